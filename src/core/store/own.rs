//! Folders of this program's own. Each is made anew and marked by a file inside, and only a marked one is removed: a name that we
//! derived may be that of somebody else's folder. No other place removes folders.

use std::{
    fs::{self, File, OpenOptions},
    io::{ErrorKind, Write},
    path::{Path, PathBuf},
};

use super::{
    StoreError,
    file::{create_dir, is_taken, parent_of, read_head, sync_dir},
};

/// File name of the mark.
const MARK: &str = ".evodrive-own";
const FORMAT: &str = "evodrive-folder/1";
/// Largest size of a mark, bytes.
const MARK_BYTES_MAX: usize = 512;
/// Name in a scratch folder of the folder that is being made.
const WHOLE: &str = "whole";

/// A folder that this program made for one purpose, and may remove.
#[derive(Debug)]
pub struct OwnDir {
    dir: PathBuf,
    /// Purpose of the folder; stands in its mark.
    id: String,
}

impl OwnDir {
    /// Makes a folder where nothing is; `None` where the name is taken.
    pub fn make(dir: &Path, id: &str) -> Result<Option<OwnDir>, StoreError> {
        if is_taken(dir) {
            return Ok(None);
        }
        // It bears its mark from the first moment, so that a kill never leaves a folder that cannot be removed.
        let scratch = Scratch::beside(dir)?;
        let whole = scratch.dir.join(WHOLE);
        let io = |source| StoreError::io("make the folder", dir, source);
        fs::create_dir(&whole).and_then(|()| marked(&whole, id)).map_err(io)?;
        match fs::rename(&whole, dir) {
            Ok(()) => sync_dir(parent_of(dir)).map(|()| Some(OwnDir { dir: dir.into(), id: id.into() })),
            // Somebody was faster.
            Err(_) if is_taken(dir) => Ok(None),
            Err(source) => Err(io(source)),
        }
    }

    /// Makes a folder, or goes on in the one that was made for the same purpose before. Any other one is an error.
    pub fn open(dir: &Path, id: &str) -> Result<OwnDir, StoreError> {
        if let Some(own) = OwnDir::make(dir, id)? {
            return Ok(own);
        }
        let own = OwnDir { dir: dir.into(), id: id.into() };
        own.check().map(|()| own)
    }

    /// Returns `true` if a folder bears a mark of this program, made for any purpose.
    pub fn is_one(dir: &Path) -> bool {
        marks(dir).is_ok_and(|mark| mark.starts_with(FORMAT))
    }

    fn check(&self) -> Result<(), StoreError> {
        let found = match marks(&self.dir) {
            Ok(mark) if mark == line(&self.id) => return Ok(()),
            Ok(_) => "one that it made for something else",
            Err(found) => found,
        };
        Err(StoreError::Foreign { path: self.dir.clone(), expected: "no folder, or one that this command made", found })
    }

    /// Takes the mark off: from now on the folder is the user's.
    pub fn give_away(&self) -> Result<(), StoreError> {
        self.check()?;
        super::remove_file(&self.dir.join(MARK))
    }

    /// Removes it with all that is in it, the mark last. It is no error if it is gone already; it is one if it is not ours.
    pub fn remove(&self) -> Result<(), StoreError> {
        if !is_taken(&self.dir) {
            return Ok(());
        }
        self.check()?;
        emptied(&self.dir).map_err(|source| StoreError::io("remove", &self.dir, source))
    }
}

/// Empties a folder without following links: a link in it goes, its target stays.
fn emptied(dir: &Path) -> std::io::Result<()> {
    for entry in fs::read_dir(dir)? {
        let entry = entry?;
        if entry.file_name() == MARK {
            continue;
        }
        if entry.file_type()?.is_dir() { fs::remove_dir_all(entry.path()) } else { fs::remove_file(entry.path()) }?;
    }
    fs::remove_file(dir.join(MARK))?;
    fs::remove_dir(dir)
}

fn line(id: &str) -> String {
    format!("{FORMAT} {id}\n")
}

/// Writes the mark, and holds its lock before the file gets its name. A disk may have no locks.
fn marked(dir: &Path, id: &str) -> std::io::Result<Option<File>> {
    let part = dir.join(format!("{MARK}.part"));
    let mut file = OpenOptions::new().read(true).write(true).create_new(true).open(&part)?;
    let is_locked = file.try_lock().is_ok();
    file.write_all(line(id).as_bytes())?;
    fs::rename(&part, dir.join(MARK))?;
    Ok(is_locked.then_some(file))
}

