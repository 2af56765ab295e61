//! Checks what the seal of a run covers: which files of its folder agree with the sealed events, and which files the events cannot vouch for.

use serde_json::{Value, json};
use std::collections::BTreeSet;

use crate::backend::RolloutCassette;
use crate::cli::records::folder::RunFolder;
use crate::evidence::RecordedRun;
use crate::experiment::{Experiment, SceneSource, read_pool};
use crate::kernel::{Digest, Threads};
use crate::llm::Cassette;
use crate::objects::{Exchange, LineageId, SceneScore};
use crate::scene::{Pool, Scene};
use crate::shard::Withdrawn;
use crate::store::{self, FsckReport, MemoKind};

/// Bytes that a result file may have.
pub const RESULT_BYTES_MAX: u64 = 32 << 20;

/// How parents name an ego that is a program of the experimenter's own.
const OWN_EGO: &str = "command";

/// Result of the check.
#[derive(Debug, Default)]
pub struct Coverage {
    /// Files that are not what the events say, each with what was expected, what was found and what to do.
    pub damage: Vec<String>,
    /// Files that the events speak for and that are as they say.
    pub covered: Vec<String>,
    /// Files of the folder that no digest speaks for.
    pub uncovered: Vec<String>,
    /// Unfinished work, which is no damage.
    pub notes: Vec<String>,
}

/// Files and folders that a run may have and that no event speaks for.
const UNCOVERED: [&str; 14] = [
    "run.json",
    "cost.json",
    "report.html",
    "spend.json",
    "processes.log",
    "rollouts.jsonl",
    "withdrawn.jsonl",
    "exchange",
    "tries",
    "recording",
    "shards",
    "transcript.before.jsonl",
    "manifest.json",
    "ro-crate-metadata.json",
];

/// Compares a folder's files with a run's events; with `read`, also those that take long. `store` is what was seen of the store, where
/// there is one.
pub fn coverage(folder: &RunFolder, run: &RecordedRun, store: Option<&FsckReport>, read: bool) -> Coverage {
    let mut coverage = Coverage::default();
    let recording = folder.card().is_ok_and(|card| card.recording.is_some());
    coverage.file("experiment.toml", experiment(folder, run));
    if read {
        coverage.file("scenes.pool", pool(folder, run));
    }
    if recording {
        coverage.notes.push("a recording that is not finished; `evodrive resume` continues it".into());
    } else {
        if read {
            coverage.file("cassette.jsonl", cassette(folder, run));
            coverage.damage.extend(rollouts(folder, run).err());
        }
        match (&run.result, folder.result().exists()) {
            (Some(_), _) => {
                coverage.file("result.json", result(folder, run));
                store.iter().for_each(|store| coverage.kept(folder, run, store));
            }
            (None, true) => coverage.damage.push(lost_end(folder, run)),
            (None, false) => {
                coverage.notes.push("a run that is not finished; `evodrive resume` continues it".into());
            }
        }
    }
    let there = UNCOVERED.into_iter().filter(|name| folder.dir.join(name).exists());
    coverage.uncovered.extend(there.map(String::from));
    coverage
}

impl Coverage {
    fn file(&mut self, name: &str, checked: Result<(), String>) {
        match checked {
            Ok(()) => self.covered.push(name.to_string()),
            Err(what) => self.damage.push(what),
        }
    }

    /// Every rollout that a label of a sealed run names is in the store, or the store is empty. A pack that was cut between two records
    /// has no other trace where its index is gone, too.
    fn kept(&mut self, folder: &RunFolder, run: &RecordedRun, store: &FsckReport) {
        let labels = || run.scores().flat_map(|(.., score)| score.scenes.iter().flat_map(SceneScore::each));
        let named: BTreeSet<Digest> = labels().map(|label| label.record).collect();
        let withdrawn = Withdrawn::read(&folder.withdrawn()).unwrap_or_else(|error| {
            self.damage.push(error.to_string());
            Vec::new()
        });
        let is_kept = |label: &&SceneScore| {
            store.whole.contains(&label.record) && store.pairs.contains_key(&(MemoKind::Rollout, label.request))
        };
        let was_withdrawn = |record: &Digest| withdrawn.iter().any(|of| of.record == *record);
        let lacking = labels().filter(|label| !is_kept(label)).map(|label| label.record);
        let (taken_out, lacking): (BTreeSet<Digest>, BTreeSet<Digest>) = lacking.partition(was_withdrawn);
        if !taken_out.is_empty() {
            self.notes.push(format!(
                "{} records were withdrawn and are not made again yet; `evodrive resume` simulates them",
                taken_out.len()
            ));
        }
        let pair = |label: &&SceneScore| {
            let kept = store.pairs.get(&(MemoKind::Rollout, label.request))?;
            (*kept != label.record).then_some((label.request, label.record, *kept))
        };
        if let Some((request, due, found)) = labels().find_map(|label| pair(&label)) {
            self.damage.push(format!(
                "{}: rollout request {request}: expected the record {due}, as the sealed events pair them, found {found}; delete \
                 the store, and `evodrive resume` fills it again",
                folder.store().join("objects.pack").display()
            ));
        }
        match lacking.first() {
            None => {}
            Some(_) if store.pack_bytes == 0 => self.notes.push(
                "the store is empty: the recorded rollouts are not kept here; `evodrive verify` simulates them again"
                    .into(),
            ),
            Some(first) => self.damage.push(format!(
                "{}: expected the {} rollouts that the sealed events name, {} of them are missing, {first} among them; delete the \
                 store, and `evodrive resume` fills it again",
                folder.store().join("objects.pack").display(),
                named.len(),
                lacking.len()
            )),
        }
    }
}

