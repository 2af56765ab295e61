//! `bundle`: a run as one file that travels.

use clap::{Args, Subcommand};
use serde_json::json;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use crate::adapters::ADAPTER_VERSION;
use crate::bundle::{self, About, BundleError, Manifest, Part, Signer, Source, Version};
use crate::cli::records::folder::{RunFolder, open_store_to_look};
use crate::cli::records::{bundle_replay, covered::coverage, run_name::OneRun};
use crate::cli::terminal::answer::Answer;
use crate::cli::terminal::exit::{Exit, Failure};
use crate::cli::terminal::output::Output;
use crate::evaluation::EVAL_VERSION;
use crate::experiment::Experiment;
use crate::sim::SIM_VERSION;
use crate::store::{self, Scratch, Store};

/// Bytes that a file with a key may have.
const KEY_BYTES_MAX: u64 = 1 << 14;

#[derive(Debug, Subcommand)]
pub enum Command {
    /// Write a finished run as one file.
    Create(CreateOptions),
    /// List what a bundle holds, and check every byte of it.
    Inspect(ReadOptions),
    /// Repeat a bundle's run from the bundle alone, and compare every event.
    Verify(VerifyOptions),
    /// Unpack a bundle as a run folder.
    Import(ImportOptions),
}

#[derive(Debug, Args)]
pub struct CreateOptions {
    #[command(flatten)]
    pub run: OneRun,
    /// The bundle, e.g. run.evodrive.
    #[arg(long)]
    pub out: PathBuf,
    #[command(flatten)]
    pub output: Output,
    /// Leave the recorded rollouts of the built-in simulator out: they can be simulated again.
    #[arg(long)]
    pub without_rollouts: bool,
    /// Private ed25519 key that signs the bundle (PKCS#8, PEM).
    #[arg(long)]
    pub sign: Option<PathBuf>,
    /// Day of publication for the RO-Crate metadata; nothing else in a bundle has a time.
    #[arg(long, default_value = "1970-01-01")]
    pub date: String,
    /// License of the run for the RO-Crate metadata: an address or a name.
    #[arg(long, default_value = "not stated")]
    pub license: String,
}

#[derive(Debug, Args)]
pub struct ReadOptions {
    /// The bundle.
    pub bundle: PathBuf,
    /// Largest unpacked size to accept, in bytes.
    #[arg(long, default_value_t = 16 << 30)]
    pub bytes_max: u64,
}

#[derive(Debug, Args)]
pub struct VerifyOptions {
    #[command(flatten)]
    pub read: ReadOptions,
    /// Public ed25519 key that must have signed the bundle (PEM).
    #[arg(long)]
    pub key: Option<PathBuf>,
    /// Only check the stored bytes against each other; run nothing.
    #[arg(long)]
    pub stored: bool,
    /// Folder for temporary files, instead of the system's.
    #[arg(long)]
    pub scratch: Option<PathBuf>,
}

#[derive(Debug, Args)]
pub struct ImportOptions {
    #[command(flatten)]
    pub read: ReadOptions,
    /// The run folder that is made; it must not exist.
    #[arg(long)]
    pub out: PathBuf,
}

pub fn run(command: &Command, jobs: usize) -> Result<Answer, Failure> {
    match command {
        Command::Create(options) => create(options),
        Command::Inspect(options) => inspect(options),
        Command::Verify(options) => bundle_replay::run(options, jobs),
        Command::Import(options) => import(options),
    }
}

impl From<BundleError> for Failure {
    fn from(error: BundleError) -> Failure {
        match error {
            BundleError::Store(store) => store.into(),
            BundleError::Damaged { .. } | BundleError::Signature { key: false, .. } => Failure::corruption(error),
            _ => Failure::bad_input(error),
        }
    }
}

/// The versions of meaning of this build.
pub fn versions() -> Version {
    let (adapter, sim, eval) = (ADAPTER_VERSION, SIM_VERSION, EVAL_VERSION);
    Version { evodrive: env!("CARGO_PKG_VERSION").into(), adapter, sim, eval }
}

