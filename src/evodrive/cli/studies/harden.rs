//! `harden`: PDM's constants searched against a suite, then generators against the hardened driver, round by round.

use clap::Args;
use serde::{Serialize, de::DeserializeOwned};
use serde_json::json;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

use crate::candidates::{Places, apply as patched, random_patch};
use crate::cli::scenes::files;
use crate::cli::studies::suite_file;
use crate::cli::studies::suite_programs::{Planned, Sources, gathered};
use crate::cli::studies::suite_stage::SuiteRunner;
use crate::cli::terminal::answer::{Answer, progress};
use crate::cli::terminal::exit::Failure;
use crate::cli::terminal::interrupt::Interrupt;
use crate::cli::terminal::output::Output;
use crate::ego::{Policy, pdm};
use crate::epoch::{Applied, SceneEntry};
use crate::evidence::figures::{Panel, heat_map};
use crate::kernel::game::{SIDE_MAX, equilibrium};
use crate::kernel::{Digest, Seed, Threads};
use crate::objects::{Program, SceneScore, Score, SolutionId};
use crate::scene::usable;
use crate::sim::{Intervention, Plant, rollout};
use crate::store;
use crate::suite::{Drives, Hardening, HardeningRound, verdict};

/// Bytes that a kept result may have.
const KEPT_BYTES_MAX: u64 = 1 << 24;
/// Edits of a patch, at most.
const EDITS_MAX: usize = 3;
/// Realism below which a patched program takes nobody's place, as a share of its parent's.
const REALISM_KEPT: f64 = 0.98;
/// Share of the route that a trial may lose on the plain scenes that its search sees.
const LOSS_SEARCHED: f64 = 0.01;

#[derive(Debug, Args)]
pub struct Options {
    /// Suite whose attacked cases the constants are searched against.
    pub suite: PathBuf,
    /// Pools or files of other scenes: plain ones for the driver, and those on which generators attack.
    #[arg(long, num_args = 1.., required = true)]
    pub scenes: Vec<PathBuf>,
    /// Families whose parents generators begin with, with commas.
    #[arg(long, value_delimiter = ',', default_value = "cat,at")]
    pub families: Vec<String>,
    /// Rounds: constants against attacks, then attacks against constants.
    #[arg(long, default_value_t = 2)]
    pub rounds: usize,
    /// Settings of constants that a round tries.
    #[arg(long, default_value_t = 24)]
    pub trials: usize,
    /// Random legal patches that a round tries, a family.
    #[arg(long, default_value_t = 16)]
    pub patches: usize,
    /// Root of all draws.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Folder for the report (harden.md, harden.json, payoffs.svg) and what was simulated; the same command goes on there.
    #[arg(long)]
    pub out: PathBuf,
    #[command(flatten)]
    pub output: Output,
}

/// A thing that a driver drives: a scene with what others do in it.
struct Attack {
    plant: Plant,
    intervention: Intervention,
    /// Digest of all that decides what a driver meets.
    digest: Digest,
}

impl Attack {
    fn new(plant: Plant, intervention: Intervention) -> Result<Attack, Failure> {
        let rules = plant.options().digest().map_err(Failure::internal)?;
        let decides = (plant.scene().digest(), rules, &intervention);
        let digest = Digest::of("evodrive/harden/attack/1", &decides).map_err(Failure::internal)?;
        Ok(Attack { plant, intervention, digest })
    }

    /// A scene of the pool under a family's rules.
    fn on(entry: &SceneEntry, family: &Planned, intervention: Intervention) -> Result<Attack, Failure> {
        let plant = Plant::with_options(entry.prepared.clone(), &family.rules).map_err(Failure::bad_input)?;
        Attack::new(plant, intervention)
    }
}

/// Cases or scenes in three parts that see nothing of each other.
struct Parts<T> {
    searched: Vec<T>,
    deciding: Vec<T>,
    paying: Vec<T>,
}

