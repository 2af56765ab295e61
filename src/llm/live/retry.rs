//! When to ask again, and how long to wait: bounded, and as the server says if it says so.

use serde_json::Value;
use std::time::Duration;

use super::http::{Answer, Lost};
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

    /// After an answer that is not 200.
    pub fn after_status(&mut self, answer: &Answer) -> Step {
        let (code, message) = code_and_message(&answer.body);
        let reason = format!("HTTP {}: {message}", answer.status);
        // An account without money also gets 429, and asking again does not help.
        let passing = matches!(answer.status, 408 | 429 | 500..=599) && code.as_deref() != Some("insufficient_quota");
        if passing { self.again(reason, answer.retry_after) } else { Step::Stop(Stop::Refused { reason }) }
    }

    /// After no answer.
    pub fn after_loss(&mut self, lost: Lost) -> Step {
        match lost {
            Lost::Unsent(reason) | Lost::Midway(reason) => self.again(reason, None),
            Lost::Unusable(reason) => Step::Stop(Stop::Malformed { reason }),
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

/// Code and message of an error's body: OpenAI, Anthropic and llama.cpp say `{"error": {..}}`, others something else.
fn code_and_message(body: &[u8]) -> (Option<String>, String) {
    let value: Value = serde_json::from_slice(body).unwrap_or(Value::Null);
    let error = value.get("error").unwrap_or(&value);
    let text = |field: &str| error.get(field).and_then(Value::as_str).map(str::to_string);
    let message = text("message").or_else(|| error.as_str().map(str::to_string));
    (text("code").or_else(|| text("type")), message.unwrap_or_else(|| String::from_utf8_lossy(body).into_owned()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::llm::IncompleteReplies;

    fn schedule(attempts_max: u32, wait_s_max: u64) -> Schedule {
        Schedule::new(&ClientOptions {
            base_url: "http://localhost".into(),
            api_key_env: None,
            timeout_s: 1,
            attempts_max,
            wait_s_max,
            incomplete_replies: IncompleteReplies::Stop,
            input_usd_per_million: 0.0,
            output_usd_per_million: 0.0,
        })
    }

    fn answer(status: u16, retry_after_s: Option<u64>, body: &str) -> Answer {
        Answer { status, retry_after: retry_after_s.map(Duration::from_secs), body: body.into() }
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
        assert!(matches!(schedule.after_status(&answer(429, Some(7), "")), Step::Again(w) if w.as_secs() == 7));
        assert!(matches!(schedule.after_status(&answer(503, None, "")), Step::Again(w) if w.as_secs() == 2));
        let Step::Stop(Stop::Transport { attempts: 3, reason }) = schedule.after_status(&answer(429, Some(61), "slow"))
        else {
            panic!("expected the end")
        };
        assert_eq!(reason, "HTTP 429: slow; it asks to wait 61 s, wait_s_max is 60");
    }

    #[test]
    fn what_asking_again_cannot_change_is_not_asked_again() {
        for (status, body) in [
            (400, "{}"),
            (401, "{}"),
            (404, "{\"detail\":\"Not Found\"}"),
            (307, ""),
            (429, "{\"error\":{\"code\":\"insufficient_quota\",\"message\":\"no credit\"}}"),
        ] {
            let step = schedule(5, 60).after_status(&answer(status, None, body));
            assert!(matches!(step, Step::Stop(Stop::Refused { .. })), "{status}");
        }
    }

    #[test]
    fn error_messages_are_found_in_each_shape() {
        assert_eq!(code_and_message(b"{\"error\":{\"code\":400,\"message\":\"too long\"}}").1, "too long");
        assert_eq!(
            code_and_message(
                b"{\"type\":\"error\",\"error\":{\"type\":\"overloaded_error\",\"message\":\"Overloaded\"}}"
            )
            .1,
            "Overloaded"
        );
        assert_eq!(code_and_message(b"{\"error\":\"model not found\"}").1, "model not found");
        assert_eq!(code_and_message(b"Bad Gateway").1, "Bad Gateway");
    }
}
