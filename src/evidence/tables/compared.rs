//! Two programs of any two runs beside each other, paired by scene: what each amounts to, the difference, its interval.

use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};

use super::bootstrap::{self, Estimate, PerScene, Quantity, Search};
use super::labels::{self, Reading};
use crate::evidence::RecordedRun;
use crate::kernel::Digest;
use crate::objects::{SceneScore, SolutionId};

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
    /// Scenes in which both have it.
    pub scenes: usize,
    pub first: Estimate,
    pub second: Estimate,
    /// Second minus first, drawn scene by scene.
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
        let shared = pairs.iter().flatten().flat_map(|label| label.metrics.keys()).collect::<BTreeSet<_>>();
        let own =
            shared.into_iter().filter_map(|name| quantity(name, &|label| label.metrics.get(name).copied(), &pairs));
        let shipped = QUANTITIES.iter().filter_map(|(name, reading)| quantity(name, reading, &pairs));
        let quantities = shipped.chain(own).collect();
        let left_out = [of_first.len(), of_second.len()].map(|all| all - pairs.len());
        let (first, second) = (first.1.clone(), second.1.clone());
        Some(Comparison { first, second, on, scenes: pairs.len(), left_out, quantities })
    })
}

fn held_out<'a>(story: &'a RecordedRun, solution: &SolutionId) -> ByScene<'a> {
    let of = story.held_out.iter().filter(|of| of.solution == *solution);
    by_scene(of.flat_map(|of| &of.score.scenes))
}

/// An attempt has the labels that decided about it, a parent those of its windows.
fn evolution<'a>(story: &'a RecordedRun, solution: &SolutionId) -> ByScene<'a> {
    let attempts =
        story.attempts.iter().filter(|of| of.exit.candidate().is_some_and(|c| c.program.solution_id == *solution));
    let windows = story.frozen.iter().filter(|of| of.parent == *solution);
    let own = attempts.filter_map(|of| of.exit.score()).flat_map(|score| &score.scenes);
    by_scene(own.chain(windows.flat_map(|of| &of.parent_score.scenes)))
}

fn by_scene<'a>(labels: impl Iterator<Item = &'a SceneScore>) -> ByScene<'a> {
    labels.map(|label| (label.scene.as_str(), label)).collect()
}

/// The three estimates of a quantity, over the scenes in which both programs have it and from the same draws.
fn quantity(name: &str, reading: &dyn Fn(&SceneScore) -> Option<f64>, pairs: &[[&SceneScore; 2]]) -> Option<Compared> {
    let both: Vec<[f64; 2]> =
        pairs.iter().filter_map(|[first, second]| Some([reading(first)?, reading(second)?])).collect();
    let suite = Digest::of_bytes(b"compared");
    let of = |value: &dyn Fn(&[f64; 2]) -> f64| -> Quantity {
        let values = both.iter().map(|pair| Some(value(pair))).collect();
        vec![Search { id: suite, seeds: vec![PerScene { suite, values }] }]
    };
    let found = bootstrap::estimates(&[of(&|pair| pair[0]), of(&|pair| pair[1]), of(&|pair| pair[1] - pair[0])]);
    let [Some(first), Some(second), Some(difference)] = found[..] else { return None };
    Some(Compared { quantity: name.to_string(), scenes: both.len(), first, second, difference })
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
    fn differences_are_paired_by_scene_and_realism_is_that_of_scenes_in_which_both_act() {
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
