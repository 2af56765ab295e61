//! What was measured of an actor's goals, kept for the next program that asks for the same ones: programs of a lineage
//! mostly differ in how they weigh goals, not in the goals. Never part of a result: what is not kept is measured again.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// Most sets of goals that a situation keeps; the one that was not asked for longest is forgotten first.
const KEPT_MAX: usize = 4;

/// What says which goals were measured.
pub type GoalsKey = [u64; 6];

/// The numbers of a key, once they are measured.
type Measured = Arc<OnceLock<Arc<[f64]>>>;

/// Measured numbers by key, those asked for last at the back.
#[derive(Debug, Default)]
pub struct MeasuredGoals(Mutex<VecDeque<(GoalsKey, Measured)>>);

impl MeasuredGoals {
    /// The numbers of a key, measured now if they are not kept. Other threads that ask for the same ones wait.
    pub fn of(&self, key: GoalsKey, measure: impl FnOnce() -> Vec<f64>) -> Arc<[f64]> {
        let mut kept = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let known = kept.iter().position(|(of, _)| *of == key).and_then(|place| kept.remove(place));
        if known.is_none() && kept.len() >= KEPT_MAX {
            kept.pop_front();
        }
        let (_, place) = known.unwrap_or_else(|| (key, Measured::default()));
        kept.push_back((key, place.clone()));
        drop(kept);
        place.get_or_init(|| measure().into()).clone()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_measured_is_not_measured_again_until_too_much_is_kept() {
        let kept = MeasuredGoals::default();
        let of = |key: u64, value: f64| kept.of([key; 6], || vec![value])[0];
        assert_eq!((of(0, 1.0), of(0, 2.0)), (1.0, 1.0));
        (1..KEPT_MAX as u64).for_each(|key| assert_eq!(of(key, 3.0), 3.0));
        assert_eq!((of(0, 2.0), of(9, 4.0)), (1.0, 4.0), "asked for again, so another one is forgotten");
        assert_eq!((of(0, 2.0), of(1, 5.0)), (1.0, 5.0));
    }
}
