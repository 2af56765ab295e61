//! Differences of a chosen program from its parent, for somebody who reads no program: a phrase for the first screen, every change in
//! words, its expressions as outlines, and the patches that led there.

use serde_json::{Value, json};
use std::collections::BTreeSet;

use super::super::recorded_run::RecordedRun;
use super::beside::Words;
use crate::objects::expr::{Expr, outline};
use crate::objects::{OperatorNode, Program, Setting, Slot, SolutionId, event::LineageResult, program_diff};
use crate::text::{counted, in_words};

/// Clauses of a phrase at most: a reader of the first screen wants the gist.
const CLAUSES_MAX: usize = 3;

/// The difference between a lineage's chosen program and its parent; `None` where the parent stays.
pub fn of(run: &RecordedRun, result: &LineageResult, words: &Words) -> Option<Value> {
    let (parent, chosen) = both(run, result)?;
    let known = |step: &&&Program| step.solution_id != parent.solution_id;
    let chain = run.chain(&chosen.solution_id);
    let steps: Vec<Value> = chain.iter().filter(known).map(|step| json!(step.solution_id)).collect();
    let modules = chosen.mechanism_modules.iter().filter(|(name, module)| {
        let before = parent.mechanism_modules.get(*name);
        before.is_none_or(|before| before.expression != module.expression)
    });
    let entry = |name: &str, what: &str, text: &str| {
        let explained: Vec<String> = names(text).into_iter().filter(|name| words.meanings.contains_key(name)).collect();
        json!({"name": name, "what": what, "outline": outline(text), "names": explained})
    };
    let hold = words.rules_hold.get(&chosen.solution_id);
    let rules = chosen
        .scenario_conditioned_policy
        .iter()
        .enumerate()
        .filter(|(_, rule)| !parent.scenario_conditioned_policy.contains(rule))
        .map(|(nth, rule)| {
            entry(&rule.name, &rule_holds(hold.and_then(|(of, all)| Some((*of.get(nth)?, *all)))), &rule.when)
        });
    let modules = modules.map(|(name, module)| entry(name, &in_words(&module.slot), &module.expression)).chain(rules);
    Some(json!({
        "says": phrase_with_the_last(parent, chosen),
        "steps": steps,
        "changes": words.changes.get(&chosen.solution_id),
        "flow": words.flows.get(&chosen.solution_id),
        "modules": modules.collect::<Vec<_>>(),
        "diff": program_diff(parent, chosen),
    }))
}

/// Describes where a rule holds, and how often where that was counted.
fn rule_holds(holds: Option<(usize, usize)>) -> String {
    let often = match holds {
        None => String::new(),
        Some((0, _)) => ": never in the held-out scenes, so it changes nothing there".into(),
        Some((holds, all)) if holds == all => {
            format!(": in all {all} held-out scenes, so it tells no scene from another")
        }
        Some((holds, all)) => format!(": in {holds} of {all} held-out scenes"),
    };
    format!("where this rule holds{often}")
}

/// Parent and chosen program, where they differ.
fn both<'r>(run: &'r RecordedRun, result: &LineageResult) -> Option<(&'r Program, &'r Program)> {
    let of = |solution: &SolutionId| run.program(solution);
    let differ = result.parent.solution != result.evolved.solution;
    differ.then(|| Some((of(&result.parent.solution)?, of(&result.evolved.solution)?))).flatten()
}

/// The gist of what a lineage's chosen program does now; `None` where the parent stays.
pub fn gist(run: &RecordedRun, result: &LineageResult) -> Option<String> {
    both(run, result).map(|(parent, chosen)| phrase_with_the_last(parent, chosen))
}

fn names(expression: &str) -> BTreeSet<String> {
    Expr::parse(expression).map(|expr| expr.names()).unwrap_or_default()
}

/// Describes what is new, the most telling part first; counts what goes beyond a few changes.
pub fn phrase(parent: &Program, chosen: &Program) -> String {
    let mut clauses = clauses(parent, chosen);
    let left = clauses.len().saturating_sub(CLAUSES_MAX);
    clauses.truncate(CLAUSES_MAX);
    if left > 0 {
        clauses.push(counted(left, "further change"));
    }
    joined(&clauses)
}

/// The same where one more change has room: the one that is left out might be what does it.
fn phrase_with_the_last(parent: &Program, chosen: &Program) -> String {
    let clauses = clauses(parent, chosen);
    if clauses.len() == CLAUSES_MAX + 1 { joined(&clauses) } else { phrase(parent, chosen) }
}

