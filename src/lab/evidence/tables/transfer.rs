//! Programs against drivers that they were not evolved on: a row for what a program was evolved on, a column a driver, on scenes that no
//! search has seen. Every program is planned around whoever drives: what is carried over is the generator, not a recorded scene.

use std::collections::BTreeSet;

use super::drivers::DRIVERS;
use super::key::RowKey;
use super::labels::{self, Labels, Read};
use super::layout::{Cell, Column, Form, Head, METHOD, Part, Row, Table};
use super::metadrive::{SCENES, SEEDS, estimated};
use super::notes;
use super::readings::{AT_FAULT, BROUGHT_ABOUT, COULD_BE_PREVENTED};
use crate::kernel::{Digest, num};
use crate::objects::{SceneScore, Score};
use crate::statistics::bootstrap::{PerScene, Quantity, Search};
use crate::world::measures::kendall;

/// One lineage's reported program and its parent.
#[derive(Clone, Debug, PartialEq)]
pub struct Line {
    /// The family as tables call it.
    pub family: String,
    /// Proposer, and the ego that it proposed against: `random patches on pdm`.
    pub evolved_on: String,
    /// Number of this repetition of its search.
    pub replica: u32,
    /// Places in [`Transferred::scores`].
    pub parent: usize,
    pub program: usize,
}

/// Scores of programs against several drivers on one list of scenes.
#[derive(Clone, Debug)]
pub struct Transferred {
    /// Digest of the pool.
    pub pool: Digest,
    pub scenes: Vec<String>,
    /// Drivers by their names in [`DRIVERS`].
    pub drivers: Vec<&'static str>,
    pub lines: Vec<Line>,
    /// Program, then driver.
    pub scores: Vec<Vec<Score>>,
}

const EVOLVED_ON: Head = Head { key: "evolved_on", head: "Evolved on" };
/// The row of programs that nobody evolved.
const PARENT: &str = "parent";
/// The rows over all families.
const ALL: &str = "all families";

/// Name, the panel's head in a heat map, title.
const READINGS: [(&str, &str, &str, Read); 3] = [
    (
        "published",
        "Published",
        "Published: any contact with an adversary that the program brought about",
        BROUGHT_ABOUT,
    ),
    ("preventable", "Preventable", "Preventable: the part that a careful driver avoids", COULD_BE_PREVENTED),
    ("at-fault", "At fault", "At fault: the part for which the driver is, by nuPlan's rule", AT_FAULT),
];

/// The programs of one row: a quantity has a search a family and a seed a repetition.
struct RowOf<'t> {
    family: Option<&'t str>,
    evolved_on: &'t str,
    lines: Vec<&'t Line>,
}

impl RowOf<'_> {
    fn is_parent(&self) -> bool {
        self.evolved_on == PARENT
    }
}

impl Transferred {
    /// The row of parents first, then what they were evolved on in the order of the lines; over all families, or of one.
    fn rows<'t>(&'t self, family: Option<&'t str>) -> Vec<RowOf<'t>> {
        let own: Vec<&Line> = self.lines.iter().filter(|line| family.is_none_or(|of| line.family == of)).collect();
        let mut all = vec![RowOf { family, evolved_on: PARENT, lines: Vec::new() }];
        for line in own {
            // Of equal parents of a family one is enough.
            if !all[0].lines.iter().any(|known| (&known.family, known.parent) == (&line.family, line.parent)) {
                all[0].lines.push(line);
            }
            match all[1..].iter_mut().find(|row| row.evolved_on == line.evolved_on) {
                Some(row) => row.lines.push(line),
                None => all.push(RowOf { family, evolved_on: &line.evolved_on, lines: vec![line] }),
            }
        }
        all
    }

    fn families(&self) -> Vec<&str> {
        let mut seen = BTreeSet::new();
        self.lines.iter().map(|line| line.family.as_str()).filter(|family| seen.insert(*family)).collect()
    }

