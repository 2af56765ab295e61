//! Verdicts on claims, from estimates.

use serde::Serialize;
use std::collections::BTreeMap;

use super::file::{Claim, Claims, ClaimsError, Direction};
use super::measure;
use crate::evidence::downstream;
use crate::evidence::recorded_run::RecordedRun;
use crate::evidence::tables::{self, Estimate, RESAMPLES, Row, Table, TableError, proposers};
use crate::kernel::{Threads, num};
use crate::objects::downstream::Downstream;
use crate::objects::{FrontOf, JudgedOn, RealismMean, realism_name};

/// Verdict of recorded runs on a claim.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// The contrary is shown somewhere, or nothing moved at all.
    NotSupported,
    /// Neither is shown, but it is shown that there is less of it than the paper reports, in every row that the paper has.
    Smaller,
    /// None of this is shown.
    Undecided,
    /// Shown in every row.
    Supported,
    /// There is no such number.
    NotTestable,
}

impl Verdict {
    /// All, in the order in which they are told: what fails first.
    pub const ALL: [Verdict; 5] =
        [Verdict::NotSupported, Verdict::Smaller, Verdict::Undecided, Verdict::Supported, Verdict::NotTestable];

    /// Returns the verdict in words for readers.
    pub fn words(self) -> &'static str {
        match self {
            Verdict::NotSupported => "not supported",
            Verdict::Smaller => "smaller than in the paper",
            Verdict::Undecided => "undecided",
            Verdict::Supported => "supported",
            Verdict::NotTestable => "not testable here",
        }
    }
}

/// One number that a claim rests on.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Part {
    /// Row of the table, or the measure.
    pub row: String,
    /// Ours.
    pub estimate: Estimate,
    /// The paper's, where it prints one.
    pub paper: Option<f64>,
    /// One-sided p that it lies on the claimed side, and on the other.
    pub p_for: f64,
    pub p_against: f64,
    /// One-sided p that it falls short of the paper's, where that lies on the claimed side.
    pub p_smaller: Option<f64>,
    /// Cell to ask `evodrive why` about; `None` for a measure.
    pub cell: Option<String>,
}

/// A claim with what was found.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Judged {
    pub id: String,
    pub label: String,
    pub text: String,
    /// The statistic with direction and threshold, in words.
    pub asked: String,
    pub verdict: Verdict,
    /// Reason why it is not testable.
    pub reason: Option<String>,
    /// Value after Holm; `None` where it was not tested.
    pub p_for: Option<f64>,
    pub p_against: Option<f64>,
    /// `None` where the paper prints no number for some row.
    pub p_smaller: Option<f64>,
    pub parts: Vec<Part>,
    /// Root of its run.
    pub root: Option<String>,
    /// True if it asks for more than 0 of a number that is never negative: a search by random patches shows that as well.
    pub never_negative: bool,
}

/// Columns of tables whose numbers are never negative.
const NEVER_NEGATIVE: [&str; 1] = ["pf_area_at_3_pct"];

/// All claims, those that fail first.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Judgement {
    pub level: f64,
    /// Number of tested claims, which Holm's correction counts.
    pub tested: usize,
    /// Name, root, and kinds of whoever proposed.
    pub runs: Vec<(String, String, String)>,
    /// Name and rules of those runs whose experiment is at hand.
    pub rules: BTreeMap<String, String>,
    /// Names of those runs in which every search was made once.
    pub one_seed: Vec<String>,
    /// The same of the studies, the recipe in the root's place.
    pub studies: Vec<(String, String, String)>,
    pub claims: Vec<Judged>,
}

/// Records that a claim is asked of.
enum Asked<'s> {
    Runs(Vec<&'s RecordedRun>),
    Study(&'s Downstream),
}

impl Asked<'_> {
    fn name(&self) -> String {
        match self {
            Asked::Runs(runs) => joined(runs, |recorded| recorded.opened.name.clone()),
            Asked::Study(record) => record.opening.name.clone(),
        }
    }

    /// Roots of the runs, or the study's recipe.
    fn root(&self) -> String {
        match self {
            Asked::Runs(runs) => joined(runs, |recorded| recorded.root.to_hex()),
            Asked::Study(record) => record.opening.recipe.to_hex(),
        }
    }

    fn table(&self, name: &str) -> Result<Option<Table>, TableError> {
        match self {
            Asked::Study(record) => Ok(Some(downstream::table(record))),
            Asked::Runs(runs) => {
                let runs: Vec<RecordedRun> = runs.iter().map(|recorded| (*recorded).clone()).collect();
                let make = tables::NAMED.iter().find(|(known, _)| *known == name);
                make.map(|(_, make)| make(&runs)).transpose()
            }
        }
    }

    fn measured(&self, name: &str, families: &[String]) -> Option<Estimate> {
        match self {
            Asked::Runs(runs) => measure::measured(name, runs, families),
            Asked::Study(_) => None,
        }
    }
}

