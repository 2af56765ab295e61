//! fig:carla-cases: a scene as the original and the evolved generator play it, side by side, a row a lineage.
//!
//! The scene that is shown follows from the labels alone, so that nobody picks it: of the held-out scenes in which the reported program
//! attacks and the parent does not, the one with the highest realism, and of equal ones the first by its id.

use super::error::FigureError;
use super::legend::{self, LETTERS, source};
use crate::draw::{
    Actor, Anchor, BLACK, Drawing, Figure, GREY, Ink, Mark, Panel, Role, Words, colour, panel, roles_in, wrapped,
};
use crate::evaluation::ContactClass;
use crate::evidence::recorded_run::{Became, RecordedRun};
use crate::evidence::tables::called;
use crate::kernel::Vec2;
use crate::objects::event::LineageResult;
use crate::objects::{SceneScore, SolutionId};
use crate::text::counted;

/// A scene that a figure shows, and by which programs it is played.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WonScene {
    /// Its method against its ego.
    pub method: String,
    pub scene: String,
    pub original: SolutionId,
    pub evolved: SolutionId,
    /// Held-out scenes in which the evolved program alone attacks, and in which its parent alone does: one picture is the best of the first.
    pub gained: usize,
    pub lost: usize,
}

/// One lineage's scene, played.
pub struct Case {
    pub won: WonScene,
    pub original: Side,
    pub evolved: Side,
}

/// A rollout as it is shown.
pub struct Side {
    pub drawing: Drawing,
    /// Its end, in a few words.
    pub ending: String,
}

/// Says who does what to whom in a contact of the ego with an adversary.
pub fn met_in_words(class: ContactClass) -> &'static str {
    match class {
        ContactClass::EgoStrikes => "the ego runs into the adversary",
        ContactClass::EgoSideswipes => "the ego sideswipes the adversary",
        ContactClass::StationaryHit => "the ego runs into the standing adversary",
        ContactClass::CutIn => "the adversary cuts in on the ego",
        ContactClass::Crossing => "the adversary crosses the ego's way",
        ContactClass::HeadOn => "the adversary meets the ego head on",
        ContactClass::Sideswipe => "the adversary sideswipes the ego",
        ContactClass::RearEndEgoStruck => "the adversary rams the ego from behind",
    }
}

/// The scene of every lineage that has one; lineages whose reported program is their parent, or wins nothing, have none.
pub fn won_scenes(run: &RecordedRun) -> Vec<WonScene> {
    run.result.iter().flat_map(|result| &result.lineages).filter_map(|lineage| won(run, lineage)).collect()
}

fn won(run: &RecordedRun, lineage: &LineageResult) -> Option<WonScene> {
    let labels = |solution: &SolutionId| -> Option<&[SceneScore]> {
        let own = run.held_out.iter().find(|of| of.lineage == lineage.lineage && of.solution == *solution);
        own.map(|held_out| held_out.score.scenes.as_slice())
    };
    let (original, evolved) = (&lineage.parent.solution, &lineage.evolved.solution);
    let parents = labels(original)?;
    let missed = |scene: &str| parents.iter().any(|of| of.scene == scene && of.attack == 0.0);
    let mut best: Option<&SceneScore> = None;
    for label in labels(evolved)?.iter().filter(|label| label.attack > 0.0 && missed(&label.scene)) {
        let nearer = |than: &SceneScore| (-label.realism, &label.scene) < (-than.realism, &than.scene);
        if best.is_none_or(nearer) {
            best = Some(label);
        }
    }
    let outcomes = run.outcomes(lineage);
    let count = |wanted: Became| outcomes.values().filter(|became| **became == wanted).count();
    Some(WonScene {
        gained: count(Became::Gained),
        lost: count(Became::Lost),
        method: called(run, &lineage.lineage),
        scene: best?.scene.clone(),
        original: original.clone(),
        evolved: evolved.clone(),
    })
}

/// Points on the sheet.
const PANEL: [f64; 2] = [225.0, 118.0];
const LEFT: f64 = 10.0;
const GAP: f64 = 10.0;
/// Height from one lineage's row to the next.
const ROW: f64 = PANEL[1] + 40.0;
/// Metres from a panel's left to its right side.
const WIDTH_M: f64 = 70.0;

