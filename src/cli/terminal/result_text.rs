//! The short result of a run, and its progress, as text.

use std::fmt::Write as _;

use crate::cli::records::folder::RunFolder;
use crate::epoch::Progress;
use crate::evaluation::{AttackOptions, EvaluationOptions, MetadriveOptions};
use crate::evidence::aligned::Aligned;
use crate::evidence::choice::Choice;
use crate::evidence::realism::LineageRealisms;
use crate::experiment::{Experiment, provenance};
use crate::kernel::Digest;
use crate::objects::event::{LineageResult, Measured, RunResult};
use crate::objects::realism_name;
use crate::objects::replay::{ReplayRow, Suite};

/// One line of progress.
pub fn progress(news: &Progress) -> String {
    match news {
        Progress::Attempt { id, exit, attack, realism, accepted } => match (attack, realism) {
            (Some(attack), Some((name, realism))) => {
                let mark = if *accepted { "  accepted" } else { "" };
                format!("  {id:<18} {exit:<9} attack {attack:.3}  {name} {realism:.4}{mark}")
            }
            _ => format!("  {id:<18} {exit}"),
        },
        Progress::Settled { epoch, lineage, active, front, hypervolume } => {
            format!("{lineage}/e{epoch} settled: front of {front}, hypervolume {hypervolume:.5}, active {active}")
        }
        Progress::Composed { template, used: true } => format!("composed {template} from its description"),
        Progress::Composed { template, used: false } => {
            format!("no usable answer for {template}: its published template is kept")
        }
        Progress::Counselled { lineage, scenes, met } => {
            format!(
                "counsel for {scenes} scenes of {lineage}: {met} advised sets led to contact with the ego when tried"
            )
        }
        Progress::Evolved { turn, verdict } => format!("{turn} change of the world evaluator {verdict}"),
        Progress::HeldOut { lineage, programs, scenes } => {
            format!("held-out suite opened for {lineage}: {programs} programs on {scenes} scenes")
        }
    }
}

/// Most lineages whose fronts a summary prints.
const FRONTS_MAX: usize = 12;

/// What a summary is made from, beside the experiment.
#[derive(Clone, Copy)]
pub struct Summary<'a> {
    pub result: &'a RunResult,
    pub choices: &'a [Choice],
    /// Of the lineages whose held-out labels are recorded.
    pub realisms: &'a [LineageRealisms],
    /// A sentence for every lineage with scenes that have no label.
    pub unlabelled: &'a [String],
}

/// Parent against evolved, the front, why each program was chosen, the four exits, where things are; the last line is the root.
/// Tables keep to the width; sentences are one line each.
pub fn summary(
    experiment: &Experiment,
    folder: &RunFolder,
    Summary { result, choices, realisms, unlabelled }: Summary<'_>,
    root: Digest,
    width: usize,
) -> String {
    let mut out = format!("{}: {}\n", experiment.name, experiment.describes);
    let held_out = result.lineages.first().map_or(0, |l| l.held_out_scenes);
    let _ = writeln!(out, "proposals from: {}; {held_out} held-out scenes\n", provenance(experiment));
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
    let strict = realism_name(experiment.evaluation.safebench().is_some());
    let replayed = result.replay.iter().filter(|replay| replay.suite == Suite::HeldOut).map(replay_row);
    let of = |lineage: &LineageResult| realisms.iter().find(|of| of.lineage == lineage.lineage.as_str());
    let evolved = result.lineages.iter().flat_map(|lineage| rows(lineage, of(lineage)));
    let rows = replayed.chain(evolved).map(Vec::from).collect();
    let heads = ["lineage", "program", "attack", "any crash", "realism", strict, "coverage", "PF-Area@3 %"];
    let heads = heads.map(String::from).to_vec();
    out.push_str(&Aligned { indent: 0, labels: 2, words: 0, heads, rows }.text(width));
    if let Some(words) = result.replay.iter().find(|replay| replay.suite == Suite::HeldOut).map(replay_words) {
        let _ = writeln!(out, "\n{words}");
    }
    let _ = writeln!(out, "\n{}", column_words(experiment.evaluation.safebench().is_some()));
    for sentence in unlabelled {
        let _ = writeln!(out, "\n{sentence}");
    }
    let fronts = if result.lineages.len() <= FRONTS_MAX { &result.lineages[..] } else { &[] };
    if fronts.is_empty() {
        let _ = writeln!(
            out,
            "\nfronts of {} lineages, and why each program was chosen: in the report and in `evodrive lineage`",
            result.lineages.len()
        );
    }
    for lineage in fronts {
        let _ = writeln!(out, "\nfront of {} (attack / {strict} on the scenes of all windows):", lineage.lineage);
        let played = result.replay.iter().find(|r| r.suite == Suite::Evolution && r.ego == lineage.ego);
        if let Some(replay) = played {
            let crash = 100.0 * replay.contact_rate;
            let _ =
                writeln!(out, "  0.000 / none    replay (no program): acts nowhere, the ego crashes in {crash:.1} %");
        }
        for point in &lineage.front {
            let o = point.objectives;
            let _ = writeln!(out, "  {:.3} / {:.4}  {}", o.attack, o.realism, point.solution);
        }
        for choice in choices.iter().filter(|choice| choice.lineage == lineage.lineage) {
            let _ = write!(out, "{}", choice.text(width));
        }
    }
    let e = result.exits;
    let _ = writeln!(
        out,
        "\nattempts: {} declined, {} invalid, {} rejected, {} evaluated; {} rollouts",
        e.declined, e.invalid, e.rejected, e.evaluated, result.rollouts
    );
    let _ = writeln!(out, "run folder: {}", folder.dir.display());
    if folder.report().exists() {
        let _ = writeln!(out, "report: {}", folder.report().display());
    }
    let _ = writeln!(out, "root: {root}");
    out
}

