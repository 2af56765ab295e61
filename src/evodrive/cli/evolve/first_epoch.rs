//! The first proposals of the quickstart, carried out in a folder of its own: a real run for tests of what follows a run.

use std::path::Path;

use crate::epoch::{Clock, Desk, Meter, Mode, Rollouts, Study, Tools};
use crate::evidence::RecordedRun;
use crate::experiment::Experiment;
use crate::kernel::Threads;
use crate::llm::{Cassette, Replay};
use crate::store::{Store, Transcript, read_events};

/// Carries out the run and returns what `look` sees of it once it is sealed.
pub fn carried_out<T>(clock: Option<Clock<'_>>, look: impl FnOnce(&Study, &RecordedRun, &Desk<'_>) -> T) -> T {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("experiments/quickstart.toml");
    let mut experiment = Experiment::read(&file).unwrap();
    experiment.budget.epochs = 1;
    experiment.budget.finalists = 1;
    experiment.budget.slots = 3;
    let threads = Threads::new(2).unwrap();
    let scenes = experiment.scenes(&[], &threads).unwrap();
    let cassette = Cassette::load(&file.parent().unwrap().join(&experiment.cassette)).unwrap();
    let replay = Replay::new(cassette, "");
    let study = experiment.study(scenes, &threads).unwrap();
    let dir = tempfile::tempdir().unwrap();
    let store = Store::open(&dir.path().join("store")).unwrap();
    let rollouts = Rollouts::new(&store, Mode::Reuse);
    let transcript = dir.path().join("transcript.jsonl");
    let log = Transcript::create(&transcript).unwrap();
    let meter = clock.map(Meter::new).unwrap_or_default();
    let tools = Tools::new(&study, &replay, &threads, &rollouts, meter);
    let mut desk = Desk { log, watch: &mut |_| {}, tools };
    crate::epoch::run(&study, &mut desk).unwrap();
    let recorded = RecordedRun::read(&read_events(&transcript).unwrap()).unwrap();
    look(&study, &recorded, &desk)
}
