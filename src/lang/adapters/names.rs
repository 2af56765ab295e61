//! Names of a contract for the outside: its digest, and every name that a program of the family may use.

use std::collections::BTreeSet;

use super::contract::Contract;
use crate::kernel::{Digest, canon::CanonError};

impl Contract {
    /// Digest of everything that the contract says.
    ///
    /// # Errors
    /// A bound that is no finite number.
    pub fn digest(&self) -> Result<Digest, CanonError> {
        Digest::of("evodrive/contract/1", self)
    }

    /// Every name that a program may use, behind the word for what it names: `parameter duration_s`, `operator
    /// motion/offsets`, `setting motion/offsets/count`, `mechanism slot guard`, `feature gap_m`.
    pub fn names(&self) -> BTreeSet<String> {
        let mut names: BTreeSet<String> = self.parameters.keys().map(|name| format!("parameter {name}")).collect();
        for (slot, specs) in &self.operators {
            for spec in specs {
                let place = format!("{}/{}", slot.name(), spec.kind);
                names.extend(spec.settings.keys().map(|setting| format!("setting {place}/{setting}")));
                names.insert(format!("operator {place}"));
            }
        }
        names.extend(self.mechanism_slots.keys().map(|name| format!("mechanism slot {name}")));
        let read = self.mechanism_slots.values().flat_map(|slot| &slot.features).chain(&self.scene_features);
        names.extend(read.map(|feature| format!("feature {}", feature.name)));
        names
    }
}

#[cfg(test)]
mod tests {
    use super::super::toy;
    use crate::objects::Slot;

    #[test]
    fn the_names_are_those_that_a_program_may_use() {
        let contract = toy::contract();
        let names = contract.names();
        let kinds = contract.operators.values().map(Vec::len).sum::<usize>();
        assert_eq!(names.iter().filter(|name| name.starts_with("operator ")).count(), kinds);
        assert_eq!(names.iter().filter(|name| name.starts_with("parameter ")).count(), contract.parameters.len());
        let kind = &contract.operators[&Slot::Motion][0].kind;
        assert!(names.contains(&format!("operator motion/{kind}")), "{names:?}");
    }

    #[test]
    fn a_bound_that_moves_changes_the_digest_and_no_name() {
        let contract = toy::contract();
        let mut moved = contract.clone();
        moved.limits.nodes += 1;
        assert_ne!(contract.digest().unwrap(), moved.digest().unwrap());
        assert_eq!(contract.names(), moved.names());
    }
}
