//! The control of SafeBench's archive: a search in which the parent itself, drawn anew, takes the place of every program.
//!
//! An archive keeps a few of some dozens of runs in each group, and a parent has hardly more than are kept. So whatever is drawn often gains by
//! that alone. Here each program that was labelled gives its place, the same scenes in the same round, to the parent. Each place plays them
//! under names of its own, because random numbers are drawn by a scene's name. Programs that are alike in effect in a scene play one and
//! the same run there; so does the parent in their places, and where a program does what the parent does it has the parent's own run. What
//! is kept, and who spans the frontier, follows the rules of the search.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use super::finale::FRONTIER_BUDGET;
use super::rounds::{Points, gains_pct};
use crate::archive::{ArchiveOptions, Contender, SelectorOptions, first_by_rule};
use crate::compiler::Prepared;
use crate::epoch::RunError;
use crate::epoch::labelling::applied::{Applied, Labelled};
use crate::epoch::setting::study::SceneEntry;
use crate::evaluation::{EvaluationError, Group, SceneArchive, Selecting, StagedRun, group_points, score};
use crate::kernel::{Digest, Threads};
use crate::objects::benchmark::{ArchiveRound, Redrawn, SafebenchRun};
use crate::objects::{Counsel, LineageId, Program, SceneFailure, SceneScore, Score};
use crate::scene::Scene;
use crate::stage::scene_values;

/// Text between a scene's name and the number of its redraw (docs/OBJECTIVES.md).
const REDRAW: &str = "/redraw";

/// A search whose programs are replaced by its parent.
pub struct Redraw<'a> {
    /// The search's lineage.
    pub lineage: &'a LineageId,
    pub parent: &'a Program,
    /// Conditions of the run.
    pub applied: Applied<'a>,
    /// The scenes that it evolved on.
    pub evolution: &'a [SceneEntry],
    /// The programs that were labelled, in the order of their attempts.
    pub replaced: Vec<Replaced<'a>>,
    /// The archive's last round.
    pub rounds: u32,
    /// Number of descendants that its frontier gain rests on.
    pub descendants: usize,
    /// How balanced selection chooses.
    pub selecting: Selecting,
    pub archive: &'a ArchiveOptions,
    pub selector: &'a SelectorOptions,
}

/// A program that gives its place to the parent.
pub struct Replaced<'a> {
    pub program: &'a Program,
    /// The round of the archive that its runs came with, from 1.
    pub round: u32,
    /// Names of the scenes that it was labelled on for the archive.
    pub scenes: BTreeSet<&'a str>,
}

/// Outcome of a scene in a draw.
type Drawn = Result<(SceneScore, SafebenchRun), SceneFailure>;
/// (Place of a scene, digest of all of a program that decides there) -> the parent's draw in the place of the programs that are alike in it.
type Draws = BTreeMap<(usize, Digest), Drawn>;

/// The parent's runs in the place of one program.
struct Played {
    score: Score,
    runs: Vec<StagedRun>,
    points: Points,
}

