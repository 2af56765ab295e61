//! Two or more results in one suite side by side, regressions first: as text, as an object, as a page.

use serde_json::{Value, json};
use std::fmt::Write as _;

use crate::cli::studies::suite_html::{BODY, STYLE, table};
use crate::cli::studies::suite_text::{mean, share};
use crate::cli::terminal::width::table_width;
use crate::draw::escaped;
use crate::evidence::aligned::Aligned;
use crate::kernel::num;
use crate::suite::{Change, Compared, Played, SideBySide, SuiteResult, kind_of, side_by_side, totals};
use crate::text::{counted, in_words};

/// Scenes of one change that a text lists, and that a page shows.
const LISTED_MAX: usize = 20;
const SHOWN_MAX: usize = 400;

/// How scenes side by side look: a table, and on a narrow window a block a scene.
const BESIDE: &str = "<style>h2 { font-size: 17px; margin: 1.2rem 0 .3rem } table.beside { border-collapse: collapse; width: 100%; table-layout: fixed; font-size: 14px } \
    table.beside th, table.beside td { text-align: left; vertical-align: top; padding: 4px 9px; border-bottom: 1px solid #8886 } \
    table.beside td:first-child { width: 24% } td.pass { border-left: 4px solid #2e9e5b } td.fail { border-left: 4px solid #d55e00 } \
    td.preventable { border-left: 4px solid #c0392b; background: #c0392b1c } td.none { border-left: 4px solid #8886; color: #777 } \
    table.beside small { color: #777 } table.beside code { font-size: 12px } @media (max-width: 700px) { \
    table.beside, table.beside tbody, table.beside tr, table.beside td { display: block; width: auto !important } \
    table.beside tr.heads { display: none } table.beside tr { border-bottom: 2px solid #8886; padding: 6px 0 } \
    table.beside td { border-bottom: 0; margin: 3px 0 } td[data-of]::before { content: attr(data-of) \": \"; font-weight: 600 } }</style>\n";

/// Drivers by number, so that versions of one name are told apart.
fn names(results: &[&SuiteResult]) -> Vec<String> {
    let name = |(k, result): (usize, &&SuiteResult)| {
        format!("[{}] {} ({})", k + 1, result.driver.name, result.driver.digest.short(8))
    };
    results.iter().enumerate().map(name).collect()
}

const HEADS: [&str; 9] =
    ["", "crash rate", "preventable", "off road", "arrived", "completion", "lost", "won", "chance"];

/// A row a result: its totals, and the scenes in which it alone, or the first alone, crashed.
fn rows(results: &[&SuiteResult], pairs: &[Compared]) -> Vec<Vec<String>> {
    let against = |k: usize| {
        let all = k.checked_sub(1).and_then(|k| pairs.get(k)).and_then(|pair| pair.rows.first());
        let of = |value: fn(&crate::suite::ComparedRow) -> String| all.map_or("-".into(), value);
        [
            of(|all| all.second_alone.to_string()),
            of(|all| all.first_alone.to_string()),
            of(|all| num::fixed(all.chance, 4)),
        ]
    };
    let row = |(k, (name, result)): (usize, (String, &&SuiteResult))| {
        let totals = totals(result);
        let all = totals.first();
        let of = |value: &dyn Fn(&crate::suite::Total) -> String| all.map_or("-".into(), value);
        let own = [
            name,
            of(&|all| share(all.crashes)),
            of(&|all| share(all.preventable)),
            of(&|all| share(all.off_road)),
            of(&|all| share(all.arrived_of_playable())),
            of(&|all| mean(all.completion)),
        ];
        own.into_iter().chain(against(k)).collect()
    };
    names(results).into_iter().zip(results).enumerate().map(row).collect()
}

/// Explanation of the columns of both tables.
const NOTE: &str = "lost, won: scenes in which this result, or the first, crashed alone; chance of that division if both crash equally often (McNemar, \
                    exact, two-sided), not corrected for several comparisons; in brackets 95 % intervals";

