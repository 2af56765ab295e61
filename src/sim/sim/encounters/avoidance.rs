//! Finds out if a contact with an adversary could have been avoided: runs the same scene and intervention once more, up to the
//! moment at which the threat was visible and the ego could have reacted, and from there with each evasive manoeuvre.
//!
//! The rollout's account is not kept here, so a look back costs less than a rollout. Families' searches do not use it.

use crate::scene::DT_S;
use crate::sim::SimError;
use crate::sim::accounts::feasibility::DRIVABLE_TOLERANCE_M;
use crate::sim::accounts::outcome::{Contact, Outcome};
use crate::sim::prepared::options::AvoidanceOptions;
use crate::sim::prepared::plant::Plant;
use crate::sim::road_users::driver::Driver;
use crate::sim::road_users::intervention::{ActorRef, Intervention};
use crate::sim::rollouts::closed_loop::ClosedLoop;
use crate::sim::rollouts::rules::OFF_ROAD_OFFSET_M;

use super::class::ContactClass;
use super::evasion::{Evasion, Manoeuvre};
use super::jury::Watchers;
use super::threat::{ThreatWatch, in_steps};

/// Fills in since when the ego could see its contact with an adversary coming, and if it could have avoided it.
/// `outcome` must be the rollout of the same plant, intervention and driver. Other outcomes stay as they are.
pub fn assess(
    plant: &Plant,
    intervention: &Intervention,
    driver: &mut dyn Driver,
    outcome: &mut Outcome,
) -> Result<(), SimError> {
    assess_relived(&mut Driven::begun(plant, intervention, driver)?, outcome.contact.as_mut())
}

/// Sideways distances of swerves within a lane, metres.
const LESSER_SWERVES_M: [f64; 3] = [0.5, 1.0, 2.0];

/// Time before a contact in which late chances to evade are looked for, s.
const LATENESS_MAX_S: f64 = 4.0;

/// Returns `true` if the k-th step lies within the time before a contact in which the last chances to avoid it are looked for.
pub(super) fn is_late(contact: &Contact, k: usize) -> bool {
    contact.time_s - k as f64 * DT_S <= LATENESS_MAX_S
}

/// Returns how late the ego was to avoid its contact with an adversary: the time from the last moment at which an evasion would
/// have helped to the moment at which it could begin, s. Negative where it had time left; `None` where no evasion of the last
/// four seconds helps, and for other contacts. `outcome` must be the assessed rollout of the same plant, intervention and driver.
///
/// # Errors
/// The same as those of the rollout itself.
pub fn lateness_s(
    plant: &Plant,
    intervention: &Intervention,
    driver: &mut dyn Driver,
    outcome: &Outcome,
) -> Result<Option<f64>, SimError> {
    let Some(contact) = outcome.contact.filter(|contact| contact.adversary) else { return Ok(None) };
    let options = &plant.options().avoidance;
    let mut states: Vec<(usize, ClosedLoop<'_>)> = Vec::new();
    let last = relive(&mut Driven::begun(plant, intervention, driver)?, |rollout, k| {
        states.extend(is_late(&contact, k).then(|| (k, rollout.fork(k))));
    })?;
    let until = last + in_steps(options.horizon_s);
    let in_time = states.iter().rev().find(|(k, state)| avoids(state, *k, until, options));
    let in_time = in_time.map(|(k, _)| *k as f64 * DT_S);
    // An ego that never sees it coming cannot begin before the contact.
    let could_s = contact.visible_s.map_or(contact.time_s, |seen| contact.time_s - seen + options.reaction_s);
    Ok(in_time.map(|in_time| could_s.min(contact.time_s) - in_time))
}

/// Does the same as [`assess`] for the contact alone.
pub(in crate::sim) fn assess_contact(
    plant: &Plant,
    intervention: &Intervention,
    driver: &mut dyn Driver,
    contact: &mut Contact,
) -> Result<(), SimError> {
    let state = ClosedLoop::without_driver(plant.into(), intervention.into(), driver.follows_log())?;
    assess_relived(&mut Driven { state, driver }, Some(contact))
}

/// A rollout that is driven again, step by step.
pub(in crate::sim) trait Relived<'a> {
    fn state(&self) -> &ClosedLoop<'a>;

    /// Begins the k-th step.
    fn wake(&mut self, k: usize);

    /// Returns the present state as one that goes on by our own rules.
    fn fork(&self, k: usize) -> ClosedLoop<'a>;

    /// Carries the k-th step out. Returns `false` if the rollout ends in it.
    fn advance(&mut self, k: usize) -> Result<bool, SimError>;
}

