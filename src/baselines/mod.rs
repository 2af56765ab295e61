//! The source families: one file each with its contract, its parent program and its signature mechanism.

pub mod at;
pub mod cat;
pub mod grammar;
pub mod kernel;
pub mod king;
pub mod strive;

use self::kernel::Operator;
use crate::adapters::Registry;

/// Every family that can be evolved.
pub fn registry() -> Registry {
    Registry::new([cat::family(), at::family(), king::family(), strive::family()])
}

/// What a motion or search kind does; `None` for kinds of other slots, which the compiler knows itself.
pub fn operator(kind: &str) -> Option<Operator> {
    match kind {
        cat::LANE_GRAPH_PRIOR => Some(cat::motion),
        cat::COLLISION_POSTERIOR => Some(cat::search),
        at::BOUNDED_OFFSETS => Some(at::motion),
        at::PARTICLE_SWARM => Some(at::search),
        at::OFFSET_GRADIENT => Some(at::descend),
        king::STEERED_ACTIONS => Some(king::motion),
        king::KINEMATIC_DESCENT => Some(king::search),
        strive::LATENT_MOTION => Some(strive::motion),
        strive::LATENT_DESCENT => Some(strive::search),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::adapters::{Contract, Domain, Family};
    use crate::objects::{ParameterValue, Setting};
    use std::collections::BTreeSet;

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
        words
    }

    fn check_parent(family: &Family) {
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

    #[test]
    fn every_parent_obeys_its_own_contract() {
        registry().iter().for_each(check_parent);
    }

    #[test]
    fn no_family_speaks_another_familys_private_words() {
        for one in registry().iter() {
            for other in registry().iter().filter(|o| o.contract.family != one.contract.family) {
                let theirs = words(&other.contract);
                let shared: Vec<_> = one.contract.private_vocabulary.iter().filter(|w| theirs.contains(*w)).collect();
                assert!(shared.is_empty(), "{} shares {shared:?}", other.contract.family);
            }
        }
    }

    #[test]
    fn private_words_are_words_of_the_contract() {
        for family in registry().iter() {
            let own = words(&family.contract);
            let strange: Vec<_> = family.contract.private_vocabulary.iter().filter(|w| !own.contains(*w)).collect();
            assert!(strange.is_empty(), "{strange:?}");
        }
    }
}
