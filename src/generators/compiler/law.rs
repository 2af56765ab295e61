//! The law slot: what adversaries obey while they observe the ego.

use std::sync::Arc;

use crate::adapters::vocabulary;
use crate::sim::Law;
use crate::stage::{Part, Settings, StageError};

/// Gives every candidate of a recorded vehicle the law; an earlier one is replaced.
pub fn give(kind: &str, settings: &Settings, parts: &mut [Part]) -> Result<(), StageError> {
    if kind != "obey_law" {
        return Err(StageError::Missing(format!("operator {kind}")));
    }
    let observed = vocabulary::LAW.len();
    let optional = |name: &str| settings.optional(name).map(|module| module.formula(observed));
    let law = Arc::new(Law {
        onset: optional("onset"),
        acceleration: settings.module("acceleration")?.formula(observed),
        offset: optional("offset"),
    });
    for candidate in parts.iter_mut().flat_map(|part| &mut part.candidates) {
        candidate.law = Some(law.clone());
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim::Observed;

    #[test]
    fn the_vocabulary_of_laws_is_what_the_simulator_observes_in_its_order() {
        let words: Vec<&str> = vocabulary::LAW.iter().map(|feature| feature.name).collect();
        assert_eq!(words, Observed::ALL.map(Observed::name));
        for (place, observed) in Observed::ALL.into_iter().enumerate() {
            assert_eq!(observed as usize, place);
        }
    }
}
