//! Contacts by who hit whom: those that parents and reported programs bring about on held-out scenes, stacked by class, and the part of
//! them that a careful ego could have prevented.

use super::error::FigureError;
use super::legend;
use crate::draw::{
    Anchor, BLACK, BLUE, Figure, GREEN, GREY, Ink, LIGHT, Mark, ORANGE, PURPLE, Rgb, SKY, VERMILION, WHITE,
};
use crate::evaluation::ContactClass;
use crate::evidence::recorded_run::RecordedRun;
use crate::evidence::tables::{Contacts, SearchedContacts, searched_contacts};
use crate::kernel::num;
use crate::objects::LineageId;

/// Width of the sheet, points: both columns of a page.
const WIDE: f64 = 494.0;
/// Left end of the bars, and the width of the share 1.
const LEFT: f64 = 118.0;
const WHOLE: f64 = 250.0;
/// Height of a bar, of the line of what is preventable below it, and from one program to the next.
const BAR: f64 = 10.0;
const LINE: f64 = 3.0;
const PROGRAM: f64 = 16.0;
/// Between two searches.
const APART: f64 = 6.0;
/// Most searches of a sheet.
const SEARCHES_MAX: usize = 12;

/// Classes that are told together, from what the ego is hit by to what it does: words, colour, classes.
const GROUPS: [(&str, Rgb, &[ContactClass]); 6] = [
    ("rammed from behind", VERMILION, &[ContactClass::RearEndEgoStruck]),
    ("head on", ORANGE, &[ContactClass::HeadOn]),
    ("side by side", PURPLE, &[ContactClass::Sideswipe]),
    ("crossing", GREEN, &[ContactClass::Crossing]),
    ("cut in", SKY, &[ContactClass::CutIn]),
    (
        "the ego drives into it",
        BLUE,
        &[ContactClass::EgoStrikes, ContactClass::EgoSideswipes, ContactClass::StationaryHit],
    ),
];

/// Two bars a search; of all, or of the lineages that are named.
pub fn contact_bars(runs: &[RecordedRun], named: &[LineageId]) -> Result<Figure, FigureError> {
    let all = searched_contacts(&super::front::of_lineages(runs, named)?)?;
    if all.is_empty() {
        return Err(FigureError::NoLabels);
    }
    if all.len() > SEARCHES_MAX {
        let known = all.into_iter().map(|of| of.method).collect();
        return Err(FigureError::TooManyLineages { most: SEARCHES_MAX, known });
    }
    Ok(drawn(&all, &legend::source(&runs.iter().collect::<Vec<_>>())))
}

fn share_of(contacts: &Contacts, classes: &[ContactClass]) -> f64 {
    contacts.by_class.iter().filter(|(class, _)| classes.contains(class)).map(|(_, share)| share).sum()
}

