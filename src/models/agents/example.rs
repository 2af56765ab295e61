//! A small family, its parent and a context, for the tests of prompts, replies and the scripted model.

use std::collections::BTreeMap;

use super::{
    Acceptance, Briefing, Change, Cluster, Context, Detail, Diagnostic, FrontPoint, Handbook, HandbookParts, Measures,
    ParentOutcome, PastEdit, Protocol, Questions, SceneRow,
};
use crate::{
    adapters::{
        Contract, Domain, Limits, MechanismSlotSpec, OperatorSpec, ParameterSpec, Port, SettingSpec,
        vocabulary::{ACTOR, CANDIDATE, SCENE},
    },
    kernel::Digest,
    objects::*,
};

pub struct Example {
    pub contract: Contract,
    handbook: Handbook,
    pub parent: Program,
    pub lineage: LineageId,
    pub memory: Vec<Card>,
    pub clusters: Vec<Cluster>,
    pub outcome: ParentOutcome,
    pub window: Vec<SceneRow>,
    pub history: Vec<PastEdit>,
    pub front: Vec<FrontPoint>,
    questions: Questions,
}

impl Example {
    pub fn toy() -> Example {
        let foreign = vec!["swarm_budget".into(), "tree_expansion".into()];
        Example::of(contract(), parent(), foreign)
    }

    /// The same surroundings for another family.
    pub fn of(contract: Contract, parent: Program, foreign: Vec<String>) -> Example {
        let measures = measures(contract.backend == "safebench");
        Example::with(contract, parent, foreign, &measures)
    }

    /// The same under other measures.
    pub fn with(contract: Contract, parent: Program, foreign: Vec<String>, measures: &Measures) -> Example {
        Example::in_form(contract, parent, foreign, measures, Questions::Plain)
    }

    /// The same in another form of questions.
    pub fn in_form(
        contract: Contract,
        parent: Program,
        foreign: Vec<String>,
        measures: &Measures,
        questions: Questions,
    ) -> Example {
        let contract_text = match questions {
            Questions::Compact => super::compact_contract_text(&contract, &parent),
            _ => super::contract_text(&contract),
        };
        let compact = questions.is_compact();
        let parts = HandbookParts {
            contract: &contract,
            contract_text: &contract_text,
            parent: &parent,
            foreign_vocabulary: &foreign,
            protected_words: &["ego", "simulator"],
            measures,
            omitted: super::Omitted::default(),
            detail: (!questions.is_plain()).then_some(Detail {
                search: "What is searched.",
                around: "What holds around it.",
                ego: Some("What it heeds."),
                compact,
            }),
        };
        Example {
            handbook: Handbook::of(&parts).unwrap(),
            contract,
            parent,
            lineage: LineageId::new("toy-idm"),
            memory: memory(),
            clusters: vec![Cluster {
                name: "cluster:dense".into(),
                scenes: 7,
                describes: "many vehicles, low speed".into(),
                attacked_share: Some(0.2),
                features: BTreeMap::from([("vehicle_count".into(), 14.2), ("ego_speed_mps".into(), 6.512_349)]),
                outcomes: BTreeMap::new(),
            }],
            outcome: outcome(),
            window: window(),
            history: history(),
            front: vec![FrontPoint {
                solution: SolutionId::new("toy-idm/parent"),
                objectives: Objectives { attack: 0.4, realism: 0.93 },
                attempt: None,
                is_parent: true,
                on_window: None,
            }],
            questions,
        }
    }

    pub fn context(&self) -> Context<'_> {
        Context {
            lineage: &self.lineage,
            epoch: 3,
            parent: &self.parent,
            parent_hash: self.parent_hash(),
            handbook: &self.handbook,
            ego: "IDM at 10 m/s on the logged route",
            memory: &self.memory,
            clusters: &self.clusters,
            parent_outcome: Some(&self.outcome),
            window: &self.window,
            history: &self.history,
            front: &self.front,
            questions: self.questions,
            not_shown: "",
        }
    }

    pub fn parent_hash(&self) -> Digest {
        self.parent.hash().unwrap()
    }

    pub fn briefing(&self) -> Briefing {
        Briefing::of(&self.context()).unwrap()
    }
}

fn number(low: f64, high: f64, unit: &str) -> Domain {
    Domain::Number { low, high, unit: unit.into() }
}

fn setting(domain: Domain, required: bool) -> SettingSpec {
    SettingSpec { domain, required, describes: "a setting of the toy family".into() }
}

fn operator(kind: &str, inputs: &[Port], output: Port, settings: &[(&str, SettingSpec)]) -> OperatorSpec {
    OperatorSpec {
        kind: kind.into(),
        inputs: inputs.to_vec(),
        output,
        settings: settings.iter().map(|(name, spec)| ((*name).to_string(), spec.clone())).collect(),
        describes: "an operator of the toy family".into(),
    }
}

fn mechanism(slot: &str) -> Domain {
    Domain::Mechanism { slot: slot.into() }
}

