//! A result as one page: totals, rules, every scene, and a player for those that failed. Nothing is loaded from elsewhere.

use std::fmt::Write as _;

use crate::cli::studies::suite_stage::{Stage, Wheel};
use crate::cli::studies::suite_text::{HEADS, NOTE, cells};
use crate::cli::terminal::exit::Failure;
use crate::draw::{Drawing, escaped, players_below};
use crate::kernel::Threads;
use crate::suite::{Case, Judged, Played, SuiteResult, Total};

/// Rollouts that the page plays: each takes about 30 kB.
const SHOWN_MAX: usize = 40;

/// How tables of suites look.
pub const STYLE: &str = "<style>.wide { overflow-x: auto } table.suite { border-collapse: collapse; font-size: 14px; margin: 0 0 1rem } \
                     table.suite th, table.suite td { text-align: left; padding: 3px 9px; border-bottom: 1px solid #8886; \
                     overflow-wrap: normal } table.suite th { white-space: nowrap } .broken { color: #c0392b; font-weight: 600 } \
                     @media (max-width: 700px) { .wide.many::before { content: \"scroll sideways for the rest →\"; font-size: 13px } }</style>\n";

/// Around a page of suites that has no player.
pub const BODY: &str = "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
                    <style>body { margin: 0 auto; max-width: 1180px; padding: 16px 20px; overflow-wrap: anywhere; \
                    font: 15px/1.5 system-ui, \"Segoe UI\", \"DejaVu Sans\", sans-serif } h1 { font-size: 22px; margin: 0 0 4px }</style>\n";
/// From so many columns on a table is wider than a telephone.
const MANY: usize = 5;

/// The page of a result.
pub fn page(
    stage: &Stage<'_>,
    wheel: &Wheel<'_>,
    (result, totals, rules): (&SuiteResult, &[Total], &[Judged]),
    threads: &Threads,
) -> Result<String, Failure> {
    let mut failed: Vec<&Played> =
        result.cases.iter().filter(|played| played.drive().is_some() && !played.passed()).collect();
    let passed = result.cases.iter().filter(|played| played.passed());
    failed.extend(passed);
    let shown: Vec<(&Played, &Case)> = failed
        .into_iter()
        .filter_map(|played| Some((played, stage.suite.case(&played.case)?)))
        .take(SHOWN_MAX)
        .collect();
    let drawings = threads.map(&shown, |_, (played, case)| {
        let drawn = stage.played(case, wheel, &result.driver.name);
        drawn.map(|drawn| (format!("{}: {}", played.case, played.in_words()), drawn.drawing()))
    });
    let drawings: Vec<(String, Drawing)> =
        drawings.into_iter().collect::<Result<_, _>>().map_err(|error| Failure::internal(error.reason()))?;
    let title = format!("{} in {}", result.driver.name, result.suite.name);
    Ok(players_below(&above(result, totals, rules), &drawings, &title))
}

fn above(result: &SuiteResult, totals: &[Total], rules: &[Judged]) -> String {
    let mut html = format!("{STYLE}<p>suite <code>{}</code></p>\n", result.suite.digest);
    for rule in rules {
        let (word, class) = if rule.holds { ("holds", "") } else { ("broken", " class=\"broken\"") };
        let said = escaped(&format!("{}: expected {}, found {}", rule.rule, rule.expected, rule.found));
        let _ = writeln!(html, "<p{class}>{word}: {said}</p>");
    }
    html += &table(&HEADS.map(String::from), &totals.iter().map(cells).collect::<Vec<_>>());
    let _ = writeln!(html, "<p><small>{NOTE}</small></p>\n<details><summary>Every scene</summary>");
    let row =
        |played: &Played| vec![played.case.clone(), played.cluster.clone(), played.class.clone(), played.in_words()];
    let rows: Vec<Vec<String>> = result.cases.iter().map(row).collect();
    html += &table(&["case", "cluster", "class", "what came of it"].map(String::from), &rows);
    html + "</details>\n"
}

/// A table of texts.
pub fn table(heads: &[String], rows: &[Vec<String>]) -> String {
    // An estimate may be broken before its interval, and not in it.
    let kept = |cell: &String| match cell.contains(" [") {
        true => escaped(cell).replace(", ", ",&#160;"),
        false => escaped(cell),
    };
    let line = |cells: &[String], tag: &str| -> String {
        let cells = cells.iter().map(|cell| format!("<{tag}>{}</{tag}>", kept(cell))).collect::<String>();
        format!("<tr>{cells}</tr>\n")
    };
    let rows: String = rows.iter().map(|row| line(row, "td")).collect();
    let many = if heads.len() >= MANY { " many" } else { "" };
    format!("<div class=\"wide{many}\"><table class=\"suite\">\n{}{rows}</table></div>\n", line(heads, "th"))
}
