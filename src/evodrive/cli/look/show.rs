//! `show`: everything about one attempt, the counsel for one scene, the composition of one template, or one turn of the world
//! evaluator.

use clap::Args;
use serde_json::{Value, json};

use crate::cli::records::run_name::OneRun;
use crate::cli::terminal::{answer::Answer, exit::Failure};
use crate::evidence::attempt_text::{self, Exchanged};
use crate::evidence::{RecordedRun, composition_text, counsel_text, lineage_text, world_text};
use crate::llm::{Cassette, Metadata};
use crate::objects::event::ParentAdopted;
use crate::objects::{Attempt, Composed, Counselled, Exchange, WorldEvolved};

#[derive(Debug, Args)]
pub struct Options {
    /// Attempt, e.g. cat-idm/e2s5; or a lineage's parent, e.g. cat-idm/parent; or a scene that was counselled, e.g. llm_attacker-idm/synth/urban/500/42; or a
    /// template that was composed, e.g. chatscene-idm/crossing; or a turn of the world evaluator, e.g. world/e3.
    pub attempt: String,
    #[command(flatten)]
    pub run: OneRun,
    /// Print whole prompts and replies.
    #[arg(long)]
    pub full: bool,
}

pub fn run(options: &Options) -> Result<Answer, Failure> {
    let folder = options.run.folder()?;
    let run = folder.recorded()?;
    let cassette = if folder.cassette().exists() { Some(Cassette::load(&folder.cassette())?) } else { None };
    let texts = |exchange: &Exchange| {
        let recorded = cassette.as_ref()?.get(&exchange.request)?;
        let request = recorded.request();
        Some(Exchanged {
            messages: request.messages.into_iter().map(|m| (m.role, m.text.to_string())).collect(),
            reply: String::from_utf8_lossy(&recorded.bytes).into_owned(),
            metadata: recorded.metadata.as_ref().map(Metadata::to_string),
        })
    };
    let shown = |exchange: &Exchange| -> Value {
        let messages = texts(exchange).map(|t| json!({"messages": t.messages, "reply": t.reply, "told": t.metadata}));
        json!({"exchange": exchange, "texts": messages})
    };
    if let Some(counselled) = run.counsel(&options.attempt) {
        let text = counsel_text::counsel(counselled, &texts, options.full);
        let exchanges: Vec<Value> = counselled.exchanges.iter().map(shown).collect();
        return Ok(Answer::new(text, json!({"counsel": counselled, "exchanges": exchanges})));
    }
    if let Some(composed) = run.composition(&options.attempt) {
        let text = composition_text::composition(composed, &texts, options.full);
        let exchanges: Vec<Value> = composed.exchanges.iter().map(shown).collect();
        return Ok(Answer::new(text, json!({"composition": composed, "exchanges": exchanges})));
    }
    if let Some(turn) = run.turn(&options.attempt) {
        let text = world_text::turn(turn, &texts, options.full);
        let exchanges: Vec<Value> = turn.exchanges.iter().map(shown).collect();
        return Ok(Answer::new(text, json!({"world": turn, "exchanges": exchanges})));
    }
    if let Some(adopted) = run.parents.iter().find(|of| of.program.solution_id.as_str() == options.attempt) {
        return parent(&run, adopted);
    }
    let attempt = run.attempt(&options.attempt).ok_or_else(|| unknown(&run, &options.attempt))?;
    let text = attempt_text::attempt(attempt, &texts, options.full);
    let exchanges: Vec<Value> = attempt.proposal.exchanges.iter().map(shown).collect();
    Ok(Answer::new(text, json!({"attempt": attempt, "exchanges": exchanges})))
}

/// A lineage's parent: where it came from, and its content.
fn parent(run: &RecordedRun, adopted: &ParentAdopted) -> Result<Answer, Failure> {
    let ParentAdopted { program, program_hash, ego, .. } = adopted;
    let mut text = format!(
        "parent {}  family {}, ego {ego}  {}\n",
        program.solution_id,
        program.source_family,
        program_hash.short(16)
    );
    lineage_text::origins(&mut text, run, program);
    text.push_str(&serde_json::to_string_pretty(program).map_err(Failure::internal)?);
    Ok(Answer::new(text, json!({"parent": adopted})))
}

/// Nothing that can be shown has this name.
fn unknown(run: &RecordedRun, name: &str) -> Failure {
    let attempts = run.attempts.iter().map(|attempt| attempt.id.to_string());
    let others = run.counsels.iter().map(Counselled::name).chain(run.composed.iter().map(Composed::name));
    let others = others.chain(run.evolved.iter().map(WorldEvolved::name));
    let known: Vec<String> = parents(run).into_iter().chain(attempts).chain(others).collect();
    Failure::bad_input(format!(
        "no attempt `{name}` in this run, nor a parent, a scene or a template of that name{} (attempts are <lineage>/e<epoch>s<slot>, counsel <lineage>/<scene>, \
         templates <lineage>/<kind>, turns of the world evaluator world/e<epoch>){}",
        hint(name, &known),
        could_be(run, name)
    ))
}

/// `; did you mean ...?`, where something is near.
fn hint(name: &str, known: &[String]) -> String {
    let near = crate::text::nearest(name, known.iter().map(String::as_str));
    near.map_or(String::new(), |near| format!("; did you mean `{near}`?"))
}

fn parents(run: &RecordedRun) -> Vec<String> {
    run.parents.iter().map(|parent| parent.program.solution_id.to_string()).collect()
}

/// Lineages that a message names before it counts.
const LINEAGES_MAX: usize = 12;

/// The lineages of a run with the names that theirs have, the one whose name is nearest first.
fn could_be(run: &RecordedRun, name: &str) -> String {
    let lineage = name.split('/').next().unwrap_or(name);
    let mut ids: Vec<&str> = run.parents.iter().map(|parent| parent.lineage.as_str()).collect();
    // Of equals the experiment's order stays.
    ids.sort_by_key(|id| std::cmp::Reverse(crate::text::likeness(lineage, id)));
    let line = |id: &&str| {
        let id = *id;
        let own = |attempt: &&Attempt| attempt.lineage.as_str() == id;
        let attempts: Vec<&str> = run.attempts.iter().filter(own).map(|attempt| attempt.id.as_str()).collect();
        match attempts.as_slice() {
            [] => format!("\n  {id}/parent"),
            [one] => format!("\n  {id}/parent, {one}"),
            [first, .., last] => format!("\n  {id}/parent, {first} to {last}"),
        }
    };
    let more = ids.len().saturating_sub(LINEAGES_MAX);
    let more = if more > 0 { format!("\n  and those of {more} more") } else { String::new() };
    format!("\n  there are{}{more}", ids.iter().take(LINEAGES_MAX).map(line).collect::<String>())
}

/// The attempt of that name.
pub fn find<'s>(run: &'s RecordedRun, name: &str) -> Result<&'s Attempt, Failure> {
    run.attempt(name).ok_or_else(|| {
        let attempts = run.attempts.iter().map(|attempt| attempt.id.to_string());
        let known: Vec<String> = parents(run).into_iter().chain(attempts).collect();
        Failure::bad_input(format!(
            "no attempt `{name}` in this run of {}{}{}",
            crate::text::counted(run.attempts.len(), "attempt"),
            hint(name, &known),
            could_be(run, name)
        ))
    })
}
