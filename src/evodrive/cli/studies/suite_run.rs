//! `suite run`: a driver in every scene of a suite, what that amounts to, and whether thresholds hold.

use clap::Args;
use serde_json::json;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use crate::backend::{DriverOptions, Header, RolloutCassette};
use crate::cli::records::folder::open_store;
use crate::cli::scenes::files;
use crate::cli::studies::suite_drive::{
    Answered, Driven, Kept, Recorded, Running, STAGED, drive_own, drive_planner, drive_recorded, driver_source,
    recording_beside,
};
use crate::cli::studies::suite_driver::TestDriver;
use crate::cli::studies::suite_file::answers_beside;
use crate::cli::studies::suite_freeze::Limits;
use crate::cli::studies::suite_stage::SuiteRunner;
use crate::cli::studies::{suite_failures, suite_file, suite_page, suite_text};
use crate::cli::terminal::answer::{Answer, progress};
use crate::cli::terminal::exit::{Exit, Failure};
use crate::cli::terminal::interrupt::Interrupt;
use crate::cli::terminal::output::Output;
use crate::cli::terminal::shell::quoted;
use crate::cli::terminal::width::table_width;
use crate::ego::Policy;
use crate::kernel::{Digest, Threads};
use crate::sim::SIM_VERSION;
use crate::store::{OwnDir, Scratch, StoreError};
use crate::suite::{
    Case, Frozen, Played, RESULT_FORMAT, Recording, RuleResult, Selected, Suite, SuiteMark, SuiteResult, Thresholds,
    Total, asked, check_thresholds, disagreements, junit, keeps, named, selection_of, totals,
};
use crate::text::{counted, nearest};

#[derive(Debug, Args)]
pub struct Options {
    /// Suite file.
    pub suite: PathBuf,
    /// Driver: idm, idm-lights, pdm, frenet, replay, standing, weights (.safetensors, .onnx), or a planner: a program,
    /// a .py file, or a .toml file with a table [driver] (docs/EGOS.md).
    #[arg(long, required_unless_present = "recorded")]
    pub driver: Option<String>,
    /// A result of a planner that is driven again from its recorded answers; no planner is started.
    #[arg(long, conflicts_with = "driver", value_name = "RESULT")]
    pub recorded: Option<PathBuf>,
    /// Longest time for a planner's decision, s, in place of its own limit.
    #[arg(long)]
    pub time_limit: Option<f64>,
    #[command(flatten)]
    pub selection: Selection,
    #[command(flatten)]
    pub limits: Limits,
    /// A result, in whose failed scenes alone the driver may fail.
    #[arg(long, value_name = "RESULT")]
    pub no_new_failures_against: Option<PathBuf>,
    /// Result to write (.json), with the planner's answers beside it; what a killed run answered is not asked again.
    #[arg(long)]
    pub out: Option<PathBuf>,
    /// A scene a line.
    #[arg(long)]
    pub csv: Option<PathBuf>,
    /// JUnit file for CI servers: a test case a scene, and one a threshold.
    #[arg(long)]
    pub junit: Option<PathBuf>,
    /// Page with the totals, the scenes, and a player for those that failed.
    #[arg(long)]
    pub html: Option<PathBuf>,
    #[command(flatten)]
    pub output: Output,
}

/// Which cases.
#[derive(Clone, Debug, Default, Args)]
pub struct Selection {
    /// Only cases of this family; may be repeated.
    #[arg(long)]
    pub family: Vec<String>,
    /// Only cases in this kind of place; may be repeated.
    #[arg(long)]
    pub cluster: Vec<String>,
    /// Only cases with this class of frozen contact, or none; may be repeated.
    #[arg(long)]
    pub class: Vec<String>,
    /// Only this case; may be repeated.
    #[arg(long)]
    pub case: Vec<String>,
}

impl Selection {
    /// As a result says it.
    pub fn marks(&self) -> Selected {
        let Selection { family, cluster, class, case } = self.clone();
        Selected { family, cluster, class, case }
    }

