//! Worked examples: small recorded runs whose tables were computed by hand.

use std::collections::BTreeMap;

use super::*;
use crate::archive::ArchiveOptions;
use crate::evidence::recorded_run::{Declared, RecordedRun, RunEvents};
use crate::kernel::Digest;
use crate::objects::fixture::scene_score;
use crate::objects::{
    Attempt, FamilyName, LineageId, Met, Objectives, Origin, ParameterValue, Program, Role, RunOrigin, SceneFailure,
    SceneScore, Score, SolutionId,
    attempt::*,
    event::*,
    ids::AttemptId,
    program::CompileContract,
    replay::{ReplayRow, ReplayScene, Replayed, Suite},
};

/// Attack and realism of one scene; `None` = its rollout failed.
pub(in crate::evidence) type Label = Option<(f64, f64)>;

const SCENES: [&str; 4] = ["s1", "s2", "s3", "s4"];

/// A finished run without lineages.
pub(in crate::evidence) fn run(name: &str, models: &[(&str, &str)]) -> RecordedRun {
    let digest = Digest::of_bytes(b"any");
    let text = |(role, label): &(&str, &str)| (role.to_string(), label.to_string());
    RecordedRun::from(RunEvents {
        opened: Opened {
            name: name.into(),
            experiment: digest,
            pool: digest,
            provenance: None,
            evolution_scenes: vec!["d1".into(), "d2".into()],
            selection_scenes: Vec::new(),
            held_out_scenes: SCENES.map(String::from).to_vec(),
            versions: Versions { adapter: 1, sim: 1, eval: 1 },
            contracts: BTreeMap::new(),
            models: models.iter().map(text).collect(),
            search: None,
            without: Vec::new(),
            attack: None,
        },
        parents: Vec::new(),
        composed: Vec::new(),
        counsels: Vec::new(),
        frozen: Vec::new(),
        attempts: Vec::new(),
        settled: Vec::new(),
        evolved: Vec::new(),
        finalists: Vec::new(),
        rounds: Vec::new(),
        held_out: Vec::new(),
        replays: Vec::new(),
        result: Some(RunResult {
            replay: Vec::new(),
            lineages: Vec::new(),
            exits: ExitCounts::default(),
            epochs: 1,
            rollouts: 0,
        }),
        root: Digest::of_bytes(name.as_bytes()),
        redrawn: Vec::new(),
        seed_note: None,
        declared: Declared::default(),
    })
}

fn scripted() -> RecordedRun {
    run("made", &[("actor", "scripted"), ("repair", "scripted")])
}

pub(in crate::evidence) fn score(of: &str, labels: &[Label; 4]) -> Score {
    let scene = |(id, label): (&&str, &Label)| {
        let (attack, realism) = (*label)?;
        Some(SceneScore {
            contact: (attack > 0.0).then(|| Met {
                adversary: true,
                class: "cut_in".into(),
                avoidable: Some(true),
                fault: None,
                avoided_by: None,
                anyway: false,
            }),
            request: Digest::of_bytes(format!("{of} {id}").as_bytes()),
            ..scene_score(id, attack, realism)
        })
    };
    let scenes: Vec<SceneScore> = SCENES.iter().zip(labels).filter_map(scene).collect();
    let failed = SCENES.iter().zip(labels).filter(|(_, label)| label.is_none());
    let failures = failed.map(|(id, _)| SceneFailure {
        scene: id.to_string(),
        reason: "no contact solved".into(),
        too_slow: false,
        abandoned: false,
    });
    let mean = |value: fn(&SceneScore) -> f64| scenes.iter().map(value).sum::<f64>() / scenes.len() as f64;
    let objectives = Objectives { attack: mean(|s| s.attack), realism: mean(|s| s.realism) };
    let realism_all = objectives.realism;
    Score {
        objectives,
        realism_all,
        coverage: 1.0,
        failures: failures.collect(),
        scenes,
        benchmark: None,
        rules: Default::default(),
    }
}

/// A lineage's end: parent, and where there is one, the evolved program.
pub(in crate::evidence) struct End<'a> {
    pub(in crate::evidence) id: &'a str,
    pub(in crate::evidence) family: &'a str,
    pub(in crate::evidence) ego: &'a str,
    pub(in crate::evidence) weight: Option<f64>,
    pub(in crate::evidence) parent: [Label; 4],
    pub(in crate::evidence) evolved: Option<[Label; 4]>,
    pub(in crate::evidence) pf_area_at_3_pct: f64,
}

pub(in crate::evidence) fn add(run: &mut RecordedRun, end: &End<'_>) {
    let lineage = LineageId::new(end.id);
    let parent = SolutionId::new(format!("{}/parent", end.id));
    let child = SolutionId::new(format!("{}/e0s0", end.id));
    let program = Program {
        solution_id: parent.clone(),
        lineage_id: lineage.clone(),
        source_family: FamilyName::new(end.family),
        generation: 0,
        parameters: end.weight.map(|w| ("preference_weight".into(), ParameterValue::Number(w))).into_iter().collect(),
        operator_graph: BTreeMap::new(),
        scenario_conditioned_policy: Vec::new(),
        mechanism_modules: BTreeMap::new(),
        compile_contract: CompileContract { backend: "metadrive".into(), constraints: Vec::new() },
        ancestor_chain: Vec::new(),
    };
    let program_hash = Digest::of_bytes(end.id.as_bytes());
    run.parents.push(ParentAdopted {
        lineage: lineage.clone(),
        ego: end.ego.into(),
        program,
        program_hash,
        origins: vec![],
    });
    let mut held_out = |solution: &SolutionId, labels: &[Label; 4]| {
        let score = score(solution.as_str(), labels);
        let measured = Measured::new(solution.clone(), &score);
        let (lineage, solution) = (lineage.clone(), solution.clone());
        run.held_out.push(HeldOut { lineage, solution, roles: Vec::new(), score, runs: Vec::new() });
        measured
    };
    let before = held_out(&parent, &end.parent);
    let after = end.evolved.as_ref().map(|labels| held_out(&child, labels));
    run.result.as_mut().unwrap().lineages.push(LineageResult {
        group: lineage.clone(),
        replica: 0,
        cut: Vec::new(),
        lineage,
        family: FamilyName::new(end.family),
        ego: end.ego.into(),
        evolved: after.clone().unwrap_or(before.clone()),
        parent: before,
        selection: "1 of 1 reach the realism required".into(),
        endpoint: after,
        at_realism: Vec::new(),
        pf_area_at_3_pct: end.pf_area_at_3_pct,
        pf_area_at_3_pct_by_group: BTreeMap::new(),
        front: Vec::new(),
        hypervolume_by_epoch: Vec::new(),
        exits: ExitCounts::default(),
        held_out_scenes: SCENES.len(),
    });
}

