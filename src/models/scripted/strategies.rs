//! The ways in which the stand-in edits a program. Each is driven by the contract in the prompt and names no family.

use serde_json::{Value, json};
use std::collections::BTreeMap;

use super::{
    conditions,
    contract::Domain,
    edit,
    forms::{self, Purpose},
    reader::{Node, PromptView},
    ways,
    wiring::{self, Draft},
};
use crate::kernel::{Stream, num};

/// Writes operations into the draft and says what they do, or finds nothing to do.
pub type Apply = fn(&PromptView, &mut Draft, &mut Stream) -> Option<String>;

pub struct Strategy {
    pub name: &'static str,
    /// Weight when the target is to raise attack, to raise realism, to diversify.
    pub weights: [f64; 3],
    pub apply: Apply,
}

const fn strategy(name: &'static str, weights: [f64; 3], apply: Apply) -> Strategy {
    Strategy { name, weights, apply }
}

pub const STRATEGIES: [Strategy; 20] = [
    strategy("fill_optional_mechanism", [6.0, 3.0, 6.0], fill_optional_mechanism),
    strategy("swap_operator", [4.0, 2.5, 4.5], swap_operator),
    strategy("replace_expression", [2.5, 1.5, 3.0], replace_expression),
    strategy("add_term", [3.0, 2.0, 1.5], add_term),
    strategy("gate_expression", [1.5, 1.5, 2.0], gate_expression),
    strategy("insert_filter", [1.0, 5.0, 1.5], insert_filter),
    strategy("obey_law", [2.0, 1.0, 2.5], ways::obey),
    strategy("fall_back", [1.5, 0.8, 2.0], ways::fall_back),
    strategy("rule_on_parameters", [2.0, 2.5, 2.0], rule_on_parameters),
    strategy("rule_on_settings", [1.5, 1.5, 2.0], rule_on_settings),
    strategy("module_by_scene", [2.0, 1.5, 2.5], module_by_scene),
    strategy("new_condition", [0.8, 0.8, 0.8], new_condition),
    strategy("widen_rule", [0.5, 0.5, 0.5], widen_rule),
    strategy("remove_filter", [0.8, 0.1, 0.6], remove_filter),
    strategy("remove_rule", [0.4, 0.4, 0.4], remove_rule),
    strategy("remove_optional", [0.2, 0.3, 0.5], remove_optional),
    strategy("flip_choice", [0.8, 0.5, 1.0], flip_choice),
    strategy("retarget_setting", [0.6, 0.6, 0.5], retarget_setting),
    strategy("move_parameters", [1.2, 1.5, 0.8], move_parameters),
    strategy("retune_constant", [0.6, 0.6, 0.4], retune_constant),
];

/// A setting of a node, as the contract declares it.
struct Place<'a> {
    node: &'a str,
    operator: &'a Node,
    setting: &'a str,
    domain: &'a Domain,
    value: Option<&'a Value>,
}

impl Place<'_> {
    fn path(&self) -> String {
        format!("/operator_graph/{}/settings/{}", self.node, self.setting)
    }
}

fn places(page: &PromptView) -> Vec<Place<'_>> {
    let mut strategies = vec![];
    for (node, operator) in &page.program.operator_graph {
        if let Some(kind) = page.kind(&operator.slot, &operator.kind) {
            strategies.extend(kind.settings.iter().map(|(setting, domain)| Place {
                node,
                operator,
                setting,
                domain,
                value: operator.settings.get(setting),
            }));
        }
    }
    strategies
}

/// One of the items, all equally likely; `None` if there are none.
fn drawn<T>(items: Vec<T>, stream: &mut Stream) -> Option<T> {
    if items.is_empty() {
        return None;
    }
    let index = stream.below(items.len());
    items.into_iter().nth(index)
}

fn tags_text(draft: &Draft) -> String {
    draft.tags.iter().map(|tag| tag.replace('_', " ")).collect::<Vec<_>>().join(" and ")
}

/// Adds a mechanism where the contract allows one and the parent has none.
fn fill_optional_mechanism(page: &PromptView, draft: &mut Draft, stream: &mut Stream) -> Option<String> {
    let free = places(page).into_iter().filter(|p| p.domain.slot.is_some() && p.value.is_none()).collect();
    let place = drawn(free, stream)?;
    let slot = place.domain.slot.as_deref()?;
    let name = wiring::new_module(page, &page.program, slot, draft, stream)?;
    draft.operations.push(edit::add(place.path(), json!({"mechanism": name})));
    let what = match Purpose::of(page, slot)? {
        Purpose::Guard | Purpose::Gate => "keeps the intervention to cases that pass",
        _ => "weighs the choice by",
    };
    Some(format!("`{name}` in `{slot}` {what} {}", tags_text(draft)))
}