/// A line of the table of lineages: lineage, program, and the numbers.
type Row = [String; 8];

/// The recorded scenes without a program.
fn replay_row(replay: &ReplayRow) -> Row {
    [
        format!("replay, {}", replay.ego),
        "-".to_string(),
        "0.000".to_string(),
        format!("{:.3}", replay.contact_rate),
        four_digits(replay.realism),
        "-".to_string(),
        "0.00".to_string(),
        "-".to_string(),
    ]
}

fn replay_words(replay: &ReplayRow) -> String {
    let judged = match (replay.realism, &replay.benchmark) {
        (Some(_), _) => "its realism is that of the recorded traffic itself".to_string(),
        (None, Some(row)) => {
            format!("an empty program has CR {:.3} and OS {:.3}", row.collision_rate, row.overall_score)
        }
        (None, None) => "no vehicle moves in them".to_string(),
    };
    format!(
        "replay: the recorded scenes without a program; its crashes are those of the ego in recorded traffic, {judged}."
    )
}

/// What the columns mean whose heads do not say it.
fn column_words(safebench: bool) -> String {
    let strict = match safebench {
        true => "ARS: SafeBench's adversarial realism score, which the search uses",
        false => "strict realism: the smaller one of that and the mean over its successes, which the search uses",
    };
    format!(
        "realism: mean over the scenes that a program acts in; {strict}; coverage: share of the scenes that it acts in; \
         ->: the program that was chosen, which the run reports."
    )
}

fn four_digits(rate: Option<f64>) -> String {
    rate.map_or("-".to_string(), |rate| format!("{rate:.4}"))
}

/// The lineage's parent, and under it the program that was chosen.
fn rows(lineage: &LineageResult, realisms: Option<&LineageRealisms>) -> [Row; 2] {
    let acted = realisms.map(|of| [&of.parent, &of.evolved].map(|program| program.realisms.realism_acted));
    let [acted_parent, acted_evolved] = acted.map_or([None, None], |acted| acted);
    let row = |name: &str, program: String, (of, acted): (&Measured, Option<f64>), area: String| {
        [
            name.to_string(),
            program,
            format!("{:.3}", of.objectives.attack),
            format!("{:.3}", of.any_contact),
            four_digits(acted),
            format!("{:.4}", of.objectives.realism),
            format!("{:.2}", of.coverage),
            area,
        ]
    };
    let chosen = lineage.evolved.solution.as_str().rsplit('/').next().unwrap_or_default();
    [
        row(lineage.lineage.as_str(), "parent".into(), (&lineage.parent, acted_parent), String::new()),
        row("", format!("-> {chosen}"), (&lineage.evolved, acted_evolved), format!("{:+.1}", lineage.pf_area_at_3_pct)),
    ]
}
