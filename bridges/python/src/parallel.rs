//! Several agents in one scene, for PettingZoo: a shared scene of the engine behind a lock, with rewards as a fleet's.

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use std::sync::{Arc, Mutex, PoisonError};

use evodrive::ego::Policy;
use evodrive::kernel::Seed;
use evodrive::learn::fleet::Seeing;
use evodrive::learn::{Reward, step_to};
use evodrive::sim::{Agent, Driver, End, SharedScene};

use crate::fleet::reward_of;
use crate::policy::seeing;
use crate::scenarios::{Scenarios, Source};
use crate::{broken, refused};

/// What became of an agent in a step: reward, places of its end and contact class (-1 without), route completion, the agent it touched.
type Report = (f64, i8, i8, f64, Option<usize>);

/// One scene at a time with up to `agents` agents, of which 0 is the scene's ego. `others` is "recorded", or the driver of those vehicles
/// that could be agents and are not.
#[pyclass(frozen)]
pub struct Shared {
    source: Arc<Source>,
    agents: usize,
    others: Option<Policy>,
    seeing: Seeing,
    reward: Reward,
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
    scene: SharedScene,
    /// Number of agents that are driven from outside: the first ones.
    agents: usize,
    hidden: Vec<Box<dyn Driver + Send>>,
    /// Place of each agent along its route, metres.
    last_s_m: Vec<f64>,
}

impl Drive {
    fn goes_on(&self) -> Vec<usize> {
        (0..self.agents).filter(|agent| self.scene.episode(*agent).end().is_none()).collect()
    }

    /// Observations of some agents, one behind the other, as the bytes of float32.
    fn seen(&self, seeing: Seeing, agents: &[usize]) -> Vec<u8> {
        let (mut bytes, mut values) = (Vec::with_capacity(4 * agents.len() * seeing.length()), Vec::new());
        for &agent in agents {
            seeing.observe(&self.scene.episode(agent).observe(), &mut values);
            bytes.extend(values.iter().flat_map(|value| value.to_ne_bytes()));
        }
        bytes
    }
}

#[pymethods]
impl Shared {
    #[new]
    fn new(scenarios: &Scenarios, agents: usize, others: &str, observation: &str, reward: &str) -> PyResult<Shared> {
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
        let (seeing, reward) = (seeing(observation)?, reward_of(reward)?);
        Ok(Shared { source, agents, others, seeing, reward, state: Mutex::default() })
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
        let (scene, names, seen) = py.detach(|| {
            let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
            if let Some(seed) = seed {
                (state.seed, state.episodes) = (seed, 0);
            }
            let plants = &self.source.stage.plants;
            let mut stream = Seed(state.seed).stream(&["parallel", &state.episodes.to_string()]);
            let scene = scene.unwrap_or_else(|| stream.below(plants.len()));
            let plant = plants.get(scene).ok_or_else(|| refused(format!("no scene {scene} of {}", plants.len())))?;
            state.episodes += 1;
            let all = Agent::of_scene(plant, if self.others.is_some() { usize::MAX } else { self.agents });
            let agents = all.len().min(self.agents);
            let driver = |(agent, policy): (&Agent, &Policy)| {
                let mut driver = policy.driver();
                driver.begin(agent.plant());
                driver
            };
            let policies = self.others.iter().cycle();
            let hidden = all[agents..].iter().zip(policies).map(driver).collect();
            let shared = SharedScene::new(&all).map_err(broken)?;
            let last_s_m = (0..agents).map(|agent| shared.episode(agent).observe().ego().along.s_m).collect();
            let drive = Drive { scene: shared, agents, hidden, last_s_m };
            let seen = drive.seen(self.seeing, &drive.goes_on());
            state.drive = Some(drive);
            let names = all[..agents].iter().map(|agent| agent.name().to_string()).collect();
            PyResult::Ok((scene, names, seen))
        })?;
        Ok((scene, names, PyBytes::new(py, &seen)))
    }

    /// Carries an action out of every agent that still drives, in their order; gives their observations, and what became of each.
    fn step<'py>(&self, py: Python<'py>, actions: Vec<[f32; 2]>) -> PyResult<(Bound<'py, PyBytes>, Vec<Report>)> {
        let (seen, reports) = py.detach(|| {
            let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
            let Some(drive) = &mut state.drive else {
                return Err(PyRuntimeError::new_err("a step before the first reset; call reset first"));
            };
            let agents = drive.goes_on();
            if actions.len() != agents.len() {
                return Err(refused(format!(
                    "{} actions of {} agents; expected one each",
                    actions.len(),
                    agents.len()
                )));
            }
            let (setting, mut left) = (self.seeing.setting(), actions.iter());
            let (shown, hidden) = (drive.agents, &mut drive.hidden);
            let done = drive.scene.step(|agent, view| match agent.checked_sub(shown) {
                None => setting.control(view, left.next().copied().unwrap_or_default()),
                Some(driver) => hidden[driver].decide(view),
            });
            done.map_err(broken)?;
            let mut reports = Vec::with_capacity(agents.len());
            for (&agent, action) in agents.iter().zip(&actions) {
                let episode = drive.scene.episode(agent);
                let (view, end) = (episode.observe(), episode.end());
                let step = step_to(&view, drive.last_s_m[agent], *action);
                drive.last_s_m[agent] = view.ego().along.s_m;
                let contact = episode.contact().map_or(-1, |contact| contact.class as i8);
                let met = drive.scene.met(agent).filter(|met| *met < drive.agents);
                let code = end.map_or(-1, |end: End| end as i8);
                reports.push((self.reward.of(&step, end), code, contact, episode.route_completion(), met));
            }
            Ok((drive.seen(self.seeing, &agents), reports))
        })?;
        Ok((PyBytes::new(py, &seen), reports))
    }
}