/// Another operator kind in a slot that has more than one, with its settings and the modules that it needs.
fn swap_operator(page: &PromptView, draft: &mut Draft, stream: &mut Stream) -> Option<String> {
    let mut swaps = vec![];
    for (name, node) in &page.program.operator_graph {
        let (Some(slot), Some(now)) = (page.contract.operators.get(&node.slot), page.kind(&node.slot, &node.kind))
        else {
            continue;
        };
        let like = |k: &&super::contract::Kind| k.inputs == now.inputs && k.output == now.output;
        let others = slot.kinds.iter().filter(|(kind, spec)| **kind != node.kind && like(spec));
        swaps.extend(others.map(|(kind, spec)| (name, node, kind, spec)));
    }
    let (name, node, kind, spec) = drawn(swaps, stream)?;
    let settings = wiring::settings(page, &page.program, spec, Some(node), draft, stream)?;
    let value = json!({"slot": node.slot, "kind": kind, "settings": settings, "inputs": node.inputs});
    draft.operations.push(edit::replace(format!("/operator_graph/{name}"), value));
    let with = if draft.tags.is_empty() { String::new() } else { format!(" by {}", tags_text(draft)) };
    Some(format!(
        "`{kind}` in place of `{}` makes the {} step{with} depend on the interaction at hand",
        node.kind, node.slot
    ))
}

/// Gives an existing module a new expression.
fn replace_expression(page: &PromptView, draft: &mut Draft, stream: &mut Stream) -> Option<String> {
    let (name, module) = drawn(page.program.mechanism_modules.iter().collect(), stream)?;
    let mechanism = forms::invent(page, &module.slot, stream)?;
    let value = wiring::module_json(page, &module.slot, &mechanism.expression, &mechanism.tags);
    draft.operations.push(edit::replace(format!("/mechanism_modules/{name}"), value));
    draft.uses(&mechanism);
    Some(format!("`{name}` now follows {}", tags_text(draft)))
}

/// Adds one term to a score, or one condition to a guard.
fn add_term(page: &PromptView, draft: &mut Draft, stream: &mut Stream) -> Option<String> {
    let (name, module) = drawn(page.program.mechanism_modules.iter().collect(), stream)?;
    let (tag, term) = forms::extra_term(page, &module.slot, stream)?;
    let old = &module.expression;
    let weight = num::rounded(stream.uniform(0.3, 1.2), 2);
    let expression = match Purpose::of(page, &module.slot)? {
        Purpose::Guard | Purpose::Gate => format!("({old}) and ({term})"),
        Purpose::Loss => format!("({old}) - {weight} * ({term})"),
        _ if stream.chance(0.3) => format!("({old}) * ({weight} + {term})"),
        _ => format!("({old}) + {weight} * ({term})"),
    };
    let mut tags = module.tags.clone();
    tags.retain(|other| *other != tag);
    tags.push(tag.clone());
    let value = wiring::module_json(page, &module.slot, &expression, &tags);
    draft.operations.push(edit::replace(format!("/mechanism_modules/{name}"), value));
    draft.tags.push(tag);
    Some(format!("`{name}` also takes {} into account", tags_text(draft)))
}

/// Lowers the weight of a module outside one kind of scene.
fn gate_expression(page: &PromptView, draft: &mut Draft, stream: &mut Stream) -> Option<String> {
    let numeric = page.program.mechanism_modules.iter().filter(|(_, module)| module.output == "number").collect();
    let (name, module) = drawn(numeric, stream)?;
    let condition = conditions::draw(page, stream)?;
    let weight = num::rounded(stream.uniform(0.2, 0.7), 2);
    let expression = format!("if({}, {}, {weight} * ({}))", condition.text, module.expression, module.expression);
    let mut tags = module.tags.clone();
    tags.push(format!("{}_scene", condition.name));
    let value = wiring::module_json(page, &module.slot, &expression, &tags);
    draft.operations.push(edit::replace(format!("/mechanism_modules/{name}"), value));
    draft.clusters.extend(condition.cluster);
    draft.tags.push(format!("{}_scene", condition.name));
    Some(format!("`{name}` counts fully only where `{}` holds", condition.text))
}

