//! `figure`: one of the paper's figures from recorded runs, as SVG or PDF.

use clap::{Args, ValueEnum};
use serde_json::json;
use std::path::{Path, PathBuf};

use super::answer::Answer;
use super::exit::Failure;
use super::folder::RunFolder;
use crate::draw::{Figure, pdf};
use crate::evidence::RecordedRun;
use crate::evidence::figures::{self, FigureError};
use crate::objects::LineageId;
use crate::store;

#[derive(Debug, Args)]
pub struct Options {
    /// Which of the paper's figures.
    pub figure: Which,
    /// Run folder; may be given again. Without it the latest one below runs/; `architecture` needs none.
    #[arg(long)]
    pub run: Vec<PathBuf>,
    /// The lineage that `case-evolution` shows; without it the run's first.
    #[arg(long)]
    pub lineage: Option<String>,
    /// File to write: .svg, or .pdf with Helvetica, which no font travels with.
    #[arg(long)]
    pub out: PathBuf,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Which {
    /// What patches edit, by part and by kind (fig:patch-surface-distribution).
    PatchSurface,
    /// Candidates in random order and in the world evaluator's order (fig:world-sidecar).
    WorldSidecar,
    /// A lineage's proposals step by step, and the chain to its reported generator (fig:case-evolution-main and companions).
    CaseEvolution,
    /// Pareto area by group over rounds (fig:carla-pareto-evolution).
    CarlaPareto,
    /// The rooms of the code, from docs/ARCHITECTURE.md (fig:method-architecture, fig:system-arch).
    Architecture,
}

impl Which {
    /// The figure of these runs; of a lineage where it is of one.
    pub fn of(self, stories: &[RecordedRun], lineage: Option<&str>) -> Result<Figure, FigureError> {
        match (self, stories) {
            (Which::PatchSurface, _) => figures::patch_surface(stories),
            (Which::WorldSidecar, _) => figures::world_order(stories),
            (Which::CarlaPareto, _) => figures::area_rounds(stories),
            (Which::Architecture, _) => figures::architecture(),
            (Which::CaseEvolution, []) => Err(FigureError::NoPatches),
            (Which::CaseEvolution, [first, ..]) => {
                let named = lineage.map(LineageId::new);
                let own =
                    |story: &&RecordedRun| story.parents.iter().any(|parent| Some(&parent.lineage) == named.as_ref());
                let story = stories.iter().find(own).unwrap_or(first);
                let lineage = named.or_else(|| story.parents.first().map(|parent| parent.lineage.clone()));
                figures::case_evolution(story, &lineage.ok_or(FigureError::NoPatches)?)
            }
        }
    }
}

pub fn run(options: &Options) -> Result<Answer, Failure> {
    let ending = ending(&options.out)?;
    let named: Vec<Option<&PathBuf>> = match (options.run.as_slice(), options.figure) {
        ([], Which::Architecture) => Vec::new(),
        ([], _) => vec![None],
        (runs, _) => runs.iter().map(Some).collect(),
    };
    let story = |dir: Option<&PathBuf>| RunFolder::find(dir.map(PathBuf::as_path))?.story();
    let stories = named.into_iter().map(story).collect::<Result<Vec<_>, _>>()?;
    let figure = options.figure.of(&stories, options.lineage.as_deref()).map_err(Failure::bad_input)?;
    let bytes = match ending {
        Ending::Svg => figure.svg().into_bytes(),
        Ending::Pdf => pdf(&figure),
    };
    store::write_atomic(&options.out, &bytes)?;
    let text = format!("{}: {}", figure.title, options.out.display());
    Ok(Answer::new(text, json!({"out": options.out, "title": figure.title, "bytes": bytes.len()})))
}

enum Ending {
    Svg,
    Pdf,
}

fn ending(out: &Path) -> Result<Ending, Failure> {
    match out.extension().and_then(|ending| ending.to_str()) {
        Some("svg") => Ok(Ending::Svg),
        Some("pdf") => Ok(Ending::Pdf),
        _ => Err(Failure::bad_input(format!("--out {}: expected a name ending in .svg or .pdf", out.display()))),
    }
}
