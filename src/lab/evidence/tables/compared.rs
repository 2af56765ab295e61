//! Two programs of any two runs beside each other, paired by scene: what each amounts to, the difference, its interval.

use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};

use super::form::Form;
use super::labels::{self, Read, suite};
use crate::evidence::RecordedRun;
use crate::kernel::{Digest, num};
use crate::objects::{RealismMean, RealismSums, SceneScore, SolutionId, realism_name};
use crate::statistics::bootstrap::{self, Estimate, PerScene, Quantity, Search};
use crate::statistics::student;

/// Scenes on which two programs are compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Paired {
    HeldOut,
    Evolution,
}

/// One quantity of both programs over the scenes that are paired.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Compared {
    pub quantity: String,
    /// Scenes in which both have it: the difference is over these.
    pub scenes: usize,
    /// Each over the paired scenes in which that program has it.
    pub first: Estimate,
    pub second: Estimate,
    /// Second minus first, drawn scene by scene.
    pub difference: Estimate,
    /// Scenes and seeds that would show a difference of this size; absent for what is no mean over scenes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub needed: Option<Needed>,
}

/// Numbers of scenes and seeds that show a difference of the measured size at 5 % with 80 % power, paired, by the measured variance.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Needed {
    /// Number of scenes by the spread between scenes, of the mean over seeds.
    pub scenes: Option<usize>,
    /// Number of seeds by the spread between seeds, of the mean over scenes.
    pub seeds: Option<usize>,
}

impl Needed {
    /// Derives both from the change in each scene of each seed.
    fn by(changes: &[Vec<Option<f64>>], difference: f64) -> Needed {
        let known = |of: &mut dyn Iterator<Item = Option<f64>>| num::mean(&of.flatten().collect::<Vec<_>>());
        let scenes = changes.iter().map(Vec::len).max().unwrap_or_default();
        let of_scene = |at: usize| known(&mut changes.iter().map(|seed| seed.get(at).copied().flatten()));
        let by_scene: Vec<f64> = (0..scenes).filter_map(of_scene).collect();
        let by_seed: Vec<f64> = changes.iter().filter_map(|seed| known(&mut seed.iter().copied())).collect();
        let needed =
            |of: &[f64]| (of.len() > 1).then(|| student::needed(difference, bootstrap::variance(of))).flatten();
        Needed { scenes: needed(&by_scene), seeds: needed(&by_seed) }
    }
}

/// Two programs on the scenes that both are labelled on.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Comparison {
    pub first: SolutionId,
    pub second: SolutionId,
    pub on: Paired,
    pub scenes: usize,
    /// Labelled scenes of each that the other has no label of: no number here rests on them.
    pub left_out: [usize; 2],
    pub quantities: Vec<Compared>,
}

/// The programs of several seeds of a search beside those of another, seed by seed.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Pooled {
    pub on: Paired,
    /// Different scenes of all seeds.
    pub scenes: usize,
    /// Means over the seeds; intervals are over seeds and scenes.
    pub quantities: Vec<Compared>,
}

const QUANTITIES: [(&str, Read); 4] = [
    ("attack", labels::ATTACK.of),
    ("realism", labels::ACTED_REALISM.of),
    ("coverage", labels::ACTED.of),
    ("any crash", labels::ANY_CONTACT.of),
];

/// The stricter one of the two realisms: of the scenes acted in and of the successes.
pub const STRICT_REALISM: &str = realism_name(false, RealismMean::Strict);

type ByScene<'a> = BTreeMap<&'a str, &'a SceneScore>;
/// A program of a run.
type Of<'a> = (&'a RecordedRun, &'a SolutionId);
/// Labels of two programs in one scene.
type Pair<'a> = [&'a SceneScore; 2];

/// The scenes that a resample draws from, in their order, and which draws they are.
pub struct Drawn {
    suite: Digest,
    scenes: Vec<String>,
}

impl Drawn {
    /// Returns the scenes as the tables draw the held-out ones of a run, so that one quantity has one interval everywhere.
    pub fn held_out(run: &RecordedRun) -> Option<Drawn> {
        Some(Drawn { suite: suite(run).ok()?, scenes: run.opened.held_out_scenes.clone() })
    }

