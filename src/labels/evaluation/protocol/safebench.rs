//! The SafeBench protocol's scores: runs are gathered by group (family and route), by family, and over all families
//! (paper, appendix CARLA/SafeBench Protocol). OS is of a whole set of runs, never a mean of single runs' scores.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::super::metrics::safebench::{
    Ars, Criteria, SafebenchOptions, ars, attack, criteria, run_realism, staged_run, trace_score,
};
use crate::evaluation::record::RolloutRecord;
use crate::kernel::num;
use crate::objects::Objectives;
use crate::objects::benchmark::{Benchmark, BenchmarkRow, Run, RunRealism, SafebenchRun};
use crate::scene::safebench::TrafficFamily;
use crate::sim::Outcome;

/// The run of an outcome; `None` of a scene that is not staged for a traffic family.
pub fn safebench_run(outcome: &Outcome, options: &SafebenchOptions) -> Option<SafebenchRun> {
    let (run, realism) = (staged_run(outcome)?, run_realism(outcome, &options.ars)?);
    let published = SafebenchRun { run, realism, search_rollouts: None };
    Some(options.preventable.map_or(published, |reading| reading.read(outcome, published)))
}

/// Returns the run of a record, with the cost of the program's own search.
pub fn recorded_run(record: &RolloutRecord, options: &SafebenchOptions) -> Option<SafebenchRun> {
    Some(SafebenchRun { search_rollouts: record.search_rollouts(), ..safebench_run(&record.outcome, options)? })
}

/// Returns the point of a single run in the plane of attack and ARS.
pub fn point_of(run: &SafebenchRun) -> (f64, f64) {
    group_score(&[*run], 0).map(|score| score.point()).map_or((0.0, 0.0), |point| (point.attack, point.realism))
}

/// Scores of a set of runs.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SafebenchScore {
    /// Number of runs behind the scores.
    pub runs: usize,
    /// Scenes that could not be run; they count as invalid.
    pub failures: usize,
    /// SafeBench's sub-metrics.
    pub criteria: Criteria,
    /// CR, 0..=1.
    pub collision_rate: f64,
    /// OS.
    pub overall_score: f64,
    /// ARS of the runs that were judged: those that the program acts in, or all; all zero where there are none.
    pub realism: Ars,
    /// ARS of all runs; one that the program does not act in is not valid.
    pub realism_all: f64,
    /// Share of the runs that the program acts in, 0..=1.
    pub coverage: f64,
    /// CR (1 - OS).
    pub attack: f64,
    /// 100 A R Valid.
    pub trace_score: f64,
    /// Mean number of scenarios simulated against the ego before a run's was chosen, over the runs that tell it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub search_rollouts: Option<f64>,
}

impl SafebenchScore {
    /// Returns the point in the plane of attack and ARS, both 0..=1.
    pub fn point(&self) -> Objectives {
        Objectives { attack: self.attack.clamp(0.0, 1.0), realism: self.realism.ars.clamp(0.0, 1.0) }
    }
}

/// Scores of a set of runs of one group; `None` without a run.
pub fn group_score(runs: &[SafebenchRun], failures: usize) -> Option<SafebenchScore> {
    let criteria = criteria(&runs.iter().map(|r| r.run).collect::<Vec<Run>>())?;
    let of = |runs: Vec<&SafebenchRun>| ars(&runs.iter().map(|r| r.realism).collect::<Vec<RunRealism>>(), failures);
    let all = of(runs.iter().collect())?;
    let acted = runs.iter().filter(|run| run.realism.acted).count();
    let coverage = acted as f64 / runs.len() as f64;
    let realism = of(runs.iter().filter(|run| run.realism.is_judged()).collect()).unwrap_or(Ars {
        ars: 0.0,
        valid_rate: 0.0,
        sub_scores: [0.0; 4],
    });
    let (collision_rate, overall_score) = (criteria.collision_rate, criteria.overall_score());
    let attack = attack(collision_rate, overall_score);
    Some(SafebenchScore {
        runs: runs.len(),
        failures,
        criteria,
        collision_rate,
        overall_score,
        realism,
        realism_all: all.ars,
        coverage,
        attack,
        trace_score: trace_score(attack, realism.ars, realism.valid_rate),
        search_rollouts: num::mean(
            &runs.iter().filter_map(|run| run.search_rollouts.map(f64::from)).collect::<Vec<_>>(),
        ),
    })
}

