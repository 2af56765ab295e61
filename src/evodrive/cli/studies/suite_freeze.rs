//! `suite freeze`: programs play on scenes around a driver, and what they do is kept for every driver after it.

use clap::Args;
use serde_json::json;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::path::PathBuf;
use std::sync::Arc;

use crate::cli::evolve::behind::Asked;
use crate::cli::scenes::files;
use crate::cli::scenes::left_out::listed;
use crate::cli::studies::suite_driver::TestDriver;
use crate::cli::studies::suite_file;
use crate::cli::studies::suite_freezing::{Freezable, Freezing};
use crate::cli::studies::suite_programs::{Planned, Sources, gathered};
use crate::cli::studies::suite_stage::shipped_realism;
use crate::cli::studies::suite_text::class_counts;
use crate::cli::terminal::answer::{Answer, progress};
use crate::cli::terminal::exit::Failure;
use crate::cli::terminal::output::Output;
use crate::cli::terminal::timed::timed;
use crate::ego::Policy;
use crate::epoch::SceneEntry;
use crate::kernel::Digest;
use crate::scene::{Pool, Scene, usable};
use crate::sim::{ContactClass, SIM_VERSION, SimulatorOptions};
use crate::suite::{Candidate, Case, DriverMark, Licence, PLAIN, Sizes, Suite, Thresholds, chosen};
use crate::text::counted;

/// Formats of scenes that this program generates.
const GENERATED: &str = "synth/";

#[derive(Debug, Args)]
pub struct Options {
    /// Program file that `evodrive program export` wrote; may be repeated.
    #[arg(long)]
    pub program: Vec<PathBuf>,
    /// Run whose lineages' reported programs are taken: its folder, its name below runs/, or the beginning of either; may be
    /// repeated.
    #[arg(long)]
    pub run: Vec<PathBuf>,
    /// Take the parents and every accepted program of the runs, too.
    #[arg(long, requires = "run")]
    pub all: bool,
    /// Family whose published parent is taken, or all; may be repeated.
    #[arg(long)]
    pub parents: Vec<String>,
    /// Pools, scenario files or folders.
    #[arg(long, num_args = 1.., required = true)]
    pub scenes: Vec<PathBuf>,
    /// Driver that the programs plan around and that the labels are of: idm, idm-lights, pdm, frenet, replay, weights (.safetensors, .onnx), or a planner's
    /// file. Given several times they take turns over the scenes, and a case says around whom it was planned.
    #[arg(long, default_value = "idm")]
    pub driver: Vec<String>,
    /// Take only scenes in which that driver has a preventable contact: a careful one avoids it, and it is no ram from behind.
    #[arg(long)]
    pub preventable_only: bool,
    /// Least realism, 0 to 1, of what a program does in a scene that is taken, as the shipped MetaDrive protocol scores it; without it any.
    #[arg(long, value_name = "X")]
    pub min_realism: Option<f64>,
    /// Take only scenes in which that driver meets an adversary in this way, as crossing; may be repeated.
    #[arg(long, value_parser = contact_class)]
    pub class: Vec<ContactClass>,
    /// Scenes of each family, at most.
    #[arg(long, default_value_t = 20)]
    pub per_family: usize,
    /// Share of scenes in which nobody is moved, as control.
    #[arg(long, default_value_t = 0.1)]
    pub plain_share: f64,
    /// For a planner's random numbers; programs keep the seed of their run or protocol.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Terms under which scenes of other sources may be passed on; they are written into the suite.
    #[arg(long)]
    pub licence: Option<String>,
    #[command(flatten)]
    pub limits: Limits,
    /// Suite file to write (.suite).
    #[arg(long)]
    pub out: PathBuf,
    #[command(flatten)]
    pub output: Output,
}

fn contact_class(word: &str) -> Result<ContactClass, String> {
    let names = ContactClass::ALL.map(ContactClass::name);
    ContactClass::ALL
        .into_iter()
        .find(|class| class.name() == word)
        .ok_or_else(|| format!("expected one of {}", names.join(", ")))
}