    /// The scenes of all seeds, by name: the order decides which scenes a resample draws.
    fn by_name(seeds: &[Vec<Pair<'_>>]) -> Drawn {
        let scenes = scenes_of(seeds).into_iter().map(String::from).collect();
        Drawn { suite: Digest::of_bytes(b"compared"), scenes }
    }
}

/// The tables' draws where both sides were labelled on the same held-out scenes.
fn drawn(seeds: &[(Of<'_>, Of<'_>)], on: Paired) -> Option<Drawn> {
    let runs = || seeds.iter().flat_map(|(first, second)| [first.0, second.0]);
    let shared = runs().next().filter(|_| on == Paired::HeldOut).and_then(Drawn::held_out)?;
    runs().all(|run| suite(run).is_ok_and(|suite| suite == shared.suite)).then_some(shared)
}

/// Compares a program of one run with one of another; `None` where no scene has labels of both.
pub fn compared(first: Of<'_>, second: Of<'_>) -> Option<Comparison> {
    let (on, pairs, left_out) = paired(first, second)?;
    let drawn = drawn(&[(first, second)], on);
    let quantities = quantities(std::slice::from_ref(&pairs), drawn.as_ref(), with_strict(first.0));
    let (first, second) = (first.1.clone(), second.1.clone());
    Some(Comparison { first, second, on, scenes: pairs.len(), left_out, quantities })
}

/// Compares the programs of several seeds at once; `None` where a seed has no labels of both, or others than the rest are on.
pub fn pooled(seeds: &[(Of<'_>, Of<'_>)]) -> Option<Pooled> {
    let paired: Vec<_> = seeds.iter().map(|(first, second)| paired(*first, *second)).collect::<Option<_>>()?;
    let (((first, _), _), (on, ..)) = (seeds.first()?, paired.first()?);
    let (on, strict) = (*on, with_strict(first));
    if paired.iter().any(|(other, ..)| *other != on) {
        return None;
    }
    let pairs: Vec<Vec<Pair<'_>>> = paired.into_iter().map(|(_, pairs, _)| pairs).collect();
    let quantities = quantities(&pairs, drawn(seeds, on).as_ref(), strict);
    Some(Pooled { on, scenes: scenes_of(&pairs).len(), quantities })
}

/// SafeBench's objective is ARS, over groups: the strict realism of its scenes would be a number that nobody searched by.
fn with_strict(run: &RecordedRun) -> bool {
    run.rounds.is_empty()
}

/// The labels of two programs in the scenes that both have, and how many of each are left out.
fn paired<'a>(first: Of<'a>, second: Of<'a>) -> Option<(Paired, Vec<Pair<'a>>, [usize; 2])> {
    let suites = [(Paired::HeldOut, RecordedRun::held_out_labels as fn(_, _) -> _), (Paired::Evolution, evolution)];
    suites.into_iter().find_map(|(on, labels)| {
        let (of_first, of_second): (ByScene<'a>, ByScene<'a>) = (labels(first.0, first.1), labels(second.0, second.1));
        let pairs = both(&of_first, &of_second);
        let left_out = [of_first.len(), of_second.len()].map(|all| all - pairs.len());
        (!pairs.is_empty()).then_some((on, pairs, left_out))
    })
}

fn both<'a>(first: &ByScene<'a>, second: &ByScene<'a>) -> Vec<Pair<'a>> {
    first.iter().filter_map(|(scene, label)| Some([*label, *second.get(scene)?])).collect()
}

/// The quantities of two programs by their labels, paired by scene; empty where no scene has labels of both. Scenes are drawn as
/// asked, else by their names.
pub fn compared_labels(first: &[SceneScore], second: &[SceneScore], drawn: Option<&Drawn>) -> Vec<Compared> {
    let pairs = both(&by_scene(first.iter()), &by_scene(second.iter()));
    if pairs.is_empty() { Vec::new() } else { quantities(&[pairs], drawn, true) }
}

