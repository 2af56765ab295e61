//! `suite compare`: results in one suite beside each other.

use clap::Args;
use serde_json::json;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use crate::cli::studies::suite_text::mean;
use crate::cli::studies::{suite_beside, suite_file};
use crate::cli::terminal::output::{Output, by_ending};
use crate::cli::terminal::shell::quoted;
use crate::cli::terminal::width::table_width;
use crate::cli::terminal::{answer::Answer, exit::Failure};
use crate::evidence::aligned::Aligned;
use crate::kernel::num;
use crate::suite::{Compared, Discordant, SuiteResult, compared};
use crate::text::counted;

/// Scenes that a list names before it counts.
const LISTED_MAX: usize = 20;
/// Chance below which a difference is reported.
const SURE: f64 = 0.05;

#[derive(Debug, Args)]
pub struct Options {
    /// Results of `evodrive suite run --out` in one suite, two or more, the oldest first: each is compared with the first.
    #[arg(required = true, num_args = 2..)]
    pub results: Vec<PathBuf>,
    /// The suite file: all results are held to its cases, and the commands that play a case name it.
    #[arg(long)]
    pub suite: Option<PathBuf>,
    /// Page to write: the results side by side, regressions first.
    #[arg(long)]
    pub html: Option<PathBuf>,
    #[command(flatten)]
    pub output: Output,
}

pub fn run(options: &Options) -> Result<Answer, Failure> {
    options.html.iter().try_for_each(|path| by_ending("--html", path, [("html", ())]))?;
    let mut results: Vec<(&Path, SuiteResult)> = Vec::new();
    for path in &options.results {
        results.push((path, suite_file::read_result(path)?));
    }
    let [(first_path, first), others @ ..] = results.as_slice() else {
        return Err(Failure::bad_input("name two or more results"));
    };
    for (path, other) in others {
        comparable(first_path, first, path, other)?;
    }
    // Where the suite is at hand, it says what each result is to hold.
    if let Some(suite) = &options.suite {
        let frozen = suite_file::read(suite)?;
        results.iter().try_for_each(|(path, result)| suite_file::is_whole(path, result, &frozen))?;
    }
    let pairs: Vec<Compared> = others.iter().map(|(_, other)| compared(first, other)).collect();
    if pairs.iter().any(|pair| pair.rows.first().is_none_or(|all| all.scenes == 0)) {
        return Err(Failure::bad_input("no scene was driven by both; there is nothing to compare"));
    }
    let command = |case: &str| {
        let suite = options.suite.as_ref().map_or("SUITE".into(), |suite| quoted(&suite.to_string_lossy()));
        let drivers: Vec<String> = results.iter().map(|(path, result)| who(path, result)).collect();
        format!("evodrive suite play {suite} --case {} {} --out play.html", quoted(case), drivers.join(" "))
    };
    let all: Vec<&SuiteResult> = results.iter().map(|(_, result)| result).collect();
    if let Some(path) = &options.html {
        options.output.write(path, suite_beside::page(&all, &pairs, &command).as_bytes())?;
    }
    let (text, object) = match (others, pairs.as_slice()) {
        ([(_, second)], [pair]) => {
            let commands: Vec<String> = pair.discordant.iter().map(|of| command(&of.case)).collect();
            let object = json!({
                "suite": first.suite, "first": first.driver, "second": second.driver, "compared": pair, "commands": commands,
            });
            (text(first, second, pair, &command), object)
        }
        _ => (suite_beside::text(&all, &pairs, &command), suite_beside::object(&all, &pairs)),
    };
    let written = options.html.as_ref().map_or(String::new(), |path| format!("{}\n", path.display()));
    Ok(Answer::new(text + &written, object))
}

/// Refuses results that were not made in one suite by one simulator.
fn comparable(first_path: &Path, first: &SuiteResult, second_path: &Path, second: &SuiteResult) -> Result<(), Failure> {
    if first.suite.digest != second.suite.digest {
        let mark = |of: &SuiteResult| format!("{} ({})", of.suite.name, of.suite.digest.short(12));
        return Err(Failure::bad_input(format!(
            "{} is a result in suite {}, {} in {}; only the same scenes can be compared",
            first_path.display(),
            mark(first),
            second_path.display(),
            mark(second)
        )));
    }
    if first.simulator != second.simulator {
        return Err(Failure::bad_input(format!(
            "{} was made by simulator version {}, {} by {}; make both with one release",
            first_path.display(),
            first.simulator,
            second_path.display(),
            second.simulator
        )));
    }
    Ok(())
}

