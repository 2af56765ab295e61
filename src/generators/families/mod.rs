//! The source families: one file or folder each with its contract, its parent program and its signature mechanism.

pub mod adv_bmt;
pub mod adv_traj;
pub mod advsim;
pub mod at;
pub mod cat;
pub mod chatscene;
pub mod grammar;
pub mod human;
pub mod interface;
pub mod king;
pub mod llm_attacker;
pub mod prior;
pub mod profile_search;
mod published;
pub mod sage;
pub mod seal;
pub mod staged;
#[cfg(test)]
mod staged_signatures;
pub mod strive;

use crate::adapters::{Contract, Registry};
use crate::objects::{OperatorNode, Program, Setting, Slot};
use crate::stage::{Source, Sources};

/// Every family that can be evolved, with its code.
pub fn sources() -> Sources {
    Sources::new([
        cat::source(),
        at::source(),
        seal::source(),
        adv_bmt::source(),
        sage::source(),
        llm_attacker::source(),
        king::source(),
        strive::source(),
        human::source(),
        advsim::source(),
        adv_traj::source(),
        chatscene::source(),
    ])
}

/// The same source, whose programs may roll so many candidates of a scene out before they choose, and none of 0.
pub fn rehearsing(mut source: Source, most: u32) -> Source {
    source.contract = without_rehearsal(&source.contract);
    let choices = source.contract.operators.get_mut(&Slot::Diversity);
    if let Some(choices) = choices.filter(|_| most > 0) {
        choices.push(grammar::rehearsed_choice(most.min(grammar::REHEARSALS_MAX)));
        source.contract.mechanism_slots.extend([grammar::rehearsal_slot()]);
    }
    source
}

/// The contract without that choice. By it program files are marked, so that one fits whatever a study offers besides.
pub fn without_rehearsal(contract: &Contract) -> Contract {
    let mut contract = contract.clone();
    contract.operators.values_mut().for_each(|specs| specs.retain(|spec| spec.kind != grammar::REHEARSED_CHOICE));
    contract.mechanism_slots.remove(grammar::REHEARSAL_SLOT);
    contract
}

/// Most candidates of a scene that a program rolls out before it chooses.
pub fn rehearsals_of(program: &Program) -> u32 {
    let choices = program.operator_graph.values().filter(|node| node.kind == grammar::REHEARSED_CHOICE);
    let count = |node: &OperatorNode| match node.settings.get("count") {
        Some(Setting::Number(count)) => *count as u32,
        _ => grammar::REHEARSALS_MAX,
    };
    choices.map(count).max().unwrap_or(0)
}

/// The source families with everything that a program made by hand may use.
pub fn sources_by_hand() -> Sources {
    sources().map(|source| rehearsing(source, grammar::REHEARSALS_MAX))
}