fn experiment(folder: &RunFolder, run: &RecordedRun) -> Result<(), String> {
    let path = folder.experiment();
    let digest = Experiment::read(&path).map_err(|error| error.to_string())?.digest();
    same(&path, "an experiment", run.opened.experiment, digest.map_err(|error| error.to_string())?)
}

fn pool(folder: &RunFolder, run: &RecordedRun) -> Result<(), String> {
    let path = folder.pool();
    let found = read_pool(&path).map_err(|error| error.to_string())?;
    same(&path, "a pool", run.opened.pool, found.digest())?;
    let said = |digest: Option<Digest>| digest.map_or("none".into(), |digest| digest.to_hex());
    match (run.opened.provenance, found.sealed_provenance()) {
        (None, None) => generated(folder, &found),
        (due, there) if due == there => Ok(()),
        (due, there) => Err(format!(
            "{}: expected origins of scenes and parts left out of digest {}, as the run's first event has it, found {}; {RESTORE}",
            path.display(),
            said(due),
            said(there)
        )),
    }
}

/// Scenes that the experiment generates say where they come from as their generator does, and nothing of them was left out.
pub fn generated(folder: &RunFolder, found: &Pool) -> Result<(), String> {
    // An experiment that cannot be read is damage of its own.
    let Ok(experiment) = folder.read_experiment() else { return Ok(()) };
    if !matches!(experiment.scenes, SceneSource::Synth { .. } | SceneSource::Safebench { .. }) {
        return Ok(());
    }
    let threads = Threads::new(1).map_err(|error| error.to_string())?;
    let made = experiment.scenes(&[], &threads).map_err(|error| error.to_string())?;
    // Scenes that were named in place of the experiment's are not its own; where an imported pool has them, the events vouch.
    if found.seals_provenance || made.digest() != found.digest() {
        return Ok(());
    }
    let origin = |scene: &Scene| json!([scene.id, scene.origin]);
    let due = made.scenes.iter().map(origin).chain(made.left_out.iter().map(|left| json!(left)));
    let there = found.scenes.iter().map(origin).chain(found.left_out.iter().map(|left| json!(left)));
    let (due, there) = (Value::from_iter(due), Value::from_iter(there));
    if due == there {
        return Ok(());
    }
    let (place, due, there) = store::first_difference("origins", &due, &there);
    let path = folder.pool();
    Err(format!("{}: {place}: expected {due}, as the generator has it, found {there}; {RESTORE}", path.display()))
}

fn same(path: &std::path::Path, what: &str, expected: Digest, found: Digest) -> Result<(), String> {
    if expected == found {
        return Ok(());
    }
    let path = path.display();
    Err(format!(
        "{path}: expected {what} of digest {expected}, as the run's first event has it, found {found}; {RESTORE}"
    ))
}

const RESTORE: &str = "restore the file, or delete the folder and run the experiment again";

