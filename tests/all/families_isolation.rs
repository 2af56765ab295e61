//! For every ordered pair of registered families: a patch that uses the other's private vocabulary fails the isolation
//! gate, wherever the word stands, and the same patch without it does not.

use evodrive::adapters::{Family, Registry};
use evodrive::candidates::{Admission, Judging, Trials, admit};
use evodrive::families;
use evodrive::objects::{Gate, LineageId, Operation, OperationKind, ProgramPatch, SolutionId};
use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet};

fn judged(registry: &Registry, family: &Family, operation: Operation) -> Admission {
    let mut parent = family.parent.clone();
    let lineage = format!("{}-idm", family.contract.family);
    parent.lineage_id = LineageId::new(&lineage);
    parent.solution_id = SolutionId::new(format!("{lineage}/parent"));
    let patch = ProgramPatch {
        source_baseline: family.contract.family.clone(),
        parent_solution_id: parent.solution_id.clone(),
        parent_program_hash: parent.hash().unwrap().to_hex(),
        operations: vec![operation],
        hypothesis: "a changed step".into(),
        memory_refs_used: vec![],
        cluster_refs_used: vec![],
        repair_summary: None,
        free: Default::default(),
    };
    let child = SolutionId::new(format!("{lineage}/e1s0"));
    let judging = Judging::whole(&family.contract, registry);
    admit(&parent, &patch, child, &judging, &|_, _| Trials::default())
}

fn add(path: String, value: Value) -> Operation {
    Operation { op: OperationKind::Add, path, value: Some(value) }
}

fn module(name: &str, expression: &str, inputs: &[&str]) -> Operation {
    let value =
        json!({"slot": "actor_score", "inputs": inputs, "output": "number", "expression": expression, "tags": []});
    add(format!("/mechanism_modules/{name}"), value)
}

/// Places of a patch where a word can stand.
fn uses(word: &str) -> Vec<Operation> {
    vec![
        add(format!("/parameters/{word}"), json!(1.0)),
        Operation {
            op: OperationKind::Replace,
            path: "/operator_graph/search".into(),
            value: Some(json!({"slot": "search", "kind": word, "settings": {}, "inputs": ["motion"]})),
        },
        add(format!("/operator_graph/search/settings/{word}"), json!(1.0)),
        module("pressure", &format!("gap_m + {word}"), &["gap_m", word]),
    ]
}

fn fails_isolation(admission: &Admission) -> bool {
    admission.gates.failed().any(|verdict| verdict.gate == Gate::Isolation)
}

#[test]
fn a_patch_with_another_familys_private_word_fails_the_isolation_gate() {
    let registry = families::registry();
    let (mut pairs, mut tried) = (0, BTreeMap::<String, BTreeSet<usize>>::new());
    for (nth, own) in registry.iter().enumerate() {
        for other in registry.iter().filter(|o| o.contract.family != own.contract.family) {
            pairs += 1;
            assert!(!other.contract.private_vocabulary.is_empty());
            // Every family tries every word, each at another place of a patch.
            for (word, of) in other.contract.private_vocabulary.iter().zip(0..) {
                let mut operations = uses(word);
                let place = (nth + of) % operations.len();
                let operation = operations.swap_remove(place);
                let admission = judged(&registry, own, operation.clone());
                let (own, other) = (&own.contract.family, &other.contract.family);
                assert!(fails_isolation(&admission), "{own} may say `{word}` of {other} in {operation:?}");
                assert_eq!(admission.candidate, None);
                tried.entry(format!("{word} of {other}")).or_default().insert(place);
            }
        }
    }
    let places = uses("word").len();
    assert!(tried.values().all(|of| of.len() == places), "a word was not tried at every place: {tried:?}");
    let families = registry.iter().count();
    assert!(families > 1 && pairs == families * (families - 1));
}

#[test]
fn a_patch_in_a_familys_own_words_passes_every_gate() {
    let registry = families::registry();
    for own in registry.iter() {
        let value = json!({
            "slot": "candidate_guard",
            "inputs": ["jerk_mps3_max"],
            "output": "boolean",
            "expression": "jerk_mps3_max < 20",
            "tags": []
        });
        let admission = judged(&registry, own, add("/mechanism_modules/calm".into(), value));
        let problems: Vec<_> = admission.gates.failed().collect();
        assert!(problems.is_empty(), "{}: {problems:?}", own.contract.family);
    }
}
