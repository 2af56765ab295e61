//! The answer first: one sentence a search of what evolved on scenes that stayed closed, how sure it is, and by what.

use serde::Serialize;
use std::cmp::Ordering;
use std::collections::BTreeMap;

use super::super::recorded_run::{Became, RecordedRun};
use super::super::tables::{Compared, Estimate, called, compared, held_out_change, is_ram, pooled, prevented};
use super::mechanism;
use crate::kernel::num;
use crate::objects::{LineageId, Met, SceneScore, SolutionId, event::LineageResult};
use crate::sim::Fault;
use crate::text::counted;

/// Result of a lineage of the experiment, all its repetitions together.
#[derive(Clone, Debug, Serialize)]
pub struct Headline {
    /// The lineage of the experiment file.
    pub group: LineageId,
    /// Name that people call it by: its method against its ego.
    pub called: String,
    /// The repetition that gained most attack: its program is the one that is shown.
    pub lineage: LineageId,
    /// Number of repetitions of the search.
    pub searches: usize,
    pub verdict: Verdict,
    /// Sentence that follows the lineage's name.
    pub says: String,
    /// Differences of the shown program from its parent; empty where the parent stays.
    pub mechanism: String,
    /// Text on how often the shown program attacks and how often its parent, and in how many scenes only one of them does; empty where that
    /// says nothing.
    pub shares: String,
    /// Text on what its contacts say of the ego's driving; empty where nothing was assessed.
    pub contacts_say: String,
    /// True if most of them say nothing of it, because they are not preventable.
    pub weigh: bool,
    /// Chosen minus parent on the held-out scenes.
    pub attack: Option<Estimate>,
    pub realism: Option<Estimate>,
    /// Number of contacts of each class among those that count, the largest first; of the shown program.
    pub contacts: Vec<(String, usize)>,
    /// Number of them that are preventable, and number that was assessed.
    pub preventable: [usize; 2],
}

/// Verdict of the held-out scenes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// More of one objective, not less of the other.
    Gain,
    /// More attack, less realism.
    Trade,
    /// More realism, less attack.
    Concession,
    /// Another program is reported, and the scenes do not tell it from its parent.
    Unsure,
    /// Less of an objective without more of the other.
    Loss,
    /// The parent stays.
    Parent,
    /// Two numbers without an interval.
    Plain,
}

/// Returns, for each lineage of the experiment, the repetition that a page shows, in the order of headlines; empty while the run is unfinished.
pub fn shown(run: &RecordedRun) -> Vec<LineageId> {
    headlines(run).into_iter().map(|headline| headline.lineage).collect()
}

fn groups(run: &RecordedRun) -> BTreeMap<&LineageId, Vec<&LineageResult>> {
    let mut groups: BTreeMap<&LineageId, Vec<&LineageResult>> = BTreeMap::new();
    let results = run.result.iter().flat_map(|result| &result.lineages);
    results.for_each(|result| groups.entry(&result.group).or_default().push(result));
    groups
}

/// The first of those that gained most attack.
fn best<'r>(of: &[&'r LineageResult]) -> Option<&'r LineageResult> {
    of.iter().copied().reduce(|best, next| if gain_of(next) > gain_of(best) { next } else { best })
}

/// A headline a lineage of the experiment, the greatest sure gains of attack first; none while the run is unfinished.
pub fn headlines(run: &RecordedRun) -> Vec<Headline> {
    let results: Vec<&LineageResult> = run.result.iter().flat_map(|result| &result.lineages).collect();
    let mut all: Vec<Headline> = groups(run).into_iter().filter_map(|(group, of)| headline(run, group, &of)).collect();
    let place = |group: &LineageId| results.iter().position(|result| result.group == *group);
    all.sort_by(|a, b| {
        let gain = |of: &Headline| of.attack.map_or(0.0, |attack| attack.value);
        let unsure = |of: &Headline| side(of.attack) <= 0;
        let by_verdict =
            unsure(a).cmp(&unsure(b)).then(if unsure(a) { a.verdict.cmp(&b.verdict) } else { Ordering::Equal });
        by_verdict.then(gain(b).total_cmp(&gain(a))).then(place(&a.group).cmp(&place(&b.group)))
    });
    all
}

fn gain_of(result: &LineageResult) -> f64 {
    result.evolved.objectives.attack - result.parent.objectives.attack
}

