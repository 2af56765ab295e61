//! Worked examples: small recorded SafeBench runs whose tables were computed by hand.

use std::collections::BTreeMap;

use super::tests::{attempt, from_their_parts, near, run, score};
use super::*;
use crate::evaluation::{Runs, SceneArchive, Selecting, StagedRun};
use crate::evidence::recorded_run::RecordedRun;
use crate::kernel::{Seed, num};
use crate::objects::benchmark::{
    ArchiveRound, BenchmarkRow, HeldOutRun, Redrawn, Run as Drive, RunRealism, SafebenchRun, SelectedScene,
};
use crate::objects::replay::{ReplayRow, Replayed, Suite};
use crate::objects::{FamilyName, LineageId, Objectives, Score, SolutionId, attempt::*, event::*};
use crate::scene::safebench::TrafficFamily;

/// Family, route, whether the ego collided; a run is otherwise perfect and its ARS is 0.8.
type Selected = (TrafficFamily, u32, bool);

use TrafficFamily::{LaneChanging, RightTurn};

fn drive(collision: bool) -> SafebenchRun {
    SafebenchRun {
        run: Drive {
            collision,
            red_lights: 0.0,
            stop_signs: 0.0,
            off_road_m: 0.0,
            route_distance_m: 0.0,
            completion: 1.0,
            completed_s: Some(0.0),
            acceleration_mps2: 0.0,
            yaw_rate_radps: 0.0,
            lane_invasions: 0.0,
        },
        realism: RunRealism { acted: true, valid: true, sub_scores: [0.5, 1.0, 1.0, 1.0] },
        search_rollouts: None,
    }
}

/// OS of such runs: only the five points for collisions are ever lost.
fn overall(collision_rate: f64) -> f64 {
    1.0 - 5.0 * collision_rate / 10.1
}

struct Lineage<'a> {
    id: &'a str,
    family: &'a str,
    rounds: &'a [&'a [Selected]],
    /// Solution of the scenes of rounds after the first.
    descendant: &'a str,
    gains_pct: &'a [(&'a str, f64)],
}

fn archive_round(lineage: &LineageId, round: u32, scenes: &[Selected], solution: &SolutionId) -> ArchiveRound {
    let mut runs = Runs::default();
    scenes.iter().for_each(|(family, route, collision)| runs.add((*family, *route), drive(*collision)));
    let scene = |(family, route, collision): &Selected| SelectedScene {
        group: format!("{}/{route}", family.name()),
        scene: format!("safebench/{}/{route:02}", family.name()),
        solution: solution.clone(),
        attack: 0.0,
        realism: 0.8,
        run: drive(*collision),
    };
    let (lineage, benchmark) = (lineage.clone(), runs.benchmark().unwrap());
    ArchiveRound { lineage, round, benchmark, selected: scenes.iter().map(scene).collect() }
}

fn gains(of: &[(&str, f64)]) -> BTreeMap<String, f64> {
    of.iter().map(|(group, gain)| (group.to_string(), *gain)).collect()
}

/// The control of a lineage: the results of its parent in the place of every program.
fn redraw(recorded: &mut RecordedRun, of: &Lineage<'_>, rounds: &[&[Selected]], gains_pct: &[(&str, f64)]) {
    let (lineage, parent) = (LineageId::new(of.id), SolutionId::new(format!("{}/parent", of.id)));
    let rounds = (0..).zip(rounds).map(|(round, scenes)| archive_round(&lineage, round, scenes, &parent)).collect();
    recorded.redrawn.push(Redrawn { lineage, programs: 1, rounds, pf_area_at_3_pct_by_group: gains(gains_pct) });
}

fn add(recorded: &mut RecordedRun, of: &Lineage<'_>) {
    let lineage = LineageId::new(of.id);
    let parent = SolutionId::new(format!("{}/parent", of.id));
    for (round, scenes) in of.rounds.iter().enumerate() {
        let solution = if round == 0 { parent.clone() } else { SolutionId::new(of.descendant) };
        recorded.rounds.push(archive_round(&lineage, round as u32, scenes, &solution));
    }
    let measured = Measured {
        solution: parent,
        objectives: Objectives { attack: 0.1, realism: 0.8 },
        realism_penalty_pct: 20.0,
        coverage: 1.0,
        any_contact: 0.1,
    };
    let gains = gains(of.gains_pct);
    recorded.result.as_mut().unwrap().lineages.push(LineageResult {
        group: lineage.clone(),
        replica: 0,
        cut: Vec::new(),
        lineage,
        family: FamilyName::new(of.family),
        ego: "idm".into(),
        evolved: measured.clone(),
        parent: measured,
        selection: "1 of 1 reach the realism required".into(),
        endpoint: None,
        at_realism: Vec::new(),
        pf_area_at_3_pct: gains.values().sum::<f64>() / gains.len().max(1) as f64,
        pf_area_at_3_pct_by_group: gains,
        front: Vec::new(),
        hypervolume_by_epoch: Vec::new(),
        exits: ExitCounts::default(),
        held_out_scenes: 4,
    });
}

