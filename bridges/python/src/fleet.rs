//! Environments: a fleet of the engine behind a lock, closed when something breaks within it.

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use serde_json::json;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;

use evodrive::kernel::Threads;
use evodrive::learn::fleet::{Autoreset, FleetError, FleetOptions, Tasks};
use evodrive::learn::{self, Reward, Step};
use evodrive::sim::{Control, Repeated, rollout_assessed};

use crate::arrays::Sheet;
use crate::picture::{Picture, picture};
use crate::policy::{Observed, driver, seeing};
use crate::scenarios::{Scenarios, Source};
use crate::{broken, refused};

/// A driver around whom adversaries are planned: its name, or the bytes of its weights.
type Around = (Option<String>, Option<Vec<u8>>);
/// Tasks that are being planned.
type Pending = (Around, JoinHandle<Result<Arc<Tasks>, String>>);

/// Environments side by side. `reward` is a rule with its constants as JSON;
/// `autoreset` next_step, same_step or disabled.
#[pyclass(frozen)]
pub struct Fleet {
    fleet: Arc<Mutex<learn::Fleet>>,
    source: Mutex<Arc<Source>>,
    /// Around whom the present tasks are planned.
    around: Mutex<Around>,
    threads: Threads,
    /// The process that began it: in another one there are no threads.
    process: u32,
    /// Why it is closed.
    closed: Mutex<Option<String>>,
    pending: Mutex<Option<Pending>>,
}

/// Decisions as they are written down: acceleration and steering.
pub fn numbers(controls: &[Control]) -> Vec<[f64; 2]> {
    let one = |control: &Control| match *control {
        Control::Drive { acceleration_mps2, steering_rad } => [acceleration_mps2, steering_rad],
        Control::FollowLog => [0.0, 0.0],
    };
    controls.iter().map(one).collect()
}

fn autoreset_named(name: &str) -> PyResult<Autoreset> {
    match name {
        "next_step" => Ok(Autoreset::NextStep),
        "same_step" => Ok(Autoreset::SameStep),
        "disabled" => Ok(Autoreset::Disabled),
        other => Err(refused(format!("autoreset is {other:?}; expected next_step, same_step or disabled"))),
    }
}

/// A reward's rule with its constants, of JSON.
pub fn reward_of(text: &str) -> PyResult<Reward> {
    let reward: Reward = serde_json::from_str(text).map_err(|error| refused(format!("reward: {error}")))?;
    match reward.constants().into_iter().find(|(_, value)| !value.is_finite()) {
        Some((name, found)) => Err(refused(format!("reward: {name} is {found}; expected a finite number"))),
        None => Ok(reward),
    }
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Fleet {
    fn open(&self) -> PyResult<()> {
        if std::process::id() != self.process {
            return Err(PyRuntimeError::new_err(
                "this environment was made in another process, of which this one is a fork; expected one made here: use spawn in \
                 place of fork, or make it behind the fork",
            ));
        }
        match &*locked(&self.closed) {
            None => Ok(()),
            Some(why) => Err(PyRuntimeError::new_err(format!("the environment is closed: {why}"))),
        }
    }

    /// Does something to the fleet without Python's lock. What breaks within it closes the environment.
    fn guarded<R: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&mut learn::Fleet) -> Result<R, FleetError> + Send,
    ) -> PyResult<R> {
        self.open()?;
        let done = py.detach(|| {
            let mut fleet = locked(&self.fleet);
            catch_unwind(AssertUnwindSafe(|| work(&mut fleet)))
        });
        match done {
            Ok(Ok(done)) => Ok(done),
            Ok(Err(error @ FleetError::Scene { .. })) => Err(self.close_for(error.to_string())),
            Ok(Err(error @ (FleetError::NotBegun | FleetError::Over { .. }))) => {
                Err(PyRuntimeError::new_err(error.to_string()))
            }
            Ok(Err(error)) => Err(refused(error)),
            Err(panic) => {
                let said = panic.downcast_ref::<String>().map(String::as_str);
                let said = said.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("no words");
                Err(self.close_for(format!("a fault within it ({said}); please report it")))
            }
        }
    }

    fn close_for(&self, why: String) -> PyErr {
        *locked(&self.closed) = Some(why.clone());
        PyRuntimeError::new_err(format!("{why}; the environment is closed"))
    }
}

