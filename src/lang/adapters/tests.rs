//! Programs that break one rule each, and the contract's findings on them.

use super::{
    toy::{contract, module, program, registry},
    *,
};
use crate::objects::{MechanismRef, ParameterRef, ParameterValue, Program, Setting, Slot, ValueType, expr::Expr};

/// All findings as text after a change of the toy program.
fn findings(change: impl FnOnce(&mut Program)) -> Vec<String> {
    let mut changed = program();
    change(&mut changed);
    contract().check_program(&changed).iter().map(Problem::to_string).collect()
}

/// The only finding.
fn finding(change: impl FnOnce(&mut Program)) -> String {
    let mut problems = findings(change);
    assert_eq!(problems.len(), 1, "{problems:#?}");
    problems.remove(0)
}

fn set(name: &str, value: f64) -> impl FnOnce(&mut Program) {
    move |program| {
        program.parameters.insert(name.into(), ParameterValue::Number(value));
    }
}

fn setting(node: &str, name: &str, value: Setting) -> impl FnOnce(&mut Program) {
    move |program| {
        program.operator_graph.get_mut(node).unwrap().settings.insert(name.into(), value);
    }
}

#[test]
fn the_toy_program_is_admissible() {
    assert_eq!(findings(|_| {}), Vec::<String>::new());
}

#[test]
fn parameters_lie_in_their_domains() {
    assert_eq!(
        finding(set("gap_limit_m", 7.5)),
        "at /parameters/gap_limit_m: found 7.5, expected a number in [0, 5] m"
    );
    assert!(finding(set("gap_limit_m", f64::NAN)).contains("found NaN"));
    assert!(finding(set("style", 1.0)).ends_with("expected one of calm, rough"));
    let missing = finding(|p| drop(p.parameters.remove("gap_limit_m")));
    assert_eq!(missing, "at /parameters/gap_limit_m: found no value, expected a number in [0, 5] m");
    assert!(finding(set("gap_limit", 1.0)).contains("did you mean `gap_limit_m`?"));
}

#[test]
fn a_whole_number_has_no_fraction_wherever_it_is_used() {
    let problems = findings(set("push_count", 2.5));
    assert_eq!(problems.len(), 2, "{problems:#?}");
    assert_eq!(problems[0], "at /parameters/push_count: found 2.5, expected a whole number in [2, 8]");
    assert!(problems[1].starts_with("at /operator_graph/motion/settings/count: found parameter `push_count`"));
}

#[test]
fn a_reference_is_checked_with_every_value_that_rules_may_give() {
    // 9 s is legal for the parameter but not for the setting that follows it.
    let problems = finding(|p| {
        let rule = &mut p.scenario_conditioned_policy[0];
        rule.parameters.insert("duration_s".into(), ParameterValue::Number(9.0));
    });
    assert!(
        problems.starts_with(
            "at /operator_graph/timing/settings/duration_s: found parameter `duration_s` with the value 9"
        )
    );
}

#[test]
fn settings_are_known_required_and_of_their_domain() {
    assert!(
        finding(|p| drop(p.operator_graph.get_mut("search").unwrap().settings.remove("combine"))).contains("no value")
    );
    assert!(
        finding(setting("search", "combine", Setting::Choice("mix".into()))).contains("expected one of add, replace")
    );
    assert!(finding(setting("search", "combin", Setting::Number(1.0))).contains("did you mean `combine`?"));
    let reference = |name: &str| Setting::Parameter(ParameterRef { parameter: name.into() });
    assert!(finding(setting("filter", "gap_m_min", reference("gap_limt_m"))).contains("did you mean `gap_limit_m`?"));
    assert!(finding(setting("filter", "gap_m_min", reference("style"))).contains("with the value `calm`"));
    let mechanism = |name: &str| Setting::Mechanism(MechanismRef { mechanism: name.into() });
    assert!(finding(setting("actor", "score", mechanism("presure"))).contains("did you mean `pressure`?"));
    assert!(finding(setting("filter", "gap_m_min", mechanism("pressure"))).contains("found mechanism `pressure`"));
    assert!(finding(setting("actor", "score", Setting::Number(1.0))).contains("{\"mechanism\": name}"));
}

#[test]
fn a_reference_to_a_module_of_another_slot_is_refused() {
    let problems = finding(|p| {
        let mut guard = module("gap_m < 5", &["gap_m"]);
        (guard.slot, guard.output) = ("actor_guard".into(), ValueType::Boolean);
        p.mechanism_modules.insert("near".into(), guard);
        setting("actor", "score", Setting::Mechanism(MechanismRef { mechanism: "near".into() }))(p);
    });
    assert!(problems.contains("found module `near` of slot `actor_guard`"), "{problems}");
}