pub(in crate::evidence) const CAT: End<'static> = End {
    id: "cat-idm",
    family: "cat",
    ego: "idm",
    weight: None,
    parent: [Some((1.0, 0.9)), Some((0.0, 0.9)), Some((0.0, 0.9)), Some((0.0, 0.9))],
    evolved: Some([Some((1.0, 0.98)), Some((1.0, 0.96)), Some((0.0, 0.98)), Some((0.0, 0.96))]),
    pf_area_at_3_pct: 12.0,
};

const SAGE: End<'static> = End {
    id: "sage-05-idm",
    family: "sage",
    ego: "idm",
    weight: Some(0.5),
    parent: [Some((0.0, 1.0)); 4],
    evolved: None,
    pf_area_at_3_pct: 0.0,
};

fn row<'t>(table: &'t Table, method: &str) -> &'t Row {
    table.rows().find(|row| row.labels[0] == method).unwrap()
}

fn ours(table: &Table, method: &str, key: &str) -> Estimate {
    row(table, method).cell(key).ours.unwrap()
}

pub(in crate::evidence) fn near(found: f64, expected: f64) {
    assert!((found - expected).abs() < 1e-12, "{found}, expected {expected}");
}

/// Holds every number of a table to what its parts give, bit for bit; how many there are.
pub(in crate::evidence) fn from_their_parts(table: &Table, runs: &[RecordedRun]) -> usize {
    from_their_parts_but(table, runs, &[])
}

/// The same of all columns but these.
fn from_their_parts_but(table: &Table, runs: &[RecordedRun], but: &[&str]) -> usize {
    let bases = Derivations::of(runs);
    let mut count = 0;
    for (row, cell) in table.rows().flat_map(|row| row.cells.iter().map(move |cell| (row, cell))) {
        let (Some(ours), key) = (cell.ours, cell.column.key) else { continue };
        if but.contains(&key) {
            continue;
        }
        let basis = row.derivation(key, &bases).unwrap_or_else(|| panic!("{:?} {key}", row.labels));
        assert_eq!(basis.value(), Some(ours.value), "{:?} {key}: {}", row.labels, basis.formula);
        count += 1;
    }
    count
}

#[test]
fn rates_penalties_and_differences_are_the_hand_computed_ones() {
    let mut run = scripted();
    add(&mut run, &CAT);
    let table = metadrive_policy(&[run]).unwrap();
    for (key, expected) in [
        ("parent_attack", 0.25),
        ("parent_rp_pct", 10.0),
        ("evolved_attack", 0.5),
        ("evolved_rp_pct", 3.0),
        ("endpoint_attack", 0.5),
        ("endpoint_rp_pct", 3.0),
        ("attack_change", 0.25),
        ("rp_change_pp", -7.0),
        ("pf_area_at_3_pct", 12.0),
    ] {
        near(ours(&table, "CAT", key).value, expected);
    }
    let cat = row(&table, "CAT");
    assert_eq!((cat.counts.as_slice(), cat.proposals.as_str()), ([4, 1, 8].as_slice(), "scripted"));
    assert_eq!(cat.cell("parent_attack").paper, Some(0.390));
    assert!(cat.notes.is_empty());
}

#[test]
fn a_penalty_that_is_the_same_in_every_scene_has_no_width_and_a_rate_has_one() {
    let mut run = scripted();
    add(&mut run, &CAT);
    let table = metadrive_policy(&[run]).unwrap();
    let width = |key| {
        let [low, high] = ours(&table, "CAT", key).interval.unwrap();
        high - low
    };
    near(width("parent_rp_pct"), 0.0);
    // Every draw of four from {1, 0, 0, 0}: all four hit the 1 in 1 of 256, three in 12 of 256, so 97.5 % lies at 0.75.
    assert_eq!(ours(&table, "CAT", "parent_attack").interval, Some([0.0, 0.75]));
    // The difference is 1 in the second scene only: paired, it has the same spread and is never negative.
    assert_eq!(ours(&table, "CAT", "attack_change").interval, Some([0.0, 0.75]));
}

#[test]
fn the_main_table_averages_over_the_papers_egos_and_says_which() {
    let mut run = scripted();
    add(&mut run, &CAT);
    let evolved = [Some((1.0, 1.0)), Some((0.0, 1.0)), Some((0.0, 1.0)), Some((0.0, 1.0))];
    let [learned, replay] = ["learned", "replay"].map(|ego| format!("cat-{ego}"));
    let other = |id, ego| End { id, ego, parent: [Some((0.0, 0.8)); 4], evolved: Some(evolved), ..CAT };
    add(&mut run, &End { pf_area_at_3_pct: 2.0, ..other(&learned, "learned") });
    add(&mut run, &other(&replay, "replay"));
    let table = metadrive_main(&[run]).unwrap();
    let cat = row(&table, "CAT");
    assert_eq!(cat.labels[1], "IDM + RL");
    assert_eq!(cat.lineages, ["cat-idm", "cat-learned"]);
    for (key, expected) in [
        ("parent_attack", (0.25 + 0.0) / 2.0),
        ("parent_rp_pct", (10.0 + 20.0) / 2.0),
        ("evolved_attack", (0.5 + 0.25) / 2.0),
        ("evolved_rp_pct", (3.0 + 0.0) / 2.0),
        ("attack_change", 0.25),
        ("attack_change_pct", 200.0),
        ("rp_change_pp", -13.5),
        ("pf_area_at_3_pct", 7.0),
    ] {
        near(ours(&table, "CAT", key).value, expected);
    }
    // The ego that the paper does not have stands apart, without figures of the paper.
    let apart = table.rows().last().unwrap();
    assert_eq!((apart.labels[1].as_str(), apart.in_paper()), ("Replay", false));
}