#[pymethods]
impl Fleet {
    #[new]
    #[pyo3(signature = (scenarios, places, threads, observation, reward, autoreset, by_failure, ego, weights, preventable, keep, motion, state=None))]
    #[allow(clippy::too_many_arguments)]
    fn new(
        py: Python<'_>,
        scenarios: &Scenarios,
        places: usize,
        threads: usize,
        observation: Observed,
        reward: &str,
        autoreset: &str,
        by_failure: f64,
        ego: Option<String>,
        weights: Option<Vec<u8>>,
        preventable: bool,
        keep: bool,
        motion: bool,
        state: Option<&str>,
    ) -> PyResult<Fleet> {
        let autoreset = autoreset_named(autoreset)?;
        let options = FleetOptions {
            seeing: seeing(&observation)?,
            reward: reward_of(reward)?,
            autoreset,
            by_failure,
            assesses: preventable,
            keeps: keep,
            keeps_motion: motion,
        };
        let policy = driver(ego.as_deref(), weights.as_deref())?;
        let source = scenarios.source.clone();
        py.detach(|| {
            let threads = if places == 1 { Threads::none() } else { Threads::new(threads).map_err(refused)? };
            let tasks = source.tasks(&policy, &threads)?;
            let fleet = match state {
                None => learn::Fleet::new(tasks, places, options),
                Some(state) => {
                    let state = serde_json::from_str(state).map_err(|error| refused(format!("state: {error}")))?;
                    learn::Fleet::resumed(tasks, options, state, &source.stage.plants, &threads)
                }
            };
            let (fleet, source) = (Arc::new(Mutex::new(fleet.map_err(refused)?)), Mutex::new(source));
            let (closed, pending, around) = (Mutex::new(None), Mutex::new(None), Mutex::new((ego, weights)));
            Ok(Fleet { fleet, source, around, threads, process: std::process::id(), closed, pending })
        })
    }

    /// How many threads step it.
    #[getter]
    fn threads(&self) -> usize {
        self.threads.count()
    }

    /// What a fleet made of the same arguments goes on from: its own state, around whom it is planned, and around whom it is being planned.
    fn state(&self, py: Python<'_>) -> PyResult<(String, Around, Option<Around>)> {
        let state = self.guarded(py, |fleet| Ok(fleet.state()))?;
        let pending = locked(&self.pending).as_ref().map(|(around, _)| around.clone());
        Ok((serde_json::to_string(&state).map_err(broken)?, locked(&self.around).clone(), pending))
    }

    /// Other programs and shares in the same scenes, for episodes that begin from now on. What is being planned is planned again for them.
    fn take(&self, py: Python<'_>, scenarios: &Scenarios) -> PyResult<()> {
        self.open()?;
        let source = scenarios.source.clone();
        let (name, weights) = locked(&self.around).clone();
        let policy = driver(name.as_deref(), weights.as_deref())?;
        let tasks = py.detach(|| source.tasks(&policy, &self.threads))?;
        *locked(&self.source) = source;
        self.guarded(py, |fleet| {
            fleet.set_tasks(tasks);
            Ok(())
        })?;
        let Some(((name, weights), former)) = locked(&self.pending).take() else { return Ok(()) };
        let _ = py.detach(|| former.join());
        self.plan_around(name, weights)
    }

    /// When new episodes begin, from the next reset on.
    fn set_autoreset(&self, py: Python<'_>, autoreset: &str) -> PyResult<()> {
        let autoreset = autoreset_named(autoreset)?;
        self.guarded(py, |fleet| {
            fleet.set_autoreset(autoreset);
            Ok(())
        })
    }

    /// How often each scene comes up beside the others, by its number; 1 of those beyond.
    fn weights(&self) -> Vec<f64> {
        locked(&self.fleet).tasks().weights().to_vec()
    }

