//! The short result of a run, and its progress, as text.

use std::fmt::Write as _;

use super::folder::RunFolder;
use crate::epoch::Progress;
use crate::experiment::{Experiment, provenance};
use crate::kernel::Digest;
use crate::objects::event::{LineageResult, RunResult};

/// One line of progress.
pub fn progress(news: &Progress) -> String {
    match news {
        Progress::Attempt { id, exit, attack, realism, accepted } => match (attack, realism) {
            (Some(attack), Some(realism)) => {
                let mark = if *accepted { "  accepted" } else { "" };
                format!("  {id:<18} {exit:<9} attack {attack:.3}  realism {realism:.4}{mark}")
            }
            _ => format!("  {id:<18} {exit}"),
        },
        Progress::Settled { epoch, lineage, active, front, hypervolume } => {
            format!("epoch {epoch} of {lineage}: front of {front}, hypervolume {hypervolume:.5}, active {active}")
        }
        Progress::Composed { template, used: true } => format!("composed {template} from its description"),
        Progress::Composed { template, used: false } => {
            format!("no answer for {template} could be used: its published template stays")
        }
        Progress::Counselled { lineage, scenes, met } => {
            format!("counsel for {scenes} scenes of {lineage}: {met} advised sets met the ego when tried")
        }
        Progress::HeldOut { lineage, programs, scenes } => {
            format!("held-out suite opened for {lineage}: {programs} programs on {scenes} scenes")
        }
    }
}

/// Parent against evolved, the front, the four exits, where things are; the last line is the root.
pub fn summary(experiment: &Experiment, folder: &RunFolder, result: &RunResult, root: Digest) -> String {
    let mut out = format!("{}: {}\n", experiment.name, experiment.describes);
    let held_out = result.lineages.first().map_or(0, |l| l.held_out_scenes);
    let _ = writeln!(out, "proposals from: {}; {held_out} held-out scenes\n", provenance(experiment));
    let _ = writeln!(
        out,
        "{:<14} {:>15} {:>15} {:>15} {:>15} {:>14}",
        "lineage", "attack", "realism", "RP %", "PF-Area@3 %", "chosen"
    );
    for lineage in &result.lineages {
        row(&mut out, lineage);
    }
    for lineage in &result.lineages {
        let _ = writeln!(out, "\nfront of {} (development labels, attack / realism):", lineage.lineage);
        for point in &lineage.front {
            let o = point.objectives;
            let _ = writeln!(out, "  {:.3} / {:.4}  {}", o.attack, o.realism, point.solution);
        }
    }
    let e = result.exits;
    let _ = writeln!(
        out,
        "\nattempts: {} declined, {} invalid, {} rejected, {} evaluated; {} rollouts",
        e.declined, e.invalid, e.rejected, e.evaluated, result.rollouts
    );
    let _ = writeln!(out, "run folder: {}", folder.dir.display());
    let _ = writeln!(out, "report: {}", folder.report().display());
    let _ = writeln!(out, "root: {root}");
    out
}

fn row(out: &mut String, lineage: &LineageResult) {
    let (p, e) = (&lineage.parent, &lineage.evolved);
    let pair = |a: String, b: String| format!("{a} -> {b}");
    let _ = writeln!(
        out,
        "{:<14} {:>15} {:>15} {:>15} {:>15} {:>14}",
        lineage.lineage.as_str(),
        pair(format!("{:.3}", p.objectives.attack), format!("{:.3}", e.objectives.attack)),
        pair(format!("{:.4}", p.objectives.realism), format!("{:.4}", e.objectives.realism)),
        pair(format!("{:.2}", p.realism_penalty_pct), format!("{:.2}", e.realism_penalty_pct)),
        format!("{:+.1}", lineage.pf_area_at_3_pct),
        e.solution.as_str().rsplit('/').next().unwrap_or_default()
    );
}
