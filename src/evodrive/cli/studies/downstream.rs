//! `downstream`: egos trained on scenes of the original and of the evolved generator, and how they drive.

use clap::Args;
use serde_json::json;
use std::path::{Path, PathBuf};

use crate::cli::scenes::files;
use crate::cli::studies::downstream_sets::{self, Sets};
use crate::cli::studies::downstream_train::{Study, references, trained};
use crate::cli::terminal::answer::{Answer, progress};
use crate::cli::terminal::output::Output;
use crate::cli::terminal::{exit::Failure, interrupt::Interrupt, shell::quoted};
use crate::draw::pdf;
use crate::evidence::downstream::{figure, page, table};
use crate::evidence::tables::{csv, markdown};
use crate::experiment::{DownstreamFile, ProgramFile};
use crate::kernel::Threads;
use crate::objects::Origin;
use crate::objects::downstream::{Downstream, FORMAT, Opening, Trained, Wanted};
use crate::store;

/// Bytes that a record may have, unpacked.
const RECORD_BYTES_MAX: u64 = 1 << 28;

#[derive(Debug, Args)]
pub struct Options {
    /// Study file, e.g. experiments/downstream/metadrive.toml.
    pub file: PathBuf,
    /// Train every arm with every seed and write the study's record; finished trainings are kept below --kept.
    #[arg(long)]
    pub record: bool,
    /// Train again what the record holds, and compare every number and the weights.
    #[arg(long, conflicts_with = "record")]
    pub retrain: bool,
    /// Only this arm, with --retrain.
    #[arg(long, requires = "retrain")]
    pub arm: Option<String>,
    /// Only this seed, with --retrain.
    #[arg(long, requires = "retrain")]
    pub seed: Option<u64>,
    /// Folder for the table (.md, .csv), the figure (.svg, .pdf) and both with what they rest on as a page (.html).
    #[arg(long)]
    pub out: Option<PathBuf>,
    /// Folder for finished trainings while a study is recorded.
    #[arg(long, default_value = "runs/downstream")]
    pub kept: PathBuf,
    /// Use the scene sets that the record names without planning them again: tables and figures within a second.
    #[arg(long, conflicts_with_all = ["record", "retrain"])]
    pub as_recorded: bool,
    #[command(flatten)]
    pub output: Output,
}

pub fn run(options: &Options, jobs: usize) -> Result<Answer, Failure> {
    let file = DownstreamFile::read(&options.file)?;
    let record = file.beside(&file.record);
    // Before the sets are planned: what is missing is said at once.
    let read = (!options.record).then(|| as_recorded(&options.file)).transpose()?;
    let threads = files::threads(jobs)?;
    let known = match read {
        Some(known) if options.as_recorded => known,
        Some(known) => compared(options, &file, known, &threads)?,
        None => recorded(options, &file, &record, &threads)?,
    };
    answer(options, &file, &known)
}

fn answer(options: &Options, file: &DownstreamFile, found: &Downstream) -> Result<Answer, Failure> {
    let table = table(found);
    let text = markdown(&table);
    if let Some(out) = &options.out {
        store::create_dir(out)?;
        let figure = figure(found);
        let named = |ending: &str| out.join(format!("{}.{ending}", file.name));
        options.output.write(&named("md"), text.as_bytes())?;
        options.output.write(&named("csv"), csv(&table).as_bytes())?;
        options.output.write(&named("svg"), figure.svg().as_bytes())?;
        options.output.write(&named("pdf"), &pdf(&figure).map_err(Failure::bad_input)?)?;
        options.output.write(&named("html"), page(found).as_bytes())?;
    }
    Ok(Answer::new(text, json!({"study": found.opening, "table": table.json()})))
}

/// The record of a study file, as it is.
pub fn as_recorded(file: &Path) -> Result<Downstream, Failure> {
    let study = DownstreamFile::read(file)?;
    let path = study.beside(&study.record);
    if !path.exists() {
        return Err(Failure::miss(format!(
            "{}: there is no record of this study\n  to train its egos and write one: {}",
            path.display(),
            recording(file)
        )));
    }
    let damaged = |what: String| Failure::corruption(format!("{}: {what}", path.display()));
    let bytes = store::read_text(&path, RECORD_BYTES_MAX)?
        .map_err(|(expected, found)| damaged(format!("expected {expected}, found {found}")))?;
    let text = String::from_utf8(bytes).map_err(|_| damaged("expected UTF-8 text".into()))?;
    Downstream::read(&text).map_err(|error| damaged(error.to_string()))
}

/// The command that records a study.
fn recording(file: &Path) -> String {
    format!("evodrive downstream {} --record", quoted(&file.to_string_lossy()))
}

/// Plans the sets of a study, and what stands first in its record.
fn opened(file: &DownstreamFile, threads: &Threads) -> Result<(Sets, Opening), Failure> {
    let program = file.generators()?;
    let sets = downstream_sets::fixed(file, &program, threads)?;
    let mut families: Vec<String> = Vec::new();
    for group in sets.fixed.training.iter().flat_map(|set| &set.groups) {
        if !families.contains(group) {
            families.push(group.clone());
        }
    }
    let opening = Opening {
        format: FORMAT.into(),
        name: file.name.clone(),
        describes: file.describes.clone(),
        recipe: file.recipe(&program, &sets.digests())?,
        program: program.digest,
        generator: generator(&program),
        proposals: program.origins.last().map(Origin::kinds).unwrap_or_default(),
        sets: sets.fixed.clone(),
        arms: file.arms.iter().map(|arm| (arm.name.clone(), arm.trains_on.clone())).collect(),
        seeds: file.seeds.clone(),
        updates: file.training.updates,
        plain_updates: file.training.plain_updates,
        families,
        references: references(&sets, threads)?,
    };
    Ok((sets, opening))
}