/// Parent .5 over four scenes, evolved 1/3 over three: in the three that both are labelled in nothing changed.
#[test]
fn a_relative_change_is_that_of_the_rows_own_paired_difference() {
    let mut run = scripted();
    let hit = Some((1.0, 0.9));
    let missed = Some((0.0, 0.9));
    add(&mut run, &End { parent: [hit, hit, missed, missed], evolved: Some([None, hit, missed, missed]), ..CAT });
    let runs = [run];
    let table = metadrive_main(&runs).unwrap();
    for (key, expected) in
        [("parent_attack", 0.5), ("evolved_attack", 1.0 / 3.0), ("attack_change", 0.0), ("attack_change_pct", 0.0)]
    {
        near(ours(&table, "CAT", key).value, expected);
        let bases = Derivations::of(&runs);
        near(row(&table, "CAT").derivation(key, &bases).unwrap().value().unwrap(), expected);
    }
}

/// Four held-out scenes without a program: one crash, and one scene in which no vehicle moves.
fn replayed() -> Replayed {
    let scene = |(id, (contact, realism)): (&str, (bool, Option<f64>))| ReplayScene {
        scene: id.to_string(),
        contact,
        realism,
        route_completion: 1.0,
    };
    let scenes = [(false, Some(1.0)), (true, Some(0.9)), (false, None), (false, Some(1.0))];
    let row = ReplayRow {
        ego: "idm".into(),
        suite: Suite::HeldOut,
        scenes: 4,
        contact_rate: 0.25,
        realism: Some(2.9 / 3.0),
        route_completion: 1.0,
        benchmark: None,
    };
    Replayed { row, scenes: SCENES.into_iter().zip(scenes).map(scene).collect(), failures: Vec::new() }
}

#[test]
fn the_first_row_is_the_recorded_scenes_without_a_program() {
    let mut run = scripted();
    add(&mut run, &CAT);
    let evolution = ReplayRow { suite: Suite::Evolution, ..replayed().row };
    run.replays = vec![Replayed { row: evolution, ..replayed() }, replayed()];
    let tables = [metadrive_main, metadrive_policy, metadrive_contacts].map(|table| table(&[run.clone()]).unwrap());
    for table in &tables {
        assert!(from_their_parts(table, &[run.clone()]) > 12);
        let first = table.rows().next().unwrap();
        assert_eq!(first.labels[..2], ["Replay (no program)", "IDM"], "{}", table.name);
        assert_eq!((first.missing(), first.counts.as_slice()), (false, [4, 1, 4].as_slice()));
        assert!(first.cells.iter().all(|cell| !cell.column.key.starts_with("evolved") || cell.ours.is_none()));
    }
    for (key, expected) in
        [("parent_attack", 0.0), ("parent_any_contact", 0.25), ("parent_rp_pct", 10.0 / 3.0), ("parent_coverage", 0.0)]
    {
        near(ours(&tables[0], "Replay (no program)", key).value, expected);
    }
    near(ours(&tables[2], "Replay (no program)", "any_contact").value, 0.25);
}

#[test]
fn realism_is_over_the_scenes_acted_in_and_contacts_are_told_by_class() {
    let mut run = scripted();
    add(&mut run, &CAT);
    // The parent acts in two of four scenes: in one the ego is struck from behind, in one it meets somebody else.
    let parent = &mut run.held_out[0].score.scenes;
    parent.iter_mut().for_each(|scene| scene.acted = false);
    for (place, adversary, class) in [(0, true, "rear_end_ego_struck"), (1, false, "ego_strikes")] {
        let realism = [0.5, 0.7][place];
        let contact = Some(Met {
            adversary,
            class: class.into(),
            avoidable: Some(false),
            fault: None,
            avoided_by: None,
            anyway: false,
        });
        parent[place] = SceneScore { acted: true, attack: 0.0, realism, contact, ..parent[place].clone() };
    }
    parent[2].realism = 1.0;
    parent[3].realism = 1.0;
    let main = metadrive_main(&[run.clone()]).unwrap();
    for (key, expected) in [
        ("parent_attack", 0.0),
        ("parent_any_contact", 0.5),
        ("parent_rp_pct", 40.0),
        ("parent_coverage", 0.5),
        ("evolved_coverage", 1.0),
    ] {
        near(ours(&main, "CAT", key).value, expected);
    }
    let contacts = metadrive_contacts(&[run]).unwrap();
    for (key, expected) in [
        ("adversary_contact", 0.25),
        ("any_contact", 0.5),
        ("avoidable_contact", 0.0),
        ("rear_end_ego_struck", 0.25),
        ("ego_strikes", 0.0),
        ("rp_all_pct", 20.0),
    ] {
        near(ours(&contacts, "CAT", key).value, expected);
    }
    let evolved = contacts.rows().find(|row| row.labels[2] == "evolved").unwrap();
    near(evolved.cell("cut_in").ours.unwrap().value, 0.5);
}

