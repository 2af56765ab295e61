//! A program as TOML is the same program, and what somebody changes in it is known by its place, its line and its hand.

use super::*;
use crate::kernel::Seed;
use crate::objects::{Gate, HandOrigin, LineageId, RunOrigin, SolutionId};
use proptest::prelude::*;

fn published(family: &str) -> ProgramFile {
    ProgramFile::published(&FamilyName::new(family)).unwrap()
}

fn read(text: &str) -> Result<ProgramFile, ProgramFileError> {
    ProgramFile::from_bytes("my.toml", text.as_bytes())
}

/// The text with one piece in place of another, which is there once.
fn edited(text: &str, old: &str, new: &str) -> String {
    assert_eq!(text.matches(old).count(), 1, "{old:?} in\n{text}");
    text.replace(old, new)
}

fn findings(text: &str) -> Vec<Finding> {
    match read(text) {
        Err(ProgramFileError::Findings { findings, .. }) => findings,
        other => panic!("{other:?}"),
    }
}

#[test]
fn every_familys_parent_is_the_same_program_as_toml_and_its_comments_say_what_its_contract_says() {
    for source in families::sources().iter() {
        let contract = &source.contract;
        let file = published(contract.family.as_str());
        let text = file.to_toml().unwrap();
        assert_eq!(read(&text).unwrap(), file, "{}", contract.family);
        assert_eq!(read(&text).unwrap().to_bytes().unwrap(), file.to_bytes().unwrap());
        let words = |text: &str| text.replace("\n# ", " ").split_whitespace().collect::<Vec<_>>().join(" ");
        let said = words(&text);
        for (name, spec) in &contract.parameters {
            assert!(said.contains(&words(&spec.domain.describe())) && said.contains(name), "{name}");
            assert!(said.contains(&words(spec.describes.trim_end_matches('.'))), "{}: {name}", contract.family);
        }
        for spec in contract.operators.values().flatten() {
            assert!(said.contains(&words(&format!("{}: {}", spec.kind, spec.describes))), "{}", spec.kind);
        }
        for feature in contract.mechanism_slots.values().flat_map(|slot| &slot.features) {
            assert!(said.contains(&words(feature.describes)), "{}", feature.name);
        }
    }
}

/// A program with every part that a file may have.
fn travelled() -> ProgramFile {
    let mut file = published("adv_bmt");
    let parent = LineageId::new("adv_bmt-idm");
    file.parent.parameters.values_mut().next().into_iter().for_each(|value| *value = ParameterValue::Number(1.0));
    file.parent_settings = [file.parent.parameters.iter().next().map(|(k, v)| (k.clone(), v.clone())).unwrap()].into();
    let hash = Digest::of_bytes(b"before");
    let of = |name: &str| SolutionId::new(name);
    file.program.ancestor_chain =
        vec![crate::objects::Ancestor { solution_id: of("adv_bmt-idm/parent"), program_hash: hash, patch_hash: hash }];
    file.program.generation = 1;
    file.program.lineage_id = parent;
    file.program.solution_id = of("adv_bmt-idm/e4s1");
    file.evolution_scenes = [Digest::of_bytes(b"scene")].into();
    let models = [("actor".to_string(), "scripted \"one\"".to_string())].into();
    file.origins =
        vec![Origin::Run(RunOrigin { run: "quickstart".into(), root: hash, solution: of("adv_bmt-idm/e4s1"), models })];
    let counsel = Counsel { attackers: vec![3, 1], ..Counsel::default() };
    file.counsel = [("synth/merge/7/1".to_string(), CarriedCounsel { scene: hash, counsel })].into();
    file.conditions.backend = Some(BackendMark { name: "metadrive".into(), version: "0.4.3".into(), digest: hash });
    file.program_hash = file.program.hash().unwrap();
    file.sealed().unwrap()
}

