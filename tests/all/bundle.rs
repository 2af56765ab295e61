//! Bundles: a run as one file, replayed from nothing but that file, and what a reader refuses.

use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::harness::{Ran, home, run, skip};

/// Made by the first release that had bundles, and by the one whose contracts have `log_way_share`. Never to be replaced: what was published
/// once is read for ever. If it is not, the program is wrong.
const ALL_FROZEN: [(&str, &str); 2] = [
    ("golden/bundles/frozen-1.evodrive", "f634462f19b80f657b8a1add29c84db120679685afcad26d608ba92fc29f2e76"),
    (FROZEN, FROZEN_ROOT),
];
/// The newest, which this build carries out.
const FROZEN: &str = "golden/bundles/frozen-2.evodrive";
const FROZEN_ROOT: &str = "5f3c0bd97caaefe17838a288ddb5c0d1fc921412813fcf9e16aafae10069b8ab";

fn bundle(args: &[&str]) -> Ran {
    run(&[&["bundle"], args].concat())
}

fn path(of: &Path) -> &str {
    of.to_str().unwrap()
}

/// The frozen bundle as a run folder.
pub fn imported(dir: &Path) -> PathBuf {
    let folder = dir.join("run");
    let ran = bundle(&["import", FROZEN, "--out", path(&folder)]);
    assert_eq!((ran.code, ran.root().as_str()), (0, FROZEN_ROOT), "{}", ran.stderr);
    folder
}

#[test]
fn frozen_bundles_are_read_for_ever_and_carried_out_again_by_every_build_of_their_versions() {
    for (frozen, root) in ALL_FROZEN {
        let ran = bundle(&["verify", frozen, "--stored"]);
        assert_eq!((ran.code, ran.root().as_str()), (0, root), "{}", ran.stderr);
        assert!(ran.stdout.contains("executed again: nothing"), "{}", ran.stdout);
        let ran = bundle(&["verify", frozen, "--json"]);
        if ran.code == 2 && ran.stderr.contains("made by another version") {
            skip(&format!("{frozen} is of other versions of meaning; its stored bytes were held against each other"));
            continue;
        }
        assert_eq!(ran.code, 0, "{}", ran.stderr);
        let printed: Value = serde_json::from_str(&ran.stdout).unwrap();
        assert_eq!((&printed["root"], &printed["executed"]["rollouts"]), (&root.into(), &25.into()), "{printed}");
        assert_eq!(
            (&printed["replayed"]["answers"], &printed["replayed"]["models"][0]),
            (&47.into(), &"scripted".into()),
            "{printed}"
        );
    }
    let ran = bundle(&["verify", ALL_FROZEN[0].0]);
    assert!(ran.code == 2 && ran.stderr.contains("contract of family cat"), "{} {}", ran.code, ran.stderr);
}

#[test]
fn verification_leads_with_its_verdict_and_counts_the_answers_that_the_run_asked_for() {
    let dir = tempfile::tempdir().unwrap();
    let experiment = crate::backends::experiment(dir.path(), "mine", "");
    let (experiment, both) = (path(&experiment), dir.path().join("both.jsonl"));
    let (both, runs) = (path(&both), dir.path().join("runs"));
    // One cassette for two settings: the first run asks for a part of it.
    let ran = |command: &str, more: &[&str]| {
        run(&[&[command, experiment, "--no-report", "--out", path(&runs), "--cassette", both], more].concat()).root()
    };
    let first = ran("record", &[]);
    ran("record", &["--set", "budget.slots=3"]);
    assert_eq!(ran("run", &[]), first);
    let folder = std::fs::read_to_string(runs.join("LATEST")).unwrap();
    let file = dir.path().join("a.evodrive");
    let made = bundle(&["create", path(&runs.join(folder.trim())), "--out", path(&file)]);
    assert_eq!(made.code, 0, "{}", made.stderr);
    let verified = bundle(&["verify", path(&file)]);
    assert!(verified.code == 0 && verified.stdout.starts_with("verified: "), "{} {}", verified.stdout, verified.stderr);
    // It speaks of the bundle, and not of the steps of the run.
    assert_eq!(verified.stderr.lines().count(), 2, "{}", verified.stderr);
    let object: Value = serde_json::from_str(&bundle(&["verify", path(&file), "--json"]).stdout).unwrap();
    let text = std::fs::read_to_string(both).unwrap();
    let recorded = text.lines().filter(|line| line.starts_with("{\"exchange\"")).count() as u64;
    let [asked, others] = ["answers", "answers_not_asked_for"].map(|key| object["replayed"][key].as_u64().unwrap());
    assert!(asked > 0 && others > 0 && asked + others == recorded, "{asked} {others} {recorded}");
    for line in [format!("only replayed: {asked} answers"), format!("not used: {others} more answers")] {
        assert!(verified.stdout.contains(&line), "{line}: {}", verified.stdout);
    }
    let shown = bundle(&["inspect", path(&file)]);
    assert!(shown.stdout.starts_with("whole: "), "{}", shown.stdout);
    // What the manifest alone says is not passed off as checked.
    let said: Vec<&str> = shown.stdout.lines().filter(|line| line.contains("unverified")).collect();
    assert!(said.len() == 2 && said[0].contains("made by evodrive") && said[1].contains("root"), "{}", shown.stdout);
    let object: Value = serde_json::from_str(&bundle(&["inspect", path(&file), "--json"]).stdout).unwrap();
    assert!(object["unverified"].as_array().unwrap().contains(&"root".into()), "{object}");
}