impl Redraw<'_> {
    /// Plays it. With it comes the parent's score under the scenes' own names, which the run has on record.
    ///
    /// # Errors
    /// No scene can be labelled.
    pub fn play(&self, threads: &Threads) -> Result<(Score, Redrawn), RunError> {
        let (mut draws, mut archive) = (Draws::new(), SceneArchive::default());
        let own = self.played(self.parent, 0, &mut draws, threads)?;
        archive.add(0, &self.parent.solution_id, own.runs);
        let (mut contenders, mut points) = (Vec::new(), BTreeMap::new());
        for (place, replaced) in self.replaced.iter().enumerate() {
            let played = self.played(replaced.program, place + 1, &mut draws, threads)?;
            let (solution, Score { objectives, coverage, .. }) = (replaced.program.solution_id.clone(), played.score);
            let taken = |run: &StagedRun| replaced.scenes.contains(own_name(&run.scene));
            archive.add(replaced.round, &solution, played.runs.into_iter().filter(taken).collect());
            contenders.push(Contender { solution: solution.clone(), objectives, coverage });
            points.insert(solution, played.points);
        }
        let first = first_by_rule(contenders, self.descendants.min(FRONTIER_BUDGET), self.selector);
        let first: Vec<Points> = first.iter().filter_map(|solution| points.remove(solution)).collect();
        let groups = self.evolution.iter().filter_map(SceneEntry::group);
        let gains = gains_pct(groups, &own.points, &first, FRONTIER_BUDGET, self.archive);
        let rounds = (0..=self.rounds).filter_map(|round| archive.after(round, &self.selecting, self.lineage));
        let redrawn = Redrawn {
            lineage: self.lineage.clone(),
            programs: self.replaced.len(),
            rounds: rounds.map(|round| self.of_parent(round)).collect(),
            pf_area_at_3_pct_by_group: gains,
        };
        Ok((own.score, redrawn))
    }

    /// The archive knows the parent's draws by the programs whose places they took: each has a coverage of its own.
    fn of_parent(&self, mut round: ArchiveRound) -> ArchiveRound {
        round.selected.iter_mut().for_each(|selected| selected.solution = self.parent.solution_id.clone());
        round
    }

    /// The parent in the place of a program: draws of its own for the scenes in which no earlier one is alike in effect.
    fn played(
        &self,
        program: &Program,
        place: usize,
        draws: &mut Draws,
        threads: &Threads,
    ) -> Result<Played, RunError> {
        let prepared = Prepared::new(program, self.applied.source);
        let prepared = prepared.map_err(|failure| RunError::Study(failure.to_string()))?;
        let key = |(at, entry): (usize, &SceneEntry)| Ok((at, prepared.in_effect(&scene_values(entry.features()))?));
        let keys = self.evolution.iter().enumerate().map(key).collect::<Result<Vec<(usize, Digest)>, RunError>>()?;
        let new: Vec<(usize, Digest)> = keys.iter().filter(|key| !draws.contains_key(key)).copied().collect();
        draws.extend(new.iter().copied().zip(self.drawn(&new, place, threads)?));
        let (mut labelled, mut failed, mut runs) = (Vec::new(), Vec::new(), Vec::new());
        for key in &keys {
            let Some(group) = self.evolution[key.0].group() else { continue };
            match draws.get(key) {
                Some(Ok((label, run))) => {
                    runs.push(StagedRun { scene: label.scene.clone(), group, run: *run });
                    labelled.push((group, (label.clone(), *run)));
                }
                Some(Err(failure)) => failed.push((group, failure.clone())),
                None => {}
            }
        }
        let points = group_points(&runs, &failed.iter().map(|(group, _)| *group).collect::<Vec<Group>>());
        let score = score::benchmark_score(labelled, failed);
        let score = score.ok_or_else(|| RunError::Study("no scene of the parent can be labelled".into()))?;
        Ok(Played { score, runs, points })
    }

    /// The parent in these scenes under the names of a place, in their order.
    fn drawn(&self, new: &[(usize, Digest)], place: usize, threads: &Threads) -> Result<Vec<Drawn>, RunError> {
        if new.is_empty() {
            return Ok(Vec::new());
        }
        let scenes = threads.map(new, |_, (at, _)| {
            let scene = Scene::clone(self.evolution[*at].scene());
            let ending = if place == 0 { String::new() } else { format!("{REDRAW}{place:02}") };
            SceneEntry::new(Arc::new(Scene { id: scene.id.clone() + &ending, ..scene }))
        });
        let counsel = |((at, _), renamed): (&(usize, Digest), &SceneEntry)| {
            Some((renamed.digest, self.applied.counsels.get(&self.evolution[*at].digest)?.clone()))
        };
        let counsels: BTreeMap<Digest, Counsel> = new.iter().zip(&scenes).filter_map(counsel).collect();
        let applied = Applied { counsels: &counsels, ..self.applied };
        let labelled = match applied.label(&[self.parent], &scenes, threads) {
            Ok(labelled) => labelled.into_iter().next(),
            Err(RunError::Evaluation(EvaluationError::NoLabel(_))) => None,
            Err(error) => return Err(error),
        };
        let drawn = labelled.map_or_else(BTreeMap::new, |labelled| by_scene(&labelled, &scenes));
        let of = |entry: &SceneEntry| {
            let scene = &entry.scene().id;
            let reason = "the parent has no label under this name".into();
            let failure = || SceneFailure { scene: scene.clone(), reason, too_slow: false, abandoned: false };
            drawn.get(scene.as_str()).cloned().ok_or_else(failure)
        };
        Ok(scenes.iter().map(of).collect())
    }
}

/// The name of a redrawn scene without its ending.
fn own_name(name: &str) -> &str {
    name.rsplit_once(REDRAW).map_or(name, |(own, _)| own)
}

/// Labels beside their runs, by the scene's name. Both stand in the order of the scenes within each group.
fn by_scene(labelled: &Labelled, scenes: &[SceneEntry]) -> BTreeMap<String, (SceneScore, SafebenchRun)> {
    let groups: BTreeMap<&str, Group> =
        scenes.iter().filter_map(|entry| Some((entry.scene().id.as_str(), entry.group()?))).collect();
    let mut runs: BTreeMap<Group, _> = labelled.runs.iter().map(|(group, runs)| (*group, runs.iter())).collect();
    let of = |label: &SceneScore| {
        let run = runs.get_mut(groups.get(label.scene.as_str())?)?.next()?;
        Some((label.scene.clone(), (label.clone(), *run)))
    };
    labelled.score.scenes.iter().filter_map(of).collect()
}
