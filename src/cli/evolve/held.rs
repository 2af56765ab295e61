//! A run folder while a command works in it. A command that fails removes the folder that it made, unless it was interrupted or the
//! folder holds what cannot be made again.

use crate::cli::records::folder::RunFolder;
use crate::cli::terminal::exit::{Exit, Failure};
use crate::cli::terminal::typed::resume_command;
use crate::store::{self, Store};

/// A run folder that nobody else can write to until this is dropped: the lock is its store's.
pub struct Held {
    /// The folder.
    pub folder: RunFolder,
    /// Its store.
    pub objects: Store,
    /// Whether this command made the folder, and the folder of run folders above it.
    made: [bool; 2],
}

impl Held {
    /// Opens a run folder, which is made where it is not there.
    pub fn of(folder: RunFolder) -> Result<Held, Failure> {
        let made = [Some(folder.dir.as_path()), folder.dir.parent()].map(|dir| dir.is_some_and(|dir| !dir.exists()));
        store::create_dir(&folder.dir)?;
        let objects = Store::open(&folder.store())?;
        Ok(Held { folder, objects, made })
    }

    /// What a command came to. One that failed leaves no folder that it made itself, unless it was interrupted, or `keeps` says
    /// that the folder holds what cannot be made again: then the message says how to go on.
    pub fn or_gone<T>(&self, came_to: Result<T, Failure>, keeps: fn(&RunFolder) -> bool) -> Result<T, Failure> {
        let Held { folder, made: [made, made_runs], .. } = self;
        let failure = match came_to {
            Err(failure) if failure.exit != Exit::Interrupted => failure,
            other => return other,
        };
        if keeps(folder) {
            let go_on = resume_command(&folder.dir);
            // Who knows a better way has named it; and this folder is that of the planner as it was.
            if failure.is_planners || failure.message.contains(&go_on) {
                return Err(failure);
            }
            let message = format!("{}\n  recorded answers are kept; to continue: {go_on}", failure.message);
            return Err(Failure { message, ..failure });
        }
        // The failure is what is to be told, not that something is left of it.
        if *made {
            let _ = store::remove_dir(&folder.dir);
        }
        if let (true, Some(runs)) = (made_runs, folder.dir.parent()) {
            let _ = store::remove_empty_dir(runs);
        }
        Err(failure)
    }
}
