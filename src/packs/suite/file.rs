//! The bytes of a suite (docs/FORMAT.md): `EVODSUIT`, version (u32), length of the head (u64), the head as JSON ([`Suite`]), a pool
//! file with the scenes, and the BLAKE3 digest of everything before it, which is the suite's name. Little-endian. On disk these bytes
//! are compressed with zstd; the digest is of the uncompressed bytes.

use super::content::Suite;
use crate::kernel::Digest;
use crate::scene::{PoolError, pool};

const MAGIC: &[u8; 8] = b"EVODSUIT";
/// Rises when an older reader could not read what is written.
pub const SUITE_VERSION: u32 = 1;
const HEAD_BYTES: usize = 8 + 4 + 8;
const CHECKSUM_BYTES: usize = 32;

/// Why bytes are no suite that can be used.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SuiteError {
    #[error("{file} is not a suite: expected the bytes EVODSUIT at its start; make one with `evodrive suite freeze`")]
    NotASuite { file: String },
    #[error(
        "{file} has suite format {found}, this build reads format {SUITE_VERSION}; use the release that wrote it, or freeze it anew"
    )]
    Version { file: String, found: u32 },
    #[error("{file} is damaged at byte {at}: expected {expected}; restore it from a copy, or freeze it anew")]
    Damaged { file: String, at: usize, expected: String },
    #[error("{file}: {place}: expected {expected}; freeze it anew")]
    Unsound { file: String, place: String, expected: String },
    #[error(transparent)]
    Pool(#[from] PoolError),
}

/// A suite with its digest.
#[derive(Clone, Debug, PartialEq)]
pub struct Frozen {
    pub suite: Suite,
    pub digest: Digest,
}

/// The bytes of a suite and its digest: the same for the same content.
///
/// # Errors
/// A number of the head that JSON cannot hold.
pub fn encode(suite: &Suite) -> Result<(Vec<u8>, Digest), serde_json::Error> {
    let head = serde_json::to_vec(suite)?;
    let scenes = pool::encode(&suite.pool);
    let mut bytes = Vec::with_capacity(HEAD_BYTES + head.len() + scenes.len() + CHECKSUM_BYTES);
    bytes.extend_from_slice(MAGIC);
    bytes.extend_from_slice(&SUITE_VERSION.to_le_bytes());
    bytes.extend_from_slice(&(head.len() as u64).to_le_bytes());
    bytes.extend_from_slice(&head);
    bytes.extend_from_slice(&scenes);
    let digest = Digest::of_bytes(&bytes);
    bytes.extend_from_slice(digest.as_bytes());
    Ok((bytes, digest))
}

/// The suite in a file's bytes; `file` is its name in messages.
///
/// # Errors
/// See [`SuiteError`].
pub fn decode(file: &str, bytes: &[u8]) -> Result<Frozen, SuiteError> {
    let name = || file.to_string();
    let damaged = |at: usize, expected: &str| SuiteError::Damaged { file: name(), at, expected: expected.into() };
    if !bytes.starts_with(MAGIC) {
        return Err(SuiteError::NotASuite { file: name() });
    }
    let head = bytes.get(8..HEAD_BYTES).and_then(|head| {
        let version = u32::from_le_bytes(*head.first_chunk()?);
        let length = u64::from_le_bytes(*head.get(4..)?.first_chunk()?);
        Some((version, usize::try_from(length).ok()?))
    });
    let (version, length) = head.ok_or_else(|| damaged(8, "a version and the head's length"))?;
    if version != SUITE_VERSION {
        return Err(SuiteError::Version { file: name(), found: version });
    }
    let end = bytes.len().checked_sub(CHECKSUM_BYTES).filter(|&end| end >= HEAD_BYTES);
    let end = end.ok_or_else(|| damaged(bytes.len(), "a checksum of 32 bytes at the end"))?;
    let digest = Digest::of_bytes(&bytes[..end]);
    if digest.as_bytes()[..] != bytes[end..] {
        return Err(damaged(end, "the checksum of all bytes before it"));
    }
    let after = HEAD_BYTES.checked_add(length).filter(|&after| after <= end);
    let after = after.ok_or_else(|| damaged(12, "a head that ends before the file"))?;
    let mut suite: Suite = serde_json::from_slice(&bytes[HEAD_BYTES..after])
        .map_err(|error| damaged(HEAD_BYTES, &format!("a head as JSON ({error})")))?;
    suite.pool = pool::decode(file, &bytes[after..end])?;
    match suite.fault() {
        Some((place, expected)) => Err(SuiteError::Unsound { file: name(), place, expected }),
        None => Ok(Frozen { suite, digest }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::suite::fixture::suite;

    #[test]
    fn a_suite_comes_back_from_its_bytes_with_its_digest() {
        let suite = suite();
        let (bytes, digest) = encode(&suite).unwrap();
        assert_eq!(decode("s", &bytes).unwrap(), Frozen { suite: suite.clone(), digest });
        let mut other = suite.clone();
        other.cases[0].label.steps += 1;
        assert_ne!(encode(&other).unwrap().1, digest, "a label is content");
        other = suite;
        other.pool.scenes[0].current_step += 1;
        assert_ne!(encode(&other).unwrap().1, digest, "a scene is content");
    }

    #[test]
    fn damage_another_version_and_what_does_not_fit_together_are_named() {
        let (bytes, _) = encode(&suite()).unwrap();
        for at in (0..bytes.len()).step_by(501) {
            let mut damaged = bytes.clone();
            damaged[at] ^= 0x10;
            assert!(decode("s", &damaged).is_err(), "{at}");
        }
        // A change that leaves everything readable.
        let place = bytes.windows(8).position(|window| window == b"\"seed\":1").unwrap();
        let mut changed = bytes.clone();
        changed[place + 7] = b'2';
        assert!(matches!(decode("s", &changed), Err(SuiteError::Damaged { .. })));
        for end in [0, 7, 8, 15, 60, bytes.len() - 1] {
            assert!(decode("s", &bytes[..end]).is_err(), "{end}");
        }
        let sealed = |change: fn(&mut Vec<u8>)| {
            let mut bytes = bytes[..bytes.len() - CHECKSUM_BYTES].to_vec();
            change(&mut bytes);
            let digest = Digest::of_bytes(&bytes);
            bytes.extend_from_slice(digest.as_bytes());
            decode("s", &bytes)
        };
        assert!(matches!(sealed(|b| b[8] = 9), Err(SuiteError::Version { found: 9, .. })));
        assert!(matches!(sealed(|b| b[12..20].fill(0xff)), Err(SuiteError::Damaged { at: 12, .. })));
        assert!(sealed(|_| ()).is_ok());
        let unsound = |change: fn(&mut Suite)| {
            let mut suite = suite();
            change(&mut suite);
            decode("s", &encode(&suite).unwrap().0).unwrap_err().to_string()
        };
        assert!(unsound(|s| s.cases[0].scene = "elsewhere".into()).contains("a scene of the suite"));
        assert!(unsound(|s| s.cases[0].rules = 7).contains("a place among 1 rules, found 7"));
        assert!(unsound(|s| s.cases[0].program = Some(7)).contains("a place among 1 programs"));
        assert!(unsound(|s| s.thresholds.max_crash_rate = Some(2.0)).contains("thresholds, max_crash_rate"));
        assert!(unsound(|s| s.cases.push(s.cases[0].clone())).contains("each id once"));
    }
}
