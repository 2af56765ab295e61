//! Reads JSON into the same tree of values as a pickle, so that one reader serves both. The parser bounds the nesting.

use std::fmt;

use serde::de::{DeserializeSeed, Deserializer, Error, MapAccess, SeqAccess, Visitor};

use super::{Kind, OBJECTS_MAX, Object, Pickle, VALUES_MAX, Value};
use crate::formats::import_error::{ImportError, shown};
use crate::formats::json_numbers::without_nan;

const BYTES_MAX: usize = 256 << 20;

/// Reads a whole JSON document.
///
/// Python's `NaN` and `Infinity` are read as `null`.
///
/// # Errors The text is not JSON, is nested deeper than 128, or has more than 256 MiB or 16 million values.
pub fn read_json<'a>(file: &'a str, bytes: &'a [u8]) -> Result<Pickle<'a>, ImportError> {
    let remedy = "mend the file or write it again";
    if bytes.len() > BYTES_MAX {
        return Err(ImportError::new(file, "byte 0", "at most 256 MiB of JSON", "split the file"));
    }
    let mut made = Made::default();
    let mended = without_nan(bytes);
    let mut parser = serde_json::Deserializer::from_slice(&mended);
    let read = Tree(&mut made).deserialize(&mut parser).and_then(|root| parser.end().map(|()| root));
    let root = read.map_err(|error| {
        let place = format!("line {}, column {}", error.line(), error.column());
        ImportError::new(file, place, format!("JSON ({})", shown(&error.to_string())), remedy)
    })?;
    Ok(Pickle { file, kind: Kind::Scene, bytes, objects: made.objects, root, listed: Default::default() })
}

/// Objects built so far, and the number of values.
#[derive(Default)]
struct Made {
    objects: Vec<Object>,
    values: usize,
}

/// Builds the values below one place of the document.
struct Tree<'o>(&'o mut Made);

impl Tree<'_> {
    fn object<E: Error>(self, object: Object) -> Result<Value, E> {
        if self.0.objects.len() >= OBJECTS_MAX {
            return Err(E::custom("more than 4 million lists, objects and texts"));
        }
        let index = self.0.objects.len() as u32;
        self.0.objects.push(object);
        Ok(Value::Object(index))
    }
}

impl<'de> DeserializeSeed<'de> for Tree<'_> {
    type Value = Value;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Value, D::Error> {
        self.0.values += 1;
        if self.0.values > VALUES_MAX {
            return Err(D::Error::custom("more than 16 million values"));
        }
        deserializer.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for Tree<'_> {
    type Value = Value;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a JSON value")
    }

    fn visit_unit<E: Error>(self) -> Result<Value, E> {
        Ok(Value::None)
    }

    fn visit_bool<E: Error>(self, value: bool) -> Result<Value, E> {
        Ok(Value::Bool(value))
    }

    fn visit_i64<E: Error>(self, value: i64) -> Result<Value, E> {
        Ok(Value::Int(value))
    }

    fn visit_u64<E: Error>(self, value: u64) -> Result<Value, E> {
        Ok(i64::try_from(value).map_or(Value::Float(value as f64), Value::Int))
    }

    fn visit_f64<E: Error>(self, value: f64) -> Result<Value, E> {
        Ok(Value::Float(value))
    }

    fn visit_str<E: Error>(self, value: &str) -> Result<Value, E> {
        self.object(Object::OwnedText(value.to_string()))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<Value, A::Error> {
        let mut items = Vec::new();
        while let Some(item) = seq.next_element_seed(Tree(self.0))? {
            items.push(item);
        }
        self.object(Object::List(items))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Value, A::Error> {
        let mut entries = Vec::new();
        while let Some(key) = map.next_key_seed(Tree(self.0))? {
            entries.push((key, map.next_value_seed(Tree(self.0))?));
        }
        self.object(Object::Dict(entries))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_document_reads_like_a_pickle() {
        let tree = read_json("f.json", br#"{"a": [[1, 2.5], [true, -3]], "b": {"c": null}, "7": "x"}"#).unwrap();
        let table = tree.root().get("a").and_then(|a| a.numbers()).unwrap();
        assert_eq!((table.rows, table.columns, table.at(0, 1), table.at(1, 0)), (2, 2, 2.5, 1.0));
        assert!(tree.root().get("b").and_then(|b| b.get("c")).unwrap().is_none());
        assert_eq!(tree.root().get("7").and_then(|x| x.text()), Some("x"));
    }

    #[test]
    fn what_is_no_json_is_refused_with_its_place() {
        let refused = |text: &str| match read_json("f.json", text.as_bytes()) {
            Ok(_) => panic!("accepted {text:.40}"),
            Err(error) => error.to_string(),
        };
        assert!(refused("{\"a\": Nan}").contains("line 1, column"));
        assert!(refused(&"[".repeat(100_000)).contains("recursion"));
        assert!(refused("{\"a\": 1e999}").contains("out of range"));
        assert!(refused("{} {}").contains("trailing"));
        assert!(refused("").contains("line 1"));
    }
}
