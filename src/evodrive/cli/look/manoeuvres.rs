//! Manoeuvres of road users in the scenes that a chosen program gains, measured in its rollouts, which are simulated again.

use std::collections::BTreeMap;

use crate::cli::look::playables::{inserted, traced};
use crate::epoch::{LineageSpec, Player, Traced};
use crate::evidence::report::{self, Approach, Gained, Manoeuvre};
use crate::evidence::{Became, RecordedRun};
use crate::kernel::{Polyline, Threads, Vec2, num};
use crate::objects::{Program, SolutionId};
use crate::scene::{AgentKind, DT_S, Sample, Scene, Track};
use crate::sim::{ActorRef, Trace};

/// Rollouts that are looked at, a program: enough for what most of them do.
const LOOKED_AT_MAX: usize = 24;

/// Distance from the recorded position beyond which a road user has left its recorded motion, metres.
const LEFT_M: f64 = 0.3;

/// Returns the manoeuvres of each program that the report shows and that is not its lineage's parent.
pub fn of(player: &Player<'_>, run: &RecordedRun, threads: &Threads) -> BTreeMap<SolutionId, Gained> {
    let study = player.study;
    let shown = report::shown(run);
    let mut all: Vec<(&LineageSpec, &Program, usize)> = Vec::new();
    let mut gained: BTreeMap<SolutionId, Gained> = BTreeMap::new();
    for spec in study.lineages.iter().filter(|spec| shown.contains(&spec.id)) {
        let Some((result, program)) =
            run.result_of(&spec.id).and_then(|result| Some((result, run.program(&result.evolved.solution)?)))
        else {
            continue;
        };
        let outcomes = run.outcomes(result);
        let won = |place: &&usize| {
            outcomes.get(study.scenes[**place].scene().id.as_str()).is_some_and(|became| *became == Became::Gained)
        };
        let won: Vec<usize> = study.held_out.iter().filter(won).copied().collect();
        if won.is_empty() {
            continue;
        }
        let looked_at = won.len().min(LOOKED_AT_MAX);
        all.extend((0..looked_at).map(|nth| (spec, program, won[nth * won.len() / looked_at])));
        gained.insert(program.solution_id.clone(), Gained { scenes: won.len(), seen: Vec::new() });
    }
    let seen = threads.map(&all, |_, (spec, program, place)| seen(player, run, spec, *place, program));
    for ((_, program, _), seen) in all.iter().zip(seen) {
        if let Some(of) = gained.get_mut(&program.solution_id) {
            of.seen.extend(seen);
        }
    }
    gained
}

/// Returns the manoeuvre of one rollout; `None` if it does not come out as recorded, or cannot be played here.
fn seen(
    player: &Player<'_>,
    run: &RecordedRun,
    spec: &LineageSpec,
    place: usize,
    program: &Program,
) -> Option<Manoeuvre> {
    let (Traced { record, motion, .. }, as_recorded) = traced(player, run, spec, place, program).ok()?;
    let contact = record.outcome.contact.filter(|_| as_recorded == Some(true))?;
    manoeuvre(player.study.scenes[place].scene(), &motion, contact.with)
}

/// Returns what a road user did up to the end of the rollout; `None` for one that only moves as recorded.
fn manoeuvre(scene: &Scene, motion: &Trace, whose: ActorRef) -> Option<Manoeuvre> {
    let actor = motion.actors.iter().find(|actor| actor.actor == whose)?;
    let log = match actor.actor {
        ActorRef::Track(ix) => Some(scene.tracks.get(ix)?),
        ActorRef::Inserted(_) => None,
    };
    let at = |k: usize| actor.samples.get(k).copied().flatten();
    let recorded = |k: usize| log.and_then(|log| log.at(motion.from_step + k));
    let left = |k: &usize| match (at(*k), recorded(*k)) {
        (Some(is), Some(was)) => is.position.distance(was.position) > LEFT_M,
        (Some(_), None) => true,
        (None, _) => false,
    };
    let last = motion.ego.len().checked_sub(1)?;
    let left = (0..=last).find(left)?;
    // The step before it still is where it was recorded.
    let from = left.checked_sub(1).filter(|before| at(*before).is_some()).unwrap_or(left);
    let (is, ego) = (at(from)?, motion.ego.get(from)?);
    let reach_m = (actor.length_m + scene.ego.track.length_m) / 2.0;
    let ahead_m = (is.position - ego.position).dot(Vec2::from_heading(ego.heading_rad));
    let lasts_s = (last - from) as f64 * DT_S;
    let way = |sample: &dyn Fn(usize) -> Option<Sample>| -> Option<f64> {
        let points: Vec<Vec2> = (from..=last).map(|k| Some(sample(k)?.position)).collect::<Option<_>>()?;
        Some(num::sum(points.windows(2).map(|pair| pair[0].distance(pair[1]))))
    };
    let faster_mps = || Some((way(&at)? - way(&|k| recorded(k).copied())?) / lasts_s).filter(|_| lasts_s > 0.0);
    Some(Manoeuvre {
        who: match log.map(|log| log.kind) {
            None => inserted(actor),
            Some(AgentKind::Vehicle) => "vehicle".into(),
            Some(AgentKind::Pedestrian) => "pedestrian".into(),
            Some(AgentKind::Cyclist) => "cyclist".into(),
            Some(AgentKind::Static) => "standing thing".into(),
        },
        came: Approach::of(ahead_m, num::wrap_angle(is.heading_rad - ego.heading_rad), reach_m),
        faster_mps: log.and_then(|_| faster_mps()),
        aside_m: log.zip(at(last)).map(|(log, end)| from_path_m(log, end.position)),
        speed_mps: way(&at).filter(|_| lasts_s > 0.0).map_or_else(|| is.speed_mps(), |way_m| way_m / lasts_s),
        lasts_s,
    })
}

