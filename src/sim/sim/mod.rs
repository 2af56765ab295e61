//! The seeded 2-D closed-loop simulator: what happens when an intervention meets the ego.

mod accounts;
mod encounters;
mod prepared;
mod road_users;
mod rollouts;
pub mod timeline_text;

pub use accounts::{
    ACTED_M, ActorConduct, ActorTrace, AdversaryReport, Contact, Driving, End, Feasibility, Motion, OfKind, OfPlace,
    Outcome, Trace, WithRecording, driving, feasibility, outcome, smooth,
};
pub use encounters::{
    Chance, ContactClass, Fault, Jury, Manoeuvre, Reacted, Reaction, Side, Striker, Timeline, assess, avoided_in_words,
    fault, gaps, jury, lateness_s, meeting,
};
pub use prepared::{
    Along, AvoidanceOptions, EgoBox, EgoCar, FollowerStart, Forecast, Obstacle, Path, Plant, PlantOptions,
    ReactiveTraffic, Scripts, SimError, SimulatorOptions, SimulatorOptionsError, Size, TrafficBoxes, body, drivable,
    error, options, path, plant, plant_options,
};
pub use road_users::{
    Action, ActorRef, Control, Driver, EgoState, Intervention, Law, Observed, Phase, Script, Seen, Speed, Trigger,
    Until, View, Way, bicycle, driver, idm, intervention, law, script, skills,
};
pub use rollouts::{
    Agent, ContactBoxes, Episode, Held, Part, Pose, Repeated, ReportedActor, ReportedContact, ReportedError,
    ReportedRollout, Retraced, RolloutCost, SharedScene, Undriven, adversaries_of, commands, contact_within, ending,
    fault_of, judge, reported, reported_timeline, retraced, rollout, rollout_assessed, rollout_counted,
    rollout_explained, rollout_in_parts, rollout_traced, tell,
};

/// Part of every rollout key; rises when any outcome can change.
pub const SIM_VERSION: u32 = 3;

#[cfg(any(test, feature = "fixtures"))]
pub mod scenes;
