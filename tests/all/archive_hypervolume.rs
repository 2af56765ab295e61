//! Hypervolume, masks, ranks and gains against fronts whose answers were computed by other programs.

use evodrive::archive::{hypervolume, non_dominated, non_dominated_with_copies, ranks};

use crate::harness::shared;

/// One front with its known answers.
#[derive(Default)]
struct Case {
    name: String,
    reference: [f64; 2],
    points: Vec<[f64; 2]>,
    area_bits: u64,
    first_copies: Vec<bool>,
    all_copies: Option<Vec<bool>>,
    ranks: Vec<usize>,
    candidate: Option<([f64; 2], bool)>,
}

fn check(case: &Case) {
    let area = hypervolume(&case.points, case.reference);
    assert_eq!(area.to_bits(), case.area_bits, "area of {}: {area}", case.name);
    assert_eq!(non_dominated(&case.points), case.first_copies, "mask of {}", case.name);
    assert_eq!(ranks(&case.points), case.ranks, "ranks of {}", case.name);
    if let Some(mask) = &case.all_copies {
        assert_eq!(&non_dominated_with_copies(&case.points), mask, "mask with copies of {}", case.name);
    }
    if let Some((candidate, gains)) = case.candidate {
        let mut with = case.points.clone();
        with.push(candidate);
        assert_eq!(hypervolume(&with, case.reference) - area > 0.0, gains, "gain of the candidate of {}", case.name);
    }
}

/// Reads the format described at the head of `fixtures/hypervolume/fronts.txt`.
fn own_cases() -> Vec<Case> {
    let mut cases: Vec<Case> = Vec::new();
    for line in include_str!("../fixtures/hypervolume/fronts.txt").lines().filter(|line| !line.starts_with('#')) {
        let words: Vec<&str> = line.split(' ').collect();
        let pair = || [words[1].parse().unwrap(), words[2].parse().unwrap()];
        if words[0] == "case" {
            cases.push(Case { name: words[1].to_string(), ..Case::default() });
            continue;
        }
        let case = cases.last_mut().unwrap();
        match words[0] {
            "ref" => case.reference = pair(),
            "area" => case.area_bits = u64::from_str_radix(words[1], 16).unwrap(),
            "candidate" => case.candidate = Some((pair(), words[3] == "+")),
            "point" => {
                case.points.push(pair());
                case.first_copies.push(words[3] == "1");
                case.ranks.push(words[4].parse().unwrap());
            }
            other => panic!("unknown line {other:?}"),
        }
    }
    cases
}

#[test]
fn every_front_of_the_fixture_has_its_known_answers() {
    let cases = own_cases();
    assert!(cases.len() >= 20, "{}", cases.len());
    cases.iter().for_each(check);
}

fn shared_case(value: &serde_json::Value) -> Case {
    let pair = |v: &serde_json::Value| [v[0].as_f64().unwrap(), v[1].as_f64().unwrap()];
    let flags = |v: &serde_json::Value| v.as_array().unwrap().iter().map(|b| b.as_bool().unwrap()).collect();
    let bits = value["hv_bits"].as_str().unwrap().trim_start_matches("0x");
    let candidate = &value["candidate"];
    Case {
        name: value.get("name").unwrap_or(&value["id"]).to_string(),
        reference: pair(&value["ref"]),
        points: value["points"].as_array().unwrap().iter().map(pair).collect(),
        area_bits: u64::from_str_radix(bits, 16).unwrap(),
        first_copies: flags(&value["nd_first"]),
        all_copies: Some(flags(&value["nd_all"])),
        ranks: value["rank"].as_array().unwrap().iter().map(|r| r.as_u64().unwrap() as usize).collect(),
        candidate: candidate
            .is_object()
            .then(|| (pair(&candidate["point"]), candidate["delta_positive_exact"].as_bool().unwrap())),
    }
}

#[test]
fn every_shared_front_has_its_known_answers() {
    let Some(path) = shared("cases/hypervolume.json") else { return };
    let text = std::fs::read_to_string(path).unwrap();
    let file: serde_json::Value = serde_json::from_str(&text).unwrap();
    let mut count = 0;
    for value in ["known", "cases"].iter().flat_map(|part| file[*part].as_array().unwrap()) {
        check(&shared_case(value));
        count += 1;
    }
    assert!(count >= 150, "{count}");
}
