//! Writes a bundle: fixed order, fixed times, fixed owners, so that equal contents are equal bytes.

use std::io::{Read, Write};
use std::path::{Path, PathBuf};

use super::crate_metadata::{Publication, metadata};
use super::manifest::{Content, FORMAT, Manifest, Version};
use super::names::{CRATE, MANIFEST, SIGNATURE};
use super::{BundleError, Signer};
use crate::kernel::{Digest, Hashing};
use crate::store::{self, Store, StoreError};

/// Higher levels save little and take minutes on a large study.
const LEVEL: i32 = 12;
/// Size to whose multiples an archive is padded.
pub const BLOCK: u64 = 512;
const CHUNK: usize = 1 << 16;

/// Source of the bytes of a file. None of them has to be in memory.
pub enum Source<'a> {
    /// A file of the run folder.
    File(PathBuf),
    /// The records of its store, in an order of their own.
    Records(&'a Store),
    /// Bytes.
    Bytes(Vec<u8>),
}

/// A file that goes into a bundle.
pub struct Part<'a> {
    /// Its name in the bundle, one of those that a bundle may hold.
    pub path: &'static str,
    pub source: Source<'a>,
}

/// Facts of the run that go into a bundle.
pub struct About {
    pub name: String,
    pub root: Digest,
    pub experiment: Digest,
    pub pool: Digest,
    pub versions: Version,
}

impl Source<'_> {
    fn write(&self, to: &mut dyn Write) -> Result<(), StoreError> {
        match self {
            Source::Records(store) => store.write_records(to),
            Source::Bytes(bytes) => to.write_all(bytes).map_err(failed),
            Source::File(path) => {
                let mut from = store::reader(path)?;
                let mut chunk = vec![0; CHUNK];
                loop {
                    let count = from.read(&mut chunk).map_err(failed)?;
                    if count == 0 {
                        return Ok(());
                    }
                    to.write_all(&chunk[..count]).map_err(failed)?;
                }
            }
        }
    }
}

fn failed(source: std::io::Error) -> StoreError {
    StoreError::Io { action: "write", path: "the bundle".into(), source, remedy: "check the path and the disk" }
}

/// Writes the bundle of these parts and gives its manifest. Nothing is at `path` until all of it is.
pub fn create(
    path: &Path,
    about: About,
    mut parts: Vec<Part<'_>>,
    [date, license]: [&str; 2],
    signer: Option<&Signer>,
) -> Result<Manifest, BundleError> {
    let About { name, root, experiment, pool, versions } = about;
    let mut manifest = Manifest { format: FORMAT.into(), name, root, experiment, pool, versions, files: Vec::new() };
    for part in &parts {
        manifest.files.push(content(part)?);
    }
    let described = Source::Bytes(metadata(&manifest, &Publication { date, license }));
    parts.push(Part { path: CRATE, source: described });
    manifest.files.push(content(&parts[parts.len() - 1])?);
    parts.sort_by_key(|part| part.path);
    manifest.files.sort_by(|a, b| a.path.cmp(&b.path));
    let text = manifest.text();
    let envelope = signer.map(|signer| signer.envelope(&manifest, &text));
    let filled = store::write_filled(path, |file| -> Result<(), StoreError> {
        let mut packed = zstd::stream::write::Encoder::new(file, LEVEL).map_err(failed)?;
        packed.include_checksum(true).map_err(failed)?;
        entry(&mut packed, MANIFEST, text.len() as u64, &Source::Bytes(text))?;
        for (part, content) in parts.iter().zip(&manifest.files) {
            entry(&mut packed, part.path, content.bytes, &part.source)?;
        }
        if let Some(envelope) = envelope {
            entry(&mut packed, SIGNATURE, envelope.len() as u64, &Source::Bytes(envelope))?;
        }
        packed.write_all(&[0; 2 * BLOCK as usize]).map_err(failed)?;
        packed.finish().map_err(failed)?;
        Ok(())
    })?;
    filled?;
    Ok(manifest)
}

fn content(part: &Part<'_>) -> Result<Content, StoreError> {
    let mut hashing = Hashing::default();
    part.source.write(&mut hashing)?;
    let (digest, bytes) = hashing.so_far();
    Ok(Content { path: part.path.to_string(), bytes, digest })
}

fn entry(to: &mut dyn Write, path: &str, bytes: u64, source: &Source<'_>) -> Result<(), StoreError> {
    to.write_all(header(path, bytes).map_err(failed)?.as_bytes()).map_err(failed)?;
    source.write(to)?;
    let rest = (BLOCK - bytes % BLOCK) % BLOCK;
    to.write_all(&vec![0; rest as usize]).map_err(failed)
}

/// The one header that a file of this name and size has.
pub fn header(path: &str, bytes: u64) -> std::io::Result<tar::Header> {
    let mut header = tar::Header::new_ustar();
    header.set_path(path)?;
    header.set_size(bytes);
    header.set_mode(0o644);
    header.set_uid(0);
    header.set_gid(0);
    header.set_mtime(0);
    header.set_entry_type(tar::EntryType::Regular);
    header.set_cksum();
    Ok(header)
}
