//! The README's numbers. Each is taken from a golden or a manifest, none stands there besides, and no digit can be changed unnoticed.

use std::collections::BTreeMap;

use evodrive::llm::Cassette;

use crate::harness::{home, text};

/// Digits that belong to a name, a definition or a typed command and are no result.
const NAMES: [&str; 4] = ["2-D simulator", "is 1 where motion", "--top 5", "Apache 2.0"];

/// Output of the README's first command, and of the tests' own run.
const FINDING: &str = "golden/finding.txt";
const QUICKSTART: &str = "golden/quickstart.txt";

/// Returns what the golden of a run prints of each lineage, with the line that names the columns: the recorded scenes, then a line
/// for a parent and one for the program that was chosen.
fn table(golden: &str) -> Vec<String> {
    let golden = text(golden);
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

/// Cells of a lineage's two lines: attack, preventable, any crash, realism, strict realism, coverage.
fn sides(golden: &str, lineage: &str) -> [Vec<f64>; 2] {
    let lines = table(golden);
    let at = lines.iter().position(|line| line.starts_with(lineage)).unwrap();
    let numbers = |line: &String| {
        let cells: Vec<&str> = line.split_whitespace().collect();
        cells[cells.len() - 7..].iter().map(|cell| cell.parse().unwrap()).collect()
    };
    [numbers(&lines[at]), numbers(&lines[at + 1])]
}

/// A row of the table of seeds in paper/README.md.
fn row(name: &str, rows: &[[f64; 2]]) -> String {
    let attack: Vec<f64> = rows.iter().map(|row| row[0]).collect();
    let realism: Vec<f64> = rows.iter().map(|row| row[1]).collect();
    let more = attack.iter().filter(|value| **value > 0.0).count();
    let fewer = attack.iter().filter(|value| **value < 0.0).count();
    let same = attack.len() - more - fewer;
    format!("| {name} | {} | {more} / {fewer} / {same} | {} |", mean(&attack), mean(&realism))
}

/// The number before `word` in a text.
fn before<'t>(text: &'t str, word: &str) -> &'t str {
    let (head, _) = text.split_once(word).unwrap_or_else(|| panic!("{word} is not in the golden"));
    head.rsplit([' ', ',']).find(|part| !part.is_empty()).unwrap()
}

/// Returns what stands behind `key` on the first line that begins with it, without a quote.
fn value(file: &str, key: &str) -> String {
    let text = text(file);
    let found = text.lines().find_map(|line| line.strip_prefix(key));
    found.unwrap_or_else(|| panic!("{file} has no {key}")).trim_matches('"').to_string()
}

/// Whatever the README must say word for word, because it holds a number.
fn pieces() -> Vec<String> {
    let (table, finding) = (table(FINDING), text(FINDING));
    let chosen = table.iter().find(|line| line.contains("-> ")).unwrap().split_whitespace().nth(1).unwrap();
    let (epoch, slot) = chosen.trim_start_matches('e').split_once('s').unwrap();
    let exits = ["declined", "invalid", "rejected", "evaluated"]
        .map(|exit| before(&finding, &format!(" {exit}")).parse::<usize>().unwrap());
    let lineages = (table.len() - 2) / 2;
    let [parent, evolved] = sides(FINDING, "adv_bmt-idm");
    let percent = |share: f64| format!("{:.1} %", 100.0 * share);
    let provenance = value("experiments/protocols/llm_agent.toml", "provenance = \"");
    let recorded = provenance.rsplit("; ").next().unwrap();
    let arxiv = text("CITATION.cff").split("\"arXiv:").nth(1).unwrap().split('"').next().unwrap().to_string();
    vec![
        format!("(arXiv {arxiv})"),
        format!("Rust {} or later", value("Cargo.toml", "rust-version = \"")),
        format!("In {} proposals", exits.iter().sum::<usize>() / lineages),
        format!("from {} to {} crashes", percent(parent[0]), percent(evolved[0])),
        format!("from {} to {}.", percent(parent[1]), percent(evolved[1])),
        table.join("\n"),
        format!("share of {} held-out", before(&finding, " held-out scenes")),
        format!("`{chosen}`: epoch {epoch}, proposal {slot}"),
        format!("a fresh one for each search, {recorded}"),
        format!("year    = {{{}}}", &value("CITATION.cff", "date-released: ")[..4]),
        format!("version = {{{}}}", value("Cargo.toml", "version = \"")),
    ]
}

/// Returns what paper/README.md must say of the stand-in: the verdicts on the paper's claims, and all twenty seeds of the tests' own run.
fn of_the_stand_in() -> Vec<String> {
    let (claims, seeds) = (text("golden/paper/claims.md"), seeds());
    let head = claims.lines().find(|line| line.contains(" claims: ")).unwrap();
    // Two counts end in `supported`.
    let (_, behind_undecided) = head.split_once(" undecided, ").unwrap();
    let undecided = before(head, " undecided");
    let left = match before(head, " not testable") {
        "0" => format!(" and leave {undecided} undecided"),
        untestable => format!(", leave {undecided} undecided and cannot test {untestable}"),
    };
    let rows = [("adv_bmt-idm", "ADV-BMT"), ("at-idm", "AT"), ("cat-idm", "CAT")];
    let rows = rows.iter().map(|(lineage, name)| row(name, &seeds[*lineage]));
    let verdicts = format!(
        "Of {} claims of the paper, the recorded runs support {}, contradict {}{left}",
        before(head, " claims: "),
        before(behind_undecided, " supported"),
        before(head, " not supported")
    );
    assert_eq!(seeds.values().map(Vec::len).collect::<Vec<_>>(), [20; 3]);
    rows.chain([verdicts, "chosen of twenty by its gain".into(), "Only ADV-BMT gains".into()]).collect()
}

