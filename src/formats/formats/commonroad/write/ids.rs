//! CommonRoad's ids: whole numbers, unique in the file. A scene's own ids are kept if they are such numbers; the others
//! get free numbers.

use std::collections::BTreeSet;

use super::standing;
use crate::scene::Scene;

pub(super) struct Ids {
    /// By lane.
    pub lanes: Vec<u32>,
    /// By crosswalk; `None` where a lane already has that outline.
    pub crosswalks: Vec<Option<u32>>,
    /// Speed limits as bits, with the number of the sign.
    pub limits: Vec<(u64, u32)>,
    pub stop_signs: Vec<u32>,
    pub lights: Vec<u32>,
    pub edges: Vec<u32>,
    /// By track, then by obstacle.
    pub tracks: Vec<Vec<u32>>,
    pub problem: u32,
}

impl Ids {
    pub fn of(scene: &Scene) -> Ids {
        let mut pick = Picker { taken: BTreeSet::new(), next: 1 };
        let own_lanes: Vec<Option<u32>> = scene.road.lanes.iter().map(|lane| pick.own(&lane.id)).collect();
        let own_tracks: Vec<Option<u32>> = scene.tracks.iter().map(|track| pick.own(&track.id)).collect();
        let mut limits: Vec<u64> =
            scene.road.lanes.iter().filter_map(|l| l.speed_limit_mps).map(f64::to_bits).collect();
        limits.sort_unstable();
        limits.dedup();
        let is_lane = |polygon: &Vec<_>| {
            let outline = |lane: &crate::scene::Lane| lane.left.iter().chain(lane.right.iter().rev()).eq(polygon);
            scene.road.lanes.iter().any(outline)
        };
        Ids {
            lanes: own_lanes.into_iter().map(|own| pick.or_free(own)).collect(),
            crosswalks: scene.crosswalks.iter().map(|p| (!is_lane(p)).then(|| pick.free())).collect(),
            limits: limits.into_iter().map(|limit| (limit, pick.free())).collect(),
            stop_signs: scene.stop_signs.iter().map(|_| pick.free()).collect(),
            lights: scene.lights.iter().map(|_| pick.free()).collect(),
            edges: scene.road.edges.iter().map(|_| pick.free()).collect(),
            tracks: own_tracks
                .into_iter()
                .zip(&scene.tracks)
                .map(|(own, track)| {
                    let parts = standing::count(track, scene.ego.start_step);
                    (0..parts).map(|k| pick.or_free(own.filter(|_| k == 0))).collect()
                })
                .collect(),
            problem: pick.free(),
        }
    }
}

struct Picker {
    taken: BTreeSet<u32>,
    next: u32,
}

impl Picker {
    /// The number in a text, if it is written plainly, above 0 and not taken.
    fn own(&mut self, text: &str) -> Option<u32> {
        let number: u32 = text.parse().ok().filter(|n| *n > 0 && *n < 1_000_000_000)?;
        (number.to_string() == text && self.taken.insert(number)).then_some(number)
    }

    fn free(&mut self) -> u32 {
        while !self.taken.insert(self.next) {
            self.next += 1;
        }
        self.next
    }

    fn or_free(&mut self, own: Option<u32>) -> u32 {
        own.unwrap_or_else(|| self.free())
    }
}
