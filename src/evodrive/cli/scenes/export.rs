//! `scenes export`: scenes, as logged or as an attempt played them, for other programs.

use clap::{Args, ValueEnum};
use serde::Serialize;
use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use crate::cli::look::rollout::{self, OfAttempt, Played};
use crate::cli::scenes::files;
use crate::cli::studies::{suite_file, suite_scenes};
use crate::cli::terminal::output::Output;
use crate::cli::terminal::{answer::Answer, exit::Failure};
use crate::formats::openscenario::Revision;
use crate::formats::scenarionet::{self, DataSet};
use crate::formats::{ExportError, Exported, ImportError, Note, Staging, commonroad, openscenario};
use crate::kernel::Threads;
use crate::scene::Scene;
use crate::text::counted;

/// Scenes that are held in memory as files before they are written.
pub const AT_ONCE: usize = 16;
/// Characters of a scene's id that go into a file's name.
const NAME_MAX: usize = 100;

#[derive(Debug, Args)]
pub struct Options {
    /// Pools, scenario files or folders; with --attempt its run, which has its own scenes.
    #[arg(id = "run", value_name = "POOL|RUN", required_unless_present = "attempt")]
    pub paths: Vec<PathBuf>,
    /// Only the scene with this id; may be repeated. Without it all scenes, or all that the attempt was labelled on.
    #[arg(long)]
    pub scene: Vec<String>,
    #[command(flatten)]
    pub of: OfAttempt,
    /// Format to write.
    #[arg(long)]
    pub format: Format,
    /// Folder for the files, named by their scenes.
    #[arg(long)]
    pub out: PathBuf,
    #[command(flatten)]
    pub output: Output,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Format {
    /// ScenarioNet's scene description as JSON, and the same as pickles with the files of a data set, for MetaDrive;
    /// importing either gives the same scene.
    Scenarionet,
    /// CommonRoad XML 2020a; importing it gives the same scene.
    Commonroad,
    /// OpenSCENARIO 1.2 (.xosc) with OpenDRIVE (.xodr), for esmini.
    Openscenario,
    /// OpenSCENARIO 1.0 with OpenDRIVE, the form that CARLA's ScenarioRunner loads.
    #[value(name = "openscenario-1.0")]
    Openscenario10,
}

/// A scene to export, and what a rollout made of it.
struct Job {
    scene: Scene,
    staging: Option<Staging>,
    /// Name of its files, without ending.
    name: String,
}

/// Files that a scene becomes.
struct Files {
    /// Names and contents, in the order in which they are written.
    files: Vec<(String, Vec<u8>)>,
    /// Parts of the scene that the files cannot hold.
    notes: Vec<Note>,
    /// The file that is part of a data set for MetaDrive, and its entry there.
    listed: Option<(String, Value)>,
}

/// Files that were written of one scene.
#[derive(Serialize)]
struct Row {
    scene: String,
    files: Vec<String>,
    notes: Vec<Note>,
}

/// A scene that the format cannot hold is left out and named; none at all is an error. A file is written whole or not
/// at all.
pub fn run(options: &Options, threads: usize) -> Result<Answer, Failure> {
    let chosen = chosen(options, threads)?;
    let mut exports = Exports::new(options.format, &options.out, options.output);
    exports.write(chosen, &Threads::new(threads)?)?;
    exports.some()?;
    let text =
        format!("{}{} in {}\n", exports.left_out_text(), counted(exports.written(), "scene"), options.out.display());
    Ok(Answer::new(text, exports.json()))
}

/// Scenes, and what rollouts made of them.
fn chosen(options: &Options, threads: usize) -> Result<Vec<(Scene, Option<Staging>)>, Failure> {
    Ok(match &options.of.attempt {
        Some(attempt) => {
            if let [_, second, ..] = options.paths.as_slice() {
                let what = "expected one run beside --attempt, found another";
                return Err(Failure::bad_input(format!("{}: {what}; scenes are named by --scene", second.display())));
            }
            let played =
                rollout::of_attempt(&options.of.run(options.paths.first())?, attempt, &options.scene, threads)?;
            let of = |played: &Played| Ok((played.scene.clone(), Some(played.wanted(options.of.ego_log)?)));
            played.iter().map(of).collect::<Result<_, Failure>>()?
        }
        None if options.paths.iter().any(|path| suite_file::is_suite(path)) => {
            let [path] = options.paths.as_slice() else {
                return Err(Failure::bad_input("a suite is exported alone: name no other scenes beside it"));
            };
            let played = suite_scenes::played(path, &options.scene, options.of.recorded.as_deref(), threads)?;
            let of = |played: &Played| Ok((played.scene.clone(), Some(played.wanted(options.of.ego_log)?)));
            played.iter().map(of).collect::<Result<_, Failure>>()?
        }
        None if options.of.recorded.is_some() => {
            let found = options.paths.first().map_or(Path::new(""), PathBuf::as_path);
            return options.of.without_result(found).map(|()| Vec::new());
        }
        None => files::chosen(&options.paths, &options.scene, threads)?
            .scenes
            .into_iter()
            .map(|scene| (scene, None))
            .collect(),
    })
}

/// Scenes that are written into a folder in one format.
pub struct Exports<'a> {
    format: Format,
    out: &'a Path,
    output: Output,
    taken: BTreeSet<String>,
    rows: Vec<Row>,
    left_out: Vec<(String, ExportError)>,
    /// The pickles that were written, for MetaDrive.
    data_set: DataSet,
}

