//! Counsel for the scenes of a lineage whose family takes it: the attacker agent is asked before the first program meets a
//! scene, held-out scenes included only when the suite is opened.
//!
//! ```text
//! show vehicles → propose attackers → try in the simulator → reflect, propose again … → counsel
//!   families          agents            compiler, sim            agents               transcript
//! ```
//!
//! A family takes counsel where its source's `asks.counsel` says so; LLM-Attacker does. The agent is shown the ego's undisturbed
//! drive second by second and, of each vehicle, when it and the ego come to the first place that both ways touch. Each set that it
//! names is carried out by the lineage's parent without a search of its own, and the agent is told what became of it (contact, never
//! close, late, early, ego yielded, blocked), as often as `[counsel]` allows. The set that met the ego, or came nearest, is the
//! scene's counsel: an input of every compilation of that lineage for that scene, part of its key, and an event of the run. An answer
//! that cannot be used is recorded with its reason, and the rules' own next proposal is tried in its place. A program says how far it
//! trusts counsel (`counsel_weight`), so compiling stays a pure function and trust can be evolved.

use std::collections::BTreeSet;

use super::briefing;
use super::counsels::Counsels;
use crate::agents::{self, AgentError, counsel::Case};
use crate::backend::NoOutcome;
use crate::compiler::{Decision, Prepared, Situation};
use crate::epoch::RunError;
use crate::epoch::labelling::labels::Labelling;
use crate::epoch::setting::desk::{Desk, Tools};
use crate::epoch::setting::options::CounselOptions;
use crate::epoch::setting::progress::Progress;
use crate::epoch::setting::study::{LineageSpec, Study};
use crate::evaluation::{EvaluationError, RolloutCache};
use crate::kernel::{Digest, Pose};
use crate::llm::ModelSpec;
use crate::objects::{
    Counsel, Counselled, HashedProgram, Program, Role,
    counsel::{EgoPlace, Trial, Vehicle},
    event::kind,
};
use crate::scene::{DT_S, Sample, TrackIx};
use crate::sim::Action;
use crate::stage::{AskCounsel, Stage};

/// Asks about the scenes at these places, in parallel; events and `counsels` follow in their order. Does nothing for
/// families that take no counsel.
pub fn take(
    study: &Study,
    spec: &LineageSpec,
    places: &[usize],
    counsels: &mut Counsels,
    desk: &mut Desk<'_>,
) -> Result<(), RunError> {
    let source = study.source(spec)?;
    let Some(asks) = source.asks.counsel else { return Ok(()) };
    let parent = study.parent(spec)?;
    let blind = (asks.blind)(&parent);
    let prepared = Prepared::new(&blind, source).map_err(|error| unfit(spec, &error))?;
    let options = study.counsel.ok_or_else(|| RunError::Study("the experiment has no table [counsel]".into()))?;
    let model = study.models.get(&Role::AttackerAgent);
    let model = model.ok_or(AgentError::NoModel { role: Role::AttackerAgent.name() })?;
    let rehearsal = Rehearsal {
        study,
        spec,
        asks,
        parent: &parent,
        blind: &blind,
        prepared: &prepared,
        options,
        model,
        tools: &desk.tools,
    };
    let mut met = 0;
    for event in desk.tools.ask_all(places, |_, &place| rehearsal.about(place)) {
        let event = event?;
        met += usize::from(event.chosen().is_some_and(|round| round.trial == Trial::Contact));
        desk.log.append(kind::COUNSEL, &event)?;
        counsels.keep(&event);
    }
    desk.tools.rollouts.flush()?;
    (desk.watch)(Progress::Counselled { lineage: spec.id.to_string(), scenes: places.len(), met });
    Ok(())
}

fn unfit(spec: &LineageSpec, error: &dyn std::fmt::Display) -> RunError {
    RunError::Study(format!("lineage {}: its parent: {error}", spec.id))
}

/// A rehearsal of proposals: the parent without a search of its own carries them out against the lineage's ego.
struct Rehearsal<'a> {
    study: &'a Study,
    spec: &'a LineageSpec,
    asks: AskCounsel,
    parent: &'a Program,
    /// The parent without a search of its own, and the same prepared.
    blind: &'a Program,
    prepared: &'a Prepared<'a>,
    options: CounselOptions,
    model: &'a ModelSpec,
    tools: &'a Tools<'a>,
}

