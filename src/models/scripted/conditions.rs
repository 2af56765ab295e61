//! Conditions on the scene, for rules of ρ and for gates. A feature is compared with a threshold near plausible values,
//! or near the mean of a scene cluster if the prompt shows one.

use super::{
    constants::{fill, without_constants},
    names::names_in,
    reader::PromptView,
};
use crate::kernel::{Stream, num};

/// Condition, and the words that hypotheses and names use for it.
pub struct Condition {
    pub text: String,
    pub name: &'static str,
    /// The cluster whose mean gives the threshold.
    pub cluster: Option<String>,
}

/// Kinds of scenes: a name and a template; `<low..high>` is drawn.
const SCENES: [(&str, &str); 16] = [
    ("dense", "vehicle_count >= <5..14 #>"),
    ("sparse", "vehicle_count < <3..7 #>"),
    ("fast_start", "ego_speed_mps > <6..12>"),
    ("slow_start", "ego_speed_mps < <3..7>"),
    ("junction", "is_junction"),
    ("open_road", "not is_junction"),
    ("conflict", "conflict_count >= <1..2 #>"),
    ("close_traffic", "nearest_vehicle_gap_m < <10..35>"),
    ("curved", "route_curvature_max_1pm > <0.01..0.08>"),
    ("near_miss", "log_distance_m_min < <2..8>"),
    ("fast_traffic", "traffic_speed_mps > <6..12>"),
    ("many_lanes", "lane_count >= 2"),
    ("high_limit", "speed_limit_mps > <12..20>"),
    ("signalised", "has_light"),
    ("long_route", "ego_route_length_m > <60..160>"),
    ("crossing_junction", "is_junction and conflict_count >= 1"),
];

/// One condition that the contract's scene features allow; `None` where it has none of them.
pub fn draw(page: &PromptView, stream: &mut Stream) -> Option<Condition> {
    let weak = page.clusters.iter().filter(|cluster| cluster.attacked_share.is_none_or(|share| share < 0.5));
    let shown: Vec<_> = weak.filter(|cluster| !cluster.features.is_empty()).collect();
    if stream.chance(0.4)
        && let Some(cluster) = stream.pick(&shown)
        && let Some(condition) = near_cluster(page, cluster, stream)
    {
        return Some(condition);
    }
    let readable = page.readable(None);
    let legal: Vec<_> =
        SCENES.iter().filter(|(_, t)| names_in(&without_constants(t)).iter().all(|n| readable.contains(n))).collect();
    if let Some((name, template)) = stream.pick(&legal) {
        return Some(Condition { text: fill(page, name, template, stream), name, cluster: None });
    }
    let booleans: Vec<_> = page
        .contract
        .scene_features
        .iter()
        .filter(|f| page.contract.features.get(*f).is_some_and(|f| f.value == "boolean"))
        .collect();
    stream.pick(&booleans).map(|feature| Condition { text: (*feature).clone(), name: "scene", cluster: None })
}

fn near_cluster(page: &PromptView, cluster: &super::reader::Cluster, stream: &mut Stream) -> Option<Condition> {
    let numbers: Vec<(&String, f64)> = cluster
        .features
        .iter()
        .filter(|(name, value)| page.contract.scene_features.contains(name) && value.is_finite())
        .filter(|(name, _)| page.contract.features.get(*name).is_some_and(|f| f.value == "number"))
        .map(|(name, value)| (name, *value))
        .collect();
    let (name, mean) = stream.pick(&numbers)?;
    let threshold = num::rounded(mean * stream.uniform(0.7, 0.95), 2);
    let text = format!("{name} >= {threshold}");
    (threshold >= 0.0).then(|| Condition { text, name: "cluster", cluster: Some(cluster.name.clone()) })
}
