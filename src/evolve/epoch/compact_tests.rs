//! Compact questions: they say in fewer bytes what detailed ones say. The same run is asked in both forms; each fact of a detailed
//! question is looked for in the compact one of its slot.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::LazyLock;

use serde_json::Value;

use super::tests::{Patience, Ran, carried_out_asking, three_families};
use crate::agents::Questions;
use crate::experiment::Experiment;
use crate::llm::Request;
use crate::objects::Round;

/// Most bytes of a compact question to an actor, as a share of the detailed one's.
const SHARE_MAX: f64 = 0.85;

/// One run in each form: detailed and compact.
static RAN: LazyLock<[(Ran, Vec<Request>); 2]> = LazyLock::new(|| {
    [Questions::Detailed, Questions::Compact].map(|questions| {
        let mut experiment = three_families();
        experiment.questions = questions;
        let patience = Patience::default();
        let ran = carried_out_asking(&experiment, None, &patience);
        (ran, patience.heard.into_inner().unwrap())
    })
});

/// Detailed and compact question of each slot.
fn pairs() -> Vec<(&'static Request, &'static Request)> {
    let [(_, detailed), (_, compact)] = &*RAN;
    let by_slot: BTreeMap<String, &Request> = compact.iter().map(|of| (format!("{:?}", of.slot), of)).collect();
    assert_eq!(detailed.len(), compact.len());
    detailed.iter().map(|of| (of, by_slot[&format!("{:?}", of.slot)])).collect()
}

/// The fenced block below a title.
fn block<'r>(request: &'r Request, title: &str) -> &'r str {
    let text = request.messages.iter().find_map(|of| of.text.split_once(&format!("## {title}\n"))).unwrap().1;
    text.split_once("```").unwrap().1.split_once('\n').unwrap().1.split_once("\n```").unwrap().0
}

/// The rows of a table, cell by cell, by the heads of its columns.
fn rows<'r>(request: &'r Request, title: &str, between: &str) -> Vec<BTreeMap<&'r str, &'r str>> {
    let mut lines = block(request, title).lines().map(|line| line.split(between).collect::<Vec<_>>());
    let head = lines.next().unwrap_or_default();
    lines.map(|cells| head.iter().copied().zip(cells).collect()).collect()
}

/// A number of a detailed table as a compact one shows it; `-` is an empty cell.
fn short(cell: &str) -> String {
    let Ok(x) = cell.parse::<f64>() else { return String::new() };
    let scale = if x.abs() < 10.0 { 10.0 } else { 1.0 };
    ((x * scale).round() / scale).to_string()
}

fn agrees(found: &str, cell: &str) -> bool {
    let (Ok(found), Ok(said)) = (found.parse::<f64>(), cell.parse::<f64>()) else { return found == short(cell) };
    (found - said).abs() <= if said.abs() < 9.9 { 0.051 } else { 0.551 }
}

