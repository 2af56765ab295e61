//! Notes of every table on the runs that it was made from.

use std::collections::{BTreeMap, BTreeSet};

use super::error::TableError;
use super::key::RowKey;
use super::labels;
use super::layout::{Column, Row, RunSource};
use super::searches::{self, Repeated};
use crate::evidence::recorded_run::RecordedRun;
use crate::objects::event::{LineageResult, ParentAdopted};
use crate::statistics::bootstrap::{self, Estimate};
use crate::text::counted;

/// The runs as the JSON form lists them.
pub fn runs(runs: &[RecordedRun]) -> Result<Vec<RunSource>, TableError> {
    let source = |run: &RecordedRun| {
        let result = labels::result(run)?;
        Ok(RunSource {
            name: run.opened.name.clone(),
            root: run.root.to_hex(),
            models: run.models(),
            scripted_roles: run.scripted_roles(),
            egos: egos(run),
            setting: run.declared.setting.clone(),
            seeds: seeds(&result.lineages),
            evolution_scenes: run.opened.evolution_scenes.len(),
            held_out_scenes: run.opened.held_out_scenes.len(),
            epochs: result.epochs,
            attempts: result.exits.total(),
            rollouts: result.rollouts,
        })
    };
    runs.iter().map(source).collect()
}

/// The most repetitions of a search.
fn seeds(lineages: &[LineageResult]) -> usize {
    let mut searches: BTreeMap<(&str, &str), usize> = BTreeMap::new();
    lineages.iter().for_each(|of| *searches.entry((of.group.as_str(), of.ego.as_str())).or_default() += 1);
    searches.into_values().max().unwrap_or(0)
}

/// The egos of a run's lineages as tables call them.
fn egos(run: &RecordedRun) -> Vec<String> {
    let named: BTreeSet<String> = run.parents.iter().map(|parent| labels::policy(run, &parent.ego)).collect();
    named.into_iter().collect()
}

/// Explains the intervals of a table, drawn over these units.
pub fn intervals(over: &str) -> String {
    format!(
        "In brackets: 95 % intervals, by the percentile bootstrap over {over} ({} resamples, seed {}); where a search was repeated, Student's \
         t over the means of its seeds and these draws.",
        bootstrap::RESAMPLES,
        bootstrap::SEED.0
    )
}

/// A sentence on each run, and one on each model of which an experiment says more than its label: who answered, when, how.
pub fn of_runs(runs: &[RecordedRun]) -> Vec<String> {
    let mut all: Vec<String> = runs.iter().map(run).collect();
    for recorded in runs {
        let labels: BTreeSet<String> = recorded.models().into_values().collect();
        for (label, provenance) in labels.iter().filter_map(|label| recorded.declared.answered.get_key_value(label)) {
            let said = format!("{label}: {}.", provenance.trim_end_matches('.'));
            if !all.contains(&said) {
                all.push(said);
            }
        }
    }
    all
}

/// One sentence on a run: its size, and what the proposals came from.
fn run(run: &RecordedRun) -> String {
    let opened = &run.opened;
    let from = run.proposals_from();
    let stand_in =
        if run.scripted_roles().is_empty() { "" } else { " (scripted is a rule-based stand-in, not a language model)" };
    let (epochs, attempts, rollouts) =
        run.result.as_ref().map_or((0, 0, 0), |result| (result.epochs, result.exits.total(), result.rollouts));
    let start =
        |parent: &ParentAdopted| Some(format!(" Lineage {} starts from {}.", parent.lineage, parent.origins.last()?));
    let starts: String = run.parents.iter().filter_map(start).collect();
    let left_out = match run.declared.setting.left_out.as_str() {
        "" => String::new(),
        which => format!(" Left out: {which}."),
    };
    format!(
        "Run {}: {} evolution and {}, {}, {}, {}; proposals from {from}{stand_in}.{starts}{}{left_out}",
        labels::run_name(run),
        opened.evolution_scenes.len(),
        counted(opened.held_out_scenes.len(), "held-out scene"),
        counted(epochs as usize, "epoch"),
        counted(attempts, "attempt"),
        counted(rollouts, "rollout"),
        run.seed_note.as_ref().map_or(String::new(), |note| format!(" Note: {note}."))
    )
}

