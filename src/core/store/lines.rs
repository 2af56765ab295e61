//! Lines of a stored file, read one by one: no more of a file is held than the part in use, and a line that is longer, or
//! heavier in memory, than any that is written ends the reading.

use std::io::BufRead;

/// Most bytes of a line of a stored file.
pub const LINE_BYTES_MAX: usize = 32 << 20;
/// Most bytes that the values of one line may take in memory.
const LINE_WEIGHT_MAX: usize = 160 << 20;
/// Shorter lines are not weighed: they cannot be too heavy.
const UNWEIGHED: usize = 1 << 20;
/// Bytes that an object, a key and an item take in memory.
const OBJECT_WEIGHT: usize = 600;
const KEY_WEIGHT: usize = 40;
const ITEM_WEIGHT: usize = 48;
/// Bytes that a table of a TOML text takes in memory while the file is checked: measured, 1.7 KB.
const TOML_TABLE_WEIGHT: usize = 1500;
/// Bytes that each character which ends a word takes, a line feed too.
const TOML_TOKEN_WEIGHT: usize = 64;
/// Least bytes that a line counts for where lines are read together, so that many empty ones are no small piece.
const LINE_COUNTS_AS: usize = 256;

/// A line of a file, without its line feed.
#[derive(Debug, PartialEq, Eq)]
pub struct Line {
    /// Content of the line; of one that is too long, its beginning.
    pub bytes: Vec<u8>,
    /// A line feed ends it.
    pub ended: bool,
}

/// Returns the next line; `None` at the end of the file. One longer than the limit is cut one byte behind it and reported by `too_large`.
pub fn next_line(from: &mut impl BufRead) -> std::io::Result<Option<Line>> {
    let mut bytes = Vec::new();
    // The limit bounds the memory, so that a device without an end is no danger.
    let most = LINE_BYTES_MAX as u64 + 2;
    if std::io::Read::take(&mut *from, most).read_until(b'\n', &mut bytes)? == 0 {
        return Ok(None);
    }
    let ended = bytes.pop_if(|last| *last == b'\n').is_some();
    Ok(Some(Line { bytes, ended }))
}

/// Returns the next lines from `next`, at least one where there is one, until they have this many bytes.
pub fn batch<E>(mut next: impl FnMut() -> Result<Option<Line>, E>, bytes: usize) -> Result<Vec<Line>, E> {
    let (mut lines, mut read) = (Vec::new(), 0);
    while read < bytes {
        let Some(line) = next()? else { break };
        read += line.bytes.len().max(LINE_COUNTS_AS);
        lines.push(line);
    }
    Ok(lines)
}

/// Returns what was expected and what was found, where the line is too long or its values take too much memory.
pub fn too_large(line: &[u8]) -> Option<(String, String)> {
    if line.len() > LINE_BYTES_MAX {
        return Some((format!("at most {LINE_BYTES_MAX} bytes in a line"), "a longer one".into()));
    }
    let weight = weight(line);
    let expected = || format!("a line whose values take at most {LINE_WEIGHT_MAX} bytes of memory");
    (weight > LINE_WEIGHT_MAX).then(|| (expected(), format!("one that may take {weight}")))
}

/// Checks a TOML text likewise; its reader keeps a table for each name and each part of a dotted name, and copies of them.
pub fn toml_too_large(text: &str) -> Option<(String, String)> {
    let mut weight = text.len();
    let mut before = b' ';
    for byte in text.bytes() {
        weight += match byte {
            b'=' | b'.' | b'{' | b'[' => TOML_TABLE_WEIGHT,
            b' ' if before == b' ' => 0,
            byte if byte.is_ascii_alphanumeric() => 0,
            _ => TOML_TOKEN_WEIGHT,
        };
        before = byte;
    }
    let expected = || format!("a file whose values take at most {LINE_WEIGHT_MAX} bytes of memory");
    (weight > LINE_WEIGHT_MAX).then(|| (expected(), format!("one that may take {weight}")))
}

/// Returns the most bytes that the values of a JSON text take in memory: a pair of brackets is two bytes in the file and hundreds here.
fn weight(text: &[u8]) -> usize {
    if text.len() <= UNWEIGHED {
        return text.len();
    }
    let (mut weight, mut quoted, mut escaped) = (text.len(), false, false);
    for byte in text {
        match byte {
            _ if escaped => escaped = false,
            b'\\' if quoted => escaped = true,
            b'"' => quoted = !quoted,
            b'{' if !quoted => weight += OBJECT_WEIGHT,
            b':' if !quoted => weight += KEY_WEIGHT,
            b',' | b'[' if !quoted => weight += ITEM_WEIGHT,
            _ => {}
        }
    }
    weight
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_come_one_by_one_and_an_empty_one_is_a_line() {
        let mut from = &b"one\n\nlast"[..];
        let mut next = || next_line(&mut from).unwrap().map(|line| (line.bytes, line.ended));
        assert_eq!(next(), Some((b"one".to_vec(), true)));
        assert_eq!(next(), Some((Vec::new(), true)));
        assert_eq!(next(), Some((b"last".to_vec(), false)));
        assert_eq!(next(), None);
    }

    #[test]
    fn a_piece_of_empty_lines_has_few_of_them() {
        let mut from = &[b'\n'; 10_000][..];
        assert_eq!(batch(|| next_line(&mut from), 1024).unwrap().len(), 4);
    }

    #[test]
    fn a_line_without_an_end_is_read_up_to_the_limit_and_no_further() {
        let mut endless = std::io::BufReader::new(std::io::repeat(0));
        let line = next_line(&mut endless).unwrap().unwrap();
        assert_eq!((line.bytes.len(), line.ended), (LINE_BYTES_MAX + 2, false));
        assert!(too_large(&line.bytes).unwrap().0.contains("in a line"));
        assert_eq!(too_large(&line.bytes[..LINE_BYTES_MAX]), None);
    }

    #[test]
    fn a_file_of_small_tables_is_too_heavy_and_a_long_text_is_not() {
        let tables = |count: usize| (0..count).map(|k| format!("k{k}={{a.b.c=1}}\n")).collect::<String>();
        assert_eq!(toml_too_large(&tables(10_000)), None);
        assert!(toml_too_large(&tables(60_000)).unwrap().0.contains("of memory"));
        assert!(toml_too_large(&"\n".repeat(4_000_000)).is_some() && toml_too_large(&"a ".repeat(4_000_000)).is_some());
        assert_eq!(toml_too_large(&format!("weights = \"{}\"\n", "aGVs".repeat(10_000_000))), None);
    }

    #[test]
    fn a_line_of_small_objects_is_too_heavy_long_before_it_is_too_long() {
        let objects = |count: usize| format!("[{}{{}}]", r#"{"a":0},"#.repeat(count)).into_bytes();
        assert_eq!(too_large(&objects(200_000)), None);
        assert!(too_large(&objects(300_000)).unwrap().0.contains("of memory"));
        // A bracket inside a text is no bracket.
        let text = format!("\"{}\"", r#"\"{\"a\":0},"#.repeat(300_000)).into_bytes();
        assert_eq!(too_large(&text), None);
    }
}