/// Returns `true` if no search of the run was repeated.
fn once(run: &RecordedRun) -> bool {
    run.result.iter().flat_map(|result| &result.lineages).all(|lineage| lineage.replica == 0)
}

fn joined(runs: &[&RecordedRun], of: fn(&RecordedRun) -> String) -> String {
    runs.iter().map(|recorded| of(recorded)).collect::<Vec<_>>().join(" + ")
}

/// Judges the claims by these runs, and by these studies under their names in the file. What no claim names is passed over.
pub fn judge(
    claims: &Claims,
    runs: &[RecordedRun],
    studies: &BTreeMap<String, Downstream>,
    threads: &Threads,
) -> Result<Judgement, ClaimsError> {
    let asked: Vec<_> = claims.claims.iter().map(|claim| asked_of(claim, claims, runs, studies)).collect();
    let made = tables_of(&claims.claims, &asked, threads)?;
    let mut judged = Vec::with_capacity(claims.claims.len());
    for (claim, asked) in claims.claims.iter().zip(asked) {
        judged.push(match asked {
            Err(reason) => untested(claim, reason, None),
            Ok(of) => one(claim, &of, &made),
        });
    }
    let tested = correct(&mut judged, claims.level);
    judged.sort_by_key(|claim| claim.verdict);
    let named =
        |recorded: &&RecordedRun| claims.runs.values().any(|named| named.experiments().contains(&recorded.opened.name));
    let source = |recorded: &RecordedRun| (recorded.opened.name.clone(), recorded.root.to_hex(), proposers(recorded));
    let study = |record: &Downstream| {
        let opening = &record.opening;
        (opening.name.clone(), opening.recipe.to_hex(), opening.proposals.clone())
    };
    Ok(Judgement {
        level: claims.level,
        tested,
        runs: runs.iter().filter(named).map(source).collect(),
        rules: runs.iter().filter(named).filter_map(|run| Some((run.opened.name.clone(), rules(run)?))).collect(),
        one_seed: runs.iter().filter(named).filter(|run| once(run)).map(|run| run.opened.name.clone()).collect(),
        studies: studies.values().map(study).collect(),
        claims: judged,
    })
}

/// Under which rules a run's programs were judged; `None` where its experiment is not at hand.
pub(super) fn rules(run: &RecordedRun) -> Option<String> {
    let of = run.declared.archive.as_ref()?;
    let theirs = [false, true].map(|safebench| realism_name(safebench, RealismMean::Plain));
    let (all, plain) = (of.front == FrontOf::Evaluated, theirs.contains(&run.realism_name()));
    let published = all && plain && of.race.is_none() && of.level <= 0.5 && of.coverage_floor <= 0.0;
    let whose = if published { "the paper's rules" } else { "our rules" };
    let race = of.race.map_or("no race".to_string(), |level| format!("race {level}"));
    let front = if all { "all evaluated" } else { "accepted" };
    let scenes = match of.judged_on {
        JudgedOn::WindowThenAll => "all windows so far",
        JudgedOn::Window => "the window",
    };
    let evaluator = if run.evolved.is_empty() { "does not change itself" } else { "evolves" };
    Some(format!(
        "{whose}: level {}, coverage floor {}, {race}, {}, front of {front} programs, judged on {scenes}, an evaluator that {evaluator}",
        of.level,
        of.coverage_floor,
        run.realism_name()
    ))
}

/// Tables by their name and what they are made of.
type Made = BTreeMap<(String, String), Table>;

/// Makes the tables that claims name, each once, side by side: their intervals take most of the time of judging.
fn tables_of(claims: &[Claim], asked: &[Result<Asked<'_>, String>], threads: &Threads) -> Result<Made, ClaimsError> {
    let mut wanted: BTreeMap<(String, String), &Asked<'_>> = BTreeMap::new();
    for (claim, of) in claims.iter().zip(asked) {
        if let (Some(table), Some(_), Ok(of)) = (&claim.table, &claim.column, of) {
            wanted.entry((table.clone(), of.name())).or_insert(of);
        }
    }
    let wanted: Vec<_> = wanted.into_iter().collect();
    let tables = threads.map(&wanted, |_, ((name, _), of)| of.table(name));
    let mut made = Made::new();
    for ((key, _), table) in wanted.into_iter().zip(tables) {
        if let Some(table) = table? {
            made.insert(key, table);
        }
    }
    Ok(made)
}

/// The runs or the study that a claim is asked of, or why there are none.
fn asked_of<'s>(
    claim: &Claim,
    claims: &Claims,
    runs: &'s [RecordedRun],
    studies: &'s BTreeMap<String, Downstream>,
) -> Result<Asked<'s>, String> {
    if let Some(reason) = &claim.not_testable {
        return Err(reason.clone());
    }
    if let Some(name) = &claim.study {
        return studies.get(name).map(Asked::Study).ok_or_else(|| format!("no record of the study `{name}` was given"));
    }
    let run = claim.run.as_deref().unwrap_or_default();
    let Some(named) = claims.runs.get(run) else { return Err(format!("the file names no run `{run}`")) };
    let given = |name: &String| {
        let recorded = runs.iter().find(|recorded| recorded.opened.name == *name);
        recorded.ok_or_else(|| format!("no run of the experiment {name} was given"))
    };
    Ok(Asked::Runs(named.experiments().iter().map(given).collect::<Result<_, _>>()?))
}

