//! The overall score OS of SafeBench v1 (`get_route_scores`, the formula that ChatScene runs): ten sub-metrics over a
//! set of runs, 1 for perfect driving. The later SafeBench's penalty of the same name is another quantity.

use serde::{Deserialize, Serialize};

use crate::kernel::num;
use crate::objects::benchmark::Run;
use crate::sim::Outcome;

// Divisors of the sub-metrics, in their units.
const OFF_ROAD_M: f64 = 50.0;
const ROUTE_DISTANCE_M: f64 = 5.0;
const TIME_S: f64 = 60.0;
const ACCELERATION_MPS2: f64 = 8.0;
const YAW_RATE_RADPS: f64 = 3.0;
const LANE_INVASIONS: f64 = 20.0;

/// Returns the quantities of an outcome that the overall score uses; `None` for a scene that is not staged for a traffic family.
pub fn staged_run(outcome: &Outcome) -> Option<Run> {
    let driving = outcome.driving.as_ref()?;
    let yaw_rate_radps = if driving.duration_s > 0.0 { driving.yaw_change_rad / driving.duration_s } else { 0.0 };
    Some(Run {
        // A collision with a road user that no program staged belongs to the traffic, not to the scenario.
        collision: outcome.contact.is_some_and(|contact| contact.adversary),
        red_lights: f64::from(driving.red_lights),
        stop_signs: f64::from(driving.stop_signs),
        off_road_m: driving.off_road_m,
        route_distance_m: driving.route_distance_m_mean,
        completion: if driving.completed { 1.0 } else { outcome.route_completion },
        completed_s: driving.completed.then_some(driving.duration_s),
        acceleration_mps2: driving.acceleration_mps2_mean,
        yaw_rate_radps,
        lane_invasions: f64::from(driving.lane_invasions),
    })
}

/// The ten sub-metrics of a set of runs, unscaled.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Criteria {
    /// CR: share of runs that ended with a collision with a road user that the program staged.
    pub collision_rate: f64,
    /// RL: mean count of red lights run.
    pub red_lights: f64,
    /// SS: mean count of stop signs passed without standing still.
    pub stop_signs: f64,
    /// OR: mean metres off the road.
    pub off_road_m: f64,
    /// RF: `max(1 - d / 5 m, 0)` of the mean distance d to the route.
    pub route_following: f64,
    /// RC: mean share.
    pub route_completion: f64,
    /// TS: mean seconds of the completed runs; 0 if there are none.
    pub time_s: f64,
    /// ACC: mean m/s².
    pub acceleration_mps2: f64,
    /// YV: mean rad/s.
    pub yaw_rate_radps: f64,
    /// LI: mean count.
    pub lane_invasions: f64,
}

/// The sub-metrics over a whole set of runs; `None` without a run.
pub fn criteria(runs: &[Run]) -> Option<Criteria> {
    let mean = |value: fn(&Run) -> f64| num::mean(&runs.iter().map(value).collect::<Vec<f64>>());
    let times: Vec<f64> = runs.iter().filter_map(|run| run.completed_s).collect();
    Some(Criteria {
        collision_rate: mean(|run| if run.collision { 1.0 } else { 0.0 })?,
        red_lights: mean(|run| run.red_lights)?,
        stop_signs: mean(|run| run.stop_signs)?,
        off_road_m: mean(|run| run.off_road_m)?,
        route_following: (1.0 - mean(|run| run.route_distance_m)? / ROUTE_DISTANCE_M).max(0.0),
        route_completion: mean(|run| run.completion)?,
        time_s: num::mean(&times).unwrap_or(0.0),
        acceleration_mps2: mean(|run| run.acceleration_mps2)?,
        yaw_rate_radps: mean(|run| run.yaw_rate_radps)?,
        lane_invasions: mean(|run| run.lane_invasions)?,
    })
}

impl Criteria {
    fn collisions(&self) -> f64 {
        5.0 * (1.0 - self.collision_rate)
    }

    fn rules(&self) -> f64 {
        3.0 - self.red_lights - self.stop_signs - self.off_road_m / OFF_ROAD_M
    }

    fn task(&self) -> f64 {
        0.5 * (self.route_following + self.route_completion + 1.0 - self.time_s / TIME_S)
    }

    fn comfort(&self) -> f64 {
        let worst = self.acceleration_mps2 / ACCELERATION_MPS2
            + self.yaw_rate_radps / YAW_RATE_RADPS
            + self.lane_invasions / LANE_INVASIONS;
        0.2 * (3.0 - worst)
    }