/// Returns the text of a folder's mark, or a description of what is there in its place.
fn marks(dir: &Path) -> Result<String, &'static str> {
    let is = |path: &Path| fs::symlink_metadata(path).map(|of| of.file_type());
    match is(dir) {
        Ok(kind) if kind.is_dir() => {}
        Ok(kind) if kind.is_symlink() => return Err("a link"),
        Ok(_) => return Err("a file"),
        Err(_) => return Err("nothing that can be looked at"),
    }
    let path = dir.join(MARK);
    match is(&path) {
        Ok(kind) if kind.is_file() => {}
        _ => return Err("a folder without this program's mark"),
    }
    let bytes = read_head(&path, MARK_BYTES_MAX).map_err(|_| "a folder whose mark cannot be read")?;
    String::from_utf8(bytes).map_err(|_| "a folder with a mark of something else")
}

/// A temporary folder: nobody else's, and removed when this is dropped or, if its command was killed, by the next one.
#[derive(Debug)]
pub struct Scratch {
    /// The folder.
    pub dir: PathBuf,
    begins: String,
    /// While this is open no command takes the folder for abandoned.
    _held: Option<File>,
}

impl Scratch {
    /// Makes it under a folder, with a new name that begins so, and removes what killed commands left there.
    pub fn under(place: &Path, begins: &str) -> Result<Scratch, StoreError> {
        remove_abandoned(place, begins);
        create_dir(place)?;
        let mut number = 0u32;
        loop {
            let dir = place.join(format!("{begins}{}-{number}", std::process::id()));
            let io = |source| StoreError::io("make a folder in", place, source);
            match private(&dir) {
                Ok(()) => {
                    let held = marked(&dir, begins).map_err(io)?;
                    return Ok(Scratch { dir, begins: begins.into(), _held: held });
                }
                Err(error) if error.kind() == ErrorKind::AlreadyExists => number += 1,
                Err(source) => return Err(io(source)),
            }
        }
    }

    /// Makes a hidden one beside a file or folder that is to be made in it first.
    pub fn beside(path: &Path) -> Result<Scratch, StoreError> {
        let name = path.file_name().ok_or_else(|| StoreError::io("write", path, ErrorKind::IsADirectory.into()))?;
        Scratch::under(parent_of(path), &format!(".{}.", name.to_string_lossy()))
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        let own = OwnDir { dir: std::mem::take(&mut self.dir), id: std::mem::take(&mut self.begins) };
        let _ = own.remove();
    }
}

/// Makes a new folder that only its owner can look into.
fn private(dir: &Path) -> std::io::Result<()> {
    let mut builder = fs::DirBuilder::new();
    #[cfg(unix)]
    std::os::unix::fs::DirBuilderExt::mode(&mut builder, 0o700);
    builder.create(dir)
}

/// Removes scratch folders of commands that were killed: those with our mark that no command holds any more. A folder that cannot be
/// looked at, locked or removed stays.
fn remove_abandoned(place: &Path, begins: &str) {
    for entry in fs::read_dir(place).into_iter().flatten().flatten() {
        let dir = entry.path();
        let named = entry.file_name().to_string_lossy().starts_with(begins);
        if !named || !marks(&dir).is_ok_and(|mark| mark == line(begins)) {
            continue;
        }
        let mark = OpenOptions::new().read(true).write(true).open(dir.join(MARK));
        if mark.is_ok_and(|mark| mark.try_lock().is_ok()) {
            let _ = emptied(&dir);
        }
    }
}

