//! The simulator's part of the experiment file: the table `[simulator]`. Everything here can change an outcome, so
//! its digest counts into the key of every rollout.

use serde::{Deserialize, Serialize};

use super::plant_options::{Obstacle, PlantOptions, TrafficBoxes};
use crate::kernel::{Digest, canon::CanonError};

/// The table `[simulator]`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SimulatorOptions {
    /// The law of motion: what cars can do, and how traffic behaves.
    pub plant: PlantOptions,
    /// When a contact counts as avoidable.
    pub avoidance: AvoidanceOptions,
    /// True if outcomes report motion that its kind does not do: slides, turns on the spot, speed. A weight of `rolling` or
    /// `speed_of_kind` needs it.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub of_kind: bool,
    /// True if outcomes report places where a motion's kind does not belong: on a motorway, across a kerb or a median. A weight of
    /// `place_of_kind` needs it.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub of_place: bool,
    /// True if outcomes say who is at fault for the ego's contact by nuPlan's rule. `reading = "at_fault"` needs it.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub at_fault: bool,
    /// True if labels say which drivers of UN R157 would have avoided the ego's contact.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub jury: bool,
    /// The form of SafeBench's scripts that traffic families stage. Not written where it is the first.
    #[serde(default, skip_serializing_if = "Scripts::are_as_defined")]
    pub scripts: Scripts,
}

/// The form of SafeBench's scripts. Its scenarios define a stop condition that is never called there: `check_stop_condition` of
/// `scenario_definition/*/object_crash_vehicle.py` and its siblings.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Scripts {
    /// As its scenarios define them: an adversary that has gone far enough stops; family 1 has a pedestrian, whatever plays it.
    #[default]
    AsDefined,
    /// As its scenarios run: nobody stops, and the adversary of AT's family 1 is a bicycle (`adv_trajectory/object_crash_vehicle.py` 58).
    AsRun,
}

impl Scripts {
    fn are_as_defined(&self) -> bool {
        *self == Scripts::AsDefined
    }
}

impl SimulatorOptions {
    /// The options that the experiments of this repository declare; for tests and benchmarks, which read no file.
    pub const SHIPPED: SimulatorOptions = SimulatorOptions {
        plant: PlantOptions::PHYSICAL,
        avoidance: AvoidanceOptions::SHIPPED,
        of_kind: false,
        of_place: false,
        at_fault: false,
        jury: false,
        scripts: Scripts::AsDefined,
    };

    /// Returns the digest that goes into a rollout's key.
    pub fn digest(&self) -> Result<Digest, CanonError> {
        Digest::of("evodrive/simulator-options/1", self)
    }

    /// Checks the values, and fails with the first one that cannot be simulated with.
    pub fn check(&self) -> Result<(), SimulatorOptionsError> {
        let mut bounds = self.plant.bounds().into_iter().chain(self.avoidance.bounds());
        // NaN lies in no range.
        match bounds.find(|(_, value, low, high)| !(low..=high).contains(&value)) {
            Some((place, found, low, high)) => Err(SimulatorOptionsError::Bound { place, found, low, high }),
            None if self.plant.obstacle != Obstacle::Reaches && self.plant.traffic_boxes == TrafficBoxes::Recorded => {
                Err(SimulatorOptionsError::CornersOfRecordedBoxes)
            }
            None => Ok(()),
        }
    }
}

/// Terms under which a contact counts as avoidable: what the ego is taken to see, and what it can do then. Docs:
/// `docs/OBJECTIVES.md`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AvoidanceOptions {
    /// Time over which motions are predicted, and for which an evading ego must stay clear after the contact, s.
    pub horizon_s: f64,
    /// Time from the moment at which the threat is visible to the first change of the controls, s.
    pub reaction_s: f64,
    /// Width of the view, centred on the ego's heading, degrees; 360 for an ego that looks all around.
    pub field_of_view_deg: f64,
    /// Full deceleration, m/s².
    pub brake_mps2: f64,
    /// Time in which the deceleration builds up, s.
    pub brake_rise_s: f64,
    /// Lateral acceleration of a swerve, m/s². A swerve while braking takes it from the brakes (friction circle).
    pub swerve_mps2: f64,
    /// Sideways distance of a swerve, and the farthest that it leads beside the route, metres.
    pub swerve_m: f64,
    /// The prediction of the others' motion. Not written where it is the first.
    #[serde(default, skip_serializing_if = "Forecast::is_of_motion")]
    pub forecast: Forecast,
    /// True if swerves by half a metre, one and two may help, too. The friction circle and the road bound them as they bound the far one.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub lesser_swerves: bool,
}

/// The ego's assumed expectation of the others.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Forecast {
    /// They keep velocity, or speed and turn rate.
    #[default]
    Motion,
    /// The same, and they may go along their lanes and any exit of these.
    Lanes,
}

impl Forecast {
    fn is_of_motion(&self) -> bool {
        *self == Forecast::Motion
    }
}

impl AvoidanceOptions {
    /// The careful and competent human driver of UN Regulation 157 (annex 4, appendix 3): 0.4 s to evaluate a risk and
    /// 0.75 s to begin to brake, 0.774 g after 0.6 s. Swerves with 0.5 g (Adams 1994, UMTRI-94-19) by one lane.
    pub const SHIPPED: AvoidanceOptions = AvoidanceOptions {
        horizon_s: 3.0,
        reaction_s: 1.15,
        field_of_view_deg: 200.0,
        brake_mps2: 7.59,
        brake_rise_s: 0.6,
        swerve_mps2: 4.9,
        swerve_m: 3.5,
        forecast: Forecast::Motion,
        lesser_swerves: false,
    };

    /// Returns the options with their bounds: name, value, lowest and highest.
    fn bounds(&self) -> [(&'static str, f64, f64, f64); 7] {
        [
            ("avoidance.horizon_s", self.horizon_s, 0.1, 10.0),
            ("avoidance.reaction_s", self.reaction_s, 0.0, 10.0),
            ("avoidance.field_of_view_deg", self.field_of_view_deg, 1.0, 360.0),
            ("avoidance.brake_mps2", self.brake_mps2, 0.1, 20.0),
            ("avoidance.brake_rise_s", self.brake_rise_s, 0.0, 5.0),
            ("avoidance.swerve_mps2", self.swerve_mps2, 0.1, 20.0),
            ("avoidance.swerve_m", self.swerve_m, 0.0, 20.0),
        ]
    }
}

/// An option that nothing can be simulated with.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SimulatorOptionsError {
    /// A number beyond its bounds.
    #[error("simulator.{place} is {found}, expected {low} to {high}; correct the experiment file")]
    Bound {
        /// The key below `[simulator]`.
        place: &'static str,
        /// Its value.
        found: f64,
        /// The lowest value that is allowed.
        low: f64,
        /// The highest value that is allowed.
        high: f64,
    },
    /// Corners are looked for in a path that recorded vehicles are wider than.
    #[error(
        "simulator.plant.obstacle looks for corners while traffic_boxes is \"recorded\", expected the boxes for which MetaDrive has that \
         test: a recorded vehicle wider than the path (2 m) has no corner in it and would not be seen; write traffic_boxes = \
         \"metadrive\", or obstacle = \"reaches\""
    )]
    CornersOfRecordedBoxes,
}
