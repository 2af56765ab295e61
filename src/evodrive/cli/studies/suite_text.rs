//! A result in words, as a table and as CSV.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;

use crate::cli::studies::suite_failures;
use crate::evidence::aligned::Aligned;
use crate::evidence::tables::{Estimate, csv_line};
use crate::kernel::num;
use crate::suite::{Case, CaseOutcome, Played, RuleResult, Share, Suite, SuiteResult, Total};
use crate::text::counted;

/// Scenes that a list names before it counts.
const LISTED_MAX: usize = 20;

/// Counts the cases with a contact, by its class.
pub fn class_counts(cases: &[&Case]) -> String {
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    cases.iter().for_each(|case| *counts.entry(case.class()).or_insert(0) += 1);
    let words = counts.into_iter().map(|(class, count)| format!("{class} {count}"));
    words.collect::<Vec<_>>().join(", ")
}

/// A share with its interval.
pub fn share(share: Option<Share>) -> String {
    share.map_or("-".into(), |of| Estimate { interval: Some(of.interval), ..Estimate::plain(of.value) }.text(3))
}

/// A mean with its interval.
pub fn mean(mean: Option<Estimate>) -> String {
    mean.map_or("-".into(), |of| of.text(3))
}

/// Heads of a table of totals; a completion stands beside every crash rate.
pub const HEADS: [&str; 11] = [
    "by",
    "",
    "scenes",
    "driven",
    "faults",
    "crash rate",
    "preventable",
    "at fault",
    "off road",
    "arrived",
    "completion",
];

/// A row's cells; what this driver cannot play counts nowhere.
pub fn cells(total: &Total) -> Vec<String> {
    vec![
        total.by.to_string(),
        total.name.clone(),
        (total.scenes - total.unplayable).to_string(),
        total.driven.to_string(),
        total.faults.to_string(),
        share(total.crashes),
        share(total.preventable),
        share(total.at_fault),
        share(total.off_road),
        share(total.arrived_of_playable()),
        mean(total.completion),
    ]
}

/// The totals within a width. Rows of which this driver can play nothing are named in a line.
pub fn table(totals: &[Total], width: usize) -> String {
    let heads = HEADS.map(String::from).to_vec();
    let (with, without): (Vec<&Total>, Vec<&Total>) = totals.iter().partition(|total| total.can_be_played());
    let rows = with.into_iter().map(cells).collect();
    let text = Aligned { indent: 0, labels: 2, words: 0, heads, rows }.text(width);
    match without.as_slice() {
        [] => text,
        some => {
            let names: Vec<String> = some.iter().map(|total| format!("{} {}", total.by, total.name)).collect();
            format!("{text}not playable by this driver: {}\n", names.join(", "))
        }
    }
}

/// Returns how many cases this driver cannot play, which is said before any number; empty if it plays all.
pub fn playable(totals: &[Total]) -> String {
    match totals.first() {
        Some(all) if all.unplayable > 0 => {
            format!(
                "{} of {} cannot be played by this driver, and count nowhere below",
                all.unplayable,
                counted(all.scenes, "case")
            )
        }
        _ => String::new(),
    }
}

/// Explanation of the numbers.
pub const NOTE: &str = "rates are shares of driven scenes with 95 % Wilson intervals; preventable: braking or swerving in time avoids the \
                        contact, and it is no ram from behind; at fault: by nuPlan's rule; arrived: of the scenes that could be played those driven to the route's end without a contact; completion: mean share of the route, 95 % bootstrap; class: of the contact that the suite's own driver had";

/// The rules and the scenes that broke them, each with the command that plays it.
pub fn rules(rules: &[RuleResult], result: &SuiteResult, command: &dyn Fn(&Played) -> String) -> String {
    let mut text = String::new();
    if rules.is_empty() {
        text.push_str(
            "no threshold is set, so contacts leave the exit code at 0: --max-preventable and the like set one\n",
        );
    }
    for rule in rules {
        let word = if rule.holds { "holds" } else { "BROKEN" };
        let _ = writeln!(text, "{word}: {}: expected {}, found {}", rule.rule, rule.expected, rule.found);
        if rule.holds {
            continue;
        }
        let scenes = rule.scenes.iter().filter_map(|id| result.case(id));
        for played in scenes.take(LISTED_MAX) {
            let _ = writeln!(text, "  {}: {}\n    {}", played.case, played.in_words(), command(played));
        }
        if let Some(more) = rule.scenes.len().checked_sub(LISTED_MAX).filter(|more| *more > 0) {
            let _ = writeln!(text, "  and {more} more, which --json lists");
        }
    }
    text
}

