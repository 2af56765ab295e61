//! Text of `apply`: where the program came from, the tables, which scenes have no label and why.

use serde_json::{Value, json};
use std::fmt::Write as _;

use crate::adapters::ADAPTER_VERSION;
use crate::cli::scenes::left_out;
use crate::cli::studies::applied_broken::{self, Broken};
use crate::cli::terminal::answer::Answer;
use crate::cli::terminal::width::table_width;
use crate::ego::Policy;
use crate::epoch::Labelled;
use crate::evaluation::EVAL_VERSION;
use crate::evidence::realism::Realisms;
use crate::evidence::tables::{self, Table};
use crate::experiment::ProgramFile;
use crate::kernel::{Digest, Seed};
use crate::objects::event::Versions;
use crate::objects::replay::Replayed;
use crate::objects::{Origin, SceneFailure, SceneScore, Score, abandoned, too_slow};
use crate::sim::{Fault, SIM_VERSION};
use crate::text::counted;

/// Scenes whose reasons are listed; of more the text says how many, and `--json` lists all.
const LISTED_MAX: usize = 20;

/// Results of what was played, and the scenes that were left out before.
pub struct Comparison {
    pub file: ProgramFile,
    /// The experiment whose rules judged, where they are not those that the program was evolved under.
    pub rules: Option<String>,
    pub ego: Policy,
    pub seed: Seed,
    pub pool: Digest,
    /// Scenes that were played, or could not be.
    pub scenes: Vec<String>,
    /// Scenes that nothing was tried on, and why.
    pub left_out: Vec<(String, String)>,
    /// Scenes for which the file holds counsel.
    pub counselled: usize,
    /// Scenes on which the program was evolved.
    pub familiar: usize,
    pub replay: Replayed,
    pub parent: Labelled,
    pub program: Labelled,
}

/// Files that were written into the folder, as text and as JSON.
#[derive(Default)]
pub struct Written {
    pub text: String,
    pub json: Value,
}

pub fn answer(of: &Comparison, written: &Written, broken: Option<&[Broken]>) -> Answer {
    let (parent, program) = (of.file.parent.solution_id.to_string(), of.file.program.solution_id.to_string());
    let [before, own] = proposals(of);
    let tables = tables::applied(&tables::Applied {
        pool: of.pool,
        scenes: &of.scenes,
        replay: &of.replay,
        parent: side(&parent, &before, &of.parent),
        program: side(&program, &own, &of.program),
    });
    let notes = notes(of);
    let rows = broken.map_or(String::new(), |broken| applied_broken::text(broken, of.scenes.len(), of.ego.name()));
    let text = format!("{}{rows}{}", text(of, &tables, &notes), written.text);
    let left_out: Vec<Value> =
        of.left_out.iter().map(|(scene, reason)| json!({"scene": scene, "reason": reason})).collect();
    let [before_realisms, own_realisms] = [&of.parent, &of.program].map(|played| Realisms::of(&played.score));
    let json = json!({
        "program": {
            "name": program, "hash": of.file.program_hash, "score": of.program.score,
            "realism_acted": own_realisms.realism_acted, "strict_realism": own_realisms.strict_realism,
        },
        "parent": {
            "name": parent, "score": of.parent.score,
            "realism_acted": before_realisms.realism_acted, "strict_realism": before_realisms.strict_realism,
        },
        "replay": {"scenes": of.replay.scenes, "failures": of.replay.failures},
        "file": of.file.digest,
        "family": of.file.family,
        "origins": of.file.origins,
        "ego": of.ego.name(),
        "rules": of.rules,
        "seed": of.seed.0,
        "pool": of.pool,
        "counselled": of.counselled,
        "evolved_on": of.familiar,
        "left_out": left_out,
        "too_slow": {
            "replay": too_slow(&of.replay.failures), "parent": too_slow(&of.parent.score.failures),
            "program": too_slow(&of.program.score.failures),
        },
        "abandoned": {
            "replay": abandoned(&of.replay.failures), "parent": abandoned(&of.parent.score.failures),
            "program": abandoned(&of.program.score.failures),
        },
        "broken": broken.map(applied_broken::to_json),
        "tables": tables.iter().map(Table::json).collect::<Vec<_>>(),
        "notes": notes,
        "written": written.json,
    });
    Answer::new(text, json)
}

fn side<'a>(name: &'a str, proposals: &'a str, of: &'a Labelled) -> tables::Played<'a> {
    tables::Played { name, proposals, score: &of.score, runs: &of.runs, failures: &of.failures }
}

/// Kinds of the models that the parent and the program came from, or a hand. A published parent came from none.
fn proposals(of: &Comparison) -> [String; 2] {
    let kinds = |origin: Option<&Origin>| origin.map_or("none".to_string(), Origin::kinds);
    let own = kinds(of.file.origins.last());
    // A hand changes the program and leaves the parent what it was when the program came out of its run.
    let mut of_runs = of.file.origins.iter().rev().skip_while(|origin| matches!(origin, Origin::Hand(_)));
    let before = kinds(of_runs.nth(1));
    // A lineage's parent on its own came from nothing later than its file.
    let own = if of.file.is_parent() { before.clone() } else { own };
    [before, own]
}

