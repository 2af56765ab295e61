//! Objectives that the archive takes: finite rates.

use crate::kernel::num;
use crate::objects::Objectives;

/// Objectives that are no rates. Hypervolume of a NaN is not 0 but wrong, so it must not get as far.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error(
    "{objective} is {value}; the archive takes finite rates in [0, 1]: the evaluation must report a failure instead"
)]
pub struct ObjectivesError {
    pub objective: &'static str,
    pub value: f64,
}

/// The same objectives with `-0.0` made `0.0`; refuses what is not finite or outside [0, 1].
pub fn admissible(objectives: Objectives) -> Result<Objectives, ObjectivesError> {
    let rate = |objective, value: f64| match num::stored(value) {
        Some(rate) if (0.0..=1.0).contains(&rate) => Ok(rate),
        _ => Err(ObjectivesError { objective, value }),
    };
    Ok(Objectives { attack: rate("attack", objectives.attack)?, realism: rate("realism", objectives.realism)? })
}
