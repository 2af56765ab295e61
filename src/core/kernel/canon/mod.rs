//! Canonical bytes of any serialisable value: tagged, length-prefixed binary, maps and structs sorted by
//! key, floats as bits. It never goes through a JSON library's text, so neither number formatting nor the
//! `preserve_order` feature can change a key. Every field counts unless its type skips it (a deny-list).

pub mod json_text;

use serde::ser::{self, Serialize};

/// Why a value has no canonical form.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum CanonError {
    /// A float is NaN or infinite.
    #[error("a NaN or an infinity cannot be stored; the producer must refuse it first")]
    NotFinite,
    /// Message of serde.
    #[error("{0}")]
    Other(String),
}

impl ser::Error for CanonError {
    fn custom<T: std::fmt::Display>(message: T) -> Self {
        CanonError::Other(message.to_string())
    }
}

/// Canonical bytes. Equal values give equal bytes for any order of fields or map entries.
pub fn canonical_bytes<T: Serialize + ?Sized>(value: &T) -> Result<Vec<u8>, CanonError> {
    written(value, false)
}

/// Canonical bytes of the JSON that a value serialises to: those of `serde_json::to_value(value)`, without building it.
/// Two values that look the same in JSON (an absent value and null, a variant and a one-entry object) give the same
/// bytes.
pub fn canonical_json_bytes<T: Serialize + ?Sized>(value: &T) -> Result<Vec<u8>, CanonError> {
    written(value, true)
}

fn written<T: Serialize + ?Sized>(value: &T, as_json: bool) -> Result<Vec<u8>, CanonError> {
    let mut sheet = Sheet { out: Vec::with_capacity(4096), entries: Vec::new(), sorted: Vec::new(), as_json };
    value.serialize(Writer { sheet: &mut sheet })?;
    Ok(sheet.out)
}

/// The bytes written so far, and a buffer in which maps sort their entries. All maps share it, so a map allocates
/// nothing.
struct Sheet {
    out: Vec<u8>,
    /// (begin of key, begin of value, end) of the entries of every open map, innermost last.
    entries: Vec<(usize, usize, usize)>,
    sorted: Vec<u8>,
    /// True to write the value's JSON form.
    as_json: bool,
}

// One tag byte opens every value. Tags are part of the format: never renumber.
const NONE: u8 = 0;
const SOME: u8 = 1;
const FALSE: u8 = 2;
const TRUE: u8 = 3;
const UNSIGNED: u8 = 4;
const NEGATIVE: u8 = 5;
const FLOAT: u8 = 6;
const TEXT: u8 = 7;
const BYTES: u8 = 8;
const LIST: u8 = 9;
const MAP: u8 = 10;
const UNIT: u8 = 11;
const VARIANT: u8 = 12;

struct Writer<'a> {
    sheet: &'a mut Sheet,
}

impl Writer<'_> {
    /// Opens a variant with content: in JSON an object of one entry.
    fn variant(&mut self, name: &str) {
        if self.sheet.as_json {
            self.tagged_u64(MAP, 1);
            self.blob(TEXT, name.as_bytes());
        } else {
            self.blob(VARIANT, name.as_bytes());
        }
    }

    fn tagged_u64(&mut self, tag: u8, value: u64) {
        self.sheet.out.push(tag);
        self.sheet.out.extend_from_slice(&value.to_le_bytes());
    }

    fn blob(&mut self, tag: u8, bytes: &[u8]) {
        self.tagged_u64(tag, bytes.len() as u64);
        self.sheet.out.extend_from_slice(bytes);
    }
}

/// Elements in order. They are counted at the end, because serde does not always know the count in advance.
struct List<'a> {
    sheet: &'a mut Sheet,
    count_at: usize,
    count: u64,
}

impl<'a> List<'a> {
    fn open(sheet: &'a mut Sheet) -> List<'a> {
        let count_at = sheet.open(LIST);
        List { sheet, count_at, count: 0 }
    }

    fn push<T: Serialize + ?Sized>(&mut self, value: &T) -> Result<(), CanonError> {
        self.count += 1;
        value.serialize(Writer { sheet: self.sheet })
    }

    fn close(self) -> Result<(), CanonError> {
        self.sheet.count(self.count_at, self.count);
        Ok(())
    }
}

impl Sheet {
    /// Writes a tag and room for a count, and gives the place of the count.
    fn open(&mut self, tag: u8) -> usize {
        self.out.push(tag);
        let count_at = self.out.len();
        self.out.extend_from_slice(&0u64.to_le_bytes());
        count_at
    }

