//! One byte changed anywhere in a store or a transcript is named, and nothing panics; a kill at any byte loses nothing flushed.

use std::{fs, path::Path};

use evodrive::{
    kernel::Digest,
    store::{MemoKind, Store, StoreError, Transcript, fsck, fsck_transcript, read_events},
};

const PACK: &str = "objects.pack";
const INDEX: &str = "index.sqlite";

fn small_store(dir: &Path) -> Vec<(Digest, Vec<u8>)> {
    let store = Store::open(dir).unwrap();
    let objects: Vec<(Digest, Vec<u8>)> =
        [b"first".to_vec(), vec![], vec![7; 40]].into_iter().map(|bytes| (store.put(&bytes).unwrap(), bytes)).collect();
    store.memo_put(MemoKind::Llm, &Digest::of_bytes(b"question"), &objects[0].0).unwrap();
    store.memo_put(MemoKind::Rollout, &Digest::of_bytes(b"scene"), &objects[2].0).unwrap();
    store.flush().unwrap();
    objects
}

/// Everything that can be read is what was stored.
fn nothing_wrong_is_read(store: &Store, objects: &[(Digest, Vec<u8>)]) {
    for (digest, bytes) in objects {
        match store.get(digest) {
            Ok(read) => assert_eq!(&read, bytes),
            Err(StoreError::Corrupt(damage)) => assert_eq!(damage.digest, Some(*digest)),
            Err(StoreError::Absent { .. }) => {}
            Err(other) => panic!("{other}"),
        }
    }
}

#[test]
fn a_whole_store_has_no_damage() {
    let dir = tempfile::tempdir().unwrap();
    small_store(dir.path());
    let report = fsck(dir.path(), true).unwrap();
    assert_eq!((report.objects, report.memo_entries), (3, 2));
    assert!(report.damage.is_empty() && report.notes.is_empty(), "{report:?}");
}

#[test]
fn every_changed_byte_of_the_pack_is_named_by_fsck() {
    let dir = tempfile::tempdir().unwrap();
    let objects = small_store(dir.path());
    let path = dir.path().join(PACK);
    let whole = fs::read(&path).unwrap();
    let bodies = 56 + 5 + 56 + 56 + 40;
    for at in 0..whole.len() {
        let mut bytes = whole.clone();
        bytes[at] ^= 1;
        fs::write(&path, &bytes).unwrap();
        let report = fsck(dir.path(), true).unwrap();
        assert!(!report.damage.is_empty(), "byte {at}");
        let owner = if at < 61 {
            Some(0)
        } else if at < 117 {
            Some(1)
        } else if at < bodies {
            Some(2)
        } else {
            None
        };
        if let Some(owner) = owner {
            let named: Vec<_> = report.damage.iter().filter(|d| d.digest == Some(objects[owner].0)).collect();
            assert!(!named.is_empty(), "byte {at}: {report:?}");
            assert!(owner == 1 || named.iter().any(|d| !d.referred_by.is_empty()), "byte {at}: {report:?}");
        }
        nothing_wrong_is_read(&Store::open(dir.path()).unwrap(), &objects);
        assert_eq!(fs::read(&path).unwrap(), bytes, "opening must not change a damaged pack, byte {at}");
    }
}

#[test]
fn a_changed_byte_of_the_pack_is_survived_when_the_index_is_lost_too() {
    let dir = tempfile::tempdir().unwrap();
    let objects = small_store(dir.path());
    let whole = fs::read(dir.path().join(PACK)).unwrap();
    for at in (0..whole.len()).step_by(3) {
        let mut bytes = whole.clone();
        bytes[at] ^= 0x40;
        fs::write(dir.path().join(PACK), &bytes).unwrap();
        fs::remove_file(dir.path().join(INDEX)).unwrap();
        assert!(!fsck(dir.path(), true).unwrap().damage.is_empty(), "byte {at}");
        let store = Store::open(dir.path()).unwrap();
        nothing_wrong_is_read(&store, &objects);
        let readable = objects.iter().filter(|(digest, _)| store.get(digest).is_ok()).count();
        assert!(readable >= 2, "byte {at} cost more than its own object");
    }
}

