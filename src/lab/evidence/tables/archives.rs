//! Archives of a recorded SafeBench run by lineage, for the tables: the archive after every round, run by run.

use std::collections::{BTreeMap, BTreeSet};

use super::basis::{Leaf, Repetition as Part};
use super::error::TableError;
use super::key::Of;
use super::labels;
use super::paper::safebench::{METHODS, Method};
use super::searches::{self, Repeated, Repetition};
use super::stopped;
use crate::evaluation::{Group, Runs};
use crate::evidence::recorded_run::RecordedRun;
use crate::kernel::num;
use crate::objects::benchmark::{ArchiveRound, Benchmark, SafebenchRun};
use crate::objects::event::Measured;
use crate::objects::{LineageId, SolutionId, event::LineageResult};
use crate::scene::safebench::TrafficFamily;

/// One lineage of a finished SafeBench run.
#[derive(Clone, Debug)]
pub struct LineageArchive {
    pub lineage: LineageId,
    /// Place of its run among those that the table is made from.
    pub place: usize,
    /// Number of this repetition of its search, from 0.
    pub replica: u32,
    /// The run's name and the beginning of its root.
    pub run: String,
    /// The paper's row that it fills, if it is one of the paper's methods as published.
    pub method: Option<&'static Method>,
    /// The search whose repetition it is: the paper's method, or the lineage's id without its ego.
    pub name: String,
    /// Name in tables.
    pub label: String,
    /// Our name of the ego policy.
    pub ego: String,
    /// The ego as the paper calls it, or as we do.
    pub policy: String,
    /// Rounds from the parent's scenes alone to the last one.
    pub rounds: Vec<Round>,
    /// Frontier gain of every group, percent.
    pub gains_pct: BTreeMap<Group, f64>,
    /// Baseline of changes, round by round: the parent, drawn as often; empty where nobody drew it.
    pub redrawn: Vec<Round>,
    /// Its frontier gains.
    pub redrawn_gains_pct: BTreeMap<Group, f64>,
    /// Distinct rollouts that its labels rest on.
    pub rollouts: usize,
    /// Kinds of the models that proposals came from.
    pub proposals: String,
    /// Reason why there is no gain, where there is none.
    pub stopped: Option<String>,
}

/// Runs that balanced selection keeps after a round, or the runs of one program.
#[derive(Clone, Debug, Default)]
pub struct Round {
    pub runs: BTreeMap<Group, Vec<SafebenchRun>>,
    /// Scenes of a group that could not be run; balanced selection keeps none.
    pub failures: BTreeMap<Group, usize>,
}

/// The part of an archive that is resampled.
#[derive(Clone, Copy, Debug)]
pub struct Archived<'a> {
    pub rounds: &'a [Round],
    /// Frontier gain of every group, percent.
    pub gains_pct: &'a BTreeMap<Group, f64>,
    pub redrawn: &'a [Round],
    pub redrawn_gains_pct: &'a BTreeMap<Group, f64>,
}

/// Scores of an archive, or of a draw of its groups.
#[derive(Clone, Debug, Default)]
pub struct Scores {
    /// Scores after each round.
    pub rounds: Vec<Option<Benchmark>>,
    /// Scores that these are compared with, round by round.
    pub redrawn: Vec<Option<Benchmark>>,
    /// Mean frontier gain over the groups, percent.
    pub gain_pct: Option<f64>,
    pub redrawn_gain_pct: Option<f64>,
}

impl Archived<'_> {
    /// Every group of the study, also those without a scene.
    pub fn groups(&self) -> BTreeSet<Group> {
        self.gains_pct.keys().copied().chain(self.rounds.iter().flat_map(Round::groups)).collect()
    }

    /// Scores over these groups; one that is named twice counts twice.
    pub fn scores(&self, groups: &[Group]) -> Scores {
        let of = |rounds: &[Round]| rounds.iter().map(|round| round.scores(groups.iter().copied())).collect();
        let gain = |gains: &BTreeMap<Group, f64>| {
            num::mean(&groups.iter().filter_map(|group| gains.get(group)).copied().collect::<Vec<f64>>())
        };
        Scores {
            rounds: of(self.rounds),
            redrawn: of(self.redrawn),
            gain_pct: gain(self.gains_pct),
            redrawn_gain_pct: gain(self.redrawn_gains_pct),
        }
    }
}

impl Round {
    /// Its groups, also those in which nothing could be run.
    pub fn groups(&self) -> BTreeSet<Group> {
        self.runs.keys().chain(self.failures.keys()).copied().collect()
    }

    /// Scores of the runs of these groups; one that is named twice counts twice. `None` without a run.
    pub fn scores(&self, groups: impl IntoIterator<Item = Group>) -> Option<Benchmark> {
        let mut runs = Runs::default();
        for group in groups {
            self.runs.get(&group).into_iter().flatten().for_each(|run| runs.add(group, *run));
            (0..self.failures.get(&group).copied().unwrap_or(0)).for_each(|_| runs.add_failure(group));
        }
        runs.benchmark()
    }
}

