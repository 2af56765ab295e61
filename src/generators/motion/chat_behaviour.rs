//! The behaviours that a template of ChatScene may show, as phases of the simulator's script language.
//!
//! They are those of ChatScene's 40 published snippets as far as SafeBench's roads have room for them: interceptions that
//! end on the ego's way, merging, weaving, parallel blocking, swerves of oncoming traffic, turns off at the last moment,
//! slow blocking.

use crate::kernel::num;
use crate::sim::bicycle::DEFAULT_LIMITS;
use crate::sim::{Phase, Speed, Until, Way};

/// Behaviour of the adversary once it is set off.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Behaviour {
    /// Keeps the drawn speed.
    Steady,
    /// ChatScene's `CrossingBehavior`.
    Intercept,
    /// The same until it is near the ego's way (ChatScene's families 1 and 2).
    InterceptAndStop,
    /// Walks diagonally (family 1).
    CrossAtAngle,
    /// Brakes ahead of the ego (families 3, 5, 6, 7).
    StopBefore,
    /// Slow first, then as fast as drawn.
    SpeedUp,
    /// Accelerates and stops on the ego's way (families 5, 7, 8).
    RushAndStop,
    /// Extremely slowly through the ego's way (families 6, 8).
    SlowBlock,
    /// An abrupt turn near the ego's way (families 5, 6, 7).
    TurnOff,
    /// ChatScene's parallel block (family 3).
    MatchEgo,
    /// Merges into the ego's lane (families 3, 4).
    CutIn,
    /// The same, and then brakes hard.
    CutInAndBrake,
    /// Over into the ego's lane and back (family 4).
    Swerve,
    /// Over and back, again and again (families 3, 6).
    Weave,
    /// Slowly out of its lane.
    Drift,
    /// From standstill into the ego's lane.
    PullOut,
}

/// Every behaviour with its word in contracts and what it does, as a model is told.
const BEHAVIOURS: [(Behaviour, &str, &str); 16] = [
    (Behaviour::Steady, "steady", "crosses or drives on at a steady speed, whatever the ego does"),
    (
        Behaviour::Intercept,
        "intercept",
        "times its speed so that it meets the ego where their ways cross: intercepts it",
    ),
    (
        Behaviour::InterceptAndStop,
        "intercept_and_stop",
        "dashes out, times its speed to the ego, then halts on the ego's way and stays there",
    ),
    (Behaviour::CrossAtAngle, "cross_at_angle", "crosses diagonally, at an angle, toward the ego or away from it"),
    (Behaviour::StopBefore, "stop_before", "drives ahead of the ego and suddenly brakes: stops and stands in its way"),
    (
        Behaviour::SpeedUp,
        "speed_up",
        "waits or goes slowly first, then speeds up: accelerates hard when the ego is near",
    ),
    (
        Behaviour::RushAndStop,
        "rush_and_stop",
        "accelerates into the junction when the ego is near and stops across its way",
    ),
    (Behaviour::SlowBlock, "slow_block", "enters the ego's way and creeps through it extremely slowly: blocks it"),
    (Behaviour::TurnOff, "turn_off", "makes an abrupt turn at the last second just before the ego's way"),
    (Behaviour::MatchEgo, "match_ego", "matches the speed of the ego beside it and keeps parallel: blocks the lane"),
    (
        Behaviour::CutIn,
        "cut_in",
        "changes lane: merges or cuts into the ego's lane when the ego is near, and drives on",
    ),
    (
        Behaviour::CutInAndBrake,
        "cut_in_and_brake",
        "changes lane into the ego's lane when the ego is near, then brakes hard in front of it",
    ),
    (Behaviour::Swerve, "swerve", "swerves into the ego's lane when the ego is near, and back again"),
    (Behaviour::Weave, "weave", "weaves between its lane and the ego's, over and back, again and again"),
    (Behaviour::Drift, "drift", "drifts slowly out of its lane into the ego's, without noticing"),
    (Behaviour::PullOut, "pull_out", "stands still, then pulls out into the ego's lane from standstill"),
];

impl Behaviour {
    /// Its word in contracts.
    pub fn word(self) -> &'static str {
        BEHAVIOURS[self as usize].1
    }

    /// Returns what it does, as a model is told.
    pub fn describes(self) -> &'static str {
        BEHAVIOURS[self as usize].2
    }

    /// The behaviour of a contract's word.
    pub fn of_word(word: &str) -> Option<Behaviour> {
        BEHAVIOURS.iter().find(|(_, w, _)| *w == word).map(|(behaviour, _, _)| *behaviour)
    }
}

/// A lane change takes this long, s; drivers take 3 to 6 s, an abrupt one half of that.
const LANE_CHANGE_S: f64 = 2.0;
/// One leg of a swerve.
const SWERVE_S: f64 = 1.3;
/// Shortest way of a sideways move; the way of a drift, metres.
const SHIFT_M_MIN: f64 = 8.0;
const DRIFT_M: f64 = 50.0;
/// Legs of a weave.
const LEGS: usize = 8;
/// Speed of a slow block (ChatScene: 0 to 2), m/s.
const SLOW_MPS: f64 = 1.0;
/// Road users that rush onto the ego's way stop at most this far from its middle (ChatScene's `STOP_DISTANCE`), metres.
const STOP_M_MAX: f64 = 2.0;
/// Nobody on foot runs faster than this, if not asked to (sprinters reach 12, joggers keep to 5), m/s.
const ON_FOOT_MPS: f64 = 5.0;
/// Tightest turn, metres, and the lateral acceleration that an abrupt one takes, m/s².
const TURN_M_MIN: f64 = 6.0;
const TURN_MPS2: f64 = 6.0;

