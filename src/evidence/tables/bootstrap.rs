//! 95 % intervals by the percentile bootstrap over scenes (Efron): scenes are drawn with replacement, and what is drawn
//! together stays together, so that a difference between two programs is paired by scene. Where a search was repeated with
//! several seeds, its repetitions are drawn with replacement too, each with the drawn scenes (a two-level, hierarchical
//! bootstrap): the interval then holds the spread between searches as well.

use serde::Serialize;
use std::collections::BTreeMap;

use crate::kernel::{Digest, Seed, Stream, num};

/// Resamples an interval rests on.
pub const RESAMPLES: usize = 2000;
/// Root of the resampling streams. No result of a run depends on it; the tables name it.
pub const SEED: Seed = Seed(95);
const LEVELS: [f64; 2] = [0.025, 0.975];
/// What a one-sided bound of 95 % leaves.
const CHANCE: f64 = 0.05;

/// A number with its interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Estimate {
    pub value: f64,
    /// 95 % bootstrap interval over scenes and seeds; `None` for a number that has none.
    pub interval: Option<[f64; 2]>,
}

impl Estimate {
    /// A number without an interval.
    pub fn plain(value: f64) -> Estimate {
        Estimate { value, interval: None }
    }
}

/// One value a scene of a held-out suite; `None` where the scene has no label.
#[derive(Clone, Debug)]
pub struct PerScene {
    /// Which suite: values of one suite are resampled together, those of different suites independently.
    pub suite: Digest,
    pub values: Vec<Option<f64>>,
}

/// One search and its repetitions.
#[derive(Clone, Debug)]
pub struct Search {
    /// Which search: quantities of one search draw the same repetitions.
    pub id: Digest,
    /// One a seed, in the order of the seeds.
    pub seeds: Vec<PerScene>,
}

/// A mean over searches of the mean over their repetitions of the means over scenes.
pub type Quantity = Vec<Search>;

/// Value and interval of each quantity, all from the same draws. `None` where a quantity rests on no label.
pub fn estimates(quantities: &[Quantity]) -> Vec<Option<Estimate>> {
    quantities.iter().zip(&resampled(quantities)).map(|(quantity, values)| estimate(quantity, values)).collect()
}

/// The same for differences, each with its chance under no difference: twice the share of resamples on the far side of 0, the
/// value itself counted as one of them, at most 1.
pub fn compared_with_zero(differences: &[Quantity]) -> Vec<Option<(Estimate, f64)>> {
    let chance = |values: &[f64]| {
        let beyond = |holds: &dyn Fn(f64) -> bool| values.iter().filter(|value| holds(**value)).count();
        let least = beyond(&|value| value <= 0.0).min(beyond(&|value| value >= 0.0));
        (2.0 * (least + 1) as f64 / (values.len() + 1) as f64).min(1.0)
    };
    let drawn = resampled(differences);
    let all = differences.iter().zip(&drawn);
    all.map(|(quantity, values)| Some((estimate(quantity, values)?, chance(values)))).collect()
}

/// One quantity divided by another, both from the same draws. `None` where either rests on nothing or the divisor is 0.
pub fn ratio(of: &Quantity, by: &Quantity) -> Option<Estimate> {
    let both = [of.clone(), by.clone()];
    let drawn = resampled(&both);
    let value = |at: usize| estimate(&both[at], &drawn[at]).map(|found| found.value);
    let (above, below) = (value(0)?, value(1)?);
    let ratios: Vec<f64> = drawn[0].iter().zip(&drawn[1]).filter(|(_, b)| **b != 0.0).map(|(a, b)| a / b).collect();
    (below != 0.0).then(|| Estimate { value: above / below, interval: interval(&ratios) })
}

fn estimate(quantity: &Quantity, values: &[f64]) -> Option<Estimate> {
    let value = mean_over(quantity, |s| (0..s.seeds.len()).collect(), |part| (0..part.values.len()).collect())?;
    Some(Estimate { value, interval: interval(values) })
}

