//! The stack machine of the pickle format. It turns opcodes into values and executes nothing.

use std::ops::Range;

use super::numpy::{Global, applied, built};
use super::torch::{self, Storage};
use super::{Kind, OBJECTS_MAX, Object, Pickle, VALUES_MAX, Value};
use crate::formats::import_error::{ImportError, shown};

const BYTES_MAX: usize = 256 << 20;
/// Most copied items.
const COPIES_MAX: usize = 16_000_000;
const STACK_MAX: usize = 2_000_000;
/// Largest distance of a memo index beyond the memo's end.
const MEMO_JUMP_MAX: usize = 65_536;

/// Reads one pickle.
///
/// # Errors
/// Truncated or unknown opcodes, names outside the list of harmless ones, and anything beyond the bounds.
pub fn read<'a>(file: &'a str, bytes: &'a [u8]) -> Result<Pickle<'a>, ImportError> {
    if let Some(fault) = unread(bytes) {
        return Err(ImportError::new(file, "byte 0", fault.0, fault.1));
    }
    Ok(read_as(file, bytes, Kind::Scene)?.0)
}

/// Reads one pickle of a checkpoint, which may hold torch's tensors and be followed by others. Returns its end, too.
///
/// # Errors
/// As [`read`].
pub fn read_checkpoint<'a>(file: &'a str, bytes: &'a [u8]) -> Result<(Pickle<'a>, usize), ImportError> {
    read_as(file, bytes, Kind::Checkpoint)
}

fn read_as<'a>(file: &'a str, bytes: &'a [u8], kind: Kind) -> Result<(Pickle<'a>, usize), ImportError> {
    let mut machine = Machine {
        pickle: Pickle { file, kind, bytes, objects: Vec::new(), root: Value::None, listed: Default::default() },
        at: 0,
        stack: Vec::new(),
        marks: Vec::new(),
        memo: Vec::new(),
        copied: 0,
        pushed: 0,
    };
    if bytes.len() > BYTES_MAX {
        return Err(machine.refuse("at most 256 MiB"));
    }
    while machine.step()? {}
    Ok((machine.pickle, machine.at))
}

const WRITE_AGAIN: &str = "load it in Python and write it again with pickle.dump(scene, file, protocol=4)";

/// Describes a file that does not begin as a readable pickle: what was expected, and what to do.
fn unread(bytes: &[u8]) -> Option<(String, &'static str)> {
    let expected = |found: &str| format!("a pickle of protocol 2 to 5, found {found}");
    Some(match bytes {
        [0x80, 2..=5, ..] => return None,
        [0x80, protocol @ 0..=1, ..] => (expected(&format!("protocol {protocol}")), WRITE_AGAIN),
        [0x80, protocol, ..] => (expected(&format!("protocol {protocol}, which is not known")), WRITE_AGAIN),
        [0xef, 0xbb, 0xbf, ..] => {
            let remedy =
                "a program saved it as text; take the three bytes off its beginning, or fetch it again as binary";
            (expected("a byte order mark of UTF-8 before it"), remedy)
        }
        _ if is_of_protocol_1(bytes) => (expected("protocol 1"), WRITE_AGAIN),
        _ if is_of_protocol_0(bytes) => (expected("protocol 0"), WRITE_AGAIN),
        _ => (expected("none"), "the file is damaged or no data; write it again with ScenarioNet"),
    })
}

/// Returns `true` for protocols 0 and 1, which have no head: a description begins with a dictionary, or with the name of its class.
pub fn is_headless(bytes: &[u8]) -> bool {
    is_of_protocol_1(bytes) || is_of_protocol_0(bytes)
}

fn is_of_protocol_1(bytes: &[u8]) -> bool {
    let class = named_class(bytes).is_some_and(|rest| matches!(rest, [b'q' | b'r', ..]));
    matches!(bytes, [b'}' | b']', b'q' | b'r', ..]) || class
}