#[test]
fn nodes_have_a_kind_of_their_slot_and_inputs_of_the_right_type() {
    let problems = findings(|p| p.operator_graph.get_mut("search").unwrap().kind = "pik".into());
    assert!(
        problems[0].contains("unknown kind of slot `search` `pik`") && problems[0].contains("`pick`"),
        "{problems:#?}"
    );
    let problems = findings(|p| p.operator_graph.get_mut("search").unwrap().inputs = vec!["actor".into()]);
    assert!(
        problems[0].contains("found `actor`, which gives actors, expected a node that gives candidates"),
        "{problems:#?}"
    );
    let problems = findings(|p| p.operator_graph.get_mut("search").unwrap().inputs = vec!["motio".into()]);
    assert!(problems[0].contains("did you mean `motion`?"), "{problems:#?}");
    let problems = findings(|p| p.operator_graph.get_mut("search").unwrap().inputs.clear());
    assert!(problems[0].contains("found 0 inputs, expected 1 (candidates)"), "{problems:#?}");
}

#[test]
fn the_graph_has_no_circle_one_end_and_no_idle_node() {
    let circle = findings(|p| {
        p.operator_graph.get_mut("search").unwrap().inputs = vec!["filter".into()];
    });
    assert!(circle.iter().any(|f| f.contains("a circle through choice, filter, search")), "{circle:#?}");
    let idle = finding(|p| p.operator_graph.get_mut("choice").unwrap().inputs = vec!["search".into()]);
    assert!(idle.starts_with("at /operator_graph/filter: found a node that leads nowhere"), "{idle}");
    let endless = findings(|p| drop(p.operator_graph.remove("choice")));
    assert!(endless.iter().any(|f| f.contains("found 0 nodes that make the choice")), "{endless:#?}");
    assert!(endless.iter().any(|f| f.contains("found 0 nodes of slot `diversity`, expected 1")), "{endless:#?}");
}

#[test]
fn there_is_one_selection_and_filters_may_be_stacked_or_left_out() {
    let stacked = findings(|p| {
        let mut second = p.operator_graph["filter"].clone();
        second.inputs = vec!["filter".into()];
        p.operator_graph.insert("filter_2".into(), second);
        p.operator_graph.get_mut("choice").unwrap().inputs = vec!["filter_2".into()];
    });
    assert_eq!(stacked, Vec::<String>::new());
    let twice = findings(|p| {
        let select = p.operator_graph.values().find(|node| node.slot == Slot::Select).unwrap().clone();
        p.operator_graph.insert("select_2".into(), select);
    });
    assert!(twice.iter().any(|f| f.contains("found 2 nodes of slot `select`, expected 1")), "{twice:#?}");
}

#[test]
fn conditions_read_scene_features_and_numeric_parameters_only() {
    let when = |text: &str| {
        let text = text.to_string();
        finding(move |p| p.scenario_conditioned_policy[0].when = text)
    };
    assert!(
        when("gap_m < 5").starts_with("at /scenario_conditioned_policy/0/when: found unknown name `gap_m` in column 1")
    );
    assert!(when("style == 1").contains("unknown name `style`"));
    assert!(when("vehicle_count").contains("an expression of type Number, expected Boolean"));
    assert!(when("vehicle_count >").contains("found the end in column 16"));
    assert_eq!(
        findings(|p| p.scenario_conditioned_policy[0].when = "ego_speed_mps > duration_s".into()),
        Vec::<String>::new()
    );
}

#[test]
fn rules_have_names_of_their_own_and_override_something_legal() {
    let first =
        |change: fn(&mut crate::objects::PolicyRule)| finding(|p| change(&mut p.scenario_conditioned_policy[0]));
    let idle = first(|rule| {
        rule.operators.clear();
        rule.parameters.clear();
    });
    assert!(idle.starts_with("at /scenario_conditioned_policy/0: found a rule that overrides nothing"), "{idle}");
    assert!(first(|rule| rule.name = "Dense scenes".into()).contains("found the name \"Dense scenes\""));
    assert!(
        first(|rule| drop(rule.parameters.insert("x".into(), ParameterValue::Number(1.0))))
            .contains("unknown parameter `x`")
    );
    assert!(first(|rule| drop(rule.operators.insert("x".into(), Default::default()))).contains("unknown node `x`"));
    let outside = first(|rule| {
        rule.operators.get_mut("filter").unwrap().insert("gap_m_min".into(), Setting::Number(6.0));
    });
    assert!(outside.starts_with("at /scenario_conditioned_policy/0/operators/filter/gap_m_min: found 6"), "{outside}");
    let twice = finding(|p| p.scenario_conditioned_policy.push(p.scenario_conditioned_policy[0].clone()));
    assert!(twice.contains("found the name `dense` a second time"), "{twice}");
}

