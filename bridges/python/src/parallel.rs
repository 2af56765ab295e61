//! Several agents in one scene, for PettingZoo: a shared scene of the engine behind a lock, with rewards as a fleet's.

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use evodrive::ego::Policy;
use evodrive::kernel::Seed;
use evodrive::learn::fleet::{Frames, Seeing};
use evodrive::learn::{Reward, step_to};
use evodrive::sim::{ActorRef, Agent, Driver, End, SharedScene};

use crate::fleet::reward_of;
use crate::picture::{Picture, picture};
use crate::policy::{Observed, seeing};
use crate::scenarios::{Scenarios, Source};
use crate::{broken, refused};

/// What became of an agent in a step: reward, places of its end and contact class (-1 without), route completion, the agent it touched, and
/// the step's numbers.
type Report = (f64, i8, i8, f64, Option<usize>, [f64; 6]);
/// Actions of the agents that drove in a step, in their order.
type Actions = Vec<[f32; 2]>;
/// What another environment goes on from: seed, episodes so far, and the number of the scene with all actions so far.
type Past = (u64, u64, Option<(usize, Vec<Actions>)>);

/// One scene at a time with up to `agents` agents, of which 0 is the scene's ego. `others` is "recorded", or the driver of those vehicles
/// that could be agents and are not.
#[pyclass(frozen)]
pub struct Shared {
    source: Arc<Source>,
    agents: usize,
    others: Option<Policy>,
    seeing: Seeing,
    reward: Reward,
    /// Whether everyone's motion is kept, to be drawn.
    motion: bool,
    state: Mutex<State>,
}

/// From where the next scene is drawn, and what is driven.
#[derive(Default)]
struct State {
    seed: u64,
    episodes: u64,
    drive: Option<Drive>,
}

struct Drive {
    /// Number of the scene.
    number: usize,
    scene: SharedScene,
    /// Recorded name of each agent that is driven from outside: the first ones.
    names: Vec<String>,
    hidden: Vec<Box<dyn Driver + Send>>,
    /// Place of each agent along its route, metres.
    last_s_m: Vec<f64>,
    frames: Vec<Frames>,
    actions: Vec<Actions>,
}

impl Drive {
    fn goes_on(&self) -> Vec<usize> {
        (0..self.names.len()).filter(|agent| self.scene.episode(*agent).end().is_none()).collect()
    }

    /// Observations of some agents, one behind the other, as the bytes of float32.
    fn seen(&mut self, seeing: &Seeing, agents: &[usize]) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(4 * agents.len() * seeing.length());
        for &agent in agents {
            let view = self.scene.episode(agent).observe();
            let values = self.frames[agent].seen(seeing, &view, self.actions.len());
            bytes.extend(values.iter().flat_map(|value| value.to_ne_bytes()));
        }
        bytes
    }

    /// Carries an action out of every agent that still drives.
    fn step(&mut self, actions: Actions, shared: &Shared) -> PyResult<Vec<Report>> {
        let agents = self.goes_on();
        if actions.len() != agents.len() {
            let (found, expected) = (actions.len(), agents.len());
            return Err(refused(format!("{found} actions of {expected} agents; expected one each")));
        }
        let (setting, mut left) = (shared.seeing.setting(), actions.iter());
        let (shown, hidden) = (self.names.len(), &mut self.hidden);
        let done = self.scene.step(|agent, view| match agent.checked_sub(shown) {
            None => setting.control(view, left.next().copied().unwrap_or_default()),
            Some(driver) => hidden[driver].decide(view),
        });
        done.map_err(broken)?;
        let mut reports = Vec::with_capacity(agents.len());
        for (&agent, action) in agents.iter().zip(&actions) {
            let episode = self.scene.episode(agent);
            let (view, end) = (episode.observe(), episode.end());
            let step = step_to(&view, self.last_s_m[agent], *action);
            self.last_s_m[agent] = view.ego().along.s_m;
            let contact = episode.contact().map_or(-1, |contact| contact.class as i8);
            let met = self.scene.met(agent).filter(|met| *met < shown);
            let code = end.map_or(-1, |end: End| end as i8);
            let worth = shared.reward.of(&step, end);
            reports.push((worth, code, contact, episode.route_completion(), met, step.numbers()));
        }
        self.actions.push(actions);
        Ok(reports)
    }
}

impl Shared {
    fn begun(&self, number: usize) -> PyResult<Drive> {
        let plants = &self.source.stage.plants;
        let plant = plants.get(number).ok_or_else(|| refused(format!("no scene {number} of {}", plants.len())))?;
        let all = Agent::of_scene(plant, if self.others.is_some() { usize::MAX } else { self.agents });
        let agents = all.len().min(self.agents);
        let driver = |(agent, policy): (&Agent, &Policy)| {
            let mut driver = policy.driver();
            driver.begin(agent.plant());
            driver
        };
        let policies = self.others.iter().cycle();
        let hidden = all[agents..].iter().zip(policies).map(driver).collect();
        let mut scene = SharedScene::new(&all).map_err(broken)?;
        if self.motion {
            scene = scene.keeping_motion();
        }
        let last_s_m = (0..agents).map(|agent| scene.episode(agent).observe().ego().along.s_m).collect();
        let names = all[..agents].iter().map(|agent| agent.name().to_string()).collect();
        Ok(Drive { number, scene, names, hidden, last_s_m, frames: vec![Frames::default(); agents], actions: vec![] })
    }

