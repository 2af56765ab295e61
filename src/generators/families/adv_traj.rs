//! AT's port to SafeBench (`adv_trajectory`; Zhang et al. 2022): the scripted adversary of a traffic family steers at 100
//! points of a straight path, one a tick, each moved sideways by at most 1 to 3 m, found by black-box queries.
//!
//! Speeds of 30 and 10 in the port's controller are taken as km/h, where alone they make sense; family 3's leader
//! follows the points at 3 m/s. The search and the smoothing are those of AdvSim's stand-in here: the port ships
//! optimised sequences, we search; `published` starts from theirs.

use super::grammar::{integer, number};
use super::interface::own;
use super::profile_search::{self, Profiled, Setting};
use super::published::Port;
use super::staged;
use crate::adapters::Family;
use crate::kernel::Vec2;
use crate::motion::script_space::Perturbation;
use crate::scene::safebench::TrafficFamily;
use crate::scene::{AgentKind, TrackIx};
use crate::sim::{Phase, Script, Scripts, Speed, Until, Way};
use crate::stage::{Part, Settings, Source, Stage, StageError};

/// The family's name in programs, experiments and tables.
pub const NAME: &str = "adv_traj";
/// Motion operator: the space of lateral profiles.
pub const LATERAL_SEQUENCE: &str = "lateral_sequence";
/// Search operator: queries of whole scenarios.
pub const LATERAL_QUERIES: &str = "lateral_queries";
/// Search operator: the same from a sequence that the port publishes.
pub const SHIPPED_LATERALS: &str = "shipped_laterals";
const PREFIX: &str = "lateral_";

const SEARCH_IN_WORDS: &str = "The search plays at most 8 scenarios (`lateral_query_count`): 100 points of one scripted road user's \
     straight path, moved sideways by at most 1, 2 or 3 m (by traffic family, times `lateral_share`), first \
     random, then each time a changed stretch (half) of the best so far. The loss is the smallest distance in \
     metres, -10 on contact, which ends the search. A `lateral_loss` (smaller is better, always added) makes \
     it play all 8, steers it and chooses among contacts; 10 outweighs one. Filters act behind; there is no \
     `reshape`, no law. Example: `yaw_rate_radps_max * 2` takes the contact with less swerving.";

/// The family as it is registered: what it declares, and the code that carries it out.
pub fn source() -> Source {
    let family = family();
    let published = profile_search::published(&family, SHIPPED_LATERALS, PREFIX);
    let source = Source::new(family, SEARCH_IN_WORDS)
        .actor(staged::SCRIPTED_ACTOR, actor)
        .operator(LATERAL_SEQUENCE, motion)
        .operator(LATERAL_QUERIES, search)
        .operator(SHIPPED_LATERALS, shipped_search);
    Source { published: Some(published), ..source }
}

/// Contract and parent.
pub fn family() -> Family {
    let share = "largest sideways move over the port's bound of 3, 2 or 1 m; 1 as ported";
    let smoothing = "neighbouring numbers that are averaged; 1: none";
    let shift = "added to the port's trigger distance";
    let motion = vec![
        own("lateral_share", number(0.05, 1.0, "1"), share, 1.0),
        own("lateral_pace", number(0.3, 2.0, "1"), "target speed over the port's; 1 as ported", 1.0),
        own("lateral_smoothing", integer(1, 20, "1"), smoothing, 1.0),
        own("lateral_trigger_shift_m", number(-15.0, 15.0, "m"), shift, 0.0),
    ];
    profile_search::family(Profiled {
        name: NAME,
        title: "AT: adversarial trajectories (Zhang et al. 2022), SafeBench's port",
        describes: "Moves 100 points of a scripted road user's straight path sideways within a fixed bound and lets it \
                    steer at one point a tick. Each query simulates the scenario against the ego; contact ends the \
                    search, nearness guides it.",
        space: LATERAL_SEQUENCE,
        space_describes: "The scripted adversary steering at 100 points beside its straight path, one a tick.",
        motion,
        queries: LATERAL_QUERIES,
        shipped: SHIPPED_LATERALS,
        prefix: PREFIX,
        loss: "lateral_loss",
    })
}

/// Bound of a move sideways and length of the planned path, metres.
pub fn bounds_m(family: TrafficFamily) -> (f64, f64) {
    match family.number() {
        1 | 2 => (1.0, 20.0),
        3 | 4 => (2.0, 50.0),
        _ => (3.0, 100.0),
    }
}

