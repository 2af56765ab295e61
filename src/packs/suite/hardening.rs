//! Hardening a driver: whether other constants are better, judged on cases that their search did not see, and the results of rounds of
//! searches on both sides.

use serde::{Deserialize, Serialize};
use std::fmt::Write as _;

use super::comparison::exact_mcnemar;
use crate::kernel::game::Equilibrium;
use crate::kernel::{Digest, num};
use crate::statistics::{Estimate, PerScene, Search, estimates};

/// A difference is shown where so uneven a division of the cases has less than this chance, if both crash equally often.
pub const LEVEL: f64 = 0.05;
/// Share of the route that may be lost on plain scenes: the 95 % interval of the change lies above minus this.
pub const LOSS_MAX: f64 = 0.02;

/// Drives of a driver in some cases, in their order.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Drives {
    /// True for each case in which it met anyone.
    pub crashed: Vec<bool>,
    /// Share of the route, 0 to 1.
    pub completion: Vec<f64>,
}

impl Drives {
    pub fn crashes(&self) -> usize {
        self.crashed.iter().filter(|crashed| **crashed).count()
    }

    /// Returns the mean share of the route; 0 without cases.
    pub fn mean_completion(&self) -> f64 {
        num::mean(&self.completion).unwrap_or(0.0)
    }

    /// Returns the number of cases in which this one alone crashes.
    fn alone(&self, other: &Drives) -> usize {
        self.crashed.iter().zip(&other.crashed).filter(|(own, other)| **own && !**other).count()
    }
}

/// Decision on whether a challenger takes the champion's place, and its basis.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Verdict {
    /// Attacked cases, and crashes of champion and challenger in them.
    pub attacked: usize,
    pub crashes: [usize; 2],
    /// Cases in which the champion alone crashes, and in which the challenger alone does.
    pub alone: [usize; 2],
    /// McNemar's chance of that division, exact, two-sided.
    pub chance: f64,
    /// Plain scenes, and crashes of both in them.
    pub plain: usize,
    pub plain_crashes: [usize; 2],
    /// Challenger less champion, in share of the route on plain scenes.
    pub completion_change: Option<Estimate>,
    pub accepted: bool,
    /// Reason in words.
    pub reason: String,
}

/// Judges a challenger by attacked cases and plain scenes, champion first. It is accepted if it crashes less in the attacked cases by
/// more than chance, crashes in no more plain scenes, and loses at most `LOSS_MAX` of the route there: a driver that stands
/// still crashes seldom.
pub fn verdict([champion, champion_plain]: [&Drives; 2], [challenger, challenger_plain]: [&Drives; 2]) -> Verdict {
    let alone = [champion.alone(challenger), challenger.alone(champion)];
    let chance = exact_mcnemar(alone[0], alone[1]);
    let change: Vec<Option<f64>> = challenger_plain
        .completion
        .iter()
        .zip(&champion_plain.completion)
        .map(|(after, before)| Some(after - before))
        .collect();
    let suite = Digest::of_bytes(format!("plain scenes {}", change.len()).as_bytes());
    let search = Search { id: suite, seeds: vec![PerScene { suite, values: change }] };
    let completion_change = estimates(&[vec![search]]).into_iter().next().flatten();
    let lost = completion_change.is_none_or(|of| of.interval.map_or(of.value, |[low, _]| low) < -LOSS_MAX);
    let plain_crashes = [champion_plain.crashes(), challenger_plain.crashes()];
    let refusal = if alone[0] <= alone[1] {
        Some("it crashes no less in the attacked cases".to_string())
    } else if chance > LEVEL {
        Some(format!("so few cases fewer come by chance ({})", num::fixed(chance, 3)))
    } else if plain_crashes[1] > plain_crashes[0] {
        Some("it crashes more on plain scenes".to_string())
    } else if lost {
        Some(format!("it may lose more than {LOSS_MAX} of the route on plain scenes"))
    } else {
        None
    };
    Verdict {
        attacked: champion.crashed.len(),
        crashes: [champion.crashes(), challenger.crashes()],
        alone,
        chance,
        plain: champion_plain.crashed.len(),
        plain_crashes,
        completion_change,
        accepted: refusal.is_none(),
        reason: refusal.unwrap_or_else(|| "fewer crashes, and no loss on plain scenes".into()),
    }
}

/// Result of one round's search of constants.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct HardeningRound {
    pub round: usize,
    pub trials: usize,
    /// Crashes of champion and best trial in the cases that the search sees.
    pub searched: [usize; 2],
    pub searched_cases: usize,
    pub verdict: Verdict,
    /// Each constant that changed: its name, the champion's and the challenger's value.
    pub moved: Vec<(String, f64, f64)>,
}

/// Result of a whole hardening.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Hardening {
    pub suite: String,
    pub suite_digest: Digest,
    pub families: Vec<String>,
    pub rounds: Vec<HardeningRound>,
    /// Names of generators and of drivers.
    pub generators: Vec<String>,
    pub drivers: Vec<String>,
    /// Scenes behind each payoff: every family's program in each scene that neither search saw.
    pub rollouts: usize,
    /// Rollouts with a contact that the generator brought about: generator, then driver.
    pub payoffs: Vec<Vec<i64>>,
    pub equilibrium: Option<Equilibrium>,
}

