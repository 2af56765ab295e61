//! A store's records in an order that depends on nothing but what is recorded, and bytes that go to a file as they come: what
//! a bundle is made of and unpacked to.

use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io::{Read, Write};
use std::path::Path;

use super::objects::Store;
use super::pack::{self, MemoEntry};
use super::{StoreError, file};
use crate::kernel::Digest;

impl Store {
    /// Writes all records that a request refers to as a pack: entries by kind and key, each object before the first entry
    /// that names it. Two stores that record the same give the same bytes. One object is in memory at a time.
    pub fn write_records(&self, to: &mut dyn Write) -> Result<(), StoreError> {
        let write = |to: &mut dyn Write, bytes: &[u8]| {
            to.write_all(bytes).map_err(|source| StoreError::io("write", Path::new("the records"), source))
        };
        let mut written = BTreeSet::new();
        for (kind, key, object) in self.recorded() {
            if written.insert(object) {
                write(to, &pack::record(false, &object, &self.get(&object)?))?;
            }
            let body = MemoEntry { kind, key, object }.body();
            write(to, &pack::record(true, &Digest::of_bytes(&body), &body))?;
        }
        Ok(())
    }
}

/// Opens a file to be read from its beginning to its end.
pub fn reader(path: &Path) -> Result<impl Read + use<>, StoreError> {
    file::open_bounded(path, u64::MAX)
}

/// A file that remembers why it took no more: whoever fills it knows neither its name nor its disk.
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

/// Writes a file from what `fill` writes, whole or not at all, without having it in memory. What `fill` says is passed on, unless
/// the file was at fault.
pub fn write_filled<E>(
    path: &Path,
    fill: impl FnOnce(&mut dyn Write) -> Result<(), E>,
) -> Result<Result<(), E>, StoreError> {
    let io = |source| StoreError::io("write", path, source);
    let temporary = file::neighbour(path)?;
    if let Some(name) = path.file_name() {
        file::remove_abandoned(file::parent_of(path), &format!(".{}.", name.to_string_lossy()), ".tmp");
    }
    let mut made = Remembering { file: File::create(&temporary).map_err(io)?, refused: None };
    // Held while it is written: what nobody holds was left by a command that was killed.
    let _claimed = file::claim(&temporary)?;
    let filled = fill(&mut made);
    if filled.is_err() {
        let _ = fs::remove_file(&temporary);
        return made.refused.map_or(Ok(filled), |source| Err(io(source)));
    }
    let ended = made.file.sync_all().and_then(|()| fs::rename(&temporary, path));
    if let Err(source) = ended {
        let _ = fs::remove_file(&temporary);
        return Err(io(source));
    }
    file::sync_dir(file::parent_of(path))?;
    Ok(filled)
}
