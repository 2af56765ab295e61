//! A store's records in an order that depends only on the records, and bytes that go to a file as they come: the way in which
//! a bundle is made and unpacked.

use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io::{Read, Write};
use std::path::Path;

use super::index::INDEX;
use super::objects::Store;
use super::pack::{self, MemoEntry, PACK};
use super::{MemoKind, Scratch, StoreError, file};
use crate::kernel::Digest;

impl Store {
    /// Writes all records that a request refers to as a pack: entries by kind and key, each object before the first entry
    /// that names it. Two stores that record the same give the same bytes. One object is in memory at a time.
    pub fn write_records(&self, to: &mut dyn Write) -> Result<(), StoreError> {
        self.write_but(None, to)
    }

    /// Removes the record of a request, and its object where no other request has it: the pack is written anew,
    /// whole or not at all, and its index made again when the store is opened next. A store without such a record stays as it is.
    pub fn withdraw(self, kind: MemoKind, key: &Digest) -> Result<(), StoreError> {
        if self.memo_get(kind, key).is_none() {
            return Ok(());
        }
        self.flush()?;
        // The index goes first: it describes the old pack alone, and a pack without one is read whole.
        file::remove_file(&self.dir().join(INDEX))?;
        write_filled(&self.dir().join(PACK), |to| self.write_but(Some((kind, *key)), to))?
    }

    fn write_but(&self, without: Option<(MemoKind, Digest)>, to: &mut dyn Write) -> Result<(), StoreError> {
        let write = |to: &mut dyn Write, bytes: &[u8]| {
            to.write_all(bytes).map_err(|source| StoreError::io("write", Path::new("the records"), source))
        };
        let mut written = BTreeSet::new();
        for (kind, key, object) in self.recorded().into_iter().filter(|of| Some((of.0, of.1)) != without) {
            if written.insert(object) {
                write(to, &pack::record(false, &object, &self.get(&object)?))?;
            }
            let body = MemoEntry { kind, key, object }.body();
            write(to, &pack::record(true, &Digest::of_bytes(&body), &body))?;
        }
        Ok(())
    }
}

/// Opens a file for reading from its beginning to its end.
pub fn reader(path: &Path) -> Result<impl Read + use<>, StoreError> {
    file::open_bounded(path, u64::MAX)
}

/// A file that remembers why it took no more bytes: the code that fills it knows neither its name nor its disk.
struct Remembering {
    file: File,
    refused: Option<std::io::Error>,
}

impl Write for Remembering {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.file.write(bytes).inspect_err(|error| {
            if error.kind() != std::io::ErrorKind::Interrupted {
                self.refused =
                    Some(error.raw_os_error().map_or(error.kind().into(), std::io::Error::from_raw_os_error));
            }
        })
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.file.flush()
    }
}

/// Writes a file from the output of `fill`, whole or not at all, without having it in memory. An error of `fill` is passed on, unless
/// the file was at fault.
pub fn write_filled<E>(
    path: &Path,
    fill: impl FnOnce(&mut dyn Write) -> Result<(), E>,
) -> Result<Result<(), E>, StoreError> {
    let io = |source| StoreError::io("write", path, source);
    // In a folder of its own, which goes with its command or, if that was killed, with the next one.
    let scratch = Scratch::beside(path)?;
    let whole = scratch.dir.join("whole");
    let mut made = Remembering { file: File::create_new(&whole).map_err(io)?, refused: None };
    let filled = fill(&mut made);
    if filled.is_err() {
        return made.refused.map_or(Ok(filled), |source| Err(io(source)));
    }
    made.file.sync_all().and_then(|()| fs::rename(&whole, path)).map_err(io)?;
    file::sync_dir(file::parent_of(path))?;
    Ok(filled)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_record_that_is_withdrawn_is_gone_with_its_object_and_may_be_made_again() {
        let dir = tempfile::tempdir().unwrap();
        let store = Store::open(dir.path()).unwrap();
        let [one, two, three] = [b"1", b"2", b"3"].map(|name| Digest::of_bytes(name));
        let kind = MemoKind::Rollout;
        for (key, bytes) in [(one, &b"wrong"[..]), (two, b"shared"), (three, b"shared")] {
            let object = store.put(bytes).unwrap();
            store.memo_put(kind, &key, &object).unwrap();
        }
        let (wrong, shared) = (Digest::of_bytes(b"wrong"), Digest::of_bytes(b"shared"));
        store.withdraw(kind, &one).unwrap();
        let store = Store::open(dir.path()).unwrap();
        assert_eq!((store.memo_get(kind, &one), store.contains(&wrong)), (None, false));
        let other = store.put(b"right").unwrap();
        store.memo_put(kind, &one, &other).unwrap();
        store.withdraw(kind, &two).unwrap();
        let store = Store::open(dir.path()).unwrap();
        assert_eq!((store.memo_get(kind, &two), store.memo_get(kind, &three)), (None, Some(shared)));
        assert_eq!((store.memo_get(kind, &one), store.get(&shared).unwrap()), (Some(other), b"shared".to_vec()));
        drop(store);
        assert_eq!(super::super::fsck(dir.path(), true).unwrap().damage, []);
    }
}
