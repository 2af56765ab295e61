//! 95 % intervals by the percentile bootstrap over scenes (Efron): scenes are drawn with replacement, and all values of a scene
//! stay together, so that a difference between two programs is paired by scene. Where a search was repeated with
//! several seeds, the spread between seeds is added to that of the draws, and Student's t accounts for their small number
//! (`student.rs`): m ± t(ν) √(s² / n + v), where s² is the variance of the n seeds' means, v that of the mean over drawn scenes, and
//! ν is Satterthwaite's number of degrees of freedom for the sum.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

use super::student;
use crate::kernel::{Digest, Seed, Stream, num};

/// Number of resamples behind an interval.
pub const RESAMPLES: usize = 2000;
/// Root of the resampling streams. No result of a run depends on it; the tables name it.
pub const SEED: Seed = Seed(95);
const LEVELS: [f64; 2] = [0.025, 0.975];
/// Chance that a one-sided bound of 95 % leaves.
const CHANCE: f64 = 0.05;

/// A number with its interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    pub value: f64,
    /// 95 % interval over scenes and seeds; `None` for a number that has none.
    pub interval: Option<[f64; 2]>,
    /// Spread behind the interval of a repeated search.
    #[serde(skip)]
    pub spread: Option<Spread>,
}

/// Likely error of a mean over repetitions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spread {
    /// Standard error, in the number's unit; above 0.
    pub error: f64,
    /// Degrees of freedom.
    pub freedom: f64,
}

impl Estimate {
    /// A number without an interval.
    pub fn plain(value: f64) -> Estimate {
        Estimate { value, interval: None, spread: None }
    }

    /// A number with the percentile interval of its resampled values.
    pub fn drawn(value: f64, resampled: &[f64]) -> Estimate {
        Estimate { interval: interval(resampled), ..Estimate::plain(value) }
    }

    /// A mean of repeated searches: `of_seeds` has the means of every search's repetitions, with its share of the whole mean; `drawn` the
    /// whole mean over drawn scenes with all repetitions, of `scenes` independent ones. Without any spread the interval has no width.
    pub fn repeated(value: f64, of_seeds: &[(f64, Vec<f64>)], drawn: &[f64], scenes: usize) -> Estimate {
        let of_search = |(share, seeds): &(f64, Vec<f64>)| {
            let n = seeds.len() as f64;
            (seeds.len() > 1).then(|| (share * share * variance(seeds) / n, n - 1.0))
        };
        let of_scenes = (variance(drawn), (scenes.max(2) - 1) as f64);
        let parts: Vec<(f64, f64)> = of_seeds.iter().filter_map(of_search).chain([of_scenes]).collect();
        let all = num::sum(parts.iter().map(|(part, _)| *part));
        let divisor = num::sum(parts.iter().map(|(part, freedom)| part * part / freedom));
        // Differences in the last bits are no spread.
        if all <= 1e-24 || divisor <= 0.0 {
            return Estimate { interval: Some([value; 2]), ..Estimate::plain(value) };
        }
        let spread = Spread { error: all.sqrt(), freedom: all * all / divisor };
        let half = student::half_of_95(spread.freedom) * spread.error;
        Estimate { value, interval: Some([value - half, value + half]), spread: Some(spread) }
    }

    /// The mean of a number over the repetitions of one search: `of_seeds` has it of each, `drawn` the mean over drawn scenes, of `scenes`
    /// independent ones. Without an interval where there are no draws, `None` without a repetition.
    pub fn over_seeds(of_seeds: Vec<f64>, drawn: Option<&[f64]>, scenes: usize) -> Option<Estimate> {
        let value = num::mean(&of_seeds)?;
        Some(match drawn {
            None => Estimate::plain(value),
            Some(drawn) if of_seeds.len() < 2 => Estimate::drawn(value, drawn),
            Some(drawn) => Estimate::repeated(value, &[(1.0, of_seeds)], drawn, scenes),
        })
    }

    /// Limits the interval to the bounds of the number: no share is below 0.
    pub fn within(self, [low, high]: [f64; 2]) -> Estimate {
        let ends = |[from, to]: [f64; 2]| {
            if (low..=high).contains(&self.value) { [from.max(low), to.min(high)] } else { [from, to] }
        };
        Estimate { interval: self.interval.map(ends), ..self }
    }

