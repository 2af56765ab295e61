//! Detects a cassette that was recorded on other scenes than the ones at hand. Its questions show the scenes of their
//! windows by their ids, so this is known before a run folder is made or a rollout is simulated.

use std::collections::BTreeSet;

use crate::agents::window;
use crate::cli::terminal::exit::Failure;
use crate::llm::Cassette;
use crate::scene::Pool;
use crate::text::counted;

/// Advice on such a cassette.
const REMEDY: &str = "take the scenes that it was recorded on (--scenes), or name by --cassette FILE the one that was recorded on \
                      these, or a new file for `evodrive record`";

/// Returns a message if no question of the cassette is about scenes of this pool alone. A cassette may hold several recordings: one that
/// fits is enough.
pub fn difference(cassette: &Cassette, pool: &Pool) -> Option<String> {
    let known: BTreeSet<&str> = pool.scenes.iter().map(|scene| scene.id.as_str()).collect();
    let mut strange = None;
    for (_, prompt) in cassette.exchanges().iter().flat_map(|exchange| &exchange.messages) {
        let mut rows = window::rows_in(prompt).peekable();
        if rows.peek().is_none() {
            continue;
        }
        match rows.find(|row| window::scene_of(row, &known).is_none()) {
            None => return None,
            Some(row) => strange = strange.or(Some(row)),
        }
    }
    let id = strange?.split(" | ").next()?;
    Some(format!(
        "{} was recorded on another scene pool: its questions show scene {id}, which is not among the {} here; {REMEDY}",
        cassette.name,
        counted(pool.scenes.len(), "scene")
    ))
}

/// Refuses to replay such a cassette: its first answer would be missing, after the work up to that question.
///
/// # Errors
/// The message of [`difference`], as a missing answer.
pub fn check(cassette: &Cassette, pool: &Pool) -> Result<(), Failure> {
    difference(cassette, pool).map_or(Ok(()), |what| Err(Failure::miss(what)))
}
