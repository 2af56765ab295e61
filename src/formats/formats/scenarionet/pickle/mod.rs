//! Python pickles (protocols 2 to 5) read as data. The opcodes that call something are interpreted only for a short list of
//! names (numpy arrays, dictionaries, sets; in checkpoints torch's tensors); all others are refused by name. No code is ever run,
//! values are shared but never copied, and size, count and nesting are bounded. [`write()`] makes pickles of such data.

mod json;
mod machine;
mod numpy;
mod torch;
mod write;

use std::borrow::Cow;
use std::cell::Cell;
use std::ops::Range;

pub use json::read_json;
pub use machine::{is_headless, read, read_checkpoint};
pub use numpy::{Array, Numbers};
pub use torch::{Storage, Tensor};
pub use write::{Lists, write};

use crate::formats::import_error::{ImportError, shown};

/// Most entries of a record (a dictionary read by its keys).
const RECORD_KEYS_MAX: usize = 256;

/// Longest id, bytes: one long text could otherwise be the id of a million things.
const ID_BYTES_MAX: usize = 256;
/// Most entries of a dictionary whose keys are ids.
const ENTRIES_MAX: usize = 500_000;
/// Most lists, dictionaries, texts and the like of one document.
const OBJECTS_MAX: usize = 4_000_000;
/// Most values in all lists and dictionaries of one document.
const VALUES_MAX: usize = 16_000_000;
/// Most items of lists that are read as tables; a list may be read many times.
const LISTED_MAX: usize = 64_000_000;

/// A value of a pickle. Compound ones live in its [`Pickle`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Value {
    /// Python's `None`.
    None,
    /// `True` or `False`.
    Bool(bool),
    /// A whole number.
    Int(i64),
    /// A float.
    Float(f64),
    /// Index of a compound value in its [`Pickle`].
    Object(u32),
}

/// A compound value.
#[derive(Debug)]
pub(super) enum Object {
    /// Bytes of the file, valid UTF-8.
    Text(Range<usize>),
    Bytes(Range<usize>),
    /// Texts and bytes that are not in the file as they are.
    OwnedText(String),
    OwnedBytes(Vec<u8>),
    List(Vec<Value>),
    Tuple(Vec<Value>),
    Dict(Vec<(Value, Value)>),
    Set(Vec<Value>),
    Global(numpy::Global),
    Dtype(numpy::Dtype),
    Array(Array),
    Storage(Storage),
    Tensor(Tensor),
}

/// A whole pickle: its root and the objects it consists of.
pub struct Pickle<'a> {
    file: &'a str,
    kind: Kind,
    bytes: &'a [u8],
    objects: Vec<Object>,
    root: Value,
    /// Number of items of lists read as tables so far.
    listed: Cell<usize>,
}

/// Purpose of reading a document: it decides the names that are allowed, and the advice for one that cannot be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Scene,
    Checkpoint,
}

impl Kind {
    fn remedy(self) -> &'static str {
        match self {
            Kind::Scene => "write the file again with ScenarioNet or leave it out",
            Kind::Checkpoint => "write the file again with torch.save of the network's state_dict()",
        }
    }
}

/// A value with its path, for error messages.
#[derive(Clone)]
pub struct Node<'p> {
    pickle: &'p Pickle<'p>,
    value: Value,
    path: String,
}

impl<'a> Pickle<'a> {
    /// Returns the value that the pickle holds.
    pub fn root(&self) -> Node<'_> {
        Node { pickle: self, value: self.root, path: String::new() }
    }

    fn object(&self, value: Value) -> Option<&Object> {
        match value {
            Value::Object(index) => self.objects.get(index as usize),
            _ => None,
        }
    }

    fn text(&self, value: Value) -> Option<&str> {
        match self.object(value)? {
            Object::Text(range) => std::str::from_utf8(self.bytes.get(range.clone())?).ok(),
            Object::OwnedText(text) => Some(text),
            _ => None,
        }
    }

    /// Returns `true` if a value is this text. A text of another length is not compared.
    fn is_text(&self, value: Value, text: &str) -> bool {
        match self.object(value) {
            Some(Object::Text(range)) => {
                range.len() == text.len() && self.bytes.get(range.clone()) == Some(text.as_bytes())
            }
            Some(Object::OwnedText(own)) => own == text,
            _ => false,
        }
    }

    /// Returns a text that is short enough for an id.
    fn id_text(&self, value: Value) -> Option<&str> {
        match self.object(value)? {
            Object::Text(range) if range.len() > ID_BYTES_MAX => None,
            Object::OwnedText(text) if text.len() > ID_BYTES_MAX => None,
            _ => self.text(value),
        }
    }

    fn raw(&self, value: Value) -> Option<&[u8]> {
        match self.object(value)? {
            Object::Bytes(range) => self.bytes.get(range.clone()),
            Object::OwnedBytes(bytes) => Some(bytes),
            _ => None,
        }
    }
}