    /// Returns the text with this many digits: `0.450 [0.401, 0.502]`.
    pub fn text(&self, digits: u32) -> String {
        let fixed = |value: f64| num::fixed(value, digits);
        let ends = self.interval.map_or(String::new(), |[low, high]| format!(" [{}, {}]", fixed(low), fixed(high)));
        format!("{}{ends}", fixed(self.value))
    }

    /// Returns the chance of a distance at least as large as this one's to `from`, to either side, where searches were repeated.
    pub fn chance_beyond(&self, from: f64) -> Option<f64> {
        self.spread.map(|spread| student::two_sided((self.value - from) / spread.error, spread.freedom))
    }
}

/// Variance of a sample; 0 of fewer than two.
pub fn variance(values: &[f64]) -> f64 {
    let mean = num::mean(values).unwrap_or(0.0);
    num::sum(values.iter().map(|value| (value - mean) * (value - mean))) / (values.len().max(2) - 1) as f64
}

/// One value per scene of a held-out suite; `None` where the scene has no label.
#[derive(Clone, Debug)]
pub struct PerScene {
    /// Which suite: values of one suite are resampled together, those of different suites independently.
    pub suite: Digest,
    pub values: Vec<Option<f64>>,
}

/// One search and its repetitions.
#[derive(Clone, Debug)]
pub struct Search {
    /// Id of the search: searches of one id have their seeds in common, so that the effect of a seed may be the same in all.
    pub id: Digest,
    /// One entry per seed, in the order of the seeds.
    pub seeds: Vec<PerScene>,
}

/// A mean over searches of the mean over their repetitions of the means over scenes.
pub type Quantity = Vec<Search>;

/// Value and interval of each quantity, all from the same draws. `None` where a quantity rests on no label.
pub fn estimates(quantities: &[Quantity]) -> Vec<Option<Estimate>> {
    quantities.iter().zip(&resampled(quantities)).map(|(quantity, values)| estimate(quantity, values)).collect()
}

/// Returns the same for differences, each with its chance under no difference: Student's where searches were repeated; else twice the share
/// of resamples on the far side of 0, the value itself counted as one of them, at most 1.
pub fn compared_with_zero(differences: &[Quantity]) -> Vec<Option<(Estimate, f64)>> {
    let chance = |values: &[f64]| {
        let beyond = |holds: &dyn Fn(f64) -> bool| values.iter().filter(|value| holds(**value)).count();
        let least = beyond(&|value| value <= 0.0).min(beyond(&|value| value >= 0.0));
        (2.0 * (least + 1) as f64 / (values.len() + 1) as f64).min(1.0)
    };
    let drawn = resampled(differences);
    let all = differences.iter().zip(&drawn);
    let both = |(quantity, values): (&Quantity, &Vec<f64>)| {
        let estimate = estimate(quantity, values)?;
        Some((estimate, estimate.chance_beyond(0.0).unwrap_or_else(|| chance(values))))
    };
    all.map(both).collect()
}

/// One quantity divided by another, paired by seed and scene, r = a / b. Its interval is that of the mean of (a - r b) / b
/// about r (the delta method). `None` where either rests on nothing, their parts do not fit, or the divisor is 0.
pub fn ratio(of: &Quantity, by: &Quantity) -> Option<Estimate> {
    let mean = |quantity| mean_over(quantity, |part| (0..part.values.len()).collect());
    let (above, below) = (mean(of)?, mean(by).filter(|below| *below != 0.0)?);
    let ratio = above / below;
    let part = |(a, b): (&PerScene, &PerScene)| {
        let off = |(a, b): (&Option<f64>, &Option<f64>)| Some(((*a)? - ratio * (*b)?) / below);
        let values = a.values.iter().zip(&b.values).map(off).collect();
        (a.suite == b.suite && a.values.len() == b.values.len()).then_some(PerScene { suite: a.suite, values })
    };
    let search = |(a, b): (&Search, &Search)| {
        let seeds = a.seeds.iter().zip(&b.seeds).map(part).collect::<Option<_>>()?;
        (a.seeds.len() == b.seeds.len()).then_some(Search { id: a.id, seeds })
    };
    let off: Quantity = of.iter().zip(by).map(search).collect::<Option<_>>()?;
    let off = estimates(&[off]).pop().flatten()?;
    let interval = off.interval.map(|[low, high]| [ratio + low, ratio + high]);
    (of.len() == by.len()).then_some(Estimate { value: ratio, interval, ..off })
}