pub fn text(results: &[&SuiteResult], pairs: &[Compared], command: &dyn Fn(&str) -> String) -> String {
    let heads = HEADS.map(String::from).to_vec();
    let table = Aligned { indent: 0, labels: 1, words: 0, heads, rows: rows(results, pairs) }.text(table_width());
    let suite = results.first().map_or("", |first| first.suite.name.as_str());
    let mut text = format!("in suite {suite}\n\n{table}\n{NOTE}\n");
    let all = side_by_side(results);
    for change in Change::ALL {
        let own: Vec<&SideBySide<'_>> = all.iter().filter(|of| of.change == change).collect();
        let _ = writeln!(text, "{}: {}", change.in_words(), counted(own.len(), "scene"));
        if !matches!(change, Change::Lost | Change::Between | Change::Won) {
            continue;
        }
        for of in own.iter().take(LISTED_MAX) {
            let _ = writeln!(text, "  {}", of.case);
            for (k, played) in of.played.iter().enumerate() {
                let _ = writeln!(text, "    [{}] {}", k + 1, words(*played));
            }
            let _ = writeln!(text, "    {}", command(of.case));
        }
        if let Some(more) = own.len().checked_sub(LISTED_MAX).filter(|more| *more > 0) {
            let _ = writeln!(text, "  and {more} more, which --json lists");
        }
    }
    text
}

fn words(played: Option<&Played>) -> String {
    played.map_or("no result".into(), Played::in_words)
}

pub fn object(results: &[&SuiteResult], pairs: &[Compared]) -> Value {
    let scene = |of: SideBySide<'_>| {
        let came: Vec<Value> = of.played.iter().map(|played| json!(played.map(|played| &played.came))).collect();
        json!({"case": of.case, "change": of.change, "came": came})
    };
    let drivers: Vec<Value> = results.iter().map(|result| json!(result.driver)).collect();
    let scenes: Vec<Value> = side_by_side(results).into_iter().map(scene).collect();
    json!({"suite": results.first().map(|first| &first.suite), "drivers": drivers, "compared": pairs, "scenes": scenes})
}

/// The page.
pub fn page(results: &[&SuiteResult], pairs: &[Compared], command: &dyn Fn(&str) -> String) -> String {
    let suite = results.first().map_or("", |first| first.suite.name.as_str());
    let title = escaped(&format!("{} in {suite}", counted(results.len(), "result")));
    let mut html = format!(
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<title>{title}</title>\n{BODY}{STYLE}{BESIDE}</head>\n<body>\n\
         <h1>{title}</h1>\n{}<p><small>{}</small></p>\n",
        table(&HEADS.map(String::from), &rows(results, pairs)),
        escaped(NOTE)
    );
    let (all, names) = (side_by_side(results), names(results));
    for change in Change::ALL {
        let own: Vec<&SideBySide<'_>> = all.iter().filter(|of| of.change == change).collect();
        let said = escaped(&format!("{} ({})", change.in_words(), own.len()));
        let open = if matches!(change, Change::Lost | Change::Between | Change::Won) { " open" } else { "" };
        if own.is_empty() {
            let _ = writeln!(html, "<h2>{said}</h2>");
            continue;
        }
        let _ = writeln!(
            html,
            "<details{open}><summary><b>{said}</b></summary>\n<table class=\"beside\">\n<tr class=\"heads\"><th>scene</th>"
        );
        names.iter().for_each(|name| html += &format!("<th>{}</th>", escaped(name)));
        html += "</tr>\n";
        own.iter().take(SHOWN_MAX).for_each(|of| html += &scene(of, &names, command));
        html += "</table>\n";
        if let Some(more) = own.len().checked_sub(SHOWN_MAX).filter(|more| *more > 0) {
            let _ = writeln!(html, "<p>and {more} more, which --json lists</p>");
        }
        html += "</details>\n";
    }
    html + "</body>\n</html>\n"
}

/// A scene's row.
fn scene(of: &SideBySide<'_>, names: &[String], command: &dyn Fn(&str) -> String) -> String {
    let place = of.played.iter().flatten().next().map_or(String::new(), |played| {
        format!("<br><small>{}, {}</small>", escaped(&played.family), escaped(&in_words(&played.cluster)))
    });
    let mut html = format!(
        "<tr><td><b>{}</b>{place}<details><summary><small>how to play it</small></summary><code>{}</code></details></td>",
        escaped(of.case),
        escaped(&command(of.case))
    );
    for (played, name) in of.played.iter().zip(names) {
        let class = match played {
            Some(played) if played.passed() => "pass",
            Some(played) if played.drive().is_some_and(crate::suite::Drive::is_preventable) => "preventable",
            Some(played) if kind_of(played).is_some() => "fail",
            _ => "none",
        };
        let kind =
            played.and_then(kind_of).map_or(String::new(), |kind| format!("<br><small>{}</small>", escaped(&kind)));
        let why = played.and_then(Played::why).map_or(String::new(), |why| {
            format!("<details><summary><small>why</small></summary><small>{}</small></details>", escaped(&why))
        });
        let _ = write!(
            html,
            "<td class=\"{class}\" data-of=\"{}\">{}{kind}{why}</td>",
            escaped(name),
            escaped(&words(*played))
        );
    }
    html + "</tr>\n"
}