impl LineageArchive {
    /// Returns its part of a number; the part's programs are those that the leaves name.
    pub(super) fn part(&self, value: Option<f64>, leaves: Vec<Leaf>) -> Part {
        let mut programs: Vec<SolutionId> = leaves.iter().flat_map(|leaf| leaf.programs.clone()).collect();
        programs.sort();
        programs.dedup();
        let part = Part::of(self.name.clone(), self.place, self.lineage.to_string(), value, leaves);
        Part { replica: self.replica, programs, ..part }
    }

    /// Returns its name in a row's key.
    pub fn key(&self) -> Of<LineageId> {
        Of { run: self.place, of: self.lineage.clone() }
    }

    /// Every group of the study, also those without a scene.
    pub fn groups(&self) -> BTreeSet<Group> {
        self.archived().groups()
    }

    /// Returns what intervals are drawn from.
    pub fn archived(&self) -> Archived<'_> {
        let LineageArchive { rounds, gains_pct, redrawn, redrawn_gains_pct, .. } = self;
        Archived { rounds, gains_pct, redrawn, redrawn_gains_pct }
    }

    /// Scores over all its groups.
    pub fn scores(&self) -> Scores {
        self.archived().scores(&self.groups().into_iter().collect::<Vec<Group>>())
    }

    /// Scenes that balanced selection keeps after the last round.
    pub fn scenes(&self) -> usize {
        self.rounds.last().map_or(0, |round| round.runs.values().map(Vec::len).sum())
    }
}

impl Repeated for LineageArchive {
    fn repetition(&self) -> Repetition<'_> {
        Repetition {
            name: &self.name,
            label: &self.label,
            ego: &self.ego,
            policy: &self.policy,
            replica: self.replica,
            lineage: self.lineage.as_str(),
            run: &self.run,
            stopped: self.stopped.as_deref(),
        }
    }
}

/// All lineages of these runs, in their order. No row of a table may come from two of them.
pub fn lineages(recorded_runs: &[RecordedRun]) -> Result<Vec<LineageArchive>, TableError> {
    gathered(recorded_runs, one)
}

/// The same with two rounds in place of the archive's: what the parent and what the program that was chosen did on held-out
/// routes. One program stands against one there, and routes that chose nothing: changes are measured against the parent itself.
pub fn held_out(recorded_runs: &[RecordedRun]) -> Result<Vec<LineageArchive>, TableError> {
    gathered(recorded_runs, |place, recorded_run, result| {
        let played = |of: &Measured| played(recorded_run, result, of);
        let rounds = vec![played(&result.parent)?, played(&result.evolved)?];
        let (redrawn, stopped) = (vec![rounds[0].clone()], stopped::note(recorded_run, result));
        let (gains_pct, redrawn_gains_pct) = Default::default();
        let archive = one(place, recorded_run, result)?;
        Ok(LineageArchive { rounds, gains_pct, redrawn, redrawn_gains_pct, stopped, ..archive })
    })
}

fn gathered(
    recorded_runs: &[RecordedRun],
    one: impl Fn(usize, &RecordedRun, &LineageResult) -> Result<LineageArchive, TableError>,
) -> Result<Vec<LineageArchive>, TableError> {
    let mut all: Vec<LineageArchive> = Vec::new();
    for (place, recorded_run) in recorded_runs.iter().enumerate() {
        let result = labels::result(recorded_run)?;
        if recorded_run.rounds.is_empty() {
            let (found, tables) = ("the MetaDrive protocol", "metadrive-main and metadrive-policy");
            return Err(TableError::OtherProtocol { run: labels::run_name(recorded_run), found, tables });
        }
        for lineage in &result.lineages {
            searches::add(&mut all, one(place, recorded_run, lineage)?)?;
        }
    }
    Ok(all)
}

