//! `program check`: the gates that a program passes without a parent, each with what it finds.

use clap::Args;
use serde_json::json;
use std::fmt::Write as _;
use std::path::PathBuf;

use crate::adapters::Problem;
use crate::candidates::words_of_others;
use crate::cli::scenes::files;
use crate::cli::studies::apply;
use crate::cli::studies::program_hand::provenance;
use crate::cli::terminal::exit::Exit;
use crate::cli::terminal::{answer::Answer, exit::Failure};
use crate::epoch::SceneEntry;
use crate::experiment::{Finding, ProgramFile, ProgramFileError};
use crate::families;
use crate::objects::Gate;
use crate::text::counted;

/// Findings of the compile gate that are listed; of more the text says how many.
const SCENES_LISTED: usize = 12;

#[derive(Debug, Args)]
pub struct Options {
    /// Program file, TOML or JSON.
    pub file: PathBuf,
    /// Compile it on these scenes too: a pool, scenario files or folders.
    #[arg(long, num_args = 1..)]
    pub scenes: Vec<PathBuf>,
    /// Driver that it plans around there: idm, idm-lights, pdm, frenet, replay, or weights (.safetensors, .onnx); without it the file's own.
    #[arg(long, requires = "scenes")]
    pub ego: Option<String>,
}

/// Result of compiling.
struct Compiled {
    scenes: usize,
    acts: usize,
    findings: Vec<Finding>,
}

/// The gates that can be asked without a parent.
const ASKED: [Gate; 5] = [Gate::Schema, Gate::Interface, Gate::Isolation, Gate::Mechanism, Gate::Compile];

pub fn run(options: &Options, jobs: usize) -> Result<Answer, Failure> {
    let (file, mut findings) = match ProgramFile::read(&options.file) {
        Ok(file) => (Some(file), Vec::new()),
        Err(ProgramFileError::Findings { findings, .. }) => (None, findings),
        Err(other) => return Err(other.into()),
    };
    let mut compiled = None;
    if let Some(file) = &file {
        let registry = families::sources_by_hand().registry();
        let family = registry.get(&file.family).ok_or_else(|| Failure::internal("a family that was read is gone"))?;
        let foreign = words_of_others(&file.program, &family.contract, &registry);
        findings.extend(foreign.into_iter().map(|problem| Finding::at(Gate::Isolation, problem, None)));
        if !options.scenes.is_empty() {
            let of = compile(options, file, jobs)?;
            findings.extend(of.findings.iter().cloned());
            compiled = Some(of);
        }
    }
    // Types are asked first: of what has none nothing else can be said.
    let typed = findings.iter().all(|finding| finding.gate != Gate::Schema);
    let verdict = |gate: Gate| match findings.iter().filter(|finding| finding.gate == gate).count() {
        _ if gate != Gate::Schema && !typed => "not asked: the schema comes first".to_string(),
        _ if matches!(gate, Gate::Compile | Gate::Isolation) && file.is_none() => {
            "not asked: the others come first".into()
        }
        0 => match (&compiled, gate) {
            (None, Gate::Compile) => "not asked: name scenes by --scenes".into(),
            (Some(of), Gate::Compile) => {
                format!("nothing in {}, and it acts in {} of them", counted(of.scenes, "scene"), of.acts)
            }
            _ => "nothing".into(),
        },
        count => counted(count, "fault"),
    };
    let verdicts: Vec<(Gate, String)> = ASKED.iter().map(|gate| (*gate, verdict(*gate))).collect();
    let mut text = String::new();
    if let Some(file) = &file {
        let _ = writeln!(text, "{}: family {}, {}\n", options.file.display(), file.family, provenance(file));
    }
    for (gate, says) in &verdicts {
        let _ = writeln!(text, "{:<10} {says}", gate.name());
    }
    if !findings.is_empty() {
        text.push('\n');
    }
    let (compile, others): (Vec<&Finding>, Vec<&Finding>) =
        findings.iter().partition(|finding| finding.gate == Gate::Compile);
    for finding in others.iter().chain(compile.iter().take(SCENES_LISTED)) {
        let _ = writeln!(text, "{}, {finding}", options.file.display());
    }
    if compile.len() > SCENES_LISTED {
        let _ = writeln!(text, "{} more, which --json lists", compile.len() - SCENES_LISTED);
    }
    let gates: serde_json::Map<String, serde_json::Value> =
        verdicts.iter().map(|(gate, says)| (gate.name().to_string(), json!(says))).collect();
    let object = json!({
        "file": options.file, "findings": findings, "gates": gates,
        "program_hash": file.as_ref().map(|file| file.program_hash), "origins": file.as_ref().map(|file| &file.origins),
    });
    let exit = if findings.is_empty() { Exit::Success } else { Exit::BadInput };
    Ok(Answer { exit, ..Answer::new(text, object) })
}

/// Compiles as the compile gate does, on scenes that are named.
fn compile(options: &Options, file: &ProgramFile, jobs: usize) -> Result<Compiled, Failure> {
    let (_, ego) = apply::under_test(file, options.ego.as_ref(), None, None)?;
    let (taken, _) = apply::sorted_out(&options.scenes, file, files::read(&options.scenes, jobs)?)?;
    let threads = files::threads(jobs)?;
    let entries = threads.map(&taken, |_, scene| SceneEntry::new(scene.clone()));
    let counsels = apply::counsels(file, &entries);
    let sources = families::sources_by_hand();
    let applied = apply::as_conditioned(file, &sources, &ego, &counsels)?;
    let (mut acts, mut findings) = (0, Vec::new());
    for (entry, of) in entries.iter().zip(applied.interventions(&[&file.program], &entries, &threads)?) {
        for compiled in of {
            match compiled {
                Ok(intervention) => acts += usize::from(!intervention.actions.is_empty()),
                Err(reason) => {
                    let problem =
                        Problem::new(format!("scene {}", entry.scene().id), reason, "a program that compiles there");
                    findings.push(Finding::at(Gate::Compile, problem, None));
                }
            }
        }
    }
    Ok(Compiled { scenes: entries.len(), acts, findings })
}