fn headline(run: &RecordedRun, group: &LineageId, of: &[&LineageResult]) -> Option<Headline> {
    let best = best(of)?;
    let evolved = of.iter().filter(|result| result.evolved.solution != result.parent.solution).count();
    let quantities: Vec<Compared> = match of {
        _ if !run.rounds.is_empty() => Vec::new(),
        [one] => compared((run, &one.parent.solution), (run, &one.evolved.solution))
            .map(|of| of.quantities)
            .unwrap_or_default(),
        _ => {
            let pairs: Vec<_> =
                of.iter().map(|one| ((run, &one.parent.solution), (run, &one.evolved.solution))).collect();
            pooled(&pairs).map(|of| of.quantities).unwrap_or_default()
        }
    };
    let difference = |name: &str| quantities.iter().find(|row| row.quantity == name).map(|row| row.difference);
    let (mut attack, mut realism) = (difference("attack"), difference("realism"));
    let staged = !run.rounds.is_empty();
    if let Some([of_attack, of_ars]) = staged.then(|| held_out_change(run, of)).flatten() {
        (attack, realism) = (Some(of_attack), Some(of_ars));
    } else if quantities.is_empty() {
        let mean =
            |of_one: &dyn Fn(&LineageResult) -> f64| num::mean(&of.iter().map(|one| of_one(one)).collect::<Vec<_>>());
        attack = mean(&gain_of).map(Estimate::plain);
        realism = mean(&|one| one.evolved.objectives.realism - one.parent.objectives.realism).map(Estimate::plain);
    }
    let verdict = if evolved == 0 { Verdict::Parent } else { verdict(attack, realism) };
    let says = says(verdict, attack, realism, realism_word(run));
    let says = match of.len() {
        1 => says,
        n => format!(
            "{says}, mean of {} ({}{})",
            counted(n, "search"),
            singly(of),
            match n - evolved {
                0 => String::new(),
                kept => format!("; {kept} keep the parent"),
            }
        ),
    };
    let (contacts_say, weigh) = contacts_say(run, best, verdict);
    Some(Headline {
        group: group.clone(),
        called: called(run, &best.lineage).split(", search").next().unwrap_or_default().to_string(),
        lineage: best.lineage.clone(),
        searches: of.len(),
        verdict,
        says,
        mechanism: mechanism::gist(run, best).unwrap_or_default(),
        shares: shares(run, best, verdict),
        attack,
        realism,
        contacts_say,
        weigh,
        contacts: contacts(run, &best.evolved.solution),
        preventable: preventable(run, &best.evolved.solution),
    })
}

/// Returns the sign of an interval, as it is printed; 0 where the interval contains 0, or where there is none.
fn side(of: Option<Estimate>) -> i8 {
    match of.and_then(|of| of.interval).map(|ends| ends.map(|end| num::rounded(end, 3))) {
        Some([low, _]) if low > 0.0 => 1,
        Some([_, high]) if high < 0.0 => -1,
        _ => 0,
    }
}

fn verdict(attack: Option<Estimate>, realism: Option<Estimate>) -> Verdict {
    if attack.is_some_and(|of| of.interval.is_none()) {
        return Verdict::Plain;
    }
    match (side(attack), side(realism)) {
        (1, 0 | 1) | (0, 1) => Verdict::Gain,
        (1, _) => Verdict::Trade,
        (-1, 1) => Verdict::Concession,
        (0, 0) => Verdict::Unsure,
        _ => Verdict::Loss,
    }
}

/// Returns the name of the realism that a line compares.
fn realism_word(run: &RecordedRun) -> &'static str {
    if run.rounds.is_empty() { "realism" } else { "ARS" }
}

fn says(verdict: Verdict, attack: Option<Estimate>, realism: Option<Estimate>, word: &str) -> String {
    let of = |name: &str, estimate: Option<Estimate>| estimate.map(|of| format!("{name} {}", signed(of)));
    let (attacks, realisms) = (
        of("attack", attack).unwrap_or_default(),
        of(word, realism).unwrap_or_else(|| format!("no {word} to compare")),
    );
    match (verdict, side(attack), side(realism)) {
        (Verdict::Parent, ..) => "no gain; the parent stays, because no descendant is better by the rule".into(),
        (Verdict::Unsure, ..) => format!("no gain that these scenes tell from none: {attacks}, {realisms}"),
        (Verdict::Plain, ..) => {
            [of("attack", attack), of(word, realism)].into_iter().flatten().collect::<Vec<_>>().join(", ")
        }
        (Verdict::Gain, 1, 0) => {
            format!("{attacks}; {word} not told from equal ({})", realism.map_or("none".into(), signed))
        }
        (Verdict::Gain, 0, _) => {
            format!("{realisms}; attack not told from equal ({})", attack.map_or("none".into(), signed))
        }
        (Verdict::Gain, ..) => format!("{attacks} and {realisms}"),
        (Verdict::Trade, ..) => format!("{attacks} at the price of {realisms}"),
        (Verdict::Concession, ..) => format!("{realisms} at the price of {attacks}"),
        (Verdict::Loss, ..) => format!("worse than its parent: {attacks}, {realisms}"),
    }
}