/// Thresholds as options.
#[derive(Clone, Copy, Debug, Args)]
pub struct Limits {
    /// Largest share of driven scenes with a contact.
    #[arg(long)]
    pub max_crash_rate: Option<f64>,
    /// Largest share of driven scenes with a preventable contact.
    #[arg(long)]
    pub max_preventable: Option<f64>,
    /// Least mean share of the route that is driven.
    #[arg(long)]
    pub min_completion: Option<f64>,
    /// Largest share of driven scenes in which the driver leaves the road.
    #[arg(long)]
    pub max_off_road: Option<f64>,
    /// Least share of playable scenes that are driven to the route's end without a contact.
    #[arg(long)]
    pub min_arrived: Option<f64>,
}

impl Limits {
    pub fn thresholds(&self) -> Result<Thresholds, Failure> {
        let Limits { max_crash_rate, max_preventable, min_completion, max_off_road, min_arrived } = *self;
        let thresholds = Thresholds { max_crash_rate, max_preventable, min_completion, max_off_road, min_arrived };
        match thresholds.fault() {
            None => Ok(thresholds),
            Some((name, found)) => {
                Err(Failure::bad_input(format!("--{}: expected 0 to 1, found {found}", name.replace('_', "-"))))
            }
        }
    }
}

pub fn run(options: &Options, jobs: usize) -> Result<Answer, Failure> {
    checked(options)?;
    let thresholds = options.limits.thresholds()?;
    let drivers = drivers(options)?;
    let sources = Sources { files: &options.program, runs: &options.run, all: options.all, parents: &options.parents };
    let programs = gathered(&sources)?;
    let threads = files::threads(jobs)?;
    let pool = files::read(&options.scenes, jobs)?;
    let scenes: Vec<Arc<Scene>> =
        pool.scenes.iter().filter(|scene| usable(scene).is_ok()).cloned().map(Arc::new).collect();
    let entries = threads.map(&scenes, |_, scene| SceneEntry::new(scene.clone()));
    let realism = shipped_realism()?;
    let mut rules: Vec<SimulatorOptions> = Vec::new();
    let (mut found, mut reasons) = (Vec::new(), Vec::new());
    let mut turns: Vec<Vec<SceneEntry>> = drivers.iter().map(|_| Vec::new()).collect();
    for (place, entry) in entries.into_iter().enumerate() {
        turns[place % drivers.len()].push(entry);
    }
    for (driver, entries) in drivers.iter().zip(&turns) {
        let around = Freezing {
            seed: options.seed,
            preventable_only: options.preventable_only,
            floor: options.min_realism.map(|floor| (floor, &realism)),
            classes: &options.class,
            ego: &driver.ego,
            asked: None,
            threads: &threads,
        };
        found.push(of_driver(driver, &around, &programs, entries, &mut rules, &mut reasons)?);
    }
    listed("not frozen", reasons.into_iter()).into_iter().for_each(progress);
    let suite = suite(options, &programs, rules, &pool, found, thresholds, &drivers)?;
    let digest = suite_file::write(&suite, &options.out, options.output)?;
    Ok(answer(options, &suite, digest))
}

/// A driver that is planned around.
struct Around {
    word: String,
    driver: TestDriver,
    ego: Policy,
}

/// The drivers that are planned around, each once.
fn drivers(options: &Options) -> Result<Vec<Around>, Failure> {
    let mut all: Vec<Around> = Vec::new();
    for word in &options.driver {
        let driver = TestDriver::named(word)?;
        let Some(ego) = driver.policy() else {
            let what = "expected a driver to plan around, found one that stands still";
            return Err(Failure::bad_input(format!("--driver {word}: {what}")));
        };
        if all.iter().any(|known| known.driver.mark() == driver.mark()) {
            return Err(Failure::bad_input(format!("--driver {word}: it is named twice; name each driver once")));
        }
        all.push(Around { word: word.clone(), driver, ego });
    }
    Ok(all)
}

