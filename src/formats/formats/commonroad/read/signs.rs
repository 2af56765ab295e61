//! Signs and lights by id: the speed or the stop that a sign demands, and the cycle of a light.

use std::collections::BTreeMap;

use super::{File, named, point};
use crate::formats::import_error::{ImportError, shown};
use crate::formats::imported::Imported;
use crate::formats::speed_limit::limit_mps;
use crate::formats::xml_read::Element;
use crate::kernel::{Vec2, num};
use crate::scene::LightState;

/// Maximum-speed signs in the schema's catalogues (Germany and Zamunda, USA, Spain); the value is in m/s. Other
/// countries' files use the German numbers.
const SPEED_SIGNS: [&str; 4] = ["274", "274.1", "R2-1", "r301"];
/// Stop signs of the same catalogues, and the American one.
const STOP_SIGNS: [&str; 3] = ["206", "r2", "R1-1"];

/// Most phases of a light's cycle.
const PHASES_MAX: usize = 100;
/// Words on the rest that is kept where a sign or a light is left out.
const OTHERS_KEPT: &str = "the other elements are kept";

#[derive(Clone)]
pub(super) struct Cycle {
    active: bool,
    offset_steps: f64,
    /// Duration in steps of the file, state.
    phases: Vec<(f64, LightState)>,
}

impl Cycle {
    /// Returns the state at a step of the file: the first phase begins at the offset and the cycle repeats both ways.
    pub fn state_at(&self, step: f64) -> LightState {
        let total = num::sum(self.phases.iter().map(|p| p.0));
        if !self.active || total <= 0.0 {
            return LightState::Unknown;
        }
        let mut left = step - self.offset_steps;
        left -= (left / total).floor() * total;
        for (duration, state) in &self.phases {
            // Resampling may put a step just before a change by a rounding error; it then belongs after the change.
            if left < duration - 1e-6 {
                return *state;
            }
            left -= duration;
        }
        self.phases[0].1
    }
}

/// Reads a speed limit in m/s, or with its unit behind it.
pub(super) fn speed(element: &Element<'_>) -> Result<f64, ImportError> {
    limit_mps(element.text(), "m/s").map_err(|expected| element.refuse(expected))
}

#[derive(Default)]
pub(super) struct Sign {
    pub speed_limit_mps: Option<f64>,
    pub is_stop: bool,
    pub position: Option<Vec2>,
}

/// Returns the signs by id; of two with one id the first is kept.
pub(super) fn signs<'d>(file: &File<'d>, imported: &mut Imported) -> BTreeMap<&'d str, Sign> {
    let mut signs = BTreeMap::new();
    for element in file.root.named("trafficSign") {
        let what = named(&element);
        let Some(id) = imported.read(&what, free_id(&element, &signs), OTHERS_KEPT) else { continue };
        let mut sign = Sign::default();
        for part in element.named("trafficSignElement") {
            let Some(number) = imported.read(&what, part.needed_child("trafficSignID"), OTHERS_KEPT) else { continue };
            let number = number.text();
            if let Some(value) = part.named("additionalValue").next().filter(|_| SPEED_SIGNS.contains(&number)) {
                let limit = imported.read(&format!("speed of {what}"), speed(&value), "the sign is kept without it");
                sign.speed_limit_mps = limit.or(sign.speed_limit_mps);
            }
            sign.is_stop |= STOP_SIGNS.contains(&number);
        }
        let place = imported.read(&format!("position of {what}"), position(&element), "the sign is kept without it");
        sign.position = place.flatten();
        signs.insert(id, sign);
    }
    signs
}

/// Returns the id of an element, if no element of its kind has it yet.
fn free_id<'d, T>(element: &Element<'d>, taken: &BTreeMap<&str, T>) -> Result<&'d str, ImportError> {
    let id = element.needed_attribute("id")?;
    if taken.contains_key(id) { Err(element.refuse("an id that is not already taken")) } else { Ok(id) }
}

fn position(element: &Element<'_>) -> Result<Option<Vec2>, ImportError> {
    element.child("position").and_then(|p| p.child("point")).map(|p| point(&p)).transpose()
}

/// Returns the lights' cycles by id; of two with one id the first is kept.
pub(super) fn cycles<'d>(file: &File<'d>, imported: &mut Imported) -> BTreeMap<&'d str, Cycle> {
    let mut cycles = BTreeMap::new();
    for element in file.root.named("trafficLight") {
        let read = free_id(&element, &cycles).and_then(|id| Ok((id, cycle(&element)?)));
        cycles.extend(imported.read(&named(&element), read, OTHERS_KEPT));
    }
    cycles
}

fn cycle(element: &Element<'_>) -> Result<Cycle, ImportError> {
    let active = element.child("active").is_none_or(|active| active.text() != "false");
    let mut cycle = Cycle { active, offset_steps: 0.0, phases: vec![] };
    if let Some(given) = element.child("cycle") {
        cycle.offset_steps = given.child("timeOffset").map(|e| super::step(&e)).transpose()?.unwrap_or(0.0);
        for phase in given.named("cycleElement") {
            if cycle.phases.len() >= PHASES_MAX {
                return Err(phase.refuse(format!("at most {PHASES_MAX} phases in a cycle")));
            }
            let duration = super::step(&phase.needed_child("duration")?)?;
            cycle.phases.push((duration, colour(&phase.needed_child("color")?)?));
        }
    }
    Ok(cycle)
}

fn colour(element: &Element<'_>) -> Result<LightState, ImportError> {
    Ok(match element.text() {
        "red" | "redYellow" => LightState::Stop,
        "yellow" => LightState::Caution,
        "green" => LightState::Go,
        "inactive" => LightState::Unknown,
        other => return Err(element.refuse(format!("a light's colour, found {:?}", shown(other)))),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cycle_repeats_from_its_offset_both_ways() {
        use LightState::{Caution, Go, Stop};
        let cycle = Cycle { active: true, offset_steps: 5.0, phases: vec![(10.0, Stop), (4.0, Go), (2.0, Caution)] };
        let states: Vec<LightState> = [4.0, 5.0, 14.0, 15.0, 18.0, 19.0, 21.0].map(|s| cycle.state_at(s)).into();
        assert_eq!(states, [Caution, Stop, Stop, Go, Go, Caution, Stop]);
        assert_eq!(Cycle { active: false, ..cycle }.state_at(6.0), LightState::Unknown);
    }
}