#[test]
fn three_readings_of_the_same_contacts_stand_side_by_side() {
    let mut run = scripted();
    add(&mut run, &CAT);
    let put = |scenes: &mut [SceneScore], met: [(&str, bool, bool); 4]| {
        for (scene, (class, avoidable, anyway)) in scenes.iter_mut().zip(met) {
            let contact = Met {
                adversary: true,
                class: class.into(),
                avoidable: Some(avoidable),
                fault: None,
                avoided_by: None,
                anyway,
            };
            *scene = SceneScore { acted: true, attack: 0.0, contact: Some(contact), ..scene.clone() };
        }
    };
    // A ram from behind, a cut-in that could have been avoided, somebody who stands and could not be, and one who is met anyway.
    let of_parent = [
        ("rear_end_ego_struck", true, false),
        ("cut_in", true, false),
        ("stationary_hit", false, false),
        ("ego_strikes", true, true),
    ];
    put(&mut run.held_out[0].score.scenes, of_parent);
    let of_evolved = [
        ("rear_end_ego_struck", true, false),
        ("rear_end_ego_struck", false, false),
        ("stationary_hit", true, false),
        ("ego_strikes", true, false),
    ];
    put(&mut run.held_out[1].score.scenes, of_evolved);
    let readings = metadrive_readings(&[run.clone()]).unwrap();
    for (key, expected) in [
        ("parent_attack", 0.0),
        ("published_parent", 0.75),
        ("published_evolved", 1.0),
        ("published_change", 0.25),
        ("evolved_rams", 0.5),
        ("evolved_standing", 0.25),
        ("preventable_parent", 0.25),
        ("preventable_evolved", 0.5),
        ("preventable_change", 0.25),
    ] {
        near(ours(&readings, "CAT", key).value, expected);
    }
    assert!(from_their_parts(&readings, &[run.clone()]) >= 9);
    // The paper counts collisions: its figure stands beside that reading alone.
    let cat = row(&readings, "CAT");
    assert_eq!((cat.cell("published_parent").paper, cat.cell("parent_attack").paper), (Some(0.39), None));
    // Who does not act brings nothing about, nor does who meets nobody.
    run.held_out[1].score.scenes.iter_mut().for_each(|scene| scene.acted = false);
    near(ours(&metadrive_readings(&[run]).unwrap(), "CAT", "published_evolved").value, 0.0);
}

#[test]
fn seeds_of_one_search_share_a_row_and_their_spread_is_in_its_intervals() {
    let mut run = scripted();
    let evolved = [None, Some([Some((0.0, 1.0)); 4]), Some([Some((1.0, 1.0)); 4])];
    for (replica, evolved) in (0..).zip(evolved) {
        let id = format!("cat-idm-s{replica}");
        add(&mut run, &End { id: &id, evolved, pf_area_at_3_pct: 6.0 * f64::from(replica), ..CAT });
        let result = run.result.as_mut().unwrap().lineages.last_mut().unwrap();
        (result.group, result.replica) = (LineageId::new("cat-idm"), replica);
    }
    let table = metadrive_policy(&[run.clone()]).unwrap();
    from_their_parts(&table, &[run.clone()]);
    let cat = row(&table, "CAT");
    assert_eq!(cat.lineages, ["cat-idm-s0", "cat-idm-s1", "cat-idm-s2"]);
    assert_eq!(cat.counts[1], 3);
    near(cat.cell("parent_attack").ours.unwrap().value, 0.25);
    // Seed 0 keeps its parent: (0.25 + 0 + 1) / 3. Three seeds as far apart as these tell nothing, and a share ends at 0 and 1.
    let attack = cat.cell("evolved_attack").ours.unwrap();
    near(attack.value, 1.25 / 3.0);
    assert_eq!(attack.interval, Some([0.0, 1.0]));
    // 0, 6 and 12: 6 -+ 4.303 √(36 / 3), by hand.
    let area = cat.cell("pf_area_at_3_pct").ours.unwrap();
    near(area.value, 6.0);
    let [low, high] = area.interval.unwrap();
    assert!((low + 8.905).abs() < 2e-3 && (high - 20.905).abs() < 2e-3, "{low} {high}");
    // A seed that is in two runs is one too many.
    assert!(metadrive_policy(&[run.clone(), run]).is_err());
}

/// Three seeds of CAT.
fn three_seeds() -> RecordedRun {
    let mut run = scripted();
    for replica in 0..3 {
        let id = format!("cat-idm-s{replica}");
        add(&mut run, &End { id: &id, ..CAT });
        let result = run.result.as_mut().unwrap().lineages.last_mut().unwrap();
        (result.group, result.replica) = (LineageId::new("cat-idm"), replica);
    }
    run
}

#[test]
fn under_one_seed_a_note_says_that_intervals_hold_no_spread_between_searches() {
    let said = |table: &Table| {
        table.notes.iter().find(|note| note.contains("spread between searches is not in them")).cloned()
    };
    let mut once = scripted();
    add(&mut once, &CAT);
    for make in [metadrive_main, metadrive_policy, metadrive_contacts] {
        let note = said(&make(&[once.clone()]).unwrap()).expect("a note");
        assert!(note.starts_with("One seed is one search: these intervals cover held-out scenes alone."), "{note}");
        assert_eq!(said(&make(&[three_seeds()]).unwrap()), None);
    }
    let mut both = three_seeds();
    add(&mut both, &SAGE);
    let note = said(&metadrive_policy(&[both]).unwrap()).expect("a note");
    assert!(note.starts_with("Where Seeds is 1"), "{note}");
    assert!(markdown(&metadrive_main(&[once]).unwrap()).contains("spread between searches"));
}

#[test]
fn how_a_seed_was_chosen_stands_under_every_table_of_its_run() {
    let mut run = scripted();
    add(&mut run, &CAT);
    run.seed_note = Some("seed 3 was chosen of ten".into());
    for make in [metadrive_main, metadrive_contacts, proposals] {
        let table = make(&[run.clone()]).unwrap();
        assert!(table.notes.iter().any(|note| note.ends_with("Note: seed 3 was chosen of ten.")), "{:?}", table.notes);
    }
}

