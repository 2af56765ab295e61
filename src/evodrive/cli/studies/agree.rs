//! `agree`: the same programs in the same scenes, played by the simulators of two runs.

use clap::{Args, Subcommand};
use serde_json::json;
use std::collections::BTreeSet;
use std::path::Path;

use crate::backend::{Answers, Backend, DriveContext, NoOutcome, Replay, lowered};
use crate::cli::evolve::behind;
use crate::cli::records::{folder::RunFolder, run_name::TwoRuns};
use crate::cli::terminal::answer::{Answer, progress};
use crate::cli::terminal::exit::Failure;
use crate::epoch::{LineageSpec, Player, Study, cluster_of};
use crate::evidence::RecordedRun;
use crate::evidence::agreement::{Descent, Meeting, Pair, Report, Side, Tried, report, text};
use crate::experiment::Experiment;
use crate::kernel::{Digest, Threads};
use crate::objects::{Program, Score};
use crate::sim::{ActorRef, Contact, Intervention, Outcome, Plant, SimulatorOptions, Trace, rollout};
use crate::text::counted;

use super::agree_init;
use super::plant_changes::{PlantChange, plant_changes};

#[derive(Debug, Args)]
#[command(args_conflicts_with_subcommands = true)]
pub struct Options {
    #[command(subcommand)]
    pub command: Option<Command>,
    #[command(flatten)]
    pub runs: TwoRuns,
}

#[derive(Debug, Subcommand)]
pub enum Command {
    /// Write the study for scenes of your own: the same programs in our simulator and in MetaDrive.
    Init(agree_init::Options),
}

/// Plays what both runs labelled in both simulators, and counts.
pub fn run(options: &Options, jobs: usize) -> Result<Answer, Failure> {
    if let Some(Command::Init(options)) = &options.command {
        return agree_init::run(options, jobs);
    }
    let threads = Threads::new(jobs)?;
    let [first, second] = options.runs.named()?;
    let agreed = agreement(first, second, &threads)?;
    Ok(Answer::new(text(&agreed), json!(agreed)))
}

/// Reports how far the simulators of two run folders agree.
pub fn agreement(first: &Path, second: &Path, threads: &Threads) -> Result<Report, Failure> {
    let (first, second) = (Run::open(first, threads)?, Run::open(second, threads)?);
    comparable(&first, &second)?;
    let cases = cases(&first, &second);
    progress(format!("{} that both runs labelled", counted(cases.len(), "rollout")));
    let players = [first.player(), second.player()];
    let own = [&first, &second].into_iter().position(|run| run.study.backend.is_none());
    let changes = own.map_or(Vec::new(), |own| plant_changes(&[&first, &second][own].study.simulator.plant));
    let both = Both { runs: [&first, &second], players: &players, own, changes: &changes };
    let played = threads.map(&cases, |_, case| play(&both, case));
    let (mut pairs, mut left_out) = (Vec::new(), Vec::new());
    for (case, played) in cases.iter().zip(played) {
        match played {
            Ok(pair) => pairs.push(pair),
            Err(reason) => left_out.push(format!("{} {}: {reason}", case.name, case.scene(&first))),
        }
    }
    let same_commands = first.plans_around()? == second.plans_around()?;
    let tried = Tried { own: own.unwrap_or(0), changes: changes.into_iter().map(|change| change.name).collect() };
    let (backends, descents) = ([first.backend_name(), second.backend_name()], descents(&first));
    Ok(report(backends, same_commands, &pairs, &tried, &descents, left_out))
}

/// Programs from elsewhere beside the parents of their families: a lineage that starts with one, and the lineage of the same family and
/// ego that starts with the family's own and sets nothing that the program has otherwise. Of several the one that sets most.
fn descents(run: &Run) -> Vec<Descent> {
    let lineages = &run.study.lineages;
    let parent = |spec: &LineageSpec| {
        let own = run.recorded.parents.iter().find(|parent| parent.lineage == spec.id)?;
        Some(own.program.solution_id.to_string())
    };
    let beside = |evolved: &LineageSpec| {
        let start = &evolved.start.as_ref()?.program;
        let alike = |spec: &&LineageSpec| {
            let same = spec.family == evolved.family && spec.ego.name() == evolved.ego.name();
            spec.start.is_none()
                && same
                && spec.parent.iter().all(|(name, set)| start.parameters.get(name) == Some(set))
        };
        // The last of the equal ones is taken, so the order is turned.
        let spec = lineages.iter().rev().filter(alike).max_by_key(|spec| spec.parent.len())?;
        Some(Descent { evolved: parent(evolved)?, parent: parent(spec)? })
    };
    lineages.iter().filter_map(beside).collect()
}

