//! `apply`: a program file played on any scenes: no model, no experiment file, no run folder.

use clap::Args;
use serde_json::json;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::backend::{Answers, Backend, Planners};
use crate::cli::evolve::behind::{self, Asked};
use crate::cli::look::rollout::Played;
use crate::cli::scenes::export::{AT_ONCE, Exports, Format};
use crate::cli::scenes::files;
use crate::cli::studies::applied_broken;
use crate::cli::studies::applied_text::{self, Comparison, Written};
use crate::cli::studies::egos;
use crate::cli::terminal::answer::{Answer, progress};
use crate::cli::terminal::exit::Failure;
use crate::cli::terminal::output::Output;
use crate::cli::terminal::shell::quoted;
use crate::draw::{Drawing, players_html};
use crate::ego::{Policy, PolicyError};
use crate::epoch::{Applied, Labelled, SceneEntry, record_digest};
use crate::evaluation::{EvaluationOptions, Playing, replay_row};
use crate::experiment::{Conditions, Experiment, ProgramFile};
use crate::families;
use crate::kernel::{Digest, Seed, Threads};
use crate::objects::replay::{Replayed, Suite};
use crate::objects::{Counsel, OverEgos, SceneScore};
use crate::scene::{LeftOut, Pool, Scene, usable};
use crate::stage::Sources;
use crate::text::{counted, nearest};

/// Rollouts that the player page holds.
const SHOWN_MAX: usize = 24;

#[derive(Debug, Args)]
pub struct Options {
    /// Program file, JSON or TOML, as `evodrive program export` or `program new` writes it.
    pub program: PathBuf,
    /// A pool, scenario files or folders.
    #[arg(long, num_args = 1.., required = true)]
    pub scenes: Vec<PathBuf>,
    /// Only the scene with this id; may be repeated.
    #[arg(long)]
    pub scene: Vec<String>,
    /// Driver under test: idm, idm-lights, pdm, frenet, replay, or the weights of a learned one (a file that ends in .safetensors or .onnx, or a name as
    /// evodrive:sac-chatscene); without it the one that the program was evolved against.
    #[arg(long)]
    pub ego: Option<String>,
    /// Your planner as the driver: a program, a .py file, or a .toml file with a table [driver] (docs/EGOS.md).
    #[arg(long, conflicts_with = "ego")]
    pub driver: Option<PathBuf>,
    /// Seconds that your planner may take for a decision; a scene in which it takes longer is counted as too slow, which is neither a
    /// crash nor a success. Without it 10, or what its table [driver] says.
    #[arg(long, requires = "driver")]
    pub time_limit: Option<f64>,
    /// Simulate and judge by the rules of this experiment file ([simulator] and [evaluation]) instead of those that the program was
    /// evolved under; seed, scenes and driver are not taken from it.
    #[arg(long)]
    pub rules: Option<PathBuf>,
    /// Say also for whose contacts the driver is at fault by nuPlan's rule, and which reference drivers avoid them; labels then have other
    /// keys than in the program's run.
    #[arg(long)]
    pub at_fault: bool,
    /// List the scenes in which the driver meets somebody, and under which program, with the command that plays each.
    #[arg(long)]
    pub scenes_broken: bool,
    /// Root of the random streams; without it the one of the program's run.
    #[arg(long)]
    pub seed: Option<u64>,
    /// Folder for a page that plays the rollouts, and for the scenes as the program played them.
    #[arg(long)]
    pub out: Option<PathBuf>,
    #[command(flatten)]
    pub output: Output,
    /// Format of the scenes in that folder; without it the page alone is written.
    #[arg(long, requires = "out")]
    pub format: Option<Format>,
    /// Write scenes with the ego's recorded motion and the whole horizon: the program's road users move as it
    /// commands, whatever the ego does.
    #[arg(long, requires = "format")]
    pub ego_log: bool,
}