/// A row a case: both rollouts at the time at which the evolved one ends, each around its ego.
///
/// # Errors
/// No case.
pub fn cases(cases: &[Case], runs: &[RecordedRun]) -> Result<Figure, FigureError> {
    if cases.is_empty() {
        return Err(FigureError::NothingWon);
    }
    // Which scenes these are stands in the title: who plays them again needs it, who reads the page does not.
    let scenes: Vec<&str> = cases.iter().map(|case| case.won.scene.as_str()).collect();
    let title = format!("Scenes by the original and the evolved generator: {}", scenes.join(", "));
    let mut sheet = Figure::new(2.0 * (PANEL[0] + LEFT) + GAP, 30.0 + ROW * cases.len() as f64, title);
    legend::row(&mut sheet, LEFT, 14.0, &signs(cases));
    for (place, case) in cases.iter().enumerate() {
        row(&mut sheet, 26.0 + ROW * place as f64, case);
    }
    let rule = "Of the held-out scenes in which the reported program attacks and its parent does not, the one with the highest realism. Both at \
                the time at which the evolved rollout ends, or at their own end before it. Gained: such scenes; lost: those the other way round.";
    let boxes = "The white pane of a box is its windscreen, so that it heads that way.";
    legend::foot(&mut sheet, &format!("{boxes} {rule} {}", source(&runs.iter().collect::<Vec<_>>())));
    Ok(sheet)
}

/// The signs that some panel has, and no other.
fn signs(cases: &[Case]) -> Vec<legend::Entry<'static>> {
    let panels = || cases.iter().flat_map(|case| [(&case.original, case), (&case.evolved, case)]);
    let seen: Vec<Role> = panels()
        .flat_map(|(side, case)| {
            let step = shown_step(side, case);
            roles_in(&side.drawing, &around_ego(side, step, [0.0, 0.0, PANEL[0], PANEL[1]]))
        })
        .collect();
    let words = [
        (&[Role::Ego][..], "ego"),
        (&[Role::Adversary], "adversary"),
        (&[Role::Interacting, Role::Traffic, Role::Static], "traffic"),
        (&[Role::Cyclist], "cyclist"),
        (&[Role::Pedestrian], "pedestrian"),
    ];
    let is_seen = |roles: &[Role]| roles.iter().any(|role| seen.contains(role));
    let fill = |(roles, words): (&[Role], &'static str)| (Mark::Square, Ink::fill(colour(roles[0])), words);
    let mut signs: Vec<legend::Entry<'static>> = words.into_iter().filter(|(of, _)| is_seen(of)).map(fill).collect();
    if is_seen(&[Role::Ghost]) {
        signs.push((Mark::Square, Ink::line(GREY, 0.6).dashed(), "where the recording has it"));
    }
    let met = |(side, case): (&Side, &Case)| {
        side.drawing.contact.as_ref().is_some_and(|contact| contact.step <= shown_step(side, case))
    };
    if panels().any(met) {
        signs.push((Mark::Cross, Ink::line(BLACK, 1.2), "contact"));
    }
    signs
}

/// The step at which a side is shown: where the evolved rollout ends, or its own end before it.
fn shown_step(side: &Side, case: &Case) -> usize {
    side_end(&case.evolved).min(side.drawing.steps.saturating_sub(1))
}

/// Returns the panel of a side at a step, with the ego in the middle.
fn around_ego(side: &Side, step: usize, place: [f64; 4]) -> Panel {
    let ego = side.drawing.actors.iter().find(|actor| actor.role == Role::Ego);
    let middle = ego.and_then(|ego| place_at(ego, step)).unwrap_or(Vec2::ZERO);
    Panel { place, middle, width_m: WIDTH_M, step, ghosts: Vec::new() }
}

