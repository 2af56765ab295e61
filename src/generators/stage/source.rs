//! A source family as the compiler and evolution know it: its contract, its parent program, the code of its own operators,
//! and what it asks of agents. Code that works with a source need not know which family it is.

use std::collections::BTreeMap;

use super::operator::{ActorOperator, Operator, Stage, StageError};
use super::situation::Situation;
use crate::adapters::{Contract, Family, Registry};
use crate::objects::composition::TemplateForm;
use crate::objects::counsel::{Trial, Vehicle};
use crate::objects::{Composition, FamilyName, Program};
use crate::scene::{Sample, Scene};
use crate::sim::Outcome;

/// One source family.
#[derive(Clone, Debug)]
pub struct Source {
    pub contract: Contract,
    /// Ids and lineage are filled in by the lineage that adopts it.
    pub parent: Program,
    /// The space that the search goes through, its ranking with the scale, and one edit with its effect, for prompts. Figures are the parent's.
    pub search_in_words: &'static str,
    /// Motion and search kinds -> what they do.
    pub operators: BTreeMap<&'static str, Operator>,
    /// Actor kinds of the family's own -> the road users that they make adversaries.
    pub actors: BTreeMap<&'static str, ActorOperator>,
    pub asks: Asks,
    /// The parent with the numbers that its authors published, where they published any.
    pub published: Option<Published>,
}

/// Program from which a lineage may start in place of its family's parent, whose search here runs anew.
#[derive(Clone, Debug)]
pub struct Published {
    pub program: Program,
    /// The operator kind by which it reads those numbers. Where no lineage starts from a program with it, a study's contract does not
    /// offer it, so that no question changes.
    pub kind: Option<&'static str>,
}

/// Questions that a family has for agents besides patches.
#[derive(Clone, Copy, Debug, Default)]
pub struct Asks {
    /// Counsel on who should attack, scene by scene.
    pub counsel: Option<AskCounsel>,
    /// Composition of the templates of its parent.
    pub templates: Option<AskTemplates>,
}

/// How counsel about a scene is taken.
#[derive(Clone, Copy, Debug)]
pub struct AskCounsel {
    /// The program that carries out what a counsel says, with no search of its own.
    pub blind: fn(&Program) -> Program,
    /// Most vehicles that a program lets attack together.
    pub attackers_max: fn(&Program) -> Result<usize, StageError>,
    /// Returns this many vehicles as the agent is shown them, the most promising first.
    pub vehicles: fn(&Stage<'_>, &Program, usize) -> Result<Vec<Vehicle>, StageError>,
    /// Returns what became of a set of attackers that was tried.
    pub trial: fn(&Situation, &Outcome, LeaderWay<'_>) -> Trial,
}

/// Motion that the first attacker was to drive: the scene step of the first sample, and the samples. Asked for only where somebody must know.
pub type LeaderWay<'a> = &'a mut dyn FnMut() -> (usize, Vec<Sample>);

/// How templates are composed.
#[derive(Clone, Copy, Debug)]
pub struct AskTemplates {
    /// Parts from which a template may be composed, a form for each kind of scenario.
    pub forms: fn() -> Vec<TemplateForm>,
    /// The kind of scenario that a scene is; `None` for scenes that no template is for.
    pub kind_of: fn(&Scene) -> Option<&'static str>,
    /// Makes a composed template a program's, for one kind of scenario.
    pub put: fn(&mut Program, &str, &Composition),
}

impl Source {
    /// A family without code of its own.
    pub fn new(family: Family, search_in_words: &'static str) -> Source {
        let Family { contract, parent } = family;
        let (operators, actors) = Default::default();
        Source { contract, parent, search_in_words, operators, actors, asks: Asks::default(), published: None }
    }

    /// The same without the kind of its published parent, unless one of these programs has it.
    pub fn offering_for<'p>(mut self, programs: impl IntoIterator<Item = &'p Program>) -> Source {
        let Some(kind) = self.published.as_ref().and_then(|published| published.kind) else { return self };
        let has = |program: &Program| program.operator_graph.values().any(|node| node.kind == kind);
        if !programs.into_iter().any(has) {
            self.contract.operators.values_mut().for_each(|specs| specs.retain(|spec| spec.kind != kind));
            self.contract.private_vocabulary.retain(|word| word != kind);
        }
        self
    }

    /// Adds the code of a motion or search kind.
    pub fn operator(mut self, kind: &'static str, run: Operator) -> Source {
        self.operators.insert(kind, run);
        self
    }

    /// Adds the code of an actor kind.
    pub fn actor(mut self, kind: &'static str, run: ActorOperator) -> Source {
        self.actors.insert(kind, run);
        self
    }
}

/// Source families by name.
#[derive(Clone, Debug)]
pub struct Sources(BTreeMap<FamilyName, Source>);

impl Sources {
    pub fn new(sources: impl IntoIterator<Item = Source>) -> Sources {
        Sources(sources.into_iter().map(|source| (source.contract.family.clone(), source)).collect())
    }

    pub fn get(&self, name: &FamilyName) -> Option<&Source> {
        self.0.get(name)
    }

    /// In the order of their names.
    pub fn iter(&self) -> impl Iterator<Item = &Source> {
        self.0.values()
    }

    /// The same with every source changed.
    pub fn map(self, change: impl Fn(Source) -> Source) -> Sources {
        Sources(self.0.into_iter().map(|(name, source)| (name, change(source))).collect())
    }

    /// Returns the registry by which the gates judge patches.
    pub fn registry(&self) -> Registry {
        Registry::new(self.iter().map(|of| Family { contract: of.contract.clone(), parent: of.parent.clone() }))
    }
}
