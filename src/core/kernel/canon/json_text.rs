//! JSON text of canonical bytes: one spelling for one value. Objects are sorted by key, there are no spaces, and
//! numbers and texts look as `serde_json` prints them. A value that was serialised once for its digest can thus be
//! printed from the same bytes, without building a tree of it.

use super::{CanonError, FALSE, FLOAT, LIST, MAP, NEGATIVE, TEXT, TRUE, UNIT, UNSIGNED};

/// Returns JSON texts of the elements of a list, given as `canonical_json_bytes`: one text and where each element ends in it.
///
/// # Errors
/// An element nested deeper than `depth`; bytes that are not those of a list as JSON.
pub fn elements(bytes: &[u8], depth: usize) -> Result<(Vec<u8>, Vec<usize>), CanonError> {
    let mut page = Page { bytes, at: 0, entries: Vec::new(), sorted: Vec::new() };
    if page.tag()? != LIST {
        return Err(not_json());
    }
    let count = page.number()?;
    let (mut text, mut ends) = (Vec::with_capacity(bytes.len()), Vec::new());
    for _ in 0..count {
        page.value(&mut text, depth)?;
        ends.push(text.len());
    }
    if page.at == bytes.len() { Ok((text, ends)) } else { Err(not_json()) }
}

fn not_json() -> CanonError {
    CanonError::Other("expected the canonical bytes of a JSON list, found others".into())
}

/// An entry of an object that is being printed: its key, and where its text begins and ends.
struct Entry<'a> {
    key: &'a str,
    begin: usize,
    end: usize,
}

/// The state of the reader, and the buffer in which objects sort their entries.
struct Page<'a> {
    bytes: &'a [u8],
    at: usize,
    /// Entries of every open object, innermost last.
    entries: Vec<Entry<'a>>,
    sorted: Vec<u8>,
}

impl<'a> Page<'a> {
    fn take(&mut self, count: usize) -> Result<&'a [u8], CanonError> {
        let end = self.at.checked_add(count).filter(|end| *end <= self.bytes.len()).ok_or_else(not_json)?;
        let taken = &self.bytes[self.at..end];
        self.at = end;
        Ok(taken)
    }

    fn tag(&mut self) -> Result<u8, CanonError> {
        Ok(self.take(1)?[0])
    }

    fn number(&mut self) -> Result<u64, CanonError> {
        let mut bytes = [0; 8];
        bytes.copy_from_slice(self.take(8)?);
        Ok(u64::from_le_bytes(bytes))
    }

    fn value(&mut self, out: &mut Vec<u8>, depth: usize) -> Result<(), CanonError> {
        match self.tag()? {
            UNIT => out.extend_from_slice(b"null"),
            FALSE => out.extend_from_slice(b"false"),
            TRUE => out.extend_from_slice(b"true"),
            UNSIGNED => print(out, &self.number()?)?,
            NEGATIVE => print(out, &-i128::from(self.number()?))?,
            FLOAT => print(out, &f64::from_bits(self.number()?))?,
            TEXT => print(out, self.text()?)?,
            LIST => self.list(out, deeper(depth)?)?,
            MAP => self.object(out, deeper(depth)?)?,
            _ => return Err(not_json()),
        }
        Ok(())
    }

    fn text(&mut self) -> Result<&'a str, CanonError> {
        let length = usize::try_from(self.number()?).map_err(|_| not_json())?;
        std::str::from_utf8(self.take(length)?).map_err(|_| not_json())
    }

    fn list(&mut self, out: &mut Vec<u8>, depth: usize) -> Result<(), CanonError> {
        let count = self.number()?;
        out.push(b'[');
        for place in 0..count {
            if place > 0 {
                out.push(b',');
            }
            self.value(out, depth)?;
        }
        out.push(b']');
        Ok(())
    }

    /// Canonical bytes sort keys by length first, JSON text sorts them by their letters. So entries are printed as they
    /// come and sorted afterwards.
    fn object(&mut self, out: &mut Vec<u8>, depth: usize) -> Result<(), CanonError> {
        let count = self.number()?;
        let first = self.entries.len();
        out.push(b'{');
        let entries_at = out.len();
        for place in 0..count {
            if place > 0 {
                out.push(b',');
            }
            let begin = out.len();
            if self.tag()? != TEXT {
                return Err(not_json());
            }
            let key = self.text()?;
            print(out, key)?;
            out.push(b':');
            self.value(out, depth)?;
            self.entries.push(Entry { key, begin, end: out.len() });
        }
        self.sort(out, entries_at, first);
        out.push(b'}');
        Ok(())
    }

    fn sort(&mut self, out: &mut Vec<u8>, entries_at: usize, first: usize) {
        let own = &mut self.entries[first..];
        if !own.is_sorted_by(|a, b| a.key <= b.key) {
            own.sort_unstable_by(|a, b| a.key.cmp(b.key));
            self.sorted.clear();
            for (place, entry) in own.iter().enumerate() {
                if place > 0 {
                    self.sorted.push(b',');
                }
                self.sorted.extend_from_slice(&out[entry.begin..entry.end]);
            }
            out.truncate(entries_at);
            out.extend_from_slice(&self.sorted);
        }
        self.entries.truncate(first);
    }
}

