//! Random legal patches: a search that knows the contract and nothing else. A baseline.

use serde_json::{Value, json};
use std::collections::BTreeMap;

use crate::adapters::{Contract, Domain, OperatorSpec};
use crate::kernel::{Digest, Stream, num};
use crate::objects::{
    FREE_SIGN, FreeConstant, Operation, OperationKind, OperatorNode, ParameterValue, Program, ProgramPatch, Setting,
    ValueType, pointer::within,
};

/// Decimals of a drawn number.
const DECIMALS: u32 = 4;
/// Tries to draw a value that differs from the present one.
const TRIES: usize = 8;

/// Places that a random patch may edit, and the values that it may put there.
#[derive(Clone, Copy, Debug)]
pub struct Places<'a> {
    /// I_b of the family.
    pub contract: &'a Contract,
    /// Values that a scene feature has somewhere: thresholds are drawn from them.
    pub values: &'a BTreeMap<&'static str, Vec<f64>>,
    /// Parts of a program that are closed in this run.
    pub closed: &'a [&'static str],
    /// True if numbers alone are edited. The patch then leaves them free, with the drawn value as the start.
    pub numbers: bool,
}

/// Draws a patch of 1 to `edits_max` edits at different places, all equally likely: a parameter's value, a literal setting of a node, a
/// node's kind (of the same types, where no module is needed), a new rule with a condition over one scene feature.
pub fn random_patch(
    parent: &Program,
    hash: Digest,
    places: &Places<'_>,
    edits_max: usize,
    stream: &mut Stream,
) -> ProgramPatch {
    let mut edits = edits(parent, places);
    edits.retain(|edit| !places.numbers || is_number(parent, places.contract, edit));
    let wanted = 1 + stream.below(edits_max.max(1));
    let mut operations = Vec::new();
    while operations.len() < wanted && !edits.is_empty() {
        let edit = edits.swap_remove(stream.below(edits.len()));
        // A node whose kind changes has no other edit: its settings are new.
        if let Some(operation) = operation(parent, places, &edit, stream).filter(|new| apart(new, &operations)) {
            operations.push(operation);
        }
    }
    let free = if places.numbers { leave_free(&mut operations) } else { BTreeMap::new() };
    ProgramPatch {
        source_baseline: parent.source_family.clone(),
        parent_solution_id: parent.solution_id.clone(),
        parent_program_hash: hash.to_hex(),
        operations,
        hypothesis: "none: a random legal edit".into(),
        memory_refs_used: Vec::new(),
        cluster_refs_used: Vec::new(),
        repair_summary: None,
        free,
    }
}

/// Puts free constants in the place of numbers that are a whole value.
fn leave_free(operations: &mut [Operation]) -> BTreeMap<String, FreeConstant> {
    let mut free = BTreeMap::new();
    for value in operations.iter_mut().filter_map(|operation| operation.value.as_mut()) {
        if let Some(start) = value.as_f64() {
            let name = format!("n{}", free.len());
            *value = json!(format!("{FREE_SIGN}{name}"));
            free.insert(name, FreeConstant { start, low: None, high: None });
        }
    }
    free
}

/// Returns `true` if an edit puts one number in the place of another.
fn is_number(parent: &Program, contract: &Contract, edit: &Edit<'_>) -> bool {
    match edit {
        Edit::Parameter(name) => {
            let domain = contract.parameters.get(*name).map(|parameter| &parameter.domain);
            matches!(domain, Some(Domain::Number { .. } | Domain::Integer { .. }))
        }
        Edit::Setting(node, setting) => matches!(parent.operator_graph[*node].settings[*setting], Setting::Number(_)),
        Edit::Kind(..) | Edit::Rule => false,
    }
}

/// A place that can be edited.
enum Edit<'a> {
    Parameter(&'a str),
    Setting(&'a str, &'a str),
    Kind(&'a str, &'a OperatorSpec),
    Rule,
}

