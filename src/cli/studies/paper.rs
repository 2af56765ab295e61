//! `paper`: carries out the runs that the plan names, makes every table, figure, claim and number of the paper from them, and compares
//! them with `golden/paper`, or writes them there.

use clap::{Args, ValueEnum};
use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use crate::cli::evolve::job_args::{JobArgs, RecordArgs, RunArgs};
use crate::cli::evolve::run::{self, Job};
use crate::cli::look::table::Which as WhichTable;
use crate::cli::look::{credit, figure};
use crate::cli::records::folder::{RUNS, RunFolder};
use crate::cli::scenes::files::threads;
use crate::cli::studies::{claims, downstream};
use crate::cli::terminal::answer::{Answer, progress};
use crate::cli::terminal::exit::{Exit, Failure};
use crate::cli::terminal::output::Output;
use crate::cli::terminal::timed;
use crate::draw::{Figure, pdf};
use crate::evidence::RecordedRun;
use crate::evidence::claims::{csv as claims_csv, latex as claims_latex, markdown as claims_markdown};
use crate::evidence::credit_table::credits as credits_table;
use crate::evidence::downstream as evidence_downstream;
use crate::evidence::paper::{Piece, Plan, What, numbers, of_agreement, plan, typed_numbers, unknown_numbers};
use crate::evidence::tables::{self, Table};
use crate::experiment::is_scripted;
use crate::kernel::Digest;
use crate::store;
use crate::text::counted;

/// Bytes that a golden or a file of the paper may have.
const BYTES_MAX: u64 = 1 << 26;
/// What stands in the place of a cassette's digest where answers are made anew.
const NOT_KEPT: &str = "none is kept: the scripted model answers again";
/// What a full form makes beside its pieces.
const WHOLE: [&str; 5] = ["claims.md", "claims.csv", "claims.tex", "numbers.tex", "provenance.toml"];

#[derive(Debug, Args)]
#[group(id = "what", required = true, multiple = false)]
pub struct Wanted {
    /// Rebuild everything, compare it with the goldens, and look for numbers typed by hand in the text.
    #[arg(long)]
    pub check: bool,
    /// Rebuild everything and write it as the new goldens; say in the commit what moved and why.
    #[arg(long)]
    pub bless: bool,
    /// Build one table or figure, named by its label or file, and write it to --out.
    #[arg(long, value_name = "LABEL", requires = "out")]
    pub figure: Option<String>,
}

#[derive(Debug, Args)]
pub struct Options {
    #[command(flatten)]
    pub wanted: Wanted,
    /// Only the pieces that come from short runs (the quickstart); with --bless the other goldens stay as they are.
    #[arg(long)]
    pub short: bool,
    /// Use the finished runs below --runs as they are; without it each is repeated from its recorded answers and
    /// rollouts.
    #[arg(long)]
    pub as_recorded: bool,
    /// Folder for run folders.
    #[arg(long, default_value = RUNS)]
    pub runs: PathBuf,
    /// Folder of the plan, the claims and the text.
    #[arg(long, default_value = "paper")]
    pub paper: PathBuf,
    /// Folder of the goldens.
    #[arg(long, default_value = "golden")]
    pub golden: PathBuf,
    /// Folder for the files of --figure.
    #[arg(long)]
    pub out: Option<PathBuf>,
    #[command(flatten)]
    pub output: Output,
}

/// Files by their name in the goldens' folder.
type Made = BTreeMap<String, Vec<u8>>;

/// The runs that are needed, and what they rest on.
struct Ran {
    recorded_runs: BTreeMap<String, RecordedRun>,
    folders: BTreeMap<String, RunFolder>,
    /// Experiment file, and digest of its cassette, or that none is kept.
    sources: BTreeMap<String, (String, String)>,
}

pub fn run(options: &Options, jobs: usize) -> Result<Answer, Failure> {
    let plan = read_plan(&options.paper)?;
    if let (Some(label), Some(out)) = (&options.wanted.figure, &options.out) {
        return one(&plan, label, out, options, jobs);
    }
    let wanted = plan.wanted(options.short);
    let ran = carry_out(&plan, &wanted, !options.short, options, jobs)?;
    let made = make(&wanted, &ran, options, jobs)?;
    let folder = options.golden.join("paper");
    if options.wanted.bless {
        store::create_dir(&folder)?;
        for (name, bytes) in &made {
            store::write_atomic(&folder.join(name), bytes)?;
        }
        let text = format!("{} written to {}", counted(made.len(), "file"), folder.display());
        return Ok(Answer::new(text, json!({"written": made.keys().collect::<Vec<_>>()})));
    }
    check(&made, &folder, &options.paper.join("evodrive.tex"))
}

