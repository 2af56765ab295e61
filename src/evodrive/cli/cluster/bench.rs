//! `bench`: how fast this machine simulates. The clock lives here, not in the simulator.

use clap::{Args, Subcommand};
use serde_json::json;
use std::path::PathBuf;

use crate::cli::cluster::bench_env;
use crate::cli::cluster::bench_ledger;
use crate::cli::cluster::bench_observe::{Cost, Observer};
use crate::cli::cluster::bench_shards;
use crate::cli::studies::apply::driver;
use crate::cli::terminal::{answer::Answer, exit::Failure, timed::timed};
use std::collections::BTreeMap;
use std::sync::Arc;

use crate::compiler::{Prepared, Situation};
use crate::ego::{Policy, Setting};
use crate::experiment::read_scenes;
use crate::families::{self, grammar};
use crate::kernel::{Seed, Threads, num};
use crate::objects::{FamilyName, Program};
use crate::scene::Scene;
use crate::sim::{Intervention, Part, RolloutCost, SimError, rollout_counted, rollout_in_parts};

#[derive(Debug, Subcommand)]
pub enum Command {
    /// Simulate every scene of a pool with an ego and one CAT adversary, with contacts and all metrics.
    Sim(SimOptions),
    /// Step environments side by side, observations, rewards and resets included, as the Python package does.
    Env(bench_env::EnvOptions),
    /// Plan, write and merge a given number of rollouts as shards; one record stands for all of them.
    Shards(bench_shards::ShardsOptions),
    /// Record, read and verify objects in a trial store, and explain missing answers of a large cassette.
    Ledger(bench_ledger::LedgerOptions),
}

#[derive(Debug, Args)]
pub struct SimOptions {
    /// A pool or scenario files.
    #[arg(long, num_args = 1.., required = true)]
    pub pool: Vec<PathBuf>,
    /// How often the whole pool is rolled out; the figures are medians.
    #[arg(long, default_value_t = 5)]
    pub repeats: usize,
    /// Driver under test: idm, idm-lights, pdm, frenet, replay, or weights (.safetensors, .onnx, or a name as evodrive:sac-metadrive).
    #[arg(long, default_value = "idm")]
    pub ego: String,
    /// Also roll the pool out with the adversaries under a law, and give the ratio of the two speeds.
    #[arg(long)]
    pub law: bool,
    /// Also roll the pool out with the observations of a learned ego made at every step, and give what one costs.
    #[arg(long)]
    pub observe: bool,
}

pub fn run(command: Command, jobs: usize) -> Result<Answer, Failure> {
    match command {
        Command::Sim(options) => sim(&options, jobs),
        Command::Env(options) => bench_env::run(&options, jobs),
        Command::Ledger(options) => bench_ledger::run(&options, jobs),
        Command::Shards(options) => bench_shards::run(&options, jobs),
    }
}