fn edits<'a>(parent: &'a Program, places: &Places<'a>) -> Vec<Edit<'a>> {
    let Places { contract, closed, .. } = *places;
    let mut edits: Vec<Edit<'a>> = parent.parameters.keys().map(|name| Edit::Parameter(name)).collect();
    for (name, node) in &parent.operator_graph {
        let kinds = contract.operators.get(&node.slot).map(Vec::as_slice).unwrap_or_default();
        let Some(own) = kinds.iter().find(|spec| spec.kind == node.kind) else { continue };
        let literal = |setting: &&String| matches!(node.settings[*setting], Setting::Number(_) | Setting::Choice(_));
        edits.extend(node.settings.keys().filter(literal).map(|setting| Edit::Setting(name, setting)));
        let alike = |spec: &&OperatorSpec| {
            let needs_module = |domain: &Domain| matches!(domain, Domain::Mechanism { .. });
            let plain = !spec.settings.values().any(|setting| setting.required && needs_module(&setting.domain));
            spec.kind != own.kind && spec.inputs == own.inputs && spec.output == own.output && plain
        };
        edits.extend(kinds.iter().filter(alike).map(|spec| Edit::Kind(name, spec)));
    }
    let rules = parent.scenario_conditioned_policy.len();
    if rules < contract.limits.rules && !closed.contains(&"/scenario_conditioned_policy") {
        // As often as a feature: one place among hundreds would never be drawn.
        edits.extend(contract.scene_features.iter().map(|_| Edit::Rule));
    }
    edits
}

fn operation(parent: &Program, places: &Places<'_>, edit: &Edit<'_>, stream: &mut Stream) -> Option<Operation> {
    let contract = places.contract;
    let replace = |path: String, value: Value| Operation { op: OperationKind::Replace, path, value: Some(value) };
    match edit {
        Edit::Parameter(name) => {
            let now = json!(parent.parameters[*name]);
            let value = another(&contract.parameters.get(*name)?.domain, &now, stream)?;
            Some(replace(within("/parameters", name), value))
        }
        Edit::Setting(node, setting) => {
            let of = &parent.operator_graph[*node];
            let spec = contract.operators.get(&of.slot)?.iter().find(|spec| spec.kind == of.kind)?;
            let value = another(&spec.settings.get(*setting)?.domain, &json!(of.settings[*setting]), stream)?;
            let place = within(&within("/operator_graph", node), "settings");
            Some(replace(within(&place, setting), value))
        }
        Edit::Kind(node, spec) => {
            let OperatorNode { slot, inputs, .. } = &parent.operator_graph[*node];
            let mut settings = serde_json::Map::new();
            for (name, setting) in spec.settings.iter().filter(|(_, setting)| setting.required) {
                settings.insert(name.clone(), drawn(&setting.domain, stream)?);
            }
            let value = json!({"slot": slot, "kind": spec.kind, "settings": settings, "inputs": inputs});
            Some(replace(within("/operator_graph", node), value))
        }
        Edit::Rule => {
            let names: Vec<&String> = parent.parameters.keys().collect();
            let name = *stream.pick(&names)?;
            let value = another(&contract.parameters.get(name)?.domain, &json!(parent.parameters[name]), stream)?;
            let rule = json!({
                "name": format!("random_{}", stream.below(1_000_000)),
                "when": condition(places, stream)?,
                "parameters": {name.as_str(): value},
                "operators": {},
            });
            let path = "/scenario_conditioned_policy/-".to_string();
            Some(Operation { op: OperationKind::Add, path, value: Some(rule) })
        }
    }
}

/// Returns `true` if an edit is neither at the place of another one nor within it. Two rules are apart.
fn apart(new: &Operation, others: &[Operation]) -> bool {
    let inside = |inner: &str, outer: &str| inner == outer || inner.starts_with(&format!("{outer}/"));
    new.op == OperationKind::Add
        || !others.iter().any(|other| inside(&new.path, &other.path) || inside(&other.path, &new.path))
}