fn row(sheet: &mut Figure, top: f64, case: &Case) {
    let WonScene { method, gained, lost, .. } = &case.won;
    sheet.heading((LEFT, top + 8.0), LETTERS, format!("{method}: {} gained, {lost} lost", counted(*gained, "scene")));
    for (place, (head, side)) in [("original", &case.original), ("evolved", &case.evolved)].into_iter().enumerate() {
        let x = LEFT + place as f64 * (PANEL[0] + GAP);
        let step = shown_step(side, case);
        panel(sheet, &side.drawing, &around_ego(side, step, [x, top + 12.0, PANEL[0], PANEL[1]]));
        // The parent's labels say that it did not attack there, so this contact is one that the ego could not avoid or has anyway.
        let spared = place == 0 && side.drawing.contact.as_ref().is_some_and(|contact| contact.step <= step);
        let counts = if spared { ", which does not count as an attack" } else { "" };
        let caption = format!("{head}, {:.1} s: {}{counts}", side.drawing.clock_s(step), side.ending);
        for (line, text) in wrapped(&caption, 6.5, PANEL[0], 2).into_iter().enumerate() {
            let at = (x, top + PANEL[1] + 20.0 + 7.5 * line as f64);
            let (anchor, bold, upwards) = (Anchor::Start, false, false);
            sheet.words(Words { at, size: 6.5, anchor, bold, colour: GREY, upwards, text });
        }
    }
}

/// The last step that a rollout shows: that of the contact, if there was one.
fn side_end(side: &Side) -> usize {
    side.drawing.contact.as_ref().map_or(side.drawing.steps.saturating_sub(1), |contact| contact.step)
}

fn place_at(actor: &Actor, step: usize) -> Option<Vec2> {
    let seen = actor.samples.iter().take(step + 1).rev().flatten().next();
    seen.map(|sample| Vec2::new(sample[0], sample[1]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::draw::{Contact, Shape, width};

    fn side(contact: Option<usize>, steps: usize) -> Side {
        let samples = (0..steps).map(|k| Some([k as f64, 0.0, 0.0, 10.0])).collect();
        let ego = Actor { label: "ego".into(), role: Role::Ego, length_m: 4.0, width_m: 2.0, samples };
        let contact = contact.map(|step| Contact { step, point: Vec2::new(step as f64, 0.0), label: "met".into() });
        let drawing = Drawing { dt_s: 0.1, steps, actors: vec![ego], contact, ..Drawing::default() };
        Side { drawing, ending: "as it ended".into() }
    }

    #[test]
    fn both_sides_stand_at_the_evolved_ones_end_and_the_case_is_named() {
        let won = || WonScene {
            method: "CAT against IDM".into(),
            scene: "synthetic-7".into(),
            original: SolutionId::new("cat-idm/parent"),
            evolved: SolutionId::new("cat-idm/e1s1"),
            gained: 3,
            lost: 5,
        };
        let case = Case { won: won(), original: side(None, 40), evolved: side(Some(20), 30) };
        let sheet = cases(&[case], &[]).unwrap();
        let text = |shape: &Shape| match shape {
            Shape::Text(words) => Some(words.text.clone()),
            _ => None,
        };
        let words: Vec<String> = sheet.shapes.iter().filter_map(text).collect();
        for caption in
            ["CAT against IDM: 3 scenes gained, 5 lost", "original, 2.0 s: as it ended", "evolved, 2.0 s: as it ended"]
        {
            assert!(words.iter().any(|line| line == caption), "{caption}: {words:?}");
        }
        let panels = sheet.shapes.iter().filter(|shape| matches!(shape, Shape::Within(..))).count();
        assert_eq!(panels, 2);
        for (sign, there) in [("ego", true), ("contact", true), ("adversary", false), ("cyclist", false)] {
            assert_eq!(words.iter().any(|line| line == sign), there, "the legend and {sign}: {words:?}");
        }
        let case = Case { won: won(), original: side(Some(10), 11), evolved: side(Some(20), 30) };
        let sheet = cases(&[case], &[]).unwrap();
        let mut words = sheet.shapes.iter().filter_map(text);
        assert!(words.any(|line| line == "original, 1.0 s: as it ended, which does not count as an attack"));
        assert!(matches!(cases(&[], &[]), Err(FigureError::NothingWon)));
        assert!(sheet.shapes.iter().all(|shape| match shape {
            Shape::Text(words) => words.at.0 + width(&words.text, words.size) < sheet.width + 12.0,
            _ => true,
        }));
    }
}