#[test]
fn a_changed_byte_of_the_index_never_gives_a_wrong_object_and_is_mended() {
    let dir = tempfile::tempdir().unwrap();
    let objects = small_store(dir.path());
    let path = dir.path().join(INDEX);
    let whole = fs::read(&path).unwrap();
    // Each page's beginning (headers and cell pointers) and end (rows), and a sample of what lies between.
    for at in (0..whole.len()).filter(|at| at % 4096 < 100 || at % 4096 > 3800 || at % 97 == 0).step_by(11) {
        let mut bytes = whole.clone();
        bytes[at] ^= 0x21;
        fs::write(&path, &bytes).unwrap();
        let _ = fsck(dir.path(), true).unwrap();
        let store = Store::open(dir.path()).unwrap_or_else(|error| panic!("byte {at}: {error}"));
        for (digest, bytes) in &objects {
            assert_eq!(&store.get(digest).unwrap(), bytes, "byte {at}");
        }
        assert_eq!(store.memo_get(MemoKind::Llm, &Digest::of_bytes(b"question")), Some(objects[0].0), "byte {at}");
        drop(store);
        assert_eq!(fsck(dir.path(), true).unwrap().damage, vec![], "byte {at} was not mended");
    }
}

#[test]
fn a_pack_cut_behind_the_last_flush_loses_only_the_cut_record() {
    let dir = tempfile::tempdir().unwrap();
    let objects = small_store(dir.path());
    let index = fs::read(dir.path().join(INDEX)).unwrap();
    let flushed = fs::metadata(dir.path().join(PACK)).unwrap().len();
    let store = Store::open(dir.path()).unwrap();
    let late = store.put(b"late").unwrap();
    drop(store);
    let whole = fs::read(dir.path().join(PACK)).unwrap();
    for length in flushed as usize..whole.len() {
        fs::write(dir.path().join(PACK), &whole[..length]).unwrap();
        fs::write(dir.path().join(INDEX), &index).unwrap();
        let store = Store::open(dir.path()).unwrap();
        assert_eq!(store.opening().cut_bytes, length as u64 - flushed);
        assert!(!store.contains(&late));
        for (digest, bytes) in &objects {
            assert_eq!(&store.get(digest).unwrap(), bytes);
        }
        assert_eq!(store.put(b"late").unwrap(), late);
        drop(store);
        assert_eq!(fs::read(dir.path().join(PACK)).unwrap(), whole);
    }
}

#[test]
fn a_pack_cut_before_the_last_flush_is_corruption_and_is_left_alone() {
    let dir = tempfile::tempdir().unwrap();
    let objects = small_store(dir.path());
    let whole = fs::read(dir.path().join(PACK)).unwrap();
    for length in 0..whole.len() {
        fs::write(dir.path().join(PACK), &whole[..length]).unwrap();
        assert!(matches!(Store::open(dir.path()), Err(StoreError::Corrupt(_))), "cut at {length}");
        assert!(!fsck(dir.path(), false).unwrap().damage.is_empty(), "cut at {length}");
        assert_eq!(fs::metadata(dir.path().join(PACK)).unwrap().len(), length as u64);
    }
    fs::write(dir.path().join(PACK), &whole).unwrap();
    assert_eq!(Store::open(dir.path()).unwrap().get(&objects[2].0).unwrap(), vec![7; 40]);
}

