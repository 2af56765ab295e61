//! Explanation of a table's numbers: from a cell down to formula, repetitions, scenes with their labels, programs with their patches,
//! reviews, and the digests of prompts and answers.

use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::fmt::Write as _;

use super::cell::{Named, cell_name};
use super::lineage_text::shortened;
use super::recorded_run::RecordedRun;
use super::tables::{Derivation, Derivations, Leaf, Repetition, Table};
use crate::kernel::Digest;
use crate::objects::{Attempt, Exchange, Program, SceneScore, SolutionId};
use crate::sim::{Fault, avoided_in_words};
use crate::text::counted;

/// Scenes of a repetition that are named where only they move its number.
const NAMED_MAX: usize = 6;
/// Scenes of a share that are named one by one.
const OF_SHARE_MAX: usize = 20;

/// Places of objects in the files of a run.
#[derive(Clone, Debug, Default)]
pub struct Places {
    /// Event of each attempt in the transcript, from 0.
    pub events: BTreeMap<String, u64>,
    /// Line of each exchange in the cassette, from 1.
    pub lines: BTreeMap<Digest, usize>,
    /// Folder of the run, as it was named.
    pub folder: String,
}

/// A cell with all that it rests on.
pub struct Why<'a, 's> {
    pub table: &'a Table,
    pub named: &'a Named<'a>,
    pub basis: &'a Derivation,
    pub bases: &'a Derivations<'s>,
    pub recorded_runs: &'a [RecordedRun],
    /// One a run.
    pub places: &'a [Places],
}

impl Why<'_, '_> {
    fn name(&self) -> String {
        cell_name(self.table, self.named.row, &self.named.cell.column)
    }

    /// The number as the table prints it.
    pub fn printed(&self) -> String {
        self.named.cell.ours.map_or("none".into(), |ours| self.number(ours.value))
    }

    fn number(&self, value: f64) -> String {
        self.named.cell.column.form.number(value)
    }

    /// Returns `true` if the number comes out again of its parts, to the printed digits.
    pub fn agrees(&self) -> bool {
        self.basis.value().map(|value| self.number(value)) == self.named.cell.ours.map(|ours| self.number(ours.value))
    }

    fn command(&self, more: &str) -> String {
        let runs: Vec<&str> = self.places.iter().map(|places| places.folder.as_str()).collect();
        format!("evodrive why {} {}{more}", self.name(), runs.join(" "))
    }

    /// The cell, its formula, its repetitions.
    pub fn short(&self) -> String {
        let ours = self.named.cell.ours;
        let interval =
            ours.and_then(|ours| ours.interval).map(|i| format!(" {}", self.named.cell.column.form.interval(i)));
        let mut out = format!("{} = {}{}\n", self.name(), self.printed(), interval.unwrap_or_default());
        if !self.named.also.is_empty() {
            let _ = writeln!(out, "  (also of that name: {})", self.named.also.join(", "));
        }
        let again = self.basis.value().map_or("no number".to_string(), |value| format!("{value}"));
        let _ = writeln!(out, "formula: {}\nfrom the parts: {again}", self.basis.formula);
        for basis in self.basis.all() {
            if !std::ptr::eq(basis, self.basis) {
                let value = basis.value().map_or("none".into(), |value| value.to_string());
                let _ = writeln!(out, "term {value}: {}", basis.formula);
            }
            for part in &basis.parts {
                self.part(&mut out, part);
            }
        }
        let scene = self.telling().map(|leaf| self.command(&format!(" --scene {}", leaf.name)));
        let attempt = self.attempts().into_iter().next().map(|id| self.command(&format!(" --attempt {id}")));
        let more: Vec<String> = scene.into_iter().chain(attempt).chain([self.command(" --full")]).collect();
        let _ = writeln!(out, "more: {}", more.join("\n      "));
        out
    }

