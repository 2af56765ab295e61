//! The feature map: a candidate's family, edit and graph, the scenes of its window, what its parent did there, and what is
//! known of its compiled interventions without a rollout. One row a candidate: numbers of scenes are means over the scenes
//! that are open, in which the child may differ from its parent.

use std::collections::BTreeSet;

use crate::kernel::{Digest, num};
use crate::objects::{
    FamilyName, FeatureColumn, FeatureGroup, FeatureSchema, Objectives, OperationKind, ParameterValue, ProbePair,
    Program, ProgramPatch, SceneScore, Score, Slot, WorldRow,
};
use crate::scene::SceneFeatures;

use super::interaction::Interaction;

const EDIT: [&str; 11] = [
    "edit_operations",
    "edit_added",
    "edit_replaced",
    "edit_removed",
    "edit_parameters",
    "edit_operator_graph",
    "edit_policy",
    "edit_mechanisms",
    "edit_parameter_change_mean",
    "edit_parameter_change_max",
    "edit_parameter_rise_mean",
];
/// Columns into which the words of an edit are hashed: place, kind, direction.
const EDIT_HASHED: usize = 32;
const GRAPH: [&str; 7] = [
    "graph_nodes",
    "graph_edges",
    "graph_settings",
    "graph_depth",
    "policy_rules",
    "mechanism_modules",
    "mechanism_characters_mean",
];
pub(super) const SCENE: [&str; 14] = [
    "vehicle_count",
    "pedestrian_count",
    "cyclist_count",
    "ego_speed_mps",
    "ego_route_length_m",
    "route_curvature_max_1pm",
    "traffic_speed_mps",
    "nearest_vehicle_gap_m",
    "log_distance_m_min",
    "conflict_count",
    "speed_limit_mps",
    "lane_count",
    "has_light",
    "is_junction",
];
const INTERACTION: [&str; 4] =
    ["relative_distance_m_min", "relative_speed_mps", "time_to_conflict_s_min", "route_deviation_m_min"];
const PARENT: [&str; 7] = [
    "parent_attack",
    "parent_realism",
    "parent_coverage",
    "parent_open_attack",
    "parent_open_realism",
    "parent_open_acted",
    "parent_open_idle_contact",
];
/// Columns of what our own simulator shows of the window, child less parent, as it is in an open scene.
const SIMULATED: [&str; 2] = ["simulated_attack_change", "simulated_realism_change"];
const PROBE: [&str; 7] =
    ["ego_distance_m_min", "conflict_s", "begins_s", "off_road_m", "acceleration_mps2", "jerk_mps3", "actors"];

/// Why there are no features.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FeatureError {
    /// The schema has no indicator for this family.
    #[error("family {0} has no column in the feature schema; build the schema from all families of the run")]
    UnknownFamily(FamilyName),
    /// A feature is NaN or infinite.
    #[error("feature {column} of {candidate} is not a finite number; its scenes should have been refused on import")]
    NotFinite {
        /// Name of the column.
        column: String,
        /// Id of the candidate.
        candidate: String,
    },
}

/// Columns for a run with these families, in the groups' order. With `simulated` there are some of our own simulator's.
pub fn schema(families: &[FamilyName], simulated: bool) -> FeatureSchema {
    let mut schema = shared_schema(families);
    let mut add = |name: String, group| schema.columns.push(FeatureColumn { name, group });
    PARENT.iter().for_each(|name| add(name.to_string(), FeatureGroup::Parent));
    ["open_share", "probe_scenes", "probe_differing_share"]
        .iter()
        .for_each(|n| add(n.to_string(), FeatureGroup::Probe));
    PROBE.iter().for_each(|name| add(format!("probe_{name}"), FeatureGroup::Probe));
    PROBE.iter().for_each(|name| add(format!("probe_change_{name}"), FeatureGroup::Probe));
    let simulated = if simulated { &SIMULATED[..] } else { &[] };
    simulated.iter().for_each(|name| add(name.to_string(), FeatureGroup::Simulated));
    schema
}

