//! The labels of a candidate: objectives, and the labels of each scene behind them.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

use super::benchmark::Benchmark;
use super::rules::{LabelRules, RealismMean, is_unsaid};
use crate::kernel::Digest;

/// F(c) = (A, R), both in [0, 1], larger is better (paper eq. prelim-objectives).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Objectives {
    /// A(c), 0..=1; larger is better.
    pub attack: f64,
    /// R(c), 0..=1; larger is better.
    pub realism: f64,
}

impl Objectives {
    /// The difference to another point.
    pub fn less(&self, other: &Objectives) -> Objectives {
        Objectives { attack: self.attack - other.attack, realism: self.realism - other.realism }
    }

    /// A point with both coordinates scaled.
    pub fn times(&self, factor: f64) -> Objectives {
        Objectives { attack: factor * self.attack, realism: factor * self.realism }
    }

    /// RP = 100 (1 - R), percent (paper eq. app-realism-penalty).
    pub fn realism_penalty_pct(&self) -> f64 {
        100.0 * (1.0 - self.realism)
    }

    /// Pareto dominance under maximisation: not worse in either objective, better in at least one.
    pub fn dominates(&self, other: &Objectives) -> bool {
        self.attack >= other.attack
            && self.realism >= other.realism
            && (self.attack > other.attack || self.realism > other.realism)
    }
}

/// Objectives with their evidence. Scenes that failed are listed, never scored.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Score {
    /// F(c): attack over all labelled scenes, realism as [`RealismSums`] has it. A program that acts nowhere has
    /// neither: both are 0, because there is no evidence that what it does is realistic.
    pub objectives: Objectives,
    /// Realism over all labelled scenes, those that nobody touched counting 1: the paper's plain mean.
    pub realism_all: f64,
    /// Share of the labelled scenes that the program acts in, 0..=1.
    pub coverage: f64,
    /// Labels, in the order of the scenes.
    pub scenes: Vec<SceneScore>,
    /// Scenes without a label, and why.
    pub failures: Vec<SceneFailure>,
    /// Rows of SafeBench's protocol, from which the objectives are taken; `None` in MetaDrive's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub benchmark: Option<Box<Benchmark>>,
    /// Rules by which the labels were summed up.
    #[serde(default, skip_serializing_if = "is_unsaid")]
    pub rules: LabelRules,
}

impl Score {
    /// Returns the name for people of the realism among the objectives. Each protocol has its own, so that nobody takes it for the
    /// mean over the scenes acted in.
    pub fn realism_name(&self) -> &'static str {
        realism_name(self.benchmark.is_some(), self.rules.mean)
    }
}

/// The name of an objective's realism: SafeBench's protocol has its own score.
pub const fn realism_name(safebench: bool, mean: RealismMean) -> &'static str {
    match (safebench, mean) {
        (true, _) => "ARS",
        (false, RealismMean::Strict) => "strict realism",
        (false, RealismMean::Plain) => "plain realism",
        (false, RealismMean::Sound) => "sound realism",
    }
}

/// Sums that R(c) is computed from: a program is as realistic as the scenes that it acts in, and no more so than the scenes in
/// which it succeeds. Without the second half a program could keep its successes as they are and buy realism with pushes
/// of a few centimetres elsewhere.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RealismSums {
    labelled: usize,
    realism: f64,
    acted: usize,
    acted_realism: f64,
    failing: usize,
    succeeded: usize,
    attack: f64,
    attack_realism: f64,
    attack_failing: f64,
}