    /// The scene that moves the number most; of equal ones the first.
    fn telling(&self) -> Option<&Leaf> {
        let size = |leaf: &Leaf| leaf.value.map_or(-1.0, f64::abs);
        let mut best: Option<&Leaf> = None;
        for leaf in self.basis.all().into_iter().flat_map(|basis| &basis.parts).flat_map(|part| &part.leaves) {
            if leaf.attempt.is_none() && best.is_none_or(|before| size(leaf) > size(before)) {
                best = Some(leaf);
            }
        }
        best
    }

    fn part(&self, out: &mut String, part: &Repetition) {
        let value = part.value.map_or("none".into(), |value| value.to_string());
        let programs: Vec<&str> = part.programs.iter().map(SolutionId::as_str).collect();
        let programs = if programs.len() > 4 { format!("{} programs", programs.len()) } else { programs.join(", ") };
        let of = &self.recorded_runs[part.run];
        // Of a number that is no sum over scenes none counts by itself.
        let scenes = if part.steps.is_empty() {
            counting(part)
        } else {
            format!("over {} together", counted(part.leaves.len(), "scene"))
        };
        let _ = writeln!(
            out,
            "  {} seed {}: {value}  of {programs}  {scenes}  run {} ({})",
            part.lineage,
            part.replica,
            of.opened.name,
            of.root.short(8)
        );
        let moving: Vec<&str> =
            part.leaves.iter().filter(|l| l.value.is_some_and(|v| v != 0.0)).map(|l| l.name.as_str()).collect();
        if is_share(part) {
            of_share(out, part);
        } else if (1..=NAMED_MAX).contains(&moving.len()) && moving.len() < part.leaves.len() {
            let _ = writeln!(out, "    not 0 in {}", moving.join(", "));
        }
        for step in &part.steps {
            let _ = writeln!(out, "    {step}");
        }
    }

    /// Names of the attempts and parents that the cell rests on, each once, those that are read first.
    pub fn attempts(&self) -> Vec<String> {
        let mut reasons: Vec<String> = Vec::new();
        for part in self.basis.all().into_iter().flat_map(|basis| &basis.parts) {
            let proposals = part.leaves.iter().filter_map(|leaf| leaf.attempt.as_ref()).map(|id| id.to_string());
            for id in part.programs.iter().rev().map(|of| of.to_string()).chain(proposals) {
                if !reasons.contains(&id) {
                    reasons.push(id);
                }
            }
        }
        reasons
    }

    /// Every scene of every repetition.
    pub fn full(&self) -> String {
        let mut out = self.short();
        for part in self.basis.all().into_iter().flat_map(|basis| &basis.parts) {
            let _ = writeln!(out, "\n{} seed {}:", part.lineage, part.replica);
            for leaf in &part.leaves {
                let value = leaf.value.map_or("-".into(), |value| value.to_string());
                let _ = writeln!(out, "  {:<44} {value:<8} {}", leaf.name, leaf.note.as_deref().unwrap_or_default());
                self.labels(&mut out, part, leaf, false);
            }
        }
        for id in self.attempts() {
            out.push('\n');
            out.push_str(&self.attempt(&id).unwrap_or_default());
        }
        out
    }

    /// One scene in every repetition that reads it; `None` where none does.
    pub fn scene(&self, id: &str) -> Option<String> {
        let mut out = String::new();
        for part in self.basis.all().into_iter().flat_map(|basis| &basis.parts) {
            for leaf in part.leaves.iter().filter(|leaf| leaf.name == id) {
                let value = leaf.value.map_or("does not count by itself".into(), |value| value.to_string());
                let note = leaf.note.as_ref().map_or(String::new(), |note| format!("  ({note})"));
                let _ = writeln!(out, "{} seed {}: {id}: {value}{note}", part.lineage, part.replica);
                self.labels(&mut out, part, leaf, true);
                if let Some(when) = &self.recorded_runs[part.run].opened.attack {
                    let fields = "`evodrive data` lays its fields out: rollouts, in the row of this record";
                    let _ = writeln!(out, "  attack is the experiment's own: {when}\n    {fields}");
                }
            }
        }
        (!out.is_empty()).then_some(out)
    }

