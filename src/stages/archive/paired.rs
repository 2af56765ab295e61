//! Paired comparison of programs on the scenes on which all of them have a label. Leaving out one scene at a time shows
//! how sure a difference is (the jackknife of Quenouille and Tukey; Efron and Stein 1981).
//!
//! The protocol says what a set of labels amounts to ([`Measure`]): means over scenes in MetaDrive's, scores of groups
//! in SafeBench's. So the gates compare the same quantities that are reported as objectives.

use std::collections::BTreeMap;

use crate::kernel::num;
use crate::objects::{Difference, RealismMean, RealismSums, SceneScore, Score};

/// A difference of means below this is rounding, 1.
const ROUNDING: f64 = 1e-12;

/// Measure of a set of labels.
pub trait Measure {
    /// Means over these scenes' labels, and over all but each one of them in turn.
    fn account(&self, scenes: &[&SceneScore]) -> Account;
}

/// A program's means over the paired scenes.
#[derive(Clone, Debug, PartialEq)]
pub struct Account {
    /// Over all of them.
    pub whole: Means,
    /// Without the first, without the second, ...
    pub without: Vec<Means>,
}

/// Labels of several programs on the scenes that all of them have.
#[derive(Clone, Debug)]
pub struct Panel<'s> {
    scenes: usize,
    programs: Vec<(Vec<&'s SceneScore>, Account)>,
}

/// Means of one program.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Means {
    pub attack: f64,
    /// `None` for a program that never acts.
    pub realism: Option<f64>,
    /// Share of scenes acted in.
    pub coverage: f64,
}

impl Means {
    /// In the plane of attack and realism; `None` for a program that never acts: it has no place there.
    pub fn point(&self) -> Option<[f64; 2]> {
        self.realism.map(|realism| [self.attack, realism])
    }
}

impl<'s> Panel<'s> {
    /// Pairs programs by scene; the order of `scores` is theirs.
    pub fn of(scores: &[&'s Score], measure: &dyn Measure) -> Panel<'s> {
        let by_scene: Vec<BTreeMap<&str, &SceneScore>> = scores
            .iter()
            .map(|score| score.scenes.iter().map(|scene| (scene.scene.as_str(), scene)).collect())
            .collect();
        let first = scores.first().map(|score| score.scenes.as_slice()).unwrap_or_default();
        let shared: Vec<&str> = first
            .iter()
            .map(|scene| scene.scene.as_str())
            .filter(|id| by_scene.iter().all(|labels| labels.contains_key(id)))
            .collect();
        let program = |labels: &BTreeMap<&str, &'s SceneScore>| {
            let labels: Vec<&SceneScore> = shared.iter().map(|id| labels[id]).collect();
            let account = measure.account(&labels);
            (labels, account)
        };
        Panel { scenes: shared.len(), programs: by_scene.iter().map(program).collect() }
    }

    /// Returns how many scenes are paired.
    pub fn scenes(&self) -> usize {
        self.scenes
    }

    /// Means of a program over all paired scenes.
    pub fn means(&self, program: usize) -> Means {
        self.programs[program].1.whole
    }

    /// Returns in how many scenes two programs have different labels.
    pub fn differing(&self, one: usize, other: usize) -> usize {
        let label = |scene: &SceneScore| (scene.attack, scene.realism, scene.acted);
        let pairs = self.programs[one].0.iter().zip(&self.programs[other].0);
        pairs.filter(|(a, b)| label(a) != label(b)).count()
    }

    /// A statistic of the programs' means with its standard error.
    pub fn difference(&self, statistic: impl Fn(&dyn Fn(usize) -> Means) -> f64) -> Difference {
        let without = |scene: usize| statistic(&|program| self.programs[program].1.without[scene]);
        let left: Vec<f64> = (0..self.scenes).map(without).collect();
        let n = left.len() as f64;
        let mean = num::mean(&left).unwrap_or(0.0);
        let squares = num::sum(left.iter().map(|x| (x - mean) * (x - mean)));
        let uncertainty = (self.scenes > 1).then(|| ((n - 1.0) / n * squares).sqrt());
        Difference { value: num::stored(statistic(&|program| self.means(program))).unwrap_or(0.0), uncertainty }
    }
}

/// MetaDrive's protocol: attack is the mean over all scenes, realism as [`RealismSums`] has it, coverage the share of
/// scenes acted in.
#[derive(Clone, Copy, Debug, Default)]
pub struct MeanOverScenes {
    /// Rule for the mean of realism.
    pub mean: RealismMean,
}

impl Measure for MeanOverScenes {
    fn account(&self, scenes: &[&SceneScore]) -> Account {
        let (attack, count) = (num::sum(scenes.iter().map(|scene| scene.attack)), scenes.len());
        let realism = RealismSums::of(scenes.iter().copied());
        let without = |scene: &&SceneScore| means(attack - scene.attack, realism.without(scene), count - 1, self.mean);
        Account { whole: means(attack, realism, count, self.mean), without: scenes.iter().map(without).collect() }
    }
}

/// Of sums over `count` scenes.
fn means(attack: f64, realism: RealismSums, count: usize, mean: RealismMean) -> Means {
    let scenes = count.max(1) as f64;
    Means {
        attack: (attack / scenes).clamp(0.0, 1.0),
        realism: realism.realism(mean),
        coverage: realism.acted() as f64 / scenes,
    }
}

/// Returns `true` if a difference is above 0 at a level: the chance that noise alone shows as much is at most 1 - level
/// (one-sided, normal). A single scene shows nothing; a change that is the same in every scene is sure.
pub fn is_shown(difference: &Difference, level: f64) -> bool {
    match difference.uncertainty {
        _ if difference.value <= ROUNDING => false,
        None => false,
        Some(uncertainty) if uncertainty <= 0.0 => true,
        Some(uncertainty) => {
            0.5 * num::erfc(difference.value / (uncertainty * std::f64::consts::SQRT_2)) <= 1.0 - level
        }
    }
}

/// Scores for this room's tests.
#[cfg(test)]
pub(super) mod samples {
    use super::*;
    use crate::kernel::Digest;
    use crate::objects::Objectives;