fn untested(claim: &Claim, reason: String, of: Option<&Asked<'_>>) -> Judged {
    Judged {
        id: claim.id.clone(),
        label: claim.label.clone(),
        text: claim.text.clone(),
        asked: asked(claim),
        verdict: Verdict::NotTestable,
        reason: Some(reason),
        p_for: None,
        p_against: None,
        p_smaller: None,
        parts: Vec::new(),
        root: of.map(|of| of.root()),
        never_negative: never_negative(claim),
    }
}

fn never_negative(claim: &Claim) -> bool {
    let column = claim.column.as_deref().is_some_and(|column| NEVER_NEGATIVE.contains(&column));
    column && claim.direction == Some(Direction::Above) && claim.threshold.is_some_and(|threshold| threshold <= 0.0)
}

fn asked(claim: &Claim) -> String {
    let what = match (&claim.table, &claim.column, &claim.measure) {
        (Some(table), Some(column), _) if claim.rows.is_empty() => format!("{table}: {column} in every row"),
        (Some(table), Some(column), _) => format!("{table}: {column} of {}", claim.rows.join(", ")),
        (_, _, Some(measure)) if claim.families.is_empty() => measure.clone(),
        (_, _, Some(measure)) => format!("{measure} of {}", claim.families.join(", ")),
        _ => return String::new(),
    };
    let side = match claim.direction {
        Some(Direction::Below) => "<",
        _ => ">",
    };
    format!("{what} {side} {}", claim.threshold.unwrap_or(0.0))
}

fn one(claim: &Claim, of: &Asked<'_>, made: &Made) -> Judged {
    let measured = match (&claim.table, &claim.column, &claim.measure) {
        (Some(name), Some(column), _) => {
            let table = made.get(&(name.clone(), of.name()));
            table.map_or_else(|| Err(format!("no table `{name}`")), |table| cells(claim, table, column))
        }
        (_, _, Some(name)) => of
            .measured(name, &claim.families)
            .map(|estimate| vec![(name.clone(), estimate, None, None)])
            .ok_or_else(|| format!("{} holds nothing that {name} counts", of.name())),
        _ => Err("nothing is asked".into()),
    };
    let measured = match measured {
        Err(reason) => return untested(claim, reason, Some(of)),
        Ok(measured) => measured,
    };
    let mut parts = Vec::with_capacity(measured.len());
    for (row, estimate, paper, cell) in measured {
        let threshold = claim.threshold.unwrap_or(0.0);
        let Some([p_for, p_against]) = sides(claim, &estimate, threshold) else {
            let reason = format!("the number of {row} has no interval, because nothing was repeated");
            return untested(claim, reason, Some(of));
        };
        let below = claim.direction == Some(Direction::Below);
        let claimed = paper.filter(|paper| if below { *paper < threshold } else { *paper > threshold });
        let p_smaller = claimed.and_then(|paper| sides(claim, &estimate, paper)).map(|[_, short_of_it]| short_of_it);
        parts.push(Part { row, estimate, paper, p_for, p_against, p_smaller, cell });
    }
    let largest = parts.iter().map(|part| part.p_for).fold(0.0, f64::max);
    let least = parts.iter().map(|part| part.p_against).fold(1.0, f64::min);
    let (p_for, p_against) = (Some(largest), Some((least * parts.len() as f64).min(1.0)));
    let smaller = parts.iter().map(|part| part.p_smaller).collect::<Option<Vec<f64>>>();
    let p_smaller = smaller.map(|all| all.into_iter().fold(0.0, f64::max));
    Judged { reason: None, p_for, p_against, p_smaller, parts, ..untested(claim, String::new(), Some(of)) }
}

type Found = (String, Estimate, Option<f64>, Option<String>);

