//! Scripted road users that wait for the ego: triggers, pedals, ways, stop rules, and what is refused.

use crate::ego::Policy;
use crate::kernel::{Pose, Vec2, num};
use crate::scene::AgentKind;
use crate::sim::scenes::*;
use crate::sim::*;

fn script(kind: AgentKind, x: f64, y: f64, heading_rad: f64, phases: Vec<Phase>) -> Script {
    let (length_m, width_m) = if kind == AgentKind::Vehicle { (4.5, 1.9) } else { (0.6, 0.6) };
    let spawn = Pose { position: Vec2::new(x, y), heading_rad };
    Script { kind, length_m, width_m, spawn, trigger: within(1e6), phases }
}

fn within(distance_m: f64) -> Trigger {
    Trigger { reference: 0, distance_m, ego_speed_mps_min: 0.0 }
}

/// Runs scripts beside an ego that drives its log at 10 m/s along the x axis.
fn run(scripts: Vec<Script>) -> (Outcome, Trace) {
    let scene = straight_road(121, 10.0, vec![]);
    let actions = scripts.into_iter().map(Action::Triggered).collect();
    rollout_traced(&Plant::new(&scene).unwrap(), &Intervention { actions }, &mut *Policy::Replay.driver()).unwrap()
}

fn motion(scripts: Vec<Script>, who: usize) -> Vec<crate::scene::Sample> {
    run(scripts).1.actors[who].samples.iter().flatten().copied().collect()
}

#[test]
fn a_car_starts_from_standstill_at_full_throttle() {
    let phases = vec![Phase::straight(50.0, Until::Forever)];
    let car = motion(vec![script(AgentKind::Vehicle, 0.0, 40.0, 0.0, phases)], 0);
    let throttle = bicycle::DEFAULT_LIMITS.engine_mps2;
    for (k, sample) in car.iter().enumerate().take(70) {
        let t = 0.1 * k as f64;
        assert!((sample.speed_mps() - throttle * t).abs() < 1e-9, "step {k}");
        assert!((sample.position.x - 0.5 * throttle * t * t).abs() < 1e-6, "step {k}");
    }
}

#[test]
fn at_its_target_speed_a_car_hunts_between_throttle_and_brake() {
    let phases = vec![Phase::straight(5.0, Until::Forever)];
    let car = motion(vec![script(AgentKind::Vehicle, 0.0, 40.0, 0.0, phases)], 0);
    let limits = bicycle::DEFAULT_LIMITS;
    let (above, below) = (0.1 * limits.engine_mps2, 0.1 * limits.brake_mps2);
    let later = &car[30..];
    assert!(later.iter().all(|s| s.speed_mps() <= 5.0 + above + 1e-9 && s.speed_mps() > 5.0 - below - 1e-9));
    assert!(later.iter().any(|s| s.speed_mps() > 5.0) && later.iter().any(|s| s.speed_mps() < 4.6), "it does hunt");
}

#[test]
fn a_trigger_measures_to_its_reference_and_asks_for_the_ego_s_speed() {
    let go = || vec![Phase::straight(5.0, Until::Forever)];
    let parked = Script { trigger: within(20.0), ..script(AgentKind::Static, 60.0, 10.0, 0.0, vec![]) };
    let far = Script { trigger: within(20.0), ..script(AgentKind::Vehicle, 0.0, 80.0, 0.0, go()) };
    let slow = Trigger { ego_speed_mps_min: 10.5, ..within(20.0) };
    let waiting = Script { trigger: slow, ..far.clone() };
    let (_, trace) = run(vec![parked, far, waiting]);
    let first_move = |who: usize| trace.actors[who].samples.iter().flatten().position(|s| s.speed_mps() > 0.0);
    // The ego is within 20 m of (60, 10) from x = 60 - sqrt(300) = 42.7 on: step 43, so it moves at step 44.
    assert_eq!((first_move(0), first_move(1), first_move(2)), (None, Some(44), None));
}

#[test]
fn after_its_last_phase_a_car_brakes_and_stays() {
    let phases = vec![Phase::straight(8.0, Until::Driven { m: 20.0 })];
    let car = motion(vec![script(AgentKind::Vehicle, 0.0, 40.0, 0.0, phases)], 0);
    let last = car[car.len() - 1];
    assert_eq!(last.speed_mps(), 0.0);
    // 20 m, at most one step further, then v^2 / 2b.
    assert!(last.position.x > 20.0 && last.position.x < 20.0 + 0.85 + 8.3 * 8.3 / (2.0 * 8.829), "{last:?}");
}

#[test]
fn profiles_give_one_value_a_step_and_repeat_the_last() {
    let mut phase = Phase::straight(0.0, Until::Forever);
    phase.speed = Speed::Profile { mps: vec![1.0, 0.0, 2.0] };
    let walker = motion(vec![script(AgentKind::Pedestrian, 0.0, 40.0, num::FRAC_PI_2, vec![phase])], 0);
    let speeds: Vec<f64> = walker.iter().map(|s| s.speed_mps()).collect();
    assert!(speeds[..6].iter().zip([0.0, 1.0, 0.0, 2.0, 2.0, 2.0]).all(|(a, b)| (a - b).abs() < 1e-9), "{speeds:?}");
    assert!((walker[10].position.y - (40.0 + 0.1 + 8.0 * 0.2)).abs() < 1e-9);
}

