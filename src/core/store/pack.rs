//! The pack: one append-only file of records, from which everything else in a store can be rebuilt.
//!
//! A record is `magic (8) | length of the body (u64, little endian) | BLAKE3 of the body (32) | check (8) | body`. The
//! magic is `EVOBJCT1` for an object and `EVOMEMO1` for a memo entry (its last byte is the format's version); the check
//! is the first 8 bytes of BLAKE3 of the 48 bytes before it, so that a damaged header can be distinguished from a
//! damaged body. Records follow each other from byte 0 without gaps. The body of a memo entry is `kind (1: llm, 2:
//! rollout, 3: compile) | request key (32) | object (32)`.

use std::{
    fs::File,
    io::{Read, Seek, SeekFrom},
};

use super::MemoKind;
use crate::kernel::Digest;

/// File name of the pack inside a store's folder.
pub(super) const PACK: &str = "objects.pack";
/// Bytes before a record's body.
pub(super) const HEADER: u64 = 56;
const OBJECT: &[u8; 8] = b"EVOBJCT1";
const MEMO: &[u8; 8] = b"EVOMEMO1";
/// Length of a memo entry's body.
pub(super) const MEMO_BODY: u64 = 65;
const CHUNK: usize = 1 << 16;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct MemoEntry {
    pub kind: MemoKind,
    pub key: Digest,
    pub object: Digest,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Header {
    pub memo: bool,
    pub length: u64,
    pub digest: Digest,
}

/// One piece of the pack.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Piece {
    Object {
        at: u64,
        length: u64,
        digest: Digest,
    },
    Memo {
        at: u64,
        entry: MemoEntry,
    },
    /// Bytes that are not a whole record, although more bytes follow or their number is right.
    Damaged {
        at: u64,
        end: u64,
        digest: Option<Digest>,
        what: String,
    },
    /// The file ends inside a record, because a write was cut off.
    Torn {
        at: u64,
    },
}

/// A whole record, ready to be written at once.
pub(super) fn record(memo: bool, digest: &Digest, body: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(HEADER as usize + body.len());
    bytes.extend_from_slice(if memo { MEMO } else { OBJECT });
    bytes.extend_from_slice(&(body.len() as u64).to_le_bytes());
    bytes.extend_from_slice(digest.as_bytes());
    let check = Digest::of_bytes(&bytes);
    bytes.extend_from_slice(&check.as_bytes()[..8]);
    bytes.extend_from_slice(body);
    bytes
}

impl MemoEntry {
    pub fn body(&self) -> Vec<u8> {
        let mut body = vec![self.kind.code()];
        body.extend_from_slice(self.key.as_bytes());
        body.extend_from_slice(self.object.as_bytes());
        body
    }

    fn read(body: &[u8]) -> Option<MemoEntry> {
        let (&code, digests) = body.split_first()?;
        let (key, object) = digests.split_first_chunk::<32>()?;
        let object: [u8; 32] = object.try_into().ok()?;
        Some(MemoEntry {
            kind: MemoKind::of_code(code)?,
            key: Digest::from_array(*key),
            object: Digest::from_array(object),
        })
    }
}

/// Returns the header in these bytes if its check holds.
pub(super) fn read_header(bytes: &[u8; HEADER as usize]) -> Option<Header> {
    let (head, check) = bytes.split_at(48);
    if &Digest::of_bytes(head).as_bytes()[..8] != check {
        return None;
    }
    let (magic, rest) = head.split_first_chunk::<8>()?;
    let (length, digest) = rest.split_first_chunk::<8>()?;
    let memo = match magic {
        OBJECT => false,
        MEMO => true,
        _ => return None,
    };
    let digest = Digest::from_array(digest.try_into().ok()?);
    Some(Header { memo, length: u64::from_le_bytes(*length), digest })
}

pub(super) fn read_at(mut file: &File, at: u64, length: u64) -> std::io::Result<Vec<u8>> {
    let size = file.metadata()?.len();
    if at.checked_add(length).is_none_or(|end| end > size) {
        return Err(std::io::ErrorKind::UnexpectedEof.into());
    }
    file.seek(SeekFrom::Start(at))?;
    let mut bytes = Vec::new();
    file.take(length).read_to_end(&mut bytes)?;
    if bytes.len() as u64 == length { Ok(bytes) } else { Err(std::io::ErrorKind::UnexpectedEof.into()) }
}

pub(super) fn header_at(file: &File, at: u64) -> std::io::Result<Option<Header>> {
    let bytes = read_at(file, at, HEADER)?;
    Ok(bytes.as_slice().try_into().ok().and_then(read_header))
}

/// The pieces of the pack from `from` to its end, in order. Bodies of objects are hashed when `read_bodies` says so; headers
/// and memo entries always are.
pub(super) fn scan(file: &File, from: u64, read_bodies: bool) -> std::io::Result<Vec<Piece>> {
    let size = file.metadata()?.len();
    let mut pieces = Vec::new();
    let mut at = from;
    while at < size {
        let (piece, end) = piece_at(file, at, size, read_bodies)?;
        pieces.push(piece);
        at = end;
    }
    Ok(pieces)
}

