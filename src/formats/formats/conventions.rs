//! Finds the convention of a file's headings and velocities. If a file contradicts itself as written, it is read in the one known
//! convention in which it does not, and this is noted; if no convention fits, the note names the option that decides.
//!
//! Ego and others have a convention each: nuPlan's tools give the ego's velocity in its own frame, and the others'
//! in the map's. Only samples on which conventions differ decide. Parked road users and people on foot, who may look
//! anywhere, decide nothing and follow the others.

use super::derived;
use super::import_error::shown;
use super::log::{LogTrack, Parts};
pub use super::read_as::{Conventions, ReadAs};
use crate::kernel::{Vec2, num};
use crate::scene::consistency::stretch::{JUDGED_MIN, MOVING_MIN_MPS, Stretch, share_between, stretches};
use crate::scene::consistency::{HEADING_LIMIT_DEG, VELOCITY_LIMIT, is_one_way};
use crate::scene::{AgentKind, LeftOut, Sample};

/// Share of the deciding samples that a convention must explain, and of all samples that it must fit. In a good file it
/// explains none.
const SURE: f64 = 0.9;
/// Least difference between readings of a heading that decide between conventions, degrees: an explained sample lies at
/// least half of it beside the written one, which does not happen in most samples of any recorded road user.
const HEADINGS_APART_DEG: f64 = HEADING_LIMIT_DEG;
/// Share by which ways must differ to decide. Less than for ways that only contradict each other, because an error along the way brings
/// no way nearer to another direction.
const VELOCITIES_APART: f64 = 0.15;
/// Largest deviation from the median, as a share, of velocities over motion that are in another unit or at other times.
const STEADY: f64 = 0.1;
const DEGREE: f64 = num::PI / 180.0;
const QUARTER: f64 = num::FRAC_PI_2;

/// A convention of headings: ours is `turn + sign * unit * theirs`.
#[derive(Debug)]
pub struct Heading {
    /// Name in `--headings`.
    pub name: &'static str,
    /// Meaning in words.
    pub meaning: &'static str,
    unit_rad: f64,
    sign: f64,
    turn_rad: f64,
    /// True if a file that fits is surely of this convention. A backward heading may also mean reverse driving.
    is_sure: bool,
}

const fn heading(name: &'static str, meaning: &'static str, unit_rad: f64, sign: f64, turn_rad: f64) -> Heading {
    Heading { name, meaning, unit_rad, sign, turn_rad, is_sure: turn_rad != num::PI }
}

/// The convention of a scene comes first. Of conventions that are equivalent the first is named.
pub const HEADINGS: [Heading; 12] = [
    heading("written", "counter-clockwise from +x, radians", 1.0, 1.0, 0.0),
    heading("degrees", "counter-clockwise from +x, degrees", DEGREE, 1.0, 0.0),
    heading("compass", "clockwise from north (+y)", 1.0, -1.0, QUARTER),
    heading("compass-degrees", "clockwise from north (+y), degrees", DEGREE, -1.0, QUARTER),
    heading("clockwise", "clockwise from +x", 1.0, -1.0, 0.0),
    heading("clockwise-degrees", "clockwise from +x, degrees", DEGREE, -1.0, 0.0),
    heading("from-north", "counter-clockwise from north (+y)", 1.0, 1.0, QUARTER),
    heading("from-north-degrees", "counter-clockwise from north (+y), degrees", DEGREE, 1.0, QUARTER),
    heading("from-south", "counter-clockwise from south (-y)", 1.0, 1.0, -QUARTER),
    heading("from-south-degrees", "counter-clockwise from south (-y), degrees", DEGREE, 1.0, -QUARTER),
    heading("backwards", "counter-clockwise from -x", 1.0, 1.0, num::PI),
    heading("backwards-degrees", "counter-clockwise from -x, degrees", DEGREE, 1.0, num::PI),
];

impl Heading {
    /// Returns `true` if its numbers are degrees.
    fn is_in_degrees(&self) -> bool {
        self.unit_rad < 1.0
    }

    /// Returns a heading of the file as ours, radians, not wrapped.
    pub fn ours(&self, theirs: f64) -> f64 {
        self.turn_rad + self.sign * self.unit_rad * theirs
    }
}

