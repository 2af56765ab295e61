//! The failures of a result, worst first, and their number by kind. A preventable contact is worse than any other contact, that is worse
//! than a way off the route, and no drive comes last; of equal ones the faster contact is worse.

use std::collections::BTreeMap;

use serde::Serialize;

use super::result::{CaseOutcome, Played, SuiteResult};
use crate::kernel::num;
use crate::sim::Timeline;
use crate::sim::timeline_text::{manner, response};

/// Order of a list of failures, for readers.
pub const SEVERITY: &str = "worst first: preventable contacts, other contacts, ways off the route, no drive; of equal ones by relative speed at the contact";

/// Failures of one kind.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Group {
    /// Kind in words, without what differs between its failures.
    pub kind: String,
    pub preventable: bool,
    /// Median time for which the threat was seen before the contact, s, over the drives that saw it.
    pub seen_s: Option<f64>,
    /// Largest relative speed of their contacts, m/s.
    pub speed_mps_max: Option<f64>,
    /// Cases, worst first.
    pub cases: Vec<String>,
}

/// Returns the rank of a failure: the smaller, the worse; `None` for a scene that is no failure.
pub(super) fn rank(played: &Played) -> Option<(u8, f64)> {
    match &played.came {
        CaseOutcome::Driven(_) if played.passed() => None,
        CaseOutcome::Driven(drive) => Some(match drive.contact {
            Some(met) if drive.is_preventable() => (0, -met.relative_speed_mps),
            Some(met) => (1, -met.relative_speed_mps),
            None => (2, 0.0),
        }),
        CaseOutcome::Fault { .. } => Some((3, 0.0)),
        CaseOutcome::Unplayable { .. } => None,
    }
}

/// Returns the failures, worst first; equal ones in the order of the suite.
pub fn worst_first(result: &SuiteResult) -> Vec<&Played> {
    let mut failed: Vec<((u8, f64), &Played)> =
        result.cases.iter().filter_map(|played| Some((rank(played)?, played))).collect();
    failed.sort_by(|(a, _), (b, _)| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
    failed.into_iter().map(|(_, played)| played).collect()
}

/// Returns the description that a failure shares with others of its kind; `None` for a scene that is no failure.
pub fn kind_of(played: &Played) -> Option<String> {
    rank(played)?;
    Some(match &played.came {
        CaseOutcome::Fault { kind, .. } => format!("no drive: {}", kind.name()),
        CaseOutcome::Unplayable { .. } => return None,
        CaseOutcome::Driven(drive) => match (drive.contact, &played.timeline) {
            (None, _) => "left its route".to_string(),
            (Some(met), None) => manner(met.class, None),
            // The driver's response matters where it could have prevented the contact, and little for a ram.
            (Some(met), Some(of)) if drive.is_preventable() => {
                format!("{}, {}, {}", manner(met.class, Some(of)), seen(of), response(of))
            }
            (Some(met), Some(of)) => format!("{}, {}", manner(met.class, Some(of)), seen(of)),
        },
    })
}

fn seen(timeline: &Timeline) -> &'static str {
    if timeline.visible_s.is_some() { "seen" } else { "never seen" }
}

/// The failures by kind, the kind of the worst first.
pub fn groups(result: &SuiteResult) -> Vec<Group> {
    let mut groups: Vec<(Group, Vec<f64>)> = Vec::new();
    let mut places: BTreeMap<(bool, String), usize> = BTreeMap::new();
    for played in worst_first(result) {
        let Some(kind) = kind_of(played) else { continue };
        let preventable = played.drive().is_some_and(super::result::Drive::is_preventable);
        let place = *places.entry((preventable, kind.clone())).or_insert_with(|| {
            let speed_mps_max = played.drive().and_then(|drive| drive.contact).map(|met| met.relative_speed_mps);
            groups.push((Group { kind, preventable, seen_s: None, speed_mps_max, cases: Vec::new() }, Vec::new()));
            groups.len() - 1
        });
        let (group, seen) = &mut groups[place];
        group.cases.push(played.case.clone());
        seen.extend(played.timeline.as_ref().and_then(|of| Some(of.contact_s - of.visible_s?)));
    }
    let whole = |(group, mut seen): (Group, Vec<f64>)| {
        seen.sort_by(f64::total_cmp);
        Group { seen_s: seen.get(seen.len() / 2).copied(), ..group }
    };
    groups.into_iter().map(whole).collect()
}