#[test]
fn equal_runs_give_equal_bytes_with_and_without_rollouts() {
    let dir = tempfile::tempdir().unwrap();
    let folder = imported(dir.path());
    let made = |name: &str, more: &[&str]| {
        let out = dir.path().join(name);
        let ran = bundle(&[&["create", path(&folder), "--out", path(&out)], more].concat());
        assert_eq!(ran.code, 0, "{}", ran.stderr);
        std::fs::read(out).unwrap()
    };
    let first = made("a", &[]);
    let ran = run(&["verify", path(&folder)]);
    assert_eq!((ran.code, ran.root().as_str()), (0, FROZEN_ROOT), "{}", ran.stderr);
    // A replay has touched the store; the bundle is the same.
    assert!(first == made("b", &[]));
    let short = made("c", &["--without-rollouts"]);
    assert!(short.len() < first.len());
    let ran = bundle(&["verify", path(&dir.path().join("c"))]);
    assert_eq!((ran.code, ran.root().as_str()), (0, FROZEN_ROOT), "{}", ran.stderr);
}

#[test]
fn a_damaged_bundle_is_named_and_leaves_nothing_behind() {
    let dir = tempfile::tempdir().unwrap();
    let whole = std::fs::read(home().join(FROZEN)).unwrap();
    let out = dir.path().join("out");
    let file = dir.path().join("x.evodrive");
    for place in (0..40).map(|k| 20 + k * (whole.len() - 40) / 40) {
        let mut bytes = whole.clone();
        bytes[place] ^= 0x10;
        std::fs::write(&file, &bytes).unwrap();
        let ran = bundle(&["import", path(&file), "--out", path(&out)]);
        assert!(
            matches!(ran.code, 2 | 5) && ran.stderr.contains("x.evodrive"),
            "byte {place}: {} {}",
            ran.code,
            ran.stderr
        );
        std::fs::write(&file, &whole[..place]).unwrap();
        let ran = bundle(&["inspect", path(&file)]);
        assert!(matches!(ran.code, 2 | 5), "cut at {place}: {} {}", ran.code, ran.stderr);
    }
    let left: Vec<_> = std::fs::read_dir(dir.path()).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    assert_eq!(left, ["x.evodrive"]);
}

/// An archive of these entries, name and bytes, as an attacker would make it.
fn archive(dir: &Path, entries: &[(&str, &[u8])]) -> PathBuf {
    let mut packed = Vec::new();
    for (name, bytes) in entries {
        let mut header = tar::Header::new_ustar();
        // The library would refuse to write such a name.
        header.as_mut_bytes()[..name.len()].copy_from_slice(name.as_bytes());
        header.set_size(bytes.len() as u64);
        header.set_mode(0o644);
        header.set_uid(0);
        header.set_gid(0);
        header.set_mtime(0);
        header.set_entry_type(tar::EntryType::Regular);
        header.set_cksum();
        packed.extend_from_slice(header.as_bytes());
        packed.extend_from_slice(bytes);
        packed.resize(packed.len().next_multiple_of(512), 0);
    }
    packed.resize(packed.len() + 1024, 0);
    let path = dir.join("made.evodrive");
    std::fs::write(&path, framed(&packed, true)).unwrap();
    path
}