impl<T> Parts<T> {
    /// Every third, so that each part has of every family and kind of scene.
    fn of(all: Vec<T>) -> Parts<T> {
        let mut parts = Parts { searched: Vec::new(), deciding: Vec::new(), paying: Vec::new() };
        for (place, one) in all.into_iter().enumerate() {
            [&mut parts.searched, &mut parts.deciding, &mut parts.paying][place % 3].push(one);
        }
        parts
    }
}

/// Bench that keeps what is simulated by its key: a killed command goes on where it stopped.
struct Bench<'a> {
    folder: PathBuf,
    threads: &'a Threads,
    interrupt: &'a Interrupt,
}

impl Bench<'_> {
    fn kept<T: Serialize + DeserializeOwned>(
        &self,
        key: &impl Serialize,
        make: impl FnOnce() -> Result<T, Failure>,
    ) -> Result<T, Failure> {
        if self.interrupt.is_asked() {
            return Err(Failure::interrupted("what was simulated is kept; the same command goes on"));
        }
        let digest = Digest::of("evodrive/harden/1", key).map_err(Failure::internal)?;
        let place = self.folder.join(format!("{}.json", digest.short(32)));
        if let Ok(bytes) = store::read_bounded(&place, KEPT_BYTES_MAX) {
            return serde_json::from_slice(&bytes).map_err(|error| {
                Failure::corruption(format!("{}: {error}; remove the file, it is simulated again", place.display()))
            });
        }
        let made = make()?;
        let bytes = serde_json::to_vec(&made).map_err(Failure::internal)?;
        store::write_atomic(&place, &bytes)?;
        Ok(made)
    }

    /// How a driver comes through attacks.
    fn drives(&self, ego: &Policy, attacks: &[Attack]) -> Result<Drives, Failure> {
        let met: Vec<Digest> = attacks.iter().map(|attack| attack.digest).collect();
        self.kept(&("drives", ego.digest(), met), || {
            let one = |_: usize, attack: &Attack| {
                rollout(&attack.plant, &attack.intervention, ego.driver().as_mut())
                    .map(|outcome| (outcome.contact.is_some(), outcome.route_completion))
            };
            let driven: Result<Vec<(bool, f64)>, _> = self.threads.map(attacks, one).into_iter().collect();
            let (crashed, completion) = driven.map_err(Failure::bad_input)?.into_iter().unzip();
            Ok(Drives { crashed, completion })
        })
    }

    /// Scores of programs of one family against a driver.
    fn scores(
        &self,
        family: &Planned,
        programs: &[&Program],
        ego: &Policy,
        entries: &[SceneEntry],
    ) -> Result<Vec<Option<Score>>, Failure> {
        let scenes: Vec<Digest> = entries.iter().map(|entry| entry.digest).collect();
        let hashes = programs.iter().map(|of| of.hash()).collect::<Result<Vec<_>, _>>().map_err(Failure::internal)?;
        let rules = family.rules.digest().map_err(Failure::internal)?;
        self.kept(&("scores", hashes, ego.digest(), scenes, rules, family.member.seed), || {
            let labelled = applied(family, ego).label_each(programs, entries, self.threads)?;
            Ok(labelled.into_iter().map(|of| of.ok().map(|of| of.score)).collect())
        })
    }
}

fn applied<'a>(family: &'a Planned, ego: &'a Policy) -> Applied<'a> {
    Applied {
        source: &family.source,
        ego,
        seed: family.seed(),
        simulator: &family.rules,
        backend: crate::backend::Backend::Own,
        evaluation: &family.evaluation,
        counsels: &family.counsels,
    }
}

