//! A row a label: one program in one scene; and a row a scene without one.

use std::collections::{BTreeMap, BTreeSet};

use super::super::recorded_run::RecordedRun;
use super::sheet::{Columns, Sheet};
use crate::kernel::Digest;
use crate::objects::{LineageId, SceneScore, SolutionId};

/// Owner and scene of a label, with its suite.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Whose<'r> {
    lineage: &'r LineageId,
    solution: &'r SolutionId,
    suite: &'static str,
    scene: &'r str,
}

type Row<'r> = (Whose<'r>, &'r SceneScore);

/// Every label of the record once: it is a function of program, scene and ego, so it does not matter where it is met first.
fn labels(run: &RecordedRun) -> Vec<Row<'_>> {
    let mut by_subject: BTreeMap<Whose<'_>, &SceneScore> = BTreeMap::new();
    for (lineage, solution, suite, score) in run.scores() {
        for label in &score.scenes {
            by_subject.entry(Whose { lineage, solution, suite, scene: &label.scene }).or_insert(label);
        }
    }
    by_subject.into_iter().collect()
}

/// Scenes in which a program has no label, with the reason, once each.
fn failures(run: &RecordedRun) -> Vec<(Whose<'_>, &str)> {
    let mut by_subject: BTreeMap<Whose<'_>, &str> = BTreeMap::new();
    for (lineage, solution, suite, score) in run.scores() {
        for failure in &score.failures {
            by_subject.entry(Whose { lineage, solution, suite, scene: &failure.scene }).or_insert(&failure.reason);
        }
    }
    by_subject.into_iter().collect()
}

/// Makes the sheet of scenes without a label, which labels cannot show.
pub fn unlabelled(run: &RecordedRun) -> Sheet {
    let columns = Columns::<(Whose<'_>, &str)>::new()
        .text("lineage", "The lineage.", |(of, _)| of.lineage.to_string())
        .text("solution", "The program, as in labels.", |(of, _)| of.solution.to_string())
        .text("suite", "evolution or held_out.", |(of, _)| of.suite)
        .text("scene", "The scene, which counts in no number of this program.", |(of, _)| of.scene)
        .text(
            "reason",
            "Why: the program could not be compiled, or the driver under test ended there.",
            |(_, reason)| *reason,
        );
    columns.laid_out("unlabelled", "a program in a scene without a label", &failures(run))
}

/// Digests of the rollout records behind the labels, sorted.
pub fn records(run: &RecordedRun) -> Vec<Digest> {
    let all: BTreeSet<Digest> = run
        .scores()
        .flat_map(|(.., score)| score.scenes.iter().flat_map(SceneScore::each).map(|label| label.record))
        .collect();
    all.into_iter().collect()
}

pub fn sheet(run: &RecordedRun) -> Sheet {
    let rows = labels(run);
    let columns = Columns::<Row<'_>>::new()
        .text("lineage", "The lineage.", |(of, _)| of.lineage.to_string())
        .text("solution", "The program: the attempt that proposed it, or <lineage>/parent.", |(of, _)| {
            of.solution.to_string()
        })
        .text("suite", "evolution or held_out.", |(of, _)| of.suite)
        .text("scene", "The scene.", |(of, _)| of.scene)
        .number("attack", "", "a: what the contact counts, 0 to 1 (docs/OBJECTIVES.md).", |(_, label)| label.attack)
        .number("realism", "", "r: 1 where every diagnostic is satisfied; 1 where nobody acts.", |(_, label)| {
            label.realism
        })
        .flag(
            "acted",
            "Whether some adversary's motion differs from replay; realism counts only where it does.",
            |(_, l)| l.acted,
        )
        .flag("intervened", "Whether the program asked for an intervention.", |(_, label)| label.intervened)
        .text("contact_class", "Who struck whom, where the ego met anyone.", |(_, label)| {
            label.contact.as_ref().map(|met| met.class.clone())
        })
        .flag("contact_adversary", "Whether it met an adversary of the program.", |(_, label)| {
            label.contact.as_ref().map(|met| met.adversary)
        })
        .flag(
            "contact_avoidable",
            "Whether braking or swerving would have avoided it; empty where not assessed.",
            |(_, l)| l.contact.as_ref().and_then(|met| met.avoidable),
        )
        .flag("contact_anyway", "Whether the ego meets the same one in plain replay.", |(_, label)| {
            label.contact.as_ref().map(|met| met.anyway)
        });
    let diagnostics: BTreeSet<String> = rows.iter().flat_map(|(_, label)| label.diagnostics.keys().cloned()).collect();
    let columns = diagnostics.into_iter().fold(columns, |columns, name| {
        let heading = format!("d_{name}");
        let meaning = "Realism diagnostic of this name, 1 = satisfied (docs/OBJECTIVES.md).";
        columns.number(&heading, "", meaning, move |(_, label)| label.diagnostics.get(&name).copied())
    });
    let metrics: BTreeSet<String> = rows.iter().flat_map(|(_, label)| label.metrics.keys().cloned()).collect();
    let columns = metrics.into_iter().fold(columns, |columns, name| {
        let heading = format!("m_{name}");
        let meaning = "Metric of this name, as the experiment declares it in evaluation.metrics.";
        columns.number(&heading, "", meaning, move |(_, label)| label.metrics.get(&name).copied())
    });
    let egos: BTreeSet<String> = rows.iter().flat_map(|(_, label)| label.by_ego.keys().cloned()).collect();
    let columns = egos.into_iter().fold(columns, |columns, name| {
        let heading = format!("attack_{name}");
        columns.number(&heading, "", "a against this driver alone.", move |(_, label)| {
            label.by_ego.get(&name).map(|alone| alone.attack)
        })
    });
    let columns = columns.text("request", "Key of the rollout request.", |(_, label)| label.request).text(
        "record",
        "Digest of the rollout's record: the key into the table of rollouts.",
        |(_, label)| label.record,
    );
    columns.laid_out("labels", "a program in a scene", &rows)
}
