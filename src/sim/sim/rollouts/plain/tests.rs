//! The fast rollout against the plain one, over drawn scenes and actions of every kind.

use std::collections::BTreeSet;
use std::sync::Arc;

use super::*;
use crate::ego::Policy;
use crate::kernel::formula::Op;
use crate::kernel::{Formula, Pose, Seed, Stream};
use crate::scene::{AgentKind, PreparedScene};
use crate::sim::scenes::{crossing, intercept, sample};
use crate::sim::{
    Driver, Law, Observed, Phase, PlantOptions, ReactiveTraffic, Script, SimulatorOptions, Speed, Trace, Trigger,
    Until, View, Way, rollout_traced,
};

/// Remembers what another driver decides, and holds what it sees against everyone present.
struct Remembering {
    inner: Box<dyn Driver>,
    controls: Vec<Control>,
}

impl Driver for Remembering {
    fn begin(&mut self, plant: &Plant) {
        self.inner.begin(plant);
    }

    fn decide(&mut self, view: &View<'_>) -> Control {
        let mut near = 0;
        view.for_each_within(SIGHT_M, |_| near += 1);
        let mut all = 0;
        view.for_each_within(f64::INFINITY, |seen| {
            all += usize::from((seen.position - view.ego().sample.position).norm_squared() <= SIGHT_M * SIGHT_M);
        });
        assert_eq!(near, all);
        self.controls.push(self.inner.decide(view));
        self.controls[self.controls.len() - 1]
    }

    fn follows_log(&self) -> bool {
        self.inner.follows_log()
    }
}

/// One intervention carried out twice: the fast outcome with its motion, and the plain outcome. Everybody is at the same
/// place at every step, or this panics.
fn both(scene: &Scene, act: &Intervention, policy: &Policy, seed: u64) -> (Outcome, Trace, Outcome) {
    // Every third under MetaDrive's law.
    let law = if seed % 3 == 2 { PlantOptions::METADRIVE_0_4_3 } else { PlantOptions::PHYSICAL };
    let reactive_traffic = match seed % 8 {
        4 => ReactiveTraffic::Always,
        5 => ReactiveTraffic::Off,
        _ => ReactiveTraffic::Driving,
    };
    let law = PlantOptions { reactive_traffic, ..law };
    let options = SimulatorOptions { plant: law, ..SimulatorOptions::SHIPPED };
    let plant = Plant::with_options(PreparedScene::new(Arc::new(scene.clone())), &options).unwrap();
    let mut driver = Remembering { inner: policy.driver(), controls: Vec::new() };
    let (fast, trace) = rollout_traced(&plant, act, &mut driver).unwrap();
    let replays = driver.follows_log();
    let plain = Plain { scene, plant: &plant, act, controls: &driver.controls, replays };
    let (slow, rows) = plain.rollout(fast.trace);
    for (k, row) in rows.iter().enumerate() {
        let there: Vec<(ActorRef, Sample)> =
            trace.actors.iter().filter_map(|actor| Some((actor.actor, actor.samples[k]?))).collect();
        let mut plainly: Vec<(ActorRef, Sample)> = row.iter().map(|other| (other.who, other.samples[0])).collect();
        plainly.sort_by_key(|(who, _)| there.iter().position(|(known, _)| known == who));
        assert_eq!(there, plainly, "{} at simulated step {k}", scene.id);
    }
    (fast, trace, slow)
}

/// Actions drawn around the ego: samples of a recorded road user or of an added one, and skills.
fn drawn(scene: &Scene, seed: u64) -> Intervention {
    let mut stream = Seed(seed).stream(&["drawn"]);
    let mut act = if stream.chance(0.3) { Intervention::default() } else { intercept(scene, stream.below(30)) };
    let from_step = stream.below(40);
    let start = sample(stream.uniform(-20.0, 20.0), stream.uniform(-8.0, 8.0), stream.uniform(-3.0, 3.0), 6.0);
    let samples: Vec<Sample> = (0..1 + stream.below(50))
        .map(|k| Sample { position: start.position + start.velocity * (0.1 * k as f64), ..start })
        .collect();
    if stream.chance(0.4) {
        let kind = crate::scene::AgentKind::Cyclist;
        let length_m = stream.uniform(0.5, 5.0);
        act.actions.push(Action::Insert { kind, length_m, width_m: 0.8, from_step, samples });
    } else if stream.chance(0.7) {
        let taken = |t: usize| act.actions.iter().any(|a| matches!(a, Action::Follow { track, .. } if *track == t));
        if let Some(track) = (0..scene.tracks.len()).rfind(|&t| !taken(t)) {
            let handover_step = from_step + stream.below(30);
            act.actions.push(Action::FollowThenReact { track, from_step, samples, handover_step });
        }
    }
    act
}

/// A formula that reads three things with drawn weights.
fn sum_of(stream: &mut Stream, places: [usize; 3], weight: f64) -> Formula {
    let mut code = vec![Op::Constant(stream.uniform(-1.0, 1.0))];
    for place in places {
        let weight = Op::Constant(stream.uniform(-weight, weight));
        code.extend([Op::Load(place), weight, Op::Times, Op::Plus]);
    }
    Formula::try_from(code).unwrap()
}

