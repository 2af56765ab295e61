//! The rules of a valid scene, and a check that names every rule that a scene breaks. It repairs nothing.

use std::collections::BTreeSet;
use std::fmt;

use super::safebench::{SPAWNS_MAX, SpawnFrame};
use super::types::{Lane, LaneIx, Scene, Track};
use crate::kernel::Vec2;

/// Samples of the longest scene: two minutes.
pub const STEPS_MAX: usize = 1200;
/// Local frame: nothing lies farther from its origin on either axis, metres.
pub const COORDINATE_MAX_M: f64 = 100_000.0;
/// Nothing in traffic is faster, m/s.
pub const SPEED_MAX_MPS: f64 = 100.0;
/// Longest way of a track and longest route, metres. Nobody drives farther in two minutes, and a search along a way
/// stays bounded.
pub const WAY_MAX_M: f64 = 20_000.0;
/// Longest way of all tracks of a scene together, metres.
pub const WAYS_MAX_M: f64 = 5_000_000.0;
/// Longest side of a bounding box, metres: a road train. The shortest is that of a traffic cone seen from above.
pub const SIDE_MAX_M: f64 = 60.0;
/// Shortest side of a bounding box, metres.
pub const SIDE_MIN_M: f64 = 0.05;

/// Most lanes that a lane leads into, or that lead into it.
pub const LINKS_MAX: usize = 64;

/// Most violations of a scene that are listed one by one.
pub const VIOLATIONS_MAX: usize = 1000;

/// One broken rule: its name, the place, what was found there, and what was expected.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Violation {
    /// Stable name, such as `samples_match_steps`.
    pub rule: &'static str,
    /// Such as `tracks[3] "veh7"`.
    pub place: String,
    /// Value found there.
    pub found: String,
    /// Value that was expected.
    pub expected: String,
}

impl fmt::Display for Violation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}: found {}, expected {}", self.rule, self.place, self.found, self.expected)
    }
}

impl Scene {
    /// Every rule the scene breaks, in the order of its fields; empty for a valid scene. If there are more than
    /// [`VIOLATIONS_MAX`], one last entry says how many.
    pub fn validate(&self) -> Vec<Violation> {
        let mut check = Check { violations: Vec::new(), more: 0 };
        check.header(self);
        check.lanes(self);
        for (ix, edge) in self.road.edges.iter().enumerate() {
            check.line(|| format!("road.edges[{ix}]"), edge, 2);
        }
        check.tracks(self);
        check.ego(self);
        check.furniture(self);
        if check.more > 0 {
            let found = format!("{} violations", check.more + VIOLATIONS_MAX);
            let (rule, expected) = ("and_more", format!("none; the first {VIOLATIONS_MAX} are told"));
            check.violations.push(Violation { rule, place: "the scene".into(), found, expected });
        }
        check.violations
    }
}

/// Returns the number of broken rules in words: a number, or that there are more than are listed.
pub fn how_many(violations: &[Violation]) -> String {
    match violations.len() {
        count @ ..=VIOLATIONS_MAX => count.to_string(),
        _ => format!("more than {VIOLATIONS_MAX}"),
    }
}

struct Check {
    violations: Vec<Violation>,
    /// Number of violations beyond the listed ones.
    more: usize,
}

impl Check {
    fn that(&mut self, holds: bool, rule: &'static str, place: impl FnOnce() -> String, found: String, expected: &str) {
        if !holds && self.violations.len() >= VIOLATIONS_MAX {
            self.more += 1;
        } else if !holds {
            self.violations.push(Violation { rule, place: place(), found, expected: expected.to_string() });
        }
    }

    fn header(&mut self, scene: &Scene) {
        let at = |name: &'static str| move || name.to_string();
        self.that(!scene.id.trim().is_empty(), "scene_has_id", at("id"), format!("{:?}", scene.id), "a name");
        let steps = scene.steps;
        self.that(
            (2..=STEPS_MAX).contains(&steps),
            "steps_in_range",
            at("steps"),
            steps.to_string(),
            "2 to 1200 samples",
        );
        let current = scene.current_step;
        self.that(
            current < steps,
            "current_step_in_range",
            at("current_step"),
            current.to_string(),
            &format!("below steps = {steps}"),
        );
    }

