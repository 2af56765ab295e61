//! Result of a format's reader, with the parts that it had to leave out.

use super::import_error::ImportError;
use crate::scene::{LeftOut, Scene};

/// Most parts of one file that are named when they are left out.
const NAMED_MAX: usize = 1000;

/// Scenes of one file. A part that cannot be read is left out by name and the rest is kept; docs/FORMAT.md has the rule.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Imported {
    /// Scenes in the order of the file.
    pub scenes: Vec<Scene>,
    /// Parts left out, with the reasons: the first ones by name.
    pub left_out: Vec<LeftOut>,
    /// Number of parts left out beyond those.
    pub more: usize,
}

impl Imported {
    /// Leaves a part out. The sentence is only made while parts are still named.
    pub fn leave_out(&mut self, file: &str, part: impl FnOnce() -> (String, String)) {
        if self.left_out.len() >= NAMED_MAX {
            self.more += 1;
            return;
        }
        let (what, reason) = part();
        self.left_out.push(LeftOut { file: file.into(), what, reason });
    }

    /// Leaves a part out for an error in it; `kept` names the rest that is still kept.
    pub fn leave_out_for(&mut self, what: impl Into<String>, error: &ImportError, kept: &str) {
        self.leave_out(&error.file, || (what.into(), error.as_part(kept)));
    }

    /// Returns the value, or `None` where it could not be read, which is then reported.
    pub fn read<T>(&mut self, what: &str, value: Result<T, ImportError>, kept: &str) -> Option<T> {
        value.map_err(|error| self.leave_out_for(what, &error, kept)).ok()
    }

    /// Takes over the results of another part of the file.
    pub fn absorb(&mut self, other: Imported) {
        self.scenes.extend(other.scenes);
        self.more += other.more;
        for LeftOut { file, what, reason } in other.left_out {
            self.leave_out(&file, || (what, reason));
        }
    }

    /// Returns all parts left out, with the number of the unnamed ones at the end.
    pub fn listed(mut self, file: &str) -> Vec<LeftOut> {
        if self.more > 0 {
            let reason = format!("and {} more parts of this file", self.more);
            self.left_out.push(LeftOut { file: file.into(), what: String::new(), reason });
        }
        self.left_out
    }
}
