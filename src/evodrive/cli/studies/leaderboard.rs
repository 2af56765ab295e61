//! `leaderboard`: several drivers in one suite: a table of drivers, and one of drivers by family.

use clap::{Args, ValueEnum};
use serde_json::json;
use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::path::PathBuf;

use crate::cli::scenes::files;
use crate::cli::studies::suite_drive::Running;
use crate::cli::studies::suite_driver::TestDriver;
use crate::cli::studies::suite_file;
use crate::cli::studies::suite_html;
use crate::cli::studies::suite_run::{Selection, again, fresh, write};
use crate::cli::studies::suite_stage::SuiteRunner;
use crate::cli::studies::suite_text::{self, mean, share};
use crate::cli::terminal::answer::{Answer, progress};
use crate::cli::terminal::exit::Failure;
use crate::cli::terminal::interrupt::Interrupt;
use crate::cli::terminal::output::Output;
use crate::cli::terminal::width::table_width;
use crate::draw::escaped;
use crate::evidence::aligned::Aligned;
use crate::evidence::tables::csv_line;
use crate::kernel::Digest;
use crate::suite::{CaseOutcome, Frozen, SuiteResult, Total, totals};
use crate::text::counted;

#[derive(Debug, Args)]
pub struct Options {
    /// Suite file.
    pub suite: PathBuf,
    /// Driver, as for `evodrive suite run`; may be repeated.
    #[arg(long)]
    pub driver: Vec<String>,
    /// Weights of a learned driver (.safetensors, .onnx); may be repeated.
    #[arg(long)]
    pub policy: Vec<PathBuf>,
    /// A planner's result whose recorded answers drive, without the planner; may be repeated.
    #[arg(long, value_name = "RESULT")]
    pub recorded: Vec<PathBuf>,
    #[command(flatten)]
    pub selection: Selection,
    /// Folder for the results, with planners' answers; what is answered there already is not asked again.
    #[arg(long)]
    pub kept: Option<PathBuf>,
    /// How it is written; without it for a terminal.
    #[arg(long)]
    pub format: Option<Format>,
    /// File to write; without it it is printed.
    #[arg(long, requires = "format")]
    pub out: Option<PathBuf>,
    #[command(flatten)]
    pub output: Output,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Format {
    Markdown,
    /// A driver and family a line, with plain numbers.
    Csv,
    Html,
}

/// A driver's row.
struct Entry {
    name: String,
    result: SuiteResult,
    totals: Vec<Total>,
}

/// Explanation of the numbers.
const NOTE: &str = "Ordered by arrived: the share of playable scenes that were driven to the end of the route without a contact; a scene \
                    in which the planner gave no drive counts against it, so neither a driver that stands still nor one that ends early \
                    comes first. Who a suite was planned around meets its own weak spots there: compare others with each other. Crash rate, preventable and \
                    off road are shares of driven scenes, with 95 % Wilson intervals; completion is the mean share \
                    of the route, with a 95 % bootstrap interval over scenes. By family: crash rate with its interval, then completion. \
                    Scenes that share a road and its traffic are counted as if they were independent.";

pub fn run(options: &Options, jobs: usize) -> Result<Answer, Failure> {
    let frozen = suite_file::read_to_drive(&options.suite)?;
    let cases = options.selection.of(&frozen.suite)?;
    let words = options.driver.iter().cloned();
    let words: Vec<String> = words.chain(options.policy.iter().map(|path| path.display().to_string())).collect();
    if words.is_empty() && options.recorded.is_empty() {
        return Err(Failure::bad_input("name who drives: --driver, --policy or --recorded"));
    }
    let (threads, interrupt) = (files::threads(jobs)?, Interrupt::listen()?);
    let running = Running { threads: &threads, interrupt: &interrupt };
    let stage = SuiteRunner::new(&frozen.suite, &threads)?;
    let drivers = words.iter().map(|word| TestDriver::named(word)).collect::<Result<Vec<_>, _>>()?;
    let mut made = Vec::new();
    for driver in &drivers {
        let mark = driver.mark();
        let name = &mark.name;
        progress(format!("{name}: {}", counted(cases.len(), "case")));
        // Two versions of a planner bear one name.
        let file = |folder: &PathBuf| folder.join(format!("{name}-{}.json", mark.digest.short(8)));
        let out = options.kept.as_ref().map(file);
        let mut one = fresh(&frozen, &stage, &options.selection, driver, out.as_deref(), &running)?;
        if let Some(out) = &out {
            write(&mut one, out, options.output)?;
        }
        made.push(one.result);
    }
    for path in &options.recorded {
        made.push(again(&frozen, &stage, &options.selection, path, &running)?.result);
    }
    let fewer = |result: &&SuiteResult| result.cases.len() < cases.len();
    let say = |result: &SuiteResult| {
        format!("{} was asked for {}. ", result.driver.name, suite_text::of_all(result.cases.len(), &frozen.suite))
    };
    let asked: String = made.iter().filter(fewer).map(say).collect();
    let asked_by_all = made.iter().map(|result| result.cases.len()).min().unwrap_or(0);
    let left_out = cases.len() - keep_common(&mut made);
    if made.first().is_none_or(|result| result.cases.is_empty()) {
        let what = "no scene can be played by all of these drivers; set fewer beside each other";
        return Err(Failure::bad_input(format!("{}: {what}", options.suite.display())));
    }
    let mut entries: Vec<Entry> = made
        .into_iter()
        .map(|result| Entry { name: result.driver.name.clone(), totals: totals(&result), result })
        .collect();
    entries.sort_by(|a, b| rank(b).total_cmp(&rank(a)).then_with(|| a.name.cmp(&b.name)));
    answer(options, &frozen, &entries, left_out, asked_by_all, &asked)
}

/// Leaves in all results the scenes that each of these drivers can play and was asked for, so that rows stand on the same ones; says
/// how many these are.
fn keep_common(results: &mut [SuiteResult]) -> usize {
    let playable = |result: &SuiteResult| -> BTreeSet<String> {
        let own = result.cases.iter().filter(|played| !matches!(played.came, CaseOutcome::Unplayable { .. }));
        own.map(|played| played.case.clone()).collect()
    };
    let common = results.iter().map(playable).reduce(|all, own| &all & &own).unwrap_or_default();
    results.iter_mut().for_each(|result| result.cases.retain(|played| common.contains(&played.case)));
    common.len()
}

/// Returns the number by which drivers are ordered.
fn rank(entry: &Entry) -> f64 {
    entry.totals.first().and_then(Total::arrived_of_playable).map_or(0.0, |share| share.value)
}

const HEADS: [&str; 9] =
    ["driver", "driven", "faults", "arrived", "crash rate", "preventable", "at fault", "off road", "completion"];

fn row(entry: &Entry, planned_around: &[Digest]) -> Vec<String> {
    let Some(all) = entry.totals.first() else { return Vec::new() };
    let own = if planned_around.contains(&entry.result.driver.digest) { " (planned around)" } else { "" };
    vec![
        format!("{}{own}", entry.name),
        all.driven.to_string(),
        all.faults.to_string(),
        share(all.arrived_of_playable()),
        share(all.crashes),
        share(all.preventable),
        share(all.at_fault),
        share(all.off_road),
        mean(all.completion),
    ]
}

/// A line a family, a column a driver.
fn by_family(entries: &[Entry]) -> (Vec<String>, Vec<Vec<String>>) {
    let of = |entry: &Entry, family: &str| {
        entry.totals.iter().find(|total| total.by == "family" && total.name == family).cloned()
    };
    let families: BTreeSet<&str> = entries
        .iter()
        .flat_map(|entry| &entry.totals)
        .filter(|total| total.by == "family")
        .map(|total| total.name.as_str())
        .collect();
    let cell = |total: Option<Total>| {
        total.filter(|total| total.driven > 0).map_or("-".to_string(), |total| {
            let completion = total.completion.map_or("-".into(), |of| crate::kernel::num::fixed(of.value, 2));
            format!("{}; {completion}", share(total.crashes))
        })
    };
    let heads =
        ["family".to_string(), "scenes".to_string()].into_iter().chain(entries.iter().map(|entry| entry.name.clone()));
    let rows = families.into_iter().map(|family| {
        let scenes = entries.first().and_then(|entry| of(entry, family)).map_or(0, |total| total.scenes);
        let cells = entries.iter().map(|entry| cell(of(entry, family)));
        [family.to_string(), scenes.to_string()].into_iter().chain(cells).collect()
    });
    (heads.collect(), rows.collect())
}

/// `left_out`: how many scenes no row stands on; `asked`: who was asked for fewer than others.
fn answer(
    options: &Options,
    frozen: &Frozen,
    entries: &[Entry],
    left_out: usize,
    asked_by_all: usize,
    asked: &str,
) -> Result<Answer, Failure> {
    let heads = HEADS.map(String::from).to_vec();
    let one = std::slice::from_ref(&frozen.suite.planned_around);
    let around = if frozen.suite.around.is_empty() { one } else { &frozen.suite.around };
    let around: Vec<Digest> = around.iter().map(|mark| mark.digest).collect();
    let rows: Vec<Vec<String>> = entries.iter().map(|entry| row(entry, &around)).collect();
    let note = format!(
        "{}{NOTE}",
        if left_out == 0 {
            String::new()
        } else {
            format!(
                "{asked}{} that not every driver here {}can play are left out, so that all rows stand on the same. ",
                counted(left_out, "scene"),
                if asked.is_empty() { "" } else { "was asked for or " }
            )
        }
    );
    let (family_heads, family_rows) = by_family(entries);
    let title = format!("Suite {}, {}", frozen.suite.name, suite_text::of_all(asked_by_all, &frozen.suite));
    let digest = frozen.digest;
    let text = match options.format {
        None => {
            let first = Aligned { indent: 0, labels: 1, words: 0, heads, rows };
            let second = Aligned { indent: 0, labels: 1, words: 0, heads: family_heads, rows: family_rows };
            let width = table_width();
            format!("{title}, digest {digest}\n\n{}\n{}\n{note}\n", first.text(width), second.text(width))
        }
        Some(Format::Markdown) => format!(
            "# {title}\n\nDigest `{digest}`, planned around {}.\n\n{}\n{}\n{note}\n",
            frozen.suite.planned_around.name,
            markdown(&heads, &rows),
            markdown(&family_heads, &family_rows)
        ),
        Some(Format::Csv) => csv(entries),
        Some(Format::Html) => html(&title, &digest.to_hex(), &note, (&heads, &rows), (&family_heads, &family_rows)),
    };
    let object: Vec<_> =
        entries.iter().map(|entry| json!({"driver": entry.result.driver, "totals": entry.totals})).collect();
    let cases = entries.first().map_or(0, |entry| entry.result.cases.len());
    let object = json!({
        "suite": entries.first().map(|entry| &entry.result.suite), "cases": cases, "cases_of_suite": frozen.suite.cases.len(),
        "drivers": object,
    });
    match &options.out {
        None => Ok(Answer::exact(text, object)),
        Some(out) => {
            options.output.write(out, text.as_bytes())?;
            Ok(Answer::new(format!("{} in {}", counted(entries.len(), "driver"), out.display()), object))
        }
    }
}

fn markdown(heads: &[String], rows: &[Vec<String>]) -> String {
    let line = |cells: &[String]| {
        format!("| {} |\n", cells.iter().map(|cell| cell.replace('|', "\\|")).collect::<Vec<_>>().join(" | "))
    };
    let rule = format!(
        "|{}\n",
        heads.iter().enumerate().map(|(i, _)| if i == 0 { "---|" } else { "--:|" }).collect::<String>()
    );
    let rows: String = rows.iter().map(|row| line(row)).collect();
    format!("{}{rule}{rows}", line(heads))
}

fn csv(entries: &[Entry]) -> String {
    let heads = [
        "driver",
        "ego",
        "by",
        "name",
        "scenes",
        "driven",
        "faults",
        "unplayable",
        "crash_rate",
        "crash_low",
        "crash_high",
        "preventable",
        "preventable_low",
        "preventable_high",
        "at_fault",
        "at_fault_low",
        "at_fault_high",
        "completion",
        "completion_low",
        "completion_high",
        "arrived",
    ];
    let mut text = csv_line(&heads.map(String::from));
    for entry in entries {
        for total in &entry.totals {
            let mut fields = vec![
                entry.name.clone(),
                entry.result.driver.digest.to_hex(),
                total.by.to_string(),
                total.name.clone(),
                total.scenes.to_string(),
                total.driven.to_string(),
                total.faults.to_string(),
                total.unplayable.to_string(),
            ];
            for of in [total.crashes, total.preventable, total.at_fault] {
                let numbers = of.map(|of| [of.value, of.interval[0], of.interval[1]]);
                fields
                    .extend(numbers.map_or([(); 3].map(|()| String::new()), |numbers| numbers.map(|x| x.to_string())));
            }
            let completion = total.completion;
            let interval = completion.and_then(|of| of.interval);
            let numbers = [completion.map(|of| of.value), interval.map(|i| i[0]), interval.map(|i| i[1])];
            fields.extend(numbers.map(|number| number.map_or(String::new(), |x| x.to_string())));
            fields.push(total.arrived_of_playable().map_or(String::new(), |of| of.value.to_string()));
            text.push_str(&csv_line(&fields));
        }
    }
    text
}

/// Heads and rows.
type Texts<'a> = (&'a Vec<String>, &'a Vec<Vec<String>>);

fn html(title: &str, digest: &str, note: &str, first: Texts<'_>, second: Texts<'_>) -> String {
    let title = escaped(title);
    let mut text = format!(
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n{}<title>{title}</title>\n{}</head>\n<body>\n<h1>{title}</h1>\n\
         <p>digest <code>{digest}</code></p>\n",
        suite_html::BODY,
        suite_html::STYLE
    );
    let _ = write!(text, "{}{}", suite_html::table(first.0, first.1), suite_html::table(second.0, second.1));
    let _ = writeln!(text, "<p><small>{note}</small></p>\n</body>\n</html>");
    text
}