    /// At least `least` finite, bounded points.
    fn line(&mut self, place: impl Fn() -> String, points: &[Vec2], least: usize) {
        let count = points.len();
        self.that(count >= least, "line_has_points", &place, format!("{count} points"), &format!("at least {least}"));
        let bad = points.iter().position(|p| !on_the_map(*p));
        if let Some(ix) = bad {
            let found = format!("point {ix} = {:?}", points[ix]);
            self.that(false, "points_are_finite_and_near", &place, found, "coordinates within 100 km of the origin");
        }
    }

    fn lanes(&mut self, scene: &Scene) {
        let lanes = &scene.road.lanes;
        let mut ids = BTreeSet::new();
        let crowded = lanes.iter().position(|lane| lane.exits.len().max(lane.entries.len()) > LINKS_MAX);
        if let Some(ix) = crowded {
            let found = format!("{} exits, {} entries", lanes[ix].exits.len(), lanes[ix].entries.len());
            self.that(false, "lane_links_are_few", || format!("road.lanes[{ix}]"), found, "at most 64 of each");
        }
        for (ix, lane) in lanes.iter().enumerate() {
            let place = || format!("road.lanes[{ix}] {:?}", lane.id);
            self.that(ids.insert(&lane.id), "lane_ids_are_unique", place, lane.id.clone(), "an id of its own");
            self.lane_lines(place, lane);
            // Checking links both ways takes time with the square of their number.
            if crowded.is_none() {
                self.lane_topology(place, ix, lanes);
            }
            if let Some(limit) = lane.speed_limit_mps {
                let sound = limit > 0.0 && limit <= SPEED_MAX_MPS;
                self.that(sound, "speed_limit_is_plausible", place, format!("{limit}"), "above 0, at most 100 m/s");
            }
        }
    }

    fn lane_lines(&mut self, place: impl Fn() -> String, lane: &Lane) {
        for line in [&lane.centre, &lane.left, &lane.right] {
            self.line(&place, line, 2);
        }
        let counts = (lane.centre.len(), lane.left.len(), lane.right.len());
        self.that(
            counts.0 == counts.1 && counts.0 == counts.2,
            "lane_lines_have_equal_counts",
            &place,
            format!("{counts:?} points"),
            "as many left and right as centre points",
        );
        let length: f64 = lane.centre.windows(2).map(|w| w[0].distance(w[1])).fold(0.0, |sum, d| sum + d);
        self.that(length > 1e-6, "lane_has_length", &place, format!("{length} m"), "a centre line of some length");
    }

    fn lane_topology(&mut self, place: impl Fn() -> String, ix: LaneIx, lanes: &[Lane]) {
        let lane = &lanes[ix];
        let links = lane.exits.iter().map(|&to| ("exit", to)).chain(lane.entries.iter().map(|&from| ("entry", from)));
        for (what, other) in links {
            let Some(there) = lanes.get(other) else {
                self.that(false, "lane_links_exist", &place, format!("{what} {other}"), "the index of a lane");
                continue;
            };
            self.that(other != ix, "no_lane_leads_into_itself", &place, format!("{what} {other}"), "another lane");
            let back = if what == "exit" { &there.entries } else { &there.exits };
            let expected = "the other lane to name this one in return";
            self.that(back.contains(&ix), "lane_links_are_mutual", &place, format!("{what} {other}"), expected);
        }
        let (left, right) = (lane.left_neighbours.iter(), lane.right_neighbours.iter());
        for (side, neighbour) in left.map(|n| ("left", n)).chain(right.map(|n| ("right", n))) {
            let sound = neighbour.lane < lanes.len() && neighbour.lane != ix;
            let found = format!("{side} neighbour {}", neighbour.lane);
            self.that(sound, "neighbours_exist", &place, found, "the index of another lane");
        }
    }

