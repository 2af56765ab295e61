//! JSON Pointer (RFC 6901): places in a program, for patches and for messages.

use std::fmt;

/// A pointer as its unescaped tokens. The empty pointer (the whole document) names no editable place.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pointer {
    /// The steps from the root, unescaped.
    pub tokens: Vec<String>,
}

/// Why a text is not a pointer.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PointerError {
    /// The text does not begin with `/`.
    #[error("expected a path that begins with `/`")]
    NoSlash,
    /// A `~` is followed by something else than `0` or `1`.
    #[error("expected `~0` (for ~) or `~1` (for /) after `~` in `{0}`")]
    Escape(String),
}

impl Pointer {
    /// Reads a pointer.
    pub fn parse(text: &str) -> Result<Pointer, PointerError> {
        let rest = text.strip_prefix('/').ok_or(PointerError::NoSlash)?;
        let tokens = rest.split('/').map(unescaped).collect::<Result<_, _>>()?;
        Ok(Pointer { tokens })
    }

    /// The first token and those after it.
    pub fn split_first(&self) -> Option<(&str, &[String])> {
        self.tokens.split_first().map(|(first, rest)| (first.as_str(), rest))
    }
}

fn unescaped(token: &str) -> Result<String, PointerError> {
    let mut out = String::with_capacity(token.len());
    let mut chars = token.chars();
    while let Some(c) = chars.next() {
        out.push(match c {
            '~' => match chars.next() {
                Some('0') => '~',
                Some('1') => '/',
                _ => return Err(PointerError::Escape(token.chars().take(60).collect())),
            },
            other => other,
        });
    }
    Ok(out)
}

/// `place` with one more token.
pub fn within(place: &str, token: &str) -> String {
    format!("{place}/{}", token.replace('~', "~0").replace('/', "~1"))
}

impl fmt::Display for Pointer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.tokens.iter().fold(String::new(), |place, token| within(&place, token)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn escapes_are_undone_and_made_again() {
        let pointer = Pointer::parse("/a~1b/c~0d//~01").unwrap();
        assert_eq!(pointer.tokens, ["a/b", "c~d", "", "~1"]);
        assert_eq!(pointer.to_string(), "/a~1b/c~0d//~01");
    }

    #[test]
    fn what_is_not_a_pointer_is_refused() {
        assert_eq!(Pointer::parse(""), Err(PointerError::NoSlash));
        assert_eq!(Pointer::parse("a/b"), Err(PointerError::NoSlash));
        assert!(matches!(Pointer::parse("/a~2"), Err(PointerError::Escape(_))));
        assert!(matches!(Pointer::parse("/a~"), Err(PointerError::Escape(_))));
    }
}
