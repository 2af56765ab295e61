//! x(c, s): the feature map of an evaluator of pairs (`[world.pairs]`), with the groups that the method's paper names: family, edit,
//! graph, scene, interaction estimates, the ego's metadata, mechanism tags, counterfactual probes, realism diagnostics that need no
//! rollout of the child, and what earlier predictions of like candidates missed.

use std::collections::BTreeSet;

use super::features::{
    CandidateView, FeatureError, SCENE, SceneView, candidate_values, check_finite, flag, mean, schema, shared_schema,
};
use crate::kernel::Digest;
use crate::objects::{
    FamilyName, FeatureColumn, FeatureGroup, FeatureSchema, GroupMean, Objectives, PairRow, Probe, SceneScore,
    WorldConfiguration, WorldFit, WorldModel, WorldRow,
};

/// Columns into which mechanism tags are hashed.
const TAGS_HASHED: usize = 16;
/// Columns of what the parent did: on the window, and in the scene.
const PARENT: [&str; 7] = [
    "parent_attack",
    "parent_realism",
    "parent_coverage",
    "parent_scene_attack",
    "parent_scene_realism",
    "parent_scene_acted",
    "parent_scene_idle_contact",
];
/// Columns of probe scenes: whether the child compiles to something else here, its parent's label where it does not, what they show.
const PROBE: [&str; 4] = ["probe_open", "probe_kept_attack", "probe_kept_realism", "probe_differing_share"];
/// Numbers of a probe that say how near and when, and those that say how it moves.
const NEAR: [&str; 4] = ["ego_distance_m_min", "conflict_s", "begins_s", "actors"];
const MOVES: [&str; 3] = ["off_road_m", "acceleration_mps2", "jerk_mps3"];
const DIAGNOSTICS: [&str; 2] = ["realism_parent_diagnostics_mean", "realism_parent_diagnostics_min"];

/// The columns of an evaluator of pairs in a run with these families and egos.
pub fn pair_schema(families: &[FamilyName], egos: &[String]) -> FeatureSchema {
    let mut schema = shared_schema(families);
    let mut add = |name: String, group| schema.columns.push(FeatureColumn { name, group });
    PARENT.iter().for_each(|name| add(name.to_string(), FeatureGroup::Parent));
    PROBE.iter().for_each(|name| add(name.to_string(), FeatureGroup::Probe));
    let of_probe = |of: &[&str]| of.iter().flat_map(|n| [format!("probe_{n}"), format!("probe_change_{n}")]).collect();
    let (near, moves): (Vec<String>, Vec<String>) = (of_probe(&NEAR), of_probe(&MOVES));
    near.into_iter().for_each(|name| add(name, FeatureGroup::Probe));
    egos.iter().collect::<BTreeSet<_>>().into_iter().for_each(|ego| add(format!("ego_{ego}"), FeatureGroup::Ego));
    ["ego_is_learned", "ego_reacts"].iter().for_each(|name| add(name.to_string(), FeatureGroup::Ego));
    add("mechanism_tags".into(), FeatureGroup::Mechanism);
    (0..TAGS_HASHED).for_each(|k| add(format!("mechanism_hashed_{k:02}"), FeatureGroup::Mechanism));
    DIAGNOSTICS.iter().for_each(|name| add(name.to_string(), FeatureGroup::Realism));
    moves.into_iter().for_each(|name| add(name, FeatureGroup::Realism));
    for of in ["family", "mechanism"] {
        for what in ["attack", "realism", "labels"] {
            add(format!("missed_{of}_{what}"), FeatureGroup::Calibration);
        }
    }
    schema
}

/// The columns of a configuration's evaluator.
pub fn schema_of(configuration: &WorldConfiguration, families: &[FamilyName], egos: &[String]) -> FeatureSchema {
    match configuration.pairs {
        Some(_) => pair_schema(families, egos),
        None => schema(families, configuration.model == WorldModel::Simulator),
    }
}

