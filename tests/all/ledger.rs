//! Coverage of a run folder's seal: each loss and each change of a file is found, named, and never taken for a finished run.

use std::path::{Path, PathBuf};

use crate::harness::{evodrive, run};
use crate::short::{copied, finished};

/// A copy of the finished run in which one file was changed.
fn changed(file: &str, change: impl Fn(String) -> String) -> (tempfile::TempDir, PathBuf) {
    let dir = tempfile::tempdir().unwrap();
    let folder = copied(dir.path());
    let path = folder.join(file);
    std::fs::write(&path, change(std::fs::read_to_string(&path).unwrap())).unwrap();
    (dir, folder)
}

fn without_last_line(text: &str) -> String {
    let end = text.trim_end().rfind('\n').map_or(0, |at| at + 1);
    text[..end].to_string()
}

fn code_and_words(command: &[&str], folder: &Path) -> (i32, String) {
    let ran = run(&[command, &[folder.to_str().unwrap()]].concat());
    (ran.code, format!("{}{}", ran.stdout, ran.stderr))
}

#[test]
fn what_is_not_finished_is_compared_with_nothing() {
    let gone = |folder: &Path| std::fs::remove_file(folder.join("transcript.jsonl")).unwrap();
    for (text, what) in
        [(None, "found none"), (Some(0), "0 events"), (Some(20), "20 events"), (Some(usize::MAX), "events")]
    {
        let keep = |whole: String| match text {
            Some(usize::MAX) => without_last_line(&whole),
            lines => whole.lines().take(lines.unwrap_or(0)).map(|line| format!("{line}\n")).collect(),
        };
        let (_dir, folder) = changed("transcript.jsonl", keep);
        if text.is_none() {
            gone(&folder);
        }
        for command in ["check", "verify"] {
            let (code, words) = code_and_words(&[command], &folder);
            assert_eq!(code, 5, "{command}, {text:?}: {words}");
            assert!(words.contains("nothing was compared") && words.contains(what), "{command}, {text:?}: {words}");
        }
        if text.is_some_and(|lines| lines > 0) {
            let (code, words) = code_and_words(&["fsck"], &folder);
            assert_eq!(code, 5, "{text:?}: {words}");
            assert!(words.contains("expected the events of a finished run to end with a seal"), "{text:?}: {words}");
            // Without its result it is a run that was interrupted, which is no damage.
            std::fs::remove_file(folder.join("result.json")).unwrap();
            let (code, words) = code_and_words(&["fsck"], &folder);
            assert_eq!(code, 0, "{text:?}: {words}");
            assert!(words.contains("a run that is not finished"), "{words}");
        }
    }
}

