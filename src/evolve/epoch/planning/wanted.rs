//! Missing work: what a run would have to compute because no record has it. While a plan is made, such work is listed and not done.

use std::collections::BTreeMap;
use std::sync::{Mutex, MutexGuard, PoisonError};

use serde::{Deserialize, Serialize};

use super::walk::LineageJob;
use crate::kernel::Digest;
use crate::objects::{Counsel, LineageId, Program};
use crate::store::MemoKind;

/// A piece of work that stands alone: with the study and its programs it can be done anywhere, in any order.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum Task {
    /// A label: the program is compiled for the scene and rolled out against the lineage's ego, or against that one of several.
    Label {
        lineage: LineageId,
        program: Digest,
        scene: String,
        counsel: Option<Counsel>,
        #[serde(default, skip_serializing_if = "Option::is_none")]
        ego: Option<String>,
    },
    /// A trial of the compile gate.
    Trial {
        lineage: LineageId,
        program: Digest,
        scene: String,
        counsel: Option<Counsel>,
        #[serde(default, skip_serializing_if = "Option::is_none")]
        ego: Option<String>,
    },
    /// The scene without a program against the lineage's ego, in another simulator than ours.
    Undisturbed { lineage: LineageId, scene: String },
}

impl Task {
    /// The scene that it is about.
    pub fn scene(&self) -> &str {
        match self {
            Task::Label { scene, .. } | Task::Trial { scene, .. } | Task::Undisturbed { scene, .. } => scene,
        }
    }

    pub fn lineage(&self) -> &LineageId {
        match self {
            Task::Label { lineage, .. } | Task::Trial { lineage, .. } | Task::Undisturbed { lineage, .. } => lineage,
        }
    }

    /// The program that is needed to do it.
    pub fn program(&self) -> Option<Digest> {
        match self {
            Task::Label { program, .. } | Task::Trial { program, .. } => Some(*program),
            Task::Undisturbed { .. } => None,
        }
    }

    /// Returns the kind of memo under which the store keeps its record; `None` for what has no record of its own.
    pub fn memo(&self) -> Option<MemoKind> {
        match self {
            Task::Label { .. } => Some(MemoKind::Rollout),
            Task::Trial { .. } => Some(MemoKind::Compile),
            Task::Undisturbed { .. } => None,
        }
    }

    /// The driver that it is about, where the lineage has several.
    pub(in crate::epoch) fn ego(&self) -> Option<&str> {
        match self {
            Task::Label { ego, .. } | Task::Trial { ego, .. } => ego.as_deref(),
            Task::Undisturbed { .. } => None,
        }
    }

    pub(in crate::epoch) fn counsel(&self) -> Option<&Counsel> {
        match self {
            Task::Label { counsel, .. } | Task::Trial { counsel, .. } => counsel.as_ref(),
            Task::Undisturbed { .. } => None,
        }
    }
}

/// Missing work, by the key of its record.
#[derive(Default)]
pub struct Wanted {
    /// True if work that was done and gave no label is asked for again.
    again: bool,
    whole: Option<Whole>,
    gathered: Mutex<Gathered>,
}

/// A plan of whole lineages: where a lineage misses a record, all that follows in it is one piece of work.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Whole {
    /// True if the plan makes the compile gate's trials itself: where the plan asks models, their answers go on from those.
    pub tries: bool,
    /// True if workers ask the models: they get a missing answer themselves, like a record.
    pub asked_elsewhere: bool,
}

#[derive(Default)]
struct Gathered {
    tasks: BTreeMap<Digest, Task>,
    programs: BTreeMap<Digest, Program>,
    walks: Vec<LineageJob>,
}

impl Wanted {
    /// Creates an empty list. `again` also asks for what was tried and gave no label.
    pub fn new(again: bool) -> Wanted {
        Wanted { again, whole: None, gathered: Mutex::default() }
    }

    /// The same list for a plan of whole lineages.
    pub fn by_lineage(self, whole: Whole) -> Wanted {
        Wanted { whole: Some(whole), ..self }
    }

    pub(in crate::epoch) fn is_by_lineage(&self) -> bool {
        self.whole.is_some()
    }

    pub(in crate::epoch) fn tries(&self) -> bool {
        self.whole.is_some_and(|whole| whole.tries)
    }

    pub(in crate::epoch) fn asked_elsewhere(&self) -> bool {
        self.whole.is_some_and(|whole| whole.asked_elsewhere)
    }

    pub(in crate::epoch) fn again(&self) -> bool {
        self.again
    }

    /// Asks for a piece of work, with the program that it takes.
    pub fn ask(&self, key: Digest, task: Task, program: Option<&Program>) {
        let mut gathered = self.gathered();
        if let (Some(hash), Some(program)) = (task.program(), program) {
            gathered.programs.entry(hash).or_insert_with(|| program.clone());
        }
        gathered.tasks.insert(key, task);
    }

    /// Asks for all that follows in a lineage, in place of the pieces that were asked for so far.
    pub(in crate::epoch) fn ask_whole(&self, walk: LineageJob) {
        let mut gathered = self.gathered();
        gathered.tasks.retain(|_, task| *task.lineage() != walk.lineage);
        gathered.walks.push(walk);
    }

    /// Forgets what was asked for.
    pub(in crate::epoch) fn nothing(&self) {
        *self.gathered() = Gathered::default();
    }

    pub fn is_empty(&self) -> bool {
        let gathered = self.gathered();
        gathered.tasks.is_empty() && gathered.walks.is_empty()
    }

    /// The lineages that were asked for as a whole.
    pub fn take_walks(&self) -> Vec<LineageJob> {
        std::mem::take(&mut self.gathered().walks)
    }

    /// Everything else that was asked for, with its programs by their hashes.
    pub fn into_tasks(self) -> (BTreeMap<Digest, Task>, BTreeMap<Digest, Program>) {
        let Gathered { tasks, programs, .. } = self.gathered.into_inner().unwrap_or_else(PoisonError::into_inner);
        (tasks, programs)
    }

    fn gathered(&self) -> MutexGuard<'_, Gathered> {
        self.gathered.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
