//! The acceptor's judgement: what the archive says of each labelled candidate, in slot order, and who leads from now on.
//! Works on copies; the state changes in `settle` alone.

use std::collections::{BTreeMap, BTreeSet};

use super::race::race;
use super::shuffled::Swapped;
use super::{groups, rival, search};
use crate::archive::search::SearchState;
use crate::archive::{self, Archive, Contender, Leaders, promote};
use crate::epoch::RunError;
use crate::epoch::freeze::{Parent, Snapshot};
use crate::epoch::labelling::labels::Labelling;
use crate::epoch::labelling::measure::measure;
use crate::epoch::labelling::standings::{Standing, Standings};
use crate::epoch::setting::desk::Tools;
use crate::epoch::setting::study::Study;
use crate::epoch::slots::draft::{Considered, Draft, Reached, RoutedCandidate};
use crate::kernel::Digest;
use crate::objects::entry::diagnostics_mean;
use crate::objects::{
    AcceptanceGates, AcceptanceRequirement, Attempt, AttemptId, Candidate, Challenge, ChallengeVerdict, Decision,
    Entry, Exit, FrontOf, HashedProgram, Objectives, Program, Race, SceneScore, Score, Slot, SolutionId, WorldLabel,
};
use crate::sim::SIM_VERSION;

/// An epoch's attempts and what they add, not yet part of the state.
pub struct EpochVerdicts {
    pub attempts: Vec<Attempt>,
    pub archive: Archive,
    pub labels: Vec<WorldLabel>,
    /// Parents, front and accepted children with their labels.
    pub standing: Standings,
    /// Programs that lead from now on; `None` where the leaders stay the same.
    pub leaders: Option<Leaders>,
    /// Memory of a search method other than the archive's own.
    pub search: Option<SearchState>,
    /// Under shuffled labels: the labels by which each slot's candidate is judged.
    pub swapped: Swapped,
    /// Requests of the rollouts that set free constants of the epoch's patches.
    pub tuning: BTreeSet<Digest>,
    /// Looks at children of earlier epochs.
    pub challenges: Vec<Challenge>,
}

impl EpochVerdicts {
    /// The archive as the epoch found it, and nothing judged yet.
    pub fn before(snapshot: &Snapshot<'_>) -> EpochVerdicts {
        let (archive, standing) = (snapshot.archive.clone(), snapshot.standing.clone());
        let search = snapshot.search.clone();
        let swapped = Swapped::new();
        let challenges = snapshot.challenges.iter().map(|(challenge, _)| challenge.clone()).collect();
        EpochVerdicts {
            attempts: Vec::new(),
            archive,
            labels: Vec::new(),
            standing,
            leaders: None,
            search,
            swapped,
            tuning: BTreeSet::new(),
            challenges,
        }
    }

