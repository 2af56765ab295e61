//! How different a program's text is from those of a reference set: OpenEvolve's feature dimension `diversity`.

use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};

/// The reference texts, and what was computed so far. A text keeps its value for ever, also when the set grows afterwards.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Diversity {
    reference: Vec<String>,
    known: BTreeMap<String, f64>,
}

impl Diversity {
    /// Mean distance of a text from the reference texts other than itself, 0 where there are none. Until it holds `size` texts
    /// the reference is taken anew from `texts`, the whole population in order of insertion; `draw` gives a number in [0, 1)
    /// where more than `size` of them must be thinned out.
    pub fn of(&mut self, code: &str, texts: &[&str], size: usize, draw: &mut dyn FnMut() -> f64) -> f64 {
        if let Some(known) = self.known.get(code) {
            return *known;
        }
        if self.reference.len() < size {
            let chosen = if texts.len() <= size { texts.to_vec() } else { far_apart(texts, size, draw()) };
            self.reference = chosen.into_iter().map(String::from).collect();
        }
        let others = self.reference.iter().filter(|other| *other != code);
        let distances: Vec<f64> = others.map(|other| distance(code, other)).collect();
        let value = match distances.len() {
            0 => 0.0,
            count => distances.iter().sum::<f64>() / count as f64,
        };
        self.known.insert(code.to_string(), value);
        value
    }
}

/// OpenEvolve's fast distance of two texts: a tenth of the difference in length, ten for each line, a half for each
/// character that only one of them has.
fn distance(a: &str, b: &str) -> f64 {
    let apart = |x: usize, y: usize| x.abs_diff(y) as f64;
    let lines = |text: &str| text.matches('\n').count();
    let letters = |text: &str| text.chars().collect::<BTreeSet<char>>();
    let own = letters(a).symmetric_difference(&letters(b)).count();
    apart(a.chars().count(), b.chars().count()) * 0.1 + apart(lines(a), lines(b)) * 10.0 + own as f64 * 0.5
}

/// One text by chance, then always the one whose nearest chosen text is farthest away.
fn far_apart<'t>(texts: &[&'t str], size: usize, draw: f64) -> Vec<&'t str> {
    let mut left = texts.to_vec();
    let mut chosen = vec![left.remove(((draw * left.len() as f64) as usize).min(left.len() - 1))];
    while chosen.len() < size && !left.is_empty() {
        let nearest = |text: &str| chosen.iter().map(|other| distance(text, other)).fold(f64::INFINITY, f64::min);
        let apart: Vec<f64> = left.iter().map(|text| nearest(text)).collect();
        let farthest = (1..left.len()).fold(0, |best, next| if apart[next] > apart[best] { next } else { best });
        chosen.push(left.remove(farthest));
    }
    chosen
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_text_is_as_far_from_another_as_length_lines_and_letters_say() {
        // 3 characters longer, one line more, b c d and the line's end are not shared.
        assert!((distance("a", "a\nbcd"[..4].trim_end()) - (0.3 + 10.0 + 0.5 * 3.0)).abs() < 1e-12);
        assert_eq!(distance("same", "same"), 0.0);
    }

    #[test]
    fn a_large_population_is_thinned_to_texts_that_lie_apart() {
        let texts = ["a", "aa", "aaa", "z\n\n\n"];
        assert_eq!(far_apart(&texts, 2, 0.0), ["a", "z\n\n\n"]);
        assert_eq!(far_apart(&texts, 2, 0.999), ["z\n\n\n", "a"]);
        let mut diversity = Diversity::default();
        let mut asked = 0;
        diversity.of("a", &texts, 2, &mut || {
            asked += 1;
            0.0
        });
        assert_eq!((diversity.reference.len(), asked), (2, 1));
        // A full reference is never taken anew, and a text keeps its value.
        let (before, frozen) = (diversity.of("a", &[], 2, &mut || 0.0), diversity.reference.clone());
        diversity.of("another text", &["x", "y"], 2, &mut || 0.0);
        assert_eq!((diversity.of("a", &[], 2, &mut || 0.0), diversity.reference), (before, frozen));
    }
}