    /// Gives each place its seed: a list of (place, seed).
    fn seed(&self, py: Python<'_>, seeds: Vec<(usize, u64)>) -> PyResult<()> {
        self.guarded(py, |fleet| seeds.into_iter().try_for_each(|(place, seed)| fleet.seed(place, seed)))
    }

    /// Begins an episode at the places of which `mask` holds true, or at all; of a given program and scene where they are named by
    /// their numbers. Gives the number of the sheet of observations.
    #[pyo3(signature = (mask=None, task=None))]
    fn reset(&self, py: Python<'_>, mask: Option<Vec<bool>>, task: Option<(usize, usize)>) -> PyResult<usize> {
        self.guarded(py, |fleet| {
            let below = fleet.places();
            if let Some(found) = mask.as_ref().map(Vec::len).filter(|len| *len != below) {
                return Err(FleetError::Place { what: "mask of length", found, below: below + 1 });
            }
            let task = match task {
                None => None,
                Some((program, scene)) => {
                    let sets = fleet.tasks().sets();
                    let below = sets.len();
                    let of = sets.get(program).ok_or(FleetError::Place { what: "program", found: program, below })?;
                    let place = of.tasks.iter().position(|task| task.scene == scene);
                    let missing = FleetError::Place { what: "scene", found: scene, below: of.tasks.len() };
                    Some((program, place.ok_or(missing)?))
                }
            };
            fleet.reset(&|place| mask.as_ref().is_none_or(|mask| mask[place]), task, &self.threads)?;
            Ok(fleet.sheet())
        })
    }

    /// Carries the actions out that lie in the array `actions`: how many episodes ended, and the number of the sheet of observations.
    fn step(&self, py: Python<'_>) -> PyResult<(usize, usize)> {
        self.guarded(py, |fleet| Ok((fleet.step(&self.threads)?, fleet.sheet())))
    }