/// A convention of velocities.
#[derive(Debug)]
pub struct Velocity {
    /// Name in `--velocities`.
    pub name: &'static str,
    /// Meaning in words.
    pub meaning: &'static str,
    /// True if it is ahead and to the left, not along the map's axes.
    own_frame: bool,
    unit_mps: f64,
}

const KMH_IN_MPS: f64 = 1.0 / 3.6;
const MPH_IN_MPS: f64 = 0.44704;

const fn velocity(name: &'static str, meaning: &'static str, own_frame: bool, unit_mps: f64) -> Velocity {
    Velocity { name, meaning, own_frame, unit_mps }
}

/// The convention of a scene comes first.
pub const VELOCITIES: [Velocity; 6] = [
    velocity("written", "along the map's axes, m/s", false, 1.0),
    velocity("own-frame", "in each road user's own frame, ahead and to the left", true, 1.0),
    velocity("kmh", "km/h", false, KMH_IN_MPS),
    velocity("mph", "mph", false, MPH_IN_MPS),
    velocity("own-frame-kmh", "in each road user's own frame, km/h", true, KMH_IN_MPS),
    velocity("own-frame-mph", "in each road user's own frame, mph", true, MPH_IN_MPS),
];

impl Velocity {
    fn ours(&self, sample: &Sample) -> Vec2 {
        let along = if self.own_frame { sample.velocity.rotated(sample.heading_rad) } else { sample.velocity };
        along * self.unit_mps
    }

    /// Returns `true` if it is of each road user's own frame, and its unit, m/s.
    #[cfg(test)]
    pub fn parts(&self) -> (bool, f64) {
        (self.own_frame, self.unit_mps)
    }

    /// Returns a speed along the heading as ours, m/s.
    pub fn speed_mps(&self, theirs: f64) -> f64 {
        theirs * self.unit_mps
    }
}

/// A road user as a file has it.
#[derive(Clone, Copy)]
pub struct Given<'g> {
    /// Time of each sample, seconds, increasing. `[samples]`
    pub times_s: &'g [f64],
    /// Samples as written.
    pub samples: &'g [Option<Sample>],
    /// True if it heads where it goes; people on foot need not.
    pub looks_ahead: bool,
}

/// Evidence of the samples for each convention of a table; the first one is the written one.
struct Tally {
    /// Number of samples that are evidence.
    count: usize,
    each: Vec<Counts>,
}

#[derive(Clone, Default)]
struct Counts {
    fits: usize,
    /// Number of samples that it and the written one read differently, and of those that it explains.
    deciding: usize,
    explained: usize,
    /// Sum of all errors.
    error: f64,
}

/// Result for a field: indices in the table of conventions.
struct Finding {
    best: usize,
    /// Another convention that fits as well.
    rival: Option<usize>,
}

impl Tally {
    fn of(conventions: usize) -> Tally {
        Tally { count: 0, each: vec![Counts::default(); conventions] }
    }

    /// Adds a sample: by convention, its error and its distance from the written one, with the error that still fits and the
    /// distance that decides.
    fn add(&mut self, fits: f64, decides: f64, of: impl Fn(usize) -> (f64, f64)) {
        self.count += 1;
        for (ix, counts) in self.each.iter_mut().enumerate() {
            let (error, apart) = of(ix);
            counts.fits += usize::from(error <= fits);
            counts.deciding += usize::from(apart >= decides);
            counts.explained += usize::from(apart >= decides && error <= fits.min(0.5 * apart));
            counts.error += error;
        }
    }

    /// Returns `true` if a convention explains the file.
    fn explains(&self, ix: usize) -> bool {
        let counts = &self.each[ix];
        let most = |part: usize, of: usize| part as f64 >= SURE * of as f64;
        counts.deciding >= JUDGED_MIN && most(counts.explained, counts.deciding) && most(counts.fits, self.count)
    }

    /// Returns `true` if these samples do not exclude a convention.
    fn allows(&self, ix: usize) -> bool {
        let counts = &self.each[ix];
        counts.deciding < JUDGED_MIN || 2 * counts.explained >= counts.deciding
    }

