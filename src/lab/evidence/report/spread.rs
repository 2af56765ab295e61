//! Spread of a program's place in the plane: both objectives over scenes drawn anew.

use super::super::tables::interval;
use crate::kernel::{Seed, num};
use crate::objects::{RealismMean, RealismSums, SceneScore};

/// Draws of the scenes.
const RESAMPLES: usize = 500;
const SEED: Seed = Seed(20_250_101);

/// 95 % percentile intervals of attack and of the realism among the objectives over these scenes; `None` where there is nothing to draw.
/// Each program draws the same scenes, so equal labels have equal intervals.
pub fn of(labels: &[SceneScore], mean: RealismMean) -> Option<[[f64; 2]; 2]> {
    if labels.is_empty() {
        return None;
    }
    let mut stream = SEED.stream(&["evidence", "report", "spread"]);
    let (mut attacks, mut realisms) = (Vec::with_capacity(RESAMPLES), Vec::with_capacity(RESAMPLES));
    for _ in 0..RESAMPLES {
        let drawn: Vec<&SceneScore> = (0..labels.len()).map(|_| &labels[stream.below(labels.len())]).collect();
        attacks.push(num::sum(drawn.iter().map(|label| label.attack)) / drawn.len() as f64);
        realisms.extend(RealismSums::of(drawn).realism(mean));
    }
    Some([interval(&attacks)?, interval(&realisms)?])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::objects::fixture::scene_score;

    #[test]
    fn the_interval_is_that_of_the_scenes_and_narrower_with_more_of_them() {
        let labels = |count: usize| -> Vec<SceneScore> {
            (0..count).map(|k| scene_score(&k.to_string(), (k % 2) as f64, 0.9)).collect()
        };
        let [attack, realism] = of(&labels(100), RealismMean::Strict).unwrap();
        // Of a rate of a half over a hundred scenes the standard error is 0.05.
        assert!((attack[0] - 0.4).abs() < 0.03 && (attack[1] - 0.6).abs() < 0.03, "{attack:?}");
        assert!((realism[0] - 0.9).abs() < 1e-12 && (realism[1] - 0.9).abs() < 1e-12, "{realism:?}");
        let [fewer, _] = of(&labels(20), RealismMean::Strict).unwrap();
        assert!(fewer[1] - fewer[0] > 1.5 * (attack[1] - attack[0]));
        assert_eq!(of(&[], RealismMean::Strict), None);
    }
}
