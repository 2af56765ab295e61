//! Which rollouts a report can play, simulated again as drawings.

use std::collections::BTreeMap;

use crate::draw::{Actor, Contact, Drawing, Role, role_of};
use crate::epoch::{LineageSpec, Player, Study, Traced, record_digest};
use crate::evidence::report::{self, Playable, Stage, Unplayed};
use crate::evidence::{Became, RecordedRun};
use crate::kernel::Threads;
use crate::objects::{Program, SolutionId};
use crate::scene::Scene;
use crate::sim::{ActorRef, ActorTrace, End, Outcome, Trace};

/// Held-out scenes of a lineage that can be played, and of the one that a reader meets first.
const SCENES_MAX: usize = 3;
const SCENES_OF_THE_BEST_MAX: usize = 12;

/// Rollouts of a page, shared out among its lineages: each takes about 30 kB of it, and a second or less to make.
const ROLLOUTS_MAX: usize = 96;

/// The chosen program and its parent, then the others that were measured as far as there is room, in the held-out scenes that tell most of
/// what changed. Of repetitions the one that the report shows is played. Any other rollout is drawn by `evodrive scenes show`.
pub fn choose(player: &Player<'_>, run: &RecordedRun, threads: &Threads) -> Stage {
    let study = player.study;
    let shown = report::shown(run);
    let specs: Vec<&LineageSpec> = study.lineages.iter().filter(|spec| shown.contains(&spec.id)).collect();
    let room = (ROLLOUTS_MAX.saturating_sub(2 * SCENES_OF_THE_BEST_MAX) / SCENES_MAX / specs.len().max(1)).max(2);
    let mut stage = Stage { repetitions_left_out: study.lineages.len() - specs.len(), ..Stage::default() };
    let (mut all, mut replays) = (Vec::new(), Vec::new());
    for spec in specs {
        let programs: Vec<(SolutionId, String)> = programs(run, spec).into_iter().take(room).collect();
        let most = if shown.first() == Some(&spec.id) { SCENES_OF_THE_BEST_MAX } else { SCENES_MAX };
        for (nth, place) in scenes(study, run, spec, most).into_iter().enumerate() {
            // Beyond the first few only before and after.
            let shown = programs.iter().take(if nth < SCENES_MAX { programs.len() } else { 2 });
            all.extend(shown.map(|(solution, role)| (spec, place, solution.clone(), role.clone())));
            let scene = study.scenes[place].scene();
            stage.scenes.entry(scene.id.clone()).or_insert_with(|| Drawing::of_scene(scene));
            // Lineages of one ego share what happens without a program.
            if !replays.iter().any(|(of, at): &(&LineageSpec, usize)| of.ego.name() == spec.ego.name() && *at == place)
            {
                replays.push((spec, place));
            }
        }
    }
    let played = threads.map(&all, |_, (spec, place, solution, role)| {
        run.program(solution).map(|program| play(player, run, spec, *place, program, role))
    });
    for ((_, place, solution, _), played) in all.iter().zip(played) {
        match played {
            Some(Ok(playable)) => stage.rollouts.push(playable),
            // Another simulator's rollouts are those that labels were recorded of; this one was not asked for.
            Some(Err(_)) if study.backend.is_some() => {}
            Some(Err(reason)) => stage.unplayed.push(Unplayed {
                solution: solution.to_string(),
                scene: study.scenes[*place].scene().id.clone(),
                reason,
            }),
            None => {}
        }
    }
    for replay in threads.map(&replays, |_, (spec, place)| without_program(player, spec, *place)) {
        match replay {
            Ok(playable) => stage.rollouts.push(playable),
            Err(_) if study.backend.is_some() => {}
            Err(unplayed) => stage.unplayed.push(unplayed),
        }
    }
    // By program, then scene: the order of the page's menus.
    let order: Vec<String> = stage.rollouts.iter().map(|p| p.solution.clone()).collect();
    stage.rollouts.sort_by_key(|p| order.iter().position(|solution| *solution == p.solution));
    stage
}

