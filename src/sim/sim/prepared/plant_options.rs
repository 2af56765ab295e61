//! The law of motion that an experiment chooses: what a car can do, how traffic begins, what counts as an obstacle.
//! `docs/PLANT.md` says what was measured and what differs between the presets.

use serde::{Deserialize, Serialize};

use crate::scene::AgentKind;
use crate::sim::road_users::bicycle::{CorneringLoss, DEFAULT_LIMITS, Limits, Settling};

use super::body::Size;

/// The key `plant` of `[simulator]`: the name of a preset, or a table with every option.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(from = "WrittenPlant")]
pub struct PlantOptions {
    /// Acceleration at full throttle on a straight road, m/s².
    pub engine_mps2: f64,
    /// Deceleration at half brake, m/s²; up to there it grows in proportion to the pedal.
    pub half_brake_mps2: f64,
    /// Deceleration at full brake, m/s²; in between it grows in proportion too.
    pub full_brake_mps2: f64,
    /// Largest lateral acceleration the tyres hold, m/s².
    pub grip_mps2: f64,
    /// Loss of speed in a bend.
    pub cornering_loss: CorneringLoss,
    /// Speed of traffic when it turns reactive.
    pub follower_start: FollowerStart,
    /// Egos behind which traffic turns reactive. Not written where these are all that drive.
    #[serde(skip_serializing_if = "ReactiveTraffic::is_behind_drivers")]
    pub reactive_traffic: ReactiveTraffic,
    /// The rule by which drivers by IDM see an obstacle.
    pub obstacle: Obstacle,
    /// Size of the ego.
    pub ego_box: EgoBox,
    /// Size of everybody else. Not written where it is as recorded.
    #[serde(skip_serializing_if = "TrafficBoxes::is_recorded")]
    pub traffic_boxes: TrafficBoxes,
    /// Motion of the ego's car. Not written where it is a single-track model.
    #[serde(skip_serializing_if = "EgoCar::is_single_track")]
    pub ego_car: EgoCar,
    /// Brakes of the ego's car while it settles at the beginning. Not written where they are the same as later.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub settling: Option<Settling>,
}

/// Speed of a recorded vehicle when it turns reactive.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FollowerStart {
    /// As recorded.
    Recorded,
    /// At standstill, as MetaDrive spawns it.
    Standing,
}

/// Egos behind which vehicles that appear follow by IDM, in place of their recording.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ReactiveTraffic {
    /// None: everybody repeats the recording.
    Off,
    /// All that drive. Behind one that repeats its recording everybody does so, too.
    #[default]
    Driving,
    /// All, as in MetaDrive.
    Always,
}

impl ReactiveTraffic {
    /// Returns `true` if traffic turns reactive behind an ego that repeats its recording, or behind one that does not.
    pub(in crate::sim) fn is_on(self, replays: bool) -> bool {
        match self {
            ReactiveTraffic::Off => false,
            ReactiveTraffic::Driving => !replays,
            ReactiveTraffic::Always => true,
        }
    }

    fn is_behind_drivers(&self) -> bool {
        *self == ReactiveTraffic::Driving
    }
}

/// When a driver takes something for an obstacle on its path, which is 2 m wide.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Obstacle {
    /// Its box reaches into the path.
    Reaches,
    /// One of its corners lies in the path: MetaDrive, which overlooks an object that stands across the whole path.
    Corner,
    /// The same in a lane that bends as the path does, less than 20 m ahead along it as well: exactly as MetaDrive does.
    Lane,
}

/// Motion of the ego's car.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum EgoCar {
    /// A single-track model with the limits above; IDM's wheels follow its wishes with a lag.
    #[default]
    SingleTrack,
    /// MetaDrive's: a body on four sprung wheels, where floor, loads and tyres decide the effect of pedal and steering wheel. IDM steers it
    /// as in MetaDrive, by the jumps of its lane's heading, and sees it a physics step late. Pedals are those of `engine_mps2` and the
    /// brakes above; `cornering_loss` and `grip_mps2` are those of the swerves alone that are tried for `avoidable`.
    Sprung,
}

impl EgoCar {
    fn is_single_track(&self) -> bool {
        *self == EgoCar::SingleTrack
    }
}

