//! Statistics of the traffic in a set of scenes, to compare one pool with another, for example generated with recorded
//! traffic.

use serde::{Deserialize, Serialize};

use super::types::{AgentKind, DT_S, Sample, Scene, Track};
use crate::kernel::{Pose, num};

/// A distribution in five figures.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    /// Number of values.
    pub count: usize,
    /// Arithmetic mean.
    pub mean: f64,
    /// 5 % quantile.
    pub p5: f64,
    /// Median.
    pub p50: f64,
    /// 95 % quantile.
    pub p95: f64,
}

impl Summary {
    /// Summary of the finite values; `None` if there are none.
    pub fn of(mut values: Vec<f64>) -> Option<Summary> {
        values.retain(|x| x.is_finite());
        let mean = num::mean(&values)?;
        values.sort_by(f64::total_cmp);
        let at = |q: f64| {
            let place = q * (values.len() - 1) as f64;
            let low = place.floor() as usize;
            let high = (low + 1).min(values.len() - 1);
            values[low] + (values[high] - values[low]) * (place - low as f64)
        };
        Some(Summary { count: values.len(), mean, p5: at(0.05), p50: at(0.5), p95: at(0.95) })
    }
}

/// Distributions over all scenes of a set. A `None` means that nothing of the kind was observed.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PoolStats {
    /// Number of scenes.
    pub scenes: usize,
    /// Road users per scene, the ego included.
    pub tracks: Option<Summary>,
    /// Motor vehicles per scene, the ego included.
    pub vehicles: Option<Summary>,
    /// Pedestrians per scene.
    pub pedestrians: Option<Summary>,
    /// Cyclists per scene.
    pub cyclists: Option<Summary>,
    /// Seconds that a road user is observed.
    pub observed_s: Option<Summary>,
    /// Metres that the ego travels over the scene.
    pub ego_travel_m: Option<Summary>,
    /// Motor vehicles that move (above 0.5 m/s), every sample.
    pub speed_mps: Option<Summary>,
    /// Share of samples of motor vehicles at which they stand, per scene.
    pub standing: Option<Summary>,
    /// Acceleration of moving vehicles, from differences of recorded speeds: noise of a recording counts too.
    pub acceleration_mps2: Option<Summary>,
    /// Jerk of moving vehicles, from differences of accelerations, m/s³.
    pub jerk_mps3: Option<Summary>,
    /// Absolute yaw rate of moving vehicles.
    pub yaw_rate_radps: Option<Summary>,
    /// Bumper-to-bumper distance to the vehicle ahead in the same lane, below [`GAP_M_MAX`], once a second.
    pub gap_m: Option<Summary>,
    /// That gap divided by the follower's speed.
    pub headway_s: Option<Summary>,
    /// Pairs of vehicles per scene that come from different ways and use the same place within
    /// [`CONFLICT_S_MAX`].
    pub conflicts: Option<Summary>,
    /// Seconds between the two of such a pair, at their closest (encroachment time at a place).
    pub encroachment_s: Option<Summary>,
}

/// Vehicles farther ahead do not count as followed, metres.
pub const GAP_M_MAX: f64 = 60.0;
/// Two uses of a place that lie farther apart than this are no conflict, seconds.
pub const CONFLICT_S_MAX: f64 = 3.0;
/// Two centres at most this far apart count as the same place, metres.
const SAME_PLACE_M: f64 = 2.5;
/// Two vehicles come from different ways if their directions differ by more than this, radians (about 20 degrees).
const OTHER_WAY_RAD: f64 = 0.35;
/// Slower than this is standing, m/s.
const STANDING_MPS: f64 = 0.5;
/// Conflicts are searched at every third sample.
const STRIDE: usize = 3;
const STEPS_PER_S: usize = 10;

/// The raw values behind [`PoolStats`], gathered scene by scene.
#[derive(Default)]
struct Gathered {
    tracks: Vec<f64>,
    vehicles: Vec<f64>,
    pedestrians: Vec<f64>,
    cyclists: Vec<f64>,
    observed: Vec<f64>,
    ego_travel: Vec<f64>,
    speed: Vec<f64>,
    standing: Vec<f64>,
    acceleration: Vec<f64>,
    jerk: Vec<f64>,
    yaw_rate: Vec<f64>,
    gap: Vec<f64>,
    headway: Vec<f64>,
    conflicts: Vec<f64>,
    encroachment: Vec<f64>,
}

