//! Other runs on the page of one: null searches, another model, another seed. What each reports stands in the front of the lineage that it
//! is compared with, and the differences in a table.

use serde::Serialize;

use super::spread;
use crate::evidence::recorded_run::RecordedRun;
use crate::evidence::tables::{Compared, searched};
use crate::kernel::Digest;
use crate::objects::{LineageId, SolutionId, event::Measured};

/// A run beside the page's own.
#[derive(Clone, Debug, Serialize)]
pub struct Other {
    pub name: String,
    pub root: Digest,
    /// Kind of search, by who proposed and what decided, in words.
    pub by: &'static str,
    /// A row a search that both have.
    pub rows: Vec<OtherRow>,
    /// The programs that it reports, by the lineages of the page's run that they are compared with.
    pub points: Vec<OtherPoint>,
    /// Omissions, with their reasons.
    pub notes: Vec<String>,
}

/// Reports of two searches, paired by scene.
#[derive(Clone, Debug, Serialize)]
pub struct OtherRow {
    pub search: String,
    /// Repetitions of both that are compared.
    pub seeds: usize,
    pub scenes: usize,
    /// First the page's run, second the other one; the difference is second minus first.
    pub quantities: Vec<Compared>,
}

/// A reported program of the other run on its held-out scenes.
#[derive(Clone, Debug, Serialize)]
pub struct OtherPoint {
    pub lineage: LineageId,
    pub measured: Measured,
    pub scenes: usize,
    /// 95 % intervals of attack and of the realism among the objectives over scenes.
    pub spread: Option<[[f64; 2]; 2]>,
}

impl Other {
    /// A run without rows and points yet.
    pub fn of(run: &RecordedRun, notes: Vec<String>) -> Other {
        let (name, root, by) = (run.opened.name.clone(), run.root, searched(run).words());
        Other { name, root, by, rows: Vec::new(), points: Vec::new(), notes }
    }

    /// Puts a program of that run beside the lineage whose reported program it is compared with; nothing where it was not measured on
    /// held-out scenes.
    pub fn add(&mut self, run: &RecordedRun, own: &SolutionId, theirs: &SolutionId, other: &RecordedRun) {
        let results = run.result.iter().flat_map(|result| &result.lineages);
        let lineages = results.filter(|of| of.evolved.solution == *own).map(|of| of.lineage.clone());
        let Some(held_out) = other.held_out.iter().find(|of| of.solution == *theirs) else { return };
        self.points.extend(lineages.map(|lineage| {
            OtherPoint {
                lineage,
                measured: Measured::new(theirs.clone(), &held_out.score),
                scenes: held_out.score.scenes.len(),
                spread: spread::of(&held_out.score.scenes, held_out.score.rules.mean)
                    .filter(|_| held_out.score.benchmark.is_none()),
            }
        }));
    }
}