/// Right turn: one of two routes collides, then both; lane changing: none, then one of two.
const ADVSIM: Lineage<'static> = Lineage {
    id: "advsim-idm",
    family: "advsim",
    rounds: &[
        &[(LaneChanging, 4, false), (LaneChanging, 5, false), (RightTurn, 4, true), (RightTurn, 5, false)],
        &[(LaneChanging, 4, true), (LaneChanging, 5, false), (RightTurn, 4, true), (RightTurn, 5, true)],
    ],
    descendant: "advsim-idm/e0s0",
    gains_pct: &[("lane_changing/4", 40.0), ("lane_changing/5", 0.0), ("right_turn/4", 0.0), ("right_turn/5", 20.0)],
};

/// The parent that was drawn as often meets the ego on both routes of the right turn, and never in lane changing.
const REDRAWN_ADVSIM: [&[Selected]; 2] = [
    ADVSIM.rounds[0],
    &[(LaneChanging, 4, false), (LaneChanging, 5, false), (RightTurn, 4, true), (RightTurn, 5, true)],
];

/// AdvSim with its control, whose frontier gains 20 % in one of four groups.
fn drawn() -> RecordedRun {
    let mut made = recorded(&[&ADVSIM]);
    let gains = [("lane_changing/4", 20.0), ("lane_changing/5", 0.0), ("right_turn/4", 0.0), ("right_turn/5", 0.0)];
    redraw(&mut made, &ADVSIM, &REDRAWN_ADVSIM, &gains);
    made
}

/// Nothing of a descendant is selected.
const HUMAN: Lineage<'static> = Lineage {
    id: "human-idm",
    family: "human",
    rounds: &[&[(RightTurn, 4, true)], &[(RightTurn, 4, true)]],
    descendant: "human-idm/parent",
    gains_pct: &[("right_turn/4", 0.0)],
};

