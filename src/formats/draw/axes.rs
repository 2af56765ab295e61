//! Axes of a figure: from numbers to places on the sheet, with grid, ticks and names.

use super::figure::{Anchor, BLACK, Figure, GREY, Ink, LIGHT, Words};
use super::helvetica;

/// A range of numbers along a side of the plot.
#[derive(Clone, Debug, PartialEq)]
pub struct Scale {
    low: f64,
    high: f64,
    /// Numbers at which ticks stand.
    pub ticks: Vec<f64>,
}

impl Scale {
    /// Makes a scale from the smallest to the largest number, widened to full ticks, about `count` of them.
    pub fn over(values: impl IntoIterator<Item = f64>, count: usize) -> Scale {
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for value in values.into_iter().filter(|value| value.is_finite()) {
            (low, high) = (low.min(value), high.max(value));
        }
        if low > high {
            (low, high) = (0.0, 1.0);
        }
        if high - low < 1e-12 {
            let room = if low == 0.0 { 1.0 } else { 0.1 * low.abs() };
            (low, high) = (low - room, high + room);
        }
        let step = round_step((high - low) / count.max(1) as f64);
        let (first, last) = ((low / step).floor(), (high / step).ceil());
        let ticks: Vec<f64> = (0..=(last - first) as usize).map(|k| (first + k as f64) * step).collect();
        Scale { low: first * step, high: last * step, ticks }
    }

    /// Makes a scale from one number to another, with ticks at these places.
    pub fn fixed(low: f64, high: f64, ticks: Vec<f64>) -> Scale {
        Scale { low, high, ticks }
    }

    /// Returns the same ticks with more room at both ends, as a share of the whole.
    pub fn widened(mut self, share: f64) -> Scale {
        let room = share * (self.high - self.low);
        self.low -= room;
        self.high += room;
        self
    }

    /// Returns 0 at the low end, 1 at the high end.
    fn share(&self, value: f64) -> f64 {
        (value - self.low) / (self.high - self.low)
    }
}

/// Returns the nearest of 1, 2 and 5 times a power of ten that is not below.
fn round_step(least: f64) -> f64 {
    let mut power = 1e-9;
    loop {
        for factor in [1.0, 2.0, 5.0] {
            if factor * power >= least * (1.0 - 1e-9) {
                return factor * power;
            }
        }
        power *= 10.0;
    }
}

/// Returns a tick's number with as many decimals as its scale needs.
pub fn tick_text(value: f64, ticks: &[f64]) -> String {
    let whole = |digits: u32| {
        let factor = f64::from(10u32.pow(digits));
        ticks.iter().all(|tick| ((tick * factor).round() - tick * factor).abs() < 1e-6)
    };
    let digits = (0..6).find(|digits| whole(*digits)).unwrap_or(6) as usize;
    let text = format!("{value:.digits$}");
    if text.trim_start_matches('-').chars().all(|c| c == '0' || c == '.') {
        text.trim_start_matches('-').to_string()
    } else {
        text
    }
}

/// Size of letters at axes, points.
const LETTERS: f64 = 7.5;

/// A plot on the sheet.
#[derive(Clone, Debug, PartialEq)]
pub struct Axes {
    /// Left, top, width, height of the plot itself, points.
    pub place: [f64; 4],
    /// Scale along the bottom.
    pub across: Scale,
    /// Scale along the left side.
    pub up: Scale,
}

impl Axes {
    /// Returns the place of a number along the bottom.
    pub fn x(&self, value: f64) -> f64 {
        self.place[0] + self.place[2] * self.across.share(value)
    }

    /// Returns the place of a number along the left side.
    pub fn y(&self, value: f64) -> f64 {
        self.place[1] + self.place[3] * (1.0 - self.up.share(value))
    }

    /// Returns the place of a pair of numbers.
    pub fn at(&self, x: f64, y: f64) -> (f64, f64) {
        (self.x(x), self.y(y))
    }