/// Vehicles that leave their recordings towards the ego's route, each under a drawn law. With the seed, what the laws read
/// goes round through everything that can be observed.
fn under_laws(scene: &Scene, seed: u64, stream: &mut Stream) -> Vec<Action> {
    let from_step = scene.ego.start_step + stream.below(20);
    let there = |t: &usize| scene.tracks[*t].kind == AgentKind::Vehicle && scene.tracks[*t].at(from_step).is_some();
    let movers: Vec<usize> = (0..scene.tracks.len()).filter(there).take(1 + seed as usize % 2).collect();
    let mut act = Vec::new();
    for (i, track) in movers.into_iter().enumerate() {
        let start = *scene.tracks[track].at(from_step).unwrap();
        let goal = Vec2::new(stream.uniform(-20.0, 50.0), stream.uniform(-6.0, 3.0));
        let way = (goal - start.position) * (1.0 / (goal - start.position).norm());
        let at = |k: usize| start.position + way * (0.1 * (k + 1) as f64 * start.speed_mps());
        let velocity = way * start.speed_mps();
        let heading_rad = way.heading();
        let samples = (0..60).map(|k| Sample { position: at(k), heading_rad, velocity }).collect();
        let place = |n: usize| (3 * seed as usize + 7 * i + n) % Observed::ALL.len();
        let onset = stream.chance(0.5).then(|| {
            let bound = Op::Constant(stream.uniform(-2.0, 10.0));
            Formula::try_from(vec![Op::Load(place(3)), bound, Op::More]).unwrap()
        });
        let acceleration = sum_of(stream, [place(0), place(1), place(2)], 0.4);
        let offset = stream.chance(0.7).then(|| sum_of(stream, [place(2), place(4), place(5)], 0.3));
        let law = Law { onset, acceleration, offset };
        act.push(Action::FollowThenObey { track, from_step: from_step + 1, samples, law });
    }
    act
}

/// Scripts on both sides of the ego's route. With the seed, their phases go round through every way, speed and end.
fn by_scripts(seed: u64, stream: &mut Stream, first: usize) -> Vec<Action> {
    let count = 1 + seed as usize % 3;
    let script = |i: usize, stream: &mut Stream| {
        let turn = seed as usize + 5 * i;
        let position = Vec2::new(stream.uniform(-38.0, 20.0), stream.uniform(-7.0, 4.0));
        let kinds = [AgentKind::Vehicle, AgentKind::Pedestrian, AgentKind::Cyclist, AgentKind::Pedestrian];
        let kind = if seed.is_multiple_of(11) { AgentKind::Static } else { kinds[turn % 4] };
        let phases = if kind == AgentKind::Static { 0 } else { 1 + turn % 4 };
        let trigger = Trigger {
            reference: first + stream.below(count),
            distance_m: stream.uniform(8.0, 45.0),
            ego_speed_mps_min: [0.0, 0.5, 6.0][turn % 3],
        };
        let phases = (0..phases).map(|p| phase(turn + 3 * p, position, stream)).collect();
        let (length_m, width_m) = if kind == AgentKind::Vehicle { (4.5, 1.9) } else { (0.7, 0.6) };
        let spawn = Pose { position, heading_rad: stream.uniform(-3.0, 3.0) };
        Action::Triggered(Script { kind, length_m, width_m, spawn, trigger, phases })
    };
    (0..count).map(|i| script(i, stream)).collect()
}

fn phase(turn: usize, from: Vec2, stream: &mut Stream) -> Phase {
    let points: Vec<Vec2> =
        (1..12).map(|i| from + Vec2::new(1.5 * i as f64, stream.uniform(-1.5, 1.5) - 0.2 * i as f64)).collect();
    let speed = match turn % 4 {
        0 => Speed::Constant { mps: stream.uniform(0.0, 8.0) },
        1 => Speed::Profile { mps: (0..20).map(|_| stream.uniform(0.0, 7.0)).collect() },
        2 => Speed::MatchEgo { mps_max: stream.uniform(2.0, 9.0) },
        _ => Speed::Intercept { mps_min: 0.5, mps_max: stream.uniform(1.0, 8.0) },
    };
    let way = match turn / 2 % 6 {
        0 => Way::Straight,
        1 => Way::Wheel { rad: (0..15).map(|_| stream.uniform(-0.4, 0.4)).collect() },
        2 => Way::Points { points },
        3 => Way::Path { points },
        4 => Way::Shift { left_m: stream.uniform(-4.0, 4.0), over_m: stream.uniform(4.0, 20.0) },
        _ => Way::Turn { left_rad: stream.uniform(-2.0, 2.0), radius_m: stream.uniform(4.0, 12.0) },
    };
    let until = match turn % 5 {
        0 => Until::Forever,
        1 => Until::Driven { m: stream.uniform(1.0, 9.0) },
        2 => Until::EgoWithin { m: stream.uniform(3.0, 15.0) },
        3 => Until::NearRoute { m: stream.uniform(0.3, 3.0) },
        _ => Until::Lasted { s: 0.1 * (1 + stream.below(20)) as f64 },
    };
    Phase { speed, way, throttle: stream.uniform(0.3, 1.0), brake: stream.uniform(0.3, 1.0), until }
}

