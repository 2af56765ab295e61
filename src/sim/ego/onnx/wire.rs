//! ONNX's messages as they lie in a file (protocol buffers), read where they lie: a hostile file gets no memory that it does not bring.

use std::collections::BTreeMap;

use crate::ego::weights_error::WeightsError;

/// Nodes, tensors and numbers of a list that a file may have.
pub const COUNT_MAX: usize = 4096;
const REMEDY: &str = "export the deterministic actor alone with torch.onnx.export, a batch of 1 and float32, or drive it as a program of \
                      your own, [driver] (docs/EGOS.md)";

/// A refusal at this place of the file.
pub fn refused(place: impl ToString, found: impl ToString, expected: impl ToString) -> WeightsError {
    let [layer, found, expected] = [place.to_string(), found.to_string(), expected.to_string()];
    WeightsError { layer, found, expected, remedy: REMEDY }
}

/// What a field holds.
#[derive(Clone, Copy)]
pub enum Held<'a> {
    Number(u64),
    Bytes(&'a [u8]),
}

impl<'a> Held<'a> {
    pub fn bytes(self) -> Result<&'a [u8], WeightsError> {
        match self {
            Held::Bytes(bytes) => Ok(bytes),
            Held::Number(number) => Err(broken(format!("the number {number}"), "a message")),
        }
    }

    fn text(self) -> Result<&'a str, WeightsError> {
        std::str::from_utf8(self.bytes()?).map_err(|error| broken(error, "text"))
    }

    fn number(self) -> Result<u64, WeightsError> {
        match self {
            Held::Number(number) => Ok(number),
            Held::Bytes(bytes) => Err(broken(format!("{} bytes", bytes.len()), "a number")),
        }
    }

    /// Appends whole numbers, which may stand side by side in one field.
    fn wholes(self, out: &mut Vec<i64>) -> Result<(), WeightsError> {
        match self {
            Held::Number(number) => out.push(number as i64),
            Held::Bytes(mut left) => {
                while !left.is_empty() && out.len() <= COUNT_MAX {
                    out.push(varint(&mut left).ok_or_else(cut)? as i64);
                }
            }
        }
        if out.len() > COUNT_MAX {
            return Err(broken("more whole numbers", format!("at most {COUNT_MAX} in a list")));
        }
        Ok(())
    }

    /// The same of floats.
    fn floats(self, out: &mut Vec<f32>) -> Result<(), WeightsError> {
        match self {
            Held::Number(bits) => out.push(f32::from_bits(bits as u32)),
            Held::Bytes(bytes) => out.extend(parts(bytes)?.iter().map(|bytes| f32::from_le_bytes(*bytes))),
        }
        Ok(())
    }
}

fn broken(found: impl ToString, expected: impl ToString) -> WeightsError {
    refused("message", found, expected)
}

fn cut() -> WeightsError {
    broken("a field that is cut off", "a whole ONNX file")
}

fn parts<const SIZE: usize>(bytes: &[u8]) -> Result<&[[u8; SIZE]], WeightsError> {
    match bytes.as_chunks() {
        (parts, []) => Ok(parts),
        _ => Err(broken(format!("{} bytes", bytes.len()), format!("numbers of {SIZE} bytes"))),
    }
}

fn varint(left: &mut &[u8]) -> Option<u64> {
    let mut number = 0;
    for place in 0..10 {
        let (byte, rest) = left.split_first()?;
        *left = rest;
        number |= u64::from(byte & 127) << (7 * place);
        if *byte < 128 {
            return Some(number);
        }
    }
    None
}

fn taken<'a>(left: &mut &'a [u8], count: u64) -> Option<&'a [u8]> {
    let (taken, rest) = left.split_at_checked(usize::try_from(count).ok()?)?;
    *left = rest;
    Some(taken)
}

/// The fields of a message, each with its number.
pub struct Fields<'a>(pub &'a [u8]);

impl<'a> Iterator for Fields<'a> {
    type Item = Result<(u64, Held<'a>), WeightsError>;

    fn next(&mut self) -> Option<Self::Item> {
        let left = &mut self.0;
        if left.is_empty() {
            return None;
        }
        let mut field = || {
            let tag = varint(left)?;
            let held = match tag & 7 {
                0 => Held::Number(varint(left)?),
                1 => Held::Number(u64::from_le_bytes(*taken(left, 8)?.as_array()?)),
                2 => {
                    let count = varint(left)?;
                    Held::Bytes(taken(left, count)?)
                }
                5 => Held::Number(u32::from_le_bytes(*taken(left, 4)?.as_array()?).into()),
                _ => return None,
            };
            Some((tag >> 3, held))
        };
        let field = field();
        if field.is_none() {
            self.0 = &[];
        }
        Some(field.ok_or_else(cut))
    }
}

/// The message at the end of these fields.
fn within<'a>(mut message: &'a [u8], path: &[u64]) -> Result<&'a [u8], WeightsError> {
    for number in path {
        let mut part: &[u8] = &[];
        for field in Fields(message) {
            match field? {
                (of, held) if of == *number => part = held.bytes()?,
                _ => {}
            }
        }
        message = part;
    }
    Ok(message)
}

