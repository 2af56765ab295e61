//! Rewards of a step of driving, by the rules of the two settings. Every constant stands in the training file.

use serde::{Deserialize, Serialize};

use crate::kernel::num;
use crate::sim::End;

/// The rule of a setting with its constants.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "rule", rename_all = "snake_case", deny_unknown_fields)]
pub enum Reward {
    /// MetaDrive's `ScenarioEnv.reward_function` (0.4.3). Contact with a solid line is ignored.
    Metadrive {
        /// Reward of a metre along the route. 1 there.
        driving: f64,
        /// Penalty of being `lateral_m_max` beside the route. 0.5.
        lateral: f64,
        /// Metres. 4.
        lateral_m_max: f64,
        /// Penalty of being turned away from the route by half a turn. 1.
        heading: f64,
        /// Share of the penalty of steering more than 1/speed. 0.5.
        steering: f64,
        /// True if the sum of the above is at least 0. True there.
        no_negative: bool,
        /// Reward of a step with a contact, in place of all the above, negated. 1.
        crash: f64,
        /// Reward of the step that arrives, in place of all the above. 5.
        success: f64,
        /// Reward of the step that leaves the road, in place of all the above, negated. 5.
        out_of_road: f64,
    },
    /// SafeBench's `_get_reward`.
    Safebench {
        /// Penalty of a contact. 1 there.
        collision: f64,
        /// Speed beyond which `too_fast` is taken off, m/s. 8.
        speed_mps_max: f64,
        /// 10.
        too_fast: f64,
        /// Distance from the route beyond which `out_of_lane` is taken off, metres. 4.
        lateral_m_max: f64,
        /// 1.
        out_of_lane: f64,
        /// Penalty of the square of the applied steering. 5.
        steering: f64,
        /// Penalty of the applied steering times the square of the speed. 0.2.
        side: f64,
        /// Share of full steering that an action 1 applies. 0.3.
        steer_share: f64,
    },
}

impl Reward {
    /// Returns MetaDrive's own constants, but for the penalty of a contact, which is 1 there: contact ends an episode here.
    pub const fn metadrive(crash: f64) -> Reward {
        Reward::Metadrive {
            driving: 1.0,
            lateral: 0.5,
            lateral_m_max: 4.0,
            heading: 1.0,
            steering: 0.5,
            no_negative: true,
            crash,
            success: 5.0,
            out_of_road: 5.0,
        }
    }
}

/// Results of a step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Step {
    /// Progress along the route, metres.
    pub progress_m: f64,
    /// Distance from the route after the step, metres.
    pub offset_m: f64,
    /// Turn from the heading to the route's after the step, radians.
    pub turn_rad: f64,
    /// Speed after the step, m/s.
    pub speed_mps: f64,
    /// Speed along the route after the step, m/s.
    pub along_mps: f64,
    /// Steering of the action, in [-1, 1].
    pub steering: f64,
}

impl Step {
    /// What its numbers are called, in the order of [`Step::numbers`].
    pub const NAMES: [&str; 6] = ["progress_m", "offset_m", "turn_rad", "speed_mps", "along_mps", "steering"];

    /// Its numbers.
    pub fn numbers(&self) -> [f64; 6] {
        [self.progress_m, self.offset_m, self.turn_rad, self.speed_mps, self.along_mps, self.steering]
    }
}

