//! Objects by digest and the memo of requests, in one folder: the pack (the truth), the index (rebuilt when lost) and a lock.
//!
//! Once `put` or `memo_put` has returned, the data survive a kill of the process. Data written before the last `flush`
//! survive a power cut.

use std::{
    collections::BTreeMap,
    fs::{self, File, OpenOptions},
    io::{ErrorKind, Read, Seek, SeekFrom, Write},
    path::{Path, PathBuf},
    sync::{Mutex, MutexGuard},
};

use super::{
    Damage, MemoKind, StoreError,
    file::{self, create_dir, no_device},
    index::{INDEX, Index, Places},
    no_file::NoFile,
    pack::{self, HEADER, MemoEntry, PACK, Piece},
};
use crate::kernel::Digest;

/// File name of the lock inside a store's folder.
const LOCK: &str = "lock";

/// Repairs made when a store was opened.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Opening {
    /// Bytes of a write that was cut off, removed from the end of the pack.
    pub cut_bytes: u64,
    /// Records found behind the last flush and indexed now.
    pub indexed_records: usize,
    /// Why the whole index was rebuilt, if it was.
    pub rebuilt_because: Option<String>,
    /// The disk has none of the locks that SQLite takes, so the index goes without: the store's own lock replaces them.
    pub without_index_locks: bool,
}

/// An open store. One process at a time; inside it, any number of threads.
#[derive(Debug)]
pub struct Store {
    dir: PathBuf,
    state: Mutex<State>,
    opening: Opening,
    /// Held until the store is dropped; `None` for a store that cannot be written to.
    _lock: Option<Lock>,
}

/// A store's lock, held until it is dropped. Its file names the holder; when the lock is dropped the name is removed.
#[derive(Debug)]
pub(super) struct Lock(File);

impl Drop for Lock {
    fn drop(&mut self) {
        let _ = self.0.set_len(0);
    }
}

#[derive(Debug)]
struct State {
    pack: File,
    /// `None` for a store that is only looked at.
    index: Option<Index>,
    /// Objects put into a store that is only looked at; they are gone with it.
    unsaved: BTreeMap<Digest, Vec<u8>>,
    places: Places,
    /// End of the pack: where the next record goes.
    end: u64,
    /// Written to the pack but not yet to the index.
    pending: Vec<Piece>,
}

impl Store {
    /// Opens the store in a folder, or makes one there. A write that a kill cut off is removed, an index that does not agree
    /// with the pack is rebuilt. A pack that is shorter than at its last flush is corruption, and is left as it is.
    pub fn open(dir: &Path) -> Result<Store, StoreError> {
        create_dir(dir)?;
        let lock = take_lock(dir)?;
        let pack_path = dir.join(PACK);
        no_device(&pack_path)?;
        let io = |source| StoreError::io("open", &pack_path, source);
        let pack =
            OpenOptions::new().read(true).write(true).create(true).truncate(false).open(&pack_path).map_err(io)?;
        let mut opening = Opening::default();
        let (index, mut places) = match load_index(&dir.join(INDEX)) {
            Ok(loaded) => loaded,
            Err(reason) => {
                opening.rebuilt_because = Some(reason);
                (new_index(&dir.join(INDEX))?, Places::default())
            }
        };
        opening.without_index_locks = index.is_without_locks();
        let mut end = pack.metadata().map_err(io)?.len();
        if places.indexed_to > end {
            return Err(StoreError::corrupt(truncated(&pack_path, &places, end)));
        }
        let pieces = pack::scan(&pack, places.indexed_to, true).map_err(io)?;
        if let Some(Piece::Torn { at }) = pieces.last() {
            opening.cut_bytes = end - at;
            end = *at;
            pack.set_len(end).map_err(io)?;
        }
        opening.indexed_records =
            pieces.iter().filter(|piece| matches!(piece, Piece::Object { .. } | Piece::Memo { .. })).count();
        pieces.iter().for_each(|piece| places.add(piece));
        let state = State { pack, index: Some(index), unsaved: BTreeMap::new(), places, end, pending: pieces };
        let store = Store { dir: dir.to_path_buf(), state: Mutex::new(state), opening, _lock: Some(lock) };
        if store.opening != Opening::default() {
            store.flush()?;
        }
        Ok(store)
    }