#[test]
fn every_cell_and_every_remark_of_a_detailed_row_stands_in_the_compact_one() {
    let mut remarks: BTreeMap<&str, usize> = BTreeMap::new();
    for (detailed, compact) in pairs() {
        let (whole, table) = (rows(detailed, "Window", " | "), rows(compact, "Window", "|"));
        assert_eq!(whole.len(), table.len());
        for (row, found) in whole.iter().zip(&table) {
            for (name, other) in [
                ("scene", "scene"),
                ("place and tags", "place"),
                ("adversaries", "adversaries"),
                ("outcome", "outcome"),
                ("below 1", "below 1"),
            ] {
                assert_eq!(row[name], found[other], "{row:?}\n{found:?}");
            }
            let numbers = ["at_s", "its_mps", "ego_mps", "bearing", "ttc_s"];
            for (name, other) in [("nearest_m", "near_m")].into_iter().chain(numbers.map(|name| (name, name))) {
                assert!(agrees(found[other], row[name]), "{name}: {row:?}\n{found:?}");
            }
            let mut said = BTreeSet::new();
            for remark in row["how"].split("; ").filter(|remark| !remark.is_empty()) {
                let words: Vec<&str> = remark.split(' ').collect();
                let (column, agree) = match words.as_slice() {
                    [who, "strike" | "strikes"] => ("how: strikes", found["how: strikes"] == *who),
                    ["seen", s, "s"] => ("seen_s", agrees(found["seen_s"], s)),
                    ["not", "seen"] => ("seen_s", found["seen_s"] == "no"),
                    [s, "s", "too", "late"] => ("late_s", agrees(found["late_s"], s)),
                    ["ego", "brakes", hard, "from", s, "s"] => {
                        let (other, from) = found["brakes"].split_once('@').unwrap();
                        ("brakes", agrees(other, hard) && agrees(from, s))
                    }
                    ["took", ..] => {
                        let taken = remark.replace("took ", "").replace(" of ", "/").replace(',', "");
                        ("took", found["took"] == taken)
                    }
                    ["law", "at", s, "s"] => ("law_s", agrees(found["law_s"], s)),
                    ["law", "changed", "nothing"] => ("law_s", found["law_s"] == "no"),
                    _ => panic!("a remark that no compact column holds: {remark}"),
                };
                assert!(agree, "{remark}: {found:?}");
                said.insert(column);
                *remarks.entry(column).or_default() += 1;
            }
            let filled = found.iter().filter(|(head, cell)| {
                let how = ["how: strikes", "seen_s", "late_s", "brakes", "took", "law_s"].contains(*head);
                how && !cell.is_empty()
            });
            assert_eq!(filled.map(|(head, _)| *head).collect::<BTreeSet<_>>(), said, "{found:?}");
        }
    }
    assert!(
        ["how: strikes", "seen_s", "brakes", "took"].iter().all(|column| remarks.contains_key(column)),
        "{remarks:?}"
    );
}

/// The numbers with a sign in a text, in thousandths where they have decimals, in order.
fn changes(text: &str) -> Vec<i64> {
    let words = text.split(|c: char| !(c.is_ascii_digit() || "+-.".contains(c)));
    let signed = words.filter(|word| word.len() > 1 && word.starts_with(['+', '-']));
    signed
        .map(|word| (word.parse::<f64>().unwrap() * if word.contains('.') { 1000.0 } else { 1.0 }).round() as i64)
        .collect()
}

/// The standard errors in a text, in thousandths.
fn errors(text: &str) -> Vec<i64> {
    let behind = text.split('±').skip(1).map(|rest| rest.trim_start());
    let numbers = behind.map(|rest| rest.split(|c: char| !(c.is_ascii_digit() || c == '.')).next().unwrap());
    numbers
        .map(|word| (word.parse::<f64>().unwrap() * if word.contains('.') { 1000.0 } else { 1.0 }).round() as i64)
        .collect()
}

