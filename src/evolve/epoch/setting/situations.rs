//! The situations of the study's scenes: what a compiler knows of a scene and an ego. Each is built when it is first needed, because
//! a replay with all rollouts recorded needs none.

use std::collections::BTreeMap;
use std::sync::{Arc, OnceLock};

use super::study::{LineageSpec, Study};
use crate::backend::{Backend, DriveContext, NoOutcome};
use crate::ego::Policy;
use crate::kernel::Seed;
use crate::scene::PreparedScene;
use crate::sim::{Intervention, Plant, SimulatorOptions};
use crate::stage::Situation;

/// Situations by place in the study's scenes, then by ego.
pub struct Situations {
    simulator: SimulatorOptions,
    seed: Seed,
    /// True if the ego's undisturbed drive is that of the simulator that judges; false if it is ours.
    around_backend: bool,
    places: Vec<Place>,
}

struct Place {
    prepared: Arc<PreparedScene>,
    by_ego: BTreeMap<String, OnceLock<Built>>,
}

/// A situation, or why the ego cannot drive the scene.
type Built = Result<Arc<Situation>, String>;

impl Situations {
    /// Makes room for the scenes of a study and the drivers of its lineages; nothing is built yet.
    pub fn of(study: &Study) -> Situations {
        let egos = || {
            let all = study.lineages.iter().flat_map(LineageSpec::by_ego);
            all.map(|spec| (spec.ego.name().to_string(), OnceLock::new())).collect()
        };
        let place = |entry: &super::study::SceneEntry| Place { prepared: entry.prepared.clone(), by_ego: egos() };
        Situations {
            simulator: study.simulator,
            seed: study.seed,
            around_backend: study.plans_around_backend(),
            places: study.scenes.iter().map(place).collect(),
        }
    }

    /// The scene at a place against an ego. `backend` is asked how the ego drives there where families plan around that.
    ///
    /// # Errors
    /// An ego that cannot drive the scene; a backend that cannot go on.
    pub fn at(&self, place: usize, ego: &Policy, backend: &Backend<'_>) -> Result<Arc<Situation>, NoOutcome> {
        let Place { prepared, by_ego } = &self.places[place];
        let known = by_ego.get(ego.name());
        if !self.around_backend {
            let under = || Situation::under(prepared.clone(), ego, &self.simulator);
            let build = || under().map(Arc::new).map_err(|error| error.to_string());
            return Ok(known.map_or_else(build, |built| built.get_or_init(build).clone())?);
        }
        if let Some(built) = known.and_then(OnceLock::get) {
            return Ok(built.clone()?);
        }
        // A reason to stop is not kept: it is no property of the scene.
        let built = match around(prepared, &self.simulator, ego, self.seed, backend) {
            Ok(situation) => Ok(Arc::new(situation)),
            Err(NoOutcome::Scene(why)) => Err(why.to_string()),
            Err(stop) => return Err(stop),
        };
        Ok(known.map_or_else(|| built.clone(), |kept| kept.get_or_init(|| built.clone()).clone())?)
    }
}

/// A scene around the undisturbed drive of the ego of whoever simulates.
pub fn around(
    prepared: &Arc<PreparedScene>,
    simulator: &SimulatorOptions,
    ego: &Policy,
    seed: Seed,
    backend: &Backend<'_>,
) -> Result<Situation, NoOutcome> {
    let plant = Plant::with_options(prepared.clone(), simulator)?;
    let (outcome, trace) = backend.traced(&plant, &Intervention::default(), ego, DriveContext::plain(seed))?;
    Ok(Situation::around(prepared.clone(), plant, ego, outcome, trace))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::backend::{Answer, Answers, BackendError, BackendOptions, PlanAround, Request, WorkerOptions};
    use crate::kernel::Digest;
    use crate::sim::scenes::crossing;
    use crate::sim::{ReportedRollout, tell};
    use std::sync::atomic::{AtomicUsize, Ordering};

    /// Another simulator, in which every ego repeats its recording; it fails the first time.
    struct Repeats(AtomicUsize);

    impl Answers for Repeats {
        fn answer(&self, request: &Request<'_>) -> Result<Answer, BackendError> {
            if self.0.fetch_add(1, Ordering::SeqCst) == 0 {
                return Err(BackendError::Unplayable("not yet".into()));
            }
            let rollout: Result<ReportedRollout, _> =
                tell(request.plant, request.intervention, Policy::Replay.driver().as_mut());
            Ok(Answer::ReportedRollout(rollout.expect("a rollout")))
        }
    }

    fn situations(around_backend: bool) -> Situations {
        let prepared = PreparedScene::new(Arc::new(crossing(3, 20, 91)));
        let by_ego = BTreeMap::from([("idm".to_string(), OnceLock::new())]);
        let simulator = SimulatorOptions::SHIPPED;
        Situations { simulator, seed: Seed(1), around_backend, places: vec![Place { prepared, by_ego }] }
    }

    #[test]
    fn families_plan_around_the_ego_of_whom_the_experiment_names() {
        let options = BackendOptions {
            name: "repeats".into(),
            version: "1".into(),
            digest: Digest::of_bytes(b"repeats"),
            options: Default::default(),
            plan_around: PlanAround::Backend,
            cassette: "none".into(),
            worker: WorkerOptions { command: vec![], workers: 1, seconds: 1.0, retries: 0, rollouts: None },
        };
        let repeats = Repeats(AtomicUsize::new(0));
        let other = Backend::Other { options: &options, answers: &repeats };
        let own = situations(false).at(0, &Policy::Idm, &other).unwrap();
        assert_eq!(repeats.0.load(Ordering::SeqCst), 0, "our own ego needs no other simulator");
        let theirs = situations(true);
        // A reason to stop ends the run and says nothing of the scene.
        assert!(matches!(theirs.at(0, &Policy::Idm, &other), Err(NoOutcome::Stop(_))));
        let around = theirs.at(0, &Policy::Idm, &other).unwrap();
        let (scene, step) = (&around.scene, around.first_step() + 20);
        let place = |situation: &Situation| situation.ego.at(step).map(|sample| sample.position);
        assert_eq!(place(&around), scene.ego.track.at(step).map(|sample| sample.position));
        assert!(place(&own).zip(place(&around)).is_some_and(|(a, b)| a.distance(b) > 0.5));
        theirs.at(0, &Policy::Idm, &other).unwrap();
        assert_eq!(repeats.0.load(Ordering::SeqCst), 2, "asked again, though it was built");
        let key = |plan_around| {
            let options = BackendOptions { plan_around, ..options.clone() };
            (options.key().unwrap(), options.rules().unwrap())
        };
        let (same, other) = (key(PlanAround::Evodrive), key(PlanAround::Backend));
        assert_eq!(same.0, other.0, "equal commands share a recorded rollout");
        assert_ne!(same.1, other.1, "labels do not");
    }
}