    /// The cases that are meant.
    pub fn of<'s>(&self, suite: &'s Suite) -> Result<Vec<&'s Case>, Failure> {
        type Names = fn(&Case) -> &str;
        let options: [(&str, &Vec<String>, Names); 4] = [
            ("family", &self.family, |case| &case.family),
            ("cluster", &self.cluster, |case| &case.cluster),
            ("class", &self.class, |case| case.class()),
            ("case", &self.case, |case| &case.id),
        ];
        for (option, words, name) in options {
            let known: BTreeSet<&str> = suite.cases.iter().map(name).collect();
            if let Some(word) = words.iter().find(|word| !known.contains(word.as_str())) {
                let near = nearest(word, known.iter().copied());
                let near = near.map_or(String::new(), |near| format!("; did you mean {near}?"));
                let known: Vec<&str> = known.into_iter().take(20).collect();
                return Err(Failure::bad_input(format!(
                    "--{option} {word}: no case of the suite has it, expected one of {}{near}",
                    known.join(", ")
                )));
            }
        }
        let marks = self.marks();
        let cases: Vec<&Case> = suite.cases.iter().filter(|case| keeps(&marks, case)).collect();
        if cases.is_empty() {
            Err(Failure::bad_input(
                "no case has all that was asked for; nothing was driven, and nothing can be said of a threshold",
            ))
        } else {
            Ok(cases)
        }
    }
}

pub fn run(options: &Options, jobs: usize) -> Result<Answer, Failure> {
    let asked = options.limits.thresholds()?;
    let frozen = suite_file::read_to_drive(&options.suite)?;
    let selection = &options.selection;
    selection.of(&frozen.suite)?;
    let baseline = options.no_new_failures_against.as_deref().map(suite_file::read_result).transpose()?;
    if let (Some(path), Some(baseline)) = (&options.no_new_failures_against, &baseline) {
        suite_file::is_whole(path, baseline, &frozen)?;
    }
    let thresholds = asked.or(&frozen.suite.thresholds);
    for path in [&options.csv, &options.junit, &options.html].into_iter().flatten() {
        // The same run may write the same files again.
        if !path.is_file() {
            options.output.may_be_made(path)?;
        }
    }
    let (threads, interrupt) = (files::threads(jobs)?, Interrupt::listen()?);
    let running = Running { threads: &threads, interrupt: &interrupt };
    let stage = SuiteRunner::new(&frozen.suite, &threads)?;
    let result = match (&options.recorded, &options.driver) {
        (Some(path), _) => again(&frozen, &stage, selection, path, &running)?,
        (None, Some(word)) => {
            let driver = TestDriver::named(word)?.within(options.time_limit)?;
            if let Some(out) = &options.out {
                free_for(out, &frozen, &driver, options.output)?;
            }
            fresh(&frozen, &stage, selection, &driver, options.out.as_deref(), &running)?
        }
        (None, None) => return Err(Failure::bad_input("name a driver with --driver, or a result with --recorded")),
    };
    finish(options, &frozen, &stage, &threads, result, &thresholds, baseline.as_ref())
}

/// Refuses a place that holds another driver's result before anything is driven; the same driver's is gone on with.
fn free_for(out: &Path, frozen: &Frozen, driver: &TestDriver, output: Output) -> Result<(), Failure> {
    let own = |before: SuiteResult| before.suite.digest == frozen.digest && before.driver == driver.mark();
    if out.is_file() && suite_file::read_result(out).is_ok_and(own) { Ok(()) } else { output.may_be_made(out) }
}

/// A result with the answers behind it.
pub struct Made {
    pub result: SuiteResult,
    pub answers: BTreeMap<usize, RolloutCassette>,
    /// The driver, to draw what it did.
    pub driver: TestDriver,
    /// Folder in which its answers waited, removed when they are written.
    recording: Option<OwnDir>,
}

