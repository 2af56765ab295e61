//! `credit`: how much of a program's gain each of its edits carries. The edits are taken out one by one, and each is put on the
//! parent alone; everything else stays as in the run, the scenes and the random streams too. The run's folder keeps what came out, for
//! reports.

use clap::Args;
use serde_json::json;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::archive::SelectorOptions;
use crate::backend::{Answers, Planners};
use crate::candidates::apply;
use crate::cli::evolve::behind::{self, Asked};
use crate::cli::look::{kept_credit, table::Format};
use crate::cli::records::folder::RunFolder;
use crate::cli::records::run_name::OneRun;
use crate::cli::scenes::files;
use crate::cli::studies::{apply as applying, packed};
use crate::cli::terminal::answer::{Answer, progress};
use crate::cli::terminal::{exit::Failure, width::stdout_width};
use crate::epoch::{Applied, SceneEntry};
use crate::evidence::RecordedRun;
use crate::evidence::choice::Choice;
use crate::evidence::credit::{Credit, EditCredit, Gain};
use crate::evidence::credit_table::credits as credits_table;
use crate::evidence::tables::Drawn;
use crate::experiment::ProgramFile;
use crate::families;
use crate::kernel::{Digest, Threads};
use crate::objects::event::ParentAdopted;
use crate::objects::{LineageId, Operation, Program, ProgramPatch, SceneScore, SolutionId};
use crate::stage::Source;

#[derive(Debug, Args)]
pub struct Options {
    /// Program, e.g. cat-idm/e2s5, or a lineage for the one that it reports; without it all that the run reports.
    pub program: Option<String>,
    #[command(flatten)]
    pub run: OneRun,
    /// Take operations out one by one, not whole patches.
    #[arg(long)]
    pub operations: bool,
    /// Write a table, as `table` does; without it what it says in words.
    #[arg(long)]
    pub format: Option<Format>,
    /// Driver under test, where the run's is not built in: the weights of a learned one (a file that ends in .safetensors or .onnx).
    #[arg(long)]
    pub ego: Option<String>,
    /// Your planner as the driver, where the run was made with one: a program, a .py file, or a .toml file with a table
    /// [driver].
    #[arg(long, conflicts_with = "ego")]
    pub driver: Option<PathBuf>,
}

pub fn run(options: &Options, jobs: usize) -> Result<Answer, Failure> {
    let folder = options.run.folder()?;
    let run = folder.recorded()?;
    let threads = files::threads(jobs)?;
    let lineage = options.program.as_ref().filter(|name| run.parents.iter().any(|of| is_of(&run, of, name)));
    let programs = match &options.program {
        Some(_) if lineage.is_some() => reported(&run, &folder.read_experiment()?.selector, lineage),
        Some(name) => match packed::find(&run, name)? {
            parent if parent.ancestor_chain.is_empty() => {
                let text = format!("{name} is a parent: there is no edit to give credit to\n");
                return Ok(Answer::new(text, json!({"credits": []})));
            }
            program => vec![program.solution_id.clone()],
        },
        None => reported(&run, &folder.read_experiment()?.selector, None),
    };
    let how = How { operations: options.operations, ego: options.ego.as_ref(), driver: options.driver.as_deref() };
    let credits = played(&how, &folder, &run, &programs, &threads)?;
    if credits.is_empty() {
        let whose = lineage.map_or("every lineage's parent".to_string(), |name| format!("the parent of {name}"));
        let text = format!("the run reports {whose}: there is no edit to give credit to\n");
        return Ok(Answer::new(text, json!({"credits": credits})));
    }
    if let Some(format) = options.format {
        let table = credits_table(&run, &credits).map_err(Failure::bad_input)?;
        return Ok(Answer::exact(format.text(&table), table.json()));
    }
    let texts: Vec<String> = credits.iter().map(|credit| credit.text(stdout_width().unwrap_or(usize::MAX))).collect();
    Ok(Answer::new(texts.join("\n"), json!({"credits": credits})))
}

/// How edits are taken out, and who drives where the run's driver is not built in.
#[derive(Default)]
struct How<'a> {
    operations: bool,
    ego: Option<&'a String>,
    driver: Option<&'a Path>,
}

