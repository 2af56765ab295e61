//! The short result of a run, and its progress, as text.

use std::fmt::Write as _;

use crate::cli::records::folder::RunFolder;
use crate::cli::terminal::typed::why_command as why;
use crate::epoch::Progress;
use crate::evaluation::{AttackOptions, EvaluationOptions, MetadriveOptions};
use crate::evidence::OWN_PLANNER;
use crate::evidence::aligned::Aligned;
use crate::evidence::choice::Choice;
use crate::evidence::lineage_text::shortened;
use crate::evidence::realism::{LineageRealisms, Realisms, realism_text};
use crate::evidence::tables::LineagePreventable;
use crate::experiment::Experiment;
use crate::kernel::{Digest, num};
use crate::objects::event::{LineageResult, Measured, RunResult};
use crate::objects::replay::{ReplayRow, Suite};
use crate::objects::{JudgedOn, LabelRules, RealismMean};
use crate::text::counted;

/// Characters of a gate's problem that a line of progress has room for.
const PROBLEM_MAX: usize = 120;

/// One line of progress.
pub fn progress(news: &Progress) -> String {
    match news {
        Progress::Attempt { id, exit, attack, realism, coverage, accepted, refused } => {
            match (attack, realism, refused) {
                (Some(attack), Some((name, realism)), _) => {
                    let mark = if *accepted { "  accepted" } else { "" };
                    let (attack, realism) = (num::fixed(*attack, 3), realism_text(*realism, *coverage));
                    format!("  {id:<18} {exit:<9} attack {attack}  {name} {realism}{mark}")
                }
                (_, _, Some((gate, problem))) => {
                    format!("  {id:<18} {exit:<9} gate {gate}: {}", shortened(problem, PROBLEM_MAX))
                }
                _ => format!("  {id:<18} {exit}"),
            }
        }
        Progress::Settled { epoch, lineage, active, front, hypervolume } => {
            format!("{lineage}/e{epoch} settled: front of {front}, hypervolume {hypervolume:.5}, active {active}")
        }
        Progress::Composed { template, used: true } => format!("composed {template} from its description"),
        Progress::Composed { template, used: false } => {
            format!("no usable answer for {template}: its published template is kept")
        }
        Progress::Counselled { lineage, scenes, met } => {
            format!(
                "counsel for {} of {lineage}: {} led to contact with the ego when tried",
                counted(*scenes, "scene"),
                counted(*met, "advised set")
            )
        }
        Progress::Evolved { turn, verdict } => format!("{turn} change of the world evaluator {verdict}"),
        Progress::Choosing { done, all } => format!("choice of programs: {done} of {}", counted(*all, "label")),
        Progress::Opening { done, all } => format!("held-out scenes: {done} of {}", counted(*all, "label")),
        Progress::HeldOut { lineage, programs, scenes } => {
            let (programs, scenes) = (counted(*programs, "program"), counted(*scenes, "scene"));
            format!("held-out suite opened for {lineage}: {programs} on {scenes}")
        }
    }
}

/// Most lineages whose fronts a summary prints.
const FRONTS_MAX: usize = 12;

/// Inputs of a summary, beside the experiment.
#[derive(Clone, Copy)]
pub struct Summary<'a> {
    pub result: &'a RunResult,
    /// Text that says who answered which roles.
    pub from: &'a str,
    pub choices: &'a [Choice],
    /// Of the lineages whose held-out labels are recorded.
    pub realisms: &'a [LineageRealisms],
    /// The other count, of the same lineages.
    pub preventable: &'a [LineagePreventable],
    /// A sentence for every lineage with scenes that have no label.
    pub unlabelled: &'a [String],
}

