//! Limits that a driver has to keep in a suite, and the scenes in which it did not.

use serde::{Deserialize, Serialize};

use super::result::{CaseOutcome, Played, SuiteResult};
use crate::kernel::num;
use crate::sim::End;

/// Limits of a suite. An absent one is not checked.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Thresholds {
    /// Largest share of driven scenes with a contact.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max_crash_rate: Option<f64>,
    /// Largest share of driven scenes with a contact that the ego caused or could have avoided.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max_preventable: Option<f64>,
    /// Least mean share of the route that is driven: a driver that stands still crashes seldom.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub min_completion: Option<f64>,
    /// Largest share of driven scenes in which the driver leaves the road: one that leaves it early crashes seldom, too.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max_off_road: Option<f64>,
    /// Least share of playable scenes that are driven to the end of the route without a contact.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub min_arrived: Option<f64>,
}

impl Thresholds {
    fn named(&self) -> [(&'static str, Option<f64>); 5] {
        [
            ("max_crash_rate", self.max_crash_rate),
            ("max_preventable", self.max_preventable),
            ("min_completion", self.min_completion),
            ("max_off_road", self.max_off_road),
            ("min_arrived", self.min_arrived),
        ]
    }

    /// The first limit outside 0 to 1. NaN lies in no range.
    pub fn fault(&self) -> Option<(&'static str, f64)> {
        self.named()
            .into_iter()
            .find_map(|(name, limit)| Some((name, limit?)).filter(|(_, x)| !(0.0..=1.0).contains(x)))
    }

    /// Returns these limits, and where one is absent that of the others.
    pub fn or(&self, others: &Thresholds) -> Thresholds {
        Thresholds {
            max_crash_rate: self.max_crash_rate.or(others.max_crash_rate),
            max_preventable: self.max_preventable.or(others.max_preventable),
            min_completion: self.min_completion.or(others.min_completion),
            max_off_road: self.max_off_road.or(others.max_off_road),
            min_arrived: self.min_arrived.or(others.min_arrived),
        }
    }

    pub fn is_empty(&self) -> bool {
        self.named().iter().all(|(_, limit)| limit.is_none())
    }
}

/// A rule and its result.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RuleResult {
    pub rule: &'static str,
    pub expected: String,
    pub found: String,
    pub holds: bool,
    /// The scenes that count against it, the worst first where they differ.
    pub scenes: Vec<String>,
}

/// Rules that cannot be judged.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ThresholdError {
    #[error(
        "a threshold is asked of no scene: {selected} selected, of which this driver can play none; select others, or leave the threshold out"
    )]
    Empty { selected: usize },
    #[error(
        "the baseline is a result in another suite: {found}, here {expected}; make it anew with `evodrive suite run` in this suite"
    )]
    OtherSuite { expected: String, found: String },
    #[error("the baseline holds none of the {selected} selected scenes; make it anew on all of the suite")]
    NothingShared { selected: usize },
}

/// Judges a driver's result. Every scene must have an answer in any case: a planner that gives no drive passes nowhere.
///
/// # Errors
/// A threshold without a scene that can be played; a baseline of another suite, or of other scenes.
pub fn check_thresholds(
    result: &SuiteResult,
    thresholds: &Thresholds,
    baseline: Option<&SuiteResult>,
) -> Result<Vec<RuleResult>, ThresholdError> {
    let selected = result.cases.len();
    let playable = result.cases.iter().filter(|played| !matches!(played.came, CaseOutcome::Unplayable { .. })).count();
    if playable == 0 && (!thresholds.is_empty() || baseline.is_some()) {
        return Err(ThresholdError::Empty { selected });
    }
    let mut rules = Vec::new();
    let ids = |of: Vec<&Played>| -> Vec<String> { of.into_iter().map(|played| played.case.clone()).collect() };
    let faults: Vec<&Played> =
        result.cases.iter().filter(|played| matches!(played.came, CaseOutcome::Fault { .. })).collect();
    if !faults.is_empty() {
        rules.push(RuleResult {
            rule: "answered",
            expected: "a drive in every scene".into(),
            found: format!("{} of {playable} scenes not driven", faults.len()),
            holds: false,
            scenes: ids(faults),
        });
    }
    let driven: Vec<&Played> = result.cases.iter().filter(|played| played.drive().is_some()).collect();
    let mut share = |rule: &'static str, limit: Option<f64>, counts: &dyn Fn(&Played) -> bool| {
        let Some(limit) = limit else { return };
        let against: Vec<&Played> = driven.iter().filter(|played| counts(played)).copied().collect();
        let found = (!driven.is_empty()).then(|| against.len() as f64 / driven.len() as f64);
        rules.push(RuleResult {
            rule,
            expected: format!("at most {limit}"),
            found: found.map_or("no driven scene".into(), |found| {
                format!("{found:.4} ({} of {})", against.len(), driven.len())
            }),
            holds: found.is_some_and(|found| found <= limit),
            scenes: ids(against),
        });
    };
    share("max_crash_rate", thresholds.max_crash_rate, &Played::crashed);
    share("max_preventable", thresholds.max_preventable, &|played| {
        played.drive().is_some_and(super::result::Drive::is_preventable)
    });
    share("max_off_road", thresholds.max_off_road, &|played| {
        played.drive().is_some_and(|drive| drive.end == End::OffRoad)
    });
    if let Some(limit) = thresholds.min_completion {
        rules.push(completion(&driven, limit));
    }
    if let Some(limit) = thresholds.min_arrived {
        rules.push(arrived(result, limit));
    }
    if let Some(baseline) = baseline {
        rules.push(new_failures(result, baseline)?);
    }
    Ok(rules)
}

