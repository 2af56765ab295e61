//! BLAKE3 digests with a domain, printed as 64 hex digits.

use serde::{Deserialize, Deserializer, Serialize, Serializer, de::Error as _};
use std::{fmt, str::FromStr};

use super::canon::{CanonError, canonical_bytes};

/// The name of immutable bytes.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Digest([u8; 32]);

/// Not 64 lower-case hex digits.
#[derive(Debug, thiserror::Error)]
#[error("expected 64 hex digits in lower case, found {0:?}")]
pub struct NotADigest(pub String);

impl Digest {
    /// Digest of plain bytes: the name of an object.
    pub fn of_bytes(bytes: &[u8]) -> Digest {
        Digest(*blake3::hash(bytes).as_bytes())
    }

    /// Digest of a value's canonical bytes under a domain such as `evodrive/program/1`; values of different
    /// domains never share a digest even when their bytes agree.
    pub fn of<T: Serialize + ?Sized>(domain: &str, value: &T) -> Result<Digest, CanonError> {
        Ok(Digest::under(domain, &canonical_bytes(value)?))
    }

    /// Digest under a domain of canonical bytes that the caller already has.
    pub fn under(domain: &str, bytes: &[u8]) -> Digest {
        let mut hasher = blake3::Hasher::new();
        hasher.update(&(domain.len() as u64).to_le_bytes());
        hasher.update(domain.as_bytes());
        hasher.update(bytes);
        Digest(*hasher.finalize().as_bytes())
    }

    /// The digest with these bytes.
    pub fn from_array(bytes: [u8; 32]) -> Digest {
        Digest(bytes)
    }

    /// Its 32 bytes.
    pub fn as_bytes(&self) -> &[u8; 32] {
        &self.0
    }

    /// 64 lower-case hex digits.
    pub fn to_hex(&self) -> String {
        blake3::Hash::from_bytes(self.0).to_hex().to_string()
    }

    /// The first `n` hex digits, for people.
    pub fn short(&self, n: usize) -> String {
        self.to_hex()[..n.min(64)].to_string()
    }
}

/// A digest of plain bytes that come piece by piece, and their number.
#[derive(Clone, Default)]
pub struct Hashing {
    hasher: blake3::Hasher,
    bytes: u64,
}

impl Hashing {
    /// Takes the next piece in.
    pub fn add(&mut self, piece: &[u8]) {
        self.hasher.update(piece);
        self.bytes += piece.len() as u64;
    }

    /// Digest and number of the bytes so far.
    pub fn so_far(&self) -> (Digest, u64) {
        (Digest(*self.hasher.finalize().as_bytes()), self.bytes)
    }
}

impl std::io::Write for Hashing {
    fn write(&mut self, piece: &[u8]) -> std::io::Result<usize> {
        self.add(piece);
        Ok(piece.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

impl fmt::Display for Digest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.to_hex())
    }
}

impl fmt::Debug for Digest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Digest({})", self.short(12))
    }
}

impl FromStr for Digest {
    type Err = NotADigest;

    fn from_str(text: &str) -> Result<Digest, NotADigest> {
        // A digest has one spelling: a changed byte that gave another one of the same digest would go unnoticed.
        let lower = !text.bytes().any(|byte| byte.is_ascii_uppercase());
        let read = if lower { blake3::Hash::from_hex(text).ok() } else { None };
        read.map(|hash| Digest(*hash.as_bytes())).ok_or_else(|| NotADigest(text.to_string()))
    }
}

impl Serialize for Digest {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(&self.to_hex())
    }
}

impl<'de> Deserialize<'de> for Digest {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Digest, D::Error> {
        String::deserialize(deserializer)?.parse().map_err(D::Error::custom)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_digest_has_one_spelling() {
        let digest = Digest::of_bytes(b"a");
        assert_eq!(digest.to_hex().parse::<Digest>().unwrap(), digest);
        for other in [digest.to_hex().to_uppercase(), digest.short(63), format!("{digest} "), "zz".into()] {
            let error = other.parse::<Digest>().unwrap_err().to_string();
            assert!(error.contains("64 hex digits in lower case") && error.contains(&other), "{error}");
        }
    }
}