/// Every answer that an event names is in the cassette, with the bytes that the event names.
fn cassette(folder: &RunFolder, run: &RecordedRun) -> Result<(), String> {
    let path = folder.cassette();
    let cassette = Cassette::load(&path).map_err(|error| error.to_string())?;
    let wrong = |exchange: &&Exchange| {
        cassette.get(&exchange.request).is_none_or(|recorded| recorded.response != exchange.response)
    };
    let said = |exchange: &Exchange| cassette.get(&exchange.request).and_then(|found| cassette.sealed_metadata(found));
    let all: Vec<&Exchange> = exchanges(run).collect();
    let Some(first) = all.iter().copied().find(wrong) else {
        let Some(other) = all.iter().find(|exchange| said(exchange) != exchange.metadata) else { return Ok(()) };
        let shown = |digest: Option<Digest>| digest.map_or("nothing that is sealed".into(), |digest| digest.to_hex());
        return Err(format!(
            "{}: request {}: expected that the provider said {} beside its answer, as the event has it, found {}; {RESTORE}",
            path.display(),
            other.request,
            shown(other.metadata),
            shown(said(other))
        ));
    };
    let (lacking, role, key) = (all.iter().copied().filter(wrong).count(), first.role.name(), first.request);
    let digest = if cassette.get(&key).is_some() { "another one" } else { "none" };
    Err(format!(
        "{}: expected the answer of the {role} to request {key}, found {digest}; {lacking} of {} answers that the events name are lacking; {RESTORE}",
        path.display(),
        all.len()
    ))
}

/// Every scene that was labelled against a driver of the backend has a recorded rollout there. Which one a label needs follows from
/// its compiled program alone, which `verify` makes.
fn rollouts(folder: &RunFolder, run: &RecordedRun) -> Result<(), String> {
    let experiment = folder.read_experiment().map_err(|failure| failure.message)?;
    let Some(options) = &experiment.simulator.backend else { return Ok(()) };
    let path = folder.rollouts();
    let recorded = RolloutCassette::load(&path).map_err(|error| error.to_string())?;
    recorded.check(options).map_err(|error| error.to_string())?;
    let (there, place) = (recorded.scenes(), path.display());
    let asks = |lineage: &LineageId| {
        let ego = run.parents.iter().find(|parent| parent.lineage == *lineage).map(|parent| parent.ego.as_str());
        !options.drives() || ego == Some(OWN_EGO)
    };
    let labelled: BTreeSet<&str> = run
        .scores()
        .filter(|(lineage, ..)| asks(lineage))
        .flat_map(|(.., score)| score.scenes.iter().map(|label| label.scene.as_str()))
        .collect();
    let lacking: Vec<&&str> = labelled.iter().filter(|scene| !there.contains(**scene)).collect();
    let Some(first) = lacking.first() else { return Ok(()) };
    Err(format!(
        "{place}: expected a recorded rollout of every scene that was labelled, found none of {first}; {} of {} scenes are lacking; {RESTORE}",
        lacking.len(),
        labelled.len()
    ))
}

/// Every question that the events name, with what was answered.
pub fn exchanges(run: &RecordedRun) -> impl Iterator<Item = &Exchange> {
    let attempts = run.attempts.iter().flat_map(|attempt| &attempt.proposal.exchanges);
    let composed = run.composed.iter().flat_map(|composed| &composed.exchanges);
    let evolved = run.evolved.iter().flat_map(|turn| &turn.exchanges);
    attempts.chain(composed).chain(run.counsels.iter().flat_map(|counsel| &counsel.exchanges)).chain(evolved)
}

fn result(folder: &RunFolder, run: &RecordedRun) -> Result<(), String> {
    let path = folder.result();
    let anew = "`evodrive resume` writes it again from the events";
    let bytes = store::read_bounded(&path, RESULT_BYTES_MAX).map_err(|error| format!("{error}; {anew}"))?;
    let expected = json!({"root": run.root, "result": run.result});
    match of_result(&bytes) {
        Ok(found) if found == expected => Ok(()),
        Ok(found) => {
            let (field, sealed, found) = store::first_difference("", &expected, &found);
            Err(format!("{}: {field}: expected {sealed}, as it was sealed, found {found}; {anew}", path.display()))
        }
        Err(error) => Err(format!("{}: expected the sealed result, found no JSON: {error}; {anew}", path.display())),
    }
}

/// The value of a result's file, unless it takes more memory than any that is written.
pub fn of_result(bytes: &[u8]) -> Result<Value, String> {
    match store::too_large(bytes) {
        Some((expected, found)) => Err(format!("expected {expected}, found {found}")),
        None => serde_json::from_slice(bytes).map_err(|error| error.to_string()),
    }
}

fn lost_end(folder: &RunFolder, run: &RecordedRun) -> String {
    let root = store::read_bounded(&folder.result(), RESULT_BYTES_MAX).ok();
    let root = root.and_then(|bytes| of_result(&bytes).ok()?["root"].as_str().map(String::from));
    format!(
        "{}: expected the events of a finished run to end with a seal of root {} (from its result), found that they end at {}; `evodrive resume` repeats what is lost",
        folder.transcript().display(),
        root.as_deref().unwrap_or("not readable"),
        run.root
    )
}
