//! A run whose work is begun in orders drawn by chance is the run.

use evodrive::epoch::{Desk, Meter, Mode, Rollouts, Tools, run};
use evodrive::experiment::Experiment;
use evodrive::kernel::{Seed, Threads};
use evodrive::llm::{Cassette, Replay};
use evodrive::store::{Store, Transcript, read_events};

#[test]
fn the_order_in_which_work_is_begun_changes_no_root() {
    let whole = crate::short::finished();
    let experiment = Experiment::read(&whole.experiment).unwrap();
    for seed in [Seed(1), Seed(2), Seed(3)] {
        let threads = Threads::shuffled(2, seed).unwrap();
        let scenes = experiment.scenes(&[], &threads).unwrap();
        let study = experiment.study(scenes, &threads).unwrap();
        let cassette = Cassette::load(&whole.experiment.with_file_name("small.jsonl")).unwrap();
        let replay = Replay::new(cassette, "");
        let folder = tempfile::tempdir().unwrap();
        let store = Store::open(&folder.path().join("store")).unwrap();
        let rollouts = Rollouts::new(&store, Mode::Reuse);
        let transcript = folder.path().join("transcript.jsonl");
        let mut watch = |_| {};
        let tools = Tools::new(&study, &replay, &threads, &rollouts, Meter::default());
        let mut desk = Desk { log: Transcript::create(&transcript).unwrap(), watch: &mut watch, tools };
        run(&study, &mut desk).unwrap();
        drop(desk);
        let root = read_events(&transcript).unwrap().last().unwrap().hash.to_hex();
        assert_eq!(root, whole.root, "work begun in the order of seed {}", seed.0);
    }
}
