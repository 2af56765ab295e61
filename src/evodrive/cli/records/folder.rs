//! A run folder: everything that a run rests on and leaves behind, named by its inputs.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::adapters::ADAPTER_VERSION;
use crate::cli::records::setting;
use crate::cli::terminal::answer::progress;
use crate::cli::terminal::exit::{Exit, Failure};
use crate::evaluation::EVAL_VERSION;
use crate::evidence::{Declared, Reading, RecordedRun, RecordedRunError};
use crate::experiment::{Experiment, ExperimentError, ModelOptions, composed, read_pool};
use crate::kernel::{Digest, Threads};
use crate::scene::Pool;
use crate::sim::SIM_VERSION;
use crate::store::{self, MemoKind, OwnDir, Store, StoreError, Transcript};

/// Folder of run folders, unless `--out` names another one.
pub const RUNS: &str = "runs";
pub const LATEST: &str = "LATEST";
const SPEND: &str = "spend.json";
pub const CARD_BYTES_MAX: u64 = 1 << 16;
const CARD_FORMAT: &str = "evodrive-run/1";

/// Content of `run.json`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RunCard {
    pub name: String,
    /// Present while the recording has not written its cassette yet.
    pub recording: Option<Recording>,
}

/// `run.json` as it is written: the recording's parts stand beside the name.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct CardFile {
    format: String,
    name: String,
    recording: bool,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    cassette: Option<PathBuf>,
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    fresh: bool,
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    overwrite: bool,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    rollouts: Option<PathBuf>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    driver_folder: Option<PathBuf>,
}

impl TryFrom<CardFile> for RunCard {
    type Error = String;

    fn try_from(file: CardFile) -> Result<RunCard, String> {
        let CardFile { format: _, name, recording, cassette, fresh, overwrite, rollouts, driver_folder } = file;
        let recording = match (recording, cassette) {
            (true, Some(cassette)) => Some(Recording { cassette, fresh, overwrite, rollouts, driver_folder }),
            (true, None) => return Err("expected `cassette`, the file that the recording writes, found none".into()),
            (false, _) => None,
        };
        Ok(RunCard { name, recording })
    }
}

impl From<RunCard> for CardFile {
    fn from(card: RunCard) -> CardFile {
        let recording = card.recording.is_some();
        let (cassette, fresh, overwrite, rollouts, driver_folder) = match card.recording {
            Some(Recording { cassette, fresh, overwrite, rollouts, driver_folder }) => {
                (Some(cassette), fresh, overwrite, rollouts, driver_folder)
            }
            None => (None, false, false, None, None),
        };
        let (format, name) = (CARD_FORMAT.into(), card.name);
        CardFile { format, name, recording, cassette, fresh, overwrite, rollouts, driver_folder }
    }
}

/// Facts that a recording needs to go on after it was interrupted.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Recording {
    /// File for the cassette.
    pub cassette: PathBuf,
    /// True if everything is asked anew.
    pub fresh: bool,
    /// True if answers that another experiment's recording left there may be lost.
    pub overwrite: bool,
    /// File for the rollouts of another simulator.
    pub rollouts: Option<PathBuf>,
    /// Folder in which the planner is started.
    pub driver_folder: Option<PathBuf>,
}

/// The files of a run.
#[derive(Clone, Debug)]
pub struct RunFolder {
    pub dir: PathBuf,
}

impl RunFolder {
    /// `<out>/<name>-<8 hex digits of the inputs>`.
    pub fn of(out: &Path, name: &str, experiment: Digest, pool: Digest) -> Result<RunFolder, Failure> {
        let versions = (ADAPTER_VERSION, SIM_VERSION, EVAL_VERSION);
        let id = Digest::of("evodrive/run-folder/1", &(experiment, pool, versions)).map_err(Failure::internal)?;
        Ok(RunFolder { dir: out.join(format!("{name}-{}", id.short(8))) })
    }

    /// The one folder below `runs` whose run was begun and is not finished, if there is one.
    ///
    /// # Errors
    /// There are several: which one is meant must be said.
    pub fn unfinished() -> Result<Option<RunFolder>, Failure> {
        let runs = Path::new(RUNS);
        let mut folders = Vec::new();
        for dir in if runs.exists() { store::list_dirs(runs)? } else { Vec::new() } {
            let folder = RunFolder { dir };
            // A folder that this program cannot read cannot be continued either.
            if folder.has_card() && folder.is_unfinished().unwrap_or(false) {
                folders.push(folder);
            }
        }
        if folders.len() > 1 {
            let names: Vec<String> = folders.iter().map(|folder| folder.dir.display().to_string()).collect();
            let (count, names) = (names.len(), names.join(", "));
            return Err(Failure::bad_input(format!("{count} runs below {} are unfinished; name one: {names}", RUNS)));
        }
        Ok(folders.pop())
    }

