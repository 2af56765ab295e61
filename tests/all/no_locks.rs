//! Disks whose mount gives no file locks. Without fcntl's locks a run goes on, says so once, and still keeps a second writer out; where
//! no lock is to be had, the error says that and what helps.
#![cfg(target_os = "linux")]

use std::path::{Path, PathBuf};
use std::process::Command;

use evodrive::store::Store;

use crate::backends::experiment;
use crate::harness::{Ran, evodrive, folder_below, home, skip};

/// Builds the library that stands between a command and the system's locks; `None` without a C compiler.
fn preloaded(folder: &Path) -> Option<PathBuf> {
    let library = folder.join("no_locks.so");
    let made = Command::new("cc")
        .args(["-shared", "-fPIC", "-o"])
        .arg(&library)
        .arg(home().join(".ci/no_locks.c"))
        .arg("-ldl")
        .status();
    if !made.is_ok_and(|ended| ended.success()) {
        skip("no C compiler (cc) is installed, so no disk without locks was tried");
        return None;
    }
    Some(library)
}

/// Carries a command out on such a disk, whose locks fail with this error.
fn without(library: &Path, folder: &Path, errno: &str, flock: bool, args: &[&str]) -> Ran {
    let mut command = evodrive();
    command.current_dir(folder).env("LD_PRELOAD", library).env("NO_LOCKS_ERRNO", errno).args(args);
    Ran::of(if flock { &mut command } else { command.env("NO_FLOCK", "1") })
}

/// A library that takes locks away, beside an experiment and a run of it on a disk that has them; none where no compiler is.
fn prepared(folder: &Path) -> Option<(PathBuf, Ran)> {
    let library = preloaded(folder)?;
    experiment(folder, "mine", "");
    let record = ["record", "mine.toml", "--no-report", "--out", "plain"];
    Some((library, Ran::of(evodrive().current_dir(folder).args(record))))
}

const TOLD: &str = "this disk has no fcntl locks";
/// ENOLCK, ENOSYS, EOPNOTSUPP and EINVAL: what such mounts say.
const ERRORS: [&str; 4] = ["37", "38", "95", "22"];

#[test]
fn a_run_goes_on_without_the_locks_of_fcntl_and_comes_to_the_same() {
    let dir = tempfile::tempdir().unwrap();
    let Some((library, plain)) = prepared(dir.path()) else { return };
    for errno in ERRORS {
        let here = |args: &[&str]| without(&library, dir.path(), errno, true, args);
        let ran =
            here(&["record", "mine.toml", "--no-report", "--out", errno, "--cassette", &format!("{errno}.jsonl")]);
        assert_eq!(ran.root(), plain.root(), "{errno}");
        assert_eq!(ran.stderr.matches(TOLD).count(), 1, "{errno}: {}", ran.stderr);
        let folder = folder_below(&dir.path().join(errno));
        let run = folder.to_str().unwrap();
        assert_eq!(here(&["fsck", "--read", run]).code, 0, "{errno}");
        assert_eq!(here(&["check", run]).root(), plain.root(), "{errno}");
        // The index is kept, and is made anew from the pack where it was damaged.
        let index = folder.join("store/index.sqlite");
        assert!(std::fs::read(&index).unwrap().starts_with(b"SQLite format 3"), "{errno}");
        std::fs::write(&index, "damaged").unwrap();
        assert_eq!(here(&["check", run]).root(), plain.root(), "{errno}");
        assert!(std::fs::read(&index).unwrap().starts_with(b"SQLite format 3"), "{errno}");
        // One writer still.
        let held = Store::open(&folder.join("store")).unwrap();
        let refused = here(&["check", run]);
        assert!(refused.code == 2 && refused.stderr.contains("is in use by process"), "{errno}: {}", refused.stderr);
        drop(held);
    }
}

#[test]
fn where_no_lock_is_to_be_had_that_is_said_with_what_helps_and_nothing_is_left() {
    let dir = tempfile::tempdir().unwrap();
    let Some((library, plain)) = prepared(dir.path()) else { return };
    for errno in ERRORS {
        let here = |args: &[&str]| without(&library, dir.path(), errno, false, args);
        for command in ["run", "record", "plan"] {
            let report: &[&str] = if command == "plan" { &[] } else { &["--no-report"] };
            let ran = here(&[&[command, "mine.toml", "--out", "none"], report].concat());
            assert_eq!(ran.code, 2, "{command}: {}", ran.stderr);
            for words in ["store/lock: ", "this disk has no file locks", "a local disk (--out)", "docs/RUNS.md"] {
                assert!(ran.stderr.contains(words), "{command}, {words}: {}", ran.stderr);
            }
            assert!(!dir.path().join("none").exists(), "{command}");
        }
        // Who only looks needs none.
        let run = folder_below(&dir.path().join("plain"));
        let whole = here(&["fsck", "--read", run.to_str().unwrap()]);
        assert_eq!(whole.code, 0, "{}", whole.stderr);
        assert!(plain.code == 0 && here(&["bundle", "inspect", "none.evodrive"]).code == 2);
    }
}
