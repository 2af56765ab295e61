//! Every command that is about a run takes it in its place and as `--run`, by path, by name and by the beginning of its name.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use crate::backends::experiment;
use crate::harness::{Ran, Recorded, evodrive, record, text};

/// A command: what stands before the run's place, what stands behind it. `@` is a file or folder that the command makes.
const COMMANDS: &[(&str, &str, &str)] = &[
    ("resume", "", ""),
    ("check", "", ""),
    ("verify", "", ""),
    ("exchange status", "", ""),
    ("scenes show", "", "--attempt cat-idm/parent --scene SCENE"),
    ("scenes best", "", "--top 1"),
    ("scenes draw", "", "--attempt cat-idm/parent --scene SCENE --out @.svg"),
    ("scenes export", "", "--attempt cat-idm/parent --scene SCENE --format scenarionet --out @"),
    ("lineage", "cat-idm", ""),
    ("show", "cat-idm/parent", ""),
    ("program show", "", "cat-idm/parent"),
    ("program export", "", "cat-idm/parent --out @.json"),
    ("fsck", "", ""),
    ("report", "", ""),
    ("watch", "", ""),
    ("table", "proposals", ""),
    ("claims", "PAPER/claims.toml", ""),
    ("figure", "case-evolution", "--out @.svg"),
    ("why", "proposals:cat-idm:accepted", ""),
    ("credit", "cat-idm/parent", ""),
    ("impact", "cat-idm/parent", ""),
    ("world", "", ""),
    ("compare", "", ""),
    ("diff", "", ""),
    ("agree", "", ""),
    ("data", "", "--out @"),
    ("bundle create", "", "--out @.evodrive"),
    ("shard plan", "", ""),
    ("shard merge", "", ""),
];

/// Command that can be given only once; `shards` names its run.
const ONCE: &str = "shard withdraw";

/// Commands that take any number of runs beside other things, and so as an option alone.
const OPTION_ALONE: [&str; 2] = ["suite freeze", "transfer"];

/// Commands that set two runs side by side.
const OF_TWO: [&str; 3] = ["compare", "diff", "agree"];

fn recorded() -> &'static Recorded {
    static RUN: OnceLock<Recorded> = OnceLock::new();
    RUN.get_or_init(|| record(|folder| experiment(folder, "mine", "")))
}

/// The working directory, below which runs/ holds the run.
fn home() -> &'static Path {
    recorded().run.parent().unwrap().parent().unwrap()
}

fn words(text: &str) -> Vec<String> {
    static SCENE: OnceLock<String> = OnceLock::new();
    let scene = SCENE.get_or_init(|| {
        let best = Ran::of(evodrive().current_dir(home()).args(["scenes", "best", "--top", "1", "--json"]));
        let object: serde_json::Value = serde_json::from_str(&best.stdout).unwrap();
        object["best"][0]["rollout"]["scene"].as_str().unwrap_or_else(|| panic!("{object}")).to_string()
    });
    let paper = crate::harness::home().join("paper").display().to_string();
    text.split_whitespace().map(|word| word.replace("SCENE", scene).replace("PAPER", &paper)).collect()
}

/// Carries the command out with the run named so; what it made is removed again.
fn called(command: &str, before: &str, named: &[String], after: &str) -> Ran {
    let made = tempfile::tempdir().unwrap();
    let place = made.path().join("made").display().to_string();
    let mut call = evodrive();
    call.current_dir(home()).args(words(command)).args(words(before)).args(named);
    call.args(words(after).iter().map(|word| word.replace('@', &place)));
    let mut ran = Ran::of(&mut call);
    ran.stdout = ran.stdout.replace(&place, "@");
    ran
}

#[test]
fn every_command_takes_its_run_in_its_place_and_as_an_option() {
    let run: PathBuf = recorded().run.clone();
    let name = run.file_name().unwrap().to_string_lossy().into_owned();
    let start = name[..name.len() - 3].to_string();
    for ((command, before, after), nth) in COMMANDS.iter().zip(0..) {
        let times = if OF_TWO.contains(command) { 2 } else { 1 };
        let place = |name: &str| vec![name.to_string(); times];
        let option =
            |name: &str| -> Vec<String> { (0..times).flat_map(|_| ["--run".to_string(), name.to_string()]).collect() };
        let by_place = called(command, before, &place(&name), after);
        assert!(by_place.code == 0, "{command}: {}{}", by_place.stdout, by_place.stderr);
        // All take a run's name from one place, so each tries one of the other ways to say it.
        let mut others = vec![option(&start), place(&start), option(run.to_str().unwrap())];
        for named in [option(&name), others.swap_remove(nth % 3)] {
            let again = called(command, before, &named, after);
            assert!(again.code == 0, "{command} {named:?}: {}", again.stderr);
            // A path is printed as it was typed, and times differ.
            if named == option(&name) && !["resume", "check", "verify"].contains(command) {
                assert_eq!(again.stdout, by_place.stdout, "{command}");
            }
        }
        let unknown = called(command, before, &option("nobody"), after);
        assert!(unknown.code == 2, "{command}: {}", unknown.stdout);
        assert!(unknown.stderr.contains("nobody"), "{command}: {}", unknown.stderr);
    }
}

#[test]
fn the_table_holds_every_command_that_names_a_run() {
    let help = text("golden/help.txt");
    let sections = help.split("\n---- evodrive ").skip(1).filter_map(|section| section.split_once(" --help\n"));
    let with_option = sections.filter(|(_, text)| text.contains("--run <RUN>")).map(|(command, _)| command);
    let known: BTreeSet<&str> =
        COMMANDS.iter().map(|(command, _, _)| *command).chain([ONCE]).chain(OPTION_ALONE).collect();
    assert_eq!(with_option.collect::<BTreeSet<_>>(), known);
}
