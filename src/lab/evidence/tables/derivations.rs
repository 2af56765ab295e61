//! Derivation of the cells of tables from recorded runs. A column holds its [`Source`]: a table takes the number from what that derives,
//! and `why` and `impact` ask for it again.

use std::cell::OnceCell;
use std::collections::BTreeMap;
use std::fmt;
use std::sync::Arc;

use super::archives::{self, LineageArchive};
use super::basis::{Combine, Derivation, Leaf, Repetition};
use super::error::TableError;
use super::frontier::Spanned;
use super::key::{RowKey, Side};
use super::labels::{self, LineageLabels, Reading, ReplayLabels};
use super::searches;
use crate::evidence::recorded_run::RecordedRun;
use crate::objects::event::LineageResult;
use crate::objects::replay::ReplayScene;
use crate::objects::{LabelRules, LineageId, RealismMean, SceneScore, SolutionId};

/// Source that a cell is computed from.
#[derive(Clone)]
pub enum Source {
    /// Made when it is asked for: all leaves of all cells would fill the memory.
    Derived(Arc<Derive>),
    /// No parts that can be listed one by one, and what it rests on instead.
    Undivided(&'static str),
}

type Derive = dyn Fn(&Derivations<'_>, &RowKey) -> Option<Derivation> + Send + Sync;

impl fmt::Debug for Source {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(if let Source::Undivided(rests) = self { rests } else { "derived" })
    }
}

impl Source {
    /// Source of cells whose records are not those of runs.
    pub const ELSEWHERE: Source = Source::Undivided("its records are not those of a run");

    pub(super) fn of(
        derive: impl Fn(&Derivations<'_>, &RowKey) -> Option<Derivation> + Send + Sync + 'static,
    ) -> Source {
        Source::Derived(Arc::new(derive))
    }

    /// No number in this row.
    pub(super) fn none() -> Source {
        Source::of(|_, _| None)
    }

    /// The mean over the held-out labels of one side of a row's lineages.
    pub(super) fn means(
        side: Side,
        read: impl Fn(&SceneScore) -> Option<f64> + Clone + Send + Sync + 'static,
        what: impl Into<String>,
    ) -> Source {
        let what = what.into();
        Source::of(move |bases, row| bases.means(&bases.lineages_of(row), side, read.clone(), &what))
    }

    /// Returns what a row's number rests on; `None` where there is no number, or no parts of it.
    pub fn derivation(&self, bases: &Derivations<'_>, row: &RowKey) -> Option<Derivation> {
        if let Source::Derived(derive) = self { derive(bases, row) } else { None }
    }
}

/// A number of a scene without a program, by the rules of its run.
pub(super) type ReplayRead = fn(&ReplayScene, &LabelRules) -> Option<f64>;

type ByProgram<'s> = BTreeMap<(&'s SolutionId, &'s str), &'s SceneScore>;

/// Records of runs that cells are derived from, each gathered once, when it is first asked for.
pub struct Derivations<'s> {
    pub(super) runs: &'s [RecordedRun],
    /// Labels by run, program and scene.
    labels: OnceCell<Vec<ByProgram<'s>>>,
    /// Lineages by run.
    lineages: OnceCell<Vec<Vec<LineageLabels>>>,
    archives: OnceCell<Vec<LineageArchive>>,
    held_out: OnceCell<Vec<LineageArchive>>,
    replays: OnceCell<Vec<ReplayLabels>>,
}

/// Returns the value; gathers it first where that was not done yet, which may fail.
fn once<T>(known: &OnceCell<T>, gather: impl FnOnce() -> Result<T, TableError>) -> Result<&T, TableError> {
    if let Some(known) = known.get() {
        return Ok(known);
    }
    let gathered = gather()?;
    Ok(known.get_or_init(|| gathered))
}

impl<'s> Derivations<'s> {
    /// Begins with nothing gathered, for tables that were made from these runs.
    pub fn of(runs: &'s [RecordedRun]) -> Derivations<'s> {
        let [archives, held_out] = [OnceCell::new(), OnceCell::new()];
        let (labels, lineages, replays) = (OnceCell::new(), OnceCell::new(), OnceCell::new());
        Derivations { runs, labels, lineages, archives, held_out, replays }
    }

    /// The label of a program of a run in a scene.
    pub fn label(&self, run: usize, solution: &SolutionId, scene: &str) -> Option<&'s SceneScore> {
        let labelled = |run: &'s RecordedRun| -> ByProgram<'s> {
            let scores = run.scores();
            scores.flat_map(|(_, of, _, score)| score.scenes.iter().map(move |l| ((of, l.scene.as_str()), l))).collect()
        };
        let labels = self.labels.get_or_init(|| self.runs.iter().map(labelled).collect());
        labels.get(run)?.get(&(solution, scene)).copied()
    }