    /// Keys of JSON objects are texts: a number that was written at `begin` becomes its digits.
    fn key_as_text(&mut self, begin: usize) -> Result<(), CanonError> {
        let sign = match self.out.get(begin) {
            Some(&TEXT) => return Ok(()),
            Some(&UNSIGNED) => "",
            Some(&NEGATIVE) => "-",
            _ => return Err(CanonError::Other("a key of a JSON object is a text or a whole number".into())),
        };
        let mut bytes = [0; 8];
        bytes.copy_from_slice(&self.out[begin + 1..begin + 9]);
        self.out.truncate(begin);
        Writer { sheet: self }.blob(TEXT, format!("{sign}{}", u64::from_le_bytes(bytes)).as_bytes());
        Ok(())
    }

    fn count(&mut self, count_at: usize, count: u64) {
        self.out[count_at..count_at + 8].copy_from_slice(&count.to_le_bytes());
    }
}

/// Entries are written as they come, and sorted by key afterwards where they were not in order.
struct Map<'a> {
    sheet: &'a mut Sheet,
    /// Place of the count; entries begin behind it.
    count_at: usize,
    /// Begin of this map's entries in `Sheet::entries`.
    first: usize,
    /// Begin of a key whose value has not come yet.
    key_at: Option<usize>,
}

impl<'a> Map<'a> {
    fn open(sheet: &'a mut Sheet) -> Map<'a> {
        let count_at = sheet.open(MAP);
        let first = sheet.entries.len();
        Map { sheet, count_at, first, key_at: None }
    }

    fn key<T: Serialize + ?Sized>(&mut self, key: &T) -> Result<(), CanonError> {
        let begin = self.sheet.out.len();
        self.key_at = Some(begin);
        key.serialize(Writer { sheet: self.sheet })?;
        if self.sheet.as_json { self.sheet.key_as_text(begin) } else { Ok(()) }
    }

    fn value<T: Serialize + ?Sized>(&mut self, value: &T) -> Result<(), CanonError> {
        let key_at = self.key_at.take().ok_or_else(|| CanonError::Other("a map value came before its key".into()))?;
        let value_at = self.sheet.out.len();
        value.serialize(Writer { sheet: self.sheet })?;
        let end = self.sheet.out.len();
        self.sheet.entries.push((key_at, value_at, end));
        Ok(())
    }

    fn close(self) -> Result<(), CanonError> {
        self.sheet.count(self.count_at, (self.sheet.entries.len() - self.first) as u64);
        let Sheet { out, entries, sorted, .. } = self.sheet;
        let own = &mut entries[self.first..];
        // The keys of a map differ. Should two be equal, the order of their values decides, so there is still only one
        // order.
        let place = |entry: &(usize, usize, usize)| (&out[entry.0..entry.1], &out[entry.1..entry.2]);
        if !own.is_sorted_by(|a, b| place(a) <= place(b)) {
            own.sort_unstable_by(|a, b| place(a).cmp(&place(b)));
            sorted.clear();
            own.iter().for_each(|(key_at, _, end)| sorted.extend_from_slice(&out[*key_at..*end]));
            out[self.count_at + 8..].copy_from_slice(sorted);
        }
        entries.truncate(self.first);
        Ok(())
    }
}

impl<'a> ser::Serializer for Writer<'a> {
    type Ok = ();
    type Error = CanonError;
    type SerializeSeq = List<'a>;
    type SerializeTuple = List<'a>;
    type SerializeTupleStruct = List<'a>;
    type SerializeTupleVariant = List<'a>;
    type SerializeMap = Map<'a>;
    type SerializeStruct = Map<'a>;
    type SerializeStructVariant = Map<'a>;

    fn is_human_readable(&self) -> bool {
        true
    }

    fn serialize_bool(self, v: bool) -> Result<(), CanonError> {
        self.sheet.out.push(if v { TRUE } else { FALSE });
        Ok(())
    }

    fn serialize_i8(self, v: i8) -> Result<(), CanonError> {
        self.serialize_i64(i64::from(v))
    }

    fn serialize_i16(self, v: i16) -> Result<(), CanonError> {
        self.serialize_i64(i64::from(v))
    }

