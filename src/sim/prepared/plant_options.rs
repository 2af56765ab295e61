//! The law of motion that an experiment chooses: what a car can do, how traffic begins, what counts as an obstacle.
//! `docs/PLANT.md` says what was measured and what differs between the presets.

use serde::{Deserialize, Serialize};

use crate::sim::road_users::bicycle::{CorneringLoss, DEFAULT_LIMITS, Limits};

/// The key `plant` of `[simulator]`: the name of a preset, or a table with every option.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(from = "WrittenPlant")]
pub struct PlantOptions {
    /// Full throttle on a straight road, m/s².
    pub engine_mps2: f64,
    /// Deceleration at half brake, m/s²; up to there it grows in proportion to the pedal.
    pub half_brake_mps2: f64,
    /// Deceleration at full brake, m/s²; in between it grows in proportion too.
    pub full_brake_mps2: f64,
    /// Largest lateral acceleration the tyres hold, m/s².
    pub grip_mps2: f64,
    /// What a bend costs in speed.
    pub cornering_loss: CorneringLoss,
    /// How fast traffic is that turns reactive.
    pub follower_start: FollowerStart,
    /// What drivers by IDM take for an obstacle.
    pub obstacle: Obstacle,
    /// How large the ego is.
    pub ego_box: EgoBox,
}

/// How fast a recorded vehicle is when it turns reactive.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FollowerStart {
    /// As recorded.
    Recorded,
    /// At standstill, as MetaDrive spawns it.
    Standing,
}

/// When a driver takes something for an obstacle on its path, which is 2 m wide.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Obstacle {
    /// Its box reaches into the path.
    Reaches,
    /// One of its corners lies in the path: MetaDrive, which overlooks what stands across the whole path.
    Corner,
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

impl PlantOptions {
    /// What a physicist would sign: tyres that brake and steer with 0.9 g, and lose speed in bends by their slip.
    pub const PHYSICAL: PlantOptions = PlantOptions {
        engine_mps2: DEFAULT_LIMITS.engine_mps2,
        half_brake_mps2: DEFAULT_LIMITS.half_brake_mps2,
        full_brake_mps2: DEFAULT_LIMITS.brake_mps2,
        grip_mps2: DEFAULT_LIMITS.grip_mps2,
        cornering_loss: DEFAULT_LIMITS.cornering_loss,
        follower_start: FollowerStart::Recorded,
        obstacle: Obstacle::Reaches,
        ego_box: EgoBox::Recorded,
    };

    /// MetaDrive 0.4.3 as measured, with its quirks: for comparison with published numbers.
    pub const METADRIVE_0_4_3: PlantOptions = PlantOptions {
        engine_mps2: 2.76,
        half_brake_mps2: 8.13,
        full_brake_mps2: 11.4,
        grip_mps2: DEFAULT_LIMITS.grip_mps2,
        cornering_loss: CorneringLoss::Steering { share: 0.77 },
        follower_start: FollowerStart::Standing,
        obstacle: Obstacle::Corner,
        ego_box: EgoBox::MetadriveDefault,
    };

    /// What a car can do.
    pub fn limits(&self) -> Limits {
        Limits {
            engine_mps2: self.engine_mps2,
            half_brake_mps2: self.half_brake_mps2,
            brake_mps2: self.full_brake_mps2,
            grip_mps2: self.grip_mps2,
            cornering_loss: self.cornering_loss,
            ..DEFAULT_LIMITS
        }
    }

    /// The options that have bounds: name, value, lowest and highest.
    pub(in crate::sim) fn bounds(&self) -> [(&'static str, f64, f64, f64); 5] {
        let (loss, low, high) = match self.cornering_loss {
            CorneringLoss::TyreSlip { cornering_coefficient } => (cornering_coefficient, 1.0, 100.0),
            CorneringLoss::Steering { share } => (share, 0.0, 2.0),
        };
        [
            ("plant.engine_mps2", self.engine_mps2, 0.1, 20.0),
            ("plant.half_brake_mps2", self.half_brake_mps2, 0.1, 20.0),
            ("plant.full_brake_mps2", self.full_brake_mps2, self.half_brake_mps2, 30.0),
            ("plant.grip_mps2", self.grip_mps2, 0.1, 20.0),
            ("plant.cornering_loss", loss, low, high),
        ]
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
    obstacle: Obstacle,
    ego_box: EgoBox,
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
                obstacle: own.obstacle,
                ego_box: own.ego_box,
            },
        }
    }
}