fn text_of(path: &Path) -> Result<String, Failure> {
    let bytes = store::read_bounded(path, BYTES_MAX)?;
    String::from_utf8(bytes).map_err(|_| Failure::bad_input(format!("{}: expected UTF-8 text", path.display())))
}

fn read_plan(paper: &Path) -> Result<Plan, Failure> {
    let path = paper.join("plan.toml");
    plan(&path.display().to_string(), &text_of(&path)?).map_err(Failure::bad_input)
}

/// The runs of these pieces, and of the claims where `claims` are wanted.
fn carry_out(plan: &Plan, wanted: &[&Piece], all: bool, options: &Options, jobs: usize) -> Result<Ran, Failure> {
    let named: BTreeSet<&str> = wanted.iter().flat_map(|piece| &piece.runs).map(String::as_str).collect();
    let mut ran = Ran { recorded_runs: BTreeMap::new(), folders: BTreeMap::new(), sources: BTreeMap::new() };
    let needed = plan.runs.iter().filter(|run| all || named.contains(run.name.as_str()));
    for planned in needed {
        let job = JobArgs {
            experiment: PathBuf::from(&planned.experiment),
            out: options.runs.clone(),
            cassette: None,
            scenes: Vec::new(),
            set: Vec::new(),
        };
        let made = Job::new(&job, jobs)?;
        let folder =
            RunFolder::of(&options.runs, &made.experiment.name, made.experiment.digest()?, made.scenes.digest())?;
        let cassette = made.cassette(&job);
        let is_kept = cassette.exists() || !is_scripted(&made.experiment);
        let cassette = if is_kept { store::digest_of_file(&cassette, 1 << 30)?.to_hex() } else { NOT_KEPT.into() };
        if !options.as_recorded {
            progress(format!("paper: run {} of {}", planned.name, planned.experiment));
            let (done, took) = timed::timed(|| match is_kept {
                true => run::run(&RunArgs { job, no_report: true }, jobs),
                false => recorded(job, folder.cassette_beside(), jobs),
            });
            done?;
            progress(format!("paper: {} took {:.0} s", planned.name, took.as_secs_f64()));
        }
        ran.recorded_runs.insert(planned.name.clone(), folder.recorded()?);
        ran.folders.insert(planned.name.clone(), folder);
        ran.sources.insert(planned.name.clone(), (planned.experiment.clone(), cassette));
    }
    Ok(ran)
}

/// Carries a run out whose answers nobody keeps, because the scripted model gives them again.
fn recorded(job: JobArgs, cassette: PathBuf, jobs: usize) -> Result<Answer, Failure> {
    let job = JobArgs { cassette: Some(cassette), ..job };
    let args = RecordArgs { run: RunArgs { job, no_report: true }, fresh: false, overwrite: true, open: None };
    run::record(&args, jobs)
}

impl Ran {
    fn of(&self, piece: &Piece) -> Vec<RecordedRun> {
        piece.runs.iter().filter_map(|name| self.recorded_runs.get(name)).cloned().collect()
    }

    fn shown(&self, piece: &Piece) -> Vec<figure::FolderAndRun> {
        let shown = |name: &String| Some((self.folders.get(name)?.clone(), self.recorded_runs.get(name)?.clone()));
        piece.runs.iter().filter_map(shown).collect()
    }
}

/// A piece's table or figure.
enum Sheet {
    Table(Table),
    Figure(Figure),
}

