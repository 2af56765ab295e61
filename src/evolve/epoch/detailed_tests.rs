//! Detailed questions: what they say is what the simulator measured, an edit without effect is told why, and the first form of questions
//! stays as it is.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::LazyLock;

use super::Without;
use super::tests::{Patience, Ran, carried_out_asking, study, three_families};
use crate::agents::Questions;
use crate::epoch::labelling::play::Player;
use crate::experiment::Experiment;
use crate::kernel::{OrientedBox, Threads, Vec2, num};
use crate::llm::Request;
use crate::objects::Exit;
use crate::objects::attempt::Gate;
use crate::sim::{ActorRef, Striker};

fn detailed() -> Experiment {
    let mut experiment = three_families();
    experiment.questions = Questions::Detailed;
    experiment
}

/// One run for all that only look at its questions.
static RAN: LazyLock<(Ran, Vec<Request>)> = LazyLock::new(|| heard(&detailed()));

fn heard(experiment: &Experiment) -> (Ran, Vec<Request>) {
    let patience = Patience::default();
    let ran = carried_out_asking(experiment, None, &patience);
    (ran, patience.heard.into_inner().unwrap())
}

/// The rows of a table below a title, cell by cell, by the heads of its columns.
fn table(text: &str, title: &str) -> Vec<BTreeMap<String, String>> {
    let behind = text.split_once(&format!("## {title}\n")).unwrap().1;
    let block = behind.split_once("```text\n").unwrap().1.split_once("\n```").unwrap().0;
    let mut lines = block.lines().map(|line| line.split(" | ").map(str::to_string).collect::<Vec<_>>());
    let head = lines.next().unwrap();
    lines.map(|cells| head.iter().cloned().zip(cells).collect()).collect()
}