/// Resampled values of each quantity, all from the same draws.
fn resampled(quantities: &[Quantity]) -> Vec<Vec<f64>> {
    let (mut suites, mut searches) = (BTreeMap::new(), BTreeMap::new());
    for search in quantities.iter().flatten() {
        searches.insert(search.id, search.seeds.len());
        search.seeds.iter().for_each(|part| {
            suites.insert(part.suite, part.values.len());
        });
    }
    let (mut suites, mut searches) = (Draws::of("bootstrap", suites), Draws::of("bootstrap-seeds", searches));
    let mut resampled: Vec<Vec<f64>> = vec![Vec::with_capacity(RESAMPLES); quantities.len()];
    for _ in 0..RESAMPLES {
        let (scenes, seeds) = (suites.next(), searches.next());
        let drawn = |draws: &BTreeMap<Digest, Vec<usize>>, of: &Digest| draws.get(of).cloned().unwrap_or_default();
        for (quantity, values) in quantities.iter().zip(&mut resampled) {
            values.extend(mean_over(quantity, |s| drawn(&seeds, &s.id), |part| drawn(&scenes, &part.suite)));
        }
    }
    resampled
}

/// The 95 % percentile interval of a quantity's resampled values; `None` without any.
pub fn interval(resampled: &[f64]) -> Option<[f64; 2]> {
    Some([num::quantile(resampled, LEVELS[0])?, num::quantile(resampled, LEVELS[1])?])
}

/// The largest share with which none of `count` independent scenes would still be a success in one study of twenty: the exact (Clopper
/// and Pearson) upper 95 % bound, one-sided, where a bootstrap has nothing to draw from.
pub fn zero_of_at_most(count: usize) -> f64 {
    1.0 - num::pow(CHANCE, 1.0 / count.max(1) as f64)
}

/// Draws with replacement from several sets, each with a random stream of its own.
struct Draws(Vec<(Digest, usize, Stream)>);

impl Draws {
    fn of(purpose: &str, sizes: BTreeMap<Digest, usize>) -> Draws {
        let stream = |id: &Digest| SEED.stream(&["evidence", "tables", purpose, &id.to_hex()]);
        Draws(sizes.into_iter().filter(|(_, size)| *size > 0).map(|(id, size)| (id, size, stream(&id))).collect())
    }

    fn next(&mut self) -> BTreeMap<Digest, Vec<usize>> {
        let draw =
            |(id, size, stream): &mut (Digest, usize, Stream)| (*id, (0..*size).map(|_| stream.below(*size)).collect());
        self.0.iter_mut().map(draw).collect()
    }
}

