//! Halves of surrogate pairs and bytes that are no UTF-8, in a server's JSON: a model wrote half a character. No JSON reader takes
//! them, so they are lifted into characters that nobody uses, and lowered again into the bytes that they are. A reply that holds
//! some is not UTF-8, and the strict reader refuses it.

/// First of the 2048 characters that stand for halves while the JSON is read: the last private plane.
const HALVES: u32 = 0x10_F000;
/// First of the 256 characters that stand for bytes.
const BYTES: u32 = 0x10_F800;

/// The body with its halves and stray bytes lifted; none where it has none.
pub fn lifted(body: &[u8]) -> Option<Vec<u8>> {
    let mut text = String::new();
    for part in body.utf8_chunks() {
        text.push_str(part.valid());
        text.extend(part.invalid().iter().filter_map(|byte| char::from_u32(BYTES + u32::from(*byte))));
    }
    let text = without_lone_escapes(&text);
    (text.as_bytes() != body).then(|| text.into_bytes())
}

/// The text of a lifted body as it came, in bytes.
pub fn lowered(text: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(text.len());
    for c in String::from_utf8_lossy(text).chars() {
        match u32::from(c) {
            lifted @ BYTES..=0x10_F8FF => bytes.push((lifted - BYTES) as u8),
            lifted @ HALVES..BYTES => {
                // As UTF-8 would write it if it were a character.
                let half = 0xD800 + lifted - HALVES;
                bytes.extend([0xE0 | (half >> 12) as u8, 0x80 | (half >> 6 & 0x3F) as u8, 0x80 | (half & 0x3F) as u8]);
            }
            _ => bytes.extend(c.encode_utf8(&mut [0; 4]).as_bytes()),
        }
    }
    bytes
}

fn without_lone_escapes(text: &str) -> String {
    let (mut out, mut rest) = (String::with_capacity(text.len()), text);
    while let Some(at) = rest.find('\\') {
        out.push_str(&rest[..at]);
        rest = &rest[at..];
        let taken = match (half(rest, 0), half(rest, 6)) {
            (Some(0xD800..0xDC00), Some(0xDC00..0xE000)) => 12,
            (Some(code), _) => {
                out.extend(char::from_u32(HALVES + code - 0xD800));
                rest = &rest[6..];
                continue;
            }
            // A backslash and what it escapes, which may be a backslash.
            _ => 1 + rest.chars().nth(1).map_or(0, char::len_utf8),
        };
        out.push_str(&rest[..taken]);
        rest = &rest[taken..];
    }
    out.push_str(rest);
    out
}

/// The code of an escape of half a pair that begins there.
fn half(text: &str, at: usize) -> Option<u32> {
    let digits = text.get(at..)?.strip_prefix("\\u")?.get(..4)?;
    u32::from_str_radix(digits, 16).ok().filter(|code| (0xD800..0xE000).contains(code))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The string that the JSON holds, as bytes.
    fn read(json: &[u8]) -> Vec<u8> {
        let text: String = serde_json::from_slice(&lifted(json).unwrap()).unwrap();
        lowered(text.as_bytes())
    }

    #[test]
    fn half_a_pair_becomes_the_bytes_that_it_would_have_and_whole_pairs_stay() {
        assert_eq!(read(br#""a\ud83d b\ude00""#), b"a\xed\xa0\xbd b\xed\xb8\x80");
        assert_eq!(read(br#""\ud83d\ude00 \ud83d\\""#), b"\xf0\x9f\x98\x80 \xed\xa0\xbd\\");
        assert_eq!(lifted(br#""\ud83d\ude00 \\ud83d""#), None);
    }

    #[test]
    fn a_stray_byte_stays_that_byte() {
        assert_eq!(read(b"\"\xc3\xbc \xff \xf0\x9f\""), b"\xc3\xbc \xff \xf0\x9f");
    }

    proptest::proptest! {
        #[test]
        fn no_bytes_make_it_panic(bytes in proptest::collection::vec(proptest::prelude::any::<u8>(), 0..60), text in "[\\\\ud83c\"]{0,40}") {
            for body in [bytes, text.into_bytes()] {
                if let Some(lifted) = lifted(&body) {
                    lowered(&lifted);
                }
            }
        }
    }
}