/// The columns with which every schema begins: families, edit, graph, scene and interaction.
pub(super) fn shared_schema(families: &[FamilyName]) -> FeatureSchema {
    let families: Vec<FamilyName> = families.iter().cloned().collect::<BTreeSet<_>>().into_iter().collect();
    let mut columns: Vec<FeatureColumn> = Vec::new();
    let mut add = |name: String, group| columns.push(FeatureColumn { name, group });
    families.iter().for_each(|family| add(format!("family_{family}"), FeatureGroup::Family));
    EDIT.iter().for_each(|name| add(name.to_string(), FeatureGroup::Edit));
    (0..EDIT_HASHED).for_each(|k| add(format!("edit_hashed_{k:02}"), FeatureGroup::Edit));
    GRAPH.iter().for_each(|name| add(name.to_string(), FeatureGroup::Graph));
    Slot::ALL.iter().for_each(|slot| add(format!("graph_{}_nodes", slot.name()), FeatureGroup::Graph));
    SCENE.iter().for_each(|name| add(format!("scene_{name}"), FeatureGroup::Scene));
    INTERACTION.iter().for_each(|name| add(format!("log_{name}"), FeatureGroup::Interaction));
    FeatureSchema { families, columns }
}

/// The values of those columns that are of the candidate itself: families, edit, graph.
///
/// # Errors
/// A family that the schema has no column for.
pub(super) fn candidate_values(
    schema: &FeatureSchema,
    candidate: &CandidateView<'_>,
) -> Result<Vec<f64>, FeatureError> {
    let family = &candidate.program.source_family;
    if !schema.families.contains(family) {
        return Err(FeatureError::UnknownFamily(family.clone()));
    }
    let mut values: Vec<f64> = schema.families.iter().map(|known| flag(known == family)).collect();
    values.extend(edit_values(candidate.program, candidate.parent, candidate.patch));
    values.extend(hashed_edit(candidate.parent, candidate.patch));
    values.extend(graph_values(candidate.program));
    Ok(values)
}

/// The first column that is not a finite number.
pub(super) fn check_finite(
    schema: &FeatureSchema,
    candidate: &CandidateView<'_>,
    values: &[f64],
) -> Result<(), FeatureError> {
    let Some(place) = values.iter().position(|value| !value.is_finite()) else { return Ok(()) };
    let column = schema.columns.get(place).map_or_else(String::new, |column| column.name.clone());
    Err(FeatureError::NotFinite { column, candidate: candidate.program.solution_id.to_string() })
}

/// A candidate with the patch that made it, the parent that it came from, and what was compiled of both.
#[derive(Clone, Copy, Debug)]
pub struct CandidateView<'a> {
    /// The child.
    pub program: &'a Program,
    /// Its parent.
    pub parent: &'a Program,
    /// Patch that made the child of the parent.
    pub patch: &'a ProgramPatch,
    /// The child's mechanism tags.
    pub mechanism_tags: &'a [String],
    /// The parent's labels on the window.
    pub parent_score: &'a Score,
    /// Both compiled on probe scenes.
    pub probes: &'a [ProbePair],
    /// The difference of their labels in our own simulator on the window, child less parent; `None` where the schema has no columns of
    /// that.
    pub simulated: Option<Objectives>,
}

/// A scene of the window, and whether the child may differ from its parent in it.
#[derive(Clone, Copy, Debug)]
pub struct SceneView<'a> {
    /// Id of the scene.
    pub id: &'a str,
    /// Its features.
    pub features: &'a SceneFeatures,
    /// Interaction as its logs show it.
    pub interaction: &'a Interaction,
    /// False where both programs compile to the same.
    pub open: bool,
}

/// ξ of a candidate over the scenes of a window.
pub fn row(
    schema: &FeatureSchema,
    candidate: &CandidateView<'_>,
    scenes: &[SceneView<'_>],
) -> Result<WorldRow, FeatureError> {
    let mut values = candidate_values(schema, candidate)?;
    let open: Vec<&SceneView<'_>> = scenes.iter().filter(|scene| scene.open).collect();
    let open_share = open.len() as f64 / scenes.len().max(1) as f64;
    values.extend(scene_means(&open));
    values.extend(parent_values(candidate.parent_score, &open));
    values.push(open_share);
    values.extend(probe_values(candidate.probes));
    values.extend(candidate.simulated.iter().flat_map(|shown| in_open_scene(shown, open_share)));
    check_finite(schema, candidate, &values)?;
    let family = candidate.program.source_family.clone();
    let mechanism_class = candidate.mechanism_class();
    let parent = candidate.parent_score.objectives;
    Ok(WorldRow { features: values, open_share, parent, family, mechanism_class, pairs: Vec::new() })
}

impl CandidateView<'_> {
    /// Its mechanism tags joined.
    pub(super) fn mechanism_class(&self) -> String {
        if self.mechanism_tags.is_empty() { "none".to_string() } else { self.mechanism_tags.join("+") }
    }
}

