//! A small family for tests, and a second one with words of its own.

use std::collections::BTreeMap;

use super::{
    contract::{
        Contract, Domain, Family, Limits, MechanismSlotSpec, OperatorSpec, ParameterSpec, Port, Registry, SettingSpec,
    },
    vocabulary,
};
use crate::objects::{
    CompileContract, FamilyName, LineageId, MechanismModule, MechanismRef, OperatorNode, ParameterRef, ParameterValue,
    PolicyRule, Program, Setting, Slot, SolutionId, ValueType,
};

fn number(low: f64, high: f64, unit: &str) -> Domain {
    Domain::Number { low, high, unit: unit.into() }
}

fn setting(name: &str, domain: Domain, required: bool) -> (String, SettingSpec) {
    (name.into(), SettingSpec { domain, required, describes: format!("sets {name}") })
}

fn operator(kind: &str, inputs: &[Port], output: Port, settings: Vec<(String, SettingSpec)>) -> OperatorSpec {
    let settings = settings.into_iter().collect();
    OperatorSpec { kind: kind.into(), inputs: inputs.to_vec(), output, settings, describes: format!("does {kind}") }
}

fn operators() -> BTreeMap<Slot, Vec<OperatorSpec>> {
    let score = || Domain::Mechanism { slot: "actor_score".into() };
    let combine = Domain::Choice { options: vec!["add".into(), "replace".into()] };
    let count = Domain::Integer { low: 2, high: 8, unit: "1".into() };
    BTreeMap::from([
        (Slot::Select, vec![operator("every_scene", &[], Port::Scene, vec![])]),
        (
            Slot::Actor,
            vec![
                operator("marked_actor", &[Port::Scene], Port::Actors, vec![]),
                operator("ranked_actors", &[Port::Scene], Port::Actors, vec![setting("score", score(), true)]),
            ],
        ),
        (
            Slot::Timing,
            vec![operator(
                "window",
                &[Port::Actors],
                Port::Window,
                vec![setting("duration_s", number(1.0, 8.0, "s"), true)],
            )],
        ),
        (Slot::Motion, vec![operator("push", &[Port::Window], Port::Candidates, vec![setting("count", count, true)])]),
        (
            Slot::Search,
            vec![operator("pick", &[Port::Candidates], Port::Candidates, vec![setting("combine", combine, true)])],
        ),
        (
            Slot::Filter,
            vec![operator(
                "gap_filter",
                &[Port::Candidates],
                Port::Candidates,
                vec![setting("gap_m_min", number(0.0, 5.0, "m"), true)],
            )],
        ),
        (Slot::Diversity, vec![operator("best_choice", &[Port::Candidates], Port::Choice, vec![])]),
    ])
}

pub fn contract() -> Contract {
    let parameter = |domain: Domain| ParameterSpec { domain, describes: "a toy".into() };
    let slot = |output, features: &[super::Feature]| MechanismSlotSpec {
        output,
        features: features.to_vec(),
        describes: "a toy slot".into(),
    };
    Contract {
        family: FamilyName::new("toy"),
        title: "Toy".into(),
        describes: "A family for tests.".into(),
        backend: "metadrive".into(),
        parameters: BTreeMap::from([
            ("duration_s".into(), parameter(number(1.0, 10.0, "s"))),
            ("gap_limit_m".into(), parameter(number(0.0, 5.0, "m"))),
            ("push_count".into(), parameter(Domain::Integer { low: 2, high: 8, unit: "1".into() })),
            ("style".into(), parameter(Domain::Choice { options: vec!["calm".into(), "rough".into()] })),
        ]),
        operators: operators(),
        mechanism_slots: BTreeMap::from([
            ("actor_score".into(), slot(ValueType::Number, vocabulary::ACTOR)),
            ("actor_guard".into(), slot(ValueType::Boolean, vocabulary::ACTOR)),
        ]),
        scene_features: vocabulary::SCENE.to_vec(),
        private_vocabulary: vec!["push".into(), "push_count".into()],
        constraints: vec!["map".into(), "dynamics".into()],
        limits: Limits::default(),
    }
}