fn deeper(depth: usize) -> Result<usize, CanonError> {
    depth.checked_sub(1).ok_or_else(|| CanonError::Other("it is nested too deep to be read back".into()))
}

fn print<T: serde::Serialize + ?Sized>(out: &mut Vec<u8>, scalar: &T) -> Result<(), CanonError> {
    serde_json::to_writer(out, scalar).map_err(|error| CanonError::Other(error.to_string()))
}

#[cfg(test)]
mod tests {
    use super::super::canonical_json_bytes;
    use super::*;
    use proptest::prelude::*;
    use serde_json::{Value, json};

    fn printed(value: &Value) -> String {
        let bytes = canonical_json_bytes(&[value]).unwrap();
        String::from_utf8(elements(&bytes, 100).unwrap().0).unwrap()
    }

    #[test]
    fn keys_come_in_order_of_their_letters() {
        let text = r#"{"b":{"z":null,"aa":[]},"ab":-1,"a":true,"a ":0.1,"a\"":"ü\n","é":2.5}"#;
        let value: Value = serde_json::from_str(text).unwrap();
        let sorted = r#"{"a":true,"a ":0.1,"a\"":"ü\n","ab":-1,"b":{"aa":[],"z":null},"é":2.5}"#;
        assert_eq!(printed(&value), sorted);
    }

    #[test]
    fn the_extremes_of_whole_numbers_keep_their_digits() {
        assert_eq!(printed(&json!([i64::MIN, u64::MAX, 0])), "[-9223372036854775808,18446744073709551615,0]");
    }

    #[test]
    fn what_is_nested_deeper_than_asked_is_refused() {
        let bytes = canonical_json_bytes(&json!([[[0]]])).unwrap();
        assert!(elements(&bytes, 2).is_ok());
        assert!(elements(&bytes, 1).is_err());
    }

    #[test]
    fn bytes_that_break_off_are_refused() {
        let bytes = canonical_json_bytes(&json!([{"a": [1, "x", 2.5]}])).unwrap();
        for end in 0..bytes.len() {
            assert!(elements(&bytes[..end], 100).is_err(), "cut at {end}");
        }
    }

    fn any_json() -> impl Strategy<Value = Value> {
        let leaf = prop_oneof![
            Just(Value::Null),
            any::<bool>().prop_map(Value::from),
            any::<i64>().prop_map(Value::from),
            any::<f64>().prop_filter("JSON knows no others", |x| x.is_finite() && *x != 0.0).prop_map(Value::from),
            any::<String>().prop_map(Value::from),
        ];
        leaf.prop_recursive(4, 32, 5, |inner| {
            prop_oneof![
                prop::collection::vec(inner.clone(), 0..5).prop_map(Value::from),
                prop::collection::btree_map("[a-c\" \\\\é\u{1}]{0,4}", inner, 0..5)
                    .prop_map(|map| Value::Object(map.into_iter().collect())),
            ]
        })
    }

    proptest! {
        #[test]
        fn a_value_is_printed_as_serde_json_prints_it(value in any_json()) {
            prop_assert_eq!(printed(&value), value.to_string());
        }
    }
}
