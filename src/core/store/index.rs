//! The index of a store: an SQLite file with the position of every record of the pack, up to the last flush. Everything
//! in it can be found in the pack too, so a lost, old or damaged index is rebuilt. Where the two differ, the pack is
//! right.

use std::{collections::BTreeMap, path::Path};

use rusqlite::{Connection, OpenFlags, params};

use super::{
    MemoKind,
    pack::{HEADER, MEMO_BODY, MemoEntry, Piece},
};
use crate::kernel::Digest;

/// File name of the index inside a store's folder.
pub(super) const INDEX: &str = "index.sqlite";
/// An index with another version number is rebuilt.
const VERSION: i64 = 1;
const TABLES: &str = "
    CREATE TABLE object (digest BLOB PRIMARY KEY, place INTEGER NOT NULL, length INTEGER NOT NULL) WITHOUT ROWID;
    CREATE TABLE memo (kind TEXT NOT NULL, request BLOB NOT NULL, object BLOB NOT NULL, place INTEGER NOT NULL,
        PRIMARY KEY (kind, request)) WITHOUT ROWID;
    CREATE TABLE pack (id INTEGER PRIMARY KEY CHECK (id = 0), indexed_to INTEGER NOT NULL, fingerprint INTEGER NOT NULL);
    INSERT INTO pack VALUES (0, 0, 0);";

/// Content of the index, in memory.
#[derive(Debug, Default, Clone, PartialEq, Eq)]
pub(super) struct Places {
    /// Object -> (offset of its record, length of its body).
    pub objects: BTreeMap<Digest, (u64, u64)>,
    /// Request -> (object, offset of its record).
    pub memo: BTreeMap<(MemoKind, Digest), (Digest, u64)>,
    /// End of the part of the pack that is described.
    pub indexed_to: u64,
    /// Exclusive or of the hashes of all entries. It shows whether a row was changed, and costs one hash per entry.
    pub fingerprint: u64,
}

impl Places {
    /// Adds a piece. Of several records of one object the first counts; of several entries of one request the last.
    pub fn add(&mut self, piece: &Piece) {
        match piece {
            Piece::Object { at, length, digest } => {
                if !self.objects.contains_key(digest) {
                    self.objects.insert(*digest, (*at, *length));
                    self.fingerprint ^= object_hash(digest, *at, *length);
                }
            }
            Piece::Memo { at, entry } => {
                if let Some((object, at)) = self.memo.insert((entry.kind, entry.key), (entry.object, *at)) {
                    self.fingerprint ^= memo_hash(&MemoEntry { object, ..*entry }, at);
                }
                self.fingerprint ^= memo_hash(entry, *at);
            }
            Piece::Damaged { .. } | Piece::Torn { .. } => {}
        }
    }

    /// Returns `true` if the records tile the pack from 0 to `indexed_to` and every memo entry names an object.
    pub fn is_whole(&self) -> bool {
        let mut spans: Vec<(u64, u64)> = self.objects.values().map(|(at, length)| (*at, *length)).collect();
        spans.extend(self.memo.values().map(|(_, at)| (*at, MEMO_BODY)));
        spans.sort_unstable();
        let end =
            spans.iter().try_fold(
                0u64,
                |end, (at, length)| {
                    if *at == end { at.checked_add(HEADER)?.checked_add(*length) } else { None }
                },
            );
        end == Some(self.indexed_to) && self.memo.values().all(|(object, _)| self.objects.contains_key(object))
    }
}

fn object_hash(digest: &Digest, at: u64, length: u64) -> u64 {
    entry_hash(digest.as_bytes(), at, length)
}

fn memo_hash(entry: &MemoEntry, at: u64) -> u64 {
    entry_hash(&entry.body(), at, MEMO_BODY)
}

fn entry_hash(body: &[u8], at: u64, length: u64) -> u64 {
    let bytes = [body, &at.to_le_bytes(), &length.to_le_bytes()].concat();
    Digest::of_bytes(&bytes).as_bytes().first_chunk().map_or(0, |first| u64::from_le_bytes(*first))
}

/// The open index file.
#[derive(Debug)]
pub(super) struct Index {
    connection: Connection,
    is_without_locks: bool,
}

/// SQLite's name for a system without locks.
const NO_LOCKS: &str = "unix-none";

