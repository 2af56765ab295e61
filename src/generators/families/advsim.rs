//! AdvSim (Wang et al. 2021) as SafeBench ports it: the speed of a traffic family's scripted adversary at each of 100
//! ticks after its trigger, as a share of twice the standard speed, found by black-box queries; its path stays straight.
//!
//! The port ships the sequences that its authors optimised; here the search runs, and `published` starts from theirs. Where their first vector comes from
//! numpy's generator, ours comes from a named stream. Choices of ours: the (1+1) evolution strategy that changes stretches of
//! the profile, a small budget, and the moving mean over neighbouring numbers (`speed_smoothing`, 1 in the port: none).

use super::grammar::{integer, number};
use super::interface::own;
use super::profile_search::{self, Profiled, Setting};
use super::published::Port;
use super::staged;
use crate::adapters::Family;
use crate::motion::script_space::Perturbation;
use crate::scene::safebench::TrafficFamily;
use crate::sim::{Phase, Script, Speed, Until};
use crate::stage::{Part, Settings, Source, Stage, StageError};

/// The family's name in programs, experiments and tables.
pub const NAME: &str = "advsim";
/// Motion operator: the space of speed profiles.
pub const SPEED_SEQUENCE: &str = "speed_sequence";
/// Search operator: queries of whole scenarios.
pub const SPEED_QUERIES: &str = "speed_queries";
/// Search operator: the same from a sequence that the port publishes.
pub const SHIPPED_SPEEDS: &str = "shipped_speeds";
const PREFIX: &str = "speed_";

const SEARCH_IN_WORDS: &str = "The search plays at most 8 scenarios (`speed_query_count`): 100 target speeds, one each 0.1 s after the \
     trigger, of one scripted road user on a straight way, first random, then each time a changed stretch \
     (half) of the best so far. The loss is the smallest distance in metres, -10 on contact, which ends the \
     search. A `speed_loss` (smaller is better, always added) makes it play all 8, steers it and chooses among \
     contacts; 10 outweighs one. Speeds beyond `speed_ceiling` are never tried; filters act behind; there is \
     no `reshape`, no law. Example: `acceleration_mps2_max / 4` takes the gentler contact.";

/// The family as it is registered: what it declares, and the code that carries it out.
pub fn source() -> Source {
    let family = family();
    let published = profile_search::published(&family, SHIPPED_SPEEDS, PREFIX);
    let source = Source::new(family, SEARCH_IN_WORDS)
        .actor(staged::SCRIPTED_ACTOR, staged::actor)
        .operator(SPEED_SEQUENCE, motion)
        .operator(SPEED_QUERIES, search)
        .operator(SHIPPED_SPEEDS, shipped_search);
    Source { published: Some(published), ..source }
}

/// Contract and parent.
pub fn family() -> Family {
    let motion = vec![
        own("speed_ceiling", number(0.5, 3.0, "1"), "largest speed over the standard speed; 2 as ported", 2.0),
        own("speed_smoothing", integer(1, 20, "1"), "neighbouring numbers that are averaged; 1: none", 1.0),
        own("speed_trigger_shift_m", number(-15.0, 15.0, "m"), "added to the port's trigger distance", 0.0),
    ];
    profile_search::family(Profiled {
        name: NAME,
        title: "AdvSim (Wang et al. 2021), SafeBench's port",
        describes: "Searches the speed of a scripted road user at each of 100 ticks after its trigger. Its path is \
                    fixed. Each query simulates the scenario against the ego; contact ends the search, nearness guides \
                    it.",
        space: SPEED_SEQUENCE,
        space_describes: "The scripted adversary on its straight path with a target speed of its own for each of 100 ticks.",
        motion,
        queries: SPEED_QUERIES,
        shipped: SHIPPED_SPEEDS,
        prefix: PREFIX,
        loss: "speed_loss",
    })
}

/// Twice the standard speed is AdvSim's ceiling: the standard that the port means, m/s (its family 3 slows a leader).
fn standard_mps(family: TrafficFamily) -> f64 {
    [2.5, 10.0, 2.0, 8.0, 10.0, 12.0, 12.0, 10.0][family.number() - 1]
}

/// Trigger distances of the port, metres.
pub fn trigger_m(family: TrafficFamily) -> f64 {
    [20.0, 17.0, 35.0, 45.0, 35.0, 45.0, 35.0, 35.0][family.number() - 1]
}

/// The scripted scenario with a profile in place of its adversary's speed.
pub fn motion(stage: &Stage<'_>, settings: &Settings, parts: &mut [Part]) -> Result<(), StageError> {
    profile_search::start(stage, parts, |family| {
        let trigger_m = (trigger_m(family) + settings.number("speed_trigger_shift_m")?).max(0.0);
        // The leader drives as it is scripted until it begins to brake.
        let lead = (family == TrafficFamily::LaneChanging).then(|| Phase::straight(12.0, Until::Driven { m: 5.0 }));
        let mps_max = settings.number("speed_ceiling")? * standard_mps(family);
        let perturbation = Perturbation::Speeds { mps_max, lead, smoothing: settings.count("speed_smoothing")? };
        Ok(Setting { figures: vec![("trigger_m", trigger_m)], perturbation, on_bicycle: false })
    })
}

/// The control sequence that a script plays in SafeBench's class: shares of twice the standard speed, one a tick.
///
/// # Errors
/// Why it is none: another kind of script, or a speed above twice the standard.
pub fn sequence(family: TrafficFamily, script: &Script) -> Result<Vec<f64>, String> {
    let Some(Speed::Profile { mps }) = script.phases.last().map(|phase| &phase.speed) else {
        return Err("its script ends in no speed profile".into());
    };
    let mps_max = 2.0 * standard_mps(family);
    profile_search::shares(mps.iter().map(|mps| mps / mps_max), |u, k| u * mps_max == mps[k])
        .map_err(|u| format!("it asks for {u} of twice the standard speed, and SafeBench's sequences end at 1"))
}

/// Queries of speed profiles.
pub fn search(stage: &Stage<'_>, settings: &Settings, parts: &mut [Part]) -> Result<(), StageError> {
    profile_search::search(stage, settings, PREFIX, None, parts)
}

/// The same from a published profile.
pub fn shipped_search(stage: &Stage<'_>, settings: &Settings, parts: &mut [Part]) -> Result<(), StageError> {
    profile_search::search(stage, settings, PREFIX, Some(Port::AdvSim), parts)
}
