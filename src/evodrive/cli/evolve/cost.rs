//! Cost of carrying out a run: the clock, the table on stderr, and `cost.json` in the run folder.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::time::Duration;

use crate::cli::records::folder::RunFolder;
use crate::cli::terminal::{answer::progress, exit::Failure};
use crate::epoch::{RolloutCounts, Study, Tools};
use crate::evidence::aligned::Aligned;
use crate::objects::{
    FamilyName, LineageId,
    cost::{FORMAT, LineageCost, RunCost, Work},
    world_audit::WORLD_LINE,
};
use crate::store;
use crate::text::counted;

/// Bytes that `cost.json` may have.
const FILE_BYTES_MAX: u64 = 1 << 24;

/// Time since now.
#[allow(clippy::disallowed_methods)]
pub fn clock() -> impl Fn() -> Duration + Sync {
    let start = std::time::Instant::now();
    move || start.elapsed()
}

/// Returns the cost that the meter found, with the study's lineages in order.
pub fn of(study: &Study, tools: &Tools<'_>) -> RunCost {
    let spent: BTreeMap<LineageId, Work> = tools.meter.lineages();
    let RolloutCounts { reused, simulated } = tools.rollouts.counts();
    let cost = |spec: &crate::epoch::LineageSpec| LineageCost {
        lineage: spec.id.clone(),
        family: spec.family.clone(),
        ego: spec.ego_label(),
        work: spent.get(&spec.id).copied().unwrap_or_default(),
    };
    // Turns of the world evaluator are no lineage's.
    let world = spent.get(&LineageId::new(WORLD_LINE)).map(|work| LineageCost {
        lineage: LineageId::new(WORLD_LINE),
        family: FamilyName::new("-"),
        ego: "-".into(),
        work: *work,
    });
    let lineages = study.lineages.iter().map(cost).chain(world).collect();
    RunCost { format: FORMAT.into(), threads: tools.threads.count(), simulated, reused, lineages }
}

/// Keeps the cost in the folder. A run that found every rollout in the store leaves the file of the run that made them.
pub fn keep(folder: &RunFolder, cost: &RunCost) -> Result<(), Failure> {
    if cost.simulated == 0 {
        match read(folder) {
            Ok(None) => {}
            Ok(Some(_)) => return Ok(()),
            Err(why) => {
                progress(format!("{why}; it is written anew, without what the rollouts cost that were recorded before"))
            }
        }
    }
    let text = serde_json::to_vec_pretty(cost).map_err(Failure::internal)?;
    Ok(store::write_atomic(&folder.cost(), &text)?)
}

/// The cost that the folder keeps, if it does. Nothing rests on it: where it cannot be read that is said, and it is done without.
pub fn kept(folder: &RunFolder) -> Option<RunCost> {
    read(folder).unwrap_or_else(|why| {
        progress(format!(
            "{why}; it is done without what the run cost: remove the file, and `evodrive run` writes it again"
        ));
        None
    })
}

fn read(folder: &RunFolder) -> Result<Option<RunCost>, String> {
    let path = folder.cost();
    if !path.exists() {
        return Ok(None);
    }
    let bytes = store::read_bounded(&path, FILE_BYTES_MAX).map_err(|error| error.to_string())?;
    let cost = serde_json::from_slice(&bytes);
    cost.map(Some).map_err(|error| format!("{}: expected what a run cost, found {error}", path.display()))
}

/// A line a lineage, the dearest first, and their sum. Tokens have a column where some were counted.
pub fn table(cost: &RunCost, width: usize) -> String {
    let mut dearest: Vec<&LineageCost> = cost.lineages.iter().collect();
    dearest.sort_by(|a, b| b.work.wall_s.total_cmp(&a.work.wall_s));
    let mut rows: Vec<Vec<String>> =
        dearest.iter().map(|of| row(of.lineage.as_str(), &of.work, cost.wall_s())).collect();
    if cost.lineages.len() > 1 {
        rows.push(row("all", &sum(cost), cost.wall_s()));
    }
    let mut heads = HEADS.map(String::from).to_vec();
    if sum(cost).input_tokens == 0 && sum(cost).output_tokens == 0 {
        heads.pop();
        rows.iter_mut().for_each(|row| row.truncate(heads.len()));
    }
    let table = Aligned { indent: 2, labels: 1, words: 0, heads, rows }.text(width);
    let mut out = format!(
        "cost: {} simulated, {} read from the store, {:.1} s on {}; times of compiling, rollouts and models are \
         summed over threads\n{}",
        counted(cost.simulated, "rollout"),
        cost.reused,
        cost.wall_s(),
        counted(cost.threads, "thread"),
        table.trim_end()
    );
    let all = sum(cost);
    if all.cached_input_tokens > 0 {
        let _ = write!(out, "\n  {} of the questions' tokens came from providers' caches", all.cached_input_tokens);
    }
    if all.cut_prompts > 0 {
        let _ = write!(
            out,
            "\n  cut by their server: {} of {}: give it a larger context and record again with --fresh",
            all.cut_prompts,
            counted(all.answers, "question")
        );
    }
    out
}

const HEADS: [&str; 10] =
    ["lineage", "wall s", "share", "rollouts", "roll. s", "compiled", "comp. s", "answers", "model s", "tokens"];

