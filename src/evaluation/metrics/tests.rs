//! Worked examples of every metric.

use super::attack::{AttackTarget, attack};
use super::realism::*;
use super::soft;
use crate::kernel::Digest;
use crate::sim::{ActorRef, AdversaryReport, Contact, End, Motion, Outcome, Striker};

pub fn options() -> RealismOptions {
    RealismOptions {
        weights: RealismWeights {
            lane_validity: 0.2,
            initial_non_overlap: 0.1,
            collision_validity: 0.2,
            route_progress: 0.1,
            continuity: 0.1,
            acceleration: 0.2,
            jerk: 0.1,
        },
        off_road_tolerance_m: 1.0,
        wrong_way_tolerance_m: 10.0,
        jump_tolerance_m: 1.0,
        acceleration_bound_mps2: 6.0,
        lateral_acceleration_bound_mps2: 5.0,
        acceleration_tolerance_mps2: 4.0,
        jerk_bound_mps3: 20.0,
        jerk_tolerance_mps3: 40.0,
    }
}

fn outcome(adversaries: Vec<AdversaryReport>) -> Outcome {
    Outcome {
        end: End::Horizon,
        steps: 80,
        contact: None,
        distance_m_min: None,
        ttc_s_min: None,
        post_encroachment_s_min: None,
        route_completion: 1.0,
        ego_lateral_m_max: 0.0,
        ego: Motion::default(),
        adversaries,
        trace: Digest::of_bytes(b"trace"),
    }
}

fn adversary() -> AdversaryReport {
    AdversaryReport {
        actor: ActorRef::Track(0),
        motion: Motion::default(),
        off_road_m_max: 0.0,
        wrong_way_m: 0.0,
        initial_overlap: false,
        struck_bystander: false,
        jump_m_max: 0.0,
        log_deviation_m_max: Some(0.0),
    }
}

#[test]
fn a_soft_violation_falls_linearly_and_ends_at_zero() {
    assert_eq!([soft(-1.0, 2.0), soft(0.0, 2.0), soft(0.5, 2.0), soft(3.0, 2.0)], [1.0, 1.0, 0.75, 0.0]);
}

#[test]
fn a_scene_without_adversary_is_fully_realistic_by_definition() {
    let found = diagnostics(&outcome(vec![]), &options());
    assert_eq!(found.len(), 7);
    assert_eq!(realism(&found, &options().weights), 1.0);
}

#[test]
fn realism_by_hand_with_every_violation() {
    let mut one = adversary();
    one.off_road_m_max = 0.25; // 0.75
    one.wrong_way_m = 5.0; // 0.5
    one.jump_m_max = 0.1; // 0.9
    one.motion.deceleration_mps2_max = 8.0; // excess 2 of 4: 0.5
    one.motion.jerk_mps3_max = 30.0; // excess 10 of 40: 0.75
    one.struck_bystander = true; // 0
    let found = diagnostics(&outcome(vec![adversary(), one]), &options());
    let by_hand = 0.2 * 0.75 + 0.1 + 0.0 + 0.1 * 0.5 + 0.1 * 0.9 + 0.2 * 0.5 + 0.1 * 0.75;
    assert!((realism(&found, &options().weights) - by_hand).abs() < 1e-12, "{found:?}");
}

#[test]
fn lateral_acceleration_and_initial_overlap_count() {
    let mut one = adversary();
    one.initial_overlap = true;
    one.motion.lateral_acceleration_mps2_max = 6.0; // excess 1 of 4
    let found = diagnostics(&outcome(vec![one]), &options());
    assert_eq!((found["initial_non_overlap"], found["acceleration"]), (0.0, 0.75));
}

#[test]
fn attack_counts_whom_the_experiment_names() {
    let contact = |adversary| {
        Some(Contact {
            with: ActorRef::Track(1),
            adversary,
            time_s: 2.0,
            relative_speed_mps: 3.0,
            impact_angle_rad: 0.0,
            striker: Striker::Other,
        })
    };
    let bystander = Outcome { contact: contact(false), ..outcome(vec![]) };
    assert_eq!(attack(&bystander, AttackTarget::Adversary), 0.0);
    assert_eq!(attack(&bystander, AttackTarget::Anyone), 1.0);
    assert_eq!(attack(&Outcome { contact: contact(true), ..outcome(vec![]) }, AttackTarget::Adversary), 1.0);
    assert_eq!(attack(&outcome(vec![]), AttackTarget::Anyone), 0.0);
}

#[test]
fn weights_that_do_not_sum_to_one_are_refused() {
    let mut wrong = options();
    wrong.weights.jerk = 0.3;
    assert!(matches!(wrong.check(), Err(RealismError::Sum(_))));
    let mut zero = options();
    zero.jump_tolerance_m = 0.0;
    assert!(matches!(zero.check(), Err(RealismError::Value { name: "jump_tolerance_m", .. })));
    assert_eq!(options().check(), Ok(()));
}
