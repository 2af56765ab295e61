//! Whole rollouts against what must hold in any world: symmetry, replay, independence of threads.

use crate::ego::Policy;
use crate::kernel::{Pose, Threads, Vec2, num};
use crate::scene::{Sample, Scene};
use crate::sim::scenes::*;
use crate::sim::*;

/// A change of frame.
#[derive(Clone, Copy, Debug)]
struct Frame {
    mirrored: bool,
    turn_rad: f64,
    shift: Vec2,
}

impl Frame {
    fn point(&self, p: Vec2) -> Vec2 {
        let p = if self.mirrored { Vec2::new(p.x, -p.y) } else { p };
        p.rotated(self.turn_rad) + self.shift
    }

    fn sample(&self, s: &Sample) -> Sample {
        let heading = if self.mirrored { -s.heading_rad } else { s.heading_rad };
        Sample {
            position: self.point(s.position),
            heading_rad: num::wrap_angle(heading + self.turn_rad),
            velocity: self.point(s.velocity) - self.shift,
        }
    }

    fn scene(&self, scene: &Scene) -> Scene {
        let mut moved = scene.clone();
        for sample in moved.tracks.iter_mut().chain([&mut moved.ego.track]).flat_map(|t| t.samples.iter_mut().flatten())
        {
            *sample = self.sample(sample);
        }
        moved.ego.route.iter_mut().for_each(|p| *p = self.point(*p));
        for lane in &mut moved.road.lanes {
            if self.mirrored {
                std::mem::swap(&mut lane.left, &mut lane.right);
            }
            let lines = [&mut lane.centre, &mut lane.left, &mut lane.right];
            lines.into_iter().flatten().for_each(|p| *p = self.point(*p));
        }
        moved
    }

    fn pose(&self, pose: &Pose) -> Pose {
        let as_sample = Sample { position: pose.position, heading_rad: pose.heading_rad, velocity: Vec2::ZERO };
        let moved = self.sample(&as_sample);
        Pose { position: moved.position, heading_rad: moved.heading_rad }
    }

    fn script(&self, script: &mut Script) {
        script.spawn = self.pose(&script.spawn);
        for phase in &mut script.phases {
            match &mut phase.way {
                Way::Straight => {}
                Way::Shift { left_m: x, .. } | Way::Turn { left_rad: x, .. } => {
                    *x = if self.mirrored { -*x } else { *x }
                }
                Way::Wheel { rad } => rad.iter_mut().for_each(|r| *r = if self.mirrored { -*r } else { *r }),
                Way::Points { points } | Way::Path { points } => points.iter_mut().for_each(|p| *p = self.point(*p)),
            }
        }
    }

    fn act(&self, act: &Intervention) -> Intervention {
        let mut moved = act.clone();
        for action in &mut moved.actions {
            match action {
                Action::Follow { samples, .. }
                | Action::Insert { samples, .. }
                | Action::FollowThenReact { samples, .. }
                | Action::FollowThenObey { samples, .. } => samples.iter_mut().for_each(|s| *s = self.sample(s)),
                Action::Triggered(script) => self.script(script),
            }
        }
        moved
    }
}

fn run(scene: &Scene, act: &Intervention) -> Outcome {
    rollout_assessed(&Plant::new(scene).unwrap(), act, &mut *Policy::Idm.driver()).unwrap()
}

fn near(a: f64, b: f64) -> bool {
    (a - b).abs() < 1e-6 * (1.0 + a.abs())
}

/// The side in a mirror.
fn swapped(side: Side) -> Side {
    match side {
        Side::Left => Side::Right,
        Side::Right => Side::Left,
        other => other,
    }
}

