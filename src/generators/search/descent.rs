//! Motions of adversaries as differentiable functions of a decision vector, and a gradient search over several at once
//! against an ego that is simulated again as they change. The search goes on after the first contact, so that the most
//! plausible of the motions that meet the ego can be chosen (`ranking`).

use std::sync::Arc;

use super::adam::{Adam, Rates};
use crate::kernel::{OrientedBox, Vec2};
use crate::motion::bicycle::State;
use crate::motion::kinematics::Slope;
use crate::motion::{Candidate, Drive, Driven};
use crate::scene::{DT_S, Sample, TrackIx};
use crate::stage::ego_rollout;
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
    /// `drive.states[k]` lies at scene step `from_step + k - 1`.
    pub drive: Drive,
    /// Bounding boxes of the states.
    pub boxes: Vec<OrientedBox>,
}

impl Mover {
    /// Returns the motion of a part at a place of its space.
    pub fn new(situation: &Situation, part: &Part, driven: &dyn Driven, place: Vec<f64>) -> Mover {
        let drive = driven.drive(&place);
        let body = |(k, state): (usize, &State)| {
            let axis = driven.axis(&drive, k).unwrap_or_else(|| Vec2::from_heading(state.heading_rad));
            situation.body_along(part.actor, state.position, axis)
        };
        let boxes = drive.states.iter().enumerate().map(body).collect();
        Mover { actor: part.actor, from_step: part.window.from_step, place, drive, boxes }
    }

    /// The state before the window and after each of its steps.
    pub fn states(&self) -> &[State] {
        &self.drive.states
    }

    /// Index of the state at a scene step, within the window.
    pub fn index(&self, step: usize) -> Option<usize> {
        let index = (step + 1).checked_sub(self.from_step).filter(|k| *k > 0)?;
        (index < self.boxes.len()).then_some(index)
    }

    /// Scene steps of the window.
    pub fn steps(&self) -> std::ops::Range<usize> {
        self.from_step..self.from_step + self.boxes.len() - 1
    }

    /// Its box at any scene step: the record's before the window, its last velocity kept after it; `None` where there is
    /// no record.
    pub fn body_at(&self, situation: &Situation, step: usize) -> Option<OrientedBox> {
        if let Some(index) = self.index(step) {
            return Some(self.boxes[index]);
        }
        let Some(late) = step.checked_sub(self.steps().end) else {
            return situation.scene.tracks[self.actor].at(step).map(|s| situation.body(self.actor, s));
        };
        let [.., before, last] = self.boxes.as_slice() else { return None };
        Some(OrientedBox { center: last.center + (last.center - before.center) * (late + 1) as f64, ..*last })
    }

    /// The motion in the window: velocity along the path, by central differences.
    pub fn samples(&self) -> Vec<Sample> {
        let states = self.states();
        let last = states.len() - 1;
        let velocity = |k: usize| {
            let (from, to) = (k - 1, (k + 1).min(last));
            (states[to].position - states[from].position) * (1.0 / ((to - from) as f64 * DT_S))
        };
        let sample = |k: usize| {
            let state = &states[k];
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

/// Slopes that a loss writes: for each mover at its states and, directly, at its decision vector.
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
            states: movers.iter().map(|m| vec![Slope::default(); m.boxes.len()]).collect(),
            places: movers.iter().map(|m| vec![0.0; m.place.len()]).collect(),
        }
    }

    /// The slope at a mover's decision vector.
    pub fn pulled(&self, index: usize, driven: &dyn Driven, mover: &Mover) -> Vec<f64> {
        let mut slope = driven.pull(&mover.drive, &self.states[index]);
        slope.iter_mut().zip(&self.places[index]).for_each(|(total, direct)| *total += direct);
        slope
    }
}

/// A loss in two parts.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Terms {
    /// Part that draws adversaries to the ego.
    pub attack: f64,
    /// Part that keeps them plausible.
    pub rest: f64,
}

impl Terms {
    /// The whole loss.
    pub fn total(&self) -> f64 {
        self.attack + self.rest
    }
}

/// Inputs of a loss.
#[derive(Clone, Copy, Debug)]
pub struct Asked<'a> {
    /// The adversaries' motions.
    pub movers: &'a [Mover],
    /// The ego's latest path.
    pub ego: &'a EgoPath,
    /// Nothing counts from this scene step on: the rollout is broken off there.
    pub until: usize,
    /// True if the slopes of the attack are wanted: not while the ego is being met, for then a search looks for the
    /// most plausible motion that still does.
    pub attacks: bool,
    /// True if the motions may be chosen. If not, only the slopes are of use, and their cost may be left out of the value.
    pub is_eligible: bool,
}

