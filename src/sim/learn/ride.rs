//! An episode as a learner sees it: its observations and actions in a setting, and the reward of each step.

use crate::ego::Setting;
use crate::ego::observation::{ACTION, route_turn_rad};
use crate::sim::{Control, End, Episode, Held, Intervention, Plant, SimError, View};

use super::reward::{Reward, Step};

/// Data that a ride keeps of itself.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Keeps {
    /// [`Episode::controls`].
    pub controls: bool,
    /// [`Episode::motion`].
    pub motion: bool,
}

/// A scene that is driven for learning.
pub struct Ride<'a> {
    episode: Episode<'a>,
    setting: Setting,
    /// Place along the route at the last decision, metres.
    last_s_m: f64,
    last: Step,
}

impl<'a> Ride<'a> {
    /// Begins at its first state. Nothing is summed up.
    pub fn new(
        plant: impl Into<Held<'a, Plant>>,
        intervention: impl Into<Held<'a, Intervention>>,
        setting: Setting,
        keeps: Keeps,
    ) -> Result<Ride<'a>, SimError> {
        let mut episode = Episode::without_account(plant, intervention)?;
        if keeps.controls {
            episode = episode.keeping_controls();
        }
        if keeps.motion {
            episode = episode.keeping_motion();
        }
        let last_s_m = episode.observe().ego().along.s_m;
        Ok(Ride { episode, setting, last_s_m, last: Step::default() })
    }

    /// Returns the episode behind it.
    pub fn episode(&self) -> &Episode<'a> {
        &self.episode
    }

    /// Returns the effects of the last step; nothing before the first.
    pub fn last(&self) -> &Step {
        &self.last
    }

    /// Returns the present view of a driver.
    pub fn view(&self) -> View<'_> {
        self.episode.observe()
    }

    /// Writes the setting's observation to `out`, in place of its contents.
    pub fn observe(&self, out: &mut Vec<f32>) {
        self.setting.observe(&self.view(), out);
    }

    /// Carries an action out, and returns the reward of the step, and the end if the episode ended.
    pub fn step(&mut self, action: [f32; ACTION], reward: &Reward) -> Result<(f64, Option<End>), SimError> {
        let control: Control = self.setting.control(&self.view(), action);
        let end = self.episode.step(control)?;
        let view = self.episode.observe();
        let step = step_to(&view, self.last_s_m, action);
        (self.last_s_m, self.last) = (view.ego().along.s_m, step);
        Ok((reward.of(&step, end), end))
    }
}

/// Returns the effects of an action that led to a view from a place along the route, metres.
pub fn step_to(view: &View<'_>, last_s_m: f64, action: [f32; ACTION]) -> Step {
    let (ego, route) = (view.ego(), view.route());
    Step {
        progress_m: ego.along.s_m - last_s_m,
        offset_m: ego.along.offset_m,
        turn_rad: route_turn_rad(view),
        speed_mps: ego.speed_mps,
        along_mps: ego.sample.velocity.dot(route.direction(ego.along.segment)),
        steering: f64::from(action[0]),
    }
}