    /// Opens the store of a finished run only to look. Where the folder can be written to, nobody else writes to it meanwhile;
    /// where it cannot, nothing is locked or mended, and objects that are put exist until the store is dropped.
    pub fn open_to_look(dir: &Path) -> Result<Store, StoreError> {
        match take_lock_to_look(dir)? {
            Some(lock) => {
                drop(lock);
                Store::open(dir)
            }
            None => Store::as_it_is(dir),
        }
    }

    /// A store to which nothing is written, neither to its pack nor beside it.
    fn as_it_is(dir: &Path) -> Result<Store, StoreError> {
        let pack_path = dir.join(PACK);
        no_device(&pack_path)?;
        let io = |source| StoreError::io("open", &pack_path, source);
        let pack = File::open(&pack_path).map_err(io)?;
        let mut opening = Opening::default();
        let index = Index::open_existing(&dir.join(INDEX), false).map_err(|error| error.to_string());
        let mut places = index.and_then(|index| loaded(&index)).unwrap_or_else(|reason| {
            opening.rebuilt_because = Some(reason);
            Places::default()
        });
        let end = pack.metadata().map_err(io)?.len();
        if places.indexed_to > end {
            return Err(StoreError::corrupt(truncated(&pack_path, &places, end)));
        }
        let pieces = pack::scan(&pack, places.indexed_to, true).map_err(io)?;
        pieces.iter().for_each(|piece| places.add(piece));
        let state = State { pack, index: None, unsaved: BTreeMap::new(), places, end, pending: Vec::new() };
        Ok(Store { dir: dir.to_path_buf(), state: Mutex::new(state), opening, _lock: None })
    }

    /// Its folder.
    pub(super) fn dir(&self) -> &Path {
        &self.dir
    }

    /// Returns the repairs made when it was opened.
    pub fn opening(&self) -> &Opening {
        &self.opening
    }

    /// Stores bytes and gives their name. Bytes that are there already are not stored again.
    pub fn put(&self, bytes: &[u8]) -> Result<Digest, StoreError> {
        let digest = Digest::of_bytes(bytes);
        let mut state = self.state();
        if !state.places.objects.contains_key(&digest) {
            let at = self.append(&mut state, &pack::record(false, &digest, bytes))?;
            if state.index.is_none() {
                state.unsaved.insert(digest, bytes.to_vec());
            }
            state.take(Piece::Object { at, length: bytes.len() as u64, digest });
        }
        Ok(digest)
    }

    /// The bytes of that name. They are hashed again, so the caller gets what was stored, or an error with digest, file
    /// and offset.
    pub fn get(&self, digest: &Digest) -> Result<Vec<u8>, StoreError> {
        let path = self.dir.join(PACK);
        let state = self.state();
        let Some((at, length)) = state.places.objects.get(digest).copied() else {
            return Err(StoreError::Absent { path: self.dir.clone(), digest: *digest });
        };
        if let Some(bytes) = state.unsaved.get(digest) {
            return Ok(bytes.clone());
        }
        let bytes = pack::read_at(&state.pack, at + HEADER, length);
        drop(state);
        let what = match bytes {
            Ok(bytes) if Digest::of_bytes(&bytes) == *digest => return Ok(bytes),
            Ok(bytes) => {
                format!("expected {length} bytes with this digest, found bytes with {}", Digest::of_bytes(&bytes))
            }
            Err(error) if error.kind() == std::io::ErrorKind::UnexpectedEof => {
                format!("expected {length} bytes, found the end of the file")
            }
            Err(source) => return Err(StoreError::io("read", &path, source)),
        };
        Err(StoreError::corrupt(Damage::at(&path, format!("offset {at}"), what).of(*digest)))
    }

    /// Returns `true` if an object of that name was stored.
    pub fn contains(&self, digest: &Digest) -> bool {
        self.state().places.objects.contains_key(digest)
    }

    /// The object recorded for a request.
    pub fn memo_get(&self, kind: MemoKind, key: &Digest) -> Option<Digest> {
        self.state().places.memo.get(&(kind, *key)).map(|(object, _)| *object)
    }

