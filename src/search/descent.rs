//! Motions of adversaries as differentiable functions of a decision vector, and a gradient search over several at once
//! against an ego that is simulated again as they change.

use std::sync::Arc;

use super::adam::{Adam, Rates};
use crate::kernel::{OrientedBox, num};
use crate::motion::bicycle::State;
use crate::motion::kinematics::Slope;
use crate::motion::{Candidate, Driven};
use crate::scene::{DT_S, Sample, TrackIx};
use crate::stage::ego_rollout;
use crate::stage::judged::Judged;
use crate::stage::operator::{Module, Part};
use crate::stage::{EgoPath, Situation};

/// One adversary as a loss sees it.
#[derive(Clone, Debug)]
pub struct Mover {
    /// The track that it moves.
    pub actor: TrackIx,
    /// Scene step of the window's first sample.
    pub from_step: usize,
    /// Its decision vector. `[dimensions]`
    pub place: Vec<f64>,
    /// `states[k]` lies at scene step `from_step + k - 1`.
    pub states: Vec<State>,
    /// Bounding boxes of the states.
    pub boxes: Vec<OrientedBox>,
}

impl Mover {
    fn new(situation: &Situation, part: &Part, driven: &dyn Driven, place: Vec<f64>) -> Mover {
        let states = driven.states(&place);
        let boxes = states.iter().map(|s| situation.body(part.actor, &s.sample())).collect();
        Mover { actor: part.actor, from_step: part.window.from_step, place, states, boxes }
    }

    /// Index of the state at a scene step, within the window.
    pub fn index(&self, step: usize) -> Option<usize> {
        let index = (step + 1).checked_sub(self.from_step).filter(|k| *k > 0)?;
        (index < self.states.len()).then_some(index)
    }

    /// Scene steps of the window.
    pub fn steps(&self) -> std::ops::Range<usize> {
        self.from_step..self.from_step + self.states.len() - 1
    }

    /// The motion in the window: velocity along the path, by central differences.
    pub fn samples(&self) -> Vec<Sample> {
        let last = self.states.len() - 1;
        let velocity = |k: usize| {
            let (from, to) = (k - 1, (k + 1).min(last));
            (self.states[to].position - self.states[from].position) * (1.0 / ((to - from) as f64 * DT_S))
        };
        let sample = |k: usize| {
            let state = &self.states[k];
            Sample { position: state.position, heading_rad: state.heading_rad, velocity: velocity(k) }
        };
        (1..=last).map(sample).collect()
    }
}

/// Scene steps that some mover's window covers.
pub fn covered(movers: &[Mover]) -> std::ops::Range<usize> {
    let from = movers.iter().map(|m| m.from_step).min().unwrap_or(0);
    from..movers.iter().map(|m| m.steps().end).max().unwrap_or(from)
}

/// Where a loss writes its slopes: for each mover at its states and, directly, at its decision vector.
#[derive(Clone, Debug, Default)]
pub struct Slopes {
    /// By each state of each mover. `[movers][states]`
    pub states: Vec<Vec<Slope>>,
    /// By each number of each decision vector. `[movers][dimensions]`
    pub places: Vec<Vec<f64>>,
}

impl Slopes {
    /// All zero, in the shape of the movers.
    pub fn of(movers: &[Mover]) -> Slopes {
        Slopes {
            states: movers.iter().map(|m| vec![Slope::default(); m.states.len()]).collect(),
            places: movers.iter().map(|m| vec![0.0; m.place.len()]).collect(),
        }
    }

    /// The slope at a mover's decision vector.
    pub fn pulled(&self, index: usize, driven: &dyn Driven, mover: &Mover) -> Vec<f64> {
        let mut slope = driven.pull(&mover.place, &mover.states, &self.states[index]);
        slope.iter_mut().zip(&self.places[index]).for_each(|(total, direct)| *total += direct);
        slope
    }
}