fn sheet(piece: &Piece, ran: &Ran, jobs: usize) -> Result<Sheet, Failure> {
    Ok(match piece.what() {
        What::Credit => {
            let (Some((folder, run)), threads) = (ran.shown(piece).pop(), threads(jobs)?) else {
                return Err(Failure::internal(format!("piece {}: its run was not carried out", piece.file)));
            };
            let credits = credit::of_reported(&folder, &run, &threads)?;
            Sheet::Table(credits_table(&run, &credits).map_err(Failure::bad_input)?)
        }
        What::Table(name) => {
            let which = WhichTable::named(&name).map_err(Failure::bad_input)?;
            Sheet::Table(which.of(&ran.of(piece)).map_err(Failure::bad_input)?)
        }
        What::Downstream { is_table } => {
            let study = piece.study.as_deref().map(Path::new).unwrap_or(Path::new(""));
            let record = downstream::as_recorded(study)?;
            match is_table {
                true => Sheet::Table(evidence_downstream::table(&record)),
                false => Sheet::Figure(evidence_downstream::figure(&record)),
            }
        }
        What::Figure(name) => {
            let which = figure::Which::from_str(&name, false).map_err(|_| {
                Failure::bad_input(format!(
                    "piece {}: no figure `{name}`; `evodrive figure --help` lists them",
                    piece.file
                ))
            })?;
            Sheet::Figure(which.of(&ran.shown(piece), piece.lineage.as_deref(), jobs)?)
        }
    })
}

fn files(piece: &Piece, sheet: &Sheet) -> Vec<(String, Vec<u8>)> {
    let named = |ending: &str| format!("{}.{ending}", piece.file);
    match sheet {
        Sheet::Table(table) => vec![
            (named("md"), tables::markdown(table).into_bytes()),
            (named("csv"), tables::csv(table).into_bytes()),
            (named("tex"), tables::latex(table).into_bytes()),
        ],
        Sheet::Figure(figure) => vec![(named("svg"), figure.svg().into_bytes()), (named("pdf"), pdf(figure))],
    }
}

fn make(wanted: &[&Piece], ran: &Ran, options: &Options, jobs: usize) -> Result<Made, Failure> {
    let (mut made, mut shown) = (Made::new(), Vec::new());
    for piece in wanted {
        let sheet = sheet(piece, ran, jobs)?;
        made.extend(files(piece, &sheet));
        if let Sheet::Table(table) = sheet {
            // Its short form has the name of the whole one's table.
            shown.extend((!piece.file.starts_with("quickstart-")).then_some(table));
        }
    }
    if options.short {
        return Ok(made);
    }
    let recorded_runs: Vec<RecordedRun> = ran.recorded_runs.values().cloned().collect();
    let judged = claims::judged(&options.paper.join("claims.toml"), &recorded_runs)?;
    // The sets' own tables are goldens elsewhere; their numbers are macros like all others.
    for (runs, names) in [
        (["metadrive", "metadrive-sac"], ["metadrive-main", "proposals"].as_slice()),
        (["safebench", "safebench-sac"], ["safebench-main", "safebench-held-out"].as_slice()),
    ] {
        for name in names {
            let which = WhichTable::named(name).map_err(Failure::bad_input)?;
            let own: Vec<RecordedRun> = runs.iter().filter_map(|run| ran.recorded_runs.get(*run)).cloned().collect();
            shown.push(which.of(&own).map_err(Failure::bad_input)?);
        }
    }
    let agreement = options.golden.join("agreement").join("agreement.md");
    let others = if agreement.exists() { of_agreement(&text_of(&agreement)?) } else { BTreeMap::new() };
    made.extend([
        ("claims.md".to_string(), claims_markdown(&judged).into_bytes()),
        ("claims.csv".to_string(), claims_csv(&judged).into_bytes()),
        ("claims.tex".to_string(), claims_latex(&judged).into_bytes()),
        ("numbers.tex".to_string(), numbers(&shown, Some(&judged), &others).into_bytes()),
    ]);
    let provenance = provenance(wanted, ran, &made)?;
    made.insert("provenance.toml".into(), provenance.into_bytes());
    Ok(made)
}