    /// One of its arrays, for numpy: actions (the only one that may be written), observations_0, observations_1, final_observations,
    /// rewards, terminated, truncated, scene, program, end, contact_class, adversary, preventable, route_completion, length, sum,
    /// step, now_scene, now_program.
    fn array(&self, name: &str) -> PyResult<Sheet> {
        let mut fleet = locked(&self.fleet);
        let n = fleet.places();
        let actions = fleet.actions_mut().as_mut_ptr() as usize;
        let sheets = fleet.sheets();
        let width = sheets.final_observations.len() / n;
        let ((at, kind), shape): ((usize, &'static str), Vec<usize>) = match name {
            "actions" => ((actions, "<f4"), vec![n, 2]),
            "observations_0" => ((sheets.observations[0].as_ptr() as usize, "<f4"), vec![n, width]),
            "observations_1" => ((sheets.observations[1].as_ptr() as usize, "<f4"), vec![n, width]),
            "final_observations" => ((sheets.final_observations.as_ptr() as usize, "<f4"), vec![n, width]),
            "rewards" => ((sheets.rewards.as_ptr() as usize, "<f8"), vec![n]),
            "terminated" => ((sheets.terminated.as_ptr() as usize, "|b1"), vec![n]),
            "truncated" => ((sheets.truncated.as_ptr() as usize, "|b1"), vec![n]),
            "scene" => ((sheets.reports.scene.as_ptr() as usize, "<i4"), vec![n]),
            "program" => ((sheets.reports.program.as_ptr() as usize, "<i4"), vec![n]),
            "end" => ((sheets.reports.end.as_ptr() as usize, "|i1"), vec![n]),
            "contact_class" => ((sheets.reports.contact_class.as_ptr() as usize, "|i1"), vec![n]),
            "adversary" => ((sheets.reports.adversary.as_ptr() as usize, "|b1"), vec![n]),
            "preventable" => ((sheets.reports.preventable.as_ptr() as usize, "|i1"), vec![n]),
            "route_completion" => ((sheets.reports.route_completion.as_ptr() as usize, "<f4"), vec![n]),
            "length" => ((sheets.reports.length.as_ptr() as usize, "<i4"), vec![n]),
            "sum" => ((sheets.reports.sum.as_ptr() as usize, "<f8"), vec![n]),
            "step" => ((sheets.steps.as_ptr() as usize, "<f8"), vec![n, Step::NAMES.len()]),
            "now_scene" => ((sheets.now_scene.as_ptr() as usize, "<i4"), vec![n]),
            "now_program" => ((sheets.now_program.as_ptr() as usize, "<i4"), vec![n]),
            other => return Err(refused(format!("a fleet has no array {other:?}"))),
        };
        Ok(Sheet::new(&self.fleet, at, kind, shape, name != "actions"))
    }

    /// Begins to plan every program around a driver, beside everything else.
    #[pyo3(signature = (name=None, weights=None))]
    fn plan_around(&self, name: Option<String>, weights: Option<Vec<u8>>) -> PyResult<()> {
        self.open()?;
        let policy = driver(name.as_deref(), weights.as_deref())?;
        let source = locked(&self.source).clone();
        let work = move || {
            let planned = catch_unwind(AssertUnwindSafe(|| source.tasks(&policy, &Threads::none())));
            match planned {
                Ok(planned) => planned.map_err(|error| error.to_string()),
                Err(_) => Err("planning broke down; please report it".to_string()),
            }
        };
        let begun = std::thread::Builder::new().name("evodrive-plan".into()).spawn(work).map_err(refused)?;
        *locked(&self.pending) = Some(((name, weights), begun));
        Ok(())
    }

    /// Waits for what is being planned; episodes that begin from now on are of it. Whether there was something.
    fn adopt(&self, py: Python<'_>) -> PyResult<bool> {
        let Some((around, pending)) = locked(&self.pending).take() else { return Ok(false) };
        let planned = py.detach(|| pending.join()).unwrap_or_else(|_| Err("planning broke down".into()));
        let tasks = planned.map_err(PyRuntimeError::new_err)?;
        *locked(&self.around) = around;
        self.guarded(py, |fleet| {
            fleet.set_tasks(tasks);
            Ok(true)
        })
    }

    /// What a place drove last, as the text of a file for `evodrive scenes show --episode`: scene, program, every control, and the
    /// labels of a rollout of them. None without an ended episode.
    fn kept(&self, py: Python<'_>, place: usize) -> PyResult<Option<String>> {
        let kept = locked(&self.fleet).kept(place).cloned();
        let Some(kept) = kept else { return Ok(None) };
        let (task, scene) = (&kept.task, kept.task.plant.scene());
        let outcome =
            py.detach(|| rollout_assessed(&task.plant, &task.intervention, &mut Repeated::new(&kept.controls, false)));
        Ok(Some(
            json!({
                "format": "evodrive-episode/1", "scene": scene.id, "scene_digest": scene.digest(),
                "program": locked(&self.source).named[kept.program].name, "intervention": &*task.intervention,
                "simulator": task.plant.options(), "outcome": outcome.map_err(refused)?,
                "controls": numbers(&kept.controls),
            })
            .to_string(),
        ))
    }

    /// The episode at a place as a picture: height, width, and rows of red, green and blue.
    fn picture<'py>(&self, py: Python<'py>, place: usize, width: f64, title: &str) -> PyResult<Picture<'py>> {
        self.open()?;
        let fleet = locked(&self.fleet);
        let episode = fleet.episode(place).ok_or_else(|| refused("nothing to draw before the first reset"))?;
        picture(py, episode, &[], width, title)
    }

    /// For tests: a fault within the engine, so that what becomes of one can be seen.
    #[pyo3(name = "_fault")]
    fn fault(&self, py: Python<'_>) -> PyResult<()> {
        self.guarded(py, |fleet| panic!("asked for at {} places", fleet.places()))
    }

    /// Closes it; every later call says so.
    fn close(&self) {
        locked(&self.closed).get_or_insert_with(|| "close() was called".into());
    }
}
