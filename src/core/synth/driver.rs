//! One simulated driver: wishes, limits, and car following (the Intelligent Driver Model of Treiber, Hennecke and
//! Helbing 2000). This module does not know roads.

use super::variation::Variation;
use crate::kernel::{Stream, num};

/// Kind of a driver's vehicle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Body {
    Car,
    Van,
    Lorry,
    Bicycle,
}

/// Wishes and limits of one driver, and the size of the vehicle.
#[derive(Clone, Copy, Debug)]
pub(super) struct Driver {
    pub body: Body,
    pub length_m: f64,
    pub width_m: f64,
    /// Wanted speed as a share of the speed limit.
    pub haste: f64,
    /// Largest speed of the vehicle or rider, m/s.
    pub speed_mps_max: f64,
    pub headway_s: f64,
    pub gap_m: f64,
    pub acceleration_mps2: f64,
    pub braking_mps2: f64,
    /// Lateral acceleration that the driver accepts in bends.
    pub sideways_mps2: f64,
    /// Weight of others' disadvantage when changing lanes (MOBIL's politeness).
    pub politeness: f64,
    /// Time left over when crossing before others.
    pub margin_s: f64,
    /// Constant place in the lane, positive to the left.
    pub bias_m: f64,
}

/// Hardest braking that a driver is capable of, m/s².
pub(super) const BRAKING_MPS2_MAX: f64 = 7.0;

impl Driver {
    pub fn draw(body: Body, draw: &mut Stream) -> Driver {
        let (length, width, pace) = match body {
            Body::Car => (draw.uniform(4.0, 5.1), draw.uniform(1.75, 1.98), draw.uniform(1.1, 2.0)),
            Body::Van => (draw.uniform(5.4, 6.3), draw.uniform(2.0, 2.15), draw.uniform(0.9, 1.4)),
            Body::Lorry => (draw.uniform(8.0, 12.0), draw.uniform(2.4, 2.55), draw.uniform(0.6, 0.9)),
            Body::Bicycle => (draw.uniform(1.7, 1.9), draw.uniform(0.6, 0.75), draw.uniform(0.6, 1.0)),
        };
        Driver {
            body,
            length_m: length,
            width_m: width,
            haste: draw.normal(1.0, 0.09).clamp(0.78, 1.2),
            speed_mps_max: match body {
                Body::Car => 60.0,
                Body::Van => 38.0,
                Body::Lorry => 24.5,
                Body::Bicycle => draw.uniform(4.2, 7.0),
            },
            headway_s: draw.uniform(0.9, 1.8),
            gap_m: draw.uniform(1.6, 2.8),
            acceleration_mps2: pace,
            braking_mps2: draw.uniform(1.5, 2.5),
            sideways_mps2: draw.uniform(1.9, 3.0),
            politeness: draw.uniform(0.1, 0.5),
            margin_s: draw.uniform(0.1, 1.1),
            bias_m: if body == Body::Bicycle { draw.uniform(-0.9, -0.4) } else { draw.uniform(-0.12, 0.12) },
        }
    }

    /// Makes the driver differ from its model; a motorist's place is at most `aside_m_max` beside the lane's centre.
    pub fn differ(&mut self, unlike: &Variation<f64>, aside_m_max: f64, draw: &mut Stream) {
        self.haste = draw.normal(1.0, unlike.haste).clamp(0.4, 1.4);
        self.acceleration_mps2 *= unlike.pace;
        self.headway_s *= unlike.headway;
        if self.body != Body::Bicycle {
            self.bias_m = draw.normal(0.0, unlike.place_m).clamp(-aside_m_max, aside_m_max);
        }
    }

    /// Acceleration towards a wanted speed on an empty road.
    pub fn free(&self, speed: f64, wanted: f64) -> f64 {
        if speed <= wanted {
            self.acceleration_mps2 * (1.0 - num::powu(speed / wanted.max(0.1), 4))
        } else {
            ((wanted - speed) / 0.8).max(-1.4 * self.braking_mps2)
        }
    }

    /// Acceleration behind something `gap` metres ahead that moves at `ahead`; no free-road term.
    pub fn follow(&self, speed: f64, gap: f64, ahead: f64) -> f64 {
        self.interaction(speed, gap, ahead, self.gap_m, self.headway_s)
    }

    /// Acceleration towards standing still within `distance` metres.
    pub fn halt(&self, speed: f64, distance: f64) -> f64 {
        self.interaction(speed, distance + 0.5, 0.0, 0.9, 0.5)
    }

    fn interaction(&self, speed: f64, gap: f64, ahead: f64, standing: f64, headway: f64) -> f64 {
        let scale = 2.0 * (self.acceleration_mps2 * self.braking_mps2).sqrt();
        let wanted = standing + (speed * headway + speed * (speed - ahead) / scale).max(0.0);
        let ratio = wanted / gap.max(0.1);
        let idm = self.acceleration_mps2 * (1.0 - ratio * ratio);
        // IDM brakes far too hard when the gap is smaller than wanted. One and a half times the kinematically needed
        // braking is enough.
        let closing = (speed - ahead).max(0.0);
        let needed = closing * closing / (2.0 * (gap - 0.6 * standing).max(0.3));
        idm.max(-(1.5 * needed).max(self.braking_mps2)).max(-BRAKING_MPS2_MAX)
    }

    /// Seconds to travel a distance when speeding up towards `wanted`.
    pub fn travel_s(&self, distance: f64, speed: f64, wanted: f64) -> f64 {
        if distance <= 0.0 {
            return 0.0;
        }
        let pace = 0.8 * self.acceleration_mps2;
        let wanted = wanted.max(speed).max(1.0);
        let run_up = (wanted * wanted - speed * speed) / (2.0 * pace);
        if distance <= run_up {
            ((speed * speed + 2.0 * pace * distance).sqrt() - speed) / pace
        } else {
            (wanted - speed) / pace + (distance - run_up) / wanted
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernel::Seed;

    #[test]
    fn a_driver_comes_to_rest_before_what_stands_in_the_way() {
        let mut draw = Seed(3).stream(&["driver"]);
        for _ in 0..50 {
            let driver = Driver::draw(Body::Car, &mut draw);
            let (mut s, mut v) = (0.0, 14.0);
            for _ in 0..600 {
                let a = driver.free(v, 14.0).min(driver.follow(v, 100.0 - s, 0.0));
                let next = (v + 0.1 * a).max(0.0);
                s += 0.05 * (v + next);
                v = next;
            }
            assert!(v < 0.5 && s < 100.0 && s > 90.0, "{s} {v}");
        }
    }
}
