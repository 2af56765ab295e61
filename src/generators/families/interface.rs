//! Additions of a family to the shared grammar, and the contract and parent program that follow from them.

use std::collections::BTreeMap;

use super::grammar;
use crate::adapters::{
    Contract, Domain, Family, Limits, MechanismSlotSpec, OperatorSpec, ParameterSpec, SettingSpec, vocabulary,
};
use crate::objects::{
    CompileContract, FamilyName, LineageId, OperatorNode, ParameterValue, Program, Setting, Slot, SolutionId,
};

/// A parameter of a family's own with the value that its parent gives it.
#[derive(Clone, Debug)]
pub struct OwnParameter {
    pub name: String,
    pub spec: ParameterSpec,
    pub value: ParameterValue,
}

/// A numeric parameter: declared as by [`grammar::parameter`], with its published value.
pub fn own(name: &str, domain: Domain, describes: &str, value: f64) -> OwnParameter {
    let (name, spec) = grammar::parameter(name, domain, describes);
    OwnParameter { name, spec, value: ParameterValue::Number(value) }
}

/// A required setting with the domain and the words of the parameter of its name.
pub fn follows(parameter: &OwnParameter) -> (String, SettingSpec) {
    grammar::required(&parameter.name, parameter.spec.domain.clone(), &parameter.spec.describes)
}

/// A node's settings that follow the parameters of their names.
pub fn from_parameters(parameters: &[OwnParameter]) -> Vec<(String, Setting)> {
    parameters.iter().map(|p| (p.name.clone(), grammar::from_parameter(&p.name))).collect()
}

/// Additions of a family to the shared grammar.
pub struct FamilySpec {
    pub name: &'static str,
    /// Method and reference.
    pub title: &'static str,
    pub describes: String,
    /// Operator kinds and mechanism slots of its own: private, as all its parameters are.
    pub words: Vec<&'static str>,
    pub parameters: Vec<OwnParameter>,
    pub operators: Vec<(Slot, OperatorSpec)>,
    /// Slots in which the shared kinds are not offered.
    pub without_shared: &'static [Slot],
    pub mechanism_slots: Vec<(String, MechanismSlotSpec)>,
    /// The parent's operator graph.
    pub graph: Vec<(String, OperatorNode)>,
}

impl FamilySpec {
    /// Contract and parent: the shared grammar with the family's own beside it.
    pub fn family(self) -> Family {
        let mut operators = grammar::shared_operators();
        operators.retain(|slot, _| !self.without_shared.contains(slot));
        for (slot, spec) in self.operators {
            operators.entry(slot).or_default().push(spec);
        }
        let mut mechanism_slots = grammar::shared_mechanism_slots();
        if self.without_shared.contains(&Slot::Law) {
            mechanism_slots.retain(|slot, _| !grammar::LAW_SLOTS.contains(&slot.as_str()));
        }
        mechanism_slots.extend(self.mechanism_slots);
        let words = self.words.into_iter().map(String::from);
        let private_vocabulary = words.chain(self.parameters.iter().map(|p| p.name.clone())).collect();
        let mut parameters = grammar::shared_parameters();
        let mut values = grammar::shared_values();
        for own in self.parameters {
            parameters.insert(own.name.clone(), own.spec);
            values.insert(own.name, own.value);
        }
        let contract = Contract {
            family: FamilyName::new(self.name),
            title: self.title.into(),
            describes: self.describes,
            backend: "metadrive".into(),
            parameters,
            operators,
            mechanism_slots,
            scene_features: vocabulary::SCENE.to_vec(),
            private_vocabulary,
            constraints: grammar::constraints(),
            limits: Limits::default(),
        };
        Family { contract, parent: parent(self.name, values, self.graph) }
    }
}

fn parent(name: &str, parameters: BTreeMap<String, ParameterValue>, graph: Vec<(String, OperatorNode)>) -> Program {
    Program {
        solution_id: SolutionId(format!("{name}/parent")),
        lineage_id: LineageId::new(name),
        source_family: FamilyName::new(name),
        generation: 0,
        parameters,
        operator_graph: graph.into_iter().collect(),
        scenario_conditioned_policy: vec![],
        mechanism_modules: BTreeMap::new(),
        compile_contract: CompileContract { backend: "metadrive".into(), constraints: grammar::constraints() },
        ancestor_chain: vec![],
    }
}

/// The parameters of several operators together, by name.
pub fn by_name(parameters: impl IntoIterator<Item = OwnParameter>) -> Vec<OwnParameter> {
    let mut all: Vec<OwnParameter> = parameters.into_iter().collect();
    all.sort_by(|a, b| a.name.cmp(&b.name));
    all
}

/// Offers a family the actor operator that takes a group of vehicles, with the size that the parent gives it. Its words
/// are nobody's own: more than one family moves several vehicles at once.
pub fn with_actor_group(mut family: Family, size: f64) -> Family {
    family.contract.operators.entry(Slot::Actor).or_default().push(grammar::group_operator());
    family.contract.parameters.extend([grammar::group_parameter()]);
    family.parent.parameters.extend([grammar::value("group_size", size)]);
    family
}

/// The actor node of such a family's parent.
pub fn actor_group() -> (String, OperatorNode) {
    let size = ("group_size".to_string(), grammar::from_parameter("group_size"));
    node("actor", Slot::Actor, "actor_group", &["select"], vec![size])
}

/// An operator kind with any number of settings.
pub fn operator(slot: Slot, kind: &str, settings: Vec<(String, SettingSpec)>, describes: &str) -> OperatorSpec {
    let mut spec = grammar::operator(slot, kind, [], describes);
    spec.settings.extend(settings);
    spec
}

/// A node with any number of settings.
pub fn node(
    name: &str,
    slot: Slot,
    kind: &str,
    inputs: &[&str],
    settings: Vec<(String, Setting)>,
) -> (String, OperatorNode) {
    let (name, mut node) = grammar::node(name, slot, kind, inputs, []);
    node.settings.extend(settings);
    (name, node)
}

/// The start of a parent's graph that replaces the whole recorded future of one vehicle, as CAT and its kin do.
pub fn one_marked_vehicle() -> Vec<(String, OperatorNode)> {
    vec![
        node("select", Slot::Select, "every_scene", &[], vec![]),
        node("actor", Slot::Actor, "marked_actor", &["select"], vec![word("otherwise", "nearest_path")]),
        after_history(),
    ]
}

/// The timing node of such a graph.
pub fn after_history() -> (String, OperatorNode) {
    let duration = ("duration_s".to_string(), grammar::from_parameter("duration_s"));
    node("timing", Slot::Timing, "after_history", &["actor"], vec![duration])
}

/// The end of a parent's graph: the highest score.
pub fn best_of_search() -> (String, OperatorNode) {
    node("choice", Slot::Diversity, "best_choice", &["search"], vec![])
}

/// A setting that is a word, with its name.
pub fn word(name: &str, word: &str) -> (String, Setting) {
    (name.into(), grammar::word(word))
}
