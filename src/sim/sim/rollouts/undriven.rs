//! Reasons why a scene has no outcome, and who caused them.

use std::fmt;

use crate::sim::SimError;

/// Start of the text about a planner, after what it did.
const PLANNER: &str = "planner `";
/// The simulator's words about a driver that answers with a number that is not finite.
const NOT_FINITE: &str = "which is not finite; this is a fault of the driver";

/// The reason why there is no outcome, in words. None of them is a crash of the ego or a success.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Undriven {
    /// The driver under test took too long for a decision.
    TooSlow(String),
    /// It abandoned the scene: a decision like any other.
    Abandoned(String),
    /// Its process ended.
    Ended(String),
    /// It answered with something that is no decision.
    Junk(String),
    /// It is not to blame.
    Other(String),
}

/// Writes the text that is recorded.
impl fmt::Display for Undriven {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Undriven::TooSlow(said) => write!(out, "too slow: {said}"),
            Undriven::Abandoned(said) => write!(out, "abandoned: {said}"),
            Undriven::Ended(said) | Undriven::Junk(said) | Undriven::Other(said) => out.write_str(said),
        }
    }
}

/// Reads a recorded text; nothing else does.
impl From<String> for Undriven {
    fn from(text: String) -> Undriven {
        match text.split_once(": ") {
            _ if text.contains(NOT_FINITE) => Undriven::Junk(text),
            Some(("too slow", said)) => Undriven::TooSlow(said.into()),
            Some(("abandoned", said)) if said.starts_with(PLANNER) => Undriven::Abandoned(said.into()),
            _ if !text.starts_with(PLANNER) => Undriven::Other(text),
            _ if text.contains(": the process ended") => Undriven::Ended(text),
            _ => Undriven::Junk(text),
        }
    }
}

impl From<SimError> for Undriven {
    fn from(error: SimError) -> Undriven {
        let of = if matches!(error, SimError::Driver { .. }) { Undriven::Junk } else { Undriven::Other };
        of(error.to_string())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_recorded_text_is_read_as_what_it_was_written_as() {
        let not_finite = SimError::Driver { scene: "s".into(), step: 3, what: "a steering" };
        let no_log = SimError::NoLog { scene: "s".into(), step: 3 };
        let written = [
            Undriven::TooSlow("planner `mine`, decision 0 (0.0 s): no answer within 1 s".into()),
            Undriven::Abandoned("planner `mine`, decision 0 (0.0 s): no-lane".into()),
            Undriven::Ended("planner `mine`, decision 0 (0.0 s): the process ended".into()),
            Undriven::Junk("planner `mine`, decision 0 (0.0 s): found other fields".into()),
            not_finite.into(),
            no_log.into(),
        ];
        for why in written {
            assert_eq!(Undriven::from(why.to_string()), why);
        }
    }
}
