//! The settings of the lane-graph prior, as every family that draws from it declares them: the same eleven figures
//! under words of the family's own, so that none of them speaks another's private vocabulary.

use super::grammar::{integer, number};
use super::interface::{OwnParameter, own};
use crate::motion::motion_prior::{self, PriorOptions};
use crate::stage::{Part, Settings, Stage, StageError};

/// The prior's parameters with CAT's figures; each name begins with `prefix`.
pub fn parameters(prefix: &str) -> Vec<OwnParameter> {
    let named = |name: &str, domain, describes: &str, value| own(&format!("{prefix}{name}"), domain, describes, value);
    vec![
        named("candidate_count", integer(4, 64, "1"), "M, trajectories kept; 32 in CAT", 32.0),
        named("nms_radius_m", number(1.0, 15.0, "m"), "goal suppression radius at full speed; 7.2 in CAT", 7.2),
        named("goal_spacing_m", number(1.0, 8.0, "m"), "distance of goals along a centre line; 2 in the stand-in", 2.0),
        named("profile_step_mps2", number(0.5, 3.0, "m/s^2"), "step between constant-acceleration profiles", 1.0),
        named(
            "profile_levels",
            integer(1, 4, "1"),
            "profiles on each side of keeping the speed; 3 = +-1, +-2, +-3",
            3.0,
        ),
        named("speed_change_scale_mps", number(0.5, 8.0, "m/s"), "scale of the mean-speed term of the log-prior", 2.0),
        named("acceleration_scale_mps2", number(0.5, 8.0, "m/s^2"), "scale of the acceleration term", 3.0),
        named("lateral_scale_mps2", number(0.5, 8.0, "m/s^2"), "scale of the lateral acceleration term", 3.0),
        named("lane_offset_scale_m", number(0.3, 6.0, "m"), "scale of the deviation from the own lane", 1.5),
        named("lane_change_cost", number(0.0, 4.0, "1"), "log-prior cost of each lane change", 0.5),
        named("flatten_rank", integer(0, 63, "1"), "from this rank on all candidates weigh alike; 6 in CAT", 6.0),
    ]
}

/// Reads the prior's options from a node's settings.
pub fn options(settings: &Settings, prefix: &str) -> Result<PriorOptions, StageError> {
    let number = |name: &str| settings.number(&format!("{prefix}{name}"));
    let count = |name: &str| settings.count(&format!("{prefix}{name}"));
    Ok(PriorOptions {
        count: count("candidate_count")?,
        nms_radius_m: number("nms_radius_m")?,
        goal_spacing_m: number("goal_spacing_m")?,
        profile_step_mps2: number("profile_step_mps2")?,
        profile_levels: count("profile_levels")?,
        speed_change_scale_mps: number("speed_change_scale_mps")?,
        acceleration_scale_mps2: number("acceleration_scale_mps2")?,
        lateral_scale_mps2: number("lateral_scale_mps2")?,
        lane_offset_scale_m: number("lane_offset_scale_m")?,
        lane_change_cost: number("lane_change_cost")?,
        flatten_rank: count("flatten_rank")?,
    })
}

/// Gives every adversary the prior's candidates from its sample before its window.
pub fn propose(stage: &Stage<'_>, options: &PriorOptions, parts: &mut [Part]) {
    for part in parts {
        let track = &stage.situation.scene.tracks[part.actor];
        let Some(anchor) = part.window.from_step.checked_sub(1).and_then(|step| track.at(step)) else { continue };
        let mut stream = stage.stream("prior", part.actor);
        part.candidates =
            motion_prior::candidates(&stage.situation.lanes, anchor, part.window.steps, options, &mut stream);
    }
}
