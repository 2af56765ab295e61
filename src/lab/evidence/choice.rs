//! Reasons why a lineage reports the program that it reports: everybody who was measured on the whole evolution pool, the
//! experiment's rule, and who fell out at which part of it. Labels are the recorded ones; the rule is the archive's.

use serde::Serialize;
use std::fmt::Write as _;

use super::aligned::Aligned;
use super::realism::realism_text;
use super::recorded_run::RecordedRun;
use crate::archive::{Contender, Selection, SelectionRule, SelectorOptions, select_active};
use crate::kernel::num;
use crate::objects::event::{LineageResult, Measured};
use crate::objects::{LineageId, SolutionId};
use crate::text::counted;

/// A choice with what it rests on.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Choice {
    /// Lineage that chose.
    pub lineage: LineageId,
    /// The program that is reported.
    pub chosen: SolutionId,
    /// The lineage's parent, which is always among those who are compared.
    pub parent: SolutionId,
    /// Scenes on which they were compared and the parent was labelled.
    pub scenes: usize,
    /// Scenes of it in which the parent has no label.
    #[serde(skip_serializing_if = "is_none")]
    pub unlabelled: usize,
    /// Name of the realism that the rule reads: `strict realism`, or `ARS` in SafeBench's protocol.
    pub realism_name: &'static str,
    /// The rule, in one sentence with the experiment's numbers.
    pub rule: String,
    /// Reasons for this one, sentence by sentence. The last one is for a parent that stays.
    pub reasons: Vec<String>,
    /// Everybody who was compared, the parent first, in the order in which they were.
    pub rows: Vec<Row>,
    /// Programs that the budget of finalists had no room for, so that they have no labels there.
    pub cut: Vec<SolutionId>,
    /// Scenes of the comparison: `the whole evolution pool`, or `scenes of selection`.
    pub measured_on: &'static str,
    /// Attack of the chosen descendant where it was searched and chosen, and where neither was done; empty where the parent stays.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub optimism: Vec<Measure>,
}

/// The attack of a program on a list of scenes.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Measure {
    /// `its window`, `all windows`, that of [`Choice::measured_on`], `held out`.
    pub on: &'static str,
    pub attack: f64,
}

/// The words for both.
const POOL: &str = "the whole evolution pool";
const SELECTION: &str = "scenes of selection";

/// Returns the attack of a chosen descendant at each stage: the longer a search, the more of what it sees first is luck.
fn optimism(run: &RecordedRun, result: &LineageResult, measured_on: &'static str) -> Vec<Measure> {
    let chosen = &result.evolved.solution;
    let of_window = run.attempts.iter().find(|of| of.id.as_str() == chosen.as_str());
    let on_front = result.front.iter().find(|point| point.solution == *chosen);
    let finalist = run.finalists.iter().find(|of| of.lineage == result.lineage && of.solution == *chosen);
    let measures = [
        ("its window", of_window.and_then(|of| Some(of.exit.score()?.objectives.attack))),
        ("all windows", on_front.map(|of| of.objectives.attack)),
        (measured_on, finalist.map(|of| of.score.objectives.attack)),
        ("held out", Some(result.evolved.objectives.attack)),
    ];
    if of_window.is_none() {
        return Vec::new();
    }
    measures.into_iter().filter_map(|(on, attack)| Some(Measure { on, attack: attack? })).collect()
}

/// One of those who were compared.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// Its labels there.
    #[serde(flatten)]
    pub measured: Measured,
    /// True if it stands on the front after the last epoch.
    pub on_front: bool,
    /// Its standing under the rule; `None` where the record does not follow the rule as it is now.
    pub standing: Option<Standing>,
}

impl Row {
    /// Its line in the table of a choice.
    fn cells(&self) -> Vec<String> {
        let Row { measured, on_front, standing } = self;
        let front = on_front.then_some("on the front");
        let said: Vec<&str> = standing.iter().map(|standing| standing.words()).chain(front).collect();
        vec![
            measured.solution.to_string(),
            num::fixed(measured.objectives.attack, 3),
            realism_text(measured.objectives.realism, measured.coverage),
            num::fixed(measured.coverage, 2),
            num::fixed(measured.any_contact, 3),
            said.join("; "),
        ]
    }
}