#[test]
fn a_file_that_the_seal_covers_is_found_when_it_was_changed_or_lost() {
    let one_digit = |text: String| {
        let at = text.find("\"attack\": 0").expect("an attack") + "\"attack\": ".len();
        format!("{}1{}", &text[..at], &text[at + 1..])
    };
    let shorter = |text: String| without_last_line(&text);
    type Change<'a> = &'a dyn Fn(String) -> String;
    let cases: [(&str, Change<'_>, &str); 4] = [
        ("result.json", &one_digit, "as it was sealed"),
        ("result.json", &|_| "{".into(), "no JSON"),
        ("cassette.jsonl", &shorter, "cassette.jsonl"),
        ("experiment.toml", &|text| text.replacen("seed = ", "seed = 1", 1), "as the run's first event has it"),
    ];
    for (file, change, word) in cases {
        let (_dir, folder) = changed(file, change);
        let (code, words) = code_and_words(&["fsck", "--read"], &folder);
        assert_eq!(code, 5, "{file}: {words}");
        assert!(words.contains(word), "{file}: {words}");
    }
    let (_dir, folder) = changed("result.json", one_digit);
    let (code, words) = code_and_words(&["check"], &folder);
    assert!(code == 4 && words.contains("result.json"), "{code}: {words}");
    assert_eq!(code_and_words(&["resume"], &folder).0, 0);
    let (code, words) = code_and_words(&["fsck", "--read"], &folder);
    assert_eq!(code, 0, "written anew: {words}");
    for word in [
        "as the events say: experiment.toml, scenes.pool, cassette.jsonl, result.json",
        "not covered by the seal: run.json",
    ] {
        assert!(words.contains(word), "{words}");
    }
}

#[test]
fn a_folder_of_a_newer_format_is_refused() {
    let (_dir, folder) = changed("run.json", |text| text.replace("evodrive-run/1", "evodrive-run/2"));
    for command in ["check", "fsck", "report"] {
        let (code, words) = code_and_words(&[command], &folder);
        assert!(code == 2 && words.contains("expected evodrive-run/1, found evodrive-run/2"), "{command}: {words}");
    }
}

#[test]
fn a_finished_run_keeps_its_files_when_another_cassette_is_tried() {
    let dir = tempfile::tempdir().unwrap();
    let folder = copied(dir.path());
    let before = std::fs::read(folder.join("cassette.jsonl")).unwrap();
    let other = dir.path().join("other.jsonl");
    std::fs::write(&other, without_last_line(&String::from_utf8(before.clone()).unwrap())).unwrap();
    let out = dir.path().to_str().unwrap();
    let experiment = finished().experiment.to_str().unwrap();
    let ran = run(&["run", experiment, "--cassette", other.to_str().unwrap(), "--out", out]);
    assert_ne!(ran.code, 0, "{}", ran.stderr);
    assert_eq!(std::fs::read(folder.join("cassette.jsonl")).unwrap(), before);
    let (code, words) = code_and_words(&["fsck", "--read"], &folder);
    assert_eq!(code, 0, "{words}");
}

#[test]
fn a_recording_that_cannot_begin_leaves_the_finished_run_finished() {
    let dir = tempfile::tempdir().unwrap();
    let folder = copied(dir.path());
    let damaged = dir.path().join("damaged.jsonl");
    std::fs::write(&damaged, "no cassette\n").unwrap();
    let (out, cassette) = (dir.path().to_str().unwrap(), damaged.to_str().unwrap());
    let ran = run(&["record", finished().experiment.to_str().unwrap(), "--cassette", cassette, "--out", out]);
    assert_eq!(ran.code, 5, "{}", ran.stderr);
    let (code, words) = code_and_words(&["fsck", "--read"], &folder);
    assert!(code == 0 && !words.contains("recording"), "{words}");
}

#[test]
fn an_answer_that_cannot_be_written_is_no_success() {
    let dir = tempfile::tempdir().unwrap();
    let folder = copied(dir.path());
    let Ok(full) = std::fs::OpenOptions::new().write(true).open("/dev/full") else {
        return crate::harness::skip("no /dev/full");
    };
    let printed = evodrive().args(["fsck", folder.to_str().unwrap()]).stdout(full).output().unwrap();
    let words = String::from_utf8_lossy(&printed.stderr);
    assert_eq!(printed.status.code(), Some(2), "{words}");
    assert!(words.contains("standard output") && words.contains("make room"), "{words}");
}

#[test]
fn what_a_file_says_does_not_reach_the_terminal_as_commands() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("bad.toml");
    std::fs::write(&path, "name = \"\u{1b}]0;title\u{7}\"\nseed = \"\\u001b[2J\"\n").unwrap();
    let ran = run(&["run", path.to_str().unwrap()]);
    assert_eq!(ran.code, 2, "{}", ran.stderr);
    let acts = |c: char| c.is_control() && !matches!(c, '\n' | '\t');
    assert!(!ran.stderr.contains(acts) && !ran.stdout.contains(acts), "{:?}", ran.stderr);
}

#[test]
fn one_more_line_feed_in_the_result_means_nothing_to_any_command() {
    let (dir, folder) = changed("result.json", |text| format!("{text}\n"));
    let bundle = dir.path().join("run.evodrive");
    let out = ["--out", bundle.to_str().unwrap(), "--run"];
    let commands: [&[&str]; 6] = [
        &["fsck", "--read"],
        &["check"],
        &["verify"],
        &["report"],
        &["bundle", "create", out[0], out[1], out[2]],
        &["resume"],
    ];
    for command in commands {
        let (code, words) = code_and_words(command, &folder);
        assert_eq!(code, 0, "{command:?}: {words}");
    }
}

/// Writes a run's pool anew with other words about its scenes, as somebody would do to hide the change.
fn retold(folder: &Path, change: impl Fn(&mut evodrive::scene::Pool)) {
    let path = folder.join("scenes.pool");
    let mut pool = evodrive::scene::pool::decode("scenes.pool", &std::fs::read(&path).unwrap()).unwrap();
    change(&mut pool);
    std::fs::write(&path, evodrive::scene::pool::encode(&pool)).unwrap();
}

