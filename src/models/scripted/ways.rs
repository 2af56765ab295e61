//! Edits of the graph's shape: a law before the choice, a second way for scenes in which the first does not serve.

use serde_json::json;

use super::{
    contract::Kind,
    edit,
    reader::{Node, PromptView},
    wiring::{self, Draft},
};
use crate::kernel::Stream;

/// The only node of a slot.
fn only<'p>(page: &'p PromptView, slot: &str) -> Option<(&'p String, &'p Node)> {
    let mut nodes = page.program.operator_graph.iter().filter(|(_, node)| node.slot == slot);
    nodes.next().filter(|_| nodes.next().is_none())
}

/// Feeds whoever a node feeds from another one.
fn redirect(page: &PromptView, from: &str, to: &str, draft: &mut Draft) {
    for (consumer, node) in &page.program.operator_graph {
        for (at, _) in node.inputs.iter().enumerate().filter(|(_, input)| *input == from) {
            draft.operations.push(edit::replace(format!("/operator_graph/{consumer}/inputs/{at}"), to.into()));
        }
    }
}

/// Lets adversaries obey a law, where the contract offers one and the program has none.
pub fn obey(page: &PromptView, draft: &mut Draft, stream: &mut Stream) -> Option<String> {
    let graph = &page.program.operator_graph;
    let (kind, spec) = page.contract.operators.get("law")?.kinds.iter().next()?;
    if graph.values().any(|node| node.slot == "law") || graph.len() >= page.contract.limits.nodes {
        return None;
    }
    let (choice, node) = only(page, "diversity")?;
    let source = node.inputs.first()?;
    let settings = wiring::settings(page, &page.program, spec, None, draft, stream)?;
    let name = draft.fresh("law", graph.keys());
    let value = json!({"slot": "law", "kind": kind, "settings": settings, "inputs": [source]});
    draft.operations.push(edit::add(format!("/operator_graph/{name}"), value));
    draft.operations.push(edit::replace(format!("/operator_graph/{choice}/inputs/0"), name.into()));
    Some(format!("The adversary answers the ego by {} instead of following a fixed motion", draft.tags.join(" and ")))
}

/// A second motion and search, with one number of the motion elsewhere, for scenes in which the first way does not serve.
pub fn fall_back(page: &PromptView, draft: &mut Draft, stream: &mut Stream) -> Option<String> {
    let graph = &page.program.operator_graph;
    let (motion_name, motion) = only(page, "motion")?;
    let (search_name, search) = only(page, "search")?;
    if search.inputs != [motion_name.clone()] || graph.len() + 3 > page.contract.limits.nodes {
        return None;
    }
    let kind = page.kind(&motion.slot, &motion.kind)?;
    let numbers: Vec<_> = kind.settings.iter().filter(|(_, domain)| domain.range.is_some()).collect();
    let (setting, domain) = *stream.pick(&numbers)?;
    let meets = |spec: &&Kind| spec.inputs.len() == 2 && spec.inputs.iter().all(|input| *input == spec.output);
    let meetings: Vec<_> =
        page.contract.operators.get("filter")?.kinds.iter().filter(|(_, spec)| meets(spec)).collect();
    let (meeting, spec) = *stream.pick(&meetings)?;
    let settings = wiring::settings(page, &page.program, spec, None, draft, stream)?;
    let mut other = motion.settings.clone();
    other.insert(setting.clone(), wiring::literal(domain, stream)?);
    let [motion_2, search_2, met] =
        ["other_motion", "other_search", meeting].map(|base| draft.fresh(base, graph.keys()));
    let node = |of: &Node, settings, inputs: [&String; 1]| json!({"slot": of.slot, "kind": of.kind, "settings": settings, "inputs": inputs});
    let from = motion.inputs.first()?;
    draft.operations.push(edit::add(format!("/operator_graph/{motion_2}"), node(motion, &other, [from])));
    draft
        .operations
        .push(edit::add(format!("/operator_graph/{search_2}"), node(search, &search.settings, [&motion_2])));
    let value = json!({"slot": "filter", "kind": meeting, "settings": settings, "inputs": [search_name, search_2]});
    draft.operations.push(edit::add(format!("/operator_graph/{met}"), value));
    redirect(page, search_name, &met, draft);
    Some(format!("`{meeting}` gives scenes in which `{search_name}` does not serve a motion with another `{setting}`"))
}