/// One zstd frame.
fn framed(bytes: &[u8], checksum: bool) -> Vec<u8> {
    let mut encoder = zstd::stream::write::Encoder::new(Vec::new(), 1).unwrap();
    encoder.include_checksum(checksum).unwrap();
    std::io::Write::write_all(&mut encoder, bytes).unwrap();
    encoder.finish().unwrap()
}

#[test]
fn a_bundle_is_one_frame_with_a_checksum() {
    let dir = tempfile::tempdir().unwrap();
    let whole = std::fs::read(FROZEN).unwrap();
    let inside = zstd::decode_all(whole.as_slice()).unwrap();
    let (head, tail) = inside.split_at(inside.len() / 2);
    let skippable = [&[0x50, 0x2A, 0x4D, 0x18, 4, 0, 0, 0][..], b"hide"].concat();
    let cases = [
        (framed(&inside, true), 0, ""),
        (framed(&inside, false), 2, "a zstd frame with a checksum"),
        ([framed(head, true), framed(tail, true)].concat(), 5, "expected"),
        ([framed(&inside, true), framed(b"", true)].concat(), 5, "one zstd frame and nothing behind it"),
        ([framed(&inside, true), skippable.clone()].concat(), 5, "one zstd frame and nothing behind it"),
        ([skippable, framed(&inside, true)].concat(), 2, ""),
    ];
    for (number, (bytes, code, word)) in cases.into_iter().enumerate() {
        let file = dir.path().join("x.evodrive");
        std::fs::write(&file, bytes).unwrap();
        let ran = bundle(&["inspect", path(&file)]);
        assert!(ran.code == code && ran.stderr.contains(word), "case {number}: {} {}", ran.code, ran.stderr);
    }
}

#[test]
fn a_kilobyte_that_comes_to_gigabytes_is_read_no_further_than_a_bundle_of_its_length_may() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("x.evodrive");
    std::fs::write(&file, framed(&vec![0; 200 << 20], true)).unwrap();
    let ran = bundle(&["inspect", path(&file)]);
    assert!(matches!(ran.code, 2 | 5), "{} {}", ran.code, ran.stderr);
}

fn manifest(format: &str, files: &[(&str, u64)]) -> Vec<u8> {
    let zero = "0".repeat(64);
    let files: Vec<Value> =
        files.iter().map(|(path, bytes)| serde_json::json!({"path": path, "bytes": bytes, "digest": zero})).collect();
    serde_json::to_vec(
        &serde_json::json!({"format": format, "name": "x", "root": zero, "experiment": zero, "pool": zero,
        "versions": {"evodrive": "0", "adapter": 1, "sim": 1, "eval": 1}, "files": files}),
    )
    .unwrap()
}

/// Entries behind the manifest, the manifest, exit code, words of the message.
type Case<'a> = (Vec<(&'a str, &'a [u8])>, Vec<u8>, i32, &'a str);

#[test]
fn what_no_bundle_may_hold_is_refused_before_anything_is_written() {
    let dir = tempfile::tempdir().unwrap();
    let now = "evodrive-bundle/1";
    let plain = manifest(now, &[]);
    let cases: Vec<Case> = vec![
        (vec![("../../escaped", b"x")], plain.clone(), 2, "leads out of the folder"),
        (vec![("/tmp/escaped", b"x")], plain.clone(), 2, "absolute name"),
        (vec![("other.txt", b"x")], plain.clone(), 2, "expected one of"),
        (vec![], manifest(now, &[("../x", 1)]), 2, "leads out of the folder"),
        (vec![], manifest(now, &[("result.json", 1), ("result.json", 1)]), 2, "a second time"),
        (vec![], manifest(now, &[("result.json", u64::MAX), ("scenes.pool", 2)]), 2, "--bytes-max"),
        (vec![], manifest(now, &[("result.json", 1 << 40)]), 2, "--bytes-max"),
        (vec![], manifest("evodrive-bundle/2", &[]), 2, "use the version of evodrive that made it"),
        (vec![("result.json", b"x")], plain.clone(), 2, "expected the manifest to name every file"),
        (vec![("manifest.json", b"x")], plain.clone(), 2, "a second time"),
        (vec![("result.json", b"x")], manifest(now, &[("result.json", 1)]), 5, "of digest"),
        (vec![("result.json", b"x")], manifest(now, &[("result.json", 9)]), 5, "expected 9 bytes, found 1"),
        (vec![], manifest(now, &[("result.json", 1)]), 5, "found the end of the archive"),
        (vec![], b"{}".to_vec(), 5, "expected a field `format`"),
    ];
    for (entries, manifest, code, word) in cases {
        let all: Vec<(&str, &[u8])> = [("manifest.json", manifest.as_slice())].into_iter().chain(entries).collect();
        let made = archive(dir.path(), &all);
        let ran = bundle(&["import", path(&made), "--out", path(&dir.path().join("out"))]);
        assert!(ran.code == code && ran.stderr.contains(word), "{word}: {} {}", ran.code, ran.stderr);
    }
    let first = archive(dir.path(), &[("../escaped", b"x")]);
    let ran = bundle(&["inspect", path(&first)]);
    assert!(ran.code == 2 && ran.stderr.contains("leads out"), "{}", ran.stderr);
    let left: Vec<_> = std::fs::read_dir(dir.path()).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    assert_eq!(left, ["made.evodrive"]);
}

