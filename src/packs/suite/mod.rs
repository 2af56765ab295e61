//! Frozen suites: scenes with the actions of others in them, the same for every planner that is tested. The content of a suite and the
//! reading of its file, the choice of scenes, the outcome of a planner in each, and the totals. Nothing here plays a scene.

mod choice;
mod comparison;
mod content;
mod failures;
mod fault;
mod file;
#[cfg(test)]
mod fixture;
mod hardening;
mod junit;
mod mark;
mod needed;
mod result;
mod result_file;
mod share;
mod side_by_side;
mod thresholds;
mod totals;
mod whole;

pub use choice::{Candidate, PLAIN, chosen};
pub use comparison::{Compared, ComparedRow, Discordant, compared};
pub use content::{Case, Licence, Member, Sizes, Suite, class_of};
pub use failures::{Group, SEVERITY, groups, headline, kind_of, worst_first};
pub use fault::FaultKind;
pub use file::{Frozen, SuiteError, decode, encode};
pub use hardening::{Drives, Hardening, HardeningRound, Verdict, verdict};
pub use junit::junit;
pub use mark::{DriverMark, Selected, SuiteMark};
pub use result::{CaseOutcome, Drive, Met, Played, Recording, SuiteResult};
pub use result_file::{RESULT_FORMAT, is_as_sealed, result_from_bytes, result_to_bytes};
pub use share::Share;
pub use side_by_side::{Change, SideBySide, side_by_side};
pub use thresholds::{RuleResult, Thresholds, check_thresholds};
pub use totals::{Total, totals};
pub use whole::{asked, disagreements, keeps, named, selection_of};
