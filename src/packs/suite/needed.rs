//! Number of scenes that are needed to show a difference between two drivers.

/// Normal quantiles of a two-sided test at 5 % and of a power of 80 %.
const Z_TWO_SIDED: f64 = 1.959_963_984_540_054;
const Z_POWER: f64 = 0.841_621_233_572_914;

/// Returns the number of scenes with which McNemar's test at 5 % finds a difference of this size four times out of five, if discordant
/// pairs stay as frequent (Connor 1987). `None` where there is no difference.
pub fn needed(b: usize, c: usize, pairs: usize) -> Option<usize> {
    if b == c || pairs == 0 {
        return None;
    }
    let n = pairs as f64;
    let (discordant, difference) = ((b + c) as f64 / n, (b as f64 - c as f64) / n);
    let spread = (discordant - difference * difference).max(0.0);
    let root = Z_TWO_SIDED * discordant.sqrt() + Z_POWER * spread.sqrt();
    Some((root * root / (difference * difference)).ceil() as usize)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scenes_grow_with_the_square_of_what_is_looked_for() {
        // By hand: discordant .2, difference .1: (1.95996 sqrt .2 + .84162 sqrt .19)^2 / .01 = 154.6.
        assert_eq!(needed(15, 5, 100), Some(155));
        assert_eq!(needed(5, 15, 100), Some(155), "whoever is better");
        assert_eq!((needed(7, 7, 100), needed(0, 0, 10), needed(0, 0, 0)), (None, None, None));
        let (half, whole) = (needed(30, 20, 200).unwrap() as f64, needed(35, 15, 200).unwrap() as f64);
        assert!((half / whole - 4.0).abs() < 0.1, "{half} {whole}");
    }
}
