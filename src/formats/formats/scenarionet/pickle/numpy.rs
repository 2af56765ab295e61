//! The few names a pickle of data may use: numpy arrays, element types and scalars, and plain containers. Each is
//! interpreted as the data it stands for.

use std::borrow::Cow;

use super::machine::Machine;
use super::torch::Tensor;
use super::{Object, Pickle, Value};
use crate::formats::import_error::ImportError;

/// Most elements of an array.
const ELEMENTS_MAX: usize = 64_000_000;
/// Most arguments, items of a state, and dimensions of a shape.
const FEW: usize = 16;

/// A name that is harmless because it is known.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Global {
    Reconstruct,
    NdArray,
    DtypeType,
    Scalar,
    FromBuffer,
    Encode,
    /// Dictionaries and their subclasses.
    DictType,
    SetType,
    ListType,
    ByteArray,
    /// Torch's tensor, over the numbers of a storage.
    Tensor,
    /// A tensor that is trained, read as the tensor that it is made of.
    Parameter,
    /// Type of the numbers of a storage: the name of its class, and bytes of a number.
    StorageType(&'static str, usize),
    /// A built-in type that makes the new values of a `defaultdict`: a name in a file, never applied.
    Factory,
}

impl Global {
    pub fn named(module: &str, name: &str) -> Option<Global> {
        Some(match (module, name) {
            ("numpy.core.multiarray" | "numpy._core.multiarray", "_reconstruct") => Global::Reconstruct,
            ("numpy.core.multiarray" | "numpy._core.multiarray", "scalar") => Global::Scalar,
            ("numpy.core.numeric" | "numpy._core.numeric", "_frombuffer") => Global::FromBuffer,
            ("numpy", "ndarray") => Global::NdArray,
            ("numpy", "dtype") => Global::DtypeType,
            ("_codecs", "encode") => Global::Encode,
            ("collections", "OrderedDict" | "defaultdict" | "Counter") => Global::DictType,
            ("builtins" | "__builtin__", "dict") => Global::DictType,
            ("metadrive.scenario.scenario_description", "ScenarioDescription") => Global::DictType,
            ("builtins" | "__builtin__", "set" | "frozenset") => Global::SetType,
            ("builtins" | "__builtin__", "list") => Global::ListType,
            ("builtins" | "__builtin__", "bytearray") => Global::ByteArray,
            ("builtins", "int" | "float" | "str" | "bool" | "tuple" | "bytes" | "complex") => Global::Factory,
            ("__builtin__", "int" | "long" | "float" | "str" | "unicode" | "bool" | "tuple") => Global::Factory,
            _ => return None,
        })
    }
}

/// Element type of an array.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Dtype {
    kind: Kind,
    /// Bytes of an element.
    size: usize,
    big_endian: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Float,
    Signed,
    Unsigned,
    Bool,
    /// Python objects in a list.
    Object,
    /// Fixed-size texts; no reader uses them.
    Text,
    /// Elements that no scene is read from: complex numbers, long doubles, records.
    Opaque,
}

impl Dtype {
    fn named(name: &str) -> Option<Dtype> {
        let big_endian = name.starts_with('>');
        let name = name.trim_start_matches(['<', '>', '=', '|']);
        // The unit of a time, as in `M8[ns]`, does not change its bytes.
        let name = name.split('[').next().unwrap_or(name);
        let kind = match name.chars().next()? {
            'f' => Kind::Float,
            'i' => Kind::Signed,
            'u' => Kind::Unsigned,
            'b' => Kind::Bool,
            'O' => Kind::Object,
            // A time is a count of its unit.
            'M' | 'm' => Kind::Signed,
            'U' | 'S' => Kind::Text,
            'c' | 'V' => Kind::Opaque,
            _ => return None,
        };
        let size = name.get(1..)?.parse().ok()?;
        let kind = if kind == Kind::Float && matches!(size, 12 | 16) { Kind::Opaque } else { kind };
        let sound = match kind {
            Kind::Float => matches!(size, 2 | 4 | 8),
            Kind::Signed | Kind::Unsigned => matches!(size, 1 | 2 | 4 | 8),
            Kind::Bool => size == 1,
            Kind::Object => size == 8,
            Kind::Text | Kind::Opaque => size <= 4096,
        };
        sound.then_some(Dtype { kind, size, big_endian })
    }

