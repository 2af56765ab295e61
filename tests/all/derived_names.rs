//! A name that a command derives may belong to a file or folder of the user's: that stays, and the command takes another name or says why
//! it cannot.

use std::path::Path;

use crate::backends::experiment;
use crate::harness::{Ran, copy_dir, evodrive, files, folder_below, run};

const THEIRS: &str = "weeks of work";

fn theirs(path: &Path) {
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    std::fs::write(path, THEIRS).unwrap();
}

fn is_theirs(path: &Path) -> bool {
    std::fs::read_to_string(path).is_ok_and(|text| text == THEIRS)
}

/// Names in a folder, hidden ones too.
fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).unwrap();
    let mut names: Vec<String> =
        entries.map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

#[test]
fn what_lies_under_the_names_of_a_run_stays() {
    let dir = tempfile::tempdir().unwrap();
    let (path, out) = (experiment(dir.path(), "mine", ""), dir.path().join("runs"));
    let call = |command: &str, more: &[&str]| {
        let words = [command, path.to_str().unwrap(), "--out", out.to_str().unwrap()];
        let report: &[&str] = if command == "plan" { &[] } else { &["--no-report"] };
        run(&[&words[..], report, more].concat())
    };
    theirs(&out.join("LATEST"));
    let recorded = call("record", &[]);
    recorded.root();
    assert!(
        is_theirs(&out.join("LATEST")) && recorded.stderr.contains("LATEST: it names no run"),
        "{}",
        recorded.stderr
    );
    std::fs::remove_file(out.join("LATEST")).unwrap();
    call("run", &[]).root();
    assert!(std::fs::read_to_string(out.join("LATEST")).unwrap().starts_with("mine-"));
    call("run", &[]).root();
    let folder = folder_below(&out);
    let whole = names(&folder);
    assert!(!whole.iter().any(|name| name.starts_with('.')), "{whole:?}: a run folder is the user's when it is made");
    // Files of theirs inside it that a command once used as its own.
    for name in ["plan.jsonl", "shards/walk.jsonl", ".plan-1-0/log", "transcript.before.jsonl"] {
        theirs(&folder.join(name));
    }
    assert_eq!(call("plan", &[]).code, 0);
    assert_eq!(run(&["shard", "plan", folder.to_str().unwrap()]).code, 0);
    let refused = call("record", &["--fresh"]);
    assert_eq!(refused.code, 2, "{}", refused.stderr);
    assert!(refused.stderr.contains("transcript.before.jsonl: expected no file, or a finished"), "{}", refused.stderr);
    for name in ["plan.jsonl", "shards/walk.jsonl", ".plan-1-0/log", "transcript.before.jsonl"] {
        assert!(is_theirs(&folder.join(name)), "{name}");
    }
    std::fs::remove_file(folder.join("transcript.before.jsonl")).unwrap();
    call("record", &["--fresh"]).root();
    // A folder of theirs with the name that the run's would have.
    let kept = dir.path().join("kept");
    copy_dir(&folder, &kept);
    std::fs::rename(&folder, dir.path().join("elsewhere")).unwrap();
    theirs(&folder.join("cassette.jsonl"));
    theirs(&folder.join("deep/log"));
    for command in ["run", "record", "plan"] {
        let refused = call(command, &[]);
        assert_eq!(refused.code, 2, "{command}: {}", refused.stderr);
        assert!(refused.stderr.contains("found something that no run has made"), "{command}: {}", refused.stderr);
        assert_eq!(names(&folder), ["cassette.jsonl", "deep"]);
        assert!(is_theirs(&folder.join("cassette.jsonl")) && is_theirs(&folder.join("deep/log")));
    }
    // One in which a command was killed that had made it bears a mark, and is gone on with.
    std::fs::remove_dir_all(&folder).unwrap();
    std::fs::create_dir(&folder).unwrap();
    std::fs::write(folder.join(".evodrive-own"), "evodrive-folder/1 run\n").unwrap();
    call("run", &[]).root();
}

#[test]
fn a_shards_worker_goes_on_in_its_own_folder_alone() {
    let dir = tempfile::tempdir().unwrap();
    let (path, out) = (experiment(dir.path(), "mine", ""), dir.path().join("runs"));
    let words = ["record", path.to_str().unwrap(), "--no-report", "--out"];
    run(&[&words[..], &[dir.path().join("first").to_str().unwrap()]].concat()).root();
    let planned = run(&["shard", "plan", path.to_str().unwrap(), "--out", out.to_str().unwrap()]);
    assert_eq!(planned.code, 0, "{}", planned.stderr);
    let shards = folder_below(&out).join("shards");
    let shard = shards.join(&files(&shards, ".shard")[0].0);
    let scratch = shards.join(format!(".{}.work", &shard.file_stem().unwrap().to_string_lossy()[..16]));
    theirs(&scratch.join("log"));
    let work = || Ran::of(evodrive().args(["shard", "work"]).arg(&shard));
    let refused = work();
    assert!(refused.code == 2 && refused.stderr.contains("without this program's mark"), "{}", refused.stderr);
    assert!(is_theirs(&scratch.join("log")));
    std::fs::rename(&scratch, dir.path().join("aside")).unwrap();
    assert_eq!(work().code, 0);
    assert!(!scratch.exists());
    let refused = run(&["bench", "ledger", "--scratch", dir.path().join("aside").to_str().unwrap(), "--objects", "1"]);
    assert!(refused.code == 2 && is_theirs(&dir.path().join("aside/log")), "{}", refused.stderr);
}

#[cfg(unix)]
#[test]
fn a_draft_of_theirs_is_not_edited_nor_removed() {
    use std::os::unix::fs::PermissionsExt;
    let dir = tempfile::tempdir().unwrap();
    let here =
        |args: &[&str]| Ran::of(evodrive().current_dir(dir.path()).env("VISUAL", dir.path().join("editor")).args(args));
    assert_eq!(here(&["program", "new", "--family", "cat", "--out", "my.toml"]).code, 0);
    let editor = dir.path().join("editor");
    std::fs::write(&editor, "#!/bin/sh\ntouch opened\n").unwrap();
    std::fs::set_permissions(&editor, PermissionsExt::from_mode(0o755)).unwrap();
    let draft = dir.path().join("my.toml.edit.toml");
    theirs(&draft);
    let refused = here(&["program", "edit", "my.toml"]);
    assert!(refused.code == 2 && refused.stderr.contains("my.toml.edit.toml: expected"), "{}", refused.stderr);
    assert!(is_theirs(&draft) && !dir.path().join("opened").exists());
    std::fs::remove_file(&draft).unwrap();
    assert_eq!(here(&["program", "edit", "my.toml"]).code, 0);
    assert!(!draft.exists() && dir.path().join("opened").exists());
}
