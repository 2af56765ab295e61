//! 95 % intervals of SafeBench's scores by the percentile bootstrap over groups: within every traffic family its routes
//! are drawn with replacement, each with all its scenes, and the scores are computed anew from the drawn runs. OS is of
//! a whole set of runs, so nothing less would do. Rounds of one lineage are drawn together: differences are paired.

use std::collections::BTreeMap;

use super::archives::LineageArchive;
use super::bootstrap::{Estimate, RESAMPLES, SEED, interval};
use crate::evaluation::Group;
use crate::kernel::{Stream, num};
use crate::objects::benchmark::Benchmark;
use crate::scene::safebench::TrafficFamily;

/// Scores of all rounds of a lineage, on its own groups and on resampled ones.
pub struct Resampled {
    measured: Vec<Option<Benchmark>>,
    drawn: Vec<Vec<Option<Benchmark>>>,
    /// Mean frontier gain over the groups, percent.
    gain_pct: Option<f64>,
    drawn_gains_pct: Vec<f64>,
}

impl Resampled {
    /// Draws depend on the groups alone: lineages on the same groups are drawn together.
    pub fn new(archive: &LineageArchive) -> Resampled {
        let mut families: BTreeMap<TrafficFamily, Vec<Group>> = BTreeMap::new();
        archive.groups().into_iter().for_each(|group| families.entry(group.0).or_default().push(group));
        let mut streams: Vec<(&Vec<Group>, Stream)> =
            families.iter().map(|(family, groups)| (groups, stream(*family, groups))).collect();
        let own: Vec<Group> = families.values().flatten().copied().collect();
        let (mut drawn, mut drawn_gains_pct) = (Vec::with_capacity(RESAMPLES), Vec::new());
        for _ in 0..RESAMPLES {
            let draw = |(groups, stream): &mut (&Vec<Group>, Stream)| -> Vec<Group> {
                (0..groups.len()).map(|_| groups[stream.below(groups.len())]).collect()
            };
            let draw: Vec<Group> = streams.iter_mut().flat_map(draw).collect();
            drawn.push(archive.rounds.iter().map(|round| round.scores(draw.iter().copied())).collect());
            drawn_gains_pct.extend(gain_pct(archive, &draw));
        }
        let measured = archive.rounds.iter().map(|round| round.scores(own.iter().copied())).collect();
        Resampled { measured, drawn, gain_pct: gain_pct(archive, &own), drawn_gains_pct }
    }

    /// A quantity of the rounds' scores. One that some draw leaves undefined has no interval.
    pub fn estimate(&self, quantity: impl Fn(&[Option<Benchmark>]) -> Option<f64>) -> Option<Estimate> {
        let value = quantity(&self.measured)?;
        let drawn: Option<Vec<f64>> = self.drawn.iter().map(|rounds| quantity(rounds)).collect();
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

fn gain_pct(archive: &LineageArchive, groups: &[Group]) -> Option<f64> {
    num::mean(&groups.iter().filter_map(|group| archive.gains_pct.get(group)).copied().collect::<Vec<f64>>())
}