#[test]
fn who_answered_stands_once_under_every_table_where_the_experiment_says_it() {
    let label = "exchange (agent, big)";
    let mut one = run("one", &[("actor", label), ("repair", "scripted")]);
    add(&mut one, &CAT);
    let said = [
        (label, "Big by Maker, release 3, a fresh one; 29 November 2026."),
        ("exchange (other, idle)", "Idle by another"),
    ];
    one.declared.answered = said.map(|(label, by)| (label.to_string(), by.to_string())).into();
    let mut two = run("two", &[("actor", label), ("repair", "scripted")]);
    add(&mut two, &SAGE);
    two.declared.answered = one.declared.answered.clone();
    for make in [metadrive_policy, metadrive_contacts, proposals] {
        let table = make(&[one.clone(), two.clone()]).unwrap();
        let named: Vec<_> = table.notes.iter().filter(|note| note.contains("Maker") || note.contains("Idle")).collect();
        assert_eq!(named, ["exchange (agent, big): Big by Maker, release 3, a fresh one; 29 November 2026."]);
    }
}

#[test]
fn a_share_of_nothing_has_its_exact_bound_under_the_table_and_the_row_without_a_program_has_none() {
    let bound = |run: &RecordedRun| {
        let table = metadrive_policy(std::slice::from_ref(run)).unwrap();
        table.notes.iter().find(|note| note.contains("all scenes agree")).cloned()
    };
    let mut run = scripted();
    add(&mut run, &SAGE);
    // SAGE succeeds in none of four scenes and acts in all: 1 - 0.05^(1/4) = 0.527, by hand.
    let note = bound(&run).expect("a note");
    assert!(
        note.contains("with 0 of 4 the true share may be up to 0.527; with 4 of 4 it may be down to 0.473"),
        "{note}"
    );
    let mut half = scripted();
    let partly = [Some((1.0, 0.9)), Some((0.0, 0.9)), None, None];
    add(&mut half, &End { parent: partly, evolved: None, ..CAT });
    let alone = bound(&half).unwrap_or_default();
    assert!(!alone.contains("with 0 of 4"), "one of two labelled scenes is a success: {alone}");
}

#[test]
fn what_was_not_run_is_missing_and_the_learned_ego_is_absent() {
    let mut run = scripted();
    add(&mut run, &CAT);
    add(&mut run, &SAGE);
    let policy = metadrive_policy(&[run.clone()]).unwrap();
    assert_eq!(policy.rows().count(), 10);
    assert!(policy.rows().all(|row| row.labels[1] == "IDM"));
    let missing: Vec<&str> = policy.rows().filter(|row| row.missing()).map(|row| row.labels[0].as_str()).collect();
    assert_eq!(missing, ["ADV-BMT", "AT", "SAGE (w=0.00)", "SAGE (w=1.00)", "LLM-Attacker", "KING", "SEAL", "STRIVE"]);
    assert!(policy.rows().filter(|row| row.missing()).all(|row| row.cells.iter().all(|cell| cell.ours.is_none())));
    let text = markdown(&policy);
    // Rows of the paper's stand beside ours alone; what is missing is told in a note.
    assert!(text.contains("learned ego (RL) is absent") && text.contains("KING with IDM"), "{text}");
    assert!(!text.contains("| KING") && text.matches("| · paper").count() == 2, "{text}");
    assert_eq!(csv(&policy).lines().count(), 1 + 2);
    let main = metadrive_main(&[run]).unwrap();
    assert_eq!(row(&main, "SAGE").lineages, ["sage-05-idm"]);
    assert!(markdown(&main).contains("SAGE (w=0.00) with IDM"));
}

#[test]
fn a_sage_row_is_named_by_its_parents_weight_and_a_variant_by_its_id() {
    let mut run = scripted();
    add(&mut run, &SAGE);
    add(&mut run, &End { id: "sage-1-idm", weight: Some(1.0), ..SAGE });
    add(&mut run, &End { id: "sage-03-idm", weight: Some(0.3), ..SAGE });
    add(&mut run, &End { id: "cat-short-idm", ..CAT });
    let table = metadrive_policy(&[run]).unwrap();
    assert_eq!(row(&table, "SAGE (w=0.50)").lineages, ["sage-05-idm"]);
    assert_eq!(row(&table, "SAGE (w=1.00)").lineages, ["sage-1-idm"]);
    // A variant says its method and its id.
    assert!(!row(&table, "SAGE (sage-03)").in_paper() && !row(&table, "CAT (cat-short)").in_paper());
    assert!(row(&table, "CAT").missing());
}

/// `init --driver` calls a lineage `cat-mine`.
#[test]
fn a_planner_stands_by_its_name_beside_the_methods_and_two_planners_are_two_rows() {
    let against = |planner: &str, id: &str| {
        let mut run = scripted();
        add(&mut run, &End { id, ego: "command", ..CAT });
        run.declared.planner = Some(planner.into());
        run
    };
    let runs = [against("careful.py", "cat-mine"), against("bold.py", "cat-mine")];
    for table in [metadrive_policy(&runs).unwrap(), metadrive_main(&runs).unwrap()] {
        let ours: Vec<[&str; 2]> = table
            .rows()
            .filter(|row| !row.missing())
            .map(|row| [row.labels[0].as_str(), row.labels[1].as_str()])
            .collect();
        assert_eq!(ours, [["CAT", "careful.py"], ["CAT", "bold.py"]], "{}", table.name);
        from_their_parts(&table, &runs);
    }
    // Nobody knows its name where the experiment cannot be read; a program from elsewhere is no method as published.
    let mut run = against("", "cat-mine");
    run.declared.planner = None;
    let (root, solution) = (Digest::of_bytes(b"other"), SolutionId::new("cat-idm/e0s0"));
    let of = RunOrigin { run: "other".into(), root, solution, models: BTreeMap::new() };
    run.parents[0].origins = vec![Origin::Run(of)];
    let table = metadrive_policy(&[run]).unwrap();
    assert_eq!(row(&table, "CAT (cat-mine)").labels[1], "command");
}

