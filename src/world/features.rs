//! The feature map x(c, s): numbers of the candidate, computed once, beside numbers of the scene.

use crate::objects::{
    FamilyName, FeatureColumn, FeatureGroup, FeatureSchema, OperationKind, ParameterValue, Program, ProgramPatch, Slot,
    WorldPair,
};
use crate::scene::SceneFeatures;

use super::interaction::Interaction;

const EDIT: [&str; 10] = [
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
];
const GRAPH: [&str; 7] = [
    "graph_nodes",
    "graph_edges",
    "graph_settings",
    "graph_depth",
    "policy_rules",
    "mechanism_modules",
    "mechanism_characters_mean",
];
const SCENE: [&str; 14] = [
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

/// Why there are no features.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FeatureError {
    /// The schema has no indicator for this family.
    #[error("family {0} has no column in the feature schema; build the schema from all families of the run")]
    UnknownFamily(FamilyName),
    /// A feature is NaN or infinite.
    #[error("feature {column} of scene {scene} is not a finite number; the scene should have been refused on import")]
    NotFinite {
        /// Name of the column.
        column: String,
        /// Id of the scene.
        scene: String,
    },
}

/// Columns for a run with these families, in the five groups' order.
pub fn schema(families: &[FamilyName]) -> FeatureSchema {
    let families: Vec<FamilyName> =
        families.iter().cloned().collect::<std::collections::BTreeSet<_>>().into_iter().collect();
    let mut columns: Vec<FeatureColumn> = Vec::new();
    let mut add = |name: String, group| columns.push(FeatureColumn { name, group });
    families.iter().for_each(|family| add(format!("family_{family}"), FeatureGroup::Family));
    EDIT.iter().for_each(|name| add(name.to_string(), FeatureGroup::Edit));
    GRAPH.iter().for_each(|name| add(name.to_string(), FeatureGroup::Graph));
    Slot::ALL.iter().for_each(|slot| add(format!("graph_{}_nodes", slot.name()), FeatureGroup::Graph));
    SCENE.iter().for_each(|name| add(format!("scene_{name}"), FeatureGroup::Scene));
    INTERACTION.iter().for_each(|name| add(format!("log_{name}"), FeatureGroup::Interaction));
    FeatureSchema { families, columns }
}

/// The part of x(c, s) that does not depend on the scene: family, edit, graph.
#[derive(Clone, Debug, PartialEq)]
pub struct CandidateFeatures {
    /// Its family.
    pub family: FamilyName,
    /// Mechanism tags joined by `+`, sorted; `none` without any.
    pub mechanism_class: String,
    values: Vec<f64>,
}

/// Features of a candidate with the patch that made it and the parent it came from.
pub fn candidate_features(
    schema: &FeatureSchema,
    candidate: &Program,
    parent: &Program,
    patch: &ProgramPatch,
    mechanism_tags: &[String],
) -> Result<CandidateFeatures, FeatureError> {
    let family = candidate.source_family.clone();
    if !schema.families.contains(&family) {
        return Err(FeatureError::UnknownFamily(family));
    }
    let flag = |holds: bool| if holds { 1.0 } else { 0.0 };
    let mut values: Vec<f64> = schema.families.iter().map(|known| flag(*known == family)).collect();
    values.extend(edit_values(candidate, parent, patch));
    values.extend(graph_values(candidate));
    let class = if mechanism_tags.is_empty() { "none".to_string() } else { mechanism_tags.join("+") };
    Ok(CandidateFeatures { family, mechanism_class: class, values })
}

/// x(c, s) of a candidate in a scene whose features and interaction were computed once.
pub fn features(
    schema: &FeatureSchema,
    candidate: &CandidateFeatures,
    scene: &str,
    of_scene: &SceneFeatures,
    interaction: &Interaction,
) -> Result<WorldPair, FeatureError> {
    let mut values = candidate.values.clone();
    values.extend(SCENE.iter().map(|name| of_scene.value(name).unwrap_or(f64::NAN)));
    values.extend([
        interaction.relative_distance_m_min,
        interaction.relative_speed_mps,
        interaction.time_to_conflict_s_min,
        interaction.route_deviation_m_min,
    ]);
    if let Some(place) = values.iter().position(|value| !value.is_finite()) {
        let column = schema.columns.get(place).map_or_else(String::new, |column| column.name.clone());
        return Err(FeatureError::NotFinite { column, scene: scene.to_string() });
    }
    let cluster = if of_scene.tags.is_empty() { "plain".to_string() } else { of_scene.tags.join("+") };
    Ok(WorldPair {
        scene: scene.to_string(),
        features: values,
        family: candidate.family.clone(),
        scene_cluster: cluster,
        mechanism_class: candidate.mechanism_class.clone(),
    })
}

fn edit_values(candidate: &Program, parent: &Program, patch: &ProgramPatch) -> [f64; 10] {
    let kind = |wanted: OperationKind| patch.operations.iter().filter(|o| o.op == wanted).count() as f64;
    let under = |root: &str| patch.operations.iter().filter(|o| o.path.starts_with(root)).count() as f64;
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
        crate::kernel::num::mean(&changes).unwrap_or(0.0),
        changes.iter().copied().fold(0.0, f64::max),
    ]
}

/// |new - old| / (|old| + |new|), in [0, 1]; 1 for another word.
fn relative_change(old: &ParameterValue, new: &ParameterValue) -> Option<f64> {
    if old == new {
        return None;
    }
    match (old, new) {
        (ParameterValue::Number(old), ParameterValue::Number(new)) => {
            let change = (new - old).abs() / (old.abs() + new.abs()).max(1e-12);
            Some(if change.is_finite() { change.min(1.0) } else { 1.0 })
        }
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
        crate::kernel::num::mean(&lengths).unwrap_or(0.0),
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
