//! Keeps two pages true: every place that docs/PAPER.md and docs/EXTENDING.md name exists, and every row of the first has a verdict and
//! says why it differs.

use std::collections::BTreeSet;
use std::path::Path;

/// Words that stand before the name of an item.
const ITEMS: [&str; 7] = ["fn", "struct", "enum", "const", "trait", "type", "mod"];

/// The items that a file defines.
fn defined(text: &str) -> Vec<&str> {
    let words: Vec<&str> = text.split(|c: char| !(c.is_alphanumeric() || c == '_')).filter(|w| !w.is_empty()).collect();
    words.windows(2).filter(|pair| ITEMS.contains(&pair[0])).map(|pair| pair[1]).collect()
}

/// Returns the faults in the rows of a page, given the text of a file below `src`.
fn faults(page: &str, file: &dyn Fn(&str) -> Option<String>) -> Vec<String> {
    let rows = page.lines().filter(|line| line.starts_with("| ") && line.matches('|').count() == 5);
    let mut faults = Vec::new();
    for row in rows.filter(|row| !row.starts_with("| paper |")) {
        let cells: Vec<&str> = row.split('|').map(str::trim).collect();
        let [_, element, places, verdict, why, _] = cells[..] else { continue };
        if !["same", "chosen", "differs", "missing"].contains(&verdict) {
            faults.push(format!("{element}: {verdict} is no verdict"));
        }
        if verdict != "same" && why.is_empty() {
            faults.push(format!("{element}: {verdict}, and not a word on why"));
        }
        for place in places.split(", ") {
            let named = place.trim_matches('`').split_once('#');
            let found = named.and_then(|(path, item)| Some(defined(&file(path)?).contains(&item)));
            if found != Some(true) {
                faults.push(format!("{element}: {place} is not there"));
            }
        }
    }
    faults
}

fn page() -> String {
    std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/PAPER.md")).expect("docs/PAPER.md")
}

/// Keys of an experiment file that a text names between backquotes.
fn keys(text: &str) -> Vec<&str> {
    let is_key = |word: &&str| {
        let parts: Vec<&str> = word.split('.').collect();
        let plain = |part: &&str| {
            !part.is_empty() && part.chars().all(|c| c.is_ascii_lowercase() || c == '_' || c.is_ascii_digit())
        };
        parts.len() > 1 && parts.iter().all(plain) && !["rs", "toml", "md"].contains(&parts[parts.len() - 1])
    };
    text.split('`').skip(1).step_by(2).filter(is_key).collect()
}

/// The keys of a protocol file with a value of their own, as the page of keys names them.
fn set(table: &toml::Table, above: &str) -> Vec<String> {
    let of = |(key, value): (&String, &toml::Value)| match value {
        toml::Value::Table(inner) => set(inner, &format!("{above}{key}.")),
        _ => vec![format!("{above}{key}")],
    };
    table.iter().flat_map(of).collect()
}

/// The text of a file that the page names by its room.
fn file(path: &str) -> Option<String> {
    let crates = std::fs::read_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join("src")).ok()?;
    crates.flatten().find_map(|of| std::fs::read_to_string(of.path().join(path)).ok())
}

#[test]
fn every_place_of_the_papers_page_exists_and_every_difference_says_why() {
    let page = page();
    let rows = page.lines().filter(|line| line.contains(".rs#")).count();
    assert!(rows > 100, "{rows} rows with a place");
    assert_eq!(faults(&page, &file), Vec::<String>::new());
}

#[test]
fn a_place_that_does_not_exist_a_verdict_of_ones_own_and_a_difference_without_a_reason_are_refused() {
    let row = |place: &str, verdict: &str, why: &str| format!("| dominance | {place} | {verdict} | {why} |");
    let refused = |row: String| faults(&row, &file).len();
    assert_eq!(refused(row("`objects/score.rs#dominates`", "same", "")), 0);
    assert_eq!(refused(row("`objects/score.rs#dominated_by`", "same", "")), 1);
    assert_eq!(refused(row("`objects/scores.rs#dominates`", "same", "")), 1);
    assert_eq!(refused(row("`objects/score.rs#dominates`", "alike", "x")), 1);
    assert_eq!(refused(row("`objects/score.rs#dominates`", "differs", "")), 1);
}

#[test]
fn the_page_names_every_rule_that_the_papers_protocol_switches_and_no_key_that_there_is_not() {
    let read = |path: &str| std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(path)).expect(path);
    let (page, known) = (page(), read("docs/EXPERIMENT.md"));
    let unknown: Vec<&str> = keys(&page).into_iter().filter(|key| !known.contains(&format!("|`{key}`"))).collect();
    assert_eq!(unknown, Vec::<&str>::new(), "keys of docs/PAPER.md that docs/EXPERIMENT.md does not have");
    assert_eq!(keys("`archive.fronts`, `archive.rs`, `gates`"), ["archive.fronts"]);
    let protocol: toml::Table = read("experiments/protocols/published.toml").parse().expect("a TOML table");
    // Weights and numbers of the evaluator are values, not rules.
    let values = ["base", "roles.", "world", "evaluation.realism.weights.", "evaluation.attack.counts"];
    let rules = set(&protocol, "").into_iter().filter(|key| !values.iter().any(|value| key.starts_with(value)));
    let unnamed: Vec<String> = rules.filter(|key| !page.contains(&format!("`{key}`"))).collect();
    assert_eq!(unnamed, Vec::<String>::new(), "rules of published.toml that docs/PAPER.md does not name");
}

/// Names between backquotes of a page, outside its blocks, that lead nowhere: paths without a file, names with `::` whose last two parts no
/// source has together, and names with a capital letter that no source has.
fn unknown<'p>(page: &'p str, sources: &[(String, String)]) -> Vec<&'p str> {
    let is_word = |c: char| c.is_alphanumeric() || c == '_';
    let words = |text: &'_ str| text.split(|c| !is_word(c)).map(String::from).collect::<BTreeSet<String>>();
    let files: Vec<_> = sources.iter().map(|(path, text)| (words(path), defined(text), words(text))).collect();
    let is_known = |span: &&str| {
        let name = span.split(|c| !is_word(c) && c != ':').next().unwrap_or_default();
        match name.split("::").collect::<Vec<_>>()[..] {
            _ if span.contains('/') && !span.contains(' ') => Path::new(env!("CARGO_MANIFEST_DIR")).join(span).exists(),
            // An item in its module's files; a variant beside its type, a function where it is written for its type.
            [.., of, name] => files.iter().any(|(path, defined, words)| {
                (path.contains(of) || defined.contains(&of)) && words.contains(name)
                    || words.contains(of) && defined.contains(&name)
            }),
            [name] if name.starts_with(char::is_uppercase) => files.iter().any(|(_, _, words)| words.contains(name)),
            _ => true,
        }
    };
    let prose = page.split("```").step_by(2).flat_map(|text| text.split('`').skip(1).step_by(2));
    prose.filter(|span| !is_known(span)).collect()
}

#[test]
fn every_place_that_the_page_on_extending_names_exists() {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/EXTENDING.md");
    let (page, sources) = (std::fs::read_to_string(page).expect("docs/EXTENDING.md"), crate::sources());
    assert_eq!(unknown(&page, &sources), Vec::<&str>::new());
    let gone = "`src/sim/ego/policies.rs`, `ego::Policies`, `Control::FollowNobody`, `Weightings`, `view`, `src/sim/ego/policy.rs`";
    assert_eq!(unknown(gone, &sources).len(), 4);
}