/// A finished run with what plays its rollouts again.
struct Run {
    folder: RunFolder,
    experiment: Experiment,
    study: Study,
    recorded: RecordedRun,
    replay: Option<Replay>,
}

impl Run {
    fn open(folder: &Path, threads: &Threads) -> Result<Run, Failure> {
        let folder = RunFolder::find(Some(folder))?;
        let experiment = folder.read_experiment()?;
        let study = experiment.study(folder.read_pool()?, threads)?;
        let (recorded, replay) = (folder.recorded()?, behind::replay_of(&experiment, &folder)?);
        Ok(Run { folder, experiment, study, recorded, replay })
    }

    fn backend(&self) -> Backend<'_> {
        behind::backend(&self.experiment, self.replay.as_ref().map(|replay| replay as &dyn Answers))
    }

    fn player(&self) -> Player<'_> {
        Player::of(&self.study, &self.recorded.counsels, self.backend())
    }

    fn backend_name(&self) -> String {
        match &self.study.backend {
            None => "evodrive".into(),
            Some(backend) if self.study.plans_around_backend() => {
                format!("{} {}, planned around its ego", backend.name, backend.version)
            }
            Some(backend) => format!("{} {}", backend.name, backend.version),
        }
    }

    /// Whose drive of the ego the families planned around; `None` for ours.
    fn plans_around(&self) -> Result<Option<Digest>, Failure> {
        let backend = self.study.backend.as_ref().filter(|_| self.study.plans_around_backend());
        backend.map(|backend| backend.key().map_err(Failure::internal)).transpose()
    }
}

/// Runs that differ in more than their simulator cannot say anything about it.
fn comparable(first: &Run, second: &Run) -> Result<(), Failure> {
    let refuse = |what: &str, a: String, b: String| {
        Err(Failure::bad_input(format!(
            "{} and {} differ in {what}: {a} and {b}; compare runs that differ only in simulator.backend",
            first.folder.dir.display(),
            second.folder.dir.display()
        )))
    };
    let (a, b) = (&first.study, &second.study);
    if a.pool_digest != b.pool_digest {
        return refuse("their scenes", a.pool_digest.short(16), b.pool_digest.short(16));
    }
    if a.simulator != b.simulator {
        return refuse(
            "simulator.plant or simulator.avoidance",
            format!("{:?}", a.simulator),
            format!("{:?}", b.simulator),
        );
    }
    if a.seed != b.seed {
        return refuse("seed", a.seed.0.to_string(), b.seed.0.to_string());
    }
    Ok(())
}

/// One rollout that both runs have a label of.
struct Case<'a> {
    /// The program's name, or the ego against which the scene is replayed.
    name: String,
    spec: &'a LineageSpec,
    /// `None` for the recorded scene without a program.
    program: Option<&'a Program>,
    /// True if the program was proposed in the run.
    proposed: bool,
    place: usize,
}

impl Case<'_> {
    fn scene<'r>(&self, run: &'r Run) -> &'r str {
        &run.study.scenes[self.place].scene().id
    }
}

/// Labels by lineage, program and scene.
type Labelled = BTreeSet<(String, String, String)>;

fn labelled(recorded: &RecordedRun) -> Labelled {
    let mut agreed = Labelled::new();
    let mut add = |lineage: &str, program: &Program, score: &Score| {
        let Ok(hash) = program.hash() else { return };
        let of = |scene: &String| (lineage.to_string(), hash.to_hex(), scene.clone());
        agreed.extend(score.scenes.iter().map(|label| of(&label.scene)));
    };
    for frozen in &recorded.frozen {
        recorded
            .program(&frozen.parent)
            .into_iter()
            .for_each(|p| add(frozen.lineage.as_str(), p, &frozen.parent_score));
    }
    for attempt in &recorded.attempts {
        if let (Some(candidate), Some(score)) = (attempt.exit.candidate(), attempt.exit.score()) {
            add(attempt.lineage.as_str(), &candidate.program, score);
        }
    }
    for finalist in &recorded.finalists {
        recorded
            .program(&finalist.solution)
            .into_iter()
            .for_each(|p| add(finalist.lineage.as_str(), p, &finalist.score));
    }
    for held_out in &recorded.held_out {
        recorded
            .program(&held_out.solution)
            .into_iter()
            .for_each(|p| add(held_out.lineage.as_str(), p, &held_out.score));
    }
    agreed
}