fn insert_filter(page: &PromptView, draft: &mut Draft, stream: &mut Stream) -> Option<String> {
    let kind = wiring::insert_filter(page, &page.program, draft, stream)?;
    let about = page.weakest().map(|(name, value)| format!(", where {name} stands at {value}")).unwrap_or_default();
    Some(format!("`{kind}` removes candidates that would not be driven{about}"))
}

/// Parameters that differ in a kind of scene.
fn rule_on_parameters(page: &PromptView, draft: &mut Draft, stream: &mut Stream) -> Option<String> {
    let condition = room_for_rule(page)?.then(|| conditions::draw(page, stream))??;
    let mut movable: Vec<&String> = page.contract.parameters.keys().filter(|name| is_used(page, name)).collect();
    stream.shuffle(&mut movable);
    let mut values = BTreeMap::new();
    for name in movable.into_iter().take(1 + stream.below(2)) {
        values.insert(name.clone(), moved(page, name, 0.3, stream)?);
    }
    let names: Vec<&String> = values.keys().collect();
    let says = format!("Where `{}` holds, {} differ", condition.text, quoted(&names));
    (!values.is_empty()).then(|| push_rule(page, draft, &condition, json!(values), json!({})))?;
    Some(says)
}

/// Operator settings that differ in a kind of scene.
fn rule_on_settings(page: &PromptView, draft: &mut Draft, stream: &mut Stream) -> Option<String> {
    let condition = room_for_rule(page)?.then(|| conditions::draw(page, stream))??;
    let place =
        drawn(places(page).into_iter().filter(|p| p.domain.slot.is_none() && p.value.is_some()).collect(), stream)?;
    let value = wiring::literal(place.domain, stream).filter(|value| Some(value) != place.value)?;
    let says = format!("Where `{}` holds, `{}` of `{}` is {value}", condition.text, place.setting, place.node);
    push_rule(page, draft, &condition, json!({}), json!({place.node: {place.setting: value}}));
    Some(says)
}

/// A second module that takes a setting over in a kind of scene.
fn module_by_scene(page: &PromptView, draft: &mut Draft, stream: &mut Stream) -> Option<String> {
    let condition = room_for_rule(page)?.then(|| conditions::draw(page, stream))??;
    let place =
        drawn(places(page).into_iter().filter(|p| p.domain.slot.is_some() && p.value.is_some()).collect(), stream)?;
    let slot = place.domain.slot.as_deref()?;
    let name = wiring::new_module(page, &page.program, slot, draft, stream)?;
    let says = format!(
        "Where `{}` holds, `{name}` with {} takes over in `{}`",
        condition.text,
        tags_text(draft),
        place.operator.kind
    );
    push_rule(page, draft, &condition, json!({}), json!({place.node: {place.setting: {"mechanism": name}}}));
    Some(says)
}

fn room_for_rule(page: &PromptView) -> Option<bool> {
    (page.program.scenario_conditioned_policy.len() < page.contract.limits.rules).then_some(true)
}

fn push_rule(
    page: &PromptView,
    draft: &mut Draft,
    condition: &conditions::Condition,
    parameters: Value,
    operators: Value,
) {
    let name = draft.fresh(condition.name, page.program.scenario_conditioned_policy.iter().map(|rule| &rule.name));
    let rule = json!({"name": name, "when": condition.text, "parameters": parameters, "operators": operators});
    draft.operations.push(edit::add("/scenario_conditioned_policy/-".into(), rule));
    draft.clusters.extend(condition.cluster.clone());
}

/// Gives an existing rule another condition.
fn new_condition(page: &PromptView, draft: &mut Draft, stream: &mut Stream) -> Option<String> {
    let (index, rule) = drawn(page.program.scenario_conditioned_policy.iter().enumerate().collect(), stream)?;
    let condition = conditions::draw(page, stream)?;
    draft
        .operations
        .push(edit::replace(format!("/scenario_conditioned_policy/{index}/when"), condition.text.clone().into()));
    draft.clusters.extend(condition.cluster);
    Some(format!("The rule `{}` now holds where `{}`", rule.name, condition.text))
}

/// Makes a rule apply in more, or in fewer, kinds of scenes.
fn widen_rule(page: &PromptView, draft: &mut Draft, stream: &mut Stream) -> Option<String> {
    let (index, rule) = drawn(page.program.scenario_conditioned_policy.iter().enumerate().collect(), stream)?;
    let condition = conditions::draw(page, stream)?;
    let joint = if stream.chance(0.5) { "or" } else { "and" };
    let when = format!("({}) {joint} ({})", rule.when, condition.text);
    draft.operations.push(edit::replace(format!("/scenario_conditioned_policy/{index}/when"), when.into()));
    draft.clusters.extend(condition.cluster);
    Some(format!(
        "The rule `{}` holds {} `{}`",
        rule.name,
        if joint == "or" { "also where" } else { "only where also" },
        condition.text
    ))
}

