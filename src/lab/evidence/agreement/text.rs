//! The agreement of two runs as text.

use std::fmt::Write;

use super::count::{Agreement, Change, EgoApart, Judged, Report};
use super::disagreement::Disagreement;
use super::interval::Interval;
use super::transfer::{Difference, LABELS, Signs, signs};

/// Tables in Markdown, then the disagreements one by one.
pub fn text(report: &Report) -> String {
    let [first, second] = &report.backends;
    let what = if report.same_commands { "rollouts" } else { "programs" };
    let mut out = format!("Contact of the ego, the same {what} in {first} (first) and {second} (second)\n\n");
    out.push_str("| rollouts of | n | both | first only | second only | neither | agreement % | kappa | same partner | time apart s | ego apart m, 1 s before | 3 s | 5 s |\n");
    out.push_str("|---|---|---|---|---|---|---|---|---|---|---|---|---|\n");
    for row in &report.rows {
        let _ = writeln!(out, "{}", line(row));
    }
    out.push_str(
        "\nIn brackets: the middle 95 % of 1000 draws of scenes. Times are medians, distances medians / 90th percentiles (of n \
         rollouts). `all`, families and clusters count the programs that lineages started from, and scenes without one.\n",
    );
    if !report.same_commands {
        out.push_str("Each plans around another drive of the ego, so the commands differ: no disagreement is a simulator's alone.\n");
    }
    out.push_str(&labels(report));
    out.push_str(&changes(report));
    out.push_str(&transferred(report));
    let _ = writeln!(out, "\nDisagreements: {}", report.disagreements.len());
    for one in &report.disagreements {
        let _ = writeln!(out, "{}", disagreement(one));
    }
    if !report.left_out.is_empty() {
        let _ = writeln!(out, "\nLeft out, because one of them has no rollout: {}", report.left_out.len());
        for reason in &report.left_out {
            let _ = writeln!(out, "- {reason}");
        }
    }
    out
}

/// The labels that a search maximises, row by row.
fn labels(report: &Report) -> String {
    let mut out = String::from(
        "\nWhat a search maximises, in the first and the second\n\n| rollouts of | published attack | published agreement % | published kappa | \
         preventable attack | preventable agreement % | preventable kappa | same class | same striker | same avoidability | relative speed more m/s | \
         apart m/s |\n|---|---|---|---|---|---|---|---|---|---|---|---|\n",
    );
    for row in &report.rows {
        let of = &row.labels;
        let share = |same: usize, all: usize| if all == 0 { "-".to_string() } else { format!("{same} of {all}") };
        let speed = |mps: Option<f64>| mps.map_or("-".to_string(), |mps| format!("{mps:.2}"));
        let _ = writeln!(
            out,
            "| {}{} | {} | {} | {} | {} | {} | {} | {} |",
            row.of.prefix(),
            row.row,
            judged(&of.published),
            judged(&of.preventable),
            share(of.same_class, of.contacts),
            share(of.same_striker, of.contacts),
            share(of.same_avoidability, of.assessed),
            speed(of.relative_speed_more_mps),
            speed(of.relative_speed_apart_mps),
        );
    }
    out.push_str(
        "\nPublished: a contact with an adversary whom the ego does not meet without the program. Preventable: one of these that a careful \
         ego could have avoided, rams from behind left out. Class, striker, avoidability and relative speed: of the contacts with the \
         same road user in both; speeds are medians, of the second less the first and of the size of that difference.\n",
    );
    out
}

/// Successes in either, agreement, kappa.
fn judged(judged: &Judged) -> String {
    let [both, first, second, _] = judged.confusion;
    let Interval { value, low, high } = judged.agreement;
    let (value, low, high) = (100.0 * value, 100.0 * low, 100.0 * high);
    format!("{}; {} | {value:.1} [{low:.1}, {high:.1}] | {}", both + first, both + second, kappa(judged.kappa))
}

