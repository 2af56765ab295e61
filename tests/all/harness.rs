//! Tools that several tests need: the binary and what it printed, files of this repository, data that may lie beside it.

use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

/// Folder of this repository.
pub fn home() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Text of a file of this repository.
pub fn text(path: &str) -> String {
    std::fs::read_to_string(home().join(path)).unwrap_or_else(|error| panic!("{path}: {error}"))
}

/// An experiment of this repository, composed from its bases.
pub fn experiment(name: &str) -> toml::Table {
    evodrive::experiment::composed(&home().join("experiments").join(name)).unwrap().table
}

/// Sets keys of an experiment's tables.
pub fn set(table: &mut toml::Table, changes: &[(&str, &str, toml::Value)]) {
    for (part, key, value) in changes {
        table[*part].as_table_mut().unwrap().insert((*key).into(), value.clone());
    }
}

/// Writes an experiment that a test made smaller, with a cassette of its own beside it.
pub fn write_small(folder: &Path, mut table: toml::Table) -> PathBuf {
    table.insert("cassette".into(), "small.jsonl".into());
    let path = folder.join("small.toml");
    std::fs::write(&path, toml::to_string(&table).unwrap()).unwrap();
    path
}

/// A recorded run that the tests of a file share.
pub struct Recorded {
    /// It is removed with this.
    _folder: tempfile::TempDir,
    pub experiment: PathBuf,
    pub run: PathBuf,
    pub root: String,
}

/// Records the experiment that `write` puts into an empty folder.
pub fn record(write: impl FnOnce(&Path) -> PathBuf) -> Recorded {
    let folder = tempfile::tempdir().unwrap();
    let experiment = write(folder.path());
    let out = folder.path().join("runs");
    let root = run(&["record", experiment.to_str().unwrap(), "--out", out.to_str().unwrap()]).root();
    Recorded { run: folder_below(&out), _folder: folder, experiment, root }
}

/// The events of a run's transcript, in order.
pub fn events(run: &Path) -> Vec<Value> {
    let text = std::fs::read_to_string(run.join("transcript.jsonl")).unwrap();
    text.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

/// Returns what a report's script draws: the story, and the scenes that it plays.
pub fn report_data(page: &str) -> Value {
    let (_, rest) = page.split_once("<script id=\"data\" type=\"application/json\">").expect("the data");
    let (data, _) = rest.split_once("</script>").expect("the data's end");
    match serde_json::from_str(data).unwrap() {
        Value::String(packed) => {
            use base64::{Engine, engine::general_purpose::STANDARD};
            let bytes = STANDARD.decode(packed).unwrap();
            serde_json::from_reader(flate2::read::ZlibDecoder::new(bytes.as_slice())).unwrap()
        }
        plain => plain,
    }
}

/// The first folder below `folder`: the run folder below `--out`.
pub fn folder_below(folder: &Path) -> PathBuf {
    std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()).find(|path| path.is_dir()).expect("a folder")
}

/// Copies a folder with all that is in it.
pub fn copy_dir(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).unwrap();
    for entry in std::fs::read_dir(from).unwrap() {
        let entry = entry.unwrap();
        let target = to.join(entry.file_name());
        if entry.path().is_dir() {
            copy_dir(&entry.path(), &target);
        } else {
            std::fs::copy(entry.path(), target).unwrap();
        }
    }
}

/// Output of a command, and how it ended.
pub struct Ran {
    pub code: i32,
    pub stdout: String,
    pub stderr: String,
}

impl Ran {
    /// Carries a command out; -1 is the code of one that a signal ended.
    pub fn of(command: &mut Command) -> Ran {
        let output = command.output().expect("the binary runs");
        Ran {
            code: output.status.code().unwrap_or(-1),
            stdout: String::from_utf8_lossy(&output.stdout).into_owned(),
            stderr: String::from_utf8_lossy(&output.stderr).into_owned(),
        }
    }

    /// Root of a run that ended well, from its last line.
    pub fn root(&self) -> String {
        assert_eq!(self.code, 0, "{}", self.stderr);
        let last = self.stdout.lines().last().unwrap_or_default();
        last.strip_prefix("root: ").unwrap_or_else(|| panic!("the last line is {last:?}")).to_string()
    }
}

/// The binary, in this repository's folder.
pub fn evodrive() -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_evodrive"));
    command.current_dir(home());
    command
}

/// The binary with these arguments.
pub fn run(args: &[&str]) -> Ran {
    Ran::of(evodrive().args(args))
}

/// A place that the developer may name.
#[allow(clippy::disallowed_methods)]
pub fn named_folder(variable: &str) -> Option<PathBuf> {
    std::env::var_os(variable).map(PathBuf::from)
}

/// A file or folder of the data that is no part of the project: `../shared` or what EVODRIVE_SHARED names. A test that
/// gets `None` ends; `cargo test` lists it as skipped at its end.
#[track_caller]
pub fn shared(path: &str) -> Option<PathBuf> {
    let found = named_folder("EVODRIVE_SHARED").unwrap_or_else(|| home().join("../shared")).join(path);
    if !found.exists() {
        skip(&format!("no {path} in ../shared or EVODRIVE_SHARED"));
        return None;
    }
    Some(found)
}

/// Notes that the running test skips all or a part of its work. The target `skipped`, which runs after this one, lists
/// the notes: what a test that passes prints is seen by nobody.
#[track_caller]
pub fn skip(reason: &str) {
    let place = std::panic::Location::caller();
    let file = Path::new(place.file()).file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("skipped");
    std::fs::create_dir_all(&folder).unwrap();
    // With one test thread all tests run on the main one, so the place names the note.
    let test = std::thread::current().name().filter(|name| *name != "main").unwrap_or("a test of").to_string();
    std::fs::write(folder.join(format!("{file}-{}", place.line())), format!("{test} ({file}): {reason}")).unwrap();
}

/// Names and bytes of the files of a folder whose names contain `part`, in order.
pub fn files(folder: &Path, part: &str) -> Vec<(String, Vec<u8>)> {
    let name = |path: &PathBuf| path.file_name().unwrap().to_string_lossy().into_owned();
    let mut paths: Vec<PathBuf> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    paths.retain(|path| path.is_file() && name(path).contains(part));
    paths.sort();
    paths.iter().map(|path| (name(path), std::fs::read(path).unwrap())).collect()
}