    /// Family and what it was evolved on of every program; of a program in several lines by the first.
    pub fn names(&self) -> Vec<String> {
        let name = |place: usize| {
            let parent = self.lines.iter().find(|line| line.parent == place);
            let own = self.lines.iter().find(|line| line.program == place);
            let parent = parent.map(|line| format!("{}: {PARENT}", line.family));
            parent.or(own.map(|line| format!("{}: {}", line.family, line.evolved_on))).unwrap_or_default()
        };
        (0..self.scores.len()).map(name).collect()
    }

    /// Returns the digest of the scenes, by which the streams of the bootstrap are named.
    pub fn suite(&self) -> Digest {
        Digest::of_bytes(format!("{} {}", self.pool, self.scenes.join("\n")).as_bytes())
    }

    fn values(&self, program: usize, driver: usize, of: Read) -> Vec<Option<f64>> {
        Labels::of(&self.scores[program][driver], &self.scenes).values(of)
    }

    /// The row's numbers against one driver, scene by scene: its programs', or those less their parents' where `change` is asked for.
    fn quantity(&self, row: &RowOf<'_>, driver: usize, of: Read, change: bool) -> Quantity {
        let per_scene = |line: &Line| {
            let program = if row.is_parent() { line.parent } else { line.program };
            let own = self.values(program, driver, of);
            let values = if change {
                let before = self.values(line.parent, driver, of);
                own.into_iter().zip(before).map(|(after, before)| Some(after? - before?)).collect()
            } else {
                own
            };
            PerScene { suite: self.suite(), values }
        };
        let each: Vec<(&str, PerScene)> =
            row.lines.iter().map(|line| (line.family.as_str(), per_scene(line))).collect();
        let families: BTreeSet<&str> = each.iter().map(|(family, _)| *family).collect();
        let search = |family: &str| Search {
            id: Digest::of_bytes(family.as_bytes()),
            seeds: each.iter().filter(|(of, _)| *of == family).map(|(_, part)| part.clone()).collect(),
        };
        families.into_iter().map(search).collect()
    }

    fn columns(&self) -> Vec<Column> {
        let column = |name: &&'static str| {
            let (key, _, head) = DRIVERS.into_iter().find(|(known, ..)| known == name)?;
            Some(Column { key, group: "Driven by", head, upward: Some(true), form: Form::Rate })
        };
        self.drivers.iter().filter_map(column).collect()
    }

    fn row(&self, of: &RowOf<'_>, reading: Read, change: bool) -> Row {
        let columns = self.columns();
        let numbered = columns.iter().enumerate();
        let quantities: Vec<(Column, Quantity)> =
            numbered.map(|(driver, column)| (*column, self.quantity(of, driver, reading, change))).collect();
        let form = if change { Form::RateChange } else { Form::Rate };
        let columns: Vec<Column> = columns.into_iter().map(|column| Column { form, ..column }).collect();
        let replicas: BTreeSet<u32> = of.lines.iter().map(|line| line.replica).collect();
        Row {
            key: RowKey::Elsewhere,
            labels: vec![of.family.unwrap_or(ALL).to_string(), of.evolved_on.to_string()],
            lineages: of.lines.iter().map(|line| format!("{} {}", line.family, line.evolved_on)).collect(),
            cells: Cell::row(&columns, &estimated(&quantities)),
            counts: vec![self.scenes.len(), if of.is_parent() { 1 } else { replicas.len() }],
            proposals: String::new(),
            notes: Vec::new(),
        }
    }
}

