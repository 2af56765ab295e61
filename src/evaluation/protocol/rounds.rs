//! SafeBench's archive: labelled scenes by group of family and route, and what balanced selection keeps of them after every
//! round (paper, appendix CARLA/SafeBench Protocol).

use std::collections::BTreeMap;

use super::balanced::balanced;
use super::safebench::{Group, Runs};
use crate::objects::benchmark::{ArchiveRound, SafebenchRun, SelectedScene};
use crate::objects::{LineageId, Objectives, SolutionId};

/// A scene's run in its group.
#[derive(Clone, Debug)]
pub struct StagedRun {
    pub scene: String,
    pub group: Group,
    pub run: SafebenchRun,
}

/// Every labelled scene of a lineage, in the order in which it was added.
#[derive(Clone, Debug, Default)]
pub struct SceneArchive(Vec<Archived>);

#[derive(Clone, Debug)]
struct Archived {
    /// The round that added it; 0 for the parent's.
    round: u32,
    solution: SolutionId,
    staged: StagedRun,
}

impl SceneArchive {
    /// Adds the scenes of a program that was labelled in a round.
    pub fn add(&mut self, round: u32, solution: &SolutionId, runs: Vec<StagedRun>) {
        self.0.extend(runs.into_iter().map(|staged| Archived { round, solution: solution.clone(), staged }));
    }

    /// What balanced selection keeps of the scenes up to a round; `None` where there are none.
    pub fn after(&self, round: u32, per_group: usize, lineage: &LineageId) -> Option<ArchiveRound> {
        let so_far: Vec<&Archived> = self.0.iter().filter(|scene| scene.round <= round).collect();
        let runs: Vec<(Group, SafebenchRun)> = so_far.iter().map(|s| (s.staged.group, s.staged.run)).collect();
        let kept = balanced(&runs, per_group);
        let mut selected = Runs::default();
        kept.iter().for_each(|place| selected.add(runs[*place].0, runs[*place].1));
        let scene = |place: &usize| {
            let Archived { solution, staged, .. } = so_far[*place];
            let (attack, realism) = staged.run.point();
            SelectedScene {
                group: group_name(staged.group),
                scene: staged.scene.clone(),
                solution: solution.clone(),
                attack,
                realism,
                run: staged.run,
            }
        };
        let (lineage, benchmark) = (lineage.clone(), selected.benchmark()?);
        Some(ArchiveRound { lineage, round, benchmark, selected: kept.iter().map(scene).collect() })
    }
}

/// A program's point in every group that it has a run in: its score over the group's runs. `failed` holds the group of
/// every scene that could not be run.
pub fn group_points(runs: &[StagedRun], failed: &[Group]) -> BTreeMap<Group, Objectives> {
    let mut by_group = Runs::default();
    runs.iter().for_each(|staged| by_group.add(staged.group, staged.run));
    failed.iter().for_each(|group| by_group.add_failure(*group));
    by_group.groups().into_iter().map(|(group, score)| (group, score.point())).collect()
}

/// A group as events and tables name it.
pub fn group_name((family, route): Group) -> String {
    format!("{}/{route}", family.name())
}
