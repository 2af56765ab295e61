//! SafeBench's archive: labelled scenes by group of family and route, and the ones that balanced selection keeps after every
//! round (paper, appendix CARLA/SafeBench Protocol).

use std::collections::{BTreeMap, BTreeSet};

use super::balanced::balanced;
use super::safebench::{Group, Runs, point_of};
use crate::objects::benchmark::{ArchiveRound, SafebenchRun, SelectedScene};
use crate::objects::{LineageId, Objectives, SolutionId};

/// A scene's run in its group.
#[derive(Clone, Debug)]
pub struct StagedRun {
    /// The scene's name.
    pub scene: String,
    /// The scene's family and route.
    pub group: Group,
    /// Labels of the run.
    pub run: SafebenchRun,
}

impl StagedRun {
    /// Returns `true` if the run counts for its program: if that acts in the scene, or all runs are judged.
    fn counts(&self) -> bool {
        self.run.realism.is_judged()
    }
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

/// Settings of balanced selection.
#[derive(Clone, Copy, Debug)]
pub struct Selecting {
    /// Runs kept in every group.
    pub per_group: usize,
    /// Share of the parent's coverage below which none of a program's scenes is kept, 1.
    pub coverage_floor: f64,
}

impl SceneArchive {
    /// Adds the scenes of a program that was labelled in a round.
    pub fn add(&mut self, round: u32, solution: &SolutionId, runs: Vec<StagedRun>) {
        self.0.extend(runs.into_iter().map(|staged| Archived { round, solution: solution.clone(), staged }));
    }

