//! Plain files. A file is written completely or not at all, and read up to a size limit. This module does not know what
//! files contain.

use std::{
    fs::{self, File},
    io::{Read, Write},
    path::{Path, PathBuf},
};

use super::{StoreError, no_file::NoFile};
use crate::kernel::{Digest, Hashing};

/// Folders nested deeper than this are not searched.
const MAX_DEPTH: usize = 32;

/// Writes a whole file: into a hidden neighbour first, which is synced and then renamed, so that a kill at any moment
/// leaves the old file or the new one. Missing parent folders are made.
pub fn write_atomic(path: &Path, bytes: &[u8]) -> Result<(), StoreError> {
    let (temporary, mut file) = neighbour(path)?;
    let written = synced_with(&mut file, bytes).and_then(|()| fs::rename(&temporary, path));
    if let Err(source) = written {
        let _ = fs::remove_file(&temporary);
        return Err(StoreError::io("write", path, source));
    }
    sync_dir(parent_of(path))
}

/// Most bytes of the name of a file to be written: it gets a longer name first, and a system has room for 255.
const NAME_BYTES_MAX: usize = 200;

/// Checks that a file of this name can be written, for callers that ask before the work whose result it is to hold.
pub fn fits(path: &Path) -> Result<(), StoreError> {
    match path.file_name().map_or(0, |name| name.len()) {
        ..=NAME_BYTES_MAX => Ok(()),
        _ => Err(StoreError::io("write", path, std::io::ErrorKind::InvalidFilename.into())),
    }
}

/// Writes a whole file where nothing is, and returns `true` if it did: of two writers at once one does. A file of that name stays.
pub fn write_new(path: &Path, bytes: &[u8]) -> Result<bool, StoreError> {
    let (temporary, mut file) = neighbour(path)?;
    let written = synced_with(&mut file, bytes).and_then(|()| named_anew(&temporary, path));
    let _ = fs::remove_file(&temporary);
    let is_new = written.map_err(|source| StoreError::io("write", path, source))?;
    sync_dir(parent_of(path)).map(|()| is_new)
}

/// Gives a file a name that nothing has; returns `true` if it was free.
fn named_anew(from: &Path, to: &Path) -> std::io::Result<bool> {
    let free = |done: std::io::Result<()>| match done {
        Err(error) if error.kind() == std::io::ErrorKind::AlreadyExists => Ok(false),
        done => done.map(|()| true),
    };
    match fs::hard_link(from, to) {
        Err(error) if error.kind() != std::io::ErrorKind::AlreadyExists => {
            // On a disk without hard links the name is taken first, and the content follows.
            let taken = free(fs::OpenOptions::new().write(true).create_new(true).open(to).map(drop))?;
            if taken { fs::rename(from, to).map(|()| true) } else { Ok(false) }
        }
        linked => free(linked),
    }
}

/// The hidden neighbour that a file is written to before it gets its name, made anew; its folder is made. An entry that has such a name
/// already is left alone: it may be somebody's, or of another machine's process of the same number.
fn neighbour(path: &Path) -> Result<(PathBuf, File), StoreError> {
    fits(path)?;
    let parent = parent_of(path);
    create_dir(parent)?;
    let name =
        path.file_name().ok_or_else(|| StoreError::io("write", path, std::io::ErrorKind::IsADirectory.into()))?;
    let mut number = 0u32;
    loop {
        let beside = parent.join(format!(".{}.{}-{number}.tmp", name.to_string_lossy(), std::process::id()));
        match fs::OpenOptions::new().write(true).create_new(true).open(&beside) {
            Ok(file) => return Ok((beside, file)),
            Err(error) if error.kind() == std::io::ErrorKind::AlreadyExists => number += 1,
            Err(source) => return Err(StoreError::io("write", path, source)),
        }
    }
}

fn synced_with(file: &mut File, bytes: &[u8]) -> std::io::Result<()> {
    file.write_all(bytes)?;
    file.sync_all()
}