/// Removes a node whose output has the type of its input.
fn remove_filter(page: &PromptView, draft: &mut Draft, stream: &mut Stream) -> Option<String> {
    let graph = &page.program.operator_graph;
    let removable = |node: &Node| {
        let count = graph.values().filter(|other| other.slot == node.slot).count();
        page.contract.operators.get(&node.slot).is_some_and(|slot| count > slot.nodes[0])
            && page
                .kind(&node.slot, &node.kind)
                .is_some_and(|kind| kind.inputs.len() == 1 && kind.inputs[0] == kind.output)
    };
    let (name, node) = drawn(graph.iter().filter(|(_, node)| removable(node)).collect(), stream)?;
    let named_by_rule = page.program.scenario_conditioned_policy.iter().any(|rule| rule.operators.contains_key(name));
    if named_by_rule {
        return None;
    }
    let source = node.inputs.first()?;
    for (consumer, other) in graph {
        for (at, _) in other.inputs.iter().enumerate().filter(|(_, input)| *input == name) {
            draft
                .operations
                .push(edit::replace(format!("/operator_graph/{consumer}/inputs/{at}"), source.as_str().into()));
        }
    }
    draft.operations.push(edit::remove(format!("/operator_graph/{name}")));
    Some(format!("Without `{}` more candidates stay in play", node.kind))
}

fn remove_rule(page: &PromptView, draft: &mut Draft, stream: &mut Stream) -> Option<String> {
    let (index, rule) = drawn(page.program.scenario_conditioned_policy.iter().enumerate().collect(), stream)?;
    draft.operations.push(edit::remove(format!("/scenario_conditioned_policy/{index}")));
    Some(format!("Without the rule `{}` all scenes are treated alike", rule.name))
}

/// Removes an optional mechanism from a setting, and its module if nothing else refers to it.
fn remove_optional(page: &PromptView, draft: &mut Draft, stream: &mut Stream) -> Option<String> {
    let set = places(page).into_iter().filter(|p| p.domain.slot.is_some() && !p.domain.required && p.value.is_some());
    let place = drawn(set.collect(), stream)?;
    let name = place.value?["mechanism"].as_str()?;
    draft.operations.push(edit::remove(place.path()));
    let text = page.parts.to_string();
    if text.matches(&json!({"mechanism": name}).to_string()).count() == 1 {
        draft.operations.push(edit::remove(format!("/mechanism_modules/{name}")));
    }
    Some(format!("Without `{name}` the {} step falls back to its own rule", place.operator.slot))
}

/// Chooses another word for a setting or a parameter with several options.
fn flip_choice(page: &PromptView, draft: &mut Draft, stream: &mut Stream) -> Option<String> {
    let settings =
        places(page).into_iter().filter(|p| p.domain.kind == "choice" && p.value.is_some_and(Value::is_string));
    let mut choices: Vec<(String, &Domain, &Value)> =
        settings.filter_map(|p| Some((p.path(), p.domain, p.value?))).collect();
    let parameters = page.contract.parameters.iter().filter(|(_, domain)| domain.kind == "choice");
    choices.extend(
        parameters
            .filter_map(|(n, domain)| Some((format!("/parameters/{n}"), domain, page.program.parameters.get(n)?))),
    );
    let (path, domain, now) = drawn(choices, stream)?;
    let others: Vec<&String> = domain.options.iter().filter(|option| now.as_str() != Some(option)).collect();
    let word = stream.pick(&others)?;
    draft.operations.push(edit::replace(path.clone(), word.as_str().into()));
    Some(format!("`{word}` at {path} changes how the step decides"))
}

/// Makes a setting follow a parameter, or stop following it.
fn retarget_setting(page: &PromptView, draft: &mut Draft, stream: &mut Stream) -> Option<String> {
    let place =
        drawn(places(page).into_iter().filter(|p| p.domain.is_numeric() && p.value.is_some()).collect(), stream)?;
    let now = place.value?;
    let akin = wiring::akin_parameter(page, place.setting, place.domain).map(|name| json!({"parameter": name}));
    let value = match akin.filter(|value| value != now) {
        Some(reference) if stream.chance(0.5) => reference,
        _ => wiring::literal(place.domain, stream)?,
    };
    draft.operations.push(edit::replace(place.path(), value.clone()));
    Some(format!("`{}` of `{}` becomes {value}", place.setting, place.node))
}