/// Target speed, m/s.
fn target_mps(family: TrafficFamily) -> f64 {
    match family.number() {
        1 | 2 => 10.0 / 3.6,
        3 => 3.0,
        _ => 30.0 / 3.6,
    }
}

/// Returns `true` if the port puts its adversary on a bicycle where the benchmark has somebody on foot: in family 1, as its scripts run.
fn rides(stage: &Stage<'_>, family: TrafficFamily) -> bool {
    family == TrafficFamily::StraightObstacle && stage.situation.plant.options().scripts == Scripts::AsRun
}

/// The road user that the port brings along.
fn actor(stage: &Stage<'_>, settings: &Settings) -> Result<Vec<TrackIx>, StageError> {
    let family = stage.situation.scene.staging.as_ref().map(|staging| staging.family);
    match family.filter(|family| rides(stage, *family)) {
        Some(_) => Ok(vec![stage.situation.guest(AgentKind::Cyclist)]),
        None => staged::actor(stage, settings),
    }
}

/// Trigger distances of the port, metres.
pub fn trigger_m(family: TrafficFamily) -> f64 {
    [35.0, 17.0, 35.0, 45.0, 40.0, 50.0, 45.0, 40.0][family.number() - 1]
}

/// The scripted scenario with a lateral profile in place of its adversary's path.
pub fn motion(stage: &Stage<'_>, settings: &Settings, parts: &mut [Part]) -> Result<(), StageError> {
    profile_search::start(stage, parts, |family| {
        let trigger_m = (trigger_m(family) + settings.number("lateral_trigger_shift_m")?).max(0.0);
        let (bound_m, length_m) = bounds_m(family);
        let lead = (family == TrafficFamily::LaneChanging).then(|| Phase::straight(12.0, Until::Driven { m: 2.0 }));
        let perturbation = Perturbation::Lateral {
            amplitude_m: settings.number("lateral_share")? * bound_m,
            length_m,
            mps: settings.number("lateral_pace")? * target_mps(family),
            lead,
            smoothing: settings.count("lateral_smoothing")?,
        };
        let figures = vec![("trigger_m", trigger_m), ("oncoming_gap_m", 20.0)];
        Ok(Setting { figures, perturbation, on_bicycle: rides(stage, family) })
    })
}

/// The control sequence that a script plays in SafeBench's class: places across its straight path, from the bound on the left
/// (0) to the bound on the right (1), one a tick.
///
/// # Errors
/// Why it is none: another kind of script, another speed, or a point beyond the bound.
pub fn sequence(family: TrafficFamily, script: &Script) -> Result<Vec<f64>, String> {
    let Some(Phase { way: Way::Points { points }, speed: Speed::Constant { mps }, .. }) = script.phases.last() else {
        return Err("its script ends in no points to steer at".into());
    };
    if *mps != target_mps(family) {
        return Err(format!("it drives at {mps} m/s, SafeBench's class at {} m/s", target_mps(family)));
    }
    let (bound_m, _) = bounds_m(family);
    let right = -Vec2::from_heading(script.spawn.heading_rad).left();
    let across_m = points.iter().map(|point| (*point - script.spawn.position).dot(right));
    // A point is a sum of several products: what rounding adds beyond the bound is cut.
    let share = |across_m: f64| {
        let u = 0.5 * (across_m / bound_m + 1.0);
        if (u - u.clamp(0.0, 1.0)).abs() < 1e-9 { u.clamp(0.0, 1.0) } else { u }
    };
    profile_search::shares(across_m.map(share), |_, _| true).map_err(|u| {
        format!("it moves to {u} of the way from bound to bound, and SafeBench's sequences end at 0 and 1")
    })
}

/// Queries of lateral profiles.
pub fn search(stage: &Stage<'_>, settings: &Settings, parts: &mut [Part]) -> Result<(), StageError> {
    profile_search::search(stage, settings, PREFIX, None, parts)
}

/// The same from a published profile.
pub fn shipped_search(stage: &Stage<'_>, settings: &Settings, parts: &mut [Part]) -> Result<(), StageError> {
    profile_search::search(stage, settings, PREFIX, Some(Port::Trajectory), parts)
}