/// Says what intervals of searches that were not repeated do not cover; `None` where all were. `seeds` says how often each was made,
/// `unit` what the intervals are drawn over.
pub fn one_seed(seeds: &[usize], unit: &str) -> Option<String> {
    let once = seeds.iter().filter(|count| **count == 1).count();
    let which = match once {
        0 => return None,
        _ if once == seeds.len() => "One seed is one search: these intervals",
        _ => "Where Seeds is 1, one search was made: such intervals",
    };
    Some(format!(
        "{which} cover {unit} alone. The spread between searches is not in them and may be larger: another seed may give another \
         result. seeds = 5 in an experiment repeats every search."
    ))
}

/// Returns how often each of these searches was made.
pub fn repeats<'a, T: Repeated + 'a>(all: impl Iterator<Item = &'a T>) -> Vec<usize> {
    searches::searches(all).iter().map(Vec::len).collect()
}

/// Says, under a table, what the bootstrap cannot show where all scenes agree: see [`AllAlike`]. `scenes` is the place of the number of
/// scenes among a row's counts, `is_share` which columns are shares of scenes. A row without a program is 0 by definition and is passed over.
pub fn all_alike(rows: &[Row], scenes: usize, is_share: impl Fn(&Column) -> bool) -> Option<String> {
    let mut alike = AllAlike::default();
    let programs = rows.iter().filter(|row| !row.missing() && !matches!(row.key, RowKey::Replay(_)));
    for (row, cell) in programs.flat_map(|row| row.cells.iter().map(move |cell| (row, cell))) {
        if let (true, Some(ours), Some(count)) = (is_share(&cell.column), cell.ours, row.counts.get(scenes)) {
            alike.add(*count, ours);
        }
    }
    alike.sentence()
}

/// Shares of scenes whose interval has no width because all scenes agree: by the number of scenes, whether one was 0 and whether
/// one was 1.
#[derive(Default)]
pub struct AllAlike(BTreeMap<usize, [bool; 2]>);

impl AllAlike {
    /// Takes a share over so many scenes in.
    pub fn add(&mut self, scenes: usize, share: Estimate) {
        let end = [0.0, 1.0].iter().position(|end| share.interval == Some([*end; 2]));
        if let Some(end) = end.filter(|_| scenes > 0) {
            self.0.entry(scenes).or_default()[end] = true;
        }
    }

    /// An exact one-sided 95 % bound (Clopper and Pearson) for every number of scenes that was met.
    pub fn sentence(&self) -> Option<String> {
        let said = |(count, [none, all]): (&usize, &[bool; 2])| {
            let upper = bootstrap::zero_of_at_most(*count);
            let none = none.then(|| format!("with 0 of {count} the true share may be up to {upper:.3}"));
            let all = all.then(|| format!("with {count} of {count} it may be down to {:.3}", 1.0 - upper));
            [none, all]
        };
        let said: Vec<String> = self.0.iter().flat_map(said).flatten().collect();
        let what = "An interval without width at 0 or 1 says that all scenes agree, not that the share is exact";
        (!said.is_empty()).then(|| format!("{what}: {} (exact one-sided 95 % bound).", said.join("; ")))
    }
}

/// Names the runs whose attack is the experiment's own expression, with that expression.
pub fn own_attack(runs: &[RecordedRun]) -> Vec<String> {
    let own = |run: &RecordedRun| {
        let when = run.opened.attack.as_ref()?;
        Some(format!(
            "Attack of run {} is the experiment's own, where the program acts: {when}. No row of the paper's stands beside it.",
            labels::run_name(run)
        ))
    };
    runs.iter().filter_map(own).collect()
}

/// Refuses runs whose attacks are different measures: their difference says nothing.
pub fn one_attack(runs: &[RecordedRun]) -> Result<(), TableError> {
    let Some(pair) = runs.windows(2).find(|pair| pair[0].opened.attack != pair[1].opened.attack) else {
        return Ok(());
    };
    let attack_of = |run: &RecordedRun| run.opened.attack.clone().unwrap_or_else(|| "the protocol's".into());
    Err(TableError::OtherAttack {
        first: labels::run_name(&pair[0]),
        of_first: attack_of(&pair[0]),
        second: labels::run_name(&pair[1]),
        of_second: attack_of(&pair[1]),
    })
}

/// Warns where different versions made the runs, so that comparing them needs care.
pub fn different_versions(runs: &[RecordedRun]) -> Option<String> {
    let differ = runs.windows(2).any(|pair| pair[0].opened.versions != pair[1].opened.versions);
    differ.then(|| "The runs were made by different versions of simulator, evaluation or adapters.".into())
}