fn text(of: &Comparison, tables: &[Table], notes: &[String]) -> String {
    let file = &of.file;
    let mut text = format!("{}, family {}, {}\n", file.program.solution_id, file.family, file.program_hash);
    for origin in &file.origins {
        let _ = writeln!(text, "from {origin}");
    }
    let _ = writeln!(
        text,
        "{} of pool {}, ego {}, seed {}\n",
        counted(of.scenes.len(), "scene"),
        of.pool.short(16),
        of.ego.name(),
        of.seed.0
    );
    // Aligned in a pipe too: behind it stand sentences, so no program reads it as a table; those take --json.
    tables.iter().for_each(|table| text.push_str(&format!("{}\n", tables::plain(table, table_width()))));
    if file.conditions.simulator.at_fault {
        let [parent, program] = [&of.parent.score, &of.program.score].map(at_fault);
        let _ = writeln!(text, "at fault by nuPlan's rule: {parent} under the parent, {program} under the program");
    }
    notes.iter().for_each(|note| text.push_str(&format!("note: {note}\n")));
    for line in left_out::listed("left out", of.left_out.iter().cloned()) {
        let _ = writeln!(text, "{line}");
    }
    let failures = |failures: &[SceneFailure]| -> Vec<String> {
        failures.iter().map(|failure| format!("{}: {}", failure.scene, failure.reason)).collect()
    };
    for (what, did, count) in [
        ("too slow", "took longer than it may for a decision in", too_slow as fn(&[SceneFailure]) -> usize),
        ("abandoned", "abandoned", abandoned),
    ] {
        let [without, parent, program] =
            [&of.replay.failures, &of.parent.score.failures, &of.program.score.failures].map(|of| count(of));
        if without + parent + program > 0 {
            let _ = writeln!(
                text,
                "{what}: the driver {did} {} without a program, {parent} under the parent, {program} under the program; those are \
                 neither crashes nor successes, and count in no number above",
                counted(without, "scene")
            );
        }
    }
    listed(&mut text, "no replay", failures(&of.replay.failures));
    listed(&mut text, "no label of the parent", failures(&of.parent.score.failures));
    listed(&mut text, "no label of the program", failures(&of.program.score.failures));
    text
}

/// For how many of a program's contacts with adversaries the ego is at fault by nuPlan's rule.
fn at_fault(score: &Score) -> String {
    let met = score
        .scenes
        .iter()
        .flat_map(SceneScore::each)
        .filter_map(|label| label.contact.as_ref())
        .filter(|met| met.adversary && !met.anyway);
    let faults: Vec<Option<Fault>> = met.map(|met| met.fault.as_deref().and_then(Fault::named)).collect();
    let blamed = faults.iter().flatten().filter(|fault| fault.is_egos()).count();
    format!("{blamed} of {}", counted(faults.len(), "contact"))
}

fn listed(text: &mut String, what: &str, lines: Vec<String>) {
    lines.iter().take(LISTED_MAX).for_each(|line| text.push_str(&format!("{what}: {line}\n")));
    if lines.len() > LISTED_MAX {
        let _ = writeln!(text, "{what}: {} more, which --json lists", lines.len() - LISTED_MAX);
    }
}

/// Returns notes on what differs from the run that the program came out of.
fn notes(of: &Comparison) -> Vec<String> {
    let conditions = &of.file.conditions;
    let mut notes = Vec::new();
    if of.file.is_parent() {
        notes.push("the program is its lineage's own parent, so both rows are the same".into());
    } else if of.familiar > 0 {
        notes.push(format!(
            "the program was evolved on {} of {}: it was chosen by its labels there, so only other scenes show what it does in \
             new traffic",
            of.familiar,
            counted(of.scenes.len(), "scene")
        ));
    }
    if let Some(backend) = &conditions.backend {
        notes.push(format!(
            "the program was evolved on labels of {} {}; `apply` plays it in our own simulator, whose labels may differ. To \
             have it labelled there, start a lineage from this file (`parent_program`) in an experiment with that \
             [simulator.backend]",
            backend.name, backend.version
        ));
    }
    if let Some(rules) = &of.rules {
        notes.push(format!(
            "simulated and judged by the rules of {rules}, not by those that the program was evolved under"
        ));
    }
    if of.ego.name() != conditions.ego {
        notes.push(format!("the program was evolved against ego {}, not {}", conditions.ego, of.ego.name()));
    }
    if of.seed.0 != conditions.seed {
        notes.push(format!("the program was labelled with seed {}, not {}", conditions.seed, of.seed.0));
    }
    let here = Versions { adapter: ADAPTER_VERSION, sim: SIM_VERSION, eval: EVAL_VERSION };
    if conditions.versions != here {
        notes.push(format!(
            "exported under simulator version {} and evaluation version {}, here {} and {}: labels may differ from the run's",
            conditions.versions.sim, conditions.versions.eval, here.sim, here.eval
        ));
    }
    if of.file.takes_counsel() {
        notes.push(format!(
            "in this family a model advises who should attack (counsel): the file holds it for {} of {}; in the \
             others the program chooses by its own rules",
            of.counselled,
            counted(of.scenes.len(), "scene")
        ));
    }
    if !of.file.parent_settings.is_empty() {
        let set: Vec<String> = of.file.parent_settings.keys().cloned().collect();
        notes.push(format!("the parent's experiment set its {}", set.join(", ")));
    }
    notes
}
