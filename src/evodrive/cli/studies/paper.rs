//! `paper`: carries out the runs that the plan names, makes every table, figure, claim and number of the paper from them, and compares
//! them with `golden/paper`, or writes them there.

use clap::Args;
use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use crate::cli::records::folder::RUNS;
use crate::cli::scenes::files::threads;
use crate::cli::studies::paper_runs::{How, Ran, carry_out};
use crate::cli::studies::paper_sheets::{Numbers, Sheet, files, named_numbers, read_numbers, sheet};
use crate::cli::studies::{claims, paper_pages};
use crate::cli::terminal::answer::Answer;
use crate::cli::terminal::exit::{Exit, Failure};
use crate::cli::terminal::output::Output;
use crate::evidence::RecordedRun;
use crate::evidence::claims::{csv as claims_csv, latex as claims_latex, markdown as claims_markdown};
use crate::evidence::paper::{
    Piece, Plan, Root, numbers, numbers_with, outdated, plan, roots, typed_numbers, unknown_numbers,
};
use crate::kernel::Digest;
use crate::store;
use crate::text::counted;

/// Bytes that a golden or a file of the paper may have.
const BYTES_MAX: u64 = 1 << 26;
/// Files that a full form makes beside its pieces.
const WHOLE: [&str; 6] = ["claims.md", "claims.csv", "claims.tex", "numbers.tex", "roots.tex", "provenance.toml"];

#[derive(Debug, Args)]
#[group(id = "what", required = true, multiple = true)]
pub struct Wanted {
    /// Rebuild everything, compare it with the goldens, look for numbers typed by hand in the text and, where LaTeX is
    /// installed, at its pages: none sideways, overfull or half empty, no missing font, no tiny letters in a figure.
    #[arg(long, conflicts_with_all = ["bless", "figure"])]
    pub check: bool,
    /// Rebuild everything and write it as the new goldens; say in the commit what moved and why. With --figure that piece alone, and where
    /// the root of one of its runs has moved, all pieces of that run; or the numbers of one other golden that the plan names.
    #[arg(long)]
    pub bless: bool,
    /// Build one table or figure, named by its label or file, and write it to --out, or with --bless to the goldens.
    #[arg(long, value_name = "LABEL")]
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

pub fn run(options: &Options, jobs: usize) -> Result<Answer, Failure> {
    let plan = read_plan(&options.paper)?;
    match (&options.wanted.figure, &options.out) {
        (Some(label), None) if options.wanted.bless => return blessed(&plan, label, options, jobs),
        (Some(label), Some(out)) if !options.wanted.bless => return one(&plan, label, out, options, jobs),
        (Some(_), _) => return Err(Failure::bad_input("--figure: expected --out FOLDER or --bless, one of the two")),
        (None, _) => {}
    }
    let wanted = plan.wanted(options.short);
    let ran = carry_out(&plan, &wanted, !options.short, &how(options, jobs))?;
    let made = make(&plan, &wanted, &ran, options, jobs)?;
    let folder = options.golden.join("paper");
    if options.wanted.bless {
        store::create_dir(&folder)?;
        for (name, bytes) in &made {
            store::write_atomic(&folder.join(name), bytes)?;
        }
        let text = format!("{} written to {}", counted(made.len(), "file"), folder.display());
        return Ok(Answer::new(text, json!({"written": made.keys().collect::<Vec<_>>()})));
    }
    check(&plan, &made, options)
}

fn how(options: &Options, jobs: usize) -> How<'_> {
    How { runs: &options.runs, as_recorded: options.as_recorded, jobs }
}

fn text_of(path: &Path) -> Result<String, Failure> {
    let bytes = store::read_bounded(path, BYTES_MAX)?;
    String::from_utf8(bytes).map_err(|_| Failure::bad_input(format!("{}: expected UTF-8 text", path.display())))
}

fn read_plan(paper: &Path) -> Result<Plan, Failure> {
    let path = paper.join("plan.toml");
    plan(&path.display().to_string(), &text_of(&path)?).map_err(Failure::bad_input)
}