/// One scene feature, alone where it is a truth value, or on one side of a value that some scene has.
fn condition(places: &Places<'_>, stream: &mut Stream) -> Option<String> {
    let feature = stream.pick(&places.contract.scene_features)?;
    if feature.value == ValueType::Boolean {
        return Some(if stream.chance(0.5) { feature.name.into() } else { format!("not {}", feature.name) });
    }
    let threshold = num::rounded(*stream.pick(places.values.get(feature.name)?)?, DECIMALS);
    Some(format!("{} {} {threshold}", feature.name, if stream.chance(0.5) { "<=" } else { ">" }))
}

/// Draws a value other than the present one; `None` where the domain seems to have no other.
fn another(domain: &Domain, now: &Value, stream: &mut Stream) -> Option<Value> {
    (0..TRIES).find_map(|_| drawn(domain, stream).filter(|value| value != now))
}

/// Draws a value, all equally likely; `None` where only a module would do.
fn drawn(domain: &Domain, stream: &mut Stream) -> Option<Value> {
    let value = match domain {
        Domain::Number { low, high, .. } => {
            ParameterValue::Number(num::rounded(stream.uniform(*low, *high), DECIMALS).clamp(*low, *high))
        }
        Domain::Integer { low, high, .. } => {
            let count = usize::try_from(high - low + 1).ok()?;
            ParameterValue::Number((*low + stream.below(count.max(1)) as i64) as f64)
        }
        Domain::Choice { options } => ParameterValue::Choice(stream.pick(options)?.clone()),
        Domain::Mechanism { .. } => return None,
    };
    Some(json!(value))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::adapters::{Port, SettingSpec, toy};
    use crate::kernel::Seed;
    use crate::objects::Slot;
    use std::collections::BTreeSet;

    const VALUES: [f64; 3] = [1.0, 2.5, 7.25];

    fn values(contract: &Contract) -> BTreeMap<&'static str, Vec<f64>> {
        contract.scene_features.iter().map(|feature| (feature.name, VALUES.to_vec())).collect()
    }

    fn stream() -> Stream {
        Seed(1).stream(&["test"])
    }

    /// The places of a program's edits as text.
    fn places(program: &Program, contract: &Contract, closed: &[&'static str]) -> Vec<String> {
        let values = values(contract);
        let places = Places { contract, values: &values, closed, numbers: false };
        let text = |edit: Edit<'_>| match edit {
            Edit::Parameter(name) => name.to_string(),
            Edit::Setting(node, setting) => format!("{node}.{setting}"),
            Edit::Kind(node, spec) => format!("{node}={}", spec.kind),
            Edit::Rule => "rule".into(),
        };
        edits(program, &places).into_iter().map(text).collect()
    }

    #[test]
    fn places_are_parameters_literal_settings_other_kinds_of_the_same_types_and_rules() {
        let (mut contract, mut program) = (toy::contract(), toy::program());
        let features = contract.scene_features.len();
        let mut wanted = ["duration_s", "gap_limit_m", "push_count", "style"].map(String::from).to_vec();
        // `marked_actor` has the types of the kind that is there; timing and motion follow parameters.
        let nodes = ["actor=marked_actor", "filter.gap_m_min", "search.combine"].map(String::from);
        let rules = vec!["rule".to_string(); features];
        wanted.extend([nodes.to_vec(), rules.clone()].concat());
        assert_eq!(places(&program, &contract, &[]), wanted);
        // A kind that asks for a module cannot be drawn; nor can one of other types.
        program.operator_graph.get_mut("actor").unwrap().kind = "marked_actor".into();
        assert!(!places(&program, &contract, &[]).contains(&"actor=ranked_actors".into()));
        let other = |inputs: &[Port], output| OperatorSpec {
            kind: "other".into(),
            inputs: inputs.to_vec(),
            output,
            settings: BTreeMap::new(),
            describes: "for this test".into(),
        };
        for (spec, can) in [
            (other(&[Port::Scene], Port::Actors), true),
            (other(&[Port::Actors], Port::Actors), false),
            (other(&[Port::Scene], Port::Window), false),
        ] {
            contract.operators.get_mut(&Slot::Actor).unwrap().push(spec);
            assert_eq!(places(&program, &contract, &[]).contains(&"actor=other".into()), can);
            contract.operators.get_mut(&Slot::Actor).unwrap().pop();
        }
        // A module that may be left out does not prevent the draw.
        let module = SettingSpec {
            domain: Domain::Mechanism { slot: "actor_score".into() },
            required: false,
            describes: "for this test".into(),
        };
        let mut spec = other(&[Port::Scene], Port::Actors);
        spec.settings.insert("score".into(), module);
        contract.operators.get_mut(&Slot::Actor).unwrap().push(spec);
        assert!(places(&program, &contract, &[]).contains(&"actor=other".into()));
    }

    #[test]
    fn a_rule_is_drawn_where_there_is_room_and_the_part_is_open() {
        let (contract, mut program) = (toy::contract(), toy::program());
        let rules = |program: &Program, closed: &[&'static str]| {
            places(program, &contract, closed).iter().filter(|place| *place == "rule").count()
        };
        let features = contract.scene_features.len();
        assert_eq!(
            (rules(&program, &["/mechanism_modules"]), rules(&program, &["/scenario_conditioned_policy"])),
            (features, 0)
        );
        let rule = program.scenario_conditioned_policy[0].clone();
        program.scenario_conditioned_policy = vec![rule.clone(); contract.limits.rules - 1];
        assert_eq!(rules(&program, &[]), features);
        program.scenario_conditioned_policy.push(rule);
        assert_eq!(rules(&program, &[]), 0);
    }

    #[test]
    fn of_numbers_alone_all_are_left_free_within_the_contract() {
        let (contract, program) = (toy::contract(), toy::program());
        let values = values(&contract);
        let places = Places { contract: &contract, values: &values, closed: &[], numbers: true };
        let mut stream = stream();
        let mut seen = BTreeSet::new();
        for _ in 0..40 {
            let patch = random_patch(&program, program.hash().unwrap(), &places, 3, &mut stream);
            assert!(!patch.operations.is_empty() && patch.free.len() == patch.operations.len(), "{patch:?}");
            let ranges = super::super::free_ranges(&program, &patch, &contract).unwrap();
            assert!(ranges.values().all(|range| (range.low..=range.high).contains(&range.start)));
            seen.extend(patch.operations.into_iter().map(|operation| operation.path));
        }
        let expected = ["/operator_graph/filter/settings/gap_m_min", "/parameters/duration_s"];
        assert!(expected.iter().all(|path| seen.contains(*path)), "{seen:?}");
        assert!(!seen.iter().any(|path| path.contains("style") || path.contains("combine")), "words are no numbers");
    }

    #[test]
    fn edits_are_apart_unless_one_stands_at_or_within_the_place_of_another() {
        let at = |op, path: &str| Operation { op, path: path.into(), value: None };
        let replace = |path| at(OperationKind::Replace, path);
        let node = "/operator_graph/filter";
        let setting = "/operator_graph/filter/settings/gap_m_min";
        assert!(apart(&replace(node), &[]));
        for (one, other, wanted) in [
            (node, node, false),
            (node, setting, false),
            (setting, node, false),
            (node, "/operator_graph/filter_two", true),
            (setting, "/operator_graph/filter/settings/gap_m", true),
        ] {
            assert_eq!(
                apart(&replace(one), &[replace("/parameters/style"), replace(other)]),
                wanted,
                "{one} beside {other}"
            );
        }
        let rule = || at(OperationKind::Add, "/scenario_conditioned_policy/-");
        assert!(apart(&rule(), &[rule()]), "two rules are two places");
    }

    #[test]
    fn every_value_of_a_domain_is_drawn_and_none_beside_it() {
        let mut stream = stream();
        let mut all = |domain: Domain| -> Vec<Value> { (0..400).filter_map(|_| drawn(&domain, &mut stream)).collect() };
        let texts = |values: Vec<Value>| values.iter().map(Value::to_string).collect::<BTreeSet<String>>();
        let integer = |low, high| Domain::Integer { low, high, unit: "1".into() };
        assert_eq!(texts(all(integer(2, 5))), ["2.0", "3.0", "4.0", "5.0"].map(String::from).into());
        assert_eq!(texts(all(integer(-1, 0))), ["-1.0", "0.0"].map(String::from).into());
        let numbers = all(Domain::Number { low: 1.0, high: 3.0, unit: "s".into() });
        let numbers: Vec<f64> = numbers.iter().map(|number| number.as_f64().unwrap()).collect();
        let (low, high) = numbers.iter().fold((9.0_f64, 0.0_f64), |(low, high), x| (low.min(*x), high.max(*x)));
        assert!((1.0..1.05).contains(&low) && (2.95..=3.0).contains(&high), "{low} to {high}");
        assert!(numbers.iter().all(|number| num::rounded(*number, DECIMALS) == *number));
        let options = vec!["calm".to_string(), "rough".to_string()];
        assert_eq!(texts(all(Domain::Choice { options })), ["\"calm\"", "\"rough\""].map(String::from).into());
        assert!(all(Domain::Mechanism { slot: "actor_score".into() }).is_empty());
        // The present value is never drawn, and without another one nothing is drawn.
        let mut stream = self::stream();
        let others: Vec<Value> = (0..200).filter_map(|_| another(&integer(0, 9), &json!(4.0), &mut stream)).collect();
        assert!(others.len() == 200 && !others.contains(&json!(4.0)));
        assert_eq!(another(&integer(3, 3), &json!(3.0), &mut stream), None);
    }

    #[test]
    fn a_condition_compares_a_feature_with_a_value_that_some_scene_has() {
        let contract = toy::contract();
        let values = values(&contract);
        let places = Places { contract: &contract, values: &values, closed: &[], numbers: false };
        let mut stream = stream();
        let found: BTreeSet<String> = (0..4000).filter_map(|_| condition(&places, &mut stream)).collect();
        let wanted = contract.scene_features.iter().flat_map(|feature| match feature.value {
            ValueType::Boolean => vec![feature.name.to_string(), format!("not {}", feature.name)],
            ValueType::Number => VALUES
                .iter()
                .flat_map(|value| ["<=", ">"].map(|sign| format!("{} {sign} {value}", feature.name)))
                .collect(),
        });
        assert_eq!(found, wanted.collect());
    }

    #[test]
    fn a_patch_has_one_to_the_most_edits_each_of_them_an_other_value_at_a_place_of_its_own() {
        let (contract, parent) = (toy::contract(), toy::program());
        let values = values(&contract);
        let places = Places { contract: &contract, values: &values, closed: &[], numbers: false };
        let (mut counts, mut kinds) = (BTreeSet::new(), BTreeSet::new());
        let mut stream = stream();
        let whole = serde_json::to_value(&parent).unwrap();
        for _ in 0..600 {
            let patch = random_patch(&parent, parent.hash().unwrap(), &places, 3, &mut stream);
            counts.insert(patch.operations.len());
            for (place, operation) in patch.operations.iter().enumerate() {
                assert!(apart(operation, &patch.operations[..place]), "{:?}", patch.operations);
                kinds.insert(operation.path.clone());
                let now = whole.pointer(&operation.path);
                assert_eq!(now.is_some(), operation.op == OperationKind::Replace, "{operation:?}");
                assert_ne!(now, operation.value.as_ref());
            }
        }
        assert_eq!(counts, BTreeSet::from([1, 2, 3]));
        let nodes = [
            "/operator_graph/actor",
            "/operator_graph/filter/settings/gap_m_min",
            "/operator_graph/search/settings/combine",
        ];
        let parameters = parent.parameters.keys().map(|name| format!("/parameters/{name}"));
        let rule = "/scenario_conditioned_policy/-".to_string();
        assert_eq!(kinds, parameters.chain(nodes.map(String::from)).chain([rule]).collect());
        // Where there are fewer places than wanted edits, all places are taken.
        let mut small = contract.clone();
        small.scene_features.clear();
        let places = Places { contract: &small, ..places };
        let most =
            (0..20).map(|_| random_patch(&parent, parent.hash().unwrap(), &places, 1000, &mut stream).operations.len());
        assert_eq!(most.max(), Some(7));
    }
}