/// The evolved program's name, its run, and who proposed its patches.
fn generator(program: &ProgramFile) -> String {
    let runs: Vec<String> = program.origins.iter().map(Origin::short).collect();
    format!("{} of {}", program.program.solution_id, runs.join(", "))
}

fn recorded(options: &Options, file: &DownstreamFile, record: &Path, threads: &Threads) -> Result<Downstream, Failure> {
    let (sets, opening) = opened(file, threads)?;
    store::create_dir(&options.kept)?;
    // Before any ego learns: what the sets are stands fixed beside the trainings, and their names hold it.
    let fixed = options.kept.join(format!("{}-{}.json", file.name, opening.recipe.short(8)));
    options.output.write(&fixed, serde_json::to_string(&opening).map_err(Failure::internal)?.as_bytes())?;
    let interrupt = Interrupt::listen()?;
    let study =
        Study { file, opening: &opening, sets: &sets, kept: Some(options.kept.as_path()), interrupt: &interrupt };
    let wanted = opening.wanted();
    progress(format!("{}: {} trainings of {} updates", file.name, wanted.len(), opening.updates));
    let Some(trainings) = trained(&study, &wanted, threads)? else {
        return Err(Failure::interrupted(format!(
            "interrupted; finished trainings are kept in {}\n  to continue: the same command",
            options.kept.display()
        )));
    };
    let known = Downstream { opening: opening.clone(), trainings };
    store::write_text(record, known.to_text().map_err(Failure::internal)?.as_bytes())?;
    progress(format!("written: {}", record.display()));
    Ok(known)
}

/// Checks that the sets come out as they were fixed, and with --retrain that the trainings do.
fn compared(
    options: &Options,
    file: &DownstreamFile,
    found: Downstream,
    threads: &Threads,
) -> Result<Downstream, Failure> {
    let (sets, opening) = opened(file, threads)?;
    if let Some(what) = differs(&found.opening, &opening) {
        return Err(Failure::divergence(format!(
            "{}: the record is of another study: {what}\n  to record this one: {}",
            file.beside(&file.record).display(),
            recording(&options.file)
        )));
    }
    if options.retrain {
        let wanted: Vec<Wanted> = opening
            .wanted()
            .into_iter()
            .filter(|which| {
                options.arm.as_ref().is_none_or(|named| *named == which.arm)
                    && options.seed.is_none_or(|seed| seed == which.seed)
            })
            .collect();
        if wanted.is_empty() {
            let arms: Vec<&str> = file.arms.iter().map(|arm| arm.name.as_str()).collect();
            return Err(Failure::bad_input(format!(
                "there is no training of that arm and seed; arms are {}, seeds {:?}",
                arms.join(", "),
                file.seeds
            )));
        }
        let interrupt = Interrupt::listen()?;
        let study = Study { file, opening: &opening, sets: &sets, kept: None, interrupt: &interrupt };
        let again = trained(&study, &wanted, threads)?
            .ok_or_else(|| Failure::interrupted("interrupted; nothing was compared"))?;
        for new in &again {
            same(&found, new)?;
        }
        let came = match again.len() {
            1 => "1 training".to_string(),
            trainings => format!("all {trainings} trainings"),
        };
        progress(format!("{came} came out as recorded: the same weights, every scene the same"));
    }
    Ok(found)
}

/// The first thing in which two openings differ.
fn differs(recorded: &Opening, now: &Opening) -> Option<String> {
    let differs = |what: &str, a: String, b: String| Some(format!("{what} is {a} there and {b} now"));
    if recorded.program != now.program {
        return differs("the program file", recorded.program.short(16), now.program.short(16));
    }
    let sets = |of: &Opening| -> Vec<_> { of.sets.training.iter().chain(&of.sets.evaluation).cloned().collect() };
    let both = sets(recorded).into_iter().zip(sets(now));
    if let Some((then, now)) = both.into_iter().find(|(a, b)| a != b) {
        return differs(
            &format!("the digest of set {}", then.name.name()),
            then.digest.short(16),
            now.digest.short(16),
        );
    }
    if recorded.references != now.references {
        return Some("drivers that were not trained (IDM, the one that stands still) drive differently now".into());
    }
    if recorded != now {
        return differs("the recipe (arms, seeds, schedule or texts)", recorded.recipe.short(16), now.recipe.short(16));
    }
    None
}

fn same(found: &Downstream, new: &Trained) -> Result<(), Failure> {
    let name = new.which();
    let old = found.trainings.iter().find(|old| old.which() == name);
    let old = old.ok_or_else(|| Failure::internal(format!("{name} is not in a record that was read")))?;
    if let Some(place) = old.examinations.iter().zip(&new.examinations).position(|(a, b)| a != b) {
        let updates = new.examinations[place].updates;
        return Err(Failure::divergence(format!(
            "{name}: the examination after {updates} updates differs from the record"
        )));
    }
    if old != new {
        let (a, b) = (old.weights.short(16), new.weights.short(16));
        return Err(Failure::divergence(format!("{name}: the weights are {a} in the record and {b} now")));
    }
    Ok(())
}
