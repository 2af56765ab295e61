//! Every fault of a program file is refused in its own words.

use super::*;
use crate::adapters::ADAPTER_VERSION;
use crate::evaluation::EVAL_VERSION;
use crate::experiment::Experiment;
use crate::families;
use crate::objects::{LineageId, SolutionId};
use crate::sim::SIM_VERSION;
use serde_json::Value;
use std::path::Path;

/// CAT's parent under the quickstart's conditions.
fn file() -> ProgramFile {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../experiments/quickstart.toml");
    let experiment = Experiment::read(&path).unwrap();
    let source = families::sources().get(&FamilyName::new("cat")).unwrap().clone();
    let parent = source.parent.adopted(&LineageId::new("cat-idm"));
    let file = ProgramFile {
        format: FORMAT.into(),
        digest: Digest::of_bytes(&[]),
        family: FamilyName::new("cat"),
        contract: ContractMark::of(&source.contract).unwrap(),
        program: Program { solution_id: SolutionId::new("cat-idm/e0s0"), ..parent.clone() },
        program_hash: parent.hash().unwrap(),
        parent,
        parent_settings: BTreeMap::new(),
        conditions: Conditions {
            ego: "idm".into(),
            seed: experiment.seed,
            versions: Versions { adapter: ADAPTER_VERSION, sim: SIM_VERSION, eval: EVAL_VERSION },
            simulator: experiment.simulator.rules(),
            backend: None,
            evaluation: experiment.evaluation,
        },
        counsel: BTreeMap::new(),
        sequences: BTreeMap::new(),
        evolution_scenes: BTreeSet::new(),
        origins: vec![],
    };
    file.sealed().unwrap()
}

fn text() -> String {
    String::from_utf8(file().to_bytes().unwrap()).unwrap()
}

fn refused(text: &str) -> ProgramFileError {
    ProgramFile::from_bytes("p.json", text.as_bytes()).expect_err("it must be refused")
}

/// Returns the error that an edit of the file's JSON value causes.
fn edited(edit: impl FnOnce(&mut Value)) -> ProgramFileError {
    let mut value: Value = serde_json::from_str(&text()).unwrap();
    edit(&mut value);
    refused(&value.to_string())
}

#[test]
fn whose_labels_a_program_was_evolved_on_is_written_only_where_it_was_another_simulator() {
    let value: Value = serde_json::from_str(&text()).unwrap();
    assert!(value["conditions"].get("backend").is_none());
    let mut elsewhere = file();
    let mark = |version: &str| BackendMark {
        name: "metadrive".into(),
        version: version.into(),
        digest: Digest::of_bytes(b"w"),
    };
    elsewhere.conditions.backend = Some(mark("0.4.3"));
    let sealed = elsewhere.clone().sealed().unwrap();
    assert_ne!(sealed.digest, file().digest);
    assert_eq!(ProgramFile::from_bytes("p.json", &sealed.to_bytes().unwrap()).unwrap(), sealed);
    elsewhere.conditions.backend = Some(mark("0.4\u{7}"));
    let strange = elsewhere.sealed().unwrap().to_bytes().unwrap();
    assert!(ProgramFile::from_bytes("p.json", &strange).unwrap_err().to_string().contains("control characters"));
}

#[test]
fn what_is_written_is_read_again_and_written_the_same() {
    let read = ProgramFile::from_bytes("p.json", text().as_bytes()).unwrap();
    assert_eq!(read, file());
    assert_eq!(String::from_utf8(read.to_bytes().unwrap()).unwrap(), text());
    // Spaces carry no meaning.
    let value: Value = serde_json::from_str(&text()).unwrap();
    assert_eq!(ProgramFile::from_bytes("p.json", value.to_string().as_bytes()).unwrap(), file());
}

#[test]
fn a_changed_value_is_found_by_its_digest() {
    let seed = edited(|value| value["conditions"]["seed"] = 1.into());
    assert!(matches!(&seed, ProgramFileError::Digest { what: "its content", .. }), "{seed}");
    let program = edited(|value| value["program"]["parameters"]["duration_s"] = 3.25.into());
    assert!(matches!(&program, ProgramFileError::Digest { what: "the program", .. }), "{program}");
    assert!(program.to_string().contains("damaged or edited"), "{program}");
    let digest = edited(|value| value["digest"] = "0".repeat(64).into());
    assert!(matches!(digest, ProgramFileError::Digest { what: "its content", .. }));
}

#[test]
fn a_file_that_was_cut_off_says_so_wherever_it_was_cut() {
    let whole = text();
    for share in [0.0, 0.2, 0.5, 0.9, 0.999] {
        let error = refused(&whole[..(whole.trim_end().len() as f64 * share) as usize]);
        assert!(matches!(error, ProgramFileError::Truncated { .. }), "{share}: {error}");
    }
}

#[test]
fn numbers_that_are_not_finite_are_named_with_their_line() {
    let duration = text().lines().position(|line| line.contains("\"duration_s\"")).unwrap() + 1;
    for word in ["NaN", "Infinity", "-Infinity", "1e999"] {
        let lines: Vec<String> = text()
            .lines()
            .enumerate()
            .map(|(i, line)| {
                if i + 1 == duration {
                    format!("{}: {word},", line.split(':').next().unwrap())
                } else {
                    line.to_string()
                }
            })
            .collect();
        let error = refused(&lines.join("\n"));
        assert!(matches!(&error, ProgramFileError::NotFinite { line, .. } if *line == duration), "{word}: {error}");
    }
}

