//! Basis of a cell of a table: searches, their repetitions, programs, and scene by scene the recorded labels. Its
//! number can be computed again from these parts alone.

use std::sync::Arc;

use crate::kernel::{Digest, num};
use crate::objects::benchmark::SafebenchRun;
use crate::objects::{Attempt, AttemptId, Met, SceneScore, SolutionId};
use crate::statistics::bootstrap::{self, Estimate, PerScene, Quantity, Search};

/// A number of a label; `None` where the scene does not count.
pub(super) type LabelRead = Arc<dyn Fn(&SceneScore) -> Option<f64> + Send + Sync>;

/// Rule by which parts give the number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Combine {
    /// Mean over searches of the mean over those repetitions that have a number.
    Means,
    /// The same, and there is none where one repetition has none.
    MeansOfAll,
    /// 100 times the share of all counted leaves that hold.
    Pooled,
    /// The second term minus the first, paired by lineage and scene; scenes that count in both.
    Paired,
    /// 100 times the first term over the second.
    Percent,
}

/// Derivation of a number from its parts.
pub struct Derivation {
    /// Rule by which the parts give it, in words.
    pub formula: String,
    pub(super) combine: Combine,
    /// The number before and the one after, where it relates two others.
    pub terms: Vec<Derivation>,
    /// One a repetition of a search.
    pub parts: Vec<Repetition>,
    pub(super) read: Option<LabelRead>,
}

/// Contribution of one repetition of a search.
#[derive(Clone, Debug)]
pub struct Repetition {
    /// Repetitions of one search are averaged before searches are.
    pub search: String,
    /// Place of its run among those that the table was made from.
    pub run: usize,
    /// Its lineage, or `replay/<ego>`.
    pub lineage: String,
    /// Number of the repetition, from 0.
    pub replica: u32,
    /// Programs whose labels are read; where there are two, the first one's number is subtracted from the second one's.
    pub programs: Vec<SolutionId>,
    /// The number of this repetition, computed from its leaves; recorded as a whole where they have none.
    pub value: Option<f64>,
    pub leaves: Vec<Leaf>,
    /// Scenes that its number is the mean of; `None` where it is no such mean.
    pub(super) scenes: Option<PerScene>,
    /// The number as the run's result has it, where its value is worked out again: a table shows this one, so `why` can tell when they part.
    pub(super) sealed: Option<f64>,
    /// Derivation, step by step, of a number that is no sum over leaves.
    pub steps: Vec<String>,
}

/// Lowest level of a derivation: a scene with its labels, a selected run, or a proposal.
#[derive(Clone, Debug)]
pub struct Leaf {
    /// Scene or attempt.
    pub name: String,
    /// Its contribution; `None` where it does not count, or only together with others.
    pub value: Option<f64>,
    /// Programs whose label of this scene is read.
    pub programs: Vec<SolutionId>,
    /// The proposal, where proposals are counted.
    pub attempt: Option<AttemptId>,
    /// Run that balanced selection keeps after a round.
    pub selected: Option<Selected>,
    /// A number that no label holds, in words.
    pub note: Option<String>,
}

/// A run that balanced selection keeps.
#[derive(Clone, Copy, Debug)]
pub struct Selected {
    pub round: u32,
    pub run: SafebenchRun,
}

impl Leaf {
    /// A scene in which labels of these programs are read.
    pub(super) fn scene(name: &str, programs: &[SolutionId], value: Option<f64>) -> Leaf {
        let programs = programs.to_vec();
        Leaf { name: name.to_string(), value, programs, attempt: None, selected: None, note: None }
    }

    /// A proposal.
    pub(super) fn attempt(of: &Attempt, value: Option<f64>) -> Leaf {
        Leaf { attempt: Some(of.id.clone()), ..Leaf::scene(of.id.as_str(), &[], value) }
    }
}