/// ξ of a candidate over the scenes of a window: a row a scene, and their means. `fit` is that of the snapshot which routes, so that what
/// earlier predictions missed rests on labels of earlier epochs alone.
///
/// # Errors
/// A family that the schema has no column for; a number that is not finite.
pub fn pair_row(
    schema: &FeatureSchema,
    candidate: &CandidateView<'_>,
    ego: &str,
    fit: Option<&WorldFit>,
    scenes: &[SceneView<'_>],
) -> Result<WorldRow, FeatureError> {
    let family = candidate.program.source_family.clone();
    let mechanism_class = candidate.mechanism_class();
    let parts = Parts::of(schema, candidate, ego, missed(fit, &family, &mechanism_class))?;
    let pairs: Vec<PairRow> = scenes.iter().map(|scene| parts.pair(candidate, scene)).collect();
    let columns = schema.columns.len();
    let features: Vec<f64> = (0..columns).map(|k| mean(pairs.iter().map(|pair| pair.features[k]))).collect();
    check_finite(schema, candidate, &features)?;
    let open = scenes.iter().filter(|scene| scene.open).count();
    let open_share = open as f64 / scenes.len().max(1) as f64;
    let parent = candidate.parent_score.objectives;
    Ok(WorldRow { features, open_share, parent, family, mechanism_class, pairs })
}

/// Keys of what earlier predictions missed.
pub(super) fn missed_keys(family: &FamilyName, mechanism_class: &str) -> [String; 2] {
    [format!("family {family}"), format!("mechanism {mechanism_class}")]
}

fn missed(fit: Option<&WorldFit>, family: &FamilyName, mechanism_class: &str) -> Vec<f64> {
    let known = fit.and_then(|fit| fit.pairs.as_ref());
    let of = |key: &String| -> [f64; 3] {
        let nothing = GroupMean { labels: 0, mean: Objectives { attack: 0.0, realism: 0.0 } };
        let group = known.and_then(|known| known.missed.get(key)).unwrap_or(&nothing);
        [group.mean.attack, group.mean.realism, f64::from(group.labels)]
    };
    missed_keys(family, mechanism_class).iter().flat_map(of).collect()
}

/// Values that are the same in all scenes of a candidate, in the order of the columns: before the scene's own numbers, and behind them.
struct Parts {
    /// Family, edit, graph.
    first: Vec<f64>,
    /// Share of probe scenes that differ, and what is near in them.
    near: Vec<f64>,
    /// Ego and mechanism tags.
    middle: Vec<f64>,
    /// How the probes move.
    moves: Vec<f64>,
    missed: Vec<f64>,
}

impl Parts {
    fn of(
        schema: &FeatureSchema,
        candidate: &CandidateView<'_>,
        ego: &str,
        missed: Vec<f64>,
    ) -> Result<Parts, FeatureError> {
        let first = candidate_values(schema, candidate)?;
        let differing: Vec<_> = candidate.probes.iter().filter(|probe| !probe.same).collect();
        let numbers = |read: &dyn Fn(&Probe) -> f64| {
            let child = mean(differing.iter().map(|probe| read(&probe.child)));
            [child, mean(differing.iter().map(|probe| read(&probe.child) - read(&probe.parent)))]
        };
        let near: [fn(&Probe) -> f64; 4] = [|p| p.ego_distance_m_min, |p| p.conflict_s, |p| p.begins_s, |p| p.actors];
        let moves: [fn(&Probe) -> f64; 3] = [|p| p.off_road_m, |p| p.acceleration_mps2, |p| p.jerk_mps3];
        let share = differing.len() as f64 / candidate.probes.len().max(1) as f64;
        let egos = schema.columns.iter().filter(|column| column.group == FeatureGroup::Ego);
        let ego_value = |name: &str| match name {
            "ego_is_learned" => flag(ego == "learned"),
            "ego_reacts" => flag(ego != "replay"),
            name => flag(name.strip_prefix("ego_") == Some(ego)),
        };
        let mut middle: Vec<f64> = egos.map(|column| ego_value(&column.name)).collect();
        middle.push(candidate.mechanism_tags.len() as f64);
        middle.extend(hashed_tags(candidate.mechanism_tags));
        Ok(Parts {
            first,
            near: std::iter::once(share).chain(near.iter().flat_map(|read| numbers(read))).collect(),
            middle,
            moves: moves.iter().flat_map(|read| numbers(read)).collect(),
            missed,
        })
    }

    fn pair(&self, candidate: &CandidateView<'_>, scene: &SceneView<'_>) -> PairRow {
        let score = candidate.parent_score;
        let label = score.scenes.iter().find(|label| label.scene == scene.id);
        let parent = label.map_or(score.objectives, |of| Objectives { attack: of.attack, realism: of.realism });
        let of_label = |read: &dyn Fn(&SceneScore) -> f64| label.map_or(0.0, read);
        let diagnostics: Vec<f64> = label.map_or(Vec::new(), |label| label.diagnostics.values().copied().collect());
        let log = scene.interaction;
        let kept = if scene.open { 0.0 } else { 1.0 };
        let mut features = self.first.clone();
        features.extend(SCENE.iter().map(|name| scene.features.value(name).unwrap_or(f64::NAN)));
        features.extend([log.relative_distance_m_min, log.relative_speed_mps]);
        features.extend([log.time_to_conflict_s_min, log.route_deviation_m_min]);
        features.extend([score.objectives.attack, score.objectives.realism, score.coverage]);
        features.extend([parent.attack, parent.realism, of_label(&|label| flag(label.acted))]);
        features.push(of_label(&|label| flag(label.attack == 0.0 && label.contact.is_some())));
        features.extend([1.0 - kept, kept * parent.attack, kept * parent.realism]);
        features.extend(&self.near);
        features.extend(&self.middle);
        let least = diagnostics.iter().copied().fold(1.0, f64::min);
        features.extend([if diagnostics.is_empty() { 1.0 } else { mean(diagnostics.iter().copied()) }, least]);
        features.extend(&self.moves);
        features.extend(&self.missed);
        PairRow { features, parent }
    }
}

/// An indicator a tag, hashed to a column.
fn hashed_tags(tags: &[String]) -> [f64; TAGS_HASHED] {
    let mut values = [0.0; TAGS_HASHED];
    for tag in tags {
        let digest = Digest::of_bytes(format!("tag {tag}").as_bytes());
        values[usize::from_str_radix(&digest.short(4), 16).unwrap_or(0) % TAGS_HASHED] = 1.0;
    }
    values
}
