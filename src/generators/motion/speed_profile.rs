//! Speed profiles: accelerate evenly, then hold. The mildest one that covers a distance in a given time.

/// Acceleration until `until_s`, then constant speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpeedProfile {
    /// Speed at the start, m/s.
    pub speed_mps: f64,
    /// Constant acceleration, m/s².
    pub acceleration_mps2: f64,
    /// When the acceleration ends, seconds from the start.
    pub until_s: f64,
}

impl SpeedProfile {
    /// The mildest acceleration of `±step, ±2 step, .. ±levels step` with which `distance_m` is covered in `time_s`,
    /// never backing up. Distances within 1 cm of keeping the speed need none. `None` if no level suffices.
    pub fn reaching(
        distance_m: f64,
        time_s: f64,
        speed_mps: f64,
        step_mps2: f64,
        levels: usize,
    ) -> Option<SpeedProfile> {
        let kept = speed_mps * time_s;
        let missing = distance_m - kept;
        if missing.abs() < 0.01 {
            return Some(SpeedProfile { speed_mps, acceleration_mps2: 0.0, until_s: 0.0 });
        }
        for level in 1..=levels {
            let a = step_mps2 * level as f64 * missing.signum();
            // a (t T - t^2 / 2) = missing
            let root = time_s * time_s - 2.0 * missing / a;
            if root < 0.0 {
                continue;
            }
            let until_s = time_s - root.sqrt();
            if speed_mps + a * until_s >= -1e-9 {
                return Some(SpeedProfile { speed_mps, acceleration_mps2: a, until_s });
            }
        }
        None
    }

    /// Speed after a time, m/s.
    pub fn speed_at(&self, time_s: f64) -> f64 {
        (self.speed_mps + self.acceleration_mps2 * time_s.min(self.until_s)).max(0.0)
    }

    /// Way driven after a time, metres.
    pub fn distance_at(&self, time_s: f64) -> f64 {
        let t = time_s.min(self.until_s);
        let during = self.speed_mps * t + 0.5 * self.acceleration_mps2 * t * t;
        during + self.speed_at(time_s) * (time_s - t)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_profile_covers_its_distance_in_its_time(speed in 0.0..25.0f64, distance in 0.0..250.0f64) {
            if let Some(profile) = SpeedProfile::reaching(distance, 8.0, speed, 1.0, 3) {
                prop_assert!((profile.distance_at(8.0) - distance).abs() < 0.011);
                prop_assert!(profile.acceleration_mps2.abs() <= 3.0);
                prop_assert!(profile.speed_at(8.0) >= 0.0);
            }
        }
    }

    #[test]
    fn the_mildest_level_is_taken() {
        let mild = SpeedProfile::reaching(100.0, 8.0, 10.0, 1.0, 3).unwrap();
        assert_eq!(mild.acceleration_mps2, 1.0);
        let hard = SpeedProfile::reaching(160.0, 8.0, 10.0, 1.0, 3).unwrap();
        assert_eq!(hard.acceleration_mps2, 3.0);
        assert_eq!(SpeedProfile::reaching(400.0, 8.0, 10.0, 1.0, 3), None);
    }
}