fn is_of_protocol_0(bytes: &[u8]) -> bool {
    let class = named_class(bytes).is_some_and(|rest| matches!(rest, [b'p', b'0'..=b'9', ..] | [b'(', ..]));
    matches!(bytes, [b'(', b'd' | b'l', b'p', b'0'..=b'9', ..]) || class
}

/// Returns the bytes after the name of a class at the beginning: `c`, its module and its name in a line each.
fn named_class(bytes: &[u8]) -> Option<&[u8]> {
    let named =
        |line: &[u8]| !line.is_empty() && line.iter().all(|b| b.is_ascii_alphanumeric() || matches!(b, b'_' | b'.'));
    let mut parts = bytes.strip_prefix(b"c")?.get(..512.min(bytes.len() - 1))?.splitn(3, |b| *b == b'\n');
    (named(parts.next()?) && named(parts.next()?)).then(|| parts.next()).flatten()
}

pub(super) struct Machine<'a> {
    pub pickle: Pickle<'a>,
    at: usize,
    stack: Vec<Value>,
    marks: Vec<usize>,
    memo: Vec<Option<Value>>,
    copied: usize,
    pushed: usize,
}

type Step<T> = Result<T, ImportError>;

impl Machine<'_> {
    pub fn refuse(&self, expected: impl Into<String>) -> ImportError {
        let remedy = match self.pickle.kind {
            Kind::Scene => "the file is damaged or no data; write it again with ScenarioNet".into(),
            Kind::Checkpoint => format!("the file is damaged or no checkpoint; {}", self.pickle.kind.remedy()),
        };
        ImportError::new(self.pickle.file, format!("byte {}", self.at), expected, remedy)
    }

    fn take(&mut self, count: usize) -> Step<Range<usize>> {
        let end = self.at.checked_add(count).filter(|&end| end <= self.pickle.bytes.len());
        let end = end.ok_or_else(|| self.refuse(format!("{count} more bytes, found the end of the file")))?;
        let range = self.at..end;
        self.at = end;
        Ok(range)
    }

    fn array<const N: usize>(&mut self) -> Step<[u8; N]> {
        let range = self.take(N)?;
        let mut bytes = [0; N];
        bytes.copy_from_slice(&self.pickle.bytes[range]);
        Ok(bytes)
    }

    fn byte(&mut self) -> Step<usize> {
        Ok(usize::from(self.array::<1>()?[0]))
    }

    fn count4(&mut self) -> Step<usize> {
        Ok(u32::from_le_bytes(self.array()?) as usize)
    }

    fn count8(&mut self) -> Step<usize> {
        let count = u64::from_le_bytes(self.array()?);
        usize::try_from(count).map_err(|_| self.refuse("a length that fits into memory"))
    }

    fn line(&mut self) -> Step<Range<usize>> {
        let rest = &self.pickle.bytes[self.at..];
        let length = rest.iter().take(4096).position(|&b| b == b'\n');
        let length = length.ok_or_else(|| self.refuse("a line end"))?;
        let range = self.take(length)?;
        self.at += 1;
        Ok(range)
    }

    fn line_text(&mut self) -> Step<String> {
        let range = self.line()?;
        let text = std::str::from_utf8(&self.pickle.bytes[range]).map(str::to_string);
        text.map_err(|_| self.refuse("UTF-8 text"))
    }

    /// Counts items that are about to be copied.
    pub fn copies(&mut self, items: usize) -> Step<()> {
        self.copied = self.copied.saturating_add(items);
        if self.copied > COPIES_MAX {
            return Err(self.refuse("at most 16 million copied items"));
        }
        Ok(())
    }

    pub fn push(&mut self, value: Value) -> Step<()> {
        if self.stack.len() >= STACK_MAX {
            return Err(self.refuse("at most 2 million values that wait for their container"));
        }
        self.pushed += 1;
        if self.pushed > VALUES_MAX {
            return Err(self.refuse("at most 16 million values"));
        }
        self.stack.push(value);
        Ok(())
    }

    pub fn object(&mut self, object: Object) -> Step<Value> {
        if self.pickle.objects.len() >= OBJECTS_MAX {
            return Err(self.refuse("at most 4 million lists, texts and the like"));
        }
        self.pickle.objects.push(object);
        Ok(Value::Object((self.pickle.objects.len() - 1) as u32))
    }

    fn push_object(&mut self, object: Object) -> Step<()> {
        let value = self.object(object)?;
        self.push(value)
    }

    fn pop(&mut self) -> Step<Value> {
        let floor = self.marks.last().copied().unwrap_or(0);
        if self.stack.len() <= floor {
            return Err(self.refuse("a value on the stack"));
        }
        self.stack.pop().ok_or_else(|| self.refuse("a value on the stack"))
    }

    fn top(&self) -> Step<Value> {
        self.stack.last().copied().ok_or_else(|| self.refuse("a value on the stack"))
    }

    fn since_mark(&mut self) -> Step<Vec<Value>> {
        let mark = self.marks.pop().ok_or_else(|| self.refuse("a mark before"))?;
        Ok(self.stack.split_off(mark.min(self.stack.len())))
    }

    fn text(&mut self, count: usize) -> Step<()> {
        let range = self.take(count)?;
        if std::str::from_utf8(&self.pickle.bytes[range.clone()]).is_err() {
            return Err(self.refuse("UTF-8 text"));
        }
        self.push_object(Object::Text(range))
    }

    /// Reads bytes; strings of Python 2 are texts where they are ASCII.
    fn bytes(&mut self, count: usize, python2: bool) -> Step<()> {
        let range = self.take(count)?;
        let is_text = python2 && self.pickle.bytes[range.clone()].is_ascii();
        self.push_object(if is_text { Object::Text(range) } else { Object::Bytes(range) })
    }

    fn long(&mut self, count: usize) -> Step<()> {
        if count > 64 {
            return Err(self.refuse("a whole number of at most 64 bytes"));
        }
        let range = self.take(count)?;
        let bytes = &self.pickle.bytes[range];
        let negative = bytes.last().is_some_and(|b| b & 0x80 != 0);
        let value = if bytes.len() <= 8 {
            let mut wide = [if negative { 0xff } else { 0 }; 8];
            wide[..bytes.len()].copy_from_slice(bytes);
            Value::Int(i64::from_le_bytes(wide))
        } else {
            // Numbers this large are ids, never quantities, so the nearest float is good enough.
            let size = bytes.iter().rev().fold(0.0, |sum, b| sum * 256.0 + f64::from(*b));
            Value::Float(size)
        };
        self.push(value)
    }

    fn remember(&mut self, index: usize) -> Step<()> {
        let value = self.top()?;
        if index > self.memo.len() + MEMO_JUMP_MAX || index > OBJECTS_MAX {
            return Err(self.refuse(format!("a memo index near {}, found {index}", self.memo.len())));
        }
        if index >= self.memo.len() {
            self.memo.resize(index + 1, None);
        }
        self.memo[index] = Some(value);
        Ok(())
    }

    fn recall(&mut self, index: usize) -> Step<()> {
        let value = self.memo.get(index).copied().flatten();
        let value = value.ok_or_else(|| self.refuse(format!("something in the memo at {index}")))?;
        self.push(value)
    }

    fn extend_list(&mut self, items: Vec<Value>) -> Step<()> {
        let Value::Object(index) = self.top()? else { return Err(self.refuse("a list to append to")) };
        match self.pickle.objects.get_mut(index as usize) {
            Some(Object::List(list) | Object::Set(list)) => list.extend(items),
            _ => return Err(self.refuse("a list to append to")),
        }
        Ok(())
    }

    fn extend_dict(&mut self, items: &[Value]) -> Step<()> {
        if !items.len().is_multiple_of(2) {
            return Err(self.refuse("keys with values"));
        }
        let Value::Object(index) = self.top()? else { return Err(self.refuse("a dictionary to fill")) };
        match self.pickle.objects.get_mut(index as usize) {
            Some(Object::Dict(entries)) => entries.extend(items.chunks_exact(2).map(|pair| (pair[0], pair[1]))),
            _ => return Err(self.refuse("a dictionary to fill")),
        }
        Ok(())
    }

    fn global(&mut self, module: &str, name: &str) -> Step<()> {
        let known = match self.pickle.kind {
            Kind::Scene => Global::named(module, name),
            Kind::Checkpoint => torch::named(module, name).or_else(|| Global::named(module, name)),
        };
        let Some(global) = known else {
            let (only, remedy) = match self.pickle.kind {
                Kind::Scene => ("numpy arrays", "a scene needs no such name; write the file again with plain data"),
                Kind::Checkpoint => ("tensors", "weights need no such name; write the network's state_dict() alone"),
            };
            let expected =
                format!("{only} and plain containers only, found the name {}.{}", shown(module), shown(name));
            return Err(ImportError::new(self.pickle.file, format!("byte {}", self.at), expected, remedy));
        };
        self.push_object(Object::Global(global))
    }

    fn stack_global(&mut self) -> Step<()> {
        let (name, module) = (self.pop()?, self.pop()?);
        let text = |value| self.pickle.text(value).map(str::to_string);
        let (Some(module), Some(name)) = (text(module), text(name)) else {
            return Err(self.refuse("a module and a name"));
        };
        self.global(&module, &name)
    }

    fn float_line(&mut self) -> Step<()> {
        let text = self.line_text()?;
        let value = text.trim().parse().map_err(|_| self.refuse("a number"))?;
        self.push(Value::Float(value))
    }

    fn int_line(&mut self) -> Step<()> {
        let text = self.line_text()?;
        let value = match text.trim().trim_end_matches('L') {
            "00" => Value::Bool(false),
            "01" => Value::Bool(true),
            digits => Value::Int(digits.parse().map_err(|_| self.refuse("a whole number"))?),
        };
        self.push(value)
    }

    fn index_line(&mut self) -> Step<usize> {
        let text = self.line_text()?;
        text.trim().parse().map_err(|_| self.refuse("an index"))
    }

    fn tuple(&mut self, count: usize) -> Step<()> {
        let mut items = Vec::with_capacity(count);
        for _ in 0..count {
            items.push(self.pop()?);
        }
        items.reverse();
        self.push_object(Object::Tuple(items))
    }

    /// Runs one opcode. Returns `false` at the end.
    fn step(&mut self) -> Step<bool> {
        match self.byte()? as u8 {
            0x80 => {
                let protocol = self.byte()?;
                if !(2..=5).contains(&protocol) {
                    return Err(self.refuse(format!("a pickle of protocol 2 to 5, found protocol {protocol}")));
                }
            }
            0x95 => {
                let frame = self.count8()?;
                if frame > self.pickle.bytes.len() - self.at {
                    return Err(self.refuse(format!("a frame of {frame} bytes, found the end of the file")));
                }
            }
            b'.' => {
                self.pickle.root = self.pop()?;
                return Ok(false);
            }
            b'(' => {
                if self.marks.len() >= STACK_MAX {
                    return Err(self.refuse("at most 2 million open marks"));
                }
                self.marks.push(self.stack.len());
            }
            b'0' => {
                self.pop()?;
            }
            b'1' => {
                self.since_mark()?;
            }
            b'2' => {
                let top = self.top()?;
                self.push(top)?;
            }
            b'N' => self.push(Value::None)?,
            0x88 => self.push(Value::Bool(true))?,
            0x89 => self.push(Value::Bool(false))?,
            b'J' => {
                let value = i32::from_le_bytes(self.array()?);
                self.push(Value::Int(i64::from(value)))?;
            }
            b'K' => {
                let value = self.byte()?;
                self.push(Value::Int(value as i64))?;
            }
            b'M' => {
                let value = u16::from_le_bytes(self.array()?);
                self.push(Value::Int(i64::from(value)))?;
            }
            0x8a => {
                let count = self.byte()?;
                self.long(count)?;
            }
            0x8b => {
                let count = self.count4()?;
                self.long(count)?;
            }
            b'I' | b'L' => self.int_line()?,
            b'F' => self.float_line()?,
            b'G' => {
                let value = f64::from_be_bytes(self.array()?);
                self.push(Value::Float(value))?;
            }
            code @ (b'U' | b'C' | 0x8c) => {
                let count = self.byte()?;
                if code == 0x8c { self.text(count)? } else { self.bytes(count, code == b'U')? }
            }
            code @ (b'T' | b'B' | b'X') => {
                let count = self.count4()?;
                if code == b'X' { self.text(count)? } else { self.bytes(count, code == b'T')? }
            }
            code @ (0x8d | 0x8e | 0x96) => {
                let count = self.count8()?;
                if code == 0x8d { self.text(count)? } else { self.bytes(count, false)? }
            }
            code => return self.container(code),
        }
        Ok(true)
    }

    fn container(&mut self, code: u8) -> Step<bool> {
        match code {
            b']' => self.push_object(Object::List(vec![]))?,
            b'}' => self.push_object(Object::Dict(vec![]))?,
            b')' => self.push_object(Object::Tuple(vec![]))?,
            0x8f => self.push_object(Object::Set(vec![]))?,
            b'l' => {
                let items = self.since_mark()?;
                self.push_object(Object::List(items))?;
            }
            b't' => {
                let items = self.since_mark()?;
                self.push_object(Object::Tuple(items))?;
            }
            0x91 => {
                let items = self.since_mark()?;
                self.push_object(Object::Set(items))?;
            }
            b'd' => {
                let items = self.since_mark()?;
                self.push_object(Object::Dict(vec![]))?;
                self.extend_dict(&items)?;
            }
            0x85..=0x87 => self.tuple(usize::from(code - 0x84))?,
            b'a' => {
                let item = self.pop()?;
                self.extend_list(vec![item])?;
            }
            b'e' | 0x90 => {
                let items = self.since_mark()?;
                self.extend_list(items)?;
            }
            b's' => {
                let (value, key) = (self.pop()?, self.pop()?);
                self.extend_dict(&[key, value])?;
            }
            b'u' => {
                let items = self.since_mark()?;
                self.extend_dict(&items)?;
            }
            0x94 => self.remember(self.memo.len())?,
            b'q' => {
                let index = self.byte()?;
                self.remember(index)?;
            }
            b'r' => {
                let index = self.count4()?;
                self.remember(index)?;
            }
            b'p' => {
                let index = self.index_line()?;
                self.remember(index)?;
            }
            b'h' => {
                let index = self.byte()?;
                self.recall(index)?;
            }
            b'j' => {
                let index = self.count4()?;
                self.recall(index)?;
            }
            b'g' => {
                let index = self.index_line()?;
                self.recall(index)?;
            }
            b'c' => {
                let (module, name) = (self.line_text()?, self.line_text()?);
                self.global(&module, &name)?;
            }
            0x93 => self.stack_global()?,
            b'Q' if self.pickle.kind == Kind::Checkpoint => {
                let id = self.pop()?;
                let storage = Storage::of(self, id)?;
                self.push_object(Object::Storage(storage))?;
            }
            b'R' | 0x81 => {
                let (arguments, callee) = (self.pop()?, self.pop()?);
                let value = applied(self, callee, arguments)?;
                self.push(value)?;
            }
            b'b' => {
                let (state, target) = (self.pop()?, self.top()?);
                built(self, target, state)?;
            }
            other => {
                self.at -= 1;
                return Err(self.refuse(format!("an opcode of plain data, found {other:#04x}")));
            }
        }
        Ok(true)
    }
}