/// Returns what edits of these programs account for, by rollouts. For whole patches the run's folder keeps the result.
fn played(
    how: &How<'_>,
    folder: &RunFolder,
    run: &RecordedRun,
    programs: &[SolutionId],
    threads: &Threads,
) -> Result<Vec<Credit>, Failure> {
    let mut credits = Vec::new();
    for solution in programs {
        progress(format!("{solution}: playing it without each of its edits"));
        credits.push(credit(how, folder, run, solution, threads)?);
    }
    // Labels of another simulator are not made here, so these would stand beside numbers that they do not belong to.
    let belongs = || folder.read_experiment().map(|experiment| experiment.simulator.backend.is_none());
    if !how.operations && !credits.is_empty() && belongs()? {
        kept_credit::keep(folder, run, &credits)?;
    }
    Ok(credits)
}

/// Returns the credit of all programs that a run reports, from its folder, and by rollouts for those that are missing there.
pub fn of_reported(folder: &RunFolder, run: &RecordedRun, threads: &Threads) -> Result<Vec<Credit>, Failure> {
    let programs = reported(run, &folder.read_experiment()?.selector, None);
    let mut credits = kept_credit::kept(folder, run)?;
    credits.retain(|of| programs.contains(&of.program) && knows_the_way(of));
    let is_missing = |program: &&SolutionId| credits.iter().all(|of| of.program != **program);
    let missing: Vec<SolutionId> = programs.iter().filter(is_missing).cloned().collect();
    credits.extend(played(&How::default(), folder, run, &missing, threads)?);
    credits.sort_by_key(|of| programs.iter().position(|program| *program == of.program));
    Ok(credits)
}

/// Returns `true` if the credit holds what the chain came to edit by edit, which a credit kept by an earlier version does not.
fn knows_the_way(credit: &Credit) -> bool {
    credit.edits.iter().all(|edit| edit.so_far.is_some())
}

/// Returns the credit of the program that a finished lineage reports, from the run's folder or by rollouts. `None` if the parent is
/// reported, the run is unfinished, another simulator labelled it, or its protocol is SafeBench's, whose archive holds many programs.
pub fn of_lineage(
    folder: &RunFolder,
    run: &RecordedRun,
    lineage: &LineageId,
    threads: &Threads,
) -> Result<Option<Credit>, Failure> {
    let Some(result) = run.result_of(lineage) else { return Ok(None) };
    let reported = &result.evolved.solution;
    let of_another = folder.read_experiment()?.simulator.backend.is_some();
    if *reported == result.parent.solution || !run.rounds.is_empty() || of_another {
        return Ok(None);
    }
    let known = |of: &Credit| of.program == *reported && knows_the_way(of);
    match kept_credit::kept(folder, run)?.into_iter().find(known) {
        Some(credit) => Ok(Some(credit)),
        None => Ok(played(&How::default(), folder, run, std::slice::from_ref(reported), threads)?.pop()),
    }
}

/// Returns `true` if a parent is of the lineage of this name, or of one of its seeds.
fn is_of(run: &RecordedRun, parent: &ParentAdopted, name: &str) -> bool {
    let seeds = run.result.iter().flat_map(|result| &result.lineages).filter(|of| of.group.as_str() == name);
    parent.lineage.as_str() == name || seeds.into_iter().any(|of| of.lineage == parent.lineage)
}

/// Returns the programs that a finished run reports, without parents; for an unfinished run those at which its lineages
/// stand. If a lineage is named, only its programs.
fn reported(run: &RecordedRun, selector: &SelectorOptions, lineage: Option<&String>) -> Vec<SolutionId> {
    let of = |parent: &ParentAdopted| {
        let choice = Choice::of(run, &parent.lineage, selector).map(|choice| choice.chosen);
        choice.or_else(|| run.active(&parent.lineage).cloned()).filter(|id| *id != parent.program.solution_id)
    };
    let meant = |of: &&ParentAdopted| lineage.is_none_or(|name| is_of(run, of, name));
    run.parents.iter().filter(meant).filter_map(of).collect()
}