/// Drives a rollout through to its end and calls a closure at the beginning of every step. Returns the last step.
pub(super) fn relive<'a>(
    rollout: &mut dyn Relived<'a>,
    mut look: impl FnMut(&dyn Relived<'a>, usize),
) -> Result<usize, SimError> {
    let mut last = 0;
    for k in 0..rollout.state().plant.steps() {
        last = k;
        rollout.wake(k);
        look(rollout, k);
        if !rollout.advance(k)? {
            break;
        }
    }
    Ok(last)
}

/// A rollout of our own, driven again.
pub(super) struct Driven<'a, 'd> {
    state: ClosedLoop<'a>,
    driver: &'d mut dyn Driver,
}

impl<'a, 'd> Driven<'a, 'd> {
    /// Begins at the first state, with the driver made ready.
    pub fn begun(
        plant: &'a Plant,
        intervention: &'a Intervention,
        driver: &'d mut dyn Driver,
    ) -> Result<Driven<'a, 'd>, SimError> {
        driver.begin(plant);
        let state = ClosedLoop::without_driver(plant.into(), intervention.into(), driver.follows_log())?;
        Ok(Driven { state, driver })
    }
}

impl<'a> Relived<'a> for Driven<'a, '_> {
    fn state(&self) -> &ClosedLoop<'a> {
        &self.state
    }

    fn wake(&mut self, k: usize) {
        self.state.wake(k);
    }

    fn fork(&self, _: usize) -> ClosedLoop<'a> {
        self.state.clone()
    }

    fn advance(&mut self, k: usize) -> Result<bool, SimError> {
        let state = &mut self.state;
        let control = self.driver.decide(&state.view(k));
        let Some(step) = state.carry_out(control, k)? else { return Ok(false) };
        state.decide_traffic(k);
        state.plan_others(k);
        if state.first_contact(k, &step).is_some() {
            return Ok(false);
        }
        state.commit(&step);
        Ok(true)
    }
}

/// Does the same as [`assess`] for a rollout that is driven again from its first state.
pub(in crate::sim) fn assess_relived<'a>(
    rollout: &mut dyn Relived<'a>,
    contact: Option<&mut Contact>,
) -> Result<(), SimError> {
    let Some(contact) = contact.filter(|contact| contact.adversary) else { return Ok(()) };
    let options = &{ rollout.state().plant.options().avoidance };
    let mut watchers = rollout.state().plant.options().jury.then(|| Watchers::of(contact, rollout.state()));
    let look_back = look_back(rollout, contact.with, options, watchers.as_mut())?;
    contact.visible_s = look_back.visible.map(|k| contact.time_s - k as f64 * DT_S);
    let until = look_back.contact + in_steps(options.horizon_s);
    contact.avoidable = Some(look_back.fork.is_some_and(|(k, state)| avoids(&state, k, until, options)));
    contact.jury = watchers.map(|watchers| watchers.jury(contact.avoidable, until));
    Ok(())
}

/// Returns `true` if some manoeuvre begun in a state at step `from` helps.
fn avoids(fork: &ClosedLoop<'_>, from: usize, until: usize, options: &AvoidanceOptions) -> bool {
    Manoeuvre::ALL.into_iter().any(|manoeuvre| helps(fork, from, until, manoeuvre, options))
}

