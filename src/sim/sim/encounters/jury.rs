//! Verdicts of several drivers about avoiding a contact: the careful driver of [`Contact::avoidable`], and the reference drivers of UN
//! Regulation 157 where they are defined. These keep their lane and only brake, for others that cut in, stand or drive ahead.

use crate::scene::DT_S;
use crate::sim::SimError;
use crate::sim::accounts::outcome::{Contact, Outcome};
use crate::sim::prepared::plant::Plant;
use crate::sim::road_users::driver::Driver;
use crate::sim::road_users::intervention::Intervention;
use crate::sim::rollouts::closed_loop::ClosedLoop;

use super::avoidance::{Driven, Relived, relive, stays_clear};
use super::class::{ContactClass, PATH_CLEARANCE_M};
use super::evasion::{Evasion, Manoeuvre};
use super::threat::in_steps;
use super::verdict::Jury;

/// g, m/s².
const GRAVITY_MPS2: f64 = 9.81;
/// Largest distance at which the lane of a place is looked for, metres.
const LANE_WITHIN_M: f64 = 3.0;

/// A driver of the regulation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Juror {
    /// Paragraph 5.2.5.2: 0.35 s after the intrusion it brakes with 6 m/s².
    Reg157,
    /// The competent and careful human driver of 01 series, amendment 4, table 1.
    HumanDriver,
    /// The fuzzy safety model of the same amendment.
    Fuzzy,
}

/// Human driver, table 1: a lane changer is perceived at this offset from its lane's centre, metres, where the time to collision is at
/// most this, s; then 0.4 s to evaluate and 0.75 s to begin to brake. A leader's braking above this, m/s², is perceived and evaluated already.
const PERCEIVED_M: f64 = 0.375;
const PERCEIVED_TTC_S: f64 = 2.0;
const EVALUATES_S: f64 = 0.4;
const BEGINS_S: f64 = 0.75;
const PERCEIVED_MPS2: f64 = 5.0;
/// It reaches 0.774 g after 0.6 s; 0.6 s after the other is wholly in its path the car brakes with 0.85 g.
const HUMAN: Braking = Braking { delay_s: EVALUATES_S + BEGINS_S, rise_s: 0.6, brake_mps2: 0.774 * GRAVITY_MPS2 };
const EMERGENCY: Braking = Braking { delay_s: 0.0, rise_s: 0.6, brake_mps2: 0.85 * GRAVITY_MPS2 };
const REG157: Braking = Braking { delay_s: 0.35, rise_s: 0.0, brake_mps2: 6.0 };

/// Fuzzy safety model: reaction s, comfortable and largest braking, the other's largest, m/s², the gap at standstill, metres, the jerk, m/s³.
const REACTION_S: f64 = 0.75;
const COMFORT_MPS2: f64 = 4.0;
const MOST_MPS2: f64 = 6.0;
const OTHERS_MOST_MPS2: f64 = 7.0;
const STANDSTILL_M: f64 = 2.0;
const JERK_MPS3: f64 = 12.65;
/// Margin of its lateral check on the time in which both pass, s.
const PASSES_S: f64 = 0.1;

/// Braking that begins after a delay and rises evenly.
#[derive(Clone, Copy)]
struct Braking {
    delay_s: f64,
    rise_s: f64,
    brake_mps2: f64,
}

impl Braking {
    /// Returns the speed lost up to a time, m/s.
    fn lost_mps(&self, seconds: f64) -> f64 {
        let since_s = (seconds - self.delay_s).max(0.0);
        if since_s < self.rise_s {
            return self.brake_mps2 * since_s * since_s / (2.0 * self.rise_s);
        }
        self.brake_mps2 * (since_s - 0.5 * self.rise_s)
    }

    /// Returns the mean deceleration over a step that begins so many steps after the beginning, m/s².
    fn at(&self, steps: usize) -> f64 {
        let from_s = steps as f64 * DT_S;
        (self.lost_mps(from_s + DT_S) - self.lost_mps(from_s)) / DT_S
    }
}

/// The other one as a driver who keeps its lane sees it, in the frame of the ego's route.
#[derive(Clone, Copy, Debug)]
struct Ahead {
    /// Gap from the ego's bumper to its near end, metres.
    gap_m: f64,
    /// Between the flanks, metres; below 0 where one is behind the other.
    clearance_m: f64,
    /// Speed towards the ego's path, m/s.
    approach_mps: f64,
    own_mps: f64,
    own_mps2: f64,
    other_mps: f64,
    /// Offset of its centre from the centre of its lane, metres.
    off_lane_m: f64,
    /// Sum of both lengths, metres.
    lengths_m: f64,
    /// True if all of it is in the ego's path.
    is_wholly_in: bool,
}

