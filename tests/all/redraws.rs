//! The control of SafeBench's archives: a parent that is drawn as often as its search drew.

use evodrive::ego::Policy;
use evodrive::epoch::{Applied, Redraw, Replaced, SceneEntry};
use evodrive::evaluation::Selecting;
use evodrive::evidence::RecordedRun;
use evodrive::experiment::Experiment;
use evodrive::families;
use evodrive::kernel::{Seed, Threads, num};
use evodrive::objects::benchmark::Redrawn;
use evodrive::objects::{FamilyName, LineageId, ParameterValue, Program, SolutionId};
use evodrive::store::read_events;
use evodrive::synth::{FamilyOptions, family_member};
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::Arc;

use crate::harness::{Recorded, copy_dir, experiment, home, record, run, set, write_small};

/// Human's parameter grid on two families, one epoch.
fn small(malformed: f64) -> Recorded {
    record(|folder| {
        let mut table = experiment("safebench/human-idm.toml");
        let options = table["scenes"]["options"].as_table_mut().unwrap();
        options.insert("families".into(), vec!["straight_obstacle", "right_turn"].into());
        options.insert("routes".into(), vec![4, 5, 6].into());
        table["split"]["evolution"].as_table_mut().unwrap().insert("count".into(), 16.into());
        let sampling = table["models"]["scripted"]["sampling"].as_table_mut().unwrap();
        sampling.insert("malformed_json_rate".into(), malformed.into());
        let changes: [(&str, &str, toml::Value); 4] = [
            ("split", "held_out", 8.into()),
            ("split", "window", 16.into()),
            ("budget", "epochs", 1.into()),
            ("budget", "slots", 4.into()),
        ];
        set(&mut table, &changes);
        write_small(folder, table)
    })
}

fn table(folder: &Path, more: &[&str]) -> (i32, String) {
    let command = ["table", "safebench-main", "--run", folder.to_str().unwrap(), "--format", "csv"];
    let ran = run(&[&command, more].concat());
    (ran.code, format!("{}{}", ran.stdout, ran.stderr))
}

/// A column of the row of Human.
fn place(csv: &str, column: &str) -> String {
    let mut lines = csv.lines();
    let place = lines.next().unwrap().split(',').position(|head| head == column).unwrap();
    lines.find(|line| line.starts_with("Human,")).unwrap().split(',').nth(place).unwrap().to_string()
}

fn number(csv: &str, column: &str) -> f64 {
    place(csv, column).parse().unwrap_or_else(|_| panic!("{column}: {csv}"))
}

fn kept(folder: &Path) -> Vec<Redrawn> {
    let text = std::fs::read_to_string(folder.join("redrawn.json")).unwrap();
    serde_json::from_value(serde_json::from_str::<Value>(&text).unwrap()["kept"].clone()).unwrap()
}

#[test]
fn a_table_draws_parents_as_often_as_programs_were_drawn_and_the_folder_keeps_it() {
    let made = small(0.0);
    let (folder, file) = (made.run.as_path(), made.run.join("redrawn.json"));
    let root = || run(&["check", folder.to_str().unwrap()]).stdout;
    let before = root();
    let (code, first) = table(folder, &["--jobs", "1"]);
    assert!(code == 0 && first.contains("playing its parent in the place of"), "{first}");
    let recorded = RecordedRun::read(&read_events(&folder.join("transcript.jsonl")).unwrap()).unwrap();
    let evaluated = recorded.attempts.iter().filter(|attempt| attempt.exit.score().is_some()).count();
    let [redrawn] = &kept(folder)[..] else { panic!("one lineage") };
    assert!(evaluated > 1 && redrawn.programs == evaluated, "{evaluated} {}", redrawn.programs);
    // Before the first round nothing is drawn anew; then the parent's own scenes stand among redraws of every program's place.
    assert_eq!(redrawn.rounds[0], recorded.rounds[0]);
    let last = redrawn.rounds.last().unwrap();
    assert!(last.selected.iter().all(|kept| kept.solution.as_str() == "human-idm/parent"));
    assert!(last.selected.iter().any(|kept| kept.scene.contains("/redraw")));
    assert!(last.benchmark.mean.attack >= redrawn.rounds[0].benchmark.mean.attack);
    let change = number(&first, "evolved_cr") - number(&first, "redrawn_cr");
    assert!((number(&first, "cr_change_pp") - 100.0 * change).abs() < 1e-9, "{first}");

    // Kept, worked out again to the same bytes on another number of threads, and no part of the run.
    let bytes = std::fs::read(&file).unwrap();
    let (_, second) = table(folder, &[]);
    assert!(first.ends_with("each\n") && !second.contains("playing") && first.starts_with(&second), "{second}");
    std::fs::remove_file(&file).unwrap();
    table(folder, &["--jobs", "2"]);
    assert!(std::fs::read(&file).unwrap() == bytes, "another number of threads, other bytes");
    assert_eq!(root(), before);
    let why = run(&["why", "safebench-main:human:attack_change_pct", "--full", folder.to_str().unwrap()]);
    assert!(why.code == 0 && why.stdout.contains("the parent redrawn: attack"), "{}{}", why.stdout, why.stderr);

    // A changed number is seen, and one of another run is not read.
    let text = String::from_utf8(bytes).unwrap();
    let lie = text.replacen("\"collision\": true", "\"collision\": false", 1);
    assert_ne!(lie, text);
    std::fs::write(&file, lie).unwrap();
    let (code, said) = table(folder, &[]);
    assert!(
        code == 5 && said.contains("redrawn.json: expected contents of digest") && said.contains("remove the file")
    );
    let root = recorded.root.to_hex();
    std::fs::write(&file, text.replace(&root, &"0".repeat(root.len()))).unwrap();
    assert_eq!(table(folder, &[]).0, 0);
    assert_eq!(std::fs::read_to_string(&file).unwrap(), text);

    // Without its scenes the table has no change, and says so.
    let other = tempfile::tempdir().unwrap();
    let copy = other.path().join(folder.file_name().unwrap());
    copy_dir(folder, &copy);
    std::fs::remove_file(copy.join("redrawn.json")).unwrap();
    std::fs::remove_file(copy.join("scenes.pool")).unwrap();
    let (code, without) = table(&copy, &[]);
    assert!(
        code == 0 && without.contains("its parents cannot be drawn anew") && without.contains("scenes.pool"),
        "{without}"
    );
    let gone = ["attack_change_pct", "redrawn_cr"].map(|column| place(&without, column));
    assert!(gone.iter().all(String::is_empty) && !place(&without, "evolved_cr").is_empty(), "{without}");
}

