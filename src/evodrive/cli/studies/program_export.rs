//! `program export`: a program as one file, or as what other programs play: SafeBench's own files of parameters, OpenSCENARIO with
//! a trigger, interventions for the scenario class of `bridges/safebench`.

use clap::{Args, ValueEnum};
use serde::Serialize;
use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::path::PathBuf;
use std::sync::Arc;

use crate::cli::scenes::{export::file_name, files};
use crate::cli::studies::apply;
use crate::cli::studies::packed::{Which, packed};
use crate::cli::studies::program_form::bytes_for;
use crate::cli::terminal::output::Output;
use crate::cli::terminal::{answer::Answer, exit::Failure};
use crate::epoch::SceneEntry;
use crate::experiment::{ProgramFile, safebench_files};
use crate::families::{self, adv_traj, advsim, chatscene, human};
use crate::formats::openscenario::{Revision, triggered};
use crate::formats::safebench::parameters::{Entry, Parameters, written};
use crate::motion::traffic_family::adversary;
use crate::scene::safebench::{Staging, TrafficFamily};
use crate::scene::{Origin, Scene};
use crate::sim::{Action, Intervention, Script};
use crate::text::counted;

/// SafeBench's ten evaluated routes.
const ROUTES: std::ops::RangeInclusive<u32> = 4..=13;
/// Name and version of an exported intervention.
const INTERVENTION: &str = "evodrive-intervention/1";
/// Folder of the scenario class among SafeBench's.
const FOLDER: &str = "evodrive";

