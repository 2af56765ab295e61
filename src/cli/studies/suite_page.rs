//! A result as one page: totals, rules, every scene, and a player for those that failed. Nothing is loaded from elsewhere.

use std::fmt::Write as _;

use crate::cli::studies::suite_failures;
use crate::cli::studies::suite_html::{STYLE, table};
use crate::cli::studies::suite_stage::{Stage, Wheel};
use crate::cli::studies::suite_text::{HEADS, NOTE, cells};
use crate::cli::terminal::exit::Failure;
use crate::draw::{Drawing, escaped, players_below};
use crate::kernel::Threads;
use crate::suite::{Case, Judged, Played, SuiteResult, Total, worst_first};

/// Rollouts that the page plays: each takes about 30 kB.
const SHOWN_MAX: usize = 40;

/// The page of a result.
pub fn page(
    stage: &Stage<'_>,
    wheel: &Wheel<'_>,
    (result, totals, rules): (&SuiteResult, &[Total], &[Judged]),
    threads: &Threads,
) -> Result<String, Failure> {
    let failed = worst_first(result).into_iter().filter(|played| played.drive().is_some());
    let passed = result.cases.iter().filter(|played| played.passed());
    let shown: Vec<(&Played, &Case)> = failed
        .chain(passed)
        .filter_map(|played| Some((played, stage.suite.case(&played.case)?)))
        .take(SHOWN_MAX)
        .collect();
    let place = |id: &str| shown.iter().position(|(played, _)| played.case == id);
    let above = above(result, totals, rules, &place);
    let drawings = threads.map(&shown, |_, (played, case)| {
        let drawn = stage.played(case, wheel, &result.driver.name);
        drawn.map(|drawn| (format!("{}: {}", played.case, played.in_words()), drawn.drawing()))
    });
    let drawings: Vec<(String, Drawing)> =
        drawings.into_iter().collect::<Result<_, _>>().map_err(|error| Failure::internal(error.reason()))?;
    let title = format!("{} in {}", result.driver.name, result.suite.name);
    Ok(players_below(&above, &drawings, &title))
}

fn above(result: &SuiteResult, totals: &[Total], rules: &[Judged], place: &dyn Fn(&str) -> Option<usize>) -> String {
    let mut html = format!("{STYLE}{}<p>suite <code>{}</code></p>\n", suite_failures::STYLE, result.suite.digest);
    for rule in rules {
        let (word, class) = if rule.holds { ("holds", "") } else { ("broken", " class=\"broken\"") };
        let said = escaped(&format!("{}: expected {}, found {}", rule.rule, rule.expected, rule.found));
        let _ = writeln!(html, "<p{class}>{word}: {said}</p>");
    }
    let rows: Vec<Vec<String>> = totals.iter().map(cells).collect();
    let heads = HEADS.map(String::from);
    html += &table(&heads, &rows[..rows.len().min(1)]);
    html += &suite_failures::html(result, place);
    let _ = writeln!(html, "<details><summary>By family, cluster and class</summary>");
    html += &table(&heads, &rows);
    let _ = writeln!(html, "<p><small>{NOTE}</small></p></details>");
    let _ = writeln!(html, "<details><summary>Every scene</summary>");
    let row =
        |played: &Played| vec![played.case.clone(), played.cluster.clone(), played.class.clone(), played.in_words()];
    let rows: Vec<Vec<String>> = result.cases.iter().map(row).collect();
    html += &table(&["case", "cluster", "class", "what came of it"].map(String::from), &rows);
    html + "</details>\n"
}