    /// Decides who leads, and writes what the epoch as a whole decided into its attempts, before they are sealed.
    pub fn decide(&mut self, study: &Study, snapshot: &Snapshot<'_>, tools: &Tools<'_>) -> Result<(), RunError> {
        let contender = |solution: &SolutionId| {
            let score = &self.standing.get(solution)?.so_far;
            Some(Contender { solution: solution.clone(), objectives: score.objectives, coverage: score.coverage })
        };
        let late = |solution: &SolutionId| snapshot.challenges.iter().any(|(of, _)| of.solution == *solution);
        let front = snapshot.archive.front().filter(|entry| !late(&entry.solution));
        let front: Vec<Contender> = front.filter_map(|entry| contender(&entry.solution)).collect();
        let parents: Vec<Contender> =
            snapshot.parents.iter().filter_map(|parent| contender(&parent.program.solution_id)).collect();
        let judged_by = |attempt: &Attempt| {
            let own = contender(accepted(attempt)?)?;
            let swapped = self.swapped.get(&attempt.slot).map(|(_, score)| (score.objectives, score.coverage));
            let (objectives, coverage) = swapped.unwrap_or((own.objectives, own.coverage));
            Some(Contender { objectives, coverage, ..own })
        };
        // Children of earlier epochs that this one accepted stand first in line.
        let shown = snapshot.challenges.iter().filter(|(of, _)| of.verdict == ChallengeVerdict::Accepted);
        let shown = shown.filter_map(|(of, _)| contender(&of.solution));
        let mut accepted: Vec<Contender> = shown.chain(self.attempts.iter().filter_map(judged_by)).collect();
        let options = &study.archive;
        let mut races: Vec<(SolutionId, Race)> = Vec::new();
        self.leaders = match study.rival() {
            Some(rival) => search::lead(rival, &parents, &accepted),
            None => loop {
                let must_act = options.requires.has(AcceptanceRequirement::Acts);
                let led = promote(options.promotion, &front, &parents, &accepted, options.reference, must_act);
                // Where labels are shuffled, a race would see the true ones.
                let level = options.race.filter(|_| self.swapped.is_empty());
                let (Some(leaders), Some(level)) = (&led, level) else { break led };
                let Some((parent, child)) = self.raced(snapshot, &leaders.active)? else { break led };
                let race = race(study, snapshot, parent, child, level, tools)?;
                let shown = race.shown;
                races.push((leaders.active.clone(), race));
                if shown {
                    break led;
                }
                // The next one in line, until one shows its gain.
                accepted.retain(|child| child.solution != leaders.active);
            },
        };
        for attempt in &mut self.attempts {
            let Exit::Evaluated { candidate, decision, .. } = &mut attempt.exit else { continue };
            let solution = &candidate.program.solution_id;
            decision.on_front = self.archive.on_front(solution);
            decision.promoted = self.leaders.as_ref().is_some_and(|led| led.names(solution));
            decision.race = races.iter().find(|(raced, _)| raced == solution).map(|(_, race)| race.clone());
        }
        for challenge in &mut self.challenges {
            challenge.race = races.iter().find(|(raced, _)| *raced == challenge.solution).map(|(_, race)| race.clone());
        }
        Ok(())
    }

    /// The epoch's labelled child of this name, or the challenger, with the program that it races against.
    fn raced<'s>(
        &'s self,
        snapshot: &'s Snapshot<'_>,
        solution: &SolutionId,
    ) -> Result<Option<(&'s Parent, HashedProgram<'s>)>, RunError> {
        if let Some((_, program)) = snapshot.challenges.iter().find(|(of, _)| of.solution == *solution) {
            return Ok(Some((&snapshot.parents[0], program.hashed()?)));
        }
        let mut of = self.attempts.iter().filter_map(|attempt| Some((attempt.slot, attempt.exit.candidate()?)));
        let child = of.find(|(_, candidate)| candidate.program.solution_id == *solution);
        Ok(child.map(|(slot, candidate)| (snapshot.parent_of(slot), candidate.hashed())))
    }
}

/// The program of an accepted attempt.
fn accepted(attempt: &Attempt) -> Option<&SolutionId> {
    let (candidate, decision) = (attempt.exit.candidate()?, attempt.exit.decision()?);
    decision.gates.any().then_some(&candidate.program.solution_id)
}

/// The exit of a draft. A labelled candidate meets the archive's gates as the slots before it left the front.
pub fn consider(
    study: &Study,
    snapshot: &Snapshot<'_>,
    draft: Draft,
    judged: &mut EpochVerdicts,
    tools: &Tools<'_>,
) -> Result<Considered, RunError> {
    let Draft { mut head, reached } = draft;
    judged.tuning.append(&mut head.tuning);
    let exit = match reached {
        Reached::Declined { reason } => Exit::Declined { reason },
        Reached::Invalid { gates } => Exit::Invalid { gates },
        Reached::Routed { gates, routed } => {
            Exit::Rejected { gates, candidate: Box::new(routed.candidate), route: routed.route }
        }
        Reached::Evaluated { gates, routed, score } => {
            let id = AttemptId::at(&snapshot.spec.id, snapshot.event.epoch, head.slot);
            let decision = accept(study, snapshot, head.slot, &routed.candidate, &score, judged, tools)?;
            judged.labels.push(world_label(snapshot, &id, &routed, &score, decision.gates.any()));
            let RoutedCandidate { candidate, route, .. } = *routed;
            Exit::Evaluated { gates, candidate: Box::new(candidate), route, score, decision }
        }
        Reached::Proposed { .. } | Reached::Admitted { .. } | Reached::Predicted { .. } => {
            unreachable!("a worker hands on what ended or was routed")
        }
    };
    Ok(Considered { head, exit })
}