impl Rehearsal<'_> {
    /// Asks about one scene. Where the ego cannot drive it, nobody can be shown; its labels fail and say why.
    fn about(&self, place: usize) -> Result<Counselled, RunError> {
        let entry = &self.study.scenes[place];
        let situation = match self.tools.situations.at(place, &self.spec.ego, &self.tools.backend) {
            Ok(situation) => Some(situation),
            Err(NoOutcome::Scene(_)) => None,
            Err(NoOutcome::Stop(error)) => return Err(EvaluationError::from(error).into()),
        };
        let vehicles = situation.as_deref().map(|situation| self.vehicles(place, situation)).transpose()?;
        let attackers_max = (self.asks.attackers_max)(self.parent);
        let case = Case {
            lineage: &self.spec.id,
            scene: &entry.scene().id,
            slot: u32::try_from(place).unwrap_or(u32::MAX),
            ego: &briefing::ego_sentence(self.study, self.spec),
            drive: &situation.as_deref().map(drive).unwrap_or_default(),
            vehicles: &vehicles.unwrap_or_default(),
            attackers_max: attackers_max.map_err(|error| unfit(self.spec, &error))?,
            rounds: self.options.rounds,
            model: self.model,
        };
        let tried = |counsel: &Counsel| match situation.as_deref() {
            Some(situation) => self.tried(place, situation, counsel),
            None => Ok(Trial::Refused { reason: "the ego cannot drive this scene".into() }),
        };
        let advice = agents::counsel::counsel(&case, &self.tools.asking(&self.spec.id), &tried)?;
        Ok(Counselled {
            lineage: self.spec.id.clone(),
            scene: entry.scene().id.clone(),
            program: self.prepared.hash(),
            digest: advice.counsel.digest()?,
            exchanges: advice.exchanges,
            rounds: advice.rounds,
            counsel: advice.counsel,
        })
    }

    /// Lineages that differ in their draws alone are shown the same vehicles.
    fn vehicles(&self, place: usize, situation: &Situation) -> Result<Vec<Vehicle>, RunError> {
        let key = (place as u64, self.spec.ego.digest(), self.parent.hash()?, self.options.vehicles as u64);
        let rank = || {
            let stage = Stage { situation, seed: self.study.seed, counsel: None };
            (self.asks.vehicles)(&stage, self.parent, self.options.vehicles).map_err(|error| error.to_string())
        };
        let shown = self.tools.counselled.of(Digest::of("evodrive/counsel-vehicles/1", &key)?, rank);
        shown.map_err(|error| unfit(self.spec, &error))
    }

    /// Carries a proposal out. Its rollout is a record like every other.
    fn tried(&self, place: usize, situation: &Situation, counsel: &Counsel) -> Result<Trial, RunError> {
        let (study, spec) = (self.study, self.spec);
        // Nothing else was counselled yet that this rollout could depend on.
        let nobody = Counsels::default();
        let labelling = Labelling { study, spec, counsels: &nobody, tools: self.tools };
        let hash = self.prepared.hash();
        let blind = HashedProgram { program: self.blind, hash };
        if labelling.want_label(blind, place, Some(counsel))? {
            return Err(RunError::Wanting);
        }
        labelling.note_label(blind, place, Some(counsel))?;
        let key = labelling.label_key(hash, place, Some(counsel))?;
        let record = match self.tools.rollouts.recorded(&key)? {
            Some((record, _)) => record,
            None if self.tools.wanted.is_some() => {
                let reason = self.tools.rollouts.no_label(&key)?;
                return Ok(Trial::Refused { reason: reason.unwrap_or_default() });
            }
            None => match labelling.rollout(self.prepared, place, Some(counsel)) {
                Ok(record) => {
                    self.tools.rollouts.keep(&key, &record)?;
                    record.into()
                }
                Err(NoOutcome::Scene(why)) => return Ok(Trial::Refused { reason: why.to_string() }),
                Err(NoOutcome::Stop(error)) => return Err(EvaluationError::from(error).into()),
            },
        };
        let unread = |error| RunError::Study(format!("a rollout record's decision cannot be read: {error}"));
        let decision: Decision = record.decision.read().map_err(unread)?;
        if !record.intervened {
            return Ok(Trial::Refused { reason: decision.reason });
        }
        if let Some(reason) = others_than(counsel, &decision) {
            return Ok(Trial::Refused { reason });
        }
        let mut way = || self.way(situation, counsel).unwrap_or_default();
        Ok((self.asks.trial)(situation, &record.outcome, &mut way))
    }

    /// Returns what the leader was commanded to drive: the scene step of the first sample, and the samples.
    fn way(&self, situation: &Situation, counsel: &Counsel) -> Option<(usize, Vec<Sample>)> {
        let leader = counsel.attackers.first()?;
        let compile = || self.prepared.compile_counselled(situation, self.study.seed, Some(counsel));
        let compiled = self.tools.meter.compile(&self.spec.id, compile).ok()?;
        // Actions come in the order of the pool, which is not the set's.
        compiled.intervention.actions.into_iter().find_map(|action| match action {
            Action::Follow { track, from_step, samples } if track == *leader => Some((from_step, samples)),
            _ => None,
        })
    }
}

/// The ego's drive on the unchanged scene, second by second.
fn drive(situation: &Situation) -> Vec<EgoPlace> {
    let (scene, ego) = (&situation.scene, &situation.ego);
    let from_step = scene.current_step.max(ego.steps().start);
    let Some(start) = ego.at(from_step) else { return vec![] };
    let origin = Pose { position: start.position, heading_rad: start.heading_rad };
    let steps_per_s = (1.0 / DT_S).round() as usize;
    let place = |step: usize| {
        let sample = ego.at(step)?;
        let local = origin.to_local(sample.position);
        let at_s = (step - from_step) as f64 * DT_S;
        Some(EgoPlace { at_s, ahead_m: local.x, left_m: local.y, speed_mps: sample.speed_mps() })
    };
    (from_step..ego.steps().end).step_by(steps_per_s).filter_map(place).collect()
}

/// Why an outcome is not the set's: some of its vehicles had no way to drive, or others attacked in their place.
fn others_than(counsel: &Counsel, decision: &Decision) -> Option<String> {
    let attacked: BTreeSet<TrackIx> = decision.actors.iter().map(|actor| actor.track).collect();
    let named: BTreeSet<TrackIx> = counsel.attackers.iter().copied().collect();
    (attacked != named).then(|| {
        if attacked.is_subset(&named) {
            "not all of the set have a way to attack here".to_string()
        } else {
            "the set has no way to attack here, others would".to_string()
        }
    })
}
