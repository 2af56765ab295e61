//! Shards of whole lineages: made by `shard plan`, gone by `shard work`.

use std::collections::BTreeSet;
use std::path::Path;

use crate::agents::AgentError;
use crate::backend::Answers;
use crate::cli::cluster::shard_done::{Nobody, done};
use crate::cli::evolve::{behind, models};
use crate::cli::records::folder::RunFolder;
use crate::cli::terminal::{exit::Failure, interrupt::Interrupt};
use crate::epoch::{
    self, CarriedAnswers, Desk, LineageJob, Meter, RecordedAnswer, Rollouts, RunError, Task, Tools, WalkRecord, Wanted,
    Whole, Workbench,
};
use crate::experiment::{self, Experiment, ModelOptions};
use crate::kernel::{Digest, Threads};
use crate::llm::{Ask, AskError, Cassette, ModelError, Record, RecordMode, client};
use crate::shard::{Lineage, Need, OnTheWay, Shard, StudyMark, TaskResult};
use crate::store::{self, Store, Transcript};

/// Returns `true` if any machine can ask every model of an experiment: the stand-in, and programs that name the files that have to travel.
pub fn asks_anywhere(experiment: &Experiment) -> bool {
    let reached = |model: &ModelOptions| match model.kind.as_str() {
        client::SCRIPTED | client::DRAWN => true,
        client::COMMAND => model.command.as_ref().is_some_and(|command| command.files.is_some()),
        _ => false,
    };
    experiment::asked(experiment).iter().all(|name| experiment.models.get(*name).is_some_and(reached))
}

/// Returns how a plan of whole lineages is made. If its own machine asks the models, it also makes the trials on which
/// their questions rest; otherwise it asks nobody.
pub fn whole(record: bool, anywhere: bool) -> Whole {
    Whole { tries: record && !anywhere, asked_elsewhere: record && anywhere }
}

/// Shards of the lineages that a plan asked for, with what the run has on record for them.
pub fn shards(
    wanted: &Wanted,
    needs: &[Need],
    recorded: &Cassette,
    asks: bool,
    tools: &Tools<'_>,
    store: &Store,
    own: &epoch::Study,
) -> Result<Vec<(String, Shard)>, Failure> {
    let study = StudyMark::of(own);
    let shard = |walk: LineageJob| {
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
    pub folder: &'a RunFolder,
    pub threads: &'a Threads,
    /// Questions that are open together; without it as many as there are threads.
    pub open: Option<usize>,
    pub rollouts: &'a Rollouts<'a>,
    /// Answers of another simulator, where one is asked.
    pub answers: Option<&'a dyn Answers>,
}

impl Bench<'_> {
    pub fn tools<'t>(&'t self, ask: &'t dyn Ask) -> Tools<'t> {
        let tools = Tools::new(self.study, ask, self.threads, self.rollouts, Meter::default());
        let tools = tools.behind(behind::backend(self.experiment, self.answers));
        match self.open {
            Some(open) => tools.asking_at_once(open),
            None => tools,
        }
    }

    /// Goes a lineage's way: what the run will rest on there, and what came of it.
    pub fn go(
        &self,
        shard: &Shard,
        lineage: &Lineage,
        store: &Store,
        log: &Path,
    ) -> Result<(OnTheWay, Vec<TaskResult>), Failure> {
        let noted = Wanted::default();
        // In the store: what a killed try was answered is not asked again.
        let models = lineage.asks.then(|| models::askable(self.experiment, self.folder, None, &Interrupt::default()));
        let models = models.transpose()?;
        let models = models.map(|models| Record::new(store, Cassette::default(), RecordMode::Missing, models));
        let carried = CarriedAnswers::new(&lineage.answers, models.as_ref().map(|models| models as &dyn Ask));
        // A killed try left its own.
        store::remove_file(log)?;
        {
            let tools = self.tools(&carried).noting(&noted);
            let mut desk = Desk { log: Transcript::create(log)?, watch: &mut |_| {}, tools };
            epoch::go(self.study, &lineage.walk, &carried, &mut desk).map_err(lacking_or_not)?;
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

/// Marks the failure as one of this machine if a model's program cannot be started here: another machine may have it.
fn lacking_or_not(error: RunError) -> Failure {
    match &error {
        RunError::Agent(AgentError::Ask(AskError::Model { error: ModelError::Lacking { .. }, .. })) => {
            Failure::lacking(format!("this machine cannot do the shard: {error}"))
        }
        _ => error.into(),
    }
}