impl Ahead {
    /// Returns the other's state; `None` where it is gone, or no longer ahead.
    fn of(state: &ClosedLoop<'_>, actor: usize) -> Option<Ahead> {
        let (actor, ego, plant) = (&state.world.actors[actor], &state.ego, &*state.plant);
        let now = actor.now.as_ref()?;
        let place = plant.route.project(now.position);
        let direction = plant.route.direction(place.segment);
        let (along, across) = (direction.dot(actor.axis).abs(), direction.cross(actor.axis).abs());
        let (half_length_m, half_width_m) = (actor.size.half_length_m, actor.size.half_width_m);
        let (reach_m, half_m) =
            (half_length_m * along + half_width_m * across, half_length_m * across + half_width_m * along);
        let gap_m = place.s_m - ego.along.s_m - reach_m - ego.size.half_length_m;
        let beside_m = place.offset_m - ego.along.offset_m;
        let to_ego = if beside_m > 0.0 { -1.0 } else { 1.0 };
        let lane = plant.lanes().nearest_lane(now.position, now.heading_rad, LANE_WITHIN_M);
        let off_lane_m = lane
            .and_then(|lane| Some(plant.lanes().centre(lane.lane)?.project(now.position).offset_m.abs()))
            .unwrap_or(0.0);
        (gap_m > -2.0 * reach_m).then_some(Ahead {
            gap_m,
            clearance_m: beside_m.abs() - half_m - ego.size.half_width_m,
            approach_mps: to_ego * direction.cross(now.velocity),
            own_mps: ego.speed_mps,
            own_mps2: ego.acceleration_mps2,
            other_mps: direction.dot(now.velocity),
            off_lane_m,
            lengths_m: 2.0 * (reach_m + ego.size.half_length_m),
            is_wholly_in: beside_m.abs() + half_m <= ego.size.half_width_m + PATH_CLEARANCE_M,
        })
    }

    /// Returns `true` if it reaches into the ego's path.
    fn intrudes(&self) -> bool {
        self.clearance_m < PATH_CLEARANCE_M
    }

    fn time_to_collision_s(&self) -> f64 {
        let closing_mps = self.own_mps - self.other_mps;
        if closing_mps > 0.0 { self.gap_m.max(0.0) / closing_mps } else { f64::INFINITY }
    }

    /// Returns the deceleration of the fuzzy safety model, m/s².
    fn fuzzy_mps2(&self) -> f64 {
        let (u, c, gap_m) = (self.own_mps, self.other_mps.max(0.0), self.gap_m);
        if self.clearance_m > 0.0 {
            let passes_s = (gap_m + self.lengths_m) / (u - c) + PASSES_S;
            if u <= c || self.approach_mps <= 0.0 || self.clearance_m / self.approach_mps >= passes_s {
                return 0.0;
            }
        }
        let ramp = |x: f64, unsafe_m: f64, safe_m: f64| {
            if x < unsafe_m {
                1.0
            } else if x >= safe_m {
                0.0
            } else {
                (safe_m - x) / (safe_m - unsafe_m)
            }
        };
        let stops_m = |brake_mps2: f64| u * REACTION_S + u * u / (2.0 * brake_mps2) - c * c / (2.0 * OTHERS_MOST_MPS2);
        let proactive = ramp(gap_m - STANDSTILL_M, stops_m(MOST_MPS2), stops_m(COMFORT_MPS2) + STANDSTILL_M);
        let slowed = u + self.own_mps2.max(-COMFORT_MPS2) * REACTION_S;
        let [unsafe_m, safe_m] = if u <= c {
            [0.0; 2]
        } else if slowed <= c {
            [(u - c) * (u - c) / (2.0 * self.own_mps2.max(-COMFORT_MPS2).abs()); 2]
        } else {
            let way_m = (0.5 * (u + slowed) - c) * REACTION_S;
            [MOST_MPS2, COMFORT_MPS2].map(|brake_mps2| way_m + (slowed - c) * (slowed - c) / (2.0 * brake_mps2))
        };
        match ramp(gap_m, unsafe_m, safe_m) {
            critical if critical > 0.0 => critical * (MOST_MPS2 - COMFORT_MPS2) + COMFORT_MPS2,
            _ => proactive * COMFORT_MPS2,
        }
    }
}

/// A driver of the regulation who watches a rollout, and the state in which it begins to act.
struct Watcher<'a> {
    juror: Juror,
    braking: Braking,
    begins: Option<(usize, ClosedLoop<'a>)>,
}