impl RealismSums {
    /// Sums these labels up, in their order.
    pub fn of<'s>(scenes: impl IntoIterator<Item = &'s SceneScore>) -> RealismSums {
        let mut sums = RealismSums::default();
        scenes.into_iter().for_each(|scene| sums.add(scene));
        sums
    }

    /// Adds a label.
    pub fn add(&mut self, scene: &SceneScore) {
        self.labelled += 1;
        self.realism += scene.realism;
        if scene.acted {
            self.acted += 1;
            self.acted_realism += scene.realism;
            self.failing += usize::from(scene.fails_outright());
            if scene.attack > 0.0 {
                self.succeeded += 1;
                self.attack += scene.attack;
                self.attack_realism += scene.attack * scene.realism;
                self.attack_failing += if scene.fails_outright() { scene.attack } else { 0.0 };
            }
        }
    }

    /// Returns the sums without one of the labels.
    pub fn without(mut self, scene: &SceneScore) -> RealismSums {
        self.labelled -= 1;
        self.realism -= scene.realism;
        if scene.acted {
            self.acted -= 1;
            self.acted_realism -= scene.realism;
            self.failing -= usize::from(scene.fails_outright());
            if scene.attack > 0.0 {
                self.succeeded -= 1;
                self.attack -= scene.attack;
                self.attack_realism -= scene.attack * scene.realism;
                self.attack_failing -= if scene.fails_outright() { scene.attack } else { 0.0 };
            }
        }
        self
    }

    /// Returns the number of scenes in which the program acts.
    pub fn acted(&self) -> usize {
        self.acted
    }

    /// Mean over the scenes acted in; `None` for a program that never acts.
    pub fn acted_mean(&self) -> Option<f64> {
        (self.acted > 0).then(|| self.acted_realism / self.acted as f64)
    }

    /// Share of the scenes acted in where some diagnostic fails outright; `None` for a program that never acts.
    pub fn failing_share(&self) -> Option<f64> {
        (self.acted > 0).then(|| self.failing as f64 / self.acted as f64)
    }

    /// Returns R(c) by one of the rules.
    pub fn realism(&self, mean: RealismMean) -> Option<f64> {
        match mean {
            RealismMean::Strict => self.strict(),
            RealismMean::Sound => Some(self.strict()?.min(self.sound()?)),
            RealismMean::Plain => (self.labelled > 0).then(|| (self.realism / self.labelled as f64).clamp(0.0, 1.0)),
        }
    }

    /// The smaller one of the shares of the scenes acted in and of the successes, by their attack, where nothing fails outright.
    fn sound(&self) -> Option<f64> {
        let acted = 1.0 - self.failing_share()?;
        let succeeded = (self.succeeded > 0).then(|| 1.0 - self.attack_failing / self.attack);
        Some(succeeded.map_or(acted, |succeeded| succeeded.min(acted)).clamp(0.0, 1.0))
    }

    /// The strict realism: the smaller one of the mean over the scenes acted in and the mean over successes, each success weighing as much
    /// as its attack; the first alone where nothing succeeds. `None` for a program that never acts.
    fn strict(&self) -> Option<f64> {
        let acted = self.acted_mean()?;
        let succeeded = (self.succeeded > 0).then(|| self.attack_realism / self.attack);
        Some(succeeded.map_or(acted, |succeeded| succeeded.min(acted)).clamp(0.0, 1.0))
    }
}

/// One labelled rollout.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SceneScore {
    /// Id of the scene.
    pub scene: String,
    /// a(τ), 0..=1. Unless [`LabelRules`] say otherwise, 0 where the program does not act, and where the ego meets a road user that it
    /// also runs into without the program.
    pub attack: f64,
    /// r(τ), 0..=1; 1 where the program does not act, and counts into the objective only where it does.
    pub realism: f64,
    /// True if the motion of some adversary really differs from what replay shows.
    pub acted: bool,
    /// d_j of each realism diagnostic, 1 = satisfied.
    pub diagnostics: BTreeMap<String, f64>,
    /// Values of the metrics that the experiment declares besides.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub metrics: BTreeMap<String, f64>,
    /// The road user that the ego met, if any: the first contact, which ends the rollout.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub contact: Option<Met>,
    /// True if the program asked for an intervention in this scene.
    pub intervened: bool,
    /// Label against each driver alone, by the driver's name, where the program was played against several. Contact, request and
    /// record of this label are then those of the lineage's first driver.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub by_ego: BTreeMap<String, SceneScore>,
    /// Key of the rollout request.
    pub request: Digest,
    /// Digest of the stored rollout record.
    pub record: Digest,
}

/// A diagnostic below this fails outright.
const FAILS_BELOW: f64 = 0.5;

