//! Strict reading of a reply: exactly one JSON object and nothing else. Models make many kinds of errors; each is
//! reported with its place.

use serde::de::{DeserializeSeed, Error as _, MapAccess, SeqAccess, Visitor};
use serde_json::{Map, Number, Value};

/// A reply longer than this is refused unread.
pub const MAX_BYTES: usize = 256 << 10;
/// Objects and lists may be nested this deep.
pub const MAX_DEPTH: usize = 64;

/// Why a reply cannot be used. This is not a failure of the program: it becomes part of the attempt.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("line {line} column {column}: expected {expected}, found {found}")]
pub struct Refusal {
    /// From 1.
    pub line: usize,
    /// From 1, in bytes.
    pub column: usize,
    /// Value that the schema asks for.
    pub expected: String,
    /// Value that the answer holds.
    pub found: String,
}

/// Reads the bytes as exactly one JSON object: UTF-8, no prose or code fence around it, no duplicate key in an object,
/// every number finite, at most `MAX_BYTES` long and `MAX_DEPTH` deep.
pub fn json_object(bytes: &[u8]) -> Result<Value, Refusal> {
    let refuse =
        |line, column, expected: &str, found: String| Refusal { line, column, expected: expected.to_string(), found };
    if bytes.len() > MAX_BYTES {
        return Err(refuse(1, 1, &format!("at most {MAX_BYTES} bytes"), format!("{} bytes", bytes.len())));
    }
    let text = std::str::from_utf8(bytes).map_err(|error| {
        let (line, column) = place(&bytes[..error.valid_up_to()]);
        refuse(line, column, "UTF-8", "a byte that is none".to_string())
    })?;
    let start = text.len() - text.trim_start_matches([' ', '\t', '\r', '\n']).len();
    if !text[start..].starts_with('{') {
        let (line, column) = place(&bytes[..start]);
        let found = text[start..].chars().take(24).collect::<String>();
        let found = if found.is_empty() { "an empty reply".to_string() } else { format!("{found:?}") };
        return Err(refuse(line, column, "one JSON object and nothing around it", found));
    }
    let mut deserializer = serde_json::Deserializer::from_str(text);
    let value = Strict { depth: MAX_DEPTH }.deserialize(&mut deserializer);
    value.and_then(|value| deserializer.end().map(|()| value)).map_err(|error| {
        let full = error.to_string();
        let found = full.split(" at line ").next().unwrap_or(&full).to_string();
        refuse(error.line().max(1), error.column().max(1), "one JSON object and nothing around it", found)
    })
}

/// Line and column, from 1, of the byte behind these.
fn place(before: &[u8]) -> (usize, usize) {
    let line = before.iter().filter(|b| **b == b'\n').count() + 1;
    let column = before.iter().rev().take_while(|b| **b != b'\n').count() + 1;
    (line, column)
}

/// Builds a value, with `depth` levels left.
#[derive(Clone, Copy)]
struct Strict {
    depth: usize,
}

impl Strict {
    fn deeper<E: serde::de::Error>(self) -> Result<Strict, E> {
        let depth = self.depth.checked_sub(1).ok_or_else(|| E::custom(format!("nesting deeper than {MAX_DEPTH}")))?;
        Ok(Strict { depth })
    }
}

impl<'de> DeserializeSeed<'de> for Strict {
    type Value = Value;
    fn deserialize<D: serde::Deserializer<'de>>(self, deserializer: D) -> Result<Value, D::Error> {
        deserializer.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for Strict {
    type Value = Value;

    fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("a JSON value")
    }

    fn visit_bool<E>(self, v: bool) -> Result<Value, E> {
        Ok(Value::Bool(v))
    }

    fn visit_u64<E>(self, v: u64) -> Result<Value, E> {
        Ok(Value::Number(v.into()))
    }

    fn visit_i64<E>(self, v: i64) -> Result<Value, E> {
        Ok(Value::Number(v.into()))
    }

    fn visit_f64<E: serde::de::Error>(self, v: f64) -> Result<Value, E> {
        Number::from_f64(v).map(Value::Number).ok_or_else(|| E::custom("a number that is not finite"))
    }

    fn visit_str<E>(self, v: &str) -> Result<Value, E> {
        Ok(Value::String(v.to_string()))
    }

    fn visit_unit<E>(self) -> Result<Value, E> {
        Ok(Value::Null)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut items: A) -> Result<Value, A::Error> {
        let inner = self.deeper()?;
        let mut list = Vec::new();
        while let Some(item) = items.next_element_seed(inner)? {
            list.push(item);
        }
        Ok(Value::Array(list))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut entries: A) -> Result<Value, A::Error> {
        let inner = self.deeper()?;
        let mut map = Map::new();
        while let Some(key) = entries.next_key::<String>()? {
            if map.contains_key(&key) {
                return Err(A::Error::custom(format!("the key {:?} twice", crate::store::shortened(&key))));
            }
            let value = entries.next_value_seed(inner)?;
            map.insert(key, value);
        }
        Ok(Value::Object(map))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refusal(text: &str) -> Refusal {
        json_object(text.as_bytes()).expect_err(text)
    }

    #[test]
    fn an_object_with_white_space_around_it_is_read() {
        let value = json_object(b" \n{\"a\": [1, -2, 0.5, null, true, \"\xc3\xbc\"]}\r\n").unwrap();
        assert_eq!(value, serde_json::json!({"a": [1, -2, 0.5, null, true, "ü"]}));
    }

    #[test]
    fn prose_and_code_fences_around_the_object_are_refused() {
        assert!(refusal("Sure! {}").found.contains("Sure!"));
        assert!(refusal("```json\n{}\n```").found.contains("```json"));
        assert_eq!((refusal("{}\nDone.").line, refusal("{}\nDone.").column), (2, 1));
        assert!(refusal("{}{}").found.contains("trailing"));
        assert!(refusal("[]").expected.contains("object"));
        assert!(refusal(" ").found.contains("empty"));
    }

    #[test]
    fn a_key_twice_is_refused_at_its_place() {
        let twice = refusal("{\n \"a\": {\"b\": 1, \"b\": 2}}");
        assert!(twice.found.contains("\"b\" twice"), "{twice}");
        assert_eq!(twice.line, 2);
    }

    #[test]
    fn numbers_that_are_not_finite_are_refused() {
        assert!(refusal("{\"a\": 1e999}").found.contains("out of range"));
        refusal("{\"a\": NaN}");
        refusal("{\"a\": -Infinity}");
    }

    #[test]
    fn depth_and_size_are_bounded() {
        let nested = |n: usize| format!("{{\"a\":{}{}}}", "[".repeat(n), "]".repeat(n));
        json_object(nested(MAX_DEPTH - 1).as_bytes()).unwrap();
        assert!(refusal(&nested(MAX_DEPTH)).found.contains("nesting deeper"));
        assert!(refusal(&nested(100_000)).found.contains("nesting deeper"));
        assert!(refusal(&format!("{{\"a\":\"{}\"}}", "x".repeat(MAX_BYTES))).expected.contains("bytes"));
    }

    #[test]
    fn bytes_that_are_no_text_are_refused_at_their_place() {
        let error = json_object(b"{\n\"a\": \"\xff\"}").unwrap_err();
        assert_eq!((error.line, error.column, error.expected.as_str()), (2, 7, "UTF-8"));
    }

    proptest::proptest! {
        #[test]
        fn no_bytes_make_it_panic(bytes in proptest::collection::vec(proptest::prelude::any::<u8>(), 0..200)) {
            let _ = json_object(&bytes);
        }
    }
}
