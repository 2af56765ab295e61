//! Recorded road users that are no adversaries, as boxes by scene step: what a motion that a search changes may run into.

use super::situation::Situation;
use crate::kernel::{OrientedBox, Pose};
use crate::scene::{Sample, TrackIx};

/// MetaDrive's reactive traffic: this far behind the ego, and no farther aside, others make way for it, metres.
const BEHIND_M: f64 = 1.0;
const ASIDE_M: f64 = 15.0;

/// Everybody who is neither the ego nor an adversary, over some steps.
#[derive(Clone, Debug)]
pub struct Bystanders {
    from_step: usize,
    boxes: Vec<Vec<(TrackIx, OrientedBox)>>,
}

impl Bystanders {
    /// Returns the bystanders over the scene steps `steps`.
    pub fn of(situation: &Situation, adversaries: &[TrackIx], steps: std::ops::Range<usize>) -> Bystanders {
        let tracks = &situation.scene.tracks;
        let at = |step: usize| {
            let others = (0..tracks.len()).filter(|ix| !adversaries.contains(ix));
            others.filter_map(|ix| Some((ix, situation.body(ix, tracks[ix].at(step)?)))).collect()
        };
        Bystanders { from_step: steps.start, boxes: steps.map(at).collect() }
    }

    /// Track and bounding box of everyone at a scene step; empty outside the steps.
    pub fn at(&self, step: usize) -> &[(TrackIx, OrientedBox)] {
        step.checked_sub(self.from_step).and_then(|k| self.boxes.get(k)).map_or(&[], Vec::as_slice)
    }

    /// Returns the tracks that would not be in the ego's way in a simulation from `first` on, where it stands at `start`:
    /// those behind it, which follow it, and those that overlap its undisturbed path, which the simulator spares.
    pub fn making_way(&self, situation: &Situation, first: usize, start: &Sample, count: usize) -> Vec<TrackIx> {
        let frame = Pose { position: start.position, heading_rad: start.heading_rad };
        let follows = |body: &OrientedBox| {
            let local = frame.to_local(body.center);
            local.x < -BEHIND_M && local.y.abs() < ASIDE_M
        };
        let behind = self.at(first + 1).iter().filter(|(_, body)| follows(body));
        let mut behind_ego: Vec<TrackIx> = behind.map(|(ix, _)| *ix).collect();
        for step in first + 1..first + 1 + count {
            let Some(ego) = situation.ego.body(step) else { break };
            behind_ego.extend(self.at(step).iter().filter(|(_, body)| ego.overlaps(body)).map(|(ix, _)| *ix));
        }
        behind_ego
    }
}