fn create(options: &CreateOptions) -> Result<Answer, Failure> {
    let folder = options.run.folder()?;
    let signer = options
        .sign
        .as_deref()
        .map(|path| Signer::read(&path.display().to_string(), &key_text(path)?).map_err(Failure::from))
        .transpose()?;
    if options.date.len() < 10 || !options.date.starts_with(|c: char| c.is_ascii_digit()) {
        return Err(Failure::bad_input(format!("--date: expected a day as 2026-11-22, found {:?}", options.date)));
    }
    let run = folder.recorded()?;
    if run.result.is_none() || folder.card()?.recording.is_some() {
        let dir = folder.dir.display();
        return Err(Failure::bad_input(format!("{dir}: expected a finished run; `evodrive resume {dir}` finishes it")));
    }
    // A bundle speaks for its run, so what it holds must be what the run's events say.
    if let Some(damage) = coverage(&folder, &run, None, true).damage.into_iter().next() {
        return Err(Failure::corruption(damage));
    }
    options.output.may_be_made(&options.out)?;
    let objects = open_store_to_look(&folder.store())?;
    let known = crate::objects::event::Versions { adapter: ADAPTER_VERSION, sim: SIM_VERSION, eval: EVAL_VERSION };
    if run.opened.versions != known {
        return Err(Failure::bad_input(
            "the run was made by another version of evodrive; make the bundle with that one",
        ));
    }
    let about = About {
        name: run.opened.name.clone(),
        root: run.root,
        experiment: run.opened.experiment,
        pool: run.opened.pool,
        versions: versions(),
    };
    let published = [options.date.as_str(), options.license.as_str()];
    let parts = parts(&folder, (!options.without_rollouts).then_some(&objects));
    let manifest = bundle::create(&options.out, about, parts, published, signer.as_ref())?;
    Ok(made(&options.out, &manifest, signer.is_some(), false))
}

/// The files of a run that go into its bundle.
fn parts<'a>(folder: &RunFolder, objects: Option<&'a Store>) -> Vec<Part<'a>> {
    let files = [
        ("experiment.toml", folder.experiment()),
        ("scenes.pool", folder.pool()),
        ("cassette.jsonl", folder.cassette()),
        ("rollouts.jsonl", folder.rollouts()),
        ("transcript.jsonl", folder.transcript()),
        ("result.json", folder.result()),
    ];
    let there = files.into_iter().filter(|(_, file)| file.exists());
    let files = there.map(|(path, file)| Part { path, source: Source::File(file) });
    let records = objects.map(|store| Part { path: "store/objects.pack", source: Source::Records(store) });
    files.chain(records).collect()
}

/// The text of a file with a key.
pub fn key_text(path: &Path) -> Result<String, Failure> {
    Ok(String::from_utf8_lossy(&store::read_bounded(path, KEY_BYTES_MAX)?).into_owned())
}

fn inspect(options: &ReadOptions) -> Result<Answer, Failure> {
    let opened = bundle::open(&options.bundle, options.bytes_max, None)?;
    let (manifest, signed) = (&opened.manifest, opened.signature.is_some());
    let whole = format!("whole: {}: every byte is as its manifest says\n", options.bundle.display());
    let answer = made(&options.bundle, manifest, signed, true);
    Ok(Answer { text: whole + &answer.text, ..answer })
}

/// Fields that inspection takes from the manifest alone, on the word of whoever wrote it.
const UNVERIFIED: [&str; 5] = ["name", "root", "experiment", "pool", "versions"];

/// Describes what a bundle holds; `alone` if only its manifest speaks for the run that it is of.
fn made(path: &Path, manifest: &Manifest, signed: bool, alone: bool) -> Answer {
    let Version { evodrive, adapter, sim, eval } = &manifest.versions;
    let signature = if signed { "present; `evodrive bundle verify --key` checks it" } else { "none" };
    let unverified = if alone { " (unverified: its manifest says so)" } else { "" };
    let mut text = format!(
        "{}: run of {}, made by evodrive {evodrive} (adapter {adapter}, simulator {sim}, evaluation {eval}){unverified}\n",
        path.display(),
        manifest.name
    );
    for file in &manifest.files {
        let _ = writeln!(text, "{:>12} bytes  {}  {}", file.bytes, file.digest.short(16), file.path);
    }
    if alone {
        text.push_str("unverified: the root below, too; `evodrive bundle verify` repeats the run and derives it\n");
    }
    let _ = write!(text, "signature: {signature}\nroot: {}", manifest.root);
    let mut object = json!({"bundle": path, "manifest": manifest, "signed": signed});
    if alone {
        object["unverified"] = json!(UNVERIFIED);
    }
    Answer::new(text, object)
}

