//! The role loop against models that answer by a table, and replies against schema and parser.

use serde_json::{Value, json};
use std::{collections::BTreeMap, sync::Mutex};

use super::{
    AgentError, End, Findings, Measures, Proposed, Protocol, Target, TargetKind, Task, example::Example, prompt,
    propose, reply, schema,
};
use crate::{
    kernel::Digest,
    llm::{Ask, AskError, DraftJudge, ModelSpec, Reply, Request},
    objects::{
        Advice, GateReport, GateVerdict, GatesAsked, ProgramPatch, Role, UnreadableCritic, UnreadablePatch,
        attempt::Gate,
    },
};

/// Answers by role and round; keeps what was asked.
struct Table {
    answers: BTreeMap<(&'static str, u32), String>,
    asked: Mutex<Vec<Request>>,
}

impl Ask for Table {
    fn ask_with(&self, request: &Request, _: Option<&dyn DraftJudge>) -> Result<Reply, AskError> {
        self.asked.lock().unwrap().push(request.clone());
        let place =
            self.answers.iter().find(|((role, round), _)| *role == request.slot.role && *round == request.slot.round);
        let critic = request.slot.role.ends_with("critic");
        let text = match place {
            Some((_, text)) => text.clone(),
            None if critic => review_reply(&request.slot.role, "approve").to_string(),
            None => patch_reply(request.slot.role == "repair").to_string(),
        };
        let response = Digest::of_bytes(text.as_bytes());
        Ok(Reply {
            request: request.key().unwrap(),
            response,
            bytes: text.into_bytes(),
            metadata: None,
            sealed_metadata: None,
        })
    }
}

fn patch_reply(repaired: bool) -> Value {
    let mut patch = json!({
        "source_baseline": "toy",
        "parent_solution_id": "toy-idm/parent",
        "parent_program_hash": "00",
        "operations": [{"op": "replace", "path": "/parameters/temperature", "value": 0.5}],
        "hypothesis": "Sharper choice.",
        "memory_refs_used": [],
        "cluster_refs_used": [],
    });
    if repaired {
        patch["repair_summary"] = "Halved the change.".into();
    }
    json!({"response_id": "r", "program_patch": patch})
}

fn review_reply(role: &str, decision: &str) -> Value {
    json!({"response_id": "r", "critic_review": {
        "role": role, "decision": decision, "blockers": ["a blocker"], "repair_hints": [], "risk_tags": [], "scope": "pre_simulation",
    }})
}

fn models() -> BTreeMap<Role, ModelSpec> {
    let spec = |role: Role| ModelSpec {
        name: format!("model of {}", role.name()),
        kind: "table".into(),
        model: "table".into(),
        sampling: BTreeMap::new(),
        response_format: None,
        body: BTreeMap::new(),
        here: Default::default(),
    };
    [Role::Actor, Role::Repair].into_iter().chain(Role::CRITICS).map(|role| (role, spec(role))).collect()
}

fn target() -> Target {
    let kind = TargetKind::RaiseAttack;
    Target { kind, text: "Raise attack above 0.400.".into(), instruction: "Look at who is chosen.".into() }
}

/// Returns the findings of gates that find nothing wrong.
fn passed() -> Findings {
    let all = [
        Gate::Schema,
        Gate::Parent,
        Gate::Interface,
        Gate::Isolation,
        Gate::Protected,
        Gate::Mechanism,
        Gate::Compile,
        Gate::Effect,
    ];
    let verdicts = all.into_iter().map(|gate| GateVerdict { gate, problems: vec![] }).collect();
    Findings { gates: GateReport { verdicts }, compared: 8, differing: 5 }
}

/// The same with a problem of one gate.
fn refused(gate: Gate, problem: &str) -> Findings {
    let mut findings = passed();
    findings.gates.verdicts.iter_mut().filter(|v| v.gate == gate).for_each(|v| v.problems.push(problem.into()));
    findings
}

fn run(answers: &[(&'static str, u32, String)], max_repair_rounds: u32) -> (Proposed, Vec<Request>) {
    run_with(answers, max_repair_rounds, &|_| passed())
}

fn run_with(
    answers: &[(&'static str, u32, String)],
    max_repair_rounds: u32,
    gates: &dyn Fn(&ProgramPatch) -> Findings,
) -> (Proposed, Vec<Request>) {
    run_of(models(), answers, max_repair_rounds, gates)
}

fn run_of(
    models: BTreeMap<Role, ModelSpec>,
    answers: &[(&'static str, u32, String)],
    max_repair_rounds: u32,
    gates: &dyn Fn(&ProgramPatch) -> Findings,
) -> (Proposed, Vec<Request>) {
    run_by(Rules::default(), models, answers, max_repair_rounds, gates)
}

/// Rules of the proposal.
#[derive(Clone, Copy, Default)]
struct Rules {
    gates: GatesAsked,
    unreadable_critic: UnreadableCritic,
    unreadable_patch: UnreadablePatch,
    tunes: bool,
}

fn run_by(
    Rules { gates: gates_asked, unreadable_critic, unreadable_patch, tunes }: Rules,
    models: BTreeMap<Role, ModelSpec>,
    answers: &[(&'static str, u32, String)],
    max_repair_rounds: u32,
    gates: &dyn Fn(&ProgramPatch) -> Findings,
) -> (Proposed, Vec<Request>) {
    let answers = answers.iter().map(|(role, round, text)| ((*role, *round), text.clone())).collect();
    let table = Table { answers, asked: Mutex::new(vec![]) };
    let (example, target) = (Example::toy(), target());
    let briefing = example.briefing();
    let task = Task {
        briefing: &briefing,
        slot: 5,
        target: &target,
        models: &models,
        critics: &Role::CRITICS,
        max_repair_rounds,
        gates: gates_asked,
        unreadable_critic,
        unreadable_patch,
        tunes,
    };
    let check = |patch: &ProgramPatch| -> Result<Findings, AgentError> { Ok(gates(patch)) };
    let proposed = propose(&task, &table, &check).unwrap();
    (proposed, table.asked.into_inner().unwrap())
}

#[test]
fn a_patch_that_all_four_critics_approve_is_returned_after_one_round() {
    let (proposed, asked) = run(&[], 2);
    assert!(matches!(proposed.end, End::Patch(_)));
    let roles: Vec<&str> = asked.iter().map(|r| r.slot.role.as_str()).collect();
    assert_eq!(roles, ["actor", "structural_critic", "attack_critic", "realism_critic", "isolation_critic"]);
    assert_eq!(proposed.proposal.exchanges.len(), 5);
    assert_eq!(proposed.proposal.rounds.len(), 1);
}

#[test]
fn a_rejection_by_any_critic_ends_the_proposal_without_a_repair() {
    for role in Role::CRITICS {
        let (proposed, asked) = run(&[(role.name(), 0, review_reply(role.name(), "reject").to_string())], 2);
        let End::Declined { reason } = &proposed.end else { panic!("{role:?} was overruled") };
        assert!(reason.contains(role.name()) && reason.contains("a blocker"), "{reason}");
        assert_eq!(asked.len(), 5, "the whole quorum is heard");
    }
}

#[test]
fn a_repaired_patch_goes_back_to_all_four_critics() {
    let (proposed, asked) = run(&[("attack_critic", 0, review_reply("attack_critic", "repair").to_string())], 2);
    let End::Patch(patch) = &proposed.end else { panic!("{:?}", proposed.end) };
    assert!(patch.repair_summary.is_some());
    assert_eq!(asked.len(), 10);
    assert_eq!(asked[5].slot.role, "repair");
    assert_eq!(asked[5].slot.round, 1);
    assert!(asked[5].messages[3].text.contains("a blocker"), "the repair sees the reviews");
    assert_eq!(proposed.proposal.rounds[0].reviews[1].decision, Advice::Repair);
}

#[test]
fn repair_rounds_are_bounded_and_the_last_review_is_not_followed_by_a_repair() {
    let stubborn: Vec<_> =
        (0..5).map(|k| ("realism_critic", k, review_reply("realism_critic", "repair").to_string())).collect();
    for limit in 0..3 {
        let (proposed, asked) = run(&stubborn, limit);
        assert!(matches!(proposed.end, End::Declined { .. }));
        assert_eq!(asked.iter().filter(|r| r.slot.role == "repair").count(), limit as usize);
        assert_eq!(proposed.proposal.rounds.len(), 1 + limit as usize);
    }
}

#[test]
fn an_unreadable_actor_reply_is_recorded_and_its_text_goes_to_the_repair() {
    let (proposed, asked) = run(&[("actor", 0, "Sure! {\"response_id\"".into())], 1);
    assert!(matches!(proposed.end, End::Patch(_)));
    assert!(proposed.proposal.exchanges[0].refusal.as_ref().unwrap().contains("JSON"));
    assert_eq!(proposed.proposal.rounds[0].patch, None);
    assert_eq!(asked[1].slot.role, "repair");
    assert!(asked[1].messages[3].text.contains("Sure!"));
    let (declined, _) = run(&[("actor", 0, "no".into())], 0);
    assert!(matches!(declined.end, End::Declined { .. }));
}

#[test]
fn a_wrapped_reply_is_read_where_the_models_option_says_so_and_its_exchange_names_what_was_taken_off() {
    let mut models = models();
    models.values_mut().for_each(|model| model.here.unwrap = true);
    let fenced = format!("```json\n{}\n```", patch_reply(false));
    let review = review_reply("isolation_critic", "approve");
    let answers = [("actor", 0, fenced.clone()), ("isolation_critic", 0, format!("<think>Fine.</think>{review}"))];
    let (proposed, asked) = run_of(models, &answers, 0, &|_| passed());
    assert!(matches!(proposed.end, End::Patch(_)), "{:?}", proposed.end);
    let taken = |k: usize| proposed.proposal.exchanges[k].unwrapped.join(", ");
    assert_eq!((taken(0).as_str(), taken(1).as_str(), taken(4).as_str()), ("code fence", "", "think block"));
    let response = proposed.proposal.exchanges[0].response;
    assert_eq!(response, crate::kernel::Digest::of_bytes(fenced.as_bytes()), "the bytes stay as they came");
    // The same question without the option: the key is the same, the reply is refused.
    let (declined, plain) = run(&answers, 0);
    assert_eq!(asked[0].key().unwrap(), plain[0].key().unwrap());
    assert!(matches!(declined.end, End::Declined { .. }));
    assert!(declined.proposal.exchanges[0].unwrapped.is_empty());
    assert!(!serde_json::to_string(&declined.proposal.exchanges[0]).unwrap().contains("unwrapped"));
}

#[test]
fn of_several_models_the_one_that_was_drawn_is_asked_and_named() {
    let mut models = models();
    let of = ["a", "b"].map(|name| (1.0, ModelSpec { name: name.into(), ..models[&Role::Actor].clone() })).to_vec();
    let drawn = Some(std::sync::Arc::new(crate::llm::Drawn { seed: 7, of }));
    models.get_mut(&Role::Actor).unwrap().here.drawn = drawn;
    let (proposed, asked) = run_of(models, &[], 0, &|_| passed());
    let name = &asked[0].model.name;
    assert!(["a", "b"].contains(&name.as_str()), "{name}");
    assert_eq!(proposed.proposal.exchanges[0].model, *name);
    assert_eq!(asked[1].model.name, "model of structural_critic");
}

#[test]
fn an_unreadable_critic_is_asked_again_with_its_answer_and_then_abstains_without_using_up_a_round() {
    let (proposed, asked) = run(&[("isolation_critic", 0, "fine with me".into())], 2);
    assert!(matches!(proposed.end, End::Patch(_)), "{:?}", proposed.end);
    let roles: Vec<&str> = asked.iter().map(|r| r.slot.role.as_str()).collect();
    assert_eq!(roles[4..], ["isolation_critic", "isolation_critic"], "no repair follows");
    assert!(asked[5].messages[3].text.contains("fine with me"), "it sees what it wrote");
    assert_ne!(asked[4].key().unwrap(), asked[5].key().unwrap(), "another question than the first");
    assert_eq!(proposed.proposal.rounds[0].reviews.len(), 3);
    assert_eq!(proposed.proposal.exchanges.iter().filter(|e| e.refusal.is_some()).count(), 2);
    let others = [
        ("isolation_critic", 0, "fine".into()),
        ("attack_critic", 0, review_reply("attack_critic", "reject").to_string()),
    ];
    assert!(matches!(run(&others, 2).0.end, End::Declined { .. }), "the others are heard");
}

#[test]
fn an_unreadable_critic_ends_the_proposal_where_it_blocks_and_is_not_asked_again() {
    let rules = Rules { unreadable_critic: UnreadableCritic::Blocks, ..Rules::default() };
    let answers = [("attack_critic", 0, "fine with me".to_string())];
    let (proposed, asked) = run_by(rules, models(), &answers, 2, &|_| passed());
    let End::Declined { reason } = &proposed.end else { panic!("{:?}", proposed.end) };
    assert!(reason.contains("no readable review by attack_critic"), "{reason}");
    assert_eq!((asked.len(), proposed.proposal.rounds[0].reviews.len()), (5, 3), "the others are heard");
}

#[test]
fn an_unreadable_patch_ends_the_proposal_where_the_rules_say_so_though_rounds_are_left() {
    let rules = Rules { unreadable_patch: UnreadablePatch::Ends, ..Rules::default() };
    let repair = ("attack_critic", 0, review_reply("attack_critic", "repair").to_string());
    for (answers, asks) in [(vec![("actor", 0, "no".to_string())], 1), (vec![repair, ("repair", 1, "no".into())], 6)] {
        let (proposed, asked) = run_by(rules, models(), &answers, 2, &|_| passed());
        let End::Declined { reason } = &proposed.end else { panic!("{:?}", proposed.end) };
        assert!(reason.contains("no readable patch"), "{reason}");
        assert_eq!(asked.len(), asks, "nothing is asked after it");
    }
}

#[test]
fn gates_that_are_asked_after_the_critics_neither_call_for_a_repair_nor_are_told() {
    let rules = Rules { gates: GatesAsked::AfterCritics, ..Rules::default() };
    let never = |_: &ProgramPatch| -> Findings { panic!("no gate is asked in the loop") };
    let (proposed, asked) = run_by(rules, models(), &[], 2, &never);
    assert!(matches!(proposed.end, End::Patch(_)), "{:?}", proposed.end);
    assert_eq!(asked.len(), 5, "whom all approve is final");
    let told = |text: &str| text.contains("asked once the critics approve") && !text.contains("probe_scenes\"");
    assert!(asked[1..].iter().all(|request| told(&request.messages.last().unwrap().text)));
}

#[test]
fn a_patch_that_a_gate_refuses_goes_to_the_repair_with_the_verdict_though_all_critics_approve() {
    let first_only = |patch: &ProgramPatch| match patch.repair_summary {
        None => refused(Gate::Effect, "nothing moves: 7f3a"),
        Some(_) => passed(),
    };
    let (proposed, asked) = run_with(&[], 2, &first_only);
    assert!(matches!(&proposed.end, End::Patch(patch) if patch.repair_summary.is_some()));
    assert_eq!(asked.len(), 10);
    assert!(asked[5].slot.role == "repair" && asked[5].messages[3].text.contains("nothing moves: 7f3a"));
    let never = |_: &ProgramPatch| refused(Gate::Compile, "does not compile");
    let (proposed, asked) = run_with(&[], 1, &never);
    assert!(matches!(proposed.end, End::Patch(_)), "in the last round it is the gate's exit");
    assert_eq!(asked.iter().filter(|r| r.slot.role == "repair").count(), 1);
}

#[test]
fn each_critic_is_told_what_the_gates_of_its_side_say() {
    let shown = |gate: Gate| {
        let (_, asked) = run_with(&[], 0, &|_| refused(gate, "a problem: 51c9"));
        let asked_with_it = asked.iter().filter(|r| r.messages[3].text.contains("a problem: 51c9"));
        asked_with_it.map(|r| r.slot.role.clone()).collect::<Vec<String>>()
    };
    assert_eq!(shown(Gate::Mechanism), ["structural_critic"]);
    assert_eq!(shown(Gate::Isolation), ["structural_critic", "isolation_critic"]);
    assert_eq!(shown(Gate::Effect), ["structural_critic", "attack_critic", "realism_critic"]);
    let (_, asked) = run_with(&[], 0, &|_| Findings { compared: 97, differing: 31, ..passed() });
    assert!(asked[1..].iter().all(|r| r.messages[3].text.contains("97") && r.messages[3].text.contains("31")));
}

#[test]
fn each_role_asks_its_own_model() {
    let (proposed, asked) = run(&[], 0);
    assert!(asked.iter().all(|r| r.model.name == format!("model of {}", r.slot.role)));
    assert_eq!(proposed.proposal.exchanges[2].model, "model of attack_critic");
}

#[test]
fn roles_and_slots_share_handbook_and_context_and_no_two_questions_share_a_key() {
    let (_, asked) = run(&[("attack_critic", 0, review_reply("attack_critic", "repair").to_string())], 1);
    assert!(asked.iter().all(|r| r.messages[..2] == asked[0].messages[..2]), "handbook and context are shared");
    assert_eq!(asked[1].messages[2], asked[6].messages[2], "a role's message is static");
    let keys: std::collections::BTreeSet<Digest> = asked.iter().map(|r| r.key().unwrap()).collect();
    assert_eq!(keys.len(), asked.len());
}

#[test]
fn the_context_shows_measured_numbers_to_four_decimals_and_the_identity_exactly() {
    let example = Example::toy();
    let text = example.briefing().text().to_string();
    assert!(text.contains("0.9312") && !text.contains("0.93123"), "realism of the parent");
    assert!(text.contains("| 6.51 |") && !text.contains("6.512"), "features of clusters");
    assert!(text.contains("20 scenes: attack +0.050 ± 0.041, realism -0.131 ± 0.020;"), "changes of past edits");
    assert!(text.contains(&example.parent_hash().to_hex()));
    assert!(text.contains("\"weakest_diagnostic\":\"jerk\""));
    assert!(!text.contains("ancestor_chain"));
}

#[test]
fn every_role_has_a_message_and_those_outside_the_loop_the_form_of_their_reply_in_it() {
    for role in [Role::Actor, Role::Repair, Role::WorldAgent].into_iter().chain(Role::CRITICS) {
        let text = prompt::instructions(role, crate::agents::Questions::Plain).unwrap().text.clone();
        let form = text.contains("{\"response_id\": \"<text>\"") || text.contains("\"response_id\": \"<text>\"}");
        // In the loop the form ends the task, with the values that a reply repeats.
        assert_eq!(form, role == Role::WorldAgent, "{role:?}");
        assert!(form || text.contains("The task ends with the form"), "{role:?}");
        assert!(!text.contains("{{"), "{role:?}");
        assert!(schema(role).is_object());
    }
}

/// Good and bad replies: what the schema accepts and what the parser accepts must be the same.
#[test]
fn schema_and_strict_parser_agree() {
    for role in [Role::Actor, Role::Repair] {
        let good = patch_reply(role == Role::Repair);
        agree(role, &good, true);
        for (path, value) in [
            ("/response_id", json!("")),
            ("/response_id", json!(7)),
            ("/program_patch", json!([])),
            ("/program_patch/operations", json!([])),
            ("/program_patch/operations/0", json!(["replace", "/parameters/temperature", 0.5])),
            ("/program_patch/operations/0", json!({"op": "add", "path": "/x"})),
            ("/program_patch/operations/0", json!({"op": "remove", "path": "/x", "value": 1})),
            ("/program_patch/operations/0", json!({"op": "replace", "path": "/x", "value": null})),
            ("/program_patch/operations/0", json!({"op": "move", "path": "/x"})),
            ("/program_patch/operations/0", json!({"op": "remove", "path": "/x", "from": "/y"})),
            ("/program_patch/operations/0", json!({"op": "remove", "path": ""})),
            ("/program_patch/hypothesis", json!("")),
            ("/program_patch/hypothesis", json!(null)),
            ("/program_patch/memory_refs_used", json!("card")),
            ("/program_patch/memory_refs_used", json!([1])),
            ("/program_patch/repair_summary", json!(null)),
            ("/program_patch/repair_summary", json!("")),
            ("/program_patch/source_baseline", json!("x".repeat(201))),
            ("/program_patch/extra", json!(1)),
            ("/extra", json!(1)),
        ] {
            agree(role, &with(&good, path, value), false);
        }
        for (path, value) in [
            ("/program_patch/operations/0", json!({"op": "remove", "path": "/x"})),
            ("/program_patch/operations/0", json!({"op": "add", "path": "/x", "value": {"a": [1]}})),
            ("/program_patch/memory_refs_used", json!(["card"])),
        ] {
            agree(role, &with(&good, path, value), true);
        }
        for field in ["hypothesis", "cluster_refs_used", "parent_program_hash", "operations"] {
            let mut bad = good.clone();
            bad["program_patch"].as_object_mut().unwrap().remove(field);
            agree(role, &bad, false);
        }
    }
    let good = json!({"response_id": "r", "attacker_choice": {"attackers": ["7", "a"], "reason": "near"}});
    agree(Role::AttackerAgent, &good, true);
    for (path, value) in [
        ("/response_id", json!("")),
        ("/attacker_choice", json!([["7"], "near"])),
        ("/attacker_choice/attackers", json!([])),
        ("/attacker_choice/attackers", json!("7")),
        ("/attacker_choice/attackers", json!([7])),
        ("/attacker_choice/attackers", json!([""])),
        ("/attacker_choice/attackers", json!(vec!["7"; 9])),
        ("/attacker_choice/reason", json!("")),
        ("/attacker_choice/reason", json!(null)),
        ("/attacker_choice/score", json!(1)),
        ("/extra", json!(1)),
    ] {
        agree(Role::AttackerAgent, &with(&good, path, value), false);
    }
    world_replies_agree();
    agree(Role::Actor, &patch_reply(true), false);
    agree(Role::Repair, &patch_reply(false), false);
    for role in Role::CRITICS {
        let good = review_reply(role.name(), "repair");
        agree(role, &good, true);
        for (path, value) in [
            ("/critic_review/role", json!("actor")),
            ("/critic_review/decision", json!("maybe")),
            ("/critic_review/scope", json!("post_simulation")),
            ("/critic_review/blockers", json!([""])),
            ("/critic_review/blockers", json!(null)),
            ("/critic_review/score", json!(1)),
            ("/critic_review", json!(["structural_critic"])),
        ] {
            agree(role, &with(&good, path, value), false);
        }
        let other = if role == Role::AttackCritic { "realism_critic" } else { "attack_critic" };
        agree(role, &with(&good, "/critic_review/role", json!(other)), false);
    }
}

fn world_replies_agree() {
    let good = json!({"response_id": "r", "world_candidate": {
        "evaluation_hypothesis": "h",
        "expected_judge_metric_improvement": "m",
        "proposed_evaluator_configuration": {"model": "ridge", "explore": 0, "excluded_columns": ["a", "b"]},
        "calibration_rationale": "c",
        "audit_routing_policy": "p",
        "risk_notes": [],
    }});
    agree(Role::WorldAgent, &good, true);
    let changes = "/world_candidate/proposed_evaluator_configuration";
    for (path, value) in [
        (changes, json!({})),
        (changes, json!([["explore", 0]])),
        (changes, json!({"explore": null})),
        (changes, json!({"explore": {"is": 0}})),
        (changes, json!({"model": ""})),
        (changes, json!({"excluded_columns": [3]})),
        (changes, json!({"excluded_columns": vec!["a"; 201]})),
        ("/world_candidate/risk_notes", json!("none")),
        ("/world_candidate/evaluation_hypothesis", json!("")),
        ("/world_candidate/labels", json!([1])),
        ("/response_id", json!("")),
    ] {
        agree(Role::WorldAgent, &with(&good, path, value), false);
    }
}

fn agree(role: Role, reply_value: &Value, good: bool) {
    let bytes = reply_value.to_string().into_bytes();
    let parsed = match role {
        Role::Actor | Role::Repair => reply::patch(&bytes, role).map(|_| ()),
        Role::AttackerAgent => reply::attackers(&bytes).map(|_| ()),
        Role::WorldAgent => reply::world(&bytes).map(|_| ()),
        _ => reply::review(&bytes, role).map(|_| ()),
    };
    assert_eq!(valid(&schema(role), reply_value), good, "schema of {role:?}: {reply_value}");
    assert_eq!(parsed.is_ok(), good, "parser of {role:?}: {parsed:?}: {reply_value}");
}

fn with(value: &Value, path: &str, new: Value) -> Value {
    let mut changed = value.clone();
    let (parent, key) = path.rsplit_once('/').unwrap();
    match changed.pointer_mut(parent).unwrap() {
        Value::Array(items) => items[key.parse::<usize>().unwrap()] = new,
        object => object[key] = new,
    }
    changed
}

/// The keywords of JSON Schema that the schema files use, and no others.
fn valid(schema: &Value, value: &Value) -> bool {
    schema.as_object().unwrap().iter().all(|(keyword, rule)| match keyword.as_str() {
        "type" => match rule {
            Value::Array(kinds) => kinds.iter().any(|k| is_type(k.as_str().unwrap(), value)),
            kind => is_type(kind.as_str().unwrap(), value),
        },
        "enum" => rule.as_array().unwrap().contains(value),
        "anyOf" => rule.as_array().unwrap().iter().any(|s| valid(s, value)),
        "required" => value
            .as_object()
            .is_none_or(|o| rule.as_array().unwrap().iter().all(|k| o.contains_key(k.as_str().unwrap()))),
        "properties" => {
            value.as_object().is_none_or(|o| o.iter().all(|(k, v)| rule.get(k).is_none_or(|s| valid(s, v))))
        }
        "additionalProperties" => value.as_object().is_none_or(|o| {
            let others = o.iter().filter(|(k, _)| schema["properties"].get(k).is_none());
            others.into_iter().all(|(_, v)| rule.is_object() && valid(rule, v))
        }),
        "minProperties" => value.as_object().is_none_or(|o| o.len() as u64 >= rule.as_u64().unwrap()),
        "maxProperties" => value.as_object().is_none_or(|o| o.len() as u64 <= rule.as_u64().unwrap()),
        "items" => value.as_array().is_none_or(|items| items.iter().all(|v| valid(rule, v))),
        "minItems" => value.as_array().is_none_or(|items| items.len() as u64 >= rule.as_u64().unwrap()),
        "maxItems" => value.as_array().is_none_or(|items| items.len() as u64 <= rule.as_u64().unwrap()),
        "minLength" => value.as_str().is_none_or(|s| s.chars().count() as u64 >= rule.as_u64().unwrap()),
        "maxLength" => value.as_str().is_none_or(|s| s.chars().count() as u64 <= rule.as_u64().unwrap()),
        "description" => rule.is_string(),
        other => panic!("keyword `{other}` is not checked"),
    })
}

fn is_type(kind: &str, value: &Value) -> bool {
    match kind {
        "object" => value.is_object(),
        "array" => value.is_array(),
        "string" => value.is_string(),
        "number" => value.is_number(),
        "boolean" => value.is_boolean(),
        other => panic!("type `{other}` is not checked"),
    }
}

#[test]
fn what_is_not_exactly_one_json_object_is_refused() {
    let good = patch_reply(false).to_string();
    for bad in [
        String::new(),
        "null".into(),
        "[]".into(),
        format!("```json\n{good}\n```"),
        format!("{good} Done."),
        format!("{good}{good}"),
        good[..good.len() - 2].to_string(),
        "[".repeat(100_000),
        good.replace("0.5", "1e999"),
    ] {
        assert!(reply::patch(bad.as_bytes(), Role::Actor).is_err(), "{}", &bad[..bad.len().min(80)]);
    }
    assert!(reply::patch(&[0xff, 0xfe], Role::Actor).is_err());
    assert!(reply::patch(format!(" {good}\n").as_bytes(), Role::Actor).is_ok());
}

#[test]
fn free_constants_are_read_where_a_search_sets_them_and_are_an_unknown_field_elsewhere() {
    let mut reply = patch_reply(false);
    let read = |reply: &Value| reply::patch_with_free(reply.to_string().as_bytes(), Role::Actor);
    assert_eq!(read(&reply), reply::patch(reply.to_string().as_bytes(), Role::Actor), "none is fine");
    // An empty list, too, is one.
    reply["program_patch"]["free"] = json!({});
    assert!(read(&reply).is_ok());
    let unknown = reply::patch(reply.to_string().as_bytes(), Role::Actor).unwrap_err().0;
    assert!(unknown.contains("unknown field `free`"), "{unknown}");
    reply["program_patch"]["free"] = json!({"a": {"start": 1.5, "high": 3}});
    let free = read(&reply).unwrap().free["a"];
    assert_eq!((free.start, free.low, free.high), (1.5, None, Some(3.0)));
    for bad in
        [json!([]), json!(null), json!({"a": 1}), json!({"a": {"low": 0}}), json!({"a": {"start": 1, "step": 1}})]
    {
        reply["program_patch"]["free"] = bad;
        assert!(read(&reply).is_err(), "{reply}");
    }
}

/// Every part of the context, changed alone, changes the context: nothing that is shown is a constant.
#[test]
fn the_context_shows_what_was_tried_what_came_of_it_and_what_happened_in_each_scene() {
    let shown = |edit: &dyn Fn(&mut Example)| {
        let mut example = Example::toy();
        edit(&mut example);
        example.briefing().text().to_string()
    };
    let before = shown(&|_| {});
    for word in [
        "Fast contacts are harder",
        "closest_speed_mps / 10",
        "-0.300",
        "crossing/7",
        "| anyway ego_strikes |",
        "ego_braked",
        "road_filter refused all",
        "bounded_jerk 0.62",
        "1.8",
        "clusters junction +0.100",
    ] {
        assert!(before.contains(word), "{word}:\n{before}");
    }
    let edits: [&dyn Fn(&mut Example); 12] = [
        &|e| e.history[0].operations.clear(),
        &|e| e.history[0].hypothesis = "Another.".into(),
        &|e| e.history[0].ended = "on the front".into(),
        &|e| e.history[0].problems = vec!["p".into()],
        &|e| e.history[0].change.as_mut().unwrap().attack.0 = 0.06,
        &|e| e.history[0].change.as_mut().unwrap().realism.1 = None,
        &|e| e.history[0].change.as_mut().unwrap().coverage = -0.1,
        &|e| e.history[0].change.as_mut().unwrap().lost = vec!["crossing/9".into()],
        &|e| e.window[0].actors = vec!["truck".into()],
        &|e| e.window[1].outcome = "unavoidable",
        &|e| e.window[2].nearest_m = Some(7.7),
        &|e| e.window[2].diagnostics = BTreeMap::from([("bounded_jerk".into(), 0.1)]),
    ];
    for (n, edit) in edits.into_iter().enumerate() {
        assert_ne!(shown(edit), before, "edit {n}");
    }
}

#[test]
fn the_handbook_states_the_objectives_with_the_numbers_of_the_run() {
    let of = |change: &dyn Fn(&mut Measures)| {
        let (toy, mut measures) = (Example::toy(), super::example::measures(false));
        change(&mut measures);
        let example = Example::with(toy.contract.clone(), toy.parent.clone(), vec!["swarm_budget".into()], &measures);
        example.context().handbook.text().to_string()
    };
    let whole = of(&|_| {});
    for word in [
        "`bounded_jerk` 0.6",
        "(8, 4)",
        "Always count: ego_strikes.",
        "cut_in, crossing",
        "swarm_budget",
        "ego simulator",
    ] {
        assert!(whole.contains(word), "{word}:\n{whole}");
    }
    let changes: [&dyn Fn(&mut Measures); 8] = [
        &|m| m.acceptance.r0 = 0.77,
        &|m| m.acceptance.a0 = 0.77,
        &|m| m.acceptance.epsilon_r = 0.77,
        &|m| m.acceptance.epsilon_a = 0.77,
        &|m| m.acceptance.level = 0.77,
        &|m| m.acceptance.coverage_floor = 0.77,
        &|m| m.acceptance.realism_min = 0.77,
        &|m| m.protocol = Protocol::Safebench { limits: vec![("jerk".into(), 1.0, 0.77)] },
    ];
    for change in changes {
        assert!(of(change).contains("0.77"));
    }
}

#[test]
fn a_card_of_an_attempt_whose_edit_is_shown_does_not_repeat_it() {
    let mut example = Example::toy();
    let text = example.memory[0].text.clone();
    assert_eq!(example.memory[0].attempt.as_ref(), Some(&example.history[0].attempt));
    assert!(!example.briefing().text().contains(&text));
    example.history.clear();
    assert!(example.briefing().text().contains(&text));
}