/// A key pair, if openssl is there.
fn keys(dir: &Path, name: &str) -> Option<(PathBuf, PathBuf)> {
    let (key, public) = (dir.join(format!("{name}.pem")), dir.join(format!("{name}.pub.pem")));
    let made = Command::new("openssl").args(["genpkey", "-algorithm", "ed25519", "-out", path(&key)]).output();
    if !made.is_ok_and(|made| made.status.success()) {
        skip("openssl is not installed: signatures with keys that it makes");
        return None;
    }
    let printed = Command::new("openssl").args(["pkey", "-in", path(&key), "-pubout", "-out", path(&public)]).output();
    assert!(printed.unwrap().status.success());
    Some((key, public))
}

#[test]
fn a_signature_holds_for_its_key_and_its_bundle_alone() {
    let dir = tempfile::tempdir().unwrap();
    let (Some((key, public)), Some((_, other))) = (keys(dir.path(), "a"), keys(dir.path(), "b")) else { return };
    let folder = imported(dir.path());
    let signed = dir.path().join("signed.evodrive");
    let ran = bundle(&["create", path(&folder), "--out", path(&signed), "--sign", path(&key)]);
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    let check = |file: &str, key: &Path| bundle(&["verify", file, "--stored", "--key", path(key)]);
    let ran = check(path(&signed), &public);
    assert!(ran.code == 0 && ran.stdout.contains("signature: holds, by key"), "{} {}", ran.stdout, ran.stderr);
    let ran = check(path(&signed), &other);
    assert!(
        ran.code == 5 && ran.stderr.contains("expected a signature by the given key, found none"),
        "{} {}",
        ran.code,
        ran.stderr
    );
    let ran = check(FROZEN, &public);
    assert!(ran.code == 2 && ran.stderr.contains("expected a signature, found none"), "{} {}", ran.code, ran.stderr);
    let ran = check(path(&signed), &key);
    assert!(ran.code == 2 && ran.stderr.contains("public key"), "{} {}", ran.code, ran.stderr);
}

/// The frozen bundle with another manifest.
fn with_manifest(dir: &Path, change: impl FnOnce(&mut Value)) -> PathBuf {
    let inside = zstd::decode_all(std::fs::read(home().join(FROZEN)).unwrap().as_slice()).unwrap();
    let mut entries: Vec<(String, Vec<u8>)> = tar::Archive::new(inside.as_slice())
        .entries()
        .unwrap()
        .map(|entry| {
            let mut entry = entry.unwrap();
            let mut bytes = Vec::new();
            std::io::Read::read_to_end(&mut entry, &mut bytes).unwrap();
            (entry.path().unwrap().display().to_string(), bytes)
        })
        .collect();
    let mut said: Value = serde_json::from_slice(&entries[0].1).unwrap();
    change(&mut said);
    entries[0].1 = serde_json::to_vec(&said).unwrap();
    let borrowed: Vec<(&str, &[u8])> = entries.iter().map(|(name, bytes)| (name.as_str(), bytes.as_slice())).collect();
    archive(dir, &borrowed)
}

