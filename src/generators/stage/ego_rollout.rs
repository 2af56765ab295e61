//! Response of the ego to adversaries: its policy simulated in the scene with their motions scripted.

use super::ego_path::EgoPath;
use super::situation::Situation;
use crate::scene::{Sample, TrackIx};
use crate::sim::{self, Action, Control, Driver, Intervention, Plant, View};

/// The ego's motion and whether it touched an adversary.
#[derive(Clone, Debug)]
pub struct Response {
    pub path: EgoPath,
    pub contact: bool,
}

/// Simulates the ego against scripted tracks: actor, first step, samples from there on; up to and with a scene step where
/// nothing after it is asked for. `None` where the simulator refuses the script.
pub fn respond(
    situation: &Situation,
    scripts: Vec<(TrackIx, usize, Vec<Sample>)>,
    until: Option<usize>,
) -> Option<Response> {
    let follow = |(track, from_step, samples)| Action::Follow { track, from_step, samples };
    let intervention = Intervention { actions: scripts.into_iter().map(follow).collect() };
    let mut watched = Watched { driver: situation.policy.driver(), seen: Vec::with_capacity(situation.plant.steps()) };
    let steps = until.map_or(usize::MAX, |step| (step + 1).saturating_sub(situation.plant.first_step()));
    let contact = sim::contact_within(&situation.plant, &intervention, &mut watched, steps).ok()?;
    let path = EgoPath::new(&situation.scene, situation.plant.first_step(), watched.seen);
    Some(Response { path, contact: contact.is_some_and(|c| c.adversary) })
}

/// A driver whose every place is noted: cheaper than tracing everyone.
struct Watched {
    driver: Box<dyn Driver>,
    seen: Vec<Sample>,
}

impl Driver for Watched {
    fn begin(&mut self, plant: &Plant) {
        self.driver.begin(plant);
    }

    fn decide(&mut self, view: &View<'_>) -> Control {
        self.seen.push(view.ego().sample);
        self.driver.decide(view)
    }

    fn follows_log(&self) -> bool {
        self.driver.follows_log()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ego::Policy;
    use crate::kernel::Vec2;
    use crate::scene::fixture::two_lane_scene;
    use std::sync::Arc;

    #[test]
    fn a_rollout_that_is_asked_for_up_to_a_step_is_the_beginning_of_the_whole_one() {
        let situation = Situation::new(Arc::new(two_lane_scene()), &Policy::Idm).unwrap();
        let (first, track) = (situation.plant.first_step(), &situation.scene.tracks[0]);
        // It drives into the ego's way and stands there, or stays where it is recorded.
        let script = |aside: Vec2| {
            let at = |step| track.at(step).map(|s| Sample { position: s.position + aside, ..*s });
            vec![(0, first + 1, (first + 1..situation.scene.steps).map_while(at).collect::<Vec<_>>())]
        };
        let ego = situation.ego.at(first + 20).unwrap().position - track.at(first + 20).unwrap().position;
        let (mut met, mut truncated) = (0, 0);
        for aside in [ego, Vec2::ZERO] {
            let whole = respond(&situation, script(aside), None).unwrap();
            let end = whole.path.steps().end;
            met += usize::from(whole.contact);
            for until in first..end + 3 {
                let part = respond(&situation, script(aside), Some(until)).unwrap();
                let steps = part.path.steps();
                assert_eq!((steps.start, steps.end), (whole.path.steps().start, end.min(until + 1)), "{until}");
                assert!(steps.clone().all(|step| part.path.at(step) == whole.path.at(step)), "{until}");
                // A reader that sees a contact in time sees the same.
                let in_time = |of: &Response| of.contact && of.path.steps().end <= until;
                assert_eq!(in_time(&part), in_time(&whole), "{until}");
                truncated += usize::from(steps.end < end);
            }
        }
        assert!(met == 1 && truncated > 20, "{met} {truncated}");
    }
}