/// Asks a plan for the labels on earlier windows that a draft will need, as far as that can be told before the slots ahead of it
/// are judged; does nothing where no plan is made.
pub fn request_earlier_labels(
    study: &Study,
    snapshot: &Snapshot<'_>,
    draft: &Draft,
    judged: &EpochVerdicts,
    tools: &Tools<'_>,
) -> Result<(), RunError> {
    let Reached::Routed { routed, .. } = &draft.reached else { return Ok(()) };
    if tools.wanted.is_none() || routed.is_rejected() || !judged.swapped.is_empty() {
        return Ok(());
    }
    let labelling = Labelling { study, spec: snapshot.spec, counsels: &snapshot.counsels, tools };
    let subject = routed.candidate.hashed();
    // The labels on the window were asked for; without them there is no more to tell.
    let Ok(score) = labelling.score(subject, &snapshot.window) else { return Ok(()) };
    let parent = &snapshot.parent_of(draft.head.slot).program.solution_id;
    if compared(study, judged, parent, &score, tools, |standing| &standing.window)?.any() {
        labelling.want(subject, &snapshot.so_far)?;
    }
    Ok(())
}

/// Compares a candidate with its parent and the front: first on the window, and where it holds there, on the scenes of all
/// windows so far, which decide; on the window alone where the archive judges on that. Who is accepted, or evaluated where the front is of
/// all, stands on the front from then on.
fn accept(
    study: &Study,
    snapshot: &Snapshot<'_>,
    slot: u32,
    candidate: &Candidate,
    window: &Score,
    judged: &mut EpochVerdicts,
    tools: &Tools<'_>,
) -> Result<Decision, RunError> {
    let parent = &snapshot.parent_of(slot).program.solution_id;
    let swapped = judged.swapped.get(&slot).cloned();
    let judged_by = swapped.as_ref().map_or(window, |(_, score)| score);
    let mut gates = compared(study, judged, parent, judged_by, tools, |standing| &standing.window)?;
    gates.labels_of = swapped.as_ref().map(|(solution, _)| solution.clone());
    gates.method = rival::verdict(study, snapshot, slot, candidate, window, &gates, &mut judged.search);
    gates.parent_tradeoff.holds &= !study.without.tradeoff;
    gates.groups = groups::accepted_in(study, &judged.archive, &judged.standing, parent, judged_by, tools)?;
    let mut score = window.clone();
    if gates.any() && snapshot.so_far.len() > snapshot.window.len() {
        let labelling = Labelling { study, spec: snapshot.spec, counsels: &snapshot.counsels, tools };
        score = labelling.score(candidate.hashed(), &snapshot.so_far)?;
        if swapped.is_none() {
            gates = compared(study, judged, parent, &score, tools, |standing| &standing.so_far)?;
            gates.parent_tradeoff.holds &= !study.without.tradeoff;
        }
    }
    let accepted = gates.any();
    let scenes = study.scenes_digest(if accepted { &snapshot.so_far } else { &snapshot.window })?;
    let entry = Entry {
        attempt: Some(AttemptId::at(&snapshot.spec.id, snapshot.event.epoch, slot)),
        gates: Some(AcceptanceGates::clone(&gates)),
        mechanism_tags: candidate.mechanism_tags.clone(),
        ..entry(snapshot, &candidate.program, candidate.program_hash, &score, scenes)
    };
    let solution = candidate.program.solution_id.clone();
    if let Some(accepted) = &gates.groups {
        groups::enter(study, &mut judged.archive, &solution, accepted);
        judged.standing.insert(solution.clone(), Standing { window: window.clone(), so_far: score.clone() });
    }
    if !accepted && study.archive.front == FrontOf::Accepted {
        judged.archive.keep(entry)?;
        return Ok(Decision { promoted: false, on_front: false, gates, race: None });
    }
    judged.standing.insert(solution, Standing { window: window.clone(), so_far: score });
    let on_front = judged.archive.insert(entry)?.on_front;
    Ok(Decision { promoted: false, on_front, gates, race: None })
}

