//! The audit on the quickstart's record: sound as it is, and whatever is changed in it is found.

use evodrive::evidence::{Gravity, RecordedRun, audit};
use evodrive::kernel::Digest;
use evodrive::objects::event::FrontPoint;
use evodrive::objects::{Exit, Met, Objectives, RouteDecision, SceneScore, SolutionId};
use evodrive::store::{Transcript, read_events};
use evodrive::world::drawn_by_monitor;

use crate::harness::run;
use crate::short::{copied, finished};

fn recorded() -> RecordedRun {
    RecordedRun::read(&read_events(&finished().run.join("transcript.jsonl")).unwrap()).unwrap()
}

/// Place of the first attempt whose exit is the wanted one.
fn first(run: &RecordedRun, wanted: impl Fn(&Exit) -> bool) -> usize {
    run.attempts.iter().position(|attempt| wanted(&attempt.exit)).expect("an attempt with this exit")
}

fn evaluated(exit: &Exit) -> bool {
    matches!(exit, Exit::Evaluated { .. })
}

fn accepted(exit: &Exit) -> bool {
    exit.decision().is_some_and(|decision| decision.gates.any())
}

#[test]
fn a_run_as_it_was_recorded_has_no_breach() {
    let breaches: Vec<_> = audit(&recorded()).into_iter().filter(|f| f.gravity == Gravity::Breach).collect();
    assert_eq!(breaches, []);
    let ran = run(&["fsck", finished().run.to_str().unwrap()]);
    assert!(ran.code == 0 && ran.stdout.contains("audit:"), "{}", ran.stdout);
}

#[test]
fn a_run_that_stopped_after_any_event_has_no_breach() {
    let events = read_events(&finished().run.join("transcript.jsonl")).unwrap();
    for end in 1..events.len() {
        let breaches: Vec<_> = audit(&RecordedRun::read(&events[..end]).unwrap());
        assert!(breaches.iter().all(|f| f.gravity == Gravity::Remark), "{end} events: {breaches:?}");
    }
}

type Change = fn(&mut RecordedRun);

/// Changes the first scene of the first label and counts it as attacked.
fn credited(run: &mut RecordedRun, change: fn(&mut SceneScore)) {
    let place = first(run, evaluated);
    if let Exit::Evaluated { score, .. } = &mut run.attempts[place].exit {
        score.scenes[0].attack = 1.0;
        change(&mut score.scenes[0]);
    }
}

#[test]
fn each_change_of_the_record_is_found_by_its_check() {
    let cases: [(&str, &str, Change); 22] = [
        ("continuity", "its hash is", |run| {
            let place = first(run, evaluated);
            if let Exit::Evaluated { candidate, .. } = &mut run.attempts[place].exit {
                candidate.program.parameters.pop_first();
            }
        }),
        ("continuity", "the lineage's first program is not a parent", |run| run.parents[0].program.generation = 1),
        ("continuity", "the active program after it", |run| run.settled[0].active = SolutionId::new("cat-idm/e99s0")),
        ("continuity", "the program that was edited", |run| run.frozen[1].parent = SolutionId::new("cat-idm/e99s0")),
        ("continuity", "admitted no program", |run| {
            let place = first(run, |exit| exit.candidate().is_none());
            let (lineage, epoch) = (run.attempts[place].lineage.clone(), run.attempts[place].epoch);
            let promoted = Some(run.attempts[place].id.clone());
            let settled = run.settled.iter_mut().find(|s| s.lineage == lineage && s.epoch == epoch).unwrap();
            settled.promoted = promoted;
        }),
        ("epochs", "slots were frozen", |run| drop(run.attempts.remove(1))),
        ("epochs", "frozen was", |run| run.attempts[0].parent_hash = Digest::of_bytes(b"another program")),
        ("epochs", "its id is not that", |run| run.attempts[0].id = run.attempts[1].id.clone()),
        ("epochs", "all gates passed", |run| {
            let place = first(run, |exit| matches!(exit, Exit::Invalid { .. }));
            if let Exit::Invalid { gates } = &mut run.attempts[place].exit {
                gates.verdicts.iter_mut().for_each(|verdict| verdict.problems.clear());
            }
        }),
        ("epochs", "the router decided something else", |run| {
            let place = first(run, evaluated);
            if let Exit::Evaluated { route, .. } = &mut run.attempts[place].exit {
                route.decision = RouteDecision::Reject;
            }
        }),
        ("result", "counts the exits", |run| run.result.as_mut().unwrap().exits.declined += 1),
        ("labels", "are not the means", |run| {
            let place = first(run, evaluated);
            if let Exit::Evaluated { score, .. } = &mut run.attempts[place].exit {
                score.objectives.realism -= 0.01;
            }
        }),
        ("labels", "does not act in it", |run| credited(run, |scene| scene.acted = false)),
        ("labels", "in plain replay too", |run| {
            credited(run, |scene| {
                scene.contact = Some(Met {
                    adversary: true,
                    class: "cut_in".into(),
                    avoidable: None,
                    fault: None,
                    avoided_by: None,
                    anyway: true,
                });
            })
        }),
        ("labels", "realism over all scenes and coverage", |run| {
            let place = first(run, evaluated);
            if let Exit::Evaluated { score, .. } = &mut run.attempts[place].exit {
                score.coverage -= 0.01;
            }
        }),
        ("closed suite", "was not open to it", |run| {
            let (place, closed) = (first(run, evaluated), run.opened.held_out_scenes[0].clone());
            if let Exit::Evaluated { score, .. } = &mut run.attempts[place].exit {
                score.scenes[0].scene = closed;
            }
        }),
        ("closed suite", "both an evolution and a selection scene", |run| {
            run.opened.selection_scenes = run.opened.evolution_scenes[..1].to_vec();
        }),
        ("closed suite", "was not open to it", |run| run.opened.selection_scenes = vec!["another".into()]),
        ("front", "labels that no rollout gave it", |run| run.settled[0].front[0].objectives.attack += 0.01),
        ("front", "dominates it", |run| {
            let solution = run.settled[0].front[0].solution.clone();
            run.settled[0].front.push(FrontPoint { solution, objectives: Objectives { attack: -1.0, realism: -1.0 } });
        }),
        ("result", "not its held-out labels", |run| {
            run.result.as_mut().unwrap().lineages[0].evolved.objectives.attack += 0.05;
        }),
        ("result", "not its held-out labels", |run| {
            run.result.as_mut().unwrap().lineages[0].evolved.any_contact += 0.05;
        }),
    ];
    for (check, word, change) in cases {
        let mut run = recorded();
        change(&mut run);
        let findings = audit(&run);
        let found = findings.iter().find(|finding| finding.check == check && finding.what.contains(word));
        assert!(found.is_some_and(|f| f.gravity == Gravity::Breach), "{check}, {word:?}: {findings:?}");
    }
}

