//! Checkpoints of PyTorch: the tensors of a network's state dictionary. Both forms of `torch.save` are read, the zip of a pickle
//! and raw numbers, and the row of pickles before it. Nothing is run: the pickle is read as data, and a name that is
//! neither a tensor nor a plain container is refused.

mod zip;

use std::collections::BTreeMap;

use super::import_error::{ImportError, shown};
use super::scenarionet::pickle::{self, Pickle, Storage};
use zip::Zip;

/// How the older form begins: a pickle of torch's magic number.
const OLD_HEAD: &[u8] = b"\x80\x02\x8a\x0al\xfc\x9cF\xf9 j\xa8P\x19.";
/// The version of the older form.
const OLD_VERSION: f64 = 1001.0;
/// Numbers of all tensors of a dictionary.
const NUMBERS_MAX: usize = 16_000_000;
const REMEDY: &str = "write it again with torch.save(network.state_dict(), file)";

/// One tensor.
#[derive(Clone, Debug, PartialEq)]
pub struct Tensor {
    /// Its key in the dictionary.
    pub name: String,
    /// Length of each dimension.
    pub shape: Vec<usize>,
    /// Its numbers, the last dimension running fastest.
    pub values: Vec<f32>,
}

/// The tensors of a checkpoint's state dictionary: the first of several in a row, the one under the first of these keys that there is,
/// or the whole.
///
/// # Errors
/// Another file, one that would run something, damage, tensors of other than float32 or float64, more than 16 million numbers.
pub fn state_dict(file: &str, bytes: &[u8], under: &[&str]) -> Result<Vec<Tensor>, ImportError> {
    if bytes.starts_with(b"PK\x03\x04") {
        let zip = Zip::of(file, bytes)?;
        let (folder, pickled) = pickled(file, &zip)?;
        let (pickle, _) = pickle::read_checkpoint(file, pickled).map_err(|error| inside("data.pkl", error))?;
        if let Ok(order) = zip.entry(&format!("{folder}/byteorder"))
            && order != b"little"
        {
            let found = shown(&String::from_utf8_lossy(order));
            return Err(ImportError::new(file, "byteorder", format!("little, found {found:?}"), REMEDY));
        }
        return tensors(file, &pickle, under, |storage| zip.entry(&format!("{folder}/data/{}", storage.key)));
    }
    if bytes.starts_with(OLD_HEAD) {
        return old(file, bytes, under);
    }
    let expected = "a checkpoint of torch.save: a zip file, or a pickle that begins with torch's magic number";
    Err(ImportError::new(file, "byte 0", expected, REMEDY))
}

/// The folder of a zip's pickle, and the pickle.
fn pickled<'a>(file: &str, zip: &Zip<'a>) -> Result<(&'a str, &'a [u8]), ImportError> {
    let mut folders = zip.names().filter_map(|name| name.strip_suffix("/data.pkl").filter(|rest| !rest.contains('/')));
    match (folders.next(), folders.next()) {
        (Some(folder), None) => Ok((folder, zip.entry(&format!("{folder}/data.pkl"))?)),
        _ => Err(ImportError::new(file, "its list", "one entry FOLDER/data.pkl", REMEDY)),
    }
}