/// Drives anew. A planner's answers wait beside `out` until all are there.
pub fn fresh(
    frozen: &Frozen,
    stage: &SuiteRunner<'_>,
    selection: &Selection,
    driver: &TestDriver,
    out: Option<&Path>,
    running: &Running<'_>,
) -> Result<Made, Failure> {
    let cases = &selection.of(&frozen.suite)?;
    let TestDriver::Planner(planner) = driver else {
        let driven = drive_own(stage, cases, driver, running)?;
        return Ok(made(frozen, driver.clone(), driven, None, selection.marks()));
    };
    let is_staged = |case: &&&Case| frozen.suite.pool.scene(&case.scene).is_some_and(|scene| scene.staging.is_some());
    match cases.iter().filter(is_staged).count() {
        0 => {}
        staged => progress(format!("{staged} of {} are {STAGED}", counted(cases.len(), "case"))),
    }
    let digest = planner.digest.ok_or_else(|| Failure::internal("a planner whose digest cannot be computed"))?;
    let (driven, recording) = match out {
        Some(out) => {
            let before = answers_of(out, stage.suite)?;
            own_answers(out, &before, planner, stage.suite)?;
            let folder = recording_beside(out);
            let recording = OwnDir::open(&folder, &format!("{} {digest}", frozen.digest))?;
            let store = open_store(&folder)?;
            (drive_planner(stage, cases, planner, Kept { store: &store, before }, running)?, Some(recording))
        }
        None => {
            let scratch = Scratch::under(&temporary(), "evodrive-suite-")?;
            let store = open_store(&scratch.dir)?;
            (drive_planner(stage, cases, planner, Kept { store: &store, before: BTreeMap::new() }, running)?, None)
        }
    };
    driven.compared.iter().for_each(progress);
    Ok(made(frozen, TestDriver::Recorded(driver.mark(), digest), driven, recording, selection.marks()))
}

/// Refuses files of answers beside a result that are not this planner's, nor those of the result that is there: their names were
/// derived, so that nobody has allowed them to be replaced.
fn own_answers(
    out: &Path,
    before: &BTreeMap<usize, RolloutCassette>,
    planner: &DriverOptions,
    suite: &Suite,
) -> Result<(), Failure> {
    let of_result = suite_file::read_result(out).map_or_else(|_| Vec::new(), |result| result.recordings);
    for (place, answers) in before {
        let path = answers_beside(out, *place);
        let is_named = of_result.iter().any(|of| path.file_name().is_some_and(|name| name == of.file.as_str()));
        let options = planner.backend(&suite.rules[*place]).map_err(Failure::internal)?;
        if !is_named && answers.backend != Header::of(&options) {
            let (expected, found) = ("no file, or recorded answers of this driver", "those of another one");
            return Err(StoreError::Foreign { path, expected, found }.into());
        }
    }
    Ok(())
}

#[allow(clippy::disallowed_methods)]
fn temporary() -> PathBuf {
    std::env::temp_dir()
}

/// Drives again from the answers beside a result, and holds the result to its seal, its suite and its answers.
pub fn again(
    frozen: &Frozen,
    stage: &SuiteRunner<'_>,
    selection: &Selection,
    path: &Path,
    running: &Running<'_>,
) -> Result<Made, Failure> {
    let before = suite_file::parse_result(path)?;
    suite_file::of_suite(path, &before, frozen)?;
    let due = asked(&before, &frozen.suite);
    // A result of a selection says nothing of the other cases: a user who names those is told so.
    let wanted = if selection.marks().is_all() { due.clone() } else { selection.of(&frozen.suite)? };
    let (cases, absent): (Vec<&Case>, Vec<&Case>) =
        wanted.iter().copied().partition(|case| before.case(&case.id).is_some());
    if cases.is_empty() {
        let place = path.display();
        return Err(Failure::bad_input(format!("{place} holds none of the selected cases; select others")));
    }
    let seal = suite_file::broken_seal(path, &before)?;
    let held = |wrong: Vec<String>| {
        if wrong.is_empty() {
            Ok(())
        } else {
            Err(suite_file::changed(path, [wrong, seal.map(String::from).into_iter().collect()].concat().join("; ")))
        }
    };
    let mut wrong = disagreements(&before, &frozen.suite, &due);
    if wrong.is_empty() && !absent.is_empty() {
        let ids: Vec<&str> = absent.iter().map(|case| case.id.as_str()).collect();
        wrong.push(format!("{} of {} selected cases are not in it: {}", ids.len(), wanted.len(), named(&ids)));
    }
    held(wrong)?;
    let (planner, answers) = answers_behind(path, &before, stage.suite)?;
    let recorded = Recorded::new(stage, planner, answers.clone())?;
    let unused = recorded.unused(stage, &due, &answers);
    let mut wrong = unlike(path, &before, planner, &answers);
    if !unused.is_empty() {
        wrong.push(format!("{} recorded answers belong to none of its cases, of {}", unused.len(), named(&unused)));
    }
    held(wrong)?;
    let known = |case: &Case| before.case(&case.id).map(|played| played.came.clone());
    let driven = drive_recorded(stage, &cases, &recorded, &known, running)?;
    let differs = |played: &Played| {
        let said = before.case(&played.case)?;
        let words = |of: &Played, what: &str| match what {
            "" => of.in_words(),
            "realism" => of.realism.map_or("none".into(), |realism| realism.to_string()),
            _ => of.why().unwrap_or_else(|| "none".into()),
        };
        // Results of older releases say neither realism nor reason.
        let what = match (&said.realism, &said.timeline) {
            _ if !played.came.is_as_said(&said.came) => "",
            (Some(_), _) if said.realism != played.realism => "realism",
            (_, Some(_)) if said.timeline != played.timeline => "why",
            _ => return None,
        };
        let [said, found] = [said, played].map(|of| words(of, what));
        Some(format!("case {}: it says {said:?}, its recorded answers come to {found:?}", played.case))
    };
    held(driven.iter().filter_map(differs).take(DIFFERENCES_MAX).collect())?;
    if let Some(broken) = seal {
        return Err(suite_file::changed(path, broken));
    }
    let marks = if selection.marks().is_all() { selection_of(&before) } else { selection.marks() };
    let driven = Driven { cases: driven, answers, compared: Vec::new() };
    Ok(made(frozen, TestDriver::Recorded(before.driver, planner), driven, None, marks))
}