#[test]
fn a_pack_that_was_cut_names_the_objects_that_are_lost() {
    let dir = tempfile::tempdir().unwrap();
    let bodies = [b"first".to_vec(), vec![1; 100], vec![2; 20]];
    let store = Store::open(dir.path()).unwrap();
    let names = bodies.map(|body| store.put(&body).unwrap());
    drop(store);
    let whole = fs::read(dir.path().join(PACK)).unwrap();
    // The last byte of the last one, its whole body, its header too, and a byte of the one before.
    for (cut, lost) in
        [(1, &names[2..]), (20, &names[2..]), (76, &names[2..]), (77, &names[1..]), (whole.len(), &names[..])]
    {
        fs::write(dir.path().join(PACK), &whole[..whole.len() - cut]).unwrap();
        let Err(StoreError::Corrupt(damage)) = Store::open(dir.path()) else { panic!("{cut} bytes cut") };
        let said = damage.to_string();
        assert!(said.contains(&format!("{} objects are lost", lost.len())), "{cut} bytes cut: {said}");
        assert!(names.iter().all(|name| said.contains(&name.to_string()) == lost.contains(name)), "{cut}: {said}");
    }
}

#[test]
fn a_record_cut_off_behind_the_last_flush_is_a_note_and_one_before_it_is_damage() {
    let dir = tempfile::tempdir().unwrap();
    small_store(dir.path());
    let pack = dir.path().join(PACK);
    let whole = fs::read(&pack).unwrap();
    fs::write(&pack, [&whole[..], b"EVOBJ"].concat()).unwrap();
    let report = fsck(dir.path(), true).unwrap();
    assert!(report.damage.is_empty() && report.notes.iter().any(|note| note.contains("was cut off")), "{report:?}");
    fs::write(&pack, &whole[..whole.len() - 1]).unwrap();
    let report = fsck(dir.path(), true).unwrap();
    assert!(!report.notes.iter().any(|note| note.contains("was cut off")), "{report:?}");
    for said in ["found the end of the file", "as at the last flush, found"] {
        assert!(report.damage.iter().any(|damage| damage.to_string().contains(said)), "{report:?}");
    }
}

/// Takes a row away with its part in the fingerprint, which is over these bytes: an index that was written wrongly, not one that rotted.
fn without_row(index: &rusqlite::Connection, bytes: &[&[u8]], remove: &str) {
    let part = i64::from_le_bytes(Digest::of_bytes(&bytes.concat()).as_bytes()[..8].try_into().unwrap());
    let fingerprint: i64 = index.query_row("SELECT fingerprint FROM pack", [], |row| row.get(0)).unwrap();
    assert_eq!(index.execute(remove, []).unwrap(), 1);
    index.execute("UPDATE pack SET fingerprint = ?1", [fingerprint ^ part]).unwrap();
}

#[test]
fn a_row_that_an_otherwise_sound_index_lacks_is_named() {
    let dir = tempfile::tempdir().unwrap();
    let said = || fsck(dir.path(), true).unwrap().damage.iter().map(ToString::to_string).collect::<Vec<String>>();
    let objects = small_store(dir.path());
    let index = rusqlite::Connection::open(dir.path().join(INDEX)).unwrap();
    let place = |of: &str| index.query_row(of, [], |row| row.get::<_, i64>(0)).unwrap();
    let at = place("SELECT place FROM memo WHERE kind = 'llm'");
    let (question, answer) = (Digest::of_bytes(b"question"), objects[0].0);
    let entry = [&[1], question.as_bytes().as_slice(), answer.as_bytes(), &at.to_le_bytes(), &65_u64.to_le_bytes()];
    without_row(&index, &entry, "DELETE FROM memo WHERE kind = 'llm'");
    let missing = format!("the llm request {question} at offset {at} is missing");
    assert!(said().len() == 1 && said()[0].contains(&missing), "{:?}", said());
    let at = place("SELECT place FROM object WHERE length = 5");
    let entry = [answer.as_bytes().as_slice(), &at.to_le_bytes(), &5_u64.to_le_bytes()];
    without_row(&index, &entry, "DELETE FROM object WHERE length = 5");
    let missing = format!("object {answer} at offset {at} is missing");
    assert!(said().len() == 2 && said().iter().any(|one| one.contains(&missing)), "{:?}", said());
}

