//! Labels of a program on scenes of the study, from the store where they are recorded, from the simulator where not.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::made::{Lazy, Made};
use super::rollouts::TrialRecord;
use super::standings::Standing;
use crate::backend::{Backend, DriveContext, NoOutcome};
use crate::candidates::Trials;
use crate::compiler::{Decision, Prepared};
use crate::ego::Policy;
use crate::epoch::RunError;
use crate::epoch::briefs::counsels::Counsels;
use crate::epoch::planning::wanted::{Task, Wanted};
use crate::epoch::setting::desk::Tools;
use crate::epoch::setting::study::{LineageSpec, SceneEntry, Study};
use crate::evaluation::{
    EvaluationError, RolloutRecord, SceneRef, Subject, Written, evaluate, label_one, over_egos, request_key,
};
use crate::kernel::{Digest, Seed, canon::CanonError};
use crate::objects::{Counsel, HashedProgram, Probe, ProbePair, Program, Score};
use crate::sim::{ActorRef, Intervention, Outcome, Plant};
use crate::stage::Situation;
use crate::store::MemoKind;

/// Number of scenes on which every child is tried, or of all probe scenes where these are fewer.
const TRIED_MIN: usize = 3;

/// Everything that labels of one lineage's programs rest on.
#[derive(Clone, Copy)]
pub struct Labelling<'a> {
    pub study: &'a Study,
    pub spec: &'a LineageSpec,
    pub counsels: &'a Counsels,
    pub tools: &'a Tools<'a>,
}

impl<'a> Labelling<'a> {
    /// The same against each of the lineage's drivers alone.
    pub fn by_ego(&self) -> Vec<Labelling<'a>> {
        self.spec.by_ego().iter().map(|spec| Labelling { spec, ..*self }).collect()
    }
}

