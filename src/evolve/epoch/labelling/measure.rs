//! Objectives of a set of labels under the study's protocol, for the archive's gates. So the gates compare the same
//! quantities that are reported as objectives: in SafeBench's protocol scores of groups and no means of single runs.

use std::collections::BTreeMap;

use crate::archive::{Account, MeanOverScenes, Means, Measure};
use crate::epoch::RunError;
use crate::epoch::setting::desk::Tools;
use crate::epoch::setting::study::Study;
use crate::evaluation::{Group, RolloutCache, Runs, SafebenchOptions, StagedRun, group_name, recorded_run};
use crate::kernel::Digest;
use crate::objects::benchmark::{HeldOutRun, SafebenchRun};
use crate::objects::{SceneScore, Score};

/// The measure for comparing these scores.
pub fn measure(study: &Study, scores: &[&Score], tools: &Tools<'_>) -> Result<Box<dyn Measure>, RunError> {
    let Some(options) = study.evaluation.safebench() else {
        return Ok(Box::new(MeanOverScenes { mean: study.evaluation.realism_mean() }));
    };
    let groups = groups(study, &study.evolution);
    let mut runs = BTreeMap::new();
    for scene in scores.iter().flat_map(|score| &score.scenes) {
        if let Some(staged) = staged_run(scene, &groups, options, tools)? {
            runs.insert(scene.request, (staged.group, staged.run));
        }
    }
    Ok(Box::new(GroupScores { runs }))
}

/// SafeBench's score of a set of runs. Runs are known by the key of their rollout.
struct GroupScores {
    runs: BTreeMap<Digest, (Group, SafebenchRun)>,
}

impl Measure for GroupScores {
    fn account(&self, scenes: &[&SceneScore]) -> Account {
        let runs: Vec<(Group, SafebenchRun)> =
            scenes.iter().filter_map(|scene| self.runs.get(&scene.request).copied()).collect();
        let without = (0..runs.len()).map(|left_out| table_means(&runs, Some(left_out)));
        Account { whole: table_means(&runs, None), without: without.collect() }
    }
}

fn table_means(runs: &[(Group, SafebenchRun)], left_out: Option<usize>) -> Means {
    let mut all = Runs::default();
    let kept = runs.iter().enumerate().filter(|(place, _)| Some(*place) != left_out);
    kept.for_each(|(_, (group, run))| all.add(*group, *run));
    let Some(table) = all.table() else { return Means { attack: 0.0, realism: None, coverage: 0.0 } };
    let share = |x: f64| x.clamp(0.0, 1.0);
    let (attack, realism, coverage) = (share(table.attack), share(table.realism), share(table.coverage));
    Means { attack, realism: (coverage > 0.0 || realism > 0.0).then_some(realism), coverage }
}

/// The labelled runs of a score, read back from their records.
pub fn staged_runs(
    study: &Study,
    options: &SafebenchOptions,
    score: &Score,
    tools: &Tools<'_>,
) -> Result<Vec<StagedRun>, RunError> {
    let groups = groups(study, &study.evolution);
    let run = |scene: &SceneScore| staged_run(scene, &groups, options, tools).transpose();
    score.scenes.iter().filter_map(run).collect()
}

/// Returns the outcomes of the held-out scenes that a score is of, in its study's order; empty outside SafeBench's protocol.
pub fn held_out_runs(study: &Study, score: &Score, tools: &Tools<'_>) -> Result<Vec<HeldOutRun>, RunError> {
    let Some(options) = study.evaluation.safebench() else { return Ok(Vec::new()) };
    let groups = groups(study, &study.held_out);
    let labels: BTreeMap<&str, &SceneScore> = score.scenes.iter().map(|label| (label.scene.as_str(), label)).collect();
    let mut runs = Vec::with_capacity(study.held_out.len());
    for &place in &study.held_out {
        let scene = study.scenes[place].scene().id.as_str();
        let Some(group) = groups.get(scene) else { continue };
        let staged = match labels.get(scene) {
            Some(label) => staged_run(label, &groups, options, tools)?,
            None => None,
        };
        runs.push(HeldOutRun { group: group_name(*group), scene: scene.into(), run: staged.map(|staged| staged.run) });
    }
    Ok(runs)
}

fn staged_run(
    scene: &SceneScore,
    groups: &BTreeMap<&str, Group>,
    options: &SafebenchOptions,
    tools: &Tools<'_>,
) -> Result<Option<StagedRun>, RunError> {
    let Some(group) = groups.get(scene.scene.as_str()) else { return Ok(None) };
    let Some((record, _)) = tools.rollouts.recorded(&scene.request)? else { return Ok(None) };
    let run = recorded_run(&record, options);
    Ok(run.map(|run| StagedRun { scene: scene.scene.clone(), group: *group, run }))
}

/// Groups of some of a study's scenes by the scenes' ids.
pub fn groups<'s>(study: &'s Study, places: &[usize]) -> BTreeMap<&'s str, Group> {
    let entries = places.iter().map(|&place| &study.scenes[place]);
    entries.filter_map(|entry| Some((entry.scene().id.as_str(), entry.group()?))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluation::point_of;
    use crate::evaluation::protocol::safebench::samples::run;
    use crate::objects::fixture::scene_score;
    use crate::scene::safebench::TrafficFamily;

    fn scene(name: &str, run: &SafebenchRun) -> SceneScore {
        let (attack, realism) = point_of(run);
        scene_score(name, attack, realism)
    }

    #[test]
    fn gates_compare_scores_of_all_runs_and_not_means_of_single_labels() {
        let (crashed, passed) = (run(true, true), run(false, true));
        let scenes = [scene("crashed", &crashed), scene("passed", &passed)];
        let group = |run: SafebenchRun| ((TrafficFamily::RightTurn, 4), run);
        let measure =
            GroupScores { runs: [(scenes[0].request, group(crashed)), (scenes[1].request, group(passed))].into() };
        let account = measure.account(&scenes.iter().collect::<Vec<_>>());
        let mut runs = Runs::default();
        [crashed, passed].into_iter().for_each(|run| runs.add((TrafficFamily::RightTurn, 4), run));
        let objectives = runs.benchmark().unwrap().mean;
        assert_eq!((account.whole.attack, account.whole.realism), (objectives.attack, Some(objectives.realism)));
        let mean = MeanOverScenes::default().account(&scenes.iter().collect::<Vec<_>>()).whole.attack;
        assert!(mean > 1.5 * account.whole.attack, "{mean} {}", account.whole.attack);
        // One left out: the other alone.
        assert_eq!(account.without.iter().map(|m| m.attack).collect::<Vec<_>>(), [0.0, scenes[0].attack]);
    }
}