    /// Returns the convention of these that explains the file best, if it is not the written one.
    fn finding(&self, among: impl Fn(usize) -> bool) -> Option<Finding> {
        let fitting: Vec<usize> = (1..self.each.len()).filter(|&ix| self.explains(ix) && among(ix)).collect();
        let error = |ix: usize| self.each[ix].error;
        // Errors of exact files are only rounding.
        let rounding = 1e-9 * self.count as f64;
        let best =
            fitting.iter().copied().reduce(|best, ix| if error(ix) < error(best) - rounding { ix } else { best })?;
        let rival = fitting.into_iter().find(|&ix| ix != best && error(ix) <= 1.5 * error(best) + rounding);
        Some(Finding { best, rival })
    }

    /// Returns, in words, the share of samples that decides for a convention.
    fn said(&self, ix: usize) -> String {
        let (counts, written) = (&self.each[ix], &self.each[0]);
        format!(
            "{} of the {} moving samples that decide fit that, and {} of all {} what is written",
            counts.explained, counts.deciding, written.fits, self.count
        )
    }

    /// Returns `true` if the written convention fits less than half of enough samples.
    fn contradicts(&self) -> bool {
        self.count >= JUDGED_MIN && 2 * self.each[0].fits < self.count
    }
}

fn headings_tally(tracks: &[Given<'_>]) -> Tally {
    let mut tally = Tally::of(HEADINGS.len());
    for track in tracks.iter().filter(|track| track.looks_ahead) {
        for stretch in stretches(track.times_s, track.samples, |_| Vec2::ZERO) {
            let heading = track.samples[stretch.middle].map(|sample| sample.heading_rad).filter(|rad| rad.is_finite());
            let Some(theirs) = heading.filter(|_| stretch.way_mps() >= MOVING_MIN_MPS) else { continue };
            tally.add(HEADING_LIMIT_DEG * DEGREE, HEADINGS_APART_DEG * DEGREE, |ix| {
                let ours = HEADINGS[ix].ours(theirs);
                (stretch.askew_rad(ours), num::wrap_angle(ours - theirs).abs())
            });
        }
    }
    tally
}

/// Returns `true` if no sample has a velocity: a moving road user then gets it from its places (`derived::fill`).
fn has_none(samples: &[Option<Sample>]) -> bool {
    samples.iter().flatten().all(|sample| sample.velocity == Vec2::ZERO)
}

/// Returns the evidence of the samples, and the way by velocities as written over that by places, of all road users that move.
fn velocities_tally(tracks: &[Given<'_>]) -> (Tally, f64) {
    let mut tally = Tally::of(VELOCITIES.len());
    let (mut by_velocity_m, mut way_m) = (0.0, 0.0);
    // Where the heading is NaN, an own frame is not known: such a sample does not fit, and stays beside the others.
    let own = |sample: &Sample| {
        let turned = sample.velocity.rotated(sample.heading_rad);
        if sample.velocity.is_finite() && !turned.is_finite() { Vec2::ZERO } else { turned }
    };
    for track in tracks.iter().filter(|track| !has_none(track.samples)) {
        let in_map = stretches(track.times_s, track.samples, |sample| sample.velocity);
        let in_own = stretches(track.times_s, track.samples, own);
        for (stretch, own) in in_map.iter().zip(&in_own).filter(|(stretch, _)| stretch.moves()) {
            // A velocity has the same length, turned or not.
            by_velocity_m += stretch.by_velocity.norm();
            way_m += stretch.way.norm();
            tally.add(VELOCITY_LIMIT, VELOCITIES_APART, |ix| {
                let of = &VELOCITIES[ix];
                let by_velocity = if of.own_frame { own.by_velocity } else { stretch.by_velocity } * of.unit_mps;
                (stretch.differs(by_velocity), share_between(by_velocity, stretch.by_velocity))
            });
        }
    }
    (tally, by_velocity_m / way_m)
}

/// The reading of a field of some road users.
#[derive(Debug, Default)]
pub struct Read {
    /// Index of the convention in its table; 0 for the written one.
    pub convention: usize,
    /// Note on it.
    pub note: Option<(String, String)>,
}

/// Returns how the headings of some road users are read: as written, or as found. `known` is the convention of the file's
/// others, which is theirs, too, without other evidence. `whose` names them.
pub fn read_headings(tracks: &[Given<'_>], whose: &str, known: usize) -> Read {
    let tally = headings_tally(tracks);
    if known > 0 && tally.explains(known) {
        return Read { convention: known, note: None };
    }
    let headings = || tracks.iter().flat_map(|track| track.samples.iter().flatten()).map(|sample| sample.heading_rad);
    let beyond = |turns: f64| headings().filter(|rad| rad.is_finite() && rad.abs() > turns * num::TAU).count();
    // Radians taken as degrees are so small that all of them would lie near to one axis.
    let may_be_degrees = beyond(1.0) > 0;
    let is_sure = |ix: usize| HEADINGS[ix].is_sure && (may_be_degrees || !HEADINGS[ix].is_in_degrees());
    if let Some(Finding { best, rival }) = tally.finding(is_sure) {
        let found = &HEADINGS[best];
        let rival = rival.map(|ix| &HEADINGS[ix]);
        let rival = rival.filter(|rival| tracks.iter().any(|track| differ_somewhere(track, found, rival)));
        let rival = rival.map_or(String::new(), |rival| {
            format!("; --headings {} fits them as well and turns others another way", rival.name)
        });
        let said = tally.said(best);
        let reason = format!(
            "those of {whose} read as {} ({}): {said}; --headings written keeps them{rival}",
            found.name, found.meaning
        );
        return Read { convention: best, note: Some((LeftOut::HEADINGS.into(), reason)) };
    }
    if known > 0 && tally.allows(known) {
        return Read { convention: known, note: None };
    }
    // Radians that were summed over a drive are a few turns at most.
    let beyond = beyond(2.0);
    let reason = if tally.contradicts() {
        let askew_deg = tally.each[0].error / tally.count as f64 / DEGREE;
        let (off, all) = (tally.count - tally.each[0].fits, tally.count);
        let fits = tally.finding(|_| true).map_or("no known convention fits".to_string(), |finding| {
            format!("--headings {} would fit, but that is not sure", HEADINGS[finding.best].name)
        });
        format!("{off} of {all} moving samples of {whose} go {askew_deg:.0} degrees beside them on average, and {fits}")
    } else if tally.count < JUDGED_MIN && beyond > 0 {
        format!("{beyond} of {whose} are greater than two turns, and nobody moves who would say in what unit they are")
    } else {
        return Read { convention: 0, note: None };
    };
    let reason =
        format!("{reason}; --headings motion turns all to where they go, --headings degrees reads them in degrees");
    Read { convention: 0, note: Some((LeftOut::HEADINGS_DOUBTFUL.into(), reason)) }
}

/// Returns `true` if two conventions give a road user headings that are not alike.
fn differ_somewhere(track: &Given<'_>, a: &Heading, b: &Heading) -> bool {
    let headings = track.samples.iter().flatten().map(|sample| sample.heading_rad).filter(|rad| rad.is_finite());
    headings.into_iter().any(|rad| num::wrap_angle(a.ours(rad) - b.ours(rad)).abs() > HEADING_LIMIT_DEG * DEGREE)
}

/// Returns how the velocities of some road users are read, whose headings are ours already; likewise.
pub fn read_velocities(tracks: &[Given<'_>], whose: &str, known: usize) -> Read {
    let (tally, pace) = velocities_tally(tracks);
    if known > 0 && tally.explains(known) {
        return Read { convention: known, note: None };
    }
    let is_paced = |ix: usize| {
        let unit_mps = VELOCITIES[ix].unit_mps;
        unit_mps == 1.0 || (pace * unit_mps - 1.0).abs() <= PACE_APART
    };
    if let Some(Finding { best, .. }) = tally.finding(is_paced) {
        let (Velocity { name, meaning, .. }, said) = (&VELOCITIES[best], tally.said(best));
        let reason = format!("those of {whose} read as {name} ({meaning}): {said}; --velocities written keeps them");
        return Read { convention: best, note: Some((LeftOut::VELOCITIES.into(), reason)) };
    }
    Read { convention: if tally.allows(known) { known } else { 0 }, note: None }
}

/// Largest difference between the pace of all and that of a unit with a name. Doubled times lie 11 % beside mph.
const PACE_APART: f64 = 0.06;

/// The fault in the velocities of one road user, in our convention.
pub enum Wrong {
    /// They have no relation to its places.
    Nothing,
    /// They are so many times its motion: sample times or unit are different.
    Times(f64),
}

/// Returns the fault if most velocities of one road user contradict its places.
pub fn wrong_velocities(track: &Given<'_>) -> Option<Wrong> {
    if has_none(track.samples) {
        return None;
    }
    let all = stretches(track.times_s, track.samples, |sample| sample.velocity);
    let moving: Vec<&Stretch> = all.iter().filter(|stretch| stretch.moves()).collect();
    let off = moving.iter().filter(|stretch| stretch.differs(stretch.by_velocity) > VELOCITY_LIMIT).count();
    if moving.len() < JUDGED_MIN || 2 * off <= moving.len() {
        return None;
    }
    let one_way = moving.iter().filter(|stretch| is_one_way(stretch.way, stretch.by_velocity));
    let times: Vec<f64> = one_way.map(|stretch| stretch.by_velocity.norm() / stretch.way.norm()).collect();
    let typical = num::quantile(&times, 0.5).unwrap_or(0.0);
    let steady = times.iter().filter(|of| (*of / typical - 1.0).abs() <= STEADY).count();
    Some(if steady as f64 >= SURE * moving.len() as f64 { Wrong::Times(typical) } else { Wrong::Nothing })
}

/// Names the road users whose velocities are a multiple of the motion other than one.
pub fn paced(of: &[(&str, f64)]) -> Option<(String, String)> {
    let (id, times) = of.first()?;
    let reason = format!(
        "{} road users move at another pace than their velocities say, e.g. track {}, whose velocities are {times:.3} times its \
         motion: sample times or units are other than read; --velocities places derives them, --step-s sets the seconds between \
         samples",
        of.len(),
        shown(id)
    );
    Some((LeftOut::VELOCITIES_DOUBTFUL.into(), reason))
}

/// Names the road users whose velocities were derived because they contradicted the places.
pub fn contradicting(of: &[&str]) -> Option<(String, String)> {
    let first = of.first()?;
    let reason = format!(
        "those of {} road users contradict their places in most samples, and no known convention fits; derived from their places; \
         --velocities written keeps them: e.g. track {}",
        of.len(),
        shown(first)
    );
    Some((LeftOut::VELOCITIES.into(), reason))
}

/// Reads the headings and velocities of a log's tracks.
pub(super) fn read(
    tracks: &mut [LogTrack],
    ego: usize,
    times_s: &[f64],
    conventions: Conventions,
    left_out: &mut Parts,
) {
    let Conventions { headings, velocities, .. } = conventions;
    let [of_ego, of_others] = match headings.named() {
        Some(ix) => [ix; 2],
        None => judged(tracks, ego, times_s, read_headings, left_out),
    };
    for (ix, track) in tracks.iter_mut().enumerate() {
        let convention = if ix == ego { of_ego } else { of_others };
        if headings == ReadAs::Derived {
            turn_to_motion(&mut track.samples, times_s);
        } else if convention > 0 {
            let convention = &HEADINGS[convention];
            track.samples.iter_mut().flatten().for_each(|s| s.heading_rad = convention.ours(s.heading_rad));
        }
    }
    let [of_ego, of_others] = match velocities.named() {
        Some(ix) => [ix; 2],
        None => judged(tracks, ego, times_s, read_velocities, left_out),
    };
    for (ix, track) in tracks.iter_mut().enumerate() {
        let convention = if ix == ego { of_ego } else { of_others };
        if velocities == ReadAs::Derived {
            derive_velocities(&mut track.samples, times_s);
        } else if convention > 0 {
            let convention = &VELOCITIES[convention];
            track.samples.iter_mut().flatten().for_each(|s| s.velocity = convention.ours(s));
        }
    }
    left_out.extend(said_by_option(conventions));
    if velocities != ReadAs::Judged {
        return;
    }
    let (mut derived, mut other_pace) = (Vec::new(), Vec::new());
    for track in tracks {
        match wrong_velocities(&given(track, times_s)) {
            Some(Wrong::Nothing) => {
                derive_velocities(&mut track.samples, times_s);
                derived.push(track.id.as_str());
            }
            Some(Wrong::Times(times)) => other_pace.push((track.id.as_str(), times)),
            None => {}
        }
    }
    left_out.extend(contradicting(&derived).into_iter().chain(paced(&other_pace)));
}

/// Lists the conventions that the user named.
pub fn said_by_option(conventions: Conventions) -> Parts {
    let heading = match conventions.headings {
        ReadAs::Known(ix) if ix > 0 => Some(format!("read as {} ({})", HEADINGS[ix].name, HEADINGS[ix].meaning)),
        ReadAs::Derived => Some("each looks where it goes; who never moves keeps his".to_string()),
        _ => None,
    };
    let velocity = match conventions.velocities {
        ReadAs::Known(ix) if ix > 0 => Some(format!("read as {} ({})", VELOCITIES[ix].name, VELOCITIES[ix].meaning)),
        ReadAs::Derived => Some("derived from places".to_string()),
        _ => None,
    };
    let heading = heading.map(|how| (LeftOut::HEADINGS.to_string(), format!("{how}, as --headings says")));
    let velocity = velocity.map(|how| (LeftOut::VELOCITIES.to_string(), format!("{how}, as --velocities says")));
    [heading, velocity].into_iter().flatten().collect()
}

/// Returns the conventions of the ego and of the others. One without evidence of its own gets that of the other; where
/// both are alike all are judged together.
fn judged(
    tracks: &[LogTrack],
    ego: usize,
    times_s: &[f64],
    read: fn(&[Given<'_>], &str, usize) -> Read,
    left_out: &mut Parts,
) -> [usize; 2] {
    let group = |belongs: fn(bool) -> bool| -> Vec<Given<'_>> {
        let of = tracks.iter().enumerate().filter(|(ix, _)| belongs(*ix == ego));
        of.map(|(_, track)| given(track, times_s)).collect()
    };
    let others = read(&group(|is_ego| !is_ego), "the others", 0);
    let own = read(&group(|is_ego| is_ego), "the ego", others.convention);
    let others = match own.convention {
        0 => others,
        of_ego if others.convention == 0 => read(&group(|is_ego| !is_ego), "the others", of_ego),
        _ => others,
    };
    let all = read(&group(|_| true), "all road users", 0);
    if own.convention == others.convention && (own.convention == 0 || own.convention == all.convention) {
        left_out.extend(all.note);
        return [all.convention; 2];
    }
    left_out.extend([own.note, others.note].into_iter().flatten());
    [own.convention, others.convention]
}

fn given<'g>(track: &'g LogTrack, times_s: &'g [f64]) -> Given<'g> {
    let looks_ahead = !matches!(track.kind, Ok(AgentKind::Pedestrian | AgentKind::Static));
    Given { times_s, samples: &track.samples, looks_ahead }
}

/// Sets headings to the direction of motion; a road user that never moves keeps its own.
fn turn_to_motion(samples: &mut [Option<Sample>], times_s: &[f64]) {
    let (known, times, places) = placed(samples, times_s);
    for (k, heading_rad) in known.into_iter().zip(derived::headings(&times, &places).unwrap_or_default()) {
        samples[k].iter_mut().for_each(|sample| sample.heading_rad = heading_rad);
    }
}

fn derive_velocities(samples: &mut [Option<Sample>], times_s: &[f64]) {
    let (known, times, places) = placed(samples, times_s);
    for (k, velocity) in known.into_iter().zip(derived::velocities(&times, &places)) {
        samples[k].iter_mut().for_each(|sample| sample.velocity = velocity);
    }
}

/// Returns the samples that have a place: their indices, times and places.
fn placed(samples: &[Option<Sample>], times_s: &[f64]) -> (Vec<usize>, Vec<f64>, Vec<Vec2>) {
    let known = samples.iter().enumerate().filter_map(|(k, sample)| Some((k, sample.as_ref()?.position)));
    let known: Vec<(usize, Vec2)> = known.filter(|(_, place)| place.is_finite()).collect();
    (
        known.iter().map(|(k, _)| *k).collect(),
        known.iter().map(|(k, _)| times_s[*k]).collect(),
        known.iter().map(|(_, place)| *place).collect(),
    )
}
