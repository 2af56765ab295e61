//! A share of scenes with the interval of its chance.

use serde::Serialize;

/// A standard normal variable lies within plus or minus this with a chance of 95 %.
const Z95: f64 = 1.959_963_984_540_054;

/// A count out of a total, with a 95 % interval (Wilson 1927), which holds near 0 and 1 and for few scenes too.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Share {
    pub count: usize,
    pub of: usize,
    pub value: f64,
    pub interval: [f64; 2],
}

impl Share {
    /// Returns the share; `None` for a total of 0.
    pub fn of(count: usize, of: usize) -> Option<Share> {
        if of == 0 {
            return None;
        }
        let (n, z2) = (of as f64, Z95 * Z95);
        let value = count as f64 / n;
        let centre = (value + z2 / (2.0 * n)) / (1.0 + z2 / n);
        let half = Z95 / (1.0 + z2 / n) * (value * (1.0 - value) / n + z2 / (4.0 * n * n)).sqrt();
        let low = if count == 0 { 0.0 } else { (centre - half).max(0.0) };
        let high = if count == of { 1.0 } else { (centre + half).min(1.0) };
        Some(Share { count, of, value, interval: [low, high] })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn intervals_are_those_of_published_tables() {
        // Newcombe 1998, table I, method 3: 81 of 263, 15 of 148, 0 of 20, 1 of 29.
        let table =
            [(81, 263, 0.2553, 0.3662), (15, 148, 0.0624, 0.1605), (0, 20, 0.0, 0.1611), (1, 29, 0.0061, 0.1718)];
        for (count, of, low, high) in table {
            let share = Share::of(count, of).unwrap();
            assert!((share.interval[0] - low).abs() < 5e-5 && (share.interval[1] - high).abs() < 5e-5, "{share:?}");
        }
        assert_eq!(Share::of(0, 0), None);
        assert_eq!(Share::of(7, 7).unwrap().interval[1], 1.0);
    }
}