/// Part of the rule at which a program fell out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Standing {
    /// It is reported.
    Chosen,
    /// It acts in no scene, so it is no contender.
    ActsNowhere,
    /// Its realism is below what the experiment requires.
    TooUnrealistic,
    /// Realistic enough, but its attack is below the best one by more than the tolerance.
    TooWeak,
    /// As good as tied in attack with the best, or nobody is realistic enough: another one is more realistic.
    LessRealistic,
    /// As realistic as the chosen one, with less attack.
    LessAttack,
    /// Equal in both to the chosen one, which came before it.
    Later,
}

impl Standing {
    /// Returns the standing in a few words.
    pub fn words(self) -> &'static str {
        match self {
            Standing::Chosen => "chosen",
            Standing::ActsNowhere => "acts nowhere",
            Standing::TooUnrealistic => "not realistic enough",
            Standing::TooWeak => "not enough attack",
            Standing::LessRealistic => "less realistic",
            Standing::LessAttack => "less attack",
            Standing::Later => "equal to the chosen one, which came before it",
        }
    }
}

impl Choice {
    /// The choice of a lineage; `None` while the run is unfinished or has no such lineage.
    pub fn of(run: &RecordedRun, lineage: &LineageId, options: &SelectorOptions) -> Option<Choice> {
        let result = run.result_of(lineage)?;
        let finalists: Vec<_> = run.finalists.iter().filter(|of| of.lineage == *lineage).collect();
        let measured: Vec<Measured> =
            finalists.iter().map(|of| Measured::new(of.solution.clone(), &of.score)).collect();
        let contenders: Vec<Contender> = measured.iter().map(contender).collect();
        let selection = select_active(&contenders, options)?;
        // A record of another version may have been made by another rule: then its own sentence is all there is to say.
        let follows = selection.solution == result.evolved.solution && selection.reason() == result.selection;
        let standing = |of: &Measured| follows.then(|| standing(of, &selection, options));
        let on_front = |of: &Measured| result.front.iter().any(|point| point.solution == of.solution);
        let row = |of: Measured| Row { on_front: on_front(&of), standing: standing(&of), measured: of };
        let rows: Vec<Row> = measured.into_iter().map(row).collect();
        let measured_on = if run.opened.selection_scenes.is_empty() { POOL } else { SELECTION };
        let realism_name = finalists.first()?.score.realism_name();
        let reasons = if follows {
            reasons(&rows, &selection, options, &result.parent.solution)
        } else {
            vec![result.selection.clone()]
        };
        Some(Choice {
            lineage: lineage.clone(),
            chosen: result.evolved.solution.clone(),
            parent: result.parent.solution.clone(),
            scenes: finalists.first().map_or(0, |of| of.score.scenes.len()),
            unlabelled: finalists.first().map_or(0, |of| of.score.failures.len()),
            realism_name,
            rule: rule(options, realism_name),
            reasons,
            rows,
            cut: result.cut.clone(),
            measured_on,
            optimism: optimism(run, result, measured_on),
        })
    }

    /// Table and reasons, as a terminal shows them: the table within the width, each sentence in one line.
    pub fn text(&self, width: usize) -> String {
        let scenes = match self.unlabelled {
            0 => counted(self.scenes, "scene"),
            without => format!("{} of {}", self.scenes, counted(self.scenes + without, "scene")),
        };
        let mut out =
            format!("why {} (labels on {}, {scenes})\n  rule: {}\n", self.chosen, self.measured_on, self.rule);
        let heads = ["program", "attack", self.realism_name, "coverage", "any crash", ""].map(String::from).to_vec();
        let rows = self.rows.iter().map(Row::cells).collect();
        out.push_str(&Aligned { indent: 2, labels: 1, words: 1, heads, rows }.text(width));
        for reason in &self.reasons {
            let _ = writeln!(out, "  {reason}");
        }
        if !self.optimism.is_empty() {
            let each: Vec<String> =
                self.optimism.iter().map(|of| format!("{} {}", of.on, num::fixed(of.attack, 3))).collect();
            let _ = writeln!(out, "  Its attack where it was searched, chosen and tested: {}.", each.join(", "));
        }
        if !self.cut.is_empty() {
            let cut: Vec<&str> = self.cut.iter().map(SolutionId::as_str).collect();
            let _ = writeln!(
                out,
                "  Not measured there, because the budget of finalists had no room for them: {}.",
                cut.join(", ")
            );
        }
        out
    }
}