fn recorded(lineages: &[&Lineage<'_>]) -> RecordedRun {
    let mut recorded = run("made", &[("actor", "scripted")]);
    lineages.iter().for_each(|lineage| add(&mut recorded, lineage));
    recorded
}

fn cell(table: &Table, labels: &[&str], key: &str) -> Cell {
    let row = table.rows().find(|row| row.labels == labels).unwrap_or_else(|| panic!("no row {labels:?}"));
    row.cell(key).clone()
}

fn ours(table: &Table, labels: &[&str], key: &str) -> Estimate {
    cell(table, labels, key).ours.unwrap()
}

#[test]
fn the_main_table_is_worked_by_hand() {
    let made = drawn();
    let table = safebench_main(std::slice::from_ref(&made)).unwrap();
    let row = ["AS", "IDM"];
    // Families count alike: CR 0 and 1/2 of the parent, 0 and 1 of the redrawn one, 1/2 and 1 of the search.
    let (before, redrawn, after) = (0.25, 0.5, 0.75);
    for (key, expected) in [
        ("parent_cr", before),
        ("parent_os", overall(before)),
        ("parent_attack", before * (1.0 - overall(before))),
        ("parent_ars", 0.8),
        ("evolved_cr", after),
        ("evolved_os", overall(after)),
        ("evolved_attack", after * (1.0 - overall(after))),
        ("redrawn_cr", redrawn),
        ("redrawn_attack", redrawn * (1.0 - overall(redrawn))),
        // CR and 1 - OS are both half as much again, not three times as much.
        ("attack_change_pct", 125.0),
        ("cr_change_pp", 25.0),
        ("os_change_pp", 100.0 * (overall(after) - overall(redrawn))),
        ("ars_change_pp", 0.0),
        ("redrawn_pf_area_at_3_pct", 5.0),
        ("pf_area_at_3_pct", 15.0),
        ("pf_area_change_pp", 10.0),
    ] {
        near(ours(&table, &row, key).value, expected);
    }
    assert_eq!(cell(&table, &row, "parent_attack").paper, Some(0.260));
    assert_eq!(cell(&table, &row, "pf_area_at_3_pct").paper, Some(142.5));
    let advsim = table.rows().next().unwrap();
    assert_eq!((advsim.counts.as_slice(), advsim.proposals.as_str()), ([4, 4, 1, 0].as_slice(), "scripted"));
    assert!(advsim.notes.is_empty(), "{:?}", advsim.notes);
    assert_eq!(from_their_parts(&table, std::slice::from_ref(&made)), 19);
    assert!(!markdown(&table).contains("Not redrawn"));
    let undrawn = safebench_main(&[recorded(&[&ADVSIM])]).unwrap();
    assert_eq!(cell(&undrawn, &row, "attack_change_pct").ours, None, "never against the parent's few runs");
    assert!(markdown(&undrawn).contains("Not redrawn, so without a change: made."));
    let rounds = safebench_rounds(std::slice::from_ref(&made)).unwrap();
    near(ours(&rounds, &["AS", "IDM", "CR", "1 redrawn"], "right_turn").value, 1.0);
    near(ours(&rounds, &["AS", "IDM", "CR", "1 change"], "average").value, 0.25);
    near(ours(&rounds, &["AS", "IDM", "CR", "1 change"], "right_turn").value, 0.0);
    assert_eq!(from_their_parts(&rounds, &[made]), 36);
}

/// A search whose every program draws what the parent draws, and its control with as many programs as `redrawn` says.
fn null_search(seed: u64, programs: usize, redrawn: usize) -> RecordedRun {
    const SELECTING: Selecting = Selecting { per_group: 4, coverage_floor: 0.8 };
    let (lineage, parent) = (LineageId::new("advsim-idm"), SolutionId::new("advsim-idm/parent"));
    let mut stream = Seed(seed).stream(&["null search"]);
    let mut runs = || -> Vec<StagedRun> {
        let groups = TrafficFamily::ALL.into_iter().flat_map(|family| (4..12).map(move |route| (family, route)));
        let four = groups.flat_map(|group| [group; 4]);
        let staged = four.map(|group| {
            let mut run = drive(stream.chance(0.07));
            run.realism.sub_scores[0] = stream.unit();
            StagedRun { scene: group.0.name().into(), group, run }
        });
        staged.collect()
    };
    let own = runs();
    let mut searched = |programs: usize| -> Vec<ArchiveRound> {
        let mut archive = SceneArchive::default();
        archive.add(0, &parent, own.clone());
        (0..programs).for_each(|k| archive.add(1, &SolutionId::new(format!("advsim-idm/e0s{k}")), runs()));
        (0..2).filter_map(|round| archive.after(round, &SELECTING, &lineage)).collect()
    };
    let mut made = recorded(&[&Lineage { rounds: &[], gains_pct: &[], ..ADVSIM }]);
    made.rounds = searched(programs);
    let rounds = searched(redrawn);
    made.redrawn = vec![Redrawn { lineage, programs: redrawn, rounds, pf_area_at_3_pct_by_group: BTreeMap::new() }];
    made
}

/// Of twenty such searches nearly all say that nothing was gained: fewer than 16 would be one case in a hundred where intervals of eight
/// routes a family hold what they should in 93 %. Beside a parent that is drawn once they would all gain.
#[test]
fn a_search_that_draws_its_parent_again_gains_nothing() {
    let holding = |searches: u64, redrawn: usize| {
        let mut holding =
            BTreeMap::from(["attack_change_pct", "cr_change_pp", "os_change_pp", "ars_change_pp"].map(|key| (key, 0)));
        for seed in 0..searches {
            let table = safebench_main(&[null_search(seed, 12, redrawn)]).unwrap();
            for (key, count) in &mut holding {
                let [low, high] = ours(&table, &["AS", "IDM"], key).interval.unwrap();
                *count += usize::from(low <= 0.0 && high >= 0.0);
            }
        }
        holding
    };
    let (as_often, once) = (holding(20, 12), holding(5, 1));
    assert!(as_often.values().all(|count| *count >= 16), "{as_often:?}");
    // Realism decides between runs of one outcome only, so its change is less sure.
    let attack = once.iter().filter(|(key, _)| **key != "ars_change_pp");
    assert!(attack.into_iter().all(|(_, count)| *count == 0), "{once:?}");
}

#[test]
fn rows_in_which_nearly_every_run_is_a_collision_are_called_saturated() {
    let run = drawn();
    let all = archives::lineages(std::slice::from_ref(&run)).unwrap();
    let table = safebench_main(&[run]).unwrap();
    let mut rows: Vec<Row> = table.rows().cloned().collect();
    assert_eq!(safebench::saturated(&rows, &all), None);
    let advsim = rows.iter_mut().find(|row| row.labels == ["AS", "IDM"]).unwrap();
    let cell = advsim.cells.iter_mut().find(|cell| cell.column.key == "evolved_cr").unwrap();
    cell.ours = Some(Estimate::plain(0.96));
    let note = safebench::saturated(&rows, &all).unwrap();
    // Both routes of the right turn, and neither of lane changing.
    assert!(note.contains("in AS/IDM the ego") && note.ends_with("AS/IDM 2 of 4."), "{note}");
}

#[test]
fn intervals_draw_routes_within_their_family_and_pair_differences() {
    let table = safebench_main(&[drawn()]).unwrap();
    let interval = |key| ours(&table, &["AS", "IDM"], key).interval.unwrap();
    // Lane changing never collides before, so CR is half of right turn's 0, 1/2 or 1, each with a chance of at least 1/4.
    assert_eq!(interval("parent_cr"), [0.0, 0.5]);
    // Right turn always does afterwards: 1/2 and half of lane changing's.
    assert_eq!(interval("evolved_cr"), [0.5, 1.0]);
    // Lane changing gains one of its two routes, half of 0 to 100 points; the right turn gains nothing over the redrawn parent.
    assert_eq!(interval("cr_change_pp"), [0.0, 50.0]);
    assert_eq!(interval("ars_change_pp"), [0.0, 0.0], "paired, a rate that is the same in every route has no width");
    assert_eq!(interval("pf_area_at_3_pct"), [0.0, 30.0]);
    // From a CR of 1/2 to 1/2, 3/4 or 1.
    assert_eq!(interval("attack_change_pct"), [0.0, 300.0]);
    let mut made = drawn();
    made.redrawn[0].rounds.truncate(1);
    let relative = ours(&safebench_main(&[made]).unwrap(), &["AS", "IDM"], "attack_change_pct");
    assert_eq!(relative.interval, None, "some draw has no attack to compare with");
}

#[test]
fn the_rounds_stand_by_family_with_the_papers_beside_them() {
    let table = safebench_rounds(&[recorded(&[&ADVSIM])]).unwrap();
    let advsim = &table.parts[0];
    assert_eq!((advsim.rows.len(), advsim.source), (15, Some("tab:carla-as-family-rounds")));
    let row = |metric, round| ["AS", "IDM", metric, round];
    near(ours(&table, &row("CR", "0"), "right_turn").value, 0.5);
    near(ours(&table, &row("CR", "1"), "average").value, 0.75);
    near(ours(&table, &row("OS", "1"), "lane_changing").value, overall(0.5));
    near(ours(&table, &row("ARS", "0"), "average").value, 0.8);
    assert_eq!(ours(&table, &row("CR", "0"), "right_turn").interval, Some([0.0, 1.0]));
    assert_eq!(cell(&table, &row("CR", "0"), "straight_obstacle").ours, None, "not in this run");
    assert_eq!(cell(&table, &row("CR", "4"), "average").ours, None, "the run has one round");
    assert_eq!(cell(&table, &row("CR", "4"), "average").paper, Some(0.791));
    assert_eq!(cell(&table, &row("ARS", "2"), "straight_obstacle").paper, Some(0.980));
}

/// The paper's ego is a learned one: once that was run, nothing printed stands beside another.
#[test]
fn the_papers_figures_stand_beside_its_ego_where_that_was_run() {
    let mut made = recorded(&[&ADVSIM, &HUMAN]);
    add(&mut made, &Lineage { id: "advsim-sac", ..ADVSIM });
    made.result.as_mut().unwrap().lineages.last_mut().unwrap().ego = "learned".into();
    let main = safebench_main(std::slice::from_ref(&made)).unwrap();
    assert_eq!(cell(&main, &["AS", "RL"], "parent_attack").paper, Some(0.260));
    assert_eq!(cell(&main, &["AS", "IDM"], "parent_attack").paper, None);
    assert_eq!(cell(&main, &["Human", "IDM"], "parent_attack").paper, Some(0.264), "no other was run of it");
    let rounds = safebench_rounds(&[made]).unwrap();
    let of = |ego| rounds.rows().filter(|row| row.labels[..2] == ["AS", ego]).collect::<Vec<_>>();
    assert!(of("RL").iter().all(|row| row.in_paper()) && of("IDM").iter().all(|row| !row.in_paper()));
    assert_eq!((of("RL").len(), of("IDM").len()), (15, 6));
}

#[test]
fn what_was_not_run_is_missing_and_a_variant_stands_apart() {
    let variant = Lineage { id: "advsim-slow-idm", ..ADVSIM };
    let made = recorded(&[&ADVSIM, &variant]);
    let main = safebench_main(std::slice::from_ref(&made)).unwrap();
    let labels: Vec<&str> = main.rows().map(|row| row.labels[0].as_str()).collect();
    assert_eq!(labels, ["AS", "AT", "CS", "Human", "AS (advsim-slow)"]);
    let missing: Vec<bool> = main.rows().map(Row::missing).collect();
    assert_eq!(missing, [false, true, true, true, false]);
    assert!(!main.rows().last().unwrap().in_paper());
    let text = markdown(&main);
    assert!(!text.contains("| AT |") && text.contains("Missing in these runs: AT, CS, Human."), "{text}");
    assert!(text.contains("learned policy (RL)"), "{text}");
    let rounds = safebench_rounds(&[made]).unwrap();
    assert_eq!(rounds.parts.iter().map(|part| part.rows.len()).collect::<Vec<_>>(), [15, 15, 15, 15, 6]);
}

#[test]
fn a_lineage_id_with_hyphens_is_the_family_with_underscores() {
    let adv_traj = Lineage { id: "adv-traj-idm", family: "adv_traj", ..ADVSIM };
    let table = safebench_main(&[recorded(&[&adv_traj])]).unwrap();
    near(ours(&table, &["AT", "IDM"], "parent_cr").value, 0.25);
}

#[test]
fn no_gain_is_zero_and_a_note_counts_what_stopped_it() {
    let mut made = recorded(&[&HUMAN]);
    redraw(&mut made, &HUMAN, HUMAN.rounds, HUMAN.gains_pct);
    made.attempts = vec![attempt("human-idm", 0, Exit::Declined { reason: "no JSON".into() })];
    let table = safebench_main(&[made]).unwrap();
    for key in ["cr_change_pp", "os_change_pp", "ars_change_pp", "attack_change_pct", "pf_area_change_pp"] {
        let none = ours(&table, &["Human", "IDM"], key);
        assert_eq!((none.value, none.interval), (0.0, Some([0.0, 0.0])), "{key}");
    }
    let note = "Human, IDM: no gain, balanced selection keeps the parent's scenes alone; 1 attempt: 1 declined, \
                0 invalid, 0 rejected, 0 evaluated, of these 0 accepted, 0 not accepted with more \
                attack than the parent but too little realism, 0 with no more attack; final choice: 1 of 1 reach the \
                realism required.";
    assert!(markdown(&table).contains(note), "{}", markdown(&table));
}

#[test]
fn runs_of_the_other_protocol_and_records_that_contradict_themselves_are_refused() {
    let made = recorded(&[&ADVSIM]);
    let wrong = metadrive_main(std::slice::from_ref(&made)).unwrap_err().to_string();
    assert!(wrong.contains("safebench-main"), "{wrong}");
    let mut other = made.clone();
    other.rounds.clear();
    assert!(safebench_main(&[other]).unwrap_err().to_string().contains("metadrive-main"));
    let mut redrawn = drawn();
    redrawn.redrawn[0].rounds[1].selected[0].run.run.collision = true;
    assert!(safebench_main(&[redrawn]).unwrap_err().to_string().contains("not those of its runs"));
    let twice = safebench_main(&[made.clone(), made.clone()]).unwrap_err().to_string();
    assert!(twice.starts_with("row AS with ego idm is in advsim-idm of run made"), "{twice}");
    let mut unfinished = made.clone();
    unfinished.result = None;
    assert!(safebench_rounds(&[unfinished]).unwrap_err().to_string().contains("evodrive resume"));
    let mut gap = made.clone();
    gap.rounds.remove(0);
    assert!(safebench_main(&[gap]).unwrap_err().to_string().contains("round 1 where round 0"));
    let mut changed = made.clone();
    changed.rounds[1].selected[0].run.run.collision = false;
    assert!(safebench_main(&[changed]).unwrap_err().to_string().contains("not those of its runs"));
    let mut nameless = made;
    nameless.rounds[0].selected[0].group = "nowhere/4".into();
    assert!(safebench_main(&[nameless]).unwrap_err().to_string().contains("nowhere/4"));
}

#[test]
fn the_first_row_is_what_a_program_that_does_nothing_scores() {
    let mut made = recorded(&[&ADVSIM]);
    let benchmark = BenchmarkRow {
        collision_rate: 0.0,
        overall_score: 0.97,
        realism: 0.0,
        valid_rate: 0.0,
        attack: 0.0,
        search_rollouts: None,
    };
    for suite in [Suite::Evolution, Suite::HeldOut] {
        let row = ReplayRow {
            ego: "idm".into(),
            suite,
            scenes: if suite == Suite::Evolution { 64 } else { 16 },
            contact_rate: 0.125,
            realism: None,
            route_completion: 1.0,
            benchmark: Some(benchmark),
        };
        made.replays.push(Replayed { row, scenes: Vec::new(), failures: Vec::new() });
    }
    let main = safebench_main(&[made.clone()]).unwrap();
    let first = main.rows().next().unwrap();
    assert_eq!((first.labels[0].as_str(), first.counts.as_slice()), ("Replay (no program)", [0, 64, 1, 64].as_slice()));
    for (key, expected) in [("parent_attack", 0.0), ("parent_ars", 0.0), ("parent_cr", 0.0), ("parent_os", 0.97)] {
        near(first.cell(key).ours.unwrap().value, expected);
    }
    let rounds = safebench_rounds(&[made]).unwrap();
    let of_nothing = &rounds.parts[0].rows;
    assert_eq!(of_nothing.iter().map(|row| row.labels[2].as_str()).collect::<Vec<_>>(), ["CR", "OS", "ARS"]);
    near(of_nothing[1].cells.last().unwrap().ours.unwrap().value, 0.97);
}

/// Gives a program of the lineage `advsim-idm` scores on evolution scenes and runs on held-out routes.
fn measured(recorded: &mut RecordedRun, solution: &str, seen: &[Selected], held_out: &[Selected], failed: &[&str]) {
    let (lineage, solution) = (LineageId::new("advsim-idm"), SolutionId::new(solution));
    let mut labels: Score = score("advsim", &[Some((0.0, 1.0)); 4]);
    let scores = |scenes: &[Selected], failed: &[&str]| {
        let mut runs = Runs::default();
        scenes.iter().for_each(|(family, route, collision)| runs.add((*family, *route), drive(*collision)));
        failed.iter().for_each(|_| runs.add_failure((RightTurn, 8)));
        Some(Box::new(runs.benchmark().unwrap()))
    };
    labels.benchmark = scores(seen, &[]);
    recorded.finalists.push(Finalist { lineage: lineage.clone(), solution: solution.clone(), score: labels.clone() });
    labels.benchmark = scores(held_out, failed);
    let run = |(family, route, collision): &Selected| HeldOutRun {
        group: format!("{}/{route}", family.name()),
        scene: format!("safebench/{}/{route:02}", family.name()),
        run: Some(drive(*collision)),
    };
    let without = |scene: &&str| HeldOutRun { group: "right_turn/8".into(), scene: scene.to_string(), run: None };
    let runs = held_out.iter().map(run).chain(failed.iter().map(without)).collect();
    recorded.held_out.push(HeldOut { lineage, solution, roles: Vec::new(), score: labels, runs });
}

/// On the routes that it saw the chosen program makes the ego collide everywhere; on others only where its parent did, and once
/// more.
pub(in crate::evidence) fn recorded_unseen() -> RecordedRun {
    unseen()
}

fn unseen() -> RecordedRun {
    let mut made = recorded(&[&ADVSIM]);
    made.result.as_mut().unwrap().lineages[0].evolved.solution = SolutionId::new("advsim-idm/e0s0");
    let seen = |collision| [(LaneChanging, 4, collision), (RightTurn, 4, true)];
    let held_out = |collision| [(LaneChanging, 8, false), (LaneChanging, 9, collision), (RightTurn, 8, true)];
    measured(&mut made, "advsim-idm/parent", &seen(false), &held_out(false), &[]);
    measured(&mut made, "advsim-idm/e0s0", &seen(true), &held_out(true), &["safebench/right_turn/08/1"]);
    made
}

#[test]
fn a_chosen_program_stands_on_routes_that_it_did_not_see_beside_those_that_it_saw() {
    let made = unseen();
    let table = safebench_held_out(std::slice::from_ref(&made)).unwrap();
    let row = ["AS", "IDM"];
    let attack = |rate: f64| rate * (1.0 - overall(rate));
    for (key, expected) in [
        ("seen_parent_attack", attack(0.5)),
        ("seen_evolved_attack", attack(1.0)),
        ("seen_parent_ars", 0.8),
        ("parent_cr", 0.5),
        // One of two lane changes, all right turns.
        ("evolved_cr", 0.75),
        ("evolved_os", overall(0.75)),
        ("attack_change_pct", 125.0),
        ("cr_change_pp", 25.0),
        // A right turn that could not be run counts as invalid: half of them are valid, so 0.8 becomes 0.4 there.
        ("ars_change_pp", -20.0),
    ] {
        near(ours(&table, &row, key).value, expected);
    }
    assert_eq!(ours(&table, &row, "cr_change_pp").interval, Some([0.0, 50.0]), "paired by route");
    assert_eq!(ours(&table, &row, "seen_parent_attack").interval, None);
    assert_eq!(table.rows().next().unwrap().counts, [3, 3, 1, 4]);
    assert!(from_their_parts(&table, std::slice::from_ref(&made)) >= 15);
    assert_eq!(table.rows().count(), 1, "nothing of the paper's stands here, so nothing is missing");
}

#[test]
fn what_a_report_says_of_held_out_routes_is_what_the_table_has() {
    let made = unseen();
    let results: Vec<&LineageResult> = made.result.as_ref().unwrap().lineages.iter().collect();
    let [attack, ars] = held_out_change(&made, &results).unwrap();
    let table = safebench_held_out(std::slice::from_ref(&made)).unwrap();
    let of = |key| ours(&table, &["AS", "IDM"], key);
    near(attack.value, of("evolved_attack").value - of("parent_attack").value);
    let points = of("ars_change_pp");
    near(100.0 * ars.value, points.value);
    let ends = |interval: Option<[f64; 2]>| interval.map(|ends| ends.map(|end| num::rounded(end, 9)));
    assert_eq!(ends(ars.interval.map(|ends| ends.map(|end| 100.0 * end))), ends(points.interval));
    // Of lane changing's two routes one is gained: a draw gains none, one or both.
    let [low, high] = attack.interval.unwrap();
    assert!(low == 0.0 && high > attack.value, "{attack:?}");
    assert!(held_out_change(&recorded(&[&ADVSIM]), &results).is_none(), "nothing was held out");
}

#[test]
fn held_out_scores_that_are_not_those_of_their_runs_are_refused() {
    let mut changed = unseen();
    changed.held_out[1].runs[1].run.as_mut().unwrap().run.collision = false;
    let refused = |made: RecordedRun| safebench_held_out(&[made]).unwrap_err().to_string();
    assert!(refused(changed).contains("held-out scores of advsim-idm/e0s0 that are not those of its runs"));
    let mut earlier = unseen();
    earlier.held_out.iter_mut().for_each(|of| of.runs.clear());
    assert!(refused(earlier).contains("was recorded by an earlier build"));
    let mut without = unseen();
    without.held_out.pop();
    assert!(refused(without).contains("no held-out labels"));
}

#[test]
fn seeds_of_one_search_share_a_row() {
    let mut made = recorded(&[&Lineage { id: "advsim-idm-s0", ..ADVSIM }, &Lineage { id: "advsim-idm-s1", ..ADVSIM }]);
    for (replica, result) in (0..).zip(&mut made.result.as_mut().unwrap().lineages) {
        (result.group, result.replica) = (LineageId::new("advsim-idm"), replica);
    }
    for table in [safebench_main(&[made.clone()]).unwrap(), safebench_rounds(&[made.clone()]).unwrap()] {
        assert!(from_their_parts(&table, &[made.clone()]) >= 9);
    }
    let table = safebench_main(&[made]).unwrap();
    let advsim = table.rows().next().unwrap();
    assert_eq!(advsim.lineages, ["advsim-idm-s0", "advsim-idm-s1"]);
    assert_eq!(advsim.counts, [4, 8, 2, 0]);
    // Two equal repetitions: the numbers of one.
    let one = safebench_main(&[recorded(&[&ADVSIM])]).unwrap();
    assert_eq!(
        advsim.cell("evolved_cr").ours.unwrap().value,
        one.rows().next().unwrap().cell("evolved_cr").ours.unwrap().value
    );
}

#[test]
fn rollouts_are_counted_once_over_everything_that_was_labelled() {
    let mut made = recorded(&[&ADVSIM]);
    let labels: Score = score("advsim", &[Some((0.0, 1.0)); 4]);
    let solution = SolutionId::new("advsim-idm/parent");
    let finalist = Finalist { lineage: LineageId::new("advsim-idm"), solution, score: labels };
    made.finalists = vec![finalist.clone(), finalist];
    assert_eq!(safebench_main(&[made]).unwrap().rows().next().unwrap().counts, [4, 4, 1, 4]);
}

#[test]
fn every_format_is_rectangular_and_holds_our_numbers_and_the_papers() {
    let made = recorded(&[&ADVSIM, &HUMAN]);
    let made = std::slice::from_ref(&made);
    for table in [safebench_main(made).unwrap(), safebench_rounds(made).unwrap()] {
        let text = markdown(&table);
        let lines: Vec<&str> = text.lines().filter(|line| line.starts_with('|')).collect();
        let cells = |line: &&str| line.matches(" | ").count();
        assert!(lines.len() >= 4 && lines.iter().all(|line| cells(line) == cells(&lines[0])), "{text}");
        let text = latex(&of_a_page(&table), LatexForm::default());
        assert_eq!(text.matches("\\begin{table").count(), table.printed().len());
        assert!(text.is_ascii(), "LaTeX engines differ in what else they print");
        let text = csv(&table);
        let heads = table.labels.len() + 2 + 4 * table.columns.len() + table.counts.len() + 2;
        assert_eq!(text.lines().next().unwrap().split(',').count(), heads);
        assert_eq!(text.lines().count(), 1 + table.rows().filter(|row| !row.missing()).count());
        let json = table.json();
        assert_eq!(json["rows"][0]["groups"], 4);
        assert_eq!(json["rows"][0]["source"], table.parts[0].source.unwrap());
    }
}

#[test]
fn rollouts_a_scene_are_the_mean_of_what_kept_runs_tell_and_without_any_there_is_no_column() {
    let mut made = drawn();
    let told = |made: &RecordedRun| {
        let table = safebench_main(std::slice::from_ref(made)).unwrap();
        table.columns.iter().any(|column| safebench::SEARCHED.contains(&column.key)).then_some(table)
    };
    assert!(told(&made).is_none());
    for round in &mut made.rounds {
        let own = if round.round == 0 { 9 } else { 41 };
        // One of two routes of each family met the ego at once.
        let numbers = [2, own].into_iter().cycle();
        round.selected.iter_mut().zip(numbers).for_each(|(kept, number)| kept.run.search_rollouts = Some(number));
        let mut runs = Runs::default();
        let groups = ADVSIM.rounds[round.round as usize].iter().map(|(family, route, _)| (*family, *route));
        groups.zip(&round.selected).for_each(|(group, kept)| runs.add(group, kept.run));
        round.benchmark = runs.benchmark().unwrap();
    }
    let table = told(&made).unwrap();
    for (key, expected) in [("parent_search_rollouts", 5.5), ("evolved_search_rollouts", 21.5)] {
        assert!((ours(&table, &["AS", "IDM"], key).value - expected).abs() < 1e-12, "{key}");
    }
    assert!(
        cell(&table, &["AS", "IDM"], "redrawn_search_rollouts").ours.is_none(),
        "nobody told of the redrawn parent"
    );
    // It looks at the ego four times as often as the parent, which is said; as often as the parent it says nothing.
    let says = |table: &Table| table.notes.iter().any(|note| note.contains("AS/IDM 21.5 for 5.5"));
    assert!(says(&table), "{:?}", table.notes);
    let rows: Vec<_> = table.rows().cloned().collect();
    let alike = |row: &mut super::Row| {
        let own = cell(&table, &["AS", "IDM"], "parent_search_rollouts").ours;
        let place = row.cells.iter().position(|cell| cell.column.key == "evolved_search_rollouts").unwrap();
        row.cells[place].ours = own;
    };
    let mut same = rows.clone();
    same.iter_mut().for_each(alike);
    assert_eq!((safebench::searched_more(&rows).is_some(), safebench::searched_more(&same)), (true, None));
}
