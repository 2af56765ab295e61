//! Announces the cost of a run before it begins, if the run will take long.

use std::io::IsTerminal;

use crate::cli::terminal::answer::progress;
use crate::cli::terminal::exit::Failure;
use crate::experiment::Experiment;
use crate::kernel::Threads;
use crate::scene::EvolutionSize;
use crate::text::counted;

/// Seconds of one thread that a rollout takes with the compiling before it: of the README's run, 12 000 in a minute of one core.
const ROLLOUT_S: f64 = 0.006;
/// A learned ego takes this many times as long, because a network drives.
const LEARNED: f64 = 5.0;
/// Runs that take longer than this many seconds are announced.
const LONG_S: f64 = 600.0;

/// Says how much there is to simulate, and on a terminal waits for Enter. Models take time of their own, which nobody knows before.
///
/// # Errors
/// A terminal that cannot be read.
pub fn announce(experiment: &Experiment, scenes: usize, threads: &Threads) -> Result<(), Failure> {
    let Some(line) = cost(experiment, scenes, threads.count()) else { return Ok(()) };
    progress(line);
    if std::io::stdin().is_terminal() && std::io::stderr().is_terminal() {
        progress("Enter begins, Ctrl-C ends");
        std::io::stdin().read_line(&mut String::new()).map_err(Failure::bad_input)?;
    }
    Ok(())
}

/// The line of an experiment that takes long. Its rollouts are the most that its budget allows where no child is looked at twice.
fn cost(experiment: &Experiment, scenes: usize, threads: usize) -> Option<String> {
    let (budget, split) = (&experiment.budget, &experiment.split);
    let evolution = match split.evolution {
        EvolutionSize::Count(count) => count,
        EvolutionSize::Share(share) => (scenes.saturating_sub(split.held_out) as f64 * share) as usize,
    };
    let (epochs, slots) = (budget.epochs as usize, budget.slots as usize);
    let each = epochs * (slots + 1) * split.window + budget.finalists * (evolution + split.held_out);
    let of_ego = |ego: &str| if ego == "learned" { LEARNED } else { 1.0 };
    let weight: f64 = experiment.lineages.iter().map(|lineage| of_ego(&lineage.ego)).sum();
    let searches = experiment.lineages.len() * experiment.seeds as usize;
    let seconds = each as f64 * weight * f64::from(experiment.seeds) * ROLLOUT_S / threads.max(1) as f64;
    (seconds > LONG_S).then(|| {
        let lasting = match seconds {
            s if s < 5400.0 => format!("{:.0} min", s / 60.0),
            s => format!("{:.0} h", s / 3600.0),
        };
        format!(
            "{}: {} in {}, up to {}: about {lasting} on {}. Tables of the shipped sets stand in golden/ without any run; \
             `evodrive paper --short` makes some in seconds, `--set seeds=1` a part of this one",
            experiment.name,
            counted(searches * epochs * slots, "proposal"),
            counted(searches, "search"),
            counted(searches * each, "rollout"),
            counted(threads, "thread")
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    fn of(file: &str, threads: usize) -> Option<String> {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("experiments").join(file);
        let experiment = Experiment::read(&path).unwrap();
        cost(&experiment, 680, threads)
    }

    #[test]
    fn what_takes_long_is_told_with_its_size_and_what_is_short_is_not() {
        assert_eq!([of("quickstart.toml", 1), of("finding.toml", 1)], [None, None]);
        let long = of("readings/published-idm.toml", 2).unwrap();
        // 10 lineages of 10 seeds; 10 epochs of 20 proposals and their parent on 20 scenes, 6 finalists on 240 and 400.
        let said = "metadrive-published-idm: 20000 proposals in 100 searches, up to 804000 rollouts: about 40 min on 2 threads.";
        assert!(long.starts_with(said), "{long}");
        assert!(of("readings/published-idm.toml", 64).is_none(), "enough threads make it short");
        let learned = of("readings/published-sac.toml", 2).unwrap();
        assert!(learned.contains(" h on 2 threads"), "{learned}");
    }
}
