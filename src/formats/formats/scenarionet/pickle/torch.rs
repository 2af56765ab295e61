//! Torch's tensors in the pickle of a checkpoint: their storages, and their numbers' places in them. The numbers lie outside the pickle.

use super::machine::Machine;
use super::numpy::Global;
use super::{Node, Object, Pickle, Value};
use crate::formats::import_error::ImportError;

/// Most dimensions of a tensor.
const DIMENSIONS_MAX: usize = 8;

/// Classes of storages, with the bytes of a number.
const STORAGES: [(&str, usize); 12] = [
    ("FloatStorage", 4),
    ("DoubleStorage", 8),
    ("HalfStorage", 2),
    ("BFloat16Storage", 2),
    ("LongStorage", 8),
    ("IntStorage", 4),
    ("ShortStorage", 2),
    ("CharStorage", 1),
    ("ByteStorage", 1),
    ("BoolStorage", 1),
    ("ComplexFloatStorage", 8),
    ("ComplexDoubleStorage", 16),
];

/// Returns the names that a checkpoint may use beyond those of a scene.
pub(super) fn named(module: &str, name: &str) -> Option<Global> {
    match (module, name) {
        ("torch._utils", "_rebuild_tensor_v2") => Some(Global::Tensor),
        ("torch._utils", "_rebuild_parameter") => Some(Global::Parameter),
        ("torch" | "torch.storage", _) => {
            STORAGES.into_iter().find(|of| of.0 == name).map(|(name, bytes)| Global::StorageType(name, bytes))
        }
        _ => None,
    }
}

fn whole(value: Value) -> Option<usize> {
    match value {
        Value::Int(count) => usize::try_from(count).ok(),
        _ => None,
    }
}

/// Numbers that lie outside the pickle, under a key.
#[derive(Clone, Debug)]
pub struct Storage {
    /// Key under which the file has them.
    pub key: String,
    /// Its class in torch, such as `FloatStorage`.
    pub class: &'static str,
    /// Bytes of a number.
    pub number_bytes: usize,
    /// Number of its numbers.
    pub count: usize,
}

impl Storage {
    /// Reads a persistent id: `("storage", class, key, device, count)`, of old files with a sixth item.
    pub(super) fn of(machine: &mut Machine<'_>, id: Value) -> Result<Storage, ImportError> {
        let storage = machine.pickle.storage(id);
        let storage = storage.ok_or_else(|| machine.refuse("the id of a storage: its class, key, device and count"))?;
        machine.copies(storage.key.len())?;
        Ok(storage)
    }
}

/// A tensor: the places of its numbers in a storage.
#[derive(Clone, Debug)]
pub struct Tensor {
    storage: Value,
    /// Index of its first number in the storage.
    pub offset: usize,
    /// Length of each dimension.
    pub shape: Vec<usize>,
    /// Distance from one number to the next of each dimension.
    pub strides: Vec<usize>,
}

impl Tensor {
    /// Reads the arguments from which torch builds it: storage, offset, shape, strides, and data for training.
    pub(super) fn of(machine: &mut Machine<'_>, arguments: &[Value]) -> Result<Tensor, ImportError> {
        // A hostile file may have one tensor built very often.
        machine.copies(2 * DIMENSIONS_MAX)?;
        let tensor = machine.pickle.tensor_of(arguments);
        tensor.ok_or_else(|| machine.refuse("storage, offset, shape and strides of a tensor"))
    }

    /// Returns the index in its storage of a number, counted with the last dimension running fastest; `None` if it overflows.
    pub fn place(&self, mut index: usize) -> Option<usize> {
        let mut place = self.offset;
        for (length, stride) in self.shape.iter().zip(&self.strides).rev() {
            place = place.checked_add((index % length).checked_mul(*stride)?)?;
            index /= length;
        }
        Some(place)
    }
}

impl Pickle<'_> {
    fn storage(&self, id: Value) -> Option<Storage> {
        let Object::Tuple(items) = self.object(id)? else { return None };
        let (word, class, key, count) = match items[..] {
            [word, class, key, _, count] | [word, class, key, _, count, Value::None] => (word, class, key, count),
            _ => return None,
        };
        let Object::Global(Global::StorageType(class, number_bytes)) = *self.object(class)? else { return None };
        let (key, count) = (self.id_text(key)?.to_string(), whole(count)?);
        self.is_text(word, "storage").then_some(Storage { key, class, number_bytes, count })
    }

    fn tensor_of(&self, arguments: &[Value]) -> Option<Tensor> {
        let [storage, offset, shape, strides, ..] = *arguments else { return None };
        let counts = |value| match self.object(value)? {
            Object::Tuple(items) if items.len() <= DIMENSIONS_MAX => items.iter().copied().map(whole).collect(),
            _ => None,
        };
        let (offset, shape, strides): (_, Vec<_>, Vec<_>) = (whole(offset)?, counts(shape)?, counts(strides)?);
        let is_sound = matches!(self.object(storage)?, Object::Storage(_)) && shape.len() == strides.len();
        is_sound.then_some(Tensor { storage, offset, shape, strides })
    }

    /// Yields the storages that tensors refer to, in the order of the file.
    pub fn storages(&self) -> impl Iterator<Item = &Storage> {
        self.objects.iter().filter_map(|object| match object {
            Object::Storage(storage) => Some(storage),
            _ => None,
        })
    }
}

impl<'p> Node<'p> {
    /// Returns a tensor and its storage, if it is one.
    pub fn tensor(&self) -> Option<(&'p Tensor, &'p Storage)> {
        let Some(Object::Tensor(tensor)) = self.pickle.object(self.value) else { return None };
        match self.pickle.object(tensor.storage) {
            Some(Object::Storage(storage)) => Some((tensor, storage)),
            _ => None,
        }
    }
}