/// Removes a folder that is empty; one that is not stays. It is no error if the folder does not exist.
pub fn remove_empty_dir(path: &Path) -> Result<(), StoreError> {
    match fs::remove_dir(path) {
        Err(source) if !matches!(source.kind(), ErrorKind::DirectoryNotEmpty | ErrorKind::NotFound) => {
            Err(StoreError::io("remove", path, source))
        }
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::write_atomic;

    #[test]
    fn a_folder_is_made_once_gone_on_with_and_removed_by_who_knows_its_mark_alone() {
        let home = tempfile::tempdir().unwrap();
        let dir = home.path().join("a/x.work");
        let own = OwnDir::make(&dir, "one").unwrap().unwrap();
        assert!(OwnDir::make(&dir, "one").unwrap().is_none(), "the name is taken");
        assert_eq!(fs::read_dir(home.path().join("a")).unwrap().count(), 1, "nothing is left beside it");
        write_atomic(&dir.join("deep/inside"), b"x").unwrap();
        let again = OwnDir::open(&dir, "one").unwrap();
        let other = OwnDir::open(&dir, "two").unwrap_err().to_string();
        assert!(other.contains("x.work") && other.contains("something else"), "{other}");
        assert!(OwnDir { dir: dir.clone(), id: "two".into() }.remove().is_err() && dir.join("deep/inside").exists());
        again.remove().unwrap();
        own.remove().unwrap();
        assert!(!dir.exists());
    }

    #[test]
    fn what_is_not_ours_stays_whatever_it_is() {
        let home = tempfile::tempdir().unwrap();
        let at = |name: &str| home.path().join(name);
        write_atomic(&at("theirs/log.bin"), b"weeks").unwrap();
        fs::create_dir(at("empty")).unwrap();
        write_atomic(&at("file"), b"x").unwrap();
        let own = OwnDir::make(&at("given"), "id").unwrap().unwrap();
        own.give_away().unwrap();
        write_atomic(&at("marked/.evodrive-own"), b"somebody's").unwrap();
        for name in ["theirs", "empty", "file", "given", "marked"] {
            let error = OwnDir::open(&at(name), "id").unwrap_err();
            assert!(error.to_string().contains(name), "{error}");
            assert!(OwnDir { dir: at(name), id: "id".into() }.remove().is_err() && at(name).exists(), "{name}");
        }
        OwnDir { dir: at("none"), id: "id".into() }.remove().unwrap();
    }

    #[cfg(unix)]
    #[test]
    fn a_link_to_a_folder_of_ours_is_none_and_a_link_inside_is_not_followed() {
        use std::os::unix::fs::{PermissionsExt, symlink};
        let home = tempfile::tempdir().unwrap();
        let at = |name: &str| home.path().join(name);
        let own = OwnDir::make(&at("own"), "id").unwrap().unwrap();
        symlink(at("own"), at("linked")).unwrap();
        assert!(OwnDir::open(&at("linked"), "id").unwrap_err().to_string().contains("found a link"));
        assert!(OwnDir { dir: at("linked"), id: "id".into() }.remove().is_err());
        write_atomic(&at("theirs/log.bin"), b"weeks").unwrap();
        symlink(at("theirs"), at("own/in")).unwrap();
        own.remove().unwrap();
        assert!(!at("own").exists() && at("theirs/log.bin").exists());
        // Nobody else looks into a scratch folder, and a name that somebody made before is not used for it.
        let taken = format!("s-{}-0", std::process::id());
        symlink(at("theirs"), at(&taken)).unwrap();
        let scratch = Scratch::under(home.path(), "s-").unwrap();
        assert_eq!(fs::symlink_metadata(&scratch.dir).unwrap().permissions().mode() & 0o777, 0o700);
        assert_ne!(scratch.dir, at(&taken));
        drop(scratch);
        assert!(at(&taken).is_symlink() && at("theirs/log.bin").exists());
    }

    #[test]
    fn what_a_killed_command_left_is_removed_and_what_runs_or_is_not_ours_is_not() {
        let home = tempfile::tempdir().unwrap();
        let at = |name: &str| home.path().join(name);
        // Killed: its mark is there, and nobody holds it.
        write_atomic(&at(".x.1-0/half"), b"half").unwrap();
        drop(marked(&at(".x.1-0"), ".x.").unwrap());
        write_atomic(&at(".x.2-0/half"), b"theirs").unwrap();
        write_atomic(&at(".x.3.tmp"), b"theirs").unwrap();
        write_atomic(&at(".y.1-0/half"), b"another's").unwrap();
        drop(marked(&at(".y.1-0"), ".y.").unwrap());
        let running = Scratch::under(home.path(), ".x.").unwrap();
        let second = Scratch::under(home.path(), ".x.").unwrap();
        let left = [".x.1-0", ".x.2-0", ".x.3.tmp", ".y.1-0"].map(|name| is_taken(&at(name)));
        assert_eq!(left, [false, true, true, true]);
        assert!(running.dir.exists() && second.dir.exists() && running.dir != second.dir);
        let dir = running.dir.clone();
        drop(running);
        assert!(!dir.exists() && second.dir.exists());
    }
}
