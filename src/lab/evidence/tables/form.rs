//! Forms in which tables write numbers.

use crate::kernel::num;
use crate::statistics::bootstrap::Estimate;

/// Form of a column's numbers, as the paper writes them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// `0.345`, a share
    Rate,
    /// `3.450`, a number of any size
    Number,
    /// `10.66%`
    Percent,
    /// `+0.035`
    RateChange,
    /// `-6.81pp`
    Points,
    /// `+7.4%`
    Gain,
}

impl Form {
    /// Decimals.
    pub fn digits(self) -> u32 {
        match self {
            Form::Rate | Form::Number | Form::RateChange => 3,
            Form::Percent | Form::Points => 2,
            Form::Gain => 1,
        }
    }

    /// A number of this form, whose interval ends where no such number lies.
    pub fn bounded(self, own: Estimate) -> Estimate {
        match self {
            Form::Rate => own.within([0.0, 1.0]),
            Form::Percent => own.within([0.0, 100.0]),
            Form::Number | Form::RateChange | Form::Points | Form::Gain => own,
        }
    }

    /// The number as text; a zero has no sign.
    pub fn number(self, value: f64) -> String {
        let (signed, unit) = match self {
            Form::Rate | Form::Number => (false, ""),
            Form::Percent => (false, "%"),
            Form::RateChange => (true, ""),
            Form::Points => (true, "pp"),
            Form::Gain => (true, "%"),
        };
        let write = if signed { num::signed } else { num::fixed };
        write(value, self.digits()) + unit
    }

    /// `[0.150, 0.550]`, without units: they stand at the value.
    pub fn interval(self, [low, high]: [f64; 2]) -> String {
        let bare = |value| self.number(value).trim_end_matches(['%', 'p']).to_string();
        format!("[{}, {}]", bare(low), bare(high))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_written_as_the_paper_writes_them() {
        assert_eq!(Form::Rate.number(0.345), "0.345");
        assert_eq!(Form::Percent.number(10.66), "10.66%");
        assert_eq!(Form::Points.number(-6.81), "-6.81pp");
        assert_eq!(Form::Gain.number(7.4), "+7.4%");
        assert_eq!(Form::RateChange.interval([-0.05, 0.1]), "[-0.050, +0.100]");
        assert_eq!(Form::Points.interval([-0.5, 0.25]), "[-0.50, +0.25]");
    }

    #[test]
    fn a_zero_has_no_sign_however_it_came_about() {
        for zero in [0.0, -0.0, 1e-9, -1e-9] {
            assert_eq!(Form::RateChange.number(zero), "0.000");
            assert_eq!(Form::Gain.number(zero), "0.0%");
        }
    }
}
