//! Checks that a result holds what its suite has: every case that was asked for, once, as the suite has it.

use std::collections::{BTreeMap, BTreeSet};

use super::content::{Case, Suite};
use super::mark::Selected;
use super::result::SuiteResult;

/// Most cases that a list names; the others are counted.
const NAMED_MAX: usize = 8;

/// Returns `true` if a selection includes a case.
pub fn keeps(selected: &Selected, case: &Case) -> bool {
    let is = |words: &[String], name: &str| words.is_empty() || words.iter().any(|word| word == name);
    is(&selected.family, &case.family)
        && is(&selected.cluster, &case.cluster)
        && is(&selected.class, case.class())
        && is(&selected.case, &case.id)
}

/// Returns the selection that a result was asked for. One of format 1 does not say, and is taken for whole families.
pub fn selection_of(result: &SuiteResult) -> Selected {
    let families = || result.cases.iter().map(|played| played.family.clone()).collect::<BTreeSet<String>>();
    let whole = || Selected { family: families().into_iter().collect(), ..Selected::default() };
    result.selection.clone().unwrap_or_else(whole)
}

/// Returns the cases of a suite that a result should hold.
pub fn asked<'s>(result: &SuiteResult, suite: &'s Suite) -> Vec<&'s Case> {
    let selected = selection_of(result);
    suite.cases.iter().filter(|case| keeps(&selected, case)).collect()
}

/// Returns the differences of a result from its suite, if it should hold these cases: each in words, with the cases by name.
pub fn disagreements(result: &SuiteResult, suite: &Suite, asked: &[&Case]) -> Vec<String> {
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    result.cases.iter().for_each(|played| *counts.entry(&played.case).or_insert(0) += 1);
    let due: BTreeSet<&str> = asked.iter().map(|case| case.id.as_str()).collect();
    let missing = asked.iter().map(|case| case.id.as_str()).filter(|id| !counts.contains_key(id)).collect();
    let twice = counts.iter().filter(|(_, count)| **count > 1).map(|(id, _)| *id).collect();
    let strange = counts.keys().filter(|id| !due.contains(*id)).copied().collect();
    let changed = result.cases.iter().filter(|played| {
        suite.case(&played.case).is_some_and(|case| {
            (&played.scene, &played.family, &played.cluster, played.class.as_str())
                != (&case.scene, &case.family, &case.cluster, case.class())
        })
    });
    let changed = changed.map(|played| played.case.as_str()).collect();
    let of = asked.len();
    let lists: [(&str, Vec<&str>); 4] = [
        ("are missing", missing),
        ("are there more than once", twice),
        ("are none that were asked for", strange),
        ("have another scene, family, cluster or class than in the suite", changed),
    ];
    let mut said: Vec<String> = lists
        .into_iter()
        .filter(|(_, cases)| !cases.is_empty())
        .map(|(what, cases)| format!("{} of {of} cases {what}: {}", cases.len(), named(&cases)))
        .collect();
    let order = result.cases.iter().map(|played| played.case.as_str());
    if said.is_empty() && !order.eq(asked.iter().map(|case| case.id.as_str())) {
        said.push("the cases stand in another order than in the suite".into());
    }
    said
}

/// Returns the names of the first of some cases, and the number of the others.
pub fn named(cases: &[&str]) -> String {
    let more = cases.len().saturating_sub(NAMED_MAX);
    let first = cases[..cases.len() - more].join(", ");
    if more == 0 { first } else { format!("{first} and {more} more") }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::suite::SuiteResult;
    use crate::suite::fixture::{ARRIVED, CRASHED, result, suite};

    /// A suite of cases `s0`, `s1`, .. as in results of the fixture, and a result of all of it.
    fn whole() -> (Suite, SuiteResult) {
        let mut suite = suite();
        let result = result("a", &[ARRIVED, CRASHED, ARRIVED, CRASHED]);
        let like = suite.cases.remove(0);
        let case = |played: &crate::suite::Played| Case {
            id: played.case.clone(),
            scene: played.scene.clone(),
            family: played.family.clone(),
            cluster: played.cluster.clone(),
            ..like.clone()
        };
        suite.cases = result.cases.iter().map(case).collect();
        (suite, result)
    }

    fn said(change: impl FnOnce(&mut SuiteResult)) -> String {
        let (suite, mut result) = whole();
        change(&mut result);
        disagreements(&result, &suite, &asked(&result, &suite)).join("; ")
    }

    #[test]
    fn a_whole_result_agrees_and_each_forgery_is_named_with_its_cases() {
        assert_eq!(said(|_| ()), "");
        assert_eq!(said(|of| of.cases.retain(|played| !played.crashed())), "2 of 4 cases are missing: cat:s1, cat:s3");
        assert!(
            said(|of| of.cases.push(of.cases[1].clone())).contains("1 of 4 cases are there more than once: cat:s1")
        );
        let renamed = said(|of| of.cases[1].case = "cat:s9".into());
        assert!(
            renamed.contains("are missing: cat:s1") && renamed.contains("none that were asked for: cat:s9"),
            "{renamed}"
        );
        let swapped = said(|of| {
            let other = of.cases[1].case.clone();
            of.cases[1].case = std::mem::replace(&mut of.cases[0].case, other);
        });
        assert!(
            swapped.contains("have another scene, family, cluster or class than in the suite: cat:s1, cat:s0"),
            "{swapped}"
        );
        assert!(said(|of| of.cases[2].cluster = "highway".into()).contains("another scene, family, cluster"));
        assert!(said(|of| of.cases.swap(0, 2)).contains("another order"));
    }

    #[test]
    fn a_selection_is_held_to_what_it_selects_and_an_old_result_to_whole_families() {
        let selected = |word: &str| Some(Selected { cluster: vec![word.into()], ..Selected::default() });
        let junctions = |of: &mut SuiteResult| {
            of.selection = selected("junction");
            of.cases.retain(|played| played.cluster == "junction");
        };
        assert_eq!(said(junctions), "");
        let mut fewer = said(|of| {
            junctions(of);
            of.cases.pop();
        });
        assert_eq!(fewer, "1 of 2 cases are missing: cat:s2");
        fewer = said(|of| of.selection = selected("junction"));
        assert!(fewer.contains("2 of 2 cases are none that were asked for"), "{fewer}");
        fewer = said(|of| {
            of.selection = None;
            of.cases.remove(3);
        });
        assert_eq!(fewer, "1 of 4 cases are missing: cat:s3");
    }
}