    /// A cassette of this run's own, beside its folder: where a recording goes that must not grow another cassette.
    pub fn cassette_beside(&self) -> PathBuf {
        self.dir.with_extension("jsonl")
    }

    /// Returns `true` if the run was begun and has not come to its end.
    pub fn is_unfinished(&self) -> Result<bool, Failure> {
        Ok(self.card()?.recording.is_some() || (self.transcript().exists() && !self.result().exists()))
    }

    /// Returns `true` if it holds what cannot be made again: answers of models or of another simulator, or questions to them.
    pub fn holds_answers(&self) -> bool {
        let recorded = self.recording().exists()
            && open_store(&self.recording()).map_or(true, |store| {
                [MemoKind::Llm, MemoKind::Rollout].into_iter().any(|kind| store.memo_len(kind) > 0)
            });
        recorded || self.exchanges().exists() || self.dir.join(SPEND).exists()
    }

    /// Returns `true` if it is a run's folder: it holds what a run writes first, or the mark of a command that made it, or nothing yet.
    pub fn is_one(&self) -> Result<bool, StoreError> {
        let own = [self.card_file(), self.experiment(), self.transcript(), self.store().join("objects.pack")];
        Ok(own.iter().any(|file| file.exists())
            || OwnDir::is_one(&self.dir)
            || self.dir.is_dir() && store::list_entries(&self.dir, "")?.is_empty())
    }

    pub fn experiment(&self) -> PathBuf {
        self.dir.join("experiment.toml")
    }

    pub fn pool(&self) -> PathBuf {
        self.dir.join("scenes.pool")
    }

    /// The experiment that the folder keeps.
    pub fn read_experiment(&self) -> Result<Experiment, Failure> {
        Experiment::read(&self.experiment()).map_err(kept)
    }

    /// The scenes that the folder keeps.
    pub fn read_pool(&self) -> Result<Pool, Failure> {
        read_pool(&self.pool()).map_err(kept)
    }

    pub fn cassette(&self) -> PathBuf {
        self.dir.join("cassette.jsonl")
    }

    /// Recorded rollouts of another simulator, where the experiment names one.
    pub fn rollouts(&self) -> PathBuf {
        self.dir.join("rollouts.jsonl")
    }

    /// Shards of missing work, and their results.
    pub fn shards(&self) -> PathBuf {
        self.dir.join("shards")
    }

    /// Files of a planner of one's own that travel with shards.
    pub fn planner(&self) -> PathBuf {
        self.dir.join("planner")
    }

    /// Records that were taken out of the run by name.
    pub fn withdrawn(&self) -> PathBuf {
        self.dir.join("withdrawn.jsonl")
    }

    /// Returns the file of what planners and workers printed during the recording; no record holds it.
    pub fn processes(&self) -> PathBuf {
        self.dir.join("processes.log")
    }

    pub fn transcript(&self) -> PathBuf {
        self.dir.join("transcript.jsonl")
    }

    /// The transcript of a finished run that is being recorded anew, until that is finished too.
    fn aside(&self) -> PathBuf {
        self.dir.join("transcript.before.jsonl")
    }

    /// Makes room for a transcript from the beginning: a finished one is kept beside it, the remains of one that was
    /// interrupted are not.
    pub fn set_aside(&self) -> Result<(), Failure> {
        let path = self.transcript();
        if path.exists() && Transcript::continue_from_start(&path)?.is_recorded_whole() {
            self.forget_what_was_set_aside()?;
            store::rename(&path, &self.aside())?;
        }
        Ok(store::remove_file(&path)?)
    }

    /// Removes the transcript that was set aside; what is none is somebody's.
    pub fn forget_what_was_set_aside(&self) -> Result<(), Failure> {
        let path = self.aside();
        let mut last = String::new();
        let read = |last: &mut String| store::each_event(&path, &mut |event| *last = event.kind);
        if store::is_taken(&path) && (read(&mut last).is_err() || last != store::SEALED) {
            let (expected, found) = ("no file, or a finished transcript that was set aside", "something else");
            return Err(StoreError::Foreign { path, expected, found }.into());
        }
        Ok(store::remove_file(&path)?)
    }

    /// The store of a recording's answers.
    pub fn recording(&self) -> PathBuf {
        self.dir.join("recording")
    }

    pub fn store(&self) -> PathBuf {
        self.dir.join("store")
    }

    /// Folders of questions to models of the kind `exchange`.
    pub fn exchanges(&self) -> PathBuf {
        self.dir.join("exchange")
    }

    /// Folders of questions of which programs, models of the kind `command`, try drafts.
    pub fn tries(&self) -> PathBuf {
        self.dir.join("tries")
    }

