//! Probe of a compiled intervention without a rollout: the adversaries' motion beside the ego's undisturbed one.

use crate::kernel::OrientedBox;
use crate::objects::Probe;
use crate::scene::{AgentKind, DT_S, Sample, Track};
use crate::sim::{Action, Intervention};
use crate::stage::Situation;

/// Boxes that come this near are in conflict, metres.
const CONFLICT_M: f64 = 2.0;
/// An adversary that is this far from its recording has departed from it, metres.
const DEPARTED_M: f64 = 0.25;
/// Largest number of a kind that is told: what is worse is bad enough.
const LEVEL_MAX: f64 = 100.0;

/// A road user's commanded motion.
struct Motion<'a> {
    kind: AgentKind,
    size_m: (f64, f64),
    from_step: usize,
    samples: &'a [Sample],
    /// Its recording, if it has one.
    recorded: Option<&'a Track>,
}

/// The probe of an intervention in its scene.
pub fn probe(situation: &Situation, intervention: &Intervention) -> Probe {
    let mut probe = Probe { actors: intervention.actions.len() as f64, ..Probe::NOTHING };
    for motion in intervention.actions.iter().filter_map(|action| motion(situation, action)) {
        meet(situation, &motion, &mut probe);
        let (length_m, width_m) = motion.size_m;
        let judged = situation.plant.feasibility_of(motion.kind, length_m, width_m, motion.samples);
        let worst = |so_far: f64, now: f64| if now.is_finite() { so_far.max(now).min(LEVEL_MAX) } else { LEVEL_MAX };
        probe.off_road_m = worst(probe.off_road_m, judged.off_road_m);
        probe.acceleration_mps2 = worst(probe.acceleration_mps2, judged.acceleration_mps2);
        probe.jerk_mps3 = worst(probe.jerk_mps3, judged.jerk_mps3);
    }
    probe
}

/// Returns the motion that an action commands; `None` for a script, which waits for the ego.
fn motion<'a>(situation: &'a Situation, action: &'a Action) -> Option<Motion<'a>> {
    match action {
        Action::Follow { track, from_step, samples }
        | Action::FollowThenReact { track, from_step, samples, .. }
        | Action::FollowThenObey { track, from_step, samples, .. } => {
            let of = situation.scene.tracks.get(*track)?;
            let size_m = (of.length_m, of.width_m);
            Some(Motion { kind: of.kind, size_m, from_step: *from_step, samples, recorded: Some(of) })
        }
        Action::Insert { kind, length_m, width_m, from_step, samples } => {
            let size_m = (*length_m, *width_m);
            Some(Motion { kind: *kind, size_m, from_step: *from_step, samples, recorded: None })
        }
        Action::Triggered(_) => None,
    }
}

/// When a motion begins, and how near it comes to where the ego drives undisturbed.
fn meet(situation: &Situation, motion: &Motion<'_>, found: &mut Probe) {
    let seconds = |step: usize| step.saturating_sub(situation.first_step()) as f64 * DT_S;
    for (step, sample) in motion.samples.iter().enumerate().map(|(k, sample)| (motion.from_step + k, sample)) {
        let recorded = motion.recorded.and_then(|track| track.at(step));
        if recorded.is_none_or(|was| was.position.distance(sample.position) > DEPARTED_M) {
            found.begins_s = found.begins_s.min(seconds(step));
        }
        let Some(ego) = situation.ego.body(step) else { continue };
        let (length_m, width_m) = motion.size_m;
        let distance_m = OrientedBox::new(sample.position, sample.heading_rad, length_m, width_m).distance(ego);
        found.ego_distance_m_min = found.ego_distance_m_min.min(distance_m);
        if distance_m < CONFLICT_M {
            found.conflict_s = found.conflict_s.min(seconds(step));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ego::Policy;
    use crate::kernel::Vec2;
    use crate::scene::fixture;
    use std::sync::Arc;

    #[test]
    fn a_vehicle_on_the_egos_path_is_near_and_one_that_keeps_its_recording_never_begins() {
        let situation = Situation::new(Arc::new(fixture::two_lane_scene()), &Policy::Idm).unwrap();
        let step = situation.first_step() + 5;
        let ego = *situation.ego.at(step).expect("the ego is there");
        let onto = vec![Sample { position: ego.position + Vec2::new(0.0, 0.1), ..ego }];
        let follow =
            |samples, from_step| Intervention { actions: vec![Action::Follow { track: 0, from_step, samples }] };
        let met = probe(&situation, &follow(onto, step));
        assert_eq!((met.ego_distance_m_min, met.conflict_s, met.begins_s, met.actors), (0.0, 0.5, 0.5, 1.0));
        let track = &situation.scene.tracks[0];
        let kept: Vec<Sample> = (step..step + 3).filter_map(|step| track.at(step).copied()).collect();
        assert_eq!(probe(&situation, &follow(kept, step)).begins_s, Probe::NOTHING.begins_s);
        assert_eq!(probe(&situation, &Intervention::default()), Probe::NOTHING);
    }
}