/// What each file was made from.
fn provenance(wanted: &[&Piece], ran: &Ran, made: &Made) -> Result<String, Failure> {
    let runs: BTreeMap<&String, Value> = ran
        .recorded_runs
        .iter()
        .map(|(name, recorded)| {
            let (experiment, cassette) = ran.sources.get(name).cloned().unwrap_or_default();
            let opened = &recorded.opened;
            let object = json!({
                "experiment": experiment,
                "experiment_digest": opened.experiment,
                "pool_digest": opened.pool,
                "cassette_digest": cassette,
                "root": recorded.root,
                "models": opened.models,
                "scripted_roles": opened.scripted_roles(),
                "versions": opened.versions,
            });
            (name, object)
        })
        .collect();
    let digest = |name: &str| made.get(name).map(|bytes| Digest::of_bytes(bytes).to_hex());
    let piece = |piece: &&Piece| {
        let own: BTreeMap<&str, String> = ["md", "csv", "tex", "svg", "pdf"]
            .into_iter()
            .filter_map(|ending| Some((ending, digest(&format!("{}.{ending}", piece.file))?)))
            .collect();
        let mut object = json!({
            "file": piece.file,
            "label": piece.label,
            "runs": piece.runs,
            "command": format!("evodrive paper --figure {} --out OUT", piece.file),
            "digests": own,
        });
        if let Some(study) = &piece.study {
            object["study"] = json!(study);
        }
        object
    };
    let whole: BTreeMap<&str, String> = WHOLE.into_iter().filter_map(|name| Some((name, digest(name)?))).collect();
    let pieces: Vec<Value> = wanted.iter().map(piece).collect();
    let all = json!({"run": runs, "whole": whole, "piece": pieces});
    let text = toml::to_string(&all).map_err(Failure::internal)?;
    Ok(format!(
        "# Made by `evodrive paper --bless`: what every file of this folder was made from, and its digest.\n\n{text}"
    ))
}

/// One piece by its label or file; of several with the label the last, which is not the short form's.
fn one(plan: &Plan, label: &str, out: &Path, options: &Options, jobs: usize) -> Result<Answer, Failure> {
    let fits = |piece: &&Piece| piece.file == label || piece.label == label;
    let Some(piece) = plan.pieces.iter().rev().find(fits) else {
        let known: Vec<&str> = plan.pieces.iter().map(|piece| piece.file.as_str()).collect();
        let expected = "expected a label of the plan or one of its files";
        return Err(Failure::bad_input(format!("--figure {label}: {expected}: {}", known.join(", "))));
    };
    let ran = carry_out(plan, &[piece], false, options, jobs)?;
    store::create_dir(out)?;
    let mut written = Vec::new();
    for (name, bytes) in files(piece, &sheet(piece, &ran, jobs)?) {
        options.output.write(&out.join(&name), &bytes)?;
        written.push(out.join(name));
    }
    let names: Vec<String> = written.iter().map(|path| path.display().to_string()).collect();
    Ok(Answer::new(format!("{}: {}", piece.label, names.join(", ")), json!({"label": piece.label, "written": written})))
}

/// What was made against what stands in the goldens, and the text's typed numbers.
fn check(made: &Made, folder: &Path, text: &Path) -> Result<Answer, Failure> {
    let mut wrong = Vec::new();
    for (name, bytes) in made {
        let path = folder.join(name);
        let there = if path.exists() { Some(store::read_bounded(&path, BYTES_MAX)?) } else { None };
        match there {
            None => wrong.push(format!("{} is missing", path.display())),
            Some(there) if there != *bytes => wrong.push(format!("{} came out differently", path.display())),
            Some(_) => {}
        }
    }
    let written = text_of(text)?;
    let numbers = match made.get("numbers.tex") {
        Some(bytes) => String::from_utf8_lossy(bytes).into_owned(),
        None => text_of(&folder.join("numbers.tex"))?,
    };
    for unknown in unknown_numbers(&written, &numbers) {
        let place = format!("{}: line {}", text.display(), unknown.line);
        wrong.push(format!(
            "{place}: golden/paper/numbers.tex has no number {:?}; expected one of those in it",
            unknown.text
        ));
    }
    for typed in typed_numbers(&written) {
        let remedy = "take it from golden/paper/numbers.tex with \\evo{...}";
        wrong.push(format!(
            "{}: line {}: a number typed by hand near {:?}; {remedy}",
            text.display(),
            typed.line,
            typed.text
        ));
    }
    let shown = match wrong.is_empty() {
        true => format!(
            "{} files are as in {}; the text has no number typed by hand, and every number that it names exists",
            made.len(),
            folder.display()
        ),
        false => {
            format!("{}\nif this is meant, run `evodrive paper --bless` and say why in the commit", wrong.join("\n"))
        }
    };
    let exit = if wrong.is_empty() { Exit::Success } else { Exit::Divergence };
    Ok(Answer { exit, ..Answer::new(shown, json!({"checked": made.len(), "wrong": wrong})) })
}
