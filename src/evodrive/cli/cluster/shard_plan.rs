//! `shard plan`: what a run has no records of, as shards.

use clap::Args;
use serde_json::json;
use std::collections::BTreeMap;
use std::path::PathBuf;

use crate::backend::{Answers, Replay as Recorded};
use crate::cli::cluster::shard_target::{Target, TargetOptions};
use crate::cli::cluster::{shard_lineage, shard_needs};
use crate::cli::evolve::{behind, models};
use crate::cli::records::folder::{RunFolder, files, open_store};
use crate::cli::terminal::answer::{Answer, progress};
use crate::cli::terminal::{exit::Failure, interrupt::Interrupt};
use crate::epoch::{self, Desk, Meter, Mode, Rollouts, Task, Tools, Wanted};
use crate::kernel::Digest;
use crate::llm::{Ask, Cassette, Record, RecordMode, Replay};
use crate::objects::Program;
use crate::shard::{Need, RESULT_ENDING, SHARD_ENDING, Shard, StudyMark, split};
use crate::store::{self, Scratch, Transcript};

#[derive(Debug, Args)]
pub struct PlanOptions {
    #[command(flatten)]
    pub target: TargetOptions,
    /// Most tasks in a shard.
    #[arg(long, default_value_t = 64)]
    pub size: usize,
    /// Ask the experiment's models for answers that the cassette lacks; `evodrive record` writes them down at the end.
    #[arg(long)]
    pub record: bool,
    /// Questions to models that are open together [default: as `evodrive record`].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=4096))]
    pub open: Option<u16>,
    /// Plan every lineage as one piece of work, as far as it can be gone: few rounds, and as many shards as lineages.
    #[arg(long)]
    pub whole_lineages: bool,
    /// Also plan tasks that were done before and gave no label.
    #[arg(long)]
    pub again: bool,
}

pub fn run(options: &PlanOptions, jobs: usize) -> Result<Answer, Failure> {
    let target = Target::of(&options.target, jobs)?;
    target.held.or_gone(planned(options, &target), RunFolder::holds_answers)
}

fn planned(options: &PlanOptions, target: &Target) -> Result<Answer, Failure> {
    let Target { job, folder, named, cassette, rollouts, held } = target;
    let recorded = recorded(cassette, folder, options.record)?;
    let backend = job.experiment.simulator.backend.clone();
    let answers = match (&backend, rollouts) {
        (Some(options), Some(path)) => Some(behind::recorded(options, path, false)?),
        _ => None,
    };
    if let Some(answers) = answers.as_ref().filter(|answers| !answers.is_empty()) {
        // Workers need not ask again what is recorded.
        answers.save(&folder.rollouts(), &job.experiment.name)?;
    }
    let study = job.experiment.study(job.scenes.clone(), &job.threads)?;
    let remembered = options.record.then(|| open_store(&folder.recording())).transpose()?;
    let replay = Replay::new(recorded.clone(), format!("evodrive shard plan --record {}", named.display()));
    let anywhere = shard_lineage::asks_anywhere(&job.experiment);
    // Tasks ask nobody, so for them the plan does.
    let asks = options.record && anywhere && options.whole_lineages;
    let models = if options.record && !asks {
        models::askable(&job.experiment, folder, None, &Interrupt::default())?
    } else {
        BTreeMap::new()
    };
    let asked = remembered.as_ref().map(|store| Record::new(store, recorded.clone(), RecordMode::Missing, models));
    let ask: &dyn Ask = asked.as_ref().map_or(&replay, |asked| asked);
    let answers = answers.map(|answers| Recorded::new(answers, "evodrive shard plan"));
    let answers = answers.as_ref().map(|answers| answers as &dyn Answers);
    let wanted = if options.whole_lineages {
        Wanted::new(options.again).by_lineage(shard_lineage::whole(options.record, anywhere))
    } else {
        Wanted::new(options.again)
    };
    // If workers ask, or nobody does, nothing is waited for here.
    let open = options.open.map(usize::from).or_else(|| models::open_by_default(&job.experiment));
    let open = open.filter(|_| options.record && !asks);
    let needs = shard_needs::gathered(&job.experiment, folder, asks)?;
    let mark = StudyMark::of(&study);
    let scratch = Scratch::under(&folder.shards(), ".walk-")?;
    let walk = scratch.dir.join("walk.jsonl");
    let labels = Rollouts::new(&held.objects, Mode::Reuse);
    let tools = || {
        let tools = Tools::new(&study, ask, &job.threads, &labels, Meter::default());
        let tools = tools.behind(behind::backend(&job.experiment, answers)).planning(&wanted);
        match open {
            Some(open) => tools.asking_at_once(open),
            None => tools,
        }
    };
    let complete = {
        let mut desk = Desk { log: Transcript::create(&walk)?, watch: &mut |_| {}, tools: tools() };
        epoch::plan(&study, &mut desk, &walk, &recorded, &wanted)
    };
    let complete = complete?;
    // If models were asked, the answers to this walk's own questions travel.
    let recorded = asked.as_ref().map(|asked| asked.to_cassette("plan")).transpose()?.unwrap_or(recorded);
    let lineages = shard_lineage::shards(&wanted, &needs, &recorded, asks, &tools(), &held.objects, &study)?;
    let (tasks, programs) = wanted.into_tasks();
    let planned = Planned::write(folder, &mark, &needs, lineages, tasks, &programs, options.size)?;
    Ok(planned.answer(folder, &named.display().to_string(), complete))
}

