//! Labels of a recorded run by lineage, for the tables: held-out labels scene by scene, and what they rest on.

use std::collections::{BTreeMap, BTreeSet};

use super::basis::{Leaf, Repetition as Part};
use super::error::TableError;
use super::key::{Of, Side};
use super::paper::{
    self,
    metadrive::{METHODS, Method},
};
use super::searches::{self, Repeated, Repetition};
use super::stopped;
use crate::evaluation::SEARCH_ROLLOUTS;
use crate::evidence::recorded_run::{OWN_PLANNER, RecordedRun, kind_of};
use crate::kernel::{Digest, num};
use crate::objects::{
    LineageId, Met, ParameterValue, Role, SceneScore, Score, SolutionId,
    event::{LineageResult, RunResult},
    replay::{ReplayScene, Suite},
};
use crate::statistics::bootstrap::PerScene;

/// Parameter of a SAGE parent that names its row.
const PREFERENCE_WEIGHT: &str = "preference_weight";

/// Held-out labels of one program, by scene of the suite; `None` where a scene has no label.
#[derive(Clone, Debug)]
pub struct Labels(Vec<Option<SceneScore>>);

/// A number of a labelled scene; `None` where the scene does not count.
pub type Read = fn(&SceneScore) -> Option<f64>;

/// The same, and what it is in words.
#[derive(Clone, Copy)]
pub struct Reading {
    pub of: Read,
    pub words: &'static str,
    /// The reading in its place of runs whose realism is the plain mean over all scenes.
    plain: Option<&'static Reading>,
}

pub(super) const fn reading(words: &'static str, of: Read) -> Reading {
    Reading { of, words, plain: None }
}

impl Reading {
    /// The reading for runs whose realism is the plain mean, or for others.
    pub(super) fn by(self, plain: bool) -> Reading {
        self.plain.copied().filter(|_| plain).unwrap_or(self)
    }
}

/// a(τ).
pub const ATTACK: Reading = reading("attack", |scene| Some(scene.attack));
/// r(τ) of the scenes that the program acts in; of all where realism is the plain mean.
pub const ACTED_REALISM: Reading = Reading {
    plain: Some(&reading("realism", |scene| Some(scene.realism))),
    ..reading("realism where the program acts", |scene| scene.acted.then_some(scene.realism))
};
/// 100 (1 - r), percent, of the same scenes.
pub const PENALTY_PCT: Reading = Reading {
    plain: Some(&PENALTY_ALL_PCT),
    ..reading("100 (1 - realism) where the program acts", |scene| scene.acted.then_some(100.0 * (1.0 - scene.realism)))
};
/// The same of the scenes in which it succeeds.
pub const SUCCESS_PENALTY_PCT: Reading = reading("100 (1 - realism) where the program succeeds", |scene| {
    (scene.attack > 0.0).then_some(100.0 * (1.0 - scene.realism))
});
/// 1 if a realism diagnostic fails outright, else 0; of the scenes that the program acts in.
pub const FAILS: Reading =
    reading("1 where the program acts and some realism diagnostic is below .5, else 0 where it acts", |scene| {
        scene.acted.then_some(share(scene.fails_outright()))
    });
/// 100 (1 - r), percent, over all scenes, 0 where the program does not act: the paper's plain mean.
pub const PENALTY_ALL_PCT: Reading = reading("100 (1 - realism)", |scene| Some(100.0 * (1.0 - scene.realism)));
/// Rollouts against the ego before the program chose, of scenes that tell.
pub const LOOKS: Reading =
    reading("rollouts against the ego before the choice", |scene| scene.metrics.get(SEARCH_ROLLOUTS).copied());
/// 1 if the program acts, else 0.
pub const ACTED: Reading = reading("1 where the program acts, else 0", |scene| Some(share(scene.acted)));
/// 1 if the ego met anyone, else 0 (MetaDrive's crash flag, on which CAT's success rests).
pub const ANY_CONTACT: Reading =
    reading("1 where the ego meets anyone, else 0", |scene| over_drivers(scene, |of| of.contact.is_some()));
