//! One attempt as text: prompts, replies, reviews, gates, route, rollouts, decision.

use std::fmt::Write as _;

use super::lineage_text::{objectives, shortened};
use crate::kernel::num;
use crate::objects::{
    AcceptanceGates, Attempt, Exchange,
    attempt::{GateReport, Route},
    score::Score,
};
use crate::text::counted;

/// The texts of an exchange, where they are at hand.
pub struct Exchanged {
    /// Role and text of each message.
    pub messages: Vec<(String, String)>,
    pub reply: String,
    /// Remarks of a provider on the reply; the scripted model makes none.
    pub metadata: Option<String>,
}

/// The whole story of an attempt. `texts` gives prompt and reply of an exchange; `full` prints prompts uncut.
pub fn attempt(attempt: &Attempt, texts: &dyn Fn(&Exchange) -> Option<Exchanged>, full: bool) -> String {
    let mut out = format!(
        "attempt {}  (epoch {}, slot {})  exit: {}\nparent  {}  {}\ntarget  {}\n",
        attempt.id,
        attempt.epoch,
        attempt.slot,
        attempt.exit.name(),
        attempt.parent,
        attempt.parent_hash.short(16),
        attempt.target
    );
    if !attempt.memory_shown.is_empty() {
        let cards: Vec<&str> = attempt.memory_shown.iter().map(|c| c.as_str()).collect();
        let _ = writeln!(out, "memory  {}", cards.join(", "));
    }
    exchanges(&mut out, &attempt.proposal.exchanges, texts, full);
    rounds(&mut out, attempt);
    if let crate::objects::Exit::Declined { reason } = &attempt.exit {
        let _ = writeln!(out, "\ndeclined: {reason}");
    }
    if let Some(gates) = attempt.exit.gates() {
        gate_report(&mut out, gates);
    }
    // Without labels the record does not say which protocol's realism was predicted.
    let realism = attempt.exit.score().map_or("R", Score::realism_name);
    if let Some(route) = attempt.exit.route() {
        routed(&mut out, route, realism);
    }
    if let Some(score) = attempt.exit.score() {
        labels(&mut out, score);
    }
    if let Some(decision) = attempt.exit.decision() {
        acceptance(&mut out, &decision.gates, realism);
        let _ = writeln!(out, "  promoted: {}   on the front: {}", decision.promoted, decision.on_front);
    }
    out
}

/// Questions and answers, in order.
pub fn exchanges(out: &mut String, exchanges: &[Exchange], texts: &dyn Fn(&Exchange) -> Option<Exchanged>, full: bool) {
    for exchange in exchanges {
        let _ = writeln!(
            out,
            "\n── {} round {}  model {}  request {}  response {}",
            exchange.role.name(),
            exchange.round,
            exchange.model,
            exchange.request.short(12),
            exchange.response.short(12)
        );
        if !exchange.unwrapped.is_empty() {
            let _ = writeln!(out, "   taken off before it was read: {}", exchange.unwrapped.join(", "));
        }
        if let Some(refusal) = &exchange.refusal {
            let _ = writeln!(out, "   refused: {refusal}");
        }
        let Some(exchanged) = texts(exchange) else {
            out.push_str("   (the texts are not available)\n");
            continue;
        };
        for (role, text) in &exchanged.messages {
            let shown = if full { text.clone() } else { shortened(text, 240) };
            let _ = writeln!(out, "   [{role}] {shown}");
        }
        let _ = writeln!(out, "   [reply] {}", exchanged.reply.trim_end());
        if let Some(metadata) = &exchanged.metadata {
            let _ = writeln!(out, "   {metadata}");
        }
    }
}

fn rounds(out: &mut String, attempt: &Attempt) {
    for (i, round) in attempt.proposal.rounds.iter().enumerate() {
        let _ = writeln!(out, "\npatch of round {i}:");
        match &round.patch {
            None => out.push_str("  none that could be read\n"),
            Some(patch) => {
                let _ = writeln!(out, "  hypothesis: {}", patch.hypothesis);
                for operation in &patch.operations {
                    let value = operation.value.as_ref().map(|v| v.to_string()).unwrap_or_default();
                    let op = format!("{:?}", operation.op).to_lowercase();
                    let _ = writeln!(out, "  {op:<8}{} {value}", operation.path);
                }
            }
        }
        for review in &round.reviews {
            let decision = format!("{:?}", review.decision).to_lowercase();
            let _ = writeln!(out, "  {:<18} {decision}", review.role.name());
            for blocker in &review.blockers {
                let _ = writeln!(out, "    blocker: {blocker}");
            }
            for hint in &review.repair_hints {
                let _ = writeln!(out, "    hint: {hint}");
            }
        }
    }
    if let Some(tuned) = &attempt.proposal.tuned {
        let _ = writeln!(out, "\n{}", tuned.in_words());
    }
}

