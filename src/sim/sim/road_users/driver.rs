//! The view and the decisions of a driver under test.

use crate::kernel::Vec2;
use crate::scene::{AgentKind, LaneIx, LightState, Road, Sample};
use crate::sim::accounts::end::End;
use crate::sim::prepared::body::Size;
use crate::sim::prepared::path::{Along, Path};
use crate::sim::prepared::plant::Plant;
use crate::sim::prepared::plant_options::{EgoCar, Obstacle};

use super::idm::{self, Front, SIGHT_M};
use super::others::{Others, Seen};

/// Largest distance at which the lane of a place is looked for, metres.
const LANE_WITHIN_M: f64 = 50.0;

/// A driver of the ego. One instance drives one rollout at a time; `begin` resets it.
pub trait Driver {
    /// Begins a rollout of this scene, and forgets everything of earlier ones.
    fn begin(&mut self, plant: &Plant);

    /// Decides once a decision step (0.1 s).
    fn decide(&mut self, view: &View<'_>) -> Control;

    /// Ends a rollout: called once with the last state and the end. For drivers that learn.
    fn finish(&mut self, _: &View<'_>, _: End) {}

    /// Returns `true` if it repeats the recorded motion. Traffic then does so too (nobody turns reactive) and contacts of the
    /// recording count from the first step on.
    fn follows_log(&self) -> bool {
        false
    }
}

/// A decision, held for one decision step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Control {
    /// Drive; both are clamped to the car's limits. Steering is positive to the left.
    Drive {
        /// Acceleration along the heading, m/s²; negative brakes.
        acceleration_mps2: f64,
        /// Angle of the front wheels, radians.
        steering_rad: f64,
    },
    /// Take the recorded place.
    FollowLog,
}

/// The ego as it is now.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EgoState {
    /// Position, heading and velocity.
    pub sample: Sample,
    /// Unit heading vector.
    pub axis: Vec2,
    /// Norm of the velocity, m/s.
    pub speed_mps: f64,
    /// Steering of the last decision, radians.
    pub steering_rad: f64,
    /// Change of speed over the last decision step, m/s².
    pub acceleration_mps2: f64,
    /// Its box.
    pub size: Size,
    /// Place along the route.
    pub along: Along,
}

/// The world at one decision step, as a driver may see it.
pub struct View<'a> {
    pub(in crate::sim) plant: &'a Plant,
    pub(in crate::sim) world: &'a Others,
    pub(in crate::sim) k: usize,
    pub(in crate::sim) ego: &'a EgoState,
}

impl View<'_> {
    /// Returns the number of decision steps since the rollout began.
    pub fn decision(&self) -> usize {
        self.k
    }

    /// Returns the scene's step.
    pub fn step(&self) -> usize {
        self.plant.first_step() + self.k
    }

    /// Returns the ego at this step.
    pub fn ego(&self) -> &EgoState {
        self.ego
    }

    /// Returns the path that the ego is to drive.
    pub fn route(&self) -> &Path {
        self.plant.route()
    }

    /// Returns the scene as it was prepared.
    pub fn plant(&self) -> &Plant {
        self.plant
    }

    /// Calls `f` for every other road user whose centre lies within `radius_m` of the ego's: recorded ones by x, then
    /// simulated ones.
    pub fn for_each_within(&self, radius_m: f64, mut f: impl FnMut(&Seen)) {
        self.world.for_each_within(self.plant, self.k, self.ego.sample.position, radius_m, |seen| f(seen));
    }

    /// Returns the nearest road user ahead on the route, as IDM sees it.
    pub fn front(&self) -> Option<Front> {
        let obstacle = self.plant.options().plant.obstacle;
        let (path, own) = match self.plant.lane() {
            Some(lane) if obstacle == Obstacle::Lane => (lane, beside(lane, self.ego.sample.position)),
            _ => {
                let path = &self.plant.route_ahead;
                let known = Along { segment: path.segment_near(self.ego.along.s_m, 0), ..self.ego.along };
                (path, path.project_near(self.ego.sample.position, &known, SIGHT_M, SIGHT_M))
            }
        };
        let mut nearest = None;
        self.world.for_each_near(self.plant, self.k, self.ego.sample.position, SIGHT_M, |near| {
            idm::nearer(&mut nearest, path, &own, near.position, near.axis, || near.velocity(), near.size, obstacle);
        });
        nearest
    }

    /// Returns `true` if a vehicle or cyclist has its centre in the ego's lane, within `reach_m` of the ego's and ahead of it, as SafeBench
    /// asks CARLA's map: the lane of a place is the street or freeway lane with the nearest centre line, whatever its heading. Walkers
    /// and things do not count.
    pub fn is_behind_vehicle_in_lane(&self, reach_m: f64) -> bool {
        let own = self.ego.sample.position;
        let lane_of = |point| self.plant.lanes().nearest_lane_any_heading(point, LANE_WITHIN_M).map(|place| place.lane);
        let (mut own_lane, mut is_behind) = (None, false);
        self.world.for_each_near(self.plant, self.k, own, reach_m, |near| {
            let drives = matches!(near.size.kind, AgentKind::Vehicle | AgentKind::Cyclist);
            if is_behind || !drives || (near.position - own).dot(self.ego.axis) <= 0.0 {
                return;
            }
            let lanes = (*own_lane.get_or_insert_with(|| lane_of(own)), lane_of(near.position));
            is_behind = matches!(lanes, (Some(a), Some(b)) if is_one_lane(&self.plant.scene().road, a, b));
        });
        is_behind
    }

    /// Returns the lane by which MetaDrive's driver steers, and the ego's place on it; `None` for a car that is steered by the route.
    pub fn on_lane(&self) -> Option<(&Path, Along)> {
        let lane = self.plant.lane().filter(|_| self.plant.options().plant.ego_car == EgoCar::Sprung)?;
        Some((lane, beside(lane, self.ego.sample.position)))
    }

    /// Returns the metres along the route to the nearest stop point ahead whose light is red.
    pub fn red_light_m(&self) -> Option<f64> {
        let mut nearest = None;
        for light in &self.plant.lights {
            let gap_m = light.s_m - self.ego.along.s_m;
            let red = light.states.get(self.k) == Some(&LightState::Stop);
            if red && gap_m > 0.0 && nearest.is_none_or(|n| gap_m < n) {
                nearest = Some(gap_m);
            }
        }
        nearest
    }
}

/// Looks along the whole lane for the nearest piece, as MetaDrive does.
fn beside(lane: &Path, point: Vec2) -> Along {
    lane.on_line_of(&lane.project(point), point)
}

/// Returns `true` if two lanes are one to CARLA, which compares road and lane: the sections into which OpenDRIVE cuts a road,
/// `road/section/lane` in an id, do not count.
fn is_one_lane(road: &Road, a: LaneIx, b: LaneIx) -> bool {
    let named = |lane: LaneIx| {
        let (road, rest) = road.lanes.get(lane)?.id.split_once('/')?;
        let (_, lane) = rest.split_once('/')?;
        (!lane.contains('/')).then_some((road, lane))
    };
    a == b || named(a).is_some_and(|of| named(b) == Some(of))
}
