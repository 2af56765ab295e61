//! Processes that are shared: each is started when nobody is idle, is used by one at a time, and is given back. Workers of a
//! simulator and planners are two such crews.

use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};

use super::error::Fault;

/// At most so many `T`, idle or busy.
pub struct Crew<T> {
    most: usize,
    state: Mutex<State<T>>,
    returned: Condvar,
}

struct State<T> {
    idle: Vec<T>,
    /// How many there are, idle or busy.
    started: usize,
    /// After a fault nobody is asked any more.
    fault: Option<Fault>,
}

impl<T> Crew<T> {
    /// Nobody is started yet.
    pub fn new(most: usize) -> Crew<T> {
        let state = Mutex::new(State { idle: Vec::new(), started: 0, fault: None });
        Crew { most, state, returned: Condvar::new() }
    }

    /// One that is idle, or a new one where there may be one more; waits where there may not. One that cannot begin stops
    /// everything: it would fail in every scene.
    ///
    /// # Errors
    /// What stopped the crew.
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

    /// Whoever went wrong is not given back: another one is started in its place.
    pub fn give_back(&self, one: Option<T>) {
        let mut state = self.state();
        match one {
            Some(one) => state.idle.push(one),
            None => state.started -= 1,
        }
        drop(state);
        self.returned.notify_one();
    }

    /// The first fault counts for everybody.
    pub fn stop(&self, fault: Fault) -> Fault {
        let first = self.state().fault.get_or_insert(fault).clone();
        self.returned.notify_all();
        first
    }

    fn state(&self) -> MutexGuard<'_, State<T>> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
