//! Worked examples of the realism score.

use super::*;
use crate::evaluation::metrics::safebench::SafebenchOptions;
use crate::kernel::Digest;
use crate::sim::{ActorRef, Contact, ContactClass, Driving, End, Feasibility, Motion, Side, Striker};

/// Bounds and tolerances of `experiments/safebench`.
pub const OPTIONS: ArsOptions = ArsOptions {
    kinematics: KinematicsOptions {
        acceleration: BoundedOptions { bound: 4.0, tolerance: 4.0 },
        lateral_acceleration: BoundedOptions { bound: 4.0, tolerance: 4.0 },
        jerk: BoundedOptions { bound: 10.0, tolerance: 20.0 },
    },
    map: MapOptions { off_road_tolerance_m: 2.0, wrong_way_tolerance_m: 10.0 },
    interaction: InteractionOptions {
        impact_speed: BoundedOptions { bound: 10.0, tolerance: 10.0 },
        approach: BoundedOptions { bound: 2.0, tolerance: 10.0 },
    },
    distance: DistanceOptions { start_gap_m: 10.0, apart_gap_m: 1.0, jump_tolerance_m: 1.0 },
    validity: ValidityOptions { jump_m_max: 2.0, off_road_m_max: 5.0 },
    judges_idle: false,
};

/// With them every staged contact counts.
pub const PUBLISHED: SafebenchOptions = SafebenchOptions { selected_per_group: 1, ars: OPTIONS, preventable: None };

pub fn report() -> AdversaryReport {
    AdversaryReport {
        actor: ActorRef::Inserted(0),
        kind: AgentKind::Vehicle,
        acted: true,
        motion: Motion::default(),
        simulated: Feasibility::default(),
        recorded: None,
        initial_overlap: false,
        struck_bystander: false,
        struck_parked: false,
        route_completion: None,
        of_kind: None,
        of_place: None,
        log_deviation_m_max: None,
    }
}

pub fn conduct(kind: AgentKind) -> ActorConduct {
    ActorConduct {
        kind,
        moved: true,
        acceleration_mps2_p95: 2.0,
        jerk_mps3_mean: 3.0,
        ego_gap_m_first: 30.0,
        other_gap_m_min: None,
    }
}

pub fn outcome(actors: Vec<(AdversaryReport, ActorConduct)>) -> Outcome {
    let (adversaries, actors) = actors.into_iter().unzip();
    Outcome {
        end: End::Horizon,
        steps: 80,
        contact: None,
        distance_m_min: Some(1.0),
        ttc_s_min: None,
        post_encroachment_s_min: None,
        route_completion: 0.5,
        ego_lateral_m_max: 0.1,
        ego: Motion::default(),
        adversaries,
        trace: Digest::of_bytes(b"trace"),
        driving: Some(Driving { actors, ..Driving::default() }),
    }
}

fn scores(actors: Vec<(AdversaryReport, ActorConduct)>) -> [f64; 4] {
    run_realism(&outcome(actors), &OPTIONS).unwrap().sub_scores
}

fn close(found: [f64; 4], expected: [f64; 4]) {
    assert!(found.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-12), "{found:?}, expected {expected:?}");
}

#[test]
fn gentle_motion_on_the_road_is_fully_real() {
    close(scores(vec![(report(), conduct(AgentKind::Vehicle))]), [1.0; 4]);
}

#[test]
fn a_run_in_which_nobody_is_set_off_is_no_scenario() {
    let idle = |kind| (report(), ActorConduct { moved: false, ..conduct(kind) });
    let nothing = RunRealism { acted: false, valid: false, sub_scores: [0.0; 4] };
    assert_eq!(run_realism(&outcome(vec![]), &OPTIONS), Some(nothing));
    let mut waiting = outcome(vec![idle(AgentKind::Vehicle), idle(AgentKind::Static)]);
    assert_eq!(run_realism(&waiting, &OPTIONS), Some(nothing), "whom one places but never sets off");
    waiting.contact = Some(contact(4.0));
    assert!(run_realism(&waiting, &OPTIONS).unwrap().acted, "a parked car that the ego drives into is a scenario");
}

#[test]
fn an_idle_run_counts_where_all_runs_do() {
    let options = ArsOptions { judges_idle: true, ..OPTIONS };
    let judged = run_realism(&outcome(vec![]), &options).unwrap();
    assert_eq!(judged, RunRealism { acted: false, valid: true, sub_scores: [1.0; 4] });
    let mut far = outcome(vec![(report(), ActorConduct { moved: false, ..conduct(AgentKind::Vehicle) })]);
    far.distance_m_min = Some(1000.0);
    let far = run_realism(&far, &options).unwrap();
    close(far.sub_scores, [1.0, 1.0, 2.0 / 3.0, 1.0]);
    let acted = RunRealism { acted: true, valid: true, sub_scores: [0.5, 1.0, 1.0, 1.0] };
    assert!((ars(&[acted, judged], 0).unwrap().ars - 0.9).abs() < 1e-12, "0.8 of the one and 1 of the other");
}

#[test]
fn abstaining_adds_no_realism() {
    let acted = RunRealism { acted: true, valid: true, sub_scores: [0.5, 1.0, 1.0, 1.0] };
    let nothing = RunRealism { acted: false, valid: false, sub_scores: [0.0; 4] };
    // One of two is valid, and the sub-scores are those of the one: 0.5 * 0.8.
    assert!((ars(&[acted, nothing], 0).unwrap().ars - 0.4).abs() < 1e-12);
    assert_eq!(ars(&[nothing; 3], 0).unwrap().ars, 0.0);
}