/// A difference over a window as it is in each of its open scenes, which alone can differ; zeros where none is open.
fn in_open_scene(of: &Objectives, open_share: f64) -> [f64; 2] {
    let share = if open_share > 0.0 { open_share } else { f64::INFINITY };
    [of.attack / share, of.realism / share]
}

pub(super) fn flag(holds: bool) -> f64 {
    if holds { 1.0 } else { 0.0 }
}

/// The mean, and 0 of nothing.
pub(super) fn mean(values: impl Iterator<Item = f64>) -> f64 {
    num::mean(&values.collect::<Vec<f64>>()).unwrap_or(0.0)
}

/// Means over the open scenes; zeros where none is open, and then nothing is predicted either.
fn scene_means(open: &[&SceneView<'_>]) -> Vec<f64> {
    let of = |name: &&str| mean(open.iter().map(|scene| scene.features.value(name).unwrap_or(f64::NAN)));
    let logs: [fn(&Interaction) -> f64; 4] = [
        |log| log.relative_distance_m_min,
        |log| log.relative_speed_mps,
        |log| log.time_to_conflict_s_min,
        |log| log.route_deviation_m_min,
    ];
    let log = |read: &fn(&Interaction) -> f64| mean(open.iter().map(|scene| read(scene.interaction)));
    SCENE.iter().map(of).chain(logs.iter().map(log)).collect()
}

/// Returns what the parent did: on the window, and in the scenes that are open.
fn parent_values(score: &Score, open: &[&SceneView<'_>]) -> [f64; 7] {
    let labelled = |scene: &&SceneView<'_>| score.scenes.iter().find(|label| label.scene == scene.id);
    let labels: Vec<&SceneScore> = open.iter().filter_map(labelled).collect();
    let of = |read: fn(&SceneScore) -> f64| mean(labels.iter().map(|label| read(label)));
    [
        score.objectives.attack,
        score.objectives.realism,
        score.coverage,
        of(|label| label.attack),
        of(|label| label.realism),
        of(|label| flag(label.acted)),
        of(|label| flag(label.attack == 0.0 && label.contact.is_some())),
    ]
}

/// Returns how many scenes were tried, the share in which the interventions differ, and of those that do the child's
/// numbers and their differences from the parent's.
fn probe_values(probes: &[ProbePair]) -> Vec<f64> {
    let differing: Vec<&ProbePair> = probes.iter().filter(|probe| !probe.same).collect();
    let mut values = vec![probes.len() as f64, differing.len() as f64 / probes.len().max(1) as f64];
    let of = |k: usize, read: fn(&ProbePair, usize) -> f64| mean(differing.iter().map(|probe| read(probe, k)));
    values.extend((0..PROBE.len()).map(|k| of(k, |probe, k| probe.child.values()[k])));
    values.extend((0..PROBE.len()).map(|k| of(k, |probe, k| probe.child.values()[k] - probe.parent.values()[k])));
    values
}

/// The words of an edit, each hashed to a column: where it edits, which kind it puts there, and for a parameter by how much.
fn hashed_edit(parent: &Program, patch: &ProgramPatch) -> [f64; EDIT_HASHED] {
    let mut values = [0.0; EDIT_HASHED];
    let mut add = |word: &str, value: f64| {
        let digest = Digest::of_bytes(format!("{} {word}", patch.source_baseline).as_bytes());
        let place = usize::from_str_radix(&digest.short(4), 16).unwrap_or(0) % EDIT_HASHED;
        values[place] += value;
    };
    for operation in &patch.operations {
        let place: Vec<&str> = operation.path.split('/').skip(1).take(2).collect();
        add(&format!("{:?} {}", operation.op, place.join(" ")), 1.0);
        let Some(value) = &operation.value else { continue };
        if let Some(kind) = value.get("kind").or(Some(value)).and_then(|kind| kind.as_str()) {
            add(&format!("kind {kind}"), 1.0);
        }
        let old = place.get(1).and_then(|name| parent.parameters.get(*name));
        if let (Some(&"parameters"), Some(ParameterValue::Number(old)), Some(new)) =
            (place.first(), old, value.as_f64())
        {
            add(&format!("change of {}", place[1]), signed_change(*old, new));
        }
    }
    values
}

/// (new - old) / (|old| + |new|), in [-1, 1].
fn signed_change(old: f64, new: f64) -> f64 {
    let change = (new - old) / (old.abs() + new.abs()).max(1e-12);
    if change.is_finite() { change.clamp(-1.0, 1.0) } else { 0.0 }
}

fn edit_values(candidate: &Program, parent: &Program, patch: &ProgramPatch) -> [f64; 11] {
    let kind = |wanted: OperationKind| patch.operations.iter().filter(|o| o.op == wanted).count() as f64;
    let under = |root: &str| patch.operations.iter().filter(|o| o.path.starts_with(root)).count() as f64;
    let rises: Vec<f64> = candidate
        .parameters
        .iter()
        .filter_map(|(name, value)| match (parent.parameters.get(name)?, value) {
            (ParameterValue::Number(old), ParameterValue::Number(new)) if old != new => Some(signed_change(*old, *new)),
            _ => None,
        })
        .collect();
    let changes: Vec<f64> = candidate
        .parameters
        .iter()
        .filter_map(|(name, value)| relative_change(parent.parameters.get(name)?, value))
        .collect();
    [
        patch.operations.len() as f64,
        kind(OperationKind::Add),
        kind(OperationKind::Replace),
        kind(OperationKind::Remove),
        under("/parameters"),
        under("/operator_graph"),
        under("/scenario_conditioned_policy"),
        under("/mechanism_modules"),
        num::mean(&changes).unwrap_or(0.0),
        changes.iter().copied().fold(0.0, f64::max),
        num::mean(&rises).unwrap_or(0.0),
    ]
}

/// |new - old| / (|old| + |new|), in [0, 1]; 1 for another word.
fn relative_change(old: &ParameterValue, new: &ParameterValue) -> Option<f64> {
    if old == new {
        return None;
    }
    match (old, new) {
        (ParameterValue::Number(old), ParameterValue::Number(new)) => Some(signed_change(*old, *new).abs()),
        _ => Some(1.0),
    }
}

fn graph_values(program: &Program) -> Vec<f64> {
    let nodes = &program.operator_graph;
    let lengths: Vec<f64> = program.mechanism_modules.values().map(|m| m.expression.len() as f64).collect();
    let mut values = vec![
        nodes.len() as f64,
        nodes.values().map(|node| node.inputs.len()).sum::<usize>() as f64,
        nodes.values().map(|node| node.settings.len()).sum::<usize>() as f64,
        graph_depth(program) as f64,
        program.scenario_conditioned_policy.len() as f64,
        program.mechanism_modules.len() as f64,
        num::mean(&lengths).unwrap_or(0.0),
    ];
    values.extend(Slot::ALL.iter().map(|slot| nodes.values().filter(|node| node.slot == *slot).count() as f64));
    values
}

/// Nodes on the longest path, by relaxation. The number of nodes bounds it, so a circle does no harm.
fn graph_depth(program: &Program) -> usize {
    let nodes = &program.operator_graph;
    let mut depth: std::collections::BTreeMap<&str, usize> = nodes.keys().map(|name| (name.as_str(), 1)).collect();
    for _ in 0..nodes.len() {
        let mut changed = false;
        for (name, node) in nodes {
            let feeding = node.inputs.iter().filter_map(|input| depth.get(input.as_str())).max().copied().unwrap_or(0);
            let reached = (feeding + 1).min(nodes.len());
            if depth.get(name.as_str()).is_some_and(|known| *known < reached) {
                depth.insert(name, reached);
                changed = true;
            }
        }
        if !changed {
            break;
        }
    }
    depth.values().copied().max().unwrap_or(0)
}
