//! Measures of a candidate for SAGE: the parts of its reward, and the features over which an expert is log-linear.

use crate::adapters::vocabulary;
use crate::kernel::num;
use crate::motion::Candidate;
use crate::scene::{DT_S, Sample};
use crate::stage::judged::{Judged, Needs, features, road_within};

/// Names of the features in their order; scales in [`Measured::features`].
pub const FEATURES: [&str; 10] = [
    "lane_deviation",
    "acceleration_rms",
    "lateral_acceleration_rms",
    "yaw_rate_rms",
    "heading_total",
    "progress_change",
    "nearness_to_ego",
    "approach_time",
    "overlap",
    "road_departure",
];

/// The features of the road lie between 0 and this.
const OF_THE_ROAD_MAX: f64 = 3.0;
/// A deviation from the lane of this much counts 1, metres.
const LANE_DEVIATION_M: f64 = 1.5;

/// A corner this far beyond the lanes has left the road, metres: the simulator's tolerance.
const OFF_ROAD_M: f64 = 0.5;
/// Penalties of the method for leaving the road and for running into a third road user.
const OFF_ROAD_PENALTY: f64 = 50.0;
const BYSTANDER_PENALTY: f64 = 10.0;

/// A candidate, measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measured {
    lane_deviation_m_max: f64,
    off_road_m_max: f64,
    bystander_gap_m_min: f64,
    ego_distance_m_min: f64,
    /// Time of the smallest distance since the window opened, s.
    approach_s: f64,
    horizon_s: f64,
    motion: Motion,
    /// Used by the reward alone: 0 for an expert, which does not look at it.
    unrealism: f64,
}

/// Means over the candidate's steps.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Motion {
    acceleration_rms: f64,
    lateral_rms: f64,
    yaw_rms: f64,
    /// Net change of heading, absolute, rad.
    heading_total: f64,
    /// Mean speed less the speed at the start, m/s.
    speed_change: f64,
}

impl Measured {
    pub fn of(candidate: &Candidate, judged: &Judged<'_>) -> Measured {
        let needs = Needs { ego: true, road: true, bystanders: true, ..Needs::default() };
        Measured { unrealism: unrealism(&candidate.samples), ..Measured::with(candidate, judged, needs) }
    }

    /// All that an expert looks at: bystanders are the reward's alone, and distances to the road count up to a bound only.
    pub fn for_expert(candidate: &Candidate, judged: &Judged<'_>) -> Measured {
        let measured = Measured::with(candidate, judged, Needs { ego: true, ..Needs::default() });
        let bounds = [OF_THE_ROAD_MAX, OF_THE_ROAD_MAX * LANE_DEVIATION_M];
        let (off_road_m_max, lane_deviation_m_max) = road_within(&candidate.samples, judged, bounds);
        Measured { off_road_m_max, lane_deviation_m_max, ..measured }
    }

    fn with(candidate: &Candidate, judged: &Judged<'_>, needs: Needs) -> Measured {
        let values = features(candidate, judged, needs);
        let value = |name: &str| {
            vocabulary::CANDIDATE.iter().position(|feature| feature.name == name).map_or(0.0, |place| values[place])
        };
        let opened_s = judged.from_step.saturating_sub(judged.situation.scene.current_step) as f64 * DT_S;
        Measured {
            lane_deviation_m_max: value("lane_deviation_m_max"),
            off_road_m_max: value("off_road_m_max"),
            bystander_gap_m_min: value("bystander_gap_m_min"),
            ego_distance_m_min: value("ego_distance_m_min"),
            approach_s: (value("closest_approach_s") - opened_s).max(0.0),
            horizon_s: candidate.samples.len() as f64 * DT_S,
            motion: motion(&candidate.samples),
            unrealism: 0.0,
        }
    }

    /// φ(τ), each of the order of one, in the order of [`FEATURES`].
    pub fn features(&self) -> [f64; FEATURES.len()] {
        let m = &self.motion;
        let overlap = self.ego_distance_m_min == 0.0;
        [
            (self.lane_deviation_m_max / LANE_DEVIATION_M).min(OF_THE_ROAD_MAX),
            m.acceleration_rms / 3.0,
            m.lateral_rms / 3.0,
            m.yaw_rms / 0.3,
            m.heading_total / num::PI,
            m.speed_change / 5.0,
            num::exp(-0.2 * self.ego_distance_m_min),
            (self.approach_s / self.horizon_s.max(DT_S)).min(1.0),
            if overlap { 1.0 } else { 0.0 },
            self.off_road_m_max.min(OF_THE_ROAD_MAX),
        ]
    }

    /// R_adv: 10 (1 - t/T) on contact at t, else exp(-0.2 d) within 20 m, else 0.
    pub fn adversarial(&self) -> f64 {
        if self.ego_distance_m_min == 0.0 {
            10.0 * (1.0 - (self.approach_s / self.horizon_s.max(DT_S)).min(1.0))
        } else if self.ego_distance_m_min <= 20.0 {
            num::exp(-0.2 * self.ego_distance_m_min)
        } else {
            0.0
        }
    }

    /// Kinematic and behaviour penalties.
    pub fn unrealism(&self) -> f64 {
        self.unrealism
    }

