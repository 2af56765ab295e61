//! Clusters of scenes for detailed questions: by the vehicle that the ego has to mind in its undisturbed drive, and where that is seen
//! from the ego. A vehicle whose way crosses comes before one that is merely near.

use std::collections::BTreeMap;
use std::f64::consts::{FRAC_PI_4, PI};

use super::briefing::means_of;
use crate::agents::{Cluster, SceneRow};
use crate::epoch::setting::desk::Tools;
use crate::epoch::setting::study::{LineageSpec, SceneEntry, Study};
use crate::kernel::num;
use crate::objects::Score;
use crate::stage::Situation;

/// A vehicle whose log stays farther away is in no conflict, metres.
const CONFLICT_M: f64 = 12.0;
/// Features whose means describe a cluster here: few, because there are more clusters.
const FEATURES: [&str; 3] = ["ego_speed_mps", "nearest_vehicle_gap_m", "vehicle_count"];
/// A vehicle that goes no farther stands, metres.
const MOVES_M: f64 = 1.0;

/// The conflict of a scene that the recording holds.
pub fn conflict(situation: &Situation) -> &'static str {
    let of = |actor: usize, name: &str| {
        let facts = situation.actors[actor].as_ref();
        facts.and_then(|facts| facts.value(name)).unwrap_or(f64::INFINITY)
    };
    let distance_m = |actor: &usize| of(*actor, "path_distance_m_min");
    let near = (0..situation.actors.len()).filter(|actor| distance_m(actor) <= CONFLICT_M);
    let (moving, standing): (Vec<usize>, Vec<usize>) = near.partition(|actor| of(*actor, "moved_m") > MOVES_M);
    let apart_s = |actor: &usize| of(*actor, "arrival_difference_s").abs();
    let crossing = moving.iter().copied().filter(|actor| of(*actor, "paths_cross") > 0.5);
    let crossing = crossing.min_by(|a, b| apart_s(a).total_cmp(&apart_s(b)));
    let nearest = moving.iter().copied().min_by(|a, b| distance_m(a).total_cmp(&distance_m(b)));
    let Some(nearest) = crossing.or(nearest) else { return if standing.is_empty() { "free" } else { "stands" } };
    let (turned, is) = (of(nearest, "heading_difference_rad"), |name: &str| of(nearest, name) > 0.5);
    let (crosses, behind) = (is("paths_cross"), is("behind"));
    if turned > PI - FRAC_PI_4 && crosses {
        "turns_across"
    } else if turned > PI - FRAC_PI_4 {
        "oncoming"
    } else if turned > FRAC_PI_4 && crosses {
        "crosses"
    } else if turned > FRAC_PI_4 {
        "passes"
    } else if is("same_lane") && behind {
        "follows"
    } else if is("same_lane") {
        "leads"
    } else if crosses {
        "merges"
    } else if is("adjacent_lane") {
        "beside"
    } else {
        "passes"
    }
}

/// The conflict of each evolution scene, by the scene's id.
pub fn conflicts(study: &Study, spec: &LineageSpec, tools: &Tools<'_>) -> BTreeMap<String, &'static str> {
    let of = |_: usize, place: &usize| {
        let situation = tools.situations.at(*place, &spec.ego, &tools.backend);
        (study.scenes[*place].scene().id.clone(), situation.map_or("free", |situation| conflict(&situation)))
    };
    tools.threads.map(&study.evolution, of).into_iter().collect()
}

/// Clusters of the evolution scenes, with what became of those of the window. `rows` are all of the window's.
pub fn clusters(
    study: &Study,
    conflicts: &BTreeMap<String, &'static str>,
    score: &Score,
    rows: &[SceneRow],
) -> Vec<Cluster> {
    let mut groups: BTreeMap<&str, Vec<&SceneEntry>> = BTreeMap::new();
    for &place in &study.evolution {
        let entry = &study.scenes[place];
        let conflict = conflicts.get(&entry.scene().id).copied().unwrap_or("free");
        groups.entry(conflict).or_default().push(entry);
    }
    let cluster = |(name, entries): (&str, Vec<&SceneEntry>)| {
        let own = |scene: &str| entries.iter().any(|entry| entry.scene().id == scene);
        let labels: Vec<f64> = score.scenes.iter().filter(|of| own(&of.scene)).map(|of| of.attack).collect();
        let mut outcomes: BTreeMap<&'static str, usize> = BTreeMap::new();
        rows.iter().filter(|row| own(&row.scene)).for_each(|row| *outcomes.entry(row.outcome).or_default() += 1);
        Cluster {
            name: format!("cluster:{name}"),
            scenes: entries.len(),
            describes: String::new(),
            attacked_share: num::mean(&labels).map(|share| num::rounded(share, 4)),
            features: means_of(&FEATURES, &entries),
            outcomes,
        }
    };
    groups.into_iter().map(cluster).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ego::Policy;
    use crate::scene::fixture::two_lane_scene;
    use std::sync::Arc;

    #[test]
    fn a_scene_without_anybody_is_free() {
        let mut scene = two_lane_scene();
        let of =
            |scene: &crate::scene::Scene| conflict(&Situation::new(Arc::new(scene.clone()), &Policy::Idm).unwrap());
        assert_ne!(of(&scene), "free", "somebody is near");
        scene.tracks.clear();
        scene.objects_of_interest.clear();
        assert_eq!(of(&scene), "free");
    }
}
