//! `bench env`: how fast environments are stepped: a fleet of the engine, as the Python package drives it, without Python.

use clap::Args;
use serde_json::json;
use std::path::PathBuf;
use std::sync::Arc;

use crate::cli::terminal::{answer::Answer, exit::Failure, timed::timed};
use crate::compiler::{Prepared, Situation};
use crate::ego::{Policy, Setting};
use crate::experiment::{ProgramFile, read_scenes};
use crate::families;
use crate::kernel::{Digest, Seed, Threads, num};
use crate::learn::Reward;
use crate::learn::fleet::{Autoreset, Fleet, FleetOptions, Task, TaskSet, Tasks};
use crate::objects::FamilyName;
use crate::scene::{PreparedScene, Scene, usable};
use crate::sim::{Intervention, Plant};

#[derive(Debug, Args)]
pub struct EnvOptions {
    /// A pool or scenario files.
    #[arg(long, num_args = 1.., required = true)]
    pub pool: Vec<PathBuf>,
    /// Environments side by side.
    #[arg(long, default_value_t = 1024)]
    pub places: usize,
    /// Steps of each in a round.
    #[arg(long, default_value_t = 100)]
    pub steps: usize,
    /// Rounds of each setting; the figures are medians.
    #[arg(long, default_value_t = 5)]
    pub repeats: usize,
    /// Print the digest of everything that one round hands out, to be held against Python's, and time nothing.
    #[arg(long)]
    pub digest: bool,
}

/// Share of the scenes as they are, beside those that CAT's parent changes.
const PLAIN: f64 = 0.3;
/// Target speed of the benchmark's driver, m/s.
const SPEED_MPS: f32 = 8.0;

pub fn run(options: &EnvOptions, jobs: usize) -> Result<Answer, Failure> {
    let threads = Threads::new(jobs)?;
    let tasks = tasks(&options.pool, &threads)?;
    if options.digest {
        return digests(options, &tasks, &threads);
    }
    let one = Threads::new(1)?;
    let (mut lines, mut rows) = (String::new(), Vec::new());
    for setting in Setting::ALL {
        let mut widths = vec![(1, &one), (options.places, &one)];
        if threads.count() > 1 {
            widths.push((options.places, &threads));
        }
        for (places, threads) in widths {
            let mut rates = Vec::new();
            let mut fleet = begun(&tasks, places, setting, threads)?;
            // As many steps in total, so that a round of one environment is long enough to be timed.
            let steps = options.steps * (options.places / places).clamp(1, 100);
            let mut ended = 0;
            for _ in 0..options.repeats.max(1) {
                let (done, took) = timed(|| driven(&mut fleet, steps, setting, threads, &mut |_| ()));
                ended += done?;
                rates.push((places * steps) as f64 / took.as_secs_f64());
            }
            let rate = num::quantile(&rates, 0.5).unwrap_or(f64::NAN);
            let length = fleet.steps() as f64 / ended.max(1) as f64;
            let (name, count) = (setting.name(), threads.count());
            lines.push_str(&format!(
                "{name:<12} {places:>6} environments, {count} threads {rate:>12.0} steps/s   {length:.0} steps an episode\n"
            ));
            rows.push(json!({
                "observation": name, "environments": places, "threads": count, "steps_per_s": rate,
                "steps_per_episode": length, "rounds": rates.len(),
            }));
        }
    }
    let text = format!(
        "observation, reward and reset of every step, medians of {} rounds, {} scenes plain and under CAT's parent\n{lines}",
        options.repeats.max(1),
        tasks.sets()[0].tasks.len()
    );
    Ok(Answer::new(text, json!({ "rows": rows })))
}

/// One round of each setting, as digests.
fn digests(options: &EnvOptions, tasks: &Arc<Tasks>, threads: &Threads) -> Result<Answer, Failure> {
    let (mut text, mut object) = (String::new(), serde_json::Map::new());
    for setting in Setting::ALL {
        let mut fleet = begun(tasks, options.places, setting, threads)?;
        let mut bytes: Vec<u8> = Vec::new();
        driven(&mut fleet, options.steps, setting, threads, &mut |fleet| {
            let sheets = fleet.sheets();
            bytes.extend(fleet.observations().iter().flat_map(|x| x.to_le_bytes()));
            bytes.extend(sheets.rewards.iter().flat_map(|x| x.to_le_bytes()));
            bytes.extend(sheets.terminated.iter().chain(&sheets.truncated));
        })?;
        let digest = Digest::of_bytes(&bytes).to_hex();
        text.push_str(&format!("{:<12} {digest}   {} transitions\n", setting.name(), fleet.steps()));
        object.insert(setting.name().into(), json!(digest));
    }
    Ok(Answer::new(text, json!({"digests": object, "threads": threads.count()})))
}

