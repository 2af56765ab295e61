//! Shared processes: each is started when none is idle, is used by one caller at a time, and is given back. Workers of a
//! simulator and planners are two such crews.

use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};

use super::error::Fault;

/// A pool of at most so many `T`, idle or busy.
pub struct Crew<T> {
    most: usize,
    state: Mutex<State<T>>,
    returned: Condvar,
}

struct State<T> {
    idle: Vec<T>,
    /// Number of processes, idle or busy.
    started: usize,
    /// Once there is a fault, nobody is asked any more.
    fault: Option<Fault>,
}

impl<T> Crew<T> {
    /// Creates a crew in which nobody is started yet.
    pub fn new(most: usize) -> Crew<T> {
        let state = Mutex::new(State { idle: Vec::new(), started: 0, fault: None });
        Crew { most, state, returned: Condvar::new() }
    }

    /// Returns an idle one, or starts a new one if the limit allows, and otherwise waits for one. One that cannot start stops
    /// the whole crew: it would fail in every scene.
    ///
    /// # Errors
    /// The fault that stopped the crew.
    pub fn take(&self, start: impl FnOnce() -> Result<T, Fault>) -> Result<T, Fault> {
        let mut state = self.state();
        loop {
            if let Some(fault) = &state.fault {
                return Err(fault.clone());
            }
            if let Some(one) = state.idle.pop() {
                return Ok(one);
            }
            if state.started < self.most {
                state.started += 1;
                drop(state);
                return start().map_err(|fault| {
                    self.give_back(None);
                    self.stop(fault)
                });
            }
            state = self.returned.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// Takes one back. `None` stands for one that failed: another is started in its place.
    pub fn give_back(&self, one: Option<T>) {
        let mut state = self.state();
        match one {
            Some(one) => state.idle.push(one),
            None => state.started -= 1,
        }
        drop(state);
        self.returned.notify_one();
    }

    /// Stops the crew and returns its first fault, which counts for everybody.
    pub fn stop(&self, fault: Fault) -> Fault {
        let first = self.state().fault.get_or_insert(fault).clone();
        self.returned.notify_all();
        first
    }

    fn state(&self) -> MutexGuard<'_, State<T>> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