fn make(plan: &Plan, wanted: &[&Piece], ran: &Ran, options: &Options, jobs: usize) -> Result<Made, Failure> {
    let (mut made, mut shown) = (Made::new(), Vec::new());
    let threads = threads(jobs)?;
    let sheets = threads.map(wanted, |_, piece| {
        let sheet = sheet(piece, ran, jobs)?;
        Ok::<_, Failure>((files(piece, &sheet)?, sheet))
    });
    for (piece, sheet) in wanted.iter().zip(sheets) {
        let (files, sheet) = sheet?;
        made.extend(files);
        if let Sheet::Table(table) = sheet {
            shown.push((piece.file.clone(), table));
        }
    }
    if options.short {
        return Ok(made);
    }
    let recorded_runs: Vec<RecordedRun> = ran.recorded_runs.values().cloned().collect();
    let judged = claims::judged(&options.paper.join("claims.toml"), &recorded_runs, &threads)?;
    // Tables that are goldens elsewhere: their numbers are macros like all others.
    let mut others = BTreeMap::new();
    for named in &plan.named {
        match named_numbers(named, ran, &options.golden)? {
            Numbers::Table(table) => shown.push((named.name.clone(), *table)),
            Numbers::Read(read) => others.extend(read),
        }
    }
    made.extend([
        ("claims.md".to_string(), claims_markdown(&judged).into_bytes()),
        ("claims.csv".to_string(), claims_csv(&judged).into_bytes()),
        ("claims.tex".to_string(), claims_latex(&judged).into_bytes()),
        ("numbers.tex".to_string(), numbers(&shown, Some(&judged), &others).into_bytes()),
    ]);
    let known = ran.recorded_runs.keys().map(|name| (name.clone(), rests_on(name, ran))).collect();
    made.insert("roots.tex".into(), roots_of(plan, &known).into_bytes());
    let provenance = provenance(wanted, &known, &made)?;
    made.insert("provenance.toml".into(), provenance.into_bytes());
    Ok(made)
}

/// Facts about runs, by their names in the plan.
type Known = BTreeMap<String, Value>;

/// The runs in the order of the plan.
fn roots_of(plan: &Plan, known: &Known) -> String {
    let root = |name: &String| {
        let of = |key: &str| known.get(name)?.get(key)?.as_str().map(String::from);
        Some(Root { experiment: of("experiment")?, root: of("root")?, cassette: of("cassette_digest")? })
    };
    roots(&plan.runs.iter().filter_map(|run| root(&run.name)).collect::<Vec<_>>())
}

/// Returns what each file was made from.
fn provenance(wanted: &[&Piece], known: &Known, made: &Made) -> Result<String, Failure> {
    let whole: BTreeMap<&str, String> =
        WHOLE.into_iter().filter_map(|name| Some((name, digest_of(made, name)?))).collect();
    let pieces: Vec<Value> = wanted.iter().map(|piece| made_from(piece, made)).collect();
    let all = json!({"run": known, "whole": whole, "piece": pieces});
    provenance_text(&all)
}

/// Returns what one run rests on.
fn rests_on(name: &str, ran: &Ran) -> Value {
    let (experiment, cassette) = ran.sources.get(name).cloned().unwrap_or_default();
    let Some(recorded) = ran.recorded_runs.get(name) else { return json!({"experiment": experiment}) };
    let opened = &recorded.opened;
    json!({
        "experiment": experiment,
        "experiment_digest": opened.experiment,
        "pool_digest": opened.pool,
        "cassette_digest": cassette,
        "root": recorded.root,
        "models": recorded.models(),
        "scripted_roles": recorded.scripted_roles(),
        "versions": opened.versions,
    })
}

fn digest_of(made: &Made, name: &str) -> Option<String> {
    made.get(name).map(|bytes| Digest::of_bytes(bytes).to_hex())
}

