//! Files that a command is asked to write (`--out` and the like). None takes the place of a run's own file, and none that of another
//! file unless `--overwrite` says so.

use clap::Args;
use std::path::{Path, PathBuf};

use crate::cli::terminal::exit::Failure;
use crate::store;

/// Files and folders that a run folder has of its own.
const OWN: [&str; 22] = [
    "run.json",
    "experiment.toml",
    "scenes.pool",
    "cassette.jsonl",
    "rollouts.jsonl",
    "transcript.jsonl",
    "transcript.before.jsonl",
    "result.json",
    "cost.json",
    "credit.json",
    "report.html",
    "spend.json",
    "processes.log",
    "withdrawn.jsonl",
    "manifest.json",
    "ro-crate-metadata.json",
    "store",
    "recording",
    "shards",
    "exchange",
    "tries",
    "planner",
];
/// A folder is a run's if one of these is in it.
const MARKS: [&str; 2] = ["run.json", "transcript.jsonl"];
/// A store is one by this file, wherever it lies.
const STORE: [&str; 3] = ["objects.pack", "index.sqlite", "lock"];

/// Returns what a file is to hold, by the ending of its name.
///
/// # Errors
/// A name with another ending, or none: the file would not hold what its name says.
pub fn by_ending<T: Copy, const N: usize>(option: &str, path: &Path, known: [(&str, T); N]) -> Result<T, Failure> {
    let ending = path.extension().and_then(|ending| ending.to_str()).unwrap_or_default();
    let found = known.iter().find(|(of, _)| ending.eq_ignore_ascii_case(of));
    found.map(|(_, kind)| *kind).ok_or_else(|| {
        let endings = known.map(|(of, _)| format!(".{of}")).join(" or ");
        Failure::bad_input(format!("{option} {}: expected a name that ends in {endings}", path.display()))
    })
}

/// Permission to replace files that are there already.
#[derive(Clone, Copy, Debug, Args)]
pub struct Output {
    /// Replace files that are there already; a run's own files never are.
    #[arg(long)]
    pub overwrite: bool,
}

impl Output {
    /// Writes a file, whole or not at all. One that is there already and the same stays.
    ///
    /// # Errors
    /// A place that `may_be_made` refuses; a disk that does not do what it is asked.
    pub fn write(self, path: &Path, bytes: &[u8]) -> Result<(), Failure> {
        if !is_own(path) && same(path, bytes) {
            return Ok(());
        }
        self.may_be_made(path)?;
        Ok(store::write_atomic(path, bytes)?)
    }

    /// Checks that a file may be written here.
    ///
    /// # Errors
    /// A run's own file, a link that leads nowhere, something that is no file, and without `--overwrite` a file.
    pub fn may_be_made(self, path: &Path) -> Result<(), Failure> {
        let refused = |found: &str, remedy: &str| {
            Err(Failure::bad_input(format!(
                "{}: expected a place for a new file, found {found}; {remedy}",
                path.display()
            )))
        };
        store::fits(path)?;
        if is_own(path) {
            return refused("a place of a run's own files", "name another file");
        }
        if !store::is_taken(path) {
            return Ok(());
        }
        match path.metadata() {
            Err(_) => refused("a link that leads nowhere", "remove it, or name another file"),
            Ok(there) if !there.is_file() => refused("something that is no file", "name another file"),
            Ok(_) if !self.overwrite => refused("a file", "name another one, or add --overwrite to replace it"),
            Ok(_) => Ok(()),
        }
    }
}

/// Returns `true` if a plain file with these bytes is there.
fn same(path: &Path, bytes: &[u8]) -> bool {
    store::is_plain_file(path).is_ok_and(|there| there)
        && store::read_bounded(path, bytes.len() as u64).is_ok_and(|there| there == bytes)
}