/// A group: all runs of one family on one route.
pub type Group = (TrafficFamily, u32);

/// Runs and failures by group.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Runs(BTreeMap<Group, (Vec<SafebenchRun>, usize)>);

/// A row of the paper's tables: each family, and their mean.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    /// Scores over all runs of a family, whatever their route.
    pub families: BTreeMap<TrafficFamily, SafebenchScore>,
    /// Means over the families that have a run.
    pub collision_rate: f64,
    /// OS, 0..=1.
    pub overall_score: f64,
    /// ARS of the runs that the program acts in, 0..=1.
    pub realism: f64,
    /// ARS of all runs, 0..=1.
    pub realism_all: f64,
    /// Share of the runs that the program acts in, 0..=1.
    pub coverage: f64,
    /// Share of those that are valid, 0..=1.
    pub valid_rate: f64,
    /// CR (1 - OS) of the two means: the paper's tables give 0.631 (1 - 0.589), no mean of products.
    pub attack: f64,
    /// Mean over the families that tell it.
    pub search_rollouts: Option<f64>,
}

impl Runs {
    /// Adds a run of a group.
    pub fn add(&mut self, group: Group, run: SafebenchRun) {
        self.0.entry(group).or_default().0.push(run);
    }

    /// Adds a scene of a group that could not be run.
    pub fn add_failure(&mut self, group: Group) {
        self.0.entry(group).or_default().1 += 1;
    }

    /// Score of every group that has a run.
    pub fn groups(&self) -> BTreeMap<Group, SafebenchScore> {
        self.0.iter().filter_map(|(group, (runs, failures))| Some((*group, group_score(runs, *failures)?))).collect()
    }

    /// The rows that are recorded; `None` without a run.
    pub fn benchmark(&self) -> Option<Benchmark> {
        let table = self.table()?;
        let families = table.families.iter().map(|(family, score)| (family.name().to_string(), row(score)));
        let mean = BenchmarkRow {
            collision_rate: table.collision_rate,
            overall_score: table.overall_score,
            realism: table.realism,
            valid_rate: table.valid_rate,
            attack: table.attack,
            search_rollouts: table.search_rollouts,
        };
        let (runs, failures) = self.0.values().fold((0, 0), |(runs, failed), of| (runs + of.0.len(), failed + of.1));
        Some(Benchmark { runs, failures, families: families.collect(), mean })
    }

    /// The table over all families; `None` without a run.
    pub fn table(&self) -> Option<Table> {
        let mut gathered: BTreeMap<TrafficFamily, (Vec<SafebenchRun>, usize)> = BTreeMap::new();
        for ((family, _), (runs, failures)) in &self.0 {
            let all = gathered.entry(*family).or_default();
            all.0.extend_from_slice(runs);
            all.1 += failures;
        }
        let families: BTreeMap<TrafficFamily, SafebenchScore> = gathered
            .iter()
            .filter_map(|(family, (runs, failed))| Some((*family, group_score(runs, *failed)?)))
            .collect();
        let mean = |of: fn(&SafebenchScore) -> f64| num::mean(&families.values().map(of).collect::<Vec<f64>>());
        let (collision_rate, overall_score) = (mean(|s| s.collision_rate)?, mean(|s| s.overall_score)?);
        Some(Table {
            collision_rate,
            overall_score,
            realism: mean(|s| s.realism.ars)?,
            realism_all: mean(|s| s.realism_all)?,
            coverage: mean(|s| s.coverage)?,
            valid_rate: mean(|s| s.realism.valid_rate)?,
            attack: attack(collision_rate, overall_score),
            search_rollouts: num::mean(&families.values().filter_map(|s| s.search_rollouts).collect::<Vec<f64>>()),
            families,
        })
    }
}

fn row(score: &SafebenchScore) -> BenchmarkRow {
    BenchmarkRow {
        collision_rate: score.collision_rate,
        overall_score: score.overall_score,
        realism: score.realism.ars,
        valid_rate: score.realism.valid_rate,
        attack: score.attack,
        search_rollouts: score.search_rollouts,
    }
}

/// Runs made by hand, for tests.
#[cfg(any(test, feature = "fixtures"))]
pub mod samples {
    use super::*;