impl Index {
    /// Opens or makes the index.
    pub fn open(path: &Path) -> rusqlite::Result<Index> {
        let alone = "PRAGMA locking_mode = EXCLUSIVE; PRAGMA synchronous = NORMAL; BEGIN EXCLUSIVE; COMMIT;";
        let index = Index::on_any_disk(path, OpenFlags::default(), alone)?;
        let version: i64 = index.connection.query_row("PRAGMA user_version", [], |row| row.get(0))?;
        if version != 0 && version != VERSION {
            return Err(rusqlite::Error::InvalidQuery);
        }
        if version == 0 {
            index.connection.execute_batch(&format!("BEGIN; {TABLES} PRAGMA user_version = {VERSION}; COMMIT;"))?;
        }
        Ok(index)
    }

    /// Opens an existing index, to look at it. Read-only only where its folder is: SQLite must be able to roll back
    /// what a killed process had begun.
    pub fn open_existing(path: &Path, writable: bool) -> rusqlite::Result<Index> {
        let flags = if writable { OpenFlags::SQLITE_OPEN_READ_WRITE } else { OpenFlags::SQLITE_OPEN_READ_ONLY };
        Index::on_any_disk(path, flags, "BEGIN; SELECT count(*) FROM sqlite_schema; COMMIT;")
    }

    /// Opens a file and runs `first`. If that is refused it tries again without SQLite's own locks (of `fcntl`), which some
    /// disks do not have: the opener of an index holds the store's lock, or only looks.
    fn on_any_disk(path: &Path, flags: OpenFlags, first: &str) -> rusqlite::Result<Index> {
        let begun = |connection: Connection, is_without_locks| {
            // Nobody else holds such a lock, so there is nothing to wait for.
            connection.busy_timeout(std::time::Duration::ZERO)?;
            connection.execute_batch(first)?;
            Ok(Index { connection, is_without_locks })
        };
        let locking = Connection::open_with_flags(path, flags).and_then(|connection| begun(connection, false));
        locking.or_else(|refused| {
            let without = Connection::open_with_flags_and_vfs(path, flags, NO_LOCKS);
            without.and_then(|connection| begun(connection, true)).map_err(|_| refused)
        })
    }

    /// Returns `true` if the disk has no locks for it.
    pub fn is_without_locks(&self) -> bool {
        self.is_without_locks
    }

    /// Reads the whole index. A row that is malformed or was changed is an error.
    pub fn load(&self) -> Result<Places, String> {
        let (places, fingerprint) = self.read().map_err(|error| error.to_string())?;
        let same = places.fingerprint == fingerprint;
        if same { Ok(places) } else { Err("a row is not as it was written".to_string()) }
    }

    fn read(&self) -> rusqlite::Result<(Places, u64)> {
        let mut places = Places::default();
        let (indexed_to, fingerprint) =
            self.connection.query_row("SELECT indexed_to, fingerprint FROM pack WHERE id = 0", [], |row| {
                Ok((whole(row, 0)?, row.get::<_, i64>(1)?.cast_unsigned()))
            })?;
        let mut statement = self.connection.prepare("SELECT digest, place, length FROM object")?;
        let mut rows = statement.query([])?;
        while let Some(row) = rows.next()? {
            places.add(&Piece::Object { digest: digest(row, 0)?, at: whole(row, 1)?, length: whole(row, 2)? });
        }
        let mut statement = self.connection.prepare("SELECT kind, request, object, place FROM memo")?;
        let mut rows = statement.query([])?;
        while let Some(row) = rows.next()? {
            let name: String = row.get(0)?;
            let kind = MemoKind::of_name(&name).ok_or(rusqlite::Error::InvalidColumnIndex(0))?;
            let entry = MemoEntry { kind, key: digest(row, 1)?, object: digest(row, 2)? };
            places.add(&Piece::Memo { at: whole(row, 3)?, entry });
        }
        places.indexed_to = indexed_to;
        Ok((places, fingerprint))
    }

    /// Adds pieces and records how far the pack is now described, all in one transaction.
    pub fn add(&mut self, pieces: &[Piece], indexed_to: u64, fingerprint: u64) -> rusqlite::Result<()> {
        let transaction = self.connection.transaction()?;
        {
            let mut object = transaction.prepare("INSERT OR IGNORE INTO object VALUES (?1, ?2, ?3)")?;
            let mut memo = transaction.prepare("INSERT OR REPLACE INTO memo VALUES (?1, ?2, ?3, ?4)")?;
            for piece in pieces {
                match piece {
                    Piece::Object { at, length, digest } => {
                        object.execute(params![digest.as_bytes(), *at as i64, *length as i64])?;
                    }
                    Piece::Memo { at, entry: MemoEntry { kind, key, object } } => {
                        memo.execute(params![kind.name(), key.as_bytes(), object.as_bytes(), *at as i64])?;
                    }
                    Piece::Damaged { .. } | Piece::Torn { .. } => {}
                }
            }
            let end = params![indexed_to as i64, fingerprint.cast_signed()];
            transaction.execute("UPDATE pack SET indexed_to = ?1, fingerprint = ?2 WHERE id = 0", end)?;
        }
        transaction.commit()
    }