    /// The lineages of every run, in their order.
    pub(super) fn by_run(&self) -> Result<&Vec<Vec<LineageLabels>>, TableError> {
        once(&self.lineages, || (0..self.runs.len()).map(|place| labels::of_run(self.runs, place)).collect())
    }

    /// All of them. No row of a table may come from two.
    pub(super) fn lineages(&self) -> Result<Vec<&LineageLabels>, TableError> {
        let mut all: Vec<&LineageLabels> = Vec::new();
        for lineage in self.by_run()?.iter().flatten() {
            searches::add(&mut all, lineage)?;
        }
        Ok(all)
    }

    /// The lineages of one run.
    pub(super) fn run(&self, place: usize) -> Vec<&LineageLabels> {
        self.by_run().ok().and_then(|runs| runs.get(place)).into_iter().flatten().collect()
    }

    /// The archives of all lineages in SafeBench's protocol.
    pub(super) fn archives(&self) -> Result<&Vec<LineageArchive>, TableError> {
        once(&self.archives, || archives::lineages(self.runs))
    }

    /// Returns what their parents and chosen programs did on held-out routes.
    pub(super) fn held_out(&self) -> Result<&Vec<LineageArchive>, TableError> {
        once(&self.held_out, || archives::held_out(self.runs))
    }

    /// The held-out scenes without a program.
    pub(super) fn replays(&self) -> Result<&Vec<ReplayLabels>, TableError> {
        once(&self.replays, || labels::replays(self.runs))
    }

    /// The lineages of a row.
    pub(super) fn lineages_of(&self, row: &RowKey) -> Vec<&LineageLabels> {
        let all = self.by_run().into_iter().flatten().flatten();
        all.filter(|l| row.has(l.place, &l.lineage)).collect()
    }

    pub(super) fn result(&self, place: usize, lineage: &LineageId) -> Option<(&'s RecordedRun, &'s LineageResult)> {
        let run = self.runs.get(place)?;
        Some((run, run.result_of(lineage)?))
    }

    /// Means of a reading over held-out labels, as the lineages' realism is summed up.
    pub(super) fn read(&self, lineages: &[&LineageLabels], side: Side, reading: Reading) -> Option<Derivation> {
        let mean = |l: &&LineageLabels| self.runs.get(l.place).map(|run| run.label_rules().mean);
        let reading = reading.by(lineages.iter().all(|l| mean(l) == Some(RealismMean::Plain)));
        self.means(lineages, side, reading.of, reading.words)
    }

    /// Means of a number over held-out labels; none of best descendants where a lineage has none.
    pub(super) fn means(
        &self,
        lineages: &[&LineageLabels],
        side: Side,
        read: impl Fn(&SceneScore) -> Option<f64> + Send + Sync + 'static,
        what: &str,
    ) -> Option<Derivation> {
        if side == Side::Endpoint && lineages.iter().any(|l| l.endpoint.is_none()) {
            return None;
        }
        let part = |l: &&LineageLabels| -> Option<Repetition> {
            let (run, result) = self.result(l.place, &l.lineage)?;
            let programs = programs(side, result);
            let scenes = l.read(side, &read);
            let leaf = |(scene, value): (&String, &Option<f64>)| Leaf::scene(scene, &programs, *value);
            let leaves = run.opened.held_out_scenes.iter().zip(&scenes.values).map(leaf).collect();
            Some(l.part(programs.clone(), None, leaves).over(scenes))
        };
        let parts = lineages.iter().filter_map(part).collect();
        let change = if side == Side::Change { "evolved minus parent, scene by scene, of " } else { "" };
        let formula = format!("{SEARCHES} the mean over held-out scenes of {change}{what}");
        Some(Derivation { read: Some(Arc::new(read)), ..Derivation::of(formula, Combine::Means, parts) })
    }