    fn locked(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[pymethods]
impl Shared {
    #[new]
    #[pyo3(signature = (scenarios, agents, others, observation, reward, motion, state=None))]
    #[allow(clippy::too_many_arguments)]
    fn new(
        py: Python<'_>,
        scenarios: &Scenarios,
        agents: usize,
        others: &str,
        observation: Observed,
        reward: &str,
        motion: bool,
        state: Option<Past>,
    ) -> PyResult<Shared> {
        let source = scenarios.source.clone();
        if let Some(staged) = source.stage.plants.iter().find(|plant| plant.is_staged()) {
            return Err(refused(format!(
                "scene {} is staged for SafeBench's traffic families, in which nobody but the ego was recorded; expected scenes of traffic",
                staged.scene_id()
            )));
        }
        let others = match others {
            "recorded" => None,
            "idm" | "idm-lights" | "pdm" | "frenet" => Some(others.parse().map_err(refused)?),
            _ => {
                let expected = "expected recorded, idm, idm-lights, pdm or frenet";
                return Err(refused(format!("others is {others:?}; {expected}")));
            }
        };
        let (seeing, reward) = (seeing(&observation)?, reward_of(reward)?);
        let shared = Shared { source, agents, others, seeing, reward, motion, state: Mutex::default() };
        let Some((seed, episodes, driven)) = state else { return Ok(shared) };
        py.detach(|| {
            let mut drive = driven.as_ref().map(|(number, _)| shared.begun(*number)).transpose()?;
            if let (Some(drive), Some((_, steps))) = (&mut drive, driven) {
                for actions in steps {
                    drive.seen(&shared.seeing, &drive.goes_on());
                    drive.step(actions, &shared)?;
                }
                drive.seen(&shared.seeing, &drive.goes_on());
            }
            *shared.locked() = State { seed, episodes, drive };
            Ok(shared)
        })
    }

    /// What one made of the same arguments goes on from.
    fn state(&self) -> Past {
        let state = self.locked();
        let driven = state.drive.as_ref().map(|drive| (drive.number, drive.actions.clone()));
        (state.seed, state.episodes, driven)
    }

    /// Begins a scene: a given one, or one that is drawn, by a new seed where there is one. Gives its number, the recorded name of each
    /// agent, and their observations.
    #[pyo3(signature = (seed=None, scene=None))]
    fn reset<'py>(
        &self,
        py: Python<'py>,
        seed: Option<u64>,
        scene: Option<usize>,
    ) -> PyResult<(usize, Vec<String>, Bound<'py, PyBytes>)> {
        let (number, names, seen) = py.detach(|| {
            let mut state = self.locked();
            if let Some(seed) = seed {
                (state.seed, state.episodes) = (seed, 0);
            }
            let mut stream = Seed(state.seed).stream(&["parallel", &state.episodes.to_string()]);
            let number = scene.unwrap_or_else(|| stream.below(self.source.stage.plants.len()));
            let mut drive = self.begun(number)?;
            state.episodes += 1;
            let (seen, names) = (drive.seen(&self.seeing, &drive.goes_on()), drive.names.clone());
            state.drive = Some(drive);
            PyResult::Ok((number, names, seen))
        })?;
        Ok((number, names, PyBytes::new(py, &seen)))
    }

    /// Carries an action out of every agent that still drives, in their order; gives their observations, and what became of each.
    fn step<'py>(&self, py: Python<'py>, actions: Actions) -> PyResult<(Bound<'py, PyBytes>, Vec<Report>)> {
        let (seen, reports) = py.detach(|| {
            let mut state = self.locked();
            let Some(drive) = &mut state.drive else {
                return Err(PyRuntimeError::new_err("a step before the first reset; call reset first"));
            };
            let agents = drive.goes_on();
            let reports = drive.step(actions, self)?;
            Ok((drive.seen(&self.seeing, &agents), reports))
        })?;
        Ok((PyBytes::new(py, &seen), reports))
    }

    /// The scene as a picture with an agent in the middle, and the other agents marked: height, width, and rows of red, green and blue.
    fn picture<'py>(&self, py: Python<'py>, agent: usize, width: f64, title: &str) -> PyResult<Picture<'py>> {
        let state = self.locked();
        let drive = state.drive.as_ref().filter(|drive| agent < drive.names.len());
        let scene = &drive.ok_or_else(|| refused("nothing to draw before the first reset"))?.scene;
        let shown = drive.map_or(0, |drive| drive.names.len());
        let track = |(other, who): (usize, ActorRef)| match who {
            ActorRef::Track(track) if other < shown => Some(track),
            _ => None,
        };
        let marked: Vec<usize> = scene.others(agent).filter_map(track).collect();
        picture(py, scene.episode(agent), &marked, width, title)
    }
}