    /// Draws ticks and names of both sides in letters of a size, without a grid: for small panels over shaded fields.
    pub fn draw_small(&self, figure: &mut Figure, letters: f64, across: &str, up: &str) {
        let [left, top, wide, high] = self.place;
        let line = Ink::line(GREY, 0.6);
        for tick in &self.up.ticks {
            let y = self.y(*tick);
            figure.line((left - 2.0, y), (left, y), line);
            figure.text((left - 4.0, y + 0.35 * letters), letters, Anchor::End, tick_text(*tick, &self.up.ticks));
        }
        for tick in &self.across.ticks {
            let x = self.x(*tick);
            figure.line((x, top + high), (x, top + high + 2.0), line);
            let at = (x, top + high + 2.5 + letters);
            figure.text(at, letters, Anchor::Middle, tick_text(*tick, &self.across.ticks));
        }
        figure.path(vec![(left, top), (left, top + high), (left + wide, top + high)], line);
        let at = (left + 0.5 * wide, top + high + 4.0 + 2.0 * letters);
        figure.text(at, letters, Anchor::Middle, across);
        let widest = self.up.ticks.iter().map(|tick| helvetica::width(&tick_text(*tick, &self.up.ticks), letters));
        figure.words(Words {
            at: (left - 7.0 - widest.fold(0.0, f64::max), top + 0.5 * high),
            size: letters,
            anchor: Anchor::Middle,
            bold: false,
            colour: BLACK,
            upwards: true,
            text: up.to_string(),
        });
    }

    /// Draws grid, ticks and names of both sides.
    pub fn draw(&self, figure: &mut Figure, across: &str, up: &str) {
        let [left, top, wide, high] = self.place;
        for tick in &self.up.ticks {
            let y = self.y(*tick);
            figure.line((left, y), (left + wide, y), Ink::line(LIGHT, 0.5));
            figure.text((left - 4.0, y + 2.6), LETTERS, Anchor::End, tick_text(*tick, &self.up.ticks));
        }
        for tick in &self.across.ticks {
            let x = self.x(*tick);
            figure.line((x, top + high), (x, top + high + 2.5), Ink::line(GREY, 0.6));
            figure.text((x, top + high + 11.0), LETTERS, Anchor::Middle, tick_text(*tick, &self.across.ticks));
        }
        figure.line((left, top + high), (left + wide, top + high), Ink::line(GREY, 0.8));
        let below = top + high + 22.0;
        figure.text((left + 0.5 * wide, below), LETTERS + 0.5, Anchor::Middle, across);
        let widest = self.up.ticks.iter().map(|t| helvetica::width(&tick_text(*t, &self.up.ticks), LETTERS));
        let beside = left - 10.0 - widest.fold(0.0, f64::max);
        figure.words(Words {
            at: (beside, top + 0.5 * high),
            size: LETTERS + 0.5,
            anchor: Anchor::Middle,
            bold: false,
            colour: BLACK,
            upwards: true,
            text: up.to_string(),
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_hold_every_number() {
        let scale = Scale::over([0.013, 0.087], 4);
        assert_eq!(
            scale.ticks.iter().map(|t| tick_text(*t, &scale.ticks)).collect::<Vec<_>>(),
            ["0.00", "0.02", "0.04", "0.06", "0.08", "0.10"]
        );
        for values in [vec![], vec![3.0], vec![0.0, 0.0], vec![-5.0, 7.0, f64::NAN]] {
            let scale = Scale::over(values.clone(), 5);
            assert!(scale.low < scale.high, "{values:?}");
            let inside = values.iter().filter(|v| v.is_finite()).all(|v| (0.0..=1.0).contains(&scale.share(*v)));
            assert!(inside, "{values:?} {scale:?}");
        }
    }

    #[test]
    fn upwards_is_up() {
        let axes = Axes {
            place: [10.0, 20.0, 100.0, 50.0],
            across: Scale::over([0.0, 1.0], 2),
            up: Scale::over([0.0, 1.0], 2),
        };
        assert_eq!(axes.at(0.0, 0.0), (10.0, 70.0));
        assert_eq!(axes.at(1.0, 1.0), (110.0, 20.0));
    }
}