    /// 50 off the road, 10 more through a third road user.
    pub fn map_penalty(&self) -> f64 {
        let off_road = if self.off_road_m_max > OFF_ROAD_M { OFF_ROAD_PENALTY } else { 0.0 };
        off_road + if self.bystander_gap_m_min == 0.0 { BYSTANDER_PENALTY } else { 0.0 }
    }

    /// Returns `true` if it may be used at all.
    pub fn is_feasible(&self) -> bool {
        self.map_penalty() == 0.0
    }

    /// a R_adv - b (kinematic + behaviour) - map
    pub fn reward(&self, adversarial: f64, realistic: f64) -> f64 {
        adversarial * self.adversarial() - realistic * self.unrealism() - self.map_penalty()
    }
}

/// Change of a candidate from one step to the next.
struct Change {
    acceleration: f64,
    /// Speed times yaw rate, m/s².
    lateral: f64,
    yaw: f64,
    turn: f64,
    mean_speed: f64,
}

fn changes(samples: &[Sample]) -> impl Iterator<Item = Change> {
    samples.windows(2).map(|pair| {
        let (speed, next) = (pair[0].speed_mps(), pair[1].speed_mps());
        let turn = num::wrap_angle(pair[1].heading_rad - pair[0].heading_rad);
        let (acceleration, yaw) = ((next - speed) / DT_S, turn / DT_S);
        let mean_speed = 0.5 * (speed + next);
        Change { acceleration, lateral: mean_speed * yaw, yaw, turn, mean_speed }
    })
}

fn steps(samples: &[Sample]) -> f64 {
    samples.len().saturating_sub(1).max(1) as f64
}

fn motion(samples: &[Sample]) -> Motion {
    let steps = steps(samples);
    let mut motion = Motion::default();
    let mut heading = 0.0;
    for change in changes(samples) {
        heading += change.turn;
        motion.acceleration_rms += change.acceleration * change.acceleration / steps;
        motion.lateral_rms += change.lateral * change.lateral / steps;
        motion.yaw_rms += change.yaw * change.yaw / steps;
        motion.speed_change += (change.mean_speed - samples[0].speed_mps()) / steps;
    }
    for square in [&mut motion.acceleration_rms, &mut motion.lateral_rms, &mut motion.yaw_rms] {
        *square = square.sqrt();
    }
    motion.heading_total = heading.abs();
    motion
}

/// Kinematic penalty, 5 [mean softplus(|a| - 7) + mean softplus(|a_lat| - 6)] + 5 mean softplus(|ω| - 0.8), and behaviour
/// penalty, 5 softplus(|Δθ| - π) + 3 mean(|ω| / (v + 0.01)).
fn unrealism(samples: &[Sample]) -> f64 {
    let steps = steps(samples);
    let (mut kinematic, mut behaviour, mut heading) = (0.0, 0.0, 0.0);
    for Change { acceleration, lateral, yaw, turn, mean_speed } in changes(samples) {
        heading += turn;
        kinematic += 5.0
            * (softplus(acceleration.abs() - 7.0) + softplus(lateral.abs() - 6.0) + softplus(yaw.abs() - 0.8))
            / steps;
        behaviour += 3.0 * (yaw.abs() / (mean_speed + 0.01)) / steps;
    }
    kinematic + (behaviour + 5.0 * softplus(f64::abs(heading) - num::PI))
}

/// ln(1 + e^x) without overflow.
fn softplus(x: f64) -> f64 {
    x.max(0.0) + num::ln(1.0 + num::exp(-x.abs()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernel::Vec2;

    #[test]
    fn softplus_by_hand() {
        assert!((softplus(0.0) - num::ln(2.0)).abs() < 1e-15);
        assert!((softplus(800.0) - 800.0).abs() < 1e-12 && softplus(-800.0) == 0.0);
    }

    #[test]
    fn someone_who_drives_straight_pays_only_the_tails_of_softplus() {
        let straight: Vec<Sample> = (0..80)
            .map(|k| Sample { position: Vec2::new(k as f64, 0.0), heading_rad: 0.0, velocity: Vec2::new(10.0, 0.0) })
            .collect();
        let motion = motion(&straight);
        let tails = 5.0 * (softplus(-7.0) + softplus(-6.0) + softplus(-0.8)) + 5.0 * softplus(-num::PI);
        assert!((unrealism(&straight) - tails).abs() < 1e-9);
        assert_eq!((motion.heading_total, motion.speed_change), (0.0, 0.0));
    }

    #[test]
    fn the_adversarial_reward_by_hand() {
        let measured = |distance: f64| Measured {
            lane_deviation_m_max: 0.0,
            off_road_m_max: 0.0,
            bystander_gap_m_min: 50.0,
            ego_distance_m_min: distance,
            approach_s: 2.0,
            horizon_s: 8.0,
            motion: Motion::default(),
            unrealism: 0.0,
        };
        assert_eq!(measured(0.0).adversarial(), 7.5);
        assert!((measured(5.0).adversarial() - num::exp(-1.0)).abs() < 1e-15);
        assert_eq!(measured(20.5).adversarial(), 0.0);
        let off = Measured { off_road_m_max: 1.0, bystander_gap_m_min: 0.0, ..measured(0.0) };
        assert_eq!((off.map_penalty(), off.is_feasible()), (60.0, false));
        assert_eq!(off.reward(10.0, 1.0), 75.0 - 60.0);
    }
}
