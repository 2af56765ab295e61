//! Two drivers in the same scenes, paired: their crashes, and the chance of the difference.

use std::collections::BTreeSet;

use serde::Serialize;

use super::needed::needed;
use super::result::{Played, SuiteResult};
use super::totals::mean;
use crate::kernel::num;
use crate::statistics::Estimate;

/// Two results side by side.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Compared {
    /// A row over all shared scenes first, then one per family.
    pub rows: Vec<ComparedRow>,
    /// Scenes in which one crashed or left its route and the other did not, those that the second lost first.
    pub discordant: Vec<Discordant>,
    /// Scenes that one of both has not driven, and why.
    pub not_compared: Vec<(String, String)>,
}

/// Both drivers in some scenes; differences are second less first.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ComparedRow {
    pub name: String,
    /// Scenes that both drove.
    pub scenes: usize,
    pub first_crashes: usize,
    pub second_crashes: usize,
    /// Contacts that the driver caused or could have avoided.
    pub first_preventable: usize,
    pub second_preventable: usize,
    /// Contacts for which each is at fault by nuPlan's rule; `None` where its result does not say.
    pub at_fault: [Option<usize>; 2],
    /// Scenes in which the first alone crashed, and in which the second alone did.
    pub first_alone: usize,
    pub second_alone: usize,
    /// Chance of such a division of those scenes if both crash equally often (McNemar, exact, two-sided).
    pub chance: f64,
    pub crash_difference: Option<Estimate>,
    pub completion_difference: Option<Estimate>,
    /// Scenes that show a difference as large as this one with 80 % power; `None` where there is no difference.
    pub needed: Option<usize>,
}

/// A scene that one passed and the other did not.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Discordant {
    pub case: String,
    /// True if it is the second driver that failed.
    pub lost: bool,
    pub first: String,
    pub second: String,
}

/// Compares two results of one suite.
pub fn compared(first: &SuiteResult, second: &SuiteResult) -> Compared {
    let mut shared: Vec<(&Played, &Played)> = Vec::new();
    let (mut discordant, mut not_compared) = (Vec::new(), Vec::new());
    for a in &first.cases {
        let Some(b) = second.case(&a.case) else {
            not_compared.push((a.case.clone(), format!("{} has no result there", second.driver.name)));
            continue;
        };
        match (a.drive(), b.drive()) {
            (Some(_), Some(_)) => shared.push((a, b)),
            (driven, _) => {
                let (who, played) = if driven.is_none() { (&first.driver.name, a) } else { (&second.driver.name, b) };
                not_compared.push((a.case.clone(), format!("{who}: {}", played.in_words())));
            }
        }
        if a.passed() != b.passed() && a.drive().is_some() && b.drive().is_some() {
            let lost = a.passed();
            discordant.push(Discordant { case: a.case.clone(), lost, first: a.in_words(), second: b.in_words() });
        }
    }
    let alone = second.cases.iter().filter(|b| first.case(&b.case).is_none());
    not_compared.extend(alone.map(|b| (b.case.clone(), format!("{} has no result there", first.driver.name))));
    discordant.sort_by_key(|of| !of.lost);
    let families: BTreeSet<&str> = shared.iter().map(|(a, _)| a.family.as_str()).collect();
    let mut rows = vec![row(first, "all scenes", &shared)];
    for family in families {
        let own: Vec<(&Played, &Played)> = shared.iter().filter(|(a, _)| a.family == family).copied().collect();
        rows.push(row(first, family, &own));
    }
    Compared { rows, discordant, not_compared }
}

fn row(first: &SuiteResult, name: &str, pairs: &[(&Played, &Played)]) -> ComparedRow {
    let count = |holds: &dyn Fn(&Played, &Played) -> bool| pairs.iter().filter(|(a, b)| holds(a, b)).count();
    let (first_alone, second_alone) =
        (count(&|a, b| a.crashed() && !b.crashed()), count(&|a, b| !a.crashed() && b.crashed()));
    let difference = |of: &dyn Fn(&Played) -> f64| {
        mean(first, "compared", name, pairs.iter().map(|(a, b)| Some(of(b) - of(a))).collect())
    };
    let preventable = |played: &Played| played.drive().is_some_and(super::result::Drive::is_preventable);
    let at_fault = |side: &[&Played]| {
        let known = side.iter().map(|played| played.drive().map_or(Some(false), |drive| drive.is_at_fault()));
        Some(known.collect::<Option<Vec<bool>>>()?.into_iter().filter(|is| *is).count())
    };
    let completion = |played: &Played| played.drive().map_or(0.0, |drive| drive.completion);
    ComparedRow {
        name: name.to_string(),
        scenes: pairs.len(),
        first_crashes: count(&|a, _| a.crashed()),
        second_crashes: count(&|_, b| b.crashed()),
        first_preventable: count(&|a, _| preventable(a)),
        second_preventable: count(&|_, b| preventable(b)),
        at_fault: [
            at_fault(&pairs.iter().map(|(first, _)| *first).collect::<Vec<_>>()),
            at_fault(&pairs.iter().map(|(_, second)| *second).collect::<Vec<_>>()),
        ],
        first_alone,
        second_alone,
        chance: exact_mcnemar(first_alone, second_alone),
        crash_difference: difference(&|played| f64::from(u8::from(played.crashed()))),
        completion_difference: difference(&completion),
        needed: needed(first_alone, second_alone, pairs.len()),
    }
}