/// Causes by what mends them.
fn changes(report: &Report) -> String {
    let Some(all) = report.rows.first().filter(|_| !report.changes.is_empty()) else { return String::new() };
    let [_, first, second, _] = all.contact.confusion;
    let (disagree, agree) = (first + second, all.rollouts - first - second);
    let mut out = format!(
        "\nThe same commands in our plant with one option changed: {disagree} disagreements to mend, {agree} rollouts to break\n\n\
         | changed | mended | mended % | broken | agreement % | kappa |\n|---|---|---|---|---|---|\n"
    );
    for Change { change, mended, broken, agreement, kappa, .. } in &report.changes {
        let kappa = kappa.map_or("-".to_string(), |kappa| format!("{kappa:.2}"));
        let share = if disagree == 0 { 0.0 } else { 100.0 * *mended as f64 / disagree as f64 };
        let agreement = 100.0 * agreement;
        let _ = writeln!(out, "| {change} | {mended} | {share:.0} | {broken} | {agreement:.1} | {kappa} |");
    }
    out.push_str(
        "\nMended: disagreements about contact that are none with this change. Broken: rollouts that disagree only with it. A change that \
         mends no more than it breaks moves the edge of a contact and is no cause.\n",
    );
    out
}

/// Describes what evolution gained in the one simulator and in the other.
fn transferred(report: &Report) -> String {
    if report.transfers.is_empty() {
        return String::new();
    }
    let mut out = String::from(
        "\nWhat evolved programs gain over the parents of their families, in the first and the second\n\n| evolved | n |",
    );
    for label in LABELS {
        let _ = write!(out, " {label}: first | {label}: second |");
    }
    let _ = writeln!(out, "\n|---|---|{}", "---|".repeat(2 * LABELS.len()));
    for row in &report.transfers {
        let _ = write!(out, "| {} | {} |", row.evolved, row.rollouts);
        for gain in &row.gains {
            let _ = write!(out, " {} | {} |", moved(&gain.first), moved(&gain.second));
        }
        out.push('\n');
    }
    out.push_str(
        "\nScenes of the parent and of the evolved program; the difference in percentage points, with the middle 95 % of 1000 draws of scenes. \
         Differences that are not zero in the first have in the second",
    );
    let said = LABELS.iter().enumerate().map(|(place, label)| {
        let Signs { same, none, other } = signs(&report.transfers, place);
        format!(" for {label} the same sign in {same}, none in {none}, the other in {other}")
    });
    let _ = writeln!(out, "{}.", said.collect::<Vec<_>>().join(";"));
    out
}

fn moved(of: &Difference) -> String {
    let Interval { value, low, high } = of.gain;
    let (value, low, high) = (100.0 * value, 100.0 * low, 100.0 * high);
    format!("{} to {}: {value:+.1} [{low:+.1}, {high:+.1}]", of.parent, of.evolved)
}

fn kappa(kappa: Option<Interval>) -> String {
    kappa.map_or("-".to_string(), |k| format!("{:.2} [{:.2}, {:.2}]", k.value, k.low, k.high))
}

fn line(row: &Agreement) -> String {
    let [both, first, second, neither] = row.contact.confusion;
    let percent = |x: f64| 100.0 * x;
    let Interval { value, low, high } = row.contact.agreement;
    let kappa = kappa(row.contact.kappa);
    let apart: Vec<String> = row.ego_apart.iter().map(of_n).collect();
    format!(
        "| {}{} | {} | {both} | {first} | {second} | {neither} | {:.1} [{:.1}, {:.1}] | {kappa} | {} | {} | {} |",
        row.of.prefix(),
        row.row,
        row.rollouts,
        percent(value),
        percent(low),
        percent(high),
        if both == 0 { "-".to_string() } else { format!("{} of {both}", row.same_partner) },
        row.contact_time_apart_s.map_or("-".to_string(), |s| format!("{s:.2}")),
        apart.join(" | "),
    )
}

fn of_n(apart: &EgoApart) -> String {
    match (apart.median_m, apart.p90_m) {
        (Some(median), Some(p90)) => format!("{median:.2} / {p90:.2} ({})", apart.rollouts),
        _ => "-".to_string(),
    }
}

fn disagreement(one: &Disagreement) -> String {
    let metres = |x: Option<f64>| x.map_or("-".to_string(), |x| format!("{x:.2} m"));
    let cause = serde_json::to_value(one.cause).ok().and_then(|v| v.as_str().map(str::to_string)).unwrap_or_default();
    let mended = match &one.mended_by[..] {
        [] => String::new(),
        changes => format!("; mended by {}", changes.join(", ")),
    };
    format!(
        "- {} {} ({}): contact in the {} with {}{} at {:.2} s; the other ended {}, nearest {}, egos {} apart: {cause}{mended}",
        one.program,
        one.scene,
        one.ego,
        one.contact_in,
        one.with.with,
        if one.with.adversary { " (adversary)" } else { "" },
        one.with.time_s(),
        one.other_end,
        metres(one.other_distance_m_min),
        metres(one.ego_apart_m),
    )
}
