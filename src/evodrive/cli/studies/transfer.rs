//! `transfer`: the reported programs of runs and their parents against drivers that they were not evolved on.

use clap::Args;
use serde_json::json;
use std::collections::BTreeMap;
use std::path::PathBuf;

use crate::cli::look::table::Format;
use crate::cli::records::folder::RunFolder;
use crate::cli::records::run_name::Runs;
use crate::cli::scenes::files;
use crate::cli::studies::{apply, packed};
use crate::cli::terminal::answer::{Answer, progress};
use crate::cli::terminal::exit::Failure;
use crate::cli::terminal::output::Output;
use crate::ego::Policy;
use crate::epoch::{Applied, SceneEntry};
use crate::evidence::RecordedRun;
use crate::evidence::figures::{Panel, heat_map};
use crate::evidence::realism::Realisms;
use crate::evidence::recognised::{self, RoadUsers};
use crate::evidence::tables::{self, Careful, DRIVERS, Line, Transferred};
use crate::experiment::ProgramFile;
use crate::families;
use crate::kernel::{Digest, Threads};
use crate::objects::{Program, Score};
use crate::scene::{Sample, beside};
use crate::sim::{ActorRef, AvoidanceOptions, Forecast, SimulatorOptions};
use crate::text::nearest;

#[derive(Debug, Args)]
pub struct Options {
    #[command(flatten)]
    pub runs: Runs,
    /// Pools or files of scenes that none of these searches has seen.
    #[arg(long, num_args = 1.., required = true)]
    pub scenes: Vec<PathBuf>,
    /// Drivers, a column each: idm, idm-lights, pdm, frenet, replay, sac-metadrive, sac-metadrive-2.
    #[arg(long, value_delimiter = ',', default_value = "idm,pdm,frenet,sac-metadrive-2")]
    pub drivers: Vec<String>,
    /// Add a row for each family.
    #[arg(long)]
    pub by_family: bool,
    /// How to write it; without it Markdown.
    #[arg(long)]
    pub format: Option<Format>,
    /// File for a heat map, SVG.
    #[arg(long)]
    pub figure: Option<PathBuf>,
    /// File for how alike judges rank the programs against each driver, Markdown: published, at fault, the careful driver, UN R157's.
    #[arg(long)]
    pub judges: Option<PathBuf>,
    /// File for how the preventable share moves with the careful driver who judges, against the first driver, Markdown: its reaction time, a
    /// forecast along lanes, lesser swerves.
    #[arg(long)]
    pub sensitivity: Option<PathBuf>,
    /// File for how well a classifier tells the road users that each program moves from recorded ones, against the first driver, Markdown.
    #[arg(long)]
    pub recognised: Option<PathBuf>,
    #[command(flatten)]
    pub output: Output,
}

/// A program to be played: its family's file, and the program in it.
struct Player {
    file: ProgramFile,
    program: Program,
}

pub fn run(options: &Options, jobs: usize) -> Result<Answer, Failure> {
    let threads = files::threads(jobs)?;
    let drivers = drivers(&options.drivers)?;
    let folders = options.runs.folders()?;
    let (mut players, mut lines) = (Vec::new(), Vec::new());
    for folder in &folders {
        let run = folder.recorded()?;
        add(folder, &run, &mut players, &mut lines)?;
    }
    let first: &Player =
        players.first().ok_or_else(|| Failure::bad_input("the runs report no program; name finished runs"))?;
    let pool = files::chosen(&options.scenes, &[], jobs)?;
    let digest = pool.digest();
    let (taken, _) = apply::sorted_out(&options.scenes, &first.file, pool)?;
    let entries = threads.map(&taken, |_, scene| SceneEntry::new(scene.clone()));
    let seen = |player: &Player| entries.iter().find(|entry| player.file.evolution_scenes.contains(&entry.digest));
    if let Some((player, entry)) = players.iter().find_map(|player| Some((player, seen(player)?))) {
        return Err(Failure::bad_input(format!(
            "scene {} is one on which {} was evolved, expected scenes that no search has seen; generate some with another seed",
            entry.scene().id,
            player.program.solution_id
        )));
    }
    let first_file = first.file.conditions.simulator;
    let played = Played { players: &players, entries: &entries, threads: &threads };
    // With contacts judged by nuPlan's rule and the jury.
    let scores = scores(played, &drivers, &SimulatorOptions { at_fault: true, jury: true, ..first_file })?;
    let judged = match options.sensitivity {
        Some(_) => careful(played, &drivers[..1], &first_file)?,
        None => Vec::new(),
    };
    let transferred = Transferred {
        pool: digest,
        scenes: taken.iter().map(|scene| scene.id.clone()).collect(),
        drivers: drivers.iter().map(|(name, _)| *name).collect(),
        lines,
        scores,
    };
    if let Some(place) = &options.recognised {
        let text = recognised(played, drivers[0].0, &drivers[0].1, &first_file, &transferred)?;
        options.output.write(place, text.as_bytes())?;
    }
    if let Some(place) = &options.sensitivity {
        options.output.write(place, tables::sensitivity(&transferred, &judged).as_bytes())?;
    }
    written(options, &transferred)
}