/// Returns `true` if a manoeuvre begun in a state at the first step stays clear up to the second.
pub(super) fn helps(
    fork: &ClosedLoop<'_>,
    from: usize,
    until: usize,
    manoeuvre: Manoeuvre,
    options: &AvoidanceOptions,
) -> bool {
    // A manoeuvre straight ahead needs the far swerve only: there the distance makes no difference.
    let lesser: &[f64] = if options.lesser_swerves && manoeuvre.side() != 0.0 { &LESSER_SWERVES_M } else { &[] };
    let mut swerves_m = std::iter::once(options.swerve_m).chain(lesser.iter().copied());
    swerves_m.any(|swerve_m| {
        let evasion = Evasion::new(manoeuvre, swerve_m, &fork.ego, options);
        stays_clear(fork, from, until, &mut |state, k| {
            evasion.control(&state.plant.route, &state.ego, state.car(), k - from)
        })
    })
}

/// Findings about a contact from driving the rollout again.
struct LookBack<'a> {
    /// The decision step in which it happened.
    contact: usize,
    /// The decision step from which on the threat was visible.
    visible: Option<usize>,
    /// The state in which the ego could begin to evade.
    fork: Option<(usize, ClosedLoop<'a>)>,
}

/// Drives the rollout again up to its contact.
fn look_back<'a>(
    rollout: &mut dyn Relived<'a>,
    adversary: ActorRef,
    options: &AvoidanceOptions,
    mut watchers: Option<&mut Watchers<'a>>,
) -> Result<LookBack<'a>, SimError> {
    let mut watch = ThreatWatch::new(options, adversary);
    let reaction = in_steps(options.reaction_s);
    let mut look_back = LookBack { contact: 0, visible: None, fork: None };
    look_back.contact = relive(rollout, |rollout, k| {
        if let Some(watchers) = &mut watchers {
            watchers.look(rollout, k);
        }
        look_back.visible = watch.visible_since(rollout.state(), k);
        match look_back.visible {
            Some(visible) if visible + reaction < k => {}
            Some(visible) if visible + reaction == k => look_back.fork = Some((k, rollout.fork(k))),
            _ => look_back.fork = None,
        }
    })?;
    Ok(look_back)
}

/// Returns `true` if the ego under `control` (m/s², radians) touches nobody and keeps to the road from step `from` to `until`. A
/// recorded road user who runs into the slowing ego from behind is taken out: a recording does not react, so it cannot brake.
pub(super) fn stays_clear(
    fork: &ClosedLoop<'_>,
    from: usize,
    until: usize,
    control: &mut dyn FnMut(&ClosedLoop<'_>, usize) -> (f64, f64),
) -> bool {
    let mut state = fork.clone().without_springs();
    let plant = &*fork.plant;
    let beyond_m = beyond_road_m(&state).max(DRIVABLE_TOLERANCE_M);
    for k in from..until.min(plant.steps()) {
        state.wake(k);
        let (acceleration_mps2, steering_rad) = control(&state, k);
        let step = state.drive(acceleration_mps2, steering_rad, k);
        state.decide_traffic(k);
        state.plan_others(k);
        while let Some(hit) = state.first_contact(k, &step) {
            let class = state.describe(k, &hit, &step).class;
            match hit.with {
                ActorRef::Track(track) if hit.replayed && class == ContactClass::RearEndEgoStruck => {
                    state.take_out(track);
                }
                _ => return false,
            }
        }
        state.commit(&step);
        let along = &state.ego.along;
        let left_route = !plant.is_staged() && along.offset_m.abs() > OFF_ROAD_OFFSET_M;
        if left_route || beyond_road_m(&state) > beyond_m {
            return false;
        }
        if along.s_m > plant.route.length_m() {
            return true;
        }
    }
    true
}

/// Returns how far the ego's outermost corner lies beyond the lanes, metres.
fn beyond_road_m(state: &ClosedLoop<'_>) -> f64 {
    let ego = &state.ego;
    let shape = ego.size.at(crate::sim::prepared::body::Place { position: ego.sample.position, axis: ego.axis });
    let beyond = |corner| state.plant.drivable.distance_m(corner, 0.0, &mut 0);
    shape.corners().into_iter().map(beyond).fold(0.0, f64::max)
}
