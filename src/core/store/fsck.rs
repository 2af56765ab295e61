//! Checks a store for damage. It looks at everything, changes nothing, and names each damaged place.

use std::{
    collections::{BTreeMap, BTreeSet},
    fs::File,
    path::Path,
};

use serde::Serialize;

use super::{
    Damage, MemoKind, StoreError,
    file::no_device,
    index::{INDEX, Index, Places},
    objects::take_lock_to_look,
    pack::{self, HEADER, PACK, Piece},
};
use crate::kernel::Digest;

const REINDEX: &str = "delete the index; it is rebuilt from the pack when the store is opened next";

/// Findings of `fsck`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct FsckReport {
    /// Whole objects.
    pub objects: usize,
    /// Whole memo entries.
    pub memo_entries: usize,
    /// Size of the pack.
    pub pack_bytes: u64,
    /// True if every byte was read and hashed, false if only headers were.
    pub read_all: bool,
    /// Harmless findings, which the next opening mends by itself.
    pub notes: Vec<String>,
    /// Empty = whole.
    pub damage: Vec<Damage>,
    /// Names of the whole objects.
    #[serde(skip)]
    pub whole: BTreeSet<Digest>,
    /// Requests and the objects that answer them.
    #[serde(skip)]
    pub pairs: BTreeMap<(MemoKind, Digest), Digest>,
}

/// Checks the store in a folder: records of the pack, index against pack, targets of memo entries, SQLite's own structure; with
/// `read_all` also the bytes of every object. Errors only where the folder cannot be looked at.
pub fn fsck(dir: &Path, read_all: bool) -> Result<FsckReport, StoreError> {
    let pack_path = dir.join(PACK);
    let io = |source| StoreError::io("read", &pack_path, source);
    no_device(&pack_path)?;
    let pack = File::open(&pack_path).map_err(io)?;
    let lock = take_lock_to_look(dir)?;
    let pieces = pack::scan(&pack, 0, read_all).map_err(io)?;
    let mut report = FsckReport { pack_bytes: pack.metadata().map_err(io)?.len(), read_all, ..FsckReport::default() };
    let indexed = check_index(&dir.join(INDEX), lock.is_some(), &mut report);
    let mut places = Places::default();
    for piece in &pieces {
        places.add(piece);
        count(piece, &pack_path, indexed.as_ref(), &mut report);
    }
    report.whole = places.objects.keys().copied().collect();
    report.pairs = places.memo.iter().map(|(request, (object, _))| (*request, *object)).collect();
    check_memo(&pack_path, &places, &mut report);
    if let Some(indexed) = &indexed {
        compare(dir, indexed, &places, &mut report);
    }
    name_referrers(&places, indexed.as_ref(), &mut report);
    Ok(report)
}

/// Returns the content of the index, if it can be read.
fn check_index(path: &Path, writable: bool, report: &mut FsckReport) -> Option<Places> {
    if !path.exists() {
        report.notes.push("there is no index; it is rebuilt from the pack when the store is opened next".to_string());
        return None;
    }
    let mut damage = |place: &str, what: String| {
        report.damage.push(Damage { remedy: REINDEX.to_string(), ..Damage::at(path, place, what) });
    };
    let index = match Index::open_existing(path, writable) {
        Ok(index) => index,
        Err(error) => {
            damage("its beginning", error.to_string());
            return None;
        }
    };
    match index.integrity() {
        Ok(problems) => problems.into_iter().for_each(|problem| damage("its pages", problem)),
        Err(error) => damage("its pages", error.to_string()),
    }
    match index.load() {
        Ok(places) => Some(places),
        Err(error) => {
            damage("its rows", error);
            None
        }
    }
}

fn count(piece: &Piece, path: &Path, indexed: Option<&Places>, report: &mut FsckReport) {
    match piece {
        Piece::Object { .. } => report.objects += 1,
        Piece::Memo { .. } => report.memo_entries += 1,
        Piece::Torn { at } if indexed.is_none_or(|places| *at >= places.indexed_to) => report
            .notes
            .push(format!("the last write, at offset {at}, was cut off; it is removed when the store is opened next")),
        Piece::Torn { at } => {
            report.damage.push(Damage::at(
                path,
                format!("offset {at}"),
                "expected a whole record, found the end of the file",
            ));
        }
        Piece::Damaged { at, digest, what, .. } => {
            let damage = Damage::at(path, format!("offset {at}"), what);
            report.damage.push(Damage { digest: *digest, ..damage });
        }
    }
}

fn check_memo(path: &Path, found: &Places, report: &mut FsckReport) {
    for ((kind, key), (object, at)) in &found.memo {
        if !found.objects.contains_key(object) {
            let what = format!("the {kind} request {key} names an object that is not there whole");
            report.damage.push(Damage::at(path, format!("offset {at}"), what).of(*object));
        }
    }
}

/// Index rows that have no record, and records below `indexed_to` that have no index row.
fn compare(dir: &Path, indexed: &Places, found: &Places, report: &mut FsckReport) {
    for (digest, place) in &indexed.objects {
        if found.objects.get(digest) != Some(place) {
            let what = format!("expected object of {} bytes, as the index has it, found none there", place.1);
            report.damage.push(Damage::at(&dir.join(PACK), format!("offset {}", place.0), what).of(*digest));
        }
    }
    let row = |what: String| Damage { remedy: REINDEX.to_string(), ..Damage::at(&dir.join(INDEX), "its rows", what) };
    for ((kind, key), place) in &indexed.memo {
        if found.memo.get(&(*kind, *key)) != Some(place) {
            report.damage.push(row(format!("the {kind} request {key} is not what the pack has at offset {}", place.1)));
        }
    }
    for (digest, (at, length)) in &found.objects {
        if at + HEADER + length <= indexed.indexed_to && !indexed.objects.contains_key(digest) {
            report.damage.push(row(format!("object {digest} at offset {at} is missing")));
        }
    }
    for ((kind, key), (_, at)) in &found.memo {
        if *at < indexed.indexed_to && !indexed.memo.contains_key(&(*kind, *key)) {
            report.damage.push(row(format!("the {kind} request {key} at offset {at} is missing")));
        }
    }
    if report.pack_bytes > indexed.indexed_to {
        report.notes.push(format!(
            "{} bytes behind the last flush are not indexed yet",
            report.pack_bytes - indexed.indexed_to
        ));
    } else if report.pack_bytes < indexed.indexed_to {
        let what = format!("expected {} bytes, as at the last flush, found {}", indexed.indexed_to, report.pack_bytes);
        report.damage.push(Damage::at(&dir.join(PACK), format!("offset {}", report.pack_bytes), what));
    }
}

fn name_referrers(found: &Places, indexed: Option<&Places>, report: &mut FsckReport) {
    let mut referrers: BTreeMap<Digest, Vec<String>> = BTreeMap::new();
    for places in [Some(found), indexed].into_iter().flatten() {
        for ((kind, key), (object, _)) in &places.memo {
            let names = referrers.entry(*object).or_default();
            let name = format!("{kind} {key}");
            if !names.contains(&name) {
                names.push(name);
            }
        }
    }
    for damage in &mut report.damage {
        if let Some(names) = damage.digest.and_then(|digest| referrers.get(&digest)) {
            damage.referred_by.clone_from(names);
        }
    }
}
