//! 95 % intervals of SafeBench's scores by the percentile bootstrap over groups: within every traffic family its routes
//! are drawn with replacement, each with all its scenes, and the scores are computed anew from the drawn runs. OS is of
//! a whole set of runs, so nothing less would do. Rounds of one lineage are drawn together: differences are paired. Where
//! a search was repeated with several seeds, its repetitions are drawn with replacement too.

use std::collections::{BTreeMap, BTreeSet};

use super::archives::Archived;
use super::bootstrap::{Estimate, RESAMPLES, SEED, interval};
use crate::evaluation::Group;
use crate::kernel::{Stream, num};
use crate::objects::benchmark::Benchmark;
use crate::scene::safebench::TrafficFamily;

/// Scores of all rounds of a lineage.
type Rounds = Vec<Option<Benchmark>>;

/// Scores of all rounds of a search, on its own groups and on resampled ones: one a seed.
pub struct Resampled {
    measured: Vec<Rounds>,
    drawn: Vec<Vec<Rounds>>,
    /// Mean frontier gain over the groups, percent.
    gain_pct: Option<f64>,
    drawn_gains_pct: Vec<f64>,
}

impl Resampled {
    /// Of the repetitions of one search. Draws depend on groups and number of seeds alone: lineages on the same groups are
    /// drawn together.
    pub fn new(seeds: &[Archived<'_>]) -> Resampled {
        let mut families: BTreeMap<TrafficFamily, Vec<Group>> = BTreeMap::new();
        let groups: BTreeSet<Group> = seeds.iter().flat_map(|archive| archive.groups()).collect();
        groups.into_iter().for_each(|group| families.entry(group.0).or_default().push(group));
        let mut repetitions =
            SEED.stream(&["evidence", "tables", "bootstrap", "repetitions", &seeds.len().to_string()]);
        let mut streams: Vec<(&Vec<Group>, Stream)> =
            families.iter().map(|(family, groups)| (groups, stream(*family, groups))).collect();
        let own: Vec<Group> = families.values().flatten().copied().collect();
        let (mut drawn, mut drawn_gains_pct) = (Vec::with_capacity(RESAMPLES), Vec::new());
        for _ in 0..RESAMPLES {
            let draw = |(groups, stream): &mut (&Vec<Group>, Stream)| -> Vec<Group> {
                (0..groups.len()).map(|_| groups[stream.below(groups.len())]).collect()
            };
            let draw: Vec<Group> = streams.iter_mut().flat_map(draw).collect();
            let repeated: Vec<Archived<'_>> = match seeds {
                [one] => vec![*one],
                _ => seeds.iter().map(|_| seeds[repetitions.below(seeds.len())]).collect(),
            };
            drawn.push(repeated.iter().map(|archive| rounds(archive, &draw)).collect());
            drawn_gains_pct.extend(gain_pct(&repeated, &draw));
        }
        let measured = seeds.iter().map(|archive| rounds(archive, &own)).collect();
        Resampled { measured, drawn, gain_pct: gain_pct(seeds, &own), drawn_gains_pct }
    }

    /// The mean over seeds of a quantity of the rounds' scores. One that some draw leaves undefined has no interval.
    pub fn estimate(&self, quantity: impl Fn(&[Option<Benchmark>]) -> Option<f64>) -> Option<Estimate> {
        let over_seeds = |seeds: &Vec<Rounds>| {
            num::mean(&seeds.iter().map(|rounds| quantity(rounds)).collect::<Option<Vec<f64>>>()?)
        };
        let value = over_seeds(&self.measured)?;
        let drawn: Option<Vec<f64>> = self.drawn.iter().map(over_seeds).collect();
        Some(Estimate { value, interval: drawn.and_then(|values| interval(&values)) })
    }

    /// PF-Area@3 with its interval.
    pub fn gain(&self) -> Option<Estimate> {
        Some(Estimate { value: self.gain_pct?, interval: interval(&self.drawn_gains_pct) })
    }
}

fn stream(family: TrafficFamily, groups: &[Group]) -> Stream {
    let routes: Vec<String> = groups.iter().map(|(_, route)| route.to_string()).collect();
    SEED.stream(&["evidence", "tables", "bootstrap", "groups", family.name(), &routes.join(" ")])
}

fn rounds(archive: &Archived<'_>, groups: &[Group]) -> Rounds {
    archive.rounds.iter().map(|round| round.scores(groups.iter().copied())).collect()
}

fn gain_pct(seeds: &[Archived<'_>], groups: &[Group]) -> Option<f64> {
    let of_seed = |archive: &Archived<'_>| {
        num::mean(&groups.iter().filter_map(|group| archive.gains_pct.get(group)).copied().collect::<Vec<f64>>())
    };
    num::mean(&seeds.iter().filter_map(of_seed).collect::<Vec<f64>>())
}