impl<'a> Exports<'a> {
    pub fn new(format: Format, out: &'a Path, output: Output) -> Exports<'a> {
        Exports {
            format,
            out,
            output,
            taken: BTreeSet::new(),
            rows: Vec::new(),
            left_out: Vec::new(),
            data_set: DataSet::default(),
        }
    }

    /// Writes scenes; one that the format cannot hold is kept with its reason.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(&mut self, chosen: Vec<(Scene, Option<Staging>)>, threads: &Threads) -> Result<(), Failure> {
        let job = |(scene, staging): (Scene, Option<Staging>)| {
            let name = file_name(staging.as_ref().map_or(&scene.id, |staging| &staging.id), &mut self.taken);
            Job { scene, staging, name }
        };
        let jobs: Vec<Job> = chosen.into_iter().map(job).collect();
        for some in jobs.chunks(AT_ONCE) {
            let exported = threads.map(some, |_, job| export(job, self.format));
            for (job, exported) in some.iter().zip(exported) {
                let scene = job.staging.as_ref().map_or(&job.scene.id, |staging| &staging.id).clone();
                match exported {
                    Err(error) => self.left_out.push((scene, error)),
                    Ok(Files { files, notes, listed }) => {
                        for (name, bytes) in &files {
                            self.output.write(&self.out.join(name), bytes)?;
                        }
                        self.rows.push(Row { scene, files: files.into_iter().map(|(name, _)| name).collect(), notes });
                        if let Some((name, summary)) = listed {
                            self.data_set.add(name, summary);
                        }
                    }
                }
            }
        }
        for (name, bytes) in self.data_set.files() {
            self.output.write(&self.out.join(name), &bytes)?;
        }
        Ok(())
    }

    /// Returns the number of scenes that were written.
    pub fn written(&self) -> usize {
        self.rows.len()
    }

    /// # Errors
    /// Nothing was written.
    fn some(&self) -> Result<(), Failure> {
        if self.rows.is_empty() {
            let reasons: Vec<String> = self.left_out.iter().map(|(_, error)| format!("  {error}")).collect();
            return Err(Failure::bad_input(format!("no scene could be exported:\n{}", reasons.join("\n"))));
        }
        Ok(())
    }