    /// Returns the element at an index in the bytes; NaN where there is none.
    fn number(&self, bytes: &[u8], index: usize) -> f64 {
        let from = index * self.size;
        let mut wide = [0u8; 8];
        let Some(raw) = bytes.get(from..from + self.size).filter(|_| self.size <= 8) else { return f64::NAN };
        wide[..self.size].copy_from_slice(raw);
        if self.big_endian {
            wide[..self.size].reverse();
        }
        let bits = u64::from_le_bytes(wide);
        let unused = 64 - 8 * self.size as u32;
        match self.kind {
            Kind::Float if self.size == 2 => half(bits as u16),
            Kind::Float if self.size == 4 => f64::from(f32::from_bits(bits as u32)),
            Kind::Float => f64::from_bits(bits),
            Kind::Signed => (((bits << unused) as i64) >> unused) as f64,
            Kind::Unsigned => bits as f64,
            Kind::Bool => f64::from(u8::from(bits != 0)),
            Kind::Object | Kind::Text | Kind::Opaque => f64::NAN,
        }
    }
}

/// Decodes a number of IEEE 754's half precision: 1 bit of sign, 5 of exponent, 10 of fraction.
fn half(bits: u16) -> f64 {
    let sign = if bits >> 15 == 1 { -1.0 } else { 1.0 };
    let (exponent, fraction) = (u64::from(bits >> 10 & 31), f64::from(bits & 1023) / 1024.0);
    // Powers of two are exact: their exponent is in the bits.
    let power = |exponent: u64| f64::from_bits((exponent + 1023 - 15) << 52);
    match exponent {
        0 => sign * fraction * power(1),
        31 if fraction > 0.0 => f64::NAN,
        31 => sign * f64::INFINITY,
        exponent => sign * (1.0 + fraction) * power(exponent),
    }
}

/// A numpy array: its shape, and its elements as bytes or as a list.
#[derive(Clone, Debug)]
pub struct Array {
    /// Length of each dimension.
    pub shape: Vec<usize>,
    dtype: Dtype,
    fortran: bool,
    data: Value,
}

/// A table of numbers; one-dimensional data is one column.
#[derive(Clone, Debug)]
pub struct Numbers<'p> {
    /// First dimension.
    pub rows: usize,
    /// Second dimension; 1 for a plain list.
    pub columns: usize,
    cells: Cells<'p>,
}

#[derive(Clone, Debug)]
enum Cells<'p> {
    Raw { bytes: &'p [u8], dtype: Dtype, fortran: bool },
    Listed(Cow<'p, [f64]>),
}

impl Numbers<'_> {
    /// Returns the number at a place; NaN beyond the table.
    pub fn at(&self, row: usize, column: usize) -> f64 {
        if row >= self.rows || column >= self.columns {
            return f64::NAN;
        }
        match &self.cells {
            Cells::Raw { bytes, dtype, fortran } => {
                let index = if *fortran { column * self.rows + row } else { row * self.columns + column };
                dtype.number(bytes, index)
            }
            Cells::Listed(values) => values.get(row * self.columns + column).copied().unwrap_or(f64::NAN),
        }
    }
}