#[test]
fn every_fact_of_a_past_edit_stands_in_its_compact_row() {
    let (mut edits, mut verdicts, mut repeated) = (0, 0, 0);
    for (detailed, compact) in pairs() {
        let whole: Vec<Value> = serde_json::from_str(block(detailed, "Edit history")).unwrap();
        let table = rows(compact, "Edit history", "|");
        assert_eq!(whole.len(), table.len());
        let prefix = format!("{}/", detailed.slot.lineage);
        for (edit, row) in whole.iter().zip(&table) {
            let word = |name: &str| edit[name].as_str().unwrap_or_default().replace(&prefix, "");
            assert_eq!(word("attempt"), row["attempt"]);
            assert_eq!(word("ended"), row["ended"]);
            assert_eq!(word("parent"), row["parent, if another"]);
            // The stand-in tells rounded digits in its hypothesis; the rest of the beginning is the same.
            let begins = |text: &str| text.chars().filter(|c| !c.is_ascii_digit()).take(90).collect::<String>();
            assert_eq!(begins(&word("hypothesis").replace('|', "¦")), begins(row["hypothesis"]));
            let gates = row["gates or problems"];
            for problem in edit["problems"].as_array().into_iter().flatten().filter_map(Value::as_str) {
                assert!(gates.contains(&problem.replace('|', "¦")), "{problem}: {gates}");
            }
            verdicts += usize::from(!word("gates").is_empty());
            assert_eq!((changes(&word("gates")), errors(&word("gates"))), (changes(gates), errors(gates)));
            let change = word("change");
            if !change.is_empty() {
                let cells =
                    ["attack", "realism", "coverage", "diagnostics", "clusters"].map(|name| row[name]).join(" ");
                assert_eq!((changes(&change), errors(&change)), (changes(&cells), errors(&cells)), "{change}\n{row:?}");
                assert!(change.starts_with(&format!("{} scenes", row["scenes"])), "{change}: {row:?}");
                let near = row["near misses"].split_once('>').unwrap();
                assert!(change.contains(&format!("near misses {} -> {}", near.0, near.1)), "{change}: {row:?}");
                for name in ["won", "lost"] {
                    let said = change.split("; ").find_map(|part| part.strip_prefix(&format!("{name} ")));
                    assert_eq!(said.unwrap_or_default().replace(", e.g.", ""), row[name], "{change}");
                }
                let names = |text: &str| {
                    let words = text.split(|c: char| !(c.is_ascii_lowercase() || c == '_'));
                    words.filter(|word| word.len() > 1).map(str::to_string).collect::<BTreeSet<_>>()
                };
                let named: BTreeSet<_> = names(&cells);
                assert!(
                    named.is_subset(&names(&change))
                        && (named.is_empty() != change.contains(';')
                            || change.contains("won")
                            || change.contains("lost")),
                    "{change}: {row:?}"
                );
            }
            let operations: Vec<&str> =
                edit["operations"].as_array().into_iter().flatten().filter_map(Value::as_str).collect();
            for operation in operations {
                let (head, value) = operation.split_once(": as ").map_or((operation, ""), |(head, _)| (head, "as"));
                let path = head.split(' ').nth(1).unwrap();
                let name = path.trim_start_matches('/').split_once('/').unwrap().1;
                let verb = head.split(' ').next().unwrap();
                assert!(row["operations"].contains(verb) && row["operations"].contains(name), "{operation}: {row:?}");
                repeated += usize::from(value == "as");
                assert!(
                    value.is_empty() || row["operations"].contains("=parent") || row["operations"].contains("=above")
                );
                if let Some((_, tail)) = head.split_once(", tags ") {
                    assert!(row["operations"].contains(tail), "{operation}: {row:?}");
                }
            }
            edits += 1;
        }
        let said = |request: &Request| {
            let text = &request.messages[1].text;
            text.split_once("Not shown are ").map(|(_, behind)| behind.split('\n').next().unwrap().to_string())
        };
        assert_eq!(said(detailed), said(compact));
    }
    assert!(edits > 0 && verdicts > 0 && repeated > 0, "{edits} {verdicts} {repeated}");
}