    /// Returns the scenes up to a round that balanced selection keeps; `None` where there are none. Only runs that count for
    /// their program can be kept, of programs that act about as often as the parent. A group without any keeps the parent's
    /// scenes, so that it does not vanish from the result.
    pub fn after(&self, round: u32, selecting: &Selecting, lineage: &LineageId) -> Option<ArchiveRound> {
        let covering = self.covering(selecting.coverage_floor);
        let eligible = |scene: &Archived| scene.staged.counts() && covering.contains(&scene.solution);
        let acted_in: BTreeSet<Group> =
            self.0.iter().filter(|s| s.round <= round && eligible(s)).map(|s| s.staged.group).collect();
        let stands_in = |scene: &Archived| scene.round == 0 && !acted_in.contains(&scene.staged.group);
        let so_far: Vec<&Archived> =
            self.0.iter().filter(|scene| scene.round <= round && (eligible(scene) || stands_in(scene))).collect();
        let runs: Vec<(Group, SafebenchRun)> = so_far.iter().map(|s| (s.staged.group, s.staged.run)).collect();
        let kept = balanced(&runs, selecting.per_group);
        let mut selected = Runs::default();
        kept.iter().for_each(|place| selected.add(runs[*place].0, runs[*place].1));
        let scene = |place: &usize| {
            let Archived { solution, staged, .. } = so_far[*place];
            let (attack, realism) = point_of(&staged.run);
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

    /// Returns programs of whose scenes a share counts that is at least `floor` times the parent's, and one scene at least.
    fn covering(&self, floor: f64) -> BTreeSet<&SolutionId> {
        let mut counts: BTreeMap<&SolutionId, (usize, usize)> = BTreeMap::new();
        for scene in &self.0 {
            let (counting, all) = counts.entry(&scene.solution).or_default();
            *counting += usize::from(scene.staged.counts());
            *all += 1;
        }
        let share = |(counting, all): (usize, usize)| counting as f64 / all.max(1) as f64;
        let parent = self.0.iter().find(|scene| scene.round == 0).and_then(|scene| counts.get(&scene.solution));
        let least = floor * parent.copied().map_or(0.0, share);
        counts.into_iter().filter(|(_, count)| count.0 > 0 && share(*count) >= least).map(|(name, _)| name).collect()
    }
}

/// A program's point in every group in which a run counts: its score over the group's runs. `failed` holds the group of every
/// scene that could not be run.
pub fn group_points(runs: &[StagedRun], failed: &[Group]) -> BTreeMap<Group, Objectives> {
    let mut by_group = Runs::default();
    runs.iter().for_each(|staged| by_group.add(staged.group, staged.run));
    failed.iter().for_each(|group| by_group.add_failure(*group));
    let counting: BTreeSet<Group> = runs.iter().filter(|staged| staged.counts()).map(|staged| staged.group).collect();
    let points = by_group.groups().into_iter().filter(|(group, _)| counting.contains(group));
    points.map(|(group, score)| (group, score.point())).collect()
}

/// A group as events and tables name it.
pub fn group_name((family, route): Group) -> String {
    format!("{}/{route}", family.name())
}

#[cfg(test)]
mod tests {
    use super::super::safebench::samples::run;
    use super::*;
    use crate::objects::benchmark::RunRealism;
    use crate::scene::safebench::TrafficFamily::{LaneChanging, RightTurn};

    const SELECTING: Selecting = Selecting { per_group: 2, coverage_floor: 0.5 };

    fn staged(group: Group, collision: bool, acted: bool) -> StagedRun {
        let scene = format!("{}/{}", group_name(group), u8::from(collision));
        let mut run = run(collision, true);
        if !acted {
            run.realism = RunRealism { acted: false, valid: false, sub_scores: [0.0; 4] };
        }
        StagedRun { scene, group, run }
    }

    #[test]
    fn an_idle_program_spans_area_and_is_selected_where_all_runs_are_judged() {
        let mut idle = staged((RightTurn, 4), false, false);
        assert!(group_points(std::slice::from_ref(&idle), &[]).is_empty());
        idle.run.realism = RunRealism { acted: false, valid: true, sub_scores: [1.0; 4] };
        assert!(group_points(std::slice::from_ref(&idle), &[])[&(RightTurn, 4)].realism > 0.99);
        let mut archive = SceneArchive::default();
        archive.add(0, &SolutionId::new("parent"), vec![staged((RightTurn, 4), false, false)]);
        archive.add(1, &SolutionId::new("idle"), vec![idle]);
        assert_eq!(solutions(&archive, 1), ["idle"]);
    }

    fn solutions(archive: &SceneArchive, round: u32) -> Vec<String> {
        let after = archive.after(round, &SELECTING, &LineageId::new("human-idm")).unwrap();
        after.selected.into_iter().map(|scene| scene.solution.0).collect()
    }

    /// As in human/e0s0: the ego of a scene without action crashes or drives perfectly, and neither is the program's merit.
    #[test]
    fn a_program_that_does_nothing_is_never_selected_and_adds_no_frontier_point() {
        let groups = [(RightTurn, 4), (LaneChanging, 4)];
        let mut archive = SceneArchive::default();
        archive.add(0, &SolutionId::new("parent"), groups.map(|group| staged(group, false, true)).into());
        let null: Vec<StagedRun> =
            groups.into_iter().flat_map(|g| [staged(g, true, false), staged(g, false, false)]).collect();
        archive.add(1, &SolutionId::new("null"), null.clone());
        assert_eq!(solutions(&archive, 1), ["parent", "parent"]);
        assert_eq!(group_points(&null, &[]), BTreeMap::new());
        archive.add(2, &SolutionId::new("acting"), groups.map(|group| staged(group, true, true)).into());
        assert_eq!(solutions(&archive, 2), ["acting", "parent", "acting", "parent"]);
    }

    #[test]
    fn a_program_that_acts_where_it_is_easy_only_is_not_selected() {
        let all: Vec<Group> = (0..8).map(|route| (RightTurn, route)).collect();
        let mut archive = SceneArchive::default();
        archive.add(0, &SolutionId::new("parent"), all.iter().map(|group| staged(*group, false, true)).collect());
        let picky = all.iter().enumerate().map(|(i, group)| staged(*group, true, i < 3)).collect();
        archive.add(1, &SolutionId::new("picky"), picky);
        assert!(solutions(&archive, 1).iter().all(|name| name == "parent"));
        let half = all.iter().enumerate().map(|(i, group)| staged(*group, true, i < 4)).collect();
        archive.add(2, &SolutionId::new("half"), half);
        assert_eq!(solutions(&archive, 2).iter().filter(|name| *name == "half").count(), 4);
    }

    #[test]
    fn shares_of_scenes_are_compared_however_many_scenes_a_program_has() {
        let all: Vec<Group> = (0..8).map(|route| (RightTurn, route)).collect();
        let acting = |count: usize, of: usize| -> Vec<StagedRun> {
            all[..of].iter().enumerate().map(|(i, group)| staged(*group, true, i < count)).collect()
        };
        let mut archive = SceneArchive::default();
        archive.add(0, &SolutionId::new("parent"), acting(4, 8));
        archive.add(1, &SolutionId::new("few"), acting(1, 2));
        archive.add(1, &SolutionId::new("fewer"), acting(1, 8));
        let found = solutions(&archive, 1);
        // Half of the parent's share of one half is required: one scene of two is enough, one of eight is not.
        assert!(found.contains(&"few".to_string()) && !found.contains(&"fewer".to_string()), "{found:?}");
    }

    #[test]
    fn what_a_later_round_finds_is_not_known_before() {
        let mut archive = SceneArchive::default();
        archive.add(0, &SolutionId::new("parent"), vec![staged((RightTurn, 4), false, false)]);
        archive.add(2, &SolutionId::new("late"), vec![staged((RightTurn, 4), true, true)]);
        assert_eq!(solutions(&archive, 1), ["parent"]);
        assert_eq!(solutions(&archive, 2), ["late"]);
    }

    #[test]
    fn a_program_has_a_point_in_each_group_that_it_acts_in_and_groups_have_names() {
        let runs = [staged((RightTurn, 4), true, true), staged((LaneChanging, 4), false, false)];
        let found = group_points(&runs, &[(RightTurn, 4)]);
        let (attack, _) = point_of(&runs[0].run);
        assert_eq!(found.keys().collect::<Vec<_>>(), [&(RightTurn, 4)]);
        assert!((found[&(RightTurn, 4)].attack - attack).abs() < 1e-12, "{found:?} {attack}");
        assert_eq!(group_name((RightTurn, 4)), format!("{}/4", RightTurn.name()));
    }

    #[test]
    fn a_group_in_which_nobody_acts_keeps_the_parents_scenes() {
        let mut archive = SceneArchive::default();
        archive.add(0, &SolutionId::new("parent"), vec![staged((RightTurn, 4), false, false)]);
        archive.add(1, &SolutionId::new("null"), vec![staged((RightTurn, 4), true, false)]);
        assert_eq!(solutions(&archive, 1), ["parent"]);
    }
}
