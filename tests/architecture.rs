//! Keeps docs/ARCHITECTURE.md true: which room may import which, which files need each other, and where effects live.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

#[path = "architecture/circles.rs"]
mod circles;
#[path = "architecture/pages.rs"]
mod pages;

/// Room -> rooms it may import. A row names only rooms that stand above it, so there can be no circles.
const TABLE: &[(&str, &str)] = &[
    ("kernel", ""),
    ("text", ""),
    ("store", "kernel"),
    ("scene", "kernel"),
    ("synth", "kernel scene"),
    ("draw", "kernel scene"),
    ("sim", "kernel scene"),
    ("formats", "kernel scene sim"),
    ("ego", "kernel scene sim"),
    ("learn", "kernel sim ego"),
    ("backend", "kernel store scene sim ego"),
    ("objects", "kernel text scene"),
    ("statistics", "kernel objects"),
    ("llm", "kernel store"),
    ("live", "kernel store llm"),
    ("scripted", "kernel text llm"),
    ("adapters", "kernel text objects"),
    ("motion", "kernel scene sim"),
    ("stage", "kernel scene sim ego objects adapters motion"),
    ("search", "kernel scene stage motion"),
    ("families", "kernel scene sim ego objects adapters motion stage search synth"),
    ("compiler", "kernel scene sim objects adapters motion stage"),
    ("agents", "kernel objects adapters llm"),
    ("candidates", "kernel text objects adapters"),
    ("world", "kernel statistics scene objects"),
    ("evaluation", "kernel scene sim ego backend objects adapters"),
    ("archive", "kernel objects"),
    ("lineage", "kernel objects"),
    ("memory", "kernel objects"),
    (
        "epoch",
        "kernel store scene sim ego backend objects llm adapters stage compiler agents candidates world evaluation archive lineage memory",
    ),
    (
        "experiment",
        "kernel text store scene formats synth sim ego learn backend objects llm adapters stage families agents world evaluation archive memory epoch",
    ),
    ("evidence", "kernel text statistics store scene draw sim objects evaluation archive lineage world"),
    ("shard", "kernel store sim backend objects adapters evaluation epoch"),
    ("bundle", "kernel store"),
    ("suite", "kernel statistics scene draw sim objects"),
    ("cli", "*"),
];

/// Crate -> its rooms. The compiler holds the walls between crates, this test those inside one.
const CRATES: &[(&str, &str)] = &[
    ("core", "kernel text statistics store scene synth objects"),
    ("sim", "sim ego learn backend"),
    ("lang", "adapters candidates"),
    ("generators", "motion stage search families compiler"),
    ("formats", "formats draw"),
    ("models", "llm agents scripted"),
    ("stages", "archive lineage memory world"),
    ("packs", "suite bundle"),
    ("labels", "evaluation"),
    ("evolve", "epoch experiment shard"),
    ("lab", "evidence"),
];

/// Effect -> the words that betray it, and the places where it may live.
const EFFECTS: &[(&str, &[&str], &[&str])] = &[
    ("disk", &["std::fs", "fs::File", "OpenOptions", "rusqlite"], &["store/"]),
    ("removal of folders", &["remove_dir"], &["store/own.rs"]),
    ("network", &["std::net", "TcpStream", "ureq::"], &["live/"]),
    ("threads", &["thread::spawn", "thread::scope", "thread::Builder", "rayon"], &["kernel/threads.rs"]),
    ("randomness", &["rand_chacha", "rand_core", "from_entropy", "getrandom"], &["kernel/rng.rs"]),
    ("clock", &["Instant::now", "SystemTime", "thread::sleep"], &["cli/"]),
    ("processes", &["Stdio", "process::Command", "ChildStdin"], &["cli/cluster/worker_process.rs"]),
    ("signals", &["signal_hook"], &["cli/terminal/interrupt.rs"]),
    ("environment", &["std::env", "env::var"], &["cli/"]),
    ("terminal", &["println!", "print!(", "stdin()", "stdout()", "stderr()"], &["cli/", "main.rs"]),
];