/// Parent against evolved, the front, why each program was chosen, the four exits, where things are; the last line is the root.
/// Tables keep to the width; sentences are one line each.
pub fn summary(
    experiment: &Experiment,
    folder: &RunFolder,
    Summary { result, from, choices, realisms, preventable, unlabelled }: Summary<'_>,
    root: Digest,
    width: usize,
) -> String {
    let mut out = format!("{}: {}\n", experiment.name, experiment.describes);
    let held_out = result.lineages.first().map_or(0, |l| l.held_out_scenes);
    let _ = writeln!(out, "proposals from: {from}; {}\n", counted(held_out, "held-out scene"));
    if let Some(note) = &experiment.seed_note {
        let _ = writeln!(out, "note: {note}\n");
    }
    for lineage in &experiment.lineages {
        for origin in lineage.parent_program.iter().filter_map(|program| program.origins.last()) {
            let _ = writeln!(out, "{} starts from {origin}\n", lineage.id);
        }
    }
    if let EvaluationOptions::Metadrive(MetadriveOptions { attack: AttackOptions { when: Some(when), .. }, .. }) =
        &experiment.evaluation
    {
        let _ = writeln!(out, "attack is the experiment's own: {}\n", when.text());
    }
    let strict = experiment.evaluation.realism_name();
    // An event knows the ego's kind alone.
    let planner = experiment.driver.as_ref().map(|driver| driver.name());
    let ego = |ego: &str| planner.clone().filter(|_| ego == OWN_PLANNER).unwrap_or(ego.to_string());
    let rules = experiment.evaluation.rules();
    let of_suite = result.replay.iter().filter(|replay| replay.suite == Suite::HeldOut);
    let replayed = of_suite.map(|replay| replay_row(replay, &ego(&replay.ego), &rules));
    let of = |lineage: &LineageResult| realisms.iter().find(|of| of.lineage == lineage.lineage.as_str());
    let other = |lineage: &LineageResult| preventable.iter().find(|of| of.lineage == lineage.lineage.as_str());
    let evolved = result.lineages.iter().flat_map(|lineage| rows(lineage, of(lineage), other(lineage)));
    let mut rows: Vec<Vec<String>> = replayed.chain(evolved).map(Vec::from).collect();
    let heads = ["lineage", "program", "attack", PREVENTABLE, "any crash", "realism", strict, FAILS, "coverage"];
    let mut heads = heads.map(String::from).to_vec();
    let safebench = experiment.evaluation.safebench().is_some();
    // Neither is a number of SafeBench's protocol. The last one first.
    for place in [FAILS_AT, PREVENTABLE_AT].into_iter().filter(|_| safebench) {
        heads.remove(place);
        rows.iter_mut().for_each(|row| drop(row.remove(place)));
    }
    out.push_str(&Aligned { indent: 0, labels: 2, words: 0, heads, rows }.text(width));
    out.push_str(&at_fault_words(preventable));
    if let Some(words) = result.replay.iter().find(|replay| replay.suite == Suite::HeldOut).map(replay_words) {
        let _ = writeln!(out, "\n{words}");
    }
    let _ = writeln!(out, "\n{}", column_words(safebench, experiment.evaluation.realism_mean()));
    if !result.lineages.is_empty() {
        let _ = writeln!(out, "\n{}", area_words(&result.lineages));
        if experiment.evaluation.safebench().is_some() {
            let _ = writeln!(out, "{REDRAWN}");
        }
    }
    for sentence in unlabelled {
        let _ = writeln!(out, "\n{sentence}");
    }
    let fronts = if result.lineages.len() <= FRONTS_MAX { &result.lineages[..] } else { &[] };
    if fronts.is_empty() {
        let _ = writeln!(
            out,
            "\nfronts of {}, and why each program was chosen: in the report and in `evodrive lineage`",
            counted(result.lineages.len(), "lineage")
        );
    }
    for lineage in fronts {
        let on = match experiment.archive.judged_on {
            JudgedOn::WindowThenAll => "all windows",
            JudgedOn::Window => "the last window",
        };
        let _ = writeln!(out, "\nfront of {} (attack / {strict} on the scenes of {on}):", lineage.lineage);
        let played = result.replay.iter().find(|r| r.suite == Suite::Evolution && r.ego == lineage.ego);
        if let Some(replay) = played {
            let (attack, crash) = (num::fixed(replay.attack(&rules), 3), num::fixed(100.0 * replay.contact_rate, 1));
            let _ =
                writeln!(out, "  {attack} / none    replay (no program): acts nowhere, the ego crashes in {crash} %");
        }
        for point in &lineage.front {
            let o = point.objectives;
            let (attack, realism) = (num::fixed(o.attack, 3), num::fixed(o.realism, 4));
            let _ = writeln!(out, "  {attack} / {realism}  {}", point.solution);
        }
        for choice in choices.iter().filter(|choice| choice.lineage == lineage.lineage) {
            let _ = write!(out, "{}", choice.text(width));
        }
    }
    let e = result.exits;
    let _ = writeln!(
        out,
        "\nattempts: {} declined, {} invalid, {} rejected, {} evaluated; {}",
        e.declined,
        e.invalid,
        e.rejected,
        e.evaluated,
        counted(result.rollouts, "rollout")
    );
    let _ = writeln!(out, "run folder: {}", folder.dir.display());
    if folder.report().exists() {
        let _ = writeln!(out, "report: {}", folder.report().display());
    }
    if let Some(command) = why_command(experiment, folder, &result.lineages) {
        let _ = writeln!(out, "why a number: {command}");
    }
    let _ = writeln!(out, "root: {root}");
    out
}

