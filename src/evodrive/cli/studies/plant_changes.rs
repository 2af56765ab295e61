//! The options of our plant, each changed by itself: what `agree` tries with the commands of a rollout about which two simulators
//! disagree.

use crate::ego::Policy;
use crate::sim::bicycle::CorneringLoss;
use crate::sim::{EgoCar, FollowerStart, Obstacle, PlantOptions, ReactiveTraffic, TrafficBoxes};

/// Loss of speed in bends and deceleration by brakes are raised and lowered by this share.
const SHARE: f64 = 0.25;

/// A plant that differs in one option, or a driver that does.
pub struct PlantChange {
    /// The option, and what became of it.
    pub name: String,
    pub plant: PlantOptions,
    /// True if the driver by IDM heeds lights where it did not, and the other way round.
    other_lights: bool,
}

impl PlantChange {
    /// The driver with this change.
    pub fn ego(&self, ego: &Policy) -> Policy {
        match ego {
            Policy::Idm if self.other_lights => Policy::IdmMindingLights,
            Policy::IdmMindingLights if self.other_lights => Policy::Idm,
            same => same.clone(),
        }
    }
}

/// Every change of a plant.
pub fn plant_changes(plant: &PlantOptions) -> Vec<PlantChange> {
    let mut changes = Vec::new();
    let mut add = |name: &str, change: &dyn Fn(&mut PlantOptions)| {
        let mut changed = *plant;
        change(&mut changed);
        changes.push(PlantChange { name: name.to_string(), plant: changed, other_lights: false });
    };
    match plant.traffic_boxes {
        TrafficBoxes::Recorded => add("boxes of MetaDrive", &|plant| plant.traffic_boxes = TrafficBoxes::Metadrive),
        TrafficBoxes::Metadrive => add("boxes as recorded", &|plant| plant.traffic_boxes = TrafficBoxes::Recorded),
    }
    match plant.obstacle {
        Obstacle::Reaches => add("detection by corners", &|plant| plant.obstacle = Obstacle::Corner),
        Obstacle::Corner | Obstacle::Lane => add("detection by reach", &|plant| plant.obstacle = Obstacle::Reaches),
    }
    match plant.follower_start {
        FollowerStart::Recorded => {
            add("followers begin at rest", &|plant| plant.follower_start = FollowerStart::Standing)
        }
        FollowerStart::Standing => {
            add("followers begin as recorded", &|plant| plant.follower_start = FollowerStart::Recorded);
        }
    }
    for (name, reactive_traffic) in [
        ("no followers", ReactiveTraffic::Off),
        ("followers of who drives", ReactiveTraffic::Driving),
        ("followers under replay, too", ReactiveTraffic::Always),
    ] {
        if plant.reactive_traffic != reactive_traffic {
            add(name, &|plant| plant.reactive_traffic = reactive_traffic);
        }
    }
    if plant.ego_car == EgoCar::Sprung {
        // Its wheels decide the loss of speed in bends and the effect of brakes.
        add("the ego's car without springs", &|plant| plant.ego_car = EgoCar::SingleTrack);
    } else {
        for (word, factor) in [("more", 1.0 + SHARE), ("less", 1.0 - SHARE)] {
            add(&format!("bends cost a quarter {word}"), &|plant| scale(&mut plant.cornering_loss, factor));
        }
        for (word, factor) in [("harder", 1.0 + SHARE), ("softer", 1.0 - SHARE)] {
            add(&format!("brakes a quarter {word}"), &|plant| {
                plant.half_brake_mps2 *= factor;
                plant.full_brake_mps2 *= factor;
                if let Some(settling) = &mut plant.settling {
                    settling.full_brake_mps2 *= factor;
                }
            });
        }
    }
    changes.push(PlantChange { name: "lights the other way".to_string(), plant: *plant, other_lights: true });
    changes
}

fn scale(loss: &mut CorneringLoss, factor: f64) {
    match loss {
        CorneringLoss::Steering { share } => *share *= factor,
        CorneringLoss::Skid { share, skid, drive, .. } => {
            *share *= factor;
            *skid *= factor;
            *drive = (*drive * factor).min(1.0);
        }
        // Tyres that are softer by so much slip more.
        CorneringLoss::TyreSlip { cornering_coefficient } => *cornering_coefficient /= factor,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_change_is_of_one_option_and_no_two_are_the_same() {
        for plant in [PlantOptions::PHYSICAL, PlantOptions::METADRIVE_0_4_3] {
            let changes = plant_changes(&plant);
            for (i, change) in changes.iter().enumerate() {
                assert_eq!(change.plant == plant, change.other_lights, "{}", change.name);
                let others = changes[..i].iter().filter(|other| !other.other_lights);
                assert!(others.into_iter().all(|other| other.plant != change.plant), "{}", change.name);
            }
        }
        let lights = plant_changes(&PlantOptions::PHYSICAL).pop().unwrap();
        assert_eq!(lights.ego(&Policy::Idm).name(), "idm-lights");
        assert_eq!(lights.ego(&Policy::Replay).name(), "replay");
    }
}