/// Every change, the most telling first.
fn clauses(parent: &Program, chosen: &Program) -> Vec<String> {
    let of = |program: &Program, slot: Slot| -> Vec<OperatorNode> {
        program.operator_graph.values().filter(|node| node.slot == slot).cloned().collect()
    };
    let mut clauses = Vec::new();
    for slot in TELLING {
        let (was, is) = (of(parent, slot), of(chosen, slot));
        let new: Vec<&OperatorNode> = is
            .iter()
            .filter(|node| !was.iter().any(|old| old.kind == node.kind && old.settings == node.settings))
            .collect();
        let gone = was.len() > is.len();
        clauses.extend(new.iter().map(|node| clause(node, was.iter().find(|old| old.kind == node.kind))));
        if gone && new.is_empty() {
            clauses.push(format!("one {} less", noun(slot)));
        }
    }
    let moved: Vec<&String> = chosen
        .mechanism_modules
        .iter()
        .filter(|(name, module)| {
            parent.mechanism_modules.get(*name).is_some_and(|old| old.expression != module.expression)
        })
        .map(|(name, _)| name)
        .collect();
    clauses.extend(moved.iter().map(|name| format!("another {}", quoted(name))));
    let rules = chosen
        .scenario_conditioned_policy
        .iter()
        .filter(|rule| !parent.scenario_conditioned_policy.contains(rule))
        .count();
    if rules > 0 {
        clauses.push(format!("{} for kinds of scenes", counted(rules, "rule")));
    }
    let set: Vec<String> = chosen
        .parameters
        .iter()
        .filter(|(name, value)| parent.parameters.get(*name) != Some(value))
        .map(|(name, value)| match parent.parameters.get(name) {
            Some(old) => format!("{} {} in place of {}", in_words(name), value.in_words(), old.in_words()),
            None => format!("{} {}", in_words(name), value.in_words()),
        })
        .collect();
    match &set[..] {
        [] => {}
        [one] => clauses.push(one.clone()),
        [first, ..] => clauses.push(format!("{first} and {}", counted(set.len() - 1, "further parameter"))),
    }
    counted_once(clauses)
}

/// Slots of a program, those first that say most of an attack.
const TELLING: [Slot; 8] =
    [Slot::Law, Slot::Actor, Slot::Timing, Slot::Motion, Slot::Search, Slot::Filter, Slot::Select, Slot::Diversity];

fn noun(slot: Slot) -> &'static str {
    match slot {
        Slot::Select => "choice of scenes",
        Slot::Actor => "choice of road users",
        Slot::Timing => "timing",
        Slot::Motion => "motion",
        Slot::Search => "search",
        Slot::Filter => "filter",
        Slot::Law => "law",
        Slot::Diversity => "choice of the candidate",
    }
}

/// A node that is not as it was: `old` is one of its kind that was there before.
fn clause(node: &OperatorNode, old: Option<&OperatorNode>) -> String {
    let new =
        || node.settings.iter().filter(|(name, value)| old.is_none_or(|old| old.settings.get(*name) != Some(value)));
    let modules: Vec<String> = new()
        .filter_map(|(_, setting)| match setting {
            Setting::Mechanism(of) => Some(quoted(&of.mechanism)),
            _ => None,
        })
        .collect();
    let by = if modules.is_empty() { String::new() } else { format!(" by {}", joined(&modules)) };
    let count = match node.settings.get("count") {
        Some(Setting::Number(count)) if *count >= 1.0 => Some(*count as usize),
        _ => None,
    };
    let chosen = if by.is_empty() { " by rank" } else { &by };
    let (noun, kind) = (noun(node.slot), in_words(&node.kind));
    match (node.slot, count, old) {
        (Slot::Law, ..) => format!("road users that answer the ego as they drive{by}"),
        (Slot::Actor, Some(1), _) => format!("one adversary, chosen{chosen}"),
        (Slot::Actor, Some(count), _) => format!("{count} adversaries, chosen{chosen}"),
        (Slot::Filter, _, None) => match (node.kind.as_str(), node.inputs.len()) {
            ("reshape", _) => format!("candidates driven otherwise{by}"),
            ("first_of", _) => "a second way for where the first does not serve".into(),
            (_, 2..) => format!("two ways, joined by {kind}{by}"),
            _ => format!("a {kind}{by}"),
        },
        (_, _, None) if kind.contains(noun.rsplit(' ').next().unwrap_or(noun)) => format!("a {kind}{by}"),
        (_, _, None) => {
            if by.is_empty() {
                format!("the {noun} by {kind}")
            } else {
                format!("the {noun} by {kind} with {}", joined(&modules))
            }
        }
        (slot, ..) => {
            let value = |(name, setting): (&String, &Setting)| match setting {
                Setting::Number(_) | Setting::Choice(_) => Some(format!("{} {}", in_words(name), setting.in_words())),
                Setting::Parameter(_) => Some(in_words(name)),
                Setting::Mechanism(_) => None,
            };
            let set: Vec<String> = new().filter_map(value).take(2).collect();
            let noun = if slot == Slot::Actor { "road users" } else { noun };
            match (set.is_empty(), by.is_empty()) {
                (true, true) => format!("fewer settings of the {noun}"),
                (true, false) => format!("{noun}{by}"),
                (false, true) => format!("{noun} with {}", joined(&set)),
                (false, false) => format!("{noun}{by}, with {}", joined(&set)),
            }
        }
    }
}

/// The name that a proposer gave to something.
fn quoted(name: &str) -> String {
    format!("“{}”", in_words(name))
}

