//! One rollout for learning: a driver that explores, and writes down what it saw, did and got.

use crate::ego::Setting;
use crate::ego::network::Mlp;
use crate::ego::observation::{ACTION, route_turn_rad};
use crate::kernel::Stream;
use crate::sim::{Control, Driver, End, Plant, SimError, View, ending};

use super::lesson::Lesson;
use super::memory::Episode;
use super::reward::{Reward, Step};
use super::sac::explore;

/// How an episode went.
#[derive(Clone, Debug, PartialEq)]
pub struct Driven {
    pub episode: Episode,
    pub end: End,
    /// Share of the route driven, 0..=1.
    pub completion: f64,
}

/// Explores one scene. `actor` is `None` where actions are drawn evenly.
pub fn drive(
    lesson: &Lesson,
    setting: Setting,
    reward: &Reward,
    actor: Option<&Mlp>,
    stream: Stream,
) -> Result<Driven, SimError> {
    let mut explorer = Explorer {
        setting,
        reward,
        actor,
        stream,
        episode: Episode::default(),
        last_s_m: 0.0,
        completion: 0.0,
        values: Vec::new(),
        spare: Vec::new(),
    };
    let (end, _) = ending(&lesson.plant, &lesson.intervention, &mut explorer)?;
    let Explorer { episode, completion, .. } = explorer;
    Ok(Driven { episode, end, completion })
}

struct Explorer<'a> {
    setting: Setting,
    reward: &'a Reward,
    actor: Option<&'a Mlp>,
    stream: Stream,
    episode: Episode,
    /// Place along the route at the last decision, metres.
    last_s_m: f64,
    completion: f64,
    values: Vec<f32>,
    spare: Vec<f32>,
}

impl Explorer<'_> {
    /// Takes what came of the last action, if there was one, and the state of now.
    fn see(&mut self, view: &View<'_>, end: Option<End>) {
        let (ego, route) = (view.ego(), view.route());
        if self.episode.rewards.len() < self.episode.actions.len() {
            let direction = route.direction(ego.along.segment);
            let steering = self.episode.actions.last().map_or(0.0, |action| f64::from(action[0]));
            let step = Step {
                progress_m: ego.along.s_m - self.last_s_m,
                offset_m: ego.along.offset_m,
                turn_rad: route_turn_rad(view),
                speed_mps: ego.speed_mps,
                along_mps: ego.sample.velocity.dot(direction),
                steering,
            };
            self.episode.rewards.push(self.reward.of(&step, end) as f32);
        }
        self.last_s_m = ego.along.s_m;
        self.completion = self.completion.max((ego.along.s_m / route.length_m()).clamp(0.0, 1.0));
        self.setting.observe(view, &mut self.values);
        self.episode.observations.extend_from_slice(&self.values);
    }
}

impl Driver for Explorer<'_> {
    fn begin(&mut self, _: &Plant) {}

    fn decide(&mut self, view: &View<'_>) -> Control {
        self.see(view, None);
        let action = match self.actor {
            Some(actor) => {
                explore(actor, &mut self.values, &mut self.spare, &mut self.stream);
                [self.values[0], self.values[1]]
            }
            None => core::array::from_fn::<f32, ACTION, _>(|_| self.stream.uniform(-1.0, 1.0) as f32),
        };
        self.episode.actions.push(action);
        self.setting.control(view, action)
    }

    fn finish(&mut self, view: &View<'_>, end: End) {
        self.see(view, Some(end));
        self.episode.is_terminal = end != End::Horizon;
    }
}