    /// Records the object that a request gave. The object must have been put; another object for the same request is a conflict.
    pub fn memo_put(&self, kind: MemoKind, key: &Digest, object: &Digest) -> Result<(), StoreError> {
        let mut state = self.state();
        if !state.places.objects.contains_key(object) {
            return Err(StoreError::Absent { path: self.dir.clone(), digest: *object });
        }
        match state.places.memo.get(&(kind, *key)) {
            Some((recorded, _)) if recorded == object => return Ok(()),
            Some((recorded, _)) => {
                return Err(StoreError::Conflict { kind, key: *key, recorded: *recorded, offered: *object });
            }
            None => {}
        }
        let entry = MemoEntry { kind, key: *key, object: *object };
        let body = entry.body();
        let at = self.append(&mut state, &pack::record(true, &Digest::of_bytes(&body), &body))?;
        state.take(Piece::Memo { at, entry });
        Ok(())
    }

    /// Number of recorded requests of a kind.
    pub fn memo_len(&self, kind: MemoKind) -> usize {
        self.state().places.memo.keys().filter(|(of, _)| *of == kind).count()
    }

    /// All recorded requests, by kind and key, with their objects.
    pub fn recorded(&self) -> Vec<(MemoKind, Digest, Digest)> {
        self.state().places.memo.iter().map(|((kind, key), (object, _))| (*kind, *key, *object)).collect()
    }

    /// Makes everything put so far survive a power cut: syncs the pack, then brings the index up to it.
    pub fn flush(&self) -> Result<(), StoreError> {
        let mut state = self.state();
        let state = &mut *state;
        let Some(index) = &mut state.index else { return Ok(()) };
        if state.pending.is_empty() {
            return Ok(()); // Nothing came since the last flush: a replay from the store waits for no disk.
        }
        state.pack.sync_data().map_err(|source| StoreError::io("sync", &self.dir.join(PACK), source))?;
        let fingerprint = state.places.fingerprint;
        index
            .add(&state.pending, state.end, fingerprint)
            .map_err(|error| index_error(&self.dir.join(INDEX), &error))?;
        state.places.indexed_to = state.end;
        state.pending.clear();
        Ok(())
    }

    /// Each record is one write. A write that fails half-way is undone.
    fn append(&self, state: &mut State, record: &[u8]) -> Result<u64, StoreError> {
        let at = state.end;
        if state.index.is_none() {
            return Ok(at);
        }
        let written = state.pack.seek(SeekFrom::Start(at)).and_then(|_| state.pack.write_all(record));
        if let Err(source) = written {
            let _ = state.pack.set_len(at);
            return Err(StoreError::io("append to", &self.dir.join(PACK), source));
        }
        state.end += record.len() as u64;
        Ok(at)
    }

    /// A thread that panicked while it held the lock left no half-done record: `append` and `take` are its only changes.
    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
    }
}

impl State {
    fn take(&mut self, piece: Piece) {
        self.places.add(&piece);
        self.pending.push(piece);
    }
}

impl Drop for Store {
    /// This only saves the next opening a scan; nothing depends on it.
    fn drop(&mut self) {
        if !self.state().pending.is_empty() {
            let _ = self.flush();
        }
    }
}

/// The exclusive lock of a store's folder. The system releases it when the process ends, however it ends.
pub(super) fn take_lock(dir: &Path) -> Result<Lock, StoreError> {
    let path = dir.join(LOCK);
    let io = |source| StoreError::io("lock", &path, source);
    if path.exists() && !path.is_file() {
        // The file holds nothing that anybody needs.
        let remedy = "remove it or move it away: the lock is made again";
        let source = NoFile::error("a file", "a folder, a pipe or a device");
        return Err(StoreError::Io { action: "lock", path, source, remedy });
    }
    let mut file = OpenOptions::new().read(true).write(true).create(true).truncate(false).open(&path).map_err(io)?;
    if let Err(error) = file::lock(&file, &path) {
        let mut holder = String::new();
        return Err(match error {
            StoreError::Locked { .. } => {
                let _ = file.take(20).read_to_string(&mut holder);
                StoreError::Locked { path: dir.to_path_buf(), holder: format!("process {holder}") }
            }
            other => other,
        });
    }
    file.set_len(0).map_err(io)?;
    file.write_all(std::process::id().to_string().as_bytes()).map_err(io)?;
    Ok(Lock(file))
}