/// Every source file: its path below `src`, which begins with its crate, and its text.
fn sources() -> Vec<(String, String)> {
    fn walk(dir: &Path, found: &mut Vec<PathBuf>) {
        for entry in std::fs::read_dir(dir).expect("src can be listed") {
            let path = entry.expect("an entry of src").path();
            if path.is_dir() {
                walk(&path, found);
            } else if path.extension().is_some_and(|e| e == "rs") {
                found.push(path);
            }
        }
    }
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut found = Vec::new();
    walk(&root, &mut found);
    found.sort();
    let name = |path: &Path| path.strip_prefix(&root).expect("below src").to_string_lossy().replace('\\', "/");
    found.iter().map(|path| (name(path), std::fs::read_to_string(path).expect("a source file"))).collect()
}

/// Path below its crate (`sim/rollouts/episode.rs`) and text of what is no test.
fn source_files() -> Vec<(String, String)> {
    let sources = sources();
    let test_only: BTreeSet<PathBuf> =
        sources.iter().flat_map(|(path, text)| test_modules(Path::new(path), text)).collect();
    let is_test = |path: &Path| test_only.iter().any(|test| path == test || path.starts_with(test.with_extension("")));
    let kept = sources.iter().filter(|(path, _)| !is_test(Path::new(path)));
    kept.map(|(path, text)| {
        let (_, below) = path.split_once('/').expect("a file of a crate");
        (below.to_string(), without_tests_and_comments(text))
    })
    .collect()
}

/// Marks of an item that no user's build contains: tests, and what the engine shows to tests of the crate above it.
const FOR_TESTS: [&str; 2] = ["#[cfg(test)]", "#[cfg(any(test, feature = \"fixtures\"))]"];

/// Files that exist for tests only: they may import what they test against.
fn test_modules(path: &Path, text: &str) -> Vec<PathBuf> {
    let stem = path.file_stem().unwrap_or_default();
    let home = path.parent().expect("a file of src");
    let home = if stem == "mod" || stem == "lib" { home.to_path_buf() } else { home.join(stem) };
    let lines: Vec<&str> = text.lines().collect();
    let named = |line: &str| Some(line.strip_suffix(';')?.rsplit_once("mod ")?.1.to_string());
    let pairs = lines.windows(2).filter(|pair| FOR_TESTS.contains(&pair[0]));
    pairs.filter_map(|pair| named(pair[1])).map(|name| home.join(format!("{name}.rs"))).collect()
}

/// Drops comments and everything from such a mark on a module to its closing brace at the margin.
fn without_tests_and_comments(text: &str) -> String {
    let mut kept = String::new();
    let mut lines = text.lines().peekable();
    while let Some(line) = lines.next() {
        if FOR_TESTS.contains(&line) {
            // The item under the attribute: up to a line that ends it at the margin.
            for inside in lines.by_ref() {
                if inside == "}" || (!inside.starts_with([' ', '#', '}']) && inside.ends_with(';')) {
                    break;
                }
            }
            continue;
        }
        kept.push_str(line.split("//").next().unwrap_or(""));
        kept.push('\n');
    }
    kept
}

/// Rooms named after `crate::`, also inside `use crate::{...}`.
fn imports(text: &str) -> BTreeSet<String> {
    let mut rooms = BTreeSet::new();
    let word = |text: &str| text.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect::<String>();
    for (at, _) in text.match_indices("crate::") {
        let before = text[..at].chars().next_back();
        if before.is_some_and(|c| c.is_alphanumeric() || c == '_') {
            continue;
        }
        let rest = text[at + 7..].trim_start();
        if let Some(group) = rest.strip_prefix('{') {
            let (mut depth, mut at_start) = (1, true);
            for (i, c) in group.char_indices() {
                match c {
                    '{' => depth += 1,
                    '}' => depth -= 1,
                    ',' if depth == 1 => at_start = true,
                    c if c.is_alphabetic() && depth == 1 && at_start => {
                        rooms.insert(word(&group[i..]));
                        at_start = false;
                    }
                    _ => {}
                }
                if depth == 0 {
                    break;
                }
            }
        } else {
            rooms.insert(word(rest));
        }
    }
    rooms
}

