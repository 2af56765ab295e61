//! `calibrate`: bounds and tolerances of realism from recorded pools.

use clap::Args;
use serde_json::json;
use std::fmt::Write as _;
use std::path::PathBuf;

use crate::cli::terminal::output::Output;
use crate::cli::terminal::{answer::Answer, exit::Failure};
use crate::evaluation::calibrate::{Observed, observed, with_of_kind};
use crate::evaluation::{Calibration, calibrate};
use crate::experiment;
use crate::kernel::Threads;
use crate::text::counted;

#[derive(Debug, Args)]
pub struct Options {
    /// Recorded traffic: pools, scenario files or folders.
    #[arg(required = true)]
    pub pools: Vec<PathBuf>,
    /// Share of the recorded road users of one kind that stay below each bound.
    #[arg(long, default_value_t = 0.95)]
    pub quantile: f64,
    /// Bound slides, turns on the spot and speeds by kind, too, for the weights `rolling` and `speed_of_kind`.
    #[arg(long)]
    pub of_kind: bool,
    /// File to write, for `[evaluation.realism] calibration = "FILE"`.
    #[arg(long)]
    pub out: Option<PathBuf>,
    #[command(flatten)]
    pub output: Output,
}

pub fn run(options: &Options, jobs: usize) -> Result<Answer, Failure> {
    let threads = Threads::new(jobs)?;
    let (mut all, mut digests, mut scenes): (Vec<Observed>, _, _) = (Vec::new(), Vec::new(), 0);
    for path in &options.pools {
        let pool = experiment::read_scenes(std::slice::from_ref(path), &threads)?;
        all.extend(observed(&pool.scenes, &threads));
        digests.push(pool.digest());
        scenes += pool.scenes.len();
    }
    let calibrated = calibrate(&all, options.quantile, digests, scenes)
        .map_err(|error| Failure::bad_input(format!("calibrate: {error}")))?;
    let calibrated = if options.of_kind { with_of_kind(calibrated, &all, options.quantile) } else { calibrated };
    let digest = calibrated.digest().map_err(Failure::internal)?;
    let mut text = listing(&calibrated);
    let _ = writeln!(text, "digest {digest}");
    if let Some(out) = &options.out {
        let values = toml::to_string(&calibrated).map_err(Failure::internal)?;
        let given: Vec<String> = options.pools.iter().map(|path| path.display().to_string()).collect();
        let of_kind = if options.of_kind { " --of-kind" } else { "" };
        let command = format!("evodrive calibrate {} --quantile {}{of_kind}", given.join(" "), options.quantile);
        let head =
            "# What recorded traffic shows: bounds and tolerances of the realism diagnostics (docs/OBJECTIVES.md).";
        let file = format!("{head}\n# Made by: {command}\n# Digest: {digest}\n{values}");
        options.output.write(out, file.as_bytes())?;
        let _ = writeln!(text, "written: {}", out.display());
    }
    Ok(Answer::new(text, json!({"digest": digest, "calibration": calibrated})))
}

fn listing(found: &Calibration) -> String {
    let mut out =
        format!("{}, quantile {}; bound (tolerance)\n{:<20}", counted(found.scenes, "scene"), found.quantile, "");
    for (kind, limits) in found.by_kind() {
        let of = if limits.pooled { "pooled, own" } else { "of" };
        let _ = write!(out, "{:>26}", format!("{kind} ({of} {})", limits.road_users));
    }
    for row in 0..found.vehicle.by_name().len() {
        let _ = write!(out, "\n{:<20}", found.vehicle.by_name()[row].0);
        for (_, limits) in found.by_kind() {
            let limit = limits.by_name()[row].1;
            let _ = write!(out, "{:>26}", format!("{:.3} ({:.3})", limit.bound, limit.tolerance));
        }
    }
    out.push('\n');
    out
}