fn is_none(count: &usize) -> bool {
    *count == 0
}

fn contender(of: &Measured) -> Contender {
    Contender { solution: of.solution.clone(), objectives: of.objectives, coverage: of.coverage }
}

fn rule(options: &SelectorOptions, realism: &str) -> String {
    let [least, share] = [options.realism_min, num::rounded(100.0 * (1.0 - options.tied_share()), 6)];
    format!(
        "{realism} of at least {least}, then the best attack; of those within {share} % of it the most realistic, then the one with more attack, then \
         the earlier one"
    )
}

/// Returns the standing that the rule's own account gives this program.
fn standing(of: &Measured, selection: &Selection, options: &SelectorOptions) -> Standing {
    let (own, best) = (of.objectives, selection.objectives);
    let constrained = selection.rule == SelectionRule::RealismConstrained;
    if of.solution == selection.solution {
        Standing::Chosen
    } else if !options.admits(of.coverage) {
        Standing::ActsNowhere
    } else if constrained && own.realism < options.realism_min {
        Standing::TooUnrealistic
    } else if constrained && !selection.tied.contains(&of.solution) {
        Standing::TooWeak
    } else if own.realism < best.realism {
        Standing::LessRealistic
    } else if own.attack < best.attack {
        Standing::LessAttack
    } else {
        Standing::Later
    }
}

fn reasons(rows: &[Row], selection: &Selection, options: &SelectorOptions, parent: &SolutionId) -> Vec<String> {
    let chosen = &selection.solution;
    let mut said = Vec::new();
    match selection.attack_best {
        Some(best) => {
            said.push(format!(
                "Realistic enough: {} of the {} ({}).",
                selection.eligible,
                acting(selection.contenders),
                names(rows, |row| options.admits(row.measured.coverage)
                    && row.measured.objectives.realism >= options.realism_min)
            ));
            if best <= 0.0 {
                said.push(attackless(rows, selection, options));
                return with_parent(said, rows, selection, parent);
            }
            let floor = num::fixed(options.tied_share() * best, 4);
            let best = num::fixed(best, 3);
            said.push(match selection.tied.len() {
                1 => format!("Of these {chosen} has the best attack, {best}; no other one has {floor} or more."),
                tied => format!(
                    "The best attack among them is {best}; {tied} have {floor} or more and count as tied: {}. {}",
                    names(rows, |row| selection.tied.contains(&row.measured.solution)),
                    tie_break(rows, selection)
                ),
            });
        }
        None if rows.iter().all(|row| !options.admits(row.measured.coverage)) => {
            said.push(format!("No program acts in any scene, so there is nothing to choose by: {chosen} is reported."));
        }
        None => said.push(format!(
            "None of the {} is realistic enough, so the most realistic one is taken. {}",
            acting(selection.contenders),
            tie_break(rows, selection)
        )),
    }
    with_parent(said, rows, selection, parent)
}

fn with_parent(mut said: Vec<String>, rows: &[Row], selection: &Selection, parent: &SolutionId) -> Vec<String> {
    if selection.solution == *parent {
        said.push(format!("The parent stays: {}.", staying(rows, selection)));
    }
    said
}

