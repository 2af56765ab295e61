//! `scenes check`, `filter`, `merge`, `split`: pools out of pools.

use clap::{ArgGroup, Args};
use serde_json::json;
use std::path::PathBuf;

use crate::cli::scenes::{contradictions, files, formula::SceneFormula, left_out, recorded_crash};
use crate::cli::terminal::answer::Answer;
use crate::cli::terminal::exit::{Exit, Failure};
use crate::cli::terminal::output::Output;
use crate::experiment;
use crate::kernel::Seed;
use crate::scene::pool::{self, EvolutionSize};
use crate::scene::{LaneGraph, LeftOut, Pool, Scene, SceneFeatures, usable};
use crate::sim::Plant;
use crate::text::counted;

#[derive(Debug, Args)]
pub struct CheckOptions {
    /// Pools, scenario files or folders.
    #[arg(required = true)]
    pub paths: Vec<PathBuf>,
}

#[derive(Debug, Args)]
pub struct FilterOptions {
    /// Pools, scenario files or folders.
    #[arg(required = true)]
    pub paths: Vec<PathBuf>,
    /// Only scenes with this tag, e.g. junction; may be repeated.
    #[arg(long)]
    pub tag: Vec<String>,
    /// Only scenes for which this holds: an expression over the scene's quantities, which `evodrive features` lists.
    #[arg(long = "where", value_name = "EXPRESSION")]
    pub holds: Option<String>,
    /// Only scenes that evolution can use.
    #[arg(long)]
    pub usable: bool,
    /// Leave out scenes whose recorded ego itself touches somebody; `scenes check` names them.
    #[arg(long)]
    pub without_crashes: bool,
    /// Leave out the scene with this id; may be repeated.
    #[arg(long, value_name = "ID")]
    pub without: Vec<String>,
    /// Pool file to write.
    #[arg(long)]
    pub out: PathBuf,
    #[command(flatten)]
    pub output: Output,
}

#[derive(Debug, Args)]
pub struct MergeOptions {
    /// Pools, scenario files or folders.
    #[arg(required = true)]
    pub paths: Vec<PathBuf>,
    /// Pool file to write.
    #[arg(long)]
    pub out: PathBuf,
    #[command(flatten)]
    pub output: Output,
}

#[derive(Debug, Args)]
#[command(group(ArgGroup::new("rule").required(true).args(["held_out", "tag"])))]
pub struct SplitOptions {
    /// Pools, scenario files or folders.
    #[arg(required = true)]
    pub paths: Vec<PathBuf>,
    /// Number of scenes to hold out; they are drawn as an experiment with this seed draws them.
    #[arg(long, value_name = "COUNT")]
    pub held_out: Option<usize>,
    /// Root of the draw.
    #[arg(long, default_value_t = 0, conflicts_with = "tag")]
    pub seed: u64,
    /// Hold out the scenes with this tag instead, e.g. junction.
    #[arg(long)]
    pub tag: Option<String>,
    /// Pool file for the scenes that are not held out.
    #[arg(long)]
    pub out: PathBuf,
    /// Pool file for those that are.
    #[arg(long, value_name = "FILE")]
    pub held_out_to: PathBuf,
    #[command(flatten)]
    pub output: Output,
}

/// Returns what keeps a scene from being used, if anything does: a rule of evolution, or a world that cannot be simulated.
fn fault(scene: &Scene) -> Option<String> {
    match usable(scene) {
        Err(reason) => Some(reason.to_string()),
        Ok(()) => Plant::new(scene).err().map(|error| format!("it cannot be simulated: {error}")),
    }
}

/// Checks every scene as evolution would use it.
pub fn check(options: &CheckOptions, jobs: usize) -> Result<Answer, Failure> {
    let threads = files::threads(jobs)?;
    let pool = experiment::read_scenes(&options.paths, &threads)?;
    let faults = threads.map(&pool.scenes, |_, scene| fault(scene));
    let unfit: Vec<(String, String)> =
        pool.scenes.iter().zip(faults).filter_map(|(scene, fault)| Some((scene.id.clone(), fault?))).collect();
    let mut lines = left_out::lines(&pool);
    lines.extend(left_out::listed("not used", unfit.iter().cloned()));
    let (all, good) = (pool.scenes.len(), pool.scenes.len() - unfit.len());
    let checks = contradictions::of_pool(&pool.scenes, &threads);
    lines.push(contradictions::table(&checks).trim_end().to_string());
    lines.extend(contradictions::lines(&checks));
    let crashes = recorded_crash::of_pool(&pool.scenes, &threads);
    lines.extend(recorded_crash::lines(&crashes, all, &options.paths));
    lines.push(format!("{good} of {} can be used; digest of the pool {}", counted(all, "scene"), pool.digest()));
    let rows: Vec<_> = unfit.iter().map(|(id, reason)| json!({"scene": id, "reason": reason})).collect();
    let object = json!({
        "digest": pool.digest(), "scenes": all, "usable": good, "unusable": rows, "left_out": pool.left_out,
        "recorded_crashes": crashes, "consistency": checks,
    });
    let exit = if unfit.is_empty() { Exit::Success } else { Exit::BadInput };
    Ok(Answer { exit, ..Answer::new(lines.join("\n"), object) })
}