fn contract() -> Contract {
    let parameter = |domain| ParameterSpec { domain, describes: "a parameter of the toy family".into() };
    let slot = |output, features: &[crate::adapters::Feature]| MechanismSlotSpec {
        output,
        features: features.to_vec(),
        describes: "a mechanism slot of the toy family".into(),
    };
    let score = || ("score", setting(mechanism("actor_score"), false));
    Contract {
        family: FamilyName::new("toy"),
        title: "Toy".into(),
        describes: "Chooses an actor and one of its candidate trajectories.".into(),
        backend: "metadrive".into(),
        parameters: BTreeMap::from([
            ("temperature".into(), parameter(number(0.1, 4.0, "1"))),
            ("horizon_s".into(), parameter(number(2.0, 8.0, "s"))),
            ("candidates".into(), parameter(Domain::Integer { low: 4, high: 64, unit: "1".into() })),
            ("mode".into(), parameter(Domain::Choice { options: vec!["mild".into(), "sharp".into()] })),
        ]),
        operators: BTreeMap::from([
            (Slot::Select, vec![operator("all_scenes", &[], Port::Scene, &[])]),
            (
                Slot::Actor,
                vec![
                    operator("nearest", &[Port::Scene], Port::Actors, &[]),
                    operator("ranked", &[Port::Scene], Port::Actors, &[score()]),
                ],
            ),
            (
                Slot::Motion,
                vec![operator(
                    "prior",
                    &[Port::Actors],
                    Port::Candidates,
                    &[("horizon_s", setting(number(2.0, 8.0, "s"), true))],
                )],
            ),
            (
                Slot::Filter,
                vec![
                    operator("keep_all", &[Port::Candidates], Port::Candidates, &[]),
                    operator(
                        "guarded",
                        &[Port::Candidates],
                        Port::Candidates,
                        &[
                            ("guard", setting(mechanism("guard"), false)),
                            ("off_road_m_max", setting(number(0.0, 3.0, "m"), true)),
                        ],
                    ),
                ],
            ),
            (
                Slot::Search,
                vec![operator(
                    "best",
                    &[Port::Candidates],
                    Port::Choice,
                    &[("objective", setting(mechanism("candidate_score"), false))],
                )],
            ),
        ]),
        mechanism_slots: BTreeMap::from([
            ("actor_score".into(), slot(ValueType::Number, ACTOR)),
            ("candidate_score".into(), slot(ValueType::Number, CANDIDATE)),
            ("guard".into(), slot(ValueType::Boolean, CANDIDATE)),
        ]),
        scene_features: SCENE.to_vec(),
        private_vocabulary: vec!["prior".into()],
        constraints: vec!["map".into(), "dynamics".into(), "interface".into()],
        limits: Limits::default(),
    }
}

fn node(slot: Slot, kind: &str, inputs: &[&str], settings: &[(&str, Setting)]) -> OperatorNode {
    OperatorNode {
        slot,
        kind: kind.into(),
        settings: settings.iter().map(|(name, value)| ((*name).to_string(), value.clone())).collect(),
        inputs: inputs.iter().map(|i| (*i).to_string()).collect(),
    }
}

fn parent() -> Program {
    let by_parameter = Setting::Parameter(ParameterRef { parameter: "horizon_s".into() });
    let by_module = Setting::Mechanism(MechanismRef { mechanism: "likely_contact".into() });
    Program {
        solution_id: SolutionId::new("toy-idm/parent"),
        lineage_id: LineageId::new("toy-idm"),
        source_family: FamilyName::new("toy"),
        generation: 0,
        parameters: BTreeMap::from([
            ("temperature".into(), ParameterValue::Number(1.0)),
            ("horizon_s".into(), ParameterValue::Number(5.0)),
            ("candidates".into(), ParameterValue::Number(32.0)),
            ("mode".into(), ParameterValue::Choice("mild".into())),
        ]),
        operator_graph: BTreeMap::from([
            ("select".into(), node(Slot::Select, "all_scenes", &[], &[])),
            ("who".into(), node(Slot::Actor, "nearest", &["select"], &[])),
            ("how".into(), node(Slot::Motion, "prior", &["who"], &[("horizon_s", by_parameter)])),
            ("keep".into(), node(Slot::Filter, "keep_all", &["how"], &[])),
            ("pick".into(), node(Slot::Search, "best", &["keep"], &[("objective", by_module)])),
        ]),
        scenario_conditioned_policy: vec![],
        mechanism_modules: BTreeMap::from([(
            "likely_contact".into(),
            MechanismModule {
                slot: "candidate_score".into(),
                inputs: vec!["prior_log_probability".into(), "collision_likelihood".into()],
                output: ValueType::Number,
                expression: "prior_log_probability + log(collision_likelihood)".into(),
                tags: vec!["posterior".into()],
            },
        )]),
        compile_contract: CompileContract {
            backend: "metadrive".into(),
            constraints: vec!["map".into(), "dynamics".into(), "interface".into()],
        },
        ancestor_chain: vec![],
    }
}