    /// Returns what was written and what the format cannot hold; what is the same for many scenes is said once.
    pub fn left_out_text(&self) -> String {
        let mut text = String::new();
        let mut notes: BTreeMap<&str, Vec<(&str, &str)>> = BTreeMap::new();
        for row in &self.rows {
            let _ = writeln!(text, "{}  {}", row.scene, row.files.join(" "));
            for note in &row.notes {
                notes.entry(&note.reason).or_default().push((&row.scene, &note.what));
            }
        }
        for (reason, places) in &notes {
            let (scene, what) = places[0];
            let place = if what.is_empty() { scene.to_string() } else { format!("{scene}, {what}") };
            let more = if places.len() > 1 { format!(" and {} more", places.len() - 1) } else { String::new() };
            let _ = writeln!(text, "note: {reason} ({place}{more})");
        }
        for (_, error) in &self.left_out {
            let _ = writeln!(text, "left out: {error}");
        }
        text
    }

    pub fn json(&self) -> Value {
        let left_out_text =
            |(scene, error): &(String, ExportError)| json!({"scene": scene, "reason": error.to_string()});
        let left_out: Vec<Value> = self.left_out.iter().map(left_out_text).collect();
        json!({"out": self.out, "scenes": self.rows, "left_out": left_out})
    }
}

/// A name that every file system takes and no other scene has: systems that fold case must not merge two.
pub fn file_name(id: &str, taken: &mut BTreeSet<String>) -> String {
    let plain = |c: char| if c.is_ascii_alphanumeric() || matches!(c, '-' | '_' | '.') { c } else { '_' };
    let base: String = id.chars().map(plain).take(NAME_MAX).collect();
    let base = base.trim_matches('.');
    let base = if base.is_empty() { "scene" } else { base };
    let mut name = base.to_string();
    let mut number = 1;
    while !taken.insert(name.to_ascii_lowercase()) {
        number += 1;
        name = format!("{base}_{number}");
    }
    name
}

fn export(job: &Job, format: Format) -> Result<Files, ExportError> {
    let (scene, staging) = (&job.scene, job.staging.as_ref());
    match format {
        Format::Scenarionet => {
            let Exported { bytes, notes } = scenarionet::export(scene, staging)?;
            let unsound =
                |error: ImportError| ExportError::Unsound { scene: scene.id.clone(), violation: error.to_string() };
            let pickled = scenarionet::pickled(&bytes).map_err(unsound)?;
            let name = scenarionet::pickle_name(&job.name);
            let files = vec![(format!("{}.json", job.name), bytes), (name.clone(), pickled.bytes)];
            Ok(Files { files, notes, listed: Some((name, pickled.summary)) })
        }
        Format::Commonroad => {
            let Exported { bytes, notes } = commonroad::export(scene, staging)?;
            Ok(Files { files: vec![(format!("{}.xml", job.name), bytes)], notes, listed: None })
        }
        Format::Openscenario | Format::Openscenario10 => {
            let revision = if format == Format::Openscenario { Revision::V1_2 } else { Revision::V1_0 };
            let road_file = format!("{}.xodr", job.name);
            let made = openscenario::export(scene, staging, &road_file, revision)?;
            // The road first: a scenario never lies beside a road that is not there yet.
            let files = vec![(road_file, made.xodr), (format!("{}.xosc", job.name), made.xosc)];
            Ok(Files { files, notes: made.notes, listed: None })
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn file_names_stay_in_the_folder_and_apart() {
        let mut taken = BTreeSet::new();
        let names = ["../../etc/passwd", "..", "", "a b", "a_b", "A_B", "\u{0}\u{1f600}", ".hidden"]
            .map(|id| file_name(id, &mut taken));
        let expected = ["_.._etc_passwd", "scene", "scene_2", "a_b", "a_b_2", "A_B_3", "__", "hidden"];
        assert_eq!(names, expected);
        assert!(file_name(&"x".repeat(5000), &mut taken).len() <= NAME_MAX);
    }
}