    /// Returns the labels of a scene that the cell rests on and that have a contact, each once: place of the run, program, and the digest of
    /// its rollout's record.
    pub fn contacts(&self, scene: &str) -> Vec<(usize, SolutionId, Digest)> {
        let mut contacts = Vec::new();
        for part in self.basis.all().into_iter().flat_map(|basis| &basis.parts) {
            for solution in part.leaves.iter().filter(|leaf| leaf.name == scene).flat_map(|leaf| &leaf.programs) {
                let label = self.bases.label(part.run, solution, scene).filter(|label| label.contact.is_some());
                let of = label.map(|label| (part.run, solution.clone(), label.record));
                contacts.extend(of.filter(|of| !contacts.contains(of)));
            }
        }
        contacts
    }

    fn labels(&self, out: &mut String, part: &Repetition, leaf: &Leaf, long: bool) {
        for solution in &leaf.programs {
            match self.bases.label(part.run, solution, &leaf.name) {
                Some(label) if long => long_label(out, solution, label, &self.places[part.run].folder),
                Some(label) => short_label(out, solution, label),
                None => {
                    let _ = writeln!(out, "    {solution}: no label of this scene is recorded");
                }
            }
        }
    }

    /// One program: its digest, its chain back to the parent, reviews, questions and answers. `None` for a name that the cell
    /// does not rest on.
    pub fn attempt(&self, id: &str) -> Option<String> {
        let recorded_of = |part: &&Repetition| {
            let program = self.recorded_runs[part.run].program(&SolutionId::new(id));
            program.is_some() || self.recorded_runs[part.run].attempt(id).is_some()
        };
        let all = self.basis.all();
        let part = all.into_iter().flat_map(|basis| &basis.parts).find(recorded_of)?;
        let (run, places) = (&self.recorded_runs[part.run], &self.places[part.run]);
        let mut out = format!("{id}\n");
        let chain = run.chain(&SolutionId::new(id));
        for (step, program) in chain.iter().enumerate() {
            self.step(&mut out, run, step, program);
        }
        if let Some(attempt) = run.attempt(id) {
            proposed(&mut out, attempt, places);
        }
        let folder = &places.folder;
        let digest = chain.last().and_then(|program| program.hash().ok()).map(|hash| hash.short(16));
        let _ = writeln!(out, "  more: evodrive show {id} --full --run {folder}");
        if let Some(digest) = digest {
            let _ = writeln!(out, "        evodrive impact {digest} {folder}");
        }
        Some(out)
    }

    fn step(&self, out: &mut String, run: &RecordedRun, step: usize, program: &Program) {
        let hash = program.hash().map_or("?".into(), |hash| hash.to_hex());
        let _ = writeln!(out, "  [{step}] {}  program {hash}", program.solution_id);
        let attempt = run.attempt(program.solution_id.as_str());
        if let Some(candidate) = attempt.and_then(|attempt| attempt.exit.candidate()) {
            let _ = writeln!(out, "      patch {}", candidate.patch_hash);
        }
        for operation in attempt.and_then(|a| a.proposal.patch()).iter().flat_map(|patch| &patch.operations) {
            let value = operation.value.as_ref().map(Value::to_string).unwrap_or_default();
            let op = format!("{:?}", operation.op).to_lowercase();
            let _ = writeln!(out, "      {op} {} {}", operation.path, shortened(&value, 100));
        }
    }

    /// The whole as one object.
    pub fn json(&self) -> Value {
        let cell = &self.named.cell;
        let programs: serde_json::Map<String, Value> =
            self.attempts().into_iter().map(|id| (id.clone(), self.program(&id))).collect();
        json!({
            "cell": self.name(), "column": cell.column.key, "printed": self.printed(), "value": cell.ours.map(|ours| ours.value),
            "from_parts": self.basis.value(), "agrees": self.agrees(), "basis": self.basis_json(self.basis), "programs": programs,
        })
    }

