//! Text files that may be compressed: written so where their name ends in `.zst`, recognised by their content when read.

use std::io::Read;
use std::path::Path;

use super::StoreError;
use super::file::{read_bounded, write_atomic};

/// First bytes of a zstd frame (RFC 8878, section 3.1.1).
const ZSTD_MAGIC: [u8; 4] = [0x28, 0xB5, 0x2F, 0xFD];
/// A study's cassette of 280 MB becomes 16 MB in eight seconds; the levels above 16 save a sixth of that and take minutes.
const LEVEL: i32 = 12;

/// A file's text, at most `max_bytes` before and after decompression. The inner error says what was expected, and what was
/// found, where the compressed stream is damaged.
#[allow(clippy::type_complexity)]
pub fn read_text(path: &Path, max_bytes: u64) -> Result<Result<Vec<u8>, (String, String)>, StoreError> {
    let bytes = read_bounded(path, max_bytes)?;
    // Compression is recognised by the content, so that a copy under another name can be read too.
    if bytes.starts_with(&ZSTD_MAGIC) || is_compressed(path) {
        return Ok(decompress(&bytes, max_bytes));
    }
    Ok(Ok(bytes))
}

/// Writes a text whole or not at all; compressed when its name ends in `.zst`.
pub fn write_text(path: &Path, text: &[u8]) -> Result<(), StoreError> {
    if !is_compressed(path) {
        return write_atomic(path, text);
    }
    let packed = zstd::bulk::compress(text, LEVEL).map_err(|source| StoreError::io("compress", path, source))?;
    write_atomic(path, &packed)
}

fn is_compressed(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending == "zst")
}

fn decompress(bytes: &[u8], max_bytes: u64) -> Result<Vec<u8>, (String, String)> {
    let mut text = Vec::new();
    let decoder = zstd::stream::read::Decoder::new(bytes).map_err(|e| ("a zstd stream".to_string(), e.to_string()))?;
    let whole = decoder.take(max_bytes + 1).read_to_end(&mut text);
    whole.map_err(|e| ("a whole zstd stream".to_string(), e.to_string()))?;
    if text.len() as u64 > max_bytes {
        return Err((format!("at most {max_bytes} bytes after decompression"), "more".to_string()));
    }
    Ok(text)
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
}
