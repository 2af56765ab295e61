//! Patches that pass, patches that fail at exactly the gates named, and hostile ones.

use proptest::prelude::*;
use serde_json::{Value, json};

use super::*;
use crate::{
    adapters::toy::{contract, program, registry},
    kernel::Digest,
    objects::{FamilyName, Gate, Operation, OperationKind, Program, ProgramPatch, SolutionId},
};

fn operation(op: OperationKind, path: &str, value: Option<Value>) -> Operation {
    Operation { op, path: path.into(), value }
}

pub(super) fn add(path: &str, value: Value) -> Operation {
    operation(OperationKind::Add, path, Some(value))
}

fn replace(path: &str, value: Value) -> Operation {
    operation(OperationKind::Replace, path, Some(value))
}

fn remove(path: &str) -> Operation {
    operation(OperationKind::Remove, path, None)
}

pub(super) fn patch(operations: Vec<Operation>) -> ProgramPatch {
    ProgramPatch {
        source_baseline: FamilyName::new("toy"),
        parent_solution_id: SolutionId::new("toy-idm/parent"),
        parent_program_hash: program().hash().unwrap().to_hex(),
        operations,
        hypothesis: "nearer actors meet the ego sooner".into(),
        memory_refs_used: vec![],
        cluster_refs_used: vec![],
        repair_summary: None,
        free: Default::default(),
    }
}

fn child_id() -> SolutionId {
    SolutionId::new("toy-idm/e1s0")
}

fn judge(patch: &ProgramPatch) -> Admission {
    admit(&program(), patch, child_id(), &Judging::whole(&contract(), &registry()), &|_, _| Trials::default())
}

/// Which gates fail.
fn failing(patch: &ProgramPatch) -> Vec<Gate> {
    let admission = judge(patch);
    assert_eq!(admission.gates.verdicts.len(), Gate::COUNT);
    assert_eq!(admission.candidate.is_some(), admission.gates.passed());
    admission.gates.failed().map(|verdict| verdict.gate).collect()
}

fn failing_with(operations: Vec<Operation>) -> Vec<Gate> {
    failing(&patch(operations))
}

fn longer() -> Operation {
    replace("/parameters/duration_s", json!(6.0))
}

/// Gates that fail when there is no child and nothing else is wrong.
const NO_CHILD: [Gate; 3] = [Gate::Schema, Gate::Mechanism, Gate::Compile];

/// A new score expression, a filter bound that a new rule tightens, and a parameter.
fn structural() -> ProgramPatch {
    let module = json!({
        "slot": "actor_score",
        "inputs": ["gap_m", "time_to_conflict_s"],
        "output": "number",
        "expression": "exp(-time_to_conflict_s / 3) / max(gap_m, 1)",
        "tags": ["time_to_conflict"],
    });
    let rule = json!({
        "name": "junctions",
        "when": "is_junction and ego_speed_mps > 5",
        "parameters": { "gap_limit_m": 1.5 },
        "operators": { "filter": { "gap_m_min": { "parameter": "gap_limit_m" } } },
    });
    patch(vec![
        add("/mechanism_modules/conflict", module),
        replace("/operator_graph/actor/settings/score", json!({ "mechanism": "conflict" })),
        add("/scenario_conditioned_policy/-", rule),
        longer(),
    ])
}

mod application {
    use super::*;

    fn refusal(operations: Vec<Operation>) -> String {
        apply(&program(), program().hash().unwrap(), &patch(operations), child_id()).unwrap_err().to_string()
    }

