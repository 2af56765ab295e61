//! Answers of every reader to a file that is missing, empty, cut, changed, a folder or not to be read: the exit code, the file, and what
//! to do.

use std::path::Path;

use crate::harness::{run, skip};
use crate::short::copied;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Damage {
    Missing,
    Empty,
    Cut,
    Flipped,
    Folder,
}

use Damage::{Cut, Empty, Flipped, Folder, Missing};

const ALL: [Damage; 5] = [Missing, Empty, Cut, Flipped, Folder];

fn inflict(path: &Path, damage: Damage) {
    let bytes = std::fs::read(path).unwrap();
    std::fs::remove_file(path).unwrap();
    match damage {
        Missing => {}
        Empty => std::fs::write(path, b"").unwrap(),
        Cut => std::fs::write(path, &bytes[..bytes.len() / 2]).unwrap(),
        Flipped => {
            let mut bytes = bytes;
            let at = bytes.len() / 2;
            bytes[at] ^= 1;
            std::fs::write(path, bytes).unwrap();
        }
        Folder => std::fs::create_dir(path).unwrap(),
    }
}

/// Commands that read a run folder, with the folder in the place of `F`.
const READERS: [(&str, &[&str]); 7] = [
    ("fsck", &["fsck", "--read", "F"]),
    ("check", &["check", "F"]),
    ("table", &["table", "metadrive-main", "--run", "F"]),
    ("show", &["show", "cat-idm/e0s0", "--run", "F"]),
    ("why", &["why", "metadrive-main:cat:attack", "F"]),
    ("impact", &["impact", "cat-idm/e0s0", "F"]),
    ("export", &["program", "export", "F", "cat-idm/parent"]),
];

/// Exit codes of the commands above, in their order, for each damage of a file. 0 where a command does not need the file, or where what is
/// left of it is whole.
#[rustfmt::skip]
const EXPECTED: &[(&str, Damage, [i32; 7])] = &[
    ("run.json", Missing,            [2, 2, 2, 2, 2, 2, 2]),
    ("run.json", Empty,              [5, 5, 5, 5, 5, 5, 5]),
    ("run.json", Cut,                [5, 5, 5, 5, 5, 5, 5]),
    ("run.json", Folder,             [2, 2, 2, 2, 2, 2, 2]),
    ("transcript.jsonl", Missing,    [5, 5, 5, 5, 5, 5, 5]),
    ("transcript.jsonl", Empty,      [5, 5, 5, 5, 5, 5, 5]),
    ("transcript.jsonl", Cut,        [5, 5, 2, 0, 2, 2, 0]),
    ("transcript.jsonl", Flipped,    [5, 5, 5, 5, 5, 5, 5]),
    ("transcript.jsonl", Folder,     [2, 2, 2, 2, 2, 2, 2]),
    ("experiment.toml", Missing,     [5, 2, 0, 0, 0, 0, 2]),
    ("experiment.toml", Empty,       [5, 5, 0, 0, 0, 0, 5]),
    ("experiment.toml", Cut,         [5, 5, 0, 0, 0, 0, 5]),
    ("experiment.toml", Folder,      [5, 5, 0, 0, 0, 0, 5]),
    ("scenes.pool", Missing,         [5, 2, 0, 0, 0, 0, 2]),
    ("scenes.pool", Empty,           [5, 5, 0, 0, 0, 5, 5]),
    ("scenes.pool", Cut,             [5, 5, 0, 0, 0, 5, 5]),
    ("scenes.pool", Flipped,         [5, 5, 0, 0, 0, 5, 5]),
    ("scenes.pool", Folder,          [5, 5, 0, 0, 0, 5, 5]),
    ("cassette.jsonl", Missing,      [5, 2, 0, 0, 0, 0, 0]),
    ("cassette.jsonl", Empty,        [5, 5, 0, 5, 0, 0, 0]),
    ("cassette.jsonl", Cut,          [5, 5, 0, 5, 0, 0, 0]),
    ("cassette.jsonl", Flipped,      [5, 5, 0, 5, 0, 0, 0]),
    ("cassette.jsonl", Folder,       [5, 2, 0, 2, 2, 0, 0]),
    ("store/objects.pack", Missing,  [5, 5, 0, 0, 0, 0, 0]),
    ("store/objects.pack", Empty,    [5, 5, 0, 0, 0, 0, 0]),
    ("store/objects.pack", Cut,      [5, 5, 0, 0, 0, 0, 0]),
    ("store/objects.pack", Folder,   [2, 2, 0, 0, 0, 0, 0]),
    ("result.json", Missing,         [5, 4, 0, 0, 0, 0, 0]),
    ("result.json", Empty,           [5, 4, 0, 0, 0, 0, 0]),
    ("result.json", Cut,             [5, 4, 0, 0, 0, 0, 0]),
    ("result.json", Folder,          [5, 4, 0, 0, 0, 0, 0]),
];