impl Hardening {
    /// Returns the result as Markdown.
    pub fn text(&self) -> String {
        let mut out = format!(
            "# PDM-Closed hardened against {}\n\nSuite `{}`; generators of {}. Of cases and scenes a third is searched on, a third decides, a third \
             is behind the payoffs.\n\n",
            self.suite,
            self.suite_digest.short(16),
            self.families.join(", ")
        );
        out += "| round | trials | crashes searched on | attacked cases that decide: crashes | alone | chance | plain crashes | completion, change | verdict |\n";
        out += "|--:|--:|--:|--:|--:|--:|--:|--:|---|\n";
        for round in &self.rounds {
            let of = &round.verdict;
            let change = of.completion_change.map_or("–".to_string(), |of| {
                let [low, high] = of.interval.unwrap_or([of.value; 2]);
                format!("{} [{}, {}]", num::signed(of.value, 3), num::signed(low, 3), num::signed(high, 3))
            });
            let _ = writeln!(
                out,
                "| {} | {} | {} → {} of {} | {} → {} of {} | {} : {} | {} | {} → {} of {} | {change} | {}: {} |",
                round.round,
                round.trials,
                round.searched[0],
                round.searched[1],
                round.searched_cases,
                of.crashes[0],
                of.crashes[1],
                of.attacked,
                of.alone[0],
                of.alone[1],
                num::fixed(of.chance, 3),
                of.plain_crashes[0],
                of.plain_crashes[1],
                of.plain,
                if of.accepted { "taken" } else { "not taken" },
                of.reason
            );
        }
        for round in self.rounds.iter().filter(|round| !round.moved.is_empty()) {
            let moved: Vec<String> =
                round.moved.iter().map(|(name, before, after)| format!("`{name}` {before} → {after}")).collect();
            let _ = writeln!(out, "\nRound {}: {}.", round.round, moved.join(", "));
        }
        out += &self.matrix();
        out
    }

    fn matrix(&self) -> String {
        let mut out = format!(
            "\n## Payoffs\n\nShare of {} rollouts, on scenes that neither side's search saw, with a contact that the generator brought about.\n\n| \
             generators | {} | equilibrium |\n|---{}|\n",
            self.rollouts,
            self.drivers.join(" | "),
            "|--:".repeat(self.drivers.len() + 1)
        );
        let share = |count: i64| num::fixed(count as f64 / self.rollouts.max(1) as f64, 3);
        let chance = |of: Option<f64>| of.map_or("–".to_string(), |of| num::fixed(of, 3));
        for (row, (name, payoffs)) in self.generators.iter().zip(&self.payoffs).enumerate() {
            let cells: Vec<String> = payoffs.iter().map(|count| share(*count)).collect();
            let own = chance(self.equilibrium.as_ref().map(|of| of.rows[row]));
            let _ = writeln!(out, "| {name} | {} | {own} |", cells.join(" | "));
        }
        let Some(equilibrium) = &self.equilibrium else { return out };
        let columns: Vec<String> = equilibrium.columns.iter().map(|of| num::fixed(*of, 3)).collect();
        let value = num::fixed(equilibrium.value / self.rollouts.max(1) as f64, 3);
        let _ = writeln!(
            out,
            "| *equilibrium* | {} | value {value} |\n\nEquilibrium: the shares in which either side plays its rounds so that the other gains nothing by \
             another choice (zero-sum, exact).",
            columns.join(" | ")
        );
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernel::game::equilibrium;

    fn drives(crashes: usize, of: usize, completion: f64) -> Drives {
        Drives { crashed: (0..of).map(|k| k < crashes).collect(), completion: vec![completion; of] }
    }

    #[test]
    fn a_driver_that_stands_still_is_not_taken_however_seldom_it_crashes() {
        let (champion, plain) = (drives(20, 40, 0.6), drives(1, 50, 0.9));
        let standing = verdict([&champion, &plain], [&drives(2, 40, 0.05), &drives(0, 50, 0.05)]);
        assert!(!standing.accepted && standing.reason.contains("route"), "{standing:?}");
        let better = verdict([&champion, &plain], [&drives(10, 40, 0.6), &drives(1, 50, 0.89)]);
        assert!(better.accepted && better.alone == [10, 0], "{better:?}");
    }

    #[test]
    fn a_few_cases_fewer_are_chance_and_more_crashes_on_plain_scenes_a_loss() {
        let (champion, plain) = (drives(20, 40, 0.6), drives(1, 50, 0.9));
        let few = verdict([&champion, &plain], [&drives(18, 40, 0.6), &plain]);
        assert!(!few.accepted && few.reason.contains("chance"), "{few:?}");
        let crashes = verdict([&champion, &plain], [&drives(5, 40, 0.6), &drives(2, 50, 0.9)]);
        assert!(!crashes.accepted && crashes.reason.contains("plain"), "{crashes:?}");
        assert!(!verdict([&champion, &plain], [&champion, &plain]).accepted);
    }

    #[test]
    fn the_text_holds_payoffs_and_equilibrium() {
        let payoffs = vec![vec![40, 10], vec![20, 30]];
        let hardening = Hardening {
            suite: "s".into(),
            suite_digest: Digest::of_bytes(b"s"),
            families: vec!["cat".into()],
            rounds: vec![],
            generators: vec!["parents".into(), "round 1".into()],
            drivers: vec!["published".into(), "round 1".into()],
            rollouts: 100,
            equilibrium: equilibrium(&payoffs),
            payoffs,
        };
        let text = hardening.text();
        assert!(text.contains("| parents | 0.400 | 0.100 | 0.250 |") && text.contains("value 0.250"), "{text}");
    }
}
