//! Programs on scenes of any pool, apart from a run: labelled by the code that labels in runs, and kept nowhere.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::labels::record;
use super::play::{Traced, traced};
use super::rollouts::record_digest;
use crate::backend::{Backend, DriveContext, NoOutcome, ProgramContext};
use crate::compiler::{Prepared, Situation};
use crate::ego::Policy;
use crate::epoch::RunError;
use crate::epoch::setting::situations;
use crate::epoch::setting::study::SceneEntry;
use crate::evaluation::{
    CacheError, EvaluationOptions, Group, RolloutCache, RolloutRecord, SceneRef, Subject, evaluate, recorded_run,
};
use crate::kernel::{Digest, Seed, Threads};
use crate::objects::{Counsel, Program, Score, benchmark::SafebenchRun};
use crate::sim::{Intervention, SimulatorOptions};
use crate::stage::Source;

/// Conditions under which programs of one family are played.
#[derive(Clone, Copy)]
pub struct Applied<'a> {
    /// Their family.
    pub source: &'a Source,
    pub ego: &'a Policy,
    pub seed: Seed,
    pub simulator: &'a SimulatorOptions,
    /// Simulator of the rollouts: our own, with a planner where the ego is one.
    pub backend: Backend<'a>,
    pub evaluation: &'a EvaluationOptions,
    /// Scene digest -> who is advised to attack there. In other scenes a program stands alone.
    pub counsels: &'a BTreeMap<Digest, Counsel>,
}

/// Labels of a program in some scenes.
#[derive(Clone, Debug)]
pub struct Labelled {
    pub score: Score,
    /// The runs behind the score by group, in SafeBench's protocol; empty in the other.
    pub runs: BTreeMap<Group, Vec<SafebenchRun>>,
    /// Scenes of each group that could not be run, in SafeBench's protocol.
    pub failures: BTreeMap<Group, usize>,
}

/// The record of a program in a scene, or why there is none.
type Found = Result<RolloutRecord, String>;

