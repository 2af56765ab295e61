//! A formula as postfix code: the compiled form of expressions, which the simulator evaluates. Evaluation allocates
//! nothing and cannot fail. Truth values are 1 and 0.

use serde::{Deserialize, Serialize};

use super::total;

/// Most values that wait on the stack at once.
pub const STACK_MAX: usize = 64;
/// Room for the values of nearly every formula: it is cleared at every evaluation, so a smaller one costs less.
const STACK_USUAL: usize = 8;

/// One step of the code. It takes its operands off the stack and leaves its result there.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Op {
    /// A number.
    Constant(f64),
    /// The value at this place among those that are given; NaN is read as 0, and too large values as the bound.
    Load(usize),
    /// The negative of a value.
    Minus,
    /// True if a value is 0.
    Not,
    /// True if one of two values is not 0.
    Or,
    /// True if neither of two values is 0.
    And,
    /// True if the first is less than the second.
    Less,
    /// True if the first is at most the second.
    AtMost,
    /// True if the first is more than the second.
    More,
    /// True if the first is at least the second.
    AtLeast,
    /// True if two values are equal.
    Equal,
    /// True if two values differ.
    Unequal,
    /// The sum of two values.
    Plus,
    /// The first less the second.
    Difference,
    /// The product of two values.
    Times,
    /// The first over the second; see [`total::divide`].
    Over,
    /// The smaller of two values.
    Min,
    /// The larger of two values.
    Max,
    /// The size of a value.
    Abs,
    /// The square root; see [`total::sqrt`].
    Sqrt,
    /// The exponential; see [`total::exp`].
    Exp,
    /// The natural logarithm; see [`total::log`].
    Log,
    /// A value, its lower and its upper bound.
    Clamp,
    /// A condition, the value where it holds, the value where it does not.
    If,
}

impl Op {
    /// Returns the number of values that it takes off the stack.
    fn takes(self) -> usize {
        match self {
            Op::Constant(_) | Op::Load(_) => 0,
            Op::Minus | Op::Not | Op::Abs | Op::Sqrt | Op::Exp | Op::Log => 1,
            Op::Clamp | Op::If => 3,
            _ => 2,
        }
    }
}

/// Code that leaves one value, whatever it is given.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Vec<Op>", into = "Vec<Op>")]
pub struct Formula {
    code: Vec<Op>,
    /// Largest number of values that wait at once.
    height: usize,
}

/// Code that is no formula.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("step {step} of a formula: expected {expected}, found {found}")]
pub struct FormulaError {
    step: usize,
    expected: String,
    found: String,
}

impl TryFrom<Vec<Op>> for Formula {
    type Error = FormulaError;

    fn try_from(code: Vec<Op>) -> Result<Formula, FormulaError> {
        let wrong = |step, expected: String, found: String| Err(FormulaError { step, expected, found });
        let (mut height, mut most) = (0usize, 0);
        for (step, op) in code.iter().enumerate() {
            if matches!(op, Op::Constant(value) if total::bounded(*value) != *value) {
                return wrong(step, format!("a number of at most {:e}", total::MAGNITUDE_MAX), format!("{op:?}"));
            }
            let Some(left) = height.checked_sub(op.takes()).filter(|left| *left < STACK_MAX) else {
                let expected = format!("{} values waiting, and room for one in {STACK_MAX}", op.takes());
                return wrong(step, expected, format!("{height} waiting for {op:?}"));
            };
            height = left + 1;
            most = height.max(most);
        }
        match height {
            1 => Ok(Formula { code, height: most }),
            _ => wrong(code.len(), "one value left at the end".into(), format!("{height}")),
        }
    }
}

impl From<Formula> for Vec<Op> {
    fn from(formula: Formula) -> Vec<Op> {
        formula.code
    }
}

impl Formula {
    /// The places of the values that it reads, in the order of the code.
    pub fn loads(&self) -> impl Iterator<Item = usize> + '_ {
        self.code.iter().filter_map(|op| if let Op::Load(place) = op { Some(*place) } else { None })
    }

    /// Returns the formula with the values from place `first` on fixed to these; places beyond them are 0.
    pub fn with_fixed(&self, first: usize, values: &[f64]) -> Formula {
        let fixed = |op: &Op| match *op {
            Op::Load(place) if place >= first => {
                Op::Constant(total::bounded(values.get(place - first).copied().unwrap_or(0.0)))
            }
            op => op,
        };
        Formula { code: self.code.iter().map(fixed).collect(), height: self.height }
    }

    /// Its value: finite, at most 1e12 in size, never -0. A place beyond the given values reads 0.
    pub fn value(&self, given: &[f64]) -> f64 {
        if self.height <= STACK_USUAL { self.run::<STACK_USUAL>(given) } else { self.run::<STACK_MAX>(given) }
    }

    fn run<const ROOM: usize>(&self, given: &[f64]) -> f64 {
        let mut stack = Stack { values: [0.0; ROOM], height: 0 };
        for op in &self.code {
            stack.run(*op, given);
        }
        stack.pop()
    }
}