#[test]
fn every_reader_ends_with_the_documented_code_and_names_the_file() {
    let mut wrong = Vec::new();
    for (file, damage, codes) in EXPECTED {
        let dir = tempfile::tempdir().unwrap();
        let folder = copied(dir.path());
        inflict(&folder.join(file), *damage);
        for ((name, command), expected) in READERS.iter().zip(codes) {
            // Deriving a whole run takes its time, and is tried where it can be refused at once.
            if *name == "check" && *expected == 4 {
                continue;
            }
            let place = folder.to_str().unwrap();
            let args: Vec<&str> = command.iter().map(|word| if *word == "F" { place } else { word }).collect();
            let ran = run(&args);
            let said = format!("{}{}", ran.stdout, ran.stderr);
            let bare = Path::new(file).file_name().unwrap().to_str().unwrap();
            let silent = *expected == 5 && !said.contains(bare);
            if ran.code != *expected || silent || said.contains("panicked") {
                let first: String = said.chars().take(300).collect();
                wrong.push(format!("{file} {damage:?}, {name}: expected {expected}, exit {}: {first}", ran.code));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn files_that_commands_are_given_are_refused_by_their_place() {
    let dir = tempfile::tempdir().unwrap();
    let folder = copied(dir.path());
    let program = dir.path().join("program.json");
    let ran =
        run(&["program", "export", folder.to_str().unwrap(), "cat-idm/parent", "--out", program.to_str().unwrap()]);
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    let pool = dir.path().join("some.pool");
    std::fs::copy(folder.join("scenes.pool"), &pool).unwrap();
    let weights = dir.path().join("weights.safetensors");
    std::fs::write(&weights, [&40u64.to_le_bytes()[..], &[b' '; 60]].concat()).unwrap();
    let cassette = dir.path().join("some.jsonl");
    std::fs::copy(folder.join("cassette.jsonl"), &cassette).unwrap();
    let out = dir.path().join("runs");
    let text = |path: &Path| path.to_str().unwrap().to_string();
    let scenes = text(&folder.join("scenes.pool"));
    let cases: [(&Path, Vec<String>); 4] = [
        (&program, vec!["apply".into(), text(&program), "--scenes".into(), scenes]),
        (&pool, vec!["scenes".into(), "list".into(), text(&pool)]),
        (
            &weights,
            ["egos", "experiments/quickstart.toml", "--policy"]
                .map(String::from)
                .into_iter()
                .chain([text(&weights)])
                .collect(),
        ),
        (
            &cassette,
            ["run", "experiments/quickstart.toml", "--cassette"]
                .map(String::from)
                .into_iter()
                .chain([text(&cassette), "--out".into(), text(&out)])
                .collect(),
        ),
    ];
    let mut wrong = Vec::new();
    for (path, command) in &cases {
        let whole = std::fs::read(path).unwrap();
        for damage in ALL {
            inflict(path, damage);
            let args: Vec<&str> = command.iter().map(String::as_str).collect();
            let ran = run(&args);
            let said = format!("{}{}", ran.stdout, ran.stderr);
            let name = path.file_name().unwrap().to_str().unwrap();
            if ![2, 5].contains(&ran.code) || !said.contains(name) || said.contains("panicked") {
                wrong.push(format!(
                    "{name} {damage:?}: exit {}: {}",
                    ran.code,
                    said.chars().take(300).collect::<String>()
                ));
            }
            let _ = std::fs::remove_dir(path);
            std::fs::write(path, &whole).unwrap();
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[cfg(unix)]
#[test]
fn what_may_not_be_read_is_said_so() {
    use std::os::unix::fs::PermissionsExt;
    let dir = tempfile::tempdir().unwrap();
    let folder = copied(dir.path());
    let path = folder.join("transcript.jsonl");
    std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o000)).unwrap();
    if std::fs::read(&path).is_ok() {
        return skip("whoever runs this may read every file");
    }
    for command in ["fsck", "check", "report"] {
        let ran = run(&[command, folder.to_str().unwrap()]);
        assert_eq!(ran.code, 2, "{command}: {}", ran.stderr);
        assert!(ran.stderr.contains("transcript.jsonl") && ran.stderr.contains("permissions"), "{}", ran.stderr);
    }
}

#[test]
fn names_inside_a_file_lead_nowhere_else() {
    let dir = tempfile::tempdir().unwrap();
    let (source, out) = (dir.path().join("in"), dir.path().join("inside").join("out"));
    std::fs::create_dir_all(&source).unwrap();
    std::fs::create_dir_all(&out).unwrap();
    let scene =
        std::fs::read_to_string(crate::harness::home().join("tests/fixtures/commonroad/two_lanes_2018b.xml")).unwrap();
    let start = scene.find("benchmarkID=\"").expect("an id") + "benchmarkID=\"".len();
    let end = start + scene[start..].find('"').unwrap();
    let escaping = format!("{}../../../escaped{}", &scene[..start], &scene[end..]);
    std::fs::write(source.join("escape.xml"), escaping).unwrap();
    let pool = dir.path().join("p.pool");
    let ran = run(&["scenes", "import", source.to_str().unwrap(), "--out", pool.to_str().unwrap()]);
    assert!([0, 2].contains(&ran.code), "{}", ran.stderr);
    for format in ["scenarionet", "commonroad", "openscenario", "openscenario-1.0"] {
        let place = out.join(format);
        run(&["scenes", "export", pool.to_str().unwrap(), "--format", format, "--out", place.to_str().unwrap()]);
    }
    let mut top: Vec<String> =
        std::fs::read_dir(dir.path()).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    top.sort();
    assert!(top.iter().all(|name| ["in", "inside", "p.pool"].contains(&name.as_str())), "{top:?}");
    let inside: Vec<_> =
        std::fs::read_dir(dir.path().join("inside")).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert_eq!(inside, ["out"]);
}