impl<'a> Watcher<'a> {
    /// Returns the drivers that are defined for a class of contact.
    fn all(class: ContactClass) -> Vec<Watcher<'a>> {
        let of = |juror, braking| Watcher { juror, braking, begins: None };
        let follows = Braking { delay_s: BEGINS_S, ..HUMAN };
        match class {
            ContactClass::CutIn => {
                vec![of(Juror::Reg157, REG157), of(Juror::HumanDriver, HUMAN), of(Juror::Fuzzy, REG157)]
            }
            ContactClass::EgoStrikes => vec![of(Juror::HumanDriver, follows), of(Juror::Fuzzy, REG157)],
            ContactClass::StationaryHit => vec![of(Juror::Fuzzy, REG157)],
            _ => Vec::new(),
        }
    }

    /// Returns `true` if there is a reason to act.
    fn is_alarmed(&self, class: ContactClass, ahead: &Ahead, other_mps2: f64) -> bool {
        match (self.juror, class) {
            (Juror::Reg157, _) => ahead.intrudes(),
            (Juror::HumanDriver, ContactClass::EgoStrikes) => {
                // Once it brakes, the leader is watched until the contact.
                ahead.intrudes() && (self.begins.is_some() || -other_mps2 > PERCEIVED_MPS2)
            }
            (Juror::HumanDriver, _) => {
                let changes = ahead.off_lane_m > PERCEIVED_M && ahead.approach_mps > 0.0;
                self.begins.is_some() && (changes || ahead.intrudes())
                    || (changes || ahead.intrudes()) && ahead.time_to_collision_s() <= PERCEIVED_TTC_S
            }
            _ => ahead.fuzzy_mps2() > 0.0,
        }
    }

    /// Returns `true` if this driver would have stayed clear; `None` for one that the regulation does not define here.
    fn avoids(&self, class: ContactClass, actor: usize, until: usize) -> Option<bool> {
        let Some((from, fork)) = &self.begins else {
            // A leader's weaker braking is undefined. Any other driver that sees no reason to act meets the other.
            return (self.juror != Juror::HumanDriver || class != ContactClass::EgoStrikes).then_some(false);
        };
        let options = &{ fork.plant.options().avoidance };
        let evasion = Evasion::new(Manoeuvre::Brake, options.swerve_m, &fork.ego, options);
        let before_mps2 = (-fork.ego.acceleration_mps2).max(0.0);
        let (mut braked_mps2, mut wholly_in) = (before_mps2, None);
        Some(stays_clear(fork, *from, until, &mut |state, k| {
            let (_, steering_rad) = evasion.control(&state.plant.route, &state.ego, state.car(), k - from);
            let ahead = Ahead::of(state, actor);
            if self.juror == Juror::Fuzzy {
                let wanted_mps2 = ahead.map_or(0.0, |ahead| ahead.fuzzy_mps2());
                braked_mps2 += (wanted_mps2 - braked_mps2).clamp(-JERK_MPS3 * DT_S, JERK_MPS3 * DT_S);
                return (-braked_mps2, steering_rad);
            }
            // The regulation has the emergency brake for cut-ins only.
            let has_emergency = self.juror == Juror::HumanDriver && class == ContactClass::CutIn;
            if has_emergency && ahead.is_some_and(|ahead| ahead.is_wholly_in) {
                wholly_in = wholly_in.or(Some(k));
            }
            let emergency_mps2 = wholly_in.map_or(0.0, |since| EMERGENCY.at(k - since));
            (-self.braking.at(k - from).max(emergency_mps2).max(before_mps2), steering_rad)
        }))
    }
}

/// The drivers of the regulation while a rollout is driven again.
pub(super) struct Watchers<'a> {
    class: ContactClass,
    /// Index of the adversary in `world.actors`.
    actor: usize,
    before_mps: Option<f64>,
    all: Vec<Watcher<'a>>,
}

