//! A turn of the world evaluator as text: the audit, what was asked and answered, what the judge measured.

use std::fmt::Write as _;

use super::attempt_text::{Exchanged, exchanges};
use super::evaluator::{measures, said};
use crate::objects::{Exchange, WorldEvolved, WorldMeasures};
use crate::text::counted;

/// The whole story of a turn. `texts` gives prompt and reply of an exchange; `full` prints prompts uncut.
pub fn turn(turn: &WorldEvolved, texts: &dyn Fn(&Exchange) -> Option<Exchanged>, full: bool) -> String {
    let audit = &turn.audit;
    let mut out = format!(
        "turn of the world evaluator after epoch {}: {}\naudit of {}, {} held; intervals should hold {:.0} %\n",
        turn.epoch,
        turn.verdict(),
        counted(audit.labels, "label"),
        audit.measures.held,
        audit.level_pct
    );
    row(&mut out, "all", &audit.measures);
    audit.families.iter().for_each(|(family, measures)| row(&mut out, family.as_str(), measures));
    for group in &audit.groups {
        let residual = group.residual.as_ref();
        let residual = residual.map_or("-".into(), |(column, correlation)| format!("{column} {correlation:+.3}"));
        let _ = writeln!(
            out,
            "  {:<12} {} columns, {} left out; unexplained: {residual}",
            group.group, group.columns, group.excluded
        );
    }
    exchanges(&mut out, &turn.exchanges, texts, full);
    if let Some(patch) = &turn.patch {
        let _ = writeln!(
            out,
            "\nproposed: {}\n  {}\n  expected: {}",
            said(&patch.changes),
            patch.hypothesis,
            patch.expected_gain
        );
    }
    if let Some(judgement) = &turn.judgement {
        let _ = writeln!(out, "\njudge: {}", measures(judgement));
        for gain in &judgement.gains {
            let error = gain.error.map_or("unknown".into(), |error| format!("{error:.4}"));
            let _ =
                writeln!(out, "  {:<14} gain {:+.4}, standard error {error}", format!("{:?}", gain.rule), gain.gain);
        }
        for objection in &judgement.objections {
            let _ = writeln!(out, "  against it, {:?}: {}", objection.rule, objection.says);
        }
    }
    let _ = writeln!(
        out,
        "\nactive from epoch {}: configuration {}, snapshot {}",
        turn.epoch + 1,
        turn.active_digest.short(12),
        turn.snapshot.short(12)
    );
    out
}

fn row(out: &mut String, name: &str, of: &WorldMeasures) {
    let number = |value: Option<f64>| value.map_or("-".into(), |value| format!("{value:.3}"));
    let _ = writeln!(
        out,
        "  {name:<12} rank correlation {}, error of attack {}, of realism {}, coverage {} %, false rejects {} %",
        number(of.rank_correlation),
        number(of.attack_error),
        number(of.realism_error),
        number(of.coverage_pct),
        number(of.false_reject_pct)
    );
}