impl Repetition {
    /// Makes a repetition of a place among the runs and a lineage.
    pub(super) fn of(search: String, run: usize, lineage: String, value: Option<f64>, leaves: Vec<Leaf>) -> Repetition {
        let (programs, steps) = (Vec::new(), Vec::new());
        Repetition { search, run, lineage, replica: 0, programs, value, leaves, scenes: None, sealed: None, steps }
    }

    /// Takes the mean over these scenes for its number.
    pub(super) fn over(self, scenes: PerScene) -> Repetition {
        Repetition { value: mean(&scenes), scenes: Some(scenes), ..self }
    }
}

/// The mean over the scenes that count.
fn mean(scenes: &PerScene) -> Option<f64> {
    num::mean(&scenes.values.iter().copied().flatten().collect::<Vec<f64>>())
}

/// Mean over searches of the mean over those repetitions that have a number; `None` where a search has no such repetition.
fn mean_of(quantity: &Quantity) -> Option<f64> {
    let of_search = |search: &Search| num::mean(&search.seeds.iter().filter_map(mean).collect::<Vec<f64>>());
    num::mean(&quantity.iter().map(of_search).collect::<Option<Vec<f64>>>()?)
}

impl Derivation {
    pub(super) fn of(formula: String, combine: Combine, parts: Vec<Repetition>) -> Derivation {
        Derivation { formula, combine, terms: Vec::new(), parts, read: None }
    }

    /// The first of two numbers in per cent of the second.
    pub(super) fn percent(formula: &str, terms: [Derivation; 2]) -> Derivation {
        Derivation { terms: terms.into(), ..Derivation::of(formula.into(), Combine::Percent, Vec::new()) }
    }

    /// The number, from the parts.
    pub fn value(&self) -> Option<f64> {
        match self.combine {
            Combine::Percent => {
                let [part, whole] = [self.terms.first()?.value()?, self.terms.get(1)?.value()?];
                (whole > 0.0).then(|| 100.0 * part / whole)
            }
            Combine::Pooled => {
                let counted: Vec<f64> = self.leaves().filter_map(|(_, leaf)| leaf.value).collect();
                let holds = counted.iter().filter(|value| **value > 0.0).count();
                (!counted.is_empty()).then(|| 100.0 * holds as f64 / counted.len() as f64)
            }
            Combine::MeansOfAll if self.parts.iter().any(|part| part.value.is_none()) => None,
            Combine::Means | Combine::MeansOfAll | Combine::Paired => mean_of(&self.quantity_of(|part| part.value)),
        }
    }

    /// Returns what the number is a mean of and its interval is drawn from: the repetitions of every search, scene by scene or by one number each.
    pub(super) fn quantity(&self) -> Quantity {
        self.quantity_of(|part| part.sealed.or(part.value))
    }

    fn quantity_of(&self, whole: fn(&Repetition) -> Option<f64>) -> Quantity {
        let (before, of) = match self.terms.as_slice() {
            [before, after] if self.combine == Combine::Paired => (Some(before), after),
            _ => (None, self),
        };
        let change = |part: &Repetition, scenes: &PerScene| {
            let Some(before) = before else { return scenes.clone() };
            let other = before.parts.iter().find(|other| other.lineage == part.lineage);
            let other = other.and_then(|other| other.scenes.as_ref()).into_iter().flat_map(|other| &other.values);
            let values = scenes.values.iter().zip(other).map(|(after, before)| Some((*after)? - (*before)?)).collect();
            PerScene { suite: scenes.suite, values }
        };
        let seed = |part: &&Repetition| match &part.scenes {
            Some(scenes) => change(part, scenes),
            // As a suite of one scene.
            None => PerScene { suite: Digest::of_bytes(b"one value"), values: vec![whole(part)] },
        };
        let search = |parts: &Vec<&Repetition>| Search {
            id: Digest::of_bytes(parts[0].search.as_bytes()),
            seeds: parts.iter().map(seed).collect(),
        };
        of.searches().iter().map(search).collect()
    }