    fn tracks(&mut self, scene: &Scene) {
        let mut ids = BTreeSet::new();
        ids.insert(scene.ego.track.id.as_str());
        for (ix, track) in scene.tracks.iter().enumerate() {
            let place = || format!("tracks[{ix}] {:?}", track.id);
            self.that(ids.insert(&track.id), "track_ids_are_unique", place, track.id.clone(), "an id of its own");
            self.track(place, track, scene.steps);
            let seen = track.span().is_some();
            self.that(seen, "track_is_observed", place, "no sample".into(), "at least one sample");
        }
        let ways_m = scene.tracks.iter().map(way_m).fold(0.0, |sum, way_m| sum + way_m);
        // A value that is not finite already broke another rule.
        let sound = !(ways_m > WAYS_MAX_M && ways_m.is_finite());
        self.that(sound, "ways_are_plausible", || "tracks".into(), format!("{ways_m:.0} m in all"), "at most 5000 km");
    }

    fn track(&mut self, place: impl Fn() -> String, track: &Track, steps: usize) {
        let count = track.samples.len();
        self.that(
            count == steps,
            "samples_match_steps",
            &place,
            format!("{count} samples"),
            &format!("steps = {steps}"),
        );
        for (side, value) in [("length", track.length_m), ("width", track.width_m)] {
            let sound = (SIDE_MIN_M..=SIDE_MAX_M).contains(&value);
            self.that(sound, "box_is_plausible", &place, format!("{side} {value} m"), "0.05 to 60 m");
        }
        for (step, sample) in track.samples.iter().enumerate() {
            let Some(sample) = sample else { continue };
            let finite = on_the_map(sample.position) && sample.heading_rad.is_finite() && sample.velocity.is_finite();
            let found = || format!("step {step}: {sample:?}");
            if !finite {
                self.that(false, "samples_are_finite", &place, found(), "finite values within 100 km of the origin");
            } else if sample.speed_mps() > SPEED_MAX_MPS {
                self.that(false, "speed_is_plausible", &place, found(), "at most 100 m/s");
            }
        }
        let way_m = way_m(track);
        let sound = !(way_m > WAY_MAX_M && way_m.is_finite());
        self.that(sound, "way_is_plausible", &place, format!("a way of {way_m:.0} m"), "at most 20 km");
    }

    fn ego(&mut self, scene: &Scene) {
        let ego = &scene.ego;
        let place = || format!("ego {:?}", ego.track.id);
        self.track(place, &ego.track, scene.steps);
        let start = ego.start_step;
        let present = ego.track.at(start).is_some();
        self.that(present, "ego_is_there_at_its_start", place, format!("start_step {start}"), "a sample at that step");
        self.that(
            start < scene.steps,
            "ego_start_in_range",
            place,
            format!("start_step {start}"),
            "a step of the scene",
        );
        self.line(|| "ego.route".into(), &ego.route, 2);
        let route_m = ego.route.windows(2).map(|w| w[0].distance(w[1])).fold(0.0, |sum, d| sum + d);
        let sound = !(route_m > WAY_MAX_M && route_m.is_finite());
        self.that(sound, "route_is_plausible", || "ego.route".into(), format!("{route_m:.0} m"), "at most 20 km");
        let distinct = ego.route.windows(2).any(|w| w[0].distance(w[1]) > 1e-6);
        let found = format!("{} points in one place", ego.route.len());
        self.that(distinct, "route_has_length", || "ego.route".into(), found, "two points that differ");
        if let Some(speed) = ego.target_speed_mps {
            let sound = (0.0..=SPEED_MAX_MPS).contains(&speed);
            self.that(sound, "target_speed_is_plausible", place, format!("{speed}"), "0 to 100 m/s");
        }
    }

