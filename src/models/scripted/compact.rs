//! The blocks of a compact question as those of a detailed one, so that all rules read one form. What cannot be told at length again (the
//! articles of a contract, digits that were rounded) no rule needs.

use std::collections::BTreeMap;

use serde_json::{Map, Value, json};

use super::{names::names_in, refusal::unanswerable};
use crate::llm::{Message, ModelError};

type Blocks = BTreeMap<String, Value>;

/// Returns `true` if these are the blocks of a compact question: its task is no JSON.
pub fn is_compact(blocks: &Blocks) -> bool {
    blocks.get("Task").is_some_and(Value::is_string)
}

/// Puts the blocks of a detailed question in the place of those of a compact one. `messages` are all of it; the form of the answer, which
/// ends the last, holds the `response_id`.
pub fn at_length(blocks: &mut Blocks, messages: &[Message]) -> Result<(), ModelError> {
    let prompt = messages.last().map_or("", |message| &message.text);
    let text = |title: &str| blocks.get(title).and_then(Value::as_str).unwrap_or_default().trim_end().to_string();
    let unread = |title: &str| unanswerable(format!("the prompt's compact block `{title}` cannot be read"));
    let (contract, first) = contract(&text("Family contract")).ok_or_else(|| unread("Family contract"))?;
    let outputs = outputs(&contract);
    let identity = identity(blocks.get("Patch"), messages, prompt);
    let parent = program(&text("Parent program"), first, &outputs).ok_or_else(|| unread("Parent program"))?;
    let history = rows(&text("Edit history")).iter().map(edit).collect::<Option<Vec<Value>>>();
    let task = task(&text("Task"), prompt).ok_or_else(|| unread("Task"))?;
    let blocks_at_length = [
        ("Outcomes", outcomes(&text("Outcomes"))),
        ("Edit history", history.ok_or_else(|| unread("Edit history"))?.into()),
        ("Memory", rows(&text("Memory")).iter().map(card).collect()),
        ("Scene clusters", text("Scene clusters").replace('|', " | ").into()),
        ("Family contract", contract.into()),
        ("Parent program", parent),
        ("Task", task),
    ];
    if let Some(Value::Object(patch)) = blocks.get_mut("Patch") {
        patch.remove("the parent's");
        for (name, value) in &identity {
            patch.entry(name.clone()).or_insert_with(|| value.clone());
        }
    }
    blocks.insert("Identity".into(), identity.into());
    blocks.extend(blocks_at_length.map(|(title, value)| (title.to_string(), value)));
    Ok(())
}

/// The contract line by line in its whole form, and the values of the parameters that it shows.
pub fn contract(text: &str) -> Option<(String, Map<String, Value>)> {
    let (mut section, mut group) = (String::new(), Vec::new());
    let mut takers: BTreeMap<String, Vec<String>> = BTreeMap::new();
    let (mut parameters, mut first) = (BTreeMap::new(), Map::new());
    let mut whole: Vec<String> = Vec::new();
    for line in text.lines() {
        if let Some(title) = line.strip_prefix("== ") {
            whole.extend(std::mem::take(&mut parameters).into_values());
            section = title.into();
            whole.push(line.into());
            continue;
        }
        match section.as_str() {
            "parameters" => {
                if let Some(kinds) = line.strip_prefix("of ").and_then(|kinds| kinds.strip_suffix(':')) {
                    group = kinds.split(", ").map(str::to_string).collect();
                    continue;
                }
                let (head, meaning) = line.split_once(": ")?;
                let (head, value) = head.split_once(" = ").map_or((head, None), |(head, value)| (head, Some(value)));
                let (name, _) = head.split_once(' ')?;
                first.extend(value.map(|value| (name.to_string(), setting(value))));
                group.iter().for_each(|kind| takers.entry(kind.clone()).or_default().push(name.into()));
                parameters.insert(name.to_string(), value_line(head, meaning)?);
            }
            "operators" if line.starts_with("  ") => {
                let (head, meaning) = line.trim_start().split_once(": ")?;
                whole.push(format!("  {}", value_line(head, meaning)?));
            }
            "operators" => {
                whole.push(line.into());
                let kind = line.strip_prefix("- ").and_then(|kind| kind.split([' ', ':']).next());
                if let Some(names) = kind.and_then(|kind| takers.get_mut(kind)) {
                    names.sort();
                    whole.push(format!("  as parameters: {}", names.join(", ")));
                }
            }
            "features" => whole.push(match line.split_once("?: ") {
                Some((name, meaning)) if !name.contains(' ') => format!("{name} (bool): {meaning}"),
                _ => line.into(),
            }),
            _ => whole.push(line.into()),
        }
    }
    Some((whole.join("\n"), first))
}

