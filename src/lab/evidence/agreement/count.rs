//! Counts over pairs of rollouts, with intervals.

use serde::Serialize;

use super::disagreement::{self, Disagreement};
use super::interval::{Interval, RESAMPLES, middle};
use super::pair::{Meeting, Pair, Tried};
use super::transfer::{Descent, Transfer, transfers};
use crate::kernel::Seed;

/// Seconds before the contact at which the egos are compared.
pub const BEFORE_S: [f64; 3] = [1.0, 3.0, 5.0];

/// Rollouts that a row counts.
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
    /// Returns the text before a row's name.
    pub fn prefix(self) -> &'static str {
        match self {
            Of::All | Of::Program => "",
            Of::Family => "family ",
            Of::Cluster => "cluster ",
            Of::Proposal => "proposal ",
        }
    }
}

/// Distance of the egos some time before the first contact.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EgoApart {
    pub before_s: f64,
    /// Median and 90th percentile, m; `None` without a rollout.
    pub median_m: Option<f64>,
    pub p90_m: Option<f64>,
    /// Rollouts that had begun by then.
    pub rollouts: usize,
}

/// Results of a row of rollouts.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Agreement {
    pub of: Of,
    pub row: String,
    pub rollouts: usize,
    /// Judgement of whether there is a contact. In a file its numbers stand beside the others.
    #[serde(flatten)]
    pub contact: Judged,
    /// Number of the contacts in both that are with the same road user.
    pub same_partner: usize,
    /// Median of the times' distance over the contacts in both, s.
    pub contact_time_apart_s: Option<f64>,
    /// One for each of [`BEFORE_S`].
    pub ego_apart: Vec<EgoApart>,
    pub labels: LabelAgreement,
}

/// Results of a row about the labels that a search maximises.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LabelAgreement {
    /// Over all rollouts: contacts that the program brought about, as published work counts them.
    pub published: Judged,
    /// Over all rollouts: those of them that a careful ego could have prevented.
    pub preventable: Judged,
    /// Contacts in both with the same road user: what follows is counted over them.
    pub contacts: usize,
    pub same_class: usize,
    pub same_striker: usize,
    /// Contacts of which both say whether they were avoidable, and those of which both say the same.
    pub assessed: usize,
    pub same_avoidability: usize,
    /// Relative speed in the second less that in the first: median, and median of its size, m/s.
    pub relative_speed_more_mps: Option<f64>,
    pub relative_speed_apart_mps: Option<f64>,
}

/// A yes or no of two judges.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Judged {
    /// Yes in both, in the first alone, in the second alone, in neither.
    pub confusion: [usize; 4],
    /// Share about which both say the same.
    pub agreement: Interval,
    /// Cohen's kappa; `None` where one of them always says the same.
    pub kappa: Option<Interval>,
}

/// Everything that is said about two runs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    /// The two backends by name.
    pub backends: [String; 2],
    /// True if both played the same commands. They do not where each plans around another drive of the ego.
    pub same_commands: bool,
    /// All rollouts first, then row by row.
    pub rows: Vec<Agreement>,
    pub disagreements: Vec<Disagreement>,
    /// Effects of single options of our plant on the disagreements; empty where neither simulator is ours.
    pub changes: Vec<Change>,
    /// Gains of evolved programs over the parents of their families in either; empty where no evolved program stands beside its
    /// parent.
    pub transfers: Vec<Transfer>,
    /// Rollouts that one of them could not play, with the reason.
    pub left_out: Vec<String>,
}

/// All rollouts with one option of our plant changed, the commands unchanged.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Change {
    /// The option and what became of it.
    pub change: String,
    /// Disagreements about contact that are none any more, and rollouts that disagree only then.
    pub mended: usize,
    pub broken: usize,
    /// Contact in both, in the first alone, in the second alone, in neither.
    pub confusion: [usize; 4],
    /// Share of rollouts about which both say the same, and Cohen's kappa.
    pub agreement: f64,
    pub kappa: Option<f64>,
}

/// Counts. `pairs` stand in the order in which they are listed.
pub fn report(
    backends: [String; 2],
    same_commands: bool,
    pairs: &[Pair],
    tried: &Tried,
    descents: &[Descent],
    left_out: Vec<String>,
) -> Report {
    let started = || pairs.iter().filter(|pair| !pair.proposed);
    let program = |pair: &&Pair| Some(pair.program.clone());
    let mut rows = vec![agreement(Of::All, "all", &started().collect::<Vec<_>>())];
    rows.extend(grouped(Of::Program, started(), program));
    rows.extend(grouped(Of::Family, started(), |pair| pair.family.clone()));
    rows.extend(grouped(Of::Cluster, started(), |pair| Some(pair.cluster.clone())));
    rows.extend(grouped(Of::Proposal, pairs.iter().filter(|pair| pair.proposed), program));
    let disagreements = pairs.iter().filter_map(|pair| disagreement::of(pair, tried)).collect();
    let all: Vec<&Pair> = started().collect();
    let changes = tried.changes.iter().enumerate().map(|(i, change)| changed(&all, tried.own, i, change)).collect();
    let transfers = transfers(pairs, descents);
    Report { backends, same_commands, rows, disagreements, changes, transfers, left_out }
}