/// What all adversaries did at one iteration.
#[derive(Clone, Debug)]
pub struct Iterate {
    /// The movers at this point.
    pub movers: Vec<Mover>,
    /// Their loss.
    pub loss: f64,
    /// Whether the ego, simulated against exactly these motions, touched an adversary; `None`: not simulated.
    pub contact: Option<bool>,
}

/// How a search runs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Descent {
    /// Gradient steps.
    pub iterations: usize,
    /// Rates of Adam.
    pub rates: Rates,
    /// The ego is simulated anew at every this many iterations, and at the last.
    pub replay_every: usize,
}

/// Adam over all parts' decision vectors from the record on; ends at the first contact of the ego with an adversary.
/// `loss` gives the loss of the movers against the ego's latest path and writes its gradients.
pub fn descend(
    situation: &Situation,
    parts: &[Part],
    descent: &Descent,
    mut loss: impl FnMut(&[Mover], &EgoPath, &mut Slopes) -> f64,
) -> Vec<Iterate> {
    let driven: Vec<&dyn Driven> = parts.iter().filter_map(|p| p.driven.as_deref()).collect();
    let mut places: Vec<Vec<f64>> = driven.iter().map(|d| d.start().to_vec()).collect();
    let mut adams: Vec<Adam> = places.iter().map(|p| Adam::new(descent.rates, p.len())).collect();
    let mut ego: Option<EgoPath> = None;
    let mut iterates = Vec::with_capacity(descent.iterations + 1);
    for iteration in 0..=descent.iterations {
        let described = parts.iter().filter(|p| p.driven.is_some()).zip(&driven).zip(&places);
        let movers: Vec<Mover> = described.map(|((p, d), x)| Mover::new(situation, p, *d, x.clone())).collect();
        let mut contact = None;
        if iteration % descent.replay_every.max(1) == 0 || iteration == descent.iterations {
            let scripts = movers.iter().map(|m| (m.actor, m.from_step, m.samples())).collect();
            let Some(response) = ego_rollout::respond(situation, scripts) else { break };
            contact = Some(response.contact);
            ego = Some(response.path);
        }
        let mut slopes = Slopes::of(&movers);
        let value = ego.as_ref().map_or(0.0, |ego| loss(&movers, ego, &mut slopes));
        for (k, mover) in movers.iter().enumerate() {
            adams[k].step(&mut places[k], &slopes.pulled(k, driven[k], mover));
        }
        iterates.push(Iterate { movers, loss: value, contact });
        if contact == Some(true) || !value.is_finite() || places.iter().flatten().any(|x| !x.is_finite()) {
            break;
        }
    }
    iterates
}

/// Mean over the movers of an expression about a candidate.
pub fn judged(situation: &Situation, iterate: &Iterate, module: &Module, prior: impl Fn(&Mover) -> f64) -> f64 {
    let adversaries: Vec<TrackIx> = iterate.movers.iter().map(|m| m.actor).collect();
    let of = |mover: &Mover| {
        let judged = Judged { situation, actor: mover.actor, from_step: mover.from_step, adversaries: &adversaries };
        module.of_candidate(&Candidate::new(mover.samples(), prior(mover)), &judged)
    };
    num::sum(iterate.movers.iter().map(of)) / iterate.movers.len().max(1) as f64
}

/// The weight that an expression about an actor gives to each part that is moved, clamped; 1 without one.
pub fn actor_weights(situation: &Situation, parts: &[Part], module: Option<&Module>) -> Vec<f64> {
    let weight_of = |part: &Part| match module {
        Some(module) => {
            let facts = situation.actors[part.actor].as_ref();
            module.number(facts.map_or(vec![], |f| f.values.clone())).clamp(WEIGHT_MIN, WEIGHT_MAX)
        }
        None => 1.0,
    };
    parts.iter().filter(|p| p.driven.is_some()).map(weight_of).collect()
}

const WEIGHT_MIN: f64 = 0.05;
const WEIGHT_MAX: f64 = 20.0;

/// Gap between the scores of iterates with contact and those without.
const NO_CONTACT: f64 = -1000.0;
/// Losses are mapped to values below this, so that no loss outweighs a contact.
const LOSS_MAX: f64 = 400.0;