fn begun(tasks: &Arc<Tasks>, places: usize, setting: Setting, threads: &Threads) -> Result<Fleet, Failure> {
    let reward = Reward::metadrive(1.0);
    let (seeing, autoreset) = (setting.into(), Autoreset::SameStep);
    let (assesses, keeps, keeps_motion) = (false, false, false);
    let options = FleetOptions { seeing, reward, autoreset, by_failure: 1.0, assesses, keeps, keeps_motion };
    let mut fleet = Fleet::new(tasks.clone(), places, options).map_err(Failure::bad_input)?;
    fleet.reset(&|_| true, None, threads).map_err(Failure::bad_input)?;
    Ok(fleet)
}

/// Drives this many steps of every environment; returns the number of episodes that ended.
fn driven(
    fleet: &mut Fleet,
    steps: usize,
    setting: Setting,
    threads: &Threads,
    see: &mut dyn FnMut(&Fleet),
) -> Result<usize, Failure> {
    let (width, mut ended, mut actions) = (setting.length(), 0, vec![0.0; 2 * fleet.places()]);
    for _ in 0..steps {
        for (seen, action) in fleet.observations().chunks_exact(width).zip(actions.chunks_exact_mut(2)) {
            action.copy_from_slice(&along_the_route(setting, seen));
        }
        fleet.actions_mut().copy_from_slice(&actions);
        ended += fleet.step(threads).map_err(Failure::bad_input)?;
        see(fleet);
    }
    Ok(ended)
}

/// Keeps to the route at a steady speed and looks out for nobody: episodes last as long as a driver's do, and it costs nothing.
/// `bridges/python/benches/env.py` has the same, number by number.
fn along_the_route(setting: Setting, seen: &[f32]) -> [f32; 2] {
    let (steering, speed_mps) = match setting {
        Setting::Metadrive1 => (seen[4] * 4.5 - seen[3] * 0.6, seen[0] * 20.0),
        Setting::Safebench1 => (seen[1] * 2.7 - seen[0] * 0.3, seen[2]),
        Setting::Safebench2 => (-seen[1] * 2.7 - seen[0] * 0.3, seen[2]),
    };
    [steering.clamp(-1.0, 1.0), ((SPEED_MPS - speed_mps) * 0.5).clamp(-1.0, 1.0)]
}

/// Usable scenes as they are, and under CAT's published parent planned around IDM.
fn tasks(pool: &[PathBuf], threads: &Threads) -> Result<Arc<Tasks>, Failure> {
    let family = FamilyName::new("cat");
    let file = ProgramFile::published(&family)?;
    let sources = families::sources();
    let source = sources.get(&family).ok_or_else(|| Failure::internal("the family cat is gone"))?;
    let prepared = Prepared::new(&file.program, source).map_err(Failure::internal)?;
    let scenes: Vec<Arc<Scene>> = read_scenes(pool, threads)?.scenes.into_iter().map(Arc::new).collect();
    let scenes: Vec<Arc<Scene>> = scenes.into_iter().filter(|scene| usable(scene).is_ok()).collect();
    let made = threads.map(&scenes, |_, scene| {
        let ready = PreparedScene::new(scene.clone());
        let plant = Plant::with_options(ready.clone(), &file.conditions.simulator).map(Arc::new);
        let act = Situation::under(ready, &Policy::Idm, &file.conditions.simulator).ok().and_then(|situation| {
            prepared.compile(&situation, Seed(file.conditions.seed)).ok().map(|compiled| compiled.intervention)
        });
        (plant, act)
    });
    let mut sets = [Vec::new(), Vec::new()];
    for (scene, (plant, act)) in made.into_iter().enumerate() {
        let plant = plant.map_err(Failure::bad_input)?;
        let task = |intervention| Task { scene, plant: plant.clone(), intervention: Arc::new(intervention) };
        sets[0].push(task(Intervention::default()));
        sets[1].extend(act.map(task));
    }
    let sets = sets.into_iter().zip([PLAIN, 1.0 - PLAIN]).map(|(tasks, share)| TaskSet { share, tasks }).collect();
    Tasks::new(sets).map(Arc::new).map_err(Failure::bad_input)
}