/// Returns what may be frozen around one driver.
fn of_driver(
    driver: &Around,
    around: &Freezing<'_>,
    programs: &[Planned],
    entries: &[SceneEntry],
    rules: &mut Vec<SimulatorOptions>,
    reasons: &mut Vec<(String, String)>,
) -> Result<Vec<Freezable>, Failure> {
    let mut freezable = Vec::new();
    for (place, planned) in programs.iter().enumerate() {
        let own = place_of(rules, &planned.rules);
        let asked = asked(driver, &planned.rules)?;
        let freezing = Freezing { asked: asked.as_ref(), ..*around };
        let (frozen, took) = timed(|| freezing.of_program(planned, place, own, entries, reasons));
        let (frozen, played) = frozen?;
        progress(format!(
            "{} ({}): {} of {played} can be frozen; {:.3} s a scene",
            planned.member.name,
            planned.member.family,
            frozen.len(),
            took.as_secs_f64() / played.max(1) as f64
        ));
        freezable.extend(frozen);
    }
    let of_first = programs.first().map_or(SimulatorOptions::SHIPPED, |planned| planned.rules);
    let own = place_of(rules, &of_first);
    let asked = asked(driver, &of_first)?;
    let freezing = Freezing { asked: asked.as_ref(), ..*around };
    freezable.extend(freezing.plain(own, &of_first, entries, reasons)?);
    Ok(freezable)
}

fn checked(options: &Options) -> Result<(), Failure> {
    if !suite_file::is_suite(&options.out) {
        let expected = "expected a name that ends in .suite, by which other commands know it";
        return Err(Failure::bad_input(format!("--out {}: {expected}", options.out.display())));
    }
    if let Some(found) = options.min_realism.filter(|floor| !(0.0..=1.0).contains(floor)) {
        return Err(Failure::bad_input(format!("--min-realism: expected 0 to 1, found {found}")));
    }
    if !(0.0..1.0).contains(&options.plain_share) {
        let found = options.plain_share;
        return Err(Failure::bad_input(format!("--plain-share: expected 0 or more and less than 1, found {found}")));
    }
    // The same suite may be frozen again: it is refused later if it is another one.
    options
        .output
        .may_be_made(&options.out)
        .or_else(|refused| if options.out.is_file() { Ok(()) } else { Err(refused) })
}

fn place_of(all: &mut Vec<SimulatorOptions>, rules: &SimulatorOptions) -> usize {
    all.iter().position(|known| known == rules).unwrap_or_else(|| {
        all.push(*rules);
        all.len() - 1
    })
}

/// The planner, where one is planned around.
fn asked(around: &Around, rules: &SimulatorOptions) -> Result<Option<Asked>, Failure> {
    match around.driver {
        TestDriver::Planner(_) => Ok(Some(Asked::named(around.word.as_ref(), rules)?)),
        _ => Ok(None),
    }
}

fn suite(
    options: &Options,
    programs: &[Planned],
    rules: Vec<SimulatorOptions>,
    pool: &Pool,
    found: Vec<Vec<Freezable>>,
    thresholds: Thresholds,
    drivers: &[Around],
) -> Result<Suite, Failure> {
    let (several, mut cases) = (drivers.len() > 1, Vec::new());
    for (around, found) in found.into_iter().enumerate() {
        // The first drivers have the scenes that cannot be divided.
        let share = |all: usize| all / drivers.len() + usize::from(around < all % drivers.len());
        cases.extend(cases_of(found, share(options.per_family), options.plain_share, several.then_some(around))?);
    }
    if cases.is_empty() {
        return Err(Failure::bad_input(
            "no scene can be frozen: no program acts in any of them, or none of the contacts is of the kind that was asked for; name other scenes or programs",
        ));
    }
    let used: BTreeSet<&str> = cases.iter().map(|case| case.scene.as_str()).collect();
    let scenes: Vec<Scene> = pool.scenes.iter().filter(|scene| used.contains(scene.id.as_str())).cloned().collect();
    let licences = licences(&scenes, options.licence.as_deref());
    let pool = Pool::new(scenes, Vec::new()).map_err(Failure::internal)?;
    let marks: Vec<DriverMark> = drivers.iter().map(|around| around.driver.mark()).collect();
    let name = options.out.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
    Ok(Suite {
        name,
        planned_around: together(&marks),
        around: if several { marks } else { Vec::new() },
        simulator: SIM_VERSION,
        seed: options.seed,
        rules,
        programs: programs.iter().map(|planned| planned.member.clone()).collect(),
        sizes: Sizes {
            per_family: options.per_family,
            plain_share: options.plain_share,
            preventable_only: options.preventable_only,
            min_realism: options.min_realism,
            classes: options.class.clone(),
        },
        thresholds,
        licences,
        cases,
        pool,
    })
}