impl PoolStats {
    /// Statistics of a set of scenes, taken in their order.
    pub fn of<'a>(scenes: impl IntoIterator<Item = &'a Scene>) -> PoolStats {
        let mut seen = Gathered::default();
        let mut count = 0;
        for scene in scenes {
            count += 1;
            seen.scene(scene);
        }
        PoolStats {
            scenes: count,
            tracks: Summary::of(seen.tracks),
            vehicles: Summary::of(seen.vehicles),
            pedestrians: Summary::of(seen.pedestrians),
            cyclists: Summary::of(seen.cyclists),
            observed_s: Summary::of(seen.observed),
            ego_travel_m: Summary::of(seen.ego_travel),
            speed_mps: Summary::of(seen.speed),
            standing: Summary::of(seen.standing),
            acceleration_mps2: Summary::of(seen.acceleration),
            jerk_mps3: Summary::of(seen.jerk),
            yaw_rate_radps: Summary::of(seen.yaw_rate),
            gap_m: Summary::of(seen.gap),
            headway_s: Summary::of(seen.headway),
            conflicts: Summary::of(seen.conflicts),
            encroachment_s: Summary::of(seen.encroachment),
        }
    }

    /// Name with unit and distribution of every figure, in a fixed order: the rows of a table of pools.
    pub fn rows(&self) -> [(&'static str, Option<Summary>); 15] {
        [
            ("tracks per scene", self.tracks),
            ("vehicles per scene", self.vehicles),
            ("pedestrians per scene", self.pedestrians),
            ("cyclists per scene", self.cyclists),
            ("observed (s)", self.observed_s),
            ("ego travel (m)", self.ego_travel_m),
            ("speed (m/s)", self.speed_mps),
            ("standing (share)", self.standing),
            ("acceleration (m/s2)", self.acceleration_mps2),
            ("jerk (m/s3)", self.jerk_mps3),
            ("|yaw rate| (rad/s)", self.yaw_rate_radps),
            ("gap (m)", self.gap_m),
            ("headway (s)", self.headway_s),
            ("conflicts per scene", self.conflicts),
            ("encroachment (s)", self.encroachment_s),
        ]
    }
}

impl Gathered {
    fn scene(&mut self, scene: &Scene) {
        let everyone: Vec<&Track> = scene.tracks.iter().chain([&scene.ego.track]).collect();
        let of = |kind: AgentKind| everyone.iter().filter(|t| t.kind == kind).count() as f64;
        self.tracks.push(everyone.len() as f64);
        self.vehicles.push(of(AgentKind::Vehicle));
        self.pedestrians.push(of(AgentKind::Pedestrian));
        self.cyclists.push(of(AgentKind::Cyclist));
        self.ego_travel.push(travel_m(&scene.ego.track));
        self.observed.extend(everyone.iter().map(|t| t.samples.iter().flatten().count() as f64 * DT_S));
        let vehicles: Vec<&Track> = everyone.iter().copied().filter(|t| t.kind == AgentKind::Vehicle).collect();
        let (mut standing, mut all) = (0, 0);
        for track in &vehicles {
            for sample in track.samples.iter().flatten() {
                all += 1;
                standing += usize::from(sample.speed_mps() <= STANDING_MPS);
            }
            self.motion(track);
        }
        if all > 0 {
            self.standing.push(f64::from(u32::try_from(standing).unwrap_or(u32::MAX)) / all as f64);
        }
        for step in (0..scene.steps).step_by(STEPS_PER_S) {
            self.gaps(&vehicles, step);
        }
        self.pairs(&vehicles);
    }

    fn motion(&mut self, track: &Track) {
        let mut before: Option<f64> = None;
        for pair in track.samples.windows(2) {
            let [Some(a), Some(b)] = pair else {
                before = None;
                continue;
            };
            if a.speed_mps() <= STANDING_MPS {
                before = None;
                continue;
            }
            let acceleration = (b.speed_mps() - a.speed_mps()) / DT_S;
            self.speed.push(a.speed_mps());
            self.acceleration.push(acceleration);
            self.yaw_rate.push((num::wrap_angle(b.heading_rad - a.heading_rad) / DT_S).abs());
            self.jerk.extend(before.map(|last| (acceleration - last) / DT_S));
            before = Some(acceleration);
        }
    }

    fn gaps(&mut self, vehicles: &[&Track], step: usize) {
        let present: Vec<(&Track, &Sample)> = vehicles.iter().filter_map(|t| Some((*t, t.at(step)?))).collect();
        for (me, mine) in &present {
            let here = Pose { position: mine.position, heading_rad: mine.heading_rad };
            let ahead = present.iter().filter_map(|(other, theirs)| {
                let there = here.to_local(theirs.position);
                let gap = there.x - 0.5 * (me.length_m + other.length_m);
                let same_way = num::wrap_angle(theirs.heading_rad - mine.heading_rad).abs() < OTHER_WAY_RAD;
                (there.x > 0.5 && there.y.abs() < 1.5 && same_way && gap < GAP_M_MAX).then_some(gap.max(0.0))
            });
            let Some(gap) = ahead.reduce(f64::min) else { continue };
            self.gap.push(gap);
            if mine.speed_mps() > 1.0 {
                self.headway.push(gap / mine.speed_mps());
            }
        }
    }

    fn pairs(&mut self, vehicles: &[&Track]) {
        let ways: Vec<Way> = vehicles.iter().filter_map(|t| Way::of(t)).collect();
        let before = self.encroachment.len();
        for (i, one) in ways.iter().enumerate() {
            self.encroachment.extend(ways[i + 1..].iter().filter_map(|other| one.encroachment_s(other)));
        }
        self.conflicts.push((self.encroachment.len() - before) as f64);
    }
}