impl Labelling<'_> {
    /// Labels a program on the scenes at these places.
    pub fn score(&self, subject: HashedProgram<'_>, places: &[usize]) -> Result<Score, RunError> {
        self.note(subject, places)?;
        if self.want(subject, places)? > 0 {
            return Err(RunError::Wanting);
        }
        self.tools.go_on()?;
        let Some(rule) = self.spec.over_egos.filter(|_| !self.spec.against.is_empty()) else {
            return self.against_one(subject, places);
        };
        let alone = |of: Labelling<'_>| Ok((of.spec.ego.name().to_string(), of.against_one(subject, places)?));
        let scores = self.by_ego().into_iter().map(alone).collect::<Result<Vec<_>, RunError>>()?;
        let nowhere =
            || EvaluationError::NoLabel(format!("no scene has a label against all of {}", self.spec.ego_label()));
        Ok(over_egos(rule, &scores).ok_or_else(nowhere)?)
    }

    /// Labels a program against this lineage's one driver.
    fn against_one(&self, subject: HashedProgram<'_>, places: &[usize]) -> Result<Score, RunError> {
        let Labelling { study, tools, .. } = *self;
        let asked = Asked::of(self, subject, places)?;
        let label = |i: usize| asked.label(i);
        Ok(evaluate(&asked.subject, &asked.scenes, &label, &study.evaluation, tools.rollouts, tools.threads)?)
    }

    /// Labels a program in our own simulator on the scenes at these places, where another simulator makes the labels. Plays the commands
    /// that the other one will get. `None` where no scene can be labelled.
    pub fn predicted(&self, subject: HashedProgram<'_>, places: &[usize]) -> Result<Option<Score>, RunError> {
        let Labelling { study, tools, .. } = *self;
        tools.go_on()?;
        let asked = Asked::of(self, subject, places)?;
        let subject = Subject { simulator: study.predicting()?, ..asked.subject };
        let label = |i: usize| asked.predicted(i);
        match evaluate(&subject, &asked.scenes, &label, &study.evaluation, &tools.predictions, tools.threads) {
            Ok(score) => Ok(Some(score)),
            Err(EvaluationError::NoLabel(_)) => Ok(None),
            Err(error) => Err(error.into()),
        }
    }

    /// Makes labels of many programs that will be needed, all in one parallel map: asked for program by program, threads
    /// would wait at the end of each one's scenes. A plan is asked for them. What gives no label is left to who needs it.
    pub fn ahead(&self, programs: &[&Program], places: &[usize]) -> Result<(), RunError> {
        self.ahead_at(&programs.iter().map(|program| (*program, places)).collect::<Vec<_>>())
    }

    /// The same where each program has places of its own.
    pub fn ahead_at(&self, programs: &[(&Program, &[usize])]) -> Result<(), RunError> {
        let Labelling { tools, .. } = *self;
        let mut distinct: BTreeMap<(Digest, &[usize]), &Program> = BTreeMap::new();
        for (program, places) in programs {
            distinct.insert((program.hash()?, places), program);
        }
        if tools.wanted.is_some() {
            let want = |(&(hash, places), program): (&(Digest, &[usize]), &&Program)| {
                self.want(HashedProgram { program, hash }, places).map(drop)
            };
            return distinct.iter().try_for_each(want);
        }
        let all: Vec<_> = distinct.into_iter().map(|((_, places), program)| (*self, program, places)).collect();
        ahead_of_all(&all, tools, &mut |_, _| ())
    }

    /// Asks a plan for the labels that are not on record, and says how many these are; 0 where no plan is made.
    pub fn want(&self, subject: HashedProgram<'_>, places: &[usize]) -> Result<usize, RunError> {
        let mut missing = 0;
        if self.tools.wanted.is_some() {
            for &place in places {
                let counsel = self.counsels.at(self.study, self.spec, place)?;
                for labelling in self.by_ego() {
                    missing += usize::from(labelling.want_label(subject, place, counsel)?);
                }
            }
        }
        Ok(missing)
    }

    /// Notes that the way rests on these labels, where somebody keeps a list of that.
    fn note(&self, subject: HashedProgram<'_>, places: &[usize]) -> Result<(), RunError> {
        if self.tools.noted.is_some() {
            for &place in places {
                for labelling in self.by_ego() {
                    labelling.note_label(subject, place, self.counsels.at(self.study, self.spec, place)?)?;
                }
            }
        }
        Ok(())
    }

    /// The same of one label.
    pub fn note_label(
        &self,
        HashedProgram { program, hash }: HashedProgram<'_>,
        place: usize,
        counsel: Option<&Counsel>,
    ) -> Result<(), RunError> {
        if let Some(noted) = self.tools.noted {
            let (lineage, scene) = (self.spec.id.clone(), self.study.scenes[place].scene().id.clone());
            let (counsel_of, ego) = (counsel.cloned(), self.spec.one_of_several());
            let task = Task::Label { lineage, program: hash, scene, counsel: counsel_of, ego };
            noted.ask(self.label_key(hash, place, counsel)?, task, Some(program));
        }
        Ok(())
    }

    /// Asks a plan for one label, and says whether it is missing. One that was tried in vain is not.
    pub fn want_label(
        &self,
        HashedProgram { program, hash }: HashedProgram<'_>,
        place: usize,
        counsel: Option<&Counsel>,
    ) -> Result<bool, RunError> {
        let Some(wanted) = self.tools.wanted else { return Ok(false) };
        let (key, rollouts) = (self.label_key(hash, place, counsel)?, self.tools.rollouts);
        if rollouts.has(MemoKind::Rollout, &key) || (!wanted.again() && rollouts.no_label(&key)?.is_some()) {
            return Ok(false);
        }
        let (lineage, scene) = (self.spec.id.clone(), self.study.scenes[place].scene().id.clone());
        let (counsel, ego) = (counsel.cloned(), self.spec.one_of_several());
        wanted.ask(key, Task::Label { lineage, program: hash, scene, counsel, ego }, Some(program));
        Ok(true)
    }

    /// The key of a label.
    pub fn label_key(&self, hash: Digest, place: usize, counsel: Option<&Counsel>) -> Result<Digest, RunError> {
        let Labelling { study, spec, .. } = *self;
        let advised = counsel.map(Counsel::digest).transpose()?;
        let scene = study.scenes[place].digest;
        Ok(request_key(hash, scene, spec.ego.digest(), study.rules()?, study.seed, advised)?)
    }

    /// Why a rollout that was tried elsewhere gave no label.
    fn known_reason(&self, hash: Digest, place: usize, counsel: Option<&Counsel>) -> Result<String, String> {
        let key = self.label_key(hash, place, counsel).map_err(|error| error.to_string())?;
        let reason = self.tools.rollouts.no_label(&key).map_err(|error| error.to_string())?;
        Ok(reason.unwrap_or_else(|| "no label".into()))
    }

    /// Labels a program on the window and on all windows so far.
    pub fn standing(
        &self,
        subject: HashedProgram<'_>,
        window: &[usize],
        so_far: &[usize],
    ) -> Result<Standing, RunError> {
        Ok(Standing { window: self.score(subject, window)?, so_far: self.score(subject, so_far)? })
    }

    /// Compiles a child on probe scenes and returns what cannot be lowered, and in how many scenes its interventions differ from its
    /// parent's. Both draw the same numbers, so that only the edit can make a difference. Stops once a difference is found and
    /// [`TRIED_MIN`] scenes were tried: most of the probe scenes are for children that seem to do what their parent does. A trial on
    /// record is not made again. Several drivers take turns over the probe scenes, so that an edit that makes a difference against
    /// one of them alone is seen.
    pub fn trials(
        &self,
        probes: &[usize],
        child: HashedProgram<'_>,
        parent: HashedProgram<'_>,
    ) -> Result<Trials, RunError> {
        if self.want_trials(probes, child, parent)? > 0 {
            return Err(RunError::Wanting);
        }
        let mut trials = Trials::default();
        let drivers = self.by_ego();
        let (children, parents) = (Lazy::new(child.program), Lazy::new(parent.program));
        let pair = |nth: usize| -> Result<Result<ProbePair, Option<String>>, RunError> {
            let (place, against) = (probes[nth], &drivers[nth % drivers.len()]);
            let own = against.trial(place, &children, child.hash)?;
            let (Some(_), None) = (own.intervention, &own.failure) else { return Ok(Err(own.failure.clone())) };
            let before = against.trial(place, &parents, parent.hash)?;
            let reported = |trial: &TrialRecord| trial.probe.unwrap_or(Probe::NOTHING);
            let same = before.intervention == own.intervention;
            Ok(Ok(ProbePair { child: reported(&own), parent: reported(&before), same }))
        };
        // The first ones are tried in any case: at the end of an epoch's slots they keep an idle thread at work.
        let (first, rest) = probes.split_at(probes.len().min(TRIED_MIN));
        for tried in self.tools.threads.map(first, |nth, _| pair(nth)) {
            note(&mut trials, tried?);
        }
        for nth in 0..rest.len() {
            if trials.differing > 0 {
                break;
            }
            note(&mut trials, pair(first.len() + nth)?);
        }
        Ok(trials)
    }

    /// Asks a plan for the trials that are not on record, as far as [`Labelling::trials`] would certainly come to them, and
    /// says how many these are.
    pub fn want_trials(
        &self,
        probes: &[usize],
        child: HashedProgram<'_>,
        parent: HashedProgram<'_>,
    ) -> Result<usize, RunError> {
        let (mut missing, mut differing, mut unsure) = (0, false, false);
        if self.tools.wanted.is_none_or(Wanted::tries) {
            return Ok(0);
        }
        let drivers = self.by_ego();
        for (tried, &place) in probes.iter().enumerate() {
            let against = &drivers[tried % drivers.len()];
            // Behind the first ones nothing is certain before these are known; then all others are asked for at once.
            if tried >= TRIED_MIN && (differing || unsure) {
                break;
            }
            let own = against.want_trial(place, child)?;
            let before = against.want_trial(place, parent)?;
            match (own, before) {
                (Some(own), Some(before)) => {
                    differing |= own.intervention.is_some() && own.intervention != before.intervention;
                }
                (own, before) => missing += usize::from(own.is_none()) + usize::from(before.is_none()),
            }
            unsure |= tried < TRIED_MIN && missing > 0;
        }
        Ok(missing)
    }

    /// A trial that is on record; one that is not is asked of the plan.
    fn want_trial(
        &self,
        place: usize,
        HashedProgram { program, hash }: HashedProgram<'_>,
    ) -> Result<Option<Arc<TrialRecord>>, RunError> {
        let key = self.trial_key(place, hash)?;
        let trial = self.tools.rollouts.tried(&key)?;
        if let (None, Some(wanted)) = (&trial, self.tools.wanted) {
            let counsel = self.counsels.at(self.study, self.spec, place)?.cloned();
            let (lineage, scene) = (self.spec.id.clone(), self.study.scenes[place].scene().id.clone());
            let ego = self.spec.one_of_several();
            wanted.ask(key, Task::Trial { lineage, program: hash, scene, counsel, ego }, Some(program));
        }
        Ok(trial)
    }

    /// The key of a trial.
    pub fn trial_key(&self, place: usize, hash: Digest) -> Result<Digest, RunError> {
        let Labelling { study, spec, counsels, .. } = *self;
        let advised = counsels.at(study, spec, place)?.map(Counsel::digest).transpose()?;
        let (scene, simulator) = (study.scenes[place].digest, study.planning()?);
        let request = request_key(hash, scene, spec.ego.digest(), simulator, study.seed, advised)?;
        Ok(Digest::of("evodrive/trial/3", &request)?)
    }

    /// A trial, from its record or made now.
    pub fn tried(&self, place: usize, subject: HashedProgram<'_>) -> Result<Arc<TrialRecord>, RunError> {
        self.trial(place, &Lazy::new(subject.program), subject.hash)
    }

    fn trial<'p>(&'p self, place: usize, program: &Lazy<'p>, hash: Digest) -> Result<Arc<TrialRecord>, RunError> {
        let Labelling { study, spec, counsels, tools } = *self;
        let entry = &study.scenes[place];
        let counsel = counsels.at(study, spec, place)?;
        let key = self.trial_key(place, hash)?;
        if let Some(noted) = tools.noted {
            let (lineage, scene) = (spec.id.clone(), entry.scene().id.clone());
            let (counsel, ego) = (counsel.cloned(), spec.one_of_several());
            noted.ask(key, Task::Trial { lineage, program: hash, scene, counsel, ego }, Some(program.program()));
        }
        if let Some(trial) = tools.rollouts.tried(&key)? {
            return Ok(trial);
        }
        tools.go_on()?;
        let (intervention, probe, failure) = match program.prepared(study.source(spec)?, &tools.searched) {
            Err(failure) => (None, None, Some(failure.to_string())),
            Ok(prepared) => match tools.situations.at(place, &spec.ego, &tools.backend) {
                Ok(situation) => match self.compiled(prepared, place, &situation, counsel)? {
                    Ok(made) => {
                        let (intervention, probe) = made.probed(&situation)?;
                        (Some(intervention), Some(probe), None)
                    }
                    Err(failure) => (None, None, Some(failure)),
                },
                // Where the other simulator has no record of the ego's drive, a program cannot be tried; that is not the program's fault.
                Err(NoOutcome::Scene(_)) if study.plans_around_backend() => (None, None, None),
                Err(NoOutcome::Scene(why)) => return Err(RunError::Study(why.to_string())),
                Err(NoOutcome::Stop(error)) => return Err(EvaluationError::from(error).into()),
            },
        };
        let (program, scene, scene_digest) = (hash, entry.scene().id.clone(), entry.digest);
        let ego = spec.ego.name().to_string();
        let trial = TrialRecord { program, scene, scene_digest, ego, failure, intervention, probe };
        tools.rollouts.keep_trial(&key, trial.clone())?;
        Ok(Arc::new(trial))
    }

    /// Compiles a program in a scene; the inner error says why it cannot be lowered. Programs that are alike in all that decides there
    /// are compiled once: a child is tried and labelled in the same scenes, and an edit changes few scenes where a rule guards it.
    pub fn compiled(
        &self,
        prepared: &Prepared<'_>,
        place: usize,
        situation: &Situation,
        counsel: Option<&Counsel>,
    ) -> Result<Result<Arc<Made>, String>, CanonError> {
        let Labelling { study, spec, tools, .. } = *self;
        let (in_effect, ego) = (prepared.in_effect(&situation.scene_values)?, spec.ego.digest());
        let key = (in_effect, place as u64, ego, counsel.map(Counsel::digest).transpose()?);
        let compile = || {
            let compile = || prepared.compile_counselled(situation, study.seed, counsel);
            let compiled = tools.meter.compile(&spec.id, compile);
            compiled.map(|compiled| Arc::new(Made::of(compiled))).map_err(|failure| failure.to_string())
        };
        Ok(tools.compiled.of(Digest::of("evodrive/compiled/1", &key)?, compile))
    }

    /// Compiles for one scene, with the counsel where the family takes it, and rolls out.
    pub fn rollout(
        &self,
        prepared: &Prepared<'_>,
        place: usize,
        counsel: Option<&Counsel>,
    ) -> Result<RolloutRecord, NoOutcome> {
        let Labelling { study, spec, tools, .. } = *self;
        self.played(prepared, place, counsel, |situation, intervention| {
            let context = study.drive_context(prepared.hash());
            let run = || tools.backend.rollout(&situation.plant, intervention, &spec.ego, context);
            let outcome = tools.meter.rollout(&spec.id, run)?;
            Ok((outcome, meets_anyway(&tools.backend, situation, &spec.ego, study.seed)?))
        })
    }

    /// The same from our own simulator, whoever makes the labels.
    fn predicted_rollout(
        &self,
        prepared: &Prepared<'_>,
        place: usize,
        counsel: Option<&Counsel>,
    ) -> Result<RolloutRecord, NoOutcome> {
        let Labelling { study, spec, .. } = *self;
        self.played(prepared, place, counsel, |situation, intervention| {
            let context = study.drive_context(prepared.hash());
            let own = |of: &Intervention| Backend::Own.rollout(&situation.plant, of, &spec.ego, context);
            // Around another simulator the situation holds the drive of that one's ego.
            let anyway = if study.plans_around_backend() {
                own(&Intervention::default())?.contact.map(|contact| contact.with)
            } else {
                situation.ego_meets
            };
            Ok((own(intervention)?, anyway))
        })
    }

    /// The record of what `play` makes of the program's commands in one scene: how it ended, and whom the ego meets anyway.
    fn played(
        &self,
        prepared: &Prepared<'_>,
        place: usize,
        counsel: Option<&Counsel>,
        play: impl FnOnce(&Situation, &Intervention) -> Result<(Outcome, Option<ActorRef>), NoOutcome>,
    ) -> Result<RolloutRecord, NoOutcome> {
        let Labelling { study, spec, tools, .. } = *self;
        let situation = tools.situations.at(place, &spec.ego, &tools.backend)?;
        let made = self.compiled(prepared, place, &situation, counsel).map_err(|error| error.to_string())??;
        let (outcome, anyway) = play(&situation, &made.compiled.intervention)?;
        Ok(record(&study.scenes[place], &spec.ego, prepared, anyway, &made.compiled.decision, outcome)?)
    }
}

