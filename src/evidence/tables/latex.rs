//! A table as LaTeX with booktabs, shaped like the paper's; graphicx scales it to the line.

use super::cells::{self, Spelling};
use super::layout::{Column, Part, Table};

const SPELLING: Spelling = Spelling {
    text: escaped,
    none: "--",
    paper: "\\quad\\textit{paper}",
    interval: |number, interval| format!("\\evointerval{{{number}}}{{{}}}", escaped(&interval)),
    figure: |figure| format!("\\textit{{{figure}}}"),
};

/// An interval stands below its number: beside it, tables of many columns would have to shrink until nobody can read them. Notes are a
/// command, so that a paper can set them otherwise.
const HEAD: &str = "% needs \\usepackage{booktabs} and \\usepackage{graphicx}\n\
    \\providecommand{\\evointerval}[2]{\\begin{tabular}[t]{@{}r@{}}#1\\\\[-0.4ex]{\\tiny #2}\\end{tabular}}\n\
    \\providecommand{\\evonote}[1]{\\par\\smallskip\\parbox{\\linewidth}{\\raggedright #1}}\n";

/// Columns and counts of a table that fit the width of a page, by their keys.
fn of_a_page_alone(name: &str) -> Option<Vec<&'static str>> {
    // What every table says of parent and evolved program, and what the numbers rest on.
    let (attacks, rest) = (["parent_attack", "evolved_attack"], ["scenes", "held_out_scenes", "seeds"]);
    let own: &[&str] = match name {
        "metadrive-main" | "metadrive-policy" => {
            &["parent_rp_pct", "evolved_rp_pct", "attack_change", "rp_change_pp", "pf_area_at_3_pct"]
        }
        "metadrive-contacts" => &["attack", "avoidable_contact", "met_anyway", "adversary_contact", "any_contact"],
        "metadrive-readings" => &["published_parent", "published_evolved", "preventable_parent", "preventable_evolved"],
        "metadrive-gains" => {
            &["floor_low", "floor_middle", "floor_high", "area_change", "over_random_proposals", "over_shuffled_labels"]
        }
        "safebench-main" => &["parent_ars", "evolved_ars", "attack_change_pct", "ars_change_pp", "pf_area_at_3_pct"],
        "safebench-rounds" => &[
            "straight_obstacle",
            "turning_obstacle",
            "lane_changing",
            "vehicle_passing",
            "red_light_running",
            "unprotected_left_turn",
            "right_turn",
            "crossing_negotiation",
            "average",
        ],
        "safebench-held-out" => &["parent_ars", "evolved_ars", "attack_change_pct", "ars_change_pp"],
        "proposals" => &[
            "readable_at_once_pct",
            "declined_pct",
            "refused_pct",
            "not_simulated_pct",
            "evaluated_pct",
            "accepted_pct",
            "attempts",
        ],
        "attack-only" | "without" => &[
            "attack",
            "realism",
            "pf_area_at_3_pct",
            "attack_change",
            "attack_p_holm",
            "realism_change",
            "realism_p_holm",
        ],
        "kwidth" => &["simulated", "validated", "accepted_of_simulated_pct", "speedup", "attack", "realism"],
        _ => return None,
    };
    Some(attacks.into_iter().chain(own.iter().copied()).chain(rest).collect())
}

/// The table with what fits the width of a page.
pub fn of_a_page(table: &Table) -> Table {
    of_a_page_alone(table.name).map_or_else(|| table.clone(), |keys| table.with(&keys))
}

/// A `table*` environment a part; the notes stand below the last.
pub fn latex(table: &Table) -> String {
    let mut out = String::from(HEAD);
    let printed = table.printed();
    for (at, one) in printed.iter().enumerate() {
        let notes = if at + 1 == printed.len() { table.notes.as_slice() } else { &[] };
        part(&mut out, table, one, notes);
    }
    out
}

fn part(out: &mut String, table: &Table, part: &Part, notes: &[String]) {
    let intervals =
        part.printed().flat_map(|row| &row.cells).any(|cell| cell.ours.is_some_and(|of| of.interval.is_some()));
    let below = if intervals { ". Below a number: its 95\\,\\% bootstrap interval" } else { "" };
    out.push_str("\\begin{table*}[!htbp]\n\\centering\n\\scriptsize\n\\setlength{\\tabcolsep}{3pt}\n");
    out.push_str(&format!("\\caption{{{}{below}.}}\n", escaped(&part.title)));
    out.push_str(&format!("\\label{{tab:evodrive-{}}}\n", part.name));
    out.push_str("\\resizebox{\\linewidth}{!}{%\n");
    let aligned = [(table.labels.len(), "l"), (table.columns.len() + table.counts.len(), "r"), (1, "l")];
    let aligned: String = aligned.map(|(columns, side)| side.repeat(columns)).concat();
    out.push_str(&format!("\\begin{{tabular}}{{{aligned}}}\n\\toprule\n"));
    out.push_str(&group_heads(table));
    let (before, after) = cells::outer_heads(table);
    line(out, before.into_iter().chain(table.columns.iter().map(head)).chain(after).collect());
    out.push_str("\\midrule\n");
    cells::lines(table, part, &SPELLING).into_iter().for_each(|cells| line(out, cells));
    out.push_str("\\bottomrule\n\\end{tabular}}\n");
    let source = part.source.map(|label| format!("Of the paper: its table \\texttt{{{}}}.", escaped(label)));
    for note in source.into_iter().chain(notes.iter().map(|note| escaped(note))) {
        out.push_str(&format!("\\evonote{{{note}}}\n"));
    }
    out.push_str("\\end{table*}\n");
}