/// 1 if the ego met an adversary, whoever caused it, else 0 (CAT: the crash with its opponent).
pub const ADVERSARY_CONTACT: Reading =
    reading("1 where the ego meets an adversary, else 0", |scene| met(scene, |of| of.adversary));
/// 1 if it met an adversary that it also runs into in plain replay, else 0.
pub const MET_ANYWAY: Reading =
    reading("1 where the ego meets an adversary that it also meets in plain replay, else 0", |scene| {
        met(scene, |of| of.adversary && of.anyway)
    });
/// 1 if it met one and could have avoided that, else 0.
pub const AVOIDABLE_CONTACT: Reading =
    reading("1 where the ego meets an adversary and could have avoided it, else 0", |scene| {
        met(scene, |of| of.adversary && of.avoidable == Some(true))
    });

/// The share of a scene's drivers for whom something holds: of one driver 1 or 0.
pub fn over_drivers(scene: &SceneScore, holds: impl Fn(&SceneScore) -> bool) -> Option<f64> {
    num::mean(&scene.each().map(|label| share(holds(label))).collect::<Vec<f64>>())
}

/// The same of a contact.
pub fn met(scene: &SceneScore, holds: impl Fn(&Met) -> bool) -> Option<f64> {
    over_drivers(scene, |label| label.contact.as_ref().is_some_and(&holds))
}

/// 1 where something holds, else 0.
pub fn share(holds: bool) -> f64 {
    if holds { 1.0 } else { 0.0 }
}

impl Labels {
    /// Orders the labels by the scenes of a suite.
    pub fn of(score: &Score, suite: &[String]) -> Labels {
        let by_scene: BTreeMap<&str, &SceneScore> = score.scenes.iter().map(|s| (s.scene.as_str(), s)).collect();
        Labels(suite.iter().map(|id| by_scene.get(id.as_str()).map(|scene| (*scene).clone())).collect())
    }

    /// A number of every scene.
    pub fn values(&self, of: impl Fn(&SceneScore) -> Option<f64>) -> Vec<Option<f64>> {
        self.0.iter().map(|label| of(label.as_ref()?)).collect()
    }

    /// Scenes without a label.
    pub fn unlabelled(&self) -> usize {
        self.0.iter().filter(|label| label.is_none()).count()
    }
}

/// The recorded held-out scenes without a program.
#[derive(Clone, Debug)]
pub struct ReplayLabels {
    /// Place of the first run that recorded them.
    pub place: usize,
    /// Our name of the ego policy.
    pub ego: String,
    /// Digest of the held-out scenes' ids.
    pub suite: Digest,
    /// The ego as the paper calls it, or as we do; a planner by its name.
    pub policy: String,
    /// Replays by scene of the suite; `None` where a scene could not be played.
    pub scenes: Vec<Option<ReplayScene>>,
}

impl ReplayLabels {
    /// A number of every scene, tied to the suite.
    pub fn per_scene(&self, of: impl Fn(&ReplayScene) -> Option<f64>) -> PerScene {
        PerScene { suite: self.suite, values: self.scenes.iter().map(|scene| of(scene.as_ref()?)).collect() }
    }

    /// Returns its name in a row's key.
    pub fn key(&self) -> Of<String> {
        Of { run: self.place, of: self.ego.clone() }
    }
}

/// The do-nothing row of every suite and ego of these runs, in their order, each once.
pub fn replays(runs: &[RecordedRun]) -> Result<Vec<ReplayLabels>, TableError> {
    let mut all: Vec<ReplayLabels> = Vec::new();
    for (place, recorded) in runs.iter().enumerate() {
        let (names, digest) = (&recorded.opened.held_out_scenes, suite(recorded)?);
        for replayed in recorded.replays.iter().filter(|replayed| replayed.row.suite == Suite::HeldOut) {
            if all.iter().any(|known| known.suite == digest && known.ego == replayed.row.ego) {
                continue;
            }
            let measured = |id: &String| replayed.scenes.iter().find(|scene| scene.scene == *id).cloned();
            let scenes = names.iter().map(measured).collect();
            let ego = replayed.row.ego.clone();
            all.push(ReplayLabels { place, policy: policy(recorded, &ego), ego, suite: digest, scenes });
        }
    }
    Ok(all)
}