/// Returns the number of cases, and out of how many if that is not the whole suite.
pub fn of_all(cases: usize, suite: &Suite) -> String {
    let all = counted(suite.cases.len(), "case");
    if cases == suite.cases.len() { all } else { format!("{cases} of {all}") }
}

/// The cases of a suite that a result does not hold, counted by family.
pub fn left_out(result: &SuiteResult, suite: &Suite) -> String {
    let held: BTreeSet<&str> = result.cases.iter().map(|played| played.case.as_str()).collect();
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    let others = suite.cases.iter().filter(|case| !held.contains(case.id.as_str()));
    others.for_each(|case| *counts.entry(&case.family).or_insert(0) += 1);
    let families: Vec<String> = counts.iter().map(|(family, count)| format!("{family} {count}")).collect();
    match counts.values().sum::<usize>() {
        0 => String::new(),
        count => format!("not asked for: {} of the suite ({})\n", counted(count, "case"), families.join(", ")),
    }
}

/// Returns what was not driven, by reason.
pub fn not_driven(result: &SuiteResult) -> String {
    let mut reasons: BTreeMap<String, Vec<&str>> = BTreeMap::new();
    for played in &result.cases {
        let reason = match &played.came {
            CaseOutcome::Driven(_) => continue,
            // The result has what differs from scene to scene.
            CaseOutcome::Fault { kind, .. } => format!("fault, {}", kind.name()),
            CaseOutcome::Unplayable { reason } => format!("cannot be played: {}", reason.replace(&played.scene, "..")),
        };
        reasons.entry(reason).or_default().push(&played.case);
    }
    let line = |(reason, cases): (String, Vec<&str>)| {
        format!("{}: {reason} (first {})\n", counted(cases.len(), "scene"), cases.first().unwrap_or(&""))
    };
    reasons.into_iter().map(line).collect()
}

/// A scene a line.
pub fn csv(result: &SuiteResult) -> String {
    let heads = [
        "case",
        "scene",
        "family",
        "cluster",
        "class",
        "came",
        "end",
        "completion",
        "seconds",
        "contact",
        "with_adversary",
        "preventable",
        "at_fault",
        "drivers_avoid",
        "drivers",
        "contact_s",
        "relative_speed_mps",
        "reason",
        "realism",
        "failure",
        "seen_before_s",
        "reacted_before_s",
        "last_chance",
        "last_chance_before_s",
    ];
    let mut text = csv_line(&heads.map(String::from));
    for played in &result.cases {
        let own = [&played.case, &played.scene, &played.family, &played.cluster, &played.class].map(Clone::clone);
        text.push_str(&csv_line(&[own.to_vec(), of_came(&played.came), suite_failures::row(played)].concat()));
    }
    text
}

fn of_came(came: &CaseOutcome) -> Vec<String> {
    let nothing = |count: usize| vec![String::new(); count];
    match came {
        CaseOutcome::Driven(drive) => {
            let end = serde_json::to_value(drive.end).ok().and_then(|end| end.as_str().map(String::from));
            let met = drive.contact.map(|met| {
                vec![
                    met.class.name().to_string(),
                    met.adversary.to_string(),
                    drive.is_preventable().to_string(),
                    drive.is_at_fault().map_or(String::new(), |is| is.to_string()),
                    met.jury.map_or(String::new(), |jury| jury.avoid().to_string()),
                    met.jury.map_or(String::new(), |jury| jury.of().to_string()),
                    met.time_s.to_string(),
                    met.relative_speed_mps.to_string(),
                ]
            });
            let seconds = drive.steps as f64 * crate::scene::DT_S;
            let own =
                vec!["driven".into(), end.unwrap_or_default(), drive.completion.to_string(), num::fixed(seconds, 1)];
            [own, met.unwrap_or_else(|| nothing(8)), nothing(1)].concat()
        }
        CaseOutcome::Fault { kind, reason } => {
            [vec![kind.name().to_string()], nothing(11), vec![reason.clone()]].concat()
        }
        CaseOutcome::Unplayable { reason } => [vec!["unplayable".into()], nothing(11), vec![reason.clone()]].concat(),
    }
}