fn cases<'a>(first: &'a Run, second: &'a Run) -> Vec<Case<'a>> {
    let (a, b) = (labelled(&first.recorded), labelled(&second.recorded));
    let scenes = &first.study.scenes;
    let place = |id: &str| scenes.iter().position(|entry| entry.scene().id == id);
    let mut cases = Vec::new();
    let mut egos: Vec<&str> = Vec::new();
    for spec in &first.study.lineages {
        if egos.contains(&spec.ego.name()) {
            continue;
        }
        egos.push(spec.ego.name());
        let name = format!("replay against {}", spec.ego.name());
        let replay = |place| Case { name: name.clone(), spec, program: None, proposed: false, place };
        cases.extend((0..scenes.len()).map(replay));
    }
    let parents = first.recorded.parents.iter().map(|parent| (&parent.program, false));
    let children = first.recorded.attempts.iter().filter_map(|attempt| attempt.exit.candidate());
    let programs: Vec<(String, (&Program, bool))> = parents
        .chain(children.map(|candidate| (&candidate.program, true)))
        .filter_map(|(program, proposed)| Some((program.hash().ok()?.to_hex(), (program, proposed))))
        .collect();
    for (lineage, hash, scene) in a.intersection(&b) {
        let spec = first.study.lineages.iter().find(|spec| spec.id.as_str() == lineage);
        let of = |(known, (program, _)): &&(String, (&Program, bool))| {
            known == hash && program.lineage_id.as_str() == lineage
        };
        let program = programs.iter().find(of).map(|(_, found)| *found);
        if let (Some(spec), Some((program, proposed)), Some(place)) = (spec, program, place(scene)) {
            let name = program.solution_id.to_string();
            cases.push(Case { name, spec, program: Some(program), proposed, place });
        }
    }
    cases
}

/// Two runs, and what is tried with the plant of the one that is our own simulator's.
struct Both<'a> {
    runs: [&'a Run; 2],
    players: &'a [Player<'a>; 2],
    own: Option<usize>,
    changes: &'a [PlantChange],
}

/// A rollout of one of them: its outcome and motion, what was commanded, and whether a contact counts as the program's doing.
struct Played {
    outcome: Outcome,
    motion: Trace,
    intervention: Intervention,
    brought_about: bool,
}

fn play(both: &Both<'_>, case: &Case<'_>) -> Result<Pair, String> {
    let [first, _] = both.runs;
    let played = |which: usize| -> Result<Played, String> {
        let run = both.runs[which];
        let spec = run.study.lineages.iter().find(|spec| spec.id == case.spec.id);
        let spec = spec.ok_or("the other run has no such lineage")?;
        let Some(program) = case.program else {
            let (outcome, motion) = unchanged(run, spec, case.place)?;
            return Ok(Played { outcome, motion, intervention: Intervention::default(), brought_about: false });
        };
        let traced = both.players[which].trace(spec, program, case.place)?;
        let record = traced.record;
        let met = record.outcome.contact.filter(|contact| contact.adversary && record.intervened);
        let brought_about = met.is_some_and(|contact| record.meets_anyway != Some(contact.with));
        let (motion, intervention) = (traced.motion, traced.intervention);
        Ok(Played { outcome: record.outcome, motion, intervention, brought_about })
    };
    let (a, b) = (played(0)?, played(1)?);
    let partner_apart_m = match (&a.outcome.contact, &b.outcome.contact) {
        (Some(contact), None) => partner_apart_m(contact, &a.motion, &b.motion),
        (None, Some(contact)) => partner_apart_m(contact, &b.motion, &a.motion),
        _ => Some(0.0),
    };
    let changed = match both.own {
        Some(own) => changed(both, own, case, &[&a, &b][own].intervention)?,
        None => Vec::new(),
    };
    let name = |actor: ActorRef| match actor {
        ActorRef::Track(track) => first.study.scenes[case.place].scene().tracks[track].id.clone(),
        ActorRef::Inserted(i) => format!("inserted {i}"),
    };
    Ok(Pair {
        program: case.name.clone(),
        family: case.program.map(|program| program.source_family.to_string()),
        proposed: case.proposed,
        cluster: cluster_of(first.study.scenes[case.place].features()).to_string(),
        scene: case.scene(first).to_string(),
        ego: case.spec.ego.name().to_string(),
        a: side(&a, &name),
        b: side(&b, &name),
        partner_apart_m,
        changed,
    })
}