/// Compares every quantity of one search or several seeds of it, each with its pairs.
fn quantities(seeds: &[Vec<Pair<'_>>], drawn: Option<&Drawn>, with_strict: bool) -> Vec<Compared> {
    let by_name = Drawn::by_name(seeds);
    let drawn = drawn.unwrap_or(&by_name);
    let shared = seeds.iter().flatten().flatten().flat_map(|label| label.metrics.keys()).collect::<BTreeSet<_>>();
    let own =
        shared.into_iter().filter_map(|name| quantity(name, &|label| label.metrics.get(name).copied(), seeds, drawn));
    let shipped = QUANTITIES.iter().filter_map(|(name, reading)| quantity(name, reading, seeds, drawn));
    let strict = with_strict.then(|| strict_realism(seeds, drawn)).flatten();
    let mut quantities: Vec<Compared> = shipped.collect();
    let behind = quantities.iter().position(|row| row.quantity == "realism").map_or(quantities.len(), |at| at + 1);
    quantities.splice(behind..behind, strict);
    quantities.extend(own);
    quantities
}

/// An attempt has the labels that decided about it, a parent those of its windows.
fn evolution<'a>(run: &'a RecordedRun, solution: &SolutionId) -> ByScene<'a> {
    let attempts =
        run.attempts.iter().filter(|of| of.exit.candidate().is_some_and(|c| c.program.solution_id == *solution));
    let windows = run.frozen.iter().filter(|of| of.parent == *solution);
    let own = attempts.filter_map(|of| of.exit.score()).flat_map(|score| &score.scenes);
    by_scene(own.chain(windows.flat_map(|of| &of.parent_score.scenes)))
}

fn by_scene<'a>(labels: impl Iterator<Item = &'a SceneScore>) -> ByScene<'a> {
    labels.map(|label| (label.scene.as_str(), label)).collect()
}

/// The scenes of all seeds, by name: the order decides which scenes a resample draws.
fn scenes_of<'a>(seeds: &[Vec<Pair<'a>>]) -> BTreeSet<&'a str> {
    seeds.iter().flatten().map(|[first, _]| first.scene.as_str()).collect()
}

/// The stricter realism of both over the paired scenes, the mean over seeds; `None` where one acts in none of them. It is no mean over scenes:
/// every draw computes it anew from the labels that were drawn, and one that leaves it undefined falls out.
fn strict_realism(seeds: &[Vec<Pair<'_>>], drawn: &Drawn) -> Option<Compared> {
    let at: Vec<Vec<Option<&Pair<'_>>>> = seeds.iter().map(|pairs| in_order(pairs, &drawn.scenes)).collect();
    // Of every seed the strict realism of both programs, over these scenes.
    let both = |draw: &[usize]| -> Option<Vec<[f64; 2]>> {
        let of_seed = |pairs: &Vec<Option<&Pair<'_>>>| {
            let mut sums = [RealismSums::default(); 2];
            for [first, second] in draw.iter().filter_map(|scene| *pairs.get(*scene)?) {
                sums[0].add(first);
                sums[1].add(second);
            }
            Some([sums[0].realism(RealismMean::Strict)?, sums[1].realism(RealismMean::Strict)?])
        };
        at.iter().map(of_seed).collect()
    };
    let own = both(&(0..drawn.scenes.len()).collect::<Vec<_>>())?;
    let draws: Vec<Vec<[f64; 2]>> =
        bootstrap::draws(drawn.suite, drawn.scenes.len()).filter_map(|draw| both(&draw)).collect();
    let count = scenes_of(seeds).len();
    let estimate = |read: fn(&[f64; 2]) -> f64| {
        let values = |of: &Vec<[f64; 2]>| of.iter().map(read).collect::<Vec<f64>>();
        let resampled: Vec<f64> = draws.iter().filter_map(|of| num::mean(&values(of))).collect();
        Estimate::over_seeds(values(&own), Some(&resampled), count)
    };
    let [first, second] = [estimate(|of| of[0])?, estimate(|of| of[1])?].map(|of| Form::Rate.bounded(of));
    let difference = estimate(|of| of[1] - of[0])?;
    Some(Compared { quantity: STRICT_REALISM.to_string(), scenes: count, first, second, difference, needed: None })
}

/// The pair of each of these scenes; nothing where a scene has none.
fn in_order<'p, 'a>(pairs: &'p [Pair<'a>], scenes: &[String]) -> Vec<Option<&'p Pair<'a>>> {
    let by_scene: BTreeMap<&str, &Pair<'_>> = pairs.iter().map(|pair| (pair[0].scene.as_str(), pair)).collect();
    scenes.iter().map(|scene| by_scene.get(scene.as_str()).copied()).collect()
}

