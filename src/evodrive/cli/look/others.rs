//! Other runs for the page of one: what `compare` says of both.

use std::path::Path;

use crate::cli::look::compare::{Blocks, Searched, blocks};
use crate::cli::look::compared_pairs::Side;
use crate::cli::terminal::exit::Failure;
use crate::evidence::report::{Other, OtherRow};

/// The other run beside this one, search by search.
///
/// # Errors
/// A run that is not there or not finished, one of the same root, or one that has no search and no scene in common.
pub fn other(own: &Side, place: &Path) -> Result<Other, Failure> {
    let theirs = Side::named(&place.to_string_lossy())?;
    if theirs.run.root == own.run.root {
        let text = format!("{}: expected another run than the report's, found the same root", place.display());
        return Err(Failure::bad_input(text));
    }
    let Blocks { searches, pairs, one_attack, notes } = blocks(own, &theirs)?;
    let mut made = Other::of(&theirs.run, notes);
    for (search, of, seeds) in searches.into_iter().flat_map(Searched::summary) {
        made.rows.push(OtherRow { search, seeds, scenes: of.scenes(), quantities: of.quantities().to_vec() });
    }
    for [first, second] in pairs.iter().filter(|_| one_attack) {
        made.add(&own.run, first, second, &theirs.run);
    }
    Ok(made)
}
