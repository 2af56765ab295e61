//! Two programs of any two runs beside each other, paired by scene: what each amounts to, the difference, its interval.

use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};

use super::bootstrap::{self, Estimate, PerScene, Quantity, Search};
use super::labels::{self, Reading};
use crate::evidence::RecordedRun;
use crate::kernel::Digest;
use crate::objects::{RealismSums, SceneScore, SolutionId, realism_name};

/// On which scenes two programs are compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Paired {
    HeldOut,
    Evolution,
}

/// One quantity of both programs over the scenes that are paired.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Compared {
    pub quantity: String,
    /// Scenes in which both have it: the difference is over these.
    pub scenes: usize,
    /// Each over the paired scenes in which that program has it.
    pub first: Estimate,
    pub second: Estimate,
    /// Second minus first, drawn scene by scene; of strict realism, which is no mean over scenes, the difference of the two.
    pub difference: Estimate,
}

/// Two programs on the scenes that both are labelled on.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Comparison {
    pub first: SolutionId,
    pub second: SolutionId,
    pub on: Paired,
    pub scenes: usize,
    /// Labelled scenes of each that the other has no label of: no number here rests on them.
    pub left_out: [usize; 2],
    pub quantities: Vec<Compared>,
}

const QUANTITIES: [(&str, Reading); 4] = [
    ("attack", |scene| Some(scene.attack)),
    ("realism", |scene| scene.acted.then_some(scene.realism)),
    ("coverage", labels::ACTED),
    ("any crash", labels::ANY_CONTACT),
];

/// The stricter one of the two realisms: of the scenes acted in and of the successes.
pub const STRICT_REALISM: &str = realism_name(false);

type ByScene<'a> = BTreeMap<&'a str, &'a SceneScore>;

/// Compares a program of one run with one of another; `None` where no scene has labels of both.
pub fn compared(first: (&RecordedRun, &SolutionId), second: (&RecordedRun, &SolutionId)) -> Option<Comparison> {
    let pairs = [(Paired::HeldOut, held_out as fn(_, _) -> _), (Paired::Evolution, evolution)];
    pairs.into_iter().find_map(|(on, labels)| {
        let (of_first, of_second) = (labels(first.0, first.1), labels(second.0, second.1));
        let pairs: Vec<[&SceneScore; 2]> =
            of_first.iter().filter_map(|(scene, label)| Some([*label, *of_second.get(scene)?])).collect();
        if pairs.is_empty() {
            return None;
        }
        // SafeBench's objective is ARS, over groups: the strict realism of its scenes would be a number that nobody searched by.
        let quantities = quantities(&pairs, first.0.rounds.is_empty());
        let left_out = [of_first.len(), of_second.len()].map(|all| all - pairs.len());
        let (first, second) = (first.1.clone(), second.1.clone());
        Some(Comparison { first, second, on, scenes: pairs.len(), left_out, quantities })
    })
}

/// The quantities of two programs by their labels, paired by scene; empty where no scene has labels of both.
pub fn compared_labels(first: &[SceneScore], second: &[SceneScore]) -> Vec<Compared> {
    // By name, as everywhere: the order decides which scenes a resample draws.
    let (of_first, of_second) = (by_scene(first.iter()), by_scene(second.iter()));
    let pairs: Vec<[&SceneScore; 2]> =
        of_first.iter().filter_map(|(scene, label)| Some([*label, *of_second.get(scene)?])).collect();
    if pairs.is_empty() { Vec::new() } else { quantities(&pairs, true) }
}

fn quantities(pairs: &[[&SceneScore; 2]], with_strict: bool) -> Vec<Compared> {
    let shared = pairs.iter().flatten().flat_map(|label| label.metrics.keys()).collect::<BTreeSet<_>>();
    let own = shared.into_iter().filter_map(|name| quantity(name, &|label| label.metrics.get(name).copied(), pairs));
    let shipped = QUANTITIES.iter().filter_map(|(name, reading)| quantity(name, reading, pairs));
    let strict = with_strict.then(|| strict_realism(pairs)).flatten();
    let mut quantities: Vec<Compared> = shipped.collect();
    let behind = quantities.iter().position(|row| row.quantity == "realism").map_or(quantities.len(), |at| at + 1);
    quantities.splice(behind..behind, strict);
    quantities.extend(own);
    quantities
}

fn held_out<'a>(run: &'a RecordedRun, solution: &SolutionId) -> ByScene<'a> {
    let of = run.held_out.iter().filter(|of| of.solution == *solution);
    by_scene(of.flat_map(|of| &of.score.scenes))
}