#[derive(Debug, Args)]
pub struct Options {
    #[command(flatten)]
    pub which: Which,
    /// File to write: JSON, or TOML to be changed by hand where its name ends in .toml; without it JSON goes to stdout. With --format
    /// the folder of the files.
    #[arg(long)]
    pub out: Option<PathBuf>,
    /// Write it for another program.
    #[arg(long, requires = "out")]
    pub format: Option<Form>,
    /// A pool, scenario files or folders: the scenes in which it is written. Files of SafeBench that say the same on every route (a
    /// grid of parameters, ranges, sequences of a file) need none.
    #[arg(long, num_args = 1.., requires = "format")]
    pub scenes: Vec<PathBuf>,
    /// Only the scene with this id; may be repeated.
    #[arg(long, requires = "scenes")]
    pub scene: Vec<String>,
    /// Driver that it plans around there: idm, idm-lights, pdm, frenet, replay, or weights (.safetensors, .onnx); without it the file's own.
    #[arg(long, requires = "scenes")]
    pub ego: Option<String>,
    #[command(flatten)]
    pub output: Output,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Form {
    /// SafeBench's own files: scenario_type/*.json with parameters or names of control sequences, the sequences, ChatScene's ranges.
    Safebench,
    /// OpenSCENARIO 1.2: scripts that wait for the ego, which is free; on the town's own road.
    Openscenario,
    /// The same as OpenSCENARIO 1.0, for CARLA's ScenarioRunner.
    #[value(name = "openscenario-1.0")]
    Openscenario10,
    /// Motion that the program commands, as JSON for the scenario class of bridges/safebench.
    Intervention,
}

pub fn run(options: &Options, jobs: usize) -> Result<Answer, Failure> {
    let file = packed(&options.which)?;
    let Some(path) = &options.out else {
        let bytes = file.to_bytes().map_err(Failure::internal)?;
        return Ok(Answer::exact(String::from_utf8_lossy(&bytes), json!(file)));
    };
    if let Some(form) = options.format {
        let scenes = commanded(options, &file, jobs)?;
        let written = Written::of(&file, form, &scenes)?;
        for (name, bytes) in &written.files {
            options.output.write(&path.join(name), bytes)?;
        }
        return Ok(written.answer(path));
    }
    options.output.write(path, &bytes_for(path, &file)?)?;
    let text = format!(
        "{}, family {}, as {}\ndigest {}\n",
        file.program.solution_id,
        file.family,
        path.display(),
        file.digest
    );
    let object = json!({"file": path, "digest": file.digest, "program": file.program.solution_id});
    Ok(Answer::new(text, object))
}

/// A scene, and what the program commands there or why it cannot be said.
struct Commanded {
    scene: Arc<Scene>,
    intervention: Result<Intervention, String>,
}

/// Returns what the program commands in the scenes that are named.
fn commanded(options: &Options, file: &ProgramFile, jobs: usize) -> Result<Vec<Commanded>, Failure> {
    if options.scenes.is_empty() {
        return Ok(Vec::new());
    }
    let (_, ego) = apply::under_test(file, options.ego.as_ref(), None, None)?;
    let pool = files::chosen(&options.scenes, &options.scene, jobs)?;
    let (taken, _) = apply::sorted_out(&options.scenes, file, pool)?;
    let threads = files::threads(jobs)?;
    let entries = threads.map(&taken, |_, scene| SceneEntry::new(scene.clone()));
    let counsels = apply::counsels(file, &entries);
    let sources = families::sources_by_hand();
    let applied = apply::as_conditioned(file, &sources, &ego, &counsels)?;
    let commanded = applied.interventions(&[&file.program], &entries, &threads)?.into_iter().flatten();
    let of = |(entry, intervention): (&SceneEntry, _)| Commanded { scene: entry.scene().clone(), intervention };
    Ok(entries.iter().zip(commanded).map(of).collect())
}

/// Files that are written, and scenes that are left out with the reason.
#[derive(Default)]
struct Written {
    files: Vec<(String, Vec<u8>)>,
    notes: BTreeSet<String>,
    left_out: Vec<(String, String)>,
}

impl Written {
    fn of(file: &ProgramFile, form: Form, scenes: &[Commanded]) -> Result<Written, Failure> {
        let mut written = Written::default();
        match form {
            Form::Safebench => written.safebench(file, scenes)?,
            _ if scenes.is_empty() => {
                return Err(Failure::bad_input("this format is of scenes: name some with --scenes"));
            }
            Form::Intervention => written.interventions(file, scenes)?,
            Form::Openscenario | Form::Openscenario10 => {
                let mut taken = BTreeSet::new();
                for of in scenes {
                    match written.openscenario(file, form, of, &mut taken) {
                        Ok(files) => written.files.extend(files),
                        Err(reason) => written.left_out.push((of.scene.id.clone(), reason)),
                    }
                }
            }
        }
        if written.files.is_empty() {
            let reasons: Vec<String> =
                written.left_out.iter().map(|(of, reason)| format!("  {of}: {reason}")).collect();
            let other = match form {
                Form::Safebench => "\nas OpenSCENARIO: --format openscenario --scenes POOL",
                _ => "",
            };
            return Err(Failure::bad_input(format!("nothing could be written:\n{}{other}", reasons.join("\n"))));
        }
        Ok(written)
    }

    /// SafeBench's own files.
    fn safebench(&mut self, file: &ProgramFile, scenes: &[Commanded]) -> Result<(), Failure> {
        let refused = |reason: String| {
            let other = "as OpenSCENARIO: --format openscenario --scenes POOL";
            Failure::bad_input(format!(
                "{} has no form in SafeBench's files: {reason}; {other}",
                file.program.solution_id
            ))
        };
        match file.family.as_str() {
            human::NAME => {
                let here: BTreeSet<u32> =
                    scenes.iter().filter_map(|of| Some(of.scene.staging.as_ref()?.route)).collect();
                let routes: Vec<u32> = if here.is_empty() { ROUTES.collect() } else { here.into_iter().collect() };
                let parent = ProgramFile::published(&file.family)?.program;
                let entries = safebench_files::human_entries(&file.program, &parent, &routes).map_err(refused)?;
                self.json("scenario_type/human.json", &entries)
            }
            chatscene::NAME => {
                let (ranges, left) = safebench_files::optimised_ranges(&file.program).map_err(refused)?;
                self.left_out.extend(left.into_iter().map(|reason| ("ranges".to_string(), reason)));
                for (scenario, of) in ranges {
                    self.json(&format!("scenario_{scenario}.json"), &of)?;
                }
                Ok(())
            }
            advsim::NAME | adv_traj::NAME => self.sequences(file, scenes).map_err(|error| match error {
                Refused::Form(reason) => refused(reason),
                Refused::Failure(failure) => failure,
            }),
            other => Err(refused(format!("family {other} is none of the benchmark's"))),
        }
    }