/// Cases that a message names of those that come out differently.
const DIFFERENCES_MAX: usize = 5;

/// The planner behind a result, and its recorded answers: all that the result names.
fn answers_behind(path: &Path, result: &SuiteResult, suite: &Suite) -> Result<Answered, Failure> {
    let place = path.display();
    let Some((planner, answers)) = planner_of(path, suite)? else {
        return Err(Failure::miss(format!(
            "{place}: no recorded answers of a planner beside it ({}); the drivers that need none are named with --driver",
            answers_beside(path, 0).display()
        )));
    };
    match result.recordings.iter().find(|of| !answers.contains_key(&of.rules)) {
        None => Ok((planner, answers)),
        Some(of) => {
            let beside = answers_beside(path, of.rules);
            Err(Failure::miss(format!("{place}: its recorded answers are gone: {}; restore them", beside.display())))
        }
    }
}

/// Returns how recorded answers differ from what their result says.
fn unlike(
    path: &Path,
    result: &SuiteResult,
    planner: Digest,
    answers: &BTreeMap<usize, RolloutCassette>,
) -> Vec<String> {
    let mut wrong = Vec::new();
    for (rules, answers) in answers {
        let beside = answers_beside(path, *rules);
        match result.recordings.iter().find(|of| of.rules == *rules) {
            None => wrong.push(format!("it does not name {}", beside.display())),
            Some(of) if of.digest.is_some_and(|digest| digest != suite_file::answers_digest(answers, result)) => {
                wrong.push(suite_file::OTHER_ANSWERS.into());
            }
            Some(_) => {}
        }
    }
    let driver = Policy::Command(planner).digest();
    if driver != result.driver.digest {
        let (said, found) = (result.driver.digest.short(12), driver.short(12));
        wrong.push(format!("it is of the driver {said}, its recorded answers are of {found}"));
    }
    wrong
}

/// The files of answers beside a result.
fn answers_of(result: &Path, suite: &Suite) -> Result<BTreeMap<usize, RolloutCassette>, Failure> {
    let mut answers = BTreeMap::new();
    for rules in 0..suite.rules.len() {
        let path = answers_beside(result, rules);
        if path.is_file() {
            answers.insert(rules, RolloutCassette::load(&path)?);
        }
    }
    Ok(answers)
}

fn made(frozen: &Frozen, driver: TestDriver, driven: Driven, recording: Option<OwnDir>, selection: Selected) -> Made {
    let result = SuiteResult {
        format: RESULT_FORMAT.into(),
        suite: SuiteMark { name: frozen.suite.name.clone(), digest: frozen.digest },
        driver: driver.mark(),
        simulator: SIM_VERSION,
        selection: Some(selection),
        recordings: Vec::new(),
        seal: None,
        cases: driven.cases,
    };
    Made { result, answers: driven.answers, driver, recording }
}

