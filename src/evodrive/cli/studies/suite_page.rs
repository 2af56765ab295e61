//! A result as one page: totals, rules, every scene, and a player for those that failed. Nothing is loaded from elsewhere.

use std::fmt::Write as _;

use crate::cli::studies::suite_failures;
use crate::cli::studies::suite_html::{STYLE, table};
use crate::cli::studies::suite_stage::{DriverSource, SuiteRunner};
use crate::cli::studies::suite_text::{HEADS, NOTE, cells, playable};
use crate::cli::terminal::exit::Failure;
use crate::draw::{Drawing, Frame, StripOptions, Theme, escaped, even_steps, players_below, strip};
use crate::kernel::Threads;
use crate::sim::timeline_text::class_in_words;
use crate::suite::{Case, Played, RuleResult, SuiteResult, Total, worst_first};
use crate::text::in_words;

/// Rollouts that the page plays: each takes about 30 kB.
const SHOWN_MAX: usize = 40;

/// The page of a result.
pub fn page(
    stage: &SuiteRunner<'_>,
    source: &DriverSource<'_>,
    result: &SuiteResult,
    totals: &[Total],
    rules: &[RuleResult],
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
    let drawings = threads.map(&shown, |_, (played, case)| {
        let drawn = stage.played(case, source, &result.driver.name);
        drawn.map(|drawn| (format!("{}: {}", played.case, played.in_words()), drawn.drawing()))
    });
    let drawings: Vec<(String, Drawing)> =
        drawings.into_iter().collect::<Result<_, _>>().map_err(|error| Failure::internal(error.reason()))?;
    let title = format!("{} in {}", result.driver.name, result.suite.name);
    let worst = match (shown.first(), drawings.first()) {
        (Some((played, _)), Some((line, drawing))) if !played.passed() => picture(line, drawing),
        _ => String::new(),
    };
    let above = above(result, totals, rules, &worst, &place);
    Ok(players_below(&above, &drawings, &title))
}

/// Number of panels in the worst failure's picture, and their width, pixels.
const PANELS: usize = 3;
const PANEL_PX: f64 = 400.0;
/// Margin around ego and adversaries in it, metres.
const AROUND_M: f64 = 12.0;
/// Seconds before the contact at which it begins.
const LED_UP_S: f64 = 3.0;

/// The worst failure up to its contact, which a reader sees before anything is scrolled.
fn picture(line: &str, drawing: &Drawing) -> String {
    let end = drawing.contact.as_ref().map_or(drawing.steps.saturating_sub(1), |contact| contact.step);
    let before = |seconds: f64| end.saturating_sub((seconds / drawing.dt_s.max(f64::MIN_POSITIVE)).round() as usize);
    let first = before(LED_UP_S).max(drawing.start_step).min(end);
    let options = StripOptions {
        panel_px: PANEL_PX,
        theme: Theme::Light,
        frame: Frame::Around(AROUND_M),
        steps: even_steps(first, end, PANELS),
        title: String::new(),
    };
    let said = escaped(line);
    format!(
        "<figure class=\"worst\"><figcaption>Worst failure: {said} <button data-play=\"0\">play</button></figcaption>\n\
         <div>{}</div></figure>\n",
        strip(drawing, &options)
    )
}

/// Kinds of place and classes of contact in words, which files and options have by name; families keep theirs.
fn in_page(total: &Total) -> Vec<String> {
    let mut cells = cells(total);
    cells[1] = match total.by {
        "class" => class_in_words(&total.name),
        "cluster" => in_words(&total.name),
        _ => total.name.clone(),
    };
    cells
}

fn above(
    result: &SuiteResult,
    totals: &[Total],
    rules: &[RuleResult],
    worst: &str,
    place: &dyn Fn(&str) -> Option<usize>,
) -> String {
    let mut html = format!("{STYLE}{}<p>suite <code>{}</code></p>\n", suite_failures::STYLE, result.suite.digest);
    for rule in rules {
        let (word, class) = if rule.holds { ("holds", "") } else { ("broken", " class=\"broken\"") };
        let said = escaped(&format!("{}: expected {}, found {}", rule.rule, rule.expected, rule.found));
        let _ = writeln!(html, "<p{class}>{word}: {said}</p>");
    }
    let said = playable(totals);
    if !said.is_empty() {
        let _ = writeln!(html, "<p>{}</p>", escaped(&said));
    }
    let rows: Vec<Vec<String>> = totals.iter().filter(|total| total.can_be_played()).map(in_page).collect();
    let heads = HEADS.map(String::from);
    html += &table(&heads, &rows[..rows.len().min(1)]);
    html += worst;
    html += &suite_failures::html(result, place);
    let _ = writeln!(html, "<details><summary>By family, cluster and class</summary>");
    html += &table(&heads, &rows);
    let _ = writeln!(html, "<p><small>{NOTE}</small></p></details>");
    let _ = writeln!(html, "<details><summary>Every scene</summary>");
    let row = |played: &Played| {
        vec![played.case.clone(), in_words(&played.cluster), class_in_words(&played.class), played.in_words()]
    };
    let rows: Vec<Vec<String>> = result.cases.iter().map(row).collect();
    html += &table(&["case", "kind of place", "frozen contact", "what came of it"].map(String::from), &rows);
    html + "</details>\n"
}