/// Returns the faults in the numbers of a README.
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
    assert!(digits.len() > 150, "{} digits", digits.len());
    assert!(faults(&readme, &pieces).is_empty(), "the README as it stands has no fault");
    for at in digits {
        let other = if &readme[at..=at] == "7" { "3" } else { "7" };
        let mut changed = readme.clone();
        changed.replace_range(at..=at, other);
        assert!(!faults(&changed, &pieces).is_empty(), "byte {at}: {}", &changed[at.saturating_sub(1)..]);
    }
}

#[test]
fn the_papers_page_says_of_the_stand_in_what_the_goldens_say() {
    let page = text("paper/README.md");
    for piece in of_the_stand_in() {
        assert!(page.contains(&piece), "paper/README.md does not say: {piece}");
    }
    assert!(page.contains("`.ci/seeds --full`"));
    let script = text(".ci/seeds");
    assert!(script.contains("golden/quickstart_seeds.csv") && script.contains("\"--full\""));
}

#[test]
fn the_finding_is_what_the_readme_says_in_words() {
    let [parent, evolved] = sides(FINDING, "adv_bmt-idm");
    assert!(evolved[0] > parent[0] && evolved[1] < parent[1], "more attack, fewer that could be prevented");
    assert!(evolved[3] > parent[3] && evolved[4] > parent[4], "at higher realism, by either");
    let contacts = text("golden/llm/metadrive_contacts.md");
    let line = contacts.lines().find(|line| line.starts_with("| ADV-BMT | IDM | evolved |")).unwrap();
    let rams = line.split('|').nth(19).unwrap().split_whitespace().next().unwrap();
    assert!(rams.parse::<f64>().unwrap() > 0.9, "nearly all are rams from behind: {rams}");
}

/// The README's run is a part of the study in golden/llm: the same answers, and so the same programs and the same labels.
#[test]
fn the_finding_replays_the_recorded_study() {
    let study = text("golden/llm/metadrive.md");
    let whole = |name: &str| Cassette::load(&home().join(format!("cassettes/{name}.jsonl.zst"))).unwrap();
    let finding = whole("finding");
    let mut answers = 0;
    for (lineage, family, method) in
        [("adv_bmt-idm", "adv_bmt", "| ADV-BMT | IDM |"), ("cat-idm", "cat", "| CAT | IDM |")]
    {
        let line = study.lines().find(|line| line.starts_with(method)).unwrap();
        let cell = |column: usize| {
            line.split('|').nth(column).unwrap().split_whitespace().next().unwrap().parse::<f64>().unwrap()
        };
        let [parent, evolved] = sides(FINDING, lineage);
        assert_eq!([parent[0], evolved[0]], [cell(3), cell(8)], "{lineage}");
        for exchange in whole(&format!("llm/metadrive/{family}")).exchanges() {
            let own = finding.exchanges().iter().find(|own| own.key == exchange.key).expect("an answer of the study");
            assert_eq!(own.bytes, exchange.bytes);
            answers += 1;
        }
    }
    assert_eq!(finding.exchanges().len(), answers, "and no other");
}

#[test]
fn of_the_quickstarts_lineages_adv_bmt_alone_gains_attack_as_the_papers_page_says() {
    let gains = ["cat-idm", "at-idm", "adv_bmt-idm"].into_iter().filter(|lineage| {
        let [parent, evolved] = sides(QUICKSTART, lineage);
        evolved[0] > parent[0]
    });
    assert_eq!(gains.collect::<Vec<_>>(), ["adv_bmt-idm"]);
}

#[test]
fn the_seed_that_the_quickstart_is_made_with_gave_its_golden() {
    let experiment: toml::Table = text("experiments/quickstart.toml").parse().unwrap();
    let seed = experiment["models"]["scripted"]["sampling"]["seed"].to_string();
    let golden = text("golden/quickstart_seeds.csv");
    let rows: Vec<Vec<&str>> = golden.lines().map(|line| line.split(',').collect()).collect();
    for both in table(QUICKSTART)[2..].chunks(2) {
        let [parent, evolved] = [0, 1].map(|i| both[i].split_whitespace().collect::<Vec<_>>());
        let of = rows.iter().find(|row| row[0] == seed && row[1] == parent[0]).expect("a row of the seed");
        let rounded = |cell: &str| evodrive::kernel::num::fixed(cell.parse().unwrap(), 3);
        assert_eq!([parent[2], evolved[2]].map(String::from), [rounded(of[2]), rounded(of[3])], "{}", parent[0]);
    }
}
