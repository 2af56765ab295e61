//! An api key in memory: it goes into one header and nowhere else.

/// A key. Neither `Debug` nor `Display` shows it.
#[derive(Clone)]
pub struct Secret(String);

/// Shorter keys are place-holders for servers without keys (`EMPTY`, `none`). Answers may contain them as ordinary
/// words.
const SECRET_CHARS_MIN: usize = 8;

impl Secret {
    /// White space around the text is dropped: keys are often read from files. A text that a header cannot hold is
    /// refused, and the message does not repeat it.
    pub fn new(text: &str) -> Result<Secret, String> {
        let text = text.trim();
        if text.is_empty() {
            return Err("is empty".into());
        }
        if !text.chars().all(|c| c.is_ascii_graphic()) {
            return Err("holds characters that no HTTP header can carry".into());
        }
        Ok(Secret(text.to_string()))
    }

    pub(super) fn header(&self, before: &str) -> String {
        format!("{before}{}", self.0)
    }

    pub(super) fn is_in(&self, text: &str) -> bool {
        self.0.len() >= SECRET_CHARS_MIN && text.contains(&self.0)
    }

    pub(super) fn redacted(&self, text: &str) -> String {
        text.replace(&self.0, "[api key]")
    }
}

impl std::fmt::Debug for Secret {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Secret")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_secret_is_trimmed_checked_and_never_shown() {
        let secret = Secret::new(" sk-0123456789\n").unwrap();
        assert_eq!(secret.header("Bearer "), "Bearer sk-0123456789");
        assert_eq!(format!("{secret:?}"), "Secret");
        assert_eq!(secret.redacted("no sk-0123456789!"), "no [api key]!");
        assert!(secret.is_in("..sk-0123456789..") && !Secret::new("EMPTY").unwrap().is_in("EMPTY"));
        for text in [" ", "a b", "a\u{7f}", "ä"] {
            assert!(!Secret::new(text).unwrap_err().contains(text.trim()) || text.trim().is_empty());
        }
    }
}
