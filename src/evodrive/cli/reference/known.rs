//! `families`, `formats`, `features`: what there is, one line each.

use clap::ValueEnum;
use serde_json::json;

use crate::adapters::vocabulary::{self, Feature};
use crate::cli::scenes::{export::Format, readable::READ};
use crate::cli::terminal::answer::Answer;
use crate::cli::terminal::width::{stdout_width, with_words};
use crate::evaluation::outcome_fields;
use crate::families;
use crate::objects::ValueType;
use crate::scene::features::{TAGS, TAGS_MEAN};

/// The source families that `lineage[].family` can name.
pub fn families() -> Answer {
    let sources = families::sources();
    let row = |source: &crate::stage::Source| {
        let of = &source.contract;
        (of.family.to_string(), of.backend.clone(), of.title.clone(), of.describes.clone())
    };
    let rows: Vec<_> = sources.iter().map(row).collect();
    let line =
        |(name, protocol, title, _): &(String, String, String, String)| format!("{name:<13} {protocol:<10} {title}\n");
    let text: String = rows.iter().map(line).collect();
    let object = |(name, protocol, title, describes): &(String, String, String, String)| json!({"family": name, "protocol": protocol, "title": title, "describes": describes});
    Answer::new(text, json!({"families": rows.iter().map(object).collect::<Vec<_>>()}))
}

/// The scene formats that are read and written.
pub fn formats() -> Answer {
    let written: Vec<(String, String)> = Format::value_variants()
        .iter()
        .filter_map(|format| format.to_possible_value())
        .map(|value| (value.get_name().to_string(), value.get_help().map(ToString::to_string).unwrap_or_default()))
        .collect();
    let mut text = String::from("read (scenes import, --scenes):\n");
    READ.iter().for_each(|(name, files, what)| text += &format!("  {name:<13} {files:<26} {what}\n"));
    text += "written (scenes export --format):\n";
    written.iter().for_each(|(name, what)| text += &format!("  {name:<13} {}\n", what.replace('\n', " ")));
    let read = READ.map(|(name, files, what)| json!({"format": name, "files": files, "what": what}));
    let written: Vec<_> = written.iter().map(|(name, what)| json!({"format": name, "what": what})).collect();
    Answer::new(text, json!({"read": read, "written": written}))
}

/// The unit that stands last in a name, but for `min` and `max`; names without one are counts, shares and scores.
fn unit_of(name: &str) -> &'static str {
    let stem = name.trim_end_matches("_min").trim_end_matches("_max");
    let units = [("_mps3", "m/s3"), ("_mps2", "m/s2"), ("_mps", "m/s"), ("_rad", "rad"), ("_s", "s"), ("_m", "m")];
    units.into_iter().find(|(ending, _)| stem.ends_with(ending)).map_or("number", |(_, unit)| unit)
}

/// Features that expressions may read, by place.
const PLACES: [(&str, &[Feature]); 7] = [
    ("scene", vocabulary::SCENE),
    ("actor", vocabulary::ACTOR),
    ("candidate", vocabulary::CANDIDATE),
    ("rehearsed", vocabulary::REHEARSED),
    ("moment", vocabulary::SHAPE),
    ("law", vocabulary::LAW),
    ("adversaries", vocabulary::GROUP),
];

/// The quantities that expressions may read: those of programs, and an experiment's own attack over outcomes. What a family reads beyond them stands in its contract.
pub fn features() -> Answer {
    let width = stdout_width();
    let mut text = String::new();
    let mut rows = Vec::new();
    for (place, features) in PLACES {
        for of in features {
            let unit = match (of.value, of.unit) {
                (ValueType::Boolean, _) => "boolean",
                (_, unit) => unit,
            };
            text += &with_words(&format!("{place:<12} {:<34} {unit:<8}", of.name), of.describes, width);
            rows.push(json!({"of": place, "name": of.name, "unit": unit, "describes": of.describes}));
        }
    }
    for (name, unit, describes) in outcome_fields() {
        let unit = if unit == "number" { unit_of(name) } else { unit };
        text += &with_words(&format!("{:<12} {name:<34} {unit:<8}", "outcome"), describes, width);
        rows.push(json!({"of": "outcome", "name": name, "unit": unit, "describes": describes}));
    }
    for (name, describes) in TAGS.into_iter().zip(TAGS_MEAN) {
        text += &with_words(&format!("{:<12} {name:<34} {:<8}", "tag", "tag"), describes, width);
        rows.push(json!({"of": "tag", "name": name, "unit": "tag", "describes": describes}));
    }
    Answer::new(text, json!({"features": rows}))
}
