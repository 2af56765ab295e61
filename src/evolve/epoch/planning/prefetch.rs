//! Simulates ahead of the run. A recorded proposal says which program it edits and how, so its child can be compiled and simulated
//! before the run reaches it, beside other work. If the run goes on as it was recorded, it needs exactly these labels; a label that
//! it does not need costs time and changes nothing.

use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};

use serde::de::DeserializeOwned;

use crate::agents::reply;
use crate::candidates::{self, Trials};
use crate::epoch::RunError;
use crate::epoch::briefs::counsels::Counsels;
use crate::epoch::briefs::in_effect::in_effect;
use crate::epoch::labelling::labels::Labelling;
use crate::epoch::setting::desk::Tools;
use crate::epoch::setting::study::{LineageSpec, Study};
use crate::epoch::slots::probes::probes;
use crate::kernel::Digest;
use crate::llm::{Cassette, Recorded};
use crate::objects::event::{ParentAdopted, kind};
use crate::objects::{
    Advice, AttemptId, Counselled, HashedProgram, LineageId, Program, ProgramPatch, Role, SolutionId,
};
use crate::store::Event;

/// Asks the plan for trials and labels of the programs that a lineage starts with and of those that recorded answers
/// propose. `events` are those of the walk: parents and counsel.
pub fn prefetch(study: &Study, events: &[Event], recorded: &Cassette, tools: &Tools<'_>) -> Result<(), RunError> {
    let parents: Vec<ParentAdopted> = bodies(events, kind::PARENT);
    let counsels = Counsels::recorded(&bodies::<Counselled>(events, kind::COUNSEL));
    for spec in &study.lineages {
        let Some(adopted) = parents.iter().find(|adopted| adopted.lineage == spec.id) else { continue };
        let ahead = Ahead { study, spec, counsels: &counsels, tools };
        let patches = approved(recorded, &spec.id, study);
        ahead.lineage(HashedProgram { program: &adopted.program, hash: adopted.program_hash }, &patches)?;
    }
    Ok(())
}

fn bodies<T: DeserializeOwned>(events: &[Event], wanted: &str) -> Vec<T> {
    let of = events.iter().filter(|event| event.kind == wanted);
    of.filter_map(|event| serde_json::from_value(event.body.clone()).ok()).collect()
}

/// Recorded answers of one slot by role and round: two where a critic was asked again.
type Talk<'a> = BTreeMap<(&'a str, u32), Vec<&'a Recorded>>;

/// The patches on which all critics agreed who gave a readable review, by epoch and slot.
fn approved(recorded: &Cassette, lineage: &LineageId, study: &Study) -> Vec<(u32, u32, ProgramPatch)> {
    let mut talks: BTreeMap<(u32, u32), Talk<'_>> = BTreeMap::new();
    for exchange in recorded.exchanges().iter().filter(|exchange| exchange.slot.lineage == lineage.as_str()) {
        let slot = &exchange.slot;
        let talk = talks.entry((slot.epoch, slot.slot)).or_default();
        talk.entry((slot.role.as_str(), slot.round)).or_default().push(exchange);
    }
    let agreed = |(&(epoch, slot), talk): (&(u32, u32), &Talk<'_>)| Some((epoch, slot, last_patch(talk, study)?));
    talks.iter().filter_map(agreed).collect()
}

/// The patch of the last round, if it was approved. One with free constants is none yet: its child is known when these are set.
fn last_patch(talk: &Talk<'_>, study: &Study) -> Option<ProgramPatch> {
    let opened = |role: Role, answer: &'_ Recorded| match study.models.get(&role) {
        Some(model) => model.drawn(&answer.slot).opened(&answer.bytes).0.to_vec(),
        None => answer.bytes.clone(),
    };
    let of = |role: Role, round: u32| talk.get(&(role.name(), round)).map(Vec::as_slice).unwrap_or_default();
    let last = talk.keys().filter(|(role, _)| *role == Role::Repair.name()).map(|(_, round)| *round).max().unwrap_or(0);
    let role = if last == 0 { Role::Actor } else { Role::Repair };
    let patch = of(role, last).iter().find_map(|answer| reply::patch(&opened(role, answer), role).ok())?;
    let approves = |critic: Role| {
        let answers = of(critic, last);
        let review = answers.iter().find_map(|answer| reply::review(&opened(critic, answer), critic).ok());
        // A critic that was asked and gave no readable review abstains.
        !answers.is_empty() && review.is_none_or(|review| review.decision == Advice::Approve)
    };
    study.critics().iter().all(|critic| approves(*critic)).then_some(patch)
}