fn row(name: &str, work: &Work, wall_s: f64) -> Vec<String> {
    let share = if wall_s > 0.0 { 100.0 * work.wall_s / wall_s } else { 0.0 };
    let tokens = match work.input_tokens.saturating_add(work.output_tokens) {
        0 => "-".to_string(),
        _ => format!("{}+{}", work.input_tokens, work.output_tokens),
    };
    let seconds = |of: f64| format!("{of:.1}");
    let (compiled, rollouts, answers) = (work.compiled, work.rollouts, work.answers);
    vec![
        name.to_string(),
        seconds(work.wall_s),
        format!("{share:.0}%"),
        rollouts.to_string(),
        seconds(work.rollout_s),
        compiled.to_string(),
        seconds(work.compile_s),
        answers.to_string(),
        seconds(work.model_s),
        tokens,
    ]
}

fn sum(cost: &RunCost) -> Work {
    let mut all = Work::default();
    for work in cost.lineages.iter().map(|lineage| lineage.work) {
        let Work { wall_s, compiled, compile_s, rollouts, rollout_s, answers, model_s, .. } = work;
        let Work { input_tokens, output_tokens, cached_input_tokens, cut_prompts, .. } = work;
        all.wall_s += wall_s;
        all.compiled += compiled;
        all.compile_s += compile_s;
        all.rollouts += rollouts;
        all.rollout_s += rollout_s;
        all.answers += answers;
        all.model_s += model_s;
        all.input_tokens = all.input_tokens.saturating_add(input_tokens);
        all.output_tokens = all.output_tokens.saturating_add(output_tokens);
        all.cached_input_tokens = all.cached_input_tokens.saturating_add(cached_input_tokens);
        all.cut_prompts += cut_prompts;
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::evolve::first_epoch::carried_out;
    use crate::epoch::Clock;
    use crate::kernel::Digest;
    use crate::objects::FamilyName;
    use std::sync::atomic::{AtomicU64, Ordering};

    fn lineage(name: &str, work: Work) -> LineageCost {
        LineageCost { lineage: LineageId::new(name), family: FamilyName::new("cat"), ego: "idm".into(), work }
    }

    #[test]
    fn the_dearest_lineage_stands_first_and_shares_add_up() {
        let of = |wall_s, rollouts| Work { wall_s, rollouts, ..Work::default() };
        let lineages = vec![lineage("cat-idm", of(1.0, 40)), lineage("king-idm", of(3.0, 60))];
        let cost = RunCost { format: FORMAT.into(), threads: 2, simulated: 100, reused: 7, lineages };
        let text = table(&cost, 100);
        let lines: Vec<Vec<&str>> =
            text.lines().skip(2).map(|line| line.split_whitespace().take(4).collect()).collect();
        assert_eq!(
            lines,
            [["king-idm", "3.0", "75%", "60"], ["cat-idm", "1.0", "25%", "40"], ["all", "4.0", "100%", "100"]]
        );
        assert!(text.starts_with("cost: 100 rollouts simulated, 7 read from the store, 4.0 s on 2 threads"), "{text}");
    }

    #[test]
    fn questions_that_were_cut_are_told_below_the_table() {
        let lineages = vec![lineage("cat-idm", Work { answers: 9, cut_prompts: 4, ..Work::default() })];
        let mut cost = RunCost { format: FORMAT.into(), threads: 2, simulated: 0, reused: 0, lineages };
        assert!(table(&cost, 80).contains("cut by their server: 4 of 9 questions"), "{}", table(&cost, 80));
        cost.lineages[0].work.cut_prompts = 0;
        assert!(!table(&cost, 80).contains("cut by"));
    }

    #[test]
    fn a_run_that_read_every_rollout_leaves_the_cost_of_the_run_that_made_them() {
        let dir = tempfile::tempdir().unwrap();
        let folder = RunFolder { dir: dir.path().to_path_buf() };
        let cost = |simulated| RunCost { format: FORMAT.into(), threads: 1, simulated, reused: 0, lineages: vec![] };
        assert_eq!(kept(&folder), None);
        keep(&folder, &cost(9)).unwrap();
        keep(&folder, &cost(0)).unwrap();
        assert_eq!(kept(&folder), Some(cost(9)));
        keep(&folder, &cost(3)).unwrap();
        assert_eq!(kept(&folder), Some(cost(3)));
        // One that cannot be read is done without, and written anew.
        std::fs::write(folder.cost(), b"").unwrap();
        assert_eq!(kept(&folder), None);
        keep(&folder, &cost(0)).unwrap();
        assert_eq!(kept(&folder), Some(cost(0)));
    }

    fn run(clock: Option<Clock<'_>>) -> (Digest, RunCost) {
        carried_out(clock, |study, _, desk| (desk.log.head(), of(study, &desk.tools)))
    }

    #[test]
    fn no_root_depends_on_the_clock() {
        let ticks = AtomicU64::new(0);
        let restless = || Duration::from_secs((ticks.fetch_add(1, Ordering::Relaxed) * 7919) % 1000);
        let (untimed, timed) = (run(None), run(Some(&restless)));
        assert_eq!(untimed.0, timed.0);
        assert!(untimed.1.wall_s() == 0.0 && timed.1.wall_s() > 0.0);
        let counts = |cost: &RunCost| -> Vec<(usize, usize, usize)> {
            cost.lineages.iter().map(|l| (l.work.compiled, l.work.rollouts, l.work.answers)).collect()
        };
        assert_eq!(counts(&untimed.1), counts(&timed.1));
        let rollouts: usize = timed.1.lineages.iter().map(|lineage| lineage.work.rollouts).sum();
        assert!(rollouts == timed.1.simulated && rollouts > 0, "every simulated rollout is some lineage's");
    }
}