    #[test]
    fn a_child_differs_from_its_parent_by_the_edits_and_its_place_in_the_lineage() {
        let (parent, patch) = (program(), structural());
        let child = apply(&parent, parent.hash().unwrap(), &patch, child_id()).unwrap();
        assert_eq!((child.solution_id.as_str(), child.generation), ("toy-idm/e1s0", 1));
        assert_eq!(child.ancestor_chain.len(), 1);
        assert_eq!(child.ancestor_chain[0].program_hash, parent.hash().unwrap());
        assert_eq!(child.ancestor_chain[0].patch_hash, patch.hash().unwrap());
        assert_eq!(child.scenario_conditioned_policy.len(), 2);
        assert_eq!(child.compile_contract, parent.compile_contract);
        assert_ne!(child.hash(), parent.hash());
        assert_eq!(parent, program());
    }

    #[test]
    fn a_list_takes_insertions_appends_and_removals_at_existing_places() {
        let rule = |name: &str| json!({ "name": name, "when": "true" });
        let edits = vec![
            add("/scenario_conditioned_policy/0", rule("first")),
            add("/scenario_conditioned_policy/-", rule("last")),
            remove("/scenario_conditioned_policy/1"),
        ];
        let child = apply(&program(), program().hash().unwrap(), &patch(edits), child_id()).unwrap();
        let names: Vec<&str> = child.scenario_conditioned_policy.iter().map(|rule| rule.name.as_str()).collect();
        assert_eq!(names, ["first", "last"]);
    }

    #[test]
    fn places_that_do_not_exist_are_named() {
        assert!(refusal(vec![replace("/parameters/speed", json!(1))]).contains("found nothing at `speed`"));
        assert!(refusal(vec![remove("/mechanism_modules/x")]).contains("operation 0 at /mechanism_modules/x"));
        assert!(refusal(vec![add("/operator_graph/x/kind", json!("k"))]).contains("found nothing at `x`"));
        assert!(refusal(vec![remove("/scenario_conditioned_policy/1")]).contains("expected a whole number below 1"));
        assert!(refusal(vec![add("/scenario_conditioned_policy/2", json!({}))]).contains("below 2"));
        for index in ["-1", "00", "01", "+0", "1e0", "99999999999999999999999", "", "-"] {
            assert!(
                refusal(vec![remove(&format!("/scenario_conditioned_policy/{index}"))]).contains("found the index")
            );
        }
    }

    #[test]
    fn what_comes_out_is_typed_strictly() {
        let text = refusal(vec![replace("/parameters/duration_s", json!([1]))]);
        assert_eq!(text, "at /parameters/duration_s: expected a number or a word");
        let text = refusal(vec![add("/mechanism_modules/pressure/code", json!("x"))]);
        assert!(text.starts_with("at /mechanism_modules/pressure: unknown field `code`"), "{text}");
        let text = refusal(vec![replace("/operator_graph/actor/slot", json!("driver"))]);
        assert!(text.starts_with("at /operator_graph/actor: unknown variant `driver`"), "{text}");
        assert!(refusal(vec![add("/parameters/duration_s/x", json!(1))]).contains("object or a list"));
        let text = refusal(vec![replace("/operator_graph/filter/settings/gap_m_min", json!(null))]);
        assert!(text.contains("a number, a word, {\"parameter\": name}"), "{text}");
    }

    #[test]
    fn protected_parts_do_not_exist_for_a_patch() {
        for path in ["/compile_contract/backend", "/ancestor_chain/-", "/solution_id", "/", "", "parameters/x"] {
            assert!(
                apply(&program(), program().hash().unwrap(), &patch(vec![add(path, json!(1))]), child_id()).is_err(),
                "{path}"
            );
        }
    }
}

#[test]
fn a_structural_patch_passes_all_gates_and_becomes_a_candidate() {
    let admission = judge(&structural());
    assert!(admission.gates.passed(), "{:#?}", admission.gates);
    let candidate = admission.candidate.unwrap();
    assert_eq!(candidate.mechanism_tags, ["pressure", "time_to_conflict"]);
    assert_eq!(candidate.program_hash, candidate.program.hash().unwrap());
}