    fn serialize_i32(self, v: i32) -> Result<(), CanonError> {
        self.serialize_i64(i64::from(v))
    }

    fn serialize_i64(mut self, v: i64) -> Result<(), CanonError> {
        let tag = if v < 0 { NEGATIVE } else { UNSIGNED };
        self.tagged_u64(tag, v.unsigned_abs());
        Ok(())
    }

    fn serialize_u8(self, v: u8) -> Result<(), CanonError> {
        self.serialize_u64(u64::from(v))
    }

    fn serialize_u16(self, v: u16) -> Result<(), CanonError> {
        self.serialize_u64(u64::from(v))
    }

    fn serialize_u32(self, v: u32) -> Result<(), CanonError> {
        self.serialize_u64(u64::from(v))
    }

    fn serialize_u64(mut self, v: u64) -> Result<(), CanonError> {
        self.tagged_u64(UNSIGNED, v);
        Ok(())
    }

    fn serialize_f32(self, v: f32) -> Result<(), CanonError> {
        self.serialize_f64(f64::from(v))
    }

    fn serialize_f64(mut self, v: f64) -> Result<(), CanonError> {
        let v = super::num::stored(v).ok_or(CanonError::NotFinite)?;
        self.tagged_u64(FLOAT, v.to_bits());
        Ok(())
    }

    fn serialize_char(self, v: char) -> Result<(), CanonError> {
        self.serialize_str(v.encode_utf8(&mut [0; 4]))
    }

    fn serialize_str(mut self, v: &str) -> Result<(), CanonError> {
        self.blob(TEXT, v.as_bytes());
        Ok(())
    }

    fn serialize_bytes(mut self, v: &[u8]) -> Result<(), CanonError> {
        if self.sheet.as_json {
            return v.serialize(self);
        }
        self.blob(BYTES, v);
        Ok(())
    }

    fn serialize_none(self) -> Result<(), CanonError> {
        self.sheet.out.push(if self.sheet.as_json { UNIT } else { NONE });
        Ok(())
    }

    fn serialize_some<T: Serialize + ?Sized>(self, value: &T) -> Result<(), CanonError> {
        if !self.sheet.as_json {
            self.sheet.out.push(SOME);
        }
        value.serialize(Writer { sheet: self.sheet })
    }

    fn serialize_unit(self) -> Result<(), CanonError> {
        self.sheet.out.push(UNIT);
        Ok(())
    }

    fn serialize_unit_struct(self, _: &'static str) -> Result<(), CanonError> {
        self.serialize_unit()
    }

    fn serialize_unit_variant(mut self, _: &'static str, _: u32, variant: &'static str) -> Result<(), CanonError> {
        if self.sheet.as_json {
            return self.serialize_str(variant);
        }
        self.blob(VARIANT, variant.as_bytes());
        self.serialize_unit()
    }

    fn serialize_newtype_struct<T: Serialize + ?Sized>(self, _: &'static str, value: &T) -> Result<(), CanonError> {
        value.serialize(self)
    }

    fn serialize_newtype_variant<T: Serialize + ?Sized>(
        mut self,
        _: &'static str,
        _: u32,
        variant: &'static str,
        value: &T,
    ) -> Result<(), CanonError> {
        self.variant(variant);
        value.serialize(self)
    }

    fn serialize_seq(self, _: Option<usize>) -> Result<List<'a>, CanonError> {
        Ok(List::open(self.sheet))
    }

    fn serialize_tuple(self, _: usize) -> Result<List<'a>, CanonError> {
        Ok(List::open(self.sheet))
    }

    fn serialize_tuple_struct(self, _: &'static str, _: usize) -> Result<List<'a>, CanonError> {
        Ok(List::open(self.sheet))
    }

    fn serialize_tuple_variant(
        mut self,
        _: &'static str,
        _: u32,
        variant: &'static str,
        _: usize,
    ) -> Result<List<'a>, CanonError> {
        self.variant(variant);
        Ok(List::open(self.sheet))
    }

    fn serialize_map(self, _: Option<usize>) -> Result<Map<'a>, CanonError> {
        Ok(Map::open(self.sheet))
    }

    fn serialize_struct(self, _: &'static str, _: usize) -> Result<Map<'a>, CanonError> {
        Ok(Map::open(self.sheet))
    }

    fn serialize_struct_variant(
        mut self,
        _: &'static str,
        _: u32,
        variant: &'static str,
        _: usize,
    ) -> Result<Map<'a>, CanonError> {
        self.variant(variant);
        Ok(Map::open(self.sheet))
    }
}