impl Pickle<'_> {
    pub(super) fn numbers(&self, value: Value) -> Option<Numbers<'_>> {
        match self.object(value)? {
            Object::Array(array) if array.dtype.kind != Kind::Object => {
                let (rows, columns) = table(&array.shape)?;
                let bytes = self.raw(array.data)?;
                Some(Numbers { rows, columns, cells: Cells::Raw { bytes, dtype: array.dtype, fortran: array.fortran } })
            }
            Object::Array(array) => self.listed(self.array_items(array)?),
            Object::List(items) | Object::Tuple(items) => self.listed(items),
            _ => None,
        }
    }

    /// Returns the items of an array of objects.
    pub(super) fn array_items(&self, array: &Array) -> Option<&Vec<Value>> {
        match self.object(array.data)? {
            Object::List(items) if array.dtype.kind == Kind::Object && array.shape.len() == 1 => Some(items),
            _ => None,
        }
    }

    /// Reads a list of numbers, or of equally long rows of numbers. Rows are looked at one level deep.
    fn listed(&self, items: &[Value]) -> Option<Numbers<'_>> {
        let plain = |value: Value| match value {
            Value::Int(i) => Some(i as f64),
            Value::Float(f) => Some(f),
            Value::Bool(b) => Some(f64::from(u8::from(b))),
            // JSON's form of NaN.
            Value::None => Some(f64::NAN),
            _ => None,
        };
        self.listed.set(self.listed.get().saturating_add(items.len()));
        if self.listed.get() > super::LISTED_MAX {
            return None;
        }
        let mut columns = None;
        let mut values = Vec::with_capacity(items.len());
        for &item in items {
            let before = values.len();
            match (plain(item), self.object(item)) {
                (Some(number), _) => values.push(number),
                (None, Some(Object::List(row) | Object::Tuple(row))) if row.len() <= 16 => {
                    for &cell in row {
                        values.push(plain(cell)?);
                    }
                }
                (None, Some(Object::Array(array))) if array.shape.len() == 1 && array.shape[0] <= 16 => {
                    let bytes = self.raw(array.data)?;
                    values.extend((0..array.shape[0]).map(|k| array.dtype.number(bytes, k)));
                }
                _ => return None,
            }
            let width = values.len() - before;
            if *columns.get_or_insert(width) != width {
                return None;
            }
        }
        Some(Numbers { rows: items.len(), columns: columns.unwrap_or(0), cells: Cells::Listed(Cow::Owned(values)) })
    }
}

/// Returns rows and columns of a shape of at most two dimensions, or with further ones of size 1.
fn table(shape: &[usize]) -> Option<(usize, usize)> {
    match shape {
        [] => Some((1, 1)),
        [rows] => Some((*rows, 1)),
        [rows, columns, rest @ ..] if rest.iter().all(|&n| n == 1) => Some((*rows, *columns)),
        _ => None,
    }
}