/// One driver, or several under one name.
fn together(marks: &[DriverMark]) -> DriverMark {
    match marks {
        [one] => one.clone(),
        several => {
            let each =
                |of: fn(&DriverMark) -> String, between: &str| several.iter().map(of).collect::<Vec<_>>().join(between);
            let digests = each(|mark| mark.digest.to_hex(), " ");
            DriverMark { name: each(|mark| mark.name.clone(), "+"), digest: Digest::of_bytes(digests.as_bytes()) }
        }
    }
}

/// Chooses cases from what may be frozen around one driver: `per_family` of each family, and the share of plain ones beside them.
fn cases_of(
    found: Vec<Freezable>,
    per_family: usize,
    plain_share: f64,
    around: Option<usize>,
) -> Result<Vec<Case>, Failure> {
    let candidates: Vec<Candidate> = found.iter().map(|found| found.candidate.clone()).collect();
    let acted = chosen(&candidates, |family| if family == PLAIN { 0 } else { per_family });
    if acted.is_empty() {
        return Ok(Vec::new());
    }
    let plain = (acted.len() as f64 * plain_share / (1.0 - plain_share)).round() as usize;
    let places = chosen(&candidates, |family| if family == PLAIN { plain } else { per_family });
    let mut all: Vec<Option<Freezable>> = found.into_iter().map(Some).collect();
    let mut cases = Vec::with_capacity(places.len());
    for place in places {
        let Some(Freezable { candidate, program, rules, intervention, label }) =
            all.get_mut(place).and_then(Option::take)
        else {
            return Err(Failure::internal("a scene was chosen twice"));
        };
        cases.push(Case {
            id: format!("{}:{}", candidate.family, candidate.scene),
            scene: candidate.scene,
            family: candidate.family,
            program,
            rules,
            cluster: candidate.cluster,
            intervention,
            label,
            around,
        });
    }
    Ok(cases)
}

fn licences(scenes: &[Scene], terms: Option<&str>) -> Vec<Licence> {
    let mut sources: BTreeMap<&str, usize> = BTreeMap::new();
    for scene in scenes {
        let source = if scene.origin.format.starts_with(GENERATED) { GENERATED } else { &scene.origin.format };
        *sources.entry(source.trim_end_matches('/')).or_insert(0) += 1;
    }
    let of = |(source, scenes): (&str, usize)| {
        let generated = GENERATED.starts_with(source);
        let terms = match (generated, terms) {
            (true, _) => "generated by EvoDrive; MIT or Apache 2.0, as EvoDrive itself",
            (false, Some(terms)) => terms,
            (false, None) => "not stated; ask whoever made the recordings before the suite is passed on",
        };
        Licence { source: source.to_string(), scenes, terms: terms.to_string() }
    };
    sources.into_iter().map(of).collect()
}

fn answer(options: &Options, suite: &Suite, digest: Digest) -> Answer {
    let mut text = format!(
        "{}: {} of {}, planned around {}\n",
        suite.name,
        counted(suite.cases.len(), "case"),
        counted(suite.pool.scenes.len(), "scene"),
        suite.planned_around.name
    );
    let families: BTreeSet<&str> = suite.cases.iter().map(|case| case.family.as_str()).collect();
    let asked: BTreeSet<&str> = suite.programs.iter().map(|member| member.family.as_str()).collect();
    for family in families.union(&asked) {
        let own: Vec<&Case> = suite.cases.iter().filter(|case| case.family == *family).collect();
        let _ = writeln!(text, "  {family:<13} {:>4}  {}", own.len(), class_counts(&own));
    }
    for licence in &suite.licences {
        let _ = writeln!(text, "{} of {}: {}", counted(licence.scenes, "scene"), licence.source, licence.terms);
    }
    let _ = writeln!(text, "{}\ndigest {digest}", options.out.display());
    let object = json!({
        "suite": options.out, "digest": digest, "cases": suite.cases.len(), "scenes": suite.pool.scenes.len(),
        "programs": suite.programs, "licences": suite.licences,
    });
    Answer::new(text, object)
}
