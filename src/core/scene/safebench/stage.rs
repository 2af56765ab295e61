//! Places along the ego's road at which a family puts its actors: ahead of the trigger, beside the road, in the left
//! lane, behind the turn. Built once per scene.

use super::staging::Staging;
use crate::kernel::{Polyline, Pose, Vec2, num};
use crate::scene::{LaneGraph, LaneIx, LanePlace, Road, Scene};

/// The ego's lane is the one within this distance of its route, metres.
const LANE_WITHIN_M: f64 = 3.0;
/// A route counts as turning where its direction differs by this much from its direction at the end, radians.
const TURNED_RAD: f64 = 0.09;
/// A route that turns less than this after its trigger runs straight on, radians.
const TURN_RAD_MIN: f64 = 0.5;
/// Lane width where no lane is found, metres (CARLA's towns).
const LANE_WIDTH_M: f64 = 3.5;
/// Directions of a route are taken over this length, metres.
const DIRECTION_M: f64 = 1.0;

/// A scene of a traffic family with the places that its generators ask for.
#[derive(Clone, Debug)]
pub struct Stage<'s> {
    scene: &'s Scene,
    staging: &'s Staging,
    graph: LaneGraph,
    route: Polyline,
    /// Arc length of the trigger on the route, metres.
    trigger_s_m: f64,
}

/// A place beside the road.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Roadside {
    /// One lane width to the right of the right-most lane's centre, facing the road.
    pub pose: Pose,
    /// Lanes between the ego's lane and the right-most one (SafeBench's `num_lane_changes`).
    pub lanes_between: usize,
    /// Width of the lane beside it, metres.
    pub lane_width_m: f64,
}

/// A place in the lane to the left of the ego's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LeftLane {
    /// Pose on that lane's centre line, heading as its traffic does.
    pub pose: Pose,
    /// True if its traffic drives in the ego's direction.
    pub same_direction: bool,
}

impl<'s> Stage<'s> {
    /// `None` for a scene of no traffic family, or one whose route is no path.
    pub fn of(scene: &'s Scene) -> Option<Stage<'s>> {
        let staging = scene.staging.as_ref()?;
        let route = Polyline::new(scene.ego.route.clone()).ok()?;
        let trigger_s_m = route.project(staging.trigger.position).s_m;
        Some(Stage { scene, staging, graph: LaneGraph::of(&scene.road), route, trigger_s_m })
    }

    /// The scene.
    pub fn scene(&self) -> &'s Scene {
        self.scene
    }

    /// Returns the data of SafeBench's scenario file.
    pub fn staging(&self) -> &'s Staging {
        self.staging
    }

    /// Returns the poses of the actors of families 5 to 8.
    pub fn spawns(&self) -> impl Iterator<Item = Pose> + use<'s> {
        let staging = self.staging;
        staging.spawns.iter().map(move |frame| staging.pose(frame))
    }

    /// The pose on the ego's route `ahead_m` after the trigger, straight on beyond its end.
    pub fn ahead(&self, ahead_m: f64) -> Pose {
        self.on_route(self.trigger_s_m + ahead_m)
    }

    fn on_route(&self, s_m: f64) -> Pose {
        Pose { position: self.route.at(s_m), heading_rad: self.direction(s_m) }
    }

    /// Direction over one metre around a place, because the points of a route may be closer together than their noise.
    fn direction(&self, s_m: f64) -> f64 {
        (self.route.at(s_m + 0.5 * DIRECTION_M) - self.route.at(s_m - 0.5 * DIRECTION_M)).heading()
    }

    fn lane_at(&self, pose: Pose) -> Option<LanePlace> {
        self.graph.nearest_lane(pose.position, pose.heading_rad, LANE_WITHIN_M)
    }

    /// The roadside abreast of a place `ahead_m` after the trigger. Facing the road is facing left: SafeBench turns its
    /// walkers by 270 degrees clockwise.
    pub fn roadside(&self, ahead_m: f64) -> Roadside {
        let pose = self.ahead(ahead_m);
        let right = -Vec2::from_heading(pose.heading_rad).left();
        let facing = num::wrap_angle(pose.heading_rad + num::FRAC_PI_2);
        let Some(place) = self.lane_at(pose) else {
            let aside = Pose { position: pose.position + right * LANE_WIDTH_M, heading_rad: facing };
            return Roadside { pose: aside, lanes_between: 0, lane_width_m: LANE_WIDTH_M };
        };
        let (mut lane, mut lanes_between) = (place.lane, 0);
        while let Some(next) = self.right_of(lane)
            && lanes_between < self.graph.lane_count()
        {
            (lane, lanes_between) = (next, lanes_between + 1);
        }
        let lane_width_m = width_m(&self.scene.road, lane, self.graph.place_in(lane, pose.position));
        let aside_m = (lanes_between + 1) as f64 * lane_width_m + place.offset_m;
        let position = pose.position + right * aside_m;
        Roadside { pose: Pose { position, heading_rad: facing }, lanes_between, lane_width_m }
    }

    fn right_of(&self, lane: LaneIx) -> Option<LaneIx> {
        let neighbour = *self.scene.road.lanes.get(lane)?.right_neighbours.first()?;
        (neighbour.same_direction && self.graph.is_through(neighbour.lane)).then_some(neighbour.lane)
    }

    /// The lane to the left of the ego's, beside the place `ahead_m` after the trigger; `None` if there is no such
    /// lane.
    pub fn left_lane(&self, ahead_m: f64) -> Option<LeftLane> {
        let pose = self.ahead(ahead_m);
        let own = self.lane_at(pose)?;
        let neighbour = *self.scene.road.lanes.get(own.lane)?.left_neighbours.first()?;
        let place = self.graph.place_in(neighbour.lane, pose.position)?;
        let on = self.graph.pose_at(neighbour.lane, place.s_m)?;
        Some(LeftLane { pose: on, same_direction: neighbour.same_direction })
    }

    /// Metres from the trigger along the route to the end of its turn; `None` where it runs straight on.
    pub fn turn_exit_m(&self) -> Option<f64> {
        let last = self.direction(self.route.length_m() - DIRECTION_M);
        let turned = |s_m: f64| num::wrap_angle(self.direction(s_m) - last).abs();
        if turned(self.trigger_s_m) < TURN_RAD_MIN {
            return None;
        }
        let steps = ((self.route.length_m() - self.trigger_s_m) / DIRECTION_M) as usize;
        let bent = (0..steps).rev().map(|k| k as f64 * DIRECTION_M).find(|d| turned(self.trigger_s_m + d) > TURNED_RAD);
        bent.map(|d| d + DIRECTION_M)
    }
}

/// Width of a lane at a place, metres.
fn width_m(road: &Road, lane: LaneIx, place: Option<LanePlace>) -> f64 {
    let Some(place) = place else { return LANE_WIDTH_M };
    let lines = road.lanes.get(lane).map(|lane| (&lane.centre, &lane.left, &lane.right));
    let Some((centre, left, right)) = lines else { return LANE_WIDTH_M };
    let mut way_m = 0.0;
    for (k, pair) in centre.windows(2).enumerate() {
        way_m += pair[0].distance(pair[1]);
        if way_m >= place.s_m {
            return left[k].distance(right[k]);
        }
    }
    LANE_WIDTH_M
}