fn memory() -> Vec<Card> {
    let card = |n: u32, kind, text: &str, tag: &str| Card {
        id: CardId::new(format!("toy-idm/e2s{n}#0")),
        kind,
        lineage: LineageId::new("toy-idm"),
        family: FamilyName::new("toy"),
        epoch: 2,
        attempt: Some(AttemptId::at(&LineageId::new("toy-idm"), 2, n)),
        text: text.into(),
        mechanism_tags: vec![tag.into()],
        scene_tags: vec!["dense".into()],
        shareable: false,
    };
    vec![
        card(1, CardKind::Failure, "Rewarding closing speed alone broke the jerk diagnostic.", "speed_mismatch"),
        card(2, CardKind::Success, "Ranking actors by time-to-conflict pressure raised attack.", "time_pressure"),
    ]
}

fn outcome() -> ParentOutcome {
    ParentOutcome {
        objectives: Objectives { attack: 0.4, realism: 0.931_234_567 },
        scenes: 20,
        failures: 1,
        coverage: 0.9,
        diagnostics: BTreeMap::from([("jerk".into(), 0.71), ("off_road".into(), 0.99)]),
        near_misses: None,
    }
}

fn window() -> Vec<SceneRow> {
    let row = |n: u32, outcome, contact: Option<&str>, nearest_m, note: &str| SceneRow {
        scene: format!("crossing/{n}"),
        cluster: "junction".into(),
        tags: vec!["light".into()],
        actors: vec![format!("car_{n}")],
        attack: if outcome == "attack" { 1.0 } else { 0.0 },
        outcome,
        contact: contact.map(str::to_string),
        nearest_m: Some(nearest_m),
        note: note.into(),
        diagnostics: BTreeMap::from([("bounded_jerk".into(), 0.62), ("map_validity".into(), 1.0)]),
        metrics: BTreeMap::new(),
        encounter: None,
    };
    vec![
        row(1, "attack", Some("cut_in"), 0.0, ""),
        row(2, "anyway", Some("ego_strikes"), 0.0, ""),
        row(3, "ego_braked", None, 1.84, "road_filter refused all, nearest violates it by 0.42"),
    ]
}

fn history() -> Vec<PastEdit> {
    let value = serde_json::json!({
        "slot": "candidate_score", "inputs": ["closest_speed_mps"], "output": "number",
        "expression": "closest_speed_mps / 10", "tags": ["speed_mismatch"],
    });
    let path = "/mechanism_modules/likely_contact".to_string();
    vec![PastEdit {
        attempt: AttemptId::at(&LineageId::new("toy-idm"), 2, 1),
        parent: SolutionId::new("toy-idm/parent"),
        ended: "not accepted".into(),
        operations: vec![Operation { op: OperationKind::Replace, path, value: Some(value) }],
        hypothesis: "Fast contacts are harder to avoid.".into(),
        problems: vec![],
        change: Some(Change {
            scenes: 20,
            attack: (0.05, Some(0.041)),
            realism: (-0.131, Some(0.02)),
            coverage: 0.0,
            diagnostics: BTreeMap::from([("jerk".into(), -0.3), ("off_road".into(), 0.0)]),
            clusters: BTreeMap::from([("junction".into(), 0.1)]),
            won: vec!["crossing/7".into()],
            lost: vec![],
            near: None,
        }),
        verdict: None,
    }]
}

/// Meanings of the two sample diagnostics, at length and in short.
const JERK: [&str; 2] = ["jerk: largest change of acceleration, m/s^3", "change of acceleration, m/s^3"];
const COLLISIONS: [&str; 2] =
    ["1 unless it touches another moving road user than the ego", "1 unless it touches a moving road user but the ego"];

/// Measures of either protocol with small numbers.
pub fn measures(safebench: bool) -> Measures {
    let diagnostic =
        |name: &str, weight, [meaning, short]: [&'static str; 2], limits: &[(&str, f64, f64)]| Diagnostic {
            name: name.into(),
            weight,
            meaning,
            short,
            limits: limits.iter().map(|(name, bound, tolerance)| (name.to_string(), *bound, *tolerance)).collect(),
        };
    let protocol = if safebench {
        Protocol::Safebench { limits: vec![("jerk m/s^3".into(), 10.0, 20.0)] }
    } else {
        Protocol::Metadrive {
            counts: vec!["ego_strikes".into()],
            counts_if_avoidable: vec!["cut_in".into(), "crossing".into()],
            reaction_s: 1.15,
            when: None,
            metrics: Vec::new(),
            diagnostics: vec![
                diagnostic("bounded_jerk", 0.6, JERK, &[("jerk_mps3", 8.0, 4.0)]),
                diagnostic("collision_validity", 0.4, COLLISIONS, &[]),
            ],
        }
    };
    let acceptance = Acceptance {
        r0: 0.95,
        a0: 0.3,
        epsilon_r: 0.01,
        epsilon_a: 0.02,
        level: 0.8,
        coverage_floor: 0.8,
        realism_min: 0.95,
    };
    Measures { protocol, acceptance, rule: None, tradeoff: true, fixed_bodies: false, otherwise: vec![] }
}
