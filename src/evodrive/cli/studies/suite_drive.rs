//! A driver through the scenes of a suite, side by side. A planner's answers are recorded; one that gives no drive costs its own
//! scene alone.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use crate::backend::{
    Answer, Answers, Backend, BackendError, BackendOptions, DriverOptions, Header, NoOutcome, Planners, Recorder,
    Replay, Request, RolloutCassette,
};
use crate::cli::cluster::worker_process::Processes;
use crate::cli::studies::suite_driver::TestDriver;
use crate::cli::studies::suite_stage::{DriverSource, Drove, SuiteRunner, as_frozen};
use crate::cli::terminal::counting_line::CountingLine;
use crate::cli::terminal::exit::Failure;
use crate::cli::terminal::interrupt::Interrupt;
use crate::ego::Policy;
use crate::kernel::{Digest, Threads};
use crate::store::Store;
use crate::suite::{Case, CaseOutcome, FaultKind, Played};

/// A planner by its digest, and its recorded answers by rules.
pub type Answered = (Digest, BTreeMap<usize, RolloutCassette>);

/// Place in which a planner's answers are kept while they come.
pub struct Kept<'a> {
    pub store: &'a Store,
    /// Answers of an earlier run, by rules.
    pub before: BTreeMap<usize, RolloutCassette>,
}

/// Threads to drive with, and the interrupt that stops them.
pub struct Running<'a> {
    pub threads: &'a Threads,
    pub interrupt: &'a Interrupt,
}

/// Results of all cases, and the answers behind them by rules.
pub struct Driven {
    pub cases: Vec<Played>,
    pub answers: BTreeMap<usize, RolloutCassette>,
    /// Number of answers that were compared with a second one, in words.
    pub compared: Vec<String>,
}

/// Drives with a driver that needs nobody else, and compares with the frozen labels where it is the one that was planned around.
pub fn drive_own(
    stage: &SuiteRunner<'_>,
    cases: &[&Case],
    driver: &TestDriver,
    running: &Running<'_>,
) -> Result<Driven, Failure> {
    let source = driver_source(stage, driver);
    let line = CountingLine::new("scene", cases.len());
    let drive = |case: &&Case| {
        let drove = stage.drove(case, &source);
        line.tick();
        drove
    };
    let drives = running.threads.map(cases, |_, case| (!running.interrupt.is_asked()).then(|| drive(case)));
    line.finish();
    let own = driver.mark().digest;
    let mut played = Vec::with_capacity(cases.len());
    for (case, drove) in cases.iter().zip(drives) {
        let drove = drove.ok_or_else(|| interrupted("nothing was written"))?;
        let is_frozen = stage.suite.planned_around(case).digest == own;
        if let (true, Ok(drove)) = (is_frozen, &drove) {
            as_frozen(case, &drove.outcome)?;
        }
        played.push(played_of(case, drove)?);
    }
    Ok(Driven { cases: played, answers: BTreeMap::new(), compared: Vec::new() })
}

/// A driver of our own at the source.
pub fn driver_source<'a>(stage: &SuiteRunner<'_>, driver: &TestDriver) -> DriverSource<'a> {
    match driver.policy() {
        None => DriverSource::Standing,
        Some(policy) => DriverSource::Policy(policy, vec![Backend::Own; stage.suite.rules.len()]),
    }
}

