//! The agreement of two runs as text.

use std::fmt::Write;

use super::count::{Agreement, Interval, Report};
use super::disagreement::Disagreement;

/// Tables in Markdown, then the disagreements one by one.
pub fn text(report: &Report) -> String {
    let [first, second] = &report.backends;
    let mut out = format!("Contact of the ego, the same rollouts in {first} (first) and {second} (second)\n\n");
    out.push_str("| rollouts of | n | both | first only | second only | neither | agreement % | kappa | same partner | time apart s | ego apart m, 1 s before | 3 s | 5 s |\n");
    out.push_str("|---|---|---|---|---|---|---|---|---|---|---|---|---|\n");
    for row in &report.rows {
        let _ = writeln!(out, "{}", line(row));
    }
    out.push_str(
        "\nIn brackets: the middle 95 % of 1000 draws of scenes. Times and distances are medians (of n rollouts).\n",
    );
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
    let apart: Vec<String> = row.ego_apart_m.iter().map(|(_, apart, n)| of_n(*apart, *n)).collect();
    format!(
        "| {} | {} | {both} | {first} | {second} | {neither} | {:.1} [{:.1}, {:.1}] | {kappa} | {} | {} | {} |",
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

fn of_n(value: Option<f64>, n: usize) -> String {
    value.map_or("-".to_string(), |value| format!("{value:.2} ({n})"))
}

fn disagreement(one: &Disagreement) -> String {
    let metres = |x: Option<f64>| x.map_or("-".to_string(), |x| format!("{x:.2} m"));
    let cause = serde_json::to_value(one.cause).ok().and_then(|v| v.as_str().map(str::to_string)).unwrap_or_default();
    format!(
        "- {} {} ({}, {}): contact in the {} with {}{} at {:.2} s; the other ended {}, nearest {}, egos {} apart: {cause}",
        one.row,
        one.scene,
        one.ego,
        one.program,
        one.contact_in,
        one.with.with,
        if one.with.adversary { " (adversary)" } else { "" },
        one.with.time_s(),
        one.other_end,
        metres(one.other_distance_m_min),
        metres(one.ego_apart_m),
    )
}