fn gate_report(out: &mut String, gates: &GateReport) {
    out.push_str("\ngates:\n");
    for verdict in &gates.verdicts {
        let name = format!("{:?}", verdict.gate).to_lowercase();
        let _ = writeln!(out, "  {name:<11}{}", if verdict.problems.is_empty() { "passed" } else { "FAILED" });
        for problem in &verdict.problems {
            let _ = writeln!(out, "    {problem}");
        }
    }
}

fn routed(out: &mut String, route: &Route, realism: &str) {
    let decision = format!("{:?}", route.decision).to_lowercase();
    // Some reasons open with the decision.
    let reason = String::from(route.reason.clone());
    let reason = reason.strip_prefix(&format!("{decision}: ")).unwrap_or(&reason);
    let _ = writeln!(
        out,
        "\nroute: {decision}: {reason}\n  predicted attack {}  {realism} {}  uncertainty {}  world snapshot {}",
        num::fixed(route.predicted.attack, 3),
        num::fixed(route.predicted.realism, 4),
        num::fixed(route.uncertainty, 3),
        route.snapshot.short(12)
    );
    if let Some(pilot) = &route.pilot {
        let _ = writeln!(
            out,
            "  pilot in {}, {} of them labelled: attack {:+.3}, {realism} {:+.3} against the parent there ({})",
            counted(pilot.scenes.len(), "scene"),
            pilot.labelled,
            pilot.difference.attack,
            pilot.difference.realism,
            pilot.scenes.join(" ")
        );
    }
}

fn labels(out: &mut String, score: &Score) {
    let _ = writeln!(out, "\nlabels: {} on {}", objectives(score), counted(score.scenes.len(), "scene"));
    for scene in &score.scenes {
        let missed: Vec<String> =
            scene.diagnostics.iter().filter(|(_, d)| **d < 1.0).map(|(name, d)| format!("{name} {d:.3}")).collect();
        let _ = writeln!(
            out,
            "  {:<34} attack {:.2}  realism {:.4}{}  rollout {}{}",
            scene.scene,
            scene.attack,
            scene.realism,
            match (scene.intervened, scene.acted) {
                (false, _) => "  (not applied)",
                (true, false) => "  (changed nothing)",
                (true, true) => "",
            },
            scene.request.short(12),
            if missed.is_empty() { String::new() } else { format!("  [{}]", missed.join(", ")) }
        );
        for (ego, alone) in &scene.by_ego {
            let met = alone.contact.as_ref().map_or("no contact", |met| met.class.as_str());
            let (attack, realism) = (alone.attack, alone.realism);
            let _ = writeln!(out, "  {:<34} {ego:<10} attack {attack:.2}  realism {realism:.4}  {met}", "");
        }
        if !scene.metrics.is_empty() {
            let measured = scene.metrics.iter().map(|(name, value)| format!("{name} {value:.4}"));
            let _ = writeln!(out, "  {:<34} {}", "", measured.collect::<Vec<_>>().join("  "));
        }
    }
    for failure in &score.failures {
        let _ = writeln!(out, "  {:<34} no label: {}", failure.scene, failure.reason);
    }
}

fn acceptance(out: &mut String, gates: &AcceptanceGates, realism: &str) {
    let some = |value: Option<f64>| value.map_or("region empty".to_string(), |v| format!("{v:.4}"));
    let error = |value: Option<f64>| value.map_or(String::new(), |v| format!(" ± {v:.4}"));
    let (d, l, t) = (&gates.densification, &gates.local_push, &gates.parent_tradeoff);
    let _ = writeln!(
        out,
        "\narchive, over {} paired scenes, {} of them with other labels than the parent's:\n  coverage floor          {}  acts in {:.4}, at least \
         {:.4}\n  frontier densification  {}  non-dominated {}, hypervolume {:.6} {:+.6}{}",
        gates.scenes,
        gates.differing_scenes,
        gates.coverage.holds,
        gates.coverage.coverage,
        gates.coverage.floor,
        d.holds,
        d.non_dominated,
        d.hypervolume_before,
        d.hypervolume_gain,
        error(d.uncertainty)
    );
    let _ = writeln!(
        out,
        "  local frontier push     {}  best attack at R >= r0: {}; best R at A >= a0: {}",
        l.holds,
        some(l.best_attack_at_r0),
        some(l.best_realism_at_a0)
    );
    let _ = writeln!(
        out,
        "  parent trade-off push   {}  attack {:+.4}{}, {realism} {:+.4}{} against the parent",
        t.holds,
        t.attack_change,
        error(t.attack_uncertainty),
        t.realism_change,
        error(t.realism_uncertainty)
    );
}
