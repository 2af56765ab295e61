//! `shard merge`: the results of shards, united with the run.

use clap::Args;
use serde_json::json;
use std::path::PathBuf;

use crate::agents::AgentError;
use crate::cli::cluster::shard_audit::{self, Auditor};
use crate::cli::cluster::shard_done::Nobody;
use crate::cli::cluster::shard_target::{Target, TargetOptions};
use crate::cli::evolve::behind;
use crate::cli::records::folder::{RunFolder, files, open_store};
use crate::cli::terminal::answer::{Answer, progress};
use crate::cli::terminal::exit::{Exit, Failure};
use crate::epoch::{Meter, Mode, Rollouts, RunError, Task, Tools, Workbench};
use crate::llm::{Completion, Record};
use crate::shard::{Merge, Merged, RESULT_ENDING, StudyMark, Withdrawn};
use crate::store;
use crate::text::counted;

#[derive(Debug, Args)]
pub struct MergeOptions {
    #[command(flatten)]
    pub target: TargetOptions,
    /// Results, or folders of results, besides those in the run folder.
    #[arg(long, num_args = 1..)]
    pub results: Vec<PathBuf>,
    /// Compute a drawn share of the results' records again, 1 for all of them, before anything is merged.
    #[arg(long, value_name = "SHARE", value_parser = shard_audit::share)]
    pub audit: Option<f64>,
}

pub fn run(options: &MergeOptions, jobs: usize) -> Result<Answer, Failure> {
    let target = Target::of(&options.target, jobs)?;
    target.held.or_gone(merge(options, &target), |_| false)
}

fn merge(options: &MergeOptions, target: &Target) -> Result<Answer, Failure> {
    let Target { job, folder, rollouts, named, held, .. } = target;
    let mut results: Vec<PathBuf> = files(&folder.shards(), RESULT_ENDING)?;
    for path in &options.results {
        results.extend(store::list_files(path, &[RESULT_ENDING])?);
    }
    let mut cassette = match (&job.experiment.simulator.backend, rollouts) {
        (Some(backend), Some(path)) => Some(behind::recorded(backend, path, false)?),
        _ => None,
    };
    let name = job.experiment.name.clone();
    let own = job.experiment.study(job.scenes.clone(), &job.threads)?;
    let (study, shards, withdrawn) = (StudyMark::of(&own), folder.shards(), Withdrawn::read(&folder.withdrawn())?);
    let rollouts_here = Rollouts::new(&held.objects, Mode::Reuse);
    let tools = Tools::new(&own, &Nobody, &job.threads, &rollouts_here, Meter::default());
    let bench = Workbench::new(&own, &tools);
    let key = |task: &Task| bench.key(task);
    let mut merge = Merge {
        study: &study,
        shards: &shards,
        store: &held.objects,
        withdrawn: &withdrawn,
        cassette: cassette.as_mut(),
        key: Some(&key),
    };
    let (mut untrue, mut checked) = (Vec::new(), None);
    if let Some(share) = options.audit {
        let (experiment, threads) = (&job.experiment, &job.threads);
        let auditor = Auditor { experiment, study: &own, threads, folder: &folder.dir };
        let audited = auditor.audit(share, &merge, results)?;
        (results, untrue, checked) = (audited.usable, audited.untrue, Some(audited.checked));
    }
    let mut merged = merge.merge(&results)?;
    let asked = keep_asked(&mut merged, folder)?;
    // Results that an audit found untrue are named first.
    untrue.append(&mut merged.refused);
    merged.refused = untrue;
    if let (Some(cassette), Some(path), true) = (&cassette, rollouts, merged.answers > 0) {
        cassette.save(path, &name)?;
        cassette.save(&folder.rollouts(), &name)?;
        progress(format!("{} in {}", counted(cassette.len(), "rollout"), path.display()));
    }
    Ok(answer(merged, checked, asked, &named.display().to_string()))
}

/// Answers that workers got of a model are this recording's: `evodrive record` asks nobody for them.
fn keep_asked(merged: &mut Merged, folder: &RunFolder) -> Result<usize, Failure> {
    let asked = std::mem::take(&mut merged.asked);
    if asked.is_empty() {
        return Ok(0);
    }
    let store = open_store(&folder.recording())?;
    for of in &asked {
        let key = of.answer;
        let absent = || Failure::corruption(format!("the answer to question {key} has no bytes; do its shard again"));
        let answer = Completion { bytes: of.bytes().ok_or_else(absent)?, metadata: of.metadata.clone() };
        Record::keep_elsewhere(&store, &key, &answer).map_err(AgentError::Ask).map_err(RunError::Agent)?;
    }
    store.flush()?;
    Ok(asked.len())
}

fn answer(merged: Merged, checked: Option<usize>, asked: usize, named: &str) -> Answer {
    let Merged { results, records, known, no_label, answers, refused, .. } = merged;
    let reasons: Vec<String> = refused.iter().map(|(_, error)| error.to_string()).collect();
    let files: Vec<&PathBuf> = refused.iter().map(|(file, _)| file).collect();
    for reason in &reasons {
        progress(format!("refused: {reason}"));
    }
    let audited = checked.map_or(String::new(), |count| format!("{count} tasks were done again here\n"));
    let text = format!(
        "{audited}{results} results: {records} new records, {known} known ones, {no_label} tasks without a label, {answers} new answers of \
         the backend; {} results refused\n  next: evodrive shard plan {named}\n",
        reasons.len()
    );
    let object = json!({
        "results": results, "records": records, "known": known, "no_label": no_label, "answers": answers,
        "refused": reasons, "refused_results": files, "audited": checked, "asked": asked,
    });
    // All usable results were merged; the first refusal gives the command's exit code.
    let exit = refused.into_iter().next().map_or(Exit::Success, |(_, error)| Failure::from(error).exit);
    Answer { exit, ..Answer::new(text, object) }
}
