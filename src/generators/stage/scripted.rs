//! Candidates of families whose adversaries wait for the ego: a whole scenario of triggered road users, simulated once
//! against the ego when it is proposed, as these methods' queries are. The adversary's simulated motion stands for the
//! candidate wherever trajectories are judged.

use std::sync::Arc;

use super::situation::Situation;
use crate::kernel::num;
use crate::motion::script_space::ScriptSpace;
use crate::motion::{Candidate, Scripted};
use crate::scene::Sample;
use crate::sim::{self, Action, ActorRef, Intervention};

/// Timing kind of such families: the whole run, because the scenario's own trigger decides when it begins.
pub const EGO_TRIGGER: &str = "ego_trigger";
/// Distance that counts if nobody came near, metres.
const FAR_M: f64 = 200.0;

/// Simulates a scenario whose action `adversary` is the one that a family perturbs. `None` where the simulator refuses
/// it, or the adversary has no motion from `from_step` on.
pub fn simulated(
    situation: &Situation,
    actions: Vec<Action>,
    adversary: usize,
    from_step: usize,
    space: Option<Arc<ScriptSpace>>,
) -> Option<Candidate> {
    let intervention = Intervention { actions };
    let mut driver = situation.policy.driver();
    let (outcome, trace) = sim::rollout_traced(&situation.plant, &intervention, driver.as_mut()).ok()?;
    let own = trace.actors.iter().find(|actor| actor.actor == ActorRef::Inserted(adversary))?;
    let before = from_step.saturating_sub(trace.from_step);
    let samples: Vec<Sample> = own.samples.iter().skip(before).map_while(|sample| *sample).collect();
    if samples.is_empty() {
        return None;
    }
    let scripted = Scripted {
        actions: intervention.actions,
        contact: outcome.contact.is_some_and(|contact| contact.adversary),
        distance_m_min: outcome.distance_m_min.and_then(num::stored).map_or(FAR_M, |d| d.min(FAR_M)),
        route_completion: outcome.route_completion,
        space,
    };
    Some(Candidate { scripted: Some(Arc::new(scripted)), ..Candidate::new(samples, 0.0) })
}
