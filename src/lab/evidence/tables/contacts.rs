//! What lies behind attack in the MetaDrive protocol: contacts by class, and the readings of published work beside ours.

use std::collections::BTreeSet;

use super::error::TableError;
use super::key::{Reads, RowKey, Side};
use super::labels::{self, LineageLabels, Reading, ReplayLabels};
use super::layout::{Cell, Column, Form, Head, METHOD, POLICY, Part, REPLAY, ROLLOUTS, Row, Table};
use super::metadrive::{SCENES, SEEDS, estimated, quantity};
use super::notes;
use super::searches::searches;
use crate::evaluation::ContactClass;
use crate::evidence::recorded_run::RecordedRun;
use crate::objects::SceneScore;
use crate::statistics::bootstrap::Search;

const fn column(key: &'static str, group: &'static str, head: &'static str, form: Form) -> Column {
    Column { key, group, head, upward: None, form }
}

const ATTACK: Column = column("attack", "Ours", "Attack", Form::Rate);
const AVOIDABLE: Column = column("avoidable_contact", "Ours", "Preventable, rams too", Form::Rate);
const ADVERSARY: Column = column("adversary_contact", "Published", "Adversary", Form::Rate);
const ANY: Column = column("any_contact", "Published", "Anyone", Form::Rate);
const ANYWAY: Column = column("met_anyway", "Ours", "Anyway", Form::Rate);
const PENALTY_ALL: Column = column("rp_all_pct", "Published", "RP, all", Form::Percent);

/// Heads of the classes, in the order of [`ContactClass::ALL`].
const CLASS_HEADS: [&str; 8] =
    ["Ego strikes", "Ego sideswipes", "Standing", "Cut-in", "Crossing", "Head-on", "Sideswipe", "Ego rear-ended"];

/// Which of a lineage's programs.
const PROGRAM: Head = Head { key: "program", head: "Program" };

const PARENT: &str = "parent";
const EVOLVED: &str = "evolved";

/// Contacts of every parent and evolved generator on held-out scenes, a row a program and ego.
pub fn metadrive_contacts(runs: &[RecordedRun]) -> Result<Table, TableError> {
    let all = labels::lineages(runs)?;
    let mut rows: Vec<Row> = labels::replays(runs)?.iter().map(replay_row).collect();
    for of in searches(all.iter()) {
        rows.push(row(PARENT, &of, Side::Parent));
        rows.push(row(EVOLVED, &of, Side::Evolved));
    }
    let title = "Contacts behind attack in MetaDrive".to_string();
    let notes = notes(runs, &all, &rows);
    Ok(Table {
        name: "metadrive-contacts",
        labels: vec![METHOD, POLICY, PROGRAM],
        columns: columns(),
        counts: vec![SCENES, SEEDS, ROLLOUTS],
        parts: vec![Part { name: "metadrive-contacts".into(), title, source: None, rows }],
        runs: notes::runs(runs)?,
        notes,
    })
}

/// A number of a scene's label.
pub(super) type Read = Box<dyn Fn(&SceneScore) -> Option<f64>>;

/// The columns with what is read off a label for each.
pub(super) fn readings() -> Vec<(Column, Read)> {
    let plain: [(Column, Reading); 6] = [
        (ATTACK, labels::ATTACK),
        (AVOIDABLE, labels::AVOIDABLE_CONTACT),
        (ANYWAY, labels::MET_ANYWAY),
        (ADVERSARY, labels::ADVERSARY_CONTACT),
        (ANY, labels::ANY_CONTACT),
        (PENALTY_ALL, labels::PENALTY_ALL_PCT),
    ];
    let of_class = |(class, head): (ContactClass, &'static str)| {
        let met = move |scene: &SceneScore| labels::met(scene, |met| met.adversary && met.class == class.name());
        (column(class.name(), "By class", head, Form::Rate), Box::new(met) as Read)
    };
    let plain = plain.into_iter().map(|(column, reading)| (column, Box::new(reading) as Read));
    plain.chain(ContactClass::ALL.into_iter().zip(CLASS_HEADS).map(of_class)).collect()
}

fn columns() -> Vec<Column> {
    readings().into_iter().map(|(column, _)| column).collect()
}

fn row(program: &str, of: &[&LineageLabels], side: Side) -> Row {
    let readings = readings();
    let of_reading = |(column, read): &(Column, Read)| (*column, quantity(of, |l| l.read(side, read)));
    let quantities: Vec<_> = readings.iter().map(of_reading).collect();
    let suites: BTreeSet<_> = of.iter().map(|l| (l.suite, l.suite_scenes)).collect();
    let kinds: BTreeSet<&str> = of.iter().map(|l| l.proposals.as_str()).collect();
    Row {
        key: RowKey::reading(of.iter().map(|l| l.key()), Reads::Side(side)),
        labels: vec![of[0].label.clone(), of[0].policy.clone(), program.to_string()],
        lineages: of.iter().map(|l| l.lineage.to_string()).collect(),
        cells: Cell::row(&columns(), &estimated(&quantities), None),
        counts: vec![suites.iter().map(|(_, n)| n).sum(), of.len(), of.iter().map(|l| l.rollouts).sum()],
        proposals: kinds.into_iter().collect::<Vec<_>>().join(" + "),
        notes: Vec::new(),
    }
}

fn replay_row(replay: &ReplayLabels) -> Row {
    let search = Search { id: replay.suite, seeds: vec![replay.per_scene(|scene| Some(labels::share(scene.contact)))] };
    Row {
        key: RowKey::Replay { egos: vec![replay.key()], metric: None },
        labels: vec![REPLAY.to_string(), replay.policy.clone(), "none".to_string()],
        lineages: vec![format!("replay/{}", replay.ego)],
        cells: Cell::row(&columns(), &estimated(&[(ANY, vec![search])]), None),
        counts: vec![replay.scenes.len(), 1, replay.scenes.iter().flatten().count()],
        proposals: "none".into(),
        notes: Vec::new(),
    }
}

fn notes(runs: &[RecordedRun], all: &[LineageLabels], rows: &[Row]) -> Vec<String> {
    let mut notes = vec![
        "All numbers are shares of held-out scenes. A rollout ends with the ego's first contact, so the classes of a row add \
         up to its column Adversary. Which classes count for Attack, and which of them only where the ego could have avoided \
         the contact, is said in the experiment's table evaluation.attack. Anyway: the ego meets an adversary that it also runs \
         into in plain replay, which never counts."
            .to_string(),
        "Published work counts differently: CAT any crash with its adversary (Adversary), MetaDrive's crash flag any crash at \
         all (Anyone); the paper's realism is the plain mean over all scenes (RP, all), in which a scene that nobody touches \
         counts as perfectly realistic."
            .to_string(),
        notes::intervals("held-out scenes"),
    ];
    notes.extend(notes::one_seed(&notes::repeats(all.iter()), "held-out scenes"));
    notes.extend(notes::all_alike(rows, 0, |column| column.form == Form::Rate));
    notes.extend(notes::of_runs(runs));
    notes.extend(notes::different_versions(runs));
    notes
}