/// `name? [slot]` and the like as `name: optional module of slot: meaning`.
fn value_line(head: &str, meaning: &str) -> Option<String> {
    let (name, domain) = head.split_once(' ')?;
    let (name, optional) = name.strip_suffix('?').map_or((name, ""), |name| (name, "optional "));
    let domain = match domain.strip_prefix('[').and_then(|slot| slot.strip_suffix(']')) {
        Some(slot) => format!("module of {slot}"),
        None if domain.contains("..") => domain.to_string(),
        None => format!("one of {}", domain.replace('|', ", ")),
    };
    Some(format!("{name}: {optional}{domain}: {meaning}"))
}

/// Mechanism slot -> what its modules give.
fn outputs(contract: &str) -> BTreeMap<String, String> {
    let behind = contract.split_once("== mechanism slots\n").map_or("", |(_, behind)| behind);
    let slots = behind.lines().take_while(|line| !line.starts_with("== "));
    slots.filter_map(|line| line.split_once(": ")).map(|(slot, said)| (slot.into(), first_word(said).into())).collect()
}

fn first_word(text: &str) -> &str {
    text.split([':', ' ']).next().unwrap_or_default()
}

/// Returns what a patch repeats of its parent: as the form of the answer has it, or as the patch says where it does not repeat it.
/// Family and id stand in the headings. A critic of a patch that repeats the hash is not told it, and any word does.
fn identity(patch: Option<&Value>, messages: &[Message], prompt: &str) -> Map<String, Value> {
    let between = |before: &str, after: char| {
        messages.iter().find_map(|message| message.text.split_once(before)?.1.split(after).next())
    };
    let headings = [
        ("source_baseline", between("# Handbook of EvoDrive, family ", '\n')),
        ("parent_solution_id", between("## Parent program\n`", '`')),
        ("parent_program_hash", None),
    ];
    let of = |name: &str, heading: Option<&str>| {
        let in_patch = patch.and_then(|patch| patch["the parent's"][name].as_str());
        quoted(prompt, name).or(in_patch).or(heading).unwrap_or("the parent's").into()
    };
    headings.into_iter().map(|(name, heading)| (name.into(), of(name, heading))).collect()
}

/// The value of a member in the form of the answer, which ends the prompt.
fn quoted<'p>(prompt: &'p str, name: &str) -> Option<&'p str> {
    prompt.rsplit_once(&format!("\"{name}\": \""))?.1.split('"').next()
}

/// A number, a word, `[module]` or `parameter name`.
fn setting(text: &str) -> Value {
    match (text.strip_prefix('[').and_then(|name| name.strip_suffix(']')), text.strip_prefix("parameter ")) {
        (Some(module), _) => json!({"mechanism": module}),
        (_, Some(parameter)) => json!({"parameter": parameter}),
        _ => text.parse::<f64>().map_or_else(|_| text.into(), Value::from),
    }
}

fn settings<'t>(all: impl Iterator<Item = &'t str>) -> Option<Map<String, Value>> {
    all.map(|one| one.split_once('=').map(|(name, value)| (name.into(), setting(value)))).collect()
}

/// The parent's parts: `== modules`, `== nodes`, `== rules`, `== parameters`, each with a line an entry.
fn program(text: &str, first: Map<String, Value>, outputs: &BTreeMap<String, String>) -> Option<Value> {
    let (mut modules, mut nodes, mut rules, mut parameters) = (Map::new(), Map::new(), Vec::new(), first);
    let mut section = "";
    for line in text.lines() {
        if let Some(title) = line.strip_prefix("== ") {
            section = title;
            continue;
        }
        let (name, said) = line.split_once(": ")?;
        match section {
            "modules" => drop(modules.insert(name.into(), module(said, outputs)?)),
            "nodes" => drop(nodes.insert(name.into(), node(said)?)),
            "rules" => rules.push(rule(said)?),
            _ => drop(parameters.insert(name.into(), setting(said))),
        }
    }
    Some(json!({
        "mechanism_modules": modules, "operator_graph": nodes, "scenario_conditioned_policy": rules,
        "parameters": parameters,
    }))
}

