//! The same labels under several readings of attack: that of the search, what published work counts, and what a careful ego could have
//! prevented. Every label holds the contact's class and whether it was avoidable, so no reading needs a rollout.

use serde::Serialize;

use super::derivations::{Derivations, ReplayRead, Source};
use super::error::TableError;
use super::key::Side;
use super::labels::{self, LineageLabels, Read, Reading, reading};
use super::layout::{Column, Form, Row, Sourced, Table, heads};
use super::metadrive::{quantity, replay_row, row, table};
use super::notes;
use super::paper::{self, Figures, metadrive as printed};
use super::searches::searches;
use crate::evaluation::ContactClass;
use crate::evidence::recorded_run::RecordedRun;
use crate::objects::event::LineageResult;
use crate::objects::{Met, SceneScore, SolutionId};
use crate::sim::Fault;
use crate::statistics::bootstrap;

const fn rate(key: &'static str, group: &'static str, head: &'static str, upward: Option<bool>) -> Column {
    Column { key, group, head, upward, form: Form::Rate }
}

const fn change(key: &'static str, group: &'static str) -> Column {
    Column { key, group, head: "Change", upward: Some(true), form: Form::RateChange }
}

const SEARCHED: &str = "As searched";
const PUBLISHED: &str = "Published";
const PREVENTABLE: &str = "Preventable";
const BLAMED: &str = "At fault";

/// Returns the contact that the program brought about, if a label says it: with an adversary of a program that acts in the scene, and not
/// one that the ego runs into without it. Which of several adversaries acts is in the rollout's record alone.
fn brought_about(scene: &SceneScore) -> Option<&Met> {
    scene.contact.as_ref().filter(|met| scene.acted && met.adversary && !met.anyway)
}

/// Returns `true` if the ego is struck from behind.
pub fn is_ram(met: &Met) -> bool {
    met.class == ContactClass::RearEndEgoStruck.name()
}

/// Returns whether a careful ego would have prevented it; `None` where nobody assessed it.
pub fn prevented(met: &Met) -> Option<bool> {
    met.avoidable.map(|_| could_be_prevented(met))
}

fn could_be_prevented(met: &Met) -> bool {
    let class = ContactClass::ALL.into_iter().find(|class| class.name() == met.class);
    class.is_some_and(|class| class.could_be_prevented(met.avoidable))
}

/// Any contact that the program brought about, whoever caused it.
pub(super) const BROUGHT_ABOUT: Read = |scene| brought(scene, |_| true);
/// Those of them that are rams from behind.
const RAMS: Read = |scene| brought(scene, is_ram);
/// Those of them in which the ego runs into something that stands.
const STANDING: Read = |scene| brought(scene, |met| met.class == ContactClass::StationaryHit.name());
/// Those of them that a careful ego could have avoided, of every class alike but rams from behind.
pub(super) const COULD_BE_PREVENTED: Read = |scene| brought(scene, could_be_prevented);
/// Those of them for which the ego is at fault by nuPlan's rule; `None` where the outcome of a contact does not say it.
pub(super) const AT_FAULT: Read = |scene| {
    let unsaid = scene.each().filter_map(brought_about).any(|met| met.fault.is_none());
    if unsaid { None } else { brought(scene, |met| fault_of(met).is_some_and(Fault::is_egos)) }
};

/// The clause of nuPlan's rule that decides of a contact.
fn fault_of(met: &Met) -> Option<Fault> {
    met.fault.as_deref().and_then(Fault::named)
}

/// The share of a scene's drivers with a contact that the program brought about and for which something holds.
fn brought(scene: &SceneScore, holds: fn(&Met) -> bool) -> Option<f64> {
    labels::over_drivers(scene, |label| brought_about(label).is_some_and(holds))
}

/// Shares of held-out scenes that a lineage's parent and its reported program attack where only preventable contacts count.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LineagePreventable {
    pub lineage: String,
    pub parent: f64,
    pub evolved: f64,
    /// The same of contacts for which the ego is at fault by nuPlan's rule, where outcomes say it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub at_fault: Option<[f64; 2]>,
}

impl LineagePreventable {
    /// `None` where the record lacks the labels of one of the two, and under SafeBench's protocol, which has a measure of its own.
    pub fn of(run: &RecordedRun, result: &LineageResult) -> Option<LineagePreventable> {
        let share = |solution: &SolutionId, reading: Read| {
            let score = run.held_out_score(&result.lineage, solution)?;
            let counted = score.scenes.iter().filter_map(reading).sum::<f64>();
            (score.benchmark.is_none() && !score.scenes.is_empty()).then(|| counted / score.scenes.len() as f64)
        };
        let both =
            |reading: Read| Some([share(&result.parent.solution, reading)?, share(&result.evolved.solution, reading)?]);
        let [parent, evolved] = both(COULD_BE_PREVENTED)?;
        let says = |solution: &SolutionId| {
            let score = run.held_out_score(&result.lineage, solution)?;
            Some(score.scenes.iter().filter_map(brought_about).any(|met| met.fault.is_some()))
        };
        let assessed =
            [&result.parent.solution, &result.evolved.solution].into_iter().filter_map(says).any(|said| said);
        let at_fault = if assessed { both(AT_FAULT) } else { None };
        Some(LineagePreventable { lineage: result.lineage.to_string(), parent, evolved, at_fault })
    }
}

