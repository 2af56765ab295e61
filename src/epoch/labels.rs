//! Labels of a program on scenes of the study, from the store where they are recorded, from the simulator where not.

use std::sync::{Arc, OnceLock, PoisonError};

use super::{
    RunError,
    counsels::Counsels,
    desk::Tools,
    rollouts::TrialRecord,
    standings::Standing,
    study::{LineageSpec, SceneEntry, Study},
};
use crate::backend::{Backend, NoOutcome};
use crate::candidates::Trials;
use crate::compiler::{CompileFailure, Decision, Prepared};
use crate::ego::Policy;
use crate::evaluation::{RolloutRecord, SceneRef, Subject, Written, evaluate, request_key};
use crate::kernel::{Digest, Seed, canon::CanonError};
use crate::objects::{Counsel, Program, Score};
use crate::sim::{ActorRef, Intervention, Outcome};
use crate::stage::{Situation, Source};

/// Scenes on which every child is tried, as far as there are probe scenes.
const TRIED_MIN: usize = 3;

/// What labels of one lineage's programs rest on.
#[derive(Clone, Copy)]
pub struct Labelling<'a> {
    pub study: &'a Study,
    pub spec: &'a LineageSpec,
    pub counsels: &'a Counsels,
    pub tools: &'a Tools<'a>,
}

impl Labelling<'_> {
    /// Labels a program, given with its hash, on the scenes at these places.
    pub fn score(&self, (program, hash): (&Program, Digest), places: &[usize]) -> Result<Score, RunError> {
        let Labelling { study, spec, counsels, tools } = *self;
        let source = study.source(spec)?;
        // Nothing is prepared where every rollout is on record.
        let prepared = OnceLock::new();
        let ready = || match prepared.get_or_init(|| Prepared::new(program, source)) {
            Ok(prepared) => Ok(prepared),
            Err(failure) => Err(failure.to_string()),
        };
        let simulator = study.rules()?;
        let subject = Subject { program: hash, ego: &spec.ego, simulator, seed: study.seed };
        let counsels = places.iter().map(|&place| counsels.at(study, spec, place)).collect::<Result<Vec<_>, _>>()?;
        let scene = |(&place, counsel): (&usize, &Option<&Counsel>)| -> Result<SceneRef<'_>, CanonError> {
            let entry = &study.scenes[place];
            let counsel = counsel.map(Counsel::digest).transpose()?;
            Ok(SceneRef { id: &entry.scene().id, digest: entry.digest, group: entry.group(), counsel })
        };
        let scenes: Vec<SceneRef<'_>> = places.iter().zip(&counsels).map(scene).collect::<Result<_, _>>()?;
        let label = |i: usize| self.rollout(ready()?, places[i], counsels[i]);
        Ok(evaluate(&subject, &scenes, &label, &study.evaluation, tools.rollouts, tools.threads)?)
    }

    /// Labels a program on the window and on all windows so far.
    pub fn standing(
        &self,
        subject: (&Program, Digest),
        window: &[usize],
        so_far: &[usize],
    ) -> Result<Standing, RunError> {
        Ok(Standing { window: self.score(subject, window)?, so_far: self.score(subject, so_far)? })
    }

    /// What comes of compiling a child on probe scenes: what cannot be lowered, and in how many scenes its interventions
    /// differ from its parent's. Both draw from the parent's random streams, so that only the edit can make a difference.
    /// Once a difference is found and [`TRIED_MIN`] scenes were tried, no more is asked: most of the probe scenes are for
    /// children that seem to do what their parent does. What was tried before is not tried again.
    pub fn trials(
        &self,
        probes: &[usize],
        (child, hash): (&Program, Digest),
        (parent, parent_hash): (&Program, Digest),
    ) -> Result<Trials, RunError> {
        let mut trials = Trials::default();
        let (mut children, mut parents) = (Lazy::new(child), Lazy::new(parent));
        for (tried, &place) in probes.iter().enumerate() {
            if tried >= TRIED_MIN && trials.differing > 0 {
                break;
            }
            let own = self.trial(place, &mut children, hash, parent_hash)?;
            let (Some(own), None) = (own.intervention, &own.failure) else {
                trials.problems.extend(own.failure.clone());
                continue;
            };
            let alone = self.tools.parent_trial.lock().unwrap_or_else(PoisonError::into_inner);
            let before = self.trial(place, &mut parents, parent_hash, parent_hash)?;
            drop(alone);
            trials.compared += 1;
            trials.differing += usize::from(before.intervention != Some(own));
        }
        Ok(trials)
    }

    fn trial<'p>(
        &'p self,
        place: usize,
        program: &mut Lazy<'p>,
        hash: Digest,
        draws_of: Digest,
    ) -> Result<Arc<TrialRecord>, RunError> {
        let Labelling { study, spec, counsels, tools } = *self;
        let entry = &study.scenes[place];
        let counsel = counsels.at(study, spec, place)?;
        let advised = counsel.map(Counsel::digest).transpose()?;
        let simulator = study.simulator.digest()?;
        let request = request_key(hash, entry.digest, spec.ego.digest(), simulator, study.seed, advised)?;
        let key = Digest::of("evodrive/trial/1", &(request, draws_of))?;
        if let Some(trial) = tools.rollouts.tried(&key)? {
            return Ok(trial);
        }
        let compiled = match program.prepared(study.source(spec)?) {
            Err(failure) => Err(failure.to_string()),
            Ok(prepared) => {
                let situation = tools.situations.at(place, &spec.ego).map_err(RunError::Study)?;
                let compile = || prepared.compile_as(draws_of, &situation, study.seed, counsel);
                tools.meter.compile(&spec.id, compile).map_err(|failure| failure.to_string())
            }
        };
        let (intervention, failure) = match compiled {
            Ok(compiled) => (Some(Digest::of("evodrive/intervention/1", &compiled.intervention)?), None),
            Err(failure) => (None, Some(failure)),
        };
        let (program, scene, scene_digest) = (hash, entry.scene().id.clone(), entry.digest);
        let ego = spec.ego.name().to_string();
        let trial = TrialRecord { program, draws_of, scene, scene_digest, ego, failure, intervention };
        tools.rollouts.keep_trial(&key, trial.clone())?;
        Ok(Arc::new(trial))
    }

    /// Compiles for one scene, with the counsel where the family takes it, and rolls out.
    pub fn rollout(
        &self,
        prepared: &Prepared<'_>,
        place: usize,
        counsel: Option<&Counsel>,
    ) -> Result<RolloutRecord, NoOutcome> {
        let Labelling { study, spec, tools, .. } = *self;
        let situation = tools.situations.at(place, &spec.ego)?;
        let compile = || prepared.compile_counselled(&situation, study.seed, counsel);
        let compiled = tools.meter.compile(&spec.id, compile).map_err(|failure| failure.to_string())?;
        let run = || tools.backend.rollout(&situation.plant, &compiled.intervention, &spec.ego, study.seed);
        let outcome: Outcome = tools.meter.rollout(&spec.id, run)?;
        let anyway = meets_anyway(&tools.backend, &situation, &spec.ego, study.seed)?;
        Ok(record(&study.scenes[place], &spec.ego, prepared, anyway, &compiled.decision, outcome)?)
    }
}