/// Digest of a run's held-out scenes.
pub fn suite(recorded: &RecordedRun) -> Result<Digest, TableError> {
    Digest::of("evodrive/held-out-suite/1", &(recorded.opened.pool, &recorded.opened.held_out_scenes))
        .map_err(|error| TableError::Canon { run: run_name(recorded), error })
}

/// One lineage of a finished run.
#[derive(Clone, Debug)]
pub struct LineageLabels {
    pub lineage: LineageId,
    /// Place of its run among those that the table is made from.
    pub place: usize,
    /// Number of this repetition of its search, from 0.
    pub replica: u32,
    /// The run's name and the beginning of its root.
    pub run: String,
    /// The paper's row that it fills, if it is one of the paper's methods as published.
    pub method: Option<&'static Method>,
    /// The search whose repetition it is: the paper's method, or the lineage's id without its ego.
    pub name: String,
    /// Name in tables: the method's name, with the id behind it where it is no method as published.
    pub label: String,
    /// Our name of the ego policy.
    pub ego: String,
    /// The ego as the paper calls it, or as we do; a planner by its name.
    pub policy: String,
    /// Digest of the held-out scenes' ids, and how many they are.
    pub suite: Digest,
    pub suite_scenes: usize,
    pub parent: Labels,
    pub evolved: Labels,
    pub endpoint: Option<Labels>,
    /// Labels of the programs that the rule chooses at the declared floors of realism, from the lowest on; empty where none are declared.
    pub at_floors: Vec<Labels>,
    /// These floors, 1.
    pub floors: Vec<f64>,
    /// Distinct rollouts that its labels rest on.
    pub rollouts: usize,
    /// Kinds of the models that proposals came from.
    pub proposals: String,
    /// Reason why there is no gain, where there is none.
    pub stopped: Option<String>,
}

impl LineageLabels {
    /// A number of every scene of one side, tied to the suite; of a change that of the scenes that count for both.
    pub fn read(&self, side: Side, of: impl Fn(&SceneScore) -> Option<f64>) -> PerScene {
        let labels = match side {
            Side::Parent => Some(&self.parent),
            Side::Evolved | Side::Change => Some(&self.evolved),
            Side::Endpoint => self.endpoint.as_ref(),
            Side::AtFloor(place) => self.at_floors.get(place),
        };
        let mut values = labels.map_or(vec![None; self.suite_scenes], |labels| labels.values(&of));
        if side == Side::Change {
            let change = |(after, before): (&Option<f64>, Option<f64>)| Some((*after)? - before?);
            values = values.iter().zip(self.parent.values(&of)).map(change).collect();
        }
        PerScene { suite: self.suite, values }
    }

    /// Its like in another run: the same lineage and ego on the same scenes.
    pub fn counterpart<'l>(&self, others: impl IntoIterator<Item = &'l LineageLabels>) -> Option<&'l LineageLabels> {
        let like = |other: &&LineageLabels| {
            (&other.lineage, other.suite, &other.ego) == (&self.lineage, self.suite, &self.ego)
        };
        others.into_iter().find(like)
    }

    /// Returns its part of a number.
    pub(super) fn part(&self, programs: Vec<SolutionId>, value: Option<f64>, leaves: Vec<Leaf>) -> Part {
        let search = format!("{} {}", self.name, self.ego);
        let part = Part::of(search, self.place, self.lineage.to_string(), value, leaves);
        Part { replica: self.replica, programs, ..part }
    }

    /// Returns its name in a row's key.
    pub fn key(&self) -> Of<LineageId> {
        Of { run: self.place, of: self.lineage.clone() }
    }

    /// Row of the main table.
    pub fn group(&self) -> String {
        self.method.map_or(self.name.clone(), |method| method.group.to_string())
    }
}

