//! Means to take counsel about a scene: the vehicles as a model is shown them, the program that carries its proposals
//! out, and what went wrong with one. This module does not know who is asked, or when.

use super::deliberation::reaches;
use super::promise::{known, promise, time_to_collision_s, weights};
use super::reflection::{evaluate, timing};
use super::words::{COUNSEL_WEIGHT, PRIOR};
use crate::families::prior;
use crate::kernel::num;
use crate::motion::Window;
use crate::objects::counsel::{LaneRelation, Trial, Vehicle};
use crate::objects::{ParameterValue, Program};
use crate::scene::{DT_S, Sample, TrackIx};
use crate::sim::Outcome;
use crate::stage::actors::{ActorFacts, arrivals_s};
use crate::stage::{Part, Settings, Situation, Stage, StageError};

/// Weight of counsel that nothing else of a score reaches.
pub const TRUST_MAX: f64 = 20.0;

/// The program that carries out what a counsel says, with no search of its own.
pub fn blind(program: &Program) -> Program {
    let mut blind = program.clone();
    for (name, value) in [(COUNSEL_WEIGHT, TRUST_MAX), ("reflection_rounds", 0.0)] {
        blind.parameters.insert(name.into(), ParameterValue::Number(value));
    }
    blind
}

/// Most vehicles that the program lets attack together.
pub fn attackers_max(program: &Program) -> Result<usize, StageError> {
    let settings = settings_of(program);
    Ok(settings.count("attacker_count")?.min(settings.count("pool_size")?).max(1))
}

/// The `count` most promising vehicles by the program's weights, most promising first: the rules' own proposal.
pub fn vehicles(stage: &Stage<'_>, program: &Program, count: usize) -> Result<Vec<Vehicle>, StageError> {
    let settings = settings_of(program);
    let (weights, reach_weight) = (weights(&settings)?, settings.number("reach_weight")?);
    let mut ranked: Vec<(TrackIx, &ActorFacts, f64)> =
        known(stage).map(|(track, facts)| (track, facts, promise(facts, &weights))).collect();
    ranked.sort_by(|a, b| b.2.total_cmp(&a.2));
    ranked.truncate(count);
    let mut shown = Vec::with_capacity(ranked.len());
    for (track, facts, promised) in ranked {
        let vehicle = vehicle(stage.situation, track, facts, reach(stage, &settings, track)?);
        shown.push((promised + if vehicle.reach { reach_weight } else { 0.0 }, vehicle));
    }
    shown.sort_by(|a, b| b.0.total_cmp(&a.0));
    Ok(shown.into_iter().map(|(_, vehicle)| vehicle).collect())
}

/// Returns the result of a proposal. `way` gives the leader's samples and the scene step of the first; it is called only if needed.
pub fn trial(situation: &Situation, outcome: &Outcome, way: impl FnOnce() -> (usize, Vec<Sample>)) -> Trial {
    let evaluation = evaluate(situation, outcome, || {
        let (from_step, samples) = way();
        timing(situation, from_step, &samples)
    });
    match evaluation.failure {
        None => Trial::Contact,
        Some(failure) => Trial::Missed {
            failure,
            distance_m_min: outcome.distance_m_min.map(|distance_m| num::rounded(distance_m, 3)),
        },
    }
}

/// The program's parameters as settings: the parent's settings follow the parameters of their names.
fn settings_of(program: &Program) -> Settings {
    let number = |(name, value): (&String, &ParameterValue)| match value {
        ParameterValue::Number(number) => Some((name.clone(), *number)),
        ParameterValue::Choice(_) => None,
    };
    Settings { numbers: program.parameters.iter().filter_map(number).collect(), ..Settings::default() }
}

/// Returns `true` if a vehicle can reach the ego after the history.
fn reach(stage: &Stage<'_>, settings: &Settings, track: TrackIx) -> Result<bool, StageError> {
    let from_step = stage.situation.first_step();
    let asked = (settings.number("duration_s")? / DT_S).round().clamp(0.0, 1e6) as usize;
    let window = Window { from_step, steps: asked.min(stage.situation.scene.steps.saturating_sub(from_step)) };
    let mut part = [Part { actor: track, window, candidates: vec![], offsets: None, driven: None, simulated: 0 }];
    prior::propose(stage, &prior::options(settings, PRIOR)?, &mut part);
    let discount = settings.number("attack_discount")?;
    Ok(reaches(stage.situation, track, from_step, discount, &mut part[0].candidates))
}

fn vehicle(situation: &Situation, track: TrackIx, facts: &ActorFacts, reach: bool) -> Vehicle {
    let value = |name: &str| facts.value(name).unwrap_or(0.0);
    let own = situation.track(track);
    let lane = if value("same_lane") != 0.0 {
        LaneRelation::Same
    } else if value("adjacent_lane") != 0.0 {
        LaneRelation::Adjacent
    } else {
        LaneRelation::Other
    };
    Vehicle {
        track,
        id: own.id.clone(),
        length_m: own.length_m,
        ahead_m: value("longitudinal_offset_m"),
        left_m: value("lateral_offset_m"),
        gap_m: value("gap_m"),
        speed_mps: value("actor_speed_mps"),
        heading_difference_rad: value("heading_difference_rad"),
        lane,
        time_to_collision_s: time_to_collision_s(facts),
        conflict: value("paths_cross") != 0.0,
        reach,
        arrivals_s: arrivals_s(&situation.scene, &situation.ego, own),
    }
}
