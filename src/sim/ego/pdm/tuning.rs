//! Constants of PDM-Closed that a search may change, each between bounds, and drawn neighbours of a setting.

use super::settings::Settings;
use crate::kernel::{Stream, num};

/// A constant: its name, its bounds, and its place in the settings.
pub struct Constant {
    /// Name of its field, or of a group of fields.
    pub name: &'static str,
    /// Lower bound, in the field's unit.
    pub least: f64,
    /// Upper bound, in the field's unit.
    pub most: f64,
    /// Reads it from the settings.
    pub read: fn(&Settings) -> f64,
    write: fn(&mut Settings, f64),
}

/// Decimals of a drawn constant: it is written down and read again.
const DECIMALS: u32 = 3;
/// Largest factor by which a constant moves at once, and most constants that move.
const FACTOR_MAX: f64 = 2.0;
const MOVED_MAX: usize = 3;

macro_rules! constant {
    ($name:literal, $least:expr, $most:expr, $settings:ident => $place:expr) => {
        Constant {
            name: $name,
            least: $least,
            most: $most,
            read: |$settings| $place,
            write: |$settings, value| $place = value,
        }
    };
}

/// The constants that a search may change. The vehicle, comfort's bounds and who is kept stay as published.
pub const CONSTANTS: [Constant; 12] = [
    constant!("gap_min_m", 0.5, 5.0, s => s.gap_min_m),
    constant!("headway_s", 0.8, 3.0, s => s.headway_s),
    constant!("acceleration_mps2", 0.7, 2.4, s => s.acceleration_mps2),
    constant!("brake_mps2", 1.5, 7.0, s => s.brake_mps2),
    constant!("free_speed_mps", 8.0, 20.0, s => s.free_speed_mps),
    constant!("radius_m", 30.0, 90.0, s => s.radius_m),
    constant!("progress_weight", 0.5, 10.0, s => s.progress_weight),
    constant!("time_to_collision_weight", 1.0, 20.0, s => s.time_to_collision_weight),
    constant!("comfort_weight", 0.2, 6.0, s => s.comfort_weight),
    // The looks in between keep their shares of it.
    Constant {
        name: "collision_look_s",
        least: 0.6,
        most: 3.0,
        read: |settings| settings.collision_looks_s[3],
        write: |settings, last_s| settings.collision_looks_s = [0.0, last_s / 3.0, 2.0 * last_s / 3.0, last_s],
    },
    constant!("emergency_s", 0.5, 3.9, s => s.emergency_s),
    constant!("emergency_mps", 2.0, 20.0, s => s.emergency_mps),
];

/// Draws a neighbour of a setting: one to three constants, each moved by up to a factor of two either way within its bounds.
pub fn neighbour(of: &Settings, stream: &mut Stream) -> Settings {
    let mut moved = *of;
    for _ in 0..1 + stream.below(MOVED_MAX) {
        let constant = &CONSTANTS[stream.below(CONSTANTS.len())];
        let factor = num::pow(FACTOR_MAX, stream.uniform(-1.0, 1.0));
        let value = ((constant.read)(&moved) * factor).clamp(constant.least, constant.most);
        (constant.write)(&mut moved, num::rounded(value, DECIMALS));
    }
    moved
}

/// Returns the first constant beyond its bounds, with its value.
pub fn beyond(of: &Settings) -> Option<(&'static str, f64)> {
    let own = |constant: &Constant| (constant.name, (constant.read)(of), constant.least, constant.most);
    CONSTANTS.iter().map(own).find(|(_, found, least, most)| !(least..=most).contains(&found)).map(|of| (of.0, of.1))
}

#[cfg(test)]
mod tests {
    use super::super::settings::PUBLISHED;
    use super::*;
    use crate::kernel::Seed;

    #[test]
    fn the_published_constants_and_their_neighbours_keep_to_their_bounds() {
        assert_eq!(beyond(&PUBLISHED), None);
        let mut stream = Seed(3).stream(&["neighbours"]);
        let mut settings = PUBLISHED;
        let mut moved = std::collections::BTreeSet::new();
        for _ in 0..400 {
            let next = neighbour(&settings, &mut stream);
            moved.extend(CONSTANTS.iter().filter(|of| (of.read)(&next) != (of.read)(&settings)).map(|of| of.name));
            settings = next;
            assert_eq!(beyond(&settings), None);
            let looks = settings.collision_looks_s;
            assert!(looks.windows(2).all(|pair| pair[0] < pair[1]), "{looks:?}");
        }
        assert_eq!(moved.len(), CONSTANTS.len(), "{moved:?}");
    }

    #[test]
    fn a_constant_beyond_its_bounds_is_named() {
        assert_eq!(beyond(&Settings { headway_s: 9.0, ..PUBLISHED }), Some(("headway_s", 9.0)));
        assert!(beyond(&Settings { headway_s: f64::NAN, ..PUBLISHED }).is_some());
    }
}
