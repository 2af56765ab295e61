//! A disk that is full, or that may not be written to, is a matter of the place that was chosen: exit code 2, the file, and what to
//! do. Each command gets a disk of its own, in a mount namespace that ends with it.
#![cfg(target_os = "linux")]

use std::path::Path;
use std::process::Command;

use crate::backends::experiment;
use crate::harness::{Ran, evodrive, folder_below, home, skip};

/// Carries a command out where `full` is a disk of so many kilobytes, which a shell fills before; none where this system makes no
/// such disk.
fn on_a_full_disk(folder: &Path, kilobytes: usize, before: &str, args: &[&str]) -> Option<Ran> {
    std::fs::create_dir_all(folder.join("full")).unwrap();
    let script = format!("mount -t tmpfs -o size={kilobytes}k none full || exit 9\n{before}\nexec \"$@\"");
    let ran = Ran::of(
        Command::new("unshare")
            .args(["--map-root-user", "--mount", "sh", "-c", &script, "sh", env!("CARGO_BIN_EXE_evodrive")])
            .args(args)
            .current_dir(folder),
    );
    if ran.stderr.contains("mount:") || ran.stderr.contains("unshare:") {
        skip(&format!("no disk of its own for a command: {}", ran.stderr.trim()));
        return None;
    }
    Some(ran)
}

/// A small run, its program and its scenes.
fn prepared(folder: &Path) -> String {
    let path = experiment(folder, "mine", "");
    let here = |args: &[&str]| {
        let ran = Ran::of(evodrive().current_dir(folder).args(args));
        assert_eq!(ran.code, 0, "{args:?}: {}", ran.stderr);
    };
    here(&["record", path.to_str().unwrap(), "--no-report"]);
    let run = folder_below(&folder.join("runs")).display().to_string();
    here(&["program", "export", &run, "cat-idm/parent", "--out", "program.json"]);
    here(&["scenes", "generate", path.to_str().unwrap(), "--out", "mine.pool"]);
    run
}

#[test]
fn every_command_that_writes_says_that_the_disk_is_full_where_and_what_to_do() {
    let dir = tempfile::tempdir().unwrap();
    let run = prepared(dir.path());
    let frozen = home().join("golden/bundles/frozen-1.evodrive").display().to_string();
    let commands: [&[&str]; 11] = [
        &["run", "mine.toml", "--no-report", "--out", "full"],
        &["record", "mine.toml", "--no-report", "--out", "full", "--cassette", "other.jsonl"],
        &["plan", "mine.toml", "--out", "full"],
        &["data", &run, "--out", "full/tables"],
        &["figure", "case-evolution", "--run", &run, "--out", "full/figure.svg"],
        &["bundle", "create", &run, "--out", "full/run.evodrive"],
        &["bundle", "import", &frozen, "--out", "full/copy"],
        &["program", "export", &run, "cat-idm/parent", "--out", "full/program.json"],
        &["scenes", "import", "mine.pool", "--out", "full/again.pool"],
        &["scenes", "export", "mine.pool", "--format", "scenarionet", "--out", "full/exported"],
        &["apply", "program.json", "--scenes", "mine.pool", "--out", "full/applied"],
    ];
    let mut wrong = Vec::new();
    for args in commands {
        let Some(ran) = on_a_full_disk(dir.path(), 4, "", args) else { return };
        let said = ran.stderr.lines().find(|line| line.starts_with("error: ")).unwrap_or_default();
        let names = ["full/", "the disk is full: make room"];
        // The system's words, and those for what SQLite reports.
        let why = ["No space left on device", "no storage space"];
        if ran.code != 2 || names.iter().any(|name| !said.contains(name)) || !why.iter().any(|why| said.contains(why)) {
            wrong.push(format!("{args:?}: exit {}: {said}", ran.code));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    // A report lies in its run's folder, which fills the disk.
    let filled = format!(
        "cp -r {run} full/run && rm -f full/run/report.html && head -c 64M /dev/zero > full/rest 2> /dev/null; true"
    );
    let Some(ran) = on_a_full_disk(dir.path(), 16384, &filled, &["report", "full/run"]) else { return };
    assert!(ran.code == 2 && ran.stderr.contains("full/run/report.html: No space left"), "{}", ran.stderr);
}

/// The disk may fill at any byte of a run; what is left is gone on with where there is room.
#[test]
fn a_run_that_a_full_disk_ended_ends_with_exit_code_2_wherever_that_happened() {
    let dir = tempfile::tempdir().unwrap();
    prepared(dir.path());
    let mut ends = Vec::new();
    for kilobytes in [64, 900, 960, 1020, 1060, 1100, 1140, 1180, 1240, 1400] {
        let args = ["run", "mine.toml", "--no-report", "--out", "full"];
        let Some(ran) = on_a_full_disk(dir.path(), kilobytes, "", &args) else { return };
        assert!(
            ran.code == 0 || ran.code == 2 && ran.stderr.contains("the disk is full"),
            "{kilobytes}: {}",
            ran.stderr
        );
        ends.push(ran.code);
    }
    assert!(ends.contains(&2), "no disk was full, so this shows nothing");
}
