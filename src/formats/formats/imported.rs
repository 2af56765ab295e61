//! What the reader of a format gives, and how it leaves out what cannot be read.

use super::import_error::ImportError;
use crate::scene::{LeftOut, Scene};

/// Most parts of one file that are named when they are left out.
const NAMED_MAX: usize = 1000;

/// What one file gave. A part that cannot be read is left out by name and the rest is kept; docs/FORMAT.md has the rule.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Imported {
    /// In the order of the file.
    pub scenes: Vec<Scene>,
    /// What was left out, with its reason: the first parts by name.
    pub left_out: Vec<LeftOut>,
    /// Parts left out beyond those.
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

    /// Leaves a part out for an error in it; `kept` says what is kept all the same.
    pub fn leave_out_for(&mut self, what: impl Into<String>, error: &ImportError, kept: &str) {
        self.leave_out(&error.file, || (what.into(), error.as_part(kept)));
    }

    /// The value, or nothing where it could not be read, which is then named.
    pub fn read<T>(&mut self, what: &str, value: Result<T, ImportError>, kept: &str) -> Option<T> {
        value.map_err(|error| self.leave_out_for(what, &error, kept)).ok()
    }

    /// Takes over what another part of the file gave.
    pub fn absorb(&mut self, other: Imported) {
        self.scenes.extend(other.scenes);
        self.more += other.more;
        for LeftOut { file, what, reason } in other.left_out {
            self.leave_out(&file, || (what, reason));
        }
    }

    /// All that was left out, the number of what is not named at the end.
    pub fn listed(mut self, file: &str) -> Vec<LeftOut> {
        if self.more > 0 {
            let reason = format!("and {} more parts of this file", self.more);
            self.left_out.push(LeftOut { file: file.into(), what: String::new(), reason });
        }
        self.left_out
    }
}