pub fn run(options: &Options, jobs: usize) -> Result<Answer, Failure> {
    let file = ProgramFile::read(&options.program)?;
    let mut file = options.rules.iter().try_fold(file, |file, rules| under_rules(file, rules))?;
    // Labels that say more are other labels: their keys are not those of the program's run.
    if options.at_fault {
        (file.conditions.simulator.at_fault, file.conditions.simulator.jury) = (true, true);
    }
    let (asked, ego) = under_test(&file, options.ego.as_ref(), options.driver.as_deref(), options.time_limit)?;
    let planners = asked.as_ref().map(Asked::planners);
    let seed = Seed(options.seed.unwrap_or(file.conditions.seed));
    let pool = files::chosen(&options.scenes, &options.scene, jobs)?;
    let threads = files::threads(jobs)?;
    let pool_digest = pool.digest();
    let (taken, left_out) = sorted_out(&options.scenes, &file, pool)?;
    let entries = threads.map(&taken, |_, scene| SceneEntry::new(scene.clone()));
    let counsels = counsels(&file, &entries);
    let sources = families::sources_by_hand();
    let backend = behind::asked(asked.as_ref(), planners.as_ref());
    let applied = Applied { seed, backend, ..as_conditioned(&file, &sources, &ego, &counsels)? };
    let mut labelled = applied.label(&[&file.parent, &file.program], &entries, &threads)?;
    let (Some(program), Some(parent)) = (labelled.pop(), labelled.pop()) else {
        return Err(Failure::internal("two programs were labelled"));
    };
    let replay = without_program(&applied, &entries, &threads)?;
    let written = match &options.out {
        None => Written::default(),
        Some(out) => write(&applied, &file, &program, &entries, out, options, &threads)?,
    };
    let compared = Comparison {
        ego: ego.clone(),
        seed,
        pool: pool_digest,
        scenes: taken.iter().map(|scene| scene.id.clone()).collect(),
        left_out,
        counselled: counsels.len(),
        familiar: entries.iter().filter(|entry| file.evolution_scenes.contains(&entry.digest)).count(),
        replay,
        parent,
        program,
        rules: options.rules.as_ref().map(|rules| rules.display().to_string()),
        file: file.clone(),
    };
    planners.iter().filter_map(Planners::compared).for_each(progress);
    let broken = options.scenes_broken.then(|| {
        let Comparison { scenes, replay, parent, program, .. } = &compared;
        applied_broken::broken(scenes, replay, &parent.score, &program.score, &command(options))
    });
    Ok(applied_text::answer(&compared, &written, broken.as_deref()))
}

/// The command as it was typed, without what chooses scenes and what is written.
fn command(options: &Options) -> String {
    let path = |path: &Path| quoted(&path.to_string_lossy());
    let scenes: Vec<String> = options.scenes.iter().map(|of| path(of)).collect();
    let mut command = format!("evodrive apply {} --scenes {}", path(&options.program), scenes.join(" "));
    let named = [
        ("--ego", options.ego.as_deref().map(quoted)),
        ("--driver", options.driver.as_deref().map(path)),
        ("--time-limit", options.time_limit.map(|limit| limit.to_string())),
        ("--rules", options.rules.as_deref().map(path)),
        ("--seed", options.seed.map(|seed| seed.to_string())),
    ];
    for (name, value) in named.into_iter().filter_map(|(name, value)| Some((name, value?))) {
        command.push_str(&format!(" {name} {value}"));
    }
    if options.at_fault {
        command.push_str(" --at-fault");
    }
    command
}

/// The file as if its programs had been evolved under another experiment's rules.
fn under_rules(file: ProgramFile, rules: &Path) -> Result<ProgramFile, Failure> {
    let experiment = Experiment::read(rules)?;
    let staged =
        |of: &EvaluationOptions| if of.safebench().is_some() { "SafeBench's routes" } else { "recorded traffic" };
    let (theirs, own) = (staged(&experiment.evaluation), staged(&file.conditions.evaluation));
    if theirs != own {
        return Err(Failure::bad_input(format!(
            "--rules {}: judges programs on {theirs}, and the program is one for {own}; name an experiment on {own}",
            rules.display()
        )));
    }
    let conditions = Conditions {
        simulator: experiment.simulator.rules(),
        evaluation: experiment.evaluation.clone(),
        ..file.conditions
    };
    Ok(ProgramFile { conditions, ..file })
}

/// Returns who drives: the planner that is named, or else the policy that is, or else the one that the program was evolved against.
pub fn under_test(
    file: &ProgramFile,
    ego: Option<&String>,
    planner: Option<&Path>,
    limit_s: Option<f64>,
) -> Result<(Option<Asked>, Policy), Failure> {
    let named = |path: &Path| Asked::named(path, &file.conditions.simulator)?.within(limit_s);
    let asked = planner.map(named).transpose()?;
    let ego = match &asked {
        Some(asked) => asked.ego()?,
        None => driver(ego.unwrap_or(&file.conditions.ego))?,
    };
    Ok((asked, ego))
}