impl<'p> Node<'p> {
    fn of(&self, value: Value, step: impl std::fmt::Display) -> Node<'p> {
        Node { pickle: self.pickle, value, path: format!("{}[{step}]", self.path) }
    }

    /// Returns `true` if it is Python's `None`.
    pub fn is_none(&self) -> bool {
        self.value == Value::None
    }

    /// Makes an error at this value.
    pub fn refuse(&self, expected: impl Into<String>) -> ImportError {
        let place = if self.path.is_empty() { "the whole pickle".to_string() } else { self.path.clone() };
        let expected = format!("{}, found {}", expected.into(), self.described());
        ImportError::new(self.pickle.file, place, expected, self.pickle.kind.remedy())
    }

    fn described(&self) -> String {
        match self.value {
            Value::None => "None".into(),
            Value::Bool(b) => b.to_string(),
            Value::Int(i) => i.to_string(),
            Value::Float(f) => f.to_string(),
            Value::Object(_) => match self.pickle.object(self.value) {
                Some(Object::Text(_) | Object::OwnedText(_)) => {
                    format!("the text {:?}", shown(self.pickle.text(self.value).unwrap_or_default()))
                }
                Some(Object::Bytes(_) | Object::OwnedBytes(_)) => "bytes".into(),
                Some(Object::List(items)) => format!("a list of {}", items.len()),
                Some(Object::Tuple(items)) => format!("a tuple of {}", items.len()),
                Some(Object::Dict(entries)) => format!("a dictionary of {}", entries.len()),
                Some(Object::Set(items)) => format!("a set of {}", items.len()),
                Some(Object::Array(array)) => format!("an array of shape {:?}", array.shape),
                Some(Object::Tensor(tensor)) => format!("a tensor of shape {:?}", tensor.shape),
                Some(Object::Global(_) | Object::Dtype(_) | Object::Storage(_)) | None => "something else".into(),
            },
        }
    }

    /// Returns its text, if it is one.
    pub fn text(&self) -> Option<&'p str> {
        self.pickle.text(self.value)
    }

    /// Returns its text; an error names the place where one is missing.
    pub fn needed_text(&self) -> Result<&'p str, ImportError> {
        self.text().ok_or_else(|| self.refuse("a text"))
    }

    /// Returns a text of at most 256 bytes, or a whole number as text: ids come as both.
    pub fn id(&self) -> Option<Cow<'p, str>> {
        match self.value {
            Value::Int(number) => Some(Cow::Owned(number.to_string())),
            _ => self.pickle.id_text(self.value).map(Cow::Borrowed),
        }
    }

    /// Returns a number, also of an array with one element.
    pub fn number(&self) -> Option<f64> {
        match self.value {
            Value::Int(i) => Some(i as f64),
            Value::Float(f) => Some(f),
            Value::Bool(b) => Some(f64::from(u8::from(b))),
            _ => {
                let numbers = self.numbers()?;
                (numbers.rows * numbers.columns == 1).then(|| numbers.at(0, 0))
            }
        }
    }

    /// Returns a whole number of at most 10^9 that is not negative, if it is one.
    pub fn index(&self) -> Option<usize> {
        let number = self.number()?;
        ((0.0..=1e9).contains(&number) && number.fract() == 0.0).then_some(number as usize)
    }

    /// Returns the value under a text key of a dictionary.
    pub fn get(&self, key: &str) -> Option<Node<'p>> {
        let Some(Object::Dict(entries)) = self.pickle.object(self.value) else { return None };
        let records = entries.iter().take(RECORD_KEYS_MAX).find(|(k, _)| self.pickle.is_text(*k, key));
        records.map(|(_, value)| self.of(*value, format_args!("{key:?}")))
    }

    /// Returns the value under a key; an error names the key that is missing.
    pub fn needed(&self, key: &str) -> Result<Node<'p>, ImportError> {
        self.get(key).ok_or_else(|| self.refuse(format!("a dictionary with {key:?}")))
    }

    /// Returns the entries of a dictionary of at most 500 000 whose keys are ids, in file order.
    pub fn entries(&self) -> Option<Vec<(Cow<'p, str>, Node<'p>)>> {
        let Some(Object::Dict(entries)) = self.pickle.object(self.value) else { return None };
        if entries.len() > ENTRIES_MAX {
            return None;
        }
        let mut records = Vec::with_capacity(entries.len());
        for (key, value) in entries {
            let key = self.of(*key, "key").id()?;
            let node = self.of(*value, format_args!("{:?}", shown(&key)));
            records.push((key, node));
        }
        Some(records)
    }

    /// Returns the items of a list, tuple, set or one-dimensional array of objects.
    pub fn items(&self) -> Option<impl ExactSizeIterator<Item = Node<'p>> + use<'p>> {
        let items = match self.pickle.object(self.value)? {
            Object::List(items) | Object::Tuple(items) | Object::Set(items) => items,
            Object::Array(array) => self.pickle.array_items(array)?,
            _ => return None,
        };
        let node = self.clone();
        Some(items.iter().enumerate().map(move |(k, value)| node.of(*value, k)))
    }

    /// Returns a table of numbers: an array of one or two dimensions, or a list of numbers or of rows.
    pub fn numbers(&self) -> Option<Numbers<'p>> {
        self.pickle.numbers(self.value)
    }

    /// Returns its numbers; an error names the place where they are missing.
    pub fn needed_numbers(&self) -> Result<Numbers<'p>, ImportError> {
        self.numbers().ok_or_else(|| self.refuse("numbers in an array or a list"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(bytes: &[u8]) -> String {
        match read("f.pkl", bytes) {
            Ok(_) => panic!("accepted"),
            Err(error) => error.to_string(),
        }
    }

    /// Protocol 4 without a frame: `{"a": [1, 2.5, None, True], "b": {"a": ...the list again}}`.
    #[test]
    fn plain_data_is_read_and_shared() {
        let mut bytes = b"\x80\x04}\x94(\x8c\x01a\x94]\x94(K\x01G".to_vec();
        bytes.extend_from_slice(&2.5f64.to_be_bytes());
        bytes.extend_from_slice(b"N\x88e\x8c\x01b\x94}\x94h\x01h\x02su.");
        let pickle = read("f.pkl", &bytes).unwrap();
        let items: Vec<_> = pickle.root().get("a").and_then(|a| a.items()).unwrap().collect();
        assert_eq!((items[0].number(), items[1].number(), items[2].is_none()), (Some(1.0), Some(2.5), true));
        let again = pickle.root().get("b").and_then(|b| b.get("a")).and_then(|a| a.items()).unwrap();
        assert_eq!(again.len(), 4);
    }

    #[test]
    fn globals_that_could_run_code_are_refused_by_name() {
        let system = refused(b"\x80\x02cos\nsystem\n(X\x02\x00\x00\x00lstR.");
        assert!(system.contains("os.system"), "{system}");
        let stacked = refused(b"\x80\x04\x8c\x08builtins\x8c\x04eval\x93\x8c\x011\x85R.");
        assert!(stacked.contains("builtins.eval"), "{stacked}");
        assert!(refused(b"\x80\x02(S'x'\nios\nsystem\n.").contains("byte"));
    }

    #[test]
    fn endless_nesting_huge_counts_and_empty_stacks_are_refused() {
        let mut nested = b"\x80\x04".to_vec();
        nested.extend(std::iter::repeat_n(b']', 3_000_000));
        assert!(!refused(&nested).is_empty());
        assert!(refused(b"\x80\x04\x8e\xff\xff\xff\xff\xff\xff\xff\x7fab.").contains("byte"));
        assert!(refused(b"\x80\x04r\xff\xff\xff\xff.").contains("byte"));
        assert!(refused(b"\x80\x04a.").contains("byte"));
        assert!(refused(b"\x80\x04N").contains("byte"));
        assert!(refused(b"\x80\x04h\x07.").contains("memo"));
        assert!(refused(b"").contains("byte 0"));
        assert!(refused(b"\x80\x09N.").contains("protocol"));
    }

    #[test]
    fn a_list_within_itself_does_no_harm() {
        let pickle = read("f.pkl", b"\x80\x04]\x94h\x00a.").unwrap();
        let inner = pickle.root().items().and_then(|mut items| items.next()?.items());
        assert_eq!(inner.map(|items| items.len()), Some(1));
        assert!(pickle.root().numbers().is_none());
    }
}
