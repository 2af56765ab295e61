//! The scenes of a suite, ready to be driven one by one.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::backend::{Backend, DriveContext, NoOutcome, ProgramContext};
use crate::cli::look::rollout::Played;
use crate::cli::terminal::exit::Failure;
use crate::ego::Policy;
use crate::evaluation::metrics::realism::realism;
use crate::evaluation::{EvaluationOptions, RealismOptions};
use crate::experiment::ProgramFile;
use crate::kernel::{Digest, Seed, Threads};
use crate::learn::Stopped;
use crate::objects::{FamilyName, SolutionId};
use crate::scene::{PreparedScene, Scene};
use crate::sim::{
    Driver, EgoCar, Fault, Jury, Outcome, Plant, Retraced, Timeline, Trace, assess, commands, fault_of, jury,
    rollout_explained, rollout_traced,
};
use crate::suite::{Case, Drive, Member, Suite};

/// Scenes of a suite.
pub struct SuiteRunner<'a> {
    pub suite: &'a Suite,
    scenes: BTreeMap<&'a str, Arc<PreparedScene>>,
    realism: RealismOptions,
}

/// Outcome of a case, and what is said of its contact.
pub struct Drove {
    pub outcome: Outcome,
    pub timeline: Option<Timeline>,
    /// Realism of what others did; `None` if nobody is moved.
    pub realism: Option<f64>,
    pub fault: Option<Fault>,
    pub jury: Option<Jury>,
}

impl Drove {
    /// As results hold it.
    pub fn drive(&self) -> Drive {
        Drive::of(&self.outcome, self.fault, self.jury)
    }
}

/// Driver, and the simulators: one a set of rules.
pub enum DriverSource<'a> {
    Standing,
    Policy(Policy, Vec<Backend<'a>>),
}

impl<'a> SuiteRunner<'a> {
    pub fn new(suite: &'a Suite, threads: &Threads) -> Result<SuiteRunner<'a>, Failure> {
        let prepared = threads.map(&suite.pool.scenes, |_, scene| PreparedScene::new(Arc::new(scene.clone())));
        let scenes = suite.pool.scenes.iter().map(|scene| scene.id.as_str()).zip(prepared).collect();
        Ok(SuiteRunner { suite, scenes, realism: shipped_realism()? })
    }

    /// Returns the plant that simulates a case.
    pub fn plant(&self, case: &Case) -> Result<Plant, NoOutcome> {
        let scene = self.scenes.get(case.scene.as_str());
        let (Some(scene), Some(rules)) = (scene, self.suite.rules.get(case.rules)) else {
            return Err(format!("case {}: its scene or its rules are gone", case.id).into());
        };
        Ok(Plant::with_options(scene.clone(), rules)?)
    }

    /// One rollout, why it ended as it did, and what is said of its contact.
    pub fn drove(&self, case: &Case, source: &DriverSource<'_>) -> Result<Drove, NoOutcome> {
        let plant = self.plant(case)?;
        let (outcome, motion, timeline) = match source {
            DriverSource::Standing => rollout_explained(&plant, &case.intervention, &mut Stopped)?,
            DriverSource::Policy(ego, backends) => {
                backend(backends, case)?.explained(&plant, &case.intervention, ego, self.context(case))?
            }
        };
        let realism = case.program.map(|_| realism(&outcome, &self.realism).1);
        Ok(Drove { timeline, realism, ..self.judged(case, &plant, source, outcome, &motion)? })
    }

    /// Judges who is at fault for a contact, and who would have avoided it. A planner drove once: its motion is driven
    /// along again, which a car on springs does not allow.
    fn judged(
        &self,
        case: &Case,
        plant: &Plant,
        source: &DriverSource<'_>,
        outcome: Outcome,
        motion: &Trace,
    ) -> Result<Drove, NoOutcome> {
        let fault = fault_of(plant, &outcome, motion);
        let driver: Option<Box<dyn Driver>> = match source {
            DriverSource::Standing => Some(Box::new(Stopped)),
            DriverSource::Policy(Policy::Command(_), _) => (plant.options().plant.ego_car != EgoCar::Sprung)
                .then(|| Box::new(Retraced::of(motion, outcome.contact.as_ref())) as Box<dyn Driver>),
            DriverSource::Policy(ego, _) => Some(ego.driver()),
        };
        let jury = match driver {
            Some(mut driver) => jury(plant, &case.intervention, &mut *driver, &outcome)?,
            None => None,
        };
        Ok(Drove { outcome, timeline: None, realism: None, fault, jury })
    }

    /// One rollout with its motion; `driver` is who is named in its caption.
    pub fn played(&self, case: &Case, source: &DriverSource<'_>, driver: &str) -> Result<Played, NoOutcome> {
        let plant = self.plant(case)?;
        let (outcome, motion) = self.traced(case, &plant, source)?;
        Ok(Played {
            solution: SolutionId::new(format!("{} against {driver}", case.id)),
            scene: Scene::clone(plant.scene()),
            outcome,
            decision: None,
            commanded: commands(&plant, &case.intervention),
            intervention: case.intervention.clone(),
            motion,
        })
    }

    fn traced(&self, case: &Case, plant: &Plant, source: &DriverSource<'_>) -> Result<(Outcome, Trace), NoOutcome> {
        match source {
            DriverSource::Standing => {
                let (mut outcome, trace) = rollout_traced(plant, &case.intervention, &mut Stopped)?;
                assess(plant, &case.intervention, &mut Stopped, &mut outcome)?;
                Ok((outcome, trace))
            }
            DriverSource::Policy(ego, backends) => {
                backend(backends, case)?.traced(plant, &case.intervention, ego, self.context(case))
            }
        }
    }

    /// The suite's seed, and of which program a case is.
    pub fn context(&self, case: &Case) -> DriveContext {
        let under = self.suite.program(case).map_or(ProgramContext::Plain, under);
        DriveContext { seed: Seed(self.suite.seed), under }
    }
}

/// Realism as the shipped MetaDrive protocol scores it: one measure for the programs of all families.
pub fn shipped_realism() -> Result<RealismOptions, Failure> {
    match ProgramFile::published(&FamilyName::new("cat"))?.conditions.evaluation {
        EvaluationOptions::Metadrive(options) => Ok(options.realism),
        EvaluationOptions::Safebench { .. } => {
            Err(Failure::internal("the shipped protocol of recorded traffic is another one"))
        }
    }
}

/// Returns what a planner that is not blind is told of a program of a suite.
pub fn under(member: &Member) -> ProgramContext {
    ProgramContext::program(member.program, member.is_parent())
}

fn backend<'b, 'a>(backends: &'b [Backend<'a>], case: &Case) -> Result<&'b Backend<'a>, NoOutcome> {
    backends.get(case.rules).ok_or_else(|| format!("case {}: its rules are gone", case.id).into())
}

/// Refuses labels that come out differently from those that were frozen.
pub fn as_frozen(case: &Case, outcome: &Outcome) -> Result<(), Failure> {
    if case.label == *outcome {
        return Ok(());
    }
    let digest = |outcome: &Outcome| Digest::of("evodrive/suite-label/1", outcome).map_err(Failure::internal);
    let (frozen, found) = (digest(&case.label)?, digest(outcome)?);
    Err(Failure::divergence(format!(
        "case {}: expected the frozen label {} (trace {}), found {} (trace {}); the suite, this build or this machine's arithmetic is \
         another one: `evodrive --version`, and freeze the suite anew",
        case.id,
        frozen.short(16),
        case.label.trace.short(16),
        found.short(16),
        outcome.trace.short(16)
    )))
}