/// The text of this field, or none.
pub fn name(message: &[u8], number: u64) -> Result<&str, WeightsError> {
    Held::Bytes(within(message, &[number])?).text()
}

/// An input's name and lengths; a length may be left open.
pub fn input(message: &[u8]) -> Result<(&str, Vec<Option<u64>>), WeightsError> {
    let (name, tensor) = (name(message, 1)?, within(message, &[2, 1])?);
    let mut shape = Vec::new();
    for field in Fields(tensor) {
        if let (1, Held::Number(kind @ (0 | 2..))) = field? {
            return Err(refused(format!("input {name:?}"), format!("numbers of kind {kind}"), "f32 (kind 1)"));
        }
    }
    for dimension in Fields(within(tensor, &[2])?) {
        let mut length = None;
        for part in Fields(dimension?.1.bytes()?) {
            if let (1, held) = part? {
                length = Some(held.number()?);
            }
        }
        shape.push(length);
    }
    Ok((name, shape))
}

/// What the entry of a file's properties says if it has this name.
pub fn property<'a>(message: &'a [u8], key: &str) -> Result<Option<&'a str>, WeightsError> {
    Ok(if name(message, 1)? == key { Some(name(message, 2)?) } else { None })
}

/// What numbers are of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    Float,
    /// Whole numbers, which say shapes and places.
    Whole,
    /// 1 of what holds, 0 of what does not.
    Truth,
}

impl Kind {
    /// The one that a file means by this number.
    pub fn of(number: u64) -> Option<Kind> {
        match number {
            1 => Some(Kind::Float),
            7 => Some(Kind::Whole),
            9 => Some(Kind::Truth),
            _ => None,
        }
    }
}

/// A table of numbers.
pub struct Tensor<'a> {
    name: &'a str,
    pub shape: Vec<usize>,
    kind: u64,
    raw: Option<&'a [u8]>,
    floats: Vec<f32>,
    wholes: Vec<i64>,
}