fn one(place: usize, recorded_run: &RecordedRun, result: &LineageResult) -> Result<LineageArchive, TableError> {
    let mut recorded: Vec<&ArchiveRound> = recorded_run.rounds.iter().filter(|r| r.lineage == result.lineage).collect();
    recorded.sort_by_key(|round| round.round);
    let damaged = |what: String| TableError::Archive {
        run: labels::run_name(recorded_run),
        lineage: result.lineage.clone(),
        what,
    };
    let (Some(first), Some(last)) = (recorded.first(), recorded.last()) else {
        return Err(damaged("holds no round".into()));
    };
    if let Some((place, round)) = recorded.iter().enumerate().find(|(place, round)| round.round as usize != *place) {
        return Err(damaged(format!("names round {} where round {place} is expected", round.round)));
    }
    let redrawn = recorded_run.redrawn.iter().find(|redrawn| redrawn.lineage == result.lineage);
    let before = redrawn.and_then(|redrawn| redrawn.rounds.last()).unwrap_or(first);
    let attack_change = last.benchmark.mean.attack - before.benchmark.mean.attack;
    let descends = last.selected.iter().any(|scene| scene.solution != result.parent.solution);
    let (stem, method) = (labels::stem(result), published(recorded_run, result));
    let group = |name: &String| group(name).ok_or_else(|| damaged(format!("names the group {name:?}")));
    let gains = |of: &BTreeMap<String, f64>| -> Result<BTreeMap<Group, f64>, TableError> {
        of.iter().map(|(name, gain)| Ok((group(name)?, *gain))).collect()
    };
    let round = |recorded: &ArchiveRound| {
        let mut runs: BTreeMap<Group, Vec<SafebenchRun>> = BTreeMap::new();
        for scene in &recorded.selected {
            runs.entry(group(&scene.group)?).or_default().push(scene.run);
        }
        let round = Round { runs, ..Round::default() };
        match round.scores(round.runs.keys().copied()) {
            Some(scores) if scores == recorded.benchmark => Ok(round),
            _ => Err(damaged(format!("holds scores in round {} that are not those of its runs", recorded.round))),
        }
    };
    Ok(LineageArchive {
        lineage: result.lineage.clone(),
        place,
        replica: result.replica,
        run: labels::run_name(recorded_run),
        method,
        name: method.map_or(stem, |method| method.name).to_string(),
        label: method_label(recorded_run, result),
        ego: result.ego.clone(),
        policy: labels::policy(recorded_run, &result.ego),
        gains_pct: gains(&result.pf_area_at_3_pct_by_group)?,
        rounds: recorded.into_iter().map(round).collect::<Result<_, TableError>>()?,
        redrawn_gains_pct: redrawn.map_or(Ok(BTreeMap::new()), |of| gains(&of.pf_area_at_3_pct_by_group))?,
        redrawn: redrawn.iter().flat_map(|of| &of.rounds).map(round).collect::<Result<_, TableError>>()?,
        rollouts: labels::rollouts(recorded_run, &result.lineage),
        proposals: labels::proposals(recorded_run),
        stopped: stopped::archive_note(recorded_run, result, attack_change, descends),
    })
}

/// The method as published that a lineage is; `None` for one that starts from a program of another run, or has another id.
fn published(recorded_run: &RecordedRun, result: &LineageResult) -> Option<&'static Method> {
    let as_published = recorded_run.parents.iter().all(|p| p.lineage != result.lineage || p.origins.is_empty());
    let stem = labels::stem(result).replace('-', "_");
    let own_id = |m: &&Method| m.family == result.family.as_str() && m.family == stem;
    METHODS.iter().filter(|_| as_published).find(own_id)
}

/// Returns the name that tables give a lineage's method in SafeBench's protocol: the paper's name where it is as published.
pub(super) fn method_label(recorded_run: &RecordedRun, result: &LineageResult) -> String {
    let own = METHODS.iter().find(|m| m.family == result.family.as_str());
    let titled = own.map_or(result.family.as_str(), |m| m.name);
    published(recorded_run, result).map_or_else(|| labels::label(titled, result), |method| method.name.to_string())
}

/// Returns the runs of one program on the held-out routes.
fn played(recorded_run: &RecordedRun, result: &LineageResult, of: &Measured) -> Result<Round, TableError> {
    let (run, lineage) = (labels::run_name(recorded_run), result.lineage.clone());
    let measured = recorded_run.held_out.iter().find(|h| h.lineage == lineage && h.solution == of.solution);
    let Some(held_out) = measured else {
        return Err(TableError::NoLabels { run, lineage, solution: of.solution.clone() });
    };
    if held_out.runs.is_empty() {
        return Err(TableError::NoHeldOutRuns { run });
    }
    let damaged = |what: String| TableError::Archive { run: run.clone(), lineage: lineage.clone(), what };
    let mut round = Round::default();
    for one in &held_out.runs {
        let group = group(&one.group).ok_or_else(|| damaged(format!("names the group {:?}", one.group)))?;
        match one.run {
            Some(run) => round.runs.entry(group).or_default().push(run),
            None => *round.failures.entry(group).or_default() += 1,
        }
    }
    match (round.scores(round.groups()), &held_out.score.benchmark) {
        (Some(scores), Some(recorded)) if scores == **recorded => Ok(round),
        _ => Err(damaged(format!("holds held-out scores of {} that are not those of its runs", of.solution))),
    }
}

/// `right_turn/5`.
fn group(name: &str) -> Option<Group> {
    let (family, route) = name.rsplit_once('/')?;
    let family = TrafficFamily::ALL.into_iter().find(|known| known.name() == family)?;
    Some((family, route.parse().ok()?))
}