/// Equal events and, within rounding, equal numbers.
fn assert_alike(a: &Outcome, b: &Outcome, mirrored: bool, what: &str) {
    assert_eq!((a.end, a.steps), (b.end, b.steps), "{what}");
    let kind = |c: Contact| (c.with, c.striker, c.class, c.avoidable);
    assert_eq!(a.contact.map(kind), b.contact.map(kind), "{what}");
    let sides = |c: Contact, mirrored: bool| [c.ego_side, c.other_side].map(|s| if mirrored { swapped(s) } else { s });
    assert_eq!(a.contact.map(|c| sides(c, false)), b.contact.map(|c| sides(c, mirrored)), "{what}");
    if let (Some(a), Some(b)) = (a.contact, b.contact) {
        let angle = if mirrored { -b.impact_angle_rad } else { b.impact_angle_rad };
        assert!(near(a.time_s, b.time_s) && near(a.relative_speed_mps, b.relative_speed_mps), "{what}");
        assert!(num::wrap_angle(a.impact_angle_rad - angle).abs() < 1e-6, "{what} {a:?} {b:?}");
    }
    let numbers = |o: &Outcome| {
        let mut all = vec![
            o.distance_m_min.unwrap_or(-1.0),
            o.ttc_s_min.unwrap_or(-1.0),
            o.post_encroachment_s_min.unwrap_or(-1.0),
            o.route_completion,
            o.ego_lateral_m_max,
        ];
        for m in std::iter::once(&o.ego).chain(o.adversaries.iter().map(|a| &a.motion)) {
            all.extend([m.speed_mps_mean, m.speed_mps_max, m.acceleration_mps2_max, m.deceleration_mps2_max]);
            all.extend([m.lateral_acceleration_mps2_max, m.jerk_mps3_max, m.yaw_rate_radps_max, m.distance_m]);
        }
        for a in &o.adversaries {
            let found = &a.simulated;
            all.extend([found.off_road_m, found.wrong_way_m, found.jump_m, a.log_deviation_m_max.unwrap_or(-1.0)]);
            all.extend([found.acceleration_mps2, found.jerk_mps3, found.slip_mps, found.roughness_m, found.kink_m]);
            all.push(a.route_completion.unwrap_or(-1.0));
        }
        all
    };
    for (i, (x, y)) in numbers(a).into_iter().zip(numbers(b)).enumerate() {
        assert!(near(x, y), "{what}: number {i}: {x} {y}");
    }
}

const FRAMES: [Frame; 4] = [
    Frame { mirrored: true, turn_rad: 0.0, shift: Vec2::ZERO },
    Frame { mirrored: false, turn_rad: 1.1, shift: Vec2::new(300.0, -70.0) },
    Frame { mirrored: true, turn_rad: -2.3, shift: Vec2::new(-40.0, 1000.0) },
    Frame { mirrored: false, turn_rad: num::PI, shift: Vec2::ZERO },
];

/// The outcome of a scene, which must be alike in every frame.
fn run_in_all_frames(scene: &Scene, act: &Intervention, seed: u64) -> Outcome {
    let plain = run(scene, act);
    for frame in FRAMES {
        let moved = run(&frame.scene(scene), &frame.act(act));
        assert_alike(&plain, &moved, frame.mirrored, &format!("seed {seed}, {frame:?}"));
    }
    plain
}

#[test]
fn a_turned_shifted_or_mirrored_scene_gives_a_turned_shifted_or_mirrored_outcome() {
    let mut contacts = 0;
    for seed in 0..60 {
        let scene = crossing(seed, 12, 91);
        let outcome = run_in_all_frames(&scene, &intercept(&scene, 10), seed);
        contacts += usize::from(outcome.contact.is_some());
    }
    assert!(contacts > 5, "{contacts}");
}