/// Returns the value that a call of a known name gives.
pub(super) fn applied(machine: &mut Machine<'_>, callee: Value, arguments: Value) -> Result<Value, ImportError> {
    let Some(Object::Global(global)) = machine.pickle.object(callee) else {
        return Err(machine.refuse("a known name to apply"));
    };
    let global = *global;
    let Some(Object::Tuple(arguments)) = machine.pickle.object(arguments) else {
        return Err(machine.refuse("arguments in a tuple"));
    };
    if arguments.len() > FEW {
        return Err(machine.refuse("at most 16 arguments"));
    }
    let arguments = arguments.clone();
    let first = arguments.first().copied().unwrap_or(Value::None);
    match global {
        Global::Reconstruct | Global::NdArray => {
            let dtype = Dtype { kind: Kind::Unsigned, size: 1, big_endian: false };
            machine.object(Object::Array(Array { shape: vec![0], dtype, fortran: false, data: Value::None }))
        }
        Global::DtypeType => {
            let dtype = machine.pickle.text(first).and_then(Dtype::named);
            let dtype = dtype.ok_or_else(|| machine.refuse("an element type of numbers, texts or objects"))?;
            machine.object(Object::Dtype(dtype))
        }
        Global::Scalar => scalar(machine, &arguments),
        Global::FromBuffer => {
            let [data, dtype, shape, order] = arguments[..] else {
                return Err(machine.refuse("a buffer, a type, a shape and an order"));
            };
            let fortran = machine.pickle.text(order) == Some("F");
            let array = array(machine, shape, dtype, fortran, data)?;
            machine.object(Object::Array(array))
        }
        Global::Encode => {
            let length = machine.pickle.text(first).map_or(0, str::len);
            machine.copies(length)?;
            let bytes: Option<Vec<u8>> = machine
                .pickle
                .text(first)
                .and_then(|text| text.chars().map(|c| u8::try_from(u32::from(c)).ok()).collect());
            let bytes = bytes.ok_or_else(|| machine.refuse("Latin-1 text"))?;
            machine.object(Object::OwnedBytes(bytes))
        }
        Global::Tensor => {
            let tensor = Tensor::of(machine, &arguments)?;
            machine.object(Object::Tensor(tensor))
        }
        Global::Parameter => Ok(first),
        Global::StorageType(..) => Err(machine.refuse("the class of a storage in its id, found it applied")),
        Global::Factory => Err(machine.refuse("a built-in type as the factory of a defaultdict, found it applied")),
        Global::DictType => {
            // A Counter comes with a dictionary.
            if let Some(Object::Dict(entries)) = machine.pickle.object(first) {
                let count = entries.len();
                machine.copies(2 * count)?;
                let entries = match machine.pickle.object(first) {
                    Some(Object::Dict(entries)) => entries.clone(),
                    _ => vec![],
                };
                return machine.object(Object::Dict(entries));
            }
            let pairs = all_items(machine, first)?;
            let pairs = pairs.iter().filter_map(|&pair| match few_items(machine, pair)?[..] {
                [key, value] => Some((key, value)),
                _ => None,
            });
            let entries = pairs.collect();
            machine.object(Object::Dict(entries))
        }
        Global::SetType => {
            let held = all_items(machine, first)?;
            machine.object(Object::Set(held))
        }
        Global::ListType => {
            let held = all_items(machine, first)?;
            machine.object(Object::List(held))
        }
        Global::ByteArray => match machine.pickle.raw(first) {
            Some(_) => Ok(first),
            None => machine.object(Object::OwnedBytes(vec![])),
        },
    }
}

/// Returns a short list or tuple, looked at without a copy.
fn few_items<'m>(machine: &'m Machine<'_>, value: Value) -> Option<&'m [Value]> {
    match machine.pickle.object(value)? {
        Object::List(items) | Object::Tuple(items) if items.len() <= FEW => Some(items),
        _ => None,
    }
}

/// Returns a copy of a list or tuple; an empty list for any other value. Copies are counted, because a hostile file could have
/// a shared list copied very often.
fn all_items(machine: &mut Machine<'_>, value: Value) -> Result<Vec<Value>, ImportError> {
    let items = match machine.pickle.object(value) {
        Some(Object::List(items) | Object::Tuple(items) | Object::Set(items)) => items.len(),
        _ => return Ok(vec![]),
    };
    machine.copies(items)?;
    match machine.pickle.object(value) {
        Some(Object::List(items) | Object::Tuple(items) | Object::Set(items)) => Ok(items.clone()),
        _ => Ok(vec![]),
    }
}

fn scalar(machine: &mut Machine<'_>, arguments: &[Value]) -> Result<Value, ImportError> {
    let [dtype, data] = arguments[..] else { return Err(machine.refuse("a type and a value")) };
    let Some(Object::Dtype(dtype)) = machine.pickle.object(dtype) else { return Err(machine.refuse("a type")) };
    let number = match dtype.kind {
        Kind::Object => return Ok(data),
        Kind::Opaque => return Ok(Value::None),
        Kind::Text => {
            let text: String = machine.pickle.raw(data).unwrap_or_default().chunks(4).filter_map(utf32).collect();
            return machine.object(Object::OwnedText(text));
        }
        _ => machine.pickle.raw(data).map(|bytes| dtype.number(bytes, 0)),
    };
    match (number, dtype.kind) {
        (Some(number), Kind::Bool) => Ok(Value::Bool(number != 0.0)),
        (Some(number), Kind::Signed | Kind::Unsigned) => Ok(Value::Int(number as i64)),
        (Some(number), _) => Ok(Value::Float(number)),
        (None, _) => Err(machine.refuse("the bytes of a number")),
    }
}