    /// Returns the faults that SQLite itself finds in its file; empty = nothing.
    pub fn integrity(&self) -> rusqlite::Result<Vec<String>> {
        let mut statement = self.connection.prepare("PRAGMA integrity_check")?;
        let lines = statement.query_map([], |row| row.get::<_, String>(0))?.collect::<rusqlite::Result<Vec<_>>>()?;
        Ok(lines.into_iter().filter(|line| line != "ok").collect())
    }
}

fn digest(row: &rusqlite::Row<'_>, column: usize) -> rusqlite::Result<Digest> {
    row.get::<_, [u8; 32]>(column).map(Digest::from_array)
}

fn whole(row: &rusqlite::Row<'_>, column: usize) -> rusqlite::Result<u64> {
    let value: i64 = row.get(column)?;
    u64::try_from(value).map_err(|_| rusqlite::Error::IntegralValueOutOfRange(column, value))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn digest(n: u8) -> Digest {
        Digest::of_bytes(&[n])
    }

    fn object(n: u8, at: u64, length: u64) -> Piece {
        Piece::Object { at, length, digest: digest(n) }
    }

    fn memo(key: u8, object: u8, at: u64) -> Piece {
        Piece::Memo { at, entry: MemoEntry { kind: MemoKind::Llm, key: digest(key), object: digest(object) } }
    }

    fn fingerprint(pieces: &[Piece]) -> u64 {
        let mut places = Places::default();
        pieces.iter().for_each(|piece| places.add(piece));
        places.fingerprint
    }

    #[test]
    fn the_fingerprint_shows_every_changed_row_and_not_the_order_of_rows() {
        let whole = fingerprint(&[object(1, 0, 4), object(2, 50, 5), memo(7, 1, 100)]);
        assert_eq!(fingerprint(&[memo(7, 1, 100), object(2, 50, 5), object(1, 0, 4)]), whole);
        for changed in [
            [object(3, 0, 4), object(2, 50, 5), memo(7, 1, 100)],
            [object(1, 1, 4), object(2, 50, 5), memo(7, 1, 100)],
            [object(1, 0, 3), object(2, 50, 5), memo(7, 1, 100)],
            [object(1, 0, 4), object(2, 50, 5), memo(8, 1, 100)],
            [object(1, 0, 4), object(2, 50, 5), memo(7, 2, 100)],
            [object(1, 0, 4), object(2, 50, 5), memo(7, 1, 101)],
        ] {
            assert_ne!(fingerprint(&changed), whole);
        }
        assert_ne!(whole, 0);
    }

    #[test]
    fn of_two_entries_of_one_request_the_last_counts_and_of_two_records_of_one_object_the_first() {
        let last = fingerprint(&[object(1, 0, 4), memo(7, 2, 200)]);
        assert_eq!(fingerprint(&[object(1, 0, 4), memo(7, 1, 100), memo(7, 2, 200)]), last);
        assert_eq!(fingerprint(&[object(1, 0, 4), object(1, 90, 4), memo(7, 2, 200)]), last);
    }

    #[test]
    fn an_index_is_whole_whose_records_tile_the_pack_and_whose_entries_name_objects() {
        let whole = |pieces: &[Piece], indexed_to: u64| {
            let mut places = Places::default();
            pieces.iter().for_each(|piece| places.add(piece));
            places.indexed_to = indexed_to;
            places.is_whole()
        };
        let second = HEADER + 4;
        let third = second + HEADER + 5;
        let end = third + HEADER + MEMO_BODY;
        let pieces = [object(1, 0, 4), object(2, second, 5), memo(7, 1, third)];
        assert!(whole(&pieces, end) && whole(&[], 0));
        assert!(!whole(&pieces, end + 1) && !whole(&pieces, end - 1), "the last record ends where the index does");
        assert!(!whole(&[object(1, 0, 4), object(2, second + 1, 5), memo(7, 1, third)], end), "a gap");
        assert!(!whole(&[object(2, second, 5), memo(7, 1, third)], end), "the first record is missing");
        assert!(!whole(&[object(1, 0, 4), object(2, second, 5), memo(7, 3, third)], end), "an entry names nobody");
    }
}