fn sim(options: &SimOptions, jobs: usize) -> Result<Answer, Failure> {
    let threads = Threads::new(jobs)?;
    let (pool, reading) = timed(|| read_scenes(&options.pool, &threads));
    // Shared, not copied: a pool is in memory once.
    let scenes: Vec<Arc<Scene>> = pool?.scenes.into_iter().map(Arc::new).collect();
    let ego = driver(&options.ego)?;
    let (prepared, preparing) = timed(|| stages(&scenes, &ego, options.law, &threads));
    let mut lawful: Vec<Intervention> = Vec::new();
    let stages: Vec<(Situation, Intervention)> = prepared
        .into_iter()
        .flatten()
        .map(|(situation, plain, law)| {
            lawful.extend(law);
            (situation, plain)
        })
        .collect();
    if stages.is_empty() {
        return Err(Failure::bad_input(format!("no scene of the pool can be simulated with the ego {}", options.ego)));
    }
    let mut seconds = Vec::new();
    let mut ratios = Vec::new();
    let (mut steps, mut agent_steps) = (0, 0);
    for _ in 0..options.repeats.max(1) {
        let round = Round::of(&threads, stages.len(), |i| {
            rollout_counted(&stages[i].0.plant, &stages[i].1, ego.driver().as_mut()).map(|(_, cost)| cost)
        })?;
        (steps, agent_steps) = (round.steps, round.agent_steps);
        seconds.push(round.seconds);
        if options.law {
            let under_law = Round::of(&threads, lawful.len(), |i| {
                rollout_counted(&stages[i].0.plant, &lawful[i], ego.driver().as_mut()).map(|(_, cost)| cost)
            })?;
            ratios.push(under_law.agent_steps_per_s() / round.agent_steps_per_s());
        }
    }
    let law = num::quantile(&ratios, 0.5);
    let median = num::quantile(&seconds, 0.5).unwrap_or(f64::NAN);
    let rate = |count: usize| count as f64 / median;
    let observed =
        if options.observe { observed(&stages, &ego, median, steps, options.repeats, &threads)? } else { vec![] };
    let split = Split::of(&stages, &ego, seconds.len()).map_err(Failure::internal)?;
    let text = format!(
        "{} scenes, {} threads, median of {} rounds\nrollouts/s     {:>14.0}\nsteps/s        {:>14.0}\nagent-steps/s  {:>14.0}\n\
         reading the pool took {:.2} s, preparing all scenes and compiling the adversaries {:.2} s, one round of rollouts {:.4} s\n{}{}",
        stages.len(),
        threads.count(),
        seconds.len(),
        rate(stages.len()),
        rate(steps as usize),
        rate(agent_steps as usize),
        reading.as_secs_f64(),
        preparing.as_secs_f64(),
        median,
        law.map(|ratio| format!("with a law (an expression evaluated at each step) for every adversary: {ratio:.2} times the agent-steps/s\n"))
            .unwrap_or_default(),
        observed.iter().map(Cost::text).collect::<String>() + &split.text()
    );
    let object = json!({
        "scenes": stages.len(), "threads": threads.count(), "rounds": seconds.len(),
        "rollouts_per_s": rate(stages.len()), "steps_per_s": rate(steps as usize),
        "agent_steps_per_s": rate(agent_steps as usize),
        "seconds": {"read": reading.as_secs_f64(), "prepare": preparing.as_secs_f64(), "rollouts_median": median},
        "split": split.object(), "law_ratio": law,
        "observe_us_per_step": observed.iter().map(|cost| (cost.setting.name(), cost.us_per_step())).collect::<BTreeMap<_, _>>(),
    });
    Ok(Answer::new(text, object))
}

/// The same rollouts with each setting's observation.
fn observed(
    stages: &[(Situation, Intervention)],
    ego: &Policy,
    plain_seconds: f64,
    steps: u64,
    repeats: usize,
    threads: &Threads,
) -> Result<Vec<Cost>, Failure> {
    let cost = |setting: Setting| {
        let mut seconds = Vec::new();
        for _ in 0..repeats.max(1) {
            let round = Round::of(threads, stages.len(), |i| {
                let mut driver = Observer::new(ego, setting);
                rollout_counted(&stages[i].0.plant, &stages[i].1, &mut driver).map(|(_, cost)| cost)
            })?;
            seconds.push(round.seconds);
        }
        let seconds = num::quantile(&seconds, 0.5).unwrap_or(f64::NAN);
        Ok(Cost { setting, seconds, plain_seconds, steps, threads: threads.count() })
    };
    Setting::ALL.into_iter().map(cost).collect()
}

/// All rollouts once.
struct Round {
    steps: u64,
    agent_steps: u64,
    seconds: f64,
}

impl Round {
    fn of(
        threads: &Threads,
        count: usize,
        rollout: impl Fn(usize) -> Result<RolloutCost, SimError> + Sync,
    ) -> Result<Round, Failure> {
        let places: Vec<usize> = (0..count).collect();
        let (costs, took) = timed(|| threads.map(&places, |_, i| rollout(*i)));
        let costs: Vec<RolloutCost> = costs.into_iter().collect::<Result<_, _>>().map_err(Failure::internal)?;
        Ok(Round {
            steps: costs.iter().map(|cost| cost.steps).sum(),
            agent_steps: costs.iter().map(|cost| cost.agent_steps).sum(),
            seconds: took.as_secs_f64(),
        })
    }