/// Returns for each change whether our own simulator finds a contact, with the commands that both simulators had.
fn changed(both: &Both<'_>, own: usize, case: &Case<'_>, intervention: &Intervention) -> Result<Vec<bool>, String> {
    let study = &both.runs[own].study;
    let prepared = &study.scenes[case.place].prepared;
    let plant = Plant::with_options(prepared.clone(), &study.simulator).map_err(|error| error.to_string())?;
    let commanded = lowered(&plant, intervention, &case.spec.ego).map_err(NoOutcome::reason)?;
    let contact = |change: &PlantChange| {
        let options = SimulatorOptions { plant: change.plant, ..study.simulator };
        let plant = Plant::with_options(prepared.clone(), &options)?;
        let ego = change.ego(&case.spec.ego);
        rollout(&plant, &commanded, ego.driver().as_mut()).map(|outcome| outcome.contact.is_some())
    };
    both.changes.iter().map(|change| contact(change).map_err(|error| error.to_string())).collect()
}

fn unchanged(run: &Run, spec: &LineageSpec, place: usize) -> Result<(Outcome, Trace), String> {
    let prepared = run.study.scenes[place].prepared.clone();
    let plant = Plant::with_options(prepared, &run.study.simulator).map_err(|error| error.to_string())?;
    let played = run.backend().traced(&plant, &Intervention::default(), &spec.ego, DriveContext::plain(run.study.seed));
    played.map_err(NoOutcome::reason)
}

fn side(played: &Played, name: &dyn Fn(ActorRef) -> String) -> Side {
    let Played { outcome, motion: trace, brought_about, .. } = played;
    let meeting = |contact: &Contact| Meeting {
        with: name(contact.with),
        adversary: contact.adversary,
        at_cs: (100.0 * contact.time_s).round() as u32,
        class: contact.class.name().to_string(),
        striker: word(&contact.striker),
        avoidable: contact.avoidable,
        relative_speed_mps: contact.relative_speed_mps,
    };
    let could = outcome.contact.and_then(|contact| contact.preventable()) == Some(true);
    // The row of a contact within a step lies at no whole step.
    let rows = trace.ego.len();
    let whole = match &outcome.contact {
        Some(contact) => rows.min((10.0 * contact.time_s + 1e-6) as usize + 1),
        None => rows,
    };
    Side {
        contact: outcome.contact.as_ref().map(meeting),
        end: word(&outcome.end),
        ego: trace.ego[..whole].iter().map(|sample| [sample.position.x, sample.position.y]).collect(),
        distance_m_min: outcome.distance_m_min,
        published: *brought_about,
        preventable: *brought_about && could,
    }
}

/// A value that is written as a word.
fn word(value: &impl serde::Serialize) -> String {
    let word = serde_json::to_value(value).ok().and_then(|value| value.as_str().map(str::to_string));
    word.unwrap_or_default()
}

/// Returns the distance between the places of a contact's partner in the rollout with it and in the other one at the last whole step
/// before it, metres; `None` if it is not on the road in the other.
fn partner_apart_m(contact: &Contact, own: &Trace, other: &Trace) -> Option<f64> {
    let step = (10.0 * contact.time_s) as usize;
    let place = |trace: &Trace| {
        let actor = trace.actors.iter().find(|actor| actor.actor == contact.with)?;
        Some(actor.samples[step.min(trace.ego.len() - 1)]?.position)
    };
    let there = place(other)?;
    Some(place(own).map_or(0.0, |own| own.distance(there)))
}
