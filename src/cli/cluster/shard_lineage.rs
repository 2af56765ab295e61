//! Shards of whole lineages: made by `shard plan`, gone by `shard work`.

use std::collections::BTreeSet;
use std::path::Path;

use crate::backend::Answers;
use crate::cli::cluster::shard_done::{Nobody, done};
use crate::cli::evolve::behind;
use crate::cli::terminal::exit::Failure;
use crate::epoch::{
    self, Carried, Desk, Meter, RecordedAnswer, Rollouts, Task, Tools, Walk, WalkRecord, Wanted, Whole, Workbench,
};
use crate::experiment::{self, Experiment};
use crate::kernel::{Digest, Threads};
use crate::llm::{Ask, Cassette, Model, client};
use crate::scripted::Scripted;
use crate::shard::{Lineage, Need, OnTheWay, Shard, StudyMark, TaskResult};
use crate::store::{self, Store, Transcript};

/// Whether every model of an experiment is the stand-in, which any machine can ask.
pub fn asks_anywhere(experiment: &Experiment) -> bool {
    let used = experiment::asked(experiment);
    let of = |name: &&str| experiment.models.get(*name).is_some_and(|model| model.kind == client::SCRIPTED);
    used.iter().all(|name| of(name) || experiment.models.get(*name).is_some_and(|model| model.kind == client::DRAWN))
}

/// How a plan of whole lineages is made: where its own machine asks the models it makes the trials too, on which their questions rest.
pub fn whole(record: bool, anywhere: bool) -> Whole {
    Whole { tries: record && !anywhere }
}

/// Shards of the lineages that a plan asked for, with what the run has on record for them.
pub fn shards(
    wanted: &Wanted,
    (study, needs): (&StudyMark, &[Need]),
    (recorded, asks): (&Cassette, bool),
    (tools, store): (&Tools<'_>, &Store),
    own: &epoch::Study,
) -> Result<Vec<(String, Shard)>, Failure> {
    let shard = |walk: Walk| {
        let mut records = Vec::new();
        for (kind, key) in epoch::known(own, &walk, tools)? {
            let Some(object) = store.memo_get(kind, &key) else { continue };
            let text = String::from_utf8(store.get(&object)?).map_err(Failure::internal)?;
            let record = serde_json::value::RawValue::from_string(text).map_err(Failure::internal)?;
            records.push(WalkRecord { kind, key, record });
        }
        let answers = RecordedAnswer::of_lineage(recorded, &walk.lineage, walk.epoch);
        let (name, needs) = (walk.name(), needs.to_vec());
        let lineage = Some(Lineage { walk, records, answers, asks });
        let study = study.clone();
        Ok((name, Shard { study, programs: Default::default(), tasks: Vec::new(), lineage, needs }))
    };
    wanted.take_walks().into_iter().map(shard).collect()
}

/// Puts what the run has on record where the work looks for it.
pub fn remember(lineage: &Lineage, store: &Store) -> Result<(), Failure> {
    for WalkRecord { kind, key, record } in &lineage.records {
        let object = store.put(record.get().as_bytes())?;
        store.memo_put(*kind, key, &object)?;
    }
    Ok(())
}

/// A study where a shard is done.
pub struct Bench<'a> {
    pub study: &'a epoch::Study,
    pub experiment: &'a Experiment,
    pub threads: &'a Threads,
    pub rollouts: &'a Rollouts<'a>,
    /// Answers of another simulator, where one is asked.
    pub answers: Option<&'a dyn Answers>,
}

impl Bench<'_> {
    pub fn tools<'t>(&'t self, ask: &'t dyn Ask) -> Tools<'t> {
        let tools = Tools::new(self.study, ask, self.threads, self.rollouts, Meter::default());
        tools.behind(behind::backend(self.experiment, self.answers))
    }

    /// Goes a lineage's way: what the run will rest on there, and what came of it.
    pub fn go(
        &self,
        shard: &Shard,
        lineage: &Lineage,
        (store, log): (&Store, &Path),
    ) -> Result<(OnTheWay, Vec<TaskResult>), Failure> {
        let noted = Wanted::default();
        let stand_in = Scripted;
        let carried = Carried::new(&lineage.answers, lineage.asks.then_some(&stand_in as &dyn Model));
        // A killed try left its own.
        store::remove_file(log)?;
        {
            let tools = self.tools(&carried).noting(&noted);
            let mut desk = Desk { log: Transcript::create(log)?, watch: &mut |_| {}, tools };
            epoch::go(self.study, &lineage.walk, &carried, &mut desk)?;
        }
        let asked = carried.asked();
        let (mut tasks, mut programs) = noted.into_tasks();
        lineage.records.iter().for_each(|record| drop(tasks.remove(&record.key)));
        let used: BTreeSet<Digest> = tasks.values().filter_map(Task::program).collect();
        programs.retain(|hash, _| used.contains(hash));
        let here = Shard { programs, tasks: tasks.into_iter().collect(), lineage: None, ..shard.clone() };
        let tools = self.tools(&Nobody);
        let bench = Workbench::new(self.study, &tools);
        let one = |_: usize, (key, task): &(Digest, Task)| done(&bench, &here, *key, task, store);
        let results = self.threads.map(&here.tasks, one).into_iter().collect::<Result<Vec<TaskResult>, Failure>>()?;
        Ok((OnTheWay { programs: here.programs, tasks: here.tasks, asked }, results))
    }
}
