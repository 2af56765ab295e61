//! The nearest known word, for messages.

/// Similarity from which a word is worth proposing (share of common characters, as in difflib).
const SIMILAR_MIN: f32 = 0.6;

/// The most similar of the words that may stand here; `None` where none is near.
pub fn nearest<'a>(word: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let known: Vec<&str> = known.into_iter().collect();
    similar::get_close_matches(word, &known, 1, SIMILAR_MIN).first().copied()
}