    fn furniture(&mut self, scene: &Scene) {
        let lanes = scene.road.lanes.len();
        for &ix in &scene.objects_of_interest {
            let sound = ix < scene.tracks.len();
            self.that(
                sound,
                "objects_of_interest_exist",
                || "objects_of_interest".into(),
                ix.to_string(),
                "a track's index",
            );
        }
        for (ix, light) in scene.lights.iter().enumerate() {
            let place = || format!("lights[{ix}]");
            self.that(light.lane < lanes, "light_lane_exists", place, light.lane.to_string(), "the index of a lane");
            let count = light.states.len();
            let expected = format!("steps = {}", scene.steps);
            self.that(count == scene.steps, "light_states_match_steps", place, format!("{count} states"), &expected);
            self.line(place, &[light.stop_point], 1);
        }
        for (ix, sign) in scene.stop_signs.iter().enumerate() {
            let place = || format!("stop_signs[{ix}]");
            self.line(place, &[sign.position], 1);
            let bad = sign.lanes.iter().find(|&&lane| lane >= lanes);
            self.that(bad.is_none(), "stop_sign_lanes_exist", place, format!("{bad:?}"), "indices of lanes");
        }
        for (ix, crosswalk) in scene.crosswalks.iter().enumerate() {
            self.line(|| format!("crosswalks[{ix}]"), crosswalk, 3);
        }
        let Some(staging) = &scene.staging else { return };
        let place = || "staging".to_string();
        self.line(place, &[staging.trigger.position], 1);
        let count = staging.spawns.len();
        self.that(count <= SPAWNS_MAX, "spawns_are_few", place, format!("{count} spawns"), "at most 16");
        let finite = |f: &&SpawnFrame| !(on_the_map(Vec2::new(f.fwd_m, f.right_m)) && f.yaw_rad.is_finite());
        let bad = staging.spawns.iter().find(finite);
        let turned = staging.trigger.heading_rad.is_finite() && bad.is_none();
        self.that(turned, "frames_are_finite", place, format!("{bad:?}"), "finite headings and offsets");
    }
}

/// Returns the way from sample to sample, over gaps too, metres.
fn way_m(track: &Track) -> f64 {
    let mut last: Option<Vec2> = None;
    let mut way_m = 0.0;
    for sample in track.samples.iter().flatten() {
        way_m += last.map_or(0.0, |last| last.distance(sample.position));
        last = Some(sample.position);
    }
    way_m
}

