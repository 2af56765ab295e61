//! What the snapshot tells the agents: scene clusters, the parent's labels, recent attempts, the front.

use std::collections::BTreeMap;

use super::study::{SceneEntry, Study};
use crate::agents::{Cluster, FrontPoint, Outcomes, ParentOutcome, RecentAttempt, Target};
use crate::archive::Archive;
use crate::ego::Policy;
use crate::kernel::num;
use crate::objects::entry::diagnostics_mean;
use crate::objects::{Attempt, Exit, Score};
use crate::scene::features::SceneFeatures;

/// Features whose means describe a cluster.
const CLUSTER_FEATURES: [&str; 5] =
    ["ego_speed_mps", "vehicle_count", "nearest_vehicle_gap_m", "conflict_count", "route_curvature_max_1pm"];
/// How many of a lineage's latest attempts the agents are shown.
const RECENT_ATTEMPTS: usize = 8;
/// Characters of a problem that are shown.
const PROBLEM_CHARS: usize = 160;

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
    let mean_of = |feature: &&str| {
        let values: Vec<f64> = entries.iter().filter_map(|e| e.features().value(feature)).collect();
        num::mean(&values).map(|mean| ((*feature).to_string(), num::rounded(mean, 4)))
    };
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
        features: CLUSTER_FEATURES.iter().filter_map(mean_of).collect(),
    }
}

/// The parent's labels in sums, and how the lineage's latest attempts ended.
pub fn outcomes(parent: &Score, attempts: &[&Attempt]) -> Outcomes {
    let share = |holds: &dyn Fn(&crate::objects::SceneScore) -> bool| {
        let hits = parent.scenes.iter().filter(|s| holds(s)).count();
        num::rounded(hits as f64 / parent.scenes.len().max(1) as f64, 4)
    };
    let parent_outcome = ParentOutcome {
        objectives: parent.objectives,
        scenes: parent.scenes.len(),
        failures: parent.failures.len(),
        attacked_share: share(&|s| s.attack > 0.0),
        intervened_share: share(&|s| s.intervened),
        diagnostics: diagnostics_mean(parent).into_iter().map(|(k, v)| (k, num::rounded(v, 4))).collect(),
    };
    let from = attempts.len().saturating_sub(RECENT_ATTEMPTS);
    Outcomes { parent: Some(parent_outcome), recent: attempts[from..].iter().map(|a| recent(a)).collect() }
}

fn recent(attempt: &Attempt) -> RecentAttempt {
    let problems = match &attempt.exit {
        Exit::Declined { reason } => vec![reason.clone()],
        Exit::Invalid { gates } => gates.failed().flat_map(|v| v.problems.iter().cloned()).collect(),
        Exit::Rejected { route, .. } => vec![route.reason.clone()],
        Exit::Evaluated { .. } => Vec::new(),
    };
    RecentAttempt {
        attempt: attempt.id.clone(),
        exit: attempt.exit.name().into(),
        mechanism_tags: attempt.exit.candidate().map(|c| c.mechanism_tags.clone()).unwrap_or_default(),
        problems: problems.into_iter().take(3).map(|p| p.chars().take(PROBLEM_CHARS).collect()).collect(),
        objectives: attempt.exit.score().map(|s| s.objectives),
    }
}

/// The ego in a sentence, for prompts.
pub fn ego_sentence(ego: &Policy) -> &'static str {
    match ego.name() {
        "idm" => {
            "idm: MetaDrive's TrajectoryIDMPolicy along its route; brakes for whoever is in its path, heeds no light"
        }
        "idm-lights" => "idm-lights: TrajectoryIDMPolicy along its route that also stops at red lights",
        "replay" => "replay: the recorded motion, blind to everybody",
        _ => "a fixed policy with frozen weights",
    }
}

/// The lineage's front as the prompts show it.
pub fn front(archive: &Archive) -> Vec<FrontPoint> {
    archive.front().map(|e| FrontPoint { solution: e.solution.clone(), objectives: e.objectives }).collect()
}

/// The search target of a slot: the three kinds take turns, so that every epoch asks for each.
pub fn target(study: &Study, slot: u32, parent: &Score) -> Target {
    match slot % 3 {
        0 => Target::raise_attack(study.selector.realism_min),
        1 => Target::raise_realism(parent.objectives.attack),
        _ => Target::diversify(),
    }
}
