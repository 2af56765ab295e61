//! Contacts behind attack in the MetaDrive protocol: their classes, and the readings of published work beside ours.

use std::sync::Arc;

use super::derivations::{Derivations, ReplayRead, Source};
use super::error::TableError;
use super::key::Side;
use super::labels::{self, LineageLabels, Reading, ReplayLabels};
use super::layout::{Column, Form, Head, METHOD, POLICY, Row, Sourced, Table, heads};
use super::metadrive::{replay_row, row, table};
use super::notes;
use super::searches::searches;
use crate::evaluation::ContactClass;
use crate::evidence::recorded_run::RecordedRun;
use crate::objects::SceneScore;

const fn column(key: &'static str, group: &'static str, head: &'static str, form: Form) -> Column {
    Column { key, group, head, upward: None, form }
}

const ANY: Column = column("any_contact", "Published", "Anyone", Form::Rate);

/// Heads of the classes, in the order of [`ContactClass::ALL`].
const CLASS_HEADS: [&str; 8] =
    ["Ego strikes", "Ego sideswipes", "Standing", "Cut-in", "Crossing", "Head-on", "Sideswipe", "Ego rear-ended"];

/// Head of the column that names one of a lineage's programs.
const PROGRAM: Head = Head { key: "program", head: "Program" };

/// Contacts of every parent and evolved generator on held-out scenes, a row a program and ego.
pub fn metadrive_contacts(runs: &[RecordedRun]) -> Result<Table, TableError> {
    let (bases, [parent, evolved]) = (Derivations::of(runs), [Side::Parent, Side::Evolved].map(columns));
    let all = bases.lineages()?;
    let without = |of: &ReplayLabels| {
        let met: (Column, ReplayRead) = (ANY, |scene, _| Some(labels::share(scene.contact)));
        let mut row = replay_row(&bases, &[of], &parent, &[met]);
        row.labels.push("none".into());
        row
    };
    let mut rows: Vec<Row> = bases.replays()?.iter().map(without).collect();
    for of in searches(all.iter().copied()) {
        for (program, columns) in [("parent", &parent), ("evolved", &evolved)] {
            let labels = vec![of[0].label.clone(), of[0].policy.clone(), program.to_string()];
            rows.push(Row { notes: Vec::new(), ..row(&bases, labels, &of, columns, None) });
        }
    }
    let notes = notes(runs, &all, &rows);
    let title = "Contacts behind attack in MetaDrive";
    let table = table("metadrive-contacts", title, None, heads(&parent), rows, notes, runs)?;
    Ok(Table { labels: vec![METHOD, POLICY, PROGRAM], ..table })
}

/// A number of a scene's label.
pub(super) type Read = Arc<dyn Fn(&SceneScore) -> Option<f64> + Send + Sync>;

/// The columns with what is read off a label for each, and what that is in words.
pub(super) fn readings() -> Vec<(Column, Read, String)> {
    let rate = |key, group, head| column(key, group, head, Form::Rate);
    let plain: [(Column, Reading); 6] = [
        (rate("attack", "Ours", "Attack"), labels::ATTACK),
        (rate("avoidable_contact", "Ours", "Preventable, rams too"), labels::AVOIDABLE_CONTACT),
        (rate("met_anyway", "Ours", "Anyway"), labels::MET_ANYWAY),
        (rate("adversary_contact", "Published", "Adversary"), labels::ADVERSARY_CONTACT),
        (ANY, labels::ANY_CONTACT),
        (column("rp_all_pct", "Published", "RP, all", Form::Percent), labels::PENALTY_ALL_PCT),
    ];
    let of_class = |(class, head): (ContactClass, &'static str)| {
        let met = move |scene: &SceneScore| labels::met(scene, |met| met.adversary && met.class == class.name());
        (rate(class.name(), "By class", head), Arc::new(met) as Read, of_class(class.name()))
    };
    let plain = plain.map(|(column, reading)| (column, Arc::new(reading.of) as Read, reading.words.to_string()));
    plain.into_iter().chain(ContactClass::ALL.into_iter().zip(CLASS_HEADS).map(of_class)).collect()
}

/// Describes a contact of a class in words.
fn of_class(class: &str) -> String {
    format!("1 where the ego meets an adversary in a contact of class {class}, else 0")
}

fn columns(side: Side) -> Vec<Sourced> {
    let sourced = |(column, read, what): (Column, Read, String)| {
        (column, Source::means(side, move |scene: &SceneScore| read(scene), what))
    };
    readings().into_iter().map(sourced).collect()
}

fn notes(runs: &[RecordedRun], all: &[&LineageLabels], rows: &[Row]) -> Vec<String> {
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
    notes.extend(notes::one_seed(&notes::repeats(all.iter().copied()), "held-out scenes"));
    notes.extend(notes::all_alike(rows, 0, |column| column.form == Form::Rate));
    notes.extend(notes::of_runs(runs));
    notes.extend(notes::different_versions(runs));
    notes
}