    fn agent_steps_per_s(&self) -> f64 {
        self.agent_steps as f64 / self.seconds.max(f64::MIN_POSITIVE)
    }
}

/// Time that rollouts spend in each of their parts: a separate pass on one thread reads a clock at the border of every
/// part, so that the headline figure pays for no clock.
struct Split {
    /// Seconds of each part, in the order of [`Part::ALL`], summed over all rollouts and rounds.
    seconds: [f64; Part::ALL.len()],
    rollouts: usize,
}

impl Split {
    #[allow(clippy::disallowed_methods)]
    fn of(stages: &[(Situation, Intervention)], ego: &Policy, rounds: usize) -> Result<Split, SimError> {
        let mut split = Split { seconds: [0.0; Part::ALL.len()], rollouts: stages.len() * rounds };
        for (situation, intervention) in (0..rounds).flat_map(|_| stages) {
            let mut since = (Part::Setup, std::time::Instant::now());
            let mut switch = |part: Part| {
                let now = std::time::Instant::now();
                split.seconds[since.0 as usize] += (now - since.1).as_secs_f64();
                since = (part, now);
            };
            rollout_in_parts(&situation.plant, intervention, ego.driver().as_mut(), &mut switch)?;
            switch(Part::Setup);
        }
        Ok(split)
    }

    fn us_per_rollout(&self, part: Part) -> f64 {
        1e6 * self.seconds[part as usize] / self.rollouts.max(1) as f64
    }

    fn share(&self, part: Part) -> f64 {
        self.seconds[part as usize] / self.seconds.iter().sum::<f64>().max(f64::MIN_POSITIVE)
    }

    fn text(&self) -> String {
        let part = |&part: &Part| format!("{} {:.0} %", part.name(), 100.0 * self.share(part));
        let parts: Vec<String> = Part::ALL.iter().map(part).collect();
        let all: f64 = Part::ALL.iter().map(|&part| self.us_per_rollout(part)).sum();
        format!(
            "share of a rollout's time (one thread, timed between the parts, {all:.0} us per rollout): {}\n",
            parts.join(", ")
        )
    }

    fn object(&self) -> serde_json::Value {
        let of = |part: Part| {
            (part.name().to_string(), json!({"us_per_rollout": self.us_per_rollout(part), "share": self.share(part)}))
        };
        serde_json::Value::Object(Part::ALL.into_iter().map(of).collect())
    }
}

/// A scene, CAT's intervention and, where it is asked for, the same under a law.
type Ready = (Situation, Intervention, Option<Intervention>);

/// Scenes made ready; those that the ego cannot drive are left out.
fn stages(scenes: &[Arc<Scene>], ego: &Policy, law: bool, threads: &Threads) -> Vec<Option<Ready>> {
    let sources = families::sources();
    threads.map(scenes, |_, scene| {
        let situation = Situation::new(scene.clone(), ego).ok()?;
        let family = sources.get(&FamilyName::new("cat"))?;
        let compiled = |program: &Program| {
            let intervention = Prepared::new(program, family).ok()?.compile(&situation, Seed(0)).ok()?.intervention;
            Some(intervention)
        };
        let plain = compiled(&family.parent)?;
        let lawful = if law { Some(compiled(&under_law(&family.parent))?) } else { None };
        Some((situation, plain, lawful))
    })
}

/// The program with a law that keeps to the candidate and yet looks at everything that costs time to look at.
fn under_law(program: &Program) -> Program {
    let brakes = "if(seen_ttc_s < 0.3 and others_ahead_gap_m < 3, -4, planned_acceleration_mps2)";
    let moves = "if(road_left_m > 1 and seen_gap_m < 10, 0.2, 0)";
    grammar::with_law(program, [("acceleration", brakes), ("offset", moves)])
}