    /// Returns `true` if its number varies over scenes, or over the repetitions of a search.
    fn is_drawn(&self) -> bool {
        let scenes = || self.parts.iter().any(|part| part.scenes.is_some());
        let repeated = || self.searches().iter().any(|parts| parts.len() > 1);
        self.combine == Combine::Paired || self.combine == Combine::Means && (scenes() || repeated())
    }

    /// The parts by search, in the order of their first.
    pub fn searches(&self) -> Vec<Vec<&Repetition>> {
        let mut pieces: Vec<Vec<&Repetition>> = Vec::new();
        for part in &self.parts {
            match pieces.iter_mut().find(|of| of[0].search == part.search) {
                Some(of) => of.push(part),
                None => pieces.push(vec![part]),
            }
        }
        pieces
    }

    /// This basis and its terms.
    pub fn all(&self) -> Vec<&Derivation> {
        [self].into_iter().chain(self.terms.iter().flat_map(Derivation::all)).collect()
    }

    /// Every leaf with its part, terms left out.
    pub fn leaves(&self) -> impl Iterator<Item = (&Repetition, &Leaf)> {
        self.parts.iter().flat_map(|part| part.leaves.iter().map(move |leaf| (part, leaf)))
    }

    /// Numbers of a label that this one uses: those that change it when they change. Of a number that is no function of
    /// single labels, those that it is made of.
    pub fn uses(&self, label: &SceneScore) -> Vec<&'static str> {
        let Some(read) = &self.read else { return vec!["attack", "realism", "acted"] };
        let bare = SceneScore { diagnostics: Default::default(), ..label.clone() };
        let own = read(&bare).map(f64::to_bits);
        let moves = |other: SceneScore| read(&other).map(f64::to_bits) != own;
        let at = |x: f64| [0.0, 0.25, 0.75].into_iter().filter(move |probe| *probe != x);
        let mut used = Vec::new();
        if at(label.attack).any(|attack| moves(SceneScore { attack, ..bare.clone() })) {
            used.push("attack");
        }
        if at(label.realism).any(|realism| moves(SceneScore { realism, ..bare.clone() })) {
            used.push("realism");
        }
        if moves(SceneScore { acted: !label.acted, ..bare.clone() }) {
            used.push("acted");
        }
        if contacts(label).into_iter().any(|contact| moves(SceneScore { contact, ..bare.clone() })) {
            used.push("contact");
        }
        used
    }
}

/// The numbers of these derivations with their intervals, all from the same draws.
pub(super) fn estimates(of: &[Option<Derivation>]) -> Vec<Option<Estimate>> {
    let drawn = |one: &Option<Derivation>| one.as_ref().filter(|of| of.is_drawn()).map(Derivation::quantity);
    let quantities: Vec<Quantity> = of.iter().map(|one| drawn(one).unwrap_or_default()).collect();
    let plain = |one: &Option<Derivation>| match one.as_ref()? {
        one if one.combine == Combine::Means => mean_of(&one.quantity()),
        one => one.value(),
    };
    bootstrap::estimates(&quantities)
        .into_iter()
        .zip(of)
        .map(|(drawn, one)| drawn.or_else(|| plain(one).map(Estimate::plain)))
        .collect()
}

/// Other contacts than the label's: none, and one of every class that says everything.
fn contacts(label: &SceneScore) -> Vec<Option<Met>> {
    let of = |class: crate::evaluation::ContactClass| {
        let class = class.name().to_string();
        let met = |adversary, anyway| Met {
            adversary,
            class: class.clone(),
            avoidable: Some(true),
            fault: None,
            avoided_by: None,
            anyway,
        };
        [met(true, false), met(true, true), met(false, false)]
    };
    let all = crate::evaluation::ContactClass::ALL.into_iter().flat_map(of).map(Some);
    [None].into_iter().chain(all).filter(|contact| *contact != label.contact).collect()
}
