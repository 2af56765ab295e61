//! A row a proposal, however it ended.

use super::super::recorded_run::RecordedRun;
use super::sheet::{Cell, Columns, Sheet, joined, word};
use crate::evidence::realism::Realisms;
use crate::objects::event::ParentAdopted;
use crate::objects::{AcceptanceGates, Attempt, Exit, edit_categories};

struct Row<'r> {
    attempt: &'r Attempt,
    adopted: Option<&'r ParentAdopted>,
}

impl Row<'_> {
    fn gates(&self) -> Option<&AcceptanceGates> {
        self.attempt.exit.decision().map(|decision| &*decision.gates)
    }

    /// The first gate that failed, or why there is no patch.
    fn reason(&self) -> Option<String> {
        match &self.attempt.exit {
            Exit::Declined { reason } => Some(reason.clone()),
            Exit::Invalid { gates } => gates.failed().next().map(|verdict| joined(verdict.problems.iter().take(1))),
            Exit::Rejected { route, .. } => Some(route.reason.clone().into()),
            Exit::Evaluated { .. } => None,
        }
    }
}

pub fn sheet(run: &RecordedRun) -> Sheet {
    let adopted = |attempt: &Attempt| run.parents.iter().find(|parent| parent.lineage == attempt.lineage);
    let rows: Vec<Row<'_>> = run.attempts.iter().map(|attempt| Row { attempt, adopted: adopted(attempt) }).collect();
    let columns = Columns::<Row<'_>>::new()
        .text("attempt", "Its id: lineage, epoch and slot, both from 0.", |r| r.attempt.id.to_string())
        .text("lineage", "The lineage.", |r| r.attempt.lineage.to_string())
        .text("family", "Source family.", |r| r.adopted.map(|a| a.program.source_family.to_string()))
        .text("ego", "The driver under test.", |r| r.adopted.map(|a| a.ego.clone()))
        .whole("epoch", "From 0.", |r| r.attempt.epoch)
        .whole("slot", "Place among the proposals of its epoch, from 0.", |r| r.attempt.slot)
        .text("parent", "The program that it edits.", |r| r.attempt.parent.to_string())
        .text("solution", "The child's name; empty where no gate let it through.", |r| {
            r.attempt.exit.candidate().map(|c| c.program.solution_id.to_string())
        })
        .text("program", "Hash of the child's content.", |r| r.attempt.exit.candidate().map(|c| c.program_hash))
        .text("exit", "declined, invalid, rejected or evaluated.", |r| r.attempt.exit.name())
        .text("failed_gate", "The first gate that refused it.", |r| {
            r.attempt.exit.gates().and_then(|gates| gates.failed().next()).map_or(Cell::Nothing, |v| word(&v.gate))
        })
        .text("reason", "Why it was declined, invalid or rejected.", Row::reason)
        .text("target", "What its slot was asked for.", |r| r.attempt.target.clone())
        .text("hypothesis", "What its proposer expects of it.", |r| {
            r.attempt.proposal.patch().map(|patch| patch.hypothesis.clone())
        })
        .whole("operations", "Operations of the patch.", |r| r.attempt.proposal.patch().map(|p| p.operations.len()))
        .text("edits", "Parts of the program that it edits.", |r| {
            r.attempt.proposal.patch().map(|p| joined(edit_categories(p).into_iter().map(|part| part.name())))
        })
        .text("tags", "Tags of the child's mechanisms.", |r| {
            r.attempt.exit.candidate().map(|c| joined(&c.mechanism_tags))
        })
        .whole("rounds", "Patches that were read: the proposal and its repairs.", |r| r.attempt.proposal.rounds.len())
        .whole("exchanges", "Questions to models.", |r| r.attempt.proposal.exchanges.len());
    let columns = columns
        .text("route", "select, audit or reject: what the world evaluator decided.", |r| {
            r.attempt.exit.route().map_or(Cell::Nothing, |route| word(&route.decision))
        })
        .number("predicted_attack", "", "Attack that it predicted.", |r| {
            r.attempt.exit.route().map(|x| x.predicted.attack)
        })
        .number("predicted_realism", "", "R (see realism) that it predicted.", |r| {
            r.attempt.exit.route().map(|x| x.predicted.realism)
        })
        .number("uncertainty", "", "Half width of the wider interval around the prediction.", |r| {
            r.attempt.exit.route().map(|x| x.uncertainty)
        })
        .number("rank_score", "", "Predicted gain that candidates are ranked by.", |r| {
            r.attempt.exit.route().and_then(|x| x.rank_score)
        })
        .number("weight", "", "How many candidates it stands for, where it was drawn at random.", |r| {
            r.attempt.exit.route().and_then(|x| x.weight)
        })
        .whole("scenes", "Scenes of its window that have a label.", |r| r.attempt.exit.score().map(|s| s.scenes.len()))
        .number("attack", "", "A over the window, 0 to 1.", |r| r.attempt.exit.score().map(|s| s.objectives.attack))
        .number("realism", "", "R over the window, 0 to 1: strict realism, or ARS in SafeBench's protocol.", |r| {
            r.attempt.exit.score().map(|s| s.objectives.realism)
        })
        .number("realism_acted", "", "Mean realism of the window's scenes acted in, 0 to 1.", |r| {
            r.attempt.exit.score().and_then(|s| Realisms::of(s).realism_acted)
        })
        .number(
            "strict_realism",
            "",
            "The smaller one of realism_acted and the mean over the successes, 0 to 1.",
            |r| r.attempt.exit.score().and_then(|s| Realisms::of(s).strict_realism),
        )
        .number("coverage", "", "Share of the window's scenes acted in.", |r| {
            r.attempt.exit.score().map(|s| s.coverage)
        })
        .whole("paired_scenes", "Scenes on which it is compared with its parent.", |r| r.gates().map(|g| g.scenes))
        .number("attack_change", "", "Attack minus the parent's on these scenes.", |r| {
            r.gates().map(|g| g.parent_tradeoff.attack_change)
        })
        .number("attack_change_se", "", "Its standard error.", |r| {
            r.gates().and_then(|g| g.parent_tradeoff.attack_uncertainty)
        })
        .number("realism_change", "", "R (see realism) minus the parent's on these scenes.", |r| {
            r.gates().map(|g| g.parent_tradeoff.realism_change)
        })
        .number("realism_change_se", "", "Its standard error.", |r| {
            r.gates().and_then(|g| g.parent_tradeoff.realism_uncertainty)
        })
        .number("hypervolume_gain", "", "What it adds to the front's hypervolume.", |r| {
            r.gates().map(|g| g.densification.hypervolume_gain)
        })
        .flag("accepted", "Whether an acceptance gate and both conditions hold.", |r| {
            r.gates().map(AcceptanceGates::any)
        })
        .flag("on_front", "Whether it was on the front when it was decided on.", |r| {
            r.attempt.exit.decision().map(|d| d.on_front)
        })
        .flag("promoted", "Whether it became the lineage's active parent.", |r| {
            r.attempt.exit.decision().map(|d| d.promoted)
        });
    columns.laid_out("attempts", "a proposal", &rows)
}