/// Drives with a planner. A planner that answers one question in two ways stops its processes: the scene in which it did is set aside,
/// and others drive the rest with new ones.
pub fn drive_planner(
    stage: &SuiteRunner<'_>,
    cases: &[&Case],
    planner: &DriverOptions,
    kept: Kept<'_>,
    running: &Running<'_>,
) -> Result<Driven, Failure> {
    let processes = Processes::until(running.interrupt);
    let backends = stage.suite.rules.iter().map(|rules| planner.backend(rules).map_err(Failure::internal));
    let backends = backends.collect::<Result<Vec<BackendOptions>, Failure>>()?;
    let ego = planner.policy().ok_or_else(|| Failure::internal("a planner whose digest cannot be computed"))?;
    let mut results: BTreeMap<usize, Played> = BTreeMap::new();
    let mut answers: BTreeMap<usize, RolloutCassette> = BTreeMap::new();
    let mut compared = Vec::new();
    let line = CountingLine::new("scene", cases.len());
    while results.len() < cases.len() {
        let left: Vec<usize> = (0..cases.len()).filter(|place| !results.contains_key(place)).collect();
        let before = results.len();
        let planners = Planners::new(planner, &processes);
        let culprit = Mutex::new(None);
        let recorders = backends.iter().enumerate().map(|(rules, options)| {
            let before = kept.before.get(&rules).cloned().filter(|before| before.backend == Header::of(options));
            let before = before.unwrap_or_else(|| RolloutCassette::new("answers", Header::of(options)));
            let asked: Box<dyn Answers + '_> = Box::new(Watched { planners: &planners, culprit: &culprit });
            Recorder::new(kept.store, before, asked, String::new())
        });
        let recorders: Vec<Recorder<'_>> = recorders.collect();
        let behind = backends.iter().zip(&recorders).map(|(options, answers)| Backend::Other { options, answers });
        let source = DriverSource::Policy(ego.clone(), behind.collect());
        let drives = running.threads.map(&left, |_, &place| {
            if running.interrupt.is_asked() {
                return None;
            }
            let drove = stage.drove(cases[place], &source);
            if !matches!(drove, Err(NoOutcome::Stop(BackendError::Planner(_)))) {
                line.tick();
            }
            Some(drove)
        });
        for (rules, recorder) in recorders.iter().enumerate() {
            let (asked, _) = recorder.cassette();
            let all = answers.entry(rules).or_insert_with(|| RolloutCassette::new("answers", asked.backend.clone()));
            asked.rollouts().for_each(|(key, recorded)| all.insert(*key, recorded.clone()));
        }
        if running.interrupt.is_asked() {
            return Err(interrupted("answers so far are kept where --out names a file; repeat the command to go on"));
        }
        compared.extend(planners.compared());
        let culprit = *culprit.lock().unwrap_or_else(PoisonError::into_inner);
        for (place, drove) in left.into_iter().zip(drives) {
            let Some(drove) = drove else { continue };
            let case = cases[place];
            if let Err(NoOutcome::Stop(BackendError::Planner(fault))) = &drove {
                let kind = match culprit {
                    // Nobody drives with a planner that does not begin.
                    None => FaultKind::NotStarted,
                    Some(key) if key_of(stage, case, &backends[case.rules], &ego) == Some(key) => {
                        FaultKind::Inconsistent
                    }
                    Some(_) => continue,
                };
                let found = format!("planner, {}: expected {}, found {}", fault.place, fault.expected, fault.found);
                results.insert(place, of_case(case, CaseOutcome::Fault { kind, reason: first_lines(&found) }));
                line.tick();
                continue;
            }
            results.insert(place, played_of(case, drove)?);
        }
        if results.len() == before {
            return Err(Failure::internal("a planner stopped, and no scene says in which of them"));
        }
    }
    line.finish();
    answers.retain(|_, answers| !answers.is_empty());
    Ok(Driven { cases: results.into_values().collect(), answers, compared })
}

/// Drives with recorded answers: no planner is asked. A fault that left no answer stays as `known` has it.
pub fn drive_recorded(
    stage: &SuiteRunner<'_>,
    cases: &[&Case],
    recorded: &Recorded,
    known: &dyn Fn(&Case) -> Option<CaseOutcome>,
    running: &Running<'_>,
) -> Result<Vec<Played>, Failure> {
    let source = recorded.source();
    let line = CountingLine::new("scene", cases.len());
    let drives = running.threads.map(cases, |_, case| {
        let drove = stage.drove(case, &source);
        line.tick();
        drove
    });
    line.finish();
    let mut played = Vec::with_capacity(cases.len());
    for (case, drove) in cases.iter().zip(drives) {
        played.push(match drove {
            Err(NoOutcome::Stop(BackendError::Miss(miss))) => match known(case) {
                Some(fault @ CaseOutcome::Fault { .. }) => of_case(case, fault),
                _ => return Err(Failure::miss(miss)),
            },
            drove => played_of(case, drove)?,
        });
    }
    Ok(played)
}

/// Recorded answers of a planner, ready to drive.
pub struct Recorded {
    ego: Policy,
    backends: Vec<BackendOptions>,
    replays: Vec<Replay>,
}

