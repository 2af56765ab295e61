//! The trainings of a downstream study, side by side: each is one arm with one seed, examined on the way.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

use crate::cli::studies::downstream_sets::{Sets, of_family};
use crate::cli::terminal::{answer::progress, exit::Failure, interrupt::Interrupt};
use crate::ego::{Policy, Weights};
use crate::evaluation::{metrics::safebench::criteria, staged_run};
use crate::experiment::{Arm, DownstreamFile};
use crate::kernel::{Digest, Threads, num};
use crate::learn::{Lesson, Stopped, Training, driven, driven_by};
use crate::objects::downstream::{Examination, FixedSet, Opening, Reference, SetDriven, SetName, Trained, Wanted};
use crate::sim::{ContactClass, Driver, End, Outcome};
use crate::store;

/// Bytes that a finished training may have.
const TRAINED_BYTES_MAX: u64 = 1 << 28;

/// Inputs that a study's trainings share.
pub struct Study<'a> {
    pub file: &'a DownstreamFile,
    pub opening: &'a Opening,
    pub sets: &'a Sets,
    /// Folder for finished trainings; `None`: they are all carried out again.
    pub kept: Option<&'a Path>,
    pub interrupt: &'a Interrupt,
}

/// The trainings wanted, in the order in which they are named. One that was kept under the same recipe is not carried out again.
/// `None` where Ctrl-C was pressed before all were finished; the finished ones are kept.
pub fn trained(study: &Study<'_>, wanted: &[Wanted], threads: &Threads) -> Result<Option<Vec<Trained>>, Failure> {
    let mut done = Vec::with_capacity(wanted.len());
    for which in wanted {
        done.push(kept(study, which)?);
    }
    let seeds: BTreeSet<u64> =
        wanted.iter().zip(&done).filter(|(_, done)| done.is_none()).map(|(which, _)| which.seed).collect();
    let seeds: Vec<u64> = seeds.into_iter().collect();
    let missing = done.iter().filter(|done| done.is_none()).count() as u64;
    let plain = study.opening.plain_updates;
    if missing < wanted.len() as u64 {
        progress(format!("{} of {} trainings are done", wanted.len() as u64 - missing, wanted.len()));
    }
    let pace = Pace::new(missing * (study.opening.updates - plain) + seeds.len() as u64 * plain);
    let begun = threads.map(&seeds, |_, seed| begun(study, *seed, &pace));
    let begun: Option<Vec<Training>> = begun.into_iter().collect::<Result<_, Failure>>()?;
    let Some(begun) = begun else { return Ok(None) };
    let begun: BTreeMap<u64, Training> = seeds.into_iter().zip(begun).collect();
    let one = |place: usize, which: &Wanted| -> Result<Option<Trained>, Failure> {
        if let Some(done) = &done[place] {
            return Ok(Some(done.clone()));
        }
        let state = begun.get(&which.seed).ok_or_else(|| Failure::internal("a seed that was begun is gone"))?;
        let Some(done) = training(study, which, state.clone(), &pace)? else { return Ok(None) };
        if let Some(folder) = study.kept {
            let text = serde_json::to_string(&done).map_err(Failure::internal)?;
            store::write_atomic(&place_of(folder, study, which)?, text.as_bytes())?;
        }
        Ok(Some(done))
    };
    threads.map(wanted, one).into_iter().collect()
}

/// Returns the file of a finished training. Its name contains all that the training depends on, so a study with other
/// sets or another schedule finds nothing, and one with more seeds or arms finds what it shares.
fn place_of(folder: &Path, study: &Study<'_>, which: &Wanted) -> Result<PathBuf, Failure> {
    let family = which.family.as_ref().map_or(String::new(), |family| format!("-{family}"));
    let arm = study.file.arms.iter().find(|known| known.name == which.arm);
    let sets = arm.map_or(&[][..], |arm| &arm.trains_on);
    let fixed = &study.opening.sets;
    let own = |set: &&FixedSet| sets.contains(&set.name) || set.name == SetName::Plain;
    let digests: Vec<Digest> =
        fixed.training.iter().filter(own).chain(&fixed.evaluation).map(|set| set.digest).collect();
    let content = (&study.file.training, sets, digests, study.opening.program);
    let recipe = Digest::of("evodrive/downstream-training/1", &content).map_err(Failure::internal)?.short(8);
    Ok(folder.join(format!("{}-{recipe}{family}-{}-s{}.json", study.file.name, which.arm, which.seed)))
}