/// A program that is prepared when it is first needed.
struct Lazy<'p> {
    program: &'p Program,
    prepared: Option<Prepared<'p>>,
}

impl<'p> Lazy<'p> {
    fn new(program: &'p Program) -> Lazy<'p> {
        Lazy { program, prepared: None }
    }

    fn prepared(&mut self, source: &'p Source) -> Result<&Prepared<'p>, CompileFailure> {
        match self.prepared {
            Some(ref prepared) => Ok(prepared),
            None => Ok(self.prepared.insert(Prepared::new(self.program, source)?)),
        }
    }
}

/// Whom the ego runs into in plain replay, as whoever simulates sees it.
pub fn meets_anyway(
    backend: &Backend<'_>,
    situation: &Situation,
    ego: &Policy,
    seed: Seed,
) -> Result<Option<ActorRef>, NoOutcome> {
    match backend {
        // The situation was built with that rollout.
        Backend::Own => Ok(situation.ego_meets),
        Backend::Other { .. } => {
            let undisturbed = backend.rollout(&situation.plant, &Intervention::default(), ego, seed)?;
            Ok(undisturbed.contact.map(|contact| contact.with))
        }
    }
}

/// The record of a rollout.
pub fn record(
    entry: &SceneEntry,
    ego: &Policy,
    prepared: &Prepared<'_>,
    meets_anyway: Option<ActorRef>,
    decision: &Decision,
    outcome: Outcome,
) -> Result<RolloutRecord, String> {
    Ok(RolloutRecord {
        scene: entry.scene().id.clone(),
        scene_digest: entry.digest,
        program: prepared.hash(),
        ego: ego.name().to_string(),
        intervened: decision.applies,
        meets_anyway,
        decision: Written::of(decision).map_err(|error| error.to_string())?,
        outcome,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::backend::{Answer, Answers, BackendError, BackendOptions, Request, WorkerOptions};
    use crate::scene::PreparedScene;
    use crate::sim::scenes::crossing;
    use crate::sim::{Plant, SimulatorOptions, tell};

    /// Another simulator: in it every ego repeats its recording.
    struct Repeats;

    impl Answers for Repeats {
        fn answer(&self, request: &Request<'_>) -> Result<Answer, BackendError> {
            let told = tell(request.plant, request.intervention, Policy::Replay.driver().as_mut());
            Ok(Answer::Told(told.expect("a rollout")))
        }
    }

    #[test]
    fn plain_replay_is_that_of_whoever_simulates() {
        let options = BackendOptions {
            name: "repeats".into(),
            version: "1".into(),
            digest: Digest::of_bytes(b"repeats"),
            options: Default::default(),
            cassette: "none".into(),
            worker: WorkerOptions { command: vec![], workers: 1, seconds: 1.0, retries: 0 },
        };
        let other = Backend::Other { options: &options, answers: &Repeats };
        let mut differing = 0;
        for seed in 0..60 {
            let prepared = PreparedScene::new(Arc::new(crossing(seed, 20, 91)));
            let own = Situation::under(prepared.clone(), &Policy::Idm, &SimulatorOptions::SHIPPED).unwrap();
            let plant = Plant::with_options(prepared, &SimulatorOptions::SHIPPED).unwrap();
            let theirs =
                crate::sim::rollout(&plant, &Intervention::default(), Policy::Replay.driver().as_mut()).unwrap();
            let theirs = theirs.contact.map(|contact| contact.with);
            let asked = |backend| meets_anyway(backend, &own, &Policy::Idm, Seed(1)).unwrap();
            assert_eq!((asked(&Backend::Own), asked(&other)), (own.ego_meets, theirs), "seed {seed}");
            differing += usize::from(own.ego_meets != theirs);
        }
        assert!(differing >= 3, "{differing}: both simulators agree here");
    }
}
