//! The features of a whole scene that expressions, prompts and memory may read: numbers with units, and tags.

use super::lanes::{LaneGraph, LanePlace};
use super::{AgentKind, LaneIx, LaneKind, Sample, Scene, Track};
use crate::kernel::geom::segments_cross;
use crate::kernel::{Polyline, Vec2, num};

/// Tags of a place and its traffic, in the order of the alphabet; a scene of SafeBench has its traffic family's name too.
pub const TAGS: [&str; 11] = [
    "crosswalk",
    "curved",
    "cyclists",
    "dense",
    "highway",
    "junction",
    "light",
    "multi_lane",
    "pedestrians",
    "slow_traffic",
    "stop_sign",
];
/// Meaning of each of [`TAGS`], in their order. Staged scenes have the name of their traffic family as a tag besides.
pub const TAGS_MEAN: [&str; 11] = [
    "The map has a crosswalk.",
    "The ego's route bends by more than 0.02 1/m somewhere.",
    "A cyclist is there at the current step.",
    "15 vehicles or more are there at the current step.",
    "The ego starts on a freeway, or the speed limit there is above 22 m/s.",
    "The ego's route crosses another lane, or a lane of it is entered from several.",
    "A traffic light stands over a lane of the ego's route.",
    "Two lanes or more lie abreast where the ego starts.",
    "Somebody on foot is there at the current step.",
    "Vehicles are there at the current step, and their mean speed is below 3 m/s.",
    "The map has a stop sign.",
];
/// The distance that is reported where there is nothing to measure to, metres.
pub const NOTHING_NEAR_M: f64 = 200.0;
/// Speed limit where none is known, m/s: 50 km/h.
pub const SPEED_LIMIT_UNKNOWN_MPS: f64 = 13.9;
/// A route's lanes are those within this distance of it, metres.
const ROUTE_LANE_WITHIN_M: f64 = 3.0;
/// Spacing at which routes are sampled, metres.
const ROUTE_SPACING_M: f64 = 2.0;
/// Paths that meet at less than this angle run along each other: sine of 15 degrees for lanes, which never wobble,
/// of 5 degrees for logs.
const LANES_CROSS_SIN_MIN: f64 = 0.258_819_045_102_520_74;
const LOGS_CROSS_SIN_MIN: f64 = 0.087_155_742_747_658_17;

/// Features of a scene at its current step; fields have the names under which expressions read them.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct SceneFeatures {
    /// Vehicles observed at the current step.
    pub vehicle_count: f64,
    /// Pedestrians observed at the current step.
    pub pedestrian_count: f64,
    /// Cyclists observed at the current step.
    pub cyclist_count: f64,
    /// Speed of the ego at its start, m/s.
    pub ego_speed_mps: f64,
    /// Length of the ego's route, metres.
    pub ego_route_length_m: f64,
    /// Largest curvature of the route, 1/m, over pieces of 2 m.
    pub route_curvature_max_1pm: f64,
    /// Mean over vehicles at the current step, m/s; 0 if there is none.
    pub traffic_speed_mps: f64,
    /// Distance to the nearest vehicle, centre to centre, metres; 200 if there is no vehicle.
    pub nearest_vehicle_gap_m: f64,
    /// Smallest distance of any vehicle's path, from the current step on, to the ego's route, metres; 200 if none.
    pub log_distance_m_min: f64,
    /// Vehicles whose path, from the current step on, crosses the ego's route.
    pub conflict_count: f64,
    /// Speed limit of the ego's lane, m/s; 13.9 if unknown.
    pub speed_limit_mps: f64,
    /// Lanes side by side at the ego's start, in its own direction.
    pub lane_count: f64,
    /// A traffic light stands on the ego's route.
    pub has_light: bool,
    /// The route crosses another lane, or a lane of the route is entered from several.
    pub is_junction: bool,
    /// Sorted: `crosswalk`, `curved`, `cyclists`, `dense`, `highway`, `junction`, `light`, `multi_lane`, `pedestrians`,
    /// `slow_traffic`, `stop_sign`, and the name of the traffic family that a scene belongs to.
    pub tags: Vec<&'static str>,
}