/// Returns what one piece was made from, and the digests of its files.
fn made_from(piece: &Piece, made: &Made) -> Value {
    let own: BTreeMap<&str, String> = ["md", "csv", "tex", "svg", "pdf"]
        .into_iter()
        .filter_map(|ending| Some((ending, digest_of(made, &format!("{}.{ending}", piece.file))?)))
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
}

/// A piece by its label or file; of several with the label the last, which is not the short form's.
fn named<'p>(plan: &'p Plan, label: &str) -> Result<&'p Piece, Failure> {
    let fits = |piece: &&Piece| piece.file == label || piece.label == label;
    plan.pieces.iter().rev().find(fits).ok_or_else(|| {
        let known: Vec<&str> = plan.pieces.iter().map(|piece| piece.file.as_str()).collect();
        let expected = "expected a label of the plan or one of its files";
        Failure::bad_input(format!("--figure {label}: {expected}: {}", known.join(", ")))
    })
}

/// The pieces to make with one, and their runs: where a run has another root than the goldens have of it, every piece of that run, so that
/// goldens of two roots never stand side by side. Also the names of the runs that moved.
fn with_moved<'p>(
    plan: &'p Plan,
    piece: &'p Piece,
    known: &toml::Table,
    how: &How<'_>,
) -> Result<(Vec<&'p Piece>, Ran, BTreeSet<String>), Failure> {
    let mut wanted = vec![piece];
    loop {
        let ran = carry_out(plan, &wanted, false, how)?;
        let root = |name: &str| known.get("run")?.get(name)?.get("root")?.as_str().map(String::from);
        let has_moved = |(name, recorded): (&String, &RecordedRun)| {
            root(name).is_some_and(|root| root != recorded.root.to_hex()).then(|| name.clone())
        };
        let moved: BTreeSet<String> = ran.recorded_runs.iter().filter_map(has_moved).collect();
        let rests = |other: &&Piece| other.runs.iter().any(|name| moved.contains(name));
        let more: Vec<&Piece> = plan.pieces.iter().filter(rests).filter(|other| !wanted.contains(other)).collect();
        if more.is_empty() {
            return Ok((wanted, ran, moved));
        }
        wanted.extend(more);
    }
}

/// Writes one piece as a golden, and what [`with_moved`] says goes with it: files, numbers, and their digests. The others stay. A piece or
/// run that the plan has got since is added, one that it lost is gone.
fn blessed(plan: &Plan, label: &str, options: &Options, jobs: usize) -> Result<Answer, Failure> {
    let folder = options.golden.join("paper");
    if let Some((name, file)) = plan.read_elsewhere().find(|(name, _)| *name == label) {
        return blessed_numbers(name, file, &folder, options);
    }
    let piece = named(plan, label)?;
    let damaged = |what: String| damaged(&folder, what);
    let mut known = known_provenance(&folder)?;
    let (wanted, ran, moved) = with_moved(plan, piece, &known, &how(options, jobs))?;
    let mut made = Made::new();
    for piece in &wanted {
        let sheet = sheet(piece, &ran, jobs)?;
        made.extend(files(piece, &sheet)?);
        if let Sheet::Table(table) = &sheet {
            let own = numbers(&[(piece.file.clone(), table.clone())], None, &BTreeMap::new());
            put_numbers(&mut made, &mut known, &folder, &piece.file, &own)?;
        }
    }
    for named in plan.named.iter().filter(|named| named.runs.iter().any(|name| moved.contains(name))) {
        let own = match named_numbers(named, &ran, &options.golden)? {
            Numbers::Table(table) => numbers(&[(named.name.clone(), *table)], None, &BTreeMap::new()),
            Numbers::Read(read) => numbers(&[], None, &read),
        };
        put_numbers(&mut made, &mut known, &folder, &named.name, &own)?;
    }
    let Some(pieces) = known.get_mut("piece").and_then(toml::Value::as_array_mut) else {
        return Err(damaged("has no pieces".into()));
    };
    let file = |of: &toml::Value| of.get("file").and_then(toml::Value::as_str).map(String::from);
    let place = |of: &toml::Value| plan.pieces.iter().position(|piece| Some(&piece.file) == file(of).as_ref());
    pieces.retain(|of| place(of).is_some() && !wanted.iter().any(|piece| Some(&piece.file) == file(of).as_ref()));
    for piece in &wanted {
        pieces.push(toml::Value::try_from(made_from(piece, &made)).map_err(Failure::internal)?);
    }
    // In the order of the plan, as when all are made anew.
    pieces.sort_by_key(place);
    put_runs(&mut made, &mut known, plan, &ran, &moved)?;
    let said = if moved.is_empty() {
        String::new()
    } else {
        format!(
            "; another root than the goldens had: {}, so all pieces of it are made; the claims still judge the older one (`evodrive paper --bless`)",
            moved.into_iter().collect::<Vec<_>>().join(", ")
        )
    };
    written(&piece.label, &said, made, &known, &folder)
}