/// An archive that measures areas from the origin.
fn archive() -> ArchiveOptions {
    ArchiveOptions {
        reference: [0.0; 2],
        r0: 0.95,
        a0: 0.5,
        epsilon_r: 0.0,
        epsilon_a: 0.0,
        epsilon_pf: 1e-3,
        level: 0.8,
        coverage_floor: 0.8,
        ..ArchiveOptions::default()
    }
}

/// Three seeds of CAT under a method, the evolved programs with these labels.
fn searched(method: Option<&str>, evolved: [Label; 4]) -> RecordedRun {
    let mut run = run(method.unwrap_or("search"), &[("actor", "scripted scripted-1")]);
    run.opened.search = method.map(|method| Searched { method: method.into(), rollouts: None });
    for replica in 0..3 {
        let id = format!("cat-idm-s{replica}");
        add(&mut run, &End { id: &id, evolved: Some(evolved), ..CAT });
        let result = run.result.as_mut().unwrap().lineages.last_mut().unwrap();
        (result.group, result.replica) = (LineageId::new("cat-idm"), replica);
        let at = |realism_min: f64, chosen: &Measured| AtRealism { realism_min, reached: true, chosen: chosen.clone() };
        let (parent, child) = (&result.parent, &result.evolved);
        result.at_realism = vec![at(0.9, child), at(0.95, child), at(0.98, parent)];
    }
    for (held_out, role) in run.held_out.iter_mut().zip(["parent", "descendant"].into_iter().cycle()) {
        held_out.roles = vec![role.to_string()];
    }
    run.declared.archive = Some(archive());
    run
}

#[test]
fn gains_stand_beside_floors_of_realism_absolute_areas_and_null_searches() {
    let missed = [Some((0.0, 0.98)), Some((0.0, 0.96)), Some((0.0, 0.98)), Some((0.0, 0.96))];
    let runs = [
        searched(None, CAT.evolved.unwrap()),
        searched(Some("random_proposals"), missed),
        searched(Some("shuffled_labels"), CAT.evolved.unwrap()),
    ];
    let table = metadrive_gains(&runs).unwrap();
    let wanted = [
        ("parent_attack", 0.25),
        ("evolved_attack", 0.5),
        ("floor_low", 0.5),
        ("floor_middle", 0.5),
        // No descendant is realistic enough there, so it is the parent.
        ("floor_high", 0.25),
        ("area_parent", 0.25 * 0.9),
        ("area_evolved", 0.5 * 0.97),
        ("area_change", 0.5 * 0.97 - 0.25 * 0.9),
        // Successes in scenes 1 and 2 against none.
        ("over_random_proposals", 0.5),
        ("over_shuffled_labels", 0.0),
    ];
    for (key, expected) in wanted {
        near(ours(&table, "CAT", key).value, expected);
    }
    assert!(from_their_parts_but(&table, &runs, &["p_random_proposals", "p_shuffled_labels"]) >= 10);
    assert!(table.notes.iter().any(|note| note.contains("at least 0.90, 0.95, 0.98")), "{:?}", table.notes);
    let p = |key| ours(&table, "CAT", key).value;
    assert!(p("p_random_proposals") < p("p_shuffled_labels"), "no difference is the likelier one");
    assert!(matches!(metadrive_gains(&[runs[0].clone(), runs[0].clone()]), Err(TableError::NoNullSearch { .. })));
}

#[test]
fn a_row_that_no_null_search_was_made_for_is_empty_there_and_so_is_the_row_over_all_and_a_note_says_it() {
    let missed = [Some((0.0, 0.98)); 4];
    let mut whole = searched(None, CAT.evolved.unwrap());
    // A search that gains more than the other, so that its part in a mean would show.
    add(&mut whole, &End { evolved: Some([Some((1.0, 1.0)); 4]), ..SAGE });
    let mut shuffled = searched(Some("shuffled_labels"), missed);
    add(&mut shuffled, &End { evolved: Some(missed), ..SAGE });
    let without_one = shuffled.result.as_mut().unwrap().lineages.pop().unwrap();
    let table =
        metadrive_gains(&[whole.clone(), searched(Some("random_proposals"), missed), shuffled.clone()]).unwrap();
    let empty =
        |of: &str, key| row(&table, of).cells.iter().find(|cell| cell.column.key == key).unwrap().ours.is_none();
    for key in ["over_random_proposals", "p_random_proposals", "over_shuffled_labels", "p_shuffled_labels"] {
        assert!(empty("SAGE (w=0.50)", key) && empty("All 2", key) && !empty("CAT", key), "{key}");
    }
    let runs = [whole.clone(), searched(Some("random_proposals"), missed), shuffled.clone()];
    let bases = Derivations::of(&runs);
    let says = |of: &str| row(&table, of).derivation("over_random_proposals", &bases).is_some();
    assert_eq!(["CAT", "SAGE (w=0.50)", "All 2"].map(says), [true, false, false], "what is asked why");
    // Two repetitions of three, which may be those that went well.
    let mut part = searched(Some("random_proposals"), missed);
    part.result.as_mut().unwrap().lineages.pop();
    let parted = metadrive_gains(&[searched(None, CAT.evolved.unwrap()), part]).unwrap();
    let cells = &row(&parted, "CAT").cells;
    assert!(cells.iter().any(|cell| cell.column.key == "over_random_proposals" && cell.ours.is_none()));
    assert!(parted.notes.iter().any(|note| note.contains("not searched for CAT against IDM")));
    let said = |table: &Table| {
        table.notes.iter().filter(|note| note.contains("not searched for SAGE (w=0.50) against IDM")).count()
    };
    assert_eq!(said(&table), 2, "{:?}", table.notes);
    shuffled.result.as_mut().unwrap().lineages.push(without_one);
    let both = metadrive_gains(&[whole, shuffled]).unwrap();
    assert_eq!(said(&both), 0, "{:?}", both.notes);
    near(ours(&both, "All 2", "over_shuffled_labels").value, 0.75);
}