/// The matrix by three readings, and what each row adds to its parents, paired by scene. `by_family` adds a row a family.
pub fn transfer(of: &Transferred, by_family: bool) -> Table {
    let families = if by_family { of.families() } else { Vec::new() };
    let mut rows = of.rows(None);
    rows.extend(families.into_iter().flat_map(|family| of.rows(Some(family))));
    let part = |(name, _, title, reading): (&str, &str, &str, Read), change: bool| Part {
        name: format!("transfer-{name}{}", if change { "-change" } else { "" }),
        title: if change { format!("{title}; change over the parent, paired by scene") } else { title.to_string() },
        source: None,
        rows: rows.iter().filter(|row| !(change && row.is_parent())).map(|row| of.row(row, reading, change)).collect(),
    };
    let parts = READINGS.into_iter().flat_map(|reading| [part(reading, false), part(reading, true)]).collect();
    Table {
        name: "transfer",
        labels: vec![METHOD, EVOLVED_ON],
        columns: of.columns(),
        counts: vec![SCENES, SEEDS],
        parts,
        runs: Vec::new(),
        notes: notes(of),
    }
}

/// A row's name, and its share by driver; `None` where none is known.
pub type NamedShares = (String, Vec<Option<f64>>);

/// Returns the data of a heat map: for each reading its head, and over all families the rows' names and shares by driver.
pub fn panels(table: &Table) -> Vec<(&'static str, Vec<NamedShares>)> {
    let share = |row: &Row| row.cells.iter().map(|cell| cell.ours.map(|of| of.value)).collect();
    let shown = |(name, head, ..): (&str, &'static str, &str, Read)| {
        let part = table.parts.iter().find(|part| part.name == format!("transfer-{name}"))?;
        let rows = part.rows.iter().filter(|row| row.labels[0] == ALL);
        Some((head, rows.map(|row| (row.labels[1].clone(), share(row))).collect()))
    };
    READINGS.into_iter().filter_map(shown).collect()
}

fn notes(of: &Transferred) -> Vec<String> {
    let without = |row: &RowOf<'_>| {
        let own: BTreeSet<&str> = row.lines.iter().map(|line| line.family.as_str()).collect();
        let lacking: Vec<&str> = of.families().into_iter().filter(|family| !own.contains(family)).collect();
        (!lacking.is_empty()).then(|| format!("The row {:?} has no program of {}.", row.evolved_on, lacking.join(", ")))
    };
    let failed: usize = of.scores.iter().flatten().map(|score| score.failures.len()).max().unwrap_or(0);
    let mut notes = vec![
        "Shares of scenes that no search has seen. A program is planned around whoever drives, so what is carried over is the generator. \
         Rows over all families are means over these; a family's parent counts once."
            .to_string(),
        notes::intervals("scenes") + " Changes are paired by scene with the program's own parent.",
    ];
    if failed > 0 {
        notes.push(format!("Up to {failed} scenes of a program have no label against a driver and count nowhere."));
    }
    notes.extend(of.rows(None).iter().filter_map(without));
    notes.extend(READINGS.iter().filter_map(|(name, _, _, read)| reachable(of, name, *read)));
    notes
}

/// Programs below it do not count among those that reach a scene (paper: R >= 0.95).
const REALISM_MIN: f64 = 0.95;

/// The share of scenes that at least one realistic program hits, by driver, beside that of the best one alone: a bound from hindsight on
/// what a program could gain by choosing well in each scene.
fn reachable(of: &Transferred, name: &str, read: Read) -> Option<String> {
    let each: Vec<String> = (0..of.drivers.len())
        .filter_map(|driver| {
            let realistic = (0..of.scores.len()).filter(|at| of.scores[*at][driver].objectives.realism >= REALISM_MIN);
            let hits: Vec<Vec<Option<f64>>> = realistic.map(|program| of.values(program, driver, read)).collect();
            let mean = |values: Vec<f64>| num::mean(&values);
            let best = hits.iter().filter_map(|one| mean(one.iter().flatten().copied().collect())).reduce(f64::max)?;
            let of_scene = |scene: usize| hits.iter().filter_map(|one| one[scene]).reduce(f64::max);
            let some = mean((0..of.scenes.len()).filter_map(of_scene).collect())?;
            let (driver, count) = (of.drivers[driver], hits.len());
            Some(format!("{driver} {} (best alone {}, of {count})", num::fixed(some, 3), num::fixed(best, 3)))
        })
        .collect();
    let says = format!(
        "Reachable, {name}: the share of scenes that at least one of the programs with realism of {REALISM_MIN} or more hits, known only \
         afterwards: {}.",
        each.join("; ")
    );
    (!each.is_empty()).then_some(says)
}