impl SceneScore {
    /// Returns `true` if some realism diagnostic fails outright, whatever its weight.
    pub fn fails_outright(&self) -> bool {
        self.diagnostics.values().any(|d| *d < FAILS_BELOW)
    }

    /// Returns the labels of single rollouts behind this one: itself, or one per driver.
    pub fn each(&self) -> impl Iterator<Item = &SceneScore> {
        let own = self.by_ego.is_empty().then_some(self);
        own.into_iter().chain(self.by_ego.values())
    }
}

/// The ego's contact with somebody.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Met {
    /// True for an adversary of the program, false for a road user that the program left alone.
    pub adversary: bool,
    /// Name of the simulator's contact class: who struck whom, on which side.
    pub class: String,
    /// True if the ego could have avoided it; `None` where nobody assessed that.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub avoidable: Option<bool>,
    /// The clause of nuPlan's rule that decides who is at fault, where outcomes say it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fault: Option<String>,
    /// Number of drivers that would have avoided it, and number of drivers asked, where outcomes say it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub avoided_by: Option<[usize; 2]>,
    /// True if the ego runs into the same one in plain replay.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub anyway: bool,
}

/// A scene without a label, and why.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SceneFailure {
    /// Id of the scene.
    pub scene: String,
    /// Why it has no label.
    pub reason: String,
    /// True if the driver under test took too long for a decision: neither a crash nor a success.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub too_slow: bool,
    /// True if the driver under test abandoned the scene: neither a crash nor a success.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub abandoned: bool,
}

/// Returns the number of these scenes in which the driver was too slow.
pub fn too_slow(failures: &[SceneFailure]) -> usize {
    failures.iter().filter(|failure| failure.too_slow).count()
}

/// Returns the number of these scenes that the driver abandoned.
pub fn abandoned(failures: &[SceneFailure]) -> usize {
    failures.iter().filter(|failure| failure.abandoned).count()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::objects::fixture::scene_score;

    /// A scene acted in with a diagnostic of weight .08 that holds or fails wholly, and one that is a little off.
    fn label(fails: bool) -> SceneScore {
        let light = if fails { 0.0 } else { 1.0 };
        let diagnostics = [("light".to_string(), light), ("other".to_string(), 0.5)].into();
        SceneScore { diagnostics, ..scene_score("s", 1.0, 1.0 - 0.08 * (1.0 - light)) }
    }

    #[test]
    fn a_diagnostic_of_little_weight_that_fails_in_most_scenes_leaves_no_sound_realism() {
        let mut sums = RealismSums::of(&(0..100).map(|place| label(place < 62)).collect::<Vec<_>>());
        let (strict, sound) = (sums.realism(RealismMean::Strict).unwrap(), sums.realism(RealismMean::Sound).unwrap());
        assert!(strict > 0.95 && (sound - 0.38).abs() < 1e-12, "{strict} {sound}");
        // A scene without action makes it no better, and taking a scene out removes all of it.
        sums.add(&SceneScore { acted: false, attack: 0.0, ..label(true) });
        assert_eq!(sums.failing_share(), Some(0.62));
        assert_eq!(sums.without(&label(true)).failing_share(), Some(61.0 / 99.0));
        // Without a failing diagnostic, sound realism equals strict realism.
        let clean = RealismSums::of(&[label(false)]);
        assert_eq!(clean.realism(RealismMean::Sound), clean.realism(RealismMean::Strict));
        assert_eq!(RealismSums::default().realism(RealismMean::Sound), None);
    }

    /// Pushes that achieve nothing, and are clean, are as cheap here as they are for the mean.
    #[test]
    fn nudges_elsewhere_make_no_success_sound() {
        let mut sums = RealismSums::of(&(0..10).map(|_| label(true)).collect::<Vec<_>>());
        (0..990).for_each(|_| sums.add(&SceneScore { attack: 0.0, ..label(false) }));
        assert!(sums.failing_share().unwrap() <= 0.01);
        assert_eq!(sums.realism(RealismMean::Sound), Some(0.0));
    }
}