/// Returns the two-sided exact chance that of `b + c` discordant pairs this few or fewer fall on the rarer side, if both sides are equally
/// likely (McNemar 1947; the binomial in place of its approximation).
pub fn exact_mcnemar(b: usize, c: usize) -> f64 {
    let (n, least) = (b + c, b.min(c));
    // k heads of n tosses: each term from the one before, as a logarithm, since 2 to the -n soon becomes 0 as a float.
    let mut ln_term = -(n as f64) * num::ln(2.0);
    let mut tail = num::exp(ln_term);
    for k in 1..=least {
        ln_term += num::ln((n - k + 1) as f64) - num::ln(k as f64);
        tail += num::exp(ln_term);
    }
    (2.0 * tail).min(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::suite::fixture::{ARRIVED, CAUSED, CRASHED, FAULT, OFF_ROAD, STOOD, result};

    #[test]
    fn the_exact_chance_is_the_binomials() {
        // By hand: 2 (1 + 10 + 45) / 1024; 2 (1 + 6) / 64; even divisions are certain.
        let table = [(8, 2, 0.109_375), (1, 5, 0.218_75), (0, 5, 0.0625), (3, 3, 1.0), (0, 0, 1.0), (0, 1, 1.0)];
        for (b, c, chance) in table {
            assert!((exact_mcnemar(b, c) - chance).abs() < 1e-12, "{b} {c}: {}", exact_mcnemar(b, c));
            assert_eq!(exact_mcnemar(b, c), exact_mcnemar(c, b));
        }
        // R: binom.test(900, 2000)$p.value = 8.43e-06, where 2 to the -2000 is no float.
        let large = exact_mcnemar(900, 1100);
        assert!((large / 8.43e-6 - 1.0).abs() < 0.01, "{large}");
    }

    #[test]
    fn pairs_are_counted_by_scene_and_who_lost_is_named() {
        let first = result("a", &[ARRIVED, CRASHED, CRASHED, ARRIVED, FAULT, STOOD, ARRIVED]);
        let second = result("b", &[CRASHED, ARRIVED, CRASHED, OFF_ROAD, CRASHED, STOOD]);
        let compared = compared(&first, &second);
        let all = &compared.rows[0];
        assert_eq!((all.scenes, all.first_crashes, all.second_crashes), (5, 2, 2));
        assert_eq!((all.first_alone, all.second_alone, all.chance), (1, 1, 1.0));
        let lost: Vec<(&str, bool)> = compared.discordant.iter().map(|of| (of.case.as_str(), of.lost)).collect();
        assert_eq!(lost, [("cat:s0", true), ("cat:s3", true), ("cat:s1", false)]);
        let left: Vec<&str> = compared.not_compared.iter().map(|(case, _)| case.as_str()).collect();
        assert_eq!(left, ["cat:s4", "cat:s6"]);
        // Completions 1, .5, .5, 1, .05 and .5, 1, .5, .5, .05.
        let difference = all.completion_difference.unwrap();
        assert!((difference.value + 0.1).abs() < 1e-12, "{difference:?}");
    }

    #[test]
    fn as_many_crashes_may_be_fewer_preventable_ones() {
        let first = result("a", &[CAUSED, CAUSED, CRASHED, ARRIVED, CAUSED]);
        let second = result("b", &[CRASHED, CAUSED, CRASHED, ARRIVED, FAULT]);
        let all = &compared(&first, &second).rows[0];
        assert_eq!((all.first_crashes, all.second_crashes), (3, 3));
        assert_eq!((all.first_preventable, all.second_preventable), (2, 1), "in the scenes that both drove");
    }

    #[test]
    fn a_driver_beside_itself_differs_nowhere() {
        let one = result("a", &[ARRIVED, CRASHED, OFF_ROAD]);
        let same = compared(&one, &one);
        assert!(same.discordant.is_empty() && same.not_compared.is_empty());
        assert_eq!((same.rows[0].chance, same.rows[0].needed), (1.0, None));
        assert_eq!(same.rows[0].completion_difference.unwrap().interval, Some([0.0, 0.0]));
    }
}