/// Makes a rename or a new file survive a power cut. A folder that cannot be opened for reading, or a file system without such a
/// request, is no error; a request that failed is one.
pub(super) fn sync_dir(dir: &Path) -> Result<(), StoreError> {
    let Ok(opened) = File::open(dir) else { return Ok(()) };
    synced(dir, opened.sync_all())
}

fn synced(dir: &Path, came: std::io::Result<()>) -> Result<(), StoreError> {
    use std::io::ErrorKind::{InvalidInput, Unsupported};
    match came {
        Err(source) if !matches!(source.kind(), InvalidInput | Unsupported) => Err(StoreError::io("sync", dir, source)),
        _ => Ok(()),
    }
}

/// Returns the name of a folder's entry. A name that is not UTF-8 could be shown to nobody and written into no file, so it is an error.
fn name_of(entry: &fs::DirEntry) -> Result<String, StoreError> {
    entry.file_name().into_string().map_err(|_| StoreError::Io {
        action: "take",
        path: entry.path(),
        source: NoFile::error("a name in UTF-8", "other bytes"),
        remedy: "rename it, or move it out of the folder",
    })
}

/// Returns `true` if anything bears this name, a link that leads nowhere included.
pub fn is_taken(path: &Path) -> bool {
    fs::symlink_metadata(path).is_ok()
}

/// Takes the lock of an open file. Closing the file gives it back, as does the end of the process.
pub(super) fn lock(file: &File, path: &Path) -> Result<(), StoreError> {
    match file.try_lock() {
        Ok(()) => Ok(()),
        Err(fs::TryLockError::WouldBlock) => {
            Err(StoreError::Locked { path: path.to_path_buf(), holder: "another process".into() })
        }
        Err(fs::TryLockError::Error(source)) => Err(StoreError::NoLocks { path: path.to_path_buf(), source }),
    }
}

pub(super) fn parent_of(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    }
}

/// Adds to the end of a file, which is made if it does not exist.
pub fn append(path: &Path, bytes: &[u8]) -> Result<(), StoreError> {
    let opened = fs::OpenOptions::new().append(true).create(true).open(path);
    opened.and_then(|mut file| file.write_all(bytes)).map_err(|source| StoreError::io("append to", path, source))
}

/// All bytes of a file that has at most `max_bytes`; a longer one is an error before it is in memory.
pub fn read_bounded(path: &Path, max_bytes: u64) -> Result<Vec<u8>, StoreError> {
    let io = |source| StoreError::io("read", path, source);
    let file = open_bounded(path, max_bytes)?;
    let mut bytes = Vec::new();
    file.take(max_bytes.saturating_add(1)).read_to_end(&mut bytes).map_err(io)?;
    if bytes.len() as u64 > max_bytes {
        return Err(StoreError::TooLarge { path: path.to_path_buf(), max_bytes });
    }
    Ok(bytes)
}

/// Refuses a pipe and a device before anybody waits for it: only files are stored, by whatever path they are reached.
pub(super) fn no_device(path: &Path) -> Result<(), StoreError> {
    let is = fs::metadata(path).ok().map(|of| of.file_type());
    match is.filter(|is| !is.is_file() && !is.is_dir()) {
        Some(is) => Err(StoreError::io("read", path, NoFile::error("a file", kind_of(is)))),
        None => Ok(()),
    }
}

/// Opens a file for reading that is at present no longer than this.
pub fn open_bounded(path: &Path, max_bytes: u64) -> Result<File, StoreError> {
    let io = |source| StoreError::io("read", path, source);
    no_device(path)?;
    let file = File::open(path).map_err(io)?;
    let is = file.metadata().map_err(io)?;
    if is.is_dir() {
        return Err(io(std::io::ErrorKind::IsADirectory.into()));
    }
    if is.len() > max_bytes {
        return Err(StoreError::TooLarge { path: path.to_path_buf(), max_bytes });
    }
    Ok(file)
}