#[test]
fn everything_that_a_file_may_hold_survives_as_toml() {
    let file = travelled();
    let text = file.to_toml().unwrap();
    assert_eq!(read(&text).unwrap(), file, "{text}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn programs_after_random_legal_edits_are_the_same_as_toml_bit_for_bit(family in 0..64_usize, seed in any::<u64>(), steps in 1..6_usize) {
        let sources = families::sources();
        let sources: Vec<_> = sources.iter().collect();
        let source = sources[family % sources.len()];
        let values = source.contract.scene_features.iter().map(|feature| (feature.name, vec![0.1, 2.5, -7.0])).collect();
        let places = crate::candidates::Places { contract: &source.contract, values: &values, closed: &[], numbers: false };
        let mut stream = Seed(seed).stream(&["toml"]);
        let mut file = published(source.contract.family.as_str());
        for _ in 0..steps {
            let hash = file.program.hash().unwrap();
            let patch = crate::candidates::random_patch(&file.program, hash, &places, 3, &mut stream);
            let child = SolutionId::new(format!("{}/e0s0", file.program.lineage_id));
            // Edits of one node's settings and kind may not fit together; a program that is no program has no file.
            let Ok(child) = crate::candidates::apply(&file.program, hash, &patch, child) else { continue };
            if source.contract.check_program(&child).is_empty() {
                file.program = child;
            }
        }
        file.program_hash = file.program.hash().unwrap();
        let file = file.sealed().unwrap();
        let text = file.to_toml().unwrap();
        let again = read(&text).unwrap();
        prop_assert_eq!(again.to_bytes().unwrap(), file.to_bytes().unwrap(), "{}", text);
        prop_assert_eq!(again.to_toml().unwrap(), text);
    }
}

#[test]
fn a_value_that_was_changed_by_hand_says_so_and_from_which_program() {
    let file = travelled();
    let text = file.to_toml().unwrap();
    // The parent below has the same line.
    let changed = read(&text.replacen("\nshape = \"vehicle\"", "\nshape = \"cyclist\"", 1)).unwrap();
    let name = SolutionId::new("adv_bmt-idm/e4s1-hand");
    let by_hand = Origin::Hand(HandOrigin { by_hand: name.clone(), from: Some(file.program_hash) });
    assert_eq!(changed.origins, [file.origins.clone(), vec![by_hand.clone()]].concat());
    assert_eq!(by_hand.to_string(), format!("{name}, written by hand from program {}", file.program_hash.short(16)));
    assert_eq!((changed.program.solution_id.clone(), changed.program.ancestor_chain.len()), (name, 0));
    assert_ne!(changed.program_hash, file.program_hash);
    assert_eq!(changed.program_hash, changed.program.hash().unwrap());
    // As JSON it is a sound file, and as TOML again the same; a second change is still one hand from the first program.
    assert_eq!(ProgramFile::from_bytes("x.json", &changed.to_bytes().unwrap()).unwrap(), changed);
    let text = changed.to_toml().unwrap();
    assert_eq!(read(&text).unwrap(), changed);
    let twice = read(&edited(&text, "\nshape = \"cyclist\"", "\nshape = \"pedestrian\"")).unwrap();
    assert_eq!(twice.origins, changed.origins);
    // The same by other means.
    let other = Program {
        parameters: changed.program.parameters.clone(),
        operator_graph: changed.program.operator_graph.clone(),
        ..file.program.clone()
    };
    assert_eq!(file.rewritten(other).unwrap(), changed);
}

#[test]
fn comments_spaces_and_order_change_nothing_and_a_program_from_nothing_is_by_hand_alone() {
    let file = published("cat");
    let text = file.to_toml().unwrap();
    let bare: String = text.lines().filter(|line| !line.starts_with('#')).map(|line| format!("{line}  \n")).collect();
    assert_eq!(read(&bare).unwrap(), file);
    let parts = &bare[bare.find("[parameters]").unwrap()..bare.find("[descent]").unwrap()];
    let own = read(&format!("format = \"evodrive-program/1\"\nfamily = \"cat\"\n{parts}")).unwrap();
    let by_hand = HandOrigin { by_hand: file.program.solution_id.clone(), from: None };
    assert_eq!(own.origins, [Origin::Hand(by_hand)]);
    assert_eq!((own.program_hash, &own.conditions, &own.parent), (file.program_hash, &file.conditions, &file.parent));
}