/// Returns what they declare: all that the gates judge patches by.
pub fn registry() -> Registry {
    sources().registry()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::adapters::Domain;
    use crate::compiler::{CompileFailure, Compiled, compile};
    use crate::ego;
    use crate::kernel::Seed;
    use crate::objects::{FamilyName, ParameterValue};
    use crate::scene::Scene;
    use crate::scene::fixture::two_lane_scene;
    use crate::scene::safebench::TrafficFamily;
    use crate::sim;
    use crate::stage::Situation;
    use crate::synth::{SynthOptions, WorldKind, family_scene, pool_member};
    use proptest::prelude::*;
    use std::collections::BTreeSet;
    use std::sync::{Arc, LazyLock};

    /// A scene against the IDM ego, and what a family's parent makes of it.
    pub fn compiled(family: &str, scene: Scene) -> (Situation, Compiled) {
        let family = sources().get(&FamilyName::new(family)).unwrap().clone();
        let situation = Situation::new(Arc::new(scene), &ego::Policy::Idm).unwrap();
        let compiled = built(&family, &family.parent, &situation);
        (situation, compiled)
    }

    /// Generated scenes, kind after kind.
    pub fn worlds(count: usize) -> impl Iterator<Item = Scene> {
        let options = SynthOptions { warm_up_s: 12.0, tracks_per_scene: 20, ..crate::scene::fixture::worlds() };
        (0..count).map(move |index| pool_member(&options, Seed(11), index).unwrap())
    }

    /// Compiles a legal program in a situation.
    pub fn built(family: &Source, program: &Program, situation: &Situation) -> Compiled {
        compile(program, family, situation, Seed(1)).unwrap_or_else(|e| panic!("{e}"))
    }

    fn fits(domain: &Domain, value: &ParameterValue) -> bool {
        match (domain, value) {
            (Domain::Number { low, high, .. }, ParameterValue::Number(x)) => (*low..=*high).contains(x),
            (Domain::Integer { low, high, .. }, ParameterValue::Number(x)) => {
                x.fract() == 0.0 && (*low as f64..=*high as f64).contains(x)
            }
            (Domain::Choice { options }, ParameterValue::Choice(word)) => options.contains(word),
            _ => false,
        }
    }

    /// Every word by which a contract could be recognised.
    fn words(contract: &Contract) -> BTreeSet<String> {
        let kinds = contract.operators.values().flatten();
        let mut words: BTreeSet<String> = kinds.clone().map(|o| o.kind.clone()).collect();
        words.extend(kinds.flat_map(|o| o.settings.keys().cloned()));
        words.extend(contract.parameters.keys().cloned());
        words.extend(contract.mechanism_slots.keys().cloned());
        let read = contract.mechanism_slots.values().flat_map(|slot| &slot.features);
        words.extend(read.map(|feature| feature.name.to_string()));
        words
    }

    fn check_parent(family: &Source) {
        let (contract, parent) = (&family.contract, &family.parent);
        assert!(parent.parameters.keys().eq(contract.parameters.keys()), "a parent sets each parameter once");
        for (name, value) in &parent.parameters {
            assert!(fits(&contract.parameters[name].domain, value), "{name} = {value:?}");
        }
        for (name, node) in &parent.operator_graph {
            let spec = contract.operators[&node.slot].iter().find(|o| o.kind == node.kind).unwrap();
            assert_eq!(spec.inputs.len(), node.inputs.len(), "{name}");
            for (setting, spec) in &spec.settings {
                assert!(!spec.required || node.settings.contains_key(setting), "{name} lacks {setting}");
            }
            for (setting, value) in &node.settings {
                let value = match value {
                    Setting::Parameter(r) => parent.parameters[&r.parameter].clone(),
                    Setting::Choice(word) => ParameterValue::Choice(word.clone()),
                    Setting::Number(number) => ParameterValue::Number(*number),
                    Setting::Mechanism(r) => panic!("a parent has no module {}", r.mechanism),
                };
                assert!(fits(&spec.settings[setting].domain, &value), "{name}.{setting} = {value:?}");
            }
        }
    }

    /// A legal program somewhere in the family's space: numbers and words drawn by shares of their ranges.
    fn drawn(family: &Source, shares: &[f64]) -> Program {
        let mut program = family.parent.clone();
        let mut share = shares.iter().copied().cycle();
        let mut next = || share.next().unwrap_or(0.5);
        for (name, spec) in &family.contract.parameters {
            let value = match &spec.domain {
                Domain::Number { low, high, .. } => low + (high - low) * next(),
                Domain::Integer { low, high, .. } => (*low as f64 + (high - low) as f64 * next()).round(),
                _ => continue,
            };
            program.parameters.insert(name.clone(), ParameterValue::Number(value));
        }
        for node in program.operator_graph.values_mut() {
            let spec = family.contract.operator(node.slot, &node.kind).unwrap();
            for (name, setting) in &mut node.settings {
                if let Domain::Choice { options } = &spec.settings[name].domain {
                    let place = (next() * options.len() as f64) as usize;
                    *setting = Setting::Choice(options[place.min(options.len() - 1)].clone());
                }
            }
        }
        program
    }

    static SITUATIONS: LazyLock<Vec<Situation>> = LazyLock::new(|| {
        let mut scenes: Vec<Scene> = worlds(WorldKind::ALL.len()).collect();
        scenes.push(two_lane_scene());
        // Nothing but the ego and a vehicle that is seen for a second; no lane.
        let mut bare = two_lane_scene();
        bare.road.lanes.clear();
        bare.objects_of_interest.clear();
        bare.tracks.truncate(1);
        bare.tracks[0].samples[10..].fill(None);
        scenes.push(bare);
        scenes.push(family_scene(TrafficFamily::VehiclePassing, 5, Seed(7)));
        scenes.push(family_scene(TrafficFamily::TurningObstacle, 5, Seed(7)));
        let situation = |scene| Situation::new(Arc::new(scene), &ego::Policy::Idm).unwrap();
        scenes.into_iter().map(situation).collect()
    });

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        #[test]
        fn any_legal_program_compiles_on_any_legal_scene_or_names_a_constraint(
            shares in prop::collection::vec(0.0..1.0f64, 13), place in 0..WorldKind::ALL.len() + 4, seed in 0u64..1000,
        ) {
            let situation = &SITUATIONS[place];
            // CAT has its own test beside the compiler; a search by gradient or swarm takes too long for one of this kind.
            let others = [cat::NAME, at::NAME, king::NAME, strive::NAME];
            for family in sources().iter().filter(|of| !others.contains(&of.contract.family.as_str())) {
                let name = &family.contract.family;
                match compile(&drawn(family, &shares), family, situation, Seed(seed)) {
                    Ok(compiled) => {
                        let mut driver = ego::Policy::Idm.driver();
                        let outcome = sim::rollout(&situation.plant, &compiled.intervention, driver.as_mut());
                        prop_assert!(outcome.is_ok(), "{name}: {outcome:?}");
                        prop_assert_eq!(compiled.decision.applies, !compiled.intervention.actions.is_empty());
                    }
                    Err(CompileFailure::Constraint { .. }) => {}
                    Err(other) => prop_assert!(false, "{name}: {other}"),
                }
            }
        }
    }

    #[test]
    fn every_parent_obeys_its_own_contract() {
        sources().iter().for_each(check_parent);
    }

    #[test]
    fn no_family_speaks_another_familys_private_words() {
        for one in sources().iter() {
            for other in sources().iter().filter(|o| o.contract.family != one.contract.family) {
                let theirs = words(&other.contract);
                let shared: Vec<_> = one.contract.private_vocabulary.iter().filter(|w| theirs.contains(*w)).collect();
                assert!(shared.is_empty(), "{} shares {shared:?}", other.contract.family);
            }
        }
    }

    #[test]
    fn private_words_are_words_of_the_contract() {
        for family in sources().iter() {
            let own = words(&family.contract);
            let strange: Vec<_> = family.contract.private_vocabulary.iter().filter(|w| !own.contains(*w)).collect();
            assert!(strange.is_empty(), "{strange:?}");
        }
    }

    #[test]
    fn every_motion_search_and_actor_kind_of_a_contract_has_its_code_and_no_other_has() {
        let shared = ["marked_actor", "ranked_actors", "actor_group"];
        for source in sources().iter() {
            let offered = |slots: &[Slot]| -> BTreeSet<String> {
                let specs = slots.iter().filter_map(|slot| source.contract.operators.get(slot)).flatten();
                specs.map(|spec| spec.kind.clone()).filter(|kind| !shared.contains(&kind.as_str())).collect()
            };
            let coded = |kinds: Vec<&str>| kinds.into_iter().map(String::from).collect::<BTreeSet<String>>();
            let name = &source.contract.family;
            let operators = coded(source.operators.keys().copied().collect());
            assert_eq!(offered(&[Slot::Motion, Slot::Search]), operators, "{name}");
            assert_eq!(offered(&[Slot::Actor]), coded(source.actors.keys().copied().collect()), "{name}");
        }
    }
}