#[test]
fn the_frontier_area_is_worked_out_again_and_names_who_spans_it() {
    let mut run = scripted();
    // Attack 0.25 at 0.9 of the parent; 0.5 at 0.97 of the descendant: (0.485 - 0.225) / 0.225.
    add(&mut run, &End { pf_area_at_3_pct: 100.0 * (0.485 - 0.225) / 0.225, ..CAT });
    run.declared.archive = Some(archive());
    for (held_out, role) in run.held_out.iter_mut().zip(["parent", "descendant"]) {
        held_out.roles = vec![role.to_string()];
    }
    let runs = [run];
    let table = metadrive_policy(&runs).unwrap();
    let basis = row(&table, "CAT").derivation("pf_area_at_3_pct", &Derivations::of(&runs)).unwrap();
    near(basis.value().unwrap(), 100.0 * (0.485 - 0.225) / 0.225);
    let said = basis.parts[0].steps.join("\n");
    for part in [
        "reference point: attack 0, strict realism 0",
        "parent cat-idm/parent: attack 0.25, strict realism 0.9; it spans 0.225",
        "descendant cat-idm/e0s0: attack 0.5, strict realism 0.97; it spans",
    ] {
        assert!(said.contains(part), "{part}: {said}");
    }
}

#[test]
fn a_scene_without_a_label_counts_nowhere_and_is_told() {
    let mut run = scripted();
    let parent = [Some((1.0, 0.9)), Some((0.0, 0.9)), Some((0.0, 0.9)), None];
    let evolved = [None, Some((1.0, 0.9)), Some((0.0, 0.9)), Some((1.0, 0.9))];
    add(&mut run, &End { parent, evolved: Some(evolved), ..CAT });
    let table = metadrive_policy(&[run]).unwrap();
    near(ours(&table, "CAT", "parent_attack").value, 1.0 / 3.0);
    near(ours(&table, "CAT", "evolved_attack").value, 2.0 / 3.0);
    // Both are labelled in the second and third scene only.
    near(ours(&table, "CAT", "attack_change").value, 0.5);
    assert!(table.notes.iter().any(|note| note.starts_with("cat-idm: up to 1 of 4 held-out scenes have no label")));
}

pub(in crate::evidence) fn attempt(lineage: &str, slot: u32, exit: Exit) -> Attempt {
    let lineage = LineageId::new(lineage);
    Attempt {
        id: AttemptId::at(&lineage, 0, slot),
        parent: SolutionId::new(format!("{lineage}/parent")),
        lineage,
        epoch: 0,
        slot,
        parent_hash: Digest::of_bytes(b"parent"),
        target: String::new(),
        memory_shown: Vec::new(),
        proposal: Proposal::default(),
        exit,
    }
}

fn failed(gates: &[Gate]) -> GateReport {
    let verdict = |gate: &Gate| GateVerdict { gate: *gate, problems: vec!["wrong".into()] };
    GateReport { verdicts: gates.iter().map(verdict).collect() }
}

pub(in crate::evidence) fn simulated(routed: RouteDecision, accepted: bool, attack_change: f64) -> Exit {
    let any = Digest::of_bytes(b"any");
    let predicted = Objectives { attack: 0.0, realism: 1.0 };
    let route = Route {
        decision: routed,
        reason: String::new().into(),
        snapshot: any,
        predicted,
        uncertainty: 0.0,
        half_width: None,
        rank_score: None,
        weight: None,
        pilot: None,
    };
    let mut run = scripted();
    add(&mut run, &SAGE);
    let program = run.parents[0].program.clone();
    let candidate = Box::new(Candidate { program, program_hash: any, patch_hash: any, mechanism_tags: Vec::new() });
    let gates = GateReport::default();
    if routed == RouteDecision::Reject {
        return Exit::Rejected { gates, candidate, route };
    }
    let decision = Decision {
        promoted: false,
        on_front: false,
        race: None,
        gates: Box::new(AcceptanceGates {
            densification: Densification { holds: accepted, non_dominated: accepted, ..Densification::default() },
            parent_tradeoff: ParentTradeoff { attack_change, realism_change: -0.1, ..ParentTradeoff::default() },
            coverage: CoverageFloor { holds: true, ..CoverageFloor::default() },
            differing_scenes: 1,
            ..AcceptanceGates::default()
        }),
    };
    Exit::Evaluated { gates, candidate, route, score: score("child", &[Some((0.0, 1.0)); 4]), decision }
}

#[test]
fn no_gain_is_zero_and_a_note_counts_what_stopped_it() {
    let mut run = scripted();
    add(&mut run, &SAGE);
    let exits = [
        Exit::Declined { reason: "no JSON".into() },
        Exit::Invalid { gates: failed(&[Gate::Schema, Gate::Compile]) },
        Exit::Invalid { gates: failed(&[Gate::Isolation]) },
        Exit::Invalid { gates: failed(&[Gate::Isolation, Gate::Compile]) },
        simulated(RouteDecision::Reject, false, 0.0),
        simulated(RouteDecision::Select, true, 0.1),
        simulated(RouteDecision::Select, false, 0.1),
        simulated(RouteDecision::Audit, false, 0.0),
        simulated(RouteDecision::Select, false, -0.1),
    ];
    run.attempts = (0..).zip(exits).map(|(slot, exit)| attempt("sage-05-idm", slot, exit)).collect();
    run.attempts.push(attempt("other-idm", 0, Exit::Declined { reason: "not of this lineage".into() }));
    let table = metadrive_policy(&[run]).unwrap();
    let zero = ours(&table, "SAGE (w=0.50)", "attack_change");
    assert_eq!((zero.value, zero.interval), (0.0, Some([0.0, 0.0])));
    let note = "SAGE (w=0.50), IDM: no gain, the parent stays active and descendants add no frontier area; 9 attempts: \
                1 declined, 3 invalid (gates: schema 1, isolation 2), 1 rejected, 4 evaluated, \
                of these 1 accepted, 1 not accepted with more attack than the parent but too little realism, 2 with no \
                more attack; final choice: 1 of 1 reach the realism required.";
    assert_eq!(row(&table, "SAGE (w=0.50)").notes, [note]);
    assert!(markdown(&table).contains(note));
}

