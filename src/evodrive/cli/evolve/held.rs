//! A run folder while a command works in it. A command that fails removes the folder that it made, unless it was interrupted or the
//! folder holds what cannot be made again.

use crate::cli::records::folder::{RunFolder, open_store};
use crate::cli::terminal::exit::{Exit, Failure};
use crate::cli::terminal::typed::resume_command;
use crate::store::{self, OwnDir, Store, StoreError};

/// A run folder that nobody else can write to until this is dropped: the lock is its store's.
pub struct Held {
    /// The folder.
    pub folder: RunFolder,
    /// Its store.
    pub objects: Store,
    /// The folder as one that this command made, if it did.
    made: Option<Made>,
    /// True if it made the folder of run folders above it, too.
    made_runs: bool,
}

/// Content of the mark of a run folder whose first command is under way.
const MADE: &str = "run";

impl Held {
    /// Opens a run folder, which is made where it is not there.
    pub fn of(folder: RunFolder) -> Result<Held, Failure> {
        let made_runs = folder.dir.parent().is_some_and(|dir| !dir.exists());
        let made = OwnDir::make(&folder.dir, MADE)?.map(Made);
        if made.is_none() && !folder.is_one()? {
            let found = "something that no run has made";
            return Err(
                StoreError::Foreign { path: folder.dir, expected: "no folder, or that of this run", found }.into()
            );
        }
        match open_store(&folder.store()) {
            Ok(objects) => Ok(Held { folder, objects, made, made_runs }),
            Err(failure) => {
                gone(&folder, made.as_ref(), made_runs);
                Err(failure.into())
            }
        }
    }

    /// Passes on the result of a command. A failed command leaves no folder that it made itself, unless it was
    /// interrupted, or `keeps` says that the folder holds what cannot be made again: then the message says how to go on.
    pub fn or_gone<T>(&self, came_to: Result<T, Failure>, keeps: fn(&RunFolder) -> bool) -> Result<T, Failure> {
        let Held { folder, made, made_runs, .. } = self;
        let failure = match came_to {
            Err(failure) if failure.exit != Exit::Interrupted => failure,
            other => return other,
        };
        if keeps(folder) {
            let go_on = resume_command(&folder.dir);
            // A failure that knows a better way has named it; and this folder belongs to the planner before its repair.
            if failure.is_planners || failure.message.contains(&go_on) {
                return Err(failure);
            }
            let message = format!("{}\n  recorded answers are kept; to continue: {go_on}", failure.message);
            return Err(Failure { message, ..failure });
        }
        gone(folder, made.as_ref(), *made_runs);
        Err(failure)
    }
}

/// A folder that a command has made: while it works there, the folder bears its mark. What it leaves then is the user's.
struct Made(OwnDir);

impl Drop for Made {
    /// One that is gone already has no mark to take off.
    fn drop(&mut self) {
        let _ = self.0.give_away();
    }
}

/// Removes what a command has made. Its failure is what is to be told, not that something is left.
fn gone(folder: &RunFolder, made: Option<&Made>, made_runs: bool) {
    if let Some(Made(made)) = made {
        let _ = made.remove();
    }
    if let (true, Some(runs)) = (made_runs, folder.dir.parent()) {
        let _ = store::remove_empty_dir(runs);
    }
}
