//! The agreement of two runs as text.

use std::fmt::Write;

use super::count::{Agreement, EgoApart, Interval, Report};
use super::disagreement::Disagreement;

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

fn line(row: &Agreement) -> String {
    let [both, first, second, neither] = row.confusion;
    let percent = |x: f64| 100.0 * x;
    let Interval { value, low, high } = row.agreement;
    let kappa = row.kappa.map_or("-".to_string(), |k| format!("{:.2} [{:.2}, {:.2}]", k.value, k.low, k.high));
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
    format!(
        "- {} {} ({}): contact in the {} with {}{} at {:.2} s; the other ended {}, nearest {}, egos {} apart: {cause}",
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
