//! The whole prompts of every role for families of different make, around the same sample data: what a model reads. They
//! change only on purpose; how to bless them stands in CONTRIBUTING.md.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Debug;

use serde_json::json;

use crate::adapters::Family;
use crate::agents::{
    Findings, Questions, Target, TargetKind, Task,
    example::{Example, measures},
    examples::examples,
    prompt::{Subject, request},
};
use crate::candidates::{Judging, Trials, admit};
use crate::families;
use crate::kernel::Digest;
use crate::llm::{ModelSpec, Request};
use crate::objects::{
    Advice, FamilyName, GateReport, GateVerdict, LineageId, MechanismModule, Operation, OperationKind, ParameterRef,
    ParameterValue, Program, ProgramPatch, Review, Role, Setting, SolutionId, attempt::Gate,
};
use crate::sim::ContactClass;

use super::reader::PromptView;

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
    asked_about(&Example::of(family.contract, family.parent, vec!["swarm_budget".into()]))
}

/// The same about a family in its surroundings. The patch repeats another hash than the parent's.
fn asked_about(example: &Example) -> Vec<Request> {
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
        gates: Default::default(),
        unreadable_critic: Default::default(),
        unreadable_patch: Default::default(),
        tunes: false,
    };
    let patch = briefing.patch_text(&ProgramPatch {
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
        free: Default::default(),
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
            Role::Repair => Subject::Repair { patch: &patch, reviews: &reviews, findings: Some(&findings) },
            _ => Subject::Review { patch: &patch, findings: Some(&findings), unusable: None },
        };
        request(&task, &spec(), role, 0, &subject).unwrap()
    };
    roles.map(question).collect()
}

/// Whoever reads a compact question learns what a reader of the detailed one learns: its blocks are told at length again and compared.
#[test]
fn a_compact_question_is_read_as_the_detailed_one() {
    let module = |slot: &str, output, expression: &str, inputs: &[&str]| MechanismModule {
        slot: slot.into(),
        inputs: inputs.iter().map(|name| (*name).to_string()).collect(),
        output,
        expression: expression.into(),
        tags: vec!["one".into(), "two".into()],
    };
    let rule = |parameter: &str, node: &str, setting: &str| {
        json!({"name": "busy", "when": "min(vehicle_count, 9) >= 8", "parameters": {parameter: 1.25},
            "operators": {node: {setting: {"parameter": parameter}}}})
    };
    for family in families::registry().iter() {
        let (contract, mut parent) = (family.contract.clone(), family.parent.adopted(&LineageId::new("toy-idm")));
        // A program that was edited: modules in both orders of inputs, a rule, another value, a parameter of another name.
        for (slot, spec) in &contract.mechanism_slots {
            let names: Vec<&str> = spec.features.iter().take(2).map(|feature| feature.name).collect();
            let [a, b] = names.as_slice() else { continue };
            for (place, inputs) in [[*a, *b], [*b, *a]].iter().enumerate() {
                let of = module(slot, spec.output, &format!("min({b}, {a}) + 1"), inputs);
                parent.mechanism_modules.insert(format!("{slot}_{place}"), of);
            }
        }
        let numbers: Vec<String> = parent.parameters.keys().take(2).cloned().collect();
        let node = parent.operator_graph.keys().next().unwrap().clone();
        parent.parameters.insert(numbers[0].clone(), ParameterValue::Number(1.25));
        let settings = &mut parent.operator_graph.get_mut(&node).unwrap().settings;
        settings.insert("other".into(), Setting::Parameter(ParameterRef { parameter: numbers[0].clone() }));
        settings.insert("word".into(), Setting::Choice("add".into()));
        let rule = rule(&numbers[0], &node, "other");
        parent.scenario_conditioned_policy.push(serde_json::from_value(rule).unwrap());

        let in_form = |questions| {
            let measures = measures(contract.backend == "safebench");
            // The handbook is of the family's own parent, the context of the edited one.
            let mut example = Example::in_form(contract.clone(), family.parent.clone(), vec![], &measures, questions);
            example.parent = parent.clone();
            asked_about(&example)
        };
        let [detailed, compact] = [Questions::Detailed, Questions::Compact].map(in_form);
        for (detailed, compact) in detailed.iter().zip(&compact) {
            let [mut whole, mut told] = [detailed, compact].map(|request| PromptView::read(request).unwrap());
            for view in [&mut whole, &mut told] {
                view.contract.mechanism_slots.values_mut().for_each(|slot| slot.meaning.clear());
            }
            let role = format!("{} of {}", detailed.slot.role, contract.family);
            let same = |what: &str, whole: &dyn Debug, told: &dyn Debug| {
                assert_eq!(format!("{whole:#?}"), format!("{told:#?}"), "{what}: {role}");
            };
            same("contract", &whole.contract, &told.contract);
            same("parent", &whole.program, &told.program);
            same("parts", &whole.parts, &told.parts);
            same("memory", &whole.memory, &told.memory);
            same("target", &whole.asked, &told.asked);
            same("patch", &whole.patch, &told.patch);
            same("refused", &whole.refused, &told.refused);
            same("reviews", &whole.reviews, &told.reviews);
            same("identity", &whole.identity, &told.identity);
            same("weakest", &whole.weakest().map(|(name, _)| name), &told.weakest().map(|(name, _)| name));
            assert_eq!(whole.chains_are_one_level, told.chains_are_one_level, "{role}");
            for (whole, told) in whole.history.iter().zip(&told.history) {
                assert!(whole.has_tag("speed_mismatch") && told.has_tag("speed_mismatch"), "{told:?}");
                let realism = [whole, told].map(|edit| edit.change.as_ref().unwrap().realism());
                assert_eq!(realism[0], realism[1], "{role}");
            }
            assert_eq!(whole.history.len(), told.history.len());
            assert_eq!(whole.clusters.len(), told.clusters.len());
        }
    }
}

