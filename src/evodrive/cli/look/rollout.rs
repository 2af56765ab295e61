//! Rollouts of one program of a run, simulated again and compared with what the run recorded: to be drawn and exported.

use clap::Args;
use std::path::{Path, PathBuf};

use crate::backend::Answers;
use crate::cli::evolve::behind;
use crate::cli::look::playables;
use crate::cli::records::{folder::RunFolder, run_name::OneRun};
use crate::cli::studies::packed;
use crate::cli::terminal::exit::Failure;
use crate::compiler::Decision;
use crate::draw::{Actor, Drawing, Role};
use crate::epoch::{Player, Study, Traced, record_digest};
use crate::evidence::RecordedRun;
use crate::formats::{Inserted, Staging};
use crate::kernel::{Digest, Threads};
use crate::objects::replay::ReplayScene;
use crate::objects::{LineageId, Program, SceneScore, SolutionId};
use crate::scene::{DT_S, Sample, Scene};
use crate::sim::{Action, ActorRef, ActorTrace, Intervention, Outcome, Timeline, Trace};

/// Whose rollouts are meant, where scenes are wanted as a program played them.
#[derive(Debug, Args)]
pub struct OfAttempt {
    /// Take the scenes as this program of a run played them: an attempt's, e.g. cat-idm/e2s5, or a parent, e.g.
    /// cat-idm/parent; cat-idm/replay is the scenes without a program, driven by that lineage's ego.
    #[arg(long)]
    pub attempt: Option<String>,
    /// Keep the ego's recorded motion and the whole horizon: the program's road users move as it commands, whatever
    /// the ego does.
    #[arg(long, requires = "attempt")]
    pub ego_log: bool,
    /// The attempt's run: its folder, its name below runs/, or the beginning of either; without it the latest.
    #[arg(id = "run_option", long = "run", value_name = "RUN", requires = "attempt")]
    pub run: Option<PathBuf>,
    /// Take a suite's cases as a driver drove them, from a result that `evodrive suite run --out` wrote and the recorded answers beside
    /// it; no planner is started.
    #[arg(long, value_name = "RESULT", requires = "run", conflicts_with_all = ["attempt", "ego_log"])]
    pub recorded: Option<PathBuf>,
}

impl OfAttempt {
    /// Refuses a result where no suite is named whose cases it drove.
    ///
    /// # Errors
    /// As said.
    pub fn without_result(&self, found: &Path) -> Result<(), Failure> {
        match &self.recorded {
            None => Ok(()),
            Some(result) => Err(Failure::bad_input(format!(
                "--recorded {}: expected the suite that this result is of, and a case of it, found {}",
                result.display(),
                found.display()
            ))),
        }
    }

    /// The attempt's run, which may stand in the place where a pool does without an attempt.
    ///
    /// # Errors
    /// It is named in both ways.
    pub fn run(&self, place: Option<&PathBuf>) -> Result<OneRun, Failure> {
        match (place, &self.run) {
            (Some(place), Some(_)) => {
                let place = place.display();
                Err(Failure::bad_input(format!(
                    "the run is named twice, as {place} and by --run; leave one of them out"
                )))
            }
            (None, None) => Ok(OneRun::default()),
            (Some(dir), None) | (None, Some(dir)) => Ok(OneRun::of(dir)),
        }
    }
}

/// One scene of a run and what became of it.
#[derive(Debug)]
pub struct Played {
    pub solution: SolutionId,
    pub scene: Scene,
    pub outcome: Outcome,
    /// Decision of the program; `None` for the scene without one.
    pub decision: Option<Decision>,
    pub intervention: Intervention,
    /// Motion that each action commands its road user, whatever the ego does; nothing where it reacts.
    pub commanded: Vec<Vec<Option<Sample>>>,
    pub motion: Trace,
}

/// The rollouts of an attempt or a parent in the scenes named, or in all evolution scenes that it was labelled on.
///
/// # Errors
/// No such attempt, program or scene; a scene of the held-out suite while the run is unfinished; a rollout that comes
/// out differently from its record.
pub fn of_attempt(run: &OneRun, attempt: &str, scenes: &[String], jobs: usize) -> Result<Vec<Played>, Failure> {
    let folder = run.folder()?;
    let recorded_run = folder.recorded()?;
    let subject = Subject::of(&recorded_run, attempt)?;
    let threads = Threads::new(jobs)?;
    let experiment = folder.read_experiment()?;
    let study = experiment.study(folder.read_pool()?, &threads)?;
    let replay = behind::replay_of(&experiment, &folder)?;
    let answers = replay.as_ref().map(|replay| replay as &dyn Answers);
    let player = Player::of(&study, &recorded_run.counsels, behind::backend(&experiment, answers));
    let places = places(&study, &recorded_run, &subject, scenes)?;
    let play = |place: usize| match &subject {
        Subject::Program(labelled) => play(&player, labelled, place),
        Subject::Replay(replay) => play_replay(&player, replay, place),
    };
    threads.map(&places, |_, &place| play(place)).into_iter().collect()
}