impl Recorded {
    pub fn new(
        stage: &SuiteRunner<'_>,
        planner: Digest,
        mut answers: BTreeMap<usize, RolloutCassette>,
    ) -> Result<Recorded, Failure> {
        let driver = DriverOptions {
            command: vec!["recorded".into()],
            files: Vec::new(),
            cassette: PathBuf::new(),
            timeout_s: 1.0,
            processes: 1,
            repeat_share: 0.0,
            observe: None,
            // The digest holds what a planner is told; whether it hears of programs is part of each question, too.
            blind: answers.values().all(|answers| answers.backend.is_blind()),
            digest: Some(planner),
            folder: PathBuf::new(),
        };
        let (mut backends, mut replays) = (Vec::new(), Vec::new());
        for (place, rules) in stage.suite.rules.iter().enumerate() {
            let options = driver.backend(rules).map_err(Failure::internal)?;
            let answers = answers.remove(&place);
            let answers = answers.unwrap_or_else(|| RolloutCassette::new("no file of answers", Header::of(&options)));
            answers.check(&options)?;
            backends.push(options);
            replays.push(Replay::new(answers, "evodrive suite run SUITE --driver PLANNER --out FILE"));
        }
        Ok(Recorded { ego: Policy::Command(planner), backends, replays })
    }

    /// The scenes of recorded answers that none of these cases asks for.
    pub fn unused<'b>(
        &self,
        stage: &SuiteRunner<'_>,
        cases: &[&Case],
        answers: &'b BTreeMap<usize, RolloutCassette>,
    ) -> Vec<&'b str> {
        let key = |case: &&Case| key_of(stage, case, self.backends.get(case.rules)?, &self.ego);
        let asked: BTreeSet<Digest> = cases.iter().filter_map(key).collect();
        let all = answers.values().flat_map(RolloutCassette::rollouts);
        all.filter(|(key, _)| !asked.contains(key)).map(|(_, recorded)| recorded.scene.as_str()).collect()
    }

    pub fn source(&self) -> DriverSource<'_> {
        let behind = self.backends.iter().zip(&self.replays);
        let behind = behind.map(|(options, answers)| Backend::Other { options, answers });
        DriverSource::Policy(self.ego.clone(), behind.collect())
    }
}

/// A folder in which answers wait until all are there.
pub fn recording_beside(result: &Path) -> PathBuf {
    let stem = result.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
    result.with_file_name(format!("{stem}.recording"))
}

fn interrupted(what: &str) -> Failure {
    Failure::interrupted(format!("interrupted; {what}"))
}

fn of_case(case: &Case, came: CaseOutcome) -> Played {
    Played {
        case: case.id.clone(),
        scene: case.scene.clone(),
        family: case.family.clone(),
        cluster: case.cluster.clone(),
        class: case.class().to_string(),
        came,
        realism: None,
        timeline: None,
    }
}

/// Why a planner gets no scene of SafeBench's.
pub const STAGED: &str = "staged for SafeBench: planners cannot play those, drivers of ours can";

/// A scene's own reason stays with the scene; whatever else stops the command.
fn played_of(case: &Case, drove: Result<Drove, NoOutcome>) -> Result<Played, Failure> {
    match drove {
        Ok(drove) => {
            let driven = CaseOutcome::Driven(drove.drive());
            Ok(Played { realism: drove.realism, timeline: drove.timeline, ..of_case(case, driven) })
        }
        Err(NoOutcome::Scene(why)) => Ok(of_case(
            case,
            match FaultKind::of(&why) {
                Some(kind) => CaseOutcome::Fault { kind, reason: why.to_string() },
                None => CaseOutcome::Unplayable { reason: why.to_string() },
            },
        )),
        // Its own words are for experiment files, and name the scene.
        Err(NoOutcome::Stop(BackendError::Unplayable(_))) => {
            Ok(of_case(case, CaseOutcome::Unplayable { reason: STAGED.into() }))
        }
        Err(NoOutcome::Stop(error)) => Err(error.into()),
    }
}

/// The key of the request that a case asks.
fn key_of(stage: &SuiteRunner<'_>, case: &Case, options: &BackendOptions, ego: &Policy) -> Option<Digest> {
    let plant = stage.plant(case).ok()?;
    Request::new(options, &plant, &case.intervention, ego, stage.context(case)).ok().map(|request| request.key)
}

/// Cuts a text to the length that a report has room for.
fn first_lines(text: &str) -> String {
    text.chars().take(600).collect()
}

/// Planners, watched for the request that shows that they do not answer alike to the same question.
struct Watched<'a> {
    planners: &'a Planners<'a>,
    culprit: &'a Mutex<Option<Digest>>,
}

impl Answers for Watched<'_> {
    fn answer(&self, request: &Request<'_>) -> Result<Answer, BackendError> {
        let answer = self.planners.answer(request);
        if let Err(BackendError::Planner(fault)) = &answer
            && fault.place.starts_with(&format!("scene {},", request.scene()))
        {
            self.culprit.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(request.key);
        }
        answer
    }
}