fn estimate(quantity: &Quantity, values: &[f64]) -> Option<Estimate> {
    let value = mean_over(quantity, |part| (0..part.values.len()).collect())?;
    if quantity.iter().all(|search| search.seeds.len() < 2) {
        return Some(Estimate::drawn(value, values));
    }
    let of_seeds = of_seeds(quantity);
    let suites: BTreeMap<Digest, usize> =
        quantity.iter().flat_map(|search| &search.seeds).map(|part| (part.suite, part.values.len())).collect();
    Some(Estimate::repeated(value, &of_seeds, values, suites.values().sum()))
}

/// Means of the repetitions, those of searches with seeds in common together, and their share of the whole mean.
fn of_seeds(quantity: &Quantity) -> Vec<(f64, Vec<f64>)> {
    let mean_of = |part: &PerScene| num::mean(&part.values.iter().copied().flatten().collect::<Vec<f64>>());
    let mut together: BTreeMap<Digest, Vec<&Search>> = BTreeMap::new();
    quantity.iter().for_each(|search| together.entry(search.id).or_default().push(search));
    let of = |searches: Vec<&Search>| {
        let seeds = searches.iter().map(|search| search.seeds.len()).max().unwrap_or(0);
        let of_seed = |seed: usize| {
            let parts = searches.iter().filter_map(|search| mean_of(search.seeds.get(seed)?));
            num::mean(&parts.collect::<Vec<f64>>())
        };
        (searches.len() as f64 / quantity.len() as f64, (0..seeds).filter_map(of_seed).collect())
    };
    together.into_values().map(of).collect()
}

/// Resampled values of each quantity over drawn scenes, all from the same draws; repetitions stay as they are.
fn resampled(quantities: &[Quantity]) -> Vec<Vec<f64>> {
    let parts = quantities.iter().flatten().flat_map(|search| &search.seeds);
    let mut suites = Draws::of("bootstrap", parts.map(|part| (part.suite, part.values.len())).collect());
    let mut resampled: Vec<Vec<f64>> = vec![Vec::with_capacity(RESAMPLES); quantities.len()];
    for _ in 0..RESAMPLES {
        let scenes = suites.next();
        let drawn = |of: &Digest| scenes.get(of).cloned().unwrap_or_default();
        for (quantity, values) in quantities.iter().zip(&mut resampled) {
            values.extend(mean_over(quantity, |part| drawn(&part.suite)));
        }
    }
    resampled
}