/// Pieces of a parallel map of labels between which progress is reported.
const PIECES: usize = 10;

/// Makes labels that lineages will need, all in one parallel map, and says now and then how many of how many there are.
pub fn ahead_of_all(
    all: &[(Labelling<'_>, &Program, &[usize])],
    tools: &Tools<'_>,
    tell: &mut dyn FnMut(usize, usize),
) -> Result<(), RunError> {
    let mut alone = Vec::new();
    for (labelling, program, places) in all {
        let subject = program.hashed()?;
        labelling.note(subject, places)?;
        alone.extend(labelling.by_ego().into_iter().map(|labelling| (labelling, subject, *places)));
    }
    let asked = alone.iter().map(|(labelling, subject, places)| Asked::of(labelling, *subject, places));
    let asked = asked.collect::<Result<Vec<_>, _>>()?;
    let each = |program: usize| (0..asked[program].places.len()).map(move |scene| (program, scene));
    let all: Vec<(usize, usize)> = (0..asked.len()).flat_map(each).collect();
    if all.is_empty() {
        return Ok(());
    }
    let mut done = 0;
    for piece in all.chunks(all.len().div_ceil(PIECES)) {
        tell(done, all.len());
        let made = tools.threads.map(piece, |_, &(program, scene)| {
            tools.go_on()?;
            let asked = &asked[program];
            label_one(&asked.subject, scene, &asked.scenes[scene], &|i| asked.label(i), tools.rollouts).map(drop)?;
            Ok(())
        });
        made.into_iter().collect::<Result<(), RunError>>()?;
        done += piece.len();
    }
    tell(done, all.len());
    Ok(())
}

/// Adds what came of a child in one probe scene: it beside its parent, or why it cannot be lowered.
fn note(trials: &mut Trials, tried: Result<ProbePair, Option<String>>) {
    match tried {
        Ok(pair) => {
            trials.compared += 1;
            trials.differing += usize::from(!pair.same);
            trials.probes.push(pair);
        }
        Err(failure) => trials.problems.extend(failure),
    }
}

/// A program's labels on some scenes, as evaluation asks for them.
struct Asked<'a> {
    labelling: &'a Labelling<'a>,
    program: Lazy<'a>,
    places: &'a [usize],
    counsels: Vec<Option<&'a Counsel>>,
    subject: Subject<'a>,
    scenes: Vec<SceneRef<'a>>,
}

impl<'a> Asked<'a> {
    fn of(
        labelling: &'a Labelling<'a>,
        HashedProgram { program, hash }: HashedProgram<'a>,
        places: &'a [usize],
    ) -> Result<Asked<'a>, RunError> {
        let Labelling { study, spec, counsels, .. } = *labelling;
        let counsels = places.iter().map(|&place| counsels.at(study, spec, place)).collect::<Result<Vec<_>, _>>()?;
        let scene = |(&place, counsel): (&usize, &Option<&Counsel>)| -> Result<SceneRef<'a>, CanonError> {
            let entry = &study.scenes[place];
            let counsel = counsel.map(Counsel::digest).transpose()?;
            Ok(SceneRef { id: &entry.scene().id, digest: entry.digest, group: entry.group(), counsel })
        };
        let scenes = places.iter().zip(&counsels).map(scene).collect::<Result<_, _>>()?;
        let subject = Subject { program: hash, ego: &spec.ego, simulator: study.rules()?, seed: study.seed };
        Ok(Asked { labelling, program: Lazy::new(program), places, counsels, subject, scenes })
    }

    /// The label of scene number `i`, compiled and rolled out now; in a plan why there is none.
    fn label(&self, i: usize) -> Result<RolloutRecord, NoOutcome> {
        let (place, counsel) = (self.places[i], self.counsels[i]);
        if self.labelling.tools.wanted.is_some() {
            return Err(self.labelling.known_reason(self.subject.program, place, counsel)?.into());
        }
        self.labelling.rollout(self.prepared()?, place, counsel)
    }

    /// The same from our own simulator, also in a plan: it costs no more than finding out what is missing.
    fn predicted(&self, i: usize) -> Result<RolloutRecord, NoOutcome> {
        self.labelling.predicted_rollout(self.prepared()?, self.places[i], self.counsels[i])
    }

    fn prepared(&self) -> Result<&Prepared<'_>, NoOutcome> {
        let Labelling { study, spec, tools, .. } = *self.labelling;
        let source = study.source(spec).map_err(|error| error.to_string())?;
        self.program.prepared(source, &tools.searched).map_err(|failure| failure.to_string().into())
    }
}

