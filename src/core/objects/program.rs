//! A generator program: the typed state p = (b, θ, G, ρ, H, κ, α) that evolves (paper eq. method-program-state).

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

use super::expr;
use super::ids::{FamilyName, LineageId, SolutionId};
use super::value_type::ValueType;
use crate::kernel::{Digest, canon::CanonError};
use crate::text::in_words;

/// The slots of an operator graph, in the order in which a scene passes them: the paper's seven, and the law.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Slot {
    /// O_select: the scenes in which the program acts.
    Select,
    /// O_actor: who becomes an adversary.
    Actor,
    /// O_timing: when the motion is changed.
    Timing,
    /// O_motion: which motions are possible.
    Motion,
    /// O_search: which of them is best.
    Search,
    /// O_filter: which of them are removed.
    Filter,
    /// Behaviour of an adversary while it observes the ego, from some step of its motion on.
    Law,
    /// O_div: which of those left is taken.
    Diversity,
}

impl Slot {
    /// All slots, in the order in which they run.
    pub const ALL: [Slot; 8] =
        [Slot::Select, Slot::Actor, Slot::Timing, Slot::Motion, Slot::Search, Slot::Filter, Slot::Law, Slot::Diversity];

    /// The word in programs and prompts.
    pub fn name(self) -> &'static str {
        match self {
            Slot::Select => "select",
            Slot::Actor => "actor",
            Slot::Timing => "timing",
            Slot::Motion => "motion",
            Slot::Search => "search",
            Slot::Filter => "filter",
            Slot::Law => "law",
            Slot::Diversity => "diversity",
        }
    }
}

/// θ: a bounded number or one of a family's declared words.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum ParameterValue {
    /// A number in the parameter's unit.
    Number(f64),
    /// One of the words that the contract offers.
    Choice(String),
}

impl ParameterValue {
    /// The number as it is, or the word without underscores; without the unit, which the contract has.
    pub fn in_words(&self) -> String {
        match self {
            ParameterValue::Number(number) => number.to_string(),
            ParameterValue::Choice(word) => in_words(word),
        }
    }
}

/// A setting of an operator: a literal, or a reference that is resolved for each scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Setting {
    /// A number in the setting's unit.
    Number(f64),
    /// The value of a parameter.
    Parameter(ParameterRef),
    /// A module of H.
    Mechanism(MechanismRef),
    /// One of the words that the contract offers.
    Choice(String),
}

/// The setting of an actor operator that names the sort of road user that it inserts.
pub const BODY_SETTING: &str = "shape";

impl Setting {
    /// Returns the value in words: for a module its name in quotes, for a parameter `as` and its name.
    pub fn in_words(&self) -> String {
        match self {
            Setting::Number(number) => number.to_string(),
            Setting::Choice(word) => in_words(word),
            Setting::Parameter(of) => format!("as {}", in_words(&of.parameter)),
            Setting::Mechanism(of) => format!("“{}”", in_words(&of.mechanism)),
        }
    }
}

/// `{"parameter": "name"}`: the value of θ under this name, after the rules of ρ were applied for the scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ParameterRef {
    /// Name of the parameter.
    pub parameter: String,
}

/// `{"mechanism": "name"}`: a module of H.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MechanismRef {
    /// Name of the module.
    pub mechanism: String,
}

/// One node of G.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OperatorNode {
    /// The slot that it fills.
    pub slot: Slot,
    /// One of the kinds that the family's contract lists for the slot.
    pub kind: String,
    /// Setting name -> value.
    #[serde(default)]
    pub settings: BTreeMap<String, Setting>,
    /// Names of the nodes that feed this one.
    #[serde(default)]
    pub inputs: Vec<String>,
}

/// One rule of ρ. Rules are tried in order and all that hold are applied, later ones last.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PolicyRule {
    /// A name that is unique in the policy.
    pub name: String,
    /// A condition on scene features in the expression language.
    pub when: String,
    /// Parameters to override in scenes where the condition holds.
    #[serde(default)]
    pub parameters: BTreeMap<String, ParameterValue>,
    /// Operator settings to override: node -> setting -> value.
    #[serde(default)]
    pub operators: BTreeMap<String, BTreeMap<String, Setting>>,
}