pub fn contact(relative_speed_mps: f64) -> Contact {
    Contact {
        with: ActorRef::Inserted(0),
        adversary: true,
        time_s: 3.0,
        relative_speed_mps,
        impact_angle_rad: 0.0,
        striker: Striker::Other,
        ego_side: Side::Rear,
        other_side: Side::Front,
        class: ContactClass::RearEndEgoStruck,
        visible_s: None,
        avoidable: None,
        fault: None,
        jury: None,
    }
}

#[test]
fn each_sub_score_is_worked_by_hand() {
    let mut bad = (report(), conduct(AgentKind::Vehicle));
    // 1 m/s² beyond 4 of 4: 0.75; lateral 2 beyond: 0.5; jerk 15 beyond 10 of 20: 0.25. Mean 0.5.
    bad.1.acceleration_mps2_p95 = 5.0;
    bad.0.motion.lateral_acceleration_mps2_max = 6.0;
    bad.1.jerk_mps3_mean = 25.0;
    // 0.5 of 2 m off the road: 0.75; 5 of 10 m on the wrong side: 0.5. Mean 0.625.
    bad.0.simulated.off_road_m = 0.5;
    bad.0.simulated.wrong_way_m = 5.0;
    // Gap of 4 of 10 m at the start: 0.4; 0.5 of 1 m apart: 0.5; jump 0.3 of 1 m: 0.7. Mean 1.6 / 3.
    bad.1.ego_gap_m_first = 4.0;
    bad.1.other_gap_m_min = Some(0.5);
    bad.0.simulated.jump_m = 0.3;
    let mut run = outcome(vec![bad.clone()]);
    // Struck nobody: 1; impact of 14 m/s, 4 beyond 10 of 10: 0.6; came within 2 m: 1. Mean 2.6 / 3.
    run.contact = Some(contact(14.0));
    let realism = run_realism(&run, &OPTIONS).unwrap();
    assert!(realism.valid);
    close(realism.sub_scores, [0.5, 0.625, 2.6 / 3.0, 1.6 / 3.0]);
    // The worst of two counts.
    assert!((scores(vec![(report(), conduct(AgentKind::Vehicle)), bad])[0] - 0.5).abs() < 1e-12);
}

#[test]
fn whoever_strikes_a_bystander_or_a_parked_thing_loses_a_third_of_the_interaction() {
    let struck = |bystander, parked| {
        let mut one = (report(), conduct(AgentKind::Vehicle));
        (one.0.struck_bystander, one.0.struck_parked) = (bystander, parked);
        scores(vec![(report(), conduct(AgentKind::Vehicle)), one])[2]
    };
    let third = 2.0 / 3.0;
    assert_eq!(
        [struck(false, false), struck(true, false), struck(false, true), struck(true, true)],
        [1.0, third, third, third]
    );
}

#[test]
fn walkers_are_not_judged_by_lanes_nor_parked_things_by_motion() {
    let mut walker = (report(), conduct(AgentKind::Pedestrian));
    walker.0.simulated.wrong_way_m = 50.0;
    walker.0.motion.lateral_acceleration_mps2_max = 90.0;
    close(scores(vec![walker]), [1.0; 4]);
    let mut machine = (report(), conduct(AgentKind::Static));
    machine.0.simulated.off_road_m = 20.0;
    let beside = vec![(report(), conduct(AgentKind::Vehicle)), machine];
    close(scores(beside.clone()), [1.0; 4]);
    assert!(run_realism(&outcome(beside), &OPTIONS).unwrap().valid, "it may stand beside the road");
}

#[test]
fn adversaries_that_never_come_near_interact_little() {
    let mut run = outcome(vec![(report(), conduct(AgentKind::Vehicle))]);
    run.distance_m_min = Some(9.0);
    // 7 m beyond 2 of 10: 0.3.
    close(run_realism(&run, &OPTIONS).unwrap().sub_scores, [1.0, 1.0, 2.3 / 3.0, 1.0]);
}

#[test]
fn the_score_is_validity_times_the_weighted_sum() {
    let runs = [
        RunRealism { acted: true, valid: true, sub_scores: [1.0, 0.5, 1.0, 0.0] },
        RunRealism { acted: true, valid: false, sub_scores: [0.5, 0.5, 0.0, 1.0] },
    ];
    let realism = ars(&runs, 2).unwrap();
    // 1 of 4 is valid; 0.4 * 0.75 + 0.3 * 0.5 + 0.2 * 0.5 + 0.1 * 0.5 = 0.6.
    close(realism.sub_scores, [0.75, 0.5, 0.5, 0.5]);
    assert!((realism.valid_rate - 0.25).abs() < 1e-12 && (realism.ars - 0.15).abs() < 1e-12);
    assert_eq!(ars(&[], 3), None);
}

#[test]
fn overlap_at_the_start_a_jump_or_leaving_the_map_make_a_scene_invalid() {
    let valid = |change: fn(&mut AdversaryReport)| {
        let mut changed = report();
        change(&mut changed);
        run_realism(&outcome(vec![(changed, conduct(AgentKind::Vehicle))]), &OPTIONS).unwrap().valid
    };
    assert!(valid(|_| ()));
    assert!(!valid(|r| r.initial_overlap = true));
    assert!(!valid(|r| r.simulated.jump_m = 2.5));
    assert!(!valid(|r| r.simulated.off_road_m = 6.0));
}

#[test]
fn options_without_a_scale_are_named() {
    assert_eq!(OPTIONS.fault(), None);
    let mut options = OPTIONS;
    options.kinematics.jerk.tolerance = 0.0;
    assert_eq!(options.fault(), Some(("kinematics.jerk.tolerance", "a positive number")));
    options = OPTIONS;
    options.validity.jump_m_max = f64::NAN;
    assert_eq!(options.fault(), Some(("validity.jump_m_max", "a number not below 0")));
}