    /// Returns a run that differs from a faultless one in these two things alone.
    pub fn run(collision: bool, valid: bool) -> SafebenchRun {
        SafebenchRun {
            run: Run {
                collision,
                red_lights: 0.0,
                stop_signs: 0.0,
                off_road_m: 0.0,
                route_distance_m: 0.0,
                completion: if collision { 0.5 } else { 1.0 },
                completed_s: (!collision).then_some(12.0),
                acceleration_mps2: 0.0,
                yaw_rate_radps: 0.0,
                lane_invasions: 0.0,
            },
            realism: RunRealism { acted: true, valid, sub_scores: [0.5, 1.0, 1.0, 1.0] },
            search_rollouts: None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::samples::run;
    use super::*;

    #[test]
    fn a_group_is_worked_by_hand() {
        let found = group_score(&[run(true, true), run(false, true)], 0).unwrap();
        // 5/2 + 3 + 0.5 (1 + 0.75 + 1 - 0.2) + 0.6 = 7.375 of 10.1.
        assert!((found.overall_score - 7.375 / 10.1).abs() < 1e-12);
        assert!((found.attack - 0.5 * (1.0 - 7.375 / 10.1)).abs() < 1e-12);
        // 0.4 * 0.5 + 0.6 = 0.8.
        assert!((found.realism.ars - 0.8).abs() < 1e-12);
        assert!((found.trace_score - 100.0 * found.attack * 0.8).abs() < 1e-12);
        assert_eq!(group_score(&[], 4), None);
    }

    #[test]
    fn realism_is_of_the_runs_that_are_acted_in_and_of_none_there_is_none() {
        let mut idle = run(false, true);
        idle.realism = RunRealism { acted: false, valid: false, sub_scores: [0.0; 4] };
        let found = group_score(&[run(true, true), idle], 0).unwrap();
        // 0.8 of the one acted run; over both of them one of two is valid.
        assert!((found.realism.ars - 0.8).abs() < 1e-12 && (found.realism_all - 0.4).abs() < 1e-12);
        assert_eq!(found.coverage, 0.5);
        let nothing = group_score(&[idle, idle], 0).unwrap();
        assert_eq!((nothing.attack, nothing.realism.ars, nothing.coverage), (0.0, 0.0, 0.0));
        assert_eq!(point_of(&idle), (0.0, 0.0));
    }

    #[test]
    fn a_single_run_has_a_point_of_its_own_and_the_mean_of_points_is_not_the_group_s_score() {
        let (crashed, arrived) = (run(true, true), run(false, true));
        // 0 + 3 + 0.5 (1 + 0.5 + 1 - 0) + 0.6 = 4.85 of 10.1, so the attack is 5.25 of 10.1.
        let (attack, realism) = point_of(&crashed);
        assert!((attack - 5.25 / 10.1).abs() < 1e-12 && (realism - 0.8).abs() < 1e-12);
        assert_eq!(point_of(&arrived).0, 0.0);
        // Half of 0.5198 for the mean of the points; half of 1 - 7.375 / 10.1 for the group.
        let group = group_score(&[crashed, arrived], 0).unwrap();
        assert!((0.5 * attack - 0.2599).abs() < 1e-4 && (group.attack - 0.1349).abs() < 1e-4);
    }

    #[test]
    fn groups_stand_apart_and_a_table_is_the_mean_over_families() {
        let mut runs = Runs::default();
        for (family, route, collision) in [
            (TrafficFamily::RightTurn, 4, true),
            (TrafficFamily::RightTurn, 5, false),
            (TrafficFamily::RightTurn, 6, false),
            (TrafficFamily::LaneChanging, 4, true),
        ] {
            runs.add((family, route), run(collision, true));
        }
        runs.add_failure((TrafficFamily::LaneChanging, 4));
        runs.add_failure((TrafficFamily::LaneChanging, 9));
        let recorded = runs.benchmark().unwrap();
        assert_eq!((recorded.runs, recorded.failures), (4, 2));
        let groups = runs.groups();
        assert_eq!(groups.len(), 4, "a group without a run has no score");
        assert_eq!(groups[&(TrafficFamily::LaneChanging, 4)].realism.valid_rate, 0.5);
        let table = runs.table().unwrap();
        assert!((table.collision_rate - (1.0 / 3.0 + 1.0) / 2.0).abs() < 1e-12, "families count alike, not runs");
        assert!((table.valid_rate - (1.0 + 1.0 / 3.0) / 2.0).abs() < 1e-12);
        assert!((table.attack - table.collision_rate * (1.0 - table.overall_score)).abs() < 1e-12);
        assert_eq!(Runs::default().table(), None);
    }
}