#[test]
fn a_child_can_be_a_parent() {
    let parent = judge(&structural()).candidate.unwrap().program;
    let mut next = patch(vec![replace("/parameters/duration_s", json!(2))]);
    next.parent_solution_id = parent.solution_id.clone();
    next.parent_program_hash = parent.hash().unwrap().to_hex();
    let id = SolutionId::new("toy-idm/e2s0");
    let admission = admit(&parent, &next, id, &Judging::whole(&contract(), &registry()), &|_, _| Trials::default());
    assert_eq!(admission.candidate.map(|candidate| candidate.program.generation), Some(2));
}

#[test]
fn the_schema_gate_refuses_missing_values_wrong_types_and_unreasonable_sizes() {
    let cases = [
        vec![operation(OperationKind::Replace, "/parameters/duration_s", None)],
        vec![operation(OperationKind::Remove, "/mechanism_modules/pressure", Some(json!(1)))],
        vec![replace("/parameters/duration_s", json!({ "number": 3 }))],
        vec![longer(), longer()],
        vec![remove("/mechanism_modules/unknown")],
    ];
    for case in cases {
        assert_eq!(failing_with(case.clone()), NO_CHILD, "{case:?}");
    }
    let mut silent = patch(vec![longer()]);
    silent.hypothesis = " ".into();
    assert_eq!(failing(&silent), NO_CHILD);
    silent.hypothesis = "x".repeat(5_000);
    assert_eq!(failing(&silent), NO_CHILD);
}

#[test]
fn the_parent_gate_refuses_stale_foreign_and_misplaced_patches() {
    let mut stale = patch(vec![longer()]);
    stale.parent_program_hash = "0".repeat(64);
    assert_eq!(failing(&stale), [Gate::Parent]);
    let mut upper = patch(vec![longer()]);
    upper.parent_program_hash = upper.parent_program_hash.to_uppercase();
    assert_eq!(failing(&upper), [Gate::Parent]);
    let mut other = patch(vec![longer()]);
    other.parent_solution_id = SolutionId::new("toy-idm/e0s1");
    assert_eq!(failing(&other), [Gate::Parent]);
    let mut family = patch(vec![longer()]);
    family.source_baseline = FamilyName::new("swarm");
    assert_eq!(failing(&family), [Gate::Parent]);
    for id in ["swarm-idm/e1s0", "toy-idm", "toy-idm/parent"] {
        let id = SolutionId::new(id);
        let gates =
            admit(&program(), &patch(vec![longer()]), id, &Judging::whole(&contract(), &registry()), &|_, _| {
                Trials::default()
            })
            .gates;
        assert_eq!(gates.failed().map(|verdict| verdict.gate).collect::<Vec<_>>(), [Gate::Parent]);
    }
}

#[test]
fn the_parent_gate_counts_the_ancestors() {
    let mut orphan = program();
    orphan.generation = 3;
    let gates =
        admit(&orphan, &patch(vec![longer()]), child_id(), &Judging::whole(&contract(), &registry()), &|_, _| {
            Trials::default()
        })
        .gates;
    assert_eq!(gates.failed().map(|verdict| verdict.gate).collect::<Vec<_>>(), [Gate::Parent]);
}

#[test]
fn the_interface_gate_refuses_unknown_places_idle_edits_and_too_many() {
    assert_eq!(failing_with(vec![replace("/parameters/duration_s", json!(5))]), [Gate::Interface]);
    let spaced = json!("closing_speed_mps/(max(gap_m,gap_limit_m))");
    assert_eq!(failing_with(vec![replace("/mechanism_modules/pressure/expression", spaced)]), [Gate::Interface]);
    assert_eq!(failing_with(vec![add("/parameters/duration", json!(3))]), [Gate::Interface, Gate::Compile]);
    assert_eq!(
        failing_with(vec![replace("/parameters", json!({}))]),
        [Gate::Schema, Gate::Interface, Gate::Mechanism, Gate::Compile]
    );
    let setting = |index: usize| {
        add(
            &format!("/mechanism_modules/m{index}"),
            json!({
                "slot": "actor_score", "inputs": [], "output": "number", "expression": "1",
            }),
        )
    };
    assert_eq!(failing_with((0..8).map(setting).collect()), []);
    assert_eq!(failing_with((0..9).map(setting).collect()), [Gate::Interface]);
    let away = failing_with(vec![add("/weather/rain", json!(1))]);
    assert_eq!(away, [Gate::Schema, Gate::Interface, Gate::Mechanism, Gate::Compile]);
}