/// Returns what led to the contacts of programs of a run in one scene. Programs are given by name, with the digests of
/// their rollouts' records. A program whose contact cannot be explained has the reason instead.
///
/// # Errors
/// The run's files cannot be read.
pub fn timelines(
    folder: &RunFolder,
    programs: &[(&SolutionId, Digest)],
    scene: &str,
    jobs: usize,
) -> Result<Vec<Result<Option<Timeline>, String>>, Failure> {
    let (recorded_run, threads) = (folder.recorded()?, Threads::new(jobs)?);
    let experiment = folder.read_experiment()?;
    let study = experiment.study(folder.read_pool()?, &threads)?;
    let replay = behind::replay_of(&experiment, folder)?;
    let answers = replay.as_ref().map(|replay| replay as &dyn Answers);
    let player = Player::of(&study, &recorded_run.counsels, behind::backend(&experiment, answers));
    let place = study.scenes.iter().position(|entry| entry.scene().id == scene);
    let one = |(name, record): &(&SolutionId, Digest)| {
        let program = packed::find(&recorded_run, name.as_str()).map_err(|failure| failure.message)?;
        let spec = study.lineages.iter().find(|spec| spec.id == program.lineage_id);
        let (Some(spec), Some(place)) = (spec, place) else {
            return Err("its lineage or its scene is gone".to_string());
        };
        let simulated =
            record_digest(&player.trace(spec, program, place)?.record).map_err(|error| error.to_string())?;
        if simulated == *record {
            player.timeline(spec, program, place)
        } else {
            Err("its rollout comes out otherwise than recorded; `evodrive verify` names the first difference".into())
        }
    };
    Ok(threads.map(programs, |_, of| one(of)))
}

/// Ending of the name of a lineage's scenes without a program.
pub const REPLAY: &str = "/replay";

/// Whose rollouts are played.
enum Subject<'s> {
    Program(Labelled<'s>),
    Replay(ReplayOf<'s>),
}

/// The scenes without a program, driven by the ego of a lineage; named `<lineage>/replay`.
struct ReplayOf<'s> {
    name: String,
    lineage: &'s LineageId,
    /// Records of these scenes in the run.
    recorded: Vec<&'s ReplayScene>,
}

impl<'s> Subject<'s> {
    fn of(recorded_run: &'s RecordedRun, name: &str) -> Result<Subject<'s>, Failure> {
        let adopted =
            name.strip_suffix(REPLAY).and_then(|id| recorded_run.parents.iter().find(|of| of.lineage.as_str() == id));
        let Some(adopted) = adopted else { return Ok(Subject::Program(Labelled::of(recorded_run, name)?)) };
        let own = recorded_run.replays.iter().filter(|of| of.row.ego == adopted.ego);
        let recorded = own.flat_map(|of| &of.scenes).collect();
        Ok(Subject::Replay(ReplayOf { name: name.to_string(), lineage: &adopted.lineage, recorded }))
    }

    fn name(&self) -> &str {
        match self {
            Subject::Program(labelled) => labelled.name(),
            Subject::Replay(replay) => &replay.name,
        }
    }

    /// Scenes that are meant where none is named: those with labels; without a program, those of evolution.
    fn own(&self, recorded_run: &RecordedRun) -> Vec<String> {
        match self {
            Subject::Program(labelled) => labelled.labels.iter().map(|label| label.scene.clone()).collect(),
            Subject::Replay(_) => recorded_run.opened.evolution_scenes.clone(),
        }
    }
}

/// A program of a run with its labels.
struct Labelled<'s> {
    program: &'s Program,
    labels: Vec<&'s SceneScore>,
}

impl<'s> Labelled<'s> {
    /// An attempt has the labels that decided about it, a parent those of its windows.
    fn of(recorded_run: &'s RecordedRun, name: &str) -> Result<Labelled<'s>, Failure> {
        let program = packed::find(recorded_run, name)?;
        let mut labels: Vec<&SceneScore> = Vec::new();
        match recorded_run.attempt(name) {
            Some(attempt) => labels.extend(attempt.exit.score().iter().flat_map(|score| &score.scenes)),
            None => {
                let own = recorded_run.frozen.iter().filter(|of| of.parent == program.solution_id);
                labels.extend(own.flat_map(|of| &of.parent_score.scenes));
                labels.sort_by(|a, b| a.scene.cmp(&b.scene));
                labels.dedup_by(|a, b| a.scene == b.scene);
            }
        }
        Ok(Labelled { program, labels })
    }

    fn name(&self) -> &'s str {
        self.program.solution_id.as_str()
    }
}