/// The run's name and the beginning of its root.
pub fn run_name(recorded: &RecordedRun) -> String {
    format!("{} ({})", recorded.opened.name, recorded.root.short(8))
}

/// Kinds of the models of the roles that propose programs, e.g. `scripted` or `openai_compatible + scripted`; `random` where they were drawn. Who is asked about scenes or descriptions is named in the run itself.
pub fn proposals(recorded: &RecordedRun) -> String {
    let asides = [Role::AttackerAgent, Role::TemplateAgent].map(Role::name);
    let models = recorded.models();
    let proposing = models.iter().filter(|(role, _)| !asides.contains(&role.as_str())).map(|(_, label)| kind_of(label));
    proposing.collect::<BTreeSet<&str>>().into_iter().collect::<Vec<_>>().join(" + ")
}

/// The result of a finished run.
pub fn result(recorded: &RecordedRun) -> Result<&RunResult, TableError> {
    recorded.result.as_ref().ok_or_else(|| TableError::Unfinished { run: run_name(recorded) })
}

impl Repeated for LineageLabels {
    fn repetition(&self) -> Repetition<'_> {
        Repetition {
            name: &self.name,
            label: &self.label,
            ego: &self.ego,
            policy: &self.policy,
            replica: self.replica,
            lineage: self.lineage.as_str(),
            run: &self.run,
            stopped: self.stopped.as_deref(),
        }
    }
}

/// The lineages of one of these runs, in their order.
pub fn of_run(runs: &[RecordedRun], place: usize) -> Result<Vec<LineageLabels>, TableError> {
    let mut all: Vec<LineageLabels> = Vec::new();
    if let Some(recorded) = runs.get(place) {
        if !recorded.rounds.is_empty() {
            let (found, tables) = ("SafeBench's protocol", "safebench-main, safebench-rounds and safebench-held-out");
            return Err(TableError::OtherProtocol { run: run_name(recorded), found, tables });
        }
        for lineage in &result(recorded)?.lineages {
            searches::add(&mut all, one(place, recorded, lineage)?)?;
        }
    }
    Ok(all)
}

fn one(place: usize, recorded: &RecordedRun, result: &LineageResult) -> Result<LineageLabels, TableError> {
    let (names, digest) = (&recorded.opened.held_out_scenes, suite(recorded)?);
    let labels = |solution: &SolutionId| {
        let measured = recorded.held_out.iter().find(|h| h.lineage == result.lineage && h.solution == *solution);
        measured.map(|held_out| Labels::of(&held_out.score, names)).ok_or_else(|| TableError::NoLabels {
            run: run_name(recorded),
            lineage: result.lineage.clone(),
            solution: solution.clone(),
        })
    };
    let published = method(recorded, result);
    // The paper has no row under a measure of the experimenter's own.
    let method = published.filter(|_| recorded.opened.attack.is_none());
    Ok(LineageLabels {
        lineage: result.lineage.clone(),
        place,
        replica: result.replica,
        run: run_name(recorded),
        method,
        name: published.map_or_else(|| stem(result).to_string(), |method| method.name.to_string()),
        label: method_label(recorded, result),
        ego: result.ego.clone(),
        policy: policy(recorded, &result.ego),
        suite: digest,
        suite_scenes: names.len(),
        parent: labels(&result.parent.solution)?,
        evolved: labels(&result.evolved.solution)?,
        endpoint: result.endpoint.as_ref().map(|endpoint| labels(&endpoint.solution)).transpose()?,
        at_floors: result.at_realism.iter().map(|of| labels(&of.chosen.solution)).collect::<Result<_, _>>()?,
        floors: result.at_realism.iter().map(|of| of.realism_min).collect(),
        rollouts: rollouts(recorded, &result.lineage),
        proposals: proposals(recorded),
        stopped: stopped::note(recorded, result),
    })
}