impl<'a> Watchers<'a> {
    /// Returns the drivers for a contact with an adversary, at a rollout's first state.
    pub fn of(contact: &Contact, state: &ClosedLoop<'_>) -> Watchers<'a> {
        let actor = state.world.actors.iter().position(|actor| actor.who == contact.with).unwrap_or(0);
        Watchers { class: contact.class, actor, before_mps: None, all: Watcher::all(contact.class) }
    }

    /// Looks at the beginning of the k-th step. Called once a step, in order.
    pub fn look(&mut self, rollout: &dyn Relived<'a>, k: usize) {
        let ahead = Ahead::of(rollout.state(), self.actor);
        let other_mps2 = match (ahead, self.before_mps) {
            (Some(ahead), Some(before)) => (ahead.other_mps - before) / DT_S,
            _ => 0.0,
        };
        self.before_mps = ahead.map(|ahead| ahead.other_mps);
        for watcher in &mut self.all {
            if !ahead.is_some_and(|ahead| watcher.is_alarmed(self.class, &ahead, other_mps2)) {
                watcher.begins = None;
            } else if watcher.begins.is_none() {
                watcher.begins = Some((k, rollout.fork(k)));
            }
        }
    }

    /// Returns the verdicts of these and of the careful driver; evading must stay clear up to a step.
    pub fn jury(&self, careful: Option<bool>, until: usize) -> Jury {
        let mut jury = Jury { careful, ..Jury::default() };
        for watcher in &self.all {
            let avoids = watcher.avoids(self.class, self.actor, until);
            match watcher.juror {
                Juror::Reg157 => jury.reg157 = avoids,
                Juror::HumanDriver => jury.human_driver = avoids,
                Juror::Fuzzy => jury.fuzzy = avoids,
            }
        }
        jury
    }
}

/// Returns the jury's verdict on an assessed contact with an adversary; `None` for any other. `outcome` must be the assessed rollout of the
/// same plant, intervention and driver.
///
/// # Errors
/// The same as those of the rollout itself.
pub fn jury(
    plant: &Plant,
    intervention: &Intervention,
    driver: &mut dyn Driver,
    outcome: &Outcome,
) -> Result<Option<Jury>, SimError> {
    let Some(contact) = outcome.contact.filter(|contact| contact.adversary) else { return Ok(None) };
    if contact.jury.is_some() || contact.avoidable.is_none() {
        return Ok(contact.jury);
    }
    let mut rollout = Driven::begun(plant, intervention, driver)?;
    let mut watchers = Watchers::of(&contact, rollout.state());
    let last = relive(&mut rollout, |rollout, k| watchers.look(rollout, k))?;
    Ok(Some(watchers.jury(contact.avoidable, last + in_steps(plant.options().avoidance.horizon_s))))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernel::{Vec2, num};
    use std::sync::Arc;

    use crate::scene::{Lane, PreparedScene, Sample};
    use crate::sim::road_users::driver::{Control, View};
    use crate::sim::scenes::{car, lane, sample, straight, straight_road};
    use crate::sim::{Action, SimulatorOptions, rollout_assessed};

    /// Goes on at its speed.
    struct Steady;

    impl Driver for Steady {
        fn begin(&mut self, _: &Plant) {}

        fn decide(&mut self, _: &View<'_>) -> Control {
            Control::Drive { acceleration_mps2: 0.0, steering_rad: 0.0 }
        }
    }

    const STEPS: usize = 121;

    /// Returns the verdict on an adversary that moves like this before an ego at 15 m/s, whose bumper begins at 2.25 m.
    fn said(samples: Vec<Sample>) -> Jury {
        let tracks = vec![car("other", samples.iter().copied().map(Some).collect())];
        let mut scene = straight_road(STEPS, 15.0, tracks);
        scene.road.lanes.push(Lane { id: "left".into(), ..lane(Vec2::new(-50.0, 4.0), Vec2::new(250.0, 4.0)) });
        let plant = Plant::new(&scene).unwrap();
        let act = Intervention { actions: vec![Action::Follow { track: 0, from_step: 0, samples }] };
        let outcome = rollout_assessed(&plant, &act, &mut Steady).unwrap();
        assert!(outcome.contact.is_some_and(|contact| contact.adversary), "{outcome:?}");
        let said = jury(&plant, &act, &mut Steady, &outcome).unwrap().unwrap();
        // A label that asks for the jury holds the same.
        let asking = SimulatorOptions { jury: true, ..SimulatorOptions::SHIPPED };
        let prepared = PreparedScene::new(Arc::new(scene));
        let asked = Plant::with_options(prepared, &asking).unwrap();
        let label = rollout_assessed(&asked, &act, &mut Steady).unwrap();
        assert_eq!(label.contact.and_then(|contact| contact.jury), Some(said));
        assert!(!serde_json::to_string(&outcome).unwrap().contains("jury"), "what was recorded stays as it was");
        said
    }

    /// An adversary drives at a speed in the lane to the left, and from there into the ego's at another, m/s. It intrudes, 0.3 m before the
    /// ego's flank, when the gap is this, metres.
    fn cuts_in(gap_m: f64, speed_mps: f64, aside_mps: f64) -> Jury {
        let begins = 20;
        // From y = 4 down to 2.2: 0.95 m of each and 0.3 m between.
        let intrudes_s = begins as f64 * 0.1 + 1.8 / aside_mps;
        let from_x = gap_m + 4.5 + (15.0 - speed_mps) * intrudes_s;
        let at = |k: usize| {
            let since_s = 0.1 * k.saturating_sub(begins) as f64;
            let y = (4.0 - aside_mps * since_s).max(0.0);
            let across = if y > 0.0 && k >= begins { -aside_mps } else { 0.0 };
            let place = sample(from_x + 0.1 * speed_mps * k as f64, y, 0.0, speed_mps);
            Sample { velocity: Vec2::new(speed_mps, across), ..place }
        };
        said((0..STEPS).map(at).collect())
    }

    #[test]
    fn a_cut_in_is_avoided_by_regulation_157_from_its_time_to_collision_on() {
        // 10 m/s faster: 10 / (2 * 6) + .35 s, 11.83 m. A step is one metre.
        let avoids = |gap_m| cuts_in(gap_m, 5.0, 1.5).reg157.unwrap();
        assert_eq!([10.5, 11.4, 13.4, 16.0].map(avoids), [false, false, true, true]);
    }

    #[test]
    fn four_drivers_judge_a_cut_in_and_none_avoids_it_where_there_is_no_room() {
        let (near, far) = (cuts_in(1.0, 5.0, 4.0), cuts_in(9.0, 10.0, 1.5));
        assert_eq!((near.of(), near.avoid()), (4, 0), "{near:?}");
        assert_eq!((far.of(), far.avoid()), (4, 4), "{far:?}");
    }

    /// A leader as fast as the ego that brakes after a second, its rear this far ahead of the ego's bumper.
    fn brakes(gap_m: f64, brake_mps2: f64) -> Jury {
        let at = |k: usize| {
            let since_s = (0.1 * k as f64 - 1.0).clamp(0.0, 15.0 / brake_mps2);
            let x = gap_m + 4.5 + 15.0 * (0.1 * k as f64).min(1.0 + since_s) - 0.5 * brake_mps2 * since_s * since_s;
            sample(x, 0.0, 0.0, 15.0 - brake_mps2 * since_s)
        };
        said((0..STEPS).map(at).collect())
    }

    #[test]
    fn the_human_driver_avoids_a_braking_leader_from_its_stopping_distance_on_and_does_not_judge_a_gentle_one() {
        // 15 (.75 + .3) + 15² / (2 * 7.59) - 7.59 * .6² / 24 of the ego, less 15² / (2 * 8) of the leader: 16.4 m.
        let human = |gap_m| brakes(gap_m, 8.0).human_driver.unwrap();
        assert_eq!([13.0, 15.0, 19.0].map(human), [false, false, true]);
        let gentle = brakes(8.0, 4.0);
        assert!(gentle.human_driver.is_none() && gentle.fuzzy.is_some(), "{gentle:?}");
    }

    #[test]
    fn what_crosses_is_judged_by_the_careful_driver_alone() {
        let crossing = straight(sample(60.0, -40.0, num::FRAC_PI_2, 10.0), STEPS).into_iter().flatten().collect();
        let said = said(crossing);
        assert_eq!((said.of(), said.careful.is_some()), (1, true), "{said:?}");
    }

    #[test]
    fn the_fuzzy_model_brakes_by_its_published_distances() {
        let ahead = |gap_m: f64, other_mps: f64| Ahead {
            gap_m,
            clearance_m: -1.0,
            approach_mps: 0.0,
            own_mps: 20.0,
            own_mps2: 0.0,
            other_mps,
            off_lane_m: 0.0,
            lengths_m: 9.0,
            is_wholly_in: true,
        };
        // Before one that stands: critical below 15 + 400 / 12 = 48.33 m fully, from 15 + 400 / 8 = 65 m on not at all.
        let found = [40.0, 56.6666666667, 70.0].map(|gap_m| ahead(gap_m, 0.0).fuzzy_mps2());
        assert!((found[0] - 6.0).abs() < 1e-9 && (found[1] - 5.0).abs() < 1e-6 && found[2] == 0.0, "{found:?}");
        // As fast: proactive alone, 1 below 2 + 15 + 400 / 12 - 400 / 14 = 21.76 m, 0 from 2 + 15 + 50 - 28.57 + 2 = 40.43 m on.
        let found = [20.0, 45.0].map(|gap_m| ahead(gap_m, 20.0).fuzzy_mps2());
        assert_eq!(found, [4.0, 0.0]);
        // One beside the ego that comes nearer too slowly to meet it is passed.
        let beside = Ahead { clearance_m: 3.0, approach_mps: 0.1, ..ahead(10.0, 0.0) };
        assert_eq!(beside.fuzzy_mps2(), 0.0);
    }
}
