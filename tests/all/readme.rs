//! The README's numbers. Each is taken from a golden or a manifest, none stands there besides, and no digit can be changed unnoticed.

use std::collections::BTreeMap;

use crate::harness::text;

/// Digits that belong to a name, a definition or a typed command and are no result.
const NAMES: [&str; 6] =
    ["2-D simulator", "is 1 where motion", "PF-Area@3*", "--set budget.finalists=2", "--top 5", "Apache 2.0"];

/// What the golden of the quickstart prints of each lineage, with the line that names the columns: the recorded scenes, then a line
/// for a parent and one for the program that was chosen.
fn table() -> Vec<String> {
    let golden = text("golden/quickstart.txt");
    let from = golden.lines().skip_while(|line| !line.starts_with("lineage "));
    from.take_while(|line| !line.is_empty()).map(String::from).collect()
}

/// The golden of the seeds: by lineage, one row a seed with attack and realism of the evolved program less those of the parent.
fn seeds() -> BTreeMap<String, Vec<[f64; 2]>> {
    let mut found: BTreeMap<String, Vec<[f64; 2]>> = BTreeMap::new();
    for line in text("golden/quickstart_seeds.csv").lines().skip(1) {
        let cells: Vec<&str> = line.split(',').collect();
        let number = |column: usize| cells[column].parse::<f64>().unwrap();
        found.entry(cells[1].to_string()).or_default().push([number(3) - number(2), number(5) - number(4)]);
    }
    found
}

/// Mean and standard error, written with the sign that a typesetter takes.
#[expect(clippy::disallowed_methods, reason = "squares alone")]
fn mean(values: &[f64]) -> String {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let variance = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (n - 1.0);
    format!("{mean:+.3} ± {:.3}", (variance / n).sqrt()).replace('-', "−")
}

/// A row of the README's second table.
fn row(name: &str, rows: &[[f64; 2]]) -> String {
    let attack: Vec<f64> = rows.iter().map(|row| row[0]).collect();
    let realism: Vec<f64> = rows.iter().map(|row| row[1]).collect();
    let more = attack.iter().filter(|value| **value > 0.0).count();
    let fewer = attack.iter().filter(|value| **value < 0.0).count();
    let same = attack.len() - more - fewer;
    format!("| {name} | {} | {more} / {fewer} / {same} | {} |", mean(&attack), mean(&realism))
}

fn in_words(count: usize) -> &'static str {
    match count {
        3 => "three",
        20 => "twenty",
        _ => panic!("the README has no word for {count} yet"),
    }
}

/// The number before `word` in a text.
fn before<'t>(text: &'t str, word: &str) -> &'t str {
    let (head, _) = text.split_once(word).unwrap_or_else(|| panic!("{word} is not in the golden"));
    head.rsplit([' ', ',']).find(|part| !part.is_empty()).unwrap()
}

/// What stands behind `key` on the first line that begins with it, without a quote.
fn value(file: &str, key: &str) -> String {
    let text = text(file);
    let found = text.lines().find_map(|line| line.strip_prefix(key));
    found.unwrap_or_else(|| panic!("{file} has no {key}")).trim_matches('"').to_string()
}

/// Whatever the README must say word for word, because it holds a number.
fn pieces() -> Vec<String> {
    let table = table();
    let quickstart = text("golden/quickstart.txt");
    let seeds = seeds();
    let chosen = table.last().unwrap().split_whitespace().nth(1).unwrap();
    let (epoch, slot) = chosen.trim_start_matches('e').split_once('s').unwrap();
    let claims = text("golden/paper/claims.md");
    let head = claims.lines().find(|line| line.contains(" claims: ")).unwrap();
    // Two counts end in `supported`.
    let (_, behind_undecided) = head.split_once(" undecided, ").unwrap();
    let undecided = before(head, " undecided");
    let left = match before(head, " not testable") {
        "0" => format!(" and leave {undecided} undecided"),
        untestable => format!(", leave {undecided} undecided and cannot test {untestable}"),
    };
    let draws = seeds.values().next().unwrap().len();
    let mut pieces = vec![
        format!("Rust {} or later", value("Cargo.toml", "rust-version = \"")),
        format!("The first evolves {} programs", in_words((table.len() - 2) / 2)),
        table.join("\n"),
        format!("share of {} held-out scenes", before(&quickstart, " held-out scenes")),
        format!("`{chosen}`: epoch {epoch}, proposal {slot}"),
        format!("chosen of {} by its gain", in_words(draws)),
        format!(
            "Of {} claims of the paper, the recorded runs support {}, contradict {}{left}",
            before(head, " claims: "),
            before(behind_undecided, " supported"),
            before(head, " not supported")
        ),
        format!("year    = {{{}}}", &value("CITATION.cff", "date-released: ")[..4]),
        format!("version = {{{}}}", value("Cargo.toml", "version = \"")),
    ];
    for (lineage, name) in [("adv_bmt-idm", "ADV-BMT"), ("at-idm", "AT"), ("cat-idm", "CAT")] {
        pieces.push(row(name, &seeds[lineage]));
    }
    pieces
}