    /// A list of scenarios and the control sequences that it names.
    fn sequences(&mut self, file: &ProgramFile, scenes: &[Commanded]) -> Result<(), Refused> {
        let family = file.family.as_str();
        let (list, folder) = if family == advsim::NAME { ("advsim", "advsim") } else { ("advtraj", "adv_trajectory") };
        // (scenario, route) and the sequence; those of a file are the same on every route.
        let mut all: Vec<(TrafficFamily, u32, Vec<f64>)> = Vec::new();
        if scenes.is_empty() && file.sequences.is_empty() {
            return Err(Refused::Form("its sequences are searched scene by scene: name scenes with --scenes".into()));
        }
        if scenes.is_empty() {
            let each = |(traffic, values): (&TrafficFamily, &Vec<f64>)| {
                ROUTES.map(|route| (*traffic, route, values.clone())).collect::<Vec<_>>()
            };
            all.extend(file.sequences.iter().flat_map(each));
        }
        for of in scenes {
            match searched(family, of) {
                Ok(found) => all.push(found),
                Err(reason) => self.left_out.push((of.scene.id.clone(), reason)),
            }
        }
        if all.is_empty() {
            return Ok(());
        }
        let (mut numbered, mut entries) = (BTreeMap::<TrafficFamily, Vec<Vec<f64>>>::new(), Vec::new());
        for (traffic, route_id, values) in all {
            let known = numbered.entry(traffic).or_default();
            let number = known.iter().position(|before| *before == values).unwrap_or_else(|| {
                known.push(values);
                known.len() - 1
            });
            entries.push(Entry {
                data_id: u32::try_from(entries.len()).unwrap_or(u32::MAX),
                scenario_folder: folder.into(),
                scenario_id: traffic.number(),
                route_id,
                risk_level: None,
                parameters: Parameters::File(format!("{number}.json")),
            });
        }
        self.json(&format!("scenario_type/{list}.json"), &entries).map_err(Refused::Failure)?;
        for (traffic, known) in &numbered {
            for (number, values) in known.iter().enumerate() {
                let name = format!("model_ckpt/{list}/{}/{number}.json", traffic.number());
                self.json(&name, values).map_err(Refused::Failure)?;
            }
        }
        Ok(())
    }

    fn json<T: Serialize>(&mut self, name: &str, value: &T) -> Result<(), Failure> {
        self.files.push((name.into(), written(value).map_err(Failure::internal)?));
        Ok(())
    }

    /// Interventions where SafeBench's policy for files looks for them, and the list that names them.
    fn interventions(&mut self, file: &ProgramFile, scenes: &[Commanded]) -> Result<(), Failure> {
        let (mut numbers, mut entries) = (BTreeMap::<usize, u32>::new(), Vec::new());
        for of in scenes {
            match Played::of(file, of) {
                Ok(played) => {
                    let number = numbers.entry(played.scenario_id).or_default();
                    self.json(&format!("model_ckpt/{FOLDER}/{}/{number}.json", played.scenario_id), &played)?;
                    entries.push(Entry {
                        data_id: u32::try_from(entries.len()).unwrap_or(u32::MAX),
                        scenario_folder: FOLDER.into(),
                        scenario_id: played.scenario_id,
                        route_id: played.route_id,
                        risk_level: None,
                        parameters: Parameters::File(format!("{number}.json")),
                    });
                    *number += 1;
                }
                Err(reason) => self.left_out.push((of.scene.id.clone(), reason)),
            }
        }
        if entries.is_empty() { Ok(()) } else { self.json(&format!("scenario_type/{FOLDER}.json"), &entries) }
    }