#[test]
fn phases_follow_each_other_by_time_and_by_the_ego_s_distance() {
    let phases = vec![
        Phase::straight(1.0, Until::Lasted { s: 1.0 }),
        Phase::straight(0.0, Until::EgoWithin { m: 30.0 }),
        Phase::straight(2.0, Until::Forever),
    ];
    let walker = motion(vec![script(AgentKind::Pedestrian, 60.0, 5.0, 0.0, phases)], 0);
    let moving: Vec<usize> = (0..walker.len()).filter(|&k| walker[k].speed_mps() > 0.0).collect();
    assert_eq!(moving[..10], [1, 2, 3, 4, 5, 6, 7, 8, 9, 10], "one second");
    // It stands at (61, 5); the ego is within 30 m from x = 61 - sqrt(875) = 31.4 on: step 32.
    assert_eq!(moving[10], 33);
}

#[test]
fn a_car_follows_a_path_around_a_corner_and_a_walker_exactly() {
    let corner: Vec<Vec2> = (0..=60)
        .map(|k| {
            let s = f64::from(k);
            let (sin, cos) = num::sin_cos(((s - 20.0) / 12.0).clamp(0.0, num::FRAC_PI_2));
            let arc = 12.0 * num::FRAC_PI_2;
            let (before, after) = (s.min(20.0), (s - 20.0 - arc).max(0.0));
            Vec2::new(before + 12.0 * sin, 40.0 + 12.0 * (1.0 - cos) + after)
        })
        .collect();
    let along = |kind| {
        let mut phase = Phase::straight(5.0, Until::Forever);
        phase.way = Way::Path { points: corner.clone() };
        motion(vec![script(kind, 0.0, 40.0, 0.0, vec![phase])], 0)
    };
    let path = crate::kernel::Polyline::new(corner.clone()).unwrap();
    let aside = |samples: &[crate::scene::Sample]| {
        samples[..100].iter().map(|s| path.project(s.position).offset_m.abs()).fold(0.0, f64::max)
    };
    let (car, walker) = (along(AgentKind::Vehicle), along(AgentKind::Pedestrian));
    assert!(aside(&car) < 1.0, "{}", aside(&car));
    assert!(aside(&walker) < 1e-6 && (walker[20].speed_mps() - 5.0).abs() < 0.1);
    let turned = num::wrap_angle(car[100].heading_rad - num::FRAC_PI_2).abs();
    assert!(turned < 0.05, "{turned}");
}

#[test]
fn a_car_steers_at_its_waypoints_and_with_its_wheel() {
    let mut phase = Phase::straight(8.0, Until::Forever);
    phase.way = Way::Points { points: (0..100).map(|k| Vec2::new(10.0 + f64::from(k), 41.0)).collect() };
    let car = motion(vec![script(AgentKind::Vehicle, 0.0, 40.0, 0.0, vec![phase.clone()])], 0);
    assert!((car[80].position.y - 41.0).abs() < 0.3, "{:?}", car[80]);
    phase.way = Way::Wheel { rad: vec![0.1] };
    let left = motion(vec![script(AgentKind::Vehicle, 0.0, 40.0, 0.0, vec![phase])], 0);
    assert!(left[40].heading_rad > 0.3 && left[40].position.y > 41.0, "{:?}", left[40]);
}

/// Returns the motion of a road user on a way, all else being equal.
fn on_way(kind: AgentKind, way: Way) -> Vec<crate::scene::Sample> {
    let phase = Phase { way, ..Phase::straight(6.0, Until::Forever) };
    motion(vec![script(kind, 0.0, 40.0, 0.0, vec![phase])], 0)
}

#[test]
fn a_shift_ends_beside_the_old_line_with_the_old_heading() {
    for (kind, left_m, off_m) in [(AgentKind::Vehicle, 3.5, 0.2), (AgentKind::Vehicle, -2.0, 0.2)] {
        let samples = on_way(kind, Way::Shift { left_m, over_m: 16.0 });
        let last = samples[samples.len() - 1];
        assert!((last.position.y - 40.0 - left_m).abs() < off_m && last.heading_rad.abs() < 0.02, "{last:?}");
        let before = samples.iter().rfind(|s| s.position.x < 1.0).unwrap();
        assert!((before.position.y - 40.0).abs() < 0.5, "it does not jump aside: {before:?}");
    }
    let walker = on_way(AgentKind::Pedestrian, Way::Shift { left_m: 3.5, over_m: 16.0 });
    let last = walker[walker.len() - 1];
    assert!((last.position.y - 43.5).abs() < 1e-3 && walker[1..].iter().all(|s| (s.speed_mps() - 6.0).abs() < 1e-9));
}