/// What is wrong with the numbers of a README.
fn faults(readme: &str, pieces: &[String]) -> Vec<String> {
    let mut rest = readme.to_string();
    let mut faults = Vec::new();
    for piece in pieces.iter().map(String::as_str).chain(NAMES) {
        match rest.find(piece) {
            Some(at) => rest.replace_range(at..at + piece.len(), ""),
            None => faults.push(format!("README.md does not say: {piece}")),
        }
    }
    let numbers = rest.lines().filter(|line| line.contains(|c: char| c.is_ascii_digit()));
    faults.extend(numbers.map(|line| format!("README.md has a number that no golden holds: {line}")));
    faults
}

#[test]
fn every_number_of_the_readme_is_one_of_a_golden_or_a_manifest() {
    let faults = faults(&text("README.md"), &pieces());
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

#[test]
fn a_digit_of_the_readme_that_is_changed_is_refused() {
    let (readme, pieces) = (text("README.md"), pieces());
    let digits: Vec<usize> = readme.bytes().enumerate().filter(|(_, b)| b.is_ascii_digit()).map(|(at, _)| at).collect();
    assert!(digits.len() > 200, "{} digits", digits.len());
    assert!(faults(&readme, &pieces).is_empty(), "the README as it stands has no fault");
    for at in digits {
        let other = if &readme[at..=at] == "7" { "3" } else { "7" };
        let mut changed = readme.clone();
        changed.replace_range(at..=at, other);
        assert!(!faults(&changed, &pieces).is_empty(), "byte {at}: {}", &changed[at.saturating_sub(1)..]);
    }
}

#[test]
fn the_readme_names_the_command_behind_its_table_of_seeds() {
    assert!(text("README.md").contains("`.ci/seeds --full`"));
    let script = text(".ci/seeds");
    assert!(script.contains("golden/quickstart_seeds.csv") && script.contains("\"--full\""));
}

#[test]
fn of_the_quickstarts_lineages_adv_bmt_alone_gains_attack_as_the_readme_says() {
    let attack = |line: &String| line.split_whitespace().nth(2).unwrap().parse::<f64>().unwrap();
    let gains: Vec<String> = table()[2..]
        .chunks(2)
        .filter(|both| both[1].trim_start().starts_with("-> ") && attack(&both[1]) > attack(&both[0]))
        .map(|both| both[0].split_whitespace().next().unwrap().to_string())
        .collect();
    assert_eq!(gains, ["adv_bmt-idm"]);
    assert!(text("README.md").contains("Only ADV-BMT gains"));
}

#[test]
fn the_seed_that_the_quickstart_is_made_with_gave_its_golden() {
    let experiment: toml::Table = text("experiments/quickstart.toml").parse().unwrap();
    let seed = experiment["models"]["scripted"]["sampling"]["seed"].to_string();
    let golden = text("golden/quickstart_seeds.csv");
    let rows: Vec<Vec<&str>> = golden.lines().map(|line| line.split(',').collect()).collect();
    for both in table()[2..].chunks(2) {
        let [parent, evolved] = [0, 1].map(|i| both[i].split_whitespace().collect::<Vec<_>>());
        let of = rows.iter().find(|row| row[0] == seed && row[1] == parent[0]).expect("a row of the seed");
        let rounded = |cell: &str| evodrive::kernel::num::fixed(cell.parse().unwrap(), 3);
        assert_eq!([parent[2], evolved[2]].map(String::from), [rounded(of[2]), rounded(of[3])], "{}", parent[0]);
    }
}