fn import(options: &ImportOptions) -> Result<Answer, Failure> {
    let (opened, folder) = unpack(&options.read, &options.out)?;
    let shown = folder.dir.display();
    let text = format!(
        "{}: run of {} in {shown}; next: evodrive verify {shown}, evodrive report {shown}\nroot: {}",
        options.read.bundle.display(),
        opened.manifest.name,
        opened.manifest.root
    );
    Ok(Answer::new(text, json!({"folder": folder.dir, "manifest": opened.manifest})))
}

/// Unpacks a bundle as a run folder, which is there whole or not at all.
pub fn unpack(read: &ReadOptions, out: &Path) -> Result<(bundle::Opened, RunFolder), Failure> {
    if store::is_taken(out) {
        return Err(Failure::bad_input(format!("{}: expected no file or folder yet, found one", out.display())));
    }
    let scratch = Scratch::beside(out)?;
    let folder = RunFolder { dir: scratch.dir.join("run") };
    let opened = bundle::open(&read.bundle, read.bytes_max, Some(&folder.dir))?;
    agrees(&opened.manifest, &folder, &read.bundle)?;
    store::rename(&folder.dir, out)?;
    Ok((opened, RunFolder { dir: out.to_path_buf() }))
}

/// Checks that the files are those of the run that the manifest speaks of; gives the folder its card.
fn agrees(manifest: &Manifest, folder: &RunFolder, bundle: &Path) -> Result<(), Failure> {
    let name = Experiment::read(&folder.experiment())?.name;
    let run = folder.recorded()?;
    let said = [manifest.root, manifest.experiment, manifest.pool];
    let inside = [run.root, run.opened.experiment, run.opened.pool];
    if let Some(place) = said.iter().zip(&inside).position(|(said, inside)| said != inside) {
        let what = ["root", "experiment", "pool"][place];
        return Err(Failure::corruption(format!(
            "{}: {what}: the manifest says {}, the events inside say {}; `evodrive bundle create` did not make this bundle",
            bundle.display(),
            said[place],
            inside[place]
        )));
    }
    let Version { adapter, sim, eval, .. } = manifest.versions;
    let versions = crate::objects::event::Versions { adapter, sim, eval };
    let others = [
        ("name", manifest.name.clone(), run.opened.name.clone()),
        ("versions", format!("{versions:?}"), format!("{:?}", run.opened.versions)),
    ];
    if let Some((what, said, inside)) = others.iter().find(|(_, said, inside)| said != inside) {
        return Err(Failure::corruption(format!(
            "{}: {what}: the manifest says {said}, the events inside say {inside}; the bundle was put together by something else",
            bundle.display()
        )));
    }
    store::create_dir(&folder.store())?;
    folder.write_card(&name, None)
}

/// Checks that this build can execute what a bundle holds.
pub fn check_versions(manifest: &Manifest, bundle: &Path) -> Result<(), Failure> {
    let (this, that) = (versions(), &manifest.versions);
    if (this.adapter, this.sim, this.eval) == (that.adapter, that.sim, that.eval) {
        return Ok(());
    }
    Err(Failure::bad_input(format!(
        "{}: made with adapter version {}, simulator version {}, evaluation version {}; this build has {}, {}, {} and would get other numbers. \
         Verify it with evodrive {}, or `--stored` to hold the stored bytes against each other",
        bundle.display(),
        that.adapter,
        that.sim,
        that.eval,
        this.adapter,
        this.sim,
        this.eval,
        that.evodrive
    )))
}

/// Findings of stored bytes end a command with this.
pub fn exit_of(clean: bool) -> Exit {
    if clean { Exit::Success } else { Exit::Corruption }
}