/// Writes a result and its answers; a recording on the way is done.
pub fn write(made: &mut Made, out: &Path, output: Output) -> Result<(), Failure> {
    for (rules, answers) in &made.answers {
        let path = answers_beside(out, *rules);
        let bytes = answers.to_bytes(&made.result.suite.name);
        if let Some(name) = path.file_name() {
            let (file, digest) = (name.to_string_lossy().into_owned(), Some(Digest::of_bytes(&bytes)));
            made.result.recordings.push(Recording { rules: *rules, file, digest });
        }
        output.write(&path, &crate::store::packed(&path, &bytes)?)?;
    }
    suite_file::write_result(&made.result, out, output)?;
    Ok(made.recording.as_ref().map_or(Ok(()), OwnDir::remove)?)
}

/// Judges, writes what was asked for, and says it.
fn finish(
    options: &Options,
    frozen: &Frozen,
    stage: &SuiteRunner<'_>,
    threads: &Threads,
    mut made: Made,
    thresholds: &Thresholds,
    baseline: Option<&SuiteResult>,
) -> Result<Answer, Failure> {
    if let Some(out) = &options.out {
        write(&mut made, out, options.output)?;
    }
    let result = &made.result;
    let rules = check_thresholds(result, thresholds, baseline).map_err(Failure::bad_input)?;
    let totals = totals(result);
    let command = |played: &Played| play_command(options, result, &played.case);
    if let Some(path) = &options.csv {
        options.output.write(path, suite_text::csv(result).as_bytes())?;
    }
    if let Some(path) = &options.junit {
        options.output.write(path, junit(result, &rules, &command).as_bytes())?;
    }
    if let Some(path) = &options.html {
        let recorded;
        let source = match &made.driver {
            TestDriver::Recorded(_, planner) => {
                recorded = Recorded::new(stage, *planner, made.answers.clone())?;
                recorded.source()
            }
            driver => driver_source(stage, driver),
        };
        let page = suite_page::page(stage, &source, result, &totals, &rules, threads)?;
        options.output.write(path, page.as_bytes())?;
    }
    Ok(answer(frozen, result, &totals, &rules, &command))
}

/// The command that plays a case: from recorded answers where there are some, which need no planner.
fn play_command(options: &Options, result: &SuiteResult, case: &str) -> String {
    let suite = quoted(&options.suite.to_string_lossy());
    let kept = options.out.as_ref().filter(|_| !result.recordings.is_empty());
    let who = match options.recorded.as_ref().or(kept) {
        Some(recorded) => format!("--recorded {}", quoted(&recorded.to_string_lossy())),
        None => format!("--driver {}", quoted(options.driver.as_deref().unwrap_or_default())),
    };
    format!("evodrive suite play {suite} --case {} {who} --out play.html", quoted(case))
}

fn answer(
    frozen: &Frozen,
    result: &SuiteResult,
    totals: &[Total],
    rules: &[RuleResult],
    command: &dyn Fn(&Played) -> String,
) -> Answer {
    let broken = rules.iter().any(|rule| !rule.holds);
    let text = format!(
        "{} in {} ({}), {}\n{}\n{}\n{}\n{}{}{}{}",
        result.driver.name,
        frozen.suite.name,
        frozen.digest.short(12),
        suite_text::of_all(result.cases.len(), &frozen.suite),
        match suite_text::playable(totals) {
            line if line.is_empty() => line,
            line => line + "\n",
        },
        suite_text::table(totals, table_width()),
        suite_text::NOTE,
        suite_text::left_out(result, &frozen.suite),
        suite_text::not_driven(result),
        suite_failures::text(result, table_width(), command),
        suite_text::rules(rules, result, command)
    );
    let commands: BTreeMap<&str, String> = rules
        .iter()
        .filter(|rule| !rule.holds)
        .flat_map(|rule| &rule.scenes)
        .filter_map(|id| result.case(id))
        .map(|played| (played.case.as_str(), command(played)))
        .collect();
    let object = json!({
        "suite": result.suite, "driver": result.driver, "totals": totals, "rules": rules, "holds": !broken, "commands": commands,
        "failures": suite_failures::object(result), "cases": result.cases, "cases_of_suite": frozen.suite.cases.len(),
    });
    let exit = if broken { Exit::Broken } else { Exit::Success };
    Answer { exit, ..Answer::new(text, object) }
}

/// The digest by which a planner's recorded answers know it.
pub fn planner_of(result: &Path, suite: &Suite) -> Result<Option<Answered>, Failure> {
    let answers = answers_of(result, suite)?;
    let planner = answers.values().next().map(RolloutCassette::recorded_of);
    Ok(planner.map(|planner| (planner, answers)))
}