/// The scene at a place without a program, in whoever simulates.
pub fn undisturbed(study: &Study, spec: &LineageSpec, place: usize, tools: &Tools<'_>) -> Result<Outcome, NoOutcome> {
    let plant = Plant::with_options(study.scenes[place].prepared.clone(), &study.simulator)?;
    tools.backend.rollout(&plant, &Intervention::default(), &spec.ego, DriveContext::plain(study.seed))
}

/// Returns the key of that rollout in a plan. The recorded answer has a key of its own.
pub fn undisturbed_key(study: &Study, spec: &LineageSpec, place: usize) -> Result<Digest, RunError> {
    let of = (study.scenes[place].digest, spec.ego.digest(), study.rules()?, study.seed);
    Ok(Digest::of("evodrive/undisturbed/1", &of)?)
}

/// The road user that the ego runs into in plain replay, in the simulator that makes the labels.
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
            let undisturbed =
                backend.rollout(&situation.plant, &Intervention::default(), ego, DriveContext::plain(seed))?;
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
    use crate::backend::{Answer, Answers, BackendError, BackendOptions, PlanAround, Request, WorkerOptions};
    use crate::scene::PreparedScene;
    use crate::sim::scenes::crossing;
    use crate::sim::{Plant, SimulatorOptions, tell};

    /// Another simulator: in it every ego repeats its recording.
    struct Repeats;

    impl Answers for Repeats {
        fn answer(&self, request: &Request<'_>) -> Result<Answer, BackendError> {
            let reported = tell(request.plant, request.intervention, Policy::Replay.driver().as_mut());
            Ok(Answer::ReportedRollout(reported.expect("a rollout")))
        }
    }

    #[test]
    fn plain_replay_is_that_of_whoever_simulates() {
        let options = BackendOptions {
            name: "repeats".into(),
            version: "1".into(),
            digest: Digest::of_bytes(b"repeats"),
            options: Default::default(),
            plan_around: PlanAround::Evodrive,
            cassette: "none".into(),
            worker: WorkerOptions { command: vec![], workers: 1, seconds: 1.0, retries: 0, rollouts: None },
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