fn signed(of: Estimate) -> String {
    let number = |value| num::signed(value, 3).replace('-', "−");
    match of.interval {
        Some([low, high]) => format!("{} [{}, {}]", number(of.value), number(low), number(high)),
        None => number(of.value),
    }
}

/// The least and the greatest gain of attack of the single searches.
fn singly(of: &[&LineageResult]) -> String {
    let gains: Vec<f64> = of.iter().map(|one| gain_of(one)).collect();
    let number = |value: f64| num::signed(value, 3).replace('-', "−");
    let (least, most) =
        (gains.iter().copied().fold(f64::MAX, f64::min), gains.iter().copied().fold(f64::MIN, f64::max));
    format!("single ones: attack {} to {}", number(least), number(most))
}

/// The share of scenes with an attack before and after, and the scenes in which only one of both attacks, where one program speaks for
/// itself.
fn shares(run: &RecordedRun, of: &LineageResult, verdict: Verdict) -> String {
    let percent = |attack: f64| num::fixed(100.0 * attack, 1);
    if !run.rounds.is_empty() && verdict != Verdict::Parent {
        let score = |attack: f64| num::fixed(attack, 3);
        let [is, was] = [&of.evolved, &of.parent].map(|of| score(of.objectives.attack));
        return format!("comes to attack {is}, its parent to {was}");
    }
    let [crashes, before] = [&of.evolved, &of.parent].map(|of| percent(of.any_contact));
    let (is, was) = (percent(of.evolved.objectives.attack), percent(of.parent.objectives.attack));
    if verdict == Verdict::Parent && run.rounds.is_empty() && run.opened.attack.is_none() {
        return format!("attacks in {was} % of the scenes (any crash {before} %)");
    }
    if says_nothing(run, verdict) {
        return String::new();
    }
    let [gained, lost] = moved(run, of);
    let gained = counted(gained, "scene");
    format!(
        "attacks in {is} % of the scenes (any crash {crashes} %), its parent in {was} % ({before} %): {gained} gained, {lost} lost{}",
        acts(of)
    )
}

/// Says in what share of the scenes each of both acts, where that differs much: realism is over these.
fn acts(of: &LineageResult) -> String {
    let (is, was) = (of.evolved.coverage, of.parent.coverage);
    let percent = |share: f64| num::fixed(100.0 * share, 0);
    if (is - was).abs() >= 0.05 {
        format!("; it acts in {} % of them, its parent in {} %", percent(is), percent(was))
    } else {
        String::new()
    }
}

/// Returns `true` if one program has no share of scenes of its own: the parent stays, or attack is a score.
fn says_nothing(run: &RecordedRun, verdict: Verdict) -> bool {
    matches!(verdict, Verdict::Parent | Verdict::Plain) || !run.rounds.is_empty() || run.opened.attack.is_some()
}

/// Scenes in which only the evolved program attacks, and in which only its parent does.
fn moved(run: &RecordedRun, of: &LineageResult) -> [usize; 2] {
    let outcomes = run.outcomes(of);
    let count = |wanted| outcomes.values().filter(|became| **became == wanted).count();
    [count(Became::Gained), count(Became::Lost)]
}

/// Says what share of the counting contacts is preventable, beside the parent's, and how many are rams; true if that share is below half.
fn contacts_say(run: &RecordedRun, of: &LineageResult, verdict: Verdict) -> (String, bool) {
    let percent = |[part, all]: [usize; 2]| num::fixed(100.0 * part as f64 / all as f64, 0);
    let is = preventable(run, &of.evolved.solution);
    if verdict == Verdict::Parent || run.opened.attack.is_some() || is[1] == 0 {
        return (String::new(), false);
    }
    let weigh = 2 * is[0] < is[1];
    let mut says = format!("{}{} % of its contacts are preventable", if weigh { "Only " } else { "" }, percent(is));
    let was = preventable(run, &of.parent.solution);
    if was[1] > 0 {
        says += &format!(" (its parent's: {} %)", percent(was));
    }
    let all = counting(run, &of.evolved.solution).count();
    let rams = counting(run, &of.evolved.solution).filter(|met| is_ram(met)).count();
    if 5 * rams >= all {
        says += &format!("; {} % are rams from behind", percent([rams, all]));
    }
    if let Some(blamed) = at_fault(run, &of.evolved.solution) {
        says += &format!("; for {} % the ego is at fault by nuPlan's rule", percent(blamed));
    }
    (says + ".", weigh)
}