/// Returns the table of how well moved road users are distinguished from recorded ones.
fn recognised(
    Played { players, entries, threads }: Played<'_>,
    name: &str,
    ego: &Policy,
    simulator: &SimulatorOptions,
    of: &Transferred,
) -> Result<String, Failure> {
    let sources = families::sources_by_hand();
    let names = of.names();
    let (mut rows, mut control) = (Vec::new(), None);
    for (place, player) in players.iter().enumerate() {
        progress(format!("{}: {} rollouts of {}", names[place], entries.len(), player.program.solution_id));
        let mut file = player.file.clone();
        file.conditions.simulator = *simulator;
        let counsels = apply::counsels(&file, entries);
        let applied = apply::as_conditioned(&file, &sources, ego, &counsels)?;
        let of_scene = |place: usize, entry: &SceneEntry| road_users(&applied, &player.program, place, entry);
        let mut users = RoadUsers::default();
        for found in threads.map(entries, of_scene) {
            users.acted.extend(found.acted);
            users.recorded.extend(found.recorded);
        }
        let realism = Realisms::of(&of.scores[place][0]).strict_realism;
        rows.push((names[place].clone(), realism, users.recognised(of.suite())));
        control.get_or_insert_with(|| users.control(of.suite()));
    }
    rows.extend(control.map(|control| ("recorded against recorded (control)".to_string(), None, control)));
    Ok(recognised::text(&rows, entries.len(), head(name)))
}

/// Returns the road users of one scene; none if the program has no rollout in it or does not act.
fn road_users(applied: &Applied<'_>, program: &Program, place: usize, entry: &SceneEntry) -> RoadUsers {
    let mut users = RoadUsers::default();
    let Ok(traced) = applied.trace(program, entry) else { return users };
    if !traced.record.outcome.acted() {
        return users;
    }
    let (motion, lanes) = (&traced.motion, &entry.prepared.lanes);
    let until = motion.ego.len()
        - if traced.record.outcome.contact.is_some() { BEFORE_CONTACT.min(motion.ego.len()) } else { 0 };
    let row =
        |samples: &[Option<Sample>]| beside::row(&motion.ego[..until], &samples[..until.min(samples.len())], lanes);
    for actor in &motion.actors {
        let moving = row(&actor.samples).map(|row| (place, row));
        if actor.adversary {
            users.acted.extend(moving)
        } else {
            users.recorded.extend(moving)
        }
        let own = match actor.actor {
            ActorRef::Track(track) if actor.adversary => entry.scene().tracks[track].samples.get(motion.from_step..),
            _ => None,
        };
        users.recorded.extend(own.and_then(row).map(|row| (place, row)));
    }
    users
}

/// Steps before a contact at which motion is no longer looked at: there even the recorded would be an attack.
const BEFORE_CONTACT: usize = 10;