/// The chosen one first, then the parent, then whoever else was measured on the held-out scenes.
fn programs(run: &RecordedRun, spec: &LineageSpec) -> Vec<(SolutionId, String)> {
    let Some(result) = run.result_of(&spec.id) else { return Vec::new() };
    let mut chosen = vec![(result.evolved.solution.clone(), "chosen".to_string())];
    let measured = run.held_out.iter().filter(|of| of.lineage == spec.id).map(|of| &of.solution);
    for solution in std::iter::once(&result.parent.solution).chain(measured) {
        if !chosen.iter().any(|(known, _)| known == solution) {
            let role = if *solution == result.parent.solution { "parent" } else { "finalist" };
            chosen.push((solution.clone(), role.to_string()));
        }
    }
    chosen
}

/// In which order the outcomes take their turns: a reader sees first what was gained, and of each of the others some.
const TURNS: [Became; 6] =
    [Became::Gained, Became::Lost, Became::Gained, Became::Both, Became::Gained, Became::Neither];

/// Held-out scenes of every outcome that there is, of each outcome the most realistic ones first.
fn scenes(study: &Study, run: &RecordedRun, spec: &LineageSpec, most: usize) -> Vec<usize> {
    let Some(result) = run.result_of(&spec.id) else { return Vec::new() };
    let before = run.held_out_labels(&result.parent.solution);
    let after = run.held_out_labels(&result.evolved.solution);
    let mut left: BTreeMap<Became, Vec<(f64, usize)>> = BTreeMap::new();
    for place in study.held_out.iter().copied() {
        let id = study.scenes[place].scene().id.as_str();
        let Some(is) = after.get(id) else { continue };
        let became = Became::of(before.get(id).copied(), is);
        left.entry(became).or_default().push((is.realism, place));
    }
    left.values_mut().for_each(|of| of.sort_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1))));
    in_turns(left, most)
}

/// The last of each outcome by turns, until there are enough or none is left.
fn in_turns(mut left: BTreeMap<Became, Vec<(f64, usize)>>, most: usize) -> Vec<usize> {
    let mut places = Vec::new();
    while places.len() < most && left.values().any(|of| !of.is_empty()) {
        for turn in TURNS {
            places.extend(left.get_mut(&turn).and_then(Vec::pop).map(|(_, place)| place));
        }
    }
    places.truncate(most);
    places
}

/// A held-out rollout simulated again, and whether it came out as the record has it; `None` where the record holds no label of it.
pub fn traced(
    player: &Player<'_>,
    run: &RecordedRun,
    spec: &LineageSpec,
    place: usize,
    program: &Program,
) -> Result<(Traced, Option<bool>), String> {
    let traced = player.trace(spec, program, place)?;
    let labels = run.held_out_labels(&program.solution_id);
    let recorded = labels.get(player.study.scenes[place].scene().id.as_str()).map(|label| label.record);
    let digest = record_digest(&traced.record).map_err(|error| error.to_string())?;
    Ok((traced, recorded.map(|recorded| recorded == digest)))
}

fn play(
    player: &Player<'_>,
    run: &RecordedRun,
    spec: &LineageSpec,
    place: usize,
    program: &Program,
    role: &str,
) -> Result<Playable, String> {
    let scene = player.study.scenes[place].scene();
    let (Traced { record, decision, motion, .. }, as_recorded) = traced(player, run, spec, place, program)?;
    let outcome = &record.outcome;
    let applied = if decision.applies { String::new() } else { format!("; not applied: {}", decision.reason) };
    Ok(Playable {
        solution: program.solution_id.to_string(),
        role: role.to_string(),
        scene: scene.id.clone(),
        changed: changed(scene, &motion),
        contact: contact(scene, &motion, outcome),
        caption: format!("{}{applied}", ending(outcome)),
        as_recorded,
    })
}