/// A line of the table of lineages: lineage, program, and the numbers.
type Row = [String; 9];

/// The head of the count that asks what the ego could have prevented, and its place.
const PREVENTABLE: &str = "preventable";
const PREVENTABLE_AT: usize = 3;
/// The head of the share of scenes acted in where some diagnostic fails outright, and its place.
const FAILS: &str = "fails";
const FAILS_AT: usize = 7;

/// The recorded scenes without a program.
fn replay_row(replay: &ReplayRow, ego: &str, rules: &LabelRules) -> Row {
    [
        format!("replay, {ego}"),
        "-".to_string(),
        num::fixed(replay.attack(rules), 3),
        "0.000".to_string(),
        num::fixed(replay.contact_rate, 3),
        four_digits(replay.realism),
        "-".to_string(),
        "-".to_string(),
        "0.00".to_string(),
    ]
}

fn replay_words(replay: &ReplayRow) -> String {
    let judged = match (replay.realism, &replay.benchmark) {
        (Some(_), _) => "its realism is that of the recorded traffic itself".to_string(),
        (None, Some(row)) => {
            let (crashes, score) = (num::fixed(row.collision_rate, 3), num::fixed(row.overall_score, 3));
            format!("an empty program has CR {crashes} and OS {score}")
        }
        (None, None) => "no vehicle moves in them".to_string(),
    };
    format!(
        "replay: the recorded scenes without a program; its crashes are those of the ego in recorded traffic, {judged}."
    )
}

/// The shares of scenes with a contact for which the ego is at fault; nothing where no outcome says it.
fn at_fault_words(all: &[LineagePreventable]) -> String {
    let of = |of: &LineagePreventable| {
        let [parent, evolved] = of.at_fault?.map(|share| num::fixed(share, 3));
        Some(format!("{} {parent} -> {evolved}", of.lineage))
    };
    let each: Vec<String> = all.iter().filter_map(of).collect();
    if each.is_empty() {
        String::new()
    } else {
        format!("\nat fault by nuPlan's rule, share of scenes: {}\n", each.join(", "))
    }
}

/// Explains the columns whose heads do not say what they mean.
fn column_words(safebench: bool, mean: RealismMean) -> String {
    let preventable = if safebench {
        ""
    } else {
        "preventable: share of scenes with a contact that the program brings about and that a careful ego could have prevented by braking or \
             swerving; a ram from behind is none, whatever counts as attack; "
    };
    let fails = if safebench { "" } else { "fails: share of those scenes where some diagnostic is below .5; " };
    let strict = match (safebench, mean) {
        (true, _) => "ARS: SafeBench's adversarial realism score, which the search uses",
        (false, RealismMean::Plain) => {
            "plain realism: the mean over all scenes, 1 where it does not act, which the search uses"
        }
        (false, RealismMean::Strict) => {
            "strict realism: the smaller one of that and the mean over its successes, which the search uses"
        }
        (false, RealismMean::Sound) => {
            "sound realism: the smallest one of that, the mean over its successes and the shares of those scenes and of its successes where \
             nothing fails, which the search uses"
        }
    };
    format!(
        "{preventable}realism: mean over the scenes that a program acts in; {strict}; {fails}coverage: share of the scenes that it acts in; \
         ->: the program that was chosen, which the run reports."
    )
}

/// SafeBench's frontier gain is over the parent's one draw of each scene.
const REDRAWN: &str = "A parent that is drawn as often gains frontier area, too; `evodrive table safebench-main` sets both beside each other.";