    /// PF-Area@3, worked out again from the held-out objectives of the parent and of the chosen descendants, or as the sealed
    /// results have it where the archive's options are not at hand.
    pub(super) fn frontier(&self, lineages: &[&LineageLabels]) -> Derivation {
        let what = "PF-Area@3, a number of a lineage: 100 times the frontier area that the first three finalists by the reporting rule add to \
                    the parent's, over the parent's, on held-out objectives";
        let mut derivation = self.spanned(lineages, what, |of| of.gain_pct);
        for part in &mut derivation.parts {
            let result = self.result(part.run, &LineageId::new(part.lineage.as_str()));
            part.sealed = result.map(|(_, result)| result.pf_area_at_3_pct);
            part.value = part.value.or(part.sealed);
        }
        derivation
    }

    /// A number of what spans each lineage's held-out front.
    pub(super) fn spanned(&self, of: &[&LineageLabels], what: &str, number: fn(&Spanned) -> f64) -> Derivation {
        let part = |l: &&LineageLabels| -> Option<Repetition> {
            let (run, result) = self.result(l.place, &l.lineage)?;
            let counts = |roles: &[String]| roles.iter().any(|role| role == "parent" || role == "descendant");
            let own = run.held_out.iter().filter(|h| h.lineage == l.lineage && counts(&h.roles));
            let programs: Vec<SolutionId> = own.map(|held_out| held_out.solution.clone()).collect();
            let leaf = |scene: &String| Leaf::scene(scene, &programs, None);
            let leaves = run.opened.held_out_scenes.iter().map(leaf).collect();
            let spanned = Spanned::of(run, result);
            let value = spanned.as_ref().map(number);
            let steps = spanned.map_or(Vec::new(), |spanned| spanned.steps);
            Some(Repetition { steps, ..l.part(programs.clone(), value, leaves) })
        };
        let parts = of.iter().filter_map(part).collect();
        Derivation::of(format!("{SEARCHES} {what}"), Combine::Means, parts)
    }

    /// A difference of lineages to others, from what `read` gives of each; of those that both have.
    pub(super) fn paired(
        &self,
        own: &[&LineageLabels],
        others: &[&LineageLabels],
        read: Reading,
    ) -> Option<Derivation> {
        let shared = |of: &[&LineageLabels], with: &[&LineageLabels]| {
            let shared = of.iter().copied().filter(|one| one.counterpart(with.iter().copied()).is_some());
            self.read(&shared.collect::<Vec<_>>(), Side::Evolved, read)
        };
        let terms = vec![shared(others, own)?, shared(own, others)?];
        let formula = "the second term minus the first, paired by lineage and scene, over scenes that count in both";
        Some(Derivation { terms, ..Derivation::of(formula.into(), Combine::Paired, Vec::new()) })
    }

    /// Means over the scenes without a program.
    pub(super) fn replayed(&self, row: &RowKey, read: ReplayRead) -> Derivation {
        let part = |replay: &ReplayLabels| -> Repetition {
            let rules = self.runs.get(replay.place).map(|run| run.label_rules()).unwrap_or_default();
            let read = |scene: &ReplayScene| read(scene, &rules);
            let leaf = |scene: &ReplayScene| {
                let realism = scene.realism.map_or("none".into(), |r| r.to_string());
                let note = Some(format!("contact {}, realism {realism}", scene.contact));
                Leaf { note, ..Leaf::scene(&scene.scene, &[], read(scene)) }
            };
            let leaves = replay.scenes.iter().flatten().map(leaf).collect();
            let (search, lineage) = (format!("{} {}", replay.suite, replay.ego), format!("replay/{}", replay.ego));
            Repetition::of(search, replay.place, lineage, None, leaves).over(replay.per_scene(read))
        };
        let own = self.replays().into_iter().flatten().filter(|replay| row.egos().contains(&replay.key()));
        let formula =
            "mean over runs with other scenes or egos of the mean over held-out scenes played without a program";
        Derivation::of(formula.into(), Combine::Means, own.map(part).collect())
    }
}

/// Beginning of a formula.
pub(super) const SEARCHES: &str = "mean over searches of the mean over their repetitions of";

fn programs(side: Side, result: &LineageResult) -> Vec<SolutionId> {
    let (parent, evolved) = (result.parent.solution.clone(), result.evolved.solution.clone());
    match side {
        Side::Parent => vec![parent],
        Side::Evolved => vec![evolved],
        Side::Endpoint => result.endpoint.iter().map(|endpoint| endpoint.solution.clone()).collect(),
        Side::AtFloor(place) => result.at_realism.get(place).map(|of| of.chosen.solution.clone()).into_iter().collect(),
        Side::Change => vec![parent, evolved],
    }
}