/// Returns `true` if the name belongs to a run or its store, by whatever way it is reached.
fn is_own(path: &Path) -> bool {
    let Some(name) = path.file_name() else { return false };
    let home = path.parent().filter(|home| !home.as_os_str().is_empty()).unwrap_or(Path::new("."));
    // A folder that is not there yet is made beside what is there: what stands above it counts.
    let home = home.canonicalize().unwrap_or_else(|_| home.to_path_buf());
    if STORE.iter().any(|of| name == *of) && home.join(STORE[0]).exists() {
        return true;
    }
    let place: PathBuf = home.join(name);
    place.ancestors().skip(1).any(|run| {
        let below = place.strip_prefix(run).ok().and_then(|below| below.components().next());
        below.is_some_and(|first| OWN.iter().any(|own| first.as_os_str() == *own))
            && MARKS.iter().any(|mark| run.join(mark).is_file())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_says_what_its_file_holds_or_is_refused() {
        let of = |name: &str| by_ending("--out", Path::new(name), [("html", 1), ("gif", 2)]);
        assert_eq!([of("a/play.gif").unwrap(), of("play.HTML").unwrap()], [2, 1]);
        for name in ["play.png", "play", "gif", "play.gif.txt"] {
            let refused = of(name).unwrap_err().message;
            assert_eq!(refused, format!("--out {name}: expected a name that ends in .html or .gif"));
        }
    }

    const KEEP: Output = Output { overwrite: false };
    const REPLACE: Output = Output { overwrite: true };

    #[test]
    fn a_file_is_replaced_only_where_that_is_asked_for_and_an_equal_one_stays() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("new/out.svg");
        KEEP.write(&path, b"one").unwrap();
        KEEP.write(&path, b"one").unwrap();
        let refused = KEEP.write(&path, b"two").unwrap_err();
        assert!(refused.message.contains("out.svg") && refused.message.contains("--overwrite"), "{}", refused.message);
        assert_eq!(std::fs::read(&path).unwrap(), b"one");
        REPLACE.write(&path, b"two").unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"two");
        assert!(REPLACE.write(dir.path(), b"three").is_err(), "a folder");
    }

    #[test]
    fn a_runs_own_file_is_never_replaced_nor_made_by_whatever_way_it_is_reached() {
        let dir = tempfile::tempdir().unwrap();
        let run = dir.path().join("run");
        for name in ["run.json", "store/objects.pack", "recording/objects.pack", "note.txt"] {
            store::write_atomic(&run.join(name), b"own").unwrap();
        }
        let own = ["run.json", "result.json", "store/objects.pack", "store/new", "shards/x/y.svg", "recording/lock"];
        for name in own {
            let refused = REPLACE.write(&run.join(name), b"own").unwrap_err();
            assert!(refused.message.contains("run's own"), "{name}: {}", refused.message);
        }
        REPLACE.write(&run.join("figures/result.json"), b"mine").unwrap();
        REPLACE.write(&run.join("note.txt"), b"mine").unwrap();
        // Beside a run, and in a folder that is none, names are free.
        KEEP.write(&dir.path().join("result.json"), b"mine").unwrap();
        // A store by itself.
        store::write_atomic(&dir.path().join("kept/objects.pack"), b"own").unwrap();
        assert!(REPLACE.write(&dir.path().join("kept/index.sqlite"), b"mine").is_err());
    }

    #[cfg(unix)]
    #[test]
    fn links_lead_no_output_into_a_run_or_nowhere() {
        let dir = tempfile::tempdir().unwrap();
        let (run, linked, dangling) = (dir.path().join("run"), dir.path().join("linked"), dir.path().join("dangling"));
        store::write_atomic(&run.join("run.json"), b"own").unwrap();
        std::os::unix::fs::symlink(&run, &linked).unwrap();
        assert!(REPLACE.write(&linked.join("run.json"), b"mine").unwrap_err().message.contains("run's own"));
        std::os::unix::fs::symlink(dir.path().join("nobody"), &dangling).unwrap();
        for of in [KEEP, REPLACE] {
            let refused = of.write(&dangling, b"mine").unwrap_err();
            assert!(refused.message.contains("a link that leads nowhere"), "{}", refused.message);
        }
        assert!(dangling.is_symlink() && !dir.path().join("nobody").exists());
    }
}
