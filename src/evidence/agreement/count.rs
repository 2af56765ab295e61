//! What is counted over pairs of rollouts, with intervals.

use serde::Serialize;

use super::disagreement::{self, Disagreement};
use super::pair::{Meeting, Pair};
use crate::kernel::Seed;

/// Seconds before the contact at which the egos are compared.
pub const BEFORE_S: [f64; 3] = [1.0, 3.0, 5.0];
const RESAMPLES: usize = 1000;

/// A value with the middle 95 % of what resampled scenes give.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Interval {
    pub value: f64,
    pub low: f64,
    pub high: f64,
}

/// What a row counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Of {
    /// Every rollout of a program that a lineage started from, and every scene without one.
    All,
    /// One such program, or the scenes without one against one ego.
    Program,
    /// Such programs of one family.
    Family,
    /// Scenes of one cluster, with such programs and without.
    Cluster,
    /// A program that was proposed in the run. It counts in no other row, so that an acceptance moves none.
    Proposal,
}

impl Of {
    /// Before a row's name.
    pub fn prefix(self) -> &'static str {
        match self {
            Of::All | Of::Program => "",
            Of::Family => "family ",
            Of::Cluster => "cluster ",
            Of::Proposal => "proposal ",
        }
    }
}

/// How far apart the egos were some time before the first contact.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EgoApart {
    pub before_s: f64,
    /// Median and 90th percentile, m; `None` without a rollout.
    pub median_m: Option<f64>,
    pub p90_m: Option<f64>,
    /// Rollouts that had begun by then.
    pub rollouts: usize,
}

/// What a row of rollouts says.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Agreement {
    pub of: Of,
    pub row: String,
    pub rollouts: usize,
    /// Contact in both, in the first alone, in the second alone, in neither.
    pub confusion: [usize; 4],
    /// Share of rollouts about which both say the same.
    pub agreement: Interval,
    /// Cohen's kappa; `None` where one simulator always says the same.
    pub kappa: Option<Interval>,
    /// Of the contacts in both: with the same road user.
    pub same_partner: usize,
    /// Of the contacts in both: median of the times' distance, s.
    pub contact_time_apart_s: Option<f64>,
    /// One for each of [`BEFORE_S`].
    pub ego_apart: Vec<EgoApart>,
}

/// Everything that is said about two runs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    /// The two backends by name.
    pub backends: [String; 2],
    /// Whether both played the same commands. They do not where each plans around another drive of the ego.
    pub same_commands: bool,
    /// All rollouts first, then row by row.
    pub rows: Vec<Agreement>,
    pub disagreements: Vec<Disagreement>,
    /// Rollouts that one of them could not play, with the reason.
    pub left_out: Vec<String>,
}

/// Counts. `pairs` stand in the order in which they are listed.
pub fn report(backends: [String; 2], same_commands: bool, pairs: &[Pair], left_out: Vec<String>) -> Report {
    let started = || pairs.iter().filter(|pair| !pair.proposed);
    let program = |pair: &&Pair| Some(pair.program.clone());
    let mut rows = vec![agreement((Of::All, "all"), &started().collect::<Vec<_>>())];
    rows.extend(grouped(Of::Program, started(), program));
    rows.extend(grouped(Of::Family, started(), |pair| pair.family.clone()));
    rows.extend(grouped(Of::Cluster, started(), |pair| Some(pair.cluster.clone())));
    rows.extend(grouped(Of::Proposal, pairs.iter().filter(|pair| pair.proposed), program));
    let disagreements = pairs.iter().filter_map(disagreement::of).collect();
    Report { backends, same_commands, rows, disagreements, left_out }
}

/// A row for each name, in the order in which names come up.
fn grouped<'p>(
    of: Of,
    pairs: impl Iterator<Item = &'p Pair>,
    name: impl Fn(&&Pair) -> Option<String>,
) -> Vec<Agreement> {
    let mut groups: Vec<(String, Vec<&Pair>)> = Vec::new();
    for (name, pair) in pairs.filter_map(|pair| Some((name(&pair)?, pair))) {
        match groups.iter_mut().find(|(known, _)| *known == name) {
            Some((_, group)) => group.push(pair),
            None => groups.push((name, vec![pair])),
        }
    }
    groups.iter().map(|(name, group)| agreement((of, name), group)).collect()
}