/// The drawn numbers of one scenario.
#[derive(Clone, Copy, Debug)]
pub struct Drawn {
    /// Speed once it is set off, m/s.
    pub mps: f64,
    /// Distance of the ego, or of its way, at which the second phase begins, metres.
    pub within_m: f64,
    /// Way sideways, positive to the left, metres.
    pub left_m: f64,
    /// True if it walks.
    pub on_foot: bool,
    /// The family's own stop rule.
    pub end: Until,
}

impl Behaviour {
    /// The phases of one scenario.
    pub fn phases(self, drawn: &Drawn) -> Vec<Phase> {
        let &Drawn { mps, within_m, left_m, on_foot, end } = drawn;
        let go = |until| Phase::straight(mps, until);
        let straight = |mps| Phase::straight(mps, end);
        let near = || go(Until::EgoWithin { m: within_m });
        let aside = |left_m, over_m, until| Phase { way: Way::Shift { left_m, over_m }, ..go(until) };
        let change_m = (LANE_CHANGE_S * mps).max(SHIFT_M_MIN);
        // A car begins to brake early enough to stand where it is asked to.
        let on_way = |m: f64| Until::NearRoute { m: m + if on_foot { 0.0 } else { braking_m(mps) } };
        match self {
            Behaviour::Steady => vec![straight(mps)],
            Behaviour::Intercept => vec![Phase { speed: intercepting(mps, on_foot), ..straight(0.0) }],
            Behaviour::InterceptAndStop => {
                vec![Phase { speed: intercepting(mps, on_foot), ..go(on_way(within_m)) }, straight(0.0)]
            }
            Behaviour::CrossAtAngle => {
                let way = Way::Turn { left_rad: num::atan2(left_m, 5.0), radius_m: TURN_M_MIN };
                vec![Phase { way, ..straight(mps) }]
            }
            Behaviour::StopBefore => vec![near(), straight(0.0)],
            Behaviour::SpeedUp => vec![Phase::straight(0.5 * mps, Until::EgoWithin { m: within_m }), straight(mps)],
            Behaviour::RushAndStop => vec![go(on_way(within_m.min(STOP_M_MAX))), straight(0.0)],
            Behaviour::SlowBlock => vec![go(Until::NearRoute { m: within_m.max(2.0) }), straight(SLOW_MPS)],
            Behaviour::TurnOff => {
                let radius_m = (mps * mps / TURN_MPS2).max(TURN_M_MIN);
                let left_rad = num::FRAC_PI_2 * (0.25 * left_m).clamp(-1.0, 1.0);
                let turn = Phase { way: Way::Turn { left_rad, radius_m }, ..straight(mps) };
                vec![go(Until::NearRoute { m: within_m + 0.5 * radius_m }), turn]
            }
            Behaviour::MatchEgo => vec![Phase { speed: Speed::MatchEgo { mps_max: mps }, ..straight(0.0) }],
            Behaviour::CutIn => vec![near(), aside(left_m, change_m, end)],
            Behaviour::CutInAndBrake => {
                vec![near(), aside(left_m, change_m, Until::Lasted { s: LANE_CHANGE_S }), straight(0.0)]
            }
            Behaviour::Swerve => {
                let leg_m = (SWERVE_S * mps).max(SHIFT_M_MIN);
                vec![near(), aside(left_m, leg_m, Until::Lasted { s: SWERVE_S }), aside(-left_m, leg_m, end)]
            }
            Behaviour::Weave => {
                let leg = |k: usize| {
                    let side = if k.is_multiple_of(2) { left_m } else { -left_m };
                    aside(side, change_m, Until::Lasted { s: LANE_CHANGE_S })
                };
                std::iter::once(near()).chain((0..LEGS).map(leg)).chain([straight(mps)]).collect()
            }
            Behaviour::Drift => vec![aside(left_m, DRIFT_M, end)],
            Behaviour::PullOut => vec![aside(left_m, SHIFT_M_MIN, end)],
        }
    }
}

fn intercepting(mps: f64, on_foot: bool) -> Speed {
    let mps_max = if on_foot { mps.max(ON_FOOT_MPS) } else { (2.0 * mps).max(1.0) };
    Speed::Intercept { mps_min: mps.min(mps_max), mps_max }
}

/// The way that a full brake takes, metres.
fn braking_m(mps: f64) -> f64 {
    mps * mps / (2.0 * DEFAULT_LIMITS.brake_mps2)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_behaviour_stands_at_its_own_place_in_the_list() {
        for (place, (behaviour, word, describes)) in BEHAVIOURS.into_iter().enumerate() {
            assert_eq!(behaviour as usize, place);
            assert_eq!(Behaviour::of_word(word), Some(behaviour));
            assert_eq!((behaviour.word(), behaviour.describes()), (word, describes));
        }
        assert_eq!(Behaviour::of_word("fly"), None);
    }

    #[test]
    fn no_two_behaviours_are_the_same_script_and_half_of_them_leave_the_straight_line() {
        let end = Until::Driven { m: 110.0 };
        let drawn = Drawn { mps: 8.0, within_m: 12.0, left_m: -3.5, on_foot: false, end };
        let scripts = BEHAVIOURS.map(|(behaviour, _, _)| behaviour.phases(&drawn));
        for (i, one) in scripts.iter().enumerate() {
            assert!(!scripts[..i].contains(one), "{:?}", BEHAVIOURS[i].0);
            assert_eq!(one.last().map(|phase| phase.until), Some(end), "the family's stop rule");
        }
        let bends = |phases: &&Vec<Phase>| phases.iter().any(|phase| phase.way != Way::Straight);
        assert_eq!(scripts.iter().filter(bends).count(), 8);
    }
}
