//! Text files that may be compressed: written so where their name ends in `.zst`, recognised by their content when read.

use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

use super::StoreError;
use super::file::{open_bounded, write_atomic};
use super::lines::{Line, next_line, too_large};

/// First bytes of a zstd frame (RFC 8878, section 3.1.1).
pub const ZSTD_MAGIC: [u8; 4] = [0x28, 0xB5, 0x2F, 0xFD];
/// A study's cassette of 280 MB becomes 16 MB in eight seconds; the levels above 16 save a sixth of that and take minutes.
const LEVEL: i32 = 12;
/// Most bytes, as a power of two, that the decompressor looks back on.
const WINDOW_LOG_MAX: u32 = 25;
/// Largest size of a compressed file's text: this many bytes, and more for each packed byte. Recorded answers come to 4 to 20 for one.
pub const UNPACKED_FREE: u64 = 64 << 20;
/// Further bytes of the text for each packed byte.
pub const UNPACKED_PER_BYTE: u64 = 64;

/// Why a text cannot be read on.
#[derive(Debug)]
pub enum TextFault {
    /// A fault of the disk.
    Store(StoreError),
    /// A damaged text: what was expected, and what was found.
    Wrong(String, String),
}

/// Returns the largest size of the text of a compressed file of `packed` bytes.
pub fn unpacked_bytes_max(packed: u64) -> u64 {
    UNPACKED_FREE.saturating_add(packed.saturating_mul(UNPACKED_PER_BYTE))
}

/// A text that is read line by line.
pub struct TextLines {
    path: PathBuf,
    from: Bounded,
}

/// Opens a text that has at most `max_bytes`, before and after decompression.
pub fn text_lines(path: &Path, max_bytes: u64) -> Result<TextLines, StoreError> {
    let io = |source| StoreError::io("read", path, source);
    let file = open_bounded(path, max_bytes)?;
    let mut packed = BufReader::new(Counted { from: Box::new(file), read: Default::default() });
    let read = packed.get_ref().read.clone();
    // Compression is recognised by the content, so that a copy under another name can be read too.
    let compressed = packed.fill_buf().map_err(io)?.starts_with(&ZSTD_MAGIC) || is_compressed(path);
    let from: Box<dyn BufRead> =
        if compressed { Box::new(BufReader::new(unpacking(packed).map_err(io)?)) } else { Box::new(packed) };
    Ok(TextLines { path: path.to_path_buf(), from: Bounded { from, max_bytes, given: 0, compressed, read } })
}

impl TextLines {
    /// The next line; none at the end.
    pub fn next_line(&mut self) -> Result<Option<Line>, TextFault> {
        let line = next_line(&mut self.from).map_err(|error| self.fault(error))?;
        match line.as_ref().and_then(|line| too_large(&line.bytes)) {
            Some((expected, found)) => Err(TextFault::Wrong(expected, found)),
            None => Ok(line),
        }
    }

    fn fault(&self, error: std::io::Error) -> TextFault {
        if error.get_ref().is_some_and(|inner| inner.is::<TooMuch>()) {
            TextFault::Wrong(error.to_string(), "more".into())
        } else if self.from.compressed {
            TextFault::Wrong("a whole zstd stream".into(), error.to_string())
        } else {
            TextFault::Store(StoreError::io("read", &self.path, error))
        }
    }
}

/// A file's text, at most `max_bytes` before and after decompression. The inner error says what was expected, and what was
/// found, where the compressed stream is damaged.
#[allow(clippy::type_complexity)]
pub fn read_text(path: &Path, max_bytes: u64) -> Result<Result<Vec<u8>, (String, String)>, StoreError> {
    let mut lines = text_lines(path, max_bytes)?;
    let mut text = Vec::new();
    match lines.from.read_to_end(&mut text).map_err(|error| lines.fault(error)) {
        Ok(_) => Ok(Ok(text)),
        Err(TextFault::Wrong(expected, found)) => Ok(Err((expected, found))),
        Err(TextFault::Store(error)) => Err(error),
    }
}

fn unpacking<R: BufRead>(packed: R) -> std::io::Result<zstd::stream::read::Decoder<'static, R>> {
    let mut decoder = zstd::stream::read::Decoder::with_buffer(packed)?;
    decoder.window_log_max(WINDOW_LOG_MAX)?;
    Ok(decoder)
}

/// Counts the bytes that a file gave.
struct Counted {
    from: Box<dyn Read>,
    read: std::rc::Rc<std::cell::Cell<u64>>,
}