/// Meanings that compact questions shorten are those of contracts, so that none outlives its contract.
#[test]
fn every_meaning_that_is_shortened_stands_in_a_contract_and_gets_shorter() {
    let contracts: String =
        families::registry().iter().map(|family| family.contract.to_prompt_json().to_string()).collect();
    let mut lines = 0;
    for line in include_str!("../agents/prompts/short_meanings.txt").lines() {
        let (whole, short) = line.split_once(" => ").unwrap();
        assert!(contracts.contains(&format!("\"meaning\":{}", json!(whole))), "{whole}");
        assert!(!short.is_empty() && short.len() < whole.len(), "{line}");
        lines += 1;
    }
    assert!(lines > 50, "{lines}");
}

/// A compact handbook marks every class of contact that counts, and knows all of them.
#[test]
fn a_compact_handbook_names_every_class_of_contact() {
    let example = |questions| {
        let family = families::registry().get(&FamilyName::new("cat")).unwrap().clone();
        Example::in_form(family.contract, family.parent, vec![], &measures(false), questions)
    };
    let compact = example(Questions::Compact);
    let text = compact.context().handbook.text().to_string();
    for class in ContactClass::ALL {
        assert!(text.contains(class.name()), "{}", class.name());
    }
    let whole = example(Questions::Detailed);
    let counts = whole.context().handbook.text().split_once("Always count: ").unwrap().1.to_string();
    let counts = counts.split_once(". Count").unwrap().0;
    let marked = ContactClass::ALL.iter().filter(|class| text.contains(&format!("+{}", class.name())));
    let marked: Vec<&str> = marked.map(|class| class.name()).collect();
    assert!(!marked.is_empty());
    assert_eq!(marked.iter().collect::<BTreeSet<_>>(), counts.split(", ").collect::<Vec<_>>().iter().collect());
}

#[test]
fn prompts_of_cat_in_compact_form() {
    let family = families::registry().get(&FamilyName::new("cat")).unwrap().clone();
    let example = Example::in_form(family.contract, family.parent, vec![], &measures(false), Questions::Compact);
    insta::assert_snapshot!("prompts_cat_compact", told(&asked_about(&example)));
}

/// Returns what all roles share, once, and then what each is told besides.
fn golden(family: &str) -> String {
    told(&asked(family))
}

fn told(asked: &[Request]) -> String {
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
        let examples = examples(contract, &parent, false);
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
                    free: Default::default(),
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
