//! Commands of every family's parent, pinned: the language may grow, published methods stay as they are. And nothing that
//! a parent says is without effect.

use evodrive::adapters::Domain;
use evodrive::compiler::{Prepared, Situation};
use evodrive::ego::Policy;
use evodrive::families::sources;
use evodrive::kernel::{Digest, Seed};
use evodrive::objects::{ParameterValue, Program, Setting};
use evodrive::scene::safebench::TrafficFamily;
use evodrive::sim::Intervention;
use evodrive::stage::Source;
use evodrive::synth::{WorldKind, family_scene};
use std::fmt::Write;
use std::sync::Arc;

use crate::worlds;

/// Returns what a program commands in a scene.
fn commanded(family: &Source, program: &Program, situation: &Situation) -> Intervention {
    let compiled = Prepared::new(program, family).unwrap().compile(situation, Seed(1));
    compiled.map(|compiled| compiled.intervention).unwrap_or_default()
}

/// The digest of what a parent commands in these scenes.
fn digest(family: &Source, situations: &[Situation]) -> Digest {
    let of = |scene: &Situation| serde_json::to_string(&commanded(family, &family.parent, scene)).unwrap();
    Digest::of_bytes(situations.iter().map(of).collect::<Vec<_>>().join("\n").as_bytes())
}

fn staged() -> Vec<Situation> {
    let prepared = |family| Situation::new(Arc::new(family_scene(family, 5, Seed(7))), &Policy::Idm).unwrap();
    TrafficFamily::ALL.into_iter().map(prepared).collect()
}

#[test]
fn every_parent_commands_what_it_did_when_it_was_published() {
    let recorded = worlds::situations(&worlds::options(), 900, WorldKind::ALL.len());
    let staged = staged();
    let mut table = String::new();
    for family in sources().iter() {
        let on_staged = family.contract.backend == "safebench";
        let digest = digest(family, if on_staged { &staged } else { &recorded });
        writeln!(table, "{} {}", family.contract.family, digest.short(16)).unwrap();
    }
    insta::assert_snapshot!(table);
}

/// Other values of a domain.
fn others(domain: &Domain, now: &ParameterValue) -> Vec<ParameterValue> {
    let values: Vec<ParameterValue> = match domain {
        Domain::Number { low, high, .. } => [0.5 * (low + high), *low, *high].map(ParameterValue::Number).to_vec(),
        Domain::Integer { low, high, .. } => {
            [(low + high) / 2, *low, *high].map(|value| ParameterValue::Number(value as f64)).to_vec()
        }
        Domain::Choice { options } => options.iter().cloned().map(ParameterValue::Choice).collect(),
        Domain::Mechanism { .. } => vec![],
    };
    values.into_iter().filter(|value| value != now).collect()
}

/// Programs that differ from the parent in one parameter, or in one setting that follows none, by what was changed.
fn edits(family: &Source) -> Vec<(String, Vec<Program>)> {
    let parent = &family.parent;
    let mut edits = vec![];
    for (name, spec) in &family.contract.parameters {
        let with = |value: ParameterValue| {
            let mut child = parent.clone();
            child.parameters.insert(name.clone(), value);
            child
        };
        edits.push((name.clone(), others(&spec.domain, &parent.parameters[name]).into_iter().map(with).collect()));
    }
    for (node, of) in &parent.operator_graph {
        let settings = &family.contract.operator(of.slot, &of.kind).unwrap().settings;
        for (name, setting) in &of.settings {
            let now = match setting {
                Setting::Number(number) => ParameterValue::Number(*number),
                Setting::Choice(word) => ParameterValue::Choice(word.clone()),
                _ => continue,
            };
            let with = |value: ParameterValue| {
                let mut child = parent.clone();
                let value = match value {
                    ParameterValue::Number(number) => Setting::Number(number),
                    ParameterValue::Choice(word) => Setting::Choice(word),
                };
                child.operator_graph.get_mut(node).unwrap().settings.insert(name.clone(), value);
                child
            };
            let children = others(&settings[name].domain, &now).into_iter().map(with).collect();
            edits.push((format!("{node}.{name}"), children));
        }
    }
    edits
}

/// Parts that change nothing in these scenes: `combine` without a score of the program's own, `otherwise` where a vehicle is marked,
/// what asks for counsel, ranges of templates that are not drawn at these seeds, and weights that the parents' searches outweigh.
const IDLE: [&str; 32] = [
    "adv_bmt search.combine",
    "at actor.otherwise",
    "at search.combine",
    "cat actor.otherwise",
    "cat search.combine",
    "chatscene crossing_act_within_m_low",
    "chatscene crossing_lateral_m_high",
    "chatscene crossing_lateral_m_low",
    "chatscene oncoming_act_within_m_low",
    "chatscene oncoming_lateral_m_high",
    "chatscene oncoming_lateral_m_low",
    "chatscene roadside_lateral_m_high",
    "chatscene roadside_lateral_m_low",
    "chatscene turning_lateral_m_high",
    "chatscene turning_lateral_m_low",
    "human temperature",
    "king implausibility_weight",
    "king search.combine",
    "llm_attacker attacker_count",
    "llm_attacker attacker_lane_change_cost",
    "llm_attacker counsel_weight",
    "llm_attacker actor.combine",
    "llm_attacker search.combine",
    "sage reference_flatten_rank",
    "sage actor.otherwise",
    "sage motion.experts",
    "sage search.combine",
    "seal opponent_flatten_rank",
    "seal actor.otherwise",
    "seal search.combine",
    "strive latent_implausibility_weight",
    "strive search.combine",
];

#[test]
fn every_parameter_and_setting_of_a_parent_but_a_known_few_changes_what_is_commanded_in_some_scene() {
    let recorded = worlds::situations(&worlds::options(), 900, WorldKind::ALL.len());
    let staged = staged();
    let mut idle = vec![];
    for family in sources().iter() {
        let scenes = if family.contract.backend == "safebench" { &staged } else { &recorded };
        let before: Vec<_> = scenes.iter().map(|scene| commanded(family, &family.parent, scene)).collect();
        for (what, children) in edits(family) {
            let differs = |child: &Program| {
                scenes.iter().zip(&before).any(|(scene, before)| commanded(family, child, scene) != *before)
            };
            if !children.iter().any(differs) {
                idle.push(format!("{} {what}", family.contract.family));
            }
        }
    }
    assert_eq!(idle, IDLE);
}