    /// Returns the file of what live models have used.
    #[cfg(feature = "live")]
    pub fn spend(&self) -> PathBuf {
        self.dir.join(SPEND)
    }

    pub fn report(&self) -> PathBuf {
        self.dir.join("report.html")
    }

    /// Returns the file of what it cost to make the run.
    pub fn cost(&self) -> PathBuf {
        self.dir.join("cost.json")
    }

    /// Returns the file of what patches of its reported programs account for.
    pub fn credit(&self) -> PathBuf {
        self.dir.join("credit.json")
    }

    /// Returns the file of the control of SafeBench's archives: the parents, drawn as often.
    pub fn redrawn(&self) -> PathBuf {
        self.dir.join("redrawn.json")
    }

    pub fn result(&self) -> PathBuf {
        self.dir.join("result.json")
    }

    fn card_file(&self) -> PathBuf {
        self.dir.join("run.json")
    }

    pub fn has_card(&self) -> bool {
        self.card_file().exists()
    }

    pub fn card(&self) -> Result<RunCard, Failure> {
        let path = self.card_file();
        let bytes = store::read_bounded(&path, CARD_BYTES_MAX)
            .map_err(|error| Failure::bad_input(format!("{} is not a run folder: {error}", self.dir.display())))?;
        let foreign = |error: String| {
            Failure::corruption(format!("{}: {error}; the file was not written by this program", path.display()))
        };
        let card: CardFile = serde_json::from_slice(&bytes).map_err(|error| foreign(error.to_string()))?;
        if card.format != CARD_FORMAT {
            return Err(Failure::bad_input(format!(
                "{}: format: expected {CARD_FORMAT}, found {}; use the version of evodrive that made the run",
                path.display(),
                card.format
            )));
        }
        card.try_into().map_err(foreign)
    }

    /// Writes `run.json`; `recording` is the recording that begins, if one does.
    pub fn write_card(&self, name: &str, recording: Option<&Recording>) -> Result<(), Failure> {
        let card = CardFile::from(RunCard { name: name.into(), recording: recording.cloned() });
        let text = serde_json::to_vec_pretty(&card).map_err(Failure::internal)?;
        Ok(store::write_atomic(&self.card_file(), &text)?)
    }

    /// Makes this the folder that commands take when none is named. Only a run that ended well is.
    pub fn mark_latest(&self) -> Result<(), Failure> {
        if let (Some(runs), Some(name)) = (self.dir.parent(), self.dir.file_name()) {
            let path = runs.join(LATEST);
            if store::is_taken(&path) && !names_a_run(&path) {
                progress(format!(
                    "{}: it names no run, so it stays as it is: `evodrive COMMAND RUN` names one",
                    path.display()
                ));
                return Ok(());
            }
            store::write_atomic(&path, name.to_string_lossy().as_bytes())?;
        }
        Ok(())
    }

    /// How a seed of the run's experiment was chosen. What is wrong with the file is for those to say who need more of it.
    fn seed_note(&self) -> Option<String> {
        composed(&self.experiment()).ok()?.seed_note().map(String::from)
    }

    /// The recorded run.
    pub fn recorded(&self) -> Result<RecordedRun, Failure> {
        self.recorded_on(None)
    }

    /// The same with threads that check its events.
    pub fn recorded_on(&self, threads: Option<&Threads>) -> Result<RecordedRun, Failure> {
        let path = self.transcript();
        if !path.exists() && self.result().exists() {
            let what = "expected the transcript of a finished run, whose result is there, found none";
            return Err(Failure::corruption(format!("{}: {what}; `evodrive resume` derives it again", path.display())));
        }
        if !path.exists() && self.has_card() {
            return Err(Failure::bad_input(format!(
                "{}: no run was carried out here yet, as after `evodrive plan`; `evodrive run` with the experiment's file does it",
                self.dir.display()
            )));
        }
        let mut reading = Reading::default();
        store::each_event_on(&path, threads, &mut |event| reading.add(event))?;
        let mut recorded = reading.finish().map_err(|error| match error {
            RecordedRunError::NotARun => Failure::corruption(format!(
                "{}: line 1: expected an `opened` event, found none: {error}; restore the file, or derive it again with `evodrive resume`",
                path.display()
            )),
            other => Failure::bad_input(format!("{}: {other}", path.display())),
        })?;
        // Other commands complain of an experiment that cannot be read.
        recorded.declared = self.read_experiment().map_or_else(
            |_| Declared::default(),
            |experiment| Declared {
                setting: setting::of(&experiment),
                answered: answered(&experiment),
                planner: experiment.driver.map(|driver| driver.name()),
                archive: Some(experiment.archive),
            },
        );
        recorded.seed_note = self.seed_note();
        Ok(recorded)
    }
}

