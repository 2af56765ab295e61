//! One POST request: bytes out, status and bounded bytes back. This module does not know models.

use std::time::Duration;

/// An answer longer than this is refused; the longest useful one is a few hundred kilobytes.
pub const RESPONSE_BYTES_MAX: u64 = 4 << 20;

/// A header; its value may hold a key.
pub type Header = (String, String);

/// One address with its headers.
pub struct Http {
    agent: ureq::Agent,
    url: String,
    headers: Vec<Header>,
}

/// An answer with any status.
pub struct Answer {
    pub status: u16,
    /// `Retry-After`, in seconds or as a date, or `retry-after-ms`.
    pub retry_after: Option<Duration>,
    pub content_type: Option<String>,
    /// True if the body has an encoding that was not asked for.
    pub encoded: bool,
    /// Address to which a redirect leads.
    pub location: Option<String>,
    pub body: Vec<u8>,
}

/// Why there is no answer.
pub enum Lost {
    /// No connection: the request was not sent.
    Unsent(String),
    /// The connection broke, or the time was up.
    Midway(String),
    /// The bytes that came are no answer: longer than any, or not HTTP.
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
        let here = url.split_once("://").is_some_and(|(_, rest)| crate::llm::client::is_loopback(rest));
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

    /// `now` is the time since 1970, for a server that names a date and not its own time.
    pub fn post(&self, body: &[u8], now: &dyn Fn() -> Duration) -> Result<Answer, Lost> {
        let mut request = self.agent.post(&self.url).header("content-type", "application/json");
        for (name, value) in &self.headers {
            request = request.header(name, value);
        }
        let mut response = request.send(body).map_err(lost)?;
        let head = |name: &str| Some(response.headers().get(name)?.to_str().ok()?.trim().to_string());
        let exactly = ["retry-after-ms", "x-ms-retry-after-ms"].into_iter().find_map(|name| wait_ms(&head(name)?));
        let retry_after =
            exactly.or_else(|| head("retry-after").and_then(|text| wait(&text, head("date").as_deref(), now)));
        let (content_type, location) = (head("content-type"), head("location"));
        let encoded = head("content-encoding").is_some_and(|encoding| encoding != "identity");
        let read = response.body_mut().with_config().limit(RESPONSE_BYTES_MAX).read_to_vec();
        let status = response.status().as_u16();
        Ok(Answer { status, retry_after, content_type, encoded, location, body: read.map_err(lost)? })
    }
}

/// How long `Retry-After` asks to wait: seconds, or the time from the server's own `Date` to the date that it names. A date that is
/// past asks for no wait.
fn wait(text: &str, date: Option<&str>, now: &dyn Fn() -> Duration) -> Option<Duration> {
    if let Ok(seconds) = text.parse() {
        return Duration::try_from_secs_f64(seconds).ok();
    }
    let since_1970 = |text: &str| {
        let start = httpdate::parse_http_date("Thu, 01 Jan 1970 00:00:00 GMT").ok()?;
        httpdate::parse_http_date(text).ok()?.duration_since(start).ok()
    };
    let now = date.and_then(since_1970).unwrap_or_else(now);
    Some(since_1970(text)?.saturating_sub(now))
}

/// How long `retry-after-ms` asks to wait: milliseconds, more exactly than the `Retry-After` beside it.
fn wait_ms(text: &str) -> Option<Duration> {
    Duration::try_from_secs_f64(text.parse::<f64>().ok()? / 1000.0).ok()
}

fn lost(error: ureq::Error) -> Lost {
    use std::io::ErrorKind::{ConnectionRefused, HostUnreachable, NetworkUnreachable};
    match &error {
        ureq::Error::HostNotFound | ureq::Error::ConnectionFailed => Lost::Unsent(error.to_string()),
        ureq::Error::Timeout(ureq::Timeout::Resolve | ureq::Timeout::Connect) => Lost::Unsent(error.to_string()),
        ureq::Error::Io(io) if matches!(io.kind(), ConnectionRefused | HostUnreachable | NetworkUnreachable) => {
            Lost::Unsent(error.to_string())
        }
        ureq::Error::BodyExceedsLimit(_) => Lost::Unusable(format!(
            "more than {RESPONSE_BYTES_MAX} bytes; ask for shorter answers (max_tokens), or check base_url and kind"
        )),
        ureq::Error::Http(_) | ureq::Error::BadUri(_) | ureq::Error::RedirectFailed | ureq::Error::TooManyRedirects => {
            Lost::Unusable(format!("{error}; check base_url"))
        }
        _ => Lost::Midway(error.to_string()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wait_is_told_in_seconds_or_as_a_date_and_the_servers_own_clock_counts() {
        let half_past_eight = Duration::from_secs(784_110_600);
        let seconds =
            |text: &str, date: Option<&str>| wait(text, date, &|| half_past_eight).map(|wait| wait.as_secs_f64());
        assert_eq!((seconds("7", None), seconds("0.5", None), seconds("soon", None)), (Some(7.0), Some(0.5), None));
        assert_eq!(
            ["6000", "250.5", "-1", "NaN", "soon"].map(wait_ms),
            [Some(Duration::from_secs(6)), Some(Duration::from_micros(250_500)), None, None, None]
        );
        let at = "Sun, 06 Nov 1994 08:30:08 GMT";
        assert_eq!(seconds(at, None), Some(8.0));
        assert_eq!(seconds(at, Some("Sun, 06 Nov 1994 08:30:05 GMT")), Some(3.0));
        // The older forms, which a reader has to know.
        assert_eq!(seconds("Sunday, 06-Nov-94 08:30:09 GMT", None), Some(9.0));
        assert_eq!(seconds("Sun Nov  6 08:29:00 1994", None), Some(0.0));
    }
}