#[test]
fn sums_clusters_front_and_cards_are_told_whole() {
    let (mut cards, mut points) = (0, 0);
    for (detailed, compact) in pairs() {
        let sums: Value = serde_json::from_str(block(detailed, "Outcomes")).unwrap();
        let said = block(compact, "Outcomes");
        let rounded = |x: f64| (x * 1000.0).round() / 1000.0;
        let number = |name: &str| {
            let behind = said.split_once(&format!("{name} ")).unwrap_or_else(|| panic!("{name}: {said}")).1;
            behind.split([',', '\n']).next().unwrap().parse::<f64>().unwrap()
        };
        let close = |found: f64, x: f64| (found - x).abs() < 0.00056;
        for name in ["attack", "realism", "coverage"] {
            assert!(close(number(name), sums[name].as_f64().unwrap()), "{name}: {said}");
        }
        let below = sums["diagnostics"].as_object().unwrap().iter().filter(|(_, x)| rounded(x.as_f64().unwrap()) < 1.0);
        below.for_each(|(name, x)| assert!(close(number(name), x.as_f64().unwrap()), "{name}: {said}"));
        assert!(said.contains(&format!("{} scenes", sums["scenes"])), "{said}");
        assert!(said.contains(&format!("{} near misses", sums["near_misses"])), "{said}");

        let (whole, table) = (rows(detailed, "Scene clusters", " | "), rows(compact, "Scene clusters", "|"));
        assert_eq!(whole.len(), table.len());
        for (row, found) in whole.iter().zip(&table) {
            assert_eq!(row.keys().collect::<Vec<_>>(), found.keys().collect::<Vec<_>>());
            for (head, cell) in row {
                let same = match *head {
                    "outcomes" => cell.replace(',', "") == found[head],
                    "attacked" => {
                        cell.parse::<f64>().map_or(found[head].is_empty(), |x| close(found[head].parse().unwrap(), x))
                    }
                    _ => *cell == found[head],
                };
                assert!(same, "{head}: {row:?}\n{found:?}");
            }
        }

        let (whole, table) = (block(detailed, "Front").lines(), block(compact, "Front").lines());
        assert_eq!(whole.clone().count(), table.clone().count());
        for (row, found) in whole.skip(1).zip(table.skip(1)) {
            let (row, found): (Vec<&str>, Vec<&str>) = (row.split(" | ").collect(), found.split('|').collect());
            assert_eq!(row.len(), found.len());
            assert_eq!(row[0].replace(&format!("{}/", detailed.slot.lineage), ""), found[0]);
            for (cell, other) in row.iter().zip(&found).skip(1) {
                let same = cell.parse::<f64>().map_or(cell == other, |x| close(other.parse().unwrap(), x));
                assert!(same, "{row:?} {found:?}");
            }
            points += 1;
        }

        let whole: Vec<Value> = serde_json::from_str(block(detailed, "Memory")).unwrap();
        let table = rows(compact, "Memory", "|");
        assert_eq!(whole.len(), table.len());
        for (card, row) in whole.iter().zip(&table) {
            for (name, value) in card.as_object().unwrap() {
                let said = match value {
                    Value::Array(words) => words.iter().filter_map(Value::as_str).collect::<Vec<_>>().join(" "),
                    other => other.as_str().unwrap().replace('|', "¦"),
                };
                assert_eq!(row[name.as_str()], said);
            }
            cards += 1;
        }
    }
    assert!(cards > 0 && points > 0, "{cards} {points}");
}

#[test]
fn the_stand_in_answers_a_compact_question_as_it_answers_the_detailed_one() {
    let [(detailed, _), (compact, _)] = &*RAN;
    // What it reads of the parent, the contract, the history and the cards decides every patch. Its words tell digits that are rounded.
    assert_eq!(detailed.attempts.len(), compact.attempts.len());
    for (detailed, compact) in detailed.attempts.iter().zip(&compact.attempts) {
        let rounds = [detailed, compact].map(|of| {
            let round = |round: &Round| {
                let decisions: Vec<_> = round.reviews.iter().map(|review| (review.role, review.decision)).collect();
                (round.patch.as_ref().map(|patch| patch.operations.clone()), decisions)
            };
            (of.id.clone(), of.proposal.rounds.iter().map(round).collect::<Vec<_>>())
        });
        assert_eq!(rounds[0], rounds[1]);
    }
    assert_ne!(detailed.root, compact.root, "both forms have the same keys");
}

#[test]
fn a_compact_question_is_shorter_than_the_detailed_one() {
    for (detailed, compact) in pairs() {
        let bytes = |request: &Request| request.messages.iter().map(|of| of.text.len()).sum::<usize>() as f64;
        let share = bytes(compact) / bytes(detailed);
        assert!(share < SHARE_MAX, "{:?}: {share:.3} of {} bytes", detailed.slot, bytes(detailed));
    }
}

#[test]
fn an_experiment_may_ask_in_compact_form_and_another_word_is_told_the_three() {
    let folder = tempfile::tempdir().unwrap();
    let base = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../experiments/quickstart.toml");
    let read = |word: &str| {
        let file = folder.path().join(format!("{word}.toml"));
        std::fs::write(&file, format!("base = {base:?}\nquestions = \"{word}\"\n")).unwrap();
        Experiment::read(&file)
    };
    assert_eq!(read("compact").unwrap().questions, Questions::Compact);
    let refused = read("short").unwrap_err().to_string();
    assert!(refused.contains("questions") && refused.contains("plain, detailed, compact"), "{refused}");
}