impl Reward {
    /// Returns the reward of the step; `end` is the end of the rollout, if it ended with the step.
    pub fn of(&self, step: &Step, end: Option<End>) -> f64 {
        match *self {
            Reward::Metadrive {
                driving,
                lateral,
                lateral_m_max,
                heading,
                steering,
                no_negative,
                crash,
                success,
                out_of_road,
            } => match end {
                Some(End::Contact) => -crash,
                Some(End::Arrived) => success,
                Some(End::OffRoad) => -out_of_road,
                Some(End::Horizon) | None => {
                    let beyond = (1.0 / step.speed_mps.max(0.01) - step.steering.abs()).min(0.0);
                    let sum = driving * step.progress_m
                        - lateral * step.offset_m.abs() / lateral_m_max
                        - heading * step.turn_rad.abs() / num::PI
                        + steering * beyond;
                    if no_negative { sum.max(0.0) } else { sum }
                }
            },
            Reward::Safebench {
                collision,
                speed_mps_max,
                too_fast,
                lateral_m_max,
                out_of_lane,
                steering,
                side,
                steer_share,
            } => {
                let steer = step.steering * steer_share;
                let taken = |penalty: f64, is_due: bool| if is_due { penalty } else { 0.0 };
                step.along_mps
                    - taken(collision, end == Some(End::Contact))
                    - taken(too_fast, step.along_mps > speed_mps_max)
                    - taken(out_of_lane, step.offset_m.abs() > lateral_m_max)
                    - steering * steer * steer
                    - side * steer.abs() * step.along_mps * step.along_mps
            }
        }
    }

    /// Returns its constants by name; all must be finite.
    pub fn constants(&self) -> Vec<(&'static str, f64)> {
        match *self {
            Reward::Metadrive {
                driving,
                lateral,
                lateral_m_max,
                heading,
                steering,
                crash,
                success,
                out_of_road,
                ..
            } => vec![
                ("driving", driving),
                ("lateral", lateral),
                ("lateral_m_max", lateral_m_max),
                ("heading", heading),
                ("steering", steering),
                ("crash", crash),
                ("success", success),
                ("out_of_road", out_of_road),
            ],
            Reward::Safebench {
                collision,
                speed_mps_max,
                too_fast,
                lateral_m_max,
                out_of_lane,
                steering,
                side,
                steer_share,
            } => vec![
                ("collision", collision),
                ("speed_mps_max", speed_mps_max),
                ("too_fast", too_fast),
                ("lateral_m_max", lateral_m_max),
                ("out_of_lane", out_of_lane),
                ("steering", steering),
                ("side", side),
                ("steer_share", steer_share),
            ],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const METADRIVE: Reward = Reward::metadrive(1.0);

    #[test]
    fn metadrives_rules_overwrite_each_other_in_its_order() {
        let step =
            Step { progress_m: 1.0, offset_m: -2.0, turn_rad: 0.0, speed_mps: 10.0, along_mps: 10.0, steering: 0.3 };
        // 1 - 0.5 * 2 / 4 + 0.5 * (1 / 10 - 0.3)
        assert!((METADRIVE.of(&step, None) - 0.65).abs() < 1e-12);
        assert_eq!(METADRIVE.of(&Step { progress_m: -1.0, ..step }, None), 0.0, "nothing negative");
        assert_eq!(METADRIVE.of(&step, Some(End::Horizon)), METADRIVE.of(&step, None), "a time limit is no end");
        let ends = [End::Contact, End::Arrived, End::OffRoad].map(|end| METADRIVE.of(&step, Some(end)));
        assert_eq!(ends, [-1.0, 5.0, -5.0]);
    }

    #[test]
    fn safebenchs_penalties_come_off_the_speed() {
        let rule = Reward::Safebench {
            collision: 1.0,
            speed_mps_max: 8.0,
            too_fast: 10.0,
            lateral_m_max: 4.0,
            out_of_lane: 1.0,
            steering: 5.0,
            side: 0.2,
            steer_share: 0.3,
        };
        let step = Step { along_mps: 6.0, steering: -0.5, ..Step::default() };
        // 6 - 5 * 0.15² - 0.2 * 0.15 * 36
        assert!((rule.of(&step, None) - (6.0 - 0.1125 - 1.08)).abs() < 1e-12);
        let fast = Step { along_mps: 9.0, offset_m: 5.0, ..Step::default() };
        assert_eq!(rule.of(&fast, Some(End::Contact)), 9.0 - 1.0 - 10.0 - 1.0);
    }
}