fn completion(driven: &[&Played], limit: f64) -> RuleResult {
    let of = |played: &Played| played.drive().map_or(0.0, |drive| drive.completion);
    let found = num::mean(&driven.iter().map(|played| of(played)).collect::<Vec<f64>>());
    let mut below: Vec<&Played> = driven.iter().filter(|played| of(played) < limit).copied().collect();
    below.sort_by(|a, b| of(a).total_cmp(&of(b)));
    RuleResult {
        rule: "min_completion",
        expected: format!("at least {limit}"),
        found: found.map_or("no driven scene".into(), |found| format!("{found:.4} over {}", driven.len())),
        holds: found.is_some_and(|found| found >= limit),
        scenes: below.into_iter().map(|played| played.case.clone()).collect(),
    }
}

/// A scene without a drive has not arrived; one that cannot be played counts nowhere.
fn arrived(result: &SuiteResult, limit: f64) -> RuleResult {
    let playable = result.cases.iter().filter(|played| !matches!(played.came, CaseOutcome::Unplayable { .. }));
    let (there, missing): (Vec<&Played>, Vec<&Played>) =
        playable.partition(|played| played.drive().is_some_and(|drive| drive.end == End::Arrived));
    let all = there.len() + missing.len();
    let found = there.len() as f64 / all.max(1) as f64;
    RuleResult {
        rule: "min_arrived",
        expected: format!("at least {limit}"),
        found: format!("{found:.4} ({} of {all})", there.len()),
        holds: found >= limit,
        scenes: missing.into_iter().map(|played| played.case.clone()).collect(),
    }
}

