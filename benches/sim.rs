//! Throughput of rollouts in agent-steps: one road user present at one 0.1 s decision step, replayed or simulated, with
//! its five contact substeps and all metrics on. IDM ego, one trajectory adversary, one thread.

use divan::{Bencher, counter::ItemsCount};
use evodrive::scene::PreparedScene;
use evodrive::sim::scenes;
use evodrive::{ego, sim};

fn main() {
    divan::main();
}

fn bench(bencher: Bencher<'_, '_>, tracks: usize, pool: u64) {
    let worlds: Vec<(sim::Plant, sim::Intervention)> = (0..pool)
        .map(|seed| {
            let scene = scenes::crossing(seed, tracks, 91);
            {
                let act = scenes::intercept(&scene, 10);
                (sim::Plant::new(&scene).unwrap(), act)
            }
        })
        .collect();
    let run = || {
        let mut driver = ego::Policy::Idm.driver();
        worlds.iter().map(|(plant, act)| sim::rollout_counted(plant, act, &mut *driver).unwrap().1.agent_steps).sum()
    };
    let items: u64 = run();
    bencher.counter(ItemsCount::new(items)).bench_local(run);
}

#[divan::bench(args = [10, 40, 100, 1000], sample_count = 20)]
fn agent_steps(bencher: Bencher<'_, '_>, tracks: usize) {
    bench(bencher, tracks, (4000 / tracks as u64).max(4));
}

#[divan::bench(sample_count = 20)]
fn pool_of_500_scenes_of_40_tracks(bencher: Bencher<'_, '_>) {
    bench(bencher, 40, 500);
}

#[divan::bench(sample_count = 20)]
fn prepare_a_scene_of_40_tracks(bencher: Bencher<'_, '_>) {
    let scene = scenes::crossing(1, 40, 91);
    let scene = std::sync::Arc::new(scene);
    bencher.bench_local(|| sim::Plant::shared(PreparedScene::new(scene.clone())).unwrap());
}