pub fn run(options: &Options, jobs: usize) -> Result<Answer, Failure> {
    checked(options)?;
    let (threads, interrupt) = (files::threads(jobs)?, Interrupt::listen()?);
    let bench = Bench { folder: options.out.join("kept"), threads: &threads, interrupt: &interrupt };
    store::create_dir(&bench.folder)?;
    let frozen = suite_file::read_to_drive(&options.suite)?;
    let stage = SuiteRunner::new(&frozen.suite, &threads)?;
    let families = gathered(&Sources { files: &[], runs: &[], all: false, parents: &options.families })?;
    if let Some(staged) = families.iter().find(|family| family.is_staged()) {
        let what = "expected families of recorded or generated traffic, found one that SafeBench stages";
        return Err(Failure::bad_input(format!("--families {}: {what}", staged.member.family)));
    }
    let pool = files::chosen(&options.scenes, &[], jobs)?;
    let scenes: Vec<_> = pool.scenes.iter().filter(|scene| usable(scene).is_ok()).cloned().map(Arc::new).collect();
    if scenes.len() < 6 {
        let found = scenes.len();
        return Err(Failure::bad_input(format!("--scenes: expected six usable scenes at least, found {found}")));
    }
    let entries = Parts::of(threads.map(&scenes, |_, scene| SceneEntry::new(scene.clone())));
    let attacked = frozen.suite.cases.iter().filter(|case| case.program.is_some());
    let cases: Vec<Attack> = attacked
        .map(|case| {
            let plant = stage.plant(case).map_err(|error| Failure::bad_input(error.reason()))?;
            Attack::new(plant, case.intervention.clone())
        })
        .collect::<Result<_, Failure>>()?;
    let rounds = Rounds {
        options,
        bench: &bench,
        families: &families,
        entries: &entries,
        plain: [plain(&families[0], &entries.searched)?, plain(&families[0], &entries.deciding)?],
    };
    let hardening = rounds.played(&frozen.suite.name, frozen.digest, Parts::of(cases))?;
    written(options, &hardening)
}

fn checked(options: &Options) -> Result<(), Failure> {
    // One driver and one set of generators more than rounds.
    if !(1..SIDE_MAX).contains(&options.rounds) {
        let found = options.rounds;
        return Err(Failure::bad_input(format!("--rounds: expected 1 to {}, found {found}", SIDE_MAX - 1)));
    }
    for (name, found) in [("--trials", options.trials), ("--patches", options.patches)] {
        if !(1..=10_000).contains(&found) {
            return Err(Failure::bad_input(format!("{name}: expected 1 to 10000, found {found}")));
        }
    }
    Ok(())
}

/// Scenes in which nobody is moved.
fn plain(family: &Planned, entries: &[SceneEntry]) -> Result<Vec<Attack>, Failure> {
    entries.iter().map(|entry| Attack::on(entry, family, Intervention::default())).collect()
}

struct Rounds<'a> {
    options: &'a Options,
    bench: &'a Bench<'a>,
    families: &'a [Planned],
    entries: &'a Parts<SceneEntry>,
    /// Plain scenes that the search sees, and those that decide.
    plain: [Vec<Attack>; 2],
}

/// Result of one round's search of constants.
struct Found {
    settings: pdm::Settings,
    /// Crashes of champion and best trial in the cases that the search sees.
    crashes: [usize; 2],
}