/// Distance of a point from where somebody was recorded to go, metres. The recorded way runs straight on beyond both ends.
fn from_path_m(log: &Track, point: Vec2) -> f64 {
    let points: Vec<Vec2> = log.samples.iter().flatten().map(|sample| sample.position).collect();
    let nearest = points.iter().map(|at| at.distance(point)).fold(f64::INFINITY, f64::min);
    // A standing road user has no way, and jitters.
    let Some(way) = Polyline::new(points).ok().filter(|way| way.length_m() > 1.0) else { return nearest };
    let at = way.project(point);
    if at.s_m <= 0.0 || at.s_m >= way.length_m() {
        (point - way.at(at.s_m)).cross(Vec2::from_heading(at.heading_rad)).abs()
    } else {
        at.offset_m.abs()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernel::Seed;
    use crate::scene::safebench::TrafficFamily;
    use crate::sim::ActorTrace;
    use crate::synth::family_scene;

    /// East at 8 m/s, from here.
    fn straight(steps: usize, from_m: f64) -> Vec<Option<Sample>> {
        let velocity = Vec2::new(8.0, 0.0);
        let at = |k: usize| Vec2::new(from_m, 0.0) + velocity * (k as f64 * DT_S);
        (0..steps).map(|k| Some(Sample { position: at(k), heading_rad: 0.0, velocity })).collect()
    }

    /// A road user that is `faster_mps` and `aside_m` to the left of what was recorded from the eleventh sample on.
    fn moved(scene: &Scene, ix: usize, faster_mps: f64, aside_m: f64) -> Option<Manoeuvre> {
        let track = &scene.tracks[ix];
        let steps = track.samples.len();
        let shifted = |k: usize| {
            let mut sample = *track.at(k)?;
            let ahead = Vec2::from_heading(sample.heading_rad);
            let since_s = k.saturating_sub(10) as f64 * DT_S;
            let aside_m = if k > 10 { aside_m } else { 0.0 };
            sample.position = sample.position + ahead * (faster_mps * since_s) + ahead.left() * aside_m;
            Some(sample)
        };
        let actor = ActorRef::Track(ix);
        let (length_m, width_m) = (track.length_m, track.width_m);
        let samples = (0..steps).map(shifted).collect();
        let ego = straight(steps, 40.0).into_iter().flatten().collect();
        let motion = Trace {
            from_step: 0,
            ego,
            actors: vec![ActorTrace { actor, length_m, width_m, adversary: true, samples }],
        };
        manoeuvre(scene, &motion, actor)
    }

    #[test]
    fn speed_and_path_are_those_against_the_recording_from_where_it_was_left() {
        let mut scene = family_scene(TrafficFamily::ALL[0], 0, Seed(1));
        let samples = straight(60, 10.0);
        let (id, kind) = ("behind".to_string(), AgentKind::Vehicle);
        scene.tracks.push(Track { id, kind, length_m: 4.5, width_m: 1.8, samples });
        let ix = scene.tracks.len() - 1;
        assert_eq!(moved(&scene, ix, 0.0, 0.0), None, "as recorded");
        let all_s = (scene.tracks[ix].samples.len() - 11) as f64 * DT_S;
        let faster = moved(&scene, ix, 4.0, 0.0).unwrap();
        assert!((faster.faster_mps.unwrap() - 4.0).abs() < 0.2 && faster.aside_m.unwrap() < 0.3, "{faster:?}");
        assert!(
            (faster.lasts_s - all_s).abs() < 1e-9
                && (faster.speed_mps - 12.0).abs() < 0.2
                && faster.who == "vehicle"
                && faster.came == Approach::Behind,
            "{faster:?} {all_s}"
        );
        let slower = moved(&scene, ix, -1.0, 0.0).unwrap();
        assert!(slower.faster_mps.unwrap() < -0.7, "{slower:?}");
        let aside = moved(&scene, ix, 0.0, 2.0).unwrap();
        assert!((aside.aside_m.unwrap() - 2.0).abs() < 0.2 && aside.faster_mps.unwrap().abs() < 1.0, "{aside:?}");
    }
}