    fn basis_json(&self, basis: &Derivation) -> Value {
        let terms: Vec<Value> = basis.terms.iter().map(|term| self.basis_json(term)).collect();
        let parts: Vec<Value> = basis.parts.iter().map(|part| self.part_json(part)).collect();
        json!({"formula": basis.formula, "value": basis.value(), "terms": terms, "parts": parts})
    }

    fn part_json(&self, part: &Repetition) -> Value {
        let leaf = |leaf: &Leaf| {
            let label = |of: &SolutionId| json!({"program": of, "label": self.bases.label(part.run, of, &leaf.name)});
            let labels: Vec<Value> = leaf.programs.iter().map(label).collect();
            let selected = leaf.selected.map(|selected| json!({"round": selected.round, "run": selected.run}));
            json!({"name": leaf.name, "value": leaf.value, "labels": labels, "selected": selected, "note": leaf.note})
        };
        let (leaves, run) = (part.leaves.iter().map(leaf).collect::<Vec<Value>>(), &self.recorded_runs[part.run]);
        json!({
            "search": part.search, "lineage": part.lineage, "replica": part.replica, "value": part.value, "programs": part.programs,
            "run": run.opened.name, "root": run.root, "leaves": leaves, "steps": part.steps,
        })
    }

    fn program(&self, id: &str) -> Value {
        let reasons = self.recorded_runs.iter().zip(self.places).find_map(|(run, places)| {
            let chain = run.chain(&SolutionId::new(id));
            let attempt = run.attempt(id);
            (!chain.is_empty() || attempt.is_some()).then_some((chain, attempt, places))
        });
        let Some((chain, attempt, places)) = reasons else { return Value::Null };
        let chain: Vec<Value> =
            chain.iter().map(|of| json!({"program": of.solution_id, "digest": of.hash().ok()})).collect();
        let line = |asked: &Exchange| json!({"exchange": asked, "cassette_line": places.lines.get(&asked.request)});
        let asked = attempt.map(|attempt| attempt.proposal.exchanges.iter().map(line).collect::<Vec<Value>>());
        json!({"chain": chain, "attempt": attempt, "exchanges": asked, "event": places.events.get(id)})
    }
}

/// Returns `true` if each scene is 0 or 1, or a difference of such: then their number says more than their mean.
fn is_share(part: &Repetition) -> bool {
    let mut values = part.leaves.iter().filter_map(|leaf| leaf.value).peekable();
    part.steps.is_empty() && values.peek().is_some() && values.all(|value| [-1.0, 0.0, 1.0].contains(&value))
}

/// The leaves of a share that have a value.
fn leaves_of(part: &Repetition, value: f64) -> Vec<&str> {
    part.leaves.iter().filter(|leaf| leaf.value == Some(value)).map(|leaf| leaf.name.as_str()).collect()
}

/// Counts a part's leaves by their values, in words.
fn counting(part: &Repetition) -> String {
    let with_value = part.leaves.iter().filter(|leaf| leaf.value.is_some()).count();
    let without = match part.leaves.len() - with_value {
        0 => String::new(),
        others => format!(", {others} more are not counted"),
    };
    if !is_share(part) {
        return format!("{with_value} of {} counted", part.leaves.len());
    }
    let noun = if part.leaves.iter().any(|leaf| leaf.attempt.is_some()) { "proposal" } else { "scene" };
    let (ones, lost) = (leaves_of(part, 1.0).len(), leaves_of(part, -1.0).len());
    let are = |count: usize| if count == 1 { "is" } else { "are" };
    let lost = if lost > 0 { format!(", {lost} {} -1", are(lost)) } else { String::new() };
    format!("{ones} of {} {} 1{lost}{without}", counted(with_value, noun), are(ones))
}