/// Returns the name that tables give a lineage's method in MetaDrive's protocol: the paper's name where it is as published.
pub fn method_label(recorded: &RecordedRun, result: &LineageResult) -> String {
    method(recorded, result).map_or_else(|| label(titled(result), result), |method| method.name.to_string())
}

/// An ego of a run as the paper calls it, or as we do; a planner by its name.
pub fn policy(recorded: &RecordedRun, ego: &str) -> String {
    paper::policy(recorded.ego_name(ego))
}

/// Returns the name that tables give a lineage that is no method as published: the method that it comes from, and its own id.
pub fn label(method: &str, result: &LineageResult) -> String {
    let id = Some(stem(result)).filter(|stem| *stem != result.family.as_str());
    format!("{method} ({})", id.unwrap_or(result.group.as_str()))
}

/// The name of a lineage's method: the paper's, or the family's.
fn titled(result: &LineageResult) -> &str {
    METHODS.iter().find(|method| method.family == result.family.as_str()).map_or(result.family.as_str(), |of| of.group)
}

/// The id of a lineage in the experiment file without its ego: the same for all seeds. A learned ego may stand there as its method, a
/// planner as `init` calls it.
pub fn stem(result: &LineageResult) -> &str {
    let (id, ego) = (result.group.as_str(), result.ego.as_str());
    let methods: &[&str] = match ego {
        "learned" => &["sac", "rl"],
        OWN_PLANNER => &["mine"],
        _ => &[],
    };
    let without = |ending: &&str| id.strip_suffix(ending).and_then(|rest| rest.strip_suffix('-'));
    std::iter::once(&ego).chain(methods).find_map(without).unwrap_or(id)
}

/// The paper's row: the family's own lineage from the published parent on, and for SAGE the one of its parent's preference weight. A lineage with
/// another id, such as `cat-short-idm`, is a variant with a row of its own.
fn method(recorded: &RecordedRun, result: &LineageResult) -> Option<&'static Method> {
    let family = result.family.as_str();
    let parent = recorded.parents.iter().find(|p| p.lineage == result.lineage);
    if parent.is_some_and(|parent| !parent.origins.is_empty()) {
        // It starts from a program of another run: no method as published.
        return None;
    }
    let weight = parent.and_then(|p| match p.program.parameters.get(PREFERENCE_WEIGHT) {
        Some(ParameterValue::Number(weight)) => Some(*weight),
        _ => None,
    });
    let own_id = |method: &Method| match (method.weight, stem(result).strip_prefix(family)) {
        (None, Some(rest)) => rest.is_empty(),
        (Some(_), Some(rest)) => rest.chars().all(|c| c.is_ascii_digit() || matches!(c, '-' | '.' | '_')),
        _ => false,
    };
    METHODS.iter().find(|m| m.family == family && (m.weight.is_none() || m.weight == weight) && own_id(m))
}

/// Distinct rollouts behind a lineage's recorded labels.
pub fn rollouts(recorded: &RecordedRun, lineage: &LineageId) -> usize {
    let frozen = recorded.frozen.iter().filter(|f| f.lineage == *lineage).map(|f| &f.parent_score);
    let attempts = recorded.attempts.iter().filter(|a| a.lineage == *lineage).filter_map(|a| a.exit.score());
    let finalists = recorded.finalists.iter().filter(|f| f.lineage == *lineage).map(|f| &f.score);
    let held_out = recorded.held_out.iter().filter(|h| h.lineage == *lineage).map(|h| &h.score);
    let scores = frozen.chain(attempts).chain(finalists).chain(held_out);
    let labels = scores.flat_map(|score| score.scenes.iter().flat_map(SceneScore::each));
    labels.map(|label| label.request).collect::<BTreeSet<Digest>>().len()
}
