//! Constants of templates: `<low..high>` and what is drawn in its place.

use super::reader::PromptView;
use crate::kernel::{Stream, num};

/// The template without its drawn constants: what is left holds all names.
pub fn without_constants(template: &str) -> String {
    let mut rest = template;
    let mut text = String::new();
    while let Some(place) = next_constant(rest) {
        text.push_str(&rest[..place.start]);
        rest = &rest[place.end..];
    }
    text + rest
}

/// Draws the constants of a template: `<low..high>`, `<low..high unit>`, `<low..high #>` for whole numbers. A constant with a unit is
/// sometimes a parameter of the family instead, if one has this unit, a value of this size and a name akin to what it is about.
pub fn fill(page: &PromptView, about: &str, template: &str, stream: &mut Stream) -> String {
    let about = format!("{about} {template}");
    let mut rest = template;
    let mut text = String::new();
    while let Some(place) = next_constant(rest) {
        text.push_str(&rest[..place.start]);
        text.push_str(&constant(page, &place, &about, stream));
        rest = &rest[place.end..];
    }
    text + rest
}

struct Constant<'a> {
    start: usize,
    end: usize,
    low: f64,
    high: f64,
    unit: &'a str,
}

fn next_constant(text: &str) -> Option<Constant<'_>> {
    let mut from = 0;
    while let Some(found) = text[from..].find('<') {
        let start = from + found;
        let body = text[start + 1..].find('>').map(|length| (&text[start + 1..start + 1 + length], start + 2 + length));
        if let Some((body, end)) = body
            && let Some(constant) = parsed(body, start, end)
        {
            return Some(constant);
        }
        from = start + 1;
    }
    None
}

fn parsed(body: &str, start: usize, end: usize) -> Option<Constant<'_>> {
    let (range, unit) = body.split_once(' ').unwrap_or((body, ""));
    let (low, high) = range.split_once("..")?;
    Some(Constant { start, end, low: low.parse().ok()?, high: high.parse().ok()?, unit })
}

fn constant(page: &PromptView, place: &Constant<'_>, about: &str, stream: &mut Stream) -> String {
    let (low, high) = (place.low, place.high);
    if place.unit == "#" {
        return num::rounded(stream.uniform(low - 0.49, high + 0.49), 0).to_string();
    }
    if !place.unit.is_empty() && stream.chance(0.4) {
        let of_size = |name: &str| page.parameter(name).is_some_and(|x| (0.5 * low..=2.0 * high).contains(&x));
        let fitting = page
            .contract
            .parameters
            .iter()
            .filter(|(name, d)| d.unit == place.unit && d.kind == "number" && of_size(name));
        let near = fitting.map(|(name, _)| (kinship(name, about), name)).filter(|(kin, _)| *kin > 0);
        if let Some((_, name)) = near.max_by_key(|(kin, _)| *kin) {
            return name.clone();
        }
    }
    num::rounded(stream.uniform(low, high), if high > 20.0 { 1 } else { 2 }).to_string()
}

/// Returns how many words of three letters and more a name shares with a text.
pub fn kinship(name: &str, text: &str) -> usize {
    const EVERYWHERE: [&str; 6] = ["mps", "mps2", "mps3", "radps", "min", "max"];
    name.split('_').filter(|word| word.len() >= 3 && !EVERYWHERE.contains(word) && text.contains(word)).count()
}