#[test]
fn unknown_and_missing_fields_and_other_formats_are_named() {
    let unknown = edited(|value| value["colour"] = "red".into());
    assert!(matches!(&unknown, ProgramFileError::Shape { reason, .. } if reason.contains("colour")), "{unknown}");
    let deep = edited(|value| value["program"]["colour"] = "red".into());
    assert!(matches!(&deep, ProgramFileError::Shape { reason, .. } if reason.contains("colour")), "{deep}");
    let missing = edited(|value| drop(value.as_object_mut().unwrap().remove("origins")));
    assert!(matches!(&missing, ProgramFileError::Shape { reason, .. } if reason.contains("origins")), "{missing}");
    let format = edited(|value| value["format"] = "evodrive-program/2".into());
    assert!(matches!(&format, ProgramFileError::Format { found, .. } if found.contains("/2")), "{format}");
    assert!(matches!(refused("[1, 2]"), ProgramFileError::Format { found, .. } if found == "missing"));
    assert!(matches!(refused("name = \"a TOML file\""), ProgramFileError::NotJson { .. }));
}

#[test]
fn another_family_is_refused_by_name() {
    let unknown = edited(|value| value["family"] = "cats".into());
    assert!(unknown.to_string().contains("did you mean `cat`?"), "{unknown}");
    let at = families::sources().get(&FamilyName::new("at")).unwrap().clone();
    let swapped = edited(|value| {
        value["family"] = "at".into();
        value["contract"] = serde_json::to_value(ContractMark::of(&at.contract).unwrap()).unwrap();
    });
    assert!(matches!(&swapped, ProgramFileError::Family { place: "program.source_family", .. }), "{swapped}");
}

#[test]
fn another_contract_is_refused_with_what_changed() {
    let version = edited(|value| value["contract"]["adapter"] = (ADAPTER_VERSION + 1).into());
    let (file, here) =
        (format!("adapter version {} in the file", ADAPTER_VERSION + 1), format!("{ADAPTER_VERSION} here"));
    assert!(version.to_string().contains(&file) && version.to_string().contains(&here), "{version}");
    let names = edited(|value| {
        value["contract"]["digest"] = "1".repeat(64).into();
        let names = value["contract"]["names"].as_array_mut().unwrap();
        names.push("parameter hover_height_m".into());
        names.retain(|name| name != "parameter duration_s");
    });
    for part in [
        "contract 1111111111111111 in the file",
        "unknown now: parameter hover_height_m",
        "new since: parameter duration_s",
    ] {
        assert!(names.to_string().contains(part), "{part:?} is not in {names}");
    }
}

#[test]
fn a_contract_that_only_grew_or_is_worded_anew_leaves_the_program_what_it_was() {
    let mut older = file();
    older.contract.digest = Digest::of_bytes(b"the contract of last year");
    older.contract.names.remove("parameter duration_s");
    let older = older.sealed().unwrap();
    assert_eq!(ProgramFile::from_bytes("old.json", &older.to_bytes().unwrap()).unwrap(), older);
}

#[test]
fn texts_that_a_terminal_would_obey_are_refused_and_never_printed() {
    let label = edited(|value| value["program"]["solution_id"] = "\u{1b}[2J".into());
    assert!(
        matches!(&label, ProgramFileError::Options { reason, .. } if reason.contains("control characters")),
        "{label}"
    );
    let family = edited(|value| value["family"] = format!("{}{}", "\u{1b}[2J", "x".repeat(10_000)).into());
    for error in [label, family] {
        let said = error.to_string();
        assert!(!said.contains('\u{1b}') && said.len() < 2_000, "{said}");
    }
}

#[test]
fn options_that_nothing_can_be_labelled_with_are_refused() {
    for (place, value, word) in [
        ("/conditions/ego", Value::from("expert"), "no ego policy"),
        ("/conditions/simulator/avoidance/horizon_s", Value::from(-1.0), "avoidance.horizon_s"),
        ("/conditions/evaluation/realism/weights/bounded_jerk", Value::from(0.9), "sum"),
    ] {
        let error = edited(|file| *file.pointer_mut(place).unwrap() = value);
        assert!(matches!(&error, ProgramFileError::Options { reason, .. } if reason.contains(word)), "{error}");
    }
}

#[test]
fn a_program_that_breaks_its_contract_is_refused_although_its_digests_fit() {
    let mut broken = file();
    broken.program.parameters.insert("hover_height_m".into(), ParameterValue::Number(1.0));
    broken.program_hash = broken.program.hash().unwrap();
    let bytes = broken.sealed().unwrap().to_bytes().unwrap();
    let error = ProgramFile::from_bytes("p.json", &bytes).expect_err("an unknown parameter");
    assert!(
        matches!(&error, ProgramFileError::Program { problem, .. } if problem.contains("hover_height_m")),
        "{error}"
    );
}

#[test]
fn a_file_that_is_too_large_is_refused_before_it_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("large.json");
    std::fs::write(&path, vec![b' '; (8 << 20) + 1]).unwrap();
    let error = ProgramFile::read(&path).expect_err("too large");
    assert!(matches!(&error, ProgramFileError::TooLarge { bytes_max, .. } if *bytes_max == 8 << 20), "{error}");
}
