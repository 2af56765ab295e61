//! Records tracks from a running simulation, and checks the log.

use super::driver::Body;
use super::interaction::Pair;
use super::options::{Reject, SynthOptions};
use super::traffic::Traffic;
use super::walkers::walker_box_m;
use crate::kernel::{OrientedBox, num};
use crate::scene::{AgentKind, DT_S, LaneIx, LightState, Sample, Track};
use std::collections::BTreeMap;

/// The recorded states.
pub(super) struct Log {
    pub tracks: Vec<Track>,
    /// States of each lane that has a light.
    pub lights: BTreeMap<LaneIx, Vec<LightState>>,
}

/// Runs the warm-up, then records every sample.
pub(super) fn record(traffic: &mut Traffic, options: &SynthOptions) -> Log {
    for _ in 0..(options.warm_up_s / DT_S).round() as usize {
        traffic.step();
        forget(traffic);
    }
    let mut tracks: BTreeMap<(bool, usize), Track> = BTreeMap::new();
    let gates: Vec<LaneIx> = (0..traffic.net.lanes.len()).filter(|&l| traffic.net.signal_of(l).is_some()).collect();
    let mut lights: BTreeMap<LaneIx, Vec<LightState>> = gates.iter().map(|&l| (l, Vec::new())).collect();
    for step in 0..options.steps {
        for (lane, states) in &mut lights {
            states.extend(traffic.net.signal_of(*lane).map(|(signal, group)| signal.state(group, traffic.time_s).0));
        }
        observe(traffic, step, options.steps, &mut tracks);
        traffic.step();
    }
    Log { tracks: tracks.into_values().collect(), lights }
}

/// Drops road users that left before the recording began; nothing refers to them any more.
fn forget(traffic: &mut Traffic) {
    if traffic.cars.iter().any(|car| car.gone) {
        traffic.cars.retain(|car| !car.gone);
        traffic.index();
    }
    traffic.walkers.list.retain(|walker| !walker.gone);
}

fn observe(traffic: &Traffic, step: usize, steps: usize, tracks: &mut BTreeMap<(bool, usize), Track>) {
    let mut see = |on_foot: bool, number: usize, kind, (length_m, width_m), sample: Sample| {
        let id = format!("{}{number}", if on_foot { "p" } else { "v" });
        let new = || Track { id, kind, length_m, width_m, samples: vec![None; steps] };
        tracks.entry((on_foot, number)).or_insert_with(new).samples[step] = Some(stored(sample));
    };
    for car in traffic.cars.iter().filter(|car| !car.gone) {
        let kind = if car.driver.body == Body::Bicycle { AgentKind::Cyclist } else { AgentKind::Vehicle };
        see(false, car.number, kind, (car.driver.length_m, car.driver.width_m), car.sample(traffic.net));
    }
    for walker in traffic.walkers.list.iter().filter(|w| !w.gone) {
        see(true, walker.number, AgentKind::Pedestrian, walker_box_m(walker), walker.sample(traffic.net));
    }
}

/// Returns the sample without negative zeros.
fn stored(sample: Sample) -> Sample {
    let plain = |x: f64| num::stored(x).unwrap_or(0.0);
    let vector = |v: crate::kernel::Vec2| crate::kernel::Vec2::new(plain(v.x), plain(v.y));
    Sample {
        position: vector(sample.position),
        heading_rad: plain(sample.heading_rad),
        velocity: vector(sample.velocity),
    }
}

/// Keeps, of each road user but the pair, the part between the first and the last step at which it is within range of the ego, as a
/// recording car would; a road user that never is within range has no track.
pub(super) fn within(log: &mut Log, pair: Pair, range_m: f64) -> Pair {
    let ego = log.tracks[pair.ego].clone();
    for (_, track) in log.tracks.iter_mut().enumerate().filter(|(at, _)| *at != pair.ego && *at != pair.other) {
        let is_near = |(of, ego): (&Option<Sample>, &Option<Sample>)| matches!((of, ego), (Some(of), Some(ego)) if of.position.distance(ego.position) <= range_m);
        let near: Vec<bool> = track.samples.iter().zip(&ego.samples).map(is_near).collect();
        let span = near.iter().position(|is| *is).zip(near.iter().rposition(|is| *is));
        let outside = |step: usize| span.is_none_or(|(first, last)| step < first || step > last);
        track.samples.iter_mut().enumerate().filter(|(step, _)| outside(*step)).for_each(|(_, sample)| *sample = None);
    }
    let is_there = |track: &Track| track.samples.iter().any(Option::is_some);
    let place = |at: usize| log.tracks[..at].iter().filter(|track| is_there(track)).count();
    let (ego, other) = (place(pair.ego), place(pair.other));
    log.tracks.retain(is_there);
    Pair { ego, other, ..pair }
}

/// Accelerations beyond these do not come from a driver, m/s².
pub(super) const ACCELERATION_MPS2: (f64, f64) = (-7.5, 3.5);
/// No road user turns faster than this while driving, rad/s.
pub(super) const YAW_RATE_RADPS_MAX: f64 = 1.0;
/// Largest lateral acceleration, m/s². Checked only where traffic varies, since the first version never checked it.
const SIDEWAYS_MPS2_MAX: f64 = 5.0;

/// Checks that the log could have happened: no two boxes overlap, no motion is out of bounds.
pub(super) fn consistent(log: &Log, options: &SynthOptions) -> Result<(), Reject> {
    let sideways_mps2_max = if options.traffic.is_some() { SIDEWAYS_MPS2_MAX } else { f64::INFINITY };
    if log.tracks.iter().any(|track| !plausible(track, sideways_mps2_max)) {
        return Err(Reject::Motion);
    }
    if (0..options.steps).any(|step| overlap_at(&log.tracks, step).is_some()) {
        return Err(Reject::Overlap);
    }
    Ok(())
}

fn plausible(track: &Track, sideways_mps2_max: f64) -> bool {
    track.samples.windows(2).all(|pair| {
        let [Some(a), Some(b)] = pair else { return true };
        let acceleration = (b.speed_mps() - a.speed_mps()) / DT_S;
        let yaw_rate = num::wrap_angle(b.heading_rad - a.heading_rad) / DT_S;
        acceleration >= ACCELERATION_MPS2.0
            && acceleration <= ACCELERATION_MPS2.1
            && yaw_rate.abs() <= YAW_RATE_RADPS_MAX
            && (yaw_rate * a.speed_mps()).abs() <= sideways_mps2_max
    })
}

/// Returns two road users, one of them on wheels, whose boxes overlap at a step.
pub(super) fn overlap_at(tracks: &[Track], step: usize) -> Option<(usize, usize)> {
    let mut present: Vec<(f64, usize, OrientedBox)> = Vec::new();
    for (i, track) in tracks.iter().enumerate() {
        if let Some(s) = track.at(step) {
            let shape = OrientedBox::new(s.position, s.heading_rad, track.length_m, track.width_m);
            present.push((s.position.x, i, shape));
        }
    }
    present.sort_by(|a, b| a.0.total_cmp(&b.0));
    for (k, (x, i, one)) in present.iter().enumerate() {
        for (other_x, j, other) in &present[k + 1..] {
            if other_x - x > 14.0 {
                break;
            }
            let on_foot = |t: usize| tracks[t].kind == AgentKind::Pedestrian;
            if !(on_foot(*i) && on_foot(*j)) && one.overlaps(other) {
                return Some((*i, *j));
            }
        }
    }
    None
}
