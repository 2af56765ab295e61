//! What every table says of the runs that it was made from.

use std::collections::BTreeMap;

use super::error::TableError;
use super::labels;
use super::layout::RunSource;
use crate::evidence::recorded_run::RecordedRun;
use crate::objects::event::ParentAdopted;

/// The runs as the JSON form lists them.
pub fn runs(runs: &[RecordedRun]) -> Result<Vec<RunSource>, TableError> {
    let source = |run: &RecordedRun| {
        let result = labels::result(run)?;
        Ok(RunSource {
            name: run.opened.name.clone(),
            root: run.root.to_hex(),
            models: run.opened.models.clone(),
            scripted_roles: run.opened.scripted_roles().into_iter().map(String::from).collect(),
            evolution_scenes: run.opened.evolution_scenes.len(),
            held_out_scenes: run.opened.held_out_scenes.len(),
            epochs: result.epochs,
            attempts: result.exits.total(),
            rollouts: result.rollouts,
        })
    };
    runs.iter().map(source).collect()
}

/// One sentence on a run: its size, and what the proposals came from.
pub fn run(run: &RecordedRun) -> String {
    let opened = &run.opened;
    let mut roles: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    opened.models.iter().for_each(|(role, label)| roles.entry(label).or_default().push(role));
    let from = match roles.len() {
        1 => roles.keys().map(|label| label.to_string()).collect(),
        _ => roles.iter().map(|(label, of)| format!("{label} as {}", of.join(", "))).collect::<Vec<_>>().join("; "),
    };
    let stand_in = match opened.scripted_roles().is_empty() {
        true => "",
        false => " (scripted is a rule-based stand-in, not a language model)",
    };
    let (epochs, attempts, rollouts) =
        run.result.as_ref().map_or((0, 0, 0), |result| (result.epochs, result.exits.total(), result.rollouts));
    let start =
        |parent: &ParentAdopted| Some(format!(" Lineage {} starts from {}.", parent.lineage, parent.origins.last()?));
    let starts: String = run.parents.iter().filter_map(start).collect();
    format!(
        "Run {}: {} evolution and {} held-out scenes, {epochs} epochs, {attempts} attempts, {rollouts} rollouts; \
         proposals from {from}{stand_in}.{starts}",
        labels::run_name(run),
        opened.evolution_scenes.len(),
        opened.held_out_scenes.len()
    )
}

/// Whose attack is the experiment's own expression, and what that is.
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

/// Whether the runs may not be compared without more ado.
pub fn different_versions(runs: &[RecordedRun]) -> Option<String> {
    let differ = runs.windows(2).any(|pair| pair[0].opened.versions != pair[1].opened.versions);
    differ.then(|| "The runs were made by different versions of simulator, evaluation or adapters.".into())
}