/// A walker, a car with three kinds of way, and a parked one, with thresholds that no rounding decides.
fn scripted(seed: u64) -> Intervention {
    let mut stream = crate::kernel::Seed(seed).stream(&["scripted"]);
    let mut draw = |low: f64, high: f64| stream.uniform(low, high);
    let trigger = Trigger { reference: 0, distance_m: draw(20.0, 40.0), ego_speed_mps_min: 0.0 };
    let spawn = |x: f64, y: f64, heading_rad: f64| Pose { position: Vec2::new(x, y), heading_rad };
    let mut phases = vec![
        Phase::straight(draw(4.0, 9.0), Until::Driven { m: draw(3.0, 9.0) }),
        Phase::straight(draw(4.0, 9.0), Until::Lasted { s: 1.05 }),
        Phase::straight(draw(4.0, 9.0), Until::EgoWithin { m: draw(5.0, 15.0) }),
        Phase::straight(draw(4.0, 9.0), Until::Forever),
    ];
    phases[1].way = Way::Wheel { rad: vec![0.05, -0.1, 0.02] };
    phases[2].way = Way::Path { points: vec![Vec2::new(0.0, 20.0), Vec2::new(2.0, 8.0), Vec2::new(1.0, -30.0)] };
    phases[3].speed = Speed::Intercept { mps_min: 1.0, mps_max: 8.0 };
    phases[3].way = Way::Points { points: vec![Vec2::new(3.0, -2.0), Vec2::new(1.0, -9.0), Vec2::new(0.0, -40.0)] };
    let car = Script {
        kind: crate::scene::AgentKind::Vehicle,
        length_m: 4.5,
        width_m: 1.9,
        spawn: spawn(draw(-3.0, 3.0), draw(20.0, 26.0), -1.5),
        trigger,
        phases: phases.clone(),
    };
    let walker = Script {
        kind: crate::scene::AgentKind::Pedestrian,
        length_m: 0.6,
        width_m: 0.6,
        spawn: spawn(draw(8.0, 16.0), draw(-9.0, -7.0), 1.6),
        phases: vec![Phase::straight(draw(1.0, 3.0), Until::Driven { m: draw(4.0, 9.0) }), phases[2].clone()],
        ..car.clone()
    };
    let parked = Script { spawn: spawn(30.0, 8.0, 0.1), phases: vec![], ..car.clone() };
    let mut aside = phases[..2].to_vec();
    (aside[0].way, aside[0].until) =
        (Way::Shift { left_m: draw(-4.0, 4.0), over_m: 12.0 }, Until::NearRoute { m: 3.05 });
    aside[1].way = Way::Turn { left_rad: draw(-1.5, 1.5), radius_m: 8.0 };
    let swerving = Script { spawn: spawn(draw(-20.0, -16.0), draw(6.0, 9.0), -0.3), phases: aside, ..car.clone() };
    Intervention { actions: [car, walker, parked, swerving].map(Action::Triggered).to_vec() }
}

#[test]
fn scripted_road_users_move_alike_in_any_frame_and_on_any_number_of_threads() {
    let mut contacts = 0;
    for seed in 0..30 {
        let scene = crossing(seed, 0, 121);
        let outcome = run_in_all_frames(&scene, &scripted(seed), seed);
        contacts += usize::from(outcome.contact.is_some());
    }
    assert!(contacts > 3, "{contacts}");
    let seeds: Vec<u64> = (0..30).collect();
    let digests =
        |threads| Threads::new(threads).unwrap().map(&seeds, |_, &s| run(&crossing(s, 5, 91), &scripted(s)).trace);
    assert_eq!(digests(1), digests(4));
}

#[test]
fn a_scene_that_begins_later_gives_the_same_outcome() {
    for seed in 0..40 {
        let scene = crossing(seed, 12, 91);
        let act = intercept(&scene, 10);
        let mut later = scene.clone();
        later.steps += 7;
        later.ego.start_step += 7;
        for track in later.tracks.iter_mut().chain([&mut later.ego.track]) {
            track.samples.splice(0..0, [None; 7]);
        }
        let mut later_act = act.clone();
        for action in &mut later_act.actions {
            if let Action::Follow { from_step, .. } = action {
                *from_step += 7;
            }
        }
        assert_eq!(run(&scene, &act), run(&later, &later_act), "seed {seed}");
    }
}

/// Replays a scene's log and holds it against the log; whether the log holds a contact of the ego at a sample.
pub fn replays_to_itself(scene: &Scene) -> bool {
    let (plant, from) = (Plant::new(scene).unwrap(), scene.ego.start_step);
    let (outcome, trace) = rollout_traced(&plant, &Intervention::default(), &mut *Policy::Replay.driver()).unwrap();
    let whole = outcome.steps + usize::from(outcome.contact.is_none());
    for (k, ego) in trace.ego.iter().enumerate().take(whole) {
        assert_eq!(Some(ego), scene.ego.track.at(from + k));
        for (actor, track) in trace.actors.iter().zip(&scene.tracks) {
            assert_eq!(actor.samples[k], track.samples[from + k], "{} step {k}", scene.id);
        }
    }
    // The recording's own first overlap at a sample is found, not later than there.
    let boxed = |t: &crate::scene::Track, k: usize| {
        let at = t.at(from + k)?;
        Some(crate::kernel::OrientedBox::new(at.position, at.heading_rad, t.length_m, t.width_m))
    };
    let first = (0..=outcome.steps).find(|&k| {
        let own = boxed(&scene.ego.track, k);
        own.is_some_and(|own| scene.tracks.iter().filter_map(|t| boxed(t, k)).any(|other| own.overlaps(&other)))
    });
    if let Some(first) = first {
        let contact = outcome.contact.expect("the recording's contact");
        assert!(contact.time_s <= 0.1 * first as f64 + 1e-9, "{}: {contact:?} {first}", scene.id);
    }
    first.is_some()
}

