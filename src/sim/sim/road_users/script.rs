//! Scripted road users that wait for the ego: their places, their triggers, and their behaviour after that. The input
//! language of SafeBench's traffic families; `triggered.rs` carries it out.

use serde::{Deserialize, Serialize};

use crate::kernel::{Pose, Vec2, num};
use crate::scene::AgentKind;

/// Most phases of one script.
pub const PHASES_MAX: usize = 64;
/// Most values of one profile, and most points of one path.
pub const VALUES_MAX: usize = 10_000;
/// Longest shift, longest way of a shift, and largest radius of a turn, metres.
const SHIFT_M_MAX: f64 = 1000.0;
/// Smallest radius that a car can turn, metres.
const RADIUS_M_MIN: f64 = 3.0;

/// One road user that stands still until the ego comes near, then runs through its phases, then brakes and stays.
///
/// Someone on foot has the asked speed at once. Everybody else starts from standstill and drives bang-bang: throttle
/// while not faster than the asked speed, else brake, as SafeBench's `go_straight`. Throttle and brake are shares of
/// [`DEFAULT_LIMITS`](crate::sim::road_users::bicycle::DEFAULT_LIMITS): full throttle 2.76 m/s², full brake 8.83 m/s².
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Script {
    /// The sort of road user; someone on foot walks, everybody else drives a bicycle model.
    pub kind: AgentKind,
    /// Length of its box, metres, above 0 and at most 100.
    pub length_m: f64,
    /// Width of its box, metres, likewise.
    pub width_m: f64,
    /// Pose in which it stands from the first simulated step on.
    pub spawn: Pose,
    /// Condition that sets it off.
    pub trigger: Trigger,
    /// Phases; empty for a parked one.
    pub phases: Vec<Phase>,
}

/// When a script begins: at the first decision step at which all of this holds.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Trigger {
    /// Index, among the intervention's actions, of the scripted road user to which the ego's distance is measured
    /// (SafeBench's reference actor); its own for most.
    pub reference: usize,
    /// Distance centre to centre, metres; the ego must be nearer.
    pub distance_m: f64,
    /// The ego must be at least this fast, m/s (SafeBench's family 5: 0.5).
    pub ego_speed_mps_min: f64,
}

/// One stretch of a script.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Phase {
    /// The speed.
    pub speed: Speed,
    /// The way.
    pub way: Way,
    /// Share of full throttle, 0..=1; not used on foot.
    pub throttle: f64,
    /// Share of full brake, 0..=1; not used on foot.
    pub brake: f64,
    /// The phase is over before the first decision step at which this holds.
    pub until: Until,
}

impl Phase {
    /// Goes straight on at a constant speed with full throttle and brake: SafeBench's `go_straight(v)`.
    pub fn straight(mps: f64, until: Until) -> Phase {
        Phase { speed: Speed::Constant { mps }, way: Way::Straight, throttle: 1.0, brake: 1.0, until }
    }
}

/// The speed asked for, m/s.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Speed {
    /// The same all the time.
    Constant {
        /// m/s, 0 to 1000.
        mps: f64,
    },
    /// One value a decision step of the phase, the last repeated (AdvSim's 100 values).
    Profile {
        /// m/s, 1 to 10 000 values.
        mps: Vec<f64>,
    },
    /// The ego's speed, at most this.
    MatchEgo {
        /// m/s.
        mps_max: f64,
    },
    /// A speed at which both reach the crossing of their ways at once: own lateral distance to the ego's line times the ego's
    /// speed over the ego's distance along it, within bounds (ChatScene's `CrossingBehavior`); the upper bound once the
    /// ego has passed.
    Intercept {
        /// m/s.
        mps_min: f64,
        /// m/s.
        mps_max: f64,
    },
}

/// The way of a phase.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Way {
    /// Wheels straight.
    Straight,
    /// Steering angles, radians to the left, one a decision step of the phase, the last repeated. Straight on foot.
    Wheel {
        /// Radians, 1 to 10 000 values, cut to what the wheels can do.
        rad: Vec<f64>,
    },
    /// Steers at one point a decision step of the phase, the last repeated (the AT port's 100 perturbed waypoints).
    Points {
        /// In the scene's frame, metres, 1 to 10 000.
        points: Vec<Vec2>,
    },
    /// Follows a path by pure pursuit; on foot exactly, from where it is nearest.
    Path {
        /// In the scene's frame, metres, 1 to 10 000.
        points: Vec<Vec2>,
    },
    /// Moves sideways while it goes on: by `left_m` (negative: to the right) over the next `over_m` metres along the
    /// heading that it has when the phase begins, then parallel to its old line. A lane change, a cut-in or, over a long
    /// way, a drift.
    Shift {
        /// Metres to the left, at most 1000 to either side.
        left_m: f64,
        /// Metres along the heading, 1 to 1000.
        over_m: f64,
    },
    /// Turns by `left_rad` (negative: to the right) on an arc of `radius_m`, then goes straight on; on foot at once. An
    /// abrupt turn, or a crossing at an angle.
    Turn {
        /// Radians to the left, at most half a turn to either side.
        left_rad: f64,
        /// Metres, 3 to 1000; not used on foot.
        radius_m: f64,
    },
}

