//! The numbers of the paper's text, as macros: `\evo{table:row:column}` gives the number as the table prints it, with its interval.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;

use crate::evidence::claims::{Judgement, Verdict};
use crate::evidence::tables::{Table, escaped};

/// Head of the file: a name that is not there stops LaTeX. `\evo` prints a number with its interval, `\evonumber` the number
/// alone, `\evostack` the interval below it.
const HEAD: &str = r"% Made by `evodrive paper --bless`; every number of the text is one of these.
\newcommand{\evo}[1]{\ifcsname evo:#1\endcsname\csname evo:#1\endcsname\else\errmessage{no number of that name: #1}\fi}
\providecommand{\evointerval}[2]{\begin{tabular}[t]{@{}r@{}}#1\\[-0.5ex]{\fontsize{6}{7}\selectfont #2}\end{tabular}}
\def\evocut#1 #2\evoend{#1}
\def\evorest#1 #2\evoend{#2}
\newcommand{\evoparts}[2]{\ifcsname evo:#2\endcsname\expandafter\expandafter\expandafter#1\csname evo:#2\endcsname{} \evoend\else\errmessage{no number of that name: #2}\fi}
\newcommand{\evonumber}[1]{\evoparts{\evocut}{#1}}
\newcommand{\evostack}[1]{\evointerval{\evonumber{#1}}{\evoparts{\evorest}{#1}}}
";

/// Every cell of these tables under the name of each, counts of the claims by verdict, and what was read from other goldens.
pub fn numbers(tables: &[(String, Table)], claims: Option<&Judgement>, others: &BTreeMap<String, String>) -> String {
    let mut all: BTreeMap<String, String> = others.clone();
    for (name, table) in tables {
        cells(&mut all, name, table);
        for run in &table.runs {
            for (name, count) in [
                ("attempts", run.attempts),
                ("rollouts", run.rollouts),
                ("evolution_scenes", run.evolution_scenes),
                ("held_out_scenes", run.held_out_scenes),
                ("epochs", run.epochs as usize),
            ] {
                all.insert(format!("run:{}:{name}", run.name), count.to_string());
            }
            all.insert(format!("run:{}:root", run.name), run.root.chars().take(8).collect());
        }
    }
    if let Some(claims) = claims {
        for verdict in Verdict::ALL {
            let count = claims.claims.iter().filter(|claim| claim.verdict == verdict).count();
            all.insert(format!("claims:{}", verdict.words()), count.to_string());
        }
        all.insert("claims:all".into(), claims.claims.len().to_string());
        all.insert("claims:tested".into(), claims.tested.to_string());
        all.insert("claims:level".into(), claims.level.to_string());
    }
    let mut out = HEAD.to_string();
    for (name, number) in all {
        let _ = writeln!(out, "\\expandafter\\def\\csname evo:{name}\\endcsname{{{}}}", escaped(&number));
    }
    out
}

/// The macros of a file by the names of their numbers.
fn macros(text: &str) -> BTreeMap<String, String> {
    let named = text.lines().filter_map(|line| {
        let (number, _) = line.strip_prefix("\\expandafter\\def\\csname evo:")?.split_once("\\endcsname")?;
        Some((number.to_string(), line.to_string()))
    });
    named.collect()
}

/// Returns the beginning of the names of a table's numbers.
fn prefix(table: &str) -> String {
    format!("{table}:")
}

/// The numbers of one table, a file as `numbers` makes it, in the place of those that `all` has of it; those of runs that it names go with them.
pub fn numbers_with(all: &str, table: &str, new: &str) -> String {
    let own = prefix(table);
    let mut lines = macros(all);
    lines.retain(|number, _| !number.starts_with(&own));
    lines.extend(macros(new));
    let mut out = HEAD.to_string();
    lines.values().for_each(|line| {
        let _ = writeln!(out, "{line}");
    });
    out
}

/// The names of a table's numbers that `all` has otherwise, or not at all, or has and `new` has not.
pub fn outdated(all: &str, table: &str, new: &str) -> BTreeSet<String> {
    let own = prefix(table);
    let of = |text| -> BTreeSet<(String, String)> {
        macros(text).into_iter().filter(|(number, _)| number.starts_with(&own)).collect()
    };
    of(all).symmetric_difference(&of(new)).map(|(number, _)| number.clone()).collect()
}

fn cells(all: &mut BTreeMap<String, String>, name: &str, table: &Table) {
    for row in table.rows() {
        let first = row.labels.first().map(String::as_str).unwrap_or_default();
        let several = table.rows().filter(|other| other.labels.first() == row.labels.first()).count() > 1;
        for cell in &row.cells {
            let Some(ours) = cell.ours else { continue };
            let form = cell.column.form;
            let interval = ours.interval.map_or(String::new(), |of| format!(" {}", form.interval(of)));
            let number = format!("{}{interval}", form.number(ours.value));
            // Under its first label the first row counts; where more rows have it, each stands under all its labels too.
            if several {
                let name = format!("{name}:{}:{}", row.labels.join("/"), cell.column.key);
                all.entry(name).or_insert(number.clone());
            }
            all.entry(format!("{name}:{first}:{}", cell.column.key)).or_insert(number);
        }
        for (head, count) in table.counts.iter().zip(&row.counts) {
            all.entry(format!("{name}:{first}:{}", head.key)).or_insert(count.to_string());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evidence::tables::metadrive_policy;
    use crate::evidence::tables::tests::{CAT, End, add, run};

    #[test]
    fn every_cell_has_its_macro_and_none_can_break_the_text() {
        let mut recorded = run("made", &[("actor", "scripted")]);
        add(&mut recorded, &CAT);
        let table = metadrive_policy(&[recorded]).unwrap();
        let text =
            numbers(&[("policy".into(), table)], None, &BTreeMap::from([("other".to_string(), "5 %".to_string())]));
        assert!(text.contains("csname evo:policy:CAT:evolved_attack\\endcsname{0.500 "), "{text}");
        assert!(!text.contains("CAT/IDM"), "one row of a name needs no more than it");
        assert!(text.contains("evo:other\\endcsname{5 \\%}") && text.contains("evo:run:made:held_out_scenes"));
    }

    #[test]
    fn numbers_of_one_table_take_the_place_of_its_old_ones_and_no_other_moves() {
        let of = |evolved: f64| {
            let mut recorded = run("made", &[("actor", "scripted")]);
            add(&mut recorded, &End { pf_area_at_3_pct: evolved, ..CAT });
            metadrive_policy(&[recorded]).unwrap()
        };
        let both =
            |first: f64| numbers(&[("one".into(), of(first)), ("one-more".into(), of(2.0))], None, &BTreeMap::new());
        let alone = |evolved: f64| numbers(&[("one".into(), of(evolved))], None, &BTreeMap::new());
        assert_eq!(numbers_with(&both(1.0), "one", &alone(5.0)), both(5.0));
        assert_ne!(both(1.0), both(5.0));
        let outdated = |all: &str, new: &str| outdated(all, "one", new).into_iter().collect::<Vec<_>>();
        assert!(outdated(&both(5.0), &alone(5.0)).is_empty());
        assert_eq!(outdated(&both(1.0), &alone(5.0)), ["one:CAT:pf_area_at_3_pct"]);
        let lacking = alone(5.0).replace("evo:one:CAT:pf_area_at_3_pct", "evo:one:BUS:pf_area_at_3_pct");
        let names = ["one:BUS:pf_area_at_3_pct", "one:CAT:pf_area_at_3_pct"];
        assert_eq!(
            (outdated(&both(5.0), &lacking), outdated(&lacking, &alone(5.0))),
            (names.map(String::from).to_vec(), names.map(String::from).to_vec())
        );
    }

    #[test]
    fn rows_of_one_method_are_told_apart_by_all_their_labels() {
        let mut recorded = run("made", &[("actor", "scripted")]);
        add(&mut recorded, &CAT);
        add(&mut recorded, &End { id: "cat-sac", ego: "learned", pf_area_at_3_pct: 7.0, ..CAT });
        let text = numbers(&[("policy".into(), metadrive_policy(&[recorded]).unwrap())], None, &BTreeMap::new());
        let number = |row: &str| text.split(&format!("evo:policy:{row}:pf_area_at_3_pct\\endcsname")).nth(1).unwrap();
        assert!(number("CAT").starts_with("{+12.0") && number("CAT/IDM").starts_with("{+12.0"));
        assert!(number("CAT/RL").starts_with("{+7.0"), "{text}");
    }
}
