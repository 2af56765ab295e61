//! Verdicts of several drivers about one contact.

use serde::{Deserialize, Serialize};

/// The jury's verdict on a contact: for each driver, true if it avoids the contact, or `None` where it is not defined.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Jury {
    /// Full brake and swerves after the reaction time: `contact.avoidable`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub careful: Option<bool>,
    /// UN R157, paragraph 5.2.5.2: 0.35 s after the intrusion it brakes with 6 m/s².
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reg157: Option<bool>,
    /// The competent and careful human driver of its 01 series, amendment 4, table 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub human_driver: Option<bool>,
    /// The fuzzy safety model of the same amendment.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fuzzy: Option<bool>,
}

/// Says in words how many of how many drivers avoid it.
pub fn avoided_in_words([avoid, of]: [usize; 2]) -> String {
    format!("{avoid} of {of} drivers avoid it")
}

impl Jury {
    fn all(&self) -> impl Iterator<Item = bool> {
        [self.careful, self.reg157, self.human_driver, self.fuzzy].into_iter().flatten()
    }

    /// Returns the number of drivers that avoid it.
    pub fn avoid(&self) -> usize {
        self.all().filter(|avoids| *avoids).count()
    }

    /// Returns the number of drivers that judged.
    pub fn of(&self) -> usize {
        self.all().count()
    }
}