/// A crossing with a few or many road users, some with a short route or one that leads away from the ego.
fn scene_of(seed: u64) -> Scene {
    let mut scene = crossing(seed, 3 + (seed % 40) as usize, 91);
    scene.ego.start_step = (seed % 3) as usize * 5;
    match seed % 7 {
        2 => scene.ego.route.truncate(20),
        5 => scene.ego.route.iter_mut().enumerate().for_each(|(i, p)| p.y += 0.3 * i as f64),
        _ => {}
    }
    scene
}

fn policy_of(seed: u64) -> Policy {
    if seed.is_multiple_of(4) { Policy::Replay } else { Policy::Idm }
}

#[test]
fn the_fast_rollout_is_the_plain_one_bit_for_bit() {
    let (mut contacts, mut ends) = (0, BTreeSet::new());
    for seed in 0..150 {
        let scene = scene_of(seed);
        let (fast, _, slow) = both(&scene, &drawn(&scene, seed), &policy_of(seed), seed);
        assert_eq!(fast, slow, "seed {seed}");
        contacts += usize::from(fast.contact.is_some());
        ends.insert(format!("{:?}", fast.end));
    }
    assert!(contacts > 25, "{contacts}");
    assert_eq!(ends.len(), 4, "{ends:?}");
}

#[test]
fn adversaries_under_laws_are_where_the_plain_rollout_has_them() {
    let (mut read, mut taken_over, mut contacts) = (BTreeSet::new(), 0, 0);
    for seed in 0..100 {
        let scene = scene_of(seed);
        let mut stream = Seed(seed).stream(&["laws"]);
        let act = Intervention { actions: under_laws(&scene, seed, &mut stream) };
        let (fast, trace, slow) = both(&scene, &act, &policy_of(seed), seed);
        assert_eq!(fast, slow, "seed {seed}");
        contacts += usize::from(fast.contact.as_ref().is_some_and(|contact| contact.adversary));
        for action in &act.actions {
            let Action::FollowThenObey { track, from_step, samples, law } = action else { continue };
            // Somewhere before the end it is not where its samples are: the law had taken over.
            let ran = from_step - trace.from_step..trace.ego.len() - 1;
            let rows = trace.actors[*track].samples.get(ran).unwrap_or_default();
            let left =
                rows.iter().zip(samples).any(|(now, sample)| now.is_some_and(|now| now.position != sample.position));
            taken_over += usize::from(left);
            let formulas = [law.onset.as_ref(), Some(&law.acceleration), law.offset.as_ref()];
            read.extend(formulas.into_iter().flatten().flat_map(Formula::loads).filter(|_| left));
        }
    }
    assert_eq!(read.len(), Observed::ALL.len(), "not everything is read by a law that took over: {read:?}");
    assert!(taken_over > 50 && contacts > 5, "{taken_over} took over, {contacts} contacts");
}

#[test]
fn adversaries_by_scripts_are_where_the_plain_rollout_has_them() {
    let (mut set_off, mut waiting, mut contacts) = (0, 0, 0);
    for seed in 0..150 {
        let scene = scene_of(seed);
        let mut stream = Seed(seed).stream(&["scripts"]);
        let act = Intervention { actions: by_scripts(seed, &mut stream, 0) };
        let (fast, trace, slow) = both(&scene, &act, &policy_of(seed), seed);
        assert_eq!(fast, slow, "seed {seed}");
        contacts += usize::from(fast.contact.as_ref().is_some_and(|contact| contact.adversary));
        for (i, action) in act.actions.iter().enumerate() {
            let Action::Triggered(script) = action else { continue };
            let last = trace.actors[scene.tracks.len() + i].samples.iter().flatten().next_back();
            let moved = last.is_some_and(|last| last.position != script.spawn.position);
            (set_off, waiting) = (set_off + usize::from(moved), waiting + usize::from(!moved));
        }
    }
    assert!(set_off > 75 && waiting > 25, "{set_off} set off, {waiting} not");
    assert!(contacts > 15, "{contacts}");
}

#[test]
fn laws_and_scripts_side_by_side_see_each_other_as_in_the_plain_rollout() {
    for seed in 0..50 {
        let scene = scene_of(seed);
        let mut stream = Seed(seed).stream(&["both"]);
        let mut actions = under_laws(&scene, seed, &mut stream);
        actions.extend(by_scripts(seed, &mut stream, actions.len()));
        let (fast, _, slow) = both(&scene, &Intervention { actions }, &policy_of(seed), seed);
        assert_eq!(fast, slow, "seed {seed}");
    }
}
