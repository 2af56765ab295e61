//! Processes that are shared: each is started when nobody is idle, is used by one at a time, and is given back. Workers of a
//! simulator and planners are two such crews.

use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};

use super::error::Fault;

/// At most so many `T`, idle or busy.
pub struct Crew<T> {
    most: usize,
    desk: Mutex<Desk<T>>,
    returned: Condvar,
}

struct Desk<T> {
    idle: Vec<T>,
    /// How many there are, idle or busy.
    started: usize,
    /// After a fault nobody is asked any more.
    fault: Option<Fault>,
}

impl<T> Crew<T> {
    /// Nobody is started yet.
    pub fn new(most: usize) -> Crew<T> {
        let desk = Mutex::new(Desk { idle: Vec::new(), started: 0, fault: None });
        Crew { most, desk, returned: Condvar::new() }
    }

    /// One that is idle, or a new one where there may be one more; waits where there may not. One that cannot begin stops
    /// everything: it would fail in every scene.
    ///
    /// # Errors
    /// What stopped the crew.
    pub fn take(&self, start: impl FnOnce() -> Result<T, Fault>) -> Result<T, Fault> {
        let mut desk = self.desk();
        loop {
            if let Some(fault) = &desk.fault {
                return Err(fault.clone());
            }
            if let Some(one) = desk.idle.pop() {
                return Ok(one);
            }
            if desk.started < self.most {
                desk.started += 1;
                drop(desk);
                return start().map_err(|fault| {
                    self.give_back(None);
                    self.stop(fault)
                });
            }
            desk = self.returned.wait(desk).unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// Whoever went wrong is not given back: another one is started in its place.
    pub fn give_back(&self, one: Option<T>) {
        let mut desk = self.desk();
        match one {
            Some(one) => desk.idle.push(one),
            None => desk.started -= 1,
        }
        drop(desk);
        self.returned.notify_one();
    }

    /// The first fault counts for everybody.
    pub fn stop(&self, fault: Fault) -> Fault {
        let first = self.desk().fault.get_or_insert(fault).clone();
        self.returned.notify_all();
        first
    }

    fn desk(&self) -> MutexGuard<'_, Desk<T>> {
        self.desk.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