/// BLAKE3 of a file of at most `max_bytes`, which is never in memory as a whole.
pub fn digest_of_file(path: &Path, max_bytes: u64) -> Result<Digest, StoreError> {
    let mut from = open_bounded(path, max_bytes)?.take(max_bytes.saturating_add(1));
    let mut hashing = Hashing::default();
    std::io::copy(&mut from, &mut hashing).map_err(|source| StoreError::io("read", path, source))?;
    let (digest, bytes) = hashing.so_far();
    if bytes > max_bytes {
        return Err(StoreError::TooLarge { path: path.to_path_buf(), max_bytes });
    }
    Ok(digest)
}

/// The first `count` bytes of a file, fewer where it is shorter.
pub fn read_head(path: &Path, count: usize) -> Result<Vec<u8>, StoreError> {
    let io = |source| StoreError::io("read", path, source);
    no_device(path)?;
    let mut bytes = Vec::with_capacity(count);
    File::open(path).map_err(io)?.take(count as u64).read_to_end(&mut bytes).map_err(io)?;
    Ok(bytes)
}

/// Bytes of a file; 0 where there is none.
pub fn length(path: &Path) -> Result<u64, StoreError> {
    match std::fs::metadata(path) {
        Ok(metadata) => Ok(metadata.len()),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(0),
        Err(source) => Err(StoreError::io("look at", path, source)),
    }
}

/// Gives a file another name in its folder; a file that had that name is gone.
pub fn rename(from: &Path, to: &Path) -> Result<(), StoreError> {
    fs::rename(from, to).map_err(|source| StoreError::io("rename", from, source))?;
    sync_dir(parent_of(to))
}

/// Removes a file. It is no error if the file does not exist.
pub fn remove_file(path: &Path) -> Result<(), StoreError> {
    match fs::remove_file(path) {
        Err(source) if source.kind() != std::io::ErrorKind::NotFound => Err(StoreError::io("remove", path, source)),
        _ => Ok(()),
    }
}

/// The folders in a folder, sorted by path; hidden and linked ones are left out.
pub fn list_dirs(root: &Path) -> Result<Vec<PathBuf>, StoreError> {
    let io = |source| StoreError::io("list", root, source);
    let mut entries = Vec::new();
    for entry in fs::read_dir(root).map_err(io)? {
        let entry = entry.map_err(io)?;
        if entry.file_type().map_err(io)?.is_dir() && !name_of(&entry)?.starts_with('.') {
            entries.push(entry.path());
        }
    }
    entries.sort();
    Ok(entries)
}

/// Returns `true` for a plain file, `false` for nothing. A link, a folder, a pipe and a device are errors: somebody who can write here
/// must not make us read elsewhere, or wait.
pub fn is_plain_file(path: &Path) -> Result<bool, StoreError> {
    let io = |source| StoreError::io("read", path, source);
    match fs::symlink_metadata(path) {
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(false),
        Err(source) => Err(io(source)),
        Ok(of) if of.is_file() => Ok(true),
        Ok(of) => Err(io(NoFile::error("a plain file", kind_of(of.file_type())))),
    }
}

fn kind_of(is: fs::FileType) -> &'static str {
    if is.is_symlink() {
        "a link"
    } else if is.is_dir() {
        "a folder"
    } else {
        "a pipe or a device"
    }
}

/// Makes a folder that does not exist yet; a link in its place is an error.
pub fn create_plain_dir(path: &Path) -> Result<(), StoreError> {
    create_dir(path)?;
    let io = |source| StoreError::io("make the folder", path, source);
    let is = fs::symlink_metadata(path).map_err(io)?.file_type();
    if is.is_dir() {
        return Ok(());
    }
    Err(io(NoFile::error("a folder", kind_of(is))))
}

/// Returns the entries of a folder whose names have this ending, sorted, of any kind: no link is followed.
pub fn list_entries(dir: &Path, ending: &str) -> Result<Vec<PathBuf>, StoreError> {
    let io = |source| StoreError::io("list", dir, source);
    let mut entries = Vec::new();
    for entry in fs::read_dir(dir).map_err(io)? {
        let entry = entry.map_err(io)?;
        let name = entry.file_name().to_string_lossy().into_owned();
        if name.ends_with(ending) && !name.starts_with('.') {
            name_of(&entry)?;
            entries.push(entry.path());
        }
    }
    entries.sort();
    Ok(entries)
}