/// A scene as it goes on without a program.
fn without_program(player: &Player<'_>, spec: &LineageSpec, place: usize) -> Result<Playable, Unplayed> {
    let scene = player.study.scenes[place].scene();
    let solution = format!("replay, {}", spec.ego.name());
    let (outcome, motion) = player.replay(spec, place).map_err(|reason| Unplayed {
        solution: solution.clone(),
        scene: scene.id.clone(),
        reason,
    })?;
    Ok(Playable {
        solution,
        role: "no program".to_string(),
        scene: scene.id.clone(),
        changed: changed(scene, &motion),
        contact: contact(scene, &motion, &outcome),
        caption: ending(&outcome),
        as_recorded: None,
    })
}

/// One line on how a rollout ended.
pub fn ending(outcome: &Outcome) -> String {
    let end = match (outcome.end, outcome.contact) {
        (End::Contact, Some(contact)) => format!(
            "{} after {:.1} s, {:.1} m/s relative speed",
            end_in_words(outcome),
            contact.time_s,
            contact.relative_speed_mps
        ),
        _ => end_in_words(outcome).to_string(),
    };
    let distance = outcome.distance_m_min.map_or(String::new(), |d| format!("; nearest {d:.1} m"));
    format!("{end}{distance}; ego completed {:.0} % of its route", 100.0 * outcome.route_completion)
}

/// How a rollout ended, without its numbers.
pub fn end_in_words(outcome: &Outcome) -> &'static str {
    match (outcome.end, outcome.contact) {
        (End::Contact, Some(contact)) if contact.adversary => "contact with the adversary",
        (End::Contact, Some(_)) => "contact with a bystander",
        (End::Contact, None) => "contact",
        (End::OffRoad, _) => "the ego left its route",
        (End::Arrived, _) => "the ego arrived",
        (End::Horizon, _) => "no contact up to the horizon",
    }
}

/// How people call a road user of a rollout.
pub fn label(scene: &Scene, actor: ActorRef) -> String {
    match actor {
        ActorRef::Track(ix) => scene.tracks.get(ix).map_or(format!("track {ix}"), |track| track.id.clone()),
        ActorRef::Inserted(k) => format!("inserted {k}"),
    }
}

/// The ego, the adversaries, and whoever else did not move as recorded.
pub fn changed(scene: &Scene, motion: &Trace) -> Vec<Actor> {
    let mut actors: Vec<Actor> = Vec::new();
    for actor in &motion.actors {
        let role = match actor.actor {
            _ if actor.adversary => Role::Adversary,
            ActorRef::Track(ix) => {
                let Some(track) = scene.tracks.get(ix) else { continue };
                role_of(track, scene.objects_of_interest.contains(&ix))
            }
            ActorRef::Inserted(_) => Role::Adversary,
        };
        if actor.adversary || !as_recorded(scene, actor, motion.from_step) {
            actors.push(drawn(scene, actor, role, motion.from_step));
        }
    }
    let ego = ActorTrace {
        actor: ActorRef::Inserted(0),
        length_m: scene.ego.track.length_m,
        width_m: scene.ego.track.width_m,
        adversary: false,
        samples: motion.ego.iter().copied().map(Some).collect(),
    };
    actors.push(Actor { label: "ego".into(), ..drawn(scene, &ego, Role::Ego, motion.from_step) });
    actors
}

fn as_recorded(scene: &Scene, actor: &ActorTrace, from_step: usize) -> bool {
    let ActorRef::Track(ix) = actor.actor else { return false };
    let Some(track) = scene.tracks.get(ix) else { return false };
    actor.samples.iter().enumerate().all(|(k, sample)| match (sample, track.at(from_step + k)) {
        (Some(now), Some(log)) => now.position == log.position,
        (None, _) => true,
        (Some(_), None) => false,
    })
}