/// A driver by its name, or by the file of its weights.
pub fn driver(name: &str) -> Result<Policy, Failure> {
    if egos::is_weights(name) {
        return egos::learned(Path::new(name));
    }
    if [OverEgos::Mean, OverEgos::Worst].iter().any(|rule| name.starts_with(&rule.label(&[]))) {
        return Err(Failure::bad_input(format!(
            "the program was evolved against several drivers ({name}), and this plays it against one: `evodrive apply --ego idm`, pdm, frenet or evodrive:sac-metadrive-2, or `evodrive transfer`"
        )));
    }
    name.parse().map_err(|error| match error {
        PolicyError::NoWeights => Failure::bad_input(
            "the program was evolved against a learned ego, whose weights are not in its file; name them: --ego policies/<name>.safetensors",
        ),
        PolicyError::NoProgram => Failure::bad_input(
            "the program was evolved against a planner, which is not in its file; name it: --driver planner.py, a program, or a .toml file with a table [driver]",
        ),
        PolicyError::Unknown(_) => {
            let near = nearest(name, Policy::NAMES);
            Failure::bad_input(format!("{error}{}", near.map_or(String::new(), |near| format!("; did you mean {near}?"))))
        }
    })
}

/// The same scenes with the empty intervention.
fn without_program(applied: &Applied<'_>, entries: &[SceneEntry], threads: &Threads) -> Result<Replayed, Failure> {
    let Applied { ego, simulator, backend, evaluation, seed, .. } = *applied;
    let playing = Playing { ego, simulator, backend, seed, evaluation };
    let prepared: Vec<_> = entries.iter().map(|entry| entry.prepared.clone()).collect();
    // The suite is a word of runs, which nothing here reads.
    replay_row(&prepared, Suite::Evolution, &playing, threads)?
        .ok_or_else(|| Failure::bad_input("no scene could be played without a program"))
}

/// Which scenes are played, and which are not and why.
pub type SortedOut = (Vec<Arc<Scene>>, Vec<(String, String)>);

/// Scenes that evolution could use too. Scenes of the other protocol are refused: a program of recorded traffic moves
/// logged vehicles, one of SafeBench's families moves the road users that a traffic family stages.
pub fn sorted_out(paths: &[PathBuf], file: &ProgramFile, pool: Pool) -> Result<SortedOut, Failure> {
    let wants_staged = file.conditions.evaluation.safebench().is_some();
    let mut strange = pool.scenes.iter().filter(|scene| scene.staging.is_some() != wants_staged);
    if let Some(first) = strange.next() {
        let (count, all) = (1 + strange.count(), pool.scenes.len());
        let place = paths.first().map_or(Path::new(""), PathBuf::as_path).display();
        let (is, wants) = if wants_staged {
            ("recorded or generated traffic", "scenes that are staged for SafeBench's traffic families")
        } else {
            ("staged for a traffic family of SafeBench", "recorded or generated traffic")
        };
        return Err(Failure::bad_input(format!(
            "{place}: {count} of {all} scenes are {is} (the first is {}), and a program of family {} plays {wants}; name \
             such scenes",
            first.id, file.family
        )));
    }
    let name = |left: &LeftOut| {
        if left.what.is_empty() { left.file.clone() } else { format!("{} ({})", left.file, left.what) }
    };
    let mut left_out: Vec<(String, String)> =
        pool.left_out.iter().map(|left| (name(left), left.reason.clone())).collect();
    let mut taken = Vec::new();
    for scene in pool.scenes {
        match usable(&scene) {
            Ok(()) => taken.push(Arc::new(scene)),
            Err(reason) => left_out.push((scene.id, reason.to_string())),
        }
    }
    if taken.is_empty() {
        let reasons: Vec<String> = left_out.iter().map(|(scene, reason)| format!("  {scene}: {reason}")).collect();
        return Err(Failure::bad_input(format!("no scene can be played:\n{}", reasons.join("\n"))));
    }
    Ok((taken, left_out))
}

/// Counsel of the file for the scenes that are still those for which it was taken, and its sequences for all others.
pub fn counsels(file: &ProgramFile, entries: &[SceneEntry]) -> BTreeMap<Digest, Counsel> {
    let of = |entry: &SceneEntry| Some((entry.digest, file.counsel_in(entry.scene(), entry.digest)?));
    entries.iter().filter_map(of).collect()
}