#[test]
fn every_fault_has_its_gate_place_line_and_what_is_expected() {
    let text = published("cat").to_toml().unwrap();
    let line = |text: &str, what: &str| text.lines().position(|line| line.starts_with(what)).unwrap() + 1;
    let value = |name: &str| text.lines().find(|line| line.starts_with(&format!("{name} ="))).unwrap().to_string();
    let duration = value("duration_s");
    let cases = [
        (
            edited(&text, &duration, "duration_s = 99.0"),
            Gate::Interface,
            "/parameters/duration_s",
            "duration_s",
            "a number in [",
        ),
        (
            edited(&text, &duration, "duration_s = [1]"),
            Gate::Schema,
            "/parameters/duration_s",
            "duration_s",
            "a number or a word",
        ),
        (
            edited(&text, &duration, &format!("{duration}\nduratoin_s = 1.0")),
            Gate::Interface,
            "/parameters/duratoin_s",
            "duratoin_s",
            "did you mean `duration_s`?",
        ),
        (
            edited(&text, &duration, "duration_s = nan"),
            Gate::Schema,
            "/parameters/duration_s",
            "duration_s",
            "a finite number",
        ),
        (edited(&text, "\n[conditions]", "\nsolution = 1\n[conditions]"), Gate::Schema, "", "", ""),
        (
            edited(&text, "slot = \"motion\"\nkind = ", "slot = \"motoin\"\nkind = "),
            Gate::Schema,
            "/operator_graph/motion/slot",
            "slot = \"motoin\"",
            "did you mean `motion`?",
        ),
        (
            edited(&text, "slot = \"motion\"\nkind = ", "slot = \"motion\"\nkidn = 1\nkind = "),
            Gate::Schema,
            "/operator_graph/motion/kidn",
            "kidn",
            "did you mean `kind`?",
        ),
    ];
    for (text, gate, place, at, expected) in cases {
        if place.is_empty() {
            let error = read(&text).unwrap_err().to_string();
            assert!(error.contains("unknown field") && error.contains("line "), "{error}");
            continue;
        }
        let found = findings(&text);
        let one = found.iter().find(|finding| finding.problem.place == place);
        let one = one.unwrap_or_else(|| panic!("{place}: {found:?}"));
        assert_eq!((one.gate, one.line), (gate, Some(line(&text, at))), "{one}");
        assert!(one.problem.expected.contains(expected), "{one}");
    }
    let module = format!(
        "{text}\n[mechanism_modules.odd]\nslot = \"candidate_guard\"\noutput = \"boolean\"\nexpression = \"gab_m > \"\n"
    );
    let found = findings(&module);
    assert!(found.iter().any(|finding| finding.gate == Gate::Mechanism && finding.line.is_some()), "{found:?}");
    let all = findings(&edited(&text, &duration, "duration_s = 99.0\nother = 1.0\nthird = 2.0"));
    // The node that names the parameter has a say, too.
    assert_eq!(all.len(), 4, "{all:?}");
    let said = ProgramFileError::Findings { file: "my.toml".into(), findings: all }.to_string();
    assert!(said.contains("3 more, which `evodrive program check my.toml` lists"), "{said}");
}

#[test]
fn what_is_no_program_in_toml_is_refused_with_what_to_do() {
    let text = published("cat").to_toml().unwrap();
    for (text, words) in [
        ("a = = 1".to_string(), "line 1"),
        ("format = \"evodrive-program/2\"".into(), "`format` is \"evodrive-program/2\""),
        ("format = \"evodrive-program/1\"".into(), "missing the word `family`"),
        (edited(&text, "\nfamily = \"cat\"", "\nfamily = \"cats\""), "did you mean `cat`?"),
        (edited(&text, "\nadapter = 3 ", "\nadapter = 2 "), "adapter version 2 in the file, 3 here"),
        (edited(&text, "\n[parameters]", "\ncolour = 1\n[parameters]"), "/colour"),
        (edited(&text, "ego = \"idm\"", "ego = \"idn\""), "conditions.ego"),
    ] {
        let error = read(&text).expect_err(words).to_string();
        assert!(error.contains("my.toml") && error.contains(words), "{words}: {error}");
    }
    let seed =
        ProgramFile { conditions: Conditions { seed: u64::MAX, ..published("cat").conditions }, ..published("cat") };
    assert!(matches!(seed.to_toml(), Err(NotWritten::Value { place, .. }) if place == "/conditions"));
}