/// The box of the ego.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum EgoBox {
    /// As the scene gives it.
    Recorded,
    /// MetaDrive's default car, 4.515 x 1.852 m.
    MetadriveDefault,
}

/// Length and width of MetaDrive's default car, metres.
pub const METADRIVE_BOX_M: (f64, f64) = (4.515, 1.852);

/// The boxes of road users besides the ego: for contact, and for obstacles of a driver.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TrafficBoxes {
    /// As the scene gives them.
    #[default]
    Recorded,
    /// Those that MetaDrive simulates in their place: one of four cars by recorded length, one bicycle, one pedestrian.
    Metadrive,
}

/// MetaDrive's cars for traffic (`get_vehicle_type`): the longest recorded length, then length and width of the car, metres.
const METADRIVE_CARS_M: [(f64, f64, f64); 4] =
    [(4.0, 4.3, 1.7), (5.2, 4.6, 1.85), (6.2, 4.87, 2.046), (f64::INFINITY, 5.74, 2.3)];
/// Length and width of its bicycle, metres.
const METADRIVE_BICYCLE_M: (f64, f64) = (1.75, 0.4);
/// The same of the square around its pedestrian, a cylinder of radius 0.35 m.
const METADRIVE_PEDESTRIAN_M: (f64, f64) = (0.7, 0.7);

impl TrafficBoxes {
    /// Returns the box of a road user of this recorded length and width, metres.
    pub(in crate::sim) fn size(self, kind: AgentKind, length_m: f64, width_m: f64) -> Size {
        let car = || {
            let fits = METADRIVE_CARS_M.iter().find(|(longest_m, ..)| length_m <= *longest_m);
            fits.map_or((length_m, width_m), |(_, length_m, width_m)| (*length_m, *width_m))
        };
        let (length_m, width_m) = match (self, kind) {
            (TrafficBoxes::Recorded, _) => (length_m, width_m),
            (TrafficBoxes::Metadrive, AgentKind::Vehicle | AgentKind::Static) => car(),
            (TrafficBoxes::Metadrive, AgentKind::Cyclist) => METADRIVE_BICYCLE_M,
            (TrafficBoxes::Metadrive, AgentKind::Pedestrian) => METADRIVE_PEDESTRIAN_M,
        };
        Size::new(kind, length_m, width_m)
    }

    fn is_recorded(&self) -> bool {
        *self == TrafficBoxes::Recorded
    }
}

impl PlantOptions {
    /// Physically sound options: tyres that brake and steer with 0.9 g, and lose speed in bends by their slip.
    pub const PHYSICAL: PlantOptions = PlantOptions {
        engine_mps2: DEFAULT_LIMITS.engine_mps2,
        half_brake_mps2: DEFAULT_LIMITS.half_brake_mps2,
        full_brake_mps2: DEFAULT_LIMITS.brake_mps2,
        grip_mps2: DEFAULT_LIMITS.grip_mps2,
        cornering_loss: DEFAULT_LIMITS.cornering_loss,
        follower_start: FollowerStart::Recorded,
        reactive_traffic: ReactiveTraffic::Driving,
        obstacle: Obstacle::Reaches,
        ego_box: EgoBox::Recorded,
        traffic_boxes: TrafficBoxes::Recorded,
        ego_car: EgoCar::SingleTrack,
        settling: None,
    };

    /// MetaDrive 0.4.3 as measured, with its quirks: for comparison with published numbers.
    pub const METADRIVE_0_4_3: PlantOptions = PlantOptions {
        engine_mps2: 2.76,
        half_brake_mps2: 8.13,
        full_brake_mps2: 11.4,
        grip_mps2: DEFAULT_LIMITS.grip_mps2,
        cornering_loss: CorneringLoss::Skid { share: 0.19, skid: 0.53, drive: 0.65, holds_mps2: 6.25 },
        follower_start: FollowerStart::Standing,
        reactive_traffic: ReactiveTraffic::Driving,
        obstacle: Obstacle::Lane,
        ego_box: EgoBox::MetadriveDefault,
        traffic_boxes: TrafficBoxes::Metadrive,
        ego_car: EgoCar::Sprung,
        settling: None,
    };