#[test]
fn a_closed_part_and_what_lies_in_it_take_no_edit() {
    let (contract, registry) = (contract(), registry());
    let closed =
        Judging { closed: vec!["/mechanism_modules", "/parameters/style"], ..Judging::whole(&contract, &registry) };
    let refused = |operations: Vec<Operation>| -> Vec<String> {
        let admission = admit(&program(), &patch(operations), child_id(), &closed, &|_, _| Trials::default());
        let gates = admission.gates.failed().flat_map(|verdict| verdict.problems.clone());
        gates.filter(|problem| problem.contains("is closed in this run")).collect()
    };
    assert!(refused(vec![longer()]).is_empty());
    assert_eq!(refused(vec![replace("/mechanism_modules/pressure/expression", json!("1"))]).len(), 1);
    assert_eq!(refused(vec![longer(), replace("/parameters/style", json!("rough"))]).len(), 1);
    assert!(refused(vec![add("/parameters/style_two", json!(1))]).is_empty(), "only what lies in it");
}

#[test]
fn a_report_names_twelve_problems_and_how_many_more_there_are() {
    let unknown = |count: usize| patch((0..count).map(|k| add(&format!("/parameters/p{k}"), json!(1))).collect());
    let of_interface = |count: usize| {
        let admission = judge(&unknown(count));
        admission.gates.verdicts.into_iter().find(|verdict| verdict.gate == Gate::Interface).unwrap().problems
    };
    // The contract takes eight edits: their number is a problem of its own, and the paths of up to twice as many are checked.
    assert_eq!(of_interface(11).len(), 12);
    let more = |count: usize| of_interface(count).get(12).cloned();
    assert_eq!(
        (more(12), more(16), more(20)),
        (Some("and 1 more".into()), Some("and 5 more".into()), Some("and 5 more".into()))
    );
}

#[test]
fn of_a_patch_that_cannot_be_applied_every_gate_says_why_it_saw_nothing() {
    let admission = judge(&patch(vec![remove("/mechanism_modules/unknown")]));
    let blind: Vec<&str> = admission.gates.verdicts.iter().flat_map(|v| &v.problems).map(String::as_str).collect();
    assert!(blind.iter().all(|problem| problem.len() > 10), "{blind:?}");
    assert!(blind.contains(&"nothing to look at: the patch could not be applied"), "{blind:?}");
}

#[test]
fn paths_into_lists_end_in_an_index_or_append() {
    let refusal = |path: &str| {
        let gates = judge(&patch(vec![add(path, json!("select"))])).gates;
        gates.failed().flat_map(|verdict| verdict.problems.clone()).any(|p| p.contains("an index, or `-` to append"))
    };
    for list in
        ["/operator_graph/timing/inputs", "/mechanism_modules/pressure/inputs", "/mechanism_modules/pressure/tags"]
    {
        let odd: Vec<String> = ["one", "1a", "", "-1"].map(|end| format!("{list}/{end}")).to_vec();
        assert!(odd.iter().all(|path| refusal(path)), "{odd:?}");
        assert!(
            !refusal(&format!("{list}/0")) && !refusal(&format!("{list}/-")) && !refusal(&format!("{list}/12")),
            "{list}"
        );
    }
    assert!(refusal("/scenario_conditioned_policy/first/when") && !refusal("/scenario_conditioned_policy/0/when"));
    // A node may be replaced whole, and has no fields other than its own.
    let fields = |path: &str| {
        let gates = judge(&patch(vec![add(path, json!("x"))])).gates;
        gates
            .failed()
            .flat_map(|verdict| verdict.problems.clone())
            .any(|p| p.contains("/operator_graph/<node>/ and one of"))
    };
    assert!(fields("/operator_graph/timing/colour") && fields("/operator_graph/timing/settings/a/b"));
    assert!(!fields("/operator_graph/timing/kind") && !fields("/operator_graph/timing"));
}