/// The contacts that one program of a search brings about, as shares of held-out scenes.
#[derive(Clone, Debug, PartialEq)]
pub struct Contacts {
    /// Contacts of any class.
    pub all: f64,
    /// Contacts of each class, in the order of [`ContactClass::ALL`].
    pub by_class: Vec<(ContactClass, f64)>,
    /// Those of them that a careful ego could have prevented.
    pub preventable: f64,
}

/// The contacts of a search's parent and of its reported program, its repetitions together.
#[derive(Clone, Debug, PartialEq)]
pub struct SearchedContacts {
    pub method: String,
    pub policy: String,
    pub parent: Contacts,
    pub evolved: Contacts,
}

/// The contacts of every search of these runs, in their order.
///
/// # Errors
/// An unfinished run, one of the other protocol.
pub fn searched_contacts(runs: &[RecordedRun]) -> Result<Vec<SearchedContacts>, TableError> {
    let bases = Derivations::of(runs);
    let all = bases.lineages()?;
    let of_side = |of: &[&LineageLabels], side: Side| {
        let share = |read: &dyn Fn(&SceneScore) -> Option<f64>| {
            let estimates = bootstrap::estimates(&[quantity(of, |l| l.read(side, read))]);
            estimates.into_iter().flatten().next().map_or(0.0, |share| share.value)
        };
        let of_class = |class: ContactClass| {
            let of = move |scene: &SceneScore| brought_about(scene).is_some_and(|met| met.class == class.name());
            (class, share(&move |scene| Some(labels::share(of(scene)))))
        };
        Contacts {
            all: share(&BROUGHT_ABOUT),
            by_class: ContactClass::ALL.into_iter().map(of_class).collect(),
            preventable: share(&COULD_BE_PREVENTED),
        }
    };
    let searched = |of: &Vec<&LineageLabels>| SearchedContacts {
        method: of[0].label.clone(),
        policy: of[0].policy.clone(),
        parent: of_side(of, Side::Parent),
        evolved: of_side(of, Side::Evolved),
    };
    Ok(searches(all.iter().copied()).iter().map(searched).collect())
}

/// Counts of contacts that the program brings about.
const ALL: Reading = reading("1 where the program brings a contact about, else 0", BROUGHT_ABOUT);
const BY_RAMS: Reading = reading("1 where the program brings a ram from behind about, else 0", RAMS);
const BY_STANDING: Reading = reading("1 where the ego meets what the program made stand, else 0", STANDING);
const PREVENTED: Reading = reading(
    "1 where the program brings a contact about that a careful ego could have prevented, else 0",
    COULD_BE_PREVENTED,
);
const EGOS_FAULT: Reading = reading(
    "1 where the program brings a contact about for which the ego is at fault by nuPlan's rule, else 0",
    AT_FAULT,
);

/// Columns with the side and the reading that each is a mean of.
const READ: [(Column, Side, Reading); 14] = [
    (rate("parent_attack", SEARCHED, "Parent", Some(true)), Side::Parent, labels::ATTACK),
    (rate("evolved_attack", SEARCHED, "Evolved", Some(true)), Side::Evolved, labels::ATTACK),
    (change("attack_change", SEARCHED), Side::Change, labels::ATTACK),
    (rate("published_parent", PUBLISHED, "Parent", Some(true)), Side::Parent, ALL),
    (rate("published_evolved", PUBLISHED, "Evolved", Some(true)), Side::Evolved, ALL),
    (change("published_change", PUBLISHED), Side::Change, ALL),
    (rate("evolved_rams", PUBLISHED, "From behind", None), Side::Evolved, BY_RAMS),
    (rate("evolved_standing", PUBLISHED, "Standing", None), Side::Evolved, BY_STANDING),
    (rate("preventable_parent", PREVENTABLE, "Parent", Some(true)), Side::Parent, PREVENTED),
    (rate("preventable_evolved", PREVENTABLE, "Evolved", Some(true)), Side::Evolved, PREVENTED),
    (change("preventable_change", PREVENTABLE), Side::Change, PREVENTED),
    (rate("at_fault_parent", BLAMED, "Parent", Some(true)), Side::Parent, EGOS_FAULT),
    (rate("at_fault_evolved", BLAMED, "Evolved", Some(true)), Side::Evolved, EGOS_FAULT),
    (change("at_fault_change", BLAMED), Side::Change, EGOS_FAULT),
];
/// Number of the first columns, which every label can fill.
const TOLD_BY_ALL: usize = 11;