    /// One scene a label (attack, realism, whether the program acts).
    pub fn scenes(labels: &[(f64, f64, bool)]) -> Score {
        let scene = |(i, (attack, realism, intervened)): (usize, &(f64, f64, bool))| SceneScore {
            scene: format!("scene-{i}"),
            attack: *attack,
            realism: *realism,
            contact: None,
            diagnostics: BTreeMap::new(),
            metrics: Default::default(),
            intervened: *intervened,
            by_ego: Default::default(),
            acted: *intervened,
            request: Digest::of_bytes(&[]),
            record: Digest::of_bytes(&[]),
        };
        let mean = |values: Vec<f64>| num::mean(&values).unwrap_or(0.0);
        let objectives = Objectives {
            attack: mean(labels.iter().map(|label| label.0).collect()),
            realism: mean(labels.iter().map(|label| label.1).collect()),
        };
        let acted = labels.iter().filter(|label| label.2).count();
        Score {
            objectives,
            realism_all: objectives.realism,
            coverage: acted as f64 / labels.len().max(1) as f64,
            scenes: labels.iter().enumerate().map(scene).collect(),
            failures: vec![],
            benchmark: None,
            rules: Default::default(),
        }
    }

    /// A program whose labels are the same in each of twenty scenes.
    pub fn alike([attack, realism]: [f64; 2]) -> Score {
        scenes(&[(attack, realism, true); 20])
    }
}

#[cfg(test)]
mod tests {
    use super::samples::scenes;
    use super::*;

    #[test]
    fn realism_is_of_the_scenes_acted_in_and_its_error_follows_the_ratio() {
        let score = scenes(&[(0.0, 0.5, true), (1.0, 1.0, true), (0.0, 1.0, false), (0.0, 1.0, false)]);
        let panel = Panel::of(&[&score], &MeanOverScenes::default());
        assert_eq!(panel.means(0), Means { attack: 0.25, realism: Some(0.75), coverage: 0.5 });
        // Left out one by one: 1, 0.5, 0.75, 0.75; mean 0.75, squares 2 * 0.0625, times 3/4.
        let realism = panel.difference(|means| means(0).realism.unwrap_or(0.0));
        assert!((realism.uncertainty.unwrap() - (0.75f64 * 0.125).sqrt()).abs() < 1e-12);
    }

    #[test]
    fn nudges_elsewhere_buy_no_realism() {
        let program = |elsewhere: f64| {
            let mut labels = vec![(1.0, 0.6, true), (1.0, 0.8, true)];
            labels.extend([(0.0, elsewhere, true); 18]);
            scenes(&labels)
        };
        let (honest, diluted) = (program(0.9), program(0.999));
        let panel = Panel::of(&[&honest, &diluted], &MeanOverScenes::default());
        let (honest, diluted) = (panel.means(0).realism.unwrap(), panel.means(1).realism.unwrap());
        assert!((honest - 0.7).abs() < 1e-12 && (diluted - honest).abs() < 1e-12, "{honest} {diluted}");
        let gain = panel.difference(|means| means(1).realism.unwrap_or(0.0) - means(0).realism.unwrap_or(0.0));
        assert!(!is_shown(&gain, 0.8), "{gain:?}");
        // Where the rest is the worse part, it is the rest that counts.
        let rough = program(0.5);
        let rough = Panel::of(&[&rough], &MeanOverScenes::default()).means(0).realism.unwrap();
        assert!((rough - (1.4 + 9.0) / 20.0).abs() < 1e-12, "{rough}");
    }

    #[test]
    fn a_difference_is_shown_by_its_size_against_its_error() {
        let of = |value, uncertainty| is_shown(&Difference { value, uncertainty }, 0.8);
        // The normal quantile of 0.8 is 0.8416.
        assert!(of(0.085, Some(0.1)) && !of(0.084, Some(0.1)));
        assert!(of(0.1, Some(0.0)) && !of(0.0, Some(0.0)) && !of(-0.1, Some(0.001)));
        assert!(!of(0.5, None), "one scene shows nothing");
    }
}
