//! A scene's way through the operator graph: select, actor, timing, motion, search and filters, choice.

use super::{CompileFailure, Compiled, Decision, FilterReport, Prepared, actors, choice, constraints, filters, timing};
use crate::motion::Candidate;
use crate::objects::Slot;
use crate::scene::TrackIx;
use crate::sim::{Action, Intervention};
use crate::stage::{Part, Settings, Situation, Source, Stage, StageError};

/// What has been decided so far.
#[derive(Default)]
struct State {
    actors: Vec<TrackIx>,
    parts: Vec<Part>,
    chosen: Vec<usize>,
    decision: Decision,
}

/// Why a scene is left alone; empty string = go on.
type Stop = Option<String>;

pub(super) fn walk(prepared: &Prepared<'_>, stage: &Stage<'_>) -> Result<Compiled, CompileFailure> {
    let rules = prepared.rules(&stage.situation.scene_values);
    let parameters = prepared.parameters(&rules);
    let mut state = State::default();
    state.decision.mode = rules.iter().map(|rule| prepared.rule_name(*rule).to_string()).collect();
    for (name, node) in prepared.nodes() {
        let settings = prepared.settings(name, node, &rules, &parameters, &stage.situation.scene_values);
        let failed = |source| CompileFailure::Node { node: name.to_string(), source };
        let stop =
            step(prepared.source(), stage, name, node.slot, &node.kind, &settings, &mut state).map_err(failed)?;
        if let Some(reason) = stop {
            state.decision.reason = reason;
            return Ok(Compiled { decision: state.decision, intervention: Intervention::default() });
        }
    }
    finish(prepared, stage, state)
}

fn step(
    source: &Source,
    stage: &Stage<'_>,
    name: &str,
    slot: Slot,
    kind: &str,
    settings: &Settings,
    state: &mut State,
) -> Result<Stop, StageError> {
    let nothing = |empty: bool, reason: &str| empty.then(|| format!("{name}: {reason}"));
    Ok(match slot {
        Slot::Select => {
            let shut = kind == "gated_scenes" && !settings.module("gate")?.boolean(vec![]);
            nothing(shut, "the gate does not hold")
        }
        Slot::Actor => {
            state.actors = actors::select(source, stage, kind, settings)?;
            nothing(state.actors.is_empty(), "no vehicle is eligible")
        }
        Slot::Timing => {
            for actor in &state.actors {
                let window = timing::window(stage.situation, *actor, kind, settings)?;
                let part = |window| Part { actor: *actor, window, candidates: vec![], offsets: None, driven: None };
                state.parts.extend(window.map(part));
            }
            nothing(state.parts.is_empty(), "no window of a second fits into the scene and the actor's log")
        }
        Slot::Motion | Slot::Search => {
            let run = source.operators.get(kind).ok_or_else(|| StageError::Missing(format!("operator {kind}")))?;
            run(stage, settings, &mut state.parts)?;
            state.parts.retain(|part| !part.candidates.is_empty());
            nothing(state.parts.is_empty(), "no candidate")
        }
        Slot::Filter => {
            let before = state.parts.iter().map(|part| part.candidates.len()).sum();
            let violation = filters::apply(stage.situation, kind, settings, &mut state.parts)?;
            state.parts.retain(|part| !part.candidates.is_empty());
            let after = state.parts.iter().map(|part| part.candidates.len()).sum();
            state.decision.filters.push(FilterReport { node: name.to_string(), before, after, violation });
            nothing(state.parts.is_empty(), "no candidate passes")
        }
        Slot::Diversity => {
            state.chosen = choice::choose(stage, kind, settings, &state.parts)?;
            None
        }
    })
}

fn finish(prepared: &Prepared<'_>, stage: &Stage<'_>, state: State) -> Result<Compiled, CompileFailure> {
    let mut decision = state.decision;
    let mut actions = Vec::with_capacity(state.parts.len());
    for (part, chosen) in state.parts.iter().zip(&state.chosen) {
        let candidate = &part.candidates[*chosen];
        constraints::check(stage.situation, part, candidate, prepared.constraints())?;
        decision.actors.push(choice::report(stage.situation, part, *chosen));
        match &candidate.scripted {
            Some(scripted) => actions.extend_from_slice(&scripted.actions),
            None => actions.push(action(stage.situation, part, candidate)),
        }
    }
    decision.applies = true;
    Ok(Compiled { decision, intervention: Intervention { actions } })
}

/// What the simulator is asked to do for one adversary.
fn action(situation: &Situation, part: &Part, candidate: &Candidate) -> Action {
    let (track, from_step, samples) = (part.actor, part.window.from_step, candidate.samples.clone());
    if let Some(guest) = situation.as_guest(track) {
        let (kind, length_m, width_m) = (guest.kind, guest.length_m, guest.width_m);
        return Action::Insert { kind, length_m, width_m, from_step, samples };
    }
    match candidate.handover_step {
        Some(step) => {
            let handover_step = step.clamp(from_step, from_step + samples.len().saturating_sub(1));
            Action::FollowThenReact { track, from_step, samples, handover_step }
        }
        None => Action::Follow { track, from_step, samples },
    }
}
