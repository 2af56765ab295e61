//! `figure`: one of the paper's figures from recorded runs, as SVG or PDF.

use clap::{Args, ValueEnum};
use serde_json::json;
use std::path::PathBuf;

use crate::cli::look::{credit, playables, redraws, rollout};
use crate::cli::records::folder::RunFolder;
use crate::cli::records::run_name::{OneRun, Runs};
use crate::cli::scenes::files;
use crate::cli::terminal::output::{Output, by_ending};
use crate::cli::terminal::{answer::Answer, exit::Failure};
use crate::draw::{Figure, pdf};
use crate::evidence::RecordedRun;
use crate::evidence::figures::{self, Case, Evolved, FigureError, Side};
use crate::objects::{LineageId, SolutionId};

#[derive(Debug, Args)]
pub struct Options {
    /// Which of the paper's figures.
    pub figure: Which,
    #[command(flatten)]
    pub runs: Runs,
    /// A lineage to show; may be given again. `case-evolution` shows these below each other, without one the run's first whose
    /// reported program has patches, `pareto-front` and `front` a panel each, `contacts` two bars, without one all.
    #[arg(long)]
    pub lineage: Vec<String>,
    /// A traffic family of SafeBench's protocol, whose scenes alone `case-evolution` scores.
    #[arg(long)]
    pub family: Option<String>,
    /// File to write: .svg, or .pdf with its font embedded.
    #[arg(long)]
    pub out: PathBuf,
    /// Write the points of `pareto-front` into this CSV file, too.
    #[arg(long, value_name = "CSV")]
    pub data: Option<PathBuf>,
    #[command(flatten)]
    pub output: Output,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Which {
    /// Edits of patches, by part and by kind (fig:patch-surface-distribution).
    PatchSurface,
    /// Candidates in random order and in the world evaluator's order (fig:world-sidecar).
    WorldSidecar,
    /// A lineage's proposals step by step, and the chain to its reported generator (fig:case-evolution-main and companions).
    CaseEvolution,
    /// Attack against realism: parent, evaluated descendants, the front and the reported program, a panel a lineage.
    ParetoFront,
    /// Attack against realism on held-out scenes: parent and reported programs of several searches, with intervals, a panel a
    /// generator.
    Front,
    /// Contacts of parents and reported programs on held-out scenes, stacked by class, with the part that could have been prevented; two bars a
    /// search.
    Contacts,
    /// The loop: a patch's way from a frozen snapshot to the settled state, and its ways out (fig:method-architecture).
    Method,
    /// Pareto area by group over rounds (fig:carla-pareto-evolution).
    CarlaPareto,
    /// Scenes in which an evolved generator attacks and its parent does not, side by side, one row per lineage
    /// (fig:carla-cases).
    Cases,
    /// The rooms of the code, from docs/ARCHITECTURE.md (fig:system-arch).
    Architecture,
}

/// A run and where it lies, for figures that play its scenes again.
pub type FolderAndRun = (RunFolder, RecordedRun);

impl Which {
    /// The figure of these runs; of some lineages where they are named.
    pub fn of(self, runs: &[FolderAndRun], lineages: &[String], jobs: usize) -> Result<Figure, Failure> {
        let recorded_runs: Vec<RecordedRun> = runs.iter().map(|(_, run)| run.clone()).collect();
        let lineages: Vec<LineageId> = lineages.iter().map(LineageId::new).collect();
        let drawn = match self {
            Which::PatchSurface => figures::patch_surface(&recorded_runs),
            Which::WorldSidecar => figures::world_order(&recorded_runs),
            Which::CaseEvolution => return evolution(runs, &lineages, None, jobs),
            Which::ParetoFront => figures::pareto_front(&recorded_runs, &lineages).map(|(figure, _)| figure),
            Which::Front => figures::front(&recorded_runs, &lineages),
            Which::Contacts => figures::contact_bars(&recorded_runs, &lineages),
            Which::Method => figures::method(),
            Which::CarlaPareto => figures::area_rounds(&recorded_runs),
            Which::Cases => figures::cases(&cases(runs, jobs)?, &recorded_runs),
            Which::Architecture => figures::architecture(),
        };
        drawn.map_err(Failure::bad_input)
    }
}

/// The steps of the named lineages, each of the first run that has it; without a name of a run's first lineage that has patches to tell.
fn evolution(runs: &[FolderAndRun], named: &[LineageId], family: Option<&str>, jobs: usize) -> Result<Figure, Failure> {
    let Some((_, first)) = runs.first() else { return Err(Failure::bad_input(FigureError::NoPatches)) };
    let lineages = match named {
        [] => vec![figures::with_a_chain(first).ok_or_else(|| Failure::bad_input(FigureError::NoPatches))?],
        named => named.to_vec(),
    };
    let threads = files::threads(jobs)?;
    let mut shown = Vec::new();
    for lineage in lineages {
        let own = |run: &RecordedRun| run.parents.iter().any(|parent| parent.lineage == lineage);
        let place = runs.iter().position(|(_, run)| own(run)).unwrap_or(0);
        let (folder, run) = &runs[place];
        shown.push((place, credit::of_lineage(folder, run, &lineage, &threads)?, lineage));
    }
    let evolved: Vec<Evolved<'_>> = shown
        .iter()
        .map(|(place, credit, lineage)| Evolved {
            run: &runs[*place].1,
            lineage: lineage.clone(),
            credit: credit.as_ref().filter(|_| family.is_none()),
            family,
        })
        .collect();
    figures::case_evolution(&evolved).map_err(Failure::bad_input)
}

/// The scenes that lineages won, played by both programs.
fn cases(runs: &[FolderAndRun], jobs: usize) -> Result<Vec<Case>, Failure> {
    let mut cases = Vec::new();
    for (folder, run) in runs {
        for won in figures::won_scenes(run) {
            let side = |solution: &SolutionId| -> Result<Side, Failure> {
                let scene = std::slice::from_ref(&won.scene);
                let played =
                    rollout::of_attempt(&OneRun::of(&folder.dir), solution.as_str(), scene, jobs)?.swap_remove(0);
                let ending = match played.outcome.contact.filter(|contact| contact.adversary) {
                    Some(contact) => figures::met_in_words(contact.class),
                    None => playables::end_in_words(&played.outcome),
                };
                Ok(Side { drawing: played.drawing(), ending: ending.to_string() })
            };
            let (original, evolved) = (side(&won.original)?, side(&won.evolved)?);
            cases.push(Case { won, original, evolved });
        }
    }
    Ok(cases)
}

pub fn run(options: &Options, jobs: usize) -> Result<Answer, Failure> {
    let ending = by_ending("--out", &options.out, [("svg", Ending::Svg), ("pdf", Ending::Pdf)])?;
    // Pictures of the program itself need no run.
    let needs_none =
        matches!(options.figure, Which::Architecture | Which::Method) && options.runs.named().next().is_none();
    let folders = if needs_none { Vec::new() } else { options.runs.folders()? };
    let with_folder = |folder: RunFolder| -> Result<FolderAndRun, Failure> {
        let run = match options.figure {
            Which::CarlaPareto => redraws::recorded(&folder, jobs)?,
            _ => folder.recorded()?,
        };
        Ok((folder, run))
    };
    let runs = folders.into_iter().map(with_folder).collect::<Result<Vec<_>, _>>()?;
    let figure = match (&options.family, options.figure) {
        (None, figure) => figure.of(&runs, &options.lineage, jobs)?,
        (Some(family), Which::CaseEvolution) => {
            let lineages: Vec<LineageId> = options.lineage.iter().map(LineageId::new).collect();
            evolution(&runs, &lineages, Some(family.as_str()), jobs)?
        }
        (Some(_), _) => {
            return Err(Failure::bad_input("--family: only case-evolution scores one family; leave it out"));
        }
    };
    let bytes = match ending {
        Ending::Svg => figure.svg().into_bytes(),
        Ending::Pdf => pdf(&figure).map_err(Failure::bad_input)?,
    };
    let points = points(options, &runs)?;
    for place in [Some(&options.out), options.data.as_ref()].into_iter().flatten() {
        options.output.may_be_made(place)?;
    }
    options.output.write(&options.out, &bytes)?;
    if let (Some(place), Some(points)) = (&options.data, points) {
        options.output.write(place, points.as_bytes())?;
    }
    let text = format!("{}: {}", figure.title, options.out.display());
    Ok(Answer::new(
        text,
        json!({"out": options.out, "data": options.data, "title": figure.title, "bytes": bytes.len()}),
    ))
}

/// The points behind the figure, where they are wanted.
fn points(options: &Options, runs: &[FolderAndRun]) -> Result<Option<String>, Failure> {
    let Some(place) = &options.data else { return Ok(None) };
    if options.figure != Which::ParetoFront {
        return Err(Failure::bad_input(format!(
            "--data {}: only pareto-front has points to write; `evodrive data` writes the tables behind the other figures",
            place.display()
        )));
    }
    let recorded: Vec<RecordedRun> = runs.iter().map(|(_, run)| run.clone()).collect();
    let lineages: Vec<LineageId> = options.lineage.iter().map(LineageId::new).collect();
    let (_, points) = figures::pareto_front(&recorded, &lineages).map_err(Failure::bad_input)?;
    Ok(Some(points))
}

#[derive(Clone, Copy)]
enum Ending {
    Svg,
    Pdf,
}
