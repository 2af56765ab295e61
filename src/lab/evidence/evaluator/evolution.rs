//! The evaluator's changes to itself: every proposal with its verdict, and the configuration that routed each epoch.

use serde::Serialize;
use serde_json::Value;
use std::collections::BTreeMap;
use std::fmt::Write as _;

use crate::evidence::recorded_run::RecordedRun;
use crate::kernel::Digest;
use crate::objects::{Judgement, WorldEvolved};
use crate::text::counted;

/// The turns of a run, counted and listed.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Evolution {
    /// Turns in which the judge promoted the proposal.
    pub promoted: usize,
    /// Turns in which it kept the incumbent.
    pub rejected: usize,
    /// Turns without a patch of the surface.
    pub refused: usize,
    /// Answers that were no patch of the surface, in all turns.
    pub refused_answers: usize,
    pub turns: Vec<TurnRow>,
    /// Configurations in the order in which they came to route, each with its first epoch and what it changes of the one before.
    pub active: Vec<ActiveRow>,
}

/// One turn.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TurnRow {
    /// The epoch before it.
    pub epoch: u32,
    pub verdict: &'static str,
    /// Key -> new value; empty where no answer was a patch of the surface.
    pub changes: BTreeMap<String, Value>,
    pub refusals: Vec<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub judgement: Option<Judgement>,
}

/// A configuration that routed epochs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ActiveRow {
    pub from_epoch: u32,
    pub configuration: Digest,
    pub changes: BTreeMap<String, Value>,
}

impl Evolution {
    /// `None` where no turn was taken.
    pub fn of(run: &RecordedRun) -> Option<Evolution> {
        let first = run.evolved.first()?;
        let count = |verdict: &str| run.evolved.iter().filter(|turn| turn.verdict() == verdict).count();
        let founding = ActiveRow { from_epoch: 0, configuration: first.incumbent, changes: BTreeMap::new() };
        let promoted = run.evolved.iter().filter(|turn| turn.verdict() == "promoted").map(|turn| ActiveRow {
            from_epoch: turn.epoch + 1,
            configuration: turn.active_digest,
            changes: changes(turn),
        });
        Some(Evolution {
            promoted: count("promoted"),
            rejected: count("rejected"),
            refused: count("refused"),
            refused_answers: run.evolved.iter().map(|turn| turn.refusals().count()).sum(),
            turns: run.evolved.iter().map(row).collect(),
            active: std::iter::once(founding).chain(promoted).collect(),
        })
    }

    /// The section of `evodrive world`.
    pub fn text(&self) -> String {
        let mut out = format!(
            "\nself-evolution: {}, {} promoted, {} rejected, {} without a usable patch ({} refused)\n",
            counted(self.turns.len(), "turn"),
            self.promoted,
            self.rejected,
            self.refused,
            counted(self.refused_answers, "answer")
        );
        for turn in &self.turns {
            let _ = writeln!(out, "  after epoch {:<3} {:<9} {}", turn.epoch, turn.verdict, said(&turn.changes));
            for refusal in &turn.refusals {
                let _ = writeln!(out, "      refused: {refusal}");
            }
            let Some(judgement) = &turn.judgement else { continue };
            let _ = writeln!(out, "      {}", measures(judgement));
            for objection in &judgement.objections {
                let _ = writeln!(out, "      {:?}: {}", objection.rule, objection.says);
            }
        }
        for active in &self.active {
            let what = if active.changes.is_empty() { "as the experiment says".into() } else { said(&active.changes) };
            let _ = writeln!(out, "  from epoch {:<3} {}  {what}", active.from_epoch, active.configuration.short(12));
        }
        out
    }
}

fn changes(turn: &WorldEvolved) -> BTreeMap<String, Value> {
    turn.patch.as_ref().map(|patch| patch.changes.clone()).unwrap_or_default()
}

fn row(turn: &WorldEvolved) -> TurnRow {
    TurnRow {
        epoch: turn.epoch,
        verdict: turn.verdict(),
        changes: changes(turn),
        refusals: turn.refusals().map(String::from).collect(),
        judgement: turn.judgement.clone(),
    }
}

/// `model = "ridge", trees = 80`.
pub fn said(changes: &BTreeMap<String, Value>) -> String {
    changes.iter().map(|(key, value)| format!("{key} = {value}")).collect::<Vec<_>>().join(", ")
}

/// Measures of incumbent and challenger on one line.
pub fn measures(judgement: &Judgement) -> String {
    let (old, new) = (&judgement.incumbent, &judgement.challenger);
    let number = |value: Option<f64>, digits: usize| value.map_or("-".into(), |value| format!("{value:.digits$}"));
    let pair = |name: &str, old: Option<f64>, new: Option<f64>, digits: usize| {
        format!("{name} {} -> {}", number(old, digits), number(new, digits))
    };
    let pairs = [
        pair("rank", old.rank_correlation, new.rank_correlation, 3),
        pair("error of realism", old.realism_error, new.realism_error, 3),
        pair("of attack", old.attack_error, new.attack_error, 3),
        pair("coverage %", old.coverage_pct, new.coverage_pct, 1),
        pair("false rejects %", old.false_reject_pct, new.false_reject_pct, 2),
    ];
    format!("{} held: {}", old.held, pairs.join(", "))
}