/// Takes the lock only to look: a folder that cannot be written to has no other writer, and is looked at without a lock. So is one
/// on a disk that has no locks.
pub(super) fn take_lock_to_look(dir: &Path) -> Result<Option<Lock>, StoreError> {
    match take_lock(dir) {
        Err(StoreError::Io { source, .. })
            if matches!(source.kind(), ErrorKind::PermissionDenied | ErrorKind::ReadOnlyFilesystem) =>
        {
            Ok(None)
        }
        Err(StoreError::NoLocks { .. }) => Ok(None),
        lock => lock.map(Some),
    }
}

fn load_index(path: &Path) -> Result<(Index, Places), String> {
    let index = Index::open(path).map_err(|error| error.to_string())?;
    let places = loaded(&index)?;
    Ok((index, places))
}

/// Returns the content of a whole index.
fn loaded(index: &Index) -> Result<Places, String> {
    let problems = index.integrity().map_err(|error| error.to_string())?;
    if !problems.is_empty() {
        return Err(problems.join("; "));
    }
    let places = index.load()?;
    if places.is_whole() { Ok(places) } else { Err("its rows do not describe the pack without gaps".to_string()) }
}

/// A fresh index in place of one that cannot be used.
fn new_index(path: &Path) -> Result<Index, StoreError> {
    for name in [INDEX.to_string(), format!("{INDEX}-journal"), format!("{INDEX}-wal"), format!("{INDEX}-shm")] {
        let old = path.with_file_name(name);
        match fs::remove_file(&old) {
            Ok(()) => {}
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {}
            Err(source) => return Err(StoreError::io("replace", &old, source)),
        }
    }
    Index::open(path).map_err(|error| index_error(path, &error))
}

fn index_error(path: &Path, error: &rusqlite::Error) -> StoreError {
    let source = match error.sqlite_error_code() {
        Some(rusqlite::ErrorCode::DiskFull) => std::io::ErrorKind::StorageFull.into(),
        Some(rusqlite::ErrorCode::ReadOnly) => std::io::ErrorKind::ReadOnlyFilesystem.into(),
        _ => {
            let (path, source) = (path.to_path_buf(), std::io::Error::other(error.to_string()));
            let remedy = "check the disk and the limit of a file's size (`ulimit -f`), and repeat the command";
            return StoreError::Io { action: "write", path, source, remedy };
        }
    };
    StoreError::io("write", path, source)
}

