//! Why a driver failed in a suite: failures by kind, worst first, each with its time line, as text and as a piece of a page.

use serde_json::{Value, json};
use std::fmt::Write as _;

use crate::draw::escaped;
use crate::evidence::aligned::Aligned;
use crate::kernel::num;
use crate::sim::{Reacted, Timeline};
use crate::suite::{Group, Played, SEVERITY, SuiteResult, groups, headline, kind_of, worst_first};
use crate::text::counted;

/// Failures that a text tells one by one, and kinds that it lists.
const TOLD_MAX: usize = 3;
const KINDS_MAX: usize = 12;
/// Failures that a page draws: each takes about 2 kB.
const DRAWN_MAX: usize = 200;
/// Seconds before the contact that a picture shows at most.
const SPAN_MAX_S: f64 = 8.0;

/// How time lines look.
pub const STYLE: &str = "<style>.evo-above h2 { font-size: 18px; margin: 1rem 0 .2rem } .line { display: grid; grid-template-columns: 11.5rem minmax(4rem, 1fr) 5rem; gap: 1px 8px; max-width: 760px; \
    font-size: 13px; margin: 4px 0 12px } .line i { position: relative; background: #8882; border-right: 2px solid #d7191c } \
    .line b { position: absolute; top: calc(50% - 5px); height: 10px; border-radius: 2px } .line .seen { background: #56b4e9 } \
    .line .did { background: #e69f00 } .line .helps { background: #2e9e5b } .line .axis { background: none; border: 0; height: 1.3em } \
    .line .axis u { position: absolute; transform: translateX(-50%); text-decoration: none; color: #777; white-space: nowrap } \
    .failure { margin: 6px 0 } .failure p { margin: 2px 0 } details.kind { margin: 4px 0 } details.kind > summary { cursor: pointer } \
    @media (max-width: 700px) { .line { grid-template-columns: 7.5rem minmax(4rem, 1fr) 3.6rem; font-size: 12px } }</style>\n";

fn cells(group: &Group) -> Vec<String> {
    let number = |value: Option<f64>| value.map_or("-".into(), |value| num::fixed(value, 1));
    vec![
        group.in_words(),
        if group.preventable { "yes" } else { "no" }.into(),
        group.cases.len().to_string(),
        number(group.speed_mps_max),
        group.cases.first().cloned().unwrap_or_default(),
    ]
}

/// Heads of a table of kinds.
const HEADS: [&str; 5] = ["kind of failure", "preventable", "scenes", "fastest, m/s", "worst scene"];

/// Returns what failed and why; empty if nothing did.
pub fn text(result: &SuiteResult, width: usize, command: &dyn Fn(&Played) -> String) -> String {
    let groups = groups(result);
    if groups.is_empty() {
        return String::new();
    }
    let heads = HEADS.map(String::from).to_vec();
    let rows = groups.iter().take(KINDS_MAX).map(cells).collect();
    let more = match groups.len().saturating_sub(KINDS_MAX) {
        0 => String::new(),
        more => format!("and {more} more kinds, which --json lists\n"),
    };
    let table = Aligned { indent: 0, labels: 1, words: 0, heads, rows }.text(width);
    let mut text = format!("failures: {}\n{table}{more}{SEVERITY}\n", headline(&groups));
    let explained = worst_first(result).into_iter().filter_map(|played| Some((played, played.why()?)));
    for (played, why) in explained.take(TOLD_MAX) {
        let _ = writeln!(text, "  {}: {}\n    {why}\n    {}", played.case, played.in_words(), command(played));
    }
    text
}

/// The same as an object.
pub fn object(result: &SuiteResult) -> Value {
    let groups = groups(result);
    json!({"headline": headline(&groups), "order": SEVERITY, "kinds": groups})
}

/// Returns the same as a piece of a page; `place` gives the place of a case among those that the page plays.
pub fn html(result: &SuiteResult, place: &dyn Fn(&str) -> Option<usize>) -> String {
    let groups = groups(result);
    if groups.is_empty() {
        return "<p>No failure.</p>\n".into();
    }
    let mut html = format!(
        "<h2>{}</h2>\n<p><small>{SEVERITY}; green: begun up to there, this manoeuvre avoids the contact</small></p>\n",
        escaped(&headline(&groups))
    );
    let (mut drawn, mut left) = (0, 0);
    for (k, group) in groups.iter().enumerate() {
        let open = if k == 0 { " open" } else { "" };
        let word = if group.preventable { "preventable, " } else { "" };
        let fast = group.speed_mps_max.map_or(String::new(), |mps| format!(", at most {} m/s", num::fixed(mps, 1)));
        let said = escaped(&format!("{}: {word}{}{fast}", counted(group.cases.len(), "scene"), group.in_words()));
        let _ = writeln!(html, "<details class=\"kind\"{open}><summary>{said}</summary>");
        for played in group.cases.iter().filter_map(|case| result.case(case)) {
            if drawn < DRAWN_MAX {
                html += &failure(played, place(&played.case))
            } else {
                left += 1
            }
            drawn += 1;
        }
        html += "</details>\n";
    }
    if left > 0 {
        let _ = writeln!(html, "<p>{} more are in the result, and not drawn here.</p>", counted(left, "failure"));
    }
    html
}