/// Recorded answers of models. To record a study there need be none yet.
fn recorded(path: &std::path::Path, folder: &RunFolder, record: bool) -> Result<Cassette, Failure> {
    if record && !path.exists() {
        return Ok(Cassette::new(path.display().to_string()));
    }
    let cassette = Cassette::load(path)?;
    if path != folder.cassette() {
        store::copy(path, &folder.cassette())?;
    }
    Ok(cassette)
}

/// Returns a readable name of a shard of tasks: its first task's lineage, and the number of tasks.
fn of_tasks(shard: &Shard) -> String {
    let lineage = shard.tasks.first().map_or("nothing", |(_, task)| task.lineage().as_str());
    format!("{lineage} {} tasks", shard.tasks.len())
}

/// Work that is missing, and the shards that hold it.
struct Planned {
    labels: usize,
    trials: usize,
    undisturbed: usize,
    lineages: usize,
    /// New shards.
    written: usize,
    /// Shards without a result, with their readable names.
    to_do: BTreeMap<PathBuf, String>,
    /// Missing tasks of shards that have a result: it was not merged.
    unmerged: usize,
}

impl Planned {
    /// Writes shards for the tasks that no earlier shard holds.
    fn write(
        folder: &RunFolder,
        mark: &StudyMark,
        needs: &[Need],
        whole: Vec<(String, Shard)>,
        mut tasks: BTreeMap<Digest, Task>,
        programs: &BTreeMap<Digest, Program>,
        size: usize,
    ) -> Result<Planned, Failure> {
        let count = |kind: fn(&Task) -> bool| tasks.values().filter(|task| kind(task)).count();
        let labels = count(|task| matches!(task, Task::Label { .. }));
        let trials = count(|task| matches!(task, Task::Trial { .. }));
        let undisturbed = tasks.len() - labels - trials;
        let (lineages, mut written, mut unmerged) = (whole.len(), 0, 0);
        let mut to_do = BTreeMap::new();
        for path in files(&folder.shards(), SHARD_ENDING)? {
            let (shard, _) = Shard::load(&path)?;
            mark.check(&shard.study, &path.display().to_string())?;
            // A shard of a lineage that has gone on since misses nothing; those still wanted are in `whole`.
            if shard.lineage.is_some() {
                continue;
            }
            let held = shard.tasks.iter().filter(|(key, _)| tasks.remove(key).is_some()).count();
            if path.with_extension(&RESULT_ENDING[1..]).exists() {
                unmerged += held;
            } else if held > 0 {
                // What a shard without such tasks holds was brought by other results.
                to_do.insert(path, of_tasks(&shard));
            }
        }
        let pieces = split(mark, tasks, programs, needs, size).map(|shard| (of_tasks(&shard), shard));
        for (name, shard) in pieces.chain(whole) {
            let (path, is_new) = shard.saved(&folder.shards())?;
            written += usize::from(is_new);
            if path.with_extension(&RESULT_ENDING[1..]).exists() {
                unmerged += shard.tasks.len() + usize::from(shard.lineage.is_some())
            } else {
                drop(to_do.insert(path, name))
            }
        }
        Ok(Planned { labels, trials, undisturbed, lineages, written, to_do, unmerged })
    }

    fn answer(&self, folder: &RunFolder, named: &str, complete: bool) -> Answer {
        let Planned { labels, trials, undisturbed, lineages, written, to_do, unmerged } = self;
        let missing = labels + trials + undisturbed;
        let shards = folder.shards();
        let at = shards.display();
        progress(format!("run folder: {}", folder.dir.display()));
        let mut text = if complete {
            format!("nothing is missing\n  next: evodrive run (or record) {named}\n")
        } else {
            format!(
                "missing: {missing} records ({trials} trials, {labels} labels, {undisturbed} scenes without a program){}\n\
                 shards to do: {} ({written} new) in {at}\n",
                if *lineages == 0 { String::new() } else { format!(" and what follows in {lineages} lineages") },
                to_do.len()
            )
        };
        if !to_do.is_empty() {
            text += &format!("  next: evodrive shard work {at}/*{SHARD_ENDING}, then evodrive shard merge {named}\n");
        }
        if *unmerged > 0 {
            text += &format!("{unmerged} of them are in results that are not merged: evodrive shard merge {named}\n");
        }
        let object = json!({
            "folder": folder.dir, "shards": shards, "complete": complete, "missing": missing, "labels": labels,
            "trials": trials, "undisturbed": undisturbed, "lineages": lineages, "new_shards": written,
            "to_do": to_do.keys().collect::<Vec<_>>(), "names": to_do.values().collect::<Vec<_>>(), "unmerged": unmerged,
        });
        Answer::new(text, object)
    }
}