fn kept(study: &Study<'_>, which: &Wanted) -> Result<Option<Trained>, Failure> {
    let Some(folder) = study.kept else { return Ok(None) };
    let path = place_of(folder, study, which)?;
    if !path.exists() {
        return Ok(None);
    }
    let bytes = store::read_bounded(&path, TRAINED_BYTES_MAX)?;
    serde_json::from_slice(&bytes).map(Some).map_err(|error| {
        Failure::corruption(format!("{}: {error}; remove it, and that training is done again", path.display()))
    })
}

/// A seed's training up to where its arms part: all its updates on the plain set of all scenes.
fn begun(study: &Study<'_>, seed: u64, pace: &Pace) -> Result<Option<Training>, Failure> {
    let mut state = Training::new(study.file.training.training(seed))?;
    let plain = study.opening.plain_updates;
    let lessons = study.sets.lessons(&[SetName::Plain], None);
    // A round may pay for more updates than are wanted here; the rest is made by the arms.
    let whole = state.options.updates;
    state.options.updates = plain;
    while !state.is_over() {
        if study.interrupt.is_asked() {
            return Ok(None);
        }
        let before = state.updates;
        state.advance(&lessons, &Threads::none())?;
        pace.made(state.updates - before);
    }
    state.options.updates = whole;
    if plain > 0 {
        progress(format!("seed {seed}: {} updates without adversaries{}", state.updates, pace.left()));
    }
    Ok(Some(state))
}

/// One training on one thread, from where its seed's arms part.
fn training(study: &Study<'_>, which: &Wanted, mut state: Training, pace: &Pace) -> Result<Option<Trained>, Failure> {
    let arm: Option<&Arm> = study.file.arms.iter().find(|known| known.name == which.arm);
    let arm = arm.ok_or_else(|| Failure::internal("an arm that was read is gone"))?;
    let family = which.family.as_deref();
    let lessons = study.sets.lessons(&arm.trains_on, family);
    let mut examinations = Vec::new();
    if study.opening.plain_updates > 0 {
        examinations.push(examined(&state, study.sets, family)?);
    }
    while !state.is_over() {
        if study.interrupt.is_asked() {
            return Ok(None);
        }
        let before = state.updates;
        let news = state.advance(&lessons, &Threads::none())?;
        pace.made(state.updates - before);
        if news.is_due {
            let examined = examined(&state, study.sets, family)?;
            progress(format!("{which}: {}{}", words(&examined, study.opening.updates), pace.left()));
            examinations.push(examined);
        }
    }
    let weights = Digest::of_bytes(&weights(&state)?);
    let Wanted { family, arm, seed } = which.clone();
    Ok(Some(Trained { family, arm, seed, weights, examinations }))
}

fn weights(state: &Training) -> Result<Vec<u8>, Failure> {
    Weights::to_bytes(state.options.setting, state.present()).map_err(Failure::internal)
}

/// How the present actor drives every evaluation set, or of them the scenes of one family.
fn examined(state: &Training, sets: &Sets, family: Option<&str>) -> Result<Examination, Failure> {
    let ego = Policy::learned(&weights(state)?).map_err(Failure::internal)?;
    let of = |(set, lessons): (&FixedSet, &Vec<Lesson>)| -> Result<SetDriven, Failure> {
        let lessons = of_family(set, lessons, family);
        Ok(set_driven(set.name, &driven(&lessons, &ego, &Threads::none()).map_err(Failure::bad_input)?))
    };
    let sets = sets.fixed.evaluation.iter().zip(&sets.evaluation).map(of).collect::<Result<_, _>>()?;
    Ok(Examination { updates: state.updates, steps: state.steps, sets })
}