/// The piece at `at` and where the next one begins.
fn piece_at(file: &File, at: u64, size: u64, read_bodies: bool) -> std::io::Result<(Piece, u64)> {
    let left = size - at;
    let header = if left < HEADER { None } else { header_at(file, at)? };
    let Some(header) = header else {
        return Ok(match next_record(file, at + 1, size)? {
            Some(end) => (damaged(at, end, None, "a record with a valid header"), end),
            None if is_cut_header(file, at, left)? => (Piece::Torn { at }, size),
            None => (damaged(at, size, None, "a record with a valid header"), size),
        });
    };
    if header.length > left - HEADER {
        return Ok((Piece::Torn { at }, size));
    }
    let end = at + HEADER + header.length;
    if !header.memo && !read_bodies {
        return Ok((Piece::Object { at, length: header.length, digest: header.digest }, end));
    }
    let body = read_at(file, at + HEADER, header.length)?;
    if Digest::of_bytes(&body) != header.digest {
        let expected = format!("{} bytes with this digest", header.length);
        return Ok((damaged(at, end, Some(header.digest), &expected), end));
    }
    if !header.memo {
        return Ok((Piece::Object { at, length: header.length, digest: header.digest }, end));
    }
    Ok(match MemoEntry::read(&body) {
        Some(entry) => (Piece::Memo { at, entry }, end),
        None => (damaged(at, end, Some(header.digest), "a memo entry of a known kind"), end),
    })
}

fn damaged(at: u64, end: u64, digest: Option<Digest>, expected: &str) -> Piece {
    Piece::Damaged { at, end, digest, what: format!("expected {expected}, found other bytes up to offset {end}") }
}

/// Returns `true` if the file ends inside a header: the last bytes are the beginning of one, or only zeros (after a power cut).
fn is_cut_header(file: &File, at: u64, left: u64) -> std::io::Result<bool> {
    if left >= HEADER {
        return all_zero(file, at, left);
    }
    let bytes = read_at(file, at, left)?;
    let begins = |magic: &[u8; 8]| bytes.iter().zip(magic).all(|(a, b)| a == b);
    Ok(begins(OBJECT) || begins(MEMO) || bytes.iter().all(|b| *b == 0))
}

fn all_zero(file: &File, at: u64, left: u64) -> std::io::Result<bool> {
    let mut done = 0;
    while done < left {
        let bytes = read_at(file, at + done, (left - done).min(CHUNK as u64))?;
        if bytes.iter().any(|b| *b != 0) {
            return Ok(false);
        }
        done += bytes.len() as u64;
    }
    Ok(true)
}

/// Offset of the first valid header at or behind `from`.
fn next_record(file: &File, from: u64, size: u64) -> std::io::Result<Option<u64>> {
    let mut at = from;
    while at.saturating_add(HEADER) <= size {
        let window = read_at(file, at, (size - at).min(CHUNK as u64))?;
        let header = window.array_windows::<{ HEADER as usize }>().position(|bytes| read_header_here(bytes).is_some());
        if let Some(offset) = header {
            return Ok(Some(at + offset as u64));
        }
        at += (window.len() as u64 - HEADER) + 1;
    }
    Ok(None)
}

/// Reads a header as `read_header`, but without hashing where the magic is wrong.
fn read_header_here(bytes: &[u8; HEADER as usize]) -> Option<Header> {
    if bytes.starts_with(OBJECT) || bytes.starts_with(MEMO) { read_header(bytes) } else { None }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn object(body: &[u8]) -> Vec<u8> {
        record(false, &Digest::of_bytes(body), body)
    }

    fn scanned(bytes: &[u8]) -> Vec<Piece> {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), bytes).unwrap();
        scan(&File::open(file.path()).unwrap(), 0, true).unwrap()
    }

    #[test]
    fn zeros_at_the_end_are_a_write_that_was_cut_off_however_many_there_are() {
        let whole = object(b"whole");
        let at = whole.len() as u64;
        for zeros in [1, 8, HEADER as usize - 1, HEADER as usize, CHUNK - 1, CHUNK, CHUNK + 1, 2 * CHUNK + 100] {
            let padded = [whole.clone(), vec![0; zeros]].concat();
            assert_eq!(scanned(&padded).last(), Some(&Piece::Torn { at }), "{zeros} zeros");
            // Another byte at the end is not from a power cut.
            let other = [padded, vec![1]].concat();
            assert!(
                matches!(scanned(&other).last(), Some(Piece::Damaged { at: place, .. }) if *place == at),
                "{zeros} zeros"
            );
        }
    }

    #[test]
    fn a_header_that_breaks_off_is_a_write_that_was_cut_off_and_other_bytes_are_damage() {
        let (one, two) = (object(b"one"), object(b"two"));
        let at = one.len() as u64;
        for length in 1..two.len() {
            assert_eq!(scanned(&[&one, &two[..length]].concat()).last(), Some(&Piece::Torn { at }), "{length} bytes");
        }
        assert!(matches!(scanned(&[&one[..], b"EVOX"].concat()).last(), Some(Piece::Damaged { .. })));
    }

    #[test]
    fn behind_damage_of_any_length_the_next_record_is_found() {
        let (first, next) = (object(b"first"), object(b"next"));
        let header = HEADER as usize;
        for length in
            [1, header - 1, header, CHUNK - header, CHUNK - header + 1, CHUNK - 1, CHUNK, CHUNK + 1, 3 * CHUNK]
        {
            let rotten = vec![7; length];
            let pieces = scanned(&[&first[..], &rotten, &next].concat());
            let (at, end) = (first.len() as u64, (first.len() + length) as u64);
            assert_eq!(pieces.len(), 3, "{length}");
            assert!(
                matches!(&pieces[1], Piece::Damaged { at: from, end: to, .. } if (*from, *to) == (at, end)),
                "{length}"
            );
            assert_eq!(pieces[2], Piece::Object { at: end, length: 4, digest: Digest::of_bytes(b"next") }, "{length}");
        }
    }
}
