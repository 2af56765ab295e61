//! When to ask again, and how long to wait: bounded, and as the server says if it says so.

use std::time::Duration;

use super::heard::Fault;
use super::http::Lost;
use crate::llm::{ClientOptions, ModelError};

/// The first wait; each further one is twice as long, up to `wait_s_max`.
const FIRST_WAIT: Duration = Duration::from_secs(1);

/// The attempts at one request.
pub struct Schedule {
    attempts: u32,
    attempts_max: u32,
    wait: Duration,
    wait_max: Duration,
}

pub enum Step {
    Again(Duration),
    Stop(Stop),
}

/// Why it is not asked again.
pub enum Stop {
    /// Given up.
    Transport { attempts: u32, reason: String },
    /// The server refuses.
    Refused { reason: String },
    /// The answer does not follow the protocol.
    Malformed { reason: String },
}

impl Stop {
    /// The model's error; `shown` makes text of the server fit for messages.
    pub fn error(self, address: &str, shown: impl Fn(&str) -> String) -> ModelError {
        let address = address.to_string();
        match self {
            Stop::Transport { attempts, reason } => ModelError::Transport { address, attempts, reason: shown(&reason) },
            Stop::Refused { reason } => ModelError::Refused { address, reason: shown(&reason) },
            Stop::Malformed { reason } => ModelError::Malformed { address, reason: shown(&reason) },
        }
    }
}

impl Schedule {
    pub fn new(options: &ClientOptions) -> Schedule {
        let wait_max = Duration::from_secs(options.wait_s_max);
        Schedule { attempts: 0, attempts_max: options.attempts_max, wait: FIRST_WAIT.min(wait_max), wait_max }
    }

    /// After a server's fault that may pass, with the wait that it asked for.
    pub fn after_fault(&mut self, fault: Fault, asked_for: Option<Duration>) -> Step {
        self.again(fault.reason, asked_for)
    }

    /// After something that is not the protocol.
    pub fn after_strange(&mut self, fault: Fault, asked_for: Option<Duration>) -> Step {
        match self.again(fault.reason, asked_for) {
            Step::Stop(Stop::Transport { reason, .. }) => Step::Stop(Stop::Malformed { reason }),
            step => step,
        }
    }

    /// After no answer.
    pub fn after_loss(&mut self, lost: Lost) -> Step {
        match lost {
            Lost::Unsent(reason) | Lost::Midway(reason) => self.again(reason, None),
            Lost::Unusable(reason) => self.after_strange(Fault { reason, answered: true }, None),
        }
    }

    fn again(&mut self, reason: String, asked_for: Option<Duration>) -> Step {
        self.attempts += 1;
        let give_up = |attempts, reason| Step::Stop(Stop::Transport { attempts, reason });
        if self.attempts >= self.attempts_max {
            return give_up(self.attempts, reason);
        }
        let backoff = self.wait;
        self.wait = self.wait.saturating_mul(2).min(self.wait_max);
        match asked_for {
            Some(asked) if asked > self.wait_max => {
                let (asked, most) = (asked.as_secs_f64(), self.wait_max.as_secs());
                give_up(self.attempts, format!("{reason}; it asks to wait {asked} s, wait_s_max is {most}"))
            }
            Some(asked) => Step::Again(asked),
            None => Step::Again(backoff),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn schedule(attempts_max: u32, wait_s_max: u64) -> Schedule {
        Schedule::new(&ClientOptions { attempts_max, wait_s_max, ..ClientOptions::at("http://localhost") })
    }

    fn fault(reason: &str) -> Fault {
        Fault { reason: reason.into(), answered: false }
    }

    #[test]
    fn waits_double_up_to_their_limit_and_attempts_end() {
        let mut schedule = schedule(6, 5);
        let mut waits = Vec::new();
        let attempts = loop {
            match schedule.after_loss(Lost::Unsent("refused".into())) {
                Step::Again(wait) => waits.push(wait.as_secs()),
                Step::Stop(Stop::Transport { attempts, .. }) => break attempts,
                Step::Stop(_) => panic!("another stop"),
            }
        };
        assert_eq!((waits, attempts), (vec![1, 2, 4, 5, 5], 6));
    }

    #[test]
    fn the_servers_own_wait_is_kept_and_too_long_a_one_is_the_end() {
        let mut schedule = schedule(5, 60);
        let seconds = |s| Some(Duration::from_secs(s));
        assert!(matches!(schedule.after_fault(fault(""), seconds(7)), Step::Again(w) if w.as_secs() == 7));
        assert!(matches!(schedule.after_strange(fault(""), None), Step::Again(w) if w.as_secs() == 2));
        let Step::Stop(Stop::Transport { attempts: 3, reason }) =
            schedule.after_fault(fault("HTTP 429: slow"), seconds(61))
        else {
            panic!("expected the end")
        };
        assert_eq!(reason, "HTTP 429: slow; it asks to wait 61 s, wait_s_max is 60");
    }

    #[test]
    fn what_is_not_the_protocol_is_asked_again_and_told_as_such_in_the_end() {
        let mut schedule = schedule(2, 60);
        assert!(matches!(schedule.after_strange(fault("a page"), None), Step::Again(_)));
        let last = schedule.after_strange(fault("a page"), None);
        assert!(matches!(last, Step::Stop(Stop::Malformed { reason }) if reason == "a page"));
    }
}