/// The rollouts with the i-th change.
fn changed(pairs: &[&Pair], own: usize, i: usize, change: &str) -> Change {
    let (mut confusion, mut mended, mut broken) = ([0; 4], 0, 0);
    for pair in pairs {
        let Some(&contact) = pair.changed.get(i) else { continue };
        let (a, b) = (pair.a.contact.is_some(), pair.b.contact.is_some());
        let (a, b) = if own == 0 { (contact, b) } else { (a, contact) };
        confusion[place((a, b))] += 1;
        mended += usize::from(a == b && !pair.agrees());
        broken += usize::from(a != b && pair.agrees());
    }
    let agreement = share(confusion).unwrap_or(1.0);
    Change { change: change.to_string(), mended, broken, confusion, agreement, kappa: kappa(confusion) }
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
    groups.iter().map(|(name, group)| agreement(of, name, group)).collect()
}

fn agreement(of: Of, row: &str, pairs: &[&Pair]) -> Agreement {
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
    let name = format!("{}{row}", of.prefix());
    let contact = judged(&name, pairs, |pair| (pair.a.contact.is_some(), pair.b.contact.is_some()));
    Agreement {
        of,
        row: row.to_string(),
        rollouts: pairs.len(),
        contact,
        same_partner: met.iter().filter(|(a, b)| a.with == b.with).count(),
        contact_time_apart_s: median(apart),
        ego_apart: BEFORE_S.into_iter().map(before).collect(),
        labels: labels(&name, pairs, &met),
    }
}

fn labels(row: &str, pairs: &[&Pair], met: &[(&Meeting, &Meeting)]) -> LabelAgreement {
    let met: Vec<(&Meeting, &Meeting)> = met.iter().filter(|(a, b)| a.with == b.with).copied().collect();
    let count = |same: &dyn Fn(&Meeting, &Meeting) -> bool| met.iter().filter(|(a, b)| same(a, b)).count();
    let assessed = |a: &Meeting, b: &Meeting| a.avoidable.is_some() && b.avoidable.is_some();
    let more: Vec<f64> = met.iter().map(|(a, b)| b.relative_speed_mps - a.relative_speed_mps).collect();
    LabelAgreement {
        published: judged(row, pairs, |pair| (pair.a.published, pair.b.published)),
        preventable: judged(row, pairs, |pair| (pair.a.preventable, pair.b.preventable)),
        contacts: met.len(),
        same_class: count(&|a, b| a.class == b.class),
        same_striker: count(&|a, b| a.striker == b.striker),
        assessed: count(&assessed),
        same_avoidability: count(&|a, b| assessed(a, b) && a.avoidable == b.avoidable),
        relative_speed_apart_mps: median(more.iter().map(|more| more.abs()).collect()),
        relative_speed_more_mps: median(more),
    }
}

/// Compares what two simulators say of the same yes or no, with intervals.
fn judged(row: &str, pairs: &[&Pair], said: impl Fn(&Pair) -> (bool, bool)) -> Judged {
    let confusion = confusion(pairs, &said);
    let resampled = resampled(row, pairs, &said);
    let interval = |value: f64, of: &dyn Fn([usize; 4]) -> Option<f64>| {
        middle(value, resampled.iter().filter_map(|confusion| of(*confusion)).collect())
    };
    Judged {
        confusion,
        agreement: interval(share(confusion).unwrap_or(1.0), &share),
        kappa: kappa(confusion).map(|value| interval(value, &kappa)),
    }
}

fn confusion(pairs: &[&Pair], said: &impl Fn(&Pair) -> (bool, bool)) -> [usize; 4] {
    let mut counts = [0; 4];
    pairs.iter().for_each(|pair| counts[place(said(pair))] += 1);
    counts
}

/// The place in a confusion of what two judges say.
fn place(said: (bool, bool)) -> usize {
    match said {
        (true, true) => 0,
        (true, false) => 1,
        (false, true) => 2,
        (false, false) => 3,
    }
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
fn resampled(row: &str, pairs: &[&Pair], said: &impl Fn(&Pair) -> (bool, bool)) -> Vec<[usize; 4]> {
    let mut scenes: Vec<&str> = pairs.iter().map(|pair| pair.scene.as_str()).collect();
    scenes.sort_unstable();
    scenes.dedup();
    let of =
        |scene: &&str| confusion(&pairs.iter().filter(|pair| pair.scene == **scene).copied().collect::<Vec<_>>(), said);
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