/// Moves one to three parameters inside their ranges.
fn move_parameters(page: &PromptView, draft: &mut Draft, stream: &mut Stream) -> Option<String> {
    let mut names: Vec<&String> = page.contract.parameters.keys().filter(|name| is_used(page, name)).collect();
    stream.shuffle(&mut names);
    let mut said = vec![];
    for name in names.into_iter().take(1 + stream.below(3)) {
        if let Some(value) = moved(page, name, 0.2, stream) {
            draft.operations.push(edit::replace(format!("/parameters/{name}"), value.clone()));
            said.push(format!("`{name}` to {value}"));
        }
    }
    (!said.is_empty()).then(|| format!("Moving {} shifts the balance of pressure and plausibility", said.join(" and ")))
}

/// Scales one number of an expression.
fn retune_constant(page: &PromptView, draft: &mut Draft, stream: &mut Stream) -> Option<String> {
    let (name, module) = drawn(page.program.mechanism_modules.iter().collect(), stream)?;
    let spans = numbers_in(&module.expression);
    let (start, end) = *stream.pick(&spans)?;
    let old: f64 = module.expression.get(start..end)?.parse().ok()?;
    let new = num::rounded(old * stream.uniform(0.5, 1.8), 3);
    let expression = format!("{}{new}{}", module.expression.get(..start)?, module.expression.get(end..)?);
    if new == old || new <= 0.0 {
        return None;
    }
    let path = format!("/mechanism_modules/{name}/expression");
    draft.operations.push(edit::replace(path, expression.into()));
    Some(format!("{new} in place of {old} in `{name}` changes how quickly its effect fades"))
}

/// Byte ranges of plain decimal numbers that stand alone.
fn numbers_in(text: &str) -> Vec<(usize, usize)> {
    let mut spans = vec![];
    let mut start = 0;
    for piece in text.split_inclusive(|c: char| !(c.is_ascii_alphanumeric() || c == '_' || c == '.')) {
        let body = piece.trim_end_matches(|c: char| !(c.is_ascii_alphanumeric() || c == '_' || c == '.'));
        if body.starts_with(|c: char| c.is_ascii_digit()) && body.bytes().all(|b| b.is_ascii_digit() || b == b'.') {
            spans.push((start, start + body.len()));
        }
        start += piece.len();
    }
    spans
}

/// Returns `true` if anything in the program follows the parameter.
fn is_used(page: &PromptView, name: &str) -> bool {
    let reference = json!({"parameter": name});
    let graph = page.program.operator_graph.values().flat_map(|node| node.settings.values());
    let read = page.program.mechanism_modules.values().any(|module| module.inputs.iter().any(|input| input == name));
    let choice = page.contract.parameters.get(name).is_some_and(|domain| domain.kind == "choice");
    read || choice || graph.into_iter().any(|value| *value == reference)
}

/// Another value of a parameter: a step of at most `share` of its range, or another word.
fn moved(page: &PromptView, name: &str, share: f64, stream: &mut Stream) -> Option<Value> {
    let (domain, now) = (page.contract.parameters.get(name)?, page.program.parameters.get(name)?);
    if domain.kind == "choice" {
        let others: Vec<&String> = domain.options.iter().filter(|option| now.as_str() != Some(option)).collect();
        return stream.pick(&others).map(|option| option.as_str().into());
    }
    let (x, [low, high]) = (now.as_f64()?, domain.range?);
    let step = (high - low) * stream.uniform(0.05, share) * if stream.chance(0.5) { 1.0 } else { -1.0 };
    let step = if domain.kind == "integer" && step.abs() < 1.0 { step.signum() } else { step };
    let target = if (low..=high).contains(&(x + step)) { x + step } else { x - step };
    let value = wiring::number(&domain.kind, target.clamp(low, high), low, high);
    (value.as_f64() != Some(x)).then_some(value)
}

fn quoted(names: &[&String]) -> String {
    names.iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(" and ")
}

/// A guard for a patch that lacks one: a filter, or a guard in an optional place. Operations to append; used by the repair.
pub fn guard(page: &PromptView, program: &super::reader::Program, stream: &mut Stream) -> Option<Draft> {
    let mut draft = Draft::default();
    wiring::insert_filter(page, program, &mut draft, stream)?;
    Some(draft)
}
