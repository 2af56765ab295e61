//! The interface I_b of a source family (paper eq. in Generator interfaces): what a program of the family may
//! contain, in a form that prompts show, gates check and compilers obey.

use serde::Serialize;
use std::collections::BTreeMap;

use super::isolation::ForeignVocabulary;
use super::vocabulary::Feature;
use crate::objects::{FamilyName, Program, Slot, ValueType};

/// A family's declared search space. Built by the family's file in `families`; fixed before evolution.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Contract {
    /// b
    pub family: FamilyName,
    /// The method's name and reference, for reports.
    pub title: String,
    /// Description of its mechanism, in two or three sentences, for prompts.
    pub describes: String,
    /// `metadrive` or `safebench`.
    pub backend: String,
    /// Θ_b
    pub parameters: BTreeMap<String, ParameterSpec>,
    /// G_b: kinds that each slot may hold.
    pub operators: BTreeMap<Slot, Vec<OperatorSpec>>,
    /// H_b: places where an expression may be plugged in.
    pub mechanism_slots: BTreeMap<String, MechanismSlotSpec>,
    /// Features that conditions of ρ may read.
    pub scene_features: Vec<Feature>,
    /// Words (operator kinds, parameters, mechanism slots, features) that belong to this family's implementation. A
    /// patch of another family that uses one fails the isolation gate.
    pub private_vocabulary: Vec<String>,
    /// F_b: names for κ.
    pub constraints: Vec<String>,
    /// Largest size of a program and of a patch.
    pub limits: Limits,
}

/// A bounded parameter of θ.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ParameterSpec {
    /// Values that it may have.
    #[serde(flatten)]
    pub domain: Domain,
    /// Description of its effect, with its reference where it has one.
    pub describes: String,
}

/// Values that a parameter or a setting may take.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case", tag = "type")]
pub enum Domain {
    /// A number between two bounds.
    Number {
        /// Smallest value, in `unit`.
        low: f64,
        /// Largest value, in `unit`.
        high: f64,
        /// `m/s`, `s`, ...; `1` where there is none.
        unit: String,
    },
    /// A number without fraction.
    Integer {
        /// Smallest value, in `unit`.
        low: i64,
        /// Largest value, in `unit`.
        high: i64,
        /// `m/s`, `s`, ...; `1` where there is none.
        unit: String,
    },
    /// One of several words.
    Choice {
        /// The words.
        options: Vec<String>,
    },
    /// The name of a module in this mechanism slot.
    Mechanism {
        /// Name of the mechanism slot.
        slot: String,
    },
}

/// Type of an edge of the graph.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Port {
    /// True if the program acts in the scene.
    Scene,
    /// The road users that become adversaries.
    Actors,
    /// The time at which each adversary's motion is changed.
    Window,
    /// Motions to choose from, with their scores.
    Candidates,
    /// One motion for each adversary.
    Choice,
}

/// An operator kind that a slot may hold.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct OperatorSpec {
    /// The word in programs.
    pub kind: String,
    /// Types of the nodes that feed it, in order. Empty: it starts the graph.
    pub inputs: Vec<Port>,
    /// Type of its result.
    pub output: Port,
    /// Its settings by name.
    pub settings: BTreeMap<String, SettingSpec>,
    /// Description of its effect, for prompts.
    pub describes: String,
}

/// A setting of an operator kind.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SettingSpec {
    /// Values that it may have.
    #[serde(flatten)]
    pub domain: Domain,
    /// True if every node of the kind must give it.
    pub required: bool,
    /// Description of its effect, for prompts.
    pub describes: String,
}

/// A place where an expression may be plugged in.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MechanismSlotSpec {
    /// Type of the expression's value.
    pub output: ValueType,
    /// Features that an expression here may read, besides the family's numeric parameters and the scene features.
    pub features: Vec<Feature>,
    /// Decision that the expression makes, for prompts.
    pub describes: String,
}

/// Bounds on the size of a program and of a patch.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Limits {
    /// Most operations of a patch.
    pub operations_per_patch: usize,
    /// Most nodes of an operator graph.
    pub nodes: usize,
    /// Most rules of a policy.
    pub rules: usize,
    /// Most mechanism modules.
    pub modules: usize,
    /// Most nodes of an expression's tree.
    pub expression_nodes: usize,
    /// Largest depth of an expression's tree.
    pub expression_depth: usize,
    /// True if a chain of terms is one level of that depth, as detailed questions say, and not one level per term.
    #[serde(skip)]
    pub chains_are_one_level: bool,
}

impl Default for Limits {
    fn default() -> Limits {
        Limits {
            operations_per_patch: 8,
            nodes: 16,
            rules: 8,
            modules: 12,
            expression_nodes: 96,
            expression_depth: 12,
            chains_are_one_level: false,
        }
    }
}

/// A family: its contract and the parent program from which evolution starts.
#[derive(Clone, Debug)]
pub struct Family {
    /// Everything that programs of the family may contain (I_b).
    pub contract: Contract,
    /// Ids and lineage are filled in by the lineage that adopts it.
    pub parent: Program,
}

/// All families of a run by name.
#[derive(Clone, Debug, Default)]
pub struct Registry {
    families: BTreeMap<FamilyName, Family>,
    /// The words that each of them may not use, computed once.
    foreign: BTreeMap<FamilyName, ForeignVocabulary>,
}

impl Registry {
    /// A registry of these families; of two with the same name the later one stays.
    pub fn new(families: impl IntoIterator<Item = Family>) -> Registry {
        let families: BTreeMap<FamilyName, Family> =
            families.into_iter().map(|f| (f.contract.family.clone(), f)).collect();
        let foreign = |(name, family): (&FamilyName, &Family)| {
            (name.clone(), family.contract.foreign_vocabulary(families.values()))
        };
        Registry { foreign: families.iter().map(foreign).collect(), families }
    }

    /// The words that a registered family may not use; `None` for a family that is not registered.
    pub fn foreign_vocabulary(&self, name: &FamilyName) -> Option<&ForeignVocabulary> {
        self.foreign.get(name)
    }

    /// The family of this name.
    pub fn get(&self, name: &FamilyName) -> Option<&Family> {
        self.families.get(name)
    }

    /// All families, by name.
    pub fn iter(&self) -> impl Iterator<Item = &Family> {
        self.families.values()
    }
}