/// Serde has one trait for each kind of list and of record; each is written as any other.
macro_rules! parts {
    (List: $($kind:ident $method:ident),*) => {$(
        impl ser::$kind for List<'_> {
            type Ok = ();
            type Error = CanonError;
            fn $method<T: Serialize + ?Sized>(&mut self, value: &T) -> Result<(), CanonError> {
                self.push(value)
            }
            fn end(self) -> Result<(), CanonError> {
                self.close()
            }
        }
    )*};
    (Map: $($kind:ident),*) => {$(
        impl ser::$kind for Map<'_> {
            type Ok = ();
            type Error = CanonError;
            fn serialize_field<T: Serialize + ?Sized>(&mut self, key: &'static str, value: &T) -> Result<(), CanonError> {
                self.key(key)?;
                self.value(value)
            }
            fn end(self) -> Result<(), CanonError> {
                self.close()
            }
        }
    )*};
}

parts!(List: SerializeSeq serialize_element, SerializeTuple serialize_element, SerializeTupleStruct serialize_field,
    SerializeTupleVariant serialize_field);
parts!(Map: SerializeStruct, SerializeStructVariant);

impl ser::SerializeMap for Map<'_> {
    type Ok = ();
    type Error = CanonError;
    fn serialize_key<T: Serialize + ?Sized>(&mut self, key: &T) -> Result<(), CanonError> {
        self.key(key)
    }
    fn serialize_value<T: Serialize + ?Sized>(&mut self, value: &T) -> Result<(), CanonError> {
        self.value(value)
    }
    fn end(self) -> Result<(), CanonError> {
        self.close()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn order_of_entries_does_not_matter() {
        let one: serde_json::Value = serde_json::from_str(r#"{"a":1,"b":[true,null]}"#).unwrap();
        let two: serde_json::Value = serde_json::from_str(r#"{"b":[true,null],"a":1}"#).unwrap();
        assert_eq!(canonical_bytes(&one), canonical_bytes(&two));
    }

    #[test]
    fn neighbouring_values_do_not_run_into_each_other() {
        assert_ne!(canonical_bytes(&["ab", "c"]), canonical_bytes(&["a", "bc"]));
        assert_ne!(canonical_bytes(&json!([[1], []])), canonical_bytes(&json!([[], [1]])));
        assert_ne!(canonical_bytes(&Some(1u8)), canonical_bytes(&1u8));
    }

    #[test]
    fn as_json_a_value_has_the_bytes_of_its_json() {
        #[derive(serde::Serialize)]
        enum Kind {
            Plain,
            One(f64),
            Two(u8, i8),
            Named { z: Option<u8>, a: char },
        }
        #[derive(serde::Serialize)]
        struct All<'a> {
            kinds: Vec<Kind>,
            absent: Option<u8>,
            there: Option<i64>,
            numbered: std::collections::BTreeMap<i32, &'a str>,
            pair: (bool, f32),
        }
        let all = All {
            kinds: vec![Kind::Plain, Kind::One(-0.0), Kind::Two(1, -1), Kind::Named { z: None, a: 'x' }],
            absent: None,
            there: Some(i64::MIN),
            numbered: [(-3, "b"), (10, "a"), (9, "c")].into(),
            pair: (true, 0.5),
        };
        let json = serde_json::to_value(&all).unwrap();
        assert_eq!(canonical_json_bytes(&all), canonical_bytes(&json));
        assert_eq!(canonical_json_bytes(&json), canonical_bytes(&json));
        assert_eq!(canonical_json_bytes(&Kind::One(f64::NAN)), Err(CanonError::NotFinite));
    }

    #[test]
    fn floats_are_bits_with_one_zero_and_no_nan() {
        assert_eq!(canonical_bytes(&-0.0f64), canonical_bytes(&0.0f64));
        assert_eq!(canonical_bytes(&f64::NAN), Err(CanonError::NotFinite));
        assert_eq!(canonical_bytes(&[1.0, f64::INFINITY]), Err(CanonError::NotFinite));
        assert_ne!(canonical_bytes(&0.1f64), canonical_bytes(&0.100_000_000_000_000_02f64));
    }
}