/// Returns what plays a file's programs under its own conditions, by our own simulator.
pub fn as_conditioned<'a>(
    file: &'a ProgramFile,
    sources: &'a Sources,
    ego: &'a Policy,
    counsels: &'a BTreeMap<Digest, Counsel>,
) -> Result<Applied<'a>, Failure> {
    let source = sources.get(&file.family).ok_or_else(|| Failure::internal("a family that was read is gone"))?;
    Ok(Applied {
        source,
        ego,
        seed: Seed(file.conditions.seed),
        simulator: &file.conditions.simulator,
        backend: Backend::Own,
        evaluation: &file.conditions.evaluation,
        counsels,
    })
}

/// Plays the program once more with its motion, and writes the page and the scenes.
fn write(
    applied: &Applied<'_>,
    file: &ProgramFile,
    labelled: &Labelled,
    entries: &[SceneEntry],
    out: &Path,
    options: &Options,
    threads: &Threads,
) -> Result<Written, Failure> {
    let labels: BTreeMap<&str, &SceneScore> =
        labelled.score.scenes.iter().map(|label| (label.scene.as_str(), label)).collect();
    let of_label = |entry: &&SceneEntry| labels.contains_key(entry.scene().id.as_str());
    let played: Vec<&SceneEntry> = entries.iter().filter(of_label).collect();
    let shown = shown(&labelled.score.scenes);
    let (mut drawings, mut exports) =
        (Vec::new(), options.format.map(|format| Exports::new(format, out, options.output)));
    for some in played.chunks(AT_ONCE) {
        let traced = threads.map(some, |_, entry| one(applied, file, entry, &labels));
        let traced = traced.into_iter().collect::<Result<Vec<Played>, Failure>>()?;
        drawings.extend(traced.iter().filter(|played| shown.contains(&played.scene.id)).map(titled));
        if let Some(exports) = &mut exports {
            let of = |played: &Played| Ok((played.scene.clone(), Some(played.wanted(options.ego_log)?)));
            exports.write(traced.iter().map(of).collect::<Result<_, Failure>>()?, threads)?;
        }
    }
    let page = out.join("player.html");
    let title = format!("{} against {}", file.program.solution_id, applied.ego.name());
    options.output.write(&page, players_html(&drawings, &title).as_bytes())?;
    let cut = match played.len() - drawings.len() {
        0 => String::new(),
        cut => format!(" (attacks first; {cut} more are not on the page)"),
    };
    let mut text = format!("{} in {}{cut}\n", counted(drawings.len(), "rollout"), page.display());
    let mut json = json!({"player": page, "shown": drawings.len()});
    if let Some(exports) = exports {
        // The tables are worth printing also where the format holds no scene: its reasons stand under them.
        text.push_str(&exports.left_out_text());
        text.push_str(&format!("{} in {}\n", counted(exports.written(), "scene"), out.display()));
        json["exported"] = exports.json();
    }
    Ok(Written { text, json })
}

/// Ids of the scenes on the page: attacks first, then where the program acts, then the others, each in the pool's order.
fn shown(labels: &[SceneScore]) -> BTreeSet<String> {
    let mut order: Vec<&SceneScore> = labels.iter().collect();
    order.sort_by(|a, b| b.attack.total_cmp(&a.attack).then(b.acted.cmp(&a.acted)));
    order.into_iter().take(SHOWN_MAX).map(|label| label.scene.clone()).collect()
}

fn one(
    applied: &Applied<'_>,
    file: &ProgramFile,
    entry: &SceneEntry,
    labels: &BTreeMap<&str, &SceneScore>,
) -> Result<Played, Failure> {
    let scene = entry.scene();
    let traced = applied
        .trace(&file.program, entry)
        .map_err(|reason| Failure::internal(format!("scene {}: {reason}", scene.id)))?;
    let record = record_digest(&traced.record).map_err(Failure::internal)?;
    if labels.get(scene.id.as_str()).is_some_and(|label| label.record != record) {
        return Err(Failure::divergence(format!("scene {}: two rollouts of one program differ", scene.id)));
    }
    Ok(Played::of(file.program.solution_id.clone(), Scene::clone(scene), traced))
}

fn titled(played: &Played) -> (String, Drawing) {
    (format!("{}: {}", played.scene.id, played.caption()), played.drawing())
}