/// Places of the scenes in the study.
fn places(
    study: &Study,
    recorded_run: &RecordedRun,
    subject: &Subject<'_>,
    scenes: &[String],
) -> Result<Vec<usize>, Failure> {
    let own = subject.own(recorded_run);
    let wanted = if scenes.is_empty() { &own } else { scenes };
    if wanted.is_empty() {
        let reason = format!("program {} was not labelled; name scenes with --scene", subject.name());
        return Err(Failure::bad_input(reason));
    }
    let closed = recorded_run.result.is_none();
    let find = |id: &String| {
        let place = study.scenes.iter().position(|entry| entry.scene().id == *id).ok_or_else(|| {
            let reason = format!("no scene `{id}` in this run; {} was labelled on", subject.name());
            Failure::bad_input(format!("{reason} {}", own.join(", ")))
        })?;
        if closed && !study.evolution.contains(&place) {
            let reason = "is held out, and the run is not finished; finish it with `evodrive resume`";
            return Err(Failure::bad_input(format!("scene `{id}` {reason}")));
        }
        Ok(place)
    };
    wanted.iter().map(find).collect()
}

fn play(player: &Player<'_>, labelled: &Labelled<'_>, place: usize) -> Result<Played, Failure> {
    let study = player.study;
    let (program, name) = (labelled.program, labelled.name());
    let lineage = study.lineages.iter().find(|spec| spec.id == program.lineage_id);
    let spec = lineage.ok_or_else(|| {
        let lineage = &program.lineage_id;
        Failure::corruption(format!("the run's experiment has no lineage {lineage}; run `evodrive fsck`"))
    })?;
    let scene = study.scenes[place].scene();
    let traced = player
        .trace(spec, program, place)
        .map_err(|reason| Failure::bad_input(format!("{name} in scene {}: {reason}", scene.id)))?;
    let recorded = labelled.labels.iter().find(|label| label.scene == scene.id);
    let simulated = record_digest(&traced.record).map_err(Failure::internal)?;
    if let Some(recorded) = recorded.filter(|recorded| recorded.record != simulated) {
        return Err(Failure::divergence(format!(
            "{name} in scene {}: the rollout is {simulated} now, {} is recorded; `evodrive verify` names the first \
             difference",
            scene.id, recorded.record
        )));
    }
    Ok(Played::of(program.solution_id.clone(), Scene::clone(scene), traced))
}

fn play_replay(player: &Player<'_>, replay: &ReplayOf<'_>, place: usize) -> Result<Played, Failure> {
    let study = player.study;
    let scene = study.scenes[place].scene();
    let spec = study.lineages.iter().find(|spec| spec.id == *replay.lineage);
    let spec = spec.ok_or_else(|| {
        Failure::corruption(format!("the run's experiment has no lineage {}; run `evodrive fsck`", replay.lineage))
    })?;
    let failed = |reason| Failure::bad_input(format!("{} in scene {}: {reason}", replay.name, scene.id));
    let (outcome, motion) = player.replay(spec, place).map_err(failed)?;
    let recorded = replay.recorded.iter().find(|of| of.scene == scene.id);
    let (contact, driven) = (outcome.contact.is_some(), outcome.route_completion);
    if let Some(of) = recorded.filter(|of| of.contact != contact || of.route_completion != driven) {
        return Err(Failure::divergence(format!(
            "{} in scene {}: expected contact {} and a route completion of {}, as recorded, found {contact} and {driven}; \
             `evodrive verify` names the first difference",
            replay.name, scene.id, of.contact, of.route_completion
        )));
    }
    Ok(Played {
        solution: SolutionId::new(&replay.name),
        scene: Scene::clone(scene),
        outcome,
        decision: None,
        intervention: Intervention::default(),
        commanded: Vec::new(),
        motion,
    })
}

impl Played {
    /// A program's rollout.
    pub fn of(solution: SolutionId, scene: Scene, traced: Traced) -> Played {
        let Traced { record, decision, intervention, commanded, motion } = traced;
        Played { solution, scene, outcome: record.outcome, decision: Some(decision), intervention, commanded, motion }
    }

    /// Returns what the program intended and how it ended, in one line.
    pub fn caption(&self) -> String {
        let applied = match &self.decision {
            Some(decision) if !decision.applies => format!("; not applied: {}", decision.reason),
            Some(_) => String::new(),
            None if self.intervention.actions.is_empty() => "; no program".to_string(),
            None => String::new(),
        };
        format!("{}{applied}", playables::ending(&self.outcome))
    }