/// The end of a phase.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Until {
    /// It lasts until the rollout ends.
    Forever,
    /// It has gone this far since it was set off, metres (SafeBench's stop rules).
    Driven {
        /// Metres, at least 0.
        m: f64,
    },
    /// The ego is nearer than this, centre to centre, metres.
    EgoWithin {
        /// Metres, at least 0.
        m: f64,
    },
    /// Its centre is nearer than this to the ego's route, metres (ChatScene's `distance from self to egoTrajectory`).
    NearRoute {
        /// Metres, at least 0.
        m: f64,
    },
    /// The phase has lasted this long, s.
    Lasted {
        /// Seconds, at least 0.
        s: f64,
    },
}

impl Script {
    /// Returns the first fault: the rule and the value found.
    pub(in crate::sim) fn fault(&self) -> Option<(&'static str, String)> {
        let spawn_is_sound = self.spawn.position.is_finite() && self.spawn.heading_rad.abs() <= 1e6;
        if !spawn_is_sound {
            return Some(("the spawn must be finite", format!("{:?}", self.spawn)));
        }
        let trigger = &self.trigger;
        // NaN compares false.
        let sound = [trigger.distance_m, trigger.ego_speed_mps_min].iter().all(|x| *x >= 0.0);
        if !sound {
            return Some(("trigger distance and speed must not be below 0", format!("{trigger:?}")));
        }
        if self.phases.len() > PHASES_MAX {
            return Some(("a script has at most 64 phases", self.phases.len().to_string()));
        }
        if self.kind == AgentKind::Static && !self.phases.is_empty() {
            return Some(("what is static has no phases", self.phases.len().to_string()));
        }
        self.phases.iter().enumerate().find_map(|(i, phase)| Some((phase.fault()?, format!("phase {i}: {phase:?}"))))
    }
}

impl Phase {
    fn fault(&self) -> Option<&'static str> {
        let speed = |mps: &f64| (0.0..=crate::sim::prepared::plant::SPEED_MPS_MAX).contains(mps);
        let counted = |n: usize| n > 0 && n <= VALUES_MAX;
        let speeds = match &self.speed {
            Speed::Constant { mps } | Speed::MatchEgo { mps_max: mps } => speed(mps),
            Speed::Profile { mps } => counted(mps.len()) && mps.iter().all(speed),
            Speed::Intercept { mps_min, mps_max } => speed(mps_min) && speed(mps_max) && mps_min <= mps_max,
        };
        if !speeds {
            return Some("speeds must be 0 to 1000 m/s, profiles of 1 to 10000 values");
        }
        let way = match &self.way {
            Way::Straight => true,
            Way::Wheel { rad } => counted(rad.len()) && rad.iter().all(|r| r.abs() <= 1e3),
            Way::Points { points } | Way::Path { points } => {
                counted(points.len()) && points.iter().all(|p| crate::sim::prepared::plant::in_range(*p))
            }
            Way::Shift { left_m, over_m } => left_m.abs() <= SHIFT_M_MAX && (1.0..=SHIFT_M_MAX).contains(over_m),
            Way::Turn { left_rad, radius_m } => {
                left_rad.abs() <= num::PI && (RADIUS_M_MIN..=SHIFT_M_MAX).contains(radius_m)
            }
        };
        if !way {
            return Some(
                "a way needs 1 to 10000 finite values or points, a shift at most 1000 m over 1 to 1000 m, a turn at most \
                 pi on a radius of 3 to 1000 m",
            );
        }
        let pedals = [self.throttle, self.brake].iter().all(|share| (0.0..=1.0).contains(share));
        if !pedals {
            return Some("throttle and brake must be shares from 0 to 1");
        }
        match self.until {
            Until::Forever => None,
            Until::Driven { m: x } | Until::EgoWithin { m: x } | Until::NearRoute { m: x } | Until::Lasted { s: x } => {
                (x.is_nan() || x < 0.0).then_some("the end of a phase must not lie below 0")
            }
        }
    }
}
