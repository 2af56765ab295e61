//! Keys of an experiment file and what may stand there: the range, the unit, when a key is needed.

use super::OptionError;

/// Characters of a value that a message repeats.
const SHOWN_CHARS: usize = 60;

/// One key of an experiment file.
pub struct Key {
    /// Its place: `budget.slots`, `lineage[].id` (of each entry of a list), `models.*.kind` (of each table, by name).
    pub key: &'static str,
    /// The paper's symbol; empty where it has none.
    pub symbol: &'static str,
    /// Empty for numbers without a unit and for words.
    pub unit: &'static str,
    pub range: Range,
    pub need: Need,
    /// Meaning, in a sentence.
    pub meaning: &'static str,
}

/// The values that a key may have.
pub enum Range {
    /// From the first to the second, both included.
    Whole(i64, i64),
    /// From the first to the second, both included.
    Number(f64, f64),
    /// Above the first, up to the second, which is included.
    Above(f64, f64),
    /// A text of 1 to so many characters.
    Text(usize),
    /// A text that no message may repeat: somebody may have put a key in its place.
    Unshown,
    /// 1 to 64 lower-case letters, digits, `-` and `_`.
    Name,
    /// One of the words of a list.
    Word(fn() -> Vec<String>),
    /// A list of words of a list.
    Words(fn() -> Vec<String>),
    /// A list of words of a list, which may be empty.
    Subset(fn() -> Vec<String>),
    /// A list of texts; whether it may be empty.
    Texts { empty: bool },
    /// A list of whole numbers, each from the first to the second.
    Wholes(i64, i64),
    /// Two numbers from the first up to the second, which is not included.
    Pair(f64, f64),
    /// A low and a high end from the first to the second, both included.
    Ends(f64, f64),
    /// `true` or `false`.
    Truth,
    /// Any value: what it must be depends on others, which are checked afterwards.
    Any,
}

/// When a key must stand in the file. A place in it is written like [`Key::key`], with the same lists and names.
pub enum Need {
    Always,
    Optional,
    /// Needed if that table is there; unknown elsewhere.
    With(&'static str),
    /// Needed if that table is not there; refused beside it.
    Without(&'static str),
    /// Needed if that key has one of these values; refused elsewhere.
    Of(&'static str, &'static [&'static str]),
}

impl Range {
    /// Refuses a value of another type or outside the range.
    pub fn check(&self, path: &str, value: &toml::Value) -> Result<(), OptionError> {
        let fits = match (self, value) {
            (Range::Whole(least, most), toml::Value::Integer(x)) => (least..=most).contains(&x),
            (Range::Number(..) | Range::Above(..), _) => number(value).is_some_and(|x| self.holds(x)),
            (Range::Text(most), toml::Value::String(text)) => (1..=*most).contains(&text.chars().count()),
            (Range::Unshown, toml::Value::String(_)) | (Range::Truth, toml::Value::Boolean(_)) | (Range::Any, _) => {
                true
            }
            (Range::Name, toml::Value::String(name)) => is_name(name),
            (Range::Word(words), toml::Value::String(word)) => {
                let words = words();
                if !words.contains(word) {
                    return Err(OptionError::word(path, word, &words));
                }
                true
            }
            (Range::Words(words) | Range::Subset(words), toml::Value::Array(items)) => {
                let words = words();
                for (i, item) in items.iter().enumerate() {
                    let word = item.as_str().unwrap_or_default();
                    if !words.iter().any(|known| known == word) {
                        return Err(OptionError::word(format!("{path}[{i}]"), word, &words));
                    }
                }
                !items.is_empty() || matches!(self, Range::Subset(_))
            }
            (Range::Texts { empty }, toml::Value::Array(items)) => {
                items.iter().all(|item| item.as_str().is_some_and(|text| !text.is_empty()))
                    && (*empty || !items.is_empty())
            }
            (Range::Wholes(least, most), toml::Value::Array(items)) => {
                let fits = |item: &toml::Value| item.as_integer().is_some_and(|x| (*least..=*most).contains(&x));
                !items.is_empty() && items.iter().all(fits)
            }
            (Range::Ends(least, most), toml::Value::Array(items)) => {
                let ends: Vec<f64> = items.iter().filter_map(number).collect();
                matches!(ends[..], [low, high] if items.len() == 2 && *least <= low && low <= high && high <= *most)
            }
            (Range::Pair(least, below), toml::Value::Array(items)) => {
                items.len() == 2 && items.iter().all(|item| number(item).is_some_and(|x| *least <= x && x < *below))
            }
            _ => false,
        };
        if fits { Ok(()) } else { Err(OptionError::new(path, self.found(value), self.to_string())) }
    }

    fn holds(&self, x: f64) -> bool {
        match self {
            Range::Number(least, most) => (*least..=*most).contains(&x),
            Range::Above(least, most) => *least < x && x <= *most,
            _ => false,
        }
    }

    /// The value as a message repeats it.
    fn found(&self, value: &toml::Value) -> String {
        match self {
            Range::Unshown => format!("a value of type {}", value.type_str()),
            _ => shown(value),
        }
    }
}

/// A value as the file writes it, shortened.
pub fn shown(value: &toml::Value) -> String {
    let text = value.to_string().replace('\n', " ");
    match text.char_indices().nth(SHOWN_CHARS) {
        Some((at, _)) => format!("{}...", &text[..at]),
        None => text,
    }
}

/// A whole number stands for a number too.
fn number(value: &toml::Value) -> Option<f64> {
    value.as_float().or_else(|| value.as_integer().map(|x| x as f64))
}

/// Returns `true` if it may name folders and files of a run.
pub fn is_name(name: &str) -> bool {
    let legal = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-' || c == '_';
    !name.is_empty() && name.len() <= 64 && name.chars().all(legal)
}

/// Large bounds as powers of ten.
pub fn bound(x: f64) -> String {
    if x.abs() >= 1e6 { format!("{x:e}") } else { x.to_string() }
}

impl std::fmt::Display for Range {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Range::Whole(least, i64::MAX) => write!(f, "a whole number from {least} to 2^63 - 1"),
            Range::Whole(least, most) => write!(f, "a whole number from {least} to {most}"),
            Range::Number(least, most) => write!(f, "a number from {} to {}", bound(*least), bound(*most)),
            Range::Above(least, most) => write!(f, "a number above {}, at most {}", bound(*least), bound(*most)),
            Range::Text(most) => write!(f, "a text of 1 to {most} characters"),
            Range::Unshown => write!(f, "a text"),
            Range::Name => write!(f, "1 to 64 lower-case letters, digits, `-` or `_`"),
            Range::Word(words) => write!(f, "one of {}", words().join(", ")),
            Range::Words(words) => write!(f, "a list of one or more of {}", words().join(", ")),
            Range::Subset(words) => write!(f, "a list of any of {}, which may be empty", words().join(", ")),
            Range::Texts { empty: true } => write!(f, "a list of texts, which may be empty"),
            Range::Texts { empty: false } => write!(f, "a list of one text or more"),
            Range::Wholes(least, most) => write!(f, "a list of whole numbers from {least} to {most}"),
            Range::Pair(least, below) => write!(f, "two numbers from {} up to but not including {}", least, below),
            Range::Ends(least, most) => write!(f, "a low and a high end from {least} to {most}"),
            Range::Truth => write!(f, "true or false"),
            Range::Any => write!(f, "a value"),
        }
    }
}
