//! A driver of one's own: it keeps a time gap to whoever is ahead on its route, and steers at a point of the route.
//! It drives in three generated scenes beside the IDM driver, and the outcomes are printed.
//!
//! `cargo run --example own_driver`

use evodrive::ego::Policy;
use evodrive::kernel::Seed;
use evodrive::scene::safebench::TrafficFamily;
use evodrive::sim::{Control, Driver, Intervention, Plant, SimError, View, rollout};
use evodrive::synth::family_scene;

/// Keeps `time_gap_s` seconds to the road user ahead and never goes faster than `speed_mps_max`.
struct TimeGapDriver {
    time_gap_s: f64,
    speed_mps_max: f64,
}

/// Gap that is kept even when standing, centre to centre, metres.
const STANDING_GAP_M: f64 = 7.0;
/// Gain by which a wrong speed is corrected, 1/s.
const SPEED_GAIN_1PS: f64 = 0.8;
/// Distance ahead on the route at which the driver aims, metres.
const AIM_M: f64 = 6.0;
/// Distance between the axles that the steering law assumes, metres.
const WHEELBASE_M: f64 = 2.7;

impl Driver for TimeGapDriver {
    /// This driver remembers nothing, so there is nothing to reset.
    fn begin(&mut self, _plant: &Plant) {}

    fn decide(&mut self, view: &View<'_>) -> Control {
        let ego = view.ego();
        let safe_mps = match view.front() {
            Some(front) => ((front.gap_m - STANDING_GAP_M) / self.time_gap_s).max(0.0),
            None => self.speed_mps_max,
        };
        let acceleration_mps2 = SPEED_GAIN_1PS * (safe_mps.min(self.speed_mps_max) - ego.speed_mps);
        // Pure pursuit: the arc that leads through the point of the route that is AIM_M ahead.
        let to_aim = view.route().at(ego.along.s_m + AIM_M, ego.along.segment) - ego.sample.position;
        let curvature_1pm = 2.0 * ego.axis.cross(to_aim) / to_aim.norm_squared().max(1.0);
        Control::Drive { acceleration_mps2, steering_rad: WHEELBASE_M * curvature_1pm }
    }
}

fn main() -> Result<(), SimError> {
    for family in [TrafficFamily::StraightObstacle, TrafficFamily::VehiclePassing, TrafficFamily::RightTurn] {
        let scene = family_scene(family, 5, Seed(7));
        let plant = Plant::new(&scene)?;
        let mut own = TimeGapDriver { time_gap_s: 1.5, speed_mps_max: 9.0 };
        let drivers: [(&str, &mut dyn Driver); 2] = [("own", &mut own), ("idm", &mut *Policy::Idm.driver())];
        for (name, driver) in drivers {
            let outcome = rollout(&plant, &Intervention::default(), driver)?;
            println!(
                "{:32} {name:4} {:?} after {:.1} s, {:.0} % of the route, fastest {:.1} m/s",
                scene.id,
                outcome.end,
                0.1 * outcome.steps as f64,
                100.0 * outcome.route_completion,
                outcome.ego.speed_mps_max,
            );
        }
    }
    Ok(())
}