fn drawn(all: &[SearchedContacts], source: &str) -> Figure {
    let mut sheet = Figure::new(WIDE, 0.0, "Contacts that parents and reported programs bring about, by class");
    let shows = |classes: &[ContactClass]| {
        all.iter().any(|of| [&of.parent, &of.evolved].iter().any(|contacts| share_of(contacts, classes) > 0.0))
    };
    let groups: Vec<_> = GROUPS.into_iter().filter(|(.., classes)| shows(classes)).collect();
    let entries: Vec<legend::Entry<'_>> =
        groups.iter().map(|(words, colour, _)| (Mark::Square, Ink::fill(*colour), *words)).collect();
    let end = legend::row(&mut sheet, 8.0, 11.0, &entries);
    debug_assert!(end <= WIDE);
    legend::row(
        &mut sheet,
        8.0,
        23.0,
        &[(Mark::Square, Ink::fill(BLACK), "of these, what a careful ego could have prevented")],
    );
    let (top, high) = (34.0, all.len() as f64 * (2.0 * PROGRAM + APART));
    let across = |share: f64| LEFT + WHOLE * share;
    for tick in [0.0, 0.25, 0.5, 0.75, 1.0] {
        sheet.line((across(tick), top), (across(tick), top + high), Ink::line(LIGHT, 0.6));
        let percent = format!("{} %", num::fixed(100.0 * tick, 0));
        sheet.text((across(tick), top + high + 10.0), legend::LETTERS, Anchor::Middle, percent);
    }
    sheet.text((across(0.5), top + high + 21.0), legend::LETTERS, Anchor::Middle, "of held-out scenes");
    let several = all.iter().any(|of| of.policy != all[0].policy);
    for (place, of) in all.iter().enumerate() {
        let y = top + place as f64 * (2.0 * PROGRAM + APART) + 4.0;
        sheet.heading((8.0, y + BAR - 2.0), 8.5, of.method.as_str());
        if several {
            sheet.text(
                (8.0, y + PROGRAM + BAR - 2.0),
                legend::LETTERS,
                Anchor::Start,
                format!("against {}", of.policy),
            );
        }
        for (row, (name, contacts)) in [("parent", &of.parent), ("evolved", &of.evolved)].into_iter().enumerate() {
            let y = y + row as f64 * PROGRAM;
            sheet.text((LEFT - 5.0, y + BAR - 2.5), legend::LETTERS, Anchor::End, name);
            let mut from = 0.0;
            for (_, colour, classes) in &groups {
                let share = share_of(contacts, classes);
                sheet.rect([across(from), y, WHOLE * share, BAR], Ink::fill(*colour).edged(WHITE, 0.3));
                from += share;
            }
            sheet.rect([LEFT, y + BAR, WHOLE * contacts.preventable, LINE], Ink::fill(BLACK));
            let percent = |share: f64| format!("{} %", num::fixed(100.0 * share, 1));
            let said = format!("{}, preventable {}", percent(contacts.all), percent(contacts.preventable));
            sheet.text((across(1.0) + 6.0, y + BAR - 2.5), legend::LETTERS, Anchor::Start, said);
        }
    }
    sheet.line((LEFT, top), (LEFT, top + high), Ink::line(GREY, 0.8));
    sheet.height = top + high + 30.0;
    let rule = "Contacts with a road user that the program moves, which the ego does not have without it, by who does what to whom.";
    legend::foot(&mut sheet, &format!("{rule} {source}"));
    sheet
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::draw::{Shape, pdf};

    fn contacts(rams: f64, crossing: f64, preventable: f64) -> Contacts {
        let share = |class| match class {
            ContactClass::RearEndEgoStruck => rams,
            ContactClass::Crossing => crossing,
            _ => 0.0,
        };
        let by_class = ContactClass::ALL.into_iter().map(|class| (class, share(class))).collect();
        Contacts { all: rams + crossing, by_class, preventable }
    }

    fn search() -> SearchedContacts {
        let (parent, evolved) = (contacts(0.1, 0.2, 0.125), contacts(0.9, 0.0, 0.0));
        SearchedContacts { method: "CAT".into(), policy: "IDM".into(), parent, evolved }
    }

    fn texts(figure: &Figure) -> Vec<String> {
        let of = |shape: &Shape| match shape {
            Shape::Text(words) => Some(words.text.clone()),
            _ => None,
        };
        figure.shapes.iter().filter_map(of).collect()
    }

    /// Widths of the rectangles of a colour, the legend's left out.
    fn widths(figure: &Figure, colour: Rgb) -> Vec<f64> {
        let of = |shape: &Shape| match shape {
            Shape::Rect([x, _, wide, _], ink) if ink.fill == Some(colour) && *x >= LEFT => Some(wide / WHOLE),
            _ => None,
        };
        figure.shapes.iter().filter_map(of).collect()
    }

    #[test]
    fn every_class_is_as_long_as_its_share_and_the_preventable_part_is_marked() {
        let figure = drawn(&[search()], "Recorded: x.");
        let near = |of: Vec<f64>, wanted: &[f64]| {
            assert_eq!(of.len(), wanted.len(), "{of:?}");
            assert!(of.iter().zip(wanted).all(|(of, wanted)| (of - wanted).abs() < 1e-9), "{of:?} {wanted:?}");
        };
        near(widths(&figure, VERMILION), &[0.1, 0.9]);
        near(widths(&figure, GREEN), &[0.2, 0.0]);
        near(widths(&figure, BLACK), &[0.125, 0.0]);
        let said = texts(&figure);
        assert!(said.iter().any(|text| text == "30.0 %, preventable 12.5 %"), "{said:?}");
    }

    #[test]
    fn the_legend_names_what_is_there_and_no_more_and_all_fits() {
        let figure = drawn(&[search()], "Recorded: x.");
        let said = texts(&figure);
        for (words, there) in [("rammed from behind", true), ("crossing", true), ("cut in", false)] {
            assert_eq!(said.iter().any(|text| text == words), there, "{words}");
        }
        let all = [0.1; 8];
        let by_class = ContactClass::ALL.into_iter().zip(all).collect();
        let every = Contacts { all: 0.8, by_class, preventable: 0.1 };
        let whole = drawn(&[SearchedContacts { parent: every.clone(), evolved: every, ..search() }], "Recorded: x.");
        assert!(pdf(&whole).is_ok());
        for shape in &whole.shapes {
            if let Shape::Text(words) = shape {
                let end = words.at.0
                    + if words.anchor == Anchor::Start { crate::draw::width(&words.text, words.size) } else { 0.0 };
                assert!(end <= whole.width && words.at.1 <= whole.height, "{words:?}");
            }
        }
    }
}
