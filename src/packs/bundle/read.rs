//! Reads a bundle from its beginning to its end, once: every byte is checked against the manifest, and no more of it is in
//! memory than a window of the decompressor and one piece.

use std::collections::BTreeSet;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;

use super::BundleError;
use super::manifest::{Content, MANIFEST_BYTES_MAX, Manifest};
use super::names::{self, MANIFEST, SIGNATURE};
use super::write::header;
use crate::kernel::{Digest, Hashing};
use crate::store;

/// Most bytes of a signature.
const SIGNATURE_BYTES_MAX: u64 = 1 << 16;
/// Most bytes, as a power of two, that the decompressor looks back on.
const WINDOW_LOG_MAX: u32 = 26;
const CHUNK: usize = 1 << 16;
/// The bit behind the first bytes of a zstd frame that says that it ends in a checksum (RFC 8878, section 3.1.1).
const CHECKSUM: u8 = 1 << 2;

/// A bundle that was read to its end and is whole.
pub struct Opened {
    pub manifest: Manifest,
    /// The manifest's bytes, which a signature is about.
    pub manifest_bytes: Vec<u8>,
    /// The envelope of a signature, unread.
    pub signature: Option<Vec<u8>>,
}

/// Reads a bundle of at most `bytes_max` bytes unpacked. With `to`, its files go there, each under its name; the caller
/// removes that folder when this fails.
pub fn open(path: &Path, bytes_max: u64, to: Option<&Path>) -> Result<Opened, BundleError> {
    let reading = Reading { file: path.display().to_string(), bytes_max };
    let most = store::unpacked_bytes_max(store::length(path)?);
    let mut archive = tar::Archive::new(reading.frame(path, most)?);
    let mut entries = archive.entries().map_err(|error| reading.no_bundle(&error))?.raw(true);
    let first = entries.next().ok_or_else(|| reading.refused(format!("expected {MANIFEST} first, found no entry")))?;
    let mut first = first.map_err(|error| reading.no_bundle(&error))?;
    let manifest_bytes = reading.small(&mut first, MANIFEST, MANIFEST_BYTES_MAX)?;
    let manifest = Manifest::read(&reading.file, &manifest_bytes, bytes_max)?;
    if let Some(to) = to {
        store::write_atomic(&to.join(MANIFEST), &manifest_bytes)?;
    }
    let (mut seen, mut signature) = (BTreeSet::from([MANIFEST.to_string()]), None);
    let mut expected = manifest.files.iter();
    for found in entries {
        let mut entry = found.map_err(|error| reading.broken(&error))?;
        let name = reading.name(&entry)?;
        if !seen.insert(name.clone()) {
            return Err(reading.refused(format!("expected {name} once, found it a second time")));
        }
        if signature.is_some() {
            return Err(reading.refused(format!("expected nothing after {SIGNATURE}, found {name}")));
        }
        match expected.next() {
            Some(content) if content.path == name => reading.content(&mut entry, content, to)?,
            None if name == SIGNATURE => signature = Some(reading.small(&mut entry, SIGNATURE, SIGNATURE_BYTES_MAX)?),
            Some(content) => return Err(reading.damaged(format!("expected {} next, found {name}", content.path))),
            None => return Err(reading.refused(format!("expected the manifest to name every file, found {name} too"))),
        }
    }
    if let Some(content) = expected.next() {
        return Err(reading.damaged(format!("expected {}, found the end of the archive", content.path)));
    }
    reading.end(archive.into_inner())?;
    Ok(Opened { manifest, manifest_bytes, signature })
}

/// The one frame of a bundle, and the number of bytes that it may still give.
struct Frame<R: Read> {
    decoder: zstd::stream::read::Decoder<'static, BufReader<R>>,
    left: u64,
    most: u64,
}

impl<R: Read> Read for Frame<R> {
    fn read(&mut self, to: &mut [u8]) -> std::io::Result<usize> {
        let count = self.decoder.read(to)?;
        self.left = self.left.checked_sub(count as u64).ok_or_else(|| {
            let per_byte = store::UNPACKED_PER_BYTE;
            let most = self.most;
            std::io::Error::other(format!(
                "more than the {most} bytes that a file of this length may come to ({per_byte} for each of its bytes, and {} more)",
                store::UNPACKED_FREE
            ))
        })?;
        Ok(count)
    }
}

/// Data that every step of the reading needs.
struct Reading {
    file: String,
    bytes_max: u64,
}

impl Reading {
    fn refused(&self, problem: String) -> BundleError {
        BundleError::Refused { file: self.file.clone(), problem }
    }

    fn damaged(&self, problem: String) -> BundleError {
        BundleError::Damaged { file: self.file.clone(), problem }
    }

    fn no_bundle(&self, error: &std::io::Error) -> BundleError {
        self.refused(format!("expected a bundle (a tar archive under zstd), found something else: {error}"))
    }