/// How a driver plays again: a planner from its answers.
fn who(path: &Path, result: &SuiteResult) -> String {
    if result.recordings.is_empty() {
        format!("--driver {}", quoted(&result.driver.name))
    } else {
        format!("--recorded {}", quoted(&path.to_string_lossy()))
    }
}

fn text(first: &SuiteResult, second: &SuiteResult, compared: &Compared, command: &dyn Fn(&str) -> String) -> String {
    let names = [first, second].map(|of| format!("{} ({})", of.driver.name, of.driver.digest.short(8)));
    let mut text = format!("first: {}\nsecond: {}\nin suite {}\n\n", names[0], names[1], first.suite.name);
    let heads = [
        "",
        "scenes",
        "first crashes",
        "second crashes",
        "first alone",
        "second alone",
        "chance",
        "crash rate, second - first",
        "completion, second - first",
        "scenes needed",
    ];
    let row = |row: &crate::suite::ComparedRow| {
        vec![
            row.name.clone(),
            row.scenes.to_string(),
            row.first_crashes.to_string(),
            row.second_crashes.to_string(),
            row.first_alone.to_string(),
            row.second_alone.to_string(),
            num::fixed(row.chance, 4),
            mean(row.crash_difference),
            mean(row.completion_difference),
            row.needed.map_or("-".into(), |needed| needed.to_string()),
        ]
    };
    let rows = compared.rows.iter().map(row).collect();
    let heads = heads.map(String::from).to_vec();
    text += &Aligned { indent: 0, labels: 1, words: 0, heads, rows }.text(table_width());
    text += "\nchance: of such a division of the scenes in which one alone crashed, if both crash equally often (McNemar, exact, two-sided); \
             in brackets 95 % bootstrap intervals over scenes, paired; families are not corrected for being several\n";
    text += &verdict(compared);
    if let Some(all) = compared.rows.first() {
        let _ =
            writeln!(text, "preventable contacts: first {}, second {}", all.first_preventable, all.second_preventable);
        if let [Some(first), Some(second)] = all.at_fault {
            let _ = writeln!(text, "at fault by nuPlan's rule: first {first}, second {second}");
        }
    }
    text += &listed("lost by the second", &compared.discordant, true, command);
    text += &listed("won by the second", &compared.discordant, false, command);
    // The same reason in many scenes is one line.
    let mut reasons: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    for (case, reason) in &compared.not_compared {
        reasons.entry(reason).or_default().push(case);
    }
    for (reason, cases) in reasons {
        let first = cases.first().unwrap_or(&"");
        let _ = writeln!(text, "not compared: {}: {reason} (first {first})", counted(cases.len(), "scene"));
    }
    text
}

/// Returns what all scenes together say of crashes.
fn verdict(compared: &Compared) -> String {
    let Some(all) = compared.rows.first() else { return String::new() };
    let discordant = all.first_alone + all.second_alone;
    if all.chance < SURE {
        let better = if all.second_alone < all.first_alone { "second" } else { "first" };
        return format!("crashes: the {better} crashes less; chance {}\n", num::fixed(all.chance, 4));
    }
    match all.needed {
        Some(needed) => format!(
            "crashes: these {} cannot tell ({} with one crash alone); a difference of this size shows itself four times of five in about {needed}\n",
            counted(all.scenes, "scene"),
            discordant
        ),
        None => {
            format!("crashes: no difference in {}, so no number of scenes can be named\n", counted(all.scenes, "scene"))
        }
    }
}

fn listed(what: &str, all: &[Discordant], lost: bool, command: &dyn Fn(&str) -> String) -> String {
    let own: Vec<&Discordant> = all.iter().filter(|of| of.lost == lost).collect();
    let mut text = format!("{what}: {}\n", counted(own.len(), "scene"));
    for of in own.iter().take(LISTED_MAX) {
        let _ = writeln!(
            text,
            "  {}\n    first: {}\n    second: {}\n    {}",
            of.case,
            of.first,
            of.second,
            command(&of.case)
        );
    }
    if let Some(more) = own.len().checked_sub(LISTED_MAX).filter(|more| *more > 0) {
        let _ = writeln!(text, "  and {more} more, which --json lists");
    }
    text
}