impl<'a> Tensor<'a> {
    pub fn read(message: &'a [u8]) -> Result<Tensor<'a>, WeightsError> {
        let mut tensor =
            Tensor { name: name(message, 8)?, shape: vec![], kind: 0, raw: None, floats: vec![], wholes: vec![] };
        let mut shape = Vec::new();
        for field in Fields(message) {
            match field? {
                (1, held) => held.wholes(&mut shape)?,
                (2, held) => tensor.kind = held.number()?,
                (4, held) => held.floats(&mut tensor.floats)?,
                (5 | 7, held) => held.wholes(&mut tensor.wholes)?,
                (9, held) => tensor.raw = Some(held.bytes()?),
                (14, held) if held.number()? == 1 => {
                    let whole = "numbers in this file; write it with external_data=False, or again by onnx.save(onnx.load(FILE), FILE)";
                    return Err(refused(tensor.place(), "numbers in another file", whole));
                }
                _ => {}
            }
        }
        tensor.shape = shape.into_iter().map(|length| usize::try_from(length).unwrap_or(0)).collect();
        Ok(tensor)
    }

    fn place(&self) -> String {
        format!("tensor {:?}", self.name)
    }

    /// Its numbers, and what they are of.
    pub fn numbers(&self) -> Result<(Vec<f32>, Kind), WeightsError> {
        let kind = Kind::of(self.kind).ok_or_else(|| {
            let expected = "f32 (kind 1), i64 (kind 7) of shapes, or bool (kind 9); export a network of float32";
            refused(self.place(), format!("numbers of kind {}", self.kind), expected)
        })?;
        let values: Vec<f32> = match (kind, self.raw) {
            (Kind::Float, Some(raw)) => parts(raw)?.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect(),
            (Kind::Float, None) => self.floats.clone(),
            (Kind::Whole, Some(raw)) => parts(raw)?.iter().map(|bytes| i64::from_le_bytes(*bytes) as f32).collect(),
            (Kind::Truth, Some(raw)) => raw.iter().map(|byte| f32::from(*byte != 0)).collect(),
            (Kind::Whole, None) => self.wholes.iter().map(|x| *x as f32).collect(),
            (Kind::Truth, None) => self.wholes.iter().map(|x| f32::from(*x != 0)).collect(),
        };
        if values.len() != self.shape.iter().product::<usize>() || values.iter().any(|x| x.is_nan()) {
            let found = format!("{} numbers of shape {:?}, or one that is none", values.len(), self.shape);
            return Err(refused(self.place(), found, "as many numbers as its shape has room for"));
        }
        Ok((values, kind))
    }
}

/// What an attribute says.
pub enum Attribute<'a> {
    Float(f32),
    Whole(i64),
    Text(&'a str),
    Tensor(Tensor<'a>),
    Floats(Vec<f32>),
    Wholes(Vec<i64>),
}

/// An operator at its place.
pub struct Node<'a> {
    name: &'a str,
    pub operator: &'a str,
    domain: &'a str,
    pub inputs: Vec<&'a str>,
    pub outputs: Vec<&'a str>,
    /// Whether the action hangs on it.
    pub is_needed: bool,
    attributes: BTreeMap<&'a str, &'a [u8]>,
}

impl<'a> Node<'a> {
    pub fn read(message: &'a [u8]) -> Result<Node<'a>, WeightsError> {
        let (name, operator, domain) = (name(message, 3)?, name(message, 4)?, name(message, 7)?);
        let mut node = Node {
            name,
            operator,
            domain,
            inputs: vec![],
            outputs: vec![],
            is_needed: false,
            attributes: BTreeMap::new(),
        };
        for field in Fields(message) {
            match field? {
                (1, held) => node.inputs.push(held.text()?),
                (2, held) => node.outputs.push(held.text()?),
                (5, held) => {
                    let attribute = held.bytes()?;
                    node.attributes.insert(self::name(attribute, 1)?, attribute);
                }
                _ => {}
            }
            if node.inputs.len().max(node.outputs.len()).max(node.attributes.len()) > 256 {
                return Err(node.refused("more inputs, outputs or attributes", "at most 256"));
            }
        }
        Ok(node)
    }

    pub fn refused(&self, found: impl ToString, expected: impl ToString) -> WeightsError {
        let name = if self.name.is_empty() { self.outputs.first().unwrap_or(&"") } else { self.name };
        refused(format!("node {name:?} ({})", self.operator), found, expected)
    }

    /// Whether the operator is one of these and says no more than they may; of other domains none is.
    pub fn check(&self, known: &[(&str, &[&str])]) -> Result<(), WeightsError> {
        let of = known.iter().find(|(name, _)| *name == self.operator && matches!(self.domain, "" | "ai.onnx"));
        let names = || known.iter().map(|(name, _)| *name).collect::<Vec<_>>().join(", ");
        let (_, known) = of.ok_or_else(|| self.refused(format!("{}{}", self.domain, self.operator), names()))?;
        match self.attributes.keys().find(|name| !known.contains(name)) {
            Some(odd) => Err(self.refused(format!("the attribute {odd:?}"), format!("no other than {known:?}"))),
            None => Ok(()),
        }
    }

    pub fn attribute(&self, key: &str) -> Result<Option<Attribute<'a>>, WeightsError> {
        let Some(&message) = self.attributes.get(key) else { return Ok(None) };
        let (mut kind, mut float, mut whole, mut bytes) = (0, 0.0, 0, &[][..]);
        let (mut floats, mut wholes) = (Vec::new(), Vec::new());
        for field in Fields(message) {
            match field? {
                (2, held) => float = f32::from_bits(held.number()? as u32),
                (3, held) => whole = held.number()? as i64,
                (4 | 5, held) => bytes = held.bytes()?,
                (7, held) => held.floats(&mut floats)?,
                (8, held) => held.wholes(&mut wholes)?,
                (20, held) => kind = held.number()?,
                _ => {}
            }
        }
        Ok(Some(match kind {
            1 => Attribute::Float(float),
            2 => Attribute::Whole(whole),
            3 => Attribute::Text(Held::Bytes(bytes).text()?),
            4 => Attribute::Tensor(Tensor::read(bytes)?),
            6 => Attribute::Floats(floats),
            7 => Attribute::Wholes(wholes),
            _ => {
                return Err(
                    self.refused(format!("the attribute {key:?} of kind {kind}"), "a number, a list or a tensor")
                );
            }
        }))
    }

    pub fn float(&self, key: &str, default: f32) -> Result<f32, WeightsError> {
        match self.attribute(key)? {
            None => Ok(default),
            Some(Attribute::Float(x)) if !x.is_nan() => Ok(x),
            _ => Err(self.refused(format!("the attribute {key:?}"), "a number with a point")),
        }
    }

    pub fn whole(&self, key: &str, default: i64) -> Result<i64, WeightsError> {
        match self.attribute(key)? {
            None => Ok(default),
            Some(Attribute::Whole(x)) => Ok(x),
            _ => Err(self.refused(format!("the attribute {key:?}"), "a whole number")),
        }
    }

    pub fn wholes(&self, key: &str) -> Result<Option<Vec<i64>>, WeightsError> {
        match self.attribute(key)? {
            None => Ok(None),
            Some(Attribute::Wholes(list)) => Ok(Some(list)),
            _ => Err(self.refused(format!("the attribute {key:?}"), "whole numbers")),
        }
    }
}