/// Explains the choice where no program that is realistic enough attacks, and names the one that would have.
fn attackless(rows: &[Row], selection: &Selection, options: &SelectorOptions) -> String {
    let how = match selection.tied.len() {
        1 => format!("{} is the only one of them.", selection.solution),
        _ => tie_break(rows, selection),
    };
    let below = rows.iter().map(|row| &row.measured);
    let below = below.filter(|of| options.admits(of.coverage) && of.objectives.realism < options.realism_min);
    // Of equals the first.
    let most = below.reduce(|most, of| if of.objectives.attack > most.objectives.attack { of } else { most });
    let most = most.filter(|of| of.objectives.attack > 0.0).map_or(String::new(), |of| {
        let (attack, realism) = (num::fixed(of.objectives.attack, 3), num::fixed(of.objectives.realism, 4));
        format!(" Below the floor {} has the most attack, {attack}, at a realism of {realism}.", of.solution)
    });
    format!("None of the programs that are realistic enough has any attack; {how}{most}")
}

/// Says how many programs act.
fn acting(count: usize) -> String {
    format!("{} that {}", counted(count, "program"), if count == 1 { "acts" } else { "act" })
}

/// Explains what decided between those who were left at the end.
fn tie_break(rows: &[Row], selection: &Selection) -> String {
    let any = |standing| rows.iter().any(|row| row.standing == Some(standing));
    let (chosen, best) = (&selection.solution, selection.objectives);
    if any(Standing::Later) {
        format!("{chosen} and another one have the same labels; the earlier one is taken.")
    } else if any(Standing::LessAttack) {
        format!(
            "{chosen} and another one are the most realistic, {}; the one with more attack is taken.",
            num::fixed(best.realism, 4)
        )
    } else {
        format!("{chosen} is the most realistic of them, {}.", num::fixed(best.realism, 4))
    }
}

/// Explains why nobody took the parent's place.
fn staying(rows: &[Row], selection: &Selection) -> &'static str {
    let any = |standing| rows.iter().any(|row| row.standing == Some(standing));
    if rows.len() == 1 {
        "no descendant was on the front or ever the active program, so no other program was measured"
    } else if rows.iter().skip(1).all(|row| row.measured.coverage <= 0.0) {
        "no descendant acts in any scene"
    } else if selection.rule == SelectionRule::MostRealistic {
        "no descendant is more realistic"
    } else if any(Standing::Later) {
        "a descendant has the same labels, and of equals the earlier one is taken"
    } else if any(Standing::LessAttack) || any(Standing::LessRealistic) {
        "descendants with as good an attack are not more realistic"
    } else if any(Standing::TooWeak) {
        "descendants that are realistic enough attack less"
    } else {
        "no descendant reaches the realism required"
    }
}