/// Checks that `fsck --read`, `check`, `verify` and `bundle create` all refuse a folder that was changed.
fn refused_by_all(folder: &Path, word: &str) {
    let bundle = folder.with_extension("evodrive");
    let out = ["--out", bundle.to_str().unwrap(), "--run"];
    let commands: [&[&str]; 4] =
        [&["fsck", "--read"], &["check"], &["verify"], &["bundle", "create", out[0], out[1], out[2]]];
    for (place, command) in commands.into_iter().enumerate() {
        let (code, words) = code_and_words(command, folder);
        assert!(matches!(code, 4 | 5), "{command:?}: {code} {words}");
        assert!([1, 2].contains(&place) || words.contains(word), "{command:?}: {words}");
    }
    assert!(!bundle.exists());
}

#[test]
fn where_generated_scenes_came_from_is_what_their_generator_says() {
    type Change = fn(&mut evodrive::scene::Pool);
    let renamed: Change = |pool| pool.scenes[3].origin.name = "somebody else".into();
    let left_out: Change = |pool| {
        let left = evodrive::scene::LeftOut { file: "x".into(), what: String::new(), reason: "it is bad".into() };
        pool.left_out.push(left);
    };
    let changes = [renamed, left_out];
    for change in changes {
        let dir = tempfile::tempdir().unwrap();
        let folder = copied(dir.path());
        retold(&folder, change);
        refused_by_all(&folder, "as the generator has it");
    }
}

#[test]
fn where_imported_scenes_came_from_is_sealed_and_files_of_other_names_are_the_same_run() {
    let dir = tempfile::tempdir().unwrap();
    let file = crate::backends::experiment(dir.path(), "imported", "");
    let here = |args: &[&str]| {
        let ran = crate::harness::Ran::of(evodrive().current_dir(dir.path()).args(args));
        assert_eq!(ran.code, 0, "{args:?}: {}", ran.stderr);
        ran
    };
    let name = file.file_name().unwrap().to_str().unwrap();
    here(&["scenes", "generate", name, "--out", "made.pool"]);
    here(&["scenes", "export", "made.pool", "--format", "commonroad", "--out", "files"]);
    here(&["scenes", "import", "files", "--out", "my.pool"]);
    let record = ["record", name, "--no-report", "--scenes", "my.pool"];
    let root = here(&record).root();
    let folder = crate::harness::folder_below(&dir.path().join("runs"));
    let opened = &crate::harness::events(&folder)[0]["body"];
    assert!(opened["provenance"].is_string(), "{opened}");
    // Files that were given other names hold the same scenes.
    let files: Vec<_> = std::fs::read_dir(dir.path().join("files")).unwrap().map(|file| file.unwrap().path()).collect();
    for path in files {
        let name = format!("renamed-{}", path.file_name().unwrap().to_str().unwrap());
        std::fs::rename(&path, path.with_file_name(name)).unwrap();
    }
    assert_eq!(here(&["run", name, "--no-report", "--scenes", "files"]).root(), root);
    here(&["fsck", "--read", folder.to_str().unwrap()]);
    retold(&folder, |pool| pool.scenes[0].origin.name = "somebody else".into());
    refused_by_all(&folder, "as the run's first event has it");
    retold(&folder, |pool| pool.seals_provenance = false);
    refused_by_all(&folder, "as the run's first event has it, found none");
}

#[test]
fn the_stores_pairs_of_request_and_record_are_those_that_the_events_seal() {
    use evodrive::store::{MemoKind, Store};
    let dir = tempfile::tempdir().unwrap();
    let folder = copied(dir.path());
    let (path, other) = (folder.join("store"), dir.path().join("other"));
    {
        let (store, swapped) = (Store::open(&path).unwrap(), Store::open(&other).unwrap());
        let mut pairs = store.recorded();
        let rollouts: Vec<usize> = (0..pairs.len()).filter(|i| pairs[*i].0 == MemoKind::Rollout).collect();
        let [one, two] = [rollouts[0], *rollouts.iter().find(|i| pairs[**i].2 != pairs[rollouts[0]].2).unwrap()];
        (pairs[one].2, pairs[two].2) = (pairs[two].2, pairs[one].2);
        for (kind, key, object) in pairs {
            swapped.put(&store.get(&object).unwrap()).unwrap();
            swapped.memo_put(kind, &key, &object).unwrap();
        }
    }
    std::fs::remove_dir_all(&path).unwrap();
    std::fs::rename(&other, &path).unwrap();
    let (code, words) = code_and_words(&["fsck"], &folder);
    assert!(code == 5 && words.contains("as the sealed events pair them"), "{code}: {words}");
}
