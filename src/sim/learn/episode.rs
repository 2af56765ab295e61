//! One rollout for learning: the exploring ego writes down its observations, actions and rewards.

use crate::ego::Setting;
use crate::ego::network::Mlp;
use crate::ego::observation::ACTION;
use crate::kernel::Stream;
use crate::sim::{End, SimError};

use super::lesson::Lesson;
use super::memory::Episode;
use super::reward::Reward;
use super::ride::{Keeps, Ride};
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
    mut stream: Stream,
) -> Result<Driven, SimError> {
    let mut ride = Ride::new(&*lesson.plant, &lesson.intervention, setting, Keeps::default())?;
    let (mut values, mut spare) = (Vec::new(), Vec::new());
    let mut episode = Episode::default();
    let mut completion: f64 = 0.0;
    loop {
        let along = ride.view().ego().along;
        completion = completion.max((along.s_m / lesson.plant.route().length_m()).clamp(0.0, 1.0));
        ride.observe(&mut values);
        episode.observations.extend_from_slice(&values);
        if let Some(end) = ride.episode().end() {
            episode.is_terminal = end != End::Horizon;
            return Ok(Driven { episode, end, completion });
        }
        let action = match actor {
            Some(actor) => {
                explore(actor, &mut values, &mut spare, &mut stream);
                [values[0], values[1]]
            }
            None => core::array::from_fn::<f32, ACTION, _>(|_| stream.uniform(-1.0, 1.0) as f32),
        };
        let (worth, _) = ride.step(action, reward)?;
        episode.actions.push(action);
        episode.rewards.push(worth as f32);
    }
}