/// Each clause once, and how often where that is more than once.
fn counted_once(clauses: Vec<String>) -> Vec<String> {
    let mut counts: Vec<(String, usize)> = Vec::new();
    for clause in clauses {
        match counts.iter_mut().find(|(known, _)| *known == clause) {
            Some((_, times)) => *times += 1,
            None => counts.push((clause, 1)),
        }
    }
    let said = |(clause, times): (String, usize)| match times {
        1 => clause,
        2 => format!("{clause} (twice)"),
        _ => format!("{clause} ({times} times)"),
    };
    counts.into_iter().map(said).collect()
}

/// `a, b and c`.
pub fn joined(clauses: &[String]) -> String {
    match clauses {
        [] => String::new(),
        [one] => one.clone(),
        [all @ .., last] => format!("{} and {last}", all.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::from_value;

    fn program(graph: Value, modules: Value, parameters: Value) -> Program {
        from_value(json!({
            "solution_id": "at-idm/parent", "lineage_id": "at-idm", "source_family": "at", "generation": 0,
            "parameters": parameters, "operator_graph": graph, "scenario_conditioned_policy": [],
            "mechanism_modules": modules, "compile_contract": {"backend": "metadrive", "constraints": []},
            "ancestor_chain": [],
        }))
        .unwrap()
    }

    #[test]
    fn a_setting_that_changed_is_named_with_its_value() {
        let actor = |shape: &str| json!({"actor": {"slot": "actor", "kind": "inserted_actor", "settings": {"shape": shape, "gap_m": 3.0}, "inputs": []}});
        let [before, after] = ["vehicle", "cyclist"].map(|shape| program(actor(shape), json!({}), json!({})));
        assert_eq!(phrase(&before, &after), "road users with shape cyclist");
    }

    #[test]
    fn the_phrase_names_the_law_before_numbers_and_says_how_much_it_leaves_out() {
        let actor =
            |kind: &str, settings: Value| json!({"slot": "actor", "kind": kind, "settings": settings, "inputs": []});
        let before =
            program(json!({"actor": actor("marked_actor", json!({}))}), json!({}), json!({"a_m": 1.0, "b_m": 1.0}));
        let law =
            json!({"slot": "law", "kind": "obey_law", "settings": {"offset": {"mechanism": "lean_in"}}, "inputs": []});
        let ranked = actor("ranked_actors", json!({"count": 2.0}));
        let after = program(json!({"actor": ranked, "law": law}), json!({}), json!({"a_m": 2.0, "b_m": 1.0}));
        assert_eq!(
            phrase(&before, &after),
            "road users that answer the ego as they drive by “lean in”, 2 adversaries, chosen by rank and a m 2 in place of 1"
        );
        assert_eq!(phrase(&before, &before), "");
        assert_eq!(phrase_with_the_last(&before, &after), phrase(&before, &after));
        let timed = json!({"slot": "timing", "kind": "conflict_window", "settings": {}, "inputs": []});
        let filter = json!({"slot": "filter", "kind": "guard_filter", "settings": {}, "inputs": []});
        let more = program(
            json!({"actor": actor("ranked_actors", json!({"count": 2.0})), "law": law, "timing": timed, "filter": filter}),
            json!({}),
            json!({"a_m": 2.0, "b_m": 3.0}),
        );
        assert!(phrase(&before, &more).ends_with("and 2 further changes"), "{}", phrase(&before, &more));
        assert_eq!(phrase_with_the_last(&before, &more), phrase(&before, &more));
        let mut fewer = more.clone();
        fewer.operator_graph.remove("filter");
        assert!(phrase(&before, &fewer).ends_with("and 1 further change"), "{}", phrase(&before, &fewer));
        let whole = phrase_with_the_last(&before, &fewer);
        assert!(whole.ends_with("and a m 2 in place of 1 and 1 further parameter"), "the last one is said: {whole}");
    }

    #[test]
    fn a_clause_is_said_once_and_names_of_the_proposer_stand_in_quotes() {
        let search =
            |settings: Value| json!({"slot": "search", "kind": "posterior", "settings": settings, "inputs": []});
        let scored = || search(json!({"score": {"mechanism": "keep_way"}}));
        let reshape = json!({"slot": "filter", "kind": "reshape", "settings": {"speed": {"mechanism": "gain"}}, "inputs": ["one"]});
        let before = program(json!({"one": search(json!({}))}), json!({}), json!({}));
        let after = program(json!({"one": scored(), "two": scored(), "faster": reshape}), json!({}), json!({}));
        assert_eq!(phrase(&before, &after), "search by “keep way” (twice) and candidates driven otherwise by “gain”");
    }

    #[test]
    fn a_rule_says_where_it_holds_and_that_one_that_always_does_tells_nothing_apart() {
        let of = |holds| rule_holds(holds);
        assert_eq!(of(None), "where this rule holds");
        assert_eq!(of(Some((20, 64))), "where this rule holds: in 20 of 64 held-out scenes");
        assert!(of(Some((64, 64))).ends_with(": in all 64 held-out scenes, so it tells no scene from another"));
        assert!(of(Some((0, 64))).contains(": never in the held-out scenes"));
    }
}