fn travel_m(track: &Track) -> f64 {
    let seen: Vec<&Sample> = track.samples.iter().flatten().collect();
    num::sum(seen.windows(2).map(|pair| pair[0].position.distance(pair[1].position)))
}

/// Thinned samples of a moving vehicle with the rectangle around them.
struct Way {
    samples: Vec<(usize, Sample)>,
    low: [f64; 2],
    high: [f64; 2],
}

impl Way {
    fn of(track: &Track) -> Option<Way> {
        let thinned = track.samples.iter().enumerate().step_by(STRIDE);
        let samples: Vec<(usize, Sample)> =
            thinned.filter_map(|(k, s)| Some((k, (*s)?))).filter(|(_, s)| s.speed_mps() > STANDING_MPS).collect();
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for (_, s) in &samples {
            for (axis, value) in [s.position.x, s.position.y].into_iter().enumerate() {
                low[axis] = low[axis].min(value);
                high[axis] = high[axis].max(value);
            }
        }
        (!samples.is_empty()).then_some(Way { samples, low, high })
    }

    /// Seconds between the two at the same place, if they come from different ways; `None` if there is no conflict.
    fn encroachment_s(&self, other: &Way) -> Option<f64> {
        let apart = |axis: usize| {
            self.low[axis] > other.high[axis] + SAME_PLACE_M || other.low[axis] > self.high[axis] + SAME_PLACE_M
        };
        if apart(0) || apart(1) {
            return None;
        }
        let mut best: Option<usize> = None;
        for (i, a) in &self.samples {
            for (j, b) in &other.samples {
                if best.is_some_and(|known| i.abs_diff(*j) >= known)
                    || (a.position - b.position).norm_squared() > SAME_PLACE_M * SAME_PLACE_M
                {
                    continue;
                }
                let turn = num::wrap_angle(a.heading_rad - b.heading_rad).abs();
                // Vehicles of opposite directions in neighbouring lanes pass each other without conflict.
                if turn > OTHER_WAY_RAD && turn < num::PI - OTHER_WAY_RAD {
                    best = Some(i.abs_diff(*j));
                }
            }
        }
        best.map(|steps| steps as f64 * DT_S).filter(|seconds| *seconds <= CONFLICT_S_MAX)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernel::Vec2;
    use crate::scene::{Ego, Origin, Road};

    fn track(id: &str, start: Vec2, velocity: Vec2) -> Track {
        let sample = |k: usize| Sample {
            position: start + velocity * (k as f64 * DT_S),
            heading_rad: velocity.heading(),
            velocity,
        };
        let samples = (0..91).map(|k| Some(sample(k))).collect();
        Track { id: id.into(), kind: AgentKind::Vehicle, length_m: 4.0, width_m: 2.0, samples }
    }

    fn scene(tracks: Vec<Track>, ego: Track) -> Scene {
        let route = vec![Vec2::ZERO, Vec2::new(90.0, 0.0)];
        Scene {
            id: "test".into(),
            origin: Origin::default(),
            steps: 91,
            current_step: 10,
            road: Road::default(),
            tracks,
            ego: Ego { track: ego, start_step: 10, route, target_speed_mps: None },
            objects_of_interest: Vec::new(),
            lights: Vec::new(),
            stop_signs: Vec::new(),
            crosswalks: Vec::new(),
            staging: None,
        }
    }

    #[test]
    fn two_cars_behind_each_other_have_the_gap_and_headway_of_geometry() {
        let ego = track("ego", Vec2::ZERO, Vec2::new(10.0, 0.0));
        let ahead = track("a", Vec2::new(24.0, 0.0), Vec2::new(10.0, 0.0));
        let stats = PoolStats::of([&scene(vec![ahead], ego)]);
        assert!((stats.gap_m.unwrap().p50 - 20.0).abs() < 1e-9);
        assert!((stats.headway_s.unwrap().p50 - 2.0).abs() < 1e-9);
        assert_eq!(stats.conflicts.unwrap().mean, 0.0);
        assert!((stats.ego_travel_m.unwrap().mean - 90.0).abs() < 1e-9);
    }

    #[test]
    fn crossing_paths_are_one_conflict_with_their_time_apart() {
        let ego = track("ego", Vec2::new(-40.0, 0.0), Vec2::new(10.0, 0.0));
        let crossing = track("c", Vec2::new(0.0, -55.0), Vec2::new(0.0, 10.0));
        let stats = PoolStats::of([&scene(vec![crossing], ego)]);
        assert_eq!(stats.conflicts.unwrap().mean, 1.0);
        // 1.5 s apart at the crossing itself; the circle of the same place takes up to 0.36 s off, thinning some back.
        let apart = stats.encroachment_s.unwrap().p50;
        assert!((1.1..=1.5).contains(&apart), "{apart}");
    }

    #[test]
    fn a_summary_ignores_what_is_not_finite_and_knows_when_nothing_is_left() {
        assert_eq!(Summary::of(vec![f64::NAN]), None);
        let summary = Summary::of(vec![3.0, f64::INFINITY, 1.0, 2.0]).unwrap();
        assert_eq!((summary.count, summary.mean, summary.p50), (3, 2.0, 2.0));
    }
}
