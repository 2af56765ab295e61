//! `scenes browse`: a page of thumbnails of a pool's scenes or a suite's cases, which filters and sorts them.

use clap::Args;
use serde_json::json;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::cli::scenes::{files, recorded_crash};
use crate::cli::studies::suite_file;
use crate::cli::terminal::output::{Output, by_ending};
use crate::cli::terminal::shell::quoted;
use crate::cli::terminal::{answer::Answer, exit::Failure};
use crate::draw::{Card, Plan, browse_html};
use crate::epoch::cluster_of;
use crate::kernel::{Threads, num};
use crate::scene::{DT_S, LaneGraph, Scene, SceneFeatures};
use crate::sim::timeline_text::class_in_words;
use crate::text::{counted, in_words};

#[derive(Debug, Args)]
pub struct Options {
    /// Pools, suites, scenario files or folders.
    #[arg(required = true)]
    pub paths: Vec<PathBuf>,
    /// Page to write.
    #[arg(long)]
    pub html: PathBuf,
    /// Most scenes that the page holds: a scene takes about 2 kB, at most 6. Of a larger pool it takes scenes at even steps, and says so.
    #[arg(long, default_value_t = 2000, value_parser = clap::value_parser!(u32).range(1..=20_000))]
    pub most: u32,
    #[command(flatten)]
    pub output: Output,
}

/// A scene that has a card.
struct Shown<'a> {
    path: &'a Path,
    /// As commands name it.
    id: String,
    scene: &'a Scene,
    /// Family, kind of place and contact of a suite's case.
    case: Option<(String, String, String)>,
}

pub fn run(options: &Options, jobs: usize) -> Result<Answer, Failure> {
    by_ending("--html", &options.html, [("html", ())])?;
    let threads = files::threads(jobs)?;
    let mut read = Vec::new();
    for path in &options.paths {
        let (pool, cases) = if suite_file::is_suite(path) {
            let suite = suite_file::read(path)?.suite;
            (suite.pool, suite.cases)
        } else {
            (files::read(std::slice::from_ref(path), jobs)?, Vec::new())
        };
        read.push((path.as_path(), pool, cases));
    }
    let mut all: Vec<Shown<'_>> = Vec::new();
    for (path, pool, cases) in &read {
        if cases.is_empty() {
            all.extend(pool.scenes.iter().map(|scene| Shown { path, id: scene.id.clone(), scene, case: None }));
        }
        for case in cases {
            let Some(scene) = pool.scene(&case.scene) else { continue };
            let frozen = (case.family.clone(), case.cluster.clone(), case.class().to_string());
            all.push(Shown { path, id: case.id.clone(), scene, case: Some(frozen) });
        }
    }
    let most = (options.most as usize).min(all.len());
    let shown: Vec<&Shown<'_>> = (0..most).map(|nth| &all[nth * all.len() / most]).collect();
    let cards = cards(&shown, &threads);
    let title = options.paths.iter().map(|path| path.display().to_string()).collect::<Vec<_>>().join(", ");
    let note = match all.len() - shown.len() {
        0 => format!("{}; dots are where each road user starts, the ego is blue", counted(all.len(), "scene")),
        left => format!(
            "{} of {}, taken at even steps ({left} are not on this page; --most shows more, `evodrive scenes filter` chooses); dots are where each \
             road user starts, the ego is blue",
            shown.len(),
            counted(all.len(), "scene")
        ),
    };
    let page = browse_html(&cards, &title, &note);
    options.output.write(&options.html, page.as_bytes())?;
    let text = format!(
        "{}: {} of {}, {} kB\n",
        options.html.display(),
        shown.len(),
        counted(all.len(), "scene"),
        page.len().div_ceil(1000)
    );
    let object = json!({"page": options.html, "scenes": all.len(), "shown": shown.len(), "bytes": page.len()});
    Ok(Answer::new(text, object))
}

/// The cards in their order; scenes of a kind of place are numbered, so that each has a name that can be said.
fn cards(shown: &[&Shown<'_>], threads: &Threads) -> Vec<Card> {
    let mut cards = threads.map(shown, |_, of| card(of));
    let mut counts: BTreeMap<String, usize> = BTreeMap::new();
    for card in &mut cards {
        let count = counts.entry(card.name.clone()).or_insert(0);
        *count += 1;
        card.name = format!("{} {count}", card.name);
    }
    cards
}

fn card(of: &Shown<'_>) -> Card {
    let scene = of.scene;
    let features = SceneFeatures::of(scene, &LaneGraph::of(&scene.road));
    let staged = scene.staging.as_ref().map(|staging| staging.family.name());
    let place = in_words(staged.unwrap_or_else(|| cluster_of(&features)));
    let (source, place, class) = match &of.case {
        Some((family, cluster, class)) => (family.clone(), in_words(cluster), class_in_words(class)),
        None => (scene.origin.format.clone(), place, threat(scene, &features)),
    };
    let name = if of.case.is_some() { format!("{place}, {source}") } else { place.clone() };
    Card {
        command: format!(
            "evodrive scenes show {} {} --html scene.html",
            quoted(&of.path.to_string_lossy()),
            quoted(&of.id)
        ),
        id: of.id.clone(),
        name,
        place,
        source,
        class,
        users: scene.tracks.len(),
        speed_mps: num::rounded(features.ego_speed_mps, 1),
        duration_s: num::rounded(DT_S * scene.steps.saturating_sub(1) as f64, 1),
        plan: Plan::of(scene),
    }
}

/// Returns what threatens the ego as recorded.
fn threat(scene: &Scene, features: &SceneFeatures) -> String {
    if recorded_crash::recorded_crash(scene).is_some() {
        "recorded contact".into()
    } else if features.conflict_count > 0.0 {
        "crossing paths".into()
    } else {
        String::new()
    }
}