/// Judge of a contact: its name and its reading.
type Judge = (&'static str, Read);

/// Judges of the same contacts: each says which of them count.
const JUDGES: [Judge; 5] = [
    ("published", BROUGHT_ABOUT),
    ("at fault (nuPlan)", AT_FAULT),
    ("careful driver avoids", COULD_BE_PREVENTED),
    ("some of the jury avoid", |scene| avoided(scene, |avoid, _| avoid > 0)),
    ("all of the jury avoid", |scene| avoided(scene, |avoid, of| of > 0 && avoid == of)),
];

/// The share of a scene's drivers with a contact about which the jury of docs/OBJECTIVES.md section 3 says so.
fn avoided(scene: &SceneScore, says: fn(usize, usize) -> bool) -> Option<f64> {
    labels::met(scene, |met| met.adversary && !met.anyway && met.avoided_by.is_some_and(|[avoid, of]| says(avoid, of)))
}

/// Makes a Markdown table of how alike judges rank the programs against one driver: Kendall's tau-b, one judge a row and column.
pub fn judges(of: &Transferred, driver: usize) -> String {
    let share = |program: usize, judge: Read| {
        let values: Vec<f64> = of.values(program, driver, judge).into_iter().flatten().collect();
        num::mean(&values).unwrap_or(0.0)
    };
    let ranked: Vec<Vec<f64>> =
        JUDGES.iter().map(|(_, judge)| (0..of.scores.len()).map(|program| share(program, *judge)).collect()).collect();
    let mut out = format!("| {} programs | {} |\n|---", of.scores.len(), JUDGES.map(|(name, _)| name).join(" | "));
    out += &"|--:".repeat(JUDGES.len());
    out += "|\n";
    for (row, (name, _)) in JUDGES.iter().enumerate() {
        let cell =
            |column: usize| kendall(&ranked[row], &ranked[column]).map_or("–".to_string(), |tau| num::signed(tau, 2));
        let cells: Vec<String> = (0..JUDGES.len()).map(cell).collect();
        out += &format!("| {name} | {} |\n", cells.join(" | "));
    }
    out
}

/// A careful driver who judges contacts, and the scores of the programs by its judgement, in the order of [`Transferred::scores`].
#[derive(Clone, Debug)]
pub struct Careful {
    pub name: &'static str,
    pub scores: Vec<Score>,
}

/// The preventable share of scenes against the first driver, by who judges, a program one row; above them the share of contacts about which a
/// judge says otherwise than the declared one, whose labels the programs have. Markdown.
pub fn sensitivity(of: &Transferred, others: &[Careful]) -> String {
    let own = of.scores.iter().filter_map(|of_program| of_program.first().cloned()).collect();
    let judges: Vec<Careful> =
        std::iter::once(Careful { name: "as declared", scores: own }).chain(others.iter().cloned()).collect();
    let avoidable = |score: &Score| -> Vec<Option<bool>> {
        score.scenes.iter().map(|scene| scene.contact.as_ref().and_then(|met| met.avoidable)).collect()
    };
    let verdicts = |judge: &Careful| judge.scores.iter().flat_map(avoidable).collect::<Vec<Option<bool>>>();
    let first = verdicts(&judges[0]);
    let moved = |judge: &Careful| {
        let both = first.iter().zip(verdicts(judge)).filter_map(|(one, other)| Some(labels::share((*one)? != other?)));
        num::mean(&both.collect::<Vec<f64>>())
    };
    let share = |program: usize, judge: &Careful| {
        let read: Vec<f64> = judge.scores[program].scenes.iter().filter_map(COULD_BE_PREVENTED).collect();
        num::mean(&read)
    };
    let written = |values: Vec<Option<f64>>| -> String {
        let cell = |value: Option<f64>| value.map_or("–".to_string(), |value| format!("{value:.3}"));
        values.into_iter().map(|value| format!(" {} |", cell(value))).collect()
    };
    let driver = of.drivers.first().copied().unwrap_or_default();
    let mut out = format!(
        "# What the preventable share owes to the careful driver who judges\n\nShares of {} scenes that no search has seen, driven by {driver}. A careful \
         driver could have prevented the contact; rams from behind count nowhere.\n\n| program |",
        of.scenes.len()
    );
    judges.iter().for_each(|judge| out += &format!(" {} |", judge.name));
    out += &format!("\n|---{}|\n", "|--:".repeat(judges.len()));
    out += &format!("| contacts judged otherwise than as declared |{}\n", written(judges.iter().map(moved).collect()));
    for (program, name) in of.names().into_iter().enumerate() {
        out += &format!("| {name} |{}\n", written(judges.iter().map(|judge| share(program, judge)).collect()));
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluation::score_of;
    use crate::objects::Met;
    use crate::objects::fixture::scene_score;
    use crate::sim::Fault;

    fn label(place: usize) -> SceneScore {
        scene_score(&format!("scene-{place}"), 0.0, 1.0)
    }

    /// Contacts in the first of ten scenes; each of a fault of the ego's, or not.
    fn score(contacts: usize, fault: Fault) -> Score {
        let mut score = score_of((0..10).map(label).collect(), Vec::new(), Default::default()).unwrap();
        for scene in score.scenes.iter_mut().take(contacts) {
            scene.contact = Some(Met {
                adversary: true,
                class: "cut_in".into(),
                avoidable: Some(fault.is_egos()),
                fault: Some(fault.name().into()),
                avoided_by: Some([1, 4]),
                anyway: false,
            });
        }
        score
    }

    fn example() -> Transferred {
        let lines = vec![
            Line { family: "CAT".into(), evolved_on: "rules on idm".into(), replica: 0, parent: 0, program: 1 },
            Line { family: "AT".into(), evolved_on: "rules on idm".into(), replica: 0, parent: 0, program: 2 },
        ];
        let scores = vec![
            vec![score(2, Fault::ActiveFront), score(1, Fault::ActiveFront)],
            vec![score(8, Fault::ActiveFront), score(2, Fault::ActiveRear)],
            vec![score(6, Fault::ActiveFront), score(0, Fault::ActiveRear)],
        ];
        let scenes = scores[0][0].scenes.iter().map(|scene| scene.scene.clone()).collect();
        Transferred { pool: Digest::of_bytes(b"pool"), scenes, drivers: vec!["idm", "pdm"], lines, scores }
    }

    fn value(table: &Table, part: &str, row: usize, key: &str) -> f64 {
        let part = table.parts.iter().find(|of| of.name == part).unwrap();
        part.rows[row].cell(key).ours.unwrap().value
    }

    #[test]
    fn each_column_is_the_driver_that_it_names() {
        let table = transfer(&example(), false);
        let shares = |part: &str, row: usize| ["idm", "pdm"].map(|driver| value(&table, part, row, driver));
        assert_eq!(shares("transfer-published", 0), [0.2, 0.1]);
        assert_eq!(shares("transfer-published", 1), [0.7, 0.1]);
        assert_eq!(shares("transfer-at-fault", 1), [0.7, 0.0]);
        let change = shares("transfer-published-change", 0);
        assert!((change[0] - 0.5).abs() < 1e-12 && change[1].abs() < 1e-12, "{change:?}");
    }

    #[test]
    fn what_some_program_reaches_is_a_union_of_scenes_over_realistic_programs_alone() {
        let mut of = example();
        let contacts: Vec<Option<Met>> =
            of.scores[2][0].scenes.iter().rev().map(|scene| scene.contact.clone()).collect();
        of.scores[2][0].scenes.iter_mut().zip(contacts).for_each(|(scene, contact)| scene.contact = contact);
        let says = |of: &Transferred| reachable(of, "published", BROUGHT_ABOUT).unwrap();
        // Eight scenes from the first on, six from the last on.
        assert!(says(&of).contains("idm 1.000 (best alone 0.800, of 3); pdm 0.200"), "{}", says(&of));
        of.scores[2][0].objectives.realism = 0.94;
        assert!(says(&of).contains("idm 0.800 (best alone 0.800, of 2)"), "{}", says(&of));
    }

    #[test]
    fn who_judges_moves_the_preventable_share_and_the_verdicts_that_moved_are_counted() {
        let of = example();
        // The other judge calls every contact of the first program unavoidable, two of the sixteen.
        let mut scores: Vec<Score> = of.scores.iter().map(|of_program| of_program[0].clone()).collect();
        scores[0]
            .scenes
            .iter_mut()
            .filter_map(|scene| scene.contact.as_mut())
            .for_each(|met| met.avoidable = Some(false));
        let text = sensitivity(&of, &[Careful { name: "slower", scores }]);
        for line in [
            "| program | as declared | slower |",
            "| contacts judged otherwise than as declared | 0.000 | 0.125 |",
            "| CAT: parent | 0.200 | 0.000 |",
            "| CAT: rules on idm | 0.800 | 0.800 |",
            "| AT: rules on idm | 0.600 | 0.600 |",
        ] {
            assert!(text.lines().any(|of| of == line), "{line}\n{text}");
        }
    }

    #[test]
    fn a_row_a_family_says_what_the_mean_hides() {
        let table = transfer(&example(), true);
        let part = table.parts.iter().find(|of| of.name == "transfer-published").unwrap();
        let named: Vec<String> = part.rows.iter().map(|row| row.labels.join("/")).collect();
        let cat = named.iter().position(|name| name == "CAT/rules on idm").unwrap();
        assert_eq!(value(&table, "transfer-published", cat, "idm"), 0.8);
    }

    #[test]
    fn a_contact_whose_outcome_does_not_say_whose_fault_it_is_counts_nowhere() {
        let mut of = example();
        of.scores[1][0].scenes[0].contact.as_mut().unwrap().fault = None;
        let table = transfer(&of, true);
        let part = table.parts.iter().find(|of| of.name == "transfer-at-fault").unwrap();
        let row = part.rows.iter().find(|row| row.labels == ["CAT", "rules on idm"]).unwrap();
        assert!((row.cell("idm").ours.unwrap().value - 7.0 / 9.0).abs() < 1e-12);
    }

    #[test]
    fn judges_who_rank_alike_agree_and_who_rank_in_reverse_do_not() {
        assert_eq!(kendall(&[1.0, 2.0, 3.0], &[10.0, 20.0, 30.0]), Some(1.0));
        assert_eq!(kendall(&[1.0, 2.0, 3.0], &[3.0, 2.0, 1.0]), Some(-1.0));
        assert_eq!(kendall(&[1.0, 1.0], &[3.0, 2.0]), None);
        // Five pairs of one order, one tied by one judge: 5 / sqrt(6 · 5).
        let tau = kendall(&[1.0, 2.0, 3.0, 4.0], &[1.0, 2.0, 3.0, 3.0]).unwrap();
        assert!((tau - 5.0 / 30.0_f64.sqrt()).abs() < 1e-12, "{tau}");
    }

    #[test]
    fn a_jury_of_whom_one_in_four_avoids_is_some_and_not_all() {
        let text = judges(&example(), 0);
        assert!(text.contains("some of the jury avoid") && text.lines().count() == 2 + JUDGES.len(), "{text}");
        let all = text.lines().last().unwrap();
        assert!(all.ends_with("| – | – | – | – | – |"), "nobody's contact is avoided by all: {all}");
    }
}
