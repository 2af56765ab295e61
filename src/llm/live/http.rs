//! One POST request: bytes out, status and bounded bytes back. This module does not know models.

use std::time::Duration;

/// An answer longer than this is refused; the longest useful one is a few hundred kilobytes.
pub const RESPONSE_BYTES_MAX: u64 = 4 << 20;

/// A header; its value may hold a key.
pub type Header = (&'static str, String);

/// One address with its headers.
pub struct Http {
    agent: ureq::Agent,
    url: String,
    headers: Vec<Header>,
}

/// An answer with any status.
pub struct Answer {
    pub status: u16,
    /// `Retry-After` in seconds. A date is ignored; the usual waiting time applies then.
    pub retry_after: Option<Duration>,
    pub body: Vec<u8>,
}

/// Why there is no answer.
pub enum Lost {
    /// No connection: the request was not sent.
    Unsent(String),
    /// The connection broke, or the time was up.
    Midway(String),
    /// The fault is one that asking again would not change.
    Unusable(String),
}

impl Lost {
    /// A request that was sent may have been answered, and billed, although the answer was lost.
    pub fn may_be_billed(&self) -> bool {
        !matches!(self, Lost::Unsent(_))
    }
}

impl Http {
    pub fn new(url: &str, headers: Vec<Header>, timeout_s: u64) -> Result<Http, String> {
        url.parse::<ureq::http::Uri>().map_err(|error| format!("base_url is not an address: {error}"))?;
        let here = url.split_once("://").is_some_and(|(_, rest)| super::client::is_loopback(rest));
        let config = ureq::Agent::config_builder()
            .timeout_global(Some(Duration::from_secs(timeout_s)))
            .http_status_as_error(false)
            // No redirects: they would send the key and the prompt to an address that nobody configured.
            .max_redirects(0)
            .max_redirects_will_error(false)
            .user_agent("evodrive")
            // HTTPS_PROXY and its like, as every HTTP program reads them; a proxy cannot change an answer.
            .proxy(if here { None } else { ureq::Proxy::try_from_env() })
            .build();
        Ok(Http { agent: config.new_agent(), url: url.to_string(), headers })
    }

    pub fn post(&self, body: &[u8]) -> Result<Answer, Lost> {
        let mut request = self.agent.post(&self.url).header("content-type", "application/json");
        for (name, value) in &self.headers {
            request = request.header(*name, value);
        }
        let mut response = request.send(body).map_err(lost)?;
        let retry_after = response.headers().get("retry-after").and_then(|value| seconds(value.to_str().ok()?));
        let read = response.body_mut().with_config().limit(RESPONSE_BYTES_MAX).read_to_vec();
        Ok(Answer { status: response.status().as_u16(), retry_after, body: read.map_err(lost)? })
    }
}

fn seconds(text: &str) -> Option<Duration> {
    let seconds: f64 = text.trim().parse().ok()?;
    Duration::try_from_secs_f64(seconds).ok()
}

fn lost(error: ureq::Error) -> Lost {
    use std::io::ErrorKind::{ConnectionRefused, HostUnreachable, NetworkUnreachable};
    match &error {
        ureq::Error::HostNotFound | ureq::Error::ConnectionFailed => Lost::Unsent(error.to_string()),
        ureq::Error::Timeout(ureq::Timeout::Resolve | ureq::Timeout::Connect) => Lost::Unsent(error.to_string()),
        ureq::Error::Io(io) if matches!(io.kind(), ConnectionRefused | HostUnreachable | NetworkUnreachable) => {
            Lost::Unsent(error.to_string())
        }
        ureq::Error::BodyExceedsLimit(_) => Lost::Unusable(format!("more than {RESPONSE_BYTES_MAX} bytes")),
        ureq::Error::Http(_) | ureq::Error::BadUri(_) | ureq::Error::RedirectFailed | ureq::Error::TooManyRedirects => {
            Lost::Unusable(error.to_string())
        }
        _ => Lost::Midway(error.to_string()),
    }
}