/// The three estimates of a quantity from the same draws: each program's over the scenes in which it has it, their difference over
/// those in which both have it.
fn quantity(
    name: &str,
    reading: &dyn Fn(&SceneScore) -> Option<f64>,
    seeds: &[Vec<Pair<'_>>],
    drawn: &Drawn,
) -> Option<Compared> {
    let (suite, scenes) = (drawn.suite, &drawn.scenes);
    let of_seed = |pairs: &Vec<Pair<'_>>| -> Vec<[Option<f64>; 2]> {
        in_order(pairs, scenes).into_iter().map(|pair| pair.map_or([None, None], |pair| pair.map(reading))).collect()
    };
    let both: Vec<Vec<[Option<f64>; 2]>> = seeds.iter().map(of_seed).collect();
    let change = |pair: &[Option<f64>; 2]| Some(pair[1]? - pair[0]?);
    let of = |value: &dyn Fn(&[Option<f64>; 2]) -> Option<f64>| -> Quantity {
        let seed = |of: &Vec<[Option<f64>; 2]>| PerScene { suite, values: of.iter().map(value).collect() };
        vec![Search { id: suite, seeds: both.iter().map(seed).collect() }]
    };
    let estimated = bootstrap::estimates(&[of(&|pair| pair[0]), of(&|pair| pair[1]), of(&change)]);
    let [Some(first), Some(second), Some(difference)] = estimated[..] else { return None };
    // A mean of shares is a share.
    let share = both.iter().flatten().flatten().flatten().all(|value| (0.0..=1.0).contains(value));
    let [first, second] = [first, second].map(|own| if share { Form::Rate.bounded(own) } else { own });
    let shared = |at: &usize| both.iter().any(|seed| seed.get(*at).and_then(change).is_some());
    let scenes = (0..scenes.len()).filter(shared).count();
    let changes: Vec<Vec<Option<f64>>> = both.iter().map(|seed| seed.iter().map(change).collect()).collect();
    let needed = Some(Needed::by(&changes, difference.value));
    Some(Compared { quantity: name.to_string(), scenes, first, second, difference, needed })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn label(scene: &str, attack: f64, acted: bool, realism: f64) -> SceneScore {
        SceneScore {
            scene: scene.into(),
            attack,
            realism,
            acted,
            diagnostics: BTreeMap::new(),
            metrics: Default::default(),
            contact: None,
            intervened: acted,
            by_ego: Default::default(),
            request: Digest::of_bytes(b"request"),
            record: Digest::of_bytes(b"record"),
        }
    }

    #[test]
    fn differences_are_paired_by_scene_and_that_of_realism_is_over_the_scenes_in_which_both_act() {
        let scenes: Vec<String> = (0..20).map(|k| format!("s{k}")).collect();
        // Scenes differ much and programs little: unpaired intervals would hold 0 with ease.
        let first: Vec<SceneScore> =
            scenes.iter().enumerate().map(|(k, s)| label(s, (k % 2) as f64 * 0.9, k != 3, 0.8)).collect();
        let second: Vec<SceneScore> =
            scenes.iter().enumerate().map(|(k, s)| label(s, (k % 2) as f64 * 0.9 + 0.1, true, 0.7)).collect();
        let pairs = [first.iter().zip(&second).map(|(a, b)| [a, b]).collect::<Vec<Pair<'_>>>()];
        let attack = quantity("attack", &QUANTITIES[0].1, &pairs, &Drawn::by_name(&pairs)).unwrap();
        assert!((attack.first.value - 0.45).abs() < 1e-12 && (attack.difference.value - 0.1).abs() < 1e-12);
        let [low, high] = attack.difference.interval.unwrap();
        assert!(low > 0.099 && high < 0.101, "{low} {high}");
        let [low, high] = attack.first.interval.unwrap();
        assert!(high - low > 0.2, "the programs by themselves are not so sure: {low} {high}");
        let realism = quantity("realism", &QUANTITIES[1].1, &pairs, &Drawn::by_name(&pairs)).unwrap();
        assert!(realism.scenes == 19 && (realism.difference.value + 0.1).abs() < 1e-12);
        // By hand: 0.1 in every scene but for one of 0.5 has a mean of 0.12 and a variance of 0.008.
        let mut other = second.clone();
        other[0].attack += 0.4;
        let pairs_of_other = [first.iter().zip(&other).map(|(a, b)| [a, b]).collect::<Vec<Pair<'_>>>()];
        let drawn = Drawn::by_name(&pairs_of_other);
        let needed = quantity("attack", &QUANTITIES[0].1, &pairs_of_other, &drawn).unwrap().needed.unwrap();
        assert_eq!(needed, Needed { scenes: student::needed(0.12, 0.008), seeds: None });
        assert!(needed.scenes.is_some_and(|scenes| (5..9).contains(&scenes)), "{needed:?}");
        let nobody = [vec![[&first[3], &second[3]]]];
        assert!(quantity("realism", &QUANTITIES[1].1, &nobody, &Drawn::by_name(&nobody)).is_none());
    }

    #[test]
    fn several_seeds_are_their_mean_and_their_interval_holds_the_spread_between_them() {
        let scenes: Vec<String> = (0..20).map(|k| format!("s{k}")).collect();
        let of = |attack: f64| scenes.iter().map(|s| label(s, attack, true, 0.8)).collect::<Vec<_>>();
        // Within a seed all scenes agree, so that one seed by itself has no width.
        let (before, after) = (of(0.1), [of(0.1), of(0.3), of(0.8)]);
        let seeds: Vec<Vec<Pair<'_>>> =
            after.iter().map(|after| before.iter().zip(after).map(|(a, b)| [a, b]).collect()).collect();
        let alone =
            quantity("attack", &QUANTITIES[0].1, &seeds[1..2], &Drawn::by_name(&seeds[1..2])).unwrap().difference;
        let [low, high] = alone.interval.unwrap();
        assert!((alone.value - 0.2).abs() < 1e-12 && high - low < 1e-12, "{alone:?}");
        let pooled = quantity("attack", &QUANTITIES[0].1, &seeds, &Drawn::by_name(&seeds)).unwrap();
        assert!((pooled.difference.value - 0.3).abs() < 1e-12 && pooled.scenes == 20, "{pooled:?}");
        let [low, high] = pooled.difference.interval.unwrap();
        assert!(low < 0.1 && high > 0.6, "{low} {high}");
        // Seeds differ by 0, 0.2 and 0.7; all scenes agree, so that their number cannot be told.
        assert_eq!(pooled.needed, Some(Needed { scenes: None, seeds: student::needed(0.3, 0.13) }));
        let strict = strict_realism(&seeds, &Drawn::by_name(&seeds)).unwrap();
        assert!((strict.first.value - 0.8).abs() < 1e-12 && strict.scenes == 20, "{strict:?}");
    }

    #[test]
    fn strict_realism_is_computed_anew_from_each_draw_for_both_programs_alike() {
        // In every other scene an attack, which is less realistic than the rest: strict realism is that of the attacks.
        let of = |less: f64| -> Vec<SceneScore> {
            let realism = |k: usize| if k.is_multiple_of(2) { 0.6 + 0.01 * k as f64 } else { 1.0 };
            (0..40).map(|k| label(&k.to_string(), ((k + 1) % 2) as f64, true, realism(k) - less)).collect()
        };
        let (first, second) = (of(0.0), of(0.05));
        let pairs = [first.iter().zip(&second).map(|(a, b)| [a, b]).collect::<Vec<Pair<'_>>>()];
        let strict = strict_realism(&pairs, &Drawn::by_name(&pairs)).unwrap();
        assert!(
            (strict.first.value - 0.79).abs() < 1e-12 && (strict.difference.value + 0.05).abs() < 1e-12,
            "{strict:?}"
        );
        let [low, high] = strict.first.interval.unwrap();
        assert!(
            low < 0.76 && high > 0.82 && high < 0.9,
            "the attacks differ, and no draw is of the other scenes: {low} {high}"
        );
        let [low, high] = strict.difference.interval.unwrap();
        assert!(low > -0.0501 && high < -0.0499, "both draw the same scenes: {low} {high}");
    }
}