/// Operations that are taken out together.
struct Edit {
    name: String,
    /// Places in the chain's list of operations.
    places: Vec<usize>,
}

/// The way from a parent to a program.
struct Way<'r> {
    parent: &'r Program,
    program: &'r Program,
    operations: Vec<Operation>,
    /// The last patch: what a patch says besides its operations.
    patch: &'r ProgramPatch,
    edits: Vec<Edit>,
}

impl<'r> Way<'r> {
    fn of(run: &'r RecordedRun, solution: &SolutionId, one_by_one: bool) -> Result<Way<'r>, Failure> {
        let chain = run.chain(solution);
        let [parent, .., program] = chain[..] else {
            return Err(Failure::internal(format!("{solution} has no edit to give credit to")));
        };
        let (mut operations, mut edits, mut last) = (Vec::new(), Vec::new(), None);
        for of in &chain[1..] {
            let name = of.solution_id.as_str();
            let patch = run.attempt(name).and_then(|attempt| attempt.proposal.patch());
            let patch =
                patch.ok_or_else(|| Failure::corruption(format!("{name}: the run has no patch of this program")))?;
            let from = operations.len();
            operations.extend(patch.operations.iter().cloned());
            let places = (from..operations.len()).collect::<Vec<usize>>();
            if one_by_one && places.len() > 1 {
                let of_place =
                    |(k, place): (usize, usize)| Edit { name: format!("{name} #{}", k + 1), places: vec![place] };
                edits.extend(places.into_iter().enumerate().map(of_place));
            } else {
                edits.push(Edit { name: name.to_string(), places });
            }
            last = Some(patch);
        }
        let patch = last.ok_or_else(|| Failure::internal("a chain without a patch"))?;
        Ok(Way { parent, program, operations, patch, edits })
    }

    /// The parent with the operations at some places done in order; or why that is no program of its family.
    fn with(&self, source: &Source, kept: impl Fn(usize) -> bool) -> Result<Program, String> {
        let operations = self.operations.iter().enumerate().filter(|(place, _)| kept(*place));
        let patch = ProgramPatch {
            operations: operations.map(|(_, operation)| operation.clone()).collect(),
            ..self.patch.clone()
        };
        let hash = self.parent.hash().map_err(|error| error.to_string())?;
        let built = apply(self.parent, hash, &patch, self.program.solution_id.clone());
        let built = built.map_err(|error| format!("another edit needs it ({error})"))?;
        match source.contract.check_program(&built).first() {
            None => Ok(built),
            Some(problem) => Err(format!("what is left is no program of the family ({problem})")),
        }
    }
}

fn credit(
    how: &How<'_>,
    folder: &RunFolder,
    run: &RecordedRun,
    solution: &SolutionId,
    threads: &Threads,
) -> Result<Credit, Failure> {
    let file = packed::packed_of(folder, run, solution.as_str())?;
    let way = Way::of(run, solution, how.operations)?;
    let sources = families::sources_by_hand();
    let (asked, ego) = match (how.ego, how.driver, packed::own_weights(folder, &file)?) {
        (None, None, Some(learned)) => (None, learned),
        (ego, driver, _) => applying::under_test(&file, ego, driver, None)?,
    };
    let planners = asked.as_ref().map(Asked::planners);
    let pool = folder.read_pool()?;
    let held_out = run.opened.held_out_scenes.iter().filter_map(|id| pool.scene(id).cloned().map(Arc::new));
    let scenes: Vec<_> = held_out.collect();
    let entries = threads.map(&scenes, |_, scene| SceneEntry::new(scene.clone()));
    let counsels = applying::counsels(&file, &entries);
    let backend = behind::asked(asked.as_ref(), planners.as_ref());
    let applied = Applied { backend, ..applying::as_conditioned(&file, &sources, &ego, &counsels)? };
    let source = applied.source;
    let whole = way.with(source, |_| true).map_err(Failure::internal)?;
    let (start, end) = (hash(way.parent)?, hash(way.program)?);
    if hash(&whole)? != end {
        return Err(Failure::divergence(format!("{solution}: its patches on its parent give another program")));
    }
    // Up to an edit of the chain, including the edit.
    let so_far = |edit: &Edit| way.with(source, |place| edit.places.last().is_none_or(|last| place <= *last));
    let without = |edit: &Edit| way.with(source, |place| !edit.places.contains(&place));
    let alone = |edit: &Edit| way.with(source, |place| edit.places.contains(&place));
    let variants: Vec<[Result<Program, String>; 3]> =
        way.edits.iter().map(|edit| [so_far(edit), without(edit), alone(edit)]).collect();
    // The same program comes about in several ways, the parent and the whole first of all: each is played once.
    let mut programs = BTreeMap::from([(start, way.parent), (end, &whole)]);
    for program in variants.iter().flatten().filter_map(|variant| variant.as_ref().ok()) {
        programs.insert(hash(program)?, program);
    }
    let labelled = applied.label_each(&programs.values().copied().collect::<Vec<_>>(), &entries, threads)?;
    planners.iter().filter_map(Planners::compared).for_each(progress);
    let labelled = labelled.into_iter().map(|labelled| labelled.map(|of| of.score.scenes).map_err(|e| e.to_string()));
    let labels: Labels = programs.into_keys().zip(labelled).collect();
    let needed = |digest: &Digest| labels[digest].as_ref().map_err(Failure::bad_input);
    let (before, after) = (needed(&start)?, needed(&end)?);
    as_recorded(&file, run, &[(way.parent, before), (way.program, after)])?;
    let drawn = Drawn::held_out(run);
    let none = || "no scene has labels of both".to_string();
    let of_variant = |variant: &Result<Program, String>| -> Result<&Vec<SceneScore>, String> {
        let digest = variant.as_ref().map_err(String::clone)?.hash().map_err(|error| error.to_string())?;
        labels[&digest].as_ref().map_err(String::clone)
    };
    let of_edit = |(edit, [so_far, without, alone]): (&Edit, &[Result<Program, String>; 3])| EditCredit {
        name: edit.name.clone(),
        what: edit.places.iter().map(|place| way.operations[*place].in_words()).collect(),
        so_far: Some(of_variant(so_far).and_then(|of| Gain::of(before, of, drawn.as_ref()).ok_or_else(none))),
        taken_out: of_variant(without).and_then(|of| Gain::of(of, after, drawn.as_ref()).ok_or_else(none)),
        alone: of_variant(alone).and_then(|of| Gain::of(before, of, drawn.as_ref()).ok_or_else(none)),
    };
    Ok(Credit {
        program: solution.clone(),
        parent: way.parent.solution_id.clone(),
        scenes: before.iter().filter(|label| after.iter().any(|other| other.scene == label.scene)).count(),
        whole: Gain::of(before, after, drawn.as_ref())
            .ok_or_else(|| Failure::bad_input(format!("{solution}: {}", none())))?,
        edits: way.edits.iter().zip(&variants).map(of_edit).collect(),
    })
}

/// Program hash -> its labels, or why it has none.
type Labels = BTreeMap<Digest, Result<Vec<SceneScore>, String>>;

fn hash(program: &Program) -> Result<Digest, Failure> {
    program.hash().map_err(Failure::internal)
}

/// Labels that the run recorded must come out again. Those of another simulator cannot be asked for here.
fn as_recorded(file: &ProgramFile, run: &RecordedRun, all: &[(&Program, &Vec<SceneScore>)]) -> Result<(), Failure> {
    if let Some(backend) = &file.conditions.backend {
        progress(format!("note: the run's labels are {}'s; these are of the built-in simulator", backend.name));
        return Ok(());
    }
    for (program, labels) in all {
        let recorded = run.held_out.iter().filter(|of| of.solution == program.solution_id);
        for known in recorded.flat_map(|of| &of.score.scenes) {
            let other = labels.iter().find(|label| label.scene == known.scene && label.record != known.record);
            if let Some(label) = other {
                return Err(Failure::divergence(format!(
                    "{} in {}: the run recorded another rollout; `evodrive verify` finds where they part",
                    program.solution_id, label.scene
                )));
            }
        }
    }
    Ok(())
}