/// Returns the provenance that an experiment states for its models, by their labels.
fn answered(experiment: &Experiment) -> BTreeMap<String, String> {
    let said = |(name, model): (&String, &ModelOptions)| Some((model.spec(name).label(), model.provenance.clone()?));
    experiment.models.iter().filter_map(said).collect()
}

/// Returns the name of one model's folder among such; a fresh recording, which has a name, asks in another one.
pub fn asked_in(model: &str, fresh: Option<&str>) -> String {
    match fresh {
        None => model.to_string(),
        Some(recording) => format!("{model}-fresh-{}", recording.chars().take(8).collect::<String>()),
    }
}

/// Makes a failure of an error in a file that a run folder keeps. The file was whole when it was written, so whatever
/// is wrong with it now is damage. If it is missing, another folder may have been meant.
fn kept(error: ExperimentError) -> Failure {
    let absent = matches!(&error, ExperimentError::Store(StoreError::Io { source, .. }) if source.kind() == std::io::ErrorKind::NotFound);
    let failure = Failure::from(error);
    if absent || failure.exit != Exit::BadInput {
        return failure;
    }
    let remedy =
        "it is the copy that the run folder keeps: restore it, or delete the folder and run the experiment again";
    Failure::corruption(format!("{}; {remedy}", failure.message))
}

/// Returns `true` if a file holds the name of a run folder and no more, as `mark_latest` writes it; the folder itself may be gone.
fn names_a_run(path: &Path) -> bool {
    let text = store::read_bounded(path, CARD_BYTES_MAX).ok().and_then(|bytes| String::from_utf8(bytes).ok());
    let name = text.as_deref().map_or("", str::trim);
    let digits = name.rsplit_once('-').map_or("", |(_, digits)| digits);
    let is_id = digits.len() == 8 && digits.bytes().all(|digit| digit.is_ascii_hexdigit()) && !name.contains('\n');
    is_id || !name.is_empty() && path.with_file_name(name).join("run.json").is_file()
}

/// Opens a store; says once if its disk lacks locks.
pub fn open_store(dir: &Path) -> Result<Store, StoreError> {
    Ok(announced(dir, Store::open(dir)?))
}

/// The same for who only looks at a finished run.
pub fn open_store_to_look(dir: &Path) -> Result<Store, StoreError> {
    Ok(announced(dir, Store::open_to_look(dir)?))
}

/// Says once that a store's disk lacks locks.
fn announced(dir: &Path, store: Store) -> Store {
    static TOLD: std::sync::Once = std::sync::Once::new();
    if store.opening().without_index_locks {
        TOLD.call_once(|| {
            progress(format!(
                "{}: this disk has no fcntl locks (mounts of NFS, Lustre and GPFS may have none): the index goes without them, and is made anew from \
                 the pack where it is damaged; one machine at a time may write here (docs/RUNS.md)",
                dir.display()
            ))
        });
    }
    store
}

/// Files of a folder with an ending, in order; none where there is no folder.
pub fn files(folder: &Path, ending: &str) -> Result<Vec<PathBuf>, Failure> {
    if !folder.exists() {
        return Ok(Vec::new());
    }
    Ok(store::list_files(folder, &[ending])?)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn card(text: &str) -> Result<RunCard, String> {
        serde_json::from_str::<CardFile>(text).map_err(|error| error.to_string())?.try_into()
    }

    #[test]
    fn a_card_comes_back_as_it_was_written() {
        let recording = Recording {
            cassette: "a.jsonl".into(),
            fresh: true,
            overwrite: false,
            rollouts: Some("b.jsonl".into()),
            driver_folder: None,
        };
        for recording in [Some(recording), None] {
            let written = RunCard { name: "mine".into(), recording };
            let text = serde_json::to_string(&CardFile::from(written.clone())).unwrap();
            assert_eq!(card(&text), Ok(written));
        }
    }

    #[test]
    fn cards_of_earlier_versions_are_read() {
        let of = |text: &str| card(text).unwrap().recording;
        assert_eq!(of(r#"{"format":"evodrive-run/1","name":"mine","recording":false}"#), None);
        let begun = of(r#"{"format":"evodrive-run/1","name":"mine","recording":true,"cassette":"a.jsonl"}"#).unwrap();
        assert_eq!((begun.cassette, begun.fresh), ("a.jsonl".into(), false));
    }

    #[test]
    fn a_recording_that_does_not_say_where_it_goes_is_refused() {
        let error = card(r#"{"format":"evodrive-run/1","name":"mine","recording":true}"#).unwrap_err();
        assert!(error.contains("`cassette`"), "{error}");
    }
}
