//! Cost of a proposal besides rollouts and model time: prompts, keys, parsing, gates, compilation on probe scenes,
//! routing, archive, lineage, memory, refit of the world evaluator, transcript. The quickstart, replayed with every
//! answer and rollout at hand in memory.

use std::path::Path;

use divan::counter::ItemsCount;
use evodrive::epoch::{Desk, Meter, Mode, Rollouts, Study, Tools, run};
use evodrive::experiment::Experiment;
use evodrive::kernel::Threads;
use evodrive::llm::{Ask, Cassette, Replay};
use evodrive::store::{Store, Transcript};

fn main() {
    divan::main();
}

fn carry_out(study: &Study, ask: &dyn Ask, threads: &Threads, rollouts: &Rollouts<'_>) -> usize {
    let folder = tempfile::tempdir().expect("a scratch folder");
    let log = Transcript::create(&folder.path().join("transcript.jsonl")).expect("a transcript");
    let mut watch = |_| {};
    let tools = Tools::new(study, ask, threads, rollouts, Meter::default());
    let mut desk = Desk { log, watch: &mut watch, tools };
    run(study, &mut desk).expect("the quickstart replays").exits.total()
}

#[divan::bench(sample_count = 30, sample_size = 1)]
fn proposals_with_everything_recorded(bencher: divan::Bencher<'_, '_>) {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("experiments/quickstart.toml");
    let threads = Threads::new(1).expect("a thread");
    let experiment = Experiment::read(&file).expect("the experiment");
    let scenes = experiment.scenes(&[], &threads).expect("scenes");
    let cassette = Cassette::load(&file.with_file_name("../cassettes/quickstart.jsonl")).expect("the cassette");
    let replay = Replay::new(cassette, "");
    let study = experiment.study(scenes, &threads).expect("the study");
    let folder = tempfile::tempdir().expect("a scratch folder");
    let store = Store::open(folder.path()).expect("a store");
    let rollouts = Rollouts::new(&store, Mode::Reuse);
    let work = || carry_out(&study, &replay, &threads, &rollouts);
    let proposals = work();
    bencher.counter(ItemsCount::new(proposals)).bench_local(work);
}