#[test]
fn what_a_manifest_says_of_its_run_is_what_the_events_inside_say() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("out");
    let same = with_manifest(dir.path(), |_| ());
    assert_eq!(bundle(&["verify", "--stored", path(&same)]).code, 0);
    let zero: Value = "0".repeat(64).into();
    let changes = [
        ("/name", "somebody".into()),
        ("/root", zero.clone()),
        ("/experiment", zero.clone()),
        ("/pool", zero),
        ("/versions/adapter", 99.into()),
        ("/versions/sim", 99.into()),
        ("/versions/eval", 99.into()),
    ];
    for (place, other) in changes {
        let made = with_manifest(dir.path(), |said| *said.pointer_mut(place).unwrap() = other);
        let what = place.split('/').nth(1).unwrap();
        for command in [vec!["import", path(&made), "--out", path(&out)], vec!["verify", "--stored", path(&made)]] {
            let ran = bundle(&command);
            let told = ran.stderr.contains(&format!("{what}: the manifest says"));
            assert!(ran.code == 5 && told, "{place}: {} {}", ran.code, ran.stderr);
        }
        assert!(!out.exists(), "{place}");
    }
}

#[test]
fn a_bundle_takes_the_place_of_no_file_that_was_not_meant() {
    let dir = tempfile::tempdir().unwrap();
    let folder = imported(dir.path());
    let create = |out: &Path, more: &[&str]| bundle(&[&["create", path(&folder), "--out", path(out)], more].concat());
    let own = folder.join("result.json");
    let before = std::fs::read(&own).unwrap();
    for more in [&[][..], &["--overwrite"]] {
        let ran = create(&own, more);
        assert!(ran.code == 2 && ran.stderr.contains("a run's own files"), "{} {}", ran.code, ran.stderr);
    }
    assert!(std::fs::read(&own).unwrap() == before);
    let taken = dir.path().join("taken");
    std::fs::write(&taken, "of somebody").unwrap();
    let ran = create(&taken, &[]);
    assert!(ran.code == 2 && ran.stderr.contains("--overwrite"), "{} {}", ran.code, ran.stderr);
    assert_eq!(std::fs::read(&taken).unwrap(), b"of somebody");
    assert_eq!(create(&taken, &["--overwrite"]).code, 0);
    assert_eq!(bundle(&["inspect", path(&taken)]).code, 0);
    let ran = bundle(&["import", FROZEN, "--out", path(&taken), "--bytes-max", "1000000000"]);
    assert!(ran.code == 2 && ran.stderr.contains("expected no file or folder yet"), "{}", ran.stderr);
}

#[cfg(unix)]
#[test]
fn an_output_that_is_a_link_to_nowhere_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    let folder = imported(dir.path());
    let link = dir.path().join("link");
    std::os::unix::fs::symlink(dir.path().join("nobody"), &link).unwrap();
    for command in [
        vec!["create", path(&folder), "--out", path(&link)],
        vec!["create", path(&folder), "--out", path(&link), "--overwrite"],
        vec!["import", FROZEN, "--out", path(&link)],
    ] {
        let ran = bundle(&command);
        assert_eq!(ran.code, 2, "{command:?}: {}", ran.stderr);
    }
    assert!(link.is_symlink() && !dir.path().join("nobody").exists());
}

#[test]
fn what_killed_bundle_commands_left_goes_with_the_next_one() {
    let dir = tempfile::tempdir().unwrap();
    let folder = imported(dir.path());
    let at = |name: &str| dir.path().join(name);
    // Folders with the mark of such a command, which nobody holds; and some of the same names without it, which are somebody's.
    for begins in [".run.evodrive.", ".copy.", "evodrive-bundle-"] {
        for (number, mark) in [("1-0", format!("evodrive-folder/1 {begins}\n")), ("2-0", "mine".into())] {
            std::fs::create_dir_all(at(&format!("{begins}{number}/store"))).unwrap();
            std::fs::write(at(&format!("{begins}{number}/.evodrive-own")), mark).unwrap();
        }
    }
    std::fs::write(at(".run.evodrive.99999999.tmp"), "theirs").unwrap();
    let made = at("run.evodrive");
    assert_eq!(bundle(&["create", path(&folder), "--out", path(&made)]).code, 0);
    assert_eq!(bundle(&["import", path(&made), "--out", path(&at("copy"))]).code, 0);
    assert_eq!(bundle(&["verify", "--stored", path(&made), "--scratch", path(dir.path())]).code, 0);
    let mut left: Vec<String> = std::fs::read_dir(dir.path())
        .unwrap()
        .map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned())
        .collect();
    left.sort();
    let theirs = [".copy.2-0", ".run.evodrive.2-0", ".run.evodrive.99999999.tmp", "copy", "evodrive-bundle-2-0"];
    assert_eq!(left, [&theirs[..], &["run", "run.evodrive"]].concat());
}