#[test]
fn a_turn_leaves_on_its_new_heading_at_once_on_foot() {
    let to_right = Way::Turn { left_rad: -num::FRAC_PI_2, radius_m: 8.0 };
    let car = on_way(AgentKind::Vehicle, to_right.clone());
    let last = car[car.len() - 1];
    assert!((last.heading_rad + num::FRAC_PI_2).abs() < 0.25 && last.position.y < 20.0, "{last:?}");
    assert!(car.iter().all(|s| s.position.x < 16.0), "on an arc of about its radius");
    let walker = on_way(AgentKind::Pedestrian, to_right);
    assert!((walker[1].heading_rad + num::FRAC_PI_2).abs() < 1e-9 && walker[30].position.x.abs() < 1e-9);
}

#[test]
fn a_phase_may_end_at_the_ego_s_route() {
    let phases = vec![Phase::straight(5.0, Until::NearRoute { m: 10.0 })];
    let walker = motion(vec![script(AgentKind::Pedestrian, 0.0, 40.0, -num::FRAC_PI_2, phases)], 0);
    // The route is the x axis: it stops at the first step at which it is nearer than 10 m.
    let last = walker[walker.len() - 1];
    assert!(last.speed_mps() == 0.0 && last.position.y < 10.0 && last.position.y > 9.4, "{last:?}");
}

#[test]
fn who_intercepts_meets_an_ego_that_ignores_it() {
    let mut phase = Phase::straight(0.0, Until::Forever);
    phase.speed = Speed::Intercept { mps_min: 0.5, mps_max: 6.0 };
    let walker = script(AgentKind::Pedestrian, 50.0, -12.0, num::FRAC_PI_2, vec![phase.clone()]);
    let contact = run(vec![walker.clone()]).0.contact.expect("a contact");
    assert_eq!((contact.with, contact.adversary), (ActorRef::Inserted(0), true));
    // The front bumper reaches x = 49.7 at 4.745 s.
    assert!((contact.time_s - 4.745).abs() < 0.15, "{contact:?}");
    phase.speed = Speed::Constant { mps: 6.0 };
    assert!(run(vec![Script { phases: vec![phase], ..walker }]).0.contact.is_none(), "it passes ahead of the ego");
}

#[test]
fn scripts_that_make_no_sense_are_refused_by_rule() {
    let good = script(AgentKind::Vehicle, 0.0, 40.0, 0.0, vec![Phase::straight(5.0, Until::Forever)]);
    let scene = straight_road(31, 10.0, vec![]);
    let plant = Plant::new(&scene).unwrap();
    let refusal = |change: &dyn Fn(&mut Script)| {
        let mut script = good.clone();
        change(&mut script);
        let act = Intervention { actions: vec![Action::Triggered(script)] };
        rollout(&plant, &act, &mut *Policy::Idm.driver()).map(|_| ()).unwrap_err().to_string()
    };
    assert!(refusal(&|s| s.trigger.reference = 1).contains("reference"));
    assert!(refusal(&|s| s.trigger.distance_m = f64::NAN).contains("trigger"));
    assert!(refusal(&|s| s.spawn.position.x = f64::INFINITY).contains("spawn"));
    assert!(refusal(&|s| s.spawn.position.x = 1e9).contains("spawn"));
    assert!(refusal(&|s| s.length_m = 0.0).contains("length"));
    assert!(refusal(&|s| s.kind = AgentKind::Static).contains("static"));
    assert!(refusal(&|s| s.phases = vec![s.phases[0].clone(); 65]).contains("64 phases"));
    assert!(refusal(&|s| s.phases[0].speed = Speed::Profile { mps: vec![] }).contains("profiles"));
    assert!(refusal(&|s| s.phases[0].speed = Speed::Intercept { mps_min: 3.0, mps_max: 2.0 }).contains("speeds"));
    assert!(refusal(&|s| s.phases[0].way = Way::Path { points: vec![Vec2::new(f64::NAN, 0.0)] }).contains("way"));
    assert!(refusal(&|s| s.phases[0].way = Way::Shift { left_m: f64::NAN, over_m: 9.0 }).contains("shift"));
    assert!(refusal(&|s| s.phases[0].way = Way::Shift { left_m: 3.0, over_m: 0.0 }).contains("shift"));
    assert!(refusal(&|s| s.phases[0].way = Way::Turn { left_rad: 4.0, radius_m: 9.0 }).contains("turn"));
    assert!(refusal(&|s| s.phases[0].way = Way::Turn { left_rad: 1.0, radius_m: 1.0 }).contains("turn"));
    assert!(refusal(&|s| s.phases[0].until = Until::NearRoute { m: -1.0 }).contains("end of a phase"));
    assert!(refusal(&|s| s.phases[0].throttle = 1.1).contains("shares"));
    assert!(refusal(&|s| s.phases[0].until = Until::Driven { m: -1.0 }).contains("end of a phase"));
}
