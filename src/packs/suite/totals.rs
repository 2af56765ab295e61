//! Totals of a result: over all scenes, and by family, kind of place and class of the frozen contact.

use std::collections::BTreeSet;

use serde::Serialize;

use super::result::{CaseOutcome, Drive, Played, SuiteResult};
use super::share::Share;
use crate::kernel::Digest;
use crate::sim::End;
use crate::statistics::{Estimate, PerScene, Search, estimates};

/// A row of totals. A share is of the driven scenes.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Total {
    /// `all`, `family`, `cluster` or `class`.
    pub by: &'static str,
    pub name: String,
    pub scenes: usize,
    pub driven: usize,
    /// Scenes in which the planner gave no drive.
    pub faults: usize,
    /// Scenes that this driver cannot play.
    pub unplayable: usize,
    pub crashes: Option<Share>,
    /// Contacts that the ego caused or could have avoided.
    pub preventable: Option<Share>,
    /// Contacts for which the ego is at fault by nuPlan's rule; `None` where some result does not say.
    pub at_fault: Option<Share>,
    /// Mean share of the route that was driven.
    pub completion: Option<Estimate>,
    pub arrived: Option<Share>,
    pub off_road: Option<Share>,
}

impl Total {
    /// Returns `true` if this driver can play any of its scenes.
    pub fn can_be_played(&self) -> bool {
        self.scenes == 0 || self.unplayable < self.scenes
    }

    /// Returns the share of playable scenes in which it arrived: a planner without an answer has not arrived.
    pub fn arrived_of_playable(&self) -> Option<Share> {
        Share::of(self.arrived.map_or(0, |share| share.count), self.driven + self.faults)
    }
}

/// Function that names the group of a scene.
type Names = fn(&Played) -> &str;

/// Groupings of the rows.
const BY: [(&str, Names); 3] =
    [("family", |played| &played.family), ("cluster", |played| &played.cluster), ("class", |played| &played.class)];

/// All rows, that of all scenes first.
pub fn totals(result: &SuiteResult) -> Vec<Total> {
    let all: Vec<&Played> = result.cases.iter().collect();
    let mut rows = vec![total(result, "all", "all scenes", &all)];
    for (by, name_of) in BY {
        let names: BTreeSet<&str> = result.cases.iter().map(name_of).collect();
        for name in names {
            let own: Vec<&Played> = all.iter().filter(|played| name_of(played) == name).copied().collect();
            rows.push(total(result, by, name, &own));
        }
    }
    rows
}

fn total(result: &SuiteResult, by: &'static str, name: &str, of: &[&Played]) -> Total {
    let drives: Vec<&Drive> = of.iter().filter_map(|played| played.drive()).collect();
    let share =
        |holds: &dyn Fn(&Drive) -> bool| Share::of(drives.iter().filter(|drive| holds(drive)).count(), drives.len());
    Total {
        by,
        name: name.to_string(),
        scenes: of.len(),
        driven: drives.len(),
        faults: of.iter().filter(|played| matches!(played.came, CaseOutcome::Fault { .. })).count(),
        unplayable: of.iter().filter(|played| matches!(played.came, CaseOutcome::Unplayable { .. })).count(),
        crashes: share(&|drive| drive.contact.is_some()),
        preventable: share(&Drive::is_preventable),
        at_fault: drives
            .iter()
            .map(|drive| drive.is_at_fault())
            .collect::<Option<Vec<bool>>>()
            .and_then(|known| Share::of(known.into_iter().filter(|is| *is).count(), drives.len())),
        completion: mean(result, by, name, drives.iter().map(|drive| Some(drive.completion)).collect()),
        arrived: share(&|drive| drive.end == End::Arrived),
        off_road: share(&|drive| drive.end == End::OffRoad),
    }
}

/// Returns a mean over scenes with the bootstrap of the paper's tables. Its draws are named by the suite and the row, so that two
/// drivers on the same scenes have the same draws.
pub(super) fn mean(result: &SuiteResult, by: &str, name: &str, values: Vec<Option<f64>>) -> Option<Estimate> {
    let suite = Digest::of_bytes(format!("{} {by} {name}", result.suite.digest).as_bytes());
    let quantity = vec![Search { id: suite, seeds: vec![PerScene { suite, values }] }];
    estimates(&[quantity]).pop().flatten()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::suite::fixture::{ARRIVED, CAUSED, CRASHED, FAULT, OFF_ROAD, STOOD, UNPLAYABLE, result};

    #[test]
    fn rows_count_each_scene_once_and_shares_are_of_driven_ones() {
        let result = result("a", &[ARRIVED, CRASHED, CAUSED, OFF_ROAD, STOOD, FAULT, UNPLAYABLE]);
        let rows = totals(&result);
        let all = &rows[0];
        assert_eq!((all.scenes, all.driven, all.faults, all.unplayable), (7, 5, 1, 1));
        let count = |share: &Option<Share>| share.map(|share| (share.count, share.of));
        let counts = [&all.crashes, &all.preventable, &all.at_fault, &all.arrived, &all.off_road].map(count);
        assert_eq!(counts, [Some((2, 5)), Some((1, 5)), Some((1, 5)), Some((1, 5)), Some((1, 5))]);
        assert_eq!(count(&all.arrived_of_playable()), Some((1, 6)), "a fault has not arrived");
        let completion = all.completion.unwrap();
        assert!((completion.value - (1.0 + 0.5 + 0.5 + 0.5 + 0.05) / 5.0).abs() < 1e-12, "{completion:?}");
        let [low, high] = completion.interval.unwrap();
        assert!(low < completion.value && completion.value < high);
        for by in ["family", "cluster", "class"] {
            let own = rows.iter().filter(|row| row.by == by);
            assert_eq!(own.map(|row| row.scenes).sum::<usize>(), 7, "{by}");
        }
        assert_eq!(rows.iter().filter(|row| row.by == "cluster").count(), 2);
    }

    #[test]
    fn nothing_driven_is_no_number() {
        let rows = totals(&result("a", &[FAULT, UNPLAYABLE]));
        assert_eq!((rows[0].crashes, rows[0].completion), (None, None));
    }
}