impl Applied<'_> {
    /// Labels of each program on these scenes, in the order of the programs. A scene's situation is built once for all of
    /// them and dropped.
    ///
    /// # Errors
    /// A program that its family's contract does not allow; one that has no label in any scene.
    pub fn label(
        &self,
        programs: &[&Program],
        scenes: &[SceneEntry],
        threads: &Threads,
    ) -> Result<Vec<Labelled>, RunError> {
        self.label_each(programs, scenes, threads)?.into_iter().collect()
    }

    /// The same, where a program without a label in any scene takes no other one along.
    ///
    /// # Errors
    /// A program that its family's contract does not allow.
    pub fn label_each(
        &self,
        programs: &[&Program],
        scenes: &[SceneEntry],
        threads: &Threads,
    ) -> Result<Vec<Result<Labelled, RunError>>, RunError> {
        let prepared = self.prepared(programs)?;
        let under: Vec<ProgramContext> =
            programs.iter().zip(&prepared).map(|(program, of)| under(program, of)).collect();
        let labels = threads.map(scenes, |_, entry| self.labels_at(&prepared, &under, entry));
        let of = |(k, prepared): (usize, &Prepared<'_>)| {
            let records: Vec<&Found> = labels.iter().map(|of_scene| &of_scene[k]).collect();
            self.scored(prepared.hash(), scenes, &records, threads)
        };
        Ok(prepared.iter().enumerate().map(of).collect())
    }

    /// Compiles what each program makes others do in each scene, in the order of the scenes, and within a scene of the programs;
    /// the inner error says why it cannot be done. Simulates nothing but what the family itself plans by.
    ///
    /// # Errors
    /// A program that its family's contract does not allow.
    pub fn interventions(
        &self,
        programs: &[&Program],
        scenes: &[SceneEntry],
        threads: &Threads,
    ) -> Result<Vec<Vec<Result<Intervention, String>>>, RunError> {
        let prepared = self.prepared(programs)?;
        let compiled = |prepared: &Prepared<'_>, situation: &Situation, entry: &SceneEntry| {
            let compiled = prepared.compile_counselled(situation, self.seed, self.counsel(entry));
            compiled.map(|compiled| compiled.intervention).map_err(|failure| failure.to_string())
        };
        Ok(threads.map(scenes, |_, entry| match self.situation(entry) {
            Ok(situation) => prepared.iter().map(|prepared| compiled(prepared, &situation, entry)).collect(),
            Err(reason) => vec![Err(reason); prepared.len()],
        }))
    }

    fn prepared<'p>(&'p self, programs: &[&'p Program]) -> Result<Vec<Prepared<'p>>, RunError> {
        let prepared = programs.iter().map(|program| Prepared::new(program, self.source));
        prepared.collect::<Result<_, _>>().map_err(|failure| RunError::Study(failure.to_string()))
    }

    /// One rollout of a program with its motion.
    ///
    /// # Errors
    /// Why there is none, as text.
    pub fn trace(&self, program: &Program, entry: &SceneEntry) -> Result<Traced, String> {
        let prepared = Prepared::new(program, self.source).map_err(|failure| failure.to_string())?;
        let (counsel, context) = (self.counsel(entry), self.context(under(program, &prepared)));
        traced(&self.backend, &prepared, &self.situation(entry)?, counsel, context, entry, self.ego)
    }

    fn context(&self, under: ProgramContext) -> DriveContext {
        DriveContext { seed: self.seed, under }
    }

    fn situation(&self, entry: &SceneEntry) -> Result<Situation, String> {
        if matches!(self.backend, Backend::Own) {
            let own = Situation::under(entry.prepared.clone(), self.ego, self.simulator);
            return own.map_err(|error| error.to_string());
        }
        let around = situations::around(&entry.prepared, self.simulator, self.ego, self.seed, &self.backend);
        around.map_err(NoOutcome::reason)
    }

    fn counsel(&self, entry: &SceneEntry) -> Option<&Counsel> {
        self.counsels.get(&entry.digest)
    }

    /// The records of all programs in one scene.
    fn labels_at(&self, programs: &[Prepared<'_>], under: &[ProgramContext], entry: &SceneEntry) -> Vec<Found> {
        let situation = match self.situation(entry) {
            Ok(situation) => situation,
            Err(reason) => return programs.iter().map(|_| Err(reason.clone())).collect(),
        };
        let one = |(prepared, &under): (&Prepared<'_>, &ProgramContext)| {
            let compiled = prepared.compile_counselled(&situation, self.seed, self.counsel(entry));
            let compiled = compiled.map_err(|failure| failure.to_string())?;
            let outcome = self
                .backend
                .rollout(&situation.plant, &compiled.intervention, self.ego, self.context(under))
                .map_err(NoOutcome::reason)?;
            record(entry, self.ego, prepared, situation.ego_meets, &compiled.decision, outcome)
        };
        programs.iter().zip(under).map(one).collect()
    }

    fn scored(
        &self,
        program: Digest,
        scenes: &[SceneEntry],
        records: &[&Found],
        threads: &Threads,
    ) -> Result<Labelled, RunError> {
        let subject = Subject { program, ego: self.ego, simulator: self.simulator.digest()?, seed: self.seed };
        let mut refs = Vec::with_capacity(scenes.len());
        for entry in scenes {
            let counsel = self.counsel(entry).map(Counsel::digest).transpose()?;
            refs.push(SceneRef { id: &entry.scene().id, digest: entry.digest, group: entry.group(), counsel });
        }
        let label = |i: usize| records[i].clone().map_err(NoOutcome::from);
        let score = evaluate(&subject, &refs, &label, self.evaluation, &Unkept, threads)?;
        let (mut runs, mut failures) = (BTreeMap::<Group, Vec<SafebenchRun>>::new(), BTreeMap::<Group, usize>::new());
        if let Some(safebench) = self.evaluation.safebench() {
            for (entry, record) in scenes.iter().zip(records) {
                let Some(group) = entry.group() else { continue };
                match record {
                    Ok(record) => {
                        runs.entry(group).or_default().extend(recorded_run(record, safebench));
                    }
                    Err(_) => *failures.entry(group).or_default() += 1,
                }
            }
        }
        Ok(Labelled { score, runs, failures })
    }
}

/// Returns what a planner that is not blind is told of a program that stands in no run.
fn under(program: &Program, prepared: &Prepared<'_>) -> ProgramContext {
    ProgramContext::program(prepared.hash(), program.is_parent())
}

/// Keeps no record: it only says under which digest a store would.
struct Unkept;

impl RolloutCache for Unkept {
    fn recorded(&self, _: &Digest) -> Result<Option<(Arc<RolloutRecord>, Digest)>, CacheError> {
        Ok(None)
    }

    fn keep(&self, _: &Digest, record: &RolloutRecord) -> Result<Digest, CacheError> {
        record_digest(record).map_err(|error| CacheError::Store(Box::new(error)))
    }
}
