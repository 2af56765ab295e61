//! Numbers of the Markdown tables among the goldens, under names like those of tables that are made anew: what a text says of a study whose
//! runs the paper does not carry out again.

use std::collections::BTreeMap;

/// Beginning of the paper's own rows.
const PAPER: &str = "· paper";

/// A table of a Markdown page.
struct Read<'t> {
    heads: Vec<&'t str>,
    /// Number of columns that name the row.
    names: usize,
    rows: Vec<Vec<&'t str>>,
}

fn cells(line: &str) -> Vec<&str> {
    line.trim().trim_start_matches('|').trim_end_matches('|').split('|').map(str::trim).collect()
}

/// The tables of a page. Numbers are set to the right; where nothing is, the first column alone names the row.
fn tables(page: &str) -> Vec<Read<'_>> {
    let lines: Vec<&str> = page.lines().collect();
    let mut all = Vec::new();
    let groups = lines.chunk_by(|a, b| a.starts_with('|') == b.starts_with('|'));
    for group in groups.filter(|group| group.len() > 2 && group[0].starts_with('|')) {
        let rules = cells(group[1]);
        let right = |rule: &&str| rule.ends_with(':');
        let names = if rules.iter().any(right) { rules.iter().take_while(|rule| !right(rule)).count() } else { 1 };
        all.push(Read { heads: cells(group[0]), names, rows: group[2..].iter().map(|line| cells(line)).collect() });
    }
    all
}

/// A head as a name: letters and digits, small, with `_` between.
fn named(head: &str) -> String {
    let lower: String =
        head.chars().map(|c| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { ' ' }).collect();
    lower.split_whitespace().collect::<Vec<_>>().join("_")
}

/// Every cell of the page's tables as `name:row:column`, and of its sentences on runs `run:<run>:<what>`. Of rows of one name the first
/// counts, and each stands under all its words besides.
pub fn quoted(name: &str, page: &str) -> BTreeMap<String, String> {
    let mut all = BTreeMap::new();
    for table in tables(page) {
        let own: Vec<&Vec<&str>> = table.rows.iter().filter(|row| !row[0].starts_with(PAPER)).collect();
        for row in &own {
            let words: Vec<&str> = row.iter().take(table.names).copied().collect();
            for (head, cell) in table.heads.iter().zip(row.iter()).skip(table.names) {
                for row in [words[0].to_string(), words.join("/")] {
                    all.entry(format!("{name}:{row}:{}", named(head))).or_insert(cell.to_string());
                }
            }
        }
    }
    all.extend(page.lines().filter_map(|line| line.strip_prefix("- Run ")).flat_map(of_run));
    all
}

/// Reads the counts of `mine (0a1b2c3d): 240 evolution and 400 held-out scenes, 5 epochs, 30 attempts, 6400 rollouts; ...` and its like.
fn of_run(sentence: &str) -> Vec<(String, String)> {
    let Some((run, rest)) = sentence.split_once(" (") else { return Vec::new() };
    let Some((root, rest)) = rest.split_once("): ") else { return Vec::new() };
    let counted = rest.split(';').next().unwrap_or_default();
    let before = |word: &str| {
        let at = counted.find(&format!(" {word}"))?;
        counted[..at].rsplit([' ', ',']).next().filter(|number| number.bytes().all(|b| b.is_ascii_digit()))
    };
    [
        ("evolution_scenes", "evolution"),
        ("held_out_scenes", "held-out scene"),
        ("epochs", "epoch"),
        ("attempts", "attempt"),
        ("rollouts", "rollout"),
    ]
    .into_iter()
    .filter_map(|(what, word)| Some((format!("run:{run}:{what}"), before(word)?.to_string())))
    .chain([(format!("run:{run}:root"), root.to_string())])
    .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const PAGE: &str = "**Title**\n\n| Method | Policy | Parent Attack ↑ | PF-Area@3 ↑ | Proposals |\n| --- | --- | --: | --: | --- |\n\
                        | CAT | IDM | 0.380 [0.333, 0.427] | +5.8% | scripted |\n| · paper |  | 0.390 | +7.2% |  |\n\
                        | CAT | RL | 0.100 | – | scripted |\n\n\
                        - Run mine (0a1b2c3d): 240 evolution and 400 held-out scenes, 5 epochs, 30 attempts, 6400 rollouts; proposals from x.\n";

    #[test]
    fn a_cell_is_found_by_row_and_column_and_no_number_of_the_paper_passes_for_ours() {
        let all = quoted("llm", PAGE);
        assert_eq!(all["llm:CAT:parent_attack"], "0.380 [0.333, 0.427]", "the first of the name");
        assert_eq!(all["llm:CAT/RL:parent_attack"], "0.100");
        assert_eq!(all["llm:CAT/IDM:pf_area_3"], "+5.8%");
        assert!(!all.values().any(|cell| cell == "0.390") && !all.keys().any(|key| key.contains("paper")), "{all:?}");
    }

    #[test]
    fn what_a_sentence_counts_of_a_run_stands_under_its_name() {
        let all = quoted("llm", PAGE);
        let of = |what: &str| all[&format!("run:mine:{what}")].as_str();
        assert_eq!([of("evolution_scenes"), of("held_out_scenes"), of("epochs")], ["240", "400", "5"]);
        assert_eq!([of("attempts"), of("rollouts"), of("root")], ["30", "6400", "0a1b2c3d"]);
    }

    #[test]
    fn a_table_without_sides_is_named_by_its_first_column() {
        let all = quoted(
            "agreement",
            "| rollouts of | n | agreement % |\n|---|---|---|\n| all | 400 | 89.8 |\n| b | 1 | 2 |\n",
        );
        assert_eq!((all["agreement:all:n"].as_str(), all["agreement:b:agreement"].as_str()), ("400", "2"));
        assert!(quoted("agreement", "no table").is_empty());
    }
}