#[test]
fn rooms_import_only_what_stands_in_their_row() {
    let table: BTreeMap<&str, BTreeSet<&str>> =
        TABLE.iter().map(|(room, may)| (*room, may.split_whitespace().collect())).collect();
    let mut broken = Vec::new();
    for (file, text) in source_files() {
        let Some((room, _)) = file.split_once('/') else { continue };
        let may = table.get(room).unwrap_or_else(|| panic!("{file}: room {room} is not in the table"));
        for import in imports(&text) {
            let allowed = import == room || may.contains("*") || may.contains(import.as_str());
            // `crate::some_macro!` and the like are not rooms.
            if table.contains_key(import.as_str()) && !allowed {
                broken.push(format!("{file} imports {import}"));
            }
        }
    }
    assert!(broken.is_empty(), "forbidden imports:\n{}", broken.join("\n"));
}

#[test]
fn no_room_may_import_what_it_does_not_use() {
    let mut used: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for (file, text) in source_files() {
        let Some((room, _)) = file.split_once('/') else { continue };
        used.entry(room.to_string()).or_default().extend(imports(&text));
    }
    let idle = |(room, may): &(&str, &str)| -> Vec<String> {
        let used = used.get(*room).unwrap_or_else(|| panic!("there is no room {room}"));
        let words = may.split_whitespace().filter(|word| *word != "*" && !used.contains(*word));
        words.map(|word| format!("{room} may import {word} and does not")).collect()
    };
    let idle: Vec<String> = TABLE.iter().flat_map(idle).collect();
    assert!(idle.is_empty(), "allowances that nobody uses:\n{}", idle.join("\n"));
}

/// Crates that a crate names in its manifest, its own name among them.
fn crates_of(name: &str) -> BTreeSet<String> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("src").join(name).join("Cargo.toml");
    let manifest: toml::Table = std::fs::read_to_string(path).expect("a manifest").parse().expect("TOML");
    let named = manifest["dependencies"].as_table().expect("dependencies").keys();
    named.filter_map(|name| name.strip_prefix("evodrive-")).map(str::to_string).chain([name.to_string()]).collect()
}

#[test]
fn of_the_walls_between_rooms_the_compiler_holds_two_thirds() {
    let home: BTreeMap<&str, &str> =
        CRATES.iter().flat_map(|(name, rooms)| rooms.split_whitespace().map(|room| (room, *name))).collect();
    let folders: BTreeSet<(String, String)> = sources()
        .iter()
        .filter_map(|(path, _)| Some((path.split('/').next()?.to_string(), path.split('/').nth(1)?.to_string())))
        .filter(|(name, room)| name != "evodrive" && !room.ends_with(".rs"))
        .collect();
    let listed = home.iter().map(|(room, name)| (name.to_string(), room.to_string())).collect();
    assert_eq!(folders, listed, "rooms in the folders of their crates");
    let reached: BTreeMap<&str, BTreeSet<String>> = CRATES.iter().map(|(name, _)| (*name, crates_of(name))).collect();
    let (mut forbidden, mut held) = (0, 0);
    for (room, may) in TABLE.iter().filter(|(room, _)| home.contains_key(room)) {
        for (other, _) in TABLE.iter().filter(|(other, _)| other != room && home.contains_key(other)) {
            if !may.split_whitespace().any(|name| name == *other) {
                forbidden += 1;
                held += u32::from(!reached[home[room]].contains(home[other]));
            }
        }
    }
    assert!(held * 3 >= forbidden * 2, "{held} of {forbidden} walls are held by crates");
}

