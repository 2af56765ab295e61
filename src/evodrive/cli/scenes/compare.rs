//! `scenes compare`: how the scenes of two pools differ.

use clap::Args;
use serde_json::json;
use std::fmt::Write as _;
use std::path::PathBuf;

use crate::cli::scenes::files::{read, threads};
use crate::cli::terminal::{answer::Answer, exit::Failure, width::table_width};
use crate::evidence::aligned::Aligned;
use crate::evidence::difference::{Difference, Quantity};
use crate::kernel::num;
use crate::scene::DT_S;
use crate::scene::stats::Summary;
use crate::text::counted;

#[derive(Debug, Args)]
pub struct Options {
    /// A pool, a scenario file or a folder of them.
    pub first: PathBuf,
    /// Another one.
    pub second: PathBuf,
}

pub fn run(options: &Options, jobs: usize) -> Result<Answer, Failure> {
    let both = [&options.first, &options.second];
    let [first, second] = both.map(|path| read(std::slice::from_ref(path), jobs));
    let (first, second) = (first?, second?);
    for (pool, path) in [&first, &second].into_iter().zip(both) {
        if pool.scenes.is_empty() {
            return Err(Failure::bad_input(format!("{}: no scene in it, expected some to compare", path.display())));
        }
    }
    let difference = Difference::of([&first.scenes, &second.scenes], &threads(jobs)?);
    let digests = [first.digest(), second.digest()];
    Ok(Answer::new(text(&difference, options), json!({"pools": digests, "difference": difference})))
}

fn text(of: &Difference, options: &Options) -> String {
    let named = |path: &PathBuf, scenes: usize| format!("{}: {}", path.display(), counted(scenes, "scene"));
    let mut text =
        format!("[1] {}\n[2] {}\n", named(&options.first, of.scenes[0]), named(&options.second, of.scenes[1]));
    let seconds = of.samples as f64 * DT_S;
    let _ = writeln!(text, "the first {} s of each scene\n", num::fixed(seconds, 1));
    let cell = |of: &Summary| [of.p5, of.p50, of.p95].map(|value| num::fixed(value, 2)).join(" / ");
    let row = |of: &Quantity| {
        let unit = if of.unit.is_empty() { String::new() } else { format!(" ({})", of.unit) };
        let numbers = [cell(&of.first), cell(&of.second), num::fixed(of.distance, 2), num::fixed(of.in_deviations, 2)];
        [of.of.to_string(), format!("{}{unit}", of.name)].into_iter().chain(numbers).collect()
    };
    let heads = ["of", "quantity", "[1] p5 / p50 / p95", "[2] p5 / p50 / p95", "distance", "in deviations"];
    let heads = heads.map(String::from).to_vec();
    let rows = of.quantities.iter().map(row).collect();
    text += &Aligned { indent: 0, labels: 2, words: 0, heads, rows }.text(table_width());
    text +=
        "\ndistance: Wasserstein's of first order, in the unit, and in standard deviations of both pools together.\n\n";
    let classified = of.told_apart.iter().map(|by| vec![by.by.to_string(), by.auc.text(2)]);
    let heads = vec!["told apart by".to_string(), "AUC".to_string()];
    text += &Aligned { indent: 0, labels: 1, words: 0, heads, rows: classified.collect() }.text(table_width());
    text += "\nAUC: the chance that a classifier (boosted trees, cross-validated by scene) takes the one of [2] for it, of two drawn from both; 0.5 where \
             nothing tells them apart.\n";
    text
}
