//! The eight traffic families of the CARLA challenge, as SafeBench numbers and ChatScene names them.

use serde::{Deserialize, Serialize};

/// A traffic family.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TrafficFamily {
    /// `DynamicObjectCrossing`: someone on foot steps out from behind a vending machine.
    StraightObstacle,
    /// `VehicleTurningRoute`: a cyclist crosses behind the turn that the ego takes.
    TurningObstacle,
    /// `OtherLeadingVehicle`: the leader brakes while the left lane is taken.
    LaneChanging,
    /// `ManeuverOppositeDirection`: a parked car must be passed against oncoming traffic.
    VehiclePassing,
    /// `OppositeVehicleRunningRedLight`: the ego has green, a crossing car does not stop.
    RedLightRunning,
    /// `SignalizedJunctionLeftTurn`: the ego turns left against an oncoming car.
    UnprotectedLeftTurn,
    /// `SignalizedJunctionRightTurn`: the ego turns right on red, cross traffic has green.
    RightTurn,
    /// `NoSignalJunctionCrossingRoute`: a crossing without lights or signs.
    CrossingNegotiation,
}

impl TrafficFamily {
    /// All families, in the order of their numbers.
    pub const ALL: [TrafficFamily; 8] = [
        TrafficFamily::StraightObstacle,
        TrafficFamily::TurningObstacle,
        TrafficFamily::LaneChanging,
        TrafficFamily::VehiclePassing,
        TrafficFamily::RedLightRunning,
        TrafficFamily::UnprotectedLeftTurn,
        TrafficFamily::RightTurn,
        TrafficFamily::CrossingNegotiation,
    ];

    /// SafeBench's scenario id, 1 to 8.
    pub fn number(self) -> usize {
        1 + self as usize
    }

    /// The family with a scenario id.
    pub fn of_number(number: usize) -> Option<TrafficFamily> {
        number.checked_sub(1).and_then(|ix| TrafficFamily::ALL.get(ix).copied())
    }

    /// The name in scene ids, tags and tables.
    pub fn name(self) -> &'static str {
        match self {
            TrafficFamily::StraightObstacle => "straight_obstacle",
            TrafficFamily::TurningObstacle => "turning_obstacle",
            TrafficFamily::LaneChanging => "lane_changing",
            TrafficFamily::VehiclePassing => "vehicle_passing",
            TrafficFamily::RedLightRunning => "red_light_running",
            TrafficFamily::UnprotectedLeftTurn => "unprotected_left_turn",
            TrafficFamily::RightTurn => "right_turn",
            TrafficFamily::CrossingNegotiation => "crossing_negotiation",
        }
    }

    /// SafeBench's class of the scenario, as it stands in `scenario_0X.json`.
    pub fn scenario_name(self) -> &'static str {
        match self {
            TrafficFamily::StraightObstacle => "DynamicObjectCrossing",
            TrafficFamily::TurningObstacle => "VehicleTurningRoute",
            TrafficFamily::LaneChanging => "OtherLeadingVehicle",
            TrafficFamily::VehiclePassing => "ManeuverOppositeDirection",
            TrafficFamily::RedLightRunning => "OppositeVehicleRunningRedLight",
            TrafficFamily::UnprotectedLeftTurn => "SignalizedJunctionLeftTurn",
            TrafficFamily::RightTurn => "SignalizedJunctionRightTurn",
            TrafficFamily::CrossingNegotiation => "NoSignalJunctionCrossingRoute",
        }
    }

    /// Returns `true` if the actors stand at frames of their own (families 5 to 8) rather than along the ego's road.
    pub fn has_spawn_frames(self) -> bool {
        self.number() >= 5
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_run_from_one_to_eight_and_back() {
        for (ix, family) in TrafficFamily::ALL.into_iter().enumerate() {
            assert_eq!((family.number(), TrafficFamily::of_number(ix + 1)), (ix + 1, Some(family)));
            let name = serde_json::to_string(&family).unwrap();
            assert_eq!(name, format!("{:?}", family.name()));
        }
        assert_eq!((TrafficFamily::of_number(0), TrafficFamily::of_number(9)), (None, None));
    }
}
