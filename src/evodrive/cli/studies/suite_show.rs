//! `suite show`: what a suite holds and where it comes from.

use clap::Args;
use serde_json::json;
use std::fmt::Write as _;
use std::path::PathBuf;

use crate::cli::studies::suite_file;
use crate::cli::terminal::width::table_width;
use crate::cli::terminal::{answer::Answer, exit::Failure};
use crate::evidence::aligned::Aligned;
use crate::suite::{Case, Drive, Suite};
use crate::text::counted;

#[derive(Debug, Args)]
pub struct Options {
    /// Suite file.
    pub suite: PathBuf,
}

pub fn run(options: &Options) -> Result<Answer, Failure> {
    let frozen = suite_file::read(&options.suite)?;
    let suite = &frozen.suite;
    let mut text = format!(
        "{}  digest {}\n{} of {}, planned around {}, simulator version {}, seed {}\n",
        suite.name,
        frozen.digest,
        counted(suite.cases.len(), "case"),
        counted(suite.pool.scenes.len(), "scene"),
        suite.planned_around.name,
        suite.simulator,
        suite.seed
    );
    for member in &suite.programs {
        let from = member.origins.last().map_or("a published parent".to_string(), |origin| origin.to_string());
        let _ = writeln!(text, "program {} ({}), {}: {from}", member.name, member.family, member.program.short(12));
    }
    for licence in &suite.licences {
        let _ = writeln!(text, "{} of {}: {}", counted(licence.scenes, "scene"), licence.source, licence.terms);
    }
    if let Some(floor) = suite.sizes.min_realism {
        let _ = writeln!(text, "realism of what programs do: at least {floor}");
    }
    if !suite.thresholds.is_empty() {
        let _ = writeln!(text, "thresholds {}", json!(suite.thresholds));
    }
    let row = |case: &Case| {
        vec![
            case.id.clone(),
            case.cluster.clone(),
            moved_by(suite, case),
            Drive::of(&case.label, None, None).in_words(),
        ]
    };
    let heads = ["case", "cluster", "program", "label"].map(String::from).to_vec();
    let rows = suite.cases.iter().map(row).collect();
    text.push_str(&Aligned { indent: 0, labels: 1, words: 3, heads, rows }.text(table_width()));
    let cases: Vec<_> = suite.cases.iter().map(|case| json!({
        "case": case.id, "scene": case.scene, "family": case.family, "cluster": case.cluster, "class": case.class(),
        "program": moved_by(suite, case), "label": case.label,
    })).collect();
    let object = json!({
        "name": suite.name, "digest": frozen.digest, "planned_around": suite.planned_around, "simulator": suite.simulator,
        "seed": suite.seed, "programs": suite.programs, "licences": suite.licences, "thresholds": suite.thresholds,
        "sizes": suite.sizes, "cases": cases,
    });
    Ok(Answer::new(text, object))
}

/// The program that moves others in a case.
fn moved_by(suite: &Suite, case: &Case) -> String {
    let member = case.program.and_then(|place| suite.programs.get(place));
    member.map_or("-".into(), |member| member.name.to_string())
}
