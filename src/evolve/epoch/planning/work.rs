//! Does planned work, a task at a time, on whatever machine it came to.

use std::collections::BTreeMap;

use super::wanted::Task;
use crate::backend::NoOutcome;
use crate::compiler::Prepared;
use crate::epoch::RunError;
use crate::epoch::briefs::counsels::Counsels;
use crate::epoch::labelling::labels::{Labelling, undisturbed, undisturbed_key};
use crate::epoch::setting::desk::Tools;
use crate::epoch::setting::study::{LineageSpec, Study};
use crate::evaluation::{EvaluationError, RolloutCache};
use crate::kernel::Digest;
use crate::objects::{HashedProgram, Program};

/// Result of a task.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Done {
    /// The store has a record under the task's key.
    Record,
    /// There is no label, and why.
    NoLabel(String),
    /// Whoever simulates was asked, and answered.
    Asked,
}

/// A study with its tools, where tasks are done.
pub struct Workbench<'a> {
    study: &'a Study,
    tools: &'a Tools<'a>,
    places: BTreeMap<&'a str, usize>,
}

/// A task with what its names stand for.
struct TaskAt<'a> {
    spec: &'a LineageSpec,
    place: usize,
    counsels: Counsels,
}

impl<'a> Workbench<'a> {
    pub fn new(study: &'a Study, tools: &'a Tools<'a>) -> Workbench<'a> {
        let places = study.scenes.iter().enumerate().map(|(place, entry)| (entry.scene().id.as_str(), place));
        Workbench { study, tools, places: places.collect() }
    }

    /// The key under which this study keeps what comes of a task.
    ///
    /// # Errors
    /// A lineage or a scene that the study does not have.
    pub fn key(&self, task: &Task) -> Result<Digest, RunError> {
        let at = self.task_at(task)?;
        let labelling = self.labelling(&at);
        match task {
            Task::Label { program, counsel, .. } => labelling.label_key(*program, at.place, counsel.as_ref()),
            Task::Trial { program, .. } => labelling.trial_key(at.place, *program),
            Task::Undisturbed { .. } => undisturbed_key(self.study, at.spec, at.place),
        }
    }

    /// Does a task. What is on record is not done again.
    ///
    /// # Errors
    /// A backend that cannot go on; a store that cannot be used; a program that is not there.
    pub fn carry_out(&self, task: &Task, program: Option<&Program>) -> Result<Done, RunError> {
        let at = self.task_at(task)?;
        let absent = || RunError::Study(format!("a task of {} has no program", task.scene()));
        match task {
            Task::Label { program: hash, .. } => {
                self.label(task, HashedProgram { program: program.ok_or_else(absent)?, hash: *hash }, &at)
            }
            Task::Trial { program: hash, .. } => {
                let subject = HashedProgram { program: program.ok_or_else(absent)?, hash: *hash };
                self.labelling(&at).tried(at.place, subject)?;
                Ok(Done::Record)
            }
            Task::Undisturbed { .. } => match undisturbed(self.study, at.spec, at.place, self.tools) {
                Err(NoOutcome::Stop(error)) => Err(EvaluationError::from(error).into()),
                Ok(_) | Err(NoOutcome::Scene(_)) => Ok(Done::Asked),
            },
        }
    }

    fn label(&self, task: &Task, subject: HashedProgram<'_>, at: &TaskAt<'_>) -> Result<Done, RunError> {
        let key = self.labelling(at).label_key(subject.hash, at.place, task.counsel())?;
        if self.tools.rollouts.recorded(&key)?.is_some() {
            return Ok(Done::Record);
        }
        let prepared = match Prepared::new(subject.program, self.study.source(at.spec)?) {
            Ok(prepared) => prepared,
            Err(failure) => return Ok(Done::NoLabel(failure.to_string())),
        };
        match self.labelling(at).rollout(&prepared, at.place, task.counsel()) {
            Ok(record) => {
                self.tools.rollouts.keep(&key, &record)?;
                Ok(Done::Record)
            }
            Err(NoOutcome::Scene(why)) => Ok(Done::NoLabel(why.to_string())),
            Err(NoOutcome::Stop(error)) => Err(EvaluationError::from(error).into()),
        }
    }

    fn task_at(&self, task: &Task) -> Result<TaskAt<'a>, RunError> {
        let study = self.study;
        let spec = study.lineages.iter().find(|spec| spec.id == *task.lineage());
        let spec = spec.ok_or_else(|| RunError::Study(format!("the study has no lineage {}", task.lineage())))?;
        let spec = match task.ego() {
            None => spec,
            Some(ego) => spec.against.iter().find(|of| of.ego.name() == ego).ok_or_else(|| {
                RunError::Study(format!("lineage {} has no driver {ego} among {}", spec.id, spec.ego_label()))
            })?,
        };
        let place = self.places.get(task.scene()).copied();
        let place = place.ok_or_else(|| RunError::Study(format!("the study has no scene {}", task.scene())))?;
        Ok(TaskAt { spec, place, counsels: Counsels::given(&spec.id, task.scene(), task.counsel()) })
    }

    fn labelling<'b>(&'b self, at: &'b TaskAt<'a>) -> Labelling<'b> {
        Labelling { study: self.study, spec: at.spec, counsels: &at.counsels, tools: self.tools }
    }
}