#[test]
fn without_reading_bodies_records_are_counted_and_only_their_headers_checked() {
    let dir = tempfile::tempdir().unwrap();
    small_store(dir.path());
    let counts = |read_all: bool| {
        let report = fsck(dir.path(), read_all).unwrap();
        (report.objects, report.memo_entries, report.damage.len())
    };
    assert_eq!((counts(false), counts(true)), ((3, 2, 0), (3, 2, 0)));
    let mut bytes = fs::read(dir.path().join(PACK)).unwrap();
    bytes[56] ^= 1;
    fs::write(dir.path().join(PACK), &bytes).unwrap();
    let (quick, thorough) = (counts(false), counts(true));
    assert_eq!(quick, (3, 2, 0), "a body was changed, no header");
    assert!(thorough.0 == 2 && thorough.2 > 0, "{thorough:?}");
    let said: Vec<String> = fsck(dir.path(), true).unwrap().damage.iter().map(ToString::to_string).collect();
    assert!(said.iter().any(|one| one.contains("names an object that is not there whole")), "{said:?}");
}

#[test]
fn a_store_in_use_is_not_looked_at_and_a_closed_one_names_no_holder() {
    let dir = tempfile::tempdir().unwrap();
    small_store(dir.path());
    let lock = dir.path().join("lock");
    let store = Store::open(dir.path()).unwrap();
    assert!(matches!(fsck(dir.path(), false), Err(StoreError::Locked { .. })));
    assert_eq!(fs::read_to_string(&lock).unwrap(), std::process::id().to_string());
    drop(store);
    assert!(fsck(dir.path(), false).unwrap().damage.is_empty());
    assert_eq!(fs::read_to_string(&lock).unwrap(), "", "who held it is nobody's business any more");
}

#[test]
fn a_lost_index_is_rebuilt_with_memo_and_all() {
    let dir = tempfile::tempdir().unwrap();
    let objects = small_store(dir.path());
    fs::remove_file(dir.path().join(INDEX)).unwrap();
    let store = Store::open(dir.path()).unwrap();
    assert_eq!(store.opening().indexed_records, 5);
    assert_eq!(store.memo_get(MemoKind::Rollout, &Digest::of_bytes(b"scene")), Some(objects[2].0));
}

#[test]
fn every_changed_byte_of_a_transcript_is_named_by_its_line() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("transcript.jsonl");
    let mut transcript = Transcript::create(&path).unwrap();
    transcript.append("start", &serde_json::json!({"seed": 7, "rate": 1e300})).unwrap();
    transcript.append("attempt", &serde_json::json!({"text": "two\nlines, ü", "gain": [0.1, null]})).unwrap();
    transcript.seal(&serde_json::json!({})).unwrap();
    drop(transcript);
    let whole = fs::read(&path).unwrap();
    for at in 0..whole.len() - 1 {
        for mask in [0x01u8, 0x20, 0x80] {
            let mut bytes = whole.clone();
            bytes[at] ^= mask;
            fs::write(&path, &bytes).unwrap();
            let line = whole[..at].iter().filter(|b| **b == b'\n').count() + 1;
            let damage = fsck_transcript(&path).unwrap();
            assert_eq!(damage.first().map(|d| d.place.clone()), Some(format!("line {line}")), "byte {at} mask {mask}");
            assert!(matches!(Transcript::open(&path), Err(StoreError::Corrupt(_))), "byte {at}");
            assert_eq!(fs::read(&path).unwrap(), bytes, "a damaged transcript must be left as it is");
        }
    }
    // The last byte is a line feed: whatever it becomes, no event is lost and none is invented.
    for value in 0..=255u8 {
        let mut bytes = whole.clone();
        *bytes.last_mut().unwrap() = value;
        fs::write(&path, &bytes).unwrap();
        assert!(read_events(&path).map_or(true, |events| events.len() == 3), "last byte {value}");
    }
}
