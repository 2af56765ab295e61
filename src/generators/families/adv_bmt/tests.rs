//! The family's signature: an inserted road user that meets the replayed ego where and when it was imposed.

use std::sync::Arc;

use super::*;
use crate::ego;
use crate::families::sources;
use crate::families::tests::{built, worlds};
use crate::objects::{FamilyName, ParameterValue, Setting};
use crate::scene::Scene;
use crate::scene::fixture::two_lane_scene;
use crate::sim::{self, Action, ActorRef};

fn logged(scene: Scene) -> Situation {
    Situation::new(Arc::new(scene), &ego::Policy::Replay).unwrap()
}

/// The inserted motion of a program variant, with its first step; `None` where every way back is blocked.
fn inserted(situation: &Situation, edit: impl Fn(&mut crate::objects::Program)) -> Option<(usize, Vec<Sample>)> {
    let family = sources().get(&FamilyName::new(NAME)).unwrap().clone();
    let mut program = family.parent.clone();
    edit(&mut program);
    let compiled = built(&family, &program, situation);
    match compiled.intervention.actions.as_slice() {
        [] => None,
        [Action::Insert { from_step, samples, .. }] => Some((*from_step, samples.clone())),
        other => panic!("{}: {other:?}", situation.scene_id()),
    }
}

#[test]
fn the_imposed_collision_is_met_at_its_step_against_the_unchanged_ego_log() {
    let (mut met, mut blocked) = (0, 0);
    for scene in worlds(22).chain([two_lane_scene()]) {
        let situation = logged(scene);
        let Some((from_step, samples)) = inserted(&situation, |_| {}) else {
            blocked += 1;
            continue;
        };
        let step = from_step + samples.len() - 1;
        assert_eq!(step + 1, situation.ego.steps().end, "{}: the last step of the log", situation.scene_id());
        let (ego, last) = (situation.ego.at(step).unwrap(), samples.last().unwrap());
        assert_eq!(last.position, ego.position, "{}", situation.scene_id());
        let guest = situation.guest(AgentKind::Vehicle);
        assert!(situation.body(guest, last).overlaps(situation.ego.body(step).unwrap()));
        // Replayed, the boxes touch on their way to that state, at most the time that two lengths take.
        let family = sources().get(&FamilyName::new(NAME)).unwrap().clone();
        let compiled = built(&family, &family.parent, &situation);
        let mut driver = ego::Policy::Replay.driver();
        let outcome = sim::rollout(&situation.plant, &compiled.intervention, driver.as_mut()).unwrap();
        let contact = outcome.contact.expect("the collision that was imposed");
        if contact.with != ActorRef::Inserted(0) {
            // The log itself holds an earlier contact; it ends the rollout before.
            continue;
        }
        let imposed_s = (step - situation.ego.steps().start) as f64 * DT_S;
        assert!(contact.time_s <= imposed_s + 1e-9, "{}: {} of {imposed_s}", situation.scene_id(), contact.time_s);
        met += 1;
    }
    assert!(met >= 18 && blocked <= 2, "{met} met, {blocked} blocked");
}

#[test]
fn the_first_sample_that_moves_and_does_not_spin_is_used() {
    for scene in worlds(11) {
        let situation = logged(scene);
        let Some((_, samples)) = inserted(&situation, |_| {}) else { continue };
        assert!(displacement_mps(&samples) >= 1.0 && curvature_1pm(&samples) < 0.8, "{}", situation.scene_id());
    }
}

#[test]
fn rejection_by_hand() {
    let at = |x: f64, heading_rad: f64| Sample { position: Vec2::new(x, 0.0), heading_rad, velocity: Vec2::ZERO };
    let line: Vec<Sample> = (0..11).map(|k| at(0.1 * k as f64, 0.0)).collect();
    // One metre in eleven samples of 0.1 s.
    assert!((displacement_mps(&line) - 1.0 / 1.1).abs() < 1e-12);
    assert_eq!(curvature_1pm(&line), 0.0);
    assert!((curvature_1pm(&[at(0.0, 0.0), at(0.5, 0.4)]) - 0.8).abs() < 1e-5);
}

