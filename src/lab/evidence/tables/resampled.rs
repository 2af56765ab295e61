//! 95 % intervals of SafeBench's scores by the percentile bootstrap over groups: within every traffic family its routes
//! are drawn with replacement, each with all its scenes, and the scores are computed anew from the drawn runs. OS is of
//! a whole set of runs, so nothing less would do. Rounds of one lineage are drawn together: differences are paired. Where
//! a search was repeated with several seeds, its repetitions are drawn with replacement too.

use std::collections::{BTreeMap, BTreeSet};

use super::archives::{Archived, Scores};
use crate::evaluation::Group;
use crate::kernel::{Stream, num};
use crate::scene::safebench::TrafficFamily;
use crate::statistics::bootstrap::{Estimate, RESAMPLES, SEED};

/// Scores of a search on its own groups and on resampled ones: one a seed.
pub struct Resampled {
    measured: Vec<Scores>,
    drawn: Vec<Vec<Scores>>,
    groups: usize,
}

impl Resampled {
    /// Resamples the repetitions of one search. Draws depend on groups and number of seeds alone: lineages on the same groups are
    /// drawn together.
    pub fn new(seeds: &[Archived<'_>]) -> Resampled {
        let mut families: BTreeMap<TrafficFamily, Vec<Group>> = BTreeMap::new();
        let groups: BTreeSet<Group> = seeds.iter().flat_map(|archive| archive.groups()).collect();
        groups.into_iter().for_each(|group| families.entry(group.0).or_default().push(group));
        let mut streams: Vec<(&Vec<Group>, Stream)> =
            families.iter().map(|(family, groups)| (groups, stream(*family, groups))).collect();
        let own: Vec<Group> = families.values().flatten().copied().collect();
        let mut drawn = Vec::with_capacity(RESAMPLES);
        for _ in 0..RESAMPLES {
            let draw = |(groups, stream): &mut (&Vec<Group>, Stream)| -> Vec<Group> {
                (0..groups.len()).map(|_| groups[stream.below(groups.len())]).collect()
            };
            let draw: Vec<Group> = streams.iter_mut().flat_map(draw).collect();
            drawn.push(seeds.iter().map(|archive| archive.scores(&draw)).collect());
        }
        let measured = seeds.iter().map(|archive| archive.scores(&own)).collect();
        Resampled { measured, drawn, groups: own.len() }
    }

    /// The mean over seeds of a quantity of the scores. One that some draw leaves undefined has no interval.
    pub fn estimate(&self, quantity: impl Fn(&Scores) -> Option<f64>) -> Option<Estimate> {
        let of_seeds = |seeds: &Vec<Scores>| seeds.iter().map(&quantity).collect::<Option<Vec<f64>>>();
        let own = of_seeds(&self.measured)?;
        let drawn: Option<Vec<f64>> = self.drawn.iter().map(|seeds| num::mean(&of_seeds(seeds)?)).collect();
        Estimate::over_seeds(own, drawn.as_deref(), self.groups)
    }
}

fn stream(family: TrafficFamily, groups: &[Group]) -> Stream {
    let routes: Vec<String> = groups.iter().map(|(_, route)| route.to_string()).collect();
    SEED.stream(&["evidence", "tables", "bootstrap", "groups", family.name(), &routes.join(" ")])
}