    /// The files of one scene.
    fn openscenario(
        &mut self,
        file: &ProgramFile,
        form: Form,
        of: &Commanded,
        taken: &mut BTreeSet<String>,
    ) -> Result<Vec<(String, Vec<u8>)>, String> {
        let scripts = scripts(of)?;
        let scene = &of.scene;
        let name = file_name(&format!("{} {}", scene.id, file.program.solution_id), taken);
        let revision = if form == Form::Openscenario { Revision::V1_2 } else { Revision::V1_0 };
        let road_file = format!("{name}.xodr");
        let made = triggered(scene, &scripts, town(&scene.origin), &road_file, revision).map_err(|e| e.to_string())?;
        self.notes.extend(made.notes.iter().map(|note| note.reason.clone()));
        // The road first: a scenario never lies beside a road that is not there yet.
        let road = made.xodr.map(|xodr| (road_file, xodr));
        Ok(road.into_iter().chain([(format!("{name}.xosc"), made.xosc)]).collect())
    }

    fn answer(self, out: &std::path::Path) -> Answer {
        let names: Vec<&String> = self.files.iter().map(|(name, _)| name).collect();
        let mut text = String::new();
        for name in &names {
            let _ = writeln!(text, "{name}");
        }
        for note in &self.notes {
            let _ = writeln!(text, "note: {note}");
        }
        for (of, reason) in &self.left_out {
            let _ = writeln!(text, "left out: {of}: {reason}");
        }
        let _ = writeln!(text, "{} in {}", counted(names.len(), "file"), out.display());
        let left: Vec<Value> = self.left_out.iter().map(|(of, reason)| json!({"what": of, "reason": reason})).collect();
        let object = json!({"out": out, "files": names, "notes": self.notes, "left_out": left});
        Answer::new(text, object)
    }
}

/// Why no sequence is written.
enum Refused {
    Form(String),
    Failure(Failure),
}

/// The scripts of an intervention, where it has nothing else.
fn scripts(of: &Commanded) -> Result<Vec<Script>, String> {
    let intervention = of.intervention.as_ref().map_err(Clone::clone)?;
    let script = |action: &Action| {
        match action {
        Action::Triggered(script) => Ok(script.clone()),
        _ => Err("the program moves recorded road users, which wait for nobody; `evodrive apply --format` writes their motion".to_string()),
    }
    };
    let scripts = intervention.actions.iter().map(script).collect::<Result<Vec<_>, _>>()?;
    if scripts.is_empty() { Err("the program does nothing here".into()) } else { Ok(scripts) }
}

/// The control sequence that the program found in a scene.
fn searched(family: &str, of: &Commanded) -> Result<(TrafficFamily, u32, Vec<f64>), String> {
    let Staging { family: traffic, route, .. } = of.scene.staging.as_ref().ok_or("it is no scene of SafeBench's")?;
    let scripts = scripts(of)?;
    let script = scripts.get(adversary(*traffic)).ok_or("its script is missing")?;
    safebench_files::trigger_is_the_ports(family, *traffic, script)?;
    Ok((*traffic, *route, safebench_files::sequence_of(family, *traffic, script)?))
}

/// CARLA's town that a scene of SafeBench's routes lies in.
fn town(origin: &Origin) -> Option<&str> {
    (origin.format == "safebench").then(|| origin.name.split('/').next()).flatten()
}

/// An intervention as the scenario class of `bridges/safebench` reads it.
#[derive(Serialize)]
struct Played<'a> {
    format: &'static str,
    scene: &'a str,
    town: &'a str,
    scenario_id: usize,
    route_id: u32,
    program: &'a str,
    program_hash: String,
    actions: &'a [Action],
}

impl<'a> Played<'a> {
    fn of(file: &'a ProgramFile, of: &'a Commanded) -> Result<Played<'a>, String> {
        scripts(of)?;
        let town = town(&of.scene.origin)
            .ok_or("it lies on a generated road, which no town of CARLA has: import SafeBench's routes with --towns")?;
        let staging = of.scene.staging.as_ref().ok_or("it is no scene of SafeBench's")?;
        let intervention = of.intervention.as_ref().map_err(Clone::clone)?;
        Ok(Played {
            format: INTERVENTION,
            scene: &of.scene.id,
            town,
            scenario_id: staging.family.number(),
            route_id: staging.route,
            program: file.program.solution_id.as_str(),
            program_hash: file.program_hash.to_hex(),
            actions: &intervention.actions,
        })
    }
}
