//! Keeps the results of motion and search nodes for programs that are alike as far as there: an edit of a filter, a
//! choice or a scene gate leaves the search as it was, and searches are nearly all that compiling costs.

use std::sync::Arc;

use crate::kernel::{Digest, LruCache};
use crate::scene::Sample;
use crate::stage::{Part, StageError};

/// Parts behind a motion or search node, by all that decides on the way there.
pub type Parts = Result<Arc<[Part]>, StageError>;

/// LruCache results of nodes; the bound is in bytes.
#[derive(Debug)]
pub struct Searched(LruCache<Digest, Parts>);

/// Estimated size of a part besides its candidates' samples, bytes.
const PART_BYTES: usize = 4096;

impl Searched {
    /// Returns a store that keeps about this many bytes.
    pub fn new(bytes_max: usize) -> Searched {
        Searched(LruCache::weighing(bytes_max, bytes))
    }

    /// Returns the result of a node, which is carried out now if it is not kept.
    pub(super) fn of(&self, key: Digest, carry_out: impl FnOnce() -> Parts) -> Parts {
        self.0.of(key, carry_out)
    }
}

fn bytes(parts: &Parts) -> usize {
    let samples = |part: &Part| part.candidates.iter().map(|candidate| candidate.samples.len()).sum::<usize>();
    let of = |part: &Part| PART_BYTES + samples(part) * size_of::<Sample>();
    PART_BYTES + parts.iter().flat_map(|parts| parts.iter()).map(of).sum::<usize>()
}