/// Replaces the goldens' runs by those of these pieces: what they are, their lines among the roots, and which of them the
/// claims do not judge yet.
fn put_runs(
    made: &mut Made,
    known: &mut toml::Table,
    plan: &Plan,
    ran: &Ran,
    moved: &BTreeSet<String>,
) -> Result<(), Failure> {
    let mut all = Known::new();
    if let Some(runs) = known.get_mut("run").and_then(toml::Value::as_table_mut) {
        runs.retain(|name, _| plan.run(name).is_some());
        for name in ran.recorded_runs.keys() {
            runs.insert(name.clone(), toml::Value::try_from(rests_on(name, ran)).map_err(Failure::internal)?);
        }
        all = runs.iter().map(|(name, run)| (name.clone(), json!(run))).collect();
    }
    if !moved.is_empty() {
        let of = |table: &toml::Table| table.get("claims").and_then(toml::Value::as_array).cloned().unwrap_or_default();
        let before = known.get("older").and_then(toml::Value::as_table).map(of).unwrap_or_default();
        let names: BTreeSet<&str> =
            before.iter().filter_map(toml::Value::as_str).chain(moved.iter().map(String::as_str)).collect();
        known.insert("older".into(), toml::Value::try_from(json!({"claims": names})).map_err(Failure::internal)?);
    }
    let bytes = roots_of(plan, &all).into_bytes();
    if let Some(of) = known.get_mut("whole").and_then(toml::Value::as_table_mut) {
        of.insert("roots.tex".into(), digest_value(&bytes));
    }
    made.insert("roots.tex".into(), bytes);
    Ok(())
}

/// Writes the numbers of a golden of another check as macros; those of the runs stay.
fn blessed_numbers(name: &str, file: &str, folder: &Path, options: &Options) -> Result<Answer, Failure> {
    let (mut made, mut known) = (Made::new(), known_provenance(folder)?);
    let own = numbers(&[], None, &read_numbers(name, file, &options.golden)?);
    put_numbers(&mut made, &mut known, folder, name, &own)?;
    written(name, "", made, &known, folder)
}

/// Replaces the goldens' numbers of a table, and their digest.
fn put_numbers(made: &mut Made, known: &mut toml::Table, folder: &Path, name: &str, own: &str) -> Result<(), Failure> {
    let before = match made.get("numbers.tex") {
        Some(bytes) => String::from_utf8_lossy(bytes).into_owned(),
        None => text_of(&folder.join("numbers.tex"))?,
    };
    let bytes = numbers_with(&before, name, own).into_bytes();
    if let Some(of) = known.get_mut("whole").and_then(toml::Value::as_table_mut) {
        of.insert("numbers.tex".into(), digest_value(&bytes));
    }
    made.insert("numbers.tex".into(), bytes);
    Ok(())
}