pub fn module(expression: &str, inputs: &[&str]) -> MechanismModule {
    MechanismModule {
        slot: "actor_score".into(),
        inputs: inputs.iter().map(|name| name.to_string()).collect(),
        output: ValueType::Number,
        expression: expression.into(),
        tags: vec!["pressure".into()],
    }
}

fn node(slot: Slot, kind: &str, inputs: &[&str], settings: &[(&str, Setting)]) -> OperatorNode {
    OperatorNode {
        slot,
        kind: kind.into(),
        settings: settings.iter().map(|(name, setting)| (name.to_string(), setting.clone())).collect(),
        inputs: inputs.iter().map(|name| name.to_string()).collect(),
    }
}

/// Every part of a program is used: parameters, references, a module, a rule, a filter.
pub fn program() -> Program {
    let follows = |name: &str| Setting::Parameter(ParameterRef { parameter: name.into() });
    let score = Setting::Mechanism(MechanismRef { mechanism: "pressure".into() });
    let graph = [
        ("select", node(Slot::Select, "every_scene", &[], &[])),
        ("actor", node(Slot::Actor, "ranked_actors", &["select"], &[("score", score)])),
        ("timing", node(Slot::Timing, "window", &["actor"], &[("duration_s", follows("duration_s"))])),
        ("motion", node(Slot::Motion, "push", &["timing"], &[("count", follows("push_count"))])),
        ("search", node(Slot::Search, "pick", &["motion"], &[("combine", Setting::Choice("add".into()))])),
        ("filter", node(Slot::Filter, "gap_filter", &["search"], &[("gap_m_min", Setting::Number(0.5))])),
        ("choice", node(Slot::Diversity, "best_choice", &["filter"], &[])),
    ];
    let rule = PolicyRule {
        name: "dense".into(),
        when: "vehicle_count > 8 and not has_light".into(),
        parameters: BTreeMap::from([("duration_s".into(), ParameterValue::Number(3.0))]),
        operators: BTreeMap::from([("filter".into(), BTreeMap::from([("gap_m_min".into(), Setting::Number(1.0))]))]),
    };
    Program {
        solution_id: SolutionId::new("toy-idm/parent"),
        lineage_id: LineageId::new("toy-idm"),
        source_family: FamilyName::new("toy"),
        generation: 0,
        parameters: BTreeMap::from([
            ("duration_s".into(), ParameterValue::Number(5.0)),
            ("gap_limit_m".into(), ParameterValue::Number(0.5)),
            ("push_count".into(), ParameterValue::Number(4.0)),
            ("style".into(), ParameterValue::Choice("calm".into())),
        ]),
        operator_graph: graph.into_iter().map(|(name, node)| (name.to_string(), node)).collect(),
        scenario_conditioned_policy: vec![rule],
        mechanism_modules: BTreeMap::from([(
            "pressure".into(),
            module("closing_speed_mps / max(gap_m, gap_limit_m)", &["closing_speed_mps", "gap_m", "gap_limit_m"]),
        )]),
        compile_contract: CompileContract {
            backend: "metadrive".into(),
            constraints: vec!["map".into(), "dynamics".into()],
        },
        ancestor_chain: vec![],
    }
}

/// The toy and a family called `swarm` that owns the words `particle_swarm` and `swarm_size`.
pub fn registry() -> Registry {
    let mut other = contract();
    other.family = FamilyName::new("swarm");
    other.private_vocabulary = vec!["particle_swarm".into(), "swarm_size".into()];
    let mut parent = program();
    parent.source_family = FamilyName::new("swarm");
    Registry::new([Family { contract: contract(), parent: program() }, Family { contract: other, parent }])
}