/// Before the rollout's first step as recorded, after its last one absent.
fn drawn(scene: &Scene, actor: &ActorTrace, role: Role, from_step: usize) -> Actor {
    let log = match actor.actor {
        _ if role == Role::Ego => Some(&scene.ego.track),
        ActorRef::Track(ix) => scene.tracks.get(ix),
        ActorRef::Inserted(_) => None,
    };
    let sample = |step: usize| match step.checked_sub(from_step) {
        None => log.and_then(|track| track.at(step)).copied(),
        Some(k) => actor.samples.get(k).copied().flatten(),
    };
    let track = crate::scene::Track {
        id: String::new(),
        kind: log.map_or(crate::scene::AgentKind::Vehicle, |track| track.kind),
        length_m: actor.length_m,
        width_m: actor.width_m,
        samples: (0..scene.steps).map(sample).collect(),
    };
    let name = match actor.actor {
        ActorRef::Inserted(_) if role != Role::Ego => inserted(actor),
        _ => label(scene, actor.actor),
    };
    Actor::of_track(&track, name, role)
}

/// A road user that a program brings in, by the body that it has (`stage` gives a cyclist and a pedestrian theirs).
pub fn inserted(actor: &ActorTrace) -> String {
    let what = match (actor.length_m, actor.width_m) {
        (length_m, _) if length_m < 1.2 => "pedestrian",
        (_, width_m) if width_m < 1.2 => "cyclist",
        _ => "car",
    };
    match actor.actor {
        ActorRef::Inserted(nth) if nth > 0 => format!("inserted {what} {}", nth + 1),
        _ => format!("inserted {what}"),
    }
}

/// Returns where the ego met somebody, if it did.
pub fn contact(scene: &Scene, motion: &Trace, outcome: &Outcome) -> Option<Contact> {
    let contact = outcome.contact?;
    let last = motion.ego.len().checked_sub(1)?;
    let ego = motion.ego.get(last)?;
    let with = motion.actors.iter().find(|a| a.actor == contact.with)?;
    let other = with.samples.get(last).copied().flatten();
    let point = other.map_or(ego.position, |other| ego.position.lerp(other.position, 0.5));
    let name = match contact.with {
        _ if contact.adversary => "contact".to_string(),
        ActorRef::Inserted(_) => inserted(with),
        ActorRef::Track(_) => label(scene, contact.with),
    };
    // The picture has the adversary's name beside it.
    let label = format!("{name}, {:.1} m/s", contact.relative_speed_mps);
    Some(Contact { step: motion.from_step + last, point, label })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::backend::Backend;
    use crate::cli::evolve::first_epoch::carried_out;

    #[test]
    fn every_outcome_is_played_and_what_was_gained_first() {
        let of = |from: usize, count: usize| (from..from + count).rev().map(|place| (0.0, place)).collect::<Vec<_>>();
        let left =
            BTreeMap::from([(Became::Gained, of(0, 9)), (Became::Lost, of(20, 1)), (Became::Neither, of(40, 9))]);
        assert_eq!(in_turns(left.clone(), 3), [0, 20, 1]);
        assert_eq!(in_turns(left.clone(), 8), [0, 20, 1, 2, 40, 3, 4, 5]);
        assert_eq!(in_turns(left, 100).len(), 19);
        assert!(in_turns(BTreeMap::new(), 3).is_empty());
    }

    #[test]
    fn a_rollout_that_is_not_the_recorded_one_is_not_called_so() {
        carried_out(None, |study, recorded, desk| {
            let player = Player::of(study, &recorded.counsels, Backend::Own);
            let says = |run: &RecordedRun| -> Vec<Option<bool>> {
                choose(&player, run, desk.tools.threads).rollouts.iter().map(|playable| playable.as_recorded).collect()
            };
            let as_it_was = says(recorded);
            assert!(as_it_was.contains(&Some(true)) && !as_it_was.contains(&Some(false)), "{as_it_was:?}");
            let mut forged = recorded.clone();
            let labels = forged.held_out.iter_mut().flat_map(|of| &mut of.score.scenes);
            labels.for_each(|label| label.record = crate::kernel::Digest::of_bytes(b"another rollout"));
            let forged = says(&forged);
            assert!(forged.contains(&Some(false)) && !forged.contains(&Some(true)), "{forged:?}");
            let without = |all: &[Option<bool>]| all.iter().filter(|one| one.is_none()).count();
            assert_eq!(without(&as_it_was), without(&forged), "a scene without a program has no record");
        });
    }
}
