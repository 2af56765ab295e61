//! The nearest known word, for messages.

/// Least similarity at which a word is proposed (share of common characters, as in difflib).
const SIMILAR_MIN: f32 = 0.6;

/// The most similar of the allowed words; `None` if none is similar.
pub fn nearest<'a>(word: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let known: Vec<&str> = known.into_iter().collect();
    similar::get_close_matches(word, &known, 1, SIMILAR_MIN).first().copied()
}