/// Returns the scenes that fail now and are not failures in the baseline.
fn new_failures(result: &SuiteResult, baseline: &SuiteResult) -> Result<RuleResult, ThresholdError> {
    if result.suite.digest != baseline.suite.digest {
        let mark = |of: &SuiteResult| format!("{} {}", of.suite.name, of.suite.digest.short(12));
        return Err(ThresholdError::OtherSuite { expected: mark(result), found: mark(baseline) });
    }
    let shared = result.cases.iter().filter(|played| baseline.case(&played.case).is_some()).count();
    if shared == 0 {
        return Err(ThresholdError::NothingShared { selected: result.cases.len() });
    }
    let known = |played: &Played| baseline.case(&played.case).is_some_and(|before| !before.passed());
    let new: Vec<String> = result
        .cases
        .iter()
        .filter(|played| !played.passed() && !known(played))
        .map(|played| played.case.clone())
        .collect();
    let unknown = match result.cases.len() - shared {
        0 => String::new(),
        more => format!(", and {more} that the baseline does not hold"),
    };
    Ok(RuleResult {
        rule: "no_new_failures",
        expected: format!("no scene failed that {} passed", baseline.driver.name),
        found: format!("{} of {shared}{unknown}", new.len()),
        holds: new.is_empty(),
        scenes: new,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::suite::fixture::{ARRIVED, CAUSED, CRASHED, FAULT, OFF_ROAD, STOOD, UNPLAYABLE, result};

    fn broken(ends: &[usize], thresholds: Thresholds) -> Vec<(&'static str, Vec<String>)> {
        let rules = check_thresholds(&result("a", ends), &thresholds, None).unwrap();
        rules.into_iter().filter(|rule| !rule.holds).map(|rule| (rule.rule, rule.scenes)).collect()
    }

    const ALL: Thresholds = Thresholds {
        max_crash_rate: Some(0.5),
        max_preventable: Some(0.25),
        min_completion: Some(0.6),
        max_off_road: None,
        min_arrived: None,
    };

    #[test]
    fn who_leaves_the_road_before_anybody_is_met_keeps_neither_to_the_road_nor_arrives() {
        let road = Thresholds { max_off_road: Some(0.25), min_arrived: Some(0.5), ..Thresholds::default() };
        let away = broken(&[OFF_ROAD, OFF_ROAD, ARRIVED, FAULT, UNPLAYABLE], road);
        let ids = |of: &[usize]| -> Vec<String> { of.iter().map(|k| format!("cat:s{k}")).collect() };
        let expected = [("answered", ids(&[3])), ("max_off_road", ids(&[0, 1])), ("min_arrived", ids(&[0, 1, 3]))];
        assert_eq!(away, expected);
        assert!(broken(&[OFF_ROAD, ARRIVED, ARRIVED, ARRIVED], road).is_empty(), "at the limits");
        let crashes = Thresholds { max_crash_rate: Some(0.0), ..Thresholds::default() };
        assert!(broken(&[OFF_ROAD; 4], crashes).is_empty(), "the crash rate alone does not see it");
    }

    #[test]
    fn each_limit_holds_up_to_its_value_and_names_the_scenes_beyond() {
        assert!(broken(&[CRASHED, CAUSED, ARRIVED, ARRIVED], ALL).is_empty(), "at the limits, which hold");
        let more = broken(&[CRASHED, CAUSED, CAUSED, ARRIVED, ARRIVED], ALL);
        let ids = |of: &[usize]| -> Vec<String> { of.iter().map(|k| format!("cat:s{k}")).collect() };
        assert_eq!(more, [("max_crash_rate", ids(&[0, 1, 2])), ("max_preventable", ids(&[1, 2]))]);
        assert!(broken(&[CRASHED, CRASHED], Thresholds::default()).is_empty(), "nothing is asked for");
    }

    #[test]
    fn who_stands_still_keeps_no_completion_and_who_answers_nothing_passes_nowhere() {
        let still = broken(&[STOOD; 4], ALL);
        assert_eq!(still.iter().map(|(rule, _)| *rule).collect::<Vec<_>>(), ["min_completion"]);
        let only_crashes = Thresholds { max_crash_rate: Some(1.0), ..Thresholds::default() };
        assert_eq!(broken(&[FAULT; 3], only_crashes).len(), 2, "no driven scene keeps no limit");
        assert_eq!(broken(&[FAULT, ARRIVED], Thresholds::default()), [("answered", vec!["cat:s0".to_string()])]);
    }

    #[test]
    fn no_scene_is_no_evidence() {
        for ends in [&[][..], &[UNPLAYABLE, UNPLAYABLE]] {
            let empty = check_thresholds(&result("a", ends), &ALL, None);
            assert_eq!(empty, Err(ThresholdError::Empty { selected: ends.len() }));
            assert!(check_thresholds(&result("a", ends), &Thresholds::default(), None).unwrap().is_empty());
        }
        // A scene that cannot be played is no pass and no failure of the others.
        assert!(broken(&[UNPLAYABLE, ARRIVED], ALL).is_empty());
        assert_eq!(Thresholds { max_crash_rate: Some(f64::NAN), ..ALL }.fault().unwrap().0, "max_crash_rate");
        assert_eq!(ALL.or(&Thresholds::default()), ALL);
    }

    #[test]
    fn a_failure_is_new_where_the_baseline_does_not_have_it() {
        let before = result("a", &[ARRIVED, CRASHED, FAULT, ARRIVED, OFF_ROAD, UNPLAYABLE]);
        let new = |ends: &[usize]| check_thresholds(&result("b", ends), &Thresholds::default(), Some(&before)).unwrap();
        let last = |ends: &[usize]| new(ends).pop().unwrap();
        assert!(last(&[ARRIVED, CRASHED, CRASHED, STOOD, CRASHED, CRASHED]).holds, "these failed before");
        assert_eq!(last(&[OFF_ROAD, ARRIVED, ARRIVED, UNPLAYABLE]).scenes, ["cat:s0", "cat:s3"]);
        assert_eq!(last(&[ARRIVED, ARRIVED, ARRIVED, FAULT]).scenes, ["cat:s3"]);
        assert_eq!(
            last(&[ARRIVED, ARRIVED, ARRIVED, ARRIVED, ARRIVED, ARRIVED, CRASHED]).scenes,
            ["cat:s6"],
            "unknown"
        );
        let mut other = before.clone();
        other.suite.digest = crate::kernel::Digest::of_bytes(b"other");
        let refused = check_thresholds(&before, &Thresholds::default(), Some(&other)).unwrap_err();
        assert!(matches!(refused, ThresholdError::OtherSuite { .. }));
        other = SuiteResult { cases: Vec::new(), ..before.clone() };
        let refused = check_thresholds(&before, &Thresholds::default(), Some(&other)).unwrap_err();
        assert!(matches!(refused, ThresholdError::NothingShared { selected: 6 }));
    }
}