/// The older form: magic number, version, machine, dictionary and keys as a pickle each; then the numbers of each key behind their
/// count.
fn old(file: &str, bytes: &[u8], under: &[&str]) -> Result<Vec<Tensor>, ImportError> {
    let refuse = |place: &str, expected: String| ImportError::new(file, place, expected, REMEDY);
    let mut at = OLD_HEAD.len();
    let mut next = |what: &str| {
        let (pickle, length) = pickle::read_checkpoint(file, &bytes[at..])
            .map_err(|error| inside(&format!("{what} from byte {at}"), error))?;
        at += length;
        Ok::<_, ImportError>(pickle)
    };
    let (version, machine) = (next("version")?, next("machine")?);
    if version.root().number() != Some(OLD_VERSION) {
        return Err(refuse("version", format!("{OLD_VERSION}")));
    }
    if machine.root().get("little_endian").and_then(|is| is.number()) != Some(1.0) {
        return Err(refuse("machine", "little_endian, True".into()));
    }
    let (dictionary, keys) = (next("dictionary")?, next("keys")?);
    let known: BTreeMap<&str, &Storage> = dictionary.storages().map(|of| (of.key.as_str(), of)).collect();
    let root = keys.root();
    let keys = root.items().ok_or_else(|| root.refuse("a list of keys"))?;
    let mut numbers: BTreeMap<&str, &[u8]> = BTreeMap::new();
    for key in keys {
        let storage = key.text().and_then(|key| known.get(key));
        let storage = storage.ok_or_else(|| key.refuse("the key of a storage in the dictionary"))?;
        let place = format!("storage {:?}", shown(&storage.key));
        let taken = |at: usize, count: usize| {
            let end = at.checked_add(count).filter(|end| *end <= bytes.len());
            end.ok_or_else(|| refuse(&place, format!("{count} more bytes, found the end of the file")))
        };
        let end = taken(at, 8)?;
        let count = bytes[at..end].iter().rev().fold(0, |sum, byte| (sum << 8) | u64::from(*byte));
        if count != storage.count as u64 {
            return Err(refuse(&place, format!("{} numbers, found {count}", storage.count)));
        }
        at = end;
        let end = taken(at, storage.count.saturating_mul(storage.number_bytes))?;
        numbers.insert(&storage.key, &bytes[at..end]);
        at = end;
    }
    tensors(file, &dictionary, under, |storage| {
        let found = numbers.get(storage.key.as_str()).copied();
        found.ok_or_else(|| refuse("keys", format!("the key {:?}", shown(&storage.key))))
    })
}

/// The tensors of the dictionary that is meant, with the bytes of their storages.
fn tensors<'a>(
    file: &str,
    pickle: &Pickle<'_>,
    under: &[&str],
    bytes: impl Fn(&Storage) -> Result<&'a [u8], ImportError>,
) -> Result<Vec<Tensor>, ImportError> {
    let root = pickle.root();
    let first = root.items().and_then(|mut items| items.next());
    let dictionary = first.or_else(|| under.iter().find_map(|key| root.get(key))).unwrap_or_else(|| root.clone());
    let refuse = || dictionary.refuse(format!("a dictionary of tensors, or one under {}", under.join(", ")));
    let mut read: Vec<Tensor> = Vec::new();
    let mut all = 0_usize;
    for (name, node) in dictionary.entries().ok_or_else(refuse)? {
        let (tensor, storage) = node.tensor().ok_or_else(|| node.refuse("a tensor"))?;
        let place = |what: String| ImportError::new(file, format!("tensor {:?}", shown(&name)), what, REMEDY);
        let count = tensor.shape.iter().try_fold(1_usize, |product, n| product.checked_mul(*n));
        all = count.map_or(usize::MAX, |count| all.saturating_add(count));
        if all > NUMBERS_MAX {
            return Err(place(format!("at most {NUMBERS_MAX} numbers in all, with shape {:?}", tensor.shape)));
        }
        let number: fn(&[u8]) -> Option<f32> = match storage.class {
            "FloatStorage" => |raw| raw.first_chunk().map(|raw| f32::from_le_bytes(*raw)),
            "DoubleStorage" => |raw| raw.first_chunk().map(|raw| f64::from_le_bytes(*raw) as f32),
            other => return Err(place(format!("float32 or float64 numbers, found a {other}"))),
        };
        let raw = bytes(storage)?;
        if Some(raw.len()) != storage.count.checked_mul(storage.number_bytes) {
            let found = raw.len();
            return Err(place(format!(
                "{} numbers of {} bytes, found {found} bytes",
                storage.count, storage.number_bytes
            )));
        }
        let mut values = Vec::with_capacity(count.unwrap_or(0));
        for place_in in 0..count.unwrap_or(0) {
            let at = tensor.place(place_in).and_then(|at| at.checked_mul(storage.number_bytes));
            let value = at.and_then(|at| raw.get(at..)).and_then(number);
            values.push(value.ok_or_else(|| place(format!("numbers within a storage of {}", storage.count)))?);
        }
        read.push(Tensor { name: name.into_owned(), shape: tensor.shape.clone(), values });
    }
    if read.is_empty() { Err(refuse()) } else { Ok(read) }
}

/// An error within a part of the file.
fn inside(part: &str, error: ImportError) -> ImportError {
    ImportError { place: format!("{part}: {}", error.place), ..error }
}