/// Makes a folder and its parents. It is no error if the folder exists.
pub fn create_dir(path: &Path) -> Result<(), StoreError> {
    fs::create_dir_all(path).map_err(|source| StoreError::io("make the folder", path, source))
}

/// Returns the files under `root` whose names end in one of `endings` (`[".xml"]`; an empty list takes all), sorted by path so that
/// the file system's order does not matter. Hidden entries and linked folders are left out. A `root` that is a file is the only answer.
pub fn list_files(root: &Path, endings: &[&str]) -> Result<Vec<PathBuf>, StoreError> {
    let mut entries = Vec::new();
    if fs::metadata(root).map_err(|source| StoreError::io("read", root, source))?.is_file() {
        entries.push(root.to_path_buf());
    } else {
        collect(root, endings, MAX_DEPTH, &mut entries)?;
    }
    entries.sort();
    Ok(entries)
}

fn collect(dir: &Path, endings: &[&str], depth: usize, found: &mut Vec<PathBuf>) -> Result<(), StoreError> {
    let io = |source| StoreError::io("list", dir, source);
    for entry in fs::read_dir(dir).map_err(io)? {
        let entry = entry.map_err(io)?;
        let name = entry.file_name().to_string_lossy().into_owned();
        let kind = entry.file_type().map_err(io)?;
        if name.starts_with('.') {
            continue;
        }
        if kind.is_dir() {
            name_of(&entry)?;
            if depth > 0 {
                collect(&entry.path(), endings, depth - 1, found)?;
            }
        } else if entry.path().is_file() && (endings.is_empty() || endings.iter().any(|end| name.ends_with(end))) {
            name_of(&entry)?;
            found.push(entry.path());
        }
    }
    Ok(())
}

/// Copies one file, whole or not at all.
pub fn copy(from: &Path, to: &Path) -> Result<(), StoreError> {
    write_atomic(to, &read_bounded(from, u64::MAX - 1)?)
}