#[test]
fn replaying_the_log_reproduces_it_and_its_contacts() {
    let contacts = (0..40).filter(|&seed| replays_to_itself(&crossing(seed, 20, 91))).count();
    assert!(contacts > 3, "{contacts}");
}

#[test]
fn one_thread_and_four_give_the_same_outcomes() {
    let seeds: Vec<u64> = (0..64).collect();
    let outcomes = |threads: usize| {
        Threads::new(threads).unwrap().map(&seeds, |_, &seed| {
            let scene = crossing(seed, 25, 91);
            run(&scene, &intercept(&scene, 10))
        })
    };
    assert_eq!(outcomes(1), outcomes(4));
}

#[test]
fn the_trace_digest_changes_with_one_bit_of_one_pose() {
    let scene = straight_road(91, 8.0, vec![car("a", straight(sample(-60.0, 40.0, 0.0, 5.0), 91))]);
    let act = |x: f64| {
        let samples = (0..60).map(|k| sample(if k == 59 { x } else { 40.0 }, 30.0, 0.0, 0.0)).collect();
        Intervention { actions: vec![Action::Follow { track: 0, from_step: 5, samples }] }
    };
    let a = run(&scene, &act(40.0));
    let b = run(&scene, &act(f64::from_bits(40f64.to_bits() + 1)));
    assert_eq!((a.end, a.steps, a.contact), (b.end, b.steps, b.contact));
    assert_ne!(a.trace, b.trace);
    let mut moved = scene.clone();
    moved.tracks[0].samples[90].as_mut().unwrap().position.y += 1e-9;
    assert_ne!(run(&scene, &Intervention::default()).trace, run(&moved, &Intervention::default()).trace);
}

#[test]
fn an_ego_without_a_recording_drives_its_route_but_cannot_replay() {
    let mut scene = straight_road(91, 8.0, vec![]);
    scene.ego.track.samples[1..].fill(None);
    let plant = Plant::new(&scene).unwrap();
    let nothing = Intervention::default();
    assert_eq!(rollout(&plant, &nothing, &mut *Policy::Idm.driver()).unwrap().end, End::Arrived);
    let refused = rollout(&plant, &nothing, &mut *Policy::Replay.driver());
    assert!(matches!(refused, Err(SimError::NoLog { step: 1, .. })), "{refused:?}");
}

#[test]
fn a_car_behind_the_ego_turns_reactive_and_does_not_run_into_it() {
    // The ego crawls where its recording drove on; the recorded follower would have run through it.
    let follower = car("follower", straight(sample(-25.0, 0.0, 0.0, 10.0), 91));
    let wall = car("wall", straight(sample(22.0, 0.0, 0.0, 0.0), 91));
    let mut scene = straight_road(91, 10.0, vec![follower, wall]);
    scene.ego.route = vec![Vec2::ZERO, Vec2::new(200.0, 0.0)];
    let outcome = run(&scene, &Intervention::default());
    assert!(outcome.contact.is_none(), "{outcome:?}");
}

#[test]
fn a_skilled_adversary_reacts_to_where_the_ego_is() {
    let scene = straight_road(91, 9.0, vec![car("a", straight(sample(2.0, 4.0, 0.0, 9.0), 91))]);
    let samples: Vec<Sample> = (0..10).map(|k| sample(2.0 + 0.9 * f64::from(k), 4.0, 0.0, 9.0)).collect();
    let react = |handover_step| Intervention {
        actions: vec![Action::FollowThenReact { track: 0, from_step: 0, samples: samples.clone(), handover_step }],
    };
    let (early, late) = (run(&scene, &react(9)), run(&scene, &react(90)));
    assert!(early.distance_m_min.unwrap() < late.distance_m_min.unwrap() - 0.5, "{early:?} {late:?}");
}