/// Mean over searches of the mean over these seeds of the mean over the labelled ones of these scenes. A repetition
/// without a label drops out; `None` where a search has no other.
fn mean_over(
    quantity: &Quantity,
    seeds: impl Fn(&Search) -> Vec<usize>,
    scenes: impl Fn(&PerScene) -> Vec<usize>,
) -> Option<f64> {
    let of_seed = |part: &PerScene| {
        let labelled = scenes(part).into_iter().filter_map(|scene| part.values.get(scene).copied().flatten());
        num::mean(&labelled.collect::<Vec<f64>>())
    };
    let of_search = |search: &Search| {
        let of_seeds = seeds(search).into_iter().filter_map(|seed| search.seeds.get(seed)).filter_map(of_seed);
        num::mean(&of_seeds.collect::<Vec<f64>>())
    };
    num::mean(&quantity.iter().map(of_search).collect::<Option<Vec<f64>>>()?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn suite(name: &str, values: &[f64]) -> PerScene {
        PerScene { suite: Digest::of_bytes(name.as_bytes()), values: values.iter().copied().map(Some).collect() }
    }

    /// A search without repetition.
    fn once(part: PerScene) -> Search {
        Search { id: Digest::of_bytes(b"search"), seeds: vec![part] }
    }

    #[test]
    fn a_ratio_is_of_the_same_draws() {
        let of = |values: &[f64]| -> Quantity {
            let seed = |(at, value): (usize, &f64)| suite(&at.to_string(), &[*value]);
            vec![Search { id: Digest::of_bytes(b"search"), seeds: values.iter().enumerate().map(seed).collect() }]
        };
        let (above, below) = (of(&[2.0, 6.0, 1.0]), of(&[1.0, 3.0, 0.5]));
        let of_seeds = ratio(&above, &below).unwrap();
        assert_eq!((of_seeds.value, of_seeds.interval), (2.0, Some([2.0, 2.0])), "twice in every draw");
        let spread = ratio(&above, &of(&[1.0, 1.0, 1.0])).unwrap();
        assert_eq!((spread.value, spread.interval.unwrap()[0] < 2.0), (3.0, true));
        assert!(spread.interval.unwrap()[1] > 4.0, "{spread:?}");
        assert_eq!(ratio(&above, &of(&[0.0, 0.0, 0.0])), None);
    }

    fn one(values: &[f64]) -> Estimate {
        estimates(&[vec![once(suite("a", values))]])[0].unwrap()
    }

    #[test]
    fn the_value_is_the_mean_over_lineages_of_their_means_over_labelled_scenes() {
        let unlabelled = PerScene { values: vec![Some(1.0), None, Some(0.0), Some(0.5)], ..suite("a", &[]) };
        let of_seeds = estimates(&[vec![once(unlabelled), once(suite("b", &[0.2, 0.4]))]])[0].unwrap();
        assert!((of_seeds.value - (0.5 + 0.3) / 2.0).abs() < 1e-15, "{of_seeds:?}");
    }

    #[test]
    fn a_rate_of_a_half_over_a_hundred_scenes_has_the_interval_of_the_binomial() {
        // Standard error 0.05, so the interval is 0.5 -+ 1.96 * 0.05 up to the grid of 0.01 and resampling noise.
        let values: Vec<f64> = (0..100).map(|i| f64::from(i % 2)).collect();
        let [low, high] = one(&values).interval.unwrap();
        assert!((low - 0.402).abs() < 0.015 && (high - 0.598).abs() < 0.015, "{low} {high}");
    }

    #[test]
    fn a_sample_without_spread_has_an_interval_without_width() {
        assert_eq!(one(&[0.3; 7]).interval, Some([one(&[0.3; 7]).value; 2]));
        assert_eq!(one(&[0.25]), Estimate { value: 0.25, interval: Some([0.25; 2]) });
    }

    #[test]
    fn two_programs_that_differ_alike_on_every_scene_differ_without_width() {
        let (before, after) = ([0.0, 1.0, 0.5, 0.25], [0.125, 1.125, 0.625, 0.375]);
        let paired: Vec<f64> = after.iter().zip(before).map(|(a, b)| a - b).collect();
        let of_seeds = estimates(&[vec![once(suite("a", &after))], vec![once(suite("a", &paired))]]);
        assert_eq!(of_seeds[1].unwrap().interval, Some([0.125; 2]));
        let [low, high] = of_seeds[0].unwrap().interval.unwrap();
        assert!(high - low > 0.3);
    }

    #[test]
    fn lineages_of_one_suite_are_drawn_together_and_of_two_suites_apart() {
        let (x, y) = ([0.0, 1.0, 0.0, 1.0, 0.0, 1.0], [1.0, 0.0, 1.0, 0.0, 1.0, 0.0]);
        let width = |quantity: Quantity| {
            let [low, high] = estimates(&[quantity])[0].unwrap().interval.unwrap();
            high - low
        };
        assert_eq!(width(vec![once(suite("a", &x)), once(suite("a", &y))]), 0.0);
        assert!(width(vec![once(suite("a", &x)), once(suite("b", &y))]) > 0.2);
    }

    #[test]
    fn a_difference_that_is_everywhere_is_sure_and_one_that_evens_out_is_not() {
        let of_seeds = |values: &[f64]| compared_with_zero(&[vec![once(suite("a", values))]])[0].unwrap();
        let (estimate, chance) = of_seeds(&[0.1; 12]);
        assert!((estimate.value - 0.1).abs() < 1e-12 && chance < 0.002, "{chance}");
        let (_, even) = of_seeds(&[0.1, -0.1, 0.2, -0.2, 0.3, -0.3]);
        assert!(even > 0.8, "{even}");
        // Without any difference nothing speaks against none.
        assert_eq!(of_seeds(&[0.0; 5]).1, 1.0);
        assert_eq!(of_seeds(&[0.1; 12]).0, estimates(&[vec![once(suite("a", &[0.1; 12]))]])[0].unwrap());
    }

    #[test]
    fn none_of_a_count_has_the_exact_bound_of_the_binomial() {
        // (1 - p)^80 = 0.05, by hand: p = 1 - exp(ln 0.05 / 80) = 0.03675; of one scene 0.95; "the rule of three" for many.
        assert!((zero_of_at_most(80) - 0.036_755).abs() < 1e-5, "{}", zero_of_at_most(80));
        assert!((zero_of_at_most(1) - 0.95).abs() < 1e-12);
        assert!((3000.0 * zero_of_at_most(3000) - 3.0).abs() < 0.01);
    }

    #[test]
    fn no_label_is_no_number() {
        assert_eq!(estimates(&[vec![once(suite("a", &[]))], vec![]]), [None, None]);
        let nothing = PerScene { values: vec![None, None], ..suite("a", &[]) };
        assert_eq!(estimates(&[vec![once(nothing), once(suite("b", &[1.0]))]]), [None]);
    }

    #[test]
    fn intervals_do_not_depend_on_what_else_is_estimated() {
        let (a, b) = (once(suite("a", &[0.0, 1.0, 1.0])), once(suite("b", &[0.0, 0.1, 0.7, 0.2])));
        let alone = estimates(&[vec![a.clone()]]);
        assert_eq!(estimates(&[vec![b], vec![a]])[1], alone[0]);
    }

    #[test]
    fn the_spread_between_seeds_is_part_of_the_interval() {
        // Five repetitions of one rate each, all scenes alike: only the seeds differ. 5^5 draws of five from
        // {0, .25, .5, .75, 1}: 2.5 % lie at or below a mean of .2, as many at or above .8.
        let seeds = [0.0, 0.25, 0.5, 0.75, 1.0].map(|rate| suite("a", &[rate; 20])).to_vec();
        let search = Search { id: Digest::of_bytes(b"search"), seeds };
        let of_seeds = estimates(&[vec![search.clone()]])[0].unwrap();
        let [low, high] = of_seeds.interval.unwrap();
        assert!((of_seeds.value - 0.5).abs() < 1e-15);
        assert!((low - 0.2).abs() < 0.051 && (high - 0.8).abs() < 0.051, "{low} {high}");
        // Two quantities of one search draw the same repetitions: their difference has no width.
        let shifted = search.seeds.iter().map(|part| PerScene {
            values: part.values.iter().map(|value| value.map(|x| x + 0.1)).collect(),
            ..part.clone()
        });
        let shifted = Search { seeds: shifted.collect(), ..search };
        let [other_low, other_high] = estimates(&[vec![shifted]])[0].unwrap().interval.unwrap();
        assert!((other_low - low - 0.1).abs() < 1e-12 && (other_high - high - 0.1).abs() < 1e-12);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        #[test]
        fn the_interval_contains_the_value(values in prop::collection::vec(0.0..=1.0f64, 1..40)) {
            let of_seeds = one(&values);
            let [low, high] = of_seeds.interval.unwrap();
            // One ulp or so: a mean of equal numbers in another order.
            prop_assert!(low <= of_seeds.value + 1e-12 && of_seeds.value <= high + 1e-12, "{of_seeds:?}");
        }

        #[test]
        fn the_interval_of_a_rate_contains_the_rate(hits in prop::collection::vec(any::<bool>(), 1..60)) {
            let of_seeds = one(&hits.iter().map(|hit| f64::from(u8::from(*hit))).collect::<Vec<_>>());
            let [low, high] = of_seeds.interval.unwrap();
            prop_assert!(0.0 <= low && low <= of_seeds.value && of_seeds.value <= high && high <= 1.0, "{of_seeds:?}");
        }
    }
}