/// `slot, tags a b, inputs y x: expression`.
fn module(said: &str, outputs: &BTreeMap<String, String>) -> Option<Value> {
    let (head, expression) = said.split_once(": ")?;
    let mut head = head.split(", ");
    let slot = head.next()?;
    let words = |text: &str| text.split(' ').map(str::to_string).collect::<Vec<String>>();
    let (mut tags, mut inputs) = (Vec::new(), names_in(expression).into_iter().map(str::to_string).collect());
    for part in head {
        match part.split_once(' ')? {
            ("tags", all) => tags = words(all),
            ("inputs", all) => inputs = words(all),
            _ => return None,
        }
    }
    Some(json!({
        "slot": slot, "tags": tags, "inputs": inputs, "output": outputs.get(slot)?, "expression": expression,
    }))
}

/// `slot kind <- input other, setting=1`.
fn node(said: &str) -> Option<Value> {
    let mut parts = said.split(", ");
    let (head, inputs) = parts.next().map(|head| head.split_once(" <- ").unwrap_or((head, "")))?;
    let (slot, kind) = head.split_once(' ')?;
    let inputs: Vec<&str> = inputs.split_whitespace().collect();
    Some(json!({"slot": slot, "kind": kind, "inputs": inputs, "settings": settings(parts)?}))
}

/// `name when condition: parameter=1, node.setting=2`.
fn rule(said: &str) -> Option<Value> {
    let (head, sets) = said.split_once(": ").unwrap_or((said.trim_end_matches(':'), ""));
    let (name, when) = head.split_once(" when ")?;
    let (mut parameters, mut operators) = (Map::new(), Map::new());
    for (place, value) in settings(sets.split(", ").filter(|set| !set.is_empty()))? {
        match place.split_once('.') {
            None => drop(parameters.insert(place, value)),
            Some((node, setting)) => {
                let node = operators.entry(node.to_string()).or_insert_with(|| json!({}));
                node[setting] = value;
            }
        }
    }
    Some(json!({"name": name, "when": when, "parameters": parameters, "operators": operators}))
}

/// The line of diagnostics behind the line of sums.
fn outcomes(text: &str) -> Value {
    if !text.starts_with("attack ") {
        return Value::Null;
    }
    let pairs = text.lines().nth(1).into_iter().flat_map(|line| line.split(", "));
    let pairs = pairs.filter_map(|pair| pair.split_once(' ').and_then(|(name, x)| Some((name, x.parse().ok()?))));
    let diagnostics: BTreeMap<&str, f64> = pairs.collect();
    let weakest = diagnostics.iter().min_by(|a, b| a.1.total_cmp(b.1)).map(|(name, _)| *name);
    json!({"diagnostics": diagnostics, "weakest_diagnostic": weakest})
}

/// The rows of a table by the heads of its columns.
fn rows(text: &str) -> Vec<BTreeMap<&str, &str>> {
    let mut lines = text.lines().map(|line| line.split('|'));
    let head: Vec<&str> = lines.next().into_iter().flatten().collect();
    lines.map(|cells| head.iter().copied().zip(cells).collect()).collect()
}

/// A past edit with what the rules read of it: its operations and its change of realism.
fn edit(row: &BTreeMap<&str, &str>) -> Option<Value> {
    let operations: Vec<&str> = row.get("operations")?.split("; ").collect();
    let realism = row.get("realism")?.split('±').next().filter(|said| !said.is_empty());
    let realism = realism.map(|said| said.parse::<f64>().map(|thousandths| thousandths / 1000.0));
    let change = realism.transpose().ok()?.map(|realism| format!("realism {realism}"));
    Some(json!({"operations": operations, "change": change}))
}

fn card(row: &BTreeMap<&str, &str>) -> Value {
    let words = |name: &str| row.get(name).map(|cell| cell.split_whitespace().collect::<Vec<_>>()).unwrap_or_default();
    json!({"id": row.get("id"), "kind": row.get("kind"), "mechanism_tags": words("mechanism_tags")})
}

/// `kind: text`, the instruction below.
fn task(text: &str, prompt: &str) -> Option<Value> {
    let (head, instruction) = text.split_once('\n').unwrap_or((text, ""));
    let (kind, says) = head.split_once(": ")?;
    let id = quoted(prompt, "response_id")?;
    Some(json!({"response_id": id, "target": {"kind": kind, "text": says, "instruction": instruction}}))
}