/// Writes what was made of one label, and what all goldens are made from.
fn written(label: &str, said: &str, mut made: Made, known: &toml::Table, folder: &Path) -> Result<Answer, Failure> {
    made.insert("provenance.toml".into(), provenance_text(known)?.into_bytes());
    for (name, bytes) in &made {
        store::write_atomic(&folder.join(name), bytes)?;
    }
    let names: Vec<&String> = made.keys().collect();
    let text = format!("{label}: {} written to {}{said}", counted(made.len(), "file"), folder.display());
    Ok(Answer::new(text, json!({"label": label, "written": names})))
}

fn digest_value(bytes: &[u8]) -> toml::Value {
    toml::Value::String(Digest::of_bytes(bytes).to_hex())
}

fn provenance_place(folder: &Path) -> PathBuf {
    folder.join("provenance.toml")
}

fn damaged(folder: &Path, what: String) -> Failure {
    let whole = "make all goldens anew: `evodrive paper --bless`";
    Failure::bad_input(format!("{}: {what}; {whole}", provenance_place(folder).display()))
}

/// Reads what the goldens were made from.
fn known_provenance(folder: &Path) -> Result<toml::Table, Failure> {
    let text = text_of(&provenance_place(folder))?;
    text.parse().map_err(|error: toml::de::Error| damaged(folder, error.to_string()))
}

/// The file of what every golden was made from.
fn provenance_text(of: &impl serde::Serialize) -> Result<String, Failure> {
    let text = toml::to_string(of).map_err(Failure::internal)?;
    Ok(format!(
        "# Made by `evodrive paper --bless`: what every file of this folder was made from, and its digest.\n\n{text}"
    ))
}

/// One piece by its label or file.
fn one(plan: &Plan, label: &str, out: &Path, options: &Options, jobs: usize) -> Result<Answer, Failure> {
    let piece = named(plan, label)?;
    let ran = carry_out(plan, &[piece], false, &how(options, jobs))?;
    store::create_dir(out)?;
    let mut written = Vec::new();
    for (name, bytes) in files(piece, &sheet(piece, &ran, jobs)?)? {
        options.output.write(&out.join(&name), &bytes)?;
        written.push(out.join(name));
    }
    let names: Vec<String> = written.iter().map(|path| path.display().to_string()).collect();
    Ok(Answer::new(format!("{}: {}", piece.label, names.join(", ")), json!({"label": piece.label, "written": written})))
}

/// Checks what was made against the goldens, the text's typed numbers, and the pages that the text makes.
fn check(plan: &Plan, made: &Made, options: &Options) -> Result<Answer, Failure> {
    let (folder, text) = (options.golden.join("paper"), options.paper.join("evodrive.tex"));
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
    let written = text_of(&text)?;
    let known = match made.get("numbers.tex") {
        Some(bytes) => String::from_utf8_lossy(bytes).into_owned(),
        None => text_of(&folder.join("numbers.tex"))?,
    };
    for (name, file) in plan.read_elsewhere() {
        let own = numbers(&[], None, &read_numbers(name, file, &options.golden)?);
        let outdated = outdated(&known, name, &own);
        if let Some(first) = outdated.first() {
            let (place, count) = (options.golden.join(file), counted(outdated.len(), "number"));
            wrong.push(format!(
                "{}: golden/paper/numbers.tex has {count} of it otherwise, the first {first:?}; `evodrive paper --bless --figure {name}` \
                 takes them over",
                place.display()
            ));
        }
    }
    for unknown in unknown_numbers(&written, &known) {
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
    let seen = paper_pages::look(&options.paper, &options.golden)?;
    wrong.extend(seen.wrong);
    let shown = if wrong.is_empty() {
        format!(
            "{} files are as in {}; the text has no number typed by hand, and every number that it names exists; {}",
            made.len(),
            folder.display(),
            seen.about
        )
    } else {
        format!("{}\nif this is meant, run `evodrive paper --bless` and say why in the commit", wrong.join("\n"))
    };
    let exit = if wrong.is_empty() { Exit::Success } else { Exit::Divergence };
    Ok(Answer { exit, ..Answer::new(shown, json!({"checked": made.len(), "pages": seen.about, "wrong": wrong})) })
}
