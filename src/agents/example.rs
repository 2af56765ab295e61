//! A small family, its parent and a context, for the tests of prompts, replies and the scripted model.

use std::collections::BTreeMap;

use super::{Briefing, Cluster, Context, FrontPoint, Outcomes, ParentOutcome, RecentAttempt};
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
    contract_text: String,
    pub parent: Program,
    pub lineage: LineageId,
    pub memory: Vec<Card>,
    pub clusters: Vec<Cluster>,
    pub outcomes: Outcomes,
    pub front: Vec<FrontPoint>,
    pub foreign: Vec<String>,
}

impl Example {
    pub fn toy() -> Example {
        let foreign = vec!["swarm_budget".into(), "tree_expansion".into()];
        Example::of(contract(), parent(), foreign)
    }

    /// The same surroundings for another family.
    pub fn of(contract: Contract, parent: Program, foreign: Vec<String>) -> Example {
        Example {
            contract_text: super::contract_text(&contract),
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
            }],
            outcomes: outcomes(),
            front: vec![FrontPoint {
                solution: SolutionId::new("toy-idm/parent"),
                objectives: Objectives { attack: 0.4, realism: 0.93 },
            }],
            foreign,
        }
    }

    pub fn context(&self) -> Context<'_> {
        Context {
            lineage: &self.lineage,
            epoch: 3,
            parent: &self.parent,
            parent_hash: self.parent_hash(),
            contract: &self.contract,
            contract_text: &self.contract_text,
            foreign_vocabulary: &self.foreign,
            ego: "IDM at 10 m/s on the logged route",
            memory: &self.memory,
            clusters: &self.clusters,
            outcomes: &self.outcomes,
            front: &self.front,
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

fn outcomes() -> Outcomes {
    Outcomes {
        parent: Some(ParentOutcome {
            objectives: Objectives { attack: 0.4, realism: 0.931_234_567 },
            scenes: 20,
            failures: 1,
            attacked_share: 0.4,
            intervened_share: 0.9,
            diagnostics: BTreeMap::from([("jerk".into(), 0.71), ("off_road".into(), 0.99)]),
        }),
        recent: vec![RecentAttempt {
            attempt: AttemptId::at(&LineageId::new("toy-idm"), 2, 1),
            exit: "evaluated".into(),
            mechanism_tags: vec!["speed_mismatch".into()],
            problems: vec![],
            objectives: Some(Objectives { attack: 0.45, realism: 0.8 }),
        }],
    }
}
