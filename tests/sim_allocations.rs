//! A rollout allocates its buffers once: a long one asks the allocator as often as a short one.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use evodrive::{ego, kernel, scene, sim};

#[allow(dead_code)]
#[path = "sim/scenes.rs"]
mod scenes;

struct Counting;

thread_local! {
    static COUNT: Cell<usize> = const { Cell::new(0) };
}

unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        COUNT.with(|c| c.set(c.get() + 1));
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, at: *mut u8, layout: Layout) {
        unsafe { System.dealloc(at, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

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