/// The leaves of a share that are not 0, by name.
fn of_share(out: &mut String, part: &Repetition) {
    for value in [1.0, -1.0] {
        let names = leaves_of(part, value);
        if names.is_empty() || names.len() == part.leaves.len() {
            continue;
        }
        let more = match names.len().saturating_sub(OF_SHARE_MAX) {
            0 => String::new(),
            more => format!(", and {more} more, --full lists all"),
        };
        let shown = names[..names.len().min(OF_SHARE_MAX)].join(", ");
        let _ = writeln!(out, "    {value} in {shown}{more}");
    }
}

fn short_label(out: &mut String, solution: &SolutionId, label: &SceneScore) {
    let contact = label.contact.as_ref().map_or("no contact".to_string(), |met| met.class.clone());
    let _ = writeln!(
        out,
        "    {solution}: attack {} realism {} acted {} {contact}  record {}",
        label.attack,
        label.realism,
        label.acted,
        label.record.short(16)
    );
    for (ego, alone) in &label.by_ego {
        let contact = alone.contact.as_ref().map_or("no contact", |met| met.class.as_str());
        let (attack, realism, record) = (alone.attack, alone.realism, alone.record.short(16));
        let _ = writeln!(out, "      {ego}: attack {attack} realism {realism} {contact}  record {record}");
    }
}

fn long_label(out: &mut String, solution: &SolutionId, label: &SceneScore, folder: &str) {
    for (ego, alone) in &label.by_ego {
        long_label(out, &SolutionId::new(format!("{solution} against {ego}")), alone, folder);
    }
    let _ = writeln!(out, "  {solution}: attack {} realism {} acted {}", label.attack, label.realism, label.acted);
    match &label.contact {
        None => out.push_str("    contact: none\n"),
        Some(met) => {
            let avoidable = met.avoidable.map_or("not assessed".into(), |avoidable| avoidable.to_string());
            let (class, adversary, anyway) = (&met.class, met.adversary, met.anyway);
            let _ = writeln!(
                out,
                "    contact: {class}, adversary {adversary}, avoidable {avoidable}, in plain replay too {anyway}"
            );
            if let Some(fault) = met.fault.as_deref().and_then(Fault::named) {
                let _ = writeln!(out, "    nuPlan's rule: {}: {}", fault.name(), fault.in_words());
            }
            if let Some(of) = met.avoided_by {
                let _ = writeln!(out, "    jury: {}", avoided_in_words(of));
            }
        }
    }
    for (name, value) in &label.diagnostics {
        let _ = writeln!(out, "    {name:<24} {value}");
    }
    let _ = writeln!(out, "    rollout key {}\n    rollout record {}", label.request, label.record);
    let scene = &label.scene;
    let _ = writeln!(
        out,
        "    more: evodrive scenes show --run {folder} --attempt {solution} --scene {scene} --html rollout.html"
    );
    let _ = writeln!(out, "          evodrive impact {} {folder}", label.record.short(16));
}

fn proposed(out: &mut String, attempt: &Attempt, places: &Places) {
    let event = places
        .events
        .get(attempt.id.as_str())
        .map_or(String::new(), |seq| format!(", event {seq} of transcript.jsonl"));
    let _ = writeln!(out, "  exit {}{event}; asked for: {}", attempt.exit.name(), attempt.target);
    for (round, of) in attempt.proposal.rounds.iter().enumerate() {
        for review in &of.reviews {
            let decision = format!("{:?}", review.decision).to_lowercase();
            let blockers =
                if review.blockers.is_empty() { String::new() } else { format!(": {}", review.blockers.join("; ")) };
            let _ = writeln!(out, "  review of round {round} by {}: {decision}{blockers}", review.role.name());
        }
    }
    if let Some(tuned) = &attempt.proposal.tuned {
        let _ = writeln!(out, "  {}", tuned.in_words());
    }
    for asked in &attempt.proposal.exchanges {
        let place = places
            .lines
            .get(&asked.request)
            .map_or("not in the cassette".to_string(), |line| format!("cassette.jsonl line {line}"));
        let _ = writeln!(
            out,
            "  {} round {}: prompt {}\n    answer {}  {place}",
            asked.role.name(),
            asked.round,
            asked.request,
            asked.response
        );
    }
}