#[test]
fn a_search_whose_proposals_change_nothing_gains_exactly_nothing() {
    let made = small(1.0);
    let (code, csv) = table(&made.run, &[]);
    assert_eq!(code, 0, "{csv}");
    for column in ["attack_change_pct", "ars_change_pp", "cr_change_pp", "os_change_pp", "pf_area_change_pp"] {
        for ending in ["", "_low", "_high"] {
            assert_eq!(number(&csv, &format!("{column}{ending}")), 0.0, "{column}{ending}");
        }
    }
}

/// A search in which every program is the parent, on scenes under names of their own. The programs differ in effect from the parent and from
/// each other, or not at all.
fn redrawn(named: &str, programs: usize, differ: bool) -> Redrawn {
    let read = Experiment::read(&home().join("experiments/safebench/human-idm.toml")).unwrap();
    let options = FamilyOptions { routes: (4..=9).collect(), draws: 4, ..FamilyOptions::all() };
    let scenes = (0..options.count()).map(|i| family_member(&options, Seed(7), i).unwrap());
    let evolution: Vec<SceneEntry> = scenes
        .map(|mut scene| {
            scene.id += named;
            SceneEntry::new(Arc::new(scene))
        })
        .collect();
    let (sources, lineage, none) = (families::sources(), LineageId::new("human-idm"), BTreeMap::new());
    let (source, simulator) = (sources.get(&FamilyName::new("human")).unwrap(), read.simulator.rules());
    let parent = source.parent.adopted(&lineage);
    let other = |k: usize| {
        let mut program = Program { solution_id: SolutionId::new(format!("human-idm/e0s{k}")), ..parent.clone() };
        program
            .parameters
            .insert("temperature".into(), ParameterValue::Number(if differ { 0.6 + 0.1 * k as f64 } else { 0.5 }));
        program
    };
    let others: Vec<Program> = (0..programs).map(other).collect();
    let all: BTreeSet<&str> = evolution.iter().map(|entry| entry.scene().id.as_str()).collect();
    let replaced = others.iter().map(|program| Replaced { program, round: 1, scenes: all.clone() });
    let redraw = Redraw {
        lineage: &lineage,
        parent: &parent,
        applied: Applied {
            source,
            ego: &Policy::Idm,
            seed: Seed(read.seed),
            simulator: &simulator,
            backend: evodrive::backend::Backend::Own,
            evaluation: &read.evaluation,
            counsels: &none,
        },
        evolution: &evolution,
        replaced: replaced.collect(),
        rounds: 1,
        descendants: 3,
        selecting: Selecting { per_group: 4, coverage_floor: read.archive.coverage_floor },
        archive: &read.archive,
        selector: &read.selector,
    };
    redraw.play(&Threads::new(2).unwrap()).unwrap().1
}

/// A program that does in every scene what the parent does draws nothing, and neither does the parent in its place.
#[test]
fn programs_that_are_alike_in_effect_share_a_draw() {
    let alike = redrawn("", 3, false);
    assert!(alike.pf_area_at_3_pct_by_group.values().all(|gain| *gain == 0.0));
    assert!(alike.rounds.iter().flat_map(|round| &round.selected).all(|kept| !kept.scene.contains("/redraw")));
}

/// The frontier gain is never negative, so a search that finds nothing has one. Less that of the parent drawn as often it has none.
#[test]
fn the_frontier_of_a_parent_that_is_drawn_again_is_no_gain() {
    let gains = |named| redrawn(named, 4, true).pf_area_at_3_pct_by_group;
    let (search, control) = (gains("/search"), gains(""));
    let over = |of: &dyn Fn(&str) -> f64| {
        let differences: Vec<f64> = search.iter().map(|(group, gain)| gain - of(group)).collect();
        let mean = num::mean(&differences).unwrap();
        let squares: Vec<f64> =
            differences.iter().map(|difference| (difference - mean) * (difference - mean)).collect();
        (mean, (num::mean(&squares).unwrap() / differences.len() as f64).sqrt())
    };
    let (gain, error) = over(&|_| 0.0);
    assert!(gain > 3.0 * error, "over nothing {gain} +- {error}");
    let (gain, error) = over(&|group| control[group]);
    assert!(gain.abs() < 2.0 * error, "over the parent drawn as often {gain} +- {error}");
}