impl Rounds<'_> {
    fn played(&self, suite: &str, suite_digest: Digest, cases: Parts<Attack>) -> Result<Hardening, Failure> {
        // The suite's last third is not needed: payoffs are of generators, on other scenes.
        let (mut searched, mut deciding) = (cases.searched, cases.deciding);
        deciding.extend(cases.paying);
        let (mut settings, mut driver) = (pdm::PUBLISHED, Policy::Pdm);
        let mut drivers = vec![("published".to_string(), driver.clone())];
        let parents: Vec<Program> = self.families.iter().map(|family| family.program.clone()).collect();
        let mut generators = vec![("parents".to_string(), parents)];
        let mut rounds = Vec::new();
        for round in 1..=self.options.rounds {
            let Found { settings: best, crashes } = self.search(round, &settings, &driver, &searched)?;
            let challenger = Policy::PdmWith(Box::new(best));
            let both = |ego: &Policy| -> Result<[Drives; 2], Failure> {
                Ok([self.bench.drives(ego, &deciding)?, self.bench.drives(ego, &self.plain[1])?])
            };
            let ([before, before_plain], [after, after_plain]) = (both(&driver)?, both(&challenger)?);
            let verdict = verdict([&before, &before_plain], [&after, &after_plain]);
            progress(format!("round {round}: {}", verdict.reason));
            rounds.push(HardeningRound {
                round,
                trials: self.options.trials,
                searched: crashes,
                searched_cases: searched.len(),
                moved: moved(&settings, &best),
                verdict: verdict.clone(),
            });
            if verdict.accepted {
                (settings, driver) = (best, challenger);
                drivers.push((format!("round {round}"), driver.clone()));
            }
            let last = generators.last().map(|(_, programs)| programs.clone()).unwrap_or_default();
            let evolved = self.attack(round, &driver, &last)?;
            searched.extend(self.attacks(&evolved, &driver, &self.entries.searched)?);
            deciding.extend(self.attacks(&evolved, &driver, &self.entries.deciding)?);
            generators.push((format!("round {round}"), evolved));
        }
        let (payoffs, rollouts) = self.payoffs(&generators, &drivers)?;
        Ok(Hardening {
            suite: suite.to_string(),
            suite_digest,
            families: self.families.iter().map(|family| family.member.family.to_string()).collect(),
            rounds,
            generators: generators.into_iter().map(|(name, _)| name).collect(),
            drivers: drivers.into_iter().map(|(name, _)| name).collect(),
            rollouts,
            equilibrium: equilibrium(&payoffs),
            payoffs,
        })
    }

    /// The best of the trials on the cases that the search sees. Each trial is a neighbour of the best so far; it takes its place with fewer
    /// crashes, or as many and more of the route, and no loss on plain scenes.
    fn search(
        &self,
        round: usize,
        settings: &pdm::Settings,
        driver: &Policy,
        searched: &[Attack],
    ) -> Result<Found, Failure> {
        let drives = |ego: &Policy| -> Result<[Drives; 2], Failure> {
            Ok([self.bench.drives(ego, searched)?, self.bench.drives(ego, &self.plain[0])?])
        };
        let [mut best_drives, first_plain] = drives(driver)?;
        let (mut best, before) = (*settings, best_drives.crashes());
        for trial in 0..self.options.trials {
            let mut stream = Seed(self.options.seed).stream(&["harden", &round.to_string(), &trial.to_string()]);
            let tried = pdm::tuning::neighbour(&best, &mut stream);
            let [attacked, plain] = drives(&Policy::PdmWith(Box::new(tried)))?;
            let order = |of: &Drives| (of.crashes(), -of.mean_completion());
            let (own, known) = (order(&attacked), order(&best_drives));
            let better = own.0 < known.0 || own.0 == known.0 && own.1 < known.1;
            let loses = plain.crashes() > first_plain.crashes()
                || plain.mean_completion() < first_plain.mean_completion() - LOSS_SEARCHED;
            if better && !loses {
                progress(format!("round {round}, trial {trial}: {} crashes of {}", own.0, searched.len()));
                (best, best_drives) = (tried, attacked);
            }
        }
        Ok(Found { settings: best, crashes: [before, best_drives.crashes()] })
    }

    /// Generators against a driver: of each family the random patches of the last round's program, of which the one with the most contacts
    /// takes over that is nearly as realistic as it.
    fn attack(&self, round: usize, driver: &Policy, last: &[Program]) -> Result<Vec<Program>, Failure> {
        let none = BTreeMap::new();
        let mut evolved = Vec::new();
        for (family, from) in self.families.iter().zip(last) {
            let hash = from.hash().map_err(Failure::internal)?;
            let places = Places { contract: &family.source.contract, values: &none, closed: &[], numbers: false };
            let mut programs = vec![from.clone()];
            for patch in 0..self.options.patches {
                let path = ["harden", &round.to_string(), family.member.family.as_str(), &patch.to_string()];
                let mut stream = Seed(self.options.seed).stream(&path);
                let drawn = random_patch(from, hash, &places, EDITS_MAX, &mut stream);
                let id = SolutionId::new(format!("{}/r{round}p{patch}", family.member.family));
                let child = patched(from, hash, &drawn, id).ok();
                programs.extend(child.filter(|child| family.source.contract.check_program(child).is_empty()));
            }
            let all: Vec<&Program> = programs.iter().collect();
            let scores = self.bench.scores(family, &all, driver, &self.entries.searched)?;
            evolved.push(programs[strongest(&scores)].clone());
        }
        Ok(evolved)
    }

    /// Returns what programs do around a driver, as attacks on any driver.
    fn attacks(&self, programs: &[Program], driver: &Policy, entries: &[SceneEntry]) -> Result<Vec<Attack>, Failure> {
        let mut all = Vec::new();
        for (family, program) in self.families.iter().zip(programs) {
            let made = applied(family, driver).interventions(&[program], entries, self.bench.threads)?;
            for (entry, made) in entries.iter().zip(made) {
                if let Some(Ok(intervention)) = made.into_iter().next() {
                    all.push(Attack::on(entry, family, intervention)?);
                }
            }
        }
        Ok(all)
    }

    /// Contacts that generators bring about against drivers on scenes that neither side's search saw, and of how many rollouts.
    fn payoffs(
        &self,
        generators: &[(String, Vec<Program>)],
        drivers: &[(String, Policy)],
    ) -> Result<(Vec<Vec<i64>>, usize), Failure> {
        let mut payoffs = Vec::new();
        for (_, programs) in generators {
            let mut row = Vec::new();
            for (_, ego) in drivers {
                let mut count = 0;
                for (family, program) in self.families.iter().zip(programs) {
                    let scores = self.bench.scores(family, &[program], ego, &self.entries.paying)?;
                    count += scores.iter().flatten().map(contacts).sum::<usize>();
                }
                row.push(i64::try_from(count).unwrap_or(i64::MAX));
            }
            payoffs.push(row);
        }
        Ok((payoffs, self.families.len() * self.entries.paying.len()))
    }
}