#[test]
fn every_scene_is_told_as_it_came_about() {
    let experiment = detailed();
    let (ran, requests) = &*RAN;
    let threads = Threads::new(2).unwrap();
    let study = study(&experiment, &threads);
    let player = Player::of(&study, &[], crate::backend::Backend::Own);
    let (mut contacts, mut misses) = (0, 0);
    for spec in &study.lineages {
        let parent = study.parent(spec).unwrap();
        let request = requests.iter().find(|of| of.slot.lineage == spec.id.as_str() && of.slot.epoch == 0).unwrap();
        for row in table(&request.messages[1].text, "Window") {
            let place = study.scenes.iter().position(|entry| entry.scene().id == row["scene"]).unwrap();
            let played = player.trace(spec, &parent, place).unwrap();
            let outcome = &played.record.outcome;
            let Ok(at_s) = row["at_s"].parse::<f64>() else {
                assert!(!outcome.acted(), "{row:?}");
                continue;
            };
            let trace = &played.motion;
            let acts = |who: ActorRef| outcome.adversaries.iter().any(|of| of.actor == who && of.acted);
            let k = match outcome.contact {
                Some(contact) => {
                    contacts += 1;
                    assert!((contact.time_s - at_s).abs() < 0.051, "{row:?}: contact at {}", contact.time_s);
                    trace.ego.len() - 1
                }
                None => {
                    misses += 1;
                    (at_s * 10.0).round() as usize
                }
            };
            let ego_mps: f64 = row["ego_mps"].parse().unwrap();
            assert!((trace.ego[k].speed_mps() - ego_mps).abs() < 0.051, "{row:?}");
            let how = &row["how"];
            let taken: Vec<String> =
                played.decision.actors.iter().map(|of| format!("{} of {}", of.chosen + 1, of.candidates)).collect();
            assert!(how.contains(&format!("took {}", taken.join(", "))), "{row:?}");
            if let Some(contact) = outcome.contact {
                let strikes = match contact.striker {
                    Striker::Ego => "ego strikes",
                    Striker::Other => "it strikes",
                    Striker::Both => "both strike",
                };
                assert!(how.contains(strikes), "{row:?}: {contact:?}");
                let seen = contact.visible_s.map(|seen_s| format!("; seen {seen_s:.1} s"));
                assert!(seen.is_none_or(|seen| how.contains(&seen)), "{row:?}: {contact:?}");
                assert!(contact.avoidable == Some(false) || !how.contains("too late"), "{row:?}: {contact:?}");
                // On which side it is: the sine of the bearing has the sign of its place to the ego's left.
                let other = trace.actors.iter().find(|of| of.actor == contact.with).unwrap();
                let own = other.samples[k].as_ref().or(other.samples[k - 1].as_ref()).unwrap();
                let away = own.position - trace.ego[k].position;
                let left = away.dot(Vec2::from_heading(trace.ego[k].heading_rad).left()) / away.norm();
                let bearing: f64 = row["bearing"].parse().unwrap();
                assert!((num::sin(bearing.to_radians()) - left).abs() < 0.02, "{row:?}: {left}");
            }
            // It brakes where its speed falls by more than 0.15 m/s within one of its whole steps.
            let whole = &trace.ego[..trace.ego.len() - 1];
            let falls = whole.windows(2).map(|pair| pair[0].speed_mps() - pair[1].speed_mps());
            assert_eq!(how.contains("ego brakes"), falls.fold(0.0, f64::max) > 0.15, "{row:?}");
            // Nobody that acts is nearer at any other step.
            let size = &study.scenes[place].scene().ego.track;
            let distance_m = |k: usize| {
                let ego = &trace.ego[k];
                let ego = OrientedBox::new(ego.position, ego.heading_rad, size.length_m, size.width_m);
                let others = trace.actors.iter().filter(|of| acts(of.actor)).filter_map(|of| {
                    let own = of.samples.get(k)?.as_ref()?;
                    Some(OrientedBox::new(own.position, own.heading_rad, of.length_m, of.width_m).distance(&ego))
                });
                others.fold(f64::INFINITY, f64::min)
            };
            let least_m = (0..trace.ego.len()).map(distance_m).fold(f64::INFINITY, f64::min);
            assert!(outcome.contact.is_some() || distance_m(k) <= least_m + 1e-9, "{row:?}: {least_m}");
        }
    }
    assert!(contacts > 0 && misses > 0, "{contacts} contacts, {misses} misses");
    // Near misses are those of the whole window, not of the scenes that are shown.
    let mut near_misses = 0;
    for frozen in ran.frozen.iter().filter(|of| of.epoch == 0) {
        let spec = study.lineages.iter().find(|spec| spec.id == frozen.lineage).unwrap();
        let parent = study.parent(spec).unwrap();
        let near = frozen.parent_score.scenes.iter().filter(|scene| {
            let place = study.scenes.iter().position(|entry| entry.scene().id == scene.scene).unwrap();
            let outcome = player.trace(spec, &parent, place).unwrap().record.outcome;
            let below = |value: Option<f64>| value.is_some_and(|value| value < 1.0);
            let close = below(outcome.distance_m_min) || below(outcome.ttc_s_min);
            scene.attack == 0.0 && outcome.acted() && close
        });
        let near = near.count();
        let request = requests.iter().find(|of| of.slot.lineage == spec.id.as_str() && of.slot.epoch == 0).unwrap();
        assert!(request.messages[1].text.contains(&format!("\"near_misses\":{near},")), "{near}");
        near_misses += near;
    }
    assert!(near_misses > 0, "nothing nearly happened, so nothing was shown");
    assert!(ran.attempts.iter().any(|attempt| attempt.exit.score().is_some()));
}

/// `text` without what stands from `from` to before `to`, which must be there.
fn cut(text: &str, from: &str, to: &str) -> String {
    let (before, behind) = text.split_once(from).unwrap_or_else(|| panic!("no {from:?} in {text}"));
    before.to_string() + behind.find(to).map(|at| &behind[at..]).unwrap()
}