fn names(rows: &[Row], which: impl Fn(&Row) -> bool) -> String {
    let of: Vec<&str> = rows.iter().filter(|row| which(row)).map(|row| row.measured.solution.as_str()).collect();
    of.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::objects::Objectives;

    const PAPER: SelectorOptions = SelectorOptions::at(0.95, 0.05);

    /// Rows of points (attack, realism, coverage), the parent first, with the reasons of the choice among them.
    fn standings(points: &[[f64; 3]]) -> (Vec<Standing>, String) {
        let name = |k: usize| SolutionId::new(if k == 0 { "parent".into() } else { format!("c{k}") });
        let measured = |(k, [attack, realism, coverage]): (usize, &[f64; 3])| Measured {
            solution: name(k),
            objectives: Objectives { attack: *attack, realism: *realism },
            realism_penalty_pct: 0.0,
            coverage: *coverage,
            any_contact: 0.0,
        };
        let measured: Vec<Measured> = points.iter().enumerate().map(measured).collect();
        let selection = select_active(&measured.iter().map(contender).collect::<Vec<_>>(), &PAPER).unwrap();
        let row = |of: &Measured| Row {
            measured: of.clone(),
            on_front: false,
            standing: Some(standing(of, &selection, &PAPER)),
        };
        let rows: Vec<Row> = measured.iter().map(row).collect();
        let reasons = reasons(&rows, &selection, &PAPER, &name(0)).join(" ");
        (rows.iter().filter_map(|row| row.standing).collect(), reasons)
    }

    #[test]
    fn everybody_is_told_where_the_rule_left_them() {
        use Standing::*;
        let (standings, reasons) = standings(&[
            [0.10, 0.99, 1.0],
            [0.90, 0.90, 1.0],
            [0.40, 0.96, 1.0],
            [0.39, 0.98, 1.0],
            [0.38, 0.98, 1.0],
            [0.39, 0.98, 1.0],
            [0.50, 0.99, 0.0],
        ]);
        assert_eq!(standings, [TooWeak, TooUnrealistic, LessRealistic, Chosen, LessAttack, Later, ActsNowhere]);
        assert!(
            reasons.contains("Realistic enough: 5 of the 6 programs that act (parent, c2, c3, c4, c5)."),
            "{reasons}"
        );
        assert!(reasons.contains("is 0.400; 4 have 0.3800 or more and count as tied: c2, c3, c4, c5."), "{reasons}");
        assert!(reasons.contains("the earlier one is taken") && !reasons.contains("parent stays"), "{reasons}");
    }

    #[test]
    fn a_parent_that_stays_is_told_why_each_time_for_the_reason_that_holds() {
        let cases: [(&[[f64; 3]], &str); 7] = [
            (&[[0.1, 0.99, 1.0]], "no other program was measured"),
            (&[[0.1, 0.99, 1.0], [0.5, 0.99, 0.0]], "no descendant acts in any scene"),
            (&[[0.1, 0.90, 1.0], [0.5, 0.80, 1.0]], "no descendant is more realistic"),
            (&[[0.1, 0.99, 1.0], [0.5, 0.80, 1.0]], "no descendant reaches the realism required"),
            (&[[0.5, 0.97, 1.0], [0.1, 0.99, 1.0]], "descendants that are realistic enough attack less"),
            (&[[0.5, 0.97, 1.0], [0.5, 0.96, 1.0]], "are not more realistic"),
            (&[[0.5, 0.97, 1.0], [0.5, 0.97, 1.0]], "has the same labels"),
        ];
        for (points, expected) in cases {
            let (standings, reasons) = standings(points);
            assert_eq!(standings[0], Standing::Chosen, "{points:?}");
            assert!(reasons.contains("The parent stays: ") && reasons.contains(expected), "{points:?}: {reasons}");
            let mut others = cases.iter().map(|(_, other)| *other).filter(|other| *other != expected);
            assert!(others.all(|other| !reasons.contains(other)), "{points:?}: {reasons}");
        }
    }

    #[test]
    fn where_nobody_realistic_enough_attacks_the_most_attacking_one_below_the_floor_is_named() {
        let below = [[0.0, 0.99, 1.0], [0.1, 0.80, 1.0], [0.4, 0.90, 1.0], [0.9, 0.90, 0.0]];
        let (_, alone) = standings(&below);
        assert!(alone.contains("has any attack; parent is the only one of them. Below"), "{alone}");
        assert!(alone.contains("Below the floor c2 has the most attack, 0.400, at a realism of 0.9000."), "{alone}");
        let (_, tied) = standings(&[[0.0, 0.96, 1.0], [0.0, 0.99, 1.0], [0.0, 0.90, 1.0]]);
        assert!(tied.contains("has any attack; c1 is the most realistic of them, 0.9900."), "{tied}");
        assert!(!tied.contains("Below the floor") && !tied.contains("or more"), "{tied}");
    }

    #[test]
    fn where_nobody_is_realistic_enough_nobody_is_said_to_be_too_unrealistic() {
        let (standings, reasons) = standings(&[[0.1, 0.80, 1.0], [0.2, 0.90, 1.0], [0.3, 0.90, 1.0]]);
        assert_eq!(standings, [Standing::LessRealistic, Standing::LessAttack, Standing::Chosen]);
        assert!(
            reasons.contains("None of the 3") && reasons.contains("the one with more attack is taken"),
            "{reasons}"
        );
    }
}
