//! Folders for what is soon gone.

use std::path::{Path, PathBuf};

use crate::cli::terminal::exit::Failure;
use crate::store;

/// A folder that is gone when this is, or when the next command finds it abandoned.
pub struct Scratch {
    pub dir: PathBuf,
    _claimed: store::Claimed,
}

impl Scratch {
    /// Makes it under a folder, named by its beginning and this process, and removes there what killed commands left.
    pub fn under(place: &Path, begins: &str) -> Result<Scratch, Failure> {
        store::remove_abandoned(place, begins, "");
        let dir = place.join(format!("{begins}{}", std::process::id()));
        store::create_dir(&dir)?;
        Ok(Scratch { _claimed: store::claim(&dir)?, dir })
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        let _ = store::remove_dir(&self.dir);
    }
}