#[test]
fn a_quoted_text_is_cut_where_it_is_too_long_and_shows_it() {
    use super::apply::shortened;
    let most = "x".repeat(160);
    assert_eq!(shortened(&most), most);
    assert_eq!(shortened(&format!("{most}y")), format!("{most}…"));
}

#[test]
fn the_interface_gate_refuses_fields_that_rules_and_modules_do_not_have() {
    for path in ["/scenario_conditioned_policy/0/colour", "/mechanism_modules/pressure/colour"] {
        let failed = failing_with(vec![add(path, json!("red"))]);
        assert!(failed.contains(&Gate::Interface), "{path}: {failed:?}");
    }
}

#[test]
fn the_isolation_gate_refuses_words_and_ids_of_others() {
    let kind = failing_with(vec![replace("/operator_graph/search/kind", json!("particle_swarm"))]);
    assert_eq!(kind, [Gate::Isolation, Gate::Compile]);
    let expression = failing_with(vec![
        replace("/mechanism_modules/pressure/expression", json!("1 + swarm_size")),
        replace("/mechanism_modules/pressure/inputs", json!(["swarm_size"])),
    ]);
    assert_eq!(expression, [Gate::Isolation, Gate::Mechanism, Gate::Compile]);
    assert_eq!(
        failing_with(vec![replace("/mechanism_modules/pressure/tags", json!(["particle_swarm"]))]),
        [Gate::Isolation]
    );
    let name = failing_with(vec![add("/parameters/swarm_size", json!(10))]);
    assert_eq!(name, [Gate::Interface, Gate::Isolation, Gate::Compile]);
    for id in ["swarm-idm", "swarm-idm/e3s1", "toy-other/parent"] {
        let tags = failing_with(vec![replace("/mechanism_modules/pressure/tags", json!([id]))]);
        assert_eq!(tags, [Gate::Isolation, Gate::Mechanism, Gate::Compile], "{id}");
    }
}

#[test]
fn only_what_has_the_form_of_an_id_is_an_id_of_another_lineage() {
    let refused = |word: &str| {
        let tag = add("/mechanism_modules/pressure/tags/-", json!(format!("as {word} has it")));
        failing_with(vec![longer(), tag]).contains(&Gate::Isolation)
    };
    for id in ["other-idm/e1s0", "other-idm/e12s345", "other-idm/parent", "/other-idm/e0s0"] {
        assert!(refused(id), "{id}");
    }
    for word in ["other-idm/e1sx", "other-idm/exs1", "other-idm/es1", "other-idm/e1s", "other-idm/x1s1", "toy-idm/e1s0"]
    {
        assert!(!refused(word), "{word}");
    }
}