fn agreement((of, row): (Of, &str), pairs: &[&Pair]) -> Agreement {
    let confusion = confusion(pairs);
    let met = pairs.iter().filter_map(|pair| Some((pair.a.contact.as_ref()?, pair.b.contact.as_ref()?)));
    let met: Vec<(&Meeting, &Meeting)> = met.collect();
    let apart = met.iter().map(|(a, b)| (a.time_s() - b.time_s()).abs()).collect();
    let before = |before_s: f64| {
        let apart = |pair: &&&Pair| pair.ego_apart_m(pair.first_contact_s()? - before_s);
        let mut distances: Vec<f64> = pairs.iter().filter_map(|pair| apart(&pair)).collect();
        distances.sort_by(f64::total_cmp);
        let p90_m = distances.get((9 * distances.len()).div_ceil(10).saturating_sub(1)).copied();
        EgoApart { before_s, rollouts: distances.len(), p90_m, median_m: median(distances) }
    };
    let resampled = resampled(&format!("{}{row}", of.prefix()), pairs);
    let interval = |value: f64, of: &dyn Fn([usize; 4]) -> Option<f64>| {
        let mut drawn: Vec<f64> = resampled.iter().filter_map(|confusion| of(*confusion)).collect();
        drawn.sort_by(f64::total_cmp);
        let at = |share: f64| drawn.get((share * (drawn.len().max(1) - 1) as f64).round() as usize).copied();
        Interval { value, low: at(0.025).unwrap_or(value), high: at(0.975).unwrap_or(value) }
    };
    Agreement {
        of,
        row: row.to_string(),
        rollouts: pairs.len(),
        confusion,
        agreement: interval(share(confusion).unwrap_or(1.0), &share),
        kappa: kappa(confusion).map(|value| interval(value, &kappa)),
        same_partner: met.iter().filter(|(a, b)| a.with == b.with).count(),
        contact_time_apart_s: median(apart),
        ego_apart: BEFORE_S.into_iter().map(before).collect(),
    }
}

fn confusion(pairs: &[&Pair]) -> [usize; 4] {
    let mut counts = [0; 4];
    for pair in pairs {
        let place = match (pair.a.contact.is_some(), pair.b.contact.is_some()) {
            (true, true) => 0,
            (true, false) => 1,
            (false, true) => 2,
            (false, false) => 3,
        };
        counts[place] += 1;
    }
    counts
}

fn share([both, first, second, neither]: [usize; 4]) -> Option<f64> {
    let all = both + first + second + neither;
    (all > 0).then(|| (both + neither) as f64 / all as f64)
}

/// Cohen's kappa: (p - e) / (1 - e), with p the share of agreement and e what two independent judges with these rates would
/// agree on (Cohen 1960).
pub fn kappa(counts: [usize; 4]) -> Option<f64> {
    let [both, first, second, neither] = counts.map(|count| count as f64);
    let all = both + first + second + neither;
    let (a, b) = ((both + first) / all, (both + second) / all);
    let chance = a * b + (1.0 - a) * (1.0 - b);
    // NaN where there is nothing.
    (chance < 1.0).then(|| ((both + neither) / all - chance) / (1.0 - chance))
}

/// Confusions of scenes drawn with replacement. Rollouts of one scene are drawn together: they resemble each other.
fn resampled(row: &str, pairs: &[&Pair]) -> Vec<[usize; 4]> {
    let mut scenes: Vec<&str> = pairs.iter().map(|pair| pair.scene.as_str()).collect();
    scenes.sort_unstable();
    scenes.dedup();
    let of = |scene: &&str| confusion(&pairs.iter().filter(|pair| pair.scene == **scene).copied().collect::<Vec<_>>());
    let counts: Vec<[usize; 4]> = scenes.iter().map(of).collect();
    let mut stream = Seed(1).stream(&["agreement", row]);
    let mut draw = || {
        let mut sum = [0; 4];
        for _ in 0..counts.len() {
            let drawn = counts[stream.below(counts.len())];
            sum.iter_mut().zip(drawn).for_each(|(sum, count)| *sum += count);
        }
        sum
    };
    (0..RESAMPLES).map(|_| draw()).collect()
}

fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    let n = values.len();
    match n {
        0 => None,
        _ if n % 2 == 1 => Some(values[n / 2]),
        _ => Some(0.5 * (values[n / 2 - 1] + values[n / 2])),
    }
}
