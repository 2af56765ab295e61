//! `scenes best`: the most severe or most realistic rollouts of a run, and how to see each of them.

use clap::{Args, ValueEnum};
use serde_json::{Value, json};
use std::fmt::Write as _;

use crate::cli::look::data;
use crate::cli::records::run_name::OneRun;
use crate::cli::scenes::files;
use crate::cli::terminal::{answer::Answer, exit::Failure, shell::rollout_command, width::table_width};
use crate::evidence::aligned::Aligned;
use crate::evidence::best::{By, Met, Ranked, best, standing, suite_in_words};
use crate::evidence::data::records;
use crate::experiment::did_you_mean;
use crate::objects::LineageId;

#[derive(Debug, Args)]
pub struct Options {
    #[command(flatten)]
    pub run: OneRun,
    /// Number of rollouts to list.
    #[arg(long, default_value_t = 5)]
    pub top: usize,
    /// Criterion that orders the list.
    #[arg(long, default_value = "severity")]
    pub by: Criterion,
    /// Only rollouts of this lineage, e.g. cat-idm.
    #[arg(long)]
    pub lineage: Option<String>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Criterion {
    /// Contacts that count, the fastest impact first; then by the smallest time to collision.
    Severity,
    /// The most realistic of those in which the program acts; of equals the more severe one.
    Realism,
}

pub fn run(options: &Options, jobs: usize) -> Result<Answer, Failure> {
    let folder = options.run.folder()?;
    let run = folder.recorded()?;
    let all: Vec<String> = run.parents.iter().map(|of| of.lineage.to_string()).collect();
    if let Some(name) = options.lineage.as_ref().filter(|name| !all.contains(name)) {
        let known = all.join(", ");
        let near = did_you_mean(name, &all);
        return Err(Failure::bad_input(format!("no lineage `{name}` in this run; there are {known}{near}")));
    }
    let lineage = options.lineage.as_ref().map(LineageId::new);
    let rollouts = data::rollouts(&folder, &records(&run), &files::threads(jobs)?)?.into_iter().collect();
    let by = match options.by {
        Criterion::Severity => By::Severity,
        Criterion::Realism => By::Realism,
    };
    let scenes = best(&run, &rollouts, by, lineage.as_ref());
    let shown = &scenes.ranked[..options.top.min(scenes.ranked.len())];
    if shown.is_empty() {
        return Err(Failure::bad_input(format!(
            "{}: expected rollouts in which a program acts, found none to rank ({} are no longer in the run's store; `evodrive run` simulates them again)",
            folder.dir.display(),
            scenes.lacking
        )));
    }
    let command = |of: &Ranked, action: &str, out: &str| {
        rollout_command(action, &folder.dir, of.program.as_str(), &of.scene, out)
    };
    let number = |value: Option<f64>| value.map_or("-".to_string(), |x| format!("{x:.1}"));
    let row = |(k, of): (usize, &Ranked)| {
        let contact = |part: fn(&Met) -> f64| number(of.contact.as_ref().map(part));
        vec![
            (k + 1).to_string(),
            of.program.to_string(),
            of.scene.clone(),
            format!("{:.2}", of.attack),
            format!("{:.4}", of.realism),
            contact(|contact| contact.at_s),
            contact(|contact| contact.speed_mps),
            number(of.ttc_s_min),
        ]
    };
    let heads = ["", "program", "scene", "attack", "realism", "contact s", "m/s", "ttc s"].map(String::from).to_vec();
    let rows = shown.iter().enumerate().map(row).collect();
    let mut text = Aligned { labels: 3, heads, rows, ..Aligned::default() }.text(table_width());
    text.push('\n');
    for (k, of) in shown.iter().enumerate() {
        let _ = writeln!(text, "{}  {}", k + 1, command(of, "show", "--html rollout.html"));
        let (what, suite) = (standing(&run, &of.program), suite_in_words(of.suite));
        let _ = writeln!(text, "   {}: {what}; {suite}", of.program);
        if let Some(first) = of.also.first() {
            let more = of.also.len() - 1;
            let others = if more > 0 { format!(" and {more} more") } else { String::new() };
            let _ = writeln!(text, "   the same in {first}{others}");
        }
    }
    let _ = write!(
        text,
        "{} of {} different rollouts in which a program acts\nas a film: {}\nas a figure: {}\nto export: {}",
        shown.len(),
        scenes.ranked.len(),
        command(&shown[0], "draw", "--out rollout.gif"),
        command(&shown[0], "draw", "--out strip.svg"),
        command(&shown[0], "export", "--format openscenario --out exported")
    );
    if scenes.lacking > 0 {
        let _ = write!(
            text,
            "\n{} rollouts are no longer in the run's store; `evodrive run` simulates them again",
            scenes.lacking
        );
    }
    let rows: Vec<Value> =
        shown.iter().map(|of| json!({"rollout": of, "standing": standing(&run, &of.program), "play": command(of, "show", "--html rollout.html")})).collect();
    Ok(Answer::new(text, json!({"best": rows, "ranked": scenes.ranked.len(), "lacking": scenes.lacking})))
}