#[test]
fn the_protected_gate_refuses_every_way_to_what_decides() {
    let outside = [Gate::Schema, Gate::Interface, Gate::Protected, Gate::Mechanism, Gate::Compile];
    let paths = [
        "/ego/policy",
        "/parameters/../ego",
        "/parameters/../../compile_contract/backend",
        "/parameters/%2e%2e/%65go/x",
        "/parameters/..%2Fego/x",
        "/parameters/..~1archive/x",
        "/compile_contract/constraints",
        "/Ancestor_Chain/0",
        "//archive/front",
        "/parameters/..\\simulator/x",
        "#/metrics/attack",
        "/source_family",
        "/scenes/splits/held_out",
    ];
    for path in paths {
        let failed = failing_with(vec![replace(path, json!(1))]);
        assert_eq!(failed, outside, "{path}");
    }
    let word = failing_with(vec![replace("/mechanism_modules/pressure/expression", json!("ego + metrics"))]);
    assert_eq!(word, [Gate::Protected, Gate::Mechanism, Gate::Compile]);
    let key = failing_with(vec![add("/mechanism_modules/x", json!({ "compile_contract": {} }))]);
    assert_eq!(key, [Gate::Schema, Gate::Protected, Gate::Mechanism, Gate::Compile]);
}

#[test]
fn the_mechanism_gate_refuses_unknown_functions_wrong_types_and_undeclared_inputs() {
    let both = [Gate::Mechanism, Gate::Compile];
    let expression = |text: &str| failing_with(vec![replace("/mechanism_modules/pressure/expression", json!(text))]);
    for text in ["print(gap_m)", "gap_m +", "gap_m", "paths_cross", "gap_m; closing_speed_mps", "NaN", "import os"] {
        assert_eq!(expression(text), both, "{text}");
    }
    let condition = vec![replace("/scenario_conditioned_policy/0/when", json!("gap_m < 3"))];
    assert_eq!(failing_with(condition), both);
    assert_eq!(expression(&"(".repeat(5000)), both);
}

#[test]
fn the_compile_gate_refuses_what_leaves_the_contract_and_what_the_compiler_cannot_lower() {
    assert_eq!(failing_with(vec![replace("/parameters/duration_s", json!(11))]), [Gate::Compile]);
    assert_eq!(failing_with(vec![replace("/parameters/duration_s", json!("NaN"))]), [Gate::Compile]);
    assert_eq!(failing_with(vec![remove("/operator_graph/choice")]), [Gate::Compile]);
    assert_eq!(failing_with(vec![replace("/operator_graph/search/inputs/0", json!("filter"))]), [Gate::Compile]);
    let refuses = |_: &Program, _| Trials { problems: vec!["scene 3: no lane".to_string()], ..Trials::default() };
    let admission = admit(&program(), &structural(), child_id(), &Judging::whole(&contract(), &registry()), &refuses);
    let failed: Vec<_> = admission.gates.failed().collect();
    assert_eq!((failed[0].gate, failed[0].problems.as_slice()), (Gate::Compile, &["scene 3: no lane".to_string()][..]));
    assert_eq!((failed.len(), admission.candidate), (1, None));
}

#[test]
fn the_effect_gate_refuses_a_child_that_does_what_its_parent_does_on_every_probe_scene() {
    let failed = |compared, differing| {
        let trials = move |_: &Program, _: Digest| Trials { compared, differing, ..Trials::default() };
        let admission =
            admit(&program(), &structural(), child_id(), &Judging::whole(&contract(), &registry()), &trials);
        assert_eq!(admission.candidate.is_some(), admission.gates.passed());
        admission.gates.failed().map(|verdict| (verdict.gate, verdict.problems[0].clone())).collect::<Vec<_>>()
    };
    let refused = failed(3, 0);
    assert!(refused.len() == 1 && refused[0].0 == Gate::Effect && refused[0].1.starts_with("no effect"), "{refused:?}");
    assert_eq!(failed(3, 1), []);
}

#[test]
fn the_compiler_never_sees_a_program_outside_the_contract() {
    let patch = patch(vec![replace("/parameters/duration_s", json!(11))]);
    let never = |_: &Program, _| -> Trials { panic!("called") };
    assert!(
        admit(&program(), &patch, child_id(), &Judging::whole(&contract(), &registry()), &never).candidate.is_none()
    );
}