/// Returns the results of all programs against one driver, with other careful drivers as judges.
fn careful(
    played: Played<'_>,
    driver: &[(&'static str, Policy)],
    simulator: &SimulatorOptions,
) -> Result<Vec<Careful>, Failure> {
    let of = |(name, set): Differing| {
        let mut simulator = SimulatorOptions { ..*simulator };
        set(&mut simulator.avoidance);
        let scores = scores(played, driver, &simulator)?.into_iter().flatten().collect();
        Ok(Careful { name, scores })
    };
    CAREFUL.into_iter().map(of).collect()
}

/// A careful driver's name, and what makes it of the experiment's.
type Differing = (&'static str, fn(&mut AvoidanceOptions));

/// Careful drivers by what they differ in from the experiment's.
const CAREFUL: [Differing; 5] = [
    ("reacts after 0.75 s", |of| of.reaction_s = 0.75),
    ("reacts after 0.4 s", |of| of.reaction_s = 0.4),
    ("foresees ways along lanes", |of| of.forecast = Forecast::Lanes),
    ("swerves less far, too", |of| of.lesser_swerves = true),
    ("both", |of| (of.forecast, of.lesser_swerves) = (Forecast::Lanes, true)),
];

/// The table, and the files that were asked for.
fn written(options: &Options, of: &Transferred) -> Result<Answer, Failure> {
    let table = tables::transfer(of, options.by_family);
    if let Some(place) = &options.figure {
        let heads: Vec<String> = of.drivers.iter().map(|name| head(name).to_string()).collect();
        let panel = |(title, rows): (&str, Vec<_>)| Panel { title: title.to_string(), rows, columns: heads.clone() };
        let panels: Vec<Panel> = tables::panels(&table).into_iter().map(panel).collect();
        let title = "Evolved on (rows), tested on (columns): share of scenes";
        options.output.write(place, heat_map(title, &panels, 1.0).svg().as_bytes())?;
    }
    if let Some(place) = &options.judges {
        let mut text = "# How alike judges rank the programs\n\nKendall's tau-b over the programs' shares of scenes; – where a judge tells no two \
                        apart.\n"
            .to_string();
        for (driver, name) in of.drivers.iter().enumerate() {
            text += &format!("\n## Driven by {}\n\n{}", head(name), tables::judges(of, driver));
        }
        options.output.write(place, text.as_bytes())?;
    }
    let object = json!({"table": table.json(), "scenes": of.scenes.len(), "programs": of.scores.len()});
    Ok(Answer::exact(options.format.unwrap_or(Format::Markdown).text(&table), object))
}

fn head(name: &str) -> &str {
    DRIVERS.into_iter().find(|(known, ..)| *known == name).map_or(name, |(.., head)| head)
}

/// The drivers of these names.
fn drivers(names: &[String]) -> Result<Vec<(&'static str, Policy)>, Failure> {
    let mut all: Vec<(&'static str, Policy)> = Vec::new();
    for name in names {
        let Some((known, policy, _)) = DRIVERS.into_iter().find(|(known, ..)| known == name) else {
            let near = nearest(name, DRIVERS.map(|(known, ..)| known));
            let near = near.map_or(String::new(), |near| format!("; did you mean {near}?"));
            let known = DRIVERS.map(|(known, ..)| known).join(", ");
            return Err(Failure::bad_input(format!(
                "--drivers: no column is called {name:?}; there are {known}{near}"
            )));
        };
        if all.iter().any(|(other, _)| *other == known) {
            return Err(Failure::bad_input(format!("--drivers: {known} is named twice; name each driver once")));
        }
        all.push((known, apply::driver(policy)?));
    }
    Ok(all)
}

/// Adds the reported program of every lineage of a run, and its parent. A program that is there already is not played again.
fn add(folder: &RunFolder, run: &RecordedRun, players: &mut Vec<Player>, lines: &mut Vec<Line>) -> Result<(), Failure> {
    let result = run.result.as_ref().ok_or_else(|| {
        Failure::bad_input(format!("{}: the run is not finished; `evodrive resume` goes on", folder.dir.display()))
    })?;
    for lineage in &result.lineages {
        let file = packed::packed_of(folder, run, lineage.evolved.solution.as_str())?;
        if file.conditions.evaluation.safebench().is_some() {
            return Err(Failure::bad_input(format!(
                "{}: its programs play SafeBench's routes, expected runs on recorded or generated traffic",
                folder.dir.display()
            )));
        }
        let mut place = |program: &Program| -> Result<usize, Failure> {
            let hash = program.hash().map_err(Failure::internal)?;
            for (place, known) in players.iter().enumerate() {
                if known.program.hash().map_err(Failure::internal)? == hash {
                    return Ok(place);
                }
            }
            players.push(Player { file: file.clone(), program: program.clone() });
            Ok(players.len() - 1)
        };
        let (parent, program) = (place(&file.parent)?, place(&file.program)?);
        let evolved_on = format!("{} on {}", tables::searched(run).words(), lineage.ego);
        let family = lineage.family.to_string();
        // Runs with the same words are repetitions of one search.
        let alike = lines.iter().filter(|of| (&of.family, &of.evolved_on) == (&family, &evolved_on)).count();
        let replica = u32::try_from(alike).unwrap_or(u32::MAX);
        lines.push(Line { family, evolved_on, replica, parent, program });
    }
    Ok(())
}

/// Programs, scenes, and who plays them.
#[derive(Clone, Copy)]
struct Played<'a> {
    players: &'a [Player],
    entries: &'a [SceneEntry],
    threads: &'a Threads,
}

/// Every program against every driver in a simulator, under the seed of the first program's run.
fn scores(
    Played { players, entries, threads }: Played<'_>,
    drivers: &[(&'static str, Policy)],
    simulator: &SimulatorOptions,
) -> Result<Vec<Vec<Score>>, Failure> {
    let Some(first) = players.first() else { return Ok(Vec::new()) };
    let mut conditions = first.file.conditions.clone();
    conditions.simulator = *simulator;
    let sources = families::sources_by_hand();
    let mut by_family: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
    for (place, player) in players.iter().enumerate() {
        by_family.entry(player.file.family.as_str()).or_default().push(place);
    }
    let mut scores: Vec<Vec<Score>> = vec![Vec::new(); players.len()];
    for (name, ego) in drivers {
        for (family, places) in &by_family {
            progress(format!("{family}: {} programs against {name}", places.len()));
            let file = ProgramFile { conditions: conditions.clone(), ..players[places[0]].file.clone() };
            let counsels: BTreeMap<Digest, _> = apply::counsels(&file, entries);
            let applied: Applied<'_> = apply::as_conditioned(&file, &sources, ego, &counsels)?;
            let programs: Vec<&Program> = places.iter().map(|&place| &players[place].program).collect();
            for (place, labelled) in places.iter().zip(applied.label(&programs, entries, threads)?) {
                scores[*place].push(labelled.score);
            }
        }
    }
    Ok(scores)
}
