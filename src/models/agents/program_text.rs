//! A program as compact questions show it: a line a module, node and rule, without what the contract or the expression says already.

use std::collections::BTreeMap;

use serde_json::Value;

use crate::objects::ParameterValue;

/// The parts that may be edited, as `shown_parent` leaves them. Parameters that have the value of `first` are left out.
pub fn program_text(parts: &Value, first: &BTreeMap<String, ParameterValue>) -> String {
    let named = |part: &str| {
        let all = parts[part].as_object().into_iter().flatten();
        all.map(|(name, value)| format!("{name}: {}", part_text(value))).collect::<Vec<String>>()
    };
    let rules = parts["scenario_conditioned_policy"].as_array().into_iter().flatten();
    let parameters = parts["parameters"].as_object().into_iter().flatten();
    let other = |(name, value): &(&String, &Value)| match first.get(*name) {
        Some(ParameterValue::Number(number)) => value.as_f64() != Some(*number),
        Some(ParameterValue::Choice(word)) => value.as_str() != Some(word),
        None => true,
    };
    let sections = [
        ("modules", named("mechanism_modules")),
        ("nodes", named("operator_graph")),
        ("rules", rules.enumerate().map(|(place, rule)| format!("{place}: {}", part_text(rule))).collect()),
        ("parameters", parameters.filter(other).map(|(name, value)| format!("{name}: {}", part_text(value))).collect()),
    ];
    let filled = sections.into_iter().filter(|(_, lines)| !lines.is_empty());
    filled.map(|(title, lines)| format!("== {title}\n{}", lines.join("\n"))).collect::<Vec<_>>().join("\n")
}

/// A module, a node, a rule or a value.
///
/// `slot, tags a b: expression`; `slot kind <- input, setting=1, other=[module]`; `name when condition: parameter=1, node.setting=2`.
pub fn part_text(value: &Value) -> String {
    let field = |name: &str| value[name].as_str().unwrap_or_default();
    let list = |name: &str| value[name].as_array().into_iter().flatten().filter_map(Value::as_str).collect::<Vec<_>>();
    if value.get("expression").is_some() {
        let (inputs, tags) = (list("inputs"), list("tags").join(" "));
        let tags = if tags.is_empty() { String::new() } else { format!(", tags {tags}") };
        let order = if inputs.is_sorted() { String::new() } else { format!(", inputs {}", inputs.join(" ")) };
        return format!("{}{tags}{order}: {}", field("slot"), field("expression"));
    }
    if value.get("kind").is_some() {
        let inputs = list("inputs").join(" ");
        let inputs = if inputs.is_empty() { String::new() } else { format!(" <- {inputs}") };
        let settings = settings(&value["settings"], "").map(|setting| format!(", {setting}"));
        return format!("{} {}{inputs}{}", field("slot"), field("kind"), settings.collect::<String>());
    }
    if value.get("when").is_some() {
        let nodes = value["operators"].as_object().into_iter().flatten();
        let nodes = nodes.flat_map(|(node, own)| settings(own, &format!("{node}.")).collect::<Vec<_>>());
        let all: Vec<String> = settings(&value["parameters"], "").chain(nodes).collect();
        return format!("{} when {}: {}", field("name"), field("when"), all.join(", "));
    }
    match (value["mechanism"].as_str(), value["parameter"].as_str(), value) {
        (Some(module), ..) => format!("[{module}]"),
        (_, Some(parameter), _) => format!("parameter {parameter}"),
        (.., Value::String(word)) => word.clone(),
        (.., Value::Number(number)) => number.as_f64().map_or_else(|| number.to_string(), |x| x.to_string()),
        _ => value.to_string(),
    }
}

/// `before` and name, `=`, and the value, for each.
fn settings<'v>(all: &'v Value, before: &str) -> impl Iterator<Item = String> + use<'v> {
    let before = before.to_string();
    let all = all.as_object().into_iter().flatten();
    all.map(move |(name, value)| format!("{before}{name}={}", part_text(value)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn every_sort_of_part_has_its_line_and_a_number_no_needless_digits() {
        let module = json!({"slot": "guard", "inputs": ["a", "b"], "output": "boolean", "expression": "a < b", "tags": ["x", "y"]});
        assert_eq!(part_text(&module), "guard, tags x y: a < b");
        let unsorted =
            json!({"slot": "guard", "inputs": ["b", "a"], "output": "boolean", "expression": "a < b", "tags": []});
        assert_eq!(part_text(&unsorted), "guard, inputs b a: a < b");
        let node = json!({"slot": "filter", "kind": "k", "inputs": ["n", "o"], "settings": {
            "far_m": 3.0, "guard": {"mechanism": "m"}, "other": {"parameter": "p"}, "word": "add"}});
        assert_eq!(part_text(&node), "filter k <- n o, far_m=3, guard=[m], other=parameter p, word=add");
        let rule = json!({"name": "r", "when": "n >= 8", "parameters": {"p": 0.25}, "operators": {"node": {"s": 2}}});
        assert_eq!(part_text(&rule), "r when n >= 8: p=0.25, node.s=2");
    }

    #[test]
    fn a_parameter_stands_where_it_differs_and_an_empty_part_nowhere() {
        let parts = json!({"parameters": {"a": 1.0, "b": 2.5, "c": "mild", "d": "sharp"}, "mechanism_modules": {},
            "operator_graph": {"select": {"slot": "select", "kind": "all", "inputs": [], "settings": {}}},
            "scenario_conditioned_policy": []});
        let first = [("a", ParameterValue::Number(1.0)), ("b", ParameterValue::Number(2.0))];
        let words = [("c", ParameterValue::Choice("mild".into())), ("d", ParameterValue::Choice("mild".into()))];
        let first = first.into_iter().chain(words).map(|(name, value)| (name.to_string(), value)).collect();
        assert_eq!(program_text(&parts, &first), "== nodes\nselect: select all\n== parameters\nb: 2.5\nd: sharp");
    }
}