/// Scenes with a contact that the program brought about.
fn contacts(score: &Score) -> usize {
    let brought =
        |label: &&SceneScore| label.acted && label.contact.as_ref().is_some_and(|met| met.adversary && !met.anyway);
    score.scenes.iter().filter(brought).count()
}

/// The place of the program with the most contacts among those that are nearly as realistic as the first one; of equals the first.
fn strongest(scores: &[Option<Score>]) -> usize {
    let floor = scores.first().and_then(Option::as_ref).map_or(0.0, |of| REALISM_KEPT * of.objectives.realism);
    let mut best = (0, scores.first().and_then(Option::as_ref).map_or(0, contacts));
    for (place, score) in scores.iter().enumerate() {
        let Some(score) = score.as_ref().filter(|score| score.objectives.realism >= floor) else { continue };
        if contacts(score) > best.1 {
            best = (place, contacts(score));
        }
    }
    best.0
}

fn moved(before: &pdm::Settings, after: &pdm::Settings) -> Vec<(String, f64, f64)> {
    let of = |constant: &pdm::tuning::Constant| {
        let (before, after) = ((constant.read)(before), (constant.read)(after));
        (before != after).then(|| (constant.name.to_string(), before, after))
    };
    pdm::tuning::CONSTANTS.iter().filter_map(of).collect()
}

/// Writes report and figure.
fn written(options: &Options, hardening: &Hardening) -> Result<Answer, Failure> {
    let text = hardening.text();
    let share = |count: &i64| Some(*count as f64 / hardening.rollouts.max(1) as f64);
    let rows = hardening.generators.iter().zip(&hardening.payoffs);
    let panel = Panel {
        title: "Driver".into(),
        rows: rows.map(|(name, row)| (name.clone(), row.iter().map(share).collect())).collect(),
        columns: hardening.drivers.clone(),
    };
    let figure = heat_map("Generators (rows) against drivers (columns)", &[panel], 1.0);
    let object = json!(hardening);
    let pretty = serde_json::to_vec_pretty(&object).map_err(Failure::internal)?;
    options.output.write(&options.out.join("harden.md"), text.as_bytes())?;
    options.output.write(&options.out.join("harden.json"), &pretty)?;
    options.output.write(&options.out.join("payoffs.svg"), figure.svg().as_bytes())?;
    Ok(Answer::exact(text, object))
}