    /// Returns the limits of a car.
    pub fn limits(&self) -> Limits {
        Limits {
            engine_mps2: self.engine_mps2,
            half_brake_mps2: self.half_brake_mps2,
            brake_mps2: self.full_brake_mps2,
            grip_mps2: self.grip_mps2,
            cornering_loss: self.cornering_loss,
            settling: self.settling,
            ..DEFAULT_LIMITS
        }
    }

    /// Returns the options that have bounds: name, value, lowest and highest.
    pub(in crate::sim) fn bounds(&self) -> Vec<(&'static str, f64, f64, f64)> {
        let mut bounds = vec![
            ("plant.engine_mps2", self.engine_mps2, 0.1, 20.0),
            ("plant.half_brake_mps2", self.half_brake_mps2, 0.1, 20.0),
            ("plant.full_brake_mps2", self.full_brake_mps2, self.half_brake_mps2, 30.0),
            ("plant.grip_mps2", self.grip_mps2, 0.1, 20.0),
        ];
        match self.cornering_loss {
            CorneringLoss::TyreSlip { cornering_coefficient } => {
                bounds.push(("plant.cornering_loss", cornering_coefficient, 1.0, 100.0));
            }
            CorneringLoss::Steering { share } => bounds.push(("plant.cornering_loss", share, 0.0, 2.0)),
            CorneringLoss::Skid { share, skid, drive, holds_mps2 } => bounds.extend([
                ("plant.cornering_loss.share", share, 0.0, 2.0),
                ("plant.cornering_loss.skid", skid, 0.0, 4.0),
                ("plant.cornering_loss.drive", drive, 0.0, 1.0),
                ("plant.cornering_loss.holds_mps2", holds_mps2, 0.1, 20.0),
            ]),
        }
        if let Some(Settling { seconds, full_brake_mps2 }) = self.settling {
            bounds.extend([
                ("plant.settling.seconds", seconds, 0.0, 10.0),
                ("plant.settling.full_brake_mps2", full_brake_mps2, self.half_brake_mps2, 30.0),
            ]);
        }
        bounds
    }
}

/// A preset's name or all options, as a file may hold them.
#[derive(Deserialize)]
#[serde(
    untagged,
    expecting = "simulator.plant must be \"physical\", \"metadrive-0.4.3\" or a table with every option of docs/PLANT.md"
)]
enum WrittenPlant {
    Preset(Preset),
    Own(OwnPlant),
}

#[derive(Deserialize)]
enum Preset {
    #[serde(rename = "physical")]
    Physical,
    #[serde(rename = "metadrive-0.4.3")]
    Metadrive,
}

/// [`PlantOptions`] field by field.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct OwnPlant {
    engine_mps2: f64,
    half_brake_mps2: f64,
    full_brake_mps2: f64,
    grip_mps2: f64,
    cornering_loss: CorneringLoss,
    follower_start: FollowerStart,
    #[serde(default)]
    reactive_traffic: ReactiveTraffic,
    obstacle: Obstacle,
    ego_box: EgoBox,
    #[serde(default)]
    traffic_boxes: TrafficBoxes,
    #[serde(default)]
    ego_car: EgoCar,
    #[serde(default)]
    settling: Option<Settling>,
}

impl From<WrittenPlant> for PlantOptions {
    fn from(written: WrittenPlant) -> PlantOptions {
        match written {
            WrittenPlant::Preset(Preset::Physical) => PlantOptions::PHYSICAL,
            WrittenPlant::Preset(Preset::Metadrive) => PlantOptions::METADRIVE_0_4_3,
            WrittenPlant::Own(own) => PlantOptions {
                engine_mps2: own.engine_mps2,
                half_brake_mps2: own.half_brake_mps2,
                full_brake_mps2: own.full_brake_mps2,
                grip_mps2: own.grip_mps2,
                cornering_loss: own.cornering_loss,
                follower_start: own.follower_start,
                reactive_traffic: own.reactive_traffic,
                obstacle: own.obstacle,
                ego_box: own.ego_box,
                traffic_boxes: own.traffic_boxes,
                ego_car: own.ego_car,
                settling: own.settling,
            },
        }
    }
}
