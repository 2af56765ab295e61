//! A rollout allocates its buffers once: a long one asks the allocator as often as a short one. A prepared scene keeps
//! little beside the scene itself.

// An allocator that counts: `GlobalAlloc` is an unsafe trait.
#![allow(unsafe_code)]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use evodrive::kernel::formula::Op;
use evodrive::scene::PreparedScene;
use evodrive::sim::scenes;
use evodrive::{ego, kernel, scene, sim};

struct Counting;

thread_local! {
    static COUNT: Cell<usize> = const { Cell::new(0) };
    static HELD_BYTES: Cell<isize> = const { Cell::new(0) };
}

unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        COUNT.with(|c| c.set(c.get() + 1));
        HELD_BYTES.with(|held| held.set(held.get() + layout.size() as isize));
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, at: *mut u8, layout: Layout) {
        HELD_BYTES.with(|held| held.set(held.get() - layout.size() as isize));
        unsafe { System.dealloc(at, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

#[test]
fn a_prepared_scene_holds_about_as_much_per_sample_as_its_rows_need() {
    let scene = std::sync::Arc::new(scenes::crossing(8, 40, 91));
    let samples = scene.tracks.iter().flat_map(|t| t.samples.iter().flatten()).count();
    let before = HELD_BYTES.with(Cell::get);
    let plant = sim::Plant::shared(PreparedScene::new(scene.clone())).unwrap();
    let held = HELD_BYTES.with(Cell::get) - before;
    // Place, reach, axis and track of a row are 40 bytes, its entry by track 4; the rest is the paths of
    // those who may turn reactive, road and route.
    let per_sample = held as usize / samples;
    assert!(samples > 3000 && (44..85).contains(&per_sample), "{held} bytes for {samples} samples");
    assert_eq!(plant.tracks(), 40);
}

#[test]
fn a_step_of_a_rollout_allocates_nothing() {
    let mut scene = scenes::crossing(8, 40, 121);
    scene.tracks.iter_mut().for_each(|t| t.samples.iter_mut().flatten().for_each(|s| s.position.y += 60.0));
    let act = scenes::intercept(&scene, 10);
    let cost = |steps: usize| {
        let mut scene = scene.clone();
        scene.steps = steps;
        scene.tracks.iter_mut().chain([&mut scene.ego.track]).for_each(|t| t.samples.truncate(steps));
        let plant = sim::Plant::new(&scene).unwrap();
        let mut driver = ego::Policy::Idm.driver();
        let before = COUNT.with(Cell::get);
        let outcome = sim::rollout(&plant, &act, &mut *driver).unwrap();
        (outcome.steps, COUNT.with(Cell::get) - before)
    };
    let ((short, few), (long, same)) = (cost(31), cost(81));
    assert!(short + 40 < long, "{short} {long}");
    assert_eq!(few, same);
    assert!(few < 40, "{few}");
}

#[test]
fn a_step_under_a_law_that_looks_at_everything_allocates_nothing() {
    let scene = scenes::crossing(8, 40, 121);
    let mut act = scenes::intercept(&scene, 10);
    let Some(sim::Action::Follow { track, from_step, samples }) = act.actions.pop() else { panic!("an interception") };
    // The sum of everything that is observed, and a way to keep the speed whatever it is.
    let places = sim::Observed::ALL.len();
    let mut code = vec![Op::Load(0)];
    (1..places).for_each(|place| code.extend([Op::Load(place), Op::Plus]));
    code.extend([Op::Constant(0.0), Op::Times]);
    let formula = kernel::Formula::try_from(code).unwrap();
    let law = sim::Law { onset: None, acceleration: formula.clone(), offset: Some(formula) };
    act.actions.push(sim::Action::FollowThenObey { track, from_step, samples, law });
    let cost = |steps: usize| {
        let mut scene = scene.clone();
        scene.steps = steps;
        scene.tracks.iter_mut().chain([&mut scene.ego.track]).for_each(|t| t.samples.truncate(steps));
        let plant = sim::Plant::new(&scene).unwrap();
        let mut driver = ego::Policy::Replay.driver();
        let before = COUNT.with(Cell::get);
        let outcome = sim::rollout(&plant, &act, &mut *driver).unwrap();
        (outcome.steps, COUNT.with(Cell::get) - before)
    };
    let ((short, few), (long, same)) = (cost(31), cost(81));
    assert!(short < long, "{short} {long}");
    assert_eq!(few, same);
}

#[test]
fn a_step_of_scripted_road_users_under_safebench_s_rules_allocates_nothing() {
    use evodrive::scene::safebench::{Staging, TrafficFamily};
    let mut scene = scenes::straight_road(121, 2.0, vec![]);
    let trigger = kernel::Pose { position: kernel::Vec2::new(10.0, 0.0), heading_rad: 0.0 };
    scene.staging = Some(Staging { family: TrafficFamily::RightTurn, route: 4, trigger, spawns: vec![] });
    scene.ego.route = vec![kernel::Vec2::ZERO, kernel::Vec2::new(240.0, 0.0)];
    let mut phase = sim::Phase::straight(6.0, sim::Until::Forever);
    phase.way = sim::Way::Path { points: (0..50).map(|k| kernel::Vec2::new(f64::from(k), 40.0)).collect() };
    let script = |kind, phases| sim::Script {
        kind,
        length_m: 1.0,
        width_m: 1.0,
        spawn: kernel::Pose { position: kernel::Vec2::new(0.0, 40.0), heading_rad: 0.0 },
        trigger: sim::Trigger { reference: 0, distance_m: 1e5, ego_speed_mps_min: 0.0 },
        phases,
    };
    let kinds = [scene::AgentKind::Vehicle, scene::AgentKind::Pedestrian];
    let actions = kinds.map(|kind| sim::Action::Triggered(script(kind, vec![phase.clone()]))).to_vec();
    let act = sim::Intervention { actions };
    let cost = |steps: usize| {
        let mut scene = scene.clone();
        scene.steps = steps;
        scene.ego.track.samples.truncate(steps);
        let plant = sim::Plant::new(&scene).unwrap();
        let mut driver = ego::Policy::Replay.driver();
        let before = COUNT.with(Cell::get);
        let outcome = sim::rollout(&plant, &act, &mut *driver).unwrap();
        (outcome.steps, COUNT.with(Cell::get) - before)
    };
    let ((short, few), (long, same)) = (cost(31), cost(121));
    assert!(short + 80 < long, "{short} {long}");
    assert_eq!(few, same);
}

#[test]
fn a_step_of_an_episode_driven_from_outside_allocates_nothing_with_everything_kept_and_observed() {
    let scene = scenes::crossing(8, 40, 121);
    let act = scenes::intercept(&scene, 10);
    let plant = sim::Plant::new(&scene).unwrap();
    let mut episode = sim::Episode::new(&plant, &act).unwrap().keeping_controls().keeping_motion();
    let settings = ego::Setting::ALL.map(|setting| (setting, vec![0.0; setting.length()]));
    let goal = ego::Arrays { goal: true, ..ego::Arrays::default() };
    let (mut settings, mut arrays) = (settings, vec![0.0; goal.length()]);
    let before = COUNT.with(Cell::get);
    while episode.end().is_none() {
        let view = episode.observe();
        settings.iter_mut().for_each(|(setting, values)| setting.observe(&view, values));
        goal.observe(&view, &mut arrays);
        episode.step(sim::Control::Drive { acceleration_mps2: 0.0, steering_rad: 0.0 }).unwrap();
    }
    assert!(episode.steps() > 20, "{}", episode.steps());
    assert_eq!(COUNT.with(Cell::get), before);
}