/// One lineage ahead of the run.
struct Ahead<'a> {
    study: &'a Study,
    spec: &'a LineageSpec,
    counsels: &'a Counsels,
    tools: &'a Tools<'a>,
}

/// Programs by the hash that patches name their parent with.
type Known = BTreeMap<String, (Program, Digest)>;

/// The child, where the compile gate was come to, and what kept it from being tried.
type Tried = (Option<(Program, Digest)>, Option<RunError>);

impl Ahead<'_> {
    fn lineage(&self, first: HashedProgram<'_>, patches: &[(u32, u32, ProgramPatch)]) -> Result<(), RunError> {
        let study = self.study;
        // The run labels its parents everywhere, whatever comes of the proposals.
        self.want(first, &study.evolution)?;
        self.want(first, &study.selection)?;
        self.want(first, &study.held_out)?;
        let mut known = Known::from([(first.hash.to_hex(), (first.program.clone(), first.hash))]);
        for (epoch, slot, patch) in patches {
            let Some((parent, hash)) = known.get(&patch.parent_program_hash).cloned() else { continue };
            // Whoever is edited leads: labelled on all windows so far, and a finalist unless the budget cuts it.
            let parent = HashedProgram { program: &parent, hash };
            self.want(parent, &study.evolution)?;
            if let Some((child, hash)) = self.proposal(*epoch, *slot, patch, parent)? {
                known.insert(hash.to_hex(), (child, hash));
            }
        }
        Ok(())
    }

    /// Judges a patch by the gates as the run will, and asks for what the compile gate or, where it is passed, the labels
    /// miss. The child, where there is one.
    fn proposal(
        &self,
        epoch: u32,
        slot: u32,
        patch: &ProgramPatch,
        parent: HashedProgram<'_>,
    ) -> Result<Option<(Program, Digest)>, RunError> {
        let Ahead { study, spec, counsels, tools } = *self;
        let labelling = Labelling { study, spec, counsels, tools };
        let window = study.window(epoch);
        if self.open(&window).len() < window.len() {
            return Ok(None);
        }
        let trials_met: Mutex<Tried> = Mutex::default();
        let tried = |program: &Program, hash: Digest| {
            let own = in_effect(study, spec, program, &window)?;
            let before = in_effect(study, spec, parent.program, &window)?;
            let own = own.as_ref().ok().filter(|_| before.is_ok());
            let before = before.unwrap_or_default();
            let probes = probes(&window, study.budget.probe_scenes, program, own, parent.program, &before);
            labelling.trials(&probes, HashedProgram { program, hash }, parent)
        };
        let compiles = |program: &Program, hash: Digest| {
            let trials = tried(program, hash);
            let mut trials_met = trials_met.lock().unwrap_or_else(PoisonError::into_inner);
            trials_met.0 = Some((program.clone(), hash));
            trials.unwrap_or_else(|error| {
                trials_met.1 = Some(error);
                Trials::default()
            })
        };
        let child = SolutionId::new(AttemptId::at(&spec.id, epoch, slot).0);
        let contract = &study.source(spec)?.contract;
        let admission = candidates::admit(parent.program, patch, child, &study.judging(contract), &compiles);
        let (child, trouble) = trials_met.into_inner().unwrap_or_else(PoisonError::into_inner);
        match trouble {
            None => {}
            // Whether it has labels at all is known when its trials are.
            Some(RunError::Wanting) => return Ok(child),
            Some(error) => return Err(error),
        }
        if let Some(candidate) = &admission.candidate {
            self.want(candidate.hashed(), &window)?;
        }
        Ok(child)
    }

    /// Labels on those of the scenes that are open to the lineage.
    fn want(&self, subject: HashedProgram<'_>, places: &[usize]) -> Result<(), RunError> {
        let Ahead { study, spec, counsels, tools } = *self;
        Labelling { study, spec, counsels, tools }.want(subject, &self.open(places)).map(drop)
    }

    /// The scenes for which counsel was taken, or all where the family takes none.
    fn open(&self, places: &[usize]) -> Vec<usize> {
        places.iter().copied().filter(|&place| self.counsels.at(self.study, self.spec, place).is_ok()).collect()
    }
}