/// Returns the number of counting contacts for which the ego is at fault, and the number that an outcome judges; `None` where none does.
fn at_fault(run: &RecordedRun, solution: &SolutionId) -> Option<[usize; 2]> {
    let said: Vec<Fault> =
        counting(run, solution).filter_map(|met| met.fault.as_deref().and_then(Fault::named)).collect();
    (!said.is_empty()).then(|| [said.iter().filter(|fault| fault.is_egos()).count(), said.len()])
}

/// The contacts of a program on held-out scenes that count as attacks.
fn counting<'r>(run: &'r RecordedRun, solution: &SolutionId) -> impl Iterator<Item = &'r Met> {
    let labels = run.held_out_labels(solution).into_values();
    let alone = labels.flat_map(SceneScore::each);
    alone.filter(|label| label.attack > 0.0).filter_map(|label| label.contact.as_ref())
}

fn preventable(run: &RecordedRun, solution: &SolutionId) -> [usize; 2] {
    let assessed: Vec<bool> = counting(run, solution).filter_map(prevented).collect();
    [assessed.iter().filter(|prevented| **prevented).count(), assessed.len()]
}

/// Classes of the contacts with an adversary that count as attacks.
fn contacts(run: &RecordedRun, solution: &SolutionId) -> Vec<(String, usize)> {
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    for met in counting(run, solution) {
        *counts.entry(met.class.as_str()).or_default() += 1;
    }
    let mut all: Vec<(String, usize)> = counts.into_iter().map(|(class, n)| (class.to_string(), n)).collect();
    all.sort_by(|a, b| b.1.cmp(&a.1).then_with(|| a.0.cmp(&b.0)));
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    fn estimate(value: f64, low: f64, high: f64) -> Option<Estimate> {
        Some(Estimate { interval: Some([low, high]), ..Estimate::plain(value) })
    }

    fn sentence(attack: Option<Estimate>, realism: Option<Estimate>) -> (Verdict, String) {
        let verdict = verdict(attack, realism);
        (verdict, says(verdict, attack, realism, "realism"))
    }

    #[test]
    fn a_sentence_claims_no_more_than_its_intervals() {
        let (up, none, down) =
            (estimate(0.08, 0.04, 0.12), estimate(0.001, -0.02, 0.03), estimate(-0.05, -0.09, -0.01));
        let (verdict, text) = sentence(up, none);
        assert_eq!(verdict, Verdict::Gain);
        assert_eq!(text, "attack +0.080 [+0.040, +0.120]; realism not told from equal (+0.001 [−0.020, +0.030])");
        assert_eq!(sentence(up, down).0, Verdict::Trade);
        assert!(sentence(up, down).1.contains(" at the price of realism −0.050 [−0.090, −0.010]"));
        assert_eq!(sentence(none, none).0, Verdict::Unsure);
        assert!(sentence(none, none).1.starts_with("no gain that these scenes tell from none"));
        assert_eq!(
            sentence(estimate(0.05, 0.0004, 0.1), none).0,
            Verdict::Unsure,
            "an end that is printed as 0 is none"
        );
        assert_eq!(sentence(down, none).0, Verdict::Loss);
        assert_eq!(sentence(down, up).0, Verdict::Concession);
        assert!(sentence(none, up).1.contains("; attack not told from equal"));
        assert_eq!(sentence(Some(Estimate::plain(0.2)), None), (Verdict::Plain, "attack +0.200".into()));
    }

    #[test]
    fn safebenchs_line_has_the_interval_of_its_table_and_the_sign_that_follows_from_it() {
        let mut run = crate::evidence::tables::recorded_unseen();
        let line = |run: &RecordedRun| headlines(run).remove(0);
        let of = line(&run);
        assert!(of.attack.unwrap().interval.is_some() && of.verdict != Verdict::Plain, "{of:?}");
        assert!(of.says.contains("ARS ") && !of.says.contains("realism"), "{}", of.says);
        assert!(of.shares.starts_with("comes to attack "), "{}", of.shares);
        // A record without held-out runs has two numbers.
        run.held_out.iter_mut().for_each(|of| of.runs.clear());
        assert_eq!(line(&run).verdict, Verdict::Plain);
    }

    #[test]
    fn a_line_says_where_a_program_acts_less_than_its_parent_and_not_where_it_acts_as_much() {
        let run = crate::evidence::tables::recorded_unseen();
        let mut result = run.result.clone().unwrap().lineages.remove(0);
        (result.parent.coverage, result.evolved.coverage) = (1.0, 0.82);
        assert_eq!(acts(&result), "; it acts in 82 % of them, its parent in 100 %");
        result.evolved.coverage = 0.96;
        assert_eq!(acts(&result), "");
    }
}