/// One module of H: a declarative mechanism in the expression language.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MechanismModule {
    /// Slot that it may be plugged into: one of the contract's mechanism slots (`actor_score`, `guard`, ...).
    pub slot: String,
    /// Features and parameters that the expression reads; each must be legal in the slot.
    pub inputs: Vec<String>,
    /// Type of the expression's value.
    pub output: ValueType,
    /// The expression's text.
    pub expression: String,
    /// Words by which memory and reports group mechanisms.
    #[serde(default)]
    pub tags: Vec<String>,
}

/// κ: what the compiled result must satisfy. Inherited from the family, never edited.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CompileContract {
    /// `metadrive` or `safebench`.
    pub backend: String,
    /// Names of the constraints of the family contract, e.g. `map`, `dynamics`, `interface`.
    pub constraints: Vec<String>,
}

/// α: one step of descent.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Ancestor {
    /// Which program.
    pub solution_id: SolutionId,
    /// Hash of its content.
    pub program_hash: Digest,
    /// Digest of the patch that led from it to its child.
    pub patch_hash: Digest,
}

/// The state that is edited, compiled and evaluated.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Program {
    /// Its name in the lineage.
    pub solution_id: SolutionId,
    /// The line of descent that it belongs to.
    pub lineage_id: LineageId,
    /// b
    pub source_family: FamilyName,
    /// Depth from the initial generator, which has 0.
    pub generation: u32,
    /// θ: parameter name -> value.
    pub parameters: BTreeMap<String, ParameterValue>,
    /// Node name -> node.
    pub operator_graph: BTreeMap<String, OperatorNode>,
    /// ρ: rules, tried in order; all that hold are applied.
    pub scenario_conditioned_policy: Vec<PolicyRule>,
    /// Module name -> module.
    pub mechanism_modules: BTreeMap<String, MechanismModule>,
    /// κ
    pub compile_contract: CompileContract,
    /// α: from the initial generator to the parent.
    pub ancestor_chain: Vec<Ancestor>,
}

/// A program with the hash of its content.
#[derive(Clone, Copy, Debug)]
pub struct HashedProgram<'a> {
    /// The program.
    pub program: &'a Program,
    /// [`Program::hash`].
    pub hash: Digest,
}

impl Program {
    /// Itself with its hash.
    pub fn hashed(&self) -> Result<HashedProgram<'_>, CanonError> {
        Ok(HashedProgram { program: self, hash: self.hash()? })
    }

    /// Hash of everything that decides the program's behaviour. Identity, lineage and ancestors do not count, and
    /// expressions count in canonical text, so spacing does not matter.
    pub fn hash(&self) -> Result<Digest, CanonError> {
        let content = (
            &self.source_family,
            &self.parameters,
            &self.operator_graph,
            normalised_policy(&self.scenario_conditioned_policy),
            normalised_modules(&self.mechanism_modules),
            &self.compile_contract,
        );
        Digest::of("evodrive/program/1", &content)
    }

    /// Returns a family's parent program as the beginning of a lineage: solution `<lineage>/parent`, generation 0, no
    /// ancestors.
    pub fn adopted(&self, lineage: &LineageId) -> Program {
        Program {
            solution_id: parent_of(lineage),
            lineage_id: lineage.clone(),
            generation: 0,
            ancestor_chain: Vec::new(),
            ..self.clone()
        }
    }

    /// Returns `true` if its lineage begins with it.
    pub fn is_parent(&self) -> bool {
        self.solution_id == parent_of(&self.lineage_id)
    }
}

/// The name of the program with which a lineage begins.
fn parent_of(lineage: &LineageId) -> SolutionId {
    SolutionId(format!("{lineage}/parent"))
}

/// Modules with their expressions in canonical text; one that does not parse keeps its own text.
pub fn normalised_modules(modules: &BTreeMap<String, MechanismModule>) -> BTreeMap<String, MechanismModule> {
    let mut modules = modules.clone();
    for module in modules.values_mut() {
        module.expression = expr::canonical_text(&module.expression);
    }
    modules
}

/// Rules with their conditions in canonical text; one that does not parse keeps its own text.
pub fn normalised_policy(rules: &[PolicyRule]) -> Vec<PolicyRule> {
    let mut rules = rules.to_vec();
    for rule in &mut rules {
        rule.when = expr::canonical_text(&rule.when);
    }
    rules
}
