//! Parts of the snapshot that the agents are told: scene clusters, the parent's labels, the front.

use std::collections::BTreeMap;

use crate::agents::{Cluster, FrontPoint, ParentOutcome};
use crate::archive::Archive;
use crate::epoch::labelling::standings::Standings;
use crate::epoch::setting::study::{LineageSpec, SceneEntry, Study};
use crate::kernel::num;
use crate::objects::entry::diagnostics_mean;
use crate::objects::{Entry, OverEgos, Score, SolutionId};
use crate::scene::features::SceneFeatures;

/// Features whose means describe a cluster.
const CLUSTER_FEATURES: [&str; 5] =
    ["ego_speed_mps", "vehicle_count", "nearest_vehicle_gap_m", "conflict_count", "route_curvature_max_1pm"];

/// The kind of place a scene is: the first that holds.
pub fn cluster_of(features: &SceneFeatures) -> &'static str {
    ["junction", "highway", "multi_lane"].into_iter().find(|tag| features.tags.contains(tag)).unwrap_or("single_lane")
}

/// Clusters of the evolution scenes with the parent's success in those of the window.
pub fn clusters(study: &Study, window_score: &Score) -> Vec<Cluster> {
    let mut groups: BTreeMap<&str, Vec<&SceneEntry>> = BTreeMap::new();
    for &place in &study.evolution {
        let entry = &study.scenes[place];
        groups.entry(cluster_of(entry.features())).or_default().push(entry);
    }
    groups.into_iter().map(|(name, entries)| cluster(name, &entries, window_score)).collect()
}

fn cluster(name: &str, entries: &[&SceneEntry], score: &Score) -> Cluster {
    let labels: Vec<f64> = entries
        .iter()
        .filter_map(|e| score.scenes.iter().find(|s| s.scene == e.scene().id))
        .map(|s| s.attack)
        .collect();
    let describes = match name {
        "junction" => "the ego's route crosses or merges with other lanes",
        "highway" => "fast road without crossing traffic",
        "multi_lane" => "several lanes in the ego's direction, no junction on the route",
        _ => "one lane in the ego's direction, no junction on the route",
    };
    Cluster {
        name: format!("cluster:{name}"),
        scenes: entries.len(),
        describes: describes.into(),
        attacked_share: num::mean(&labels).map(|share| num::rounded(share, 4)),
        features: means_of(&CLUSTER_FEATURES, entries),
        outcomes: BTreeMap::new(),
    }
}

/// Means of features over scenes.
pub fn means_of(features: &[&str], entries: &[&SceneEntry]) -> BTreeMap<String, f64> {
    let mean_of = |feature: &&str| {
        let values: Vec<f64> = entries.iter().filter_map(|e| e.features().value(feature)).collect();
        num::mean(&values).map(|mean| ((*feature).to_string(), num::rounded(mean, 2)))
    };
    features.iter().filter_map(mean_of).collect()
}

/// The parent's labels on the window in sums.
pub fn parent_outcome(parent: &Score) -> ParentOutcome {
    ParentOutcome {
        objectives: parent.objectives,
        scenes: parent.scenes.len(),
        failures: parent.failures.len(),
        coverage: num::rounded(parent.coverage, 4),
        diagnostics: diagnostics_mean(parent).into_iter().map(|(k, v)| (k, num::rounded(v, 4))).collect(),
        near_misses: None,
    }
}

/// A lineage's driver in a sentence, for prompts; its name alone where the study does not tell what it sees. Of several drivers each, and
/// how a scene counts.
pub fn ego_sentence(study: &Study, spec: &LineageSpec) -> String {
    let of = |spec: &LineageSpec| one_ego_sentence(study, spec.ego.name()).to_string();
    let Some(rule) = spec.over_egos.filter(|_| !spec.against.is_empty()) else { return of(spec) };
    let each: Vec<String> = spec.against.iter().map(of).collect();
    let counts = match rule {
        OverEgos::Mean => "a scene's attack is the mean over them",
        OverEgos::Worst => "a scene's attack is the least over them: only what troubles all of them counts",
    };
    format!(
        "several drivers, each alone in the scene; {counts}. {}. Outcomes of scenes are those of the first",
        each.join(". ")
    )
}

fn one_ego_sentence<'e>(study: &Study, name: &'e str) -> &'e str {
    match name {
        name if study.without.sight => name,
        "idm" => {
            "idm: MetaDrive's TrajectoryIDMPolicy along its route; brakes for whoever is in its path, heeds no light"
        }
        "idm-lights" => "idm-lights: TrajectoryIDMPolicy along its route that also stops at red lights",
        "pdm" => {
            "pdm: PDM-Closed, which tries fifteen ways along its route against a forecast of everybody within 50 m"
        }
        "frenet" => {
            "frenet: CommonRoad's reactive planner, which samples manoeuvres beside its route that meet nobody within 6 s"
        }
        "command" => "command: a planner of its own; a fixed function of what it sees around it",
        "replay" => "replay: the recorded motion, blind to everybody",
        _ => "a fixed policy with frozen weights",
    }
}

/// The lineage's front as the prompts of a parent show it; `standing` is given where they show it on the window, too.
pub fn front(archive: &Archive, parent: &SolutionId, standing: Option<&Standings>) -> Vec<FrontPoint> {
    let point = |entry: &Entry| FrontPoint {
        solution: entry.solution.clone(),
        objectives: entry.objectives,
        attempt: entry.attempt.clone(),
        is_parent: entry.solution == *parent,
        on_window: standing.and_then(|of| of.get(&entry.solution)).map(|labels| labels.window.objectives),
    };
    archive.front().map(point).collect()
}