/// The columns: with those of who is at fault where some outcome says it (`simulator.at_fault`, `table --at-fault`).
fn columns_of(all: &[&LineageLabels]) -> &'static [(Column, Side, Reading)] {
    let says = |label: &SceneScore| label.each().filter_map(|of| of.contact.as_ref()).any(|met| met.fault.is_some());
    let some = |lineage: &&LineageLabels| {
        let share = |label: &SceneScore| Some(labels::share(says(label)));
        [Side::Parent, Side::Evolved].iter().any(|side| lineage.read(*side, share).values.contains(&Some(1.0)))
    };
    if all.iter().any(some) { &READ } else { &READ[..TOLD_BY_ALL] }
}

fn sourced((column, side, reading): &(Column, Side, Reading)) -> Sourced {
    (*column, Source::means(*side, reading.of, reading.words))
}

/// Attack of parent and evolved generator on held-out scenes by three readings, a row a method and ego.
pub fn metadrive_readings(runs: &[RecordedRun]) -> Result<Table, TableError> {
    let bases = Derivations::of(runs);
    let all = bases.lineages()?;
    let read = columns_of(&all);
    let columns: Vec<Sourced> = read.iter().map(sourced).collect();
    // Without a program nothing is brought about, which only the search's own reading may not ask for.
    let parents = read.iter().filter(|(_, side, _)| *side == Side::Parent);
    let of_replay = parents.map(|(column, ..)| -> (Column, ReplayRead) {
        let is_own = column.key == "parent_attack";
        (*column, if is_own { |scene, rules| Some(scene.attack(rules)) } else { |_, _| Some(0.0) })
    });
    let of_replay: Vec<_> = of_replay.collect();
    let replays = bases.replays()?.iter();
    let mut rows: Vec<Row> = replays.map(|of| replay_row(&bases, &[of], &columns, &of_replay)).collect();
    rows.extend(searches(all.iter().copied()).iter().map(|of| {
        let labels = vec![of[0].label.clone(), of[0].policy.clone()];
        let figures = figures(of[0]);
        Row { notes: Vec::new(), ..row(&bases, labels, of, &columns, figures.as_ref()) }
    }));
    let notes = notes(runs, &all, &rows);
    let title = "Attack in MetaDrive by three readings of the same contacts";
    table("metadrive-readings", title, Some(printed::POLICY_LABEL), heads(&columns), rows, notes, runs)
}

/// The paper counts collisions, so its figures stand beside the published reading.
fn figures(of: &LineageLabels) -> Option<Figures> {
    let theirs = printed::policy_figures(of.method?.name, paper::policy_name(&of.ego)?)?;
    let both = [theirs.under("parent_attack")?, theirs.under("evolved_attack")?];
    Some(Figures::new(["published_parent", "published_evolved"], &both))
}

fn notes(runs: &[RecordedRun], all: &[&LineageLabels], rows: &[Row]) -> Vec<String> {
    let mut notes = vec![
        "Shares of held-out scenes. As searched: the contacts that the experiment counts (evaluation.attack). Published: any contact with \
         an adversary that the program brought about, whoever caused it, as published work counts collisions. From behind and Standing: \
         the part of the evolved program's published contacts in which the ego is rammed from behind, or runs into somebody who stands. \
         Preventable: the part that a careful ego could have avoided by braking or swerving, asked of every class alike, rams from \
         behind left out."
            .to_string(),
        "A search is steered by the first reading alone: under another one its numbers show what it got on the way. The paper's attack \
         counts collisions, so its figures stand beside the published reading; whether a road user is met that the ego runs into without \
         the program is not asked there. A label says whether the program acts in a scene, not who of several adversaries does: where \
         one of them moves and the ego meets another that repeats its recording, the last two readings count it, and the first does not."
            .to_string(),
        notes::intervals("held-out scenes") + " Differences are paired by scene.",
    ];
    if columns_of(all).len() > TOLD_BY_ALL {
        notes.push("At fault: the part of the published contacts for which the ego is, by nuPlan's rule; reported, not searched.".into());
    }
    notes.extend(notes::one_seed(&notes::repeats(all.iter().copied()), "held-out scenes"));
    notes.extend(notes::all_alike(rows, 0, |column| column.form == Form::Rate));
    notes.extend(notes::of_runs(runs));
    notes.extend(notes::different_versions(runs));
    notes
}