/// Heads over neighbouring columns of one group, with their rules; empty without groups.
fn group_heads(table: &Table) -> String {
    if table.columns.iter().all(|column| column.group.is_empty()) {
        return String::new();
    }
    let (mut cells, mut rules) = (vec![String::new(); table.labels.len()], String::new());
    let mut first = table.labels.len() + 1;
    for group in table.columns.chunk_by(|a, b| a.group == b.group) {
        let last = first + group.len() - 1;
        cells.push(format!("\\multicolumn{{{}}}{{c}}{{{}}}", group.len(), escaped(group[0].group)));
        rules.push_str(&format!("\\cmidrule(lr){{{first}-{last}}}"));
        first = last + 1;
    }
    cells.extend(vec![String::new(); table.counts.len() + 1]);
    let mut out = String::new();
    line(&mut out, cells);
    format!("{out}{rules}\n")
}

fn head(column: &Column) -> String {
    let arrow = match column.upward {
        Some(true) => "$\\uparrow$",
        Some(false) => "$\\downarrow$",
        None => "",
    };
    format!("{}{arrow}", escaped(column.head))
}

fn line(out: &mut String, cells: Vec<String>) {
    out.push_str(&format!("{} \\\\\n", cells.join(" & ")));
}

/// Text that LaTeX prints as it stands. A bracket is kept from being read as the option of a line's end.
pub fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' | '%' | '$' | '#' | '_' | '{' | '}' => out.extend(['\\', c]),
            '\\' => out.push_str("\\textbackslash{}"),
            '~' => out.push_str("\\textasciitilde{}"),
            '^' => out.push_str("\\textasciicircum{}"),
            '<' => out.push_str("\\textless{}"),
            '>' => out.push_str("\\textgreater{}"),
            '|' => out.push_str("\\textbar{}"),
            '"' => out.push_str("''"),
            '[' | ']' => out.extend(['{', c, '}']),
            c if c.is_control() => out.push(' '),
            c => out.push(c),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::super::tests::{CAT, add, run};
    use super::super::{NAMED, metadrive_policy, safebench_tests};
    use super::*;

    /// A head of a column that is printed, with its group.
    fn heads(table: &Table) -> Vec<(String, String)> {
        let (before, after) = cells::outer_heads(table);
        let outer = before.into_iter().chain(after).map(|head| (String::new(), head));
        let of = |column: &Column| (column.group.to_string(), column.head.to_string());
        outer.chain(table.columns.iter().map(of)).collect()
    }

    #[test]
    fn what_fits_a_page_is_of_the_table_and_no_head_stands_twice() {
        let mut metadrive = run("made", &[("actor", "scripted")]);
        add(&mut metadrive, &CAT);
        let safebench = safebench_tests::recorded_unseen();
        let mut made = 0;
        for (name, make) in NAMED {
            let Some(table) = [&metadrive, &safebench].into_iter().find_map(|run| make(std::slice::from_ref(run)).ok())
            else {
                continue;
            };
            made += 1;
            let all = heads(&table);
            assert_eq!(all.iter().collect::<std::collections::BTreeSet<_>>().len(), all.len(), "{name}: {all:?}");
            let page = of_a_page(&table);
            assert!(heads(&page).len() <= 16, "{name}: {:?}", heads(&page));
            if let Some(keys) = of_a_page_alone(name) {
                let unknown: Vec<&&str> = keys.iter().filter(|key| !page.keys().contains(key)).collect();
                // Some have no parent beside the evolved program, and every one counts its scenes under one of two names.
                let general = ["parent_attack", "evolved_attack", "scenes", "held_out_scenes"];
                assert!(unknown.iter().all(|key| general.contains(key)), "{name} has no {unknown:?}");
                assert!(page.keys().len() < table.keys().len(), "{name}");
            }
            let text = latex(&page);
            let body = text.lines().filter(|line| line.ends_with(" \\\\") && !line.contains("multicolumn"));
            let cells: Vec<usize> = body.map(|line| line.matches(" & ").count() + 1).collect();
            assert!(!cells.is_empty() && cells.iter().all(|count| *count == heads(&page).len()), "{name}: {cells:?}");
        }
        assert!(made >= 10, "{made} tables");
    }

    #[test]
    fn a_caption_and_the_notes_are_text_that_latex_prints() {
        let mut made = run("mine_100%", &[("actor", "scripted")]);
        add(&mut made, &CAT);
        let text = latex(&metadrive_policy(&[made]).unwrap());
        let caption =
            "\\caption{Policy-specific results in MetaDrive. Below a number: its 95\\,\\% bootstrap interval.}";
        assert!(text.contains(caption), "{text}");
        assert!(text.contains("\\evonote{Run mine\\_100\\%"), "{text}");
    }

    #[test]
    fn every_character_that_latex_reads_is_escaped() {
        assert_eq!(escaped("10.66% & a_b #1 $x$ {y}"), "10.66\\% \\& a\\_b \\#1 \\$x\\$ \\{y\\}");
        assert_eq!(escaped("\\ ~ ^"), "\\textbackslash{} \\textasciitilde{} \\textasciicircum{}");
        assert_eq!(escaped("R >= 0.95 | <b>"), "R \\textgreater{}= 0.95 \\textbar{} \\textless{}b\\textgreater{}");
        assert_eq!(escaped("[1]\n\"q\""), "{[}1{]} ''q''");
    }
}