/// One failure with its time line.
fn failure(played: &Played, place: Option<usize>) -> String {
    let play = place.map_or(String::new(), |k| format!(" <button data-play=\"{k}\">play</button>"));
    let realism =
        played.realism.map_or(String::new(), |realism| format!("; realism of the others {}", num::fixed(realism, 2)));
    let mut html = format!(
        "<div class=\"failure\"><p><b>{}</b>{play}<br>{}</p>\n",
        escaped(&played.case),
        escaped(&format!("{}{realism}", played.in_words()))
    );
    if let (Some(timeline), Some(why)) = (&played.timeline, played.why()) {
        html += &picture(timeline, &why);
        let _ = writeln!(html, "<p>{}</p>", escaped(&why));
    }
    html + "</div>\n"
}

/// A time line as a picture: a row a thing, time to the right, the contact at the right end.
fn picture(timeline: &Timeline, why: &str) -> String {
    let before = |at_s: f64| (timeline.contact_s - at_s).max(0.0);
    let last = timeline.chances.iter().filter_map(|chance| chance.last_s);
    let all = timeline.visible_s.into_iter().chain(timeline.reaction.map(|of| of.at_s)).chain(last);
    let span_s = all.map(before).fold(1.0, f64::max).min(SPAN_MAX_S).ceil();
    // Share of the width at which a moment lies, percent.
    let share = |at_s: f64| 100.0 * (1.0 - (before(at_s) / span_s).min(1.0));
    let mut html = format!("<div class=\"line\" role=\"img\" aria-label=\"{}\">\n", escaped(why));
    let mut row = |name: &str, class: &str, bar: Option<(f64, f64)>, value: String| {
        let bar = bar.map_or(String::new(), |(from, to)| {
            format!(
                "<b class=\"{class}\" style=\"left:{}%;width:{}%\"></b>",
                num::fixed(from, 1),
                num::fixed(to - from, 1)
            )
        });
        let _ = writeln!(html, "<span>{name}</span><i>{bar}</i><span>{value}</span>");
    };
    let ago = |at_s: f64| format!("{} s", num::fixed(before(at_s), 1));
    let since = |at_s: f64| Some((share(at_s), 100.0));
    row("threat visible", "seen", timeline.visible_s.and_then(since), timeline.visible_s.map_or("never".into(), ago));
    let did = timeline.reaction.map_or("reaction", |of| match of.by {
        Reacted::Braked => "driver brakes",
        Reacted::SteeredLeft => "driver steers left",
        Reacted::SteeredRight => "driver steers right",
    });
    row(
        did,
        "did",
        timeline.reaction.and_then(|of| since(of.at_s)),
        timeline.reaction.map_or("none".into(), |of| ago(of.at_s)),
    );
    for chance in &timeline.chances {
        let bar = chance.last_s.map(|at_s| (0.0, share(at_s)));
        row(chance.by.in_words(), "helps", bar, chance.last_s.map_or("no help".into(), ago));
    }
    let step_s = if span_s > 4.0 { 2 } else { 1 };
    let ticks = (0..span_s as usize).step_by(step_s).map(|ago_s| {
        let name = if ago_s == 0 { "contact".to_string() } else { format!("−{ago_s} s") };
        format!("<u style=\"left:{}%\">{name}</u>", num::fixed(100.0 * (1.0 - ago_s as f64 / span_s), 1))
    });
    let ticks = ticks.collect::<String>();
    html + &format!("<span></span><i class=\"axis\">{ticks}</i><span></span>\n</div>\n")
}

/// Returns the row of a failure in a table: its kind, when it was seen and reacted to, the last chance.
pub fn row(played: &Played) -> Vec<String> {
    let number = |value: Option<f64>| value.map_or(String::new(), |value| num::fixed(value, 1));
    let timeline = played.timeline.as_ref();
    let before = |at_s: Option<f64>| number(timeline.and_then(|of| Some(of.contact_s - at_s?)));
    let last = timeline.and_then(Timeline::last_chance);
    vec![
        played.realism.map_or(String::new(), |realism| realism.to_string()),
        kind_of(played).unwrap_or_default(),
        before(timeline.and_then(|of| of.visible_s)),
        before(timeline.and_then(|of| of.reaction).map(|of| of.at_s)),
        last.map_or(String::new(), |chance| chance.by.in_words().to_string()),
        before(last.and_then(|chance| chance.last_s)),
    ]
}