impl SceneFeatures {
    /// The features of a validated scene, given the lane graph of its road.
    pub fn of(scene: &Scene, graph: &LaneGraph) -> SceneFeatures {
        let now = |track: &Track| track.at(scene.current_step).copied();
        let present = |kind: AgentKind| scene.tracks.iter().filter(move |t| t.kind == kind && now(t).is_some());
        let vehicles: Vec<Sample> = present(AgentKind::Vehicle).filter_map(now).collect();
        let ego = scene.ego.track.at(scene.ego.start_step).copied().unwrap_or_default();
        let route = Polyline::new(scene.ego.route.clone()).ok().map(|line| line.resampled(ROUTE_SPACING_M));
        let lane = graph.nearest_lane(ego.position, ego.heading_rad, 10.0);
        let lanes = route.as_ref().map(|line| route_lanes(line, graph)).unwrap_or_default();
        let limit = lane.and_then(|place| scene.road.lanes[place.lane].speed_limit_mps);
        let speeds: Vec<f64> = vehicles.iter().map(Sample::speed_mps).collect();
        let gaps = vehicles.iter().map(|v| v.position.distance(ego.position));
        let (log_distance_m_min, conflicts) = route.as_ref().map_or((NOTHING_NEAR_M, 0), |r| logs_against(scene, r));
        let mut features = SceneFeatures {
            vehicle_count: vehicles.len() as f64,
            pedestrian_count: present(AgentKind::Pedestrian).count() as f64,
            cyclist_count: present(AgentKind::Cyclist).count() as f64,
            ego_speed_mps: ego.speed_mps(),
            ego_route_length_m: route.as_ref().map_or(0.0, Polyline::length_m),
            route_curvature_max_1pm: route.as_ref().map_or(0.0, curvature_max_1pm),
            traffic_speed_mps: num::mean(&speeds).unwrap_or(0.0),
            nearest_vehicle_gap_m: gaps.fold(NOTHING_NEAR_M, f64::min),
            log_distance_m_min,
            conflict_count: conflicts as f64,
            speed_limit_mps: limit.unwrap_or(SPEED_LIMIT_UNKNOWN_MPS),
            lane_count: lane.map_or(0, |place| lanes_abreast(place, graph)) as f64,
            has_light: scene.lights.iter().any(|light| lanes.contains(&light.lane)),
            is_junction: route.as_ref().is_some_and(|line| meets_other_lanes(line, &lanes, graph)),
            tags: vec![],
        };
        let freeway = lane.is_some_and(|place| scene.road.lanes[place.lane].kind == LaneKind::Freeway);
        features.tags = features.tags_of(scene, freeway);
        features
    }

    /// The value of a feature by its name in the vocabulary; booleans as 0 and 1; `None` for any other name.
    pub fn value(&self, name: &str) -> Option<f64> {
        Some(match name {
            "vehicle_count" => self.vehicle_count,
            "pedestrian_count" => self.pedestrian_count,
            "cyclist_count" => self.cyclist_count,
            "ego_speed_mps" => self.ego_speed_mps,
            "ego_route_length_m" => self.ego_route_length_m,
            "route_curvature_max_1pm" => self.route_curvature_max_1pm,
            "traffic_speed_mps" => self.traffic_speed_mps,
            "nearest_vehicle_gap_m" => self.nearest_vehicle_gap_m,
            "log_distance_m_min" => self.log_distance_m_min,
            "conflict_count" => self.conflict_count,
            "speed_limit_mps" => self.speed_limit_mps,
            "lane_count" => self.lane_count,
            "has_light" => f64::from(u8::from(self.has_light)),
            "is_junction" => f64::from(u8::from(self.is_junction)),
            _ => return None,
        })
    }

    fn tags_of(&self, scene: &Scene, freeway: bool) -> Vec<&'static str> {
        let holds = [
            !scene.crosswalks.is_empty(),
            self.route_curvature_max_1pm > 0.02,
            self.cyclist_count > 0.0,
            self.vehicle_count >= 15.0,
            freeway || self.speed_limit_mps > 22.0,
            self.is_junction,
            self.has_light,
            self.lane_count >= 2.0,
            self.pedestrian_count > 0.0,
            self.vehicle_count > 0.0 && self.traffic_speed_mps < 3.0,
            !scene.stop_signs.is_empty(),
        ];
        let mut tags: Vec<&str> = TAGS.into_iter().zip(holds).filter(|(_, holds)| *holds).map(|(tag, _)| tag).collect();
        tags.extend(scene.staging.as_ref().map(|staging| staging.family.name()));
        tags.sort_unstable();
        tags
    }
}

/// Largest change of direction per metre of an evenly resampled route.
fn curvature_max_1pm(route: &Polyline) -> f64 {
    let turns = route.points().windows(3).map(|w| {
        let (one, two) = (w[1] - w[0], w[2] - w[1]);
        num::atan2(one.cross(two), one.dot(two)).abs() / (0.5 * (one.norm() + two.norm()))
    });
    turns.fold(0.0, f64::max)
}

/// Lanes under a route, heading the same way; sorted.
fn route_lanes(route: &Polyline, graph: &LaneGraph) -> Vec<LaneIx> {
    let mut lanes: Vec<LaneIx> = route
        .points()
        .windows(2)
        .filter_map(|w| graph.nearest_lane(w[0].lerp(w[1], 0.5), (w[1] - w[0]).heading(), ROUTE_LANE_WITHIN_M))
        .map(|place| place.lane)
        .collect();
    lanes.sort_unstable();
    lanes.dedup();
    lanes
}