#[test]
fn no_two_files_of_a_room_need_each_other_but_those_on_the_list() {
    circles::check(&source_files());
}

#[test]
fn the_table_itself_has_no_circle() {
    let order: Vec<&str> = TABLE.iter().map(|(room, _)| *room).collect();
    for (place, (room, may)) in TABLE.iter().enumerate() {
        for import in may.split_whitespace().filter(|m| *m != "*") {
            let above = order.iter().position(|r| *r == import).unwrap_or_else(|| panic!("{import} is no room"));
            assert!(above < place, "{room} may import {import}, which stands below it");
        }
    }
}

#[test]
fn effects_stay_at_their_addresses() {
    let mut strayed = Vec::new();
    for (file, text) in source_files() {
        for (effect, words, homes) in EFFECTS {
            let at_home = homes.iter().any(|home| file.starts_with(home));
            for word in words.iter().filter(|_| !at_home) {
                if text.contains(word) {
                    strayed.push(format!("{file}: {word} ({effect} lives in {})", homes.join(", ")));
                }
            }
        }
    }
    assert!(strayed.is_empty(), "effects out of place:\n{}", strayed.join("\n"));
}

/// Scripts and Python remove no folder but a shell's own scratch folder, made in the same file; what users install removes none.
#[test]
fn scripts_remove_no_folder_but_their_own_scratch() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut strayed = Vec::new();
    let mut open = vec![root.join("bridges"), root.join(".ci")];
    while let Some(path) = open.pop() {
        let name = path.strip_prefix(root).expect("below").to_string_lossy().into_owned();
        if path.is_dir() {
            // What tests and builds leave there is no source.
            if !["target", "__pycache__", ".venv", "node_modules"].iter().any(|left| name.ends_with(left)) {
                open.extend(std::fs::read_dir(&path).expect("a folder").map(|entry| entry.expect("an entry").path()));
            }
            continue;
        }
        let Ok(text) = std::fs::read_to_string(&path) else { continue };
        strayed.extend(
            text.lines()
                .filter(|line| removes_another_folder(&name, line, &text))
                .map(|line| format!("{name}: {line}")),
        );
    }
    assert!(strayed.is_empty(), "folders are removed that the script did not make:\n{}", strayed.join("\n"));
    for (line, text, is_another) in [
        ("rm -rf \"$out\"", "out=$1", true),
        ("rm -r $HOME/x", "", true),
        ("trap 'rm -rf \"$scratch\"' EXIT", "scratch=$(mktemp -d)", false),
    ] {
        assert_eq!(removes_another_folder(".ci/x", line, text), is_another, "{line}");
    }
    assert!(removes_another_folder("bridges/x/evodrive_x/y.py", "shutil.rmtree(folder)", ""));
}

fn removes_another_folder(file: &str, line: &str, text: &str) -> bool {
    let python = ["rmtree", "removedirs"].iter().any(|word| line.contains(word));
    // Trials in .ci remove what they made in a temporary folder.
    let shipped = file.starts_with("bridges/") && !file.contains("/tests/");
    let Some((_, removed)) = ["rm -rf ", "rm -r ", "rm -fr "].iter().find_map(|word| line.split_once(word)) else {
        return shipped && python;
    };
    let variable: String =
        removed.chars().skip_while(|c| !c.is_alphabetic()).take_while(|c| c.is_alphanumeric() || *c == '_').collect();
    !text.contains(&format!("{variable}=$(mktemp -d"))
}