#[test]
fn a_row_from_two_runs_and_an_unfinished_run_are_refused() {
    let mut run = scripted();
    add(&mut run, &CAT);
    let twice = metadrive_main(&[run.clone(), run.clone()]).unwrap_err().to_string();
    assert!(twice.starts_with("row CAT with ego idm is in cat-idm of run made"), "{twice}");
    run.held_out.clear();
    assert!(matches!(metadrive_main(&[run.clone()]), Err(TableError::NoLabels { .. })));
    run.result = None;
    let unfinished = metadrive_policy(&[run]).unwrap_err().to_string();
    assert!(unfinished.contains("evodrive resume"), "{unfinished}");
}

#[test]
fn proposals_name_the_kinds_of_models_and_no_stand_in_passes_for_a_language_model() {
    let mut run = run("mixed", &[("actor", "openai_compatible (qwen, q)"), ("repair", "scripted")]);
    add(&mut run, &CAT);
    let mut second = scripted();
    add(&mut second, &SAGE);
    let table = metadrive_policy(&[run, second]).unwrap();
    assert_eq!(row(&table, "CAT").proposals, "openai_compatible + scripted");
    assert_eq!(row(&table, "SAGE (w=0.50)").proposals, "scripted");
    let note = table.notes.iter().find(|note| note.starts_with("Run mixed")).unwrap();
    assert!(note.contains("openai_compatible (qwen, q) as actor; scripted as repair"), "{note}");
    assert!(note.contains("not a language model"), "{note}");
}

#[test]
fn a_role_that_nobody_was_asked_for_proposed_nothing() {
    let scripted = [("actor", "scripted"), ("attacker_agent", "scripted"), ("realism_critic", "scripted")];
    for method in ["random_proposals", "random"] {
        let mut drawn = run("drawn", &scripted);
        add(&mut drawn, &CAT);
        drawn.opened.search = Some(Searched { method: method.into(), rollouts: None });
        let table = metadrive_policy(&[drawn.clone()]).unwrap();
        assert_eq!(row(&table, "CAT").proposals, "random");
        let note = table.notes.iter().find(|note| note.starts_with("Run drawn")).unwrap();
        assert!(note.contains("proposals from random legal patches as actor; scripted as attacker_agent (s"), "{note}");
        assert_eq!(drawn.scripted_roles(), ["attacker_agent"]);
        assert_eq!(table.json()["runs"][0]["models"]["actor"], "random legal patches");
    }
    // A search without critics names none, though its experiment has models for them.
    let mut asked = run("asked", &[("actor", "exchange (agent, big)"), ("realism_critic", "scripted")]);
    add(&mut asked, &CAT);
    let named = |run: &RecordedRun| row(&metadrive_policy(std::slice::from_ref(run)).unwrap(), "CAT").proposals.clone();
    let exchange = |role| Exchange {
        role,
        round: 0,
        request: Digest::of_bytes(b"question"),
        response: Digest::of_bytes(b"answer"),
        model: "agent".into(),
        metadata: None,
        unwrapped: Vec::new(),
        refusal: None,
    };
    let asking = |slot, role| {
        let mut of = attempt("cat-idm", slot, Exit::Declined { reason: "none".into() });
        of.proposal.exchanges.push(exchange(role));
        of
    };
    asked.attempts.push(asking(0, Role::Actor));
    assert_eq!(named(&asked), "exchange");
    asked.attempts.push(asking(1, Role::RealismCritic));
    assert_eq!(named(&asked), "exchange + scripted");
}

/// A run's events do not hold which contacts its experiment counts, so a note that named one reading would be wrong below the others.
#[test]
fn the_note_on_attack_names_every_reading_or_gives_way_to_an_experiments_own() {
    let mut run = scripted();
    add(&mut run, &CAT);
    let note = metadrive_main(&[run.clone()]).unwrap().notes.remove(0);
    for reading in ["(published reading)", "(preventable)", "caused or could have avoided"] {
        assert!(note.contains(reading), "{reading}: {note}");
    }
    run.opened.attack = Some("struck_by_ego".into());
    let notes = metadrive_main(&[run]).unwrap().notes;
    assert!(notes[0].starts_with("Attack: see below. Any crash"), "{}", notes[0]);
    assert!(notes.iter().any(|note| note.contains("the program acts: struck_by_ego")), "{notes:?}");
}

#[test]
fn every_format_is_rectangular_and_holds_our_numbers_and_the_papers() {
    let mut run = scripted();
    add(&mut run, &CAT);
    add(&mut run, &SAGE);
    for table in [metadrive_main(&[run.clone()]).unwrap(), metadrive_policy(&[run]).unwrap()] {
        let text = markdown(&table);
        let lines: Vec<&str> = text.lines().filter(|line| line.starts_with('|')).collect();
        let cells = |line: &&str| line.matches(" | ").count();
        // Heads, their rule, and two rows of ours, each with the paper's where it has one.
        assert!(lines.len() >= 4 && lines.iter().all(|line| cells(line) == cells(&lines[0])), "{text}");
        assert!(text.contains("0.250 [0.000, 0.750]"), "{text}");
        let text = latex(&table, LatexForm { whole: true, paper: true });
        assert!(text.contains("\\evointerval{0.250}{{[}0.000, 0.750{]}}") && text.contains("10.00\\%"), "{text}");
        let text = csv(&table);
        let head = text.lines().next().unwrap();
        assert_eq!(head.split(',').count(), 9 + 4 * table.columns.len());
        let measured = text.lines().find(|line| line.starts_with("CAT,IDM,measured,cat-idm,")).unwrap();
        assert!(measured.contains("cat-idm,0.25,0,0.75,0.3"), "{measured}");
        let json = table.json();
        assert_eq!(json["rows"][0]["values"]["parent_attack"]["ours"]["value"], 0.25);
        assert_eq!(json["rows"][1]["missing"], true);
    }
}