#[test]
fn a_search_without_sight_is_asked_the_same_less_what_the_ego_sees_and_how_it_drives() {
    let mut experiment = detailed();
    let told = &RAN.1;
    let digest = experiment.digest().unwrap();
    experiment.without = Some(Without { sight: true, ..Without::default() });
    assert_ne!(experiment.digest().unwrap(), digest);
    let (ran, untold) = heard(&experiment);
    assert!(ran.attempts.iter().any(|attempt| attempt.exit.score().is_some()));
    let mut compared = 0;
    for request in untold.iter().filter(|of| of.slot.role == "actor" && of.slot.epoch == 0) {
        let other = told.iter().find(|of| of.slot == request.slot).unwrap();
        let text = |at: usize| -> &str { &other.messages[at].text };
        let handbook = cut(&cut(text(0), ", and what the ego heeds", "\n"), "\nEgo: idm follows", "\n\n## Gates");
        assert_eq!(*request.messages[0].text, handbook);
        let context = cut(text(1), ": MetaDrive's TrajectoryIDMPolicy", "\"");
        assert_eq!(*request.messages[1].text, context);
        assert_eq!(request.messages[2], other.messages[2]);
        let task =
            text(3).replace("look at what it sees when (`how`), and whom it does not heed", "look at when (`how`)");
        assert_eq!(*request.messages[3].text, task);
        compared += 1;
    }
    assert!(compared > 5, "{compared}");
    let everything = untold.iter().flat_map(|of| of.messages.iter()).map(|of| of.text.to_string());
    for said in ["heed", "whoever is in its path", "1 m of the route", "beside or behind"] {
        assert!(everything.clone().all(|text| !text.contains(said)), "{said}");
    }
}

#[test]
fn clusters_and_outcomes_count_the_whole_window_and_the_front_is_told_on_it() {
    let (ran, requests) = &*RAN;
    for request in requests {
        let text = &request.messages[1].text;
        let frozen =
            ran.frozen.iter().find(|of| of.lineage.as_str() == request.slot.lineage && of.epoch == request.slot.epoch);
        let frozen = frozen.unwrap();
        let clusters = table(text, "Scene clusters");
        let counted: usize = clusters
            .iter()
            .flat_map(|row| row["outcomes"].split(", "))
            .filter_map(|cell| cell.split(' ').next()?.parse::<usize>().ok())
            .sum();
        assert_eq!(counted, frozen.window.len(), "{clusters:?}");
        let rows = table(text, "Window");
        let names: BTreeSet<String> = clusters.iter().map(|row| row["ref"].replace("cluster:", "")).collect();
        assert!(rows.iter().all(|row| names.contains(row["place and tags"].split(' ').next().unwrap())), "{rows:?}");
        let front = table(text, "Front");
        let own = front.iter().find(|row| row["program"] == frozen.parent.as_str());
        if let Some(own) = own {
            let attack: f64 = own["attack on this window"].parse().unwrap();
            assert!((attack - frozen.parent_score.objectives.attack).abs() < 1e-4, "{own:?}");
        }
    }
}

#[test]
fn attempts_that_are_not_shown_are_counted_and_refusals_say_what_was_compared() {
    let (ran, requests) = &*RAN;
    let (mut counted, mut compared) = (0, 0);
    for request in requests.iter().filter(|of| of.slot.epoch == 2) {
        let text = &request.messages[1].text;
        let shown = text.matches("{\"attempt\":").count();
        let before =
            ran.attempts.iter().filter(|of| of.lineage.as_str() == request.slot.lineage && of.epoch < 2).count();
        let said = text.split_once("Not shown are ").and_then(|(_, behind)| behind.split(' ').next());
        let said: usize = said.map_or(0, |count| count.parse().unwrap());
        assert_eq!(shown + said, before, "{text}");
        counted += usize::from(said > 0);
        compared += text.matches("\"gates\":\"").count();
    }
    assert!(counted > 0 && compared > 0, "{counted} {compared}");
}

#[test]
fn an_edit_without_effect_is_told_what_its_parts_came_to() {
    let refused = |experiment: &Experiment| -> Vec<Vec<String>> {
        let (ran, _) = heard(experiment);
        let of = |attempt: &crate::objects::Attempt| match &attempt.exit {
            Exit::Invalid { gates } => gates.failed().find(|verdict| verdict.gate == Gate::Effect).cloned(),
            _ => None,
        };
        ran.attempts.iter().filter_map(of).map(|verdict| verdict.problems).collect()
    };
    let mut experiment = detailed();
    // Rules leave few edits without effect; more slots find some.
    experiment.budget.slots = 12;
    let with_reasons = refused(&experiment);
    assert!(!with_reasons.is_empty(), "no edit was without effect, so nothing was shown");
    for problems in &with_reasons {
        assert!(problems.len() > 1 && problems[1..].iter().any(|line| line.contains("probe scenes")), "{problems:?}");
    }
    experiment.questions = Questions::Plain;
    assert!(refused(&experiment).iter().all(|problems| problems.len() == 1));
}