fn on_the_map(point: Vec2) -> bool {
    point.is_finite() && point.x.abs() <= COORDINATE_MAX_M && point.y.abs() <= COORDINATE_MAX_M
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::fixture::two_lane_scene;
    use crate::scene::{Light, LightState, Neighbour, Sample};

    /// The names of the rules that a change breaks.
    fn broken_by(change: impl FnOnce(&mut Scene)) -> Vec<&'static str> {
        let mut scene = two_lane_scene();
        change(&mut scene);
        let mut rules: Vec<_> = scene.validate().into_iter().map(|v| v.rule).collect();
        rules.dedup();
        rules
    }

    #[test]
    fn a_sound_scene_breaks_no_rule() {
        assert_eq!(two_lane_scene().validate(), vec![]);
    }

    #[test]
    fn each_broken_rule_is_named() {
        assert_eq!(broken_by(|s| s.id.clear()), ["scene_has_id"]);
        assert_eq!(broken_by(|s| s.current_step = 999), ["current_step_in_range"]);
        assert_eq!(broken_by(|s| s.tracks[0].samples.truncate(3)), ["samples_match_steps"]);
        assert_eq!(broken_by(|s| s.tracks[1].id = s.tracks[0].id.clone()), ["track_ids_are_unique"]);
        assert_eq!(broken_by(|s| s.tracks[0].width_m = 0.0), ["box_is_plausible"]);
        assert_eq!(broken_by(|s| s.tracks[0].samples.fill(None)), ["track_is_observed"]);
        assert_eq!(broken_by(|s| s.ego.track.samples[0] = None), ["ego_is_there_at_its_start"]);
        assert_eq!(broken_by(|s| s.ego.route = vec![Vec2::ZERO; 2]), ["route_has_length"]);
        let far = |k: usize| Vec2::new(if k.is_multiple_of(2) { 0.0 } else { 9e3 }, 0.0);
        let jump = |t: &mut Track| t.samples.iter_mut().flatten().enumerate().for_each(|(k, s)| s.position = far(k));
        assert_eq!(broken_by(|s| jump(&mut s.tracks[0])), ["way_is_plausible"]);
        assert_eq!(broken_by(|s| s.ego.route = (0..5).map(far).collect()), ["route_is_plausible"]);
        assert_eq!(
            broken_by(|s| {
                jump(&mut s.tracks[0]);
                s.tracks = (0..20).map(|k| Track { id: k.to_string(), ..s.tracks[0].clone() }).collect();
            }),
            ["way_is_plausible", "ways_are_plausible"]
        );
        assert_eq!(broken_by(|s| s.road.lanes[0].exits.push(77)), ["lane_links_exist"]);
        assert_eq!(broken_by(|s| s.road.lanes[1].exits.push(0)), ["lane_links_are_mutual"]);
        assert_eq!(broken_by(|s| s.road.lanes[0].exits = vec![2; 65]), ["lane_links_are_few"]);
        assert_eq!(broken_by(|s| s.objects_of_interest.push(9)), ["objects_of_interest_exist"]);
        assert_eq!(broken_by(|s| s.crosswalks.push(vec![Vec2::ZERO])), ["line_has_points"]);
        assert_eq!(broken_by(|s| s.road.lanes[0].speed_limit_mps = Some(0.0)), ["speed_limit_is_plausible"]);
        assert_eq!(broken_by(|s| s.road.lanes[0].left.truncate(2)), ["lane_lines_have_equal_counts"]);
        assert_eq!(
            broken_by(|s| s.road.lanes[0].left_neighbours = vec![Neighbour { lane: 0, same_direction: true }]),
            ["neighbours_exist"]
        );
        assert_eq!(
            broken_by(|s| {
                s.road.lanes[0].exits.push(0);
                s.road.lanes[0].entries.push(0);
            }),
            ["no_lane_leads_into_itself"]
        );
        assert_eq!(
            broken_by(|s| {
                let states = vec![LightState::Go; 2];
                s.lights.push(Light { lane: 0, stop_point: Vec2::ZERO, states });
            }),
            ["light_states_match_steps"]
        );
    }

    #[test]
    fn the_first_thousand_violations_are_told_and_the_rest_counted() {
        let mut scene = two_lane_scene();
        scene.objects_of_interest = vec![99; 1000];
        assert_eq!((scene.validate().len(), how_many(&scene.validate()).as_str()), (1000, "1000"));
        scene.objects_of_interest = vec![99; 5000];
        let violations = scene.validate();
        assert_eq!(
            (violations.len(), violations[0].rule, how_many(&violations).as_str()),
            (1001, "objects_of_interest_exist", "more than 1000")
        );
        assert_eq!((violations[1000].rule, violations[1000].found.as_str()), ("and_more", "5000 violations"));
    }

    #[test]
    fn a_staging_out_of_all_measure_is_named() {
        let staging = |trigger_x: f64, spawns: usize| {
            let frame = SpawnFrame { fwd_m: 1.0, right_m: 0.0, yaw_rad: 0.0 };
            let trigger = crate::kernel::Pose { position: Vec2::new(trigger_x, 0.0), heading_rad: 0.0 };
            let family = crate::scene::safebench::TrafficFamily::RightTurn;
            Some(crate::scene::safebench::Staging { family, route: 4, trigger, spawns: vec![frame; spawns] })
        };
        assert_eq!(broken_by(|s| s.staging = staging(0.0, 16)), Vec::<&str>::new());
        assert_eq!(broken_by(|s| s.staging = staging(f64::NAN, 1)), ["points_are_finite_and_near"]);
        assert_eq!(broken_by(|s| s.staging = staging(0.0, 17)), ["spawns_are_few"]);
    }

    #[test]
    fn numbers_that_are_none_are_found_wherever_they_stand() {
        assert_eq!(
            broken_by(|s| s.road.lanes[0].centre[1].x = f64::NAN),
            ["points_are_finite_and_near", "lane_has_length"]
        );
        let sample = Sample { heading_rad: f64::INFINITY, ..Sample::default() };
        assert_eq!(broken_by(|s| s.tracks[0].samples[4] = Some(sample)), ["samples_are_finite"]);
        let fast = Sample { velocity: Vec2::new(0.0, 101.0), ..Sample::default() };
        assert_eq!(broken_by(|s| s.tracks[0].samples[4] = Some(fast)), ["speed_is_plausible"]);
    }
}
