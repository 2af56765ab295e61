//! The measures as a table.

use std::fmt::Write as _;

use super::super::aligned::Aligned;
use super::{quality::Quality, report::EvaluatorReport};

const HEAD: [&str; 13] = [
    "",
    "admitted",
    "selected",
    "audited",
    "rejected",
    "spearman",
    "kendall",
    "error ratio",
    "coverage %",
    "recall@30 %",
    "false rejects %",
    "accepted, sel. %",
    "accepted, aud. %",
];

/// A row an epoch and family, in lines of at most `width` characters, then what the numbers say.
pub fn text(report: &EvaluatorReport, width: usize) -> String {
    let mut rows: Vec<[String; 13]> = Vec::new();
    rows.extend(report.epochs.iter().map(|(epoch, quality)| row(&format!("epoch {epoch}"), quality)));
    rows.extend(report.families.iter().map(|(family, quality)| row(family, quality)));
    rows.push(row("all", &report.pooled));
    let table = Aligned {
        labels: 1,
        heads: HEAD.map(String::from).to_vec(),
        rows: rows.into_iter().map(Vec::from).collect(),
        ..Aligned::default()
    };
    let mut out = table.text(width);
    let pooled = &report.pooled;
    let _ = writeln!(
        out,
        "\nspearman of the difference: attack {}, realism {}; absolute error ratio {}; regret {}",
        number(pooled.spearman_attack, 3),
        number(pooled.spearman_realism, 3),
        number(pooled.absolute_error_ratio_to_parent, 3),
        number(pooled.regret, 4)
    );
    if let (Some(ranked), Some(drawn)) = (pooled.false_reject_pct, pooled.false_reject_of_a_draw_pct) {
        let _ = writeln!(out, "false rejects {ranked:.1} %; with as many drawn at random instead {drawn:.1} %");
    }
    if let Some(against) = &report.against {
        let _ = writeln!(
            out,
            "compared with the other run, {} lineages: {:.1} % of its hypervolume with {:.1} % of its rollouts, {:.1} % of its simulated candidates; by lineage {:+.4} ± {} \
             (more in {}, less in {})",
            against.lineages,
            100.0 * against.hypervolume_share,
            100.0 * against.rollout_share,
            100.0 * against.candidate_share,
            against.hypervolume_difference,
            number(against.hypervolume_difference_error, 4),
            against.lineages_better,
            against.lineages_worse
        );
        if let Some(parents) = against.parents_share {
            let gained = match against.gain_share() {
                Some(gain) => format!("this run gained {:.1} % of what it gained over them", 100.0 * gain),
                None => "it gained nothing over them".to_string(),
            };
            let _ = writeln!(out, "the parents alone have {:.1} % of its hypervolume; {gained}", 100.0 * parents);
        }
    }
    if let Some(evolution) = &report.evolution {
        out.push_str(&evolution.text());
    }
    out
}

fn row(name: &str, quality: &Quality) -> [String; 13] {
    let rejects = match (quality.false_reject_pct, quality.false_reject_interval) {
        (Some(value), Some([low, high])) => format!("{value:.1} [{low:.1}, {high:.1}]"),
        _ => "-".into(),
    };
    [
        name.to_string(),
        quality.admitted.to_string(),
        quality.selected.to_string(),
        quality.audited.to_string(),
        quality.rejected.to_string(),
        number(quality.spearman_pooled, 3),
        number(quality.kendall_pooled, 3),
        number(quality.error_ratio_to_parent, 3),
        number(quality.coverage_80_pct, 1),
        number(quality.recall_top_30_pct, 1),
        rejects,
        number(quality.selected_accepted_pct, 1),
        number(quality.audited_accepted_pct, 1),
    ]
}

fn number(value: Option<f64>, digits: usize) -> String {
    value.map_or("-".into(), |value| format!("{value:.digits$}"))
}