/// Loss that a search minimises.
pub trait Objective {
    /// The loss; its slopes are added to `slopes`.
    fn loss(&self, asked: &Asked<'_>, slopes: &mut Slopes) -> Terms;

    /// Scene step at which a rollout of these motions is broken off, whatever the ego does; `None`: never.
    fn broken_off(&self, _movers: &[Mover]) -> Option<usize> {
        None
    }
}

impl<F: Fn(&[Mover], &EgoPath, &mut Slopes) -> f64> Objective for F {
    fn loss(&self, asked: &Asked<'_>, slopes: &mut Slopes) -> Terms {
        Terms { attack: self(asked.movers, asked.ego, slopes), rest: 0.0 }
    }
}

/// State of all adversaries at one iteration.
#[derive(Clone, Debug)]
pub struct Iterate {
    /// The movers at this point.
    pub movers: Vec<Mover>,
    /// Value of each term of the loss here.
    pub terms: Terms,
    /// True if the ego, simulated against exactly these motions, touched an adversary before the rollout was broken off; `None`: not simulated.
    pub contact: Option<bool>,
    /// Scene step at which the objective broke the rollout off; `None`: it did not.
    pub broken_off: Option<usize>,
    /// Scene step at which the ego's latest rollout ended.
    pub end_step: usize,
}

/// How a search runs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Descent {
    /// Iterations without contact.
    pub iterations: usize,
    /// Iterations after the first contact.
    pub refinements: usize,
    /// Rates of Adam.
    pub rates: Rates,
    /// The ego is simulated anew at every this many iterations, at the last, and at all after the first contact.
    pub replay_every: usize,
}

/// Adam over all parts' decision vectors from the record on, until the ego has been met and some iterations more.
pub fn descend(situation: &Situation, parts: &[Part], descent: &Descent, objective: &impl Objective) -> Vec<Iterate> {
    let spaces: Vec<(&Part, &dyn Driven)> = parts.iter().filter_map(|p| Some((p, p.driven.as_deref()?))).collect();
    let mut places: Vec<Vec<f64>> = spaces.iter().map(|(_, d)| d.start().to_vec()).collect();
    let mut adams: Vec<Adam> = places.iter().map(|p| Adam::new(descent.rates, p.len())).collect();
    let mut ego: Option<EgoPath> = None;
    let mut last = descent.iterations;
    let mut has_met = false;
    let mut iterates: Vec<Iterate> = Vec::with_capacity(descent.iterations + descent.refinements + 1);
    let mut iteration = 0;
    while iteration <= last {
        let movers: Vec<Mover> =
            spaces.iter().zip(&places).map(|((p, d), x)| Mover::new(situation, p, *d, x.clone())).collect();
        let broken_off = objective.broken_off(&movers);
        let mut contact = None;
        if has_met || iteration % descent.replay_every.max(1) == 0 || iteration == last {
            let scripts = movers.iter().map(|m| (m.actor, m.from_step, m.samples())).collect();
            // Nothing is needed of a rollout beyond its break-off, unless its path serves further iterations.
            let until = broken_off.filter(|_| has_met || descent.replay_every <= 1);
            let Some(response) = ego_rollout::respond(situation, scripts, until) else { break };
            // Within the step that would have followed the path's last.
            let in_time = broken_off.is_none_or(|step| response.path.steps().end <= step);
            contact = Some(response.contact && in_time);
            ego = Some(response.path);
        }
        let met = contact == Some(true);
        if met && !has_met {
            (has_met, last) = (true, iteration + descent.refinements);
        }
        let mut slopes = Slopes::of(&movers);
        let asked = ego.as_ref().map(|ego| Asked {
            movers: &movers,
            ego,
            until: broken_off.unwrap_or(usize::MAX),
            attacks: !met,
            is_eligible: met || broken_off.is_none(),
        });
        let terms = asked.map_or(Terms::default(), |asked| objective.loss(&asked, &mut slopes));
        for (k, mover) in movers.iter().enumerate() {
            adams[k].step(&mut places[k], &slopes.pulled(k, spaces[k].1, mover));
        }
        let end_step = ego.as_ref().map_or(0, |ego| ego.steps().end);
        iterates.push(Iterate { movers, terms, contact, broken_off, end_step });
        if !terms.total().is_finite() || places.iter().flatten().any(|x| !x.is_finite()) {
            break;
        }
        iteration += 1;
    }
    iterates
}

/// Returns the motions of the parts at the start of a search: they follow their records.
pub fn at_record(situation: &Situation, parts: &[Part]) -> Vec<Mover> {
    let spaces = parts.iter().filter_map(|part| Some((part, part.driven.as_deref()?)));
    spaces.map(|(part, driven)| Mover::new(situation, part, driven, driven.start().to_vec())).collect()
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
