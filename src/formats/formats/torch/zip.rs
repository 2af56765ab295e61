//! The entries of a zip file whose bytes are stored without compression, which is how `torch.save` writes them.

use std::collections::BTreeMap;
use std::ops::Range;

use flate2::Crc;

use crate::formats::import_error::{ImportError, shown};

/// Most entries of one file.
const ENTRIES_MAX: usize = 65_534;
/// Number of bytes of the record at the end, and the most that a comment behind it may have.
const END_BYTES: usize = 22;
const COMMENT_MAX: usize = 65_535;
/// Number of bytes of an entry in the list, and before its data, each without names.
const LISTED_BYTES: usize = 46;
const LOCAL_BYTES: usize = 30;

/// A zip file's entries by name.
pub struct Zip<'a> {
    file: &'a str,
    bytes: &'a [u8],
    entries: BTreeMap<&'a str, (Range<usize>, u32)>,
}

impl<'a> Zip<'a> {
    /// Reads the list of entries.
    ///
    /// # Errors
    /// No list, one that leads out of the file, an entry that is compressed, encrypted or there twice.
    pub fn of(file: &'a str, bytes: &'a [u8]) -> Result<Zip<'a>, ImportError> {
        let mut zip = Zip { file, bytes, entries: BTreeMap::new() };
        let (mut at, count) = zip.list()?;
        for _ in 0..count {
            at = zip.add(at)?;
        }
        Ok(zip)
    }

    /// Returns the names of its entries.
    pub fn names(&self) -> impl Iterator<Item = &'a str> + '_ {
        self.entries.keys().copied()
    }

    /// Returns the bytes of an entry, compared with the sum that the file gives.
    ///
    /// # Errors
    /// No such entry, or other bytes than were written.
    pub fn entry(&self, name: &str) -> Result<&'a [u8], ImportError> {
        let Some((range, sum)) = self.entries.get(name) else {
            return Err(self.refuse("its list", format!("an entry {:?}", shown(name))));
        };
        let bytes = &self.bytes[range.clone()];
        let mut crc = Crc::new();
        crc.update(bytes);
        if crc.sum() == *sum {
            Ok(bytes)
        } else {
            Err(self.refuse(name, format!("bytes with the check sum {sum:08x}, found {:08x}", crc.sum())))
        }
    }

    fn refuse(&self, place: &str, expected: impl Into<String>) -> ImportError {
        ImportError::new(self.file, shown(place), expected, "fetch or write the file again, with torch.save")
    }

    /// Returns the start of the list, and the number of its entries.
    fn list(&self) -> Result<(usize, usize), ImportError> {
        let length = self.bytes.len();
        let from = length.saturating_sub(END_BYTES + COMMENT_MAX);
        let is_end = |at: &usize| {
            let comment = self.number(at + 20, 2);
            self.bytes[*at..].starts_with(b"PK\x05\x06") && comment.is_some_and(|n| at + END_BYTES + n == length)
        };
        let end = (from..length).rev().find(is_end);
        let end = end.ok_or_else(|| self.refuse("its end", "the end of a whole zip file, found none"))?;
        let number = |at: usize, bytes| self.number(end + at, bytes).unwrap_or(usize::MAX);
        let (count, list) = (number(10, 2), number(16, 4));
        if number(4, 4) != 0 || count > ENTRIES_MAX || list > end {
            return Err(self.refuse("its end", format!("one file of at most {ENTRIES_MAX} entries and 4 GiB")));
        }
        Ok((list, count))
    }

    /// Adds the entry whose line in the list begins at `at`, and returns the start of the next one.
    fn add(&mut self, at: usize) -> Result<usize, ImportError> {
        let broken = || self.refuse(&format!("byte {at}"), "an entry of a zip file's list");
        let number = |from: usize, bytes: usize| self.number(at + from, bytes).ok_or_else(broken);
        if !self.bytes.get(at..).is_some_and(|rest| rest.starts_with(b"PK\x01\x02")) {
            return Err(broken());
        }
        let (flags, method, sum) = (number(8, 2)?, number(10, 2)?, number(16, 4)?);
        let (stored, size, local) = (number(20, 4)?, number(24, 4)?, number(42, 4)?);
        let (name, extra, comment) = (number(28, 2)?, number(30, 2)?, number(32, 2)?);
        let name_range = at + LISTED_BYTES..at + LISTED_BYTES + name;
        let name = self.bytes.get(name_range.clone()).and_then(|name| std::str::from_utf8(name).ok());
        let name = name.ok_or_else(broken)?;
        if flags & 1 != 0 || method != 0 || stored != size {
            let found = if flags & 1 != 0 { "an encrypted one" } else { "a compressed one" };
            return Err(self.refuse(name, format!("an entry whose bytes stand as they are, found {found}")));
        }
        let head = self.bytes.get(local..).filter(|rest| rest.starts_with(b"PK\x03\x04"));
        let beside = [26, 28].map(|from| self.number(local + from, 2));
        let from = match (head, beside) {
            (Some(_), [Some(name), Some(extra)]) => local + LOCAL_BYTES + name + extra,
            _ => return Err(broken()),
        };
        let range = from..from + size;
        if self.bytes.get(range.clone()).is_none() {
            let rest = self.bytes.len().saturating_sub(from);
            return Err(self.refuse(name, format!("{size} bytes from byte {from} on, found {rest}")));
        }
        if self.entries.insert(name, (range, sum as u32)).is_some() {
            return Err(self.refuse(name, "each name once, found it twice"));
        }
        Ok(name_range.end + extra + comment)
    }

    /// Reads a whole number of at most four bytes.
    fn number(&self, at: usize, bytes: usize) -> Option<usize> {
        let raw = self.bytes.get(at..at.checked_add(bytes)?)?;
        Some(raw.iter().rev().fold(0, |sum, byte| (sum << 8) | usize::from(*byte)))
    }
}