struct Stack<const ROOM: usize> {
    values: [f64; ROOM],
    height: usize,
}

impl<const ROOM: usize> Stack<ROOM> {
    fn push(&mut self, value: f64) {
        self.values[self.height] = value;
        self.height += 1;
    }

    fn pop(&mut self) -> f64 {
        self.height -= 1;
        self.values[self.height]
    }

    fn run(&mut self, op: Op, given: &[f64]) {
        let result = match op {
            Op::Constant(value) => value,
            Op::Load(place) => total::bounded(given.get(place).copied().unwrap_or(0.0)),
            Op::Minus => total::bounded(-self.pop()),
            Op::Not => truth(self.pop() == 0.0),
            Op::Abs => self.pop().abs(),
            Op::Sqrt => total::sqrt(self.pop()),
            Op::Exp => total::exp(self.pop()),
            Op::Log => total::log(self.pop()),
            Op::Clamp => {
                let (high, low) = (self.pop(), self.pop());
                total::clamp(self.pop(), low, high)
            }
            Op::If => {
                let (otherwise, held) = (self.pop(), self.pop());
                if self.pop() != 0.0 { held } else { otherwise }
            }
            of_two => {
                let right = self.pop();
                of_pair(of_two, self.pop(), right)
            }
        };
        self.push(result);
    }
}

fn truth(holds: bool) -> f64 {
    f64::from(u8::from(holds))
}

fn of_pair(op: Op, a: f64, b: f64) -> f64 {
    match op {
        Op::Or => truth(a != 0.0 || b != 0.0),
        Op::And => truth(a != 0.0 && b != 0.0),
        Op::Less => truth(a < b),
        Op::AtMost => truth(a <= b),
        Op::More => truth(a > b),
        Op::AtLeast => truth(a >= b),
        Op::Equal => truth(a == b),
        Op::Unequal => truth(a != b),
        Op::Plus => total::bounded(a + b),
        Op::Difference => total::bounded(a - b),
        Op::Times => total::bounded(a * b),
        Op::Over => total::divide(a, b),
        Op::Min => a.min(b),
        // The last of the operations that take two values.
        _ => a.max(b),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn code_that_does_not_leave_one_value_is_refused() {
        let made = |code: Vec<Op>| Formula::try_from(code).map_err(|error| error.to_string());
        assert!(made(vec![]).unwrap_err().contains("one value left at the end, found 0"));
        assert!(made(vec![Op::Plus]).unwrap_err().contains("step 0"));
        assert!(made(vec![Op::Constant(1.0), Op::Constant(2.0)]).unwrap_err().contains("found 2"));
        assert!(made(vec![Op::Constant(f64::NAN)]).is_err());
        let mut deep = vec![Op::Constant(1.0); STACK_MAX];
        deep.extend(vec![Op::Plus; STACK_MAX - 1]);
        assert_eq!(made(deep.clone()).unwrap().value(&[]), STACK_MAX as f64);
        deep.insert(0, Op::Constant(1.0));
        assert!(made(deep).unwrap_err().contains("64"));
    }

    #[test]
    fn a_formula_of_any_height_has_room() {
        for height in 1..=STACK_MAX {
            let mut code: Vec<Op> = (1..=height).map(|value| Op::Constant(value as f64)).collect();
            code.extend(vec![Op::Plus; height - 1]);
            let formula = Formula::try_from(code).unwrap();
            assert_eq!(formula.value(&[]), (height * (height + 1) / 2) as f64, "{height} values wait at once");
        }
    }

    #[test]
    fn a_formula_reads_its_places_and_fixed_ones_no_more() {
        let formula = Formula::try_from(vec![Op::Load(0), Op::Load(1), Op::Difference]).unwrap();
        assert_eq!(formula.value(&[7.0, 2.0]), 5.0);
        assert_eq!(formula.value(&[7.0]), 7.0);
        assert_eq!(formula.value(&[f64::NAN, 1.0]), -1.0);
        assert_eq!(formula.value(&[f64::INFINITY, 0.0]), total::MAGNITUDE_MAX);
        let fixed = formula.with_fixed(1, &[4.0]);
        assert_eq!((fixed.value(&[7.0, 2.0]), fixed.loads().collect::<Vec<_>>()), (3.0, vec![0]));
        let text = serde_json::to_string(&fixed).unwrap();
        assert_eq!(text, r#"[{"load":0},{"constant":4.0},"difference"]"#);
        assert_eq!(serde_json::from_str::<Formula>(&text).unwrap(), fixed);
        assert!(serde_json::from_str::<Formula>(r#"["plus"]"#).is_err());
    }
}