#[test]
fn controls_of_the_grown_motion_are_tokens_joined_by_ramps() {
    let situation = logged(two_lane_scene());
    let (_, samples) = inserted(&situation, |_| {}).unwrap();
    let controls: Vec<(f64, f64)> = samples
        .windows(2)
        .map(|pair| {
            let turn = num::wrap_angle(pair[1].heading_rad - pair[0].heading_rad);
            ((pair[1].speed_mps() - pair[0].speed_mps()) / DT_S, turn / DT_S)
        })
        .collect();
    let is_token = |value: f64, step: f64| (value - (value / step).round() * step).abs() < 1e-6;
    // Backward from the collision: three steps of ramp, then the token's own control for two.
    for (back, (acceleration, yaw)) in controls.iter().rev().enumerate() {
        if back % 5 >= reverse::RAMP_STEPS - 1 {
            assert!(is_token(*acceleration, 0.625) && acceleration.abs() <= 10.0 + 1e-9, "{back}: {acceleration}");
            assert!(is_token(*yaw, num::PI / 32.0), "{back}: {yaw}");
        }
    }
}

/// Largest jerk of the used motions, and share of them that leave the road by more than a metre.
fn roughness(scenes: usize, edit: impl Fn(&mut crate::objects::Program)) -> (f64, f64) {
    let (mut jerk, mut departed, mut count) = (0.0, 0.0, 0.0);
    for scene in worlds(scenes) {
        let situation = logged(scene);
        let Some((_, samples)) = inserted(&situation, &edit) else { continue };
        let speeds: Vec<f64> = samples.iter().map(Sample::speed_mps).collect();
        let jerks = speeds.windows(3).map(|v| (v[2] - 2.0 * v[1] + v[0]).abs() / (DT_S * DT_S));
        jerk += jerks.fold(0.0, f64::max);
        let guest = situation.guest(AgentKind::Vehicle);
        let judged = Judged { situation: &situation, actor: guest, from_step: 11, adversaries: &[guest] };
        departed += f64::from(road_departure_m(&judged, &samples) > 1.0);
        count += 1.0;
    }
    (jerk / count, departed / count)
}

#[test]
fn without_the_costs_of_change_and_of_the_road_motions_are_rougher_and_leave_the_road() {
    let number = |program: &mut crate::objects::Program, name: &str, value: f64| {
        program.parameters.insert(name.into(), ParameterValue::Number(value));
    };
    let parent = roughness(22, |_| {});
    let rough = roughness(22, |program| {
        number(program, "token_acceleration_change_mps2", 20.0);
        number(program, "token_yaw_change_radps", 3.0);
    });
    let astray = roughness(22, |program| {
        number(program, "token_road_scale_m", 10.0);
        number(program, "road_departure_m_max", 20.0);
    });
    println!("(jerk, share off the road): parent {parent:?}, no smoothing {rough:?}, no road {astray:?}");
    assert!(parent.0 < 0.8 * rough.0, "{parent:?} {rough:?}");
    assert!(parent.1 < astray.1, "{parent:?} {astray:?}");
}

#[test]
fn a_cyclist_may_be_inserted_and_linger_after_an_earlier_collision() {
    let situation = logged(two_lane_scene());
    let (from_step, samples) = inserted(&situation, |program| {
        let actor = program.operator_graph.get_mut("actor").unwrap();
        actor.settings.insert("shape".into(), Setting::Choice("cyclist".into()));
        let motion = program.operator_graph.get_mut("motion").unwrap();
        motion.settings.insert("meeting".into(), Setting::Choice("drawn".into()));
        program.parameters.insert("linger_s".into(), ParameterValue::Number(1.0));
    })
    .unwrap();
    let met = samples
        .iter()
        .enumerate()
        .any(|(k, s)| situation.ego.at(from_step + k).is_some_and(|ego| ego.position.distance(s.position) < 1e-9));
    assert!(met);
}