/// Copies a file that may be a program: anyone who could start it can start the copy.
pub fn copy_program(from: &Path, to: &Path) -> Result<(), StoreError> {
    copy(from, to)?;
    let mode = fs::metadata(from).map(|of| of.permissions());
    mode.and_then(|mode| fs::set_permissions(to, mode)).map_err(|source| StoreError::io("write", to, source))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::remove_empty_dir;

    #[test]
    fn a_written_file_replaces_the_old_one_and_leaves_no_neighbour() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a/b.txt");
        write_atomic(&path, b"old").unwrap();
        write_atomic(&path, b"new").unwrap();
        assert_eq!(read_bounded(&path, 3).unwrap(), b"new");
        assert_eq!(fs::read_dir(dir.path().join("a")).unwrap().count(), 1);
    }

    #[test]
    fn a_write_that_fails_leaves_no_neighbour() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("taken");
        fs::create_dir_all(path.join("inside")).unwrap();
        let error = write_atomic(&path, b"x").unwrap_err();
        assert!(error.to_string().contains("taken"), "{error}");
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 1);
    }

    #[cfg(unix)]
    #[test]
    fn a_link_laid_under_the_name_of_the_neighbour_or_of_the_file_is_not_followed() {
        let dir = tempfile::tempdir().unwrap();
        let (outside, path) = (dir.path().join("outside"), dir.path().join("file"));
        write_atomic(&outside, b"of somebody").unwrap();
        let beside = neighbour(&path).unwrap().0;
        remove_file(&beside).unwrap();
        for laid in [beside.clone(), path.clone()] {
            std::os::unix::fs::symlink(&outside, laid).unwrap();
            write_atomic(&path, b"ours").unwrap();
            assert_eq!(read_bounded(&outside, 99).unwrap(), b"of somebody");
            assert!(!path.is_symlink() && read_bounded(&path, 99).unwrap() == b"ours");
            remove_file(&path).unwrap();
        }
        assert!(beside.is_symlink(), "what has the neighbour's name is not ours to remove");
    }

    #[test]
    fn of_many_that_write_one_new_file_one_does_and_it_is_whole() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a/new");
        let pool = crate::kernel::Threads::new(8).unwrap();
        let texts: Vec<Vec<u8>> = (0..40u8).map(|n| vec![n; 4096]).collect();
        let wrote = pool.map(&texts, |_, text| write_new(&path, text).unwrap());
        let winner = wrote.iter().position(|is_new| *is_new).unwrap();
        assert_eq!(wrote.iter().filter(|is_new| **is_new).count(), 1);
        assert_eq!(read_bounded(&path, 4096).unwrap(), texts[winner]);
        assert_eq!(fs::read_dir(dir.path().join("a")).unwrap().count(), 1, "no neighbour stays");
    }

    #[test]
    fn a_file_above_the_limit_is_an_error() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("big");
        write_atomic(&path, &[0; 10]).unwrap();
        assert!(matches!(read_bounded(&path, 9), Err(StoreError::TooLarge { max_bytes: 9, .. })));
        assert!(matches!(read_bounded(&dir.path().join("none"), 9), Err(StoreError::Io { .. })));
        assert!(matches!(read_bounded(dir.path(), 9), Err(StoreError::Io { .. })));
    }

    #[test]
    fn a_name_that_is_too_long_is_refused_before_anything_is_written_and_a_long_one_is_not() {
        let dir = tempfile::tempdir().unwrap();
        let named = |bytes: usize| dir.path().join("n".repeat(bytes));
        write_atomic(&named(NAME_BYTES_MAX), b"x").unwrap();
        for bytes in [NAME_BYTES_MAX + 1, 255, 300, 100_000] {
            let refused = [fits(&named(bytes)), write_atomic(&named(bytes), b"x")];
            assert!(
                refused.iter().all(|of| of.as_ref().is_err_and(|error| error.to_string().contains("shorter name")))
            );
        }
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 1);
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn an_entry_whose_name_is_no_text_is_told_where_it_would_be_taken() {
        use std::os::unix::ffi::OsStrExt;
        let dir = tempfile::tempdir().unwrap();
        let odd = std::ffi::OsStr::from_bytes(b"caf\xe9.xml");
        fs::write(dir.path().join(odd), b"").unwrap();
        assert_eq!(list_files(dir.path(), &[".json"]).unwrap(), Vec::<PathBuf>::new());
        for refused in [list_files(dir.path(), &[".xml"]), list_entries(dir.path(), ".xml")] {
            let error = refused.unwrap_err().to_string();
            assert!(error.contains("expected a name in UTF-8") && error.contains("rename it"), "{error}");
        }
    }

    #[cfg(unix)]
    #[test]
    fn a_device_is_refused_at_once_by_whatever_way_it_is_reached() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("linked");
        std::os::unix::fs::symlink("/dev/zero", &path).unwrap();
        for refused in
            [read_bounded(&path, 9).map(drop), read_head(&path, 9).map(drop), open_bounded(&path, 9).map(drop)]
        {
            let error = refused.unwrap_err();
            assert!(error.to_string().contains("expected a file, found a pipe or a device"), "{error}");
        }
    }

    #[test]
    fn a_folder_that_cannot_be_synced_is_an_error_and_one_that_knows_no_such_request_is_none() {
        use std::io::ErrorKind::{InvalidInput, Other, StorageFull, Unsupported};
        let dir = Path::new("folder");
        for kind in [Other, StorageFull] {
            let error = synced(dir, Err(kind.into())).unwrap_err().to_string();
            assert!(error.contains("cannot sync folder"), "{error}");
        }
        for kind in [InvalidInput, Unsupported] {
            assert!(synced(dir, Err(kind.into())).is_ok());
        }
        // A folder that exists is synced, and one that does not is left to another command.
        assert!(sync_dir(tempfile::tempdir().unwrap().path()).is_ok() && sync_dir(dir).is_ok());
    }

    #[test]
    fn no_file_has_no_length_and_one_that_cannot_be_asked_is_an_error() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("three");
        write_atomic(&path, b"abc").unwrap();
        assert_eq!((length(&path).unwrap(), length(&dir.path().join("none")).unwrap()), (3, 0));
        let within = length(&path.join("below a file")).unwrap_err();
        assert!(within.to_string().contains("below a file"), "{within}");
    }

    #[test]
    fn what_is_removed_is_gone_what_was_gone_is_no_error_and_the_other_kind_is_one() {
        let dir = tempfile::tempdir().unwrap();
        let (file, none, folder) = (dir.path().join("file"), dir.path().join("none"), dir.path().join("folder"));
        type Remover = fn(&Path) -> Result<(), StoreError>;
        for (remove, kind) in [(remove_file as Remover, "file"), (remove_empty_dir, "empty")] {
            write_atomic(&file, b"x").unwrap();
            create_dir(&folder).unwrap();
            let (own, other) = if kind == "file" { (&file, &folder) } else { (&folder, &file) };
            remove(own).unwrap();
            remove(&none).unwrap();
            assert!(matches!(remove(other), Err(StoreError::Io { .. })), "{kind}");
            assert!(!own.exists() && other.exists(), "{kind}");
        }
        write_atomic(&folder.join("inside"), b"x").unwrap();
        remove_empty_dir(&folder).unwrap();
        assert!(folder.join("inside").exists(), "what is not empty stays");
    }

    #[test]
    fn a_file_is_copied_renamed_and_begun_to_be_read() {
        let dir = tempfile::tempdir().unwrap();
        let [one, two, three] = ["one", "two", "three"].map(|name| dir.path().join(name));
        write_atomic(&one, b"abcdef").unwrap();
        copy(&one, &two).unwrap();
        assert_eq!((read_head(&two, 4).unwrap(), read_head(&two, 9).unwrap()), (b"abcd".to_vec(), b"abcdef".to_vec()));
        rename(&two, &three).unwrap();
        assert!(one.exists() && !two.exists() && read_bounded(&three, 6).unwrap() == b"abcdef");
        assert!(copy(&two, &three).is_err() && rename(&two, &one).is_err() && read_head(&two, 1).is_err());
    }

    #[test]
    fn folders_are_listed_without_files_and_hidden_ones_and_files_no_deeper_than_the_bound() {
        let dir = tempfile::tempdir().unwrap();
        for name in ["b", "a", ".hidden"] {
            create_dir(&dir.path().join(name)).unwrap();
        }
        write_atomic(&dir.path().join("file"), b"").unwrap();
        assert_eq!(list_dirs(dir.path()).unwrap(), ["a", "b"].map(|name| dir.path().join(name)));
        let deep = |levels: usize| (0..levels).fold(dir.path().join("a"), |path, _| path.join("d"));
        for levels in [MAX_DEPTH - 1, MAX_DEPTH] {
            write_atomic(&deep(levels).join("leaf"), b"").unwrap();
        }
        assert_eq!(list_files(dir.path(), &["leaf"]).unwrap(), [deep(MAX_DEPTH - 1).join("leaf")]);
    }

    #[test]
    fn files_are_listed_in_the_order_of_their_paths() {
        let dir = tempfile::tempdir().unwrap();
        for name in ["b.xml", "a/z.xml", "a/y.txt", ".hidden.xml", "c.xml"] {
            write_atomic(&dir.path().join(name), b"").unwrap();
        }
        let names: Vec<_> = list_files(dir.path(), &[".xml"])
            .unwrap()
            .iter()
            .map(|path| path.strip_prefix(dir.path()).unwrap().to_string_lossy().into_owned())
            .collect();
        assert_eq!(names, ["a/z.xml", "b.xml", "c.xml"]);
        assert_eq!(list_files(&dir.path().join("b.xml"), &[]).unwrap().len(), 1);
    }
}