/// Returns the scenes of each resample of a suite of `size` scenes, as all estimates of this suite draw them. Quantities that are not
/// means over scenes are computed from them.
pub fn draws(suite: Digest, size: usize) -> impl Iterator<Item = Vec<usize>> {
    let mut draws = Draws::of("bootstrap", BTreeMap::from([(suite, size)]));
    (0..RESAMPLES).map(move |_| draws.next().remove(&suite).unwrap_or_default())
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

/// Mean over searches of the mean over their seeds of the mean over the labelled ones of these scenes. A repetition
/// without a label drops out; `None` where a search has no other.
fn mean_over(quantity: &Quantity, scenes: impl Fn(&PerScene) -> Vec<usize>) -> Option<f64> {
    let of_seed = |part: &PerScene| {
        let labelled = scenes(part).into_iter().filter_map(|scene| part.values.get(scene).copied().flatten());
        num::mean(&labelled.collect::<Vec<f64>>())
    };
    let of_search = |search: &Search| num::mean(&search.seeds.iter().filter_map(of_seed).collect::<Vec<f64>>());
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
        assert_eq!(one(&[0.25]), Estimate { interval: Some([0.25; 2]), ..Estimate::plain(0.25) });
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
        // Without any difference the chance is 1.
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
        // Five repetitions of one rate each, all scenes alike: only the seeds differ. Their variance is 0.15625, so by hand
        // 0.5 -+ 2.776 √(0.15625 / 5) = 0.0093 to 0.9907.
        let seeds = [0.0, 0.25, 0.5, 0.75, 1.0].map(|rate| suite("a", &[rate; 20])).to_vec();
        let search = Search { id: Digest::of_bytes(b"search"), seeds };
        let of_seeds = estimates(&[vec![search.clone()]])[0].unwrap();
        let [low, high] = of_seeds.interval.unwrap();
        assert!((of_seeds.value - 0.5).abs() < 1e-15);
        assert!((low - 0.0093).abs() < 1e-3 && (high - 0.9907).abs() < 1e-3, "{low} {high}");
        // Another search whose seeds are its own halves the variance and doubles the degrees of freedom: t is 2.306.
        let other = Search { id: Digest::of_bytes(b"other"), ..search.clone() };
        let [low, _] = estimates(&[vec![search.clone(), other]])[0].unwrap().interval.unwrap();
        assert!((low - (0.5 - 2.306 * (0.156_25_f64 / 10.0).sqrt())).abs() < 1e-3, "{low}");
        // One with the same seeds adds nothing.
        let [low, _] = estimates(&[vec![search.clone(), search]])[0].unwrap().interval.unwrap();
        assert!((low - 0.0093).abs() < 1e-3, "{low}");
    }

    /// Returns how many of 400 made-up studies have the true mean in their interval: rates of seeds about one half, and scenes on which
    /// these fall.
    fn covered(seeds: usize, spread: f64, interval: impl Fn(&Quantity) -> [f64; 2]) -> f64 {
        let studies = 400;
        let holds = |study: usize| {
            let mut stream = Seed(11).stream(&["coverage", &study.to_string()]);
            let hard: Vec<f64> = (0..60).map(|_| 0.4 * (stream.unit() - 0.5)).collect();
            let of_seed = |_| {
                let rate = 0.5 + spread * (stream.unit() + stream.unit() + stream.unit() - 1.5);
                suite("a", &hard.iter().map(|off| f64::from(stream.unit() < rate + off)).collect::<Vec<f64>>())
            };
            let search = Search { id: Digest::of_bytes(b"search"), seeds: (0..seeds).map(of_seed).collect() };
            let [low, high] = interval(&vec![search]);
            low <= 0.5 && 0.5 <= high
        };
        (0..studies).filter(|study| holds(*study)).count() as f64 / studies as f64
    }

    #[test]
    fn of_a_hundred_studies_with_few_seeds_ninety_five_hold_the_true_mean_and_a_bootstrap_of_seeds_would_not() {
        let own = |quantity: &Quantity| estimates(std::slice::from_ref(quantity))[0].unwrap().interval.unwrap();
        for (seeds, spread) in [(3, 0.2), (5, 0.6), (5, 0.2), (10, 0.2), (5, 0.02)] {
            let share = covered(seeds, spread, own);
            assert!((0.93..=0.995).contains(&share), "{seeds} seeds, spread {spread}: {share}");
        }
        // The method before this one: percentiles of means of drawn seeds on drawn scenes.
        let of_both = |quantity: &Quantity| {
            let (seeds, mut stream) = (&quantity[0].seeds, Seed(12).stream(&["both"]));
            let mut draw = || {
                let scenes: Vec<usize> = (0..60).map(|_| stream.below(60)).collect();
                let mut of = || {
                    let seed = &seeds[stream.below(seeds.len())];
                    num::mean(&scenes.iter().filter_map(|scene| seed.values[*scene]).collect::<Vec<f64>>())
                };
                num::mean(&(0..seeds.len()).filter_map(|_| of()).collect::<Vec<f64>>()).unwrap()
            };
            interval(&(0..400).map(|_| draw()).collect::<Vec<f64>>()).unwrap()
        };
        let share = covered(5, 0.6, of_both);
        assert!(share < 0.91, "{share}");
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