/// A driver for each scene.
type Makes = dyn Fn() -> Box<dyn Driver> + Sync;

/// How egos drive the evaluation sets that nobody trained: IDM, and one that stands.
pub fn references(sets: &Sets, threads: &Threads) -> Result<Vec<Reference>, Failure> {
    let standing = || -> Box<dyn Driver> { Box::new(Stopped) };
    let idm = || -> Box<dyn Driver> { Policy::Idm.driver() };
    let drivers: [(&str, &Makes); 2] = [("IDM", &idm), ("stands still", &standing)];
    let of = |(name, driver): (&str, &Makes)| -> Result<Reference, Failure> {
        let all = sets.fixed.evaluation.iter().zip(&sets.evaluation);
        let drives = |(set, lessons): (&FixedSet, &Vec<Lesson>)| {
            driven_by(lessons, driver, threads)
                .map(|outcomes| set_driven(set.name, &outcomes))
                .map_err(Failure::bad_input)
        };
        Ok(Reference { driver: name.to_string(), sets: all.map(drives).collect::<Result<_, _>>()? })
    };
    drivers.into_iter().map(of).collect()
}

fn set_driven(set: SetName, outcomes: &[Outcome]) -> SetDriven {
    let score = |outcome: &Outcome| Some(criteria(&[staged_run(outcome)?])?.overall_score());
    SetDriven {
        set,
        ends: outcomes.iter().map(letter).collect(),
        completion: outcomes.iter().map(|outcome| outcome.route_completion).collect(),
        score: outcomes.iter().filter_map(score).collect(),
    }
}

fn letter(outcome: &Outcome) -> char {
    // The classes that count whatever the ego could have done.
    let caused =
        |class| matches!(class, ContactClass::EgoStrikes | ContactClass::EgoSideswipes | ContactClass::StationaryHit);
    match outcome.end {
        End::Contact if outcome.contact.is_some_and(|hit| caused(hit.class) || hit.avoidable == Some(true)) => 'f',
        End::Contact => 'c',
        End::OffRoad => 'o',
        End::Arrived => 'a',
        End::Horizon => 'h',
    }
}

fn words(found: &Examination, updates: u64) -> String {
    let of = |driven: &SetDriven| {
        let crashed = driven.ends.chars().filter(|end| "cf".contains(*end)).count();
        let share = 100.0 * crashed as f64 / driven.ends.len().max(1) as f64;
        let completion = 100.0 * num::mean(&driven.completion).unwrap_or(0.0);
        format!("{} crash rate {share:.0} %, route completion {completion:.0} %", driven.set.name())
    };
    let sets: Vec<String> = found.sets.iter().map(of).collect();
    format!("after {} of {updates} updates {}", found.updates, sets.join("; "))
}

/// Progress by the clock over all trainings; no result depends on it.
struct Pace {
    begun: Instant,
    /// Updates in all, and made since the beginning.
    whole: u64,
    made: AtomicU64,
}

impl Pace {
    #[allow(clippy::disallowed_methods)]
    fn new(whole: u64) -> Pace {
        Pace { begun: Instant::now(), whole, made: AtomicU64::new(0) }
    }

    fn made(&self, updates: u64) {
        self.made.fetch_add(updates, Ordering::Relaxed);
    }

    fn left(&self) -> String {
        let (whole, made) = (self.whole, self.made.load(Ordering::Relaxed).max(1));
        let minutes = self.begun.elapsed().as_secs_f64() / 60.0 * (whole.saturating_sub(made)) as f64 / made as f64;
        format!(" ({} % of all updates, {minutes:.0} min left)", 100 * made / whole.max(1))
    }
}
