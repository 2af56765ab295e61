//! The digest of a rollout's motion, streamed: it changes when one bit of one simulated pose changes. Replayed motion
//! enters once, through the plant's digest.

use crate::kernel::Digest;
use crate::scene::Sample;
use crate::sim::prepared::plant::Plant;

/// BLAKE3 hashes long inputs several times faster than short ones, so words are gathered first.
const BUFFER_BYTES: usize = 16 * 1024;

pub(in crate::sim) struct TraceDigest {
    hasher: blake3::Hasher,
    buffer: Vec<u8>,
}

impl TraceDigest {
    pub fn new(plant: &Plant) -> TraceDigest {
        let mut hasher = blake3::Hasher::new_derive_key("evodrive/sim/1 trace");
        hasher.update(plant.digest().as_bytes());
        TraceDigest { hasher, buffer: Vec::with_capacity(BUFFER_BYTES) }
    }

    /// A pose of the ego (0) or of a simulated road user (1 + its place).
    pub fn pose(&mut self, who: u64, sample: &Sample) {
        self.words([
            who,
            sample.position.x.to_bits(),
            sample.position.y.to_bits(),
            sample.heading_rad.to_bits(),
            sample.velocity.x.to_bits(),
            sample.velocity.y.to_bits(),
        ]);
    }

    fn words<const N: usize>(&mut self, words: [u64; N]) {
        if self.buffer.len() + 8 * N > BUFFER_BYTES {
            self.hasher.update(&self.buffer);
            self.buffer.clear();
        }
        for word in words {
            self.buffer.extend_from_slice(&word.to_le_bytes());
        }
    }

    /// The digest of all words so far and these last ones.
    pub fn finish<const N: usize>(&self, last: [u64; N]) -> Digest {
        let mut hasher = self.hasher.clone();
        hasher.update(&self.buffer);
        for word in last {
            hasher.update(&word.to_le_bytes());
        }
        Digest::from_array(*hasher.finalize().as_bytes())
    }
}
