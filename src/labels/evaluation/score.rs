//! From rollout records to a candidate's score: means over scenes, in scene order; SafeBench's over its groups.

use std::collections::BTreeMap;

use super::metrics::{MetadriveOptions, attack, realism, safebench::SafebenchOptions};
use super::protocol::safebench::{Group, Runs, point_of, recorded_run};
use super::record::RolloutRecord;
use crate::kernel::{Digest, num};
use crate::objects::{
    AttackRequirement, LabelRules, Met, Objectives, RealismSums, Required, SceneFailure, SceneScore, Score,
    benchmark::SafebenchRun,
};

/// Metric of a label whose program was rolled out against the ego before it chose: the number of these rollouts.
pub const SEARCH_ROLLOUTS: &str = "search_rollouts";

/// One scene's labels.
pub fn scene_score(record: &RolloutRecord, request: Digest, stored: Digest, options: &MetadriveOptions) -> SceneScore {
    let acted = record.outcome.acted();
    let (diagnostics, realism) = realism::realism(&record.outcome, &options.realism);
    SceneScore {
        scene: record.scene.clone(),
        attack: if may_count(record, options) { attack::attack(&record.outcome, &options.attack) } else { 0.0 },
        realism: if acted { realism } else { 1.0 },
        acted,
        contact: met(record),
        diagnostics,
        metrics: options
            .metrics
            .iter()
            .map(|(name, of)| (name.clone(), of.value(&record.outcome)))
            .chain(record.search_rollouts().map(|rollouts| (SEARCH_ROLLOUTS.to_string(), f64::from(rollouts))))
            .collect(),
        intervened: record.intervened,
        by_ego: Default::default(),
        request,
        record: stored,
    }
}

/// Returns one run's labels in SafeBench's protocol: the contribution of the run alone. `None` for an outcome of a scene that is
/// staged for no traffic family.
pub fn staged_scene_score(
    record: &RolloutRecord,
    request: Digest,
    stored: Digest,
    options: &SafebenchOptions,
) -> Option<(SceneScore, SafebenchRun)> {
    let run = recorded_run(record, options)?;
    let [kinematics, map, interaction, distance] = run.realism.sub_scores;
    let valid = if run.realism.valid { 1.0 } else { 0.0 };
    let named = [
        ("adversary_kinematics", kinematics),
        ("adversary_map", map),
        ("adversary_interaction", interaction),
        ("adversary_distance", distance),
        ("scene_validity", valid),
    ];
    let (attack, realism) = point_of(&run);
    let score = SceneScore {
        scene: record.scene.clone(),
        attack,
        realism,
        acted: run.realism.acted,
        contact: met(record),
        diagnostics: named.into_iter().map(|(name, value)| (name.to_string(), value)).collect::<BTreeMap<_, _>>(),
        metrics: BTreeMap::new(),
        intervened: record.intervened,
        by_ego: Default::default(),
        request,
        record: stored,
    };
    Some((score, run))
}

/// Returns `true` if the event can be the program's doing. An experiment's own expression may count an event without contact: then
/// the program has to act in the scene.
fn may_count(record: &RolloutRecord, options: &MetadriveOptions) -> bool {
    match record.outcome.contact {
        None if options.attack.when.is_some() => {
            record.outcome.acted() || !options.attack.requires.has(AttackRequirement::Acts)
        }
        _ => is_brought_about(record, &options.attack.requires),
    }
}

/// Returns `true` if the program caused the ego's contact: the road user that the ego met moved differently than recorded, and the
/// ego does not run into it in plain replay. So it is no success to name a road user and leave it alone, or to nudge one that the ego
/// hits without the program. Each condition holds only where it is required.
fn is_brought_about(record: &RolloutRecord, requires: &Required<AttackRequirement>) -> bool {
    let Some(contact) = record.outcome.contact else { return false };
    let acted = |with| record.outcome.adversaries.iter().any(|adversary| adversary.actor == with && adversary.acted);
    (record.meets_anyway != Some(contact.with) || !requires.has(AttackRequirement::NotMetAnyway))
        && (acted(contact.with) || !requires.has(AttackRequirement::Acts))
}

/// The contact that ended a rollout, as labels keep it.
fn met(record: &RolloutRecord) -> Option<Met> {
    let contact = record.outcome.contact?;
    let (class, anyway) = (contact.class.name().to_string(), record.meets_anyway == Some(contact.with));
    let fault = contact.fault.map(|fault| fault.name().to_string());
    let avoided_by = contact.jury.map(|jury| [jury.avoid(), jury.of()]);
    Some(Met { adversary: contact.adversary, class, avoidable: contact.avoidable, fault, avoided_by, anyway })
}

/// F(c) = (A, R) (paper eq. prelim-objectives): attack is the empirical mean over the labelled scenes, realism that over
/// the scenes among them that the program acts in or, where that is smaller, succeeds in ([`RealismSums`]), and 0 where it
/// acts in none; the plain mean where the rules say so. `None` if no scene has a label: there is no score without evidence.
pub fn score_of(scenes: Vec<SceneScore>, failures: Vec<SceneFailure>, rules: LabelRules) -> Option<Score> {
    let mean = |value: fn(&SceneScore) -> f64| num::mean(&scenes.iter().map(value).collect::<Vec<f64>>());
    let realism = RealismSums::of(&scenes).realism(rules.mean).unwrap_or(0.0);
    let objectives = Objectives { attack: mean(|s| s.attack)?, realism };
    let (realism_all, coverage) = (mean(|s| s.realism)?, mean(|s| if s.acted { 1.0 } else { 0.0 })?);
    Some(Score { objectives, realism_all, coverage, scenes, failures, benchmark: None, rules })
}

/// A label of SafeBench's protocol with the group that it belongs to.
pub type Grouped<T> = (Group, T);

/// F(c) = (CR (1 - OS), ARS) over groups (paper eq. app-carla-objectives): collisions and realism of the scenes that the
/// program acts in, OS of all. A scene without a label makes its group less valid. `None` if no scene has a label.
pub fn benchmark_score(
    labelled: Vec<Grouped<(SceneScore, SafebenchRun)>>,
    failed: Vec<Grouped<SceneFailure>>,
) -> Option<Score> {
    let mut runs = Runs::default();
    labelled.iter().for_each(|(group, (_, run))| runs.add(*group, *run));
    failed.iter().for_each(|(group, _)| runs.add_failure(*group));
    let (benchmark, table) = (runs.benchmark()?, runs.table()?);
    let share = |x: f64| x.clamp(0.0, 1.0);
    let objectives = Objectives { attack: share(benchmark.mean.attack), realism: share(benchmark.mean.realism) };
    let scenes = labelled.into_iter().map(|(_, (scene, _))| scene).collect();
    let failures = failed.into_iter().map(|(_, failure)| failure).collect();
    let (realism_all, coverage) = (share(table.realism_all), share(table.coverage));
    let benchmark = Some(Box::new(benchmark));
    Some(Score { objectives, realism_all, coverage, scenes, failures, benchmark, rules: LabelRules::default() })
}