/// Returns the smallest distance of vehicles' logs from the route, and the number of them that cross it.
fn logs_against(scene: &Scene, route: &Polyline) -> (f64, usize) {
    let (mut nearest, mut conflicts) = (NOTHING_NEAR_M, 0);
    for track in scene.tracks.iter().filter(|t| t.kind == AgentKind::Vehicle) {
        let path: Vec<Vec2> = track.samples.iter().skip(scene.current_step).flatten().map(|s| s.position).collect();
        let Ok(path) = Polyline::new(path.clone()) else {
            if let Some(place) = path.first() {
                nearest = nearest.min(route.project(*place).offset_m.abs());
            }
            continue;
        };
        let path = path.resampled(ROUTE_SPACING_M);
        let offsets = path.points().iter().map(|p| route.project(*p).offset_m.abs());
        nearest = offsets.fold(nearest, f64::min);
        conflicts += usize::from(crosses(route, path.points(), LOGS_CROSS_SIN_MIN));
    }
    (nearest, conflicts)
}

/// Returns `true` if a path crosses the route at no less than the given sine of an angle.
fn crosses(route: &Polyline, path: &[Vec2], sin_min: f64) -> bool {
    path.windows(2).any(|p| {
        route.points().windows(2).any(|r| {
            let near = r[0].distance(p[0]) <= r[0].distance(r[1]) + p[0].distance(p[1]);
            let (a, b) = (r[1] - r[0], p[1] - p[0]);
            near && segments_cross(r[0], r[1], p[0], p[1]) && a.cross(b).abs() > sin_min * a.norm() * b.norm()
        })
    })
}

fn meets_other_lanes(route: &Polyline, lanes: &[LaneIx], graph: &LaneGraph) -> bool {
    let merges = lanes.iter().any(|&lane| graph.entries(lane).len() > 1);
    merges
        || (0..graph.lane_count()).any(|lane| {
            // A lane that leaves the route touches it at its start and crosses nothing.
            let leaves = graph.entries(lane).iter().any(|from| lanes.binary_search(from).is_ok());
            let other = graph.is_through(lane) && lanes.binary_search(&lane).is_err() && !leaves;
            other && graph.centre(lane).is_some_and(|line| crosses(route, line.points(), LANES_CROSS_SIN_MIN))
        })
}

/// Lanes of the same direction side by side, the lane itself included.
fn lanes_abreast(place: LanePlace, graph: &LaneGraph) -> usize {
    let mut lanes = vec![place.lane];
    let Some(here) = graph.pose_at(place.lane, place.s_m) else { return 1 };
    let mut next = 0;
    while next < lanes.len() {
        for lane in graph.beside_at(lanes[next], here.position) {
            if graph.is_through(lane) && !lanes.contains(&lane) {
                lanes.push(lane);
            }
        }
        next += 1;
    }
    lanes.len()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::fixture::{straight, two_lane_scene};

    fn features(scene: &Scene) -> SceneFeatures {
        SceneFeatures::of(scene, &LaneGraph::of(&scene.road))
    }

    #[test]
    fn a_straight_two_lane_road_reads_as_such() {
        let features = features(&two_lane_scene());
        assert_eq!((features.vehicle_count, features.lane_count, features.speed_limit_mps), (2.0, 2.0, 15.0));
        assert_eq!((features.ego_route_length_m, features.route_curvature_max_1pm), (140.0, 0.0));
        assert_eq!((features.traffic_speed_mps, features.nearest_vehicle_gap_m), (10.0, 3.5));
        assert_eq!((features.log_distance_m_min, features.conflict_count), (0.0, 0.0));
        assert!(!features.is_junction && !features.has_light);
        assert_eq!(features.tags, ["multi_lane"]);
    }

    #[test]
    fn a_crossing_car_is_a_conflict_and_a_crossing_lane_a_junction() {
        let mut scene = two_lane_scene();
        scene.tracks[1].samples = straight(60, Vec2::new(60.3, -20.0), 1.5, 8.0);
        scene.road.lanes.push(crate::scene::fixture::lane("x", vec![Vec2::new(60.0, -30.0), Vec2::new(61.0, 30.0)]));
        let features = features(&scene);
        assert_eq!(features.conflict_count, 1.0);
        assert!(features.is_junction);
        assert!(features.tags.contains(&"junction"));
    }

    #[test]
    fn a_light_counts_only_on_the_route() {
        let mut scene = two_lane_scene();
        let light = |lane| crate::scene::Light { lane, stop_point: Vec2::ZERO, states: vec![] };
        scene.lights = vec![light(3)];
        assert!(!features(&scene).has_light);
        scene.lights = vec![light(2)];
        assert!(features(&scene).has_light);
    }
}