#[test]
fn hostile_patches_are_refused_with_short_reports() {
    let mut deep = json!(1);
    for _ in 0..2000 {
        deep = json!([deep]);
    }
    let wide = json!(vec![0; 100_000]);
    let big = json!("x".repeat(10_000_000));
    let cases = [
        vec![add("/mechanism_modules/a", deep)],
        vec![add("/mechanism_modules/a", wide)],
        vec![add("/mechanism_modules/a", big.clone())],
        vec![add(&"/a".repeat(100_000), json!(1))],
        vec![add("/parameters/~", json!(1))],
        vec![add("/parameters/\u{0}\u{202e}", json!("\u{0}"))],
        (0..20_000).map(|i| add(&format!("/parameters/p{i}"), json!(i))).collect(),
        vec![],
    ];
    for case in cases {
        let admission = judge(&patch(case));
        assert!(admission.candidate.is_none());
        let reported: usize = admission.gates.verdicts.iter().flat_map(|v| &v.problems).map(String::len).sum();
        assert!(reported < 50_000, "{reported} bytes of problems");
    }
}

fn values() -> impl Strategy<Value = Value> {
    let leaf = prop_oneof![
        any::<f64>().prop_map(|x| json!(x)),
        (-3i64..12).prop_map(|x| json!(x)),
        Just(Value::Null),
        any::<bool>().prop_map(|x| json!(x)),
        "(add|replace|calm|gap_m|1 / gap_m|pressure|filter|search|number|[a-z~/ ]{0,8})".prop_map(Value::String),
        Just(json!({ "parameter": "gap_limit_m" })),
        Just(json!({ "mechanism": "pressure" })),
        Just(json!({ "slot": "actor_score", "inputs": [], "output": "number", "expression": "2" })),
        Just(json!({ "name": "r", "when": "has_light", "parameters": { "gap_limit_m": 1 } })),
    ];
    leaf.prop_recursive(2, 8, 3, |inner| {
        prop_oneof![
            prop::collection::vec(inner.clone(), 0..3).prop_map(Value::Array),
            prop::collection::btree_map("[a-z_]{0,8}", inner, 0..3)
                .prop_map(|m| Value::Object(m.into_iter().collect())),
        ]
    })
}

fn operations() -> impl Strategy<Value = Operation> {
    let kind = prop_oneof![Just(OperationKind::Add), Just(OperationKind::Replace), Just(OperationKind::Remove)];
    let path = prop_oneof![
        "/parameters/(duration_s|gap_limit_m|push_count|style|x)",
        "/operator_graph/(filter|actor|search|x)(/(kind|slot|inputs|inputs/0|settings|settings/gap_m_min|settings/score))?",
        "/scenario_conditioned_policy/(0|1|-)(/(when|name|parameters/gap_limit_m|operators/filter))?",
        "/mechanism_modules/(pressure|x)(/(expression|inputs|tags|output))?",
        "[/a-z~0-9.%#-]{0,20}",
    ];
    (kind, path, prop::option::weighted(0.8, values())).prop_map(|(op, path, value)| Operation { op, path, value })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]
    #[test]
    fn no_patch_panics_and_none_passes_out_of_contract(operations in prop::collection::vec(operations(), 0..4)) {
        let admission = judge(&patch(operations));
        prop_assert_eq!(admission.gates.verdicts.len(), Gate::COUNT);
        prop_assert_eq!(admission.candidate.is_some(), admission.gates.passed());
        if let Some(candidate) = admission.candidate {
            prop_assert_eq!(contract().check_program(&candidate.program), vec![]);
            prop_assert_ne!(Some(candidate.program_hash), program().hash().ok());
            prop_assert_eq!(candidate.program.compile_contract, program().compile_contract);
        }
    }

    #[test]
    fn a_legal_change_of_a_parameter_passes(duration_s in 1.0f64..8.0) {
        let passed = judge(&patch(vec![replace("/parameters/duration_s", json!(duration_s))])).gates.passed();
        prop_assert!(passed);
    }
}
