//! Places for the words of a picture: inside it, beside the thing that they name, and never upon each other or upon the contact.

/// Words that need a place.
#[derive(Clone, Debug, PartialEq)]
pub struct Wanted {
    /// Place of the thing that they name, pixels.
    pub at: (f64, f64),
    /// Extent of the thing around that place, pixels.
    pub reach_px: f64,
    pub text: String,
    /// True for the main road users and the contact: these words are always shown, at the cost of others.
    pub needed: bool,
}

/// Words at a place of a picture, pixels: the left end of their base line.
#[derive(Clone, Debug, PartialEq)]
pub struct Label {
    pub x: f64,
    pub y: f64,
    pub text: String,
}

/// Size of the letters: the mean advance of one, and of a line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Letters {
    pub advance_px: f64,
    pub line_px: f64,
}

/// Left, top, right, bottom.
type Area = [f64; 4];

fn overlap(a: &Area, b: &Area) -> f64 {
    let side = |low: usize| (a[low + 2].min(b[low + 2]) - a[low].max(b[low])).max(0.0);
    side(0) * side(1)
}

/// Number of rings of places around the named thing, the nearest first.
const RINGS: usize = 5;

/// Places the words in their order. Words that are not needed are left out where no place is free; needed ones then go where they cover
/// least. `kept_free` are areas that words avoid.
pub fn placed(wanted: &[Wanted], size: (f64, f64), letters: Letters, kept_free: &[Area]) -> Vec<Label> {
    let mut taken: Vec<Area> = kept_free.to_vec();
    taken.extend(wanted.iter().filter(|of| of.needed).map(|of| square(of.at.0, of.at.1, of.reach_px)));
    let mut labels = Vec::new();
    for of in wanted {
        let (wide, high) = (letters.advance_px * of.text.chars().count() as f64, letters.line_px);
        let covered = |area: &Area| taken.iter().map(|other| overlap(area, other)).sum::<f64>();
        let areas = areas(of, wide, high, size);
        let free = areas.iter().find(|area| covered(area) == 0.0).copied();
        let least = || areas.iter().copied().min_by(|a, b| covered(a).total_cmp(&covered(b))).filter(|_| of.needed);
        if let Some(area) = free.or_else(least) {
            taken.push(area);
            labels.push(Label { x: area[0], y: area[3] - 0.22 * high, text: of.text.clone() });
        }
    }
    labels
}

fn square(x: f64, y: f64, reach: f64) -> Area {
    [x - reach, y - reach, x + reach, y + reach]
}

/// Returns places around it, pushed into the picture. None covers the named thing unless the picture is too small for any other.
fn areas(of: &Wanted, wide: f64, high: f64, size: (f64, f64)) -> Vec<Area> {
    let (x, y) = of.at;
    let mut areas = Vec::new();
    for ring in 0..RINGS {
        let away = of.reach_px + 3.0 + ring as f64 * high;
        for (left, top) in [
            (x + away, y - away - high),
            (x + away, y + away),
            (x - away - wide, y - away - high),
            (x - away - wide, y + away),
            (x - 0.5 * wide, y - away - high),
            (x - 0.5 * wide, y + away),
            (x + away, y - 0.5 * high),
            (x - away - wide, y - 0.5 * high),
        ] {
            let left = left.clamp(2.0, (size.0 - wide - 2.0).max(2.0));
            let top = top.clamp(2.0, (size.1 - high - 2.0).max(2.0));
            areas.push([left, top, left + wide, top + high]);
        }
    }
    areas
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Areas that touch, up to the rounding of their sides.
    const TOUCHING: f64 = 1e-6;
    const LETTERS: Letters = Letters { advance_px: 7.4, line_px: 15.0 };

    fn area(label: &Label) -> Area {
        let top = label.y - 0.78 * LETTERS.line_px;
        [label.x, top, label.x + LETTERS.advance_px * label.text.chars().count() as f64, top + LETTERS.line_px]
    }

    proptest! {
        #[test]
        fn words_of_a_contact_stay_inside_and_off_each_other_wherever_it_happens(x in 0.0..320.0f64, y in 0.0..240.0f64, apart in 0.0..6.0f64) {
            let one = |at: (f64, f64), text: &str| Wanted { at, reach_px: 8.0, text: text.into(), needed: true };
            let wanted = [one((x, y), "ego 10.6 m/s"), one((x + apart, y), "inserted cyclist 9.8 m/s"), one((x, y), "contact, 20.5 m/s")];
            let labels = placed(&wanted, (320.0, 240.0), LETTERS, &[square(x, y, 22.0)]);
            prop_assert_eq!(labels.len(), 3);
            let areas: Vec<Area> = labels.iter().map(area).collect();
            for (k, one) in areas.iter().enumerate() {
                prop_assert!(one[0] >= 0.0 && one[1] >= 0.0 && one[2] <= 320.0 && one[3] <= 240.0, "{:?} leaves the picture", labels[k]);
                prop_assert!(overlap(one, &square(x, y, 22.0)) < TOUCHING, "{:?} covers the contact", labels[k]);
                for other in &areas[k + 1..] {
                    prop_assert!(overlap(one, other) < TOUCHING, "{labels:?}");
                }
            }
        }
    }

    #[test]
    fn words_that_are_not_needed_give_way() {
        let one = |needed| Wanted { at: (30.0, 15.0), reach_px: 4.0, text: "v12".into(), needed };
        let many: Vec<Wanted> = (0..12).map(|k| one(k == 0)).collect();
        let labels = placed(&many, (60.0, 30.0), LETTERS, &[]);
        assert!(!labels.is_empty() && labels.len() < 12, "{labels:?}");
    }
}