impl Read for Counted {
    fn read(&mut self, to: &mut [u8]) -> std::io::Result<usize> {
        let count = self.from.read(to)?;
        self.read.set(self.read.get() + count as u64);
        Ok(count)
    }
}

/// A text that ends in an error where it is longer than allowed.
struct Bounded {
    from: Box<dyn BufRead>,
    max_bytes: u64,
    given: u64,
    compressed: bool,
    /// Bytes of the file so far.
    read: std::rc::Rc<std::cell::Cell<u64>>,
}

/// The limit that a text exceeds.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
struct TooMuch(String);

impl Bounded {
    fn hold(&self) -> std::io::Result<()> {
        let after = if self.compressed { " after decompression" } else { "" };
        let from_file = unpacked_bytes_max(self.read.get());
        let too_much = if self.given > self.max_bytes {
            TooMuch(format!("at most {} bytes{after}", self.max_bytes))
        } else if self.compressed && self.given > from_file {
            TooMuch(format!(
                "at most {UNPACKED_PER_BYTE} bytes after decompression for each byte of the file, and {UNPACKED_FREE} more"
            ))
        } else {
            return Ok(());
        };
        Err(std::io::Error::other(too_much))
    }
}

impl Read for Bounded {
    fn read(&mut self, to: &mut [u8]) -> std::io::Result<usize> {
        let count = self.from.read(to)?;
        self.given += count as u64;
        self.hold().map(|()| count)
    }
}

impl BufRead for Bounded {
    fn fill_buf(&mut self) -> std::io::Result<&[u8]> {
        self.hold()?;
        self.from.fill_buf()
    }

    fn consume(&mut self, count: usize) {
        self.given += count as u64;
        self.from.consume(count);
    }
}

/// Writes a text whole or not at all; compressed when its name ends in `.zst`.
pub fn write_text(path: &Path, text: &[u8]) -> Result<(), StoreError> {
    if !is_compressed(path) {
        return write_atomic(path, text);
    }
    write_atomic(path, &packed(path, text)?)
}

/// A text as a compressed file holds it; `path` is the name for messages.
pub fn packed(path: &Path, text: &[u8]) -> Result<Vec<u8>, StoreError> {
    zstd::bulk::compress(text, LEVEL).map_err(|source| StoreError::io("compress", path, source))
}

fn is_compressed(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending == "zst")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_text_may_be_as_long_as_the_bound_says_plain_and_compressed() {
        let dir = tempfile::tempdir().unwrap();
        let text = vec![b'a'; 1000];
        for name in ["plain.txt", "packed.zst"] {
            let path = dir.path().join(name);
            write_text(&path, &text).unwrap();
            assert_eq!(read_text(&path, 1000).unwrap().unwrap(), text, "{name}");
        }
        assert!(matches!(read_text(&dir.path().join("plain.txt"), 999), Err(StoreError::TooLarge { .. })));
        let (expected, found) = read_text(&dir.path().join("packed.zst"), 999).unwrap().unwrap_err();
        assert_eq!((expected.as_str(), found.as_str()), ("at most 999 bytes after decompression", "more"));
    }

    #[test]
    fn a_compressed_text_is_known_by_its_bytes_or_by_its_name() {
        let dir = tempfile::tempdir().unwrap();
        let (packed, copy) = (dir.path().join("text.zst"), dir.path().join("text.txt"));
        write_text(&packed, b"a text").unwrap();
        std::fs::copy(&packed, &copy).unwrap();
        assert_eq!(read_text(&copy, 100).unwrap().unwrap(), b"a text");
        // A file that has the name but not the content is reported as damaged.
        std::fs::write(&packed, b"a text").unwrap();
        assert_eq!(read_text(&packed, 100).unwrap().unwrap_err().0, "a whole zstd stream");
    }

    /// A kilobyte of a compressed file that comes to a hundred megabytes: no more of it is read than the limit lets.
    #[test]
    fn a_compressed_text_comes_to_so_many_bytes_for_each_of_its_own_and_no_more() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("bomb.zst");
        write_text(&path, &vec![b'\n'; 100 << 20]).unwrap();
        let (expected, _) = read_text(&path, 1 << 30).unwrap().unwrap_err();
        assert!(expected.contains("for each byte of the file"), "{expected}");
        let mut lines = text_lines(&path, 1 << 30).unwrap();
        assert_eq!(lines.next_line().unwrap().unwrap().bytes, b"", "what stands ahead of the limit is read");
    }
}
