//! The paper's claims against recorded runs: each a statistic, a direction and a threshold from a file; estimate and interval from the
//! tables and from counts over lineages; a verdict by one rule. Nobody types a verdict.
//!
//! The rule: a claim over several rows holds only if it holds in each. Of every row the interval gives a one-sided p (normal, with the half
//! of the interval that faces the threshold; never below one in the number of resamples). A claim's p is the largest of its rows. Over
//! all claims that can be tested, p is corrected after Holm. *Supported*: corrected p at most the level. *Not supported*: the other
//! side of the threshold is shown in some row, corrected for rows and after Holm, or the number stands on the threshold without any
//! spread. *Undecided*: neither. *Not testable here*: there is no such number.

mod file;
mod judge;
mod measure;
mod protocols;
#[cfg(test)]
mod tests;
mod text;

pub use file::{Claim, Claims, ClaimsError, Direction, read};
pub use judge::{Judged, Judgement, Part, Verdict, judge};
pub use protocols::{ClaimsUnder, Floor, side_by_side, under_protocols};
pub use text::{csv, latex, markdown};