    /// Opens the one frame of a bundle: it must have a checksum, so that no byte of it can change unseen.
    fn frame(&self, path: &Path, most: u64) -> Result<Frame<impl Read + use<>>, BundleError> {
        let mut packed = BufReader::new(store::reader(path)?);
        let head = packed.fill_buf().map_err(|error| self.no_bundle(&error))?;
        if head.starts_with(&store::ZSTD_MAGIC) && head.get(4).is_some_and(|described| described & CHECKSUM == 0) {
            return Err(self.refused("expected a zstd frame with a checksum, found one without".into()));
        }
        let decoder = zstd::stream::read::Decoder::with_buffer(packed).and_then(|mut decoder| {
            decoder.window_log_max(WINDOW_LOG_MAX)?;
            Ok(decoder.single_frame())
        });
        Ok(Frame { decoder: decoder.map_err(|error| self.no_bundle(&error))?, left: most, most })
    }

    fn broken(&self, error: &std::io::Error) -> BundleError {
        self.damaged(format!("expected a whole archive, found: {error}"))
    }

    /// Returns the name of an entry. A name that may not be there is refused before anything else is read.
    fn name(&self, found: &tar::Entry<'_, impl Read>) -> Result<String, BundleError> {
        let name = String::from_utf8_lossy(&found.header().path_bytes()).into_owned();
        names::refused(&name).map_or(Ok(name), |problem| Err(self.refused(problem)))
    }

    /// Returns the size of an entry, which must have the one header of a file of its name and size.
    fn size(&self, found: &tar::Entry<'_, impl Read>, name: &str) -> Result<u64, BundleError> {
        let size = found.header().size().map_err(|error| self.broken(&error))?;
        let due = header(name, size).map_err(|error| self.broken(&error))?;
        if due.as_bytes() != found.header().as_bytes() {
            return Err(self.refused(format!(
                "{name}: expected a plain file with the fixed owner, time and mode of a bundle, found another entry"
            )));
        }
        Ok(size)
    }

    /// All bytes of an entry that is small.
    fn small(&self, found: &mut tar::Entry<'_, impl Read>, due: &str, max: u64) -> Result<Vec<u8>, BundleError> {
        let name = self.name(found)?;
        if name != due {
            return Err(self.refused(format!("expected {due} first, found {name}")));
        }
        let size = self.size(found, due)?;
        if size > max {
            return Err(self.refused(format!("{due}: expected at most {max} bytes, found {size}")));
        }
        let mut bytes = Vec::new();
        found.read_to_end(&mut bytes).map_err(|error| self.broken(&error))?;
        if bytes.len() as u64 == size { Ok(bytes) } else { Err(self.damaged(format!("{due} is cut off"))) }
    }

    /// Reads one file, and checks it against the manifest.
    fn content(
        &self,
        found: &mut tar::Entry<'_, impl Read>,
        content: &Content,
        to: Option<&Path>,
    ) -> Result<(), BundleError> {
        let size = self.size(found, &content.path)?;
        if size != content.bytes {
            let (path, bytes) = (&content.path, content.bytes);
            return Err(self.damaged(format!("{path}: expected {bytes} bytes, found {size}")));
        }
        let sum = match to {
            None => self.pour(found, &mut std::io::sink())?,
            Some(to) => {
                let mut sum = None;
                store::write_filled(&to.join(&content.path), |file| -> Result<(), BundleError> {
                    sum = Some(self.pour(found, file)?);
                    Ok(())
                })??;
                sum.unwrap_or_else(|| Hashing::default().so_far())
            }
        };
        let due: (Digest, u64) = (content.digest, content.bytes);
        if sum == due {
            return Ok(());
        }
        let (path, (digest, bytes)) = (&content.path, sum);
        Err(self.damaged(format!(
            "{path}: expected {} bytes of digest {}, found {bytes} bytes of digest {digest}",
            due.1, due.0
        )))
    }

    /// Writes the bytes of an entry to `to`, and hashes them on the way.
    fn pour(&self, from: &mut impl Read, to: &mut dyn std::io::Write) -> Result<(Digest, u64), BundleError> {
        let mut hashing = Hashing::default();
        let mut chunk = vec![0; CHUNK];
        loop {
            let count = from.read(&mut chunk).map_err(|error| self.broken(&error))?;
            if count == 0 {
                return Ok(hashing.so_far());
            }
            hashing.add(&chunk[..count]);
            to.write_all(&chunk[..count]).map_err(|source| {
                let (path, remedy) = (self.file.clone().into(), "make room on the disk and repeat");
                BundleError::Store(store::StoreError::Io { action: "unpack", path, source, remedy })
            })?;
        }
    }

    /// Checks that nothing follows the archive's end, or the frame's: a second frame, or one that readers skip, could hold anything.
    fn end<R: Read>(&self, mut rest: Frame<R>) -> Result<(), BundleError> {
        let mut chunk = vec![0; CHUNK];
        let mut bytes = 0;
        loop {
            let count = rest.read(&mut chunk).map_err(|error| self.broken(&error))?;
            bytes += count as u64;
            if count == 0 {
                break;
            }
            if chunk[..count].iter().any(|byte| *byte != 0) || bytes > self.bytes_max {
                return Err(self.damaged("expected nothing after the last entry, found more bytes".into()));
            }
        }
        match rest.decoder.finish().fill_buf() {
            Ok([]) => Ok(()),
            Ok(_) => Err(self.damaged("expected one zstd frame and nothing behind it, found more bytes".into())),
            Err(error) => Err(self.broken(&error)),
        }
    }
}
