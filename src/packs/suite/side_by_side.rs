//! Several results in one suite side by side: the scenes in which they differ, regressions first.

use std::collections::BTreeSet;

use serde::Serialize;

use super::failures::rank;
use super::result::{Played, SuiteResult};

/// Change of a scene's outcome from the first result to the last.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Change {
    /// The first passed, the last does not.
    Lost,
    /// First and last end alike, and one between them does not.
    Between,
    /// The first did not pass, the last does.
    Won,
    /// Nobody passed.
    FailedByAll,
    /// All passed.
    PassedByAll,
    /// One of them has not driven it.
    NotCompared,
}

impl Change {
    /// All changes, in the order of a page.
    pub const ALL: [Change; 6] =
        [Change::Lost, Change::Between, Change::Won, Change::FailedByAll, Change::PassedByAll, Change::NotCompared];

    /// Returns the change as a heading.
    pub fn in_words(self) -> &'static str {
        match self {
            Change::Lost => "lost: the first passes, the last fails",
            Change::Between => "first and last alike, others not",
            Change::Won => "won: the first fails, the last passes",
            Change::FailedByAll => "failed by all",
            Change::PassedByAll => "passed by all",
            Change::NotCompared => "not driven by all",
        }
    }
}

/// A scene in all results.
#[derive(Clone, Debug, PartialEq)]
pub struct SideBySide<'r> {
    pub case: &'r str,
    pub change: Change,
    /// One entry per result; `None` where it does not have this scene.
    pub played: Vec<Option<&'r Played>>,
}

/// Returns every scene of any of the results: by its change, within that the worst failure of the last result that fails first, and
/// equal ones in the order of the suite.
pub fn side_by_side<'r>(results: &[&'r SuiteResult]) -> Vec<SideBySide<'r>> {
    let (mut seen, all) = (BTreeSet::new(), results.iter().flat_map(|result| &result.cases));
    let cases: Vec<&'r str> = all.map(|played| played.case.as_str()).filter(|case| seen.insert(*case)).collect();
    let row = |case: &'r str| {
        let played: Vec<Option<&'r Played>> = results.iter().map(|result| result.case(case)).collect();
        SideBySide { case, change: change(&played), played }
    };
    let mut rows: Vec<SideBySide<'r>> = cases.into_iter().map(row).collect();
    let worst = |of: &SideBySide<'_>| {
        of.played.iter().rev().flatten().find_map(|played| rank(played)).unwrap_or((u8::MAX, 0.0))
    };
    rows.sort_by(|a, b| {
        let (x, y) = (worst(a), worst(b));
        a.change.cmp(&b.change).then(x.0.cmp(&y.0)).then(x.1.total_cmp(&y.1))
    });
    rows
}

fn change(played: &[Option<&Played>]) -> Change {
    let Some(passed) =
        played.iter().map(|of| of.filter(|of| of.drive().is_some()).map(Played::passed)).collect::<Option<Vec<bool>>>()
    else {
        return Change::NotCompared;
    };
    match (passed.first(), passed.last()) {
        (Some(true), Some(false)) => Change::Lost,
        (Some(false), Some(true)) => Change::Won,
        _ if passed.iter().all(|passed| *passed) => Change::PassedByAll,
        _ if passed.iter().all(|passed| !*passed) => Change::FailedByAll,
        _ => Change::Between,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::suite::CaseOutcome;
    use crate::suite::fixture::{ARRIVED, CAUSED, CRASHED, FAULT, OFF_ROAD, result};

    #[test]
    fn regressions_come_first_the_worst_of_them_before_all() {
        let first = result("a", &[ARRIVED, ARRIVED, CRASHED, ARRIVED, ARRIVED, CRASHED, FAULT, ARRIVED]);
        let second = result("b", &[ARRIVED, ARRIVED, ARRIVED, ARRIVED, CRASHED, CRASHED, ARRIVED, ARRIVED]);
        let mut third = result("c", &[OFF_ROAD, CRASHED, ARRIVED, CAUSED, ARRIVED, CRASHED, ARRIVED, ARRIVED]);
        // Faster, and not preventable: less bad than the slower one that is.
        if let CaseOutcome::Driven(drive) = &mut third.cases[1].came {
            drive.contact.as_mut().unwrap().relative_speed_mps = 30.0;
        }
        let rows = side_by_side(&[&first, &second, &third]);
        let told: Vec<(&str, Change)> = rows.iter().map(|of| (of.case, of.change)).collect();
        let expected = [
            ("cat:s3", Change::Lost),
            ("cat:s1", Change::Lost),
            ("cat:s0", Change::Lost),
            ("cat:s4", Change::Between),
            ("cat:s2", Change::Won),
            ("cat:s5", Change::FailedByAll),
            ("cat:s7", Change::PassedByAll),
            ("cat:s6", Change::NotCompared),
        ];
        assert_eq!(told, expected);
        assert!(rows.iter().all(|of| of.played.len() == 3));
    }

    #[test]
    fn a_scene_that_one_result_has_alone_is_not_compared() {
        let (first, second) = (result("a", &[ARRIVED]), result("b", &[ARRIVED, CRASHED]));
        let rows = side_by_side(&[&first, &second]);
        assert_eq!((rows[1].case, rows[1].change, rows[1].played[0]), ("cat:s1", Change::NotCompared, None));
    }
}