/// PF-Area@3 in a sentence of its own: in the row of a program it would be read as that program's.
fn area_words(lineages: &[LineageResult]) -> String {
    let of = |lineage: &LineageResult| format!("{} {} %", lineage.lineage, num::signed(lineage.pf_area_at_3_pct, 1));
    format!(
        "PF-Area@3 of each lineage, which is no number of the program that was chosen: the area that its first three finalists by the \
         reporting rule add to the parent's under the Pareto front; it compares only runs with the same `budget.finalists`: {}.",
        lineages.iter().map(of).collect::<Vec<_>>().join(", ")
    )
}

/// A command that leads from a number above to what it rests on: the attack of the program that moved it most against its parent.
fn why_command(experiment: &Experiment, folder: &RunFolder, lineages: &[LineageResult]) -> Option<String> {
    let moved = |of: &LineageResult| (of.evolved.objectives.attack - of.parent.objectives.attack).abs();
    // Of equals the first.
    let most = lineages.iter().reduce(|most, of| if moved(of) > moved(most) { of } else { most })?;
    let lineage = &most.lineage;
    let table = if experiment.evaluation.safebench().is_some() { "safebench-main" } else { "metadrive-policy" };
    Some(why(&format!("{table}:{lineage}:evolved_attack"), &folder.dir))
}

fn four_digits(rate: Option<f64>) -> String {
    rate.map_or("-".to_string(), |rate| num::fixed(rate, 4))
}

/// The lineage's parent, and under it the program that was chosen.
fn rows(
    lineage: &LineageResult,
    realisms: Option<&LineageRealisms>,
    preventable: Option<&LineagePreventable>,
) -> [Row; 2] {
    let [own_parent, own_evolved] =
        [|of: &LineageRealisms| of.parent.realisms, |of: &LineageRealisms| of.evolved.realisms]
            .map(|read| realisms.map(read));
    let share = |of: Option<f64>| of.map_or("-".to_string(), |share| num::fixed(share, 3));
    let row = |name: &str, program: String, (of, own, preventable): (&Measured, Option<Realisms>, Option<f64>)| {
        [
            name.to_string(),
            program,
            num::fixed(of.objectives.attack, 3),
            share(preventable),
            num::fixed(of.any_contact, 3),
            four_digits(own.and_then(|own| own.realism_acted)),
            realism_text(of.objectives.realism, of.coverage),
            share(own.and_then(|own| own.failing_share)),
            num::fixed(of.coverage, 2),
        ]
    };
    let chosen = lineage.evolved.solution.as_str().rsplit('/').next().unwrap_or_default();
    [
        row(lineage.lineage.as_str(), "parent".into(), (&lineage.parent, own_parent, preventable.map(|of| of.parent))),
        row("", format!("-> {chosen}"), (&lineage.evolved, own_evolved, preventable.map(|of| of.evolved))),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn attempt(refused: Option<(&'static str, String)>, realism: Option<f64>, coverage: f64) -> String {
        let realism = realism.map(|realism| ("strict realism", realism));
        let (exit, attack) = if refused.is_some() { ("invalid", None) } else { ("evaluated", Some(0.0375)) };
        progress(&Progress::Attempt {
            id: "cat-idm/e0s0".into(),
            exit,
            attack,
            realism,
            coverage,
            accepted: false,
            refused,
        })
    }

    #[test]
    fn a_line_of_progress_names_the_gate_that_refused() {
        let problem = "/parameters/speed is 9, expected 0 to 1".to_string();
        let line = attempt(Some(("interface", problem)), None, 0.0);
        assert_eq!(line.trim(), "cat-idm/e0s0       invalid   gate interface: /parameters/speed is 9, expected 0 to 1");
        let long = attempt(Some(("schema", "word ".repeat(60))), None, 0.0);
        assert!(long.ends_with('…') && long.chars().count() < 170, "{long}");
    }

    #[test]
    fn a_line_of_progress_has_no_realism_of_who_acts_nowhere() {
        assert!(attempt(None, Some(0.0), 0.0).ends_with("attack 0.038  strict realism -"));
        assert!(attempt(None, Some(0.9), 0.5).ends_with("attack 0.038  strict realism 0.9000"));
    }
}
