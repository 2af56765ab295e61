//! `suite compare`: two results in one suite beside each other.

use clap::Args;
use serde_json::json;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use crate::cli::studies::suite_file;
use crate::cli::studies::suite_text::mean;
use crate::cli::terminal::shell::quoted;
use crate::cli::terminal::width::table_width;
use crate::cli::terminal::{answer::Answer, exit::Failure};
use crate::evidence::aligned::Aligned;
use crate::kernel::num;
use crate::suite::{Compared, Discordant, SuiteResult, compared};
use crate::text::counted;

/// Scenes that a list names before it counts.
const LISTED_MAX: usize = 20;
/// A chance below this is told as a difference.
const SURE: f64 = 0.05;

#[derive(Debug, Args)]
pub struct Options {
    /// Result of `evodrive suite run --out`.
    pub first: PathBuf,
    /// Another one in the same suite.
    pub second: PathBuf,
    /// The suite file: both results are held to its cases, and the commands that play a case name it.
    #[arg(long)]
    pub suite: Option<PathBuf>,
}

pub fn run(options: &Options) -> Result<Answer, Failure> {
    let [first, second] = [&options.first, &options.second].map(|path| suite_file::read_result(path));
    let (first, second) = (first?, second?);
    if first.suite.digest != second.suite.digest {
        let mark = |of: &SuiteResult| format!("{} ({})", of.suite.name, of.suite.digest.short(12));
        return Err(Failure::bad_input(format!(
            "{} is a result in suite {}, {} in {}; only the same scenes can be compared",
            options.first.display(),
            mark(&first),
            options.second.display(),
            mark(&second)
        )));
    }
    if first.simulator != second.simulator {
        return Err(Failure::bad_input(format!(
            "{} was made by simulator version {}, {} by {}; make both with one release",
            options.first.display(),
            first.simulator,
            options.second.display(),
            second.simulator
        )));
    }
    // Where the suite is at hand, it says what each result is to hold.
    if let Some(suite) = &options.suite {
        let frozen = suite_file::read(suite)?;
        for (path, result) in [(&options.first, &first), (&options.second, &second)] {
            suite_file::is_whole(path, result, &frozen)?;
        }
    }
    let compared = compared(&first, &second);
    if compared.rows.first().is_none_or(|all| all.scenes == 0) {
        return Err(Failure::bad_input("no scene was driven by both; there is nothing to compare"));
    }
    let command = |case: &str| {
        let suite = options.suite.as_ref().map_or("SUITE".into(), |suite| quoted(&suite.to_string_lossy()));
        let [a, b] = [(&options.first, &first), (&options.second, &second)].map(|(path, result)| who(path, result));
        format!("evodrive suite play {suite} --case {} {a} {b} --out play.html", quoted(case))
    };
    let text = text((&first, &second), &compared, &command);
    let commands: Vec<String> = compared.discordant.iter().map(|of| command(&of.case)).collect();
    let object = json!({
        "suite": first.suite, "first": first.driver, "second": second.driver, "compared": compared, "commands": commands,
    });
    Ok(Answer::new(text, object))
}

/// How a driver plays again: a planner from its answers.
fn who(path: &Path, result: &SuiteResult) -> String {
    match result.recordings.is_empty() {
        true => format!("--driver {}", quoted(&result.driver.name)),
        false => format!("--recorded {}", quoted(&path.to_string_lossy())),
    }
}

fn text(
    (first, second): (&SuiteResult, &SuiteResult),
    compared: &Compared,
    command: &dyn Fn(&str) -> String,
) -> String {
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

/// What all scenes together say of crashes.
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
