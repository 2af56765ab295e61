//! What the ego does about adversaries: its policy simulated in the scene with their motions scripted.

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

/// Simulates the ego against scripted tracks: actor, first step, samples from there on. `None` where the simulator
/// refuses the script.
pub fn respond(situation: &Situation, scripts: Vec<(TrackIx, usize, Vec<Sample>)>) -> Option<Response> {
    let follow = |(track, from_step, samples)| Action::Follow { track, from_step, samples };
    let intervention = Intervention { actions: scripts.into_iter().map(follow).collect() };
    let mut watched = Watched { driver: situation.policy.driver(), seen: Vec::with_capacity(situation.plant.steps()) };
    let (_, contact) = sim::ending(&situation.plant, &intervention, &mut watched).ok()?;
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