impl Group {
    /// Returns the kind with the time for which the threat was seen before the contact.
    pub fn in_words(&self) -> String {
        match self.seen_s {
            Some(seen_s) => self.kind.replacen(", seen", &format!(", seen {} s", num::fixed(seen_s, 1)), 1),
            None => self.kind.clone(),
        }
    }
}

/// Returns the most frequent failure in a line; empty where nothing failed.
pub fn headline(groups: &[Group]) -> String {
    let of = |preventable: bool| {
        let own: Vec<&Group> = groups.iter().filter(|group| group.preventable == preventable).collect();
        let all: usize = own.iter().map(|group| group.cases.len()).sum();
        let most = own.into_iter().reduce(|most, of| if of.cases.len() > most.cases.len() { of } else { most })?;
        let word = if preventable { "preventable" } else { "other" };
        Some(match most.cases.len() {
            count if count == all => format!("{all} {word}: {}", most.in_words()),
            count => format!("{all} {word}, {count} of one kind: {}", most.in_words()),
        })
    };
    [true, false].into_iter().filter_map(of).collect::<Vec<_>>().join("; ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim::{Chance, ContactClass, Manoeuvre, Reacted, Reaction, Side};
    use crate::suite::fixture::{ARRIVED, CAUSED, CRASHED, FAULT, OFF_ROAD, UNPLAYABLE, result};

    fn seen(before_s: f64, from: Side, braked_before_s: Option<f64>) -> Timeline {
        let last = |by| Chance { by, last_s: (by == Manoeuvre::Brake).then_some(2.0) };
        Timeline {
            contact_s: 3.5,
            visible_s: Some(3.5 - before_s),
            reaction: braked_before_s.map(|before_s| Reaction { at_s: 3.5 - before_s, by: Reacted::Braked }),
            braked_mps2_max: 0.0,
            from,
            chances: Manoeuvre::ALL.map(last).to_vec(),
        }
    }

    /// Returns a result whose failures each have a speed and a time line.
    fn failed() -> SuiteResult {
        let mut result = result("a", &[FAULT, CRASHED, CAUSED, OFF_ROAD, ARRIVED, CAUSED, CAUSED, UNPLAYABLE, CAUSED]);
        let timelines = [
            (1, 14.0, seen(2.0, Side::Front, None)),
            (2, 3.0, seen(2.4, Side::Right, None)),
            (5, 9.0, seen(2.0, Side::Left, None)),
            (6, 7.0, seen(1.8, Side::Right, None)),
            (8, 5.0, seen(2.1, Side::Right, Some(0.4))),
        ];
        for (k, speed_mps, timeline) in timelines {
            if let CaseOutcome::Driven(drive) = &mut result.cases[k].came
                && let Some(met) = &mut drive.contact
            {
                met.relative_speed_mps = speed_mps;
                if k != 1 {
                    met.class = ContactClass::Crossing;
                }
            }
            result.cases[k].timeline = Some(timeline);
        }
        result
    }

    #[test]
    fn preventable_contacts_come_before_faster_ones_that_are_not_and_the_faster_before_the_slower() {
        let result = failed();
        let order: Vec<&str> = worst_first(&result).iter().map(|played| played.case.as_str()).collect();
        assert_eq!(order, ["cat:s5", "cat:s6", "cat:s8", "cat:s2", "cat:s1", "cat:s3", "cat:s0"]);
    }

    #[test]
    fn failures_of_one_kind_are_counted_together_and_others_apart() {
        let groups = groups(&failed());
        let told: Vec<(String, Vec<&str>)> =
            groups.iter().map(|of| (of.in_words(), of.cases.iter().map(String::as_str).collect())).collect();
        let expected = [
            ("crossing from the left, seen 2.0 s, no reaction", vec!["cat:s5"]),
            ("crossing from the right, seen 2.4 s, no reaction", vec!["cat:s6", "cat:s2"]),
            ("crossing from the right, seen 2.1 s, braked too late", vec!["cat:s8"]),
            ("head on, seen 2.0 s", vec!["cat:s1"]),
            ("left its route", vec!["cat:s3"]),
            ("no drive: too slow", vec!["cat:s0"]),
        ];
        let expected: Vec<(String, Vec<&str>)> =
            expected.into_iter().map(|(kind, cases)| (kind.to_string(), cases)).collect();
        assert_eq!(told, expected);
        assert_eq!(
            headline(&groups),
            "4 preventable, 2 of one kind: crossing from the right, seen 2.4 s, no reaction; 3 other, 1 of one kind: head on, seen 2.0 s"
        );
        assert_eq!(headline(&[]), "");
    }
}