fn utf32(bytes: &[u8]) -> Option<char> {
    let code = u32::from_le_bytes(*bytes.first_chunk()?);
    char::from_u32(code).filter(|c| *c != '\0')
}

/// Adds a state to a value.
pub(super) fn built(machine: &mut Machine<'_>, target: Value, state: Value) -> Result<(), ImportError> {
    match machine.pickle.object(target) {
        Some(Object::Array(_)) => {
            let state = few_items(machine, state).unwrap_or_default();
            let [_, shape, dtype, fortran, data] = state[..] else {
                return Err(machine.refuse("version, shape, type, order and data of an array"));
            };
            let array = array(machine, shape, dtype, fortran == Value::Bool(true), data)?;
            replace(machine, target, Object::Array(array));
        }
        Some(Object::Dtype(dtype)) => {
            let mut dtype = *dtype;
            let state = few_items(machine, state).unwrap_or_default();
            if state.get(1).and_then(|order| machine.pickle.text(*order)) == Some(">") {
                dtype.big_endian = true;
            }
            replace(machine, target, Object::Dtype(dtype));
        }
        // Attributes of a dictionary's subclass say nothing about a scene.
        Some(Object::Dict(_)) => {}
        _ => return Err(machine.refuse("an array, an element type or a dictionary to build")),
    }
    Ok(())
}

fn replace(machine: &mut Machine<'_>, target: Value, object: Object) {
    if let Value::Object(index) = target
        && let Some(place) = machine.pickle.objects.get_mut(index as usize)
    {
        *place = object;
    }
}

fn array(machine: &Machine<'_>, shape: Value, dtype: Value, fortran: bool, data: Value) -> Result<Array, ImportError> {
    let Some(Object::Dtype(dtype)) = machine.pickle.object(dtype) else {
        return Err(machine.refuse("an element type"));
    };
    let dimensions = match shape {
        Value::Int(_) => Some(vec![shape]),
        _ => few_items(machine, shape).map(<[Value]>::to_vec),
    };
    let sizes: Option<Vec<usize>> = dimensions
        .unwrap_or_default()
        .iter()
        .map(|&d| match d {
            Value::Int(n) => usize::try_from(n).ok(),
            _ => None,
        })
        .collect();
    let sizes = sizes.filter(|sizes| sizes.len() <= 8).ok_or_else(|| machine.refuse("a shape"))?;
    let count = sizes.iter().try_fold(1usize, |product, &n| product.checked_mul(n)).filter(|&n| n <= ELEMENTS_MAX);
    let count = count.ok_or_else(|| machine.refuse("an array of at most 64 million elements"))?;
    let held = match (dtype.kind, machine.pickle.object(data)) {
        (Kind::Object, Some(Object::List(items))) => Some(items.len()),
        (Kind::Object, _) => None,
        _ => machine.pickle.raw(data).map(|bytes| bytes.len() / dtype.size.max(1)),
    };
    let sized = !(matches!(dtype.kind, Kind::Text | Kind::Opaque) && dtype.size == 0);
    if held != Some(count) && sized {
        return Err(machine.refuse(format!("data of {count} elements")));
    }
    Ok(Array { shape: sizes, dtype: *dtype, fortran, data })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halves_are_what_ieee_754_says() {
        let of = [0x3c00, 0xc000, 0x3555, 0x0001, 0x0400, 0x7bff, 0x8000].map(half);
        let smallest = f64::from_bits((1023 - 24) << 52);
        assert_eq!(of, [1.0, -2.0, 0.333_251_953_125, smallest, smallest * 1024.0, 65504.0, -0.0]);
        assert!(half(0x7c01).is_nan() && half(0xfc00) == f64::NEG_INFINITY);
    }
}