    /// The scene up to the end of the rollout; adversaries with their logged selves beside them, the ego on top.
    pub fn drawing(&self) -> Drawing {
        let motion = &self.motion;
        let mut drawing = Drawing::of_scene(&self.scene);
        let mut changed = playables::changed(&self.scene, motion);
        let same = |a: &Actor, b: &Actor| a.label == b.label && (a.role == Role::Ego) == (b.role == Role::Ego);
        let mut ghosts: Vec<Actor> = Vec::new();
        let mut kept: Vec<Actor> = Vec::new();
        for logged in std::mem::take(&mut drawing.actors) {
            match changed.iter().position(|now| same(now, &logged)) {
                None => kept.push(logged),
                Some(at) => {
                    let now = changed.remove(at);
                    if now.role == Role::Adversary {
                        let label = format!("{} as logged", logged.label);
                        ghosts.push(Actor { label, role: Role::Ghost, ..logged });
                    }
                    kept.push(now);
                }
            }
        }
        kept.extend(changed);
        kept.sort_by_key(|actor| actor.role == Role::Ego);
        drawing.actors = ghosts;
        drawing.actors.extend(kept);
        drawing.contact = playables::contact(&self.scene, motion, &self.outcome);
        drawing.steps = (motion.from_step + motion.ego.len()).min(self.scene.steps);
        drawing.actors.iter_mut().for_each(|actor| actor.samples.truncate(drawing.steps));
        drawing.lights.iter_mut().for_each(|light| light.states.truncate(drawing.steps));
        drawing
    }

    /// The rollout as a change of its scene: the ego, the adversaries, and whoever else did not move as logged.
    pub fn staging(&self) -> Staging {
        let motion = &self.motion;
        let share = self.last_step_share();
        let whole = motion.ego.len() - usize::from(share.is_some());
        let mut staging = Staging {
            id: format!("{} {}", self.scene.id, self.solution),
            from_step: motion.from_step,
            ego: Some(motion.ego.clone()),
            tracks: Default::default(),
            inserted: vec![],
            last_step_share: share,
        };
        let mut kinds = self.intervention.actions.iter().filter_map(|action| match action {
            Action::Triggered(script) => Some(script.kind),
            Action::Insert { kind, .. } => Some(*kind),
            Action::Follow { .. } | Action::FollowThenReact { .. } | Action::FollowThenObey { .. } => None,
        });
        for actor in &motion.actors {
            let ActorTrace { length_m, width_m, ref samples, .. } = *actor;
            match actor.actor {
                ActorRef::Track(track) => {
                    let logged = |k: usize| self.scene.tracks[track].at(motion.from_step + k).copied();
                    if (0..whole).any(|k| samples[k] != logged(k)) {
                        staging.tracks.insert(track, samples.clone());
                    }
                }
                ActorRef::Inserted(_) => {
                    let Some(kind) = kinds.next() else { unreachable!("every inserted actor has its action") };
                    staging.inserted.push(Inserted { kind, length_m, width_m, samples: samples.clone() });
                }
            }
        }
        staging
    }

    /// The scene over its whole horizon with the program's road users as commanded and everybody else, the ego included,
    /// as logged: for another simulator that drives an ego of its own.
    ///
    /// # Errors
    /// An adversary waits for the ego or reacts to it, so that it has no motion without it.
    pub fn with_ego_log(&self) -> Result<Staging, Failure> {
        let mut staging = Staging {
            id: format!("{} {} ego as logged", self.scene.id, self.solution),
            from_step: self.motion.from_step,
            ego: None,
            tracks: Default::default(),
            inserted: vec![],
            last_step_share: None,
        };
        for (action, samples) in self.intervention.actions.iter().zip(&self.commanded) {
            let samples = samples.clone();
            match action {
                Action::Follow { track, .. } => {
                    staging.tracks.insert(*track, samples);
                }
                Action::Insert { kind, length_m, width_m, .. } => {
                    staging.inserted.push(Inserted { kind: *kind, length_m: *length_m, width_m: *width_m, samples });
                }
                Action::FollowThenReact { .. } | Action::FollowThenObey { .. } | Action::Triggered(_) => {
                    return Err(Failure::bad_input(format!(
                        "scene {}: an adversary of {} reacts to the ego, so it cannot be played beside the recorded ego; leave out \
                         --ego-log",
                        self.scene.id, self.solution
                    )));
                }
            }
        }
        Ok(staging)
    }

    /// The change of its scene that is wanted.
    ///
    /// # Errors
    /// As [`Played::with_ego_log`].
    pub fn wanted(&self, ego_log: bool) -> Result<Staging, Failure> {
        if ego_log { self.with_ego_log() } else { Ok(self.staging()) }
    }

    /// Returns the share of the last step that was driven, if a contact ended the rollout within that step.
    fn last_step_share(&self) -> Option<f64> {
        let contact = self.outcome.contact?;
        let steps_before = self.motion.ego.len().checked_sub(2)?;
        let share = contact.time_s / DT_S - steps_before as f64;
        // A contact at the very start of a step leaves whole steps.
        (share > 0.0 && share < 1.0 - 1e-9).then_some(share)
    }
}