/// Scenes by tag, by an expression, by use.
pub fn filter(options: &FilterOptions, jobs: usize) -> Result<Answer, Failure> {
    files::known_tags(&options.tag)?;
    let formula = options.holds.as_deref().map(SceneFormula::parse).transpose().map_err(Failure::bad_input)?;
    let threads = files::threads(jobs)?;
    let mut pool = experiment::read_scenes(&options.paths, &threads)?;
    for id in &options.without {
        files::named(&pool, &options.paths[0], id)?;
    }
    let keeps = threads.map(&pool.scenes, |_, scene| {
        let features = SceneFeatures::of(scene, &LaneGraph::of(&scene.road));
        options.tag.iter().all(|tag| features.tags.contains(&tag.as_str()))
            && formula.as_ref().is_none_or(|formula| formula.holds(&features))
            && (!options.usable || fault(scene).is_none())
            && (!options.without_crashes || recorded_crash::recorded_crash(scene).is_none())
            && !options.without.contains(&scene.id)
    });
    let (all, mut keeps) = (pool.scenes.len(), keeps.into_iter());
    pool.scenes.retain(|_| keeps.next().unwrap_or(false));
    if pool.scenes.is_empty() {
        return Err(Failure::bad_input(format!(
            "none of the {all} scenes fits, so no pool is written; `evodrive scenes list` shows their tags, `evodrive scenes stats` their quantities"
        )));
    }
    let mut answer = files::written(&pool, &options.out, options.output, &threads)?;
    answer.text += &format!("{} of {} kept\n", pool.scenes.len(), counted(all, "scene"));
    answer.json["of"] = json!(all);
    Ok(answer)
}

/// The union of pools.
pub fn merge(options: &MergeOptions, jobs: usize) -> Result<Answer, Failure> {
    let threads = files::threads(jobs)?;
    let read = |path: &PathBuf| {
        Ok::<_, Failure>((path.display().to_string(), experiment::read_scenes(std::slice::from_ref(path), &threads)?))
    };
    let pools = options.paths.iter().map(read).collect::<Result<Vec<_>, _>>()?;
    let (pool, repeated) = Pool::merged(pools).map_err(Failure::bad_input)?;
    let mut answer = files::written(&pool, &options.out, options.output, &threads)?;
    if repeated > 0 {
        answer.text += &format!("in several pools, and kept once: {}\n", counted(repeated, "scene"));
    }
    answer.json["repeated"] = json!(repeated);
    Ok(answer)
}

/// Two pools that share no scene.
pub fn split(options: &SplitOptions, jobs: usize) -> Result<Answer, Failure> {
    files::known_tags(options.tag.as_slice())?;
    if options.out == options.held_out_to {
        return Err(Failure::bad_input(format!(
            "--out and --held-out-to are both {}, expected two files",
            options.out.display()
        )));
    }
    let threads = files::threads(jobs)?;
    let pool = experiment::read_scenes(&options.paths, &threads)?;
    let split = match (&options.tag, options.held_out) {
        (Some(tag), _) => {
            pool.parted(|scene| SceneFeatures::of(scene, &LaneGraph::of(&scene.road)).tags.contains(&tag.as_str()))
        }
        (None, held_out) => pool
            .split(Seed(options.seed), EvolutionSize::Share(1.0), held_out.unwrap_or_default())
            .map_err(Failure::bad_input)?,
    };
    let (mut open, closed) = (pool.part(&split.evolution), pool.part(&split.held_out));
    for (part, name) in [(&open, "the scenes that are not held out"), (&closed, "the held-out scenes")] {
        if part.scenes.is_empty() {
            return Err(Failure::bad_input(format!(
                "{name} would be 0 of {}; nothing is written: give another count or tag",
                pool.scenes.len()
            )));
        }
    }
    let unused = |scene: &Scene| {
        let reason = usable(scene).err()?.to_string();
        Some(LeftOut { file: scene.origin.name.clone(), what: format!("scene {}", scene.id), reason })
    };
    open.left_out = pool.scenes.iter().filter_map(unused).collect();
    let mut lines = left_out::lines(&open);
    // Both or none.
    for out in [&options.out, &options.held_out_to] {
        options.output.may_be_made(out)?;
    }
    for (part, out) in [(&open, &options.out), (&closed, &options.held_out_to)] {
        options.output.write(out, &pool::encode(part))?;
        lines.push(format!("{} in {}, digest {}", counted(part.scenes.len(), "scene"), out.display(), part.digest()));
    }
    let described = |part: &Pool, out: &PathBuf| {
        let ids: Vec<&str> = part.scenes.iter().map(|scene| scene.id.as_str()).collect();
        json!({"pool": out, "digest": part.digest(), "scenes": ids})
    };
    let object = json!({"open": described(&open, &options.out), "held_out": described(&closed, &options.held_out_to)});
    Ok(Answer::new(lines.join("\n"), object))
}
