//! The whole prompts of every role for families of different make, around the same sample data: what a model reads. They
//! change only on purpose; how to bless them stands in CONTRIBUTING.md.

use std::collections::BTreeMap;

use crate::adapters::Family;
use crate::agents::{
    Findings, Target, TargetKind, Task,
    example::Example,
    examples::examples,
    prompt::{Subject, patch_text, request},
};
use crate::candidates::{Judging, Trials, admit};
use crate::families;
use crate::kernel::Digest;
use crate::llm::{ModelSpec, Request};
use crate::objects::{
    Advice, FamilyName, GateReport, GateVerdict, LineageId, Operation, OperationKind, Program, ProgramPatch, Review,
    Role, SolutionId, attempt::Gate,
};

/// Bytes of a token in these prompts, measured: see docs/MODELS.md.
const BYTES_PER_TOKEN: f64 = 3.8;
/// Most tokens of a question about CAT around the sample data.
const TOKENS_MAX: f64 = 7_800.0;

fn spec() -> ModelSpec {
    ModelSpec {
        name: "model".into(),
        kind: "exchange".into(),
        model: "anyone".into(),
        sampling: BTreeMap::new(),
        response_format: None,
        body: BTreeMap::new(),
        here: Default::default(),
    }
}

/// The questions of all roles about a family.
fn asked(family: &str) -> Vec<Request> {
    let family = families::registry().get(&FamilyName::new(family)).unwrap().clone();
    let example = Example::of(family.contract, family.parent, vec!["swarm_budget".into()]);
    let briefing = example.briefing();
    let target = Target {
        kind: TargetKind::RaiseAttack,
        text: "Raise attack above 0.400 while realism, now 0.931, stays at or above 0.900.".into(),
        instruction: "Look at who is chosen.".into(),
    };
    let models = BTreeMap::new();
    let task = Task {
        briefing: &briefing,
        slot: 0,
        target: &target,
        models: &models,
        critics: &Role::CRITICS,
        max_repair_rounds: 1,
    };
    let patch = patch_text(&ProgramPatch {
        source_baseline: example.parent.source_family.clone(),
        parent_solution_id: example.parent.solution_id.clone(),
        parent_program_hash: "0".repeat(64),
        operations: vec![Operation {
            op: OperationKind::Replace,
            path: "/parameters/temperature".into(),
            value: Some(0.25.into()),
        }],
        hypothesis: "A sharper choice meets the ego more often.".into(),
        memory_refs_used: vec![],
        cluster_refs_used: vec![],
        repair_summary: None,
    });
    let verdict = GateVerdict { gate: Gate::Parent, problems: vec!["found a hash that is not the parent's".into()] };
    let findings = Findings { gates: GateReport { verdicts: vec![verdict] }, compared: 8, differing: 3 };
    let reviews = [Review {
        role: Role::AttackCritic,
        decision: Advice::Repair,
        blockers: vec!["/parameters/temperature: too small a change".into()],
        repair_hints: vec!["set it to 0.1".into()],
        risk_tags: vec![],
        scope: "pre_simulation".into(),
    }];
    let patch = patch.unwrap();
    let roles = [Role::Actor].into_iter().chain(Role::CRITICS).chain([Role::Repair]);
    let question = |role| {
        let subject = match role {
            Role::Actor => Subject::None,
            Role::Repair => Subject::Repair { patch: &patch, reviews: &reviews, findings: &findings },
            _ => Subject::Review { patch: &patch, findings: &findings, unusable: None },
        };
        request(&task, &spec(), role, 0, &subject).unwrap()
    };
    roles.map(question).collect()
}

/// What all roles share once, then what each is told besides.
fn golden(family: &str) -> String {
    let asked = asked(family);
    let shared = asked[0].messages[..2].iter().map(|m| format!("[{}]\n{}\n", m.role, &*m.text)).collect::<String>();
    let own = asked.iter().map(|request| {
        let prompt = request.messages[2..].iter().map(|m| format!("[{}]\n{}\n", m.role, &*m.text)).collect::<String>();
        format!("==== {} ====\n{prompt}", request.slot.role)
    });
    format!("==== every role ====\n{shared}{}", own.collect::<String>())
}

/// The examples of each family are patches that its gates let through, but for the compiler, which is not asked here; the first
/// operation of the structural one, alone, too: its fault is that it has no effect.
#[test]
fn the_examples_of_a_prompt_pass_the_gates_of_their_family() {
    let registry = families::registry();
    let mut structural = 0;
    for family in registry.iter() {
        let (contract, parent) = (&family.contract, family.parent.adopted(&LineageId::new("a-lineage")));
        let examples = examples(contract, &parent);
        structural += usize::from(examples.works.is_some());
        for text in examples.works.iter().chain(&examples.rule) {
            let operations: Vec<Operation> = serde_json::from_str(text).unwrap();
            assert!(handbook_of(family).contains(text.as_str()), "{}", contract.family);
            for length in 1..=operations.len() {
                let patch = ProgramPatch {
                    source_baseline: contract.family.clone(),
                    parent_solution_id: parent.solution_id.clone(),
                    parent_program_hash: parent.hash().unwrap().to_hex(),
                    operations: operations[..length].to_vec(),
                    hypothesis: "An example.".into(),
                    memory_refs_used: vec![],
                    cluster_refs_used: vec![],
                    repair_summary: None,
                };
                let compiles = |_: &Program, _: Digest| Trials::default();
                let child = SolutionId::new("a-lineage/e0s0");
                let gates = admit(&parent, &patch, child, &Judging::whole(contract, &registry), &compiles).gates;
                let problems: Vec<&String> = gates.failed().flat_map(|verdict| &verdict.problems).collect();
                // Between its first and its last operation the node leads nowhere yet.
                let whole = length == 1 || length == operations.len();
                assert!(problems.is_empty() || !whole, "{}: {text}: {problems:?}", contract.family);
            }
        }
    }
    assert!(structural > 5, "{structural} families have a structural example");
}

fn handbook_of(family: &Family) -> String {
    let example = Example::of(family.contract.clone(), family.parent.clone(), vec![]);
    example.context().handbook.text().to_string()
}

#[test]
fn prompts_of_cat() {
    insta::assert_snapshot!("prompts_cat", golden("cat"));
}

#[test]
fn prompts_of_king() {
    insta::assert_snapshot!("prompts_king", golden("king"));
}

#[test]
fn prompts_of_strive() {
    insta::assert_snapshot!("prompts_strive", golden("strive"));
}

#[test]
fn prompts_of_chatscene() {
    insta::assert_snapshot!("prompts_chatscene", golden("chatscene"));
}

#[test]
fn a_sample_question_about_cat_stays_short() {
    for request in asked("cat") {
        let bytes: usize = request.messages.iter().map(|message| message.text.len()).sum();
        let tokens = bytes as f64 / BYTES_PER_TOKEN;
        println!("{}: {bytes} bytes, about {tokens:.0} tokens", request.slot.role);
        assert!(tokens < TOKENS_MAX, "{}: {bytes} bytes, about {tokens:.0} tokens", request.slot.role);
    }
}