#[test]
fn what_the_evaluator_would_have_turned_away_and_the_archive_accepted_is_a_remark() {
    let mut run = recorded();
    let before = audit(&run).len();
    let monitored = |exit: &Exit| exit.score().is_some() && exit.route().is_some_and(drawn_by_monitor);
    let counted =
        |wanted: fn(&Exit) -> bool| run.attempts.iter().map(|a| &a.exit).filter(|e| monitored(e) && wanted(e)).count();
    let (all, wrongly) = (counted(|_| true) + 2, counted(accepted) + 1);
    let drawn = |run: &mut RecordedRun, place: usize| {
        let Exit::Evaluated { route, .. } = &mut run.attempts[place].exit else { panic!("evaluated") };
        route.decision = RouteDecision::Audit;
        route.reason = "audit: left out by the rank, drawn at random, rank 5 of 6".to_string().into();
    };
    // A candidate that the archive refused was turned away rightly.
    let refused = first(&run, |exit| evaluated(exit) && !accepted(exit) && !exit.route().is_some_and(drawn_by_monitor));
    drawn(&mut run, refused);
    assert_eq!(audit(&run).len(), before);
    // One that it accepted was turned away wrongly.
    let place = first(&run, |exit| evaluated(exit) && !accepted(exit) && !exit.route().is_some_and(drawn_by_monitor));
    let Exit::Evaluated { decision, .. } = &mut run.attempts[place].exit else { panic!("evaluated") };
    let gates = &mut decision.gates;
    (gates.coverage.holds, gates.parent_tradeoff.holds, gates.differing_scenes) = (true, true, 1);
    drawn(&mut run, place);
    let findings = audit(&run);
    let remark = findings.iter().find(|finding| finding.check == "monitor").expect("a remark");
    assert_eq!(remark.gravity, Gravity::Remark);
    assert!(remark.what.contains(run.attempts[place].id.as_str()), "{remark}");
    assert!(remark.what.contains(&format!("{wrongly} of {all} candidates")), "{remark}");
}

#[test]
fn fsck_finds_a_record_that_was_changed_and_chained_anew() {
    let dir = tempfile::tempdir().unwrap();
    let folder = copied(dir.path());
    let path = folder.join("transcript.jsonl");
    let events = read_events(&path).unwrap();
    std::fs::remove_file(&path).unwrap();
    let mut transcript = Transcript::create(&path).unwrap();
    let (last, before) = events.split_last().unwrap();
    for event in before {
        transcript.append(&event.kind, &event.body).unwrap();
    }
    let mut body = last.body.clone();
    body["lineages"][0]["evolved"]["objectives"]["attack"] = 0.999.into();
    transcript.seal(&body).unwrap();
    transcript.flush().unwrap();
    drop(transcript);
    let ran = run(&["fsck", folder.to_str().unwrap()]);
    assert_eq!(ran.code, 5, "{}", ran.stdout);
    assert!(!ran.stdout.contains("transcript.jsonl"), "the chain itself holds: {}", ran.stdout);
    assert!(ran.stdout.contains("result.json: /result/lineages/0/evolved"), "{}", ran.stdout);
    assert!(ran.stdout.contains("breach (result) cat-idm: "), "{}", ran.stdout);
}