fn truncated(path: &Path, places: &Places, end: u64) -> Damage {
    let lost: Vec<String> = places
        .objects
        .iter()
        .filter(|(_, (at, length))| at + HEADER + length > end)
        .map(|(digest, _)| digest.to_string())
        .collect();
    let shown = lost.iter().take(10).cloned().collect::<Vec<_>>().join(", ");
    let what = format!(
        "expected {} bytes, as at the last flush, found {end}; {} objects are lost: {shown}",
        places.indexed_to,
        lost.len()
    );
    Damage::at(path, format!("offset {end}"), what)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn key(n: u8) -> Digest {
        Digest::of_bytes(&[n])
    }

    #[test]
    fn what_was_put_is_there_after_reopening() {
        let dir = tempfile::tempdir().unwrap();
        let store = Store::open(dir.path()).unwrap();
        let one = store.put(b"one").unwrap();
        let empty = store.put(b"").unwrap();
        store.memo_put(MemoKind::Llm, &key(1), &one).unwrap();
        store.memo_put(MemoKind::Llm, &key(3), &one).unwrap();
        store.memo_put(MemoKind::Rollout, &key(1), &empty).unwrap();
        drop(store);
        let store = Store::open(dir.path()).unwrap();
        assert_eq!(store.opening(), &Opening::default());
        assert_eq!(store.get(&one).unwrap(), b"one");
        assert_eq!(store.get(&empty).unwrap(), b"");
        assert_eq!(store.memo_get(MemoKind::Llm, &key(1)), Some(one));
        assert_eq!(store.memo_get(MemoKind::Rollout, &key(1)), Some(empty));
        assert_eq!(store.memo_get(MemoKind::Llm, &key(2)), None);
        assert_eq!((store.memo_len(MemoKind::Llm), store.memo_len(MemoKind::Rollout)), (2, 1));
    }

    #[test]
    fn a_store_that_cannot_be_written_to_is_read_keeps_what_is_put_in_memory_and_stays_as_it_is() {
        let dir = tempfile::tempdir().unwrap();
        let store = Store::open(dir.path()).unwrap();
        let one = store.put(b"one").unwrap();
        store.memo_put(MemoKind::Llm, &key(1), &one).unwrap();
        drop(store);
        // Behind the last flush a whole record and one that was cut off.
        let two = Digest::of_bytes(b"two");
        let whole = pack::record(false, &two, b"two");
        let mut pack = OpenOptions::new().append(true).open(dir.path().join(PACK)).unwrap();
        pack.write_all(&[&whole[..], &whole[..20]].concat()).unwrap();
        let files = || {
            let mut names: Vec<_> = fs::read_dir(dir.path()).unwrap().map(|entry| entry.unwrap().path()).collect();
            names.sort();
            names.into_iter().map(|name| (fs::read(&name).unwrap(), name)).collect::<Vec<_>>()
        };
        for is_indexed in [true, false] {
            if !is_indexed {
                fs::remove_file(dir.path().join(INDEX)).unwrap();
            }
            let before = files();
            let looked = Store::as_it_is(dir.path()).unwrap();
            assert_eq!(looked.opening().rebuilt_because.is_none(), is_indexed);
            assert_eq!((looked.get(&one).unwrap(), looked.get(&two).unwrap()), (b"one".to_vec(), b"two".to_vec()));
            assert_eq!(looked.memo_get(MemoKind::Llm, &key(1)), Some(one));
            let three = looked.put(b"three").unwrap();
            looked.memo_put(MemoKind::Rollout, &key(2), &three).unwrap();
            looked.flush().unwrap();
            assert_eq!((looked.get(&three).unwrap(), looked.put(b"three").unwrap()), (b"three".to_vec(), three));
            assert_eq!(looked.memo_get(MemoKind::Rollout, &key(2)), Some(three));
            drop(looked);
            assert!(files() == before, "nothing is written");
        }
    }

    #[test]
    fn equal_bytes_are_stored_once() {
        let dir = tempfile::tempdir().unwrap();
        let store = Store::open(dir.path()).unwrap();
        assert_eq!(store.put(b"same").unwrap(), store.put(b"same").unwrap());
        assert_eq!(fs::metadata(dir.path().join(PACK)).unwrap().len(), HEADER + 4);
    }

    #[test]
    fn one_request_cannot_give_two_results() {
        let dir = tempfile::tempdir().unwrap();
        let store = Store::open(dir.path()).unwrap();
        let (one, two) = (store.put(b"one").unwrap(), store.put(b"two").unwrap());
        store.memo_put(MemoKind::Rollout, &key(1), &one).unwrap();
        assert!(matches!(store.memo_put(MemoKind::Rollout, &key(1), &two), Err(StoreError::Conflict { .. })));
        assert_eq!(store.memo_get(MemoKind::Rollout, &key(1)), Some(one));
        assert!(matches!(store.memo_put(MemoKind::Llm, &key(2), &key(9)), Err(StoreError::Absent { .. })));
    }

    #[test]
    fn a_second_opening_is_refused_and_named() {
        let dir = tempfile::tempdir().unwrap();
        let first = Store::open(dir.path()).unwrap();
        let error = Store::open(dir.path()).unwrap_err();
        assert!(error.to_string().contains(&format!("in use by process {}", std::process::id())), "{error}");
        drop(first);
        Store::open(dir.path()).unwrap();
    }

    #[test]
    fn threads_share_a_store_without_losing_an_object() {
        let dir = tempfile::tempdir().unwrap();
        let store = Store::open(dir.path()).unwrap();
        let items: Vec<u32> = (0..200).collect();
        let pool = crate::kernel::Threads::new(4).unwrap();
        let names = pool.map(&items, |_, n| store.put(&(n % 50).to_le_bytes()).unwrap());
        for (n, name) in items.iter().zip(&names) {
            assert_eq!(store.get(name).unwrap(), (n % 50).to_le_bytes());
        }
    }
}