#[test]
fn mechanisms_declare_exactly_what_they_read() {
    let with = |expression: &'static str, inputs: &'static [&'static str]| {
        move |p: &mut Program| drop(p.mechanism_modules.insert("pressure".into(), module(expression, inputs)))
    };
    assert!(finding(with("1 / gap_m", &[])).contains("no `gap_m`, which the expression reads"));
    assert!(finding(with("1", &["gap_m"])).contains("`gap_m`, which the expression does not read"));
    assert!(finding(with("gap_m", &["gap_m", "gap_m"])).contains("a name listed twice"));
    assert!(
        finding(with("collision_likelihood", &["collision_likelihood"]))
            .contains("unknown name `collision_likelihood`")
    );
    assert!(finding(with("gap_m < 1", &["gap_m"])).contains("of type Boolean, expected Number"));
    assert!(finding(with("open(gap_m)", &["gap_m"])).contains("unknown function `open`"));
}

#[test]
fn mechanisms_are_bounded_in_size_and_have_a_slot_type_and_plain_names() {
    let long = vec!["gap_m"; 13].join(" + ");
    assert!(
        finding(|p| p.mechanism_modules.get_mut("pressure").unwrap().expression = long)
            .contains("at most 96 nodes and depth 12")
    );
    let problems = findings(|p| p.mechanism_modules.get_mut("pressure").unwrap().slot = "actor_scor".into());
    assert!(problems.iter().any(|f| f.contains("did you mean `actor_score`?")), "{problems:#?}");
    assert!(
        finding(|p| p.mechanism_modules.get_mut("pressure").unwrap().output = ValueType::Boolean).contains("/output")
    );
    assert!(finding(|p| p.mechanism_modules.get_mut("pressure").unwrap().tags = vec!["a b".into()]).contains("/tags"));
    let strange = finding(|p| drop(p.mechanism_modules.insert("a/b".into(), module("1", &[]))));
    assert!(strange.starts_with("at /mechanism_modules/a~1b: found the name \"a/b\""), "{strange}");
}

#[test]
fn what_is_inherited_cannot_differ() {
    assert!(finding(|p| p.compile_contract.constraints.clear()).starts_with("at /compile_contract/constraints"));
    assert!(finding(|p| p.compile_contract.backend = "other".into()).starts_with("at /compile_contract/backend"));
    assert!(finding(|p| p.source_family = crate::objects::FamilyName::new("x")).starts_with("at /source_family"));
}

#[test]
fn a_program_beyond_the_limits_is_not_looked_at_further() {
    let problems = finding(|p| {
        for index in 0..1000 {
            p.mechanism_modules.insert(format!("m{index}"), module("(", &[]));
        }
    });
    assert_eq!(problems, "at /mechanism_modules: found 1001 modules, expected at most 12");
}

#[test]
fn scopes_list_slot_features_then_scene_features_then_numeric_parameters() {
    let scope = contract().mechanism_scope("actor_score").unwrap();
    assert_eq!(scope.get("gap_m"), Some((ValueType::Number, 0)));
    assert_eq!(scope.get("vehicle_count"), Some((ValueType::Number, vocabulary::ACTOR.len())));
    let parameters = vocabulary::ACTOR.len() + vocabulary::SCENE.len();
    assert_eq!(scope.get("duration_s"), Some((ValueType::Number, parameters)));
    assert_eq!((scope.get("style"), scope.len()), (None, parameters + 3));
    assert!(Expr::parse("gap_m + vehicle_count").unwrap().compile(&contract().condition_scope()).is_err());
}

#[test]
fn prompts_show_range_unit_and_meaning_and_are_stable() {
    let shown = contract().to_prompt_json();
    assert_eq!(shown["parameters"]["gap_limit_m"]["range"], serde_json::json!([0.0, 5.0]));
    assert_eq!(shown["parameters"]["gap_limit_m"]["unit"], "m");
    assert_eq!(shown["operators"]["filter"]["nodes"], serde_json::json!([0, 8]));
    assert_eq!(shown["operators"]["actor"]["kinds"]["ranked_actors"]["settings"]["score"]["slot"], "actor_score");
    assert_eq!(shown["features"]["closing_speed_mps"]["unit"], "m/s");
    assert_eq!(shown.to_string(), contract().to_prompt_json().to_string());
}

#[test]
fn words_private_to_another_family_are_found_inside_expressions_and_paths() {
    let (registry, contract) = (registry(), contract());
    let foreign = contract.foreign_vocabulary(registry.iter());
    let problems = foreign.words_in(["/parameters/swarm_size", "1+swarm_size*2", "particle_swarms", "push"]);
    let words: Vec<(&str, &str)> = problems.iter().map(|f| (f.word.as_str(), f.family.as_str())).collect();
    assert_eq!(words, [("swarm_size", "swarm")]);
}

#[test]
fn the_hash_of_the_toy_program_is_pinned() {
    // A change of canonical bytes, of canonical expression text or of the program's fields moves every hash.
    assert_eq!(program().hash().unwrap().to_hex(), "9e72a86fab87c22e4edc82c21e9ee8e7039389bc684d0f8dc7b71cb8ce888d4a");
}