/// An attempt has the labels that decided about it, a parent those of its windows.
fn evolution<'a>(run: &'a RecordedRun, solution: &SolutionId) -> ByScene<'a> {
    let attempts =
        run.attempts.iter().filter(|of| of.exit.candidate().is_some_and(|c| c.program.solution_id == *solution));
    let windows = run.frozen.iter().filter(|of| of.parent == *solution);
    let own = attempts.filter_map(|of| of.exit.score()).flat_map(|score| &score.scenes);
    by_scene(own.chain(windows.flat_map(|of| &of.parent_score.scenes)))
}

fn by_scene<'a>(labels: impl Iterator<Item = &'a SceneScore>) -> ByScene<'a> {
    labels.map(|label| (label.scene.as_str(), label)).collect()
}

/// The stricter realism of both over the paired scenes, without intervals; `None` where one acts in none of them.
fn strict_realism(pairs: &[[&SceneScore; 2]]) -> Option<Compared> {
    let of = |at: usize| RealismSums::of(pairs.iter().map(|pair| pair[at])).realism();
    let (first, second) = (of(0)?, of(1)?);
    let [before, after, difference] = [first, second, second - first].map(Estimate::plain);
    Some(Compared {
        quantity: STRICT_REALISM.to_string(),
        scenes: pairs.len(),
        first: before,
        second: after,
        difference,
    })
}

/// The three estimates of a quantity from the same draws: each program's over the scenes in which it has it, their difference over
/// those in which both have it.
fn quantity(name: &str, reading: &dyn Fn(&SceneScore) -> Option<f64>, pairs: &[[&SceneScore; 2]]) -> Option<Compared> {
    let both: Vec<[Option<f64>; 2]> = pairs.iter().map(|pair| pair.map(reading)).collect();
    let change = |pair: &[Option<f64>; 2]| Some(pair[1]? - pair[0]?);
    let suite = Digest::of_bytes(b"compared");
    let of = |value: &dyn Fn(&[Option<f64>; 2]) -> Option<f64>| -> Quantity {
        let values = both.iter().map(value).collect();
        vec![Search { id: suite, seeds: vec![PerScene { suite, values }] }]
    };
    let estimated = bootstrap::estimates(&[of(&|pair| pair[0]), of(&|pair| pair[1]), of(&change)]);
    let [Some(first), Some(second), Some(difference)] = estimated[..] else { return None };
    Some(Compared {
        quantity: name.to_string(),
        scenes: both.iter().filter_map(change).count(),
        first,
        second,
        difference,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn label(scene: &str, attack: f64, acted: bool, realism: f64) -> SceneScore {
        SceneScore {
            scene: scene.into(),
            attack,
            realism,
            acted,
            diagnostics: BTreeMap::new(),
            metrics: Default::default(),
            contact: None,
            intervened: acted,
            request: Digest::of_bytes(b"request"),
            record: Digest::of_bytes(b"record"),
        }
    }

    #[test]
    fn differences_are_paired_by_scene_and_that_of_realism_is_over_the_scenes_in_which_both_act() {
        let scenes: Vec<String> = (0..20).map(|k| format!("s{k}")).collect();
        // Scenes differ much and programs little: unpaired intervals would hold 0 with ease.
        let first: Vec<SceneScore> =
            scenes.iter().enumerate().map(|(k, s)| label(s, (k % 2) as f64 * 0.9, k != 3, 0.8)).collect();
        let second: Vec<SceneScore> =
            scenes.iter().enumerate().map(|(k, s)| label(s, (k % 2) as f64 * 0.9 + 0.1, true, 0.7)).collect();
        let pairs: Vec<[&SceneScore; 2]> = first.iter().zip(&second).map(|(a, b)| [a, b]).collect();
        let attack = quantity("attack", &QUANTITIES[0].1, &pairs).unwrap();
        assert!((attack.first.value - 0.45).abs() < 1e-12 && (attack.difference.value - 0.1).abs() < 1e-12);
        let [low, high] = attack.difference.interval.unwrap();
        assert!(low > 0.099 && high < 0.101, "{low} {high}");
        let [low, high] = attack.first.interval.unwrap();
        assert!(high - low > 0.2, "the programs by themselves are not so sure: {low} {high}");
        let realism = quantity("realism", &QUANTITIES[1].1, &pairs).unwrap();
        assert!(realism.scenes == 19 && (realism.difference.value + 0.1).abs() < 1e-12);
        let nobody = [[&first[3], &second[3]]];
        assert!(quantity("realism", &QUANTITIES[1].1, &nobody).is_none());
    }
}