/// The cells that a claim names; every one must be there.
fn cells(claim: &Claim, table: &Table, column: &str) -> Result<Vec<Found>, String> {
    let name = |row: &Row| row.labels.iter().take(2).cloned().collect::<Vec<_>>().join(" / ");
    let rows: Vec<(String, Option<&Row>)> = match claim.rows.as_slice() {
        [] => table.rows().filter(|row| row.in_paper()).map(|row| (name(row), Some(row))).collect(),
        named => {
            let find = |wanted: &String| {
                let fits = |row: &&Row| row.labels.first() == Some(wanted) || name(row) == *wanted;
                (wanted.clone(), table.rows().find(fits))
            };
            named.iter().map(find).collect()
        }
    };
    if rows.is_empty() {
        return Err(format!("{} has none of the paper's rows", table.name));
    }
    let measured = |(wanted, row): (String, Option<&Row>)| {
        let cell = row.and_then(|row| row.cells.iter().find(|cell| cell.column.key == column));
        let cell = cell.ok_or_else(|| format!("{} has no {column} of {wanted}", table.name))?;
        let ours = cell.ours.ok_or_else(|| format!("{wanted} has no number of {column} in this run"))?;
        let first = row.and_then(|row| row.labels.first()).unwrap_or(&wanted);
        let alike = table.rows().filter(|row| row.labels.first() == Some(first)).count();
        let named = match row {
            Some(row) if alike > 1 => row.labels.join("/"),
            _ => first.clone(),
        };
        // `why` asks runs; a study's cells come from its record.
        let place = format!("{}:{}:{column}", table.name, named.to_lowercase().replace(' ', "-"));
        Ok((wanted, ours, cell.paper, claim.run.is_some().then_some(place)))
    };
    rows.into_iter().map(measured).collect()
}

/// One-sided p for the claimed side of a threshold and for the other; `None` without an interval.
fn sides(claim: &Claim, estimate: &Estimate, threshold: f64) -> Option<[f64; 2]> {
    let [low, high] = estimate.interval?;
    let below_is_claimed = claim.direction == Some(Direction::Below);
    if let Some(chance) = estimate.chance_beyond(threshold) {
        let (own, other) = (0.5 * chance, 1.0 - 0.5 * chance);
        return Some(if (estimate.value < threshold) == below_is_claimed { [own, other] } else { [other, own] });
    }
    let (above, below) = (
        shown(estimate.value - threshold, estimate.value - low),
        shown(threshold - estimate.value, high - estimate.value),
    );
    // A number on the threshold that no draw moves is nothing at all, and that is shown.
    let nothing = estimate.value == threshold && low == high;
    let ps = if below_is_claimed { [below, above] } else { [above, below] };
    Some(if nothing { [1.0, least_p()] } else { ps })
}

/// The smallest p that so many resamples can tell.
fn least_p() -> f64 {
    1.0 / (RESAMPLES as f64 + 1.0)
}

/// One-sided p of a distance to the threshold, with the half of a 95 % interval that faces it.
fn shown(distance: f64, half: f64) -> f64 {
    /// Standard errors in half a 95 % interval.
    const IN_HALF: f64 = 1.959_964;
    if distance <= 0.0 {
        return 1.0;
    }
    let error = half / IN_HALF;
    let p = if error > 0.0 { 0.5 * num::erfc(distance / error / std::f64::consts::SQRT_2) } else { 0.0 };
    p.max(least_p())
}

/// Corrects all tests after Holm, each side by itself, and gives the verdicts; tells how many were tested.
fn correct(judged: &mut [Judged], level: f64) -> usize {
    let tested: Vec<usize> = (0..judged.len()).filter(|&at| judged[at].p_for.is_some()).collect();
    let of = |read: &dyn Fn(&Judged) -> Option<f64>| -> Vec<f64> {
        holm(&tested.iter().map(|&at| read(&judged[at]).unwrap_or(1.0)).collect::<Vec<f64>>())
    };
    let (p_for, p_against) = (of(&|claim| claim.p_for), of(&|claim| claim.p_against));
    let p_smaller = of(&|claim| claim.p_smaller);
    for (((&at, p_for), p_against), p_smaller) in tested.iter().zip(p_for).zip(p_against).zip(p_smaller) {
        let claim = &mut judged[at];
        (claim.p_for, claim.p_against) = (Some(p_for), Some(p_against));
        claim.p_smaller = claim.p_smaller.map(|_| p_smaller);
        claim.verdict = match (p_for <= level, p_against <= level) {
            (_, true) => Verdict::NotSupported,
            (true, false) => Verdict::Supported,
            (false, false) if p_smaller <= level => Verdict::Smaller,
            (false, false) => Verdict::Undecided,
        };
    }
    tested.len()
}

/// Holm's step-down correction, in the order given.
pub fn holm(p: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..p.len()).collect();
    order.sort_by(|&a, &b| p[a].total_cmp(&p[b]).then(a.cmp(&b)));
    let (mut corrected, mut largest) = (vec![1.0; p.len()], 0.0f64);
    for (before, &at) in order.iter().enumerate() {
        largest = largest.max((p.len() - before) as f64 * p[at]).min(1.0);
        corrected[at] = largest;
    }
    corrected
}
