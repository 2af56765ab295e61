//! Generated worlds: a road is built, individual drivers are simulated on it, and their motion is the log.
//!
//! Drivers follow by the Intelligent Driver Model, change lanes by MOBIL and enter junctions by lights, stop signs and
//! gap acceptance, so a log is dynamically consistent: no two road users overlap, and a driver could make every motion.
//! Equal options, seed and index give equal bits.

mod car;
mod curve;
mod driver;
mod families;
mod family_site;
mod interaction;
mod junction;
mod lane_change;
mod network;
mod node;
mod options;
mod record;
mod right_of_way;
mod road;
mod traffic;
mod variation;
mod walkers;
mod worlds;

#[cfg(test)]
mod tests;

pub use families::{FamilyOptions, family_member, family_scene};
pub use options::{Reject, SynthError, SynthOptions, WorldKind};
pub use variation::TrafficOptions;

use crate::kernel::Seed;
use crate::scene::{Ego, LaneIx, Light, Origin, Scene, StopSign};
use interaction::Pair;
use network::Network;
use record::Log;
use road::road;
use traffic::{Traffic, stream};

/// Generates the scene `synth/<kind>/<seed>/<index>`.
///
/// Sub-seeds are tried until one passes the filter of [`SynthOptions`]: the ego travels far enough and another vehicle
/// interacts with it; that vehicle becomes the scene's object of interest. A light belongs to the lane that ends at it.
/// Errors: an option out of range, or no scene within `attempts_max`.
pub fn generate(kind: WorldKind, seed: Seed, index: u32, options: &SynthOptions) -> Result<Scene, SynthError> {
    options.check()?;
    let id = format!("synth/{}/{}/{index}", kind.name(), seed.0);
    let variation = options.variation(kind, seed, index);
    let mut last = Reject::NoEgo;
    let may_follow =
        seed.stream(&["synth", kind.name(), &index.to_string(), "following"]).chance(options.following_share);
    for attempt in 0..options.attempts_max {
        let path = ["synth".to_string(), kind.name().to_string(), index.to_string(), attempt.to_string()];
        let net = worlds::lay_world(kind, options, variation, &mut stream(seed, &path, "world"));
        let mut traffic = Traffic::new(&net, kind, options, variation, seed, &path);
        let mut log = record::record(&mut traffic, options);
        let following = may_follow || 2 * attempt >= options.attempts_max;
        let chosen = interaction::choose(&log.tracks, options, following).and_then(|pair| {
            record::consistent(&log, options)?;
            Ok(pair)
        });
        match chosen {
            Ok(pair) => {
                let pair = variation.map_or(pair, |of| record::within(&mut log, pair, of.range_m));
                return Ok(assemble(id, kind, seed, index, options, &net, log, pair));
            }
            Err(reject) => last = reject,
        }
    }
    Err(SynthError::Filtered { id, attempts: options.attempts_max, last })
}

/// Generates `count` scenes, the kinds of the options in turn; scene `i` has index `i / number of kinds`.
///
/// Scenes are independent of each other, so a caller may as well map [`generate`] over its own threads; see
/// [`pool_member`].
pub fn pool(options: &SynthOptions, seed: Seed, count: usize) -> Result<Vec<Scene>, SynthError> {
    (0..count).map(|i| pool_member(options, seed, i)).collect()
}

/// Generates the scene at place `i` of a pool.
pub fn pool_member(options: &SynthOptions, seed: Seed, i: usize) -> Result<Scene, SynthError> {
    options.check()?;
    let (turn, place) = (i / options.kinds.len(), i % options.kinds.len());
    let kind = options.kinds[place];
    // A kind that stands in the list more than once comes as often in each turn.
    let of_kind = |list: &[WorldKind]| list.iter().filter(|of| **of == kind).count();
    let index = turn * of_kind(&options.kinds) + of_kind(&options.kinds[..place]);
    let index = u32::try_from(index).unwrap_or(u32::MAX);
    generate(kind, seed, index, options)
}

#[allow(clippy::too_many_arguments)]
fn assemble(
    id: String,
    kind: WorldKind,
    seed: Seed,
    index: u32,
    options: &SynthOptions,
    net: &Network,
    log: Log,
    pair: Pair,
) -> Scene {
    let Log { mut tracks, lights } = log;
    let ego = tracks.remove(pair.ego);
    let other = if pair.other > pair.ego { pair.other - 1 } else { pair.other };
    let mut route: Vec<crate::kernel::Vec2> = Vec::new();
    for sample in ego.samples.iter().flatten() {
        if route.last().is_none_or(|last| last.distance(sample.position) > 0.05) {
            route.push(sample.position);
        }
    }
    Scene {
        id,
        origin: Origin { format: format!("synth/{}", kind.name()), name: format!("{}/{index}", seed.0) },
        steps: options.steps,
        current_step: options.current_step,
        road: road(net),
        tracks,
        ego: Ego { track: ego, start_step: options.current_step, route, target_speed_mps: None },
        objects_of_interest: vec![other],
        lights: lights
            .into_iter()
            .map(|(lane, states)| Light { lane, stop_point: stop_point(net, lane), states })
            .collect(),
        stop_signs: stop_signs(net),
        crosswalks: walkers::polygons(net),
        staging: None,
    }
}

fn stop_point(net: &Network, lane: LaneIx) -> crate::kernel::Vec2 {
    let lane = &net.lanes[lane];
    lane.curve.at(lane.gate.map_or(lane.curve.length_m(), |gate| gate.stop_s)).position
}

fn stop_signs(net: &Network) -> Vec<StopSign> {
    let mut lanes: Vec<LaneIx> = net
        .nodes
        .iter()
        .flat_map(|node| &node.connectors)
        .filter(|connector| connector.stop_sign)
        .map(|connector| connector.origin)
        .collect();
    lanes.sort_unstable();
    lanes.dedup();
    lanes.into_iter().map(|lane| StopSign { position: stop_point(net, lane), lanes: vec![lane] }).collect()
}