/// The score of an iterate: smaller losses first, and contact before everything else.
pub fn score(contact: Option<bool>, loss: f64) -> f64 {
    let squeezed = if loss.is_finite() { LOSS_MAX * loss / (LOSS_MAX + loss.abs()) } else { LOSS_MAX };
    if contact == Some(true) { -squeezed } else { NO_CONTACT - squeezed }
}

/// Indices of at most `most` iterates, in order: the last, the one with the smallest loss, and an even selection.
pub fn selection(iterates: &[Iterate], most: usize) -> Vec<usize> {
    let Some(last) = iterates.len().checked_sub(1) else { return vec![] };
    let best = (0..=last).min_by(|a, b| iterates[*a].loss.total_cmp(&iterates[*b].loss)).unwrap_or(last);
    let even = most.saturating_sub(2).max(1);
    let mut chosen: Vec<usize> = (0..even).map(|k| k * last / even).chain([best, last]).collect();
    chosen.sort_unstable();
    chosen.dedup();
    chosen
}

/// Puts iterates into the parts as candidates that belong together: `chosen` are their indices and scores, `prior`
/// gives the log-probability of a motion.
pub fn into_candidates(
    parts: &mut [Part],
    iterates: &[Iterate],
    chosen: &[(usize, f64)],
    prior: impl Fn(&Mover) -> f64,
) {
    let with_space = parts.iter_mut().filter(|p| p.driven.is_some());
    for (which, part) in with_space.enumerate() {
        let candidate = |(index, score): &(usize, f64)| {
            let mover = &iterates[*index].movers[which];
            let candidate = Candidate::new(mover.samples(), prior(mover));
            Candidate { score: *score, iterate: Some(*index), ..candidate }
        };
        part.candidates = chosen.iter().map(candidate).collect();
    }
}

/// Opens the space of a part and makes the motion that follows the record its only candidate.
pub fn open(part: &mut Part, situation: &Situation, driven: Option<Arc<dyn Driven>>) {
    part.candidates.clear();
    if let Some(space) = &driven {
        let mover = Mover::new(situation, part, space.as_ref(), space.start().to_vec());
        part.candidates.push(Candidate { iterate: Some(0), ..Candidate::new(mover.samples(), 0.0) });
    }
    part.driven = driven;
}

/// For tests of losses: the largest error of the pulled slopes against central differences, relative to the slope, at
/// the records moved by `shift(dimension)`.
#[cfg(test)]
pub fn slope_error(
    situation: &Situation,
    parts: &[Part],
    shift: impl Fn(usize) -> f64,
    loss: impl Fn(&[Mover], &mut Slopes) -> f64,
) -> f64 {
    let driven: Vec<&dyn Driven> = parts.iter().filter_map(|p| p.driven.as_deref()).collect();
    let places: Vec<Vec<f64>> =
        driven.iter().map(|d| d.start().iter().enumerate().map(|(k, x)| x + shift(k)).collect()).collect();
    let movers = |places: &[Vec<f64>]| -> Vec<Mover> {
        parts.iter().zip(&driven).zip(places).map(|((p, d), x)| Mover::new(situation, p, *d, x.clone())).collect()
    };
    let value = |places: &[Vec<f64>]| {
        let movers = movers(places);
        loss(&movers, &mut Slopes::of(&movers))
    };
    let at = movers(&places);
    let mut slopes = Slopes::of(&at);
    loss(&at, &mut slopes);
    let mut worst: f64 = 0.0;
    for which in 0..places.len() {
        let pulled = slopes.pulled(which, driven[which], &at[which]);
        for (k, found) in pulled.into_iter().enumerate() {
            let moved = |step: f64| {
                let mut places = places.clone();
                places[which][k] += step;
                value(&places)
            };
            let difference = (moved(1e-6) - moved(-1e-6)) / 2e-6;
            worst = worst.max((difference - found).abs() / (1.0 + difference.abs()));
        }
    }
    worst
}