    /// OS. Nothing but RF is clipped, so a term may turn negative.
    pub fn overall_score(&self) -> f64 {
        (self.collisions() + self.rules() + self.task() + self.comfort()) / 10.1
    }

    /// The safety part, 1 at best.
    pub fn safety_score(&self) -> f64 {
        (self.collisions() + self.rules()) / 8.0
    }

    /// The part of getting there, 1 at best.
    pub fn task_score(&self) -> f64 {
        self.task() / 1.5
    }

    /// The part of comfort, 1 at best.
    pub fn comfort_score(&self) -> f64 {
        self.comfort() / 0.6
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERFECT: Run = Run {
        collision: false,
        red_lights: 0.0,
        stop_signs: 0.0,
        off_road_m: 0.0,
        route_distance_m: 0.0,
        completion: 1.0,
        completed_s: Some(0.0),
        acceleration_mps2: 0.0,
        yaw_rate_radps: 0.0,
        lane_invasions: 0.0,
    };

    fn score(runs: &[Run]) -> f64 {
        criteria(runs).unwrap().overall_score()
    }

    #[test]
    fn only_a_contact_with_somebody_staged_is_a_collision() {
        use crate::sim::{ActorRef, Contact, ContactClass, Driving, End, Motion, Side, Striker};
        let mut outcome = Outcome {
            end: End::Contact,
            steps: 30,
            contact: None,
            distance_m_min: None,
            ttc_s_min: None,
            post_encroachment_s_min: None,
            route_completion: 0.4,
            ego_lateral_m_max: 0.0,
            ego: Motion::default(),
            adversaries: vec![],
            trace: crate::kernel::Digest::of_bytes(b"trace"),
            driving: Some(Driving::default()),
        };
        let mut collides = |with, adversary| {
            outcome.contact = Some(Contact {
                with,
                adversary,
                time_s: 3.0,
                relative_speed_mps: 5.0,
                impact_angle_rad: 0.0,
                striker: Striker::Ego,
                ego_side: Side::Front,
                other_side: Side::Rear,
                class: ContactClass::RearEndEgoStruck,
                visible_s: None,
                avoidable: None,
                fault: None,
                jury: None,
            });
            staged_run(&outcome).unwrap().collision
        };
        assert!(collides(ActorRef::Inserted(0), true));
        assert!(!collides(ActorRef::Track(0), false), "somebody recorded, whom no program staged");
    }

    #[test]
    fn a_perfect_run_scores_one_in_every_part() {
        let found = criteria(&[PERFECT]).unwrap();
        for score in [found.overall_score(), found.safety_score(), found.task_score(), found.comfort_score()] {
            assert!((score - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn two_runs_are_worked_by_hand() {
        let crashed = Run {
            collision: true,
            red_lights: 1.0,
            stop_signs: 0.0,
            off_road_m: 10.0,
            route_distance_m: 1.0,
            completion: 0.4,
            completed_s: None,
            acceleration_mps2: 4.0,
            yaw_rate_radps: 0.6,
            lane_invasions: 2.0,
        };
        let arrived = Run {
            red_lights: 0.0,
            stop_signs: 1.0,
            route_distance_m: 0.5,
            completed_s: Some(12.0),
            acceleration_mps2: 1.0,
            yaw_rate_radps: 0.3,
            ..PERFECT
        };
        let found = criteria(&[crashed, arrived]).unwrap();
        // 5 (1 - 1/2) = 2.5; 3 - 1/2 - 1/2 - 5/50 = 1.9;
        // RF = 1 - 0.75/5 = 0.85, RC = 0.7, TS = 12 of the completed one: 0.5 (0.85 + 0.7 + 1 - 0.2) = 1.175;
        // ACC = 2.5/8 = 0.3125, YV = 0.45/3 = 0.15, LI = 1/20 = 0.05: 0.2 (3 - 0.5125) = 0.4975. Sum 6.0725.
        assert!((found.safety_score() - 4.4 / 8.0).abs() < 1e-12);
        assert!((found.task_score() - 1.175 / 1.5).abs() < 1e-12);
        assert!((found.comfort_score() - 0.4975 / 0.6).abs() < 1e-12);
        assert!((found.overall_score() - 6.0725 / 10.1).abs() < 1e-12);
    }

    #[test]
    fn each_sub_metric_takes_its_share_of_the_score() {
        let lost = |run: Run| 10.1 * (1.0 - score(&[run]));
        let close = |found: f64, expected: f64| assert!((found - expected).abs() < 1e-9, "{found} {expected}");
        close(lost(Run { collision: true, ..PERFECT }), 5.0);
        close(lost(Run { red_lights: 1.0, ..PERFECT }), 1.0);
        close(lost(Run { stop_signs: 2.0, ..PERFECT }), 2.0);
        close(lost(Run { off_road_m: 50.0, ..PERFECT }), 1.0);
        close(lost(Run { route_distance_m: 2.5, ..PERFECT }), 0.25);
        close(lost(Run { completion: 0.0, ..PERFECT }), 0.5);
        close(lost(Run { completed_s: Some(60.0), ..PERFECT }), 0.5);
        close(lost(Run { acceleration_mps2: 8.0, ..PERFECT }), 0.2);
        close(lost(Run { yaw_rate_radps: 3.0, ..PERFECT }), 0.2);
        close(lost(Run { lane_invasions: 20.0, ..PERFECT }), 0.2);
    }

    #[test]
    fn only_route_following_is_clipped() {
        assert_eq!(criteria(&[Run { route_distance_m: 80.0, ..PERFECT }]).unwrap().route_following, 0.0);
        assert!(score(&[Run { off_road_m: 2000.0, ..PERFECT }]) < 0.0);
    }

    #[test]
    fn the_score_is_of_the_set_and_no_set_has_none() {
        // Time counts over completed runs: adding one that never arrives does not halve it.
        let slow = Run { completed_s: Some(30.0), ..PERFECT };
        let stuck = Run { completed_s: None, completion: 0.2, ..PERFECT };
        assert_eq!(criteria(&[slow, stuck]).unwrap().time_s, 30.0);
        assert_eq!(criteria(&[stuck]).unwrap().time_s, 0.0);
        assert_eq!(criteria(&[]), None);
    }

    /// One moment of a drive, as ChatScene records it.
    #[derive(Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Moment {
        current_game_time: f64,
        driven_distance: f64,
        ego_yaw: f64,
        off_road: bool,
        distance_to_route: f64,
        ego_acceleration_x: f64,
        ego_acceleration_y: f64,
        ego_acceleration_z: f64,
        collision: bool,
        run_red_light: u32,
        run_stop: u32,
        lane_invasion: u32,
        route_complete: f64,
    }

    /// The drive's quantities, by the definitions of [`Driving`](crate::sim::Driving).
    fn run(drive: &[Moment]) -> Run {
        let (first, last) = (drive.first().unwrap(), drive.last().unwrap());
        let mean = |value: &dyn Fn(&Moment) -> f64| drive.iter().map(value).sum::<f64>() / drive.len() as f64;
        let steps = || drive.windows(2).map(|pair| (&pair[0], &pair[1]));
        let off_road = steps().filter(|(before, now)| before.off_road || now.off_road);
        let seconds = last.current_game_time - first.current_game_time;
        Run {
            collision: last.collision,
            red_lights: f64::from(last.run_red_light),
            stop_signs: f64::from(last.run_stop),
            off_road_m: off_road.map(|(before, now)| now.driven_distance - before.driven_distance).sum(),
            route_distance_m: mean(&|moment| moment.distance_to_route),
            completion: last.route_complete / 100.0,
            completed_s: (last.route_complete == 100.0).then_some(seconds),
            acceleration_mps2: mean(&|moment| {
                let of = [moment.ego_acceleration_x, moment.ego_acceleration_y, moment.ego_acceleration_z];
                of.iter().map(|a| a * a).sum::<f64>().sqrt()
            }),
            yaw_rate_radps: steps().map(|(before, now)| (now.ego_yaw - before.ego_yaw).abs()).sum::<f64>().to_radians()
                / seconds,
            lane_invasions: f64::from(last.lane_invasion),
        }
    }

    #[test]
    fn chatscenes_own_function_gives_the_same_scores_for_the_same_records() {
        // Random drives in the form of ChatScene's records, with the answers of its `get_route_scores` (commit abb98629) for them.
        #[derive(Deserialize)]
        struct Records {
            answer: std::collections::BTreeMap<String, f64>,
            runs: Vec<Vec<Moment>>,
        }
        let text = include_str!("../../../../../tests/fixtures/chatscene/records.json");
        let records: Records = serde_json::from_str(text).unwrap();
        let found = criteria(&records.runs.iter().map(|drive| run(drive)).collect::<Vec<Run>>()).unwrap();
        let scores = [
            ("final_score", found.overall_score()),
            ("safety_os", found.safety_score()),
            ("task_os", found.task_score()),
            ("comfort_os", found.comfort_score()),
        ];
        for (name, ours) in scores {
            let theirs = records.answer[name];
            assert!((ours - theirs).abs() < 1e-12, "{name}: {ours}, there {theirs}");
        }
    }
}