/// Asks the gates about a score beside the parent's and the front's on the same scenes.
fn compared(
    study: &Study,
    judged: &EpochVerdicts,
    parent: &SolutionId,
    child: &Score,
    tools: &Tools<'_>,
    on: impl Fn(&Standing) -> &Score,
) -> Result<Box<AcceptanceGates>, RunError> {
    let standing = |solution: &SolutionId| judged.standing.get(solution).map(&on);
    let parent = standing(parent).ok_or_else(|| {
        RunError::Study(format!("the labels of parent {parent} are missing from its epoch's snapshot"))
    })?;
    let front: Vec<&Score> = judged.archive.front().filter_map(|entry| standing(&entry.solution)).collect();
    let standing = archive::Standing { child, parent, front: &front };
    let measure = measure(study, &[&[child, parent], front.as_slice()].concat(), tools)?;
    Ok(Box::new(archive::consider(&standing, &study.archive, &*measure)?))
}

/// Returns what the world evaluator will learn from a labelled candidate: its labels on the window.
fn world_label(
    snapshot: &Snapshot<'_>,
    id: &AttemptId,
    routed: &RoutedCandidate,
    score: &Score,
    accepted: bool,
) -> WorldLabel {
    WorldLabel {
        attempt: id.clone(),
        solution: routed.candidate.program.solution_id.clone(),
        epoch: snapshot.event.epoch,
        row: routed.row.clone(),
        labels: score.objectives,
        diagnostics: diagnostics_mean(score),
        decision: routed.route.decision,
        predicted: routed.route.predicted,
        accepted,
        pairs: if routed.row.pairs.is_empty() { Vec::new() } else { pair_labels(snapshot, score) },
    }
}

/// A candidate's labels scene of the window by scene.
fn pair_labels(snapshot: &Snapshot<'_>, score: &Score) -> Vec<Option<Objectives>> {
    let labels: BTreeMap<&str, &SceneScore> = score.scenes.iter().map(|of| (of.scene.as_str(), of)).collect();
    let of = |scene: &String| {
        let label = labels.get(scene.as_str())?;
        Some(Objectives { attack: label.attack, realism: label.realism })
    };
    snapshot.event.window.iter().map(of).collect()
}

/// The archive's entry of a program labelled on scenes whose list has the digest `scenes`.
fn entry(snapshot: &Snapshot<'_>, program: &Program, program_hash: Digest, score: &Score, scenes: Digest) -> Entry {
    Entry {
        solution: program.solution_id.clone(),
        attempt: None,
        program_hash,
        family: program.source_family.clone(),
        ego: snapshot.spec.ego_label(),
        lineage: snapshot.spec.id.clone(),
        epoch: snapshot.event.epoch,
        objectives: score.objectives,
        diagnostics: diagnostics_mean(score),
        scenes,
        sim_version: SIM_VERSION,
        operators: operators(program),
        mechanism_tags: crate::memory::tags_of(program),
        gates: None,
    }
}

/// Operator kinds in slot order.
fn operators(program: &Program) -> Vec<String> {
    let in_slot = |slot: Slot| program.operator_graph.values().filter(move |node| node.slot == slot);
    Slot::ALL.into_iter().flat_map(in_slot).map(|node| node.kind.clone()).collect()
}

/// The entry with which a lineage's archive begins: its parent on the first window.
pub fn parent_entry(study: &Study, snapshot: &Snapshot<'_>) -> Result<Entry, RunError> {
    let parent = &snapshot.parents[0];
    let scenes = study.scenes_digest(&snapshot.window)?;
    Ok(entry(snapshot, &parent.program, parent.hash, &parent.score, scenes))
}
