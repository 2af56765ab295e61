//! Words of a process without what they must not carry on: keys and homes.

/// Text in place of a key.
const KEY: &str = "[key]";
/// A value of the environment shorter than this is a key only as a whole word, or behind its name.
const SECRET_CHARS: usize = 8;
/// A value shorter than this is no key.
const SECRET_CHARS_MIN: usize = 4;
/// Parts of names of variables that hold keys.
const SECRET_NAMES: [&str; 6] = ["KEY", "TOKEN", "SECRET", "PASSWORD", "PASSWD", "CREDENTIAL"];
/// How keys of common providers begin.
const OPENINGS: [&str; 9] = ["sk-", "sk_", "gsk_", "hf_", "ghp_", "github_pat_", "xai-", "AKIA", "AIza"];
/// Folders that hold homes.
const HOMES: [&str; 3] = ["/home/", "/Users/", "\\Users\\"];

/// A text without values of the environment's keys, words that look like keys, and paths of homes.
#[allow(clippy::disallowed_methods)]
pub fn redacted(text: &str) -> String {
    let all =
        std::env::vars_os().filter_map(|(name, value)| Some((name.into_string().ok()?, value.into_string().ok()?)));
    redacted_with(text, &all.collect::<Vec<_>>())
}

fn redacted_with(text: &str, environment: &[(String, String)]) -> String {
    let mut text = text.to_string();
    let mut short = Vec::new();
    for (name, value) in environment {
        let upper = name.to_uppercase();
        if value.len() >= SECRET_CHARS && SECRET_NAMES.iter().any(|part| upper.contains(part)) {
            text = text.replace(value.as_str(), KEY);
        } else if value.len() >= SECRET_CHARS_MIN && names_key(name) {
            short.push(value.as_str());
        } else if name == "HOME" && value.len() > 1 {
            text = text.replace(value.as_str(), "~");
        }
    }
    for home in HOMES {
        text = without_user(&text, home);
    }
    let (mut out, mut is_named) = (String::with_capacity(text.len()), false);
    for word in text.split_inclusive(ends_word) {
        let bare = word.trim_end_matches(ends_word);
        let within = bare.trim_matches(|c: char| c.is_ascii_punctuation());
        if short.contains(&within) || is_named && bare.len() >= SECRET_CHARS_MIN && bare != KEY {
            out.extend([KEY, &word[bare.len()..]])
        } else {
            out.push_str(&without_key(word))
        }
        is_named = word.ends_with('=') && names_key(bare) || is_named && matches!(word, "\"" | "'");
    }
    out
}

/// Returns `true` if this is the name of a key, as `API_KEY` is and `max_tokens` is not.
fn names_key(name: &str) -> bool {
    name.split(|c: char| !c.is_ascii_alphanumeric()).any(|part| {
        SECRET_NAMES.iter().any(|secret| part.eq_ignore_ascii_case(secret)) || part.eq_ignore_ascii_case("apikey")
    })
}

fn ends_word(c: char) -> bool {
    c.is_whitespace() || matches!(c, '"' | '\'' | '=' | ',' | '(' | ')' | ':' | '<' | '>' | '`')
}

/// `/home/alice/x` as `~/x`.
fn without_user(text: &str, home: &str) -> String {
    let mut pieces = text.split(home);
    let mut out = pieces.next().unwrap_or_default().to_string();
    for piece in pieces {
        let user = piece.find(|c| ends_word(c) || c == '/' || c == '\\').unwrap_or(piece.len());
        out.push('~');
        out.push_str(&piece[user..]);
    }
    out
}

/// A word, with what ended it.
fn without_key(word: &str) -> String {
    let bare = word.trim_end_matches(ends_word);
    let begins = |at: &usize| !bare[..*at].ends_with(|c: char| c.is_alphanumeric());
    let begin = OPENINGS.iter().filter_map(|opening| bare.find(opening)).filter(begins).min();
    match begin {
        Some(at) if bare.len() - at >= SECRET_CHARS => format!("{}{KEY}{}", &bare[..at], &word[bare.len()..]),
        _ => word.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_and_homes_are_gone_and_the_rest_stays() {
        let environment = [("MY_API_KEY", "a1b2c3d4e5"), ("HOME", "/srv/people/bob"), ("LANG", "C.UTF-8-long")]
            .map(|(n, v)| (n.into(), v.into()));
        let redacted_text = redacted_with(
            "File \"/home/alice/runs/mine.py\", line 3\n key a1b2c3d4e5 in /srv/people/bob/x; sk-abcdef123456, C.UTF-8-long, a risk-averse one",
            &environment,
        );
        assert_eq!(
            redacted_text,
            "File \"~/runs/mine.py\", line 3\n key [key] in ~/x; [key], C.UTF-8-long, a risk-averse one"
        );
        // A key behind its name, whoever set it, and a short one as a whole word.
        let short = [("DB_PASSWORD", "hunter2")].map(|(n, v)| (n.into(), v.into()));
        assert_eq!(
            redacted_with(
                "API_KEY=abcd1 my-token='xyz12' max_tokens=25600 hunter2; hunter22 KeyError: 'speed'",
                &short
            ),
            "API_KEY=[key] my-token='[key]' max_tokens=25600 [key] hunter22 KeyError: 'speed'"
        );
        assert_eq!(redacted_with("token=ghp_0123456789 C:\\Users\\eve\\x", &[]), "token=[key] C:~\\x");
    }
}