/// Names of the crates that `roots` bring into a build, by Cargo.lock. Development crates count too: none of them speaks HTTP.
fn locked_below(roots: &BTreeSet<String>) -> BTreeSet<String> {
    let text = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("Cargo.lock")).expect("Cargo.lock");
    let lock: toml::Table = text.parse().expect("Cargo.lock is TOML");
    let mut needs: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for package in lock["package"].as_array().expect("packages") {
        let name = package["name"].as_str().expect("a name").to_string();
        let words = package.get("dependencies").and_then(|list| list.as_array()).into_iter().flatten();
        let names = words.filter_map(|word| word.as_str()?.split(' ').next().map(str::to_string));
        needs.entry(name).or_default().extend(names);
    }
    let mut found = BTreeSet::new();
    let mut open: Vec<String> = roots.iter().cloned().collect();
    while let Some(name) = open.pop() {
        if found.insert(name.clone()) {
            open.extend(needs.get(&name).into_iter().flatten().cloned());
        }
    }
    found
}

#[test]
fn only_the_feature_live_brings_network_code_into_a_build() {
    let manifest = |place: &str| -> toml::Table {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(place).join("Cargo.toml");
        std::fs::read_to_string(path).expect("Cargo.toml").parse().expect("Cargo.toml is TOML")
    };
    let root = manifest("");
    assert_eq!(root["features"]["default"].as_array().map(Vec::len), Some(0), "no feature is on by default");
    let optional = |value: &toml::Value| value.get("optional").and_then(toml::Value::as_bool) == Some(true);
    // Cargo.lock does not say what is optional, so the crates of this workspace are asked themselves.
    let members = root["workspace"]["members"].as_array().expect("members").iter();
    let manifests = members.map(|member| manifest(member.as_str().expect("a folder"))).chain([root.clone()]);
    let always: BTreeSet<String> = manifests
        // The unit tests' crate has none but those of tests.
        .filter_map(|manifest| Some(manifest.get("dependencies")?.as_table().expect("dependencies").clone()))
        .flatten()
        .filter(|(name, value)| !optional(value) && !name.starts_with("evodrive"))
        .map(|(name, _)| name)
        .collect();
    let network = ["ureq", "ureq-proto", "rustls", "ring", "webpki-roots", "reqwest", "hyper", "tokio", "native-tls"];
    let here = locked_below(&always);
    let strayed: Vec<&str> = network.into_iter().filter(|name| here.contains(*name)).collect();
    assert!(strayed.is_empty(), "the default build would contain {}", strayed.join(", "));
    let live = locked_below(&BTreeSet::from(["ureq".to_string()]));
    assert!(live.contains("rustls") && !live.contains("tokio"), "the client is blocking, with rustls");
}

#[test]
fn every_file_opens_with_what_it_is() {
    for (file, text) in sources().iter().filter(|(file, _)| !file.ends_with("tests.rs")) {
        assert!(text.starts_with("//!"), "{file} does not open with a //! sentence");
    }
}

/// Words that once stood for a recorded run, a reported rollout and the result of anything. Their noun says more.
const PRIVATE: [&str; 6] = ["told", "untold", "retold", "story", "stories", "let mut found"];

#[test]
fn no_identifier_is_a_private_word() {
    let private: Vec<String> = source_files()
        .iter()
        .filter(|(file, _)| !file.contains("openscenario"))
        .flat_map(|(file, text)| private_words(file, text))
        .collect();
    assert!(private.is_empty(), "name it as CONTRIBUTING.md says under Names\n{private:#?}");
    let here = |text: &str| private_words("room/file.rs", text).len();
    assert_eq!((here("let told = 1;"), here("f(\"what was told\", toldest)"), here("{ story.root }")), (1, 0, 1));
}

fn private_words(file: &str, text: &str) -> Vec<String> {
    let letter = |c: char| c.is_alphanumeric() || c == '_';
    let mut at = Vec::new();
    for (number, line) in text.lines().enumerate() {
        // What stands between quotation marks is text for people.
        let code: String = line.split('"').step_by(2).collect::<Vec<_>>().join("\"");
        for word in PRIVATE {
            let whole = code
                .match_indices(word)
                .any(|(from, _)| !code[..from].ends_with(letter) && !code[from + word.len()..].starts_with(letter));
            if whole {
                at.push(format!("{file}:{}: {word}", number + 1));
            }
        }
    }
    at
}
