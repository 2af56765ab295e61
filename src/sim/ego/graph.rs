//! A network of any form as steps over one row of numbers: the observation stands first, and each step appends its results. What only
//! moves numbers (slices, joins, other shapes) is no step: whoever reads them knows where they lie.

use super::network::{Dense, elu, erf, gelu, sigmoid, tanh};
use super::observation::ACTION;
use crate::kernel::num;

/// Where a number comes from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Cell {
    /// The file.
    Fixed(f32),
    /// This place of the row.
    At(u32),
}

impl Cell {
    fn of(self, row: &[f32]) -> f32 {
        match self {
            Cell::Fixed(x) => x,
            Cell::At(place) => row[place as usize],
        }
    }
}

/// A function of one number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Function {
    Relu,
    /// The slope below 0.
    LeakyRelu(f32),
    Tanh,
    Sigmoid,
    /// What is approached below 0, negated.
    Elu(f32),
    Gelu,
    Erf,
    Exp,
    Softplus,
    /// The least and the most.
    Clip(f32, f32),
    Abs,
    Neg,
    Sign,
    Sqrt,
    Log,
    Mish,
    /// What is approached below 0, negated.
    Celu(f32),
    /// What is approached below 0, negated, and the slope above it, which both are multiplied by.
    Selu(f32, f32),
    /// Slope and height at 0 of a line that is cut to [0, 1].
    HardSigmoid(f32, f32),
    /// 1 of all but 0.
    Truth,
    /// 1 of 0, and 0 of all else.
    Not,
}

impl Function {
    fn of(self, x: f32) -> f32 {
        match self {
            Function::Relu | Function::LeakyRelu(_) if x > 0.0 => x,
            Function::Relu => 0.0,
            Function::LeakyRelu(slope) => slope * x,
            Function::Tanh => tanh(x),
            Function::Sigmoid => sigmoid(x),
            Function::Elu(_) if x > 0.0 => x,
            Function::Elu(depth) => depth * elu(x),
            Function::Gelu => gelu(x),
            Function::Erf => erf(x),
            Function::Exp => num::exp(f64::from(x)) as f32,
            Function::Softplus => {
                let x = f64::from(x);
                (x.max(0.0) + num::ln(1.0 + num::exp(-x.abs()))) as f32
            }
            Function::Clip(least, _) if x < least => least,
            Function::Clip(_, most) if x > most => most,
            Function::Clip(..) => x,
            Function::Abs => x.abs(),
            Function::Neg => -x,
            Function::Sign => f32::from(x > 0.0) - f32::from(x < 0.0),
            Function::Sqrt => x.sqrt(),
            Function::Log => num::ln(f64::from(x)) as f32,
            Function::Mish => x * tanh(Function::Softplus.of(x)),
            Function::Celu(_) if x > 0.0 => x,
            Function::Celu(depth) => depth * elu(x / depth),
            Function::Selu(_, slope) if x > 0.0 => slope * x,
            Function::Selu(depth, slope) => slope * (depth * elu(x)),
            Function::HardSigmoid(slope, height) => Function::Clip(0.0, 1.0).of(slope * x + height),
            Function::Truth => f32::from(x != 0.0),
            Function::Not => f32::from(x == 0.0),
        }
    }
}

/// What makes one number of two.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Operator {
    Add,
    Sub,
    Mul,
    Div,
    /// The larger one; what is no number where either is none. Of +0 and -0 the first.
    Max,
    Min,
    /// The first, times the second where it lies below 0.
    PRelu,
    /// 1 where it is so, 0 where not, as is everything of what is no number.
    Greater,
    GreaterOrEqual,
    Less,
    LessOrEqual,
    Equal,
    And,
    Or,
    Xor,
}

impl Operator {
    fn of(self, a: f32, b: f32) -> f32 {
        match self {
            Operator::Add => a + b,
            Operator::Sub => a - b,
            Operator::Mul => a * b,
            Operator::Div => a / b,
            Operator::Max if a.is_nan() || a >= b => a,
            Operator::Min if a.is_nan() || a <= b => a,
            Operator::Max | Operator::Min => b,
            Operator::PRelu if a < 0.0 => b * a,
            Operator::PRelu => a,
            Operator::Greater => f32::from(a > b),
            Operator::GreaterOrEqual => f32::from(a >= b),
            Operator::Less => f32::from(a < b),
            Operator::LessOrEqual => f32::from(a <= b),
            Operator::Equal => f32::from(a == b),
            Operator::And => f32::from(a != 0.0 && b != 0.0),
            Operator::Or => f32::from(a != 0.0 || b != 0.0),
            Operator::Xor => f32::from((a != 0.0) != (b != 0.0)),
        }
    }
}

/// What appends numbers to the row.
#[derive(Clone, Debug, PartialEq)]
pub enum Step {
    /// A layer's outputs.
    Layer(Dense, Vec<Cell>),
    /// A function of each number.
    Each(Function, Vec<Cell>),
    /// One of each pair.
    Pairs(Operator, Vec<[Cell; 2]>),
    /// The second of each three where the first is not 0, else the third.
    Choices(Vec<[Cell; 3]>),
}

impl Step {
    /// Whether all that it reads stands in the file.
    pub fn is_fixed(&self) -> bool {
        let is_fixed = |cell: &Cell| matches!(cell, Cell::Fixed(_));
        match self {
            Step::Layer(_, from) | Step::Each(_, from) => from.iter().all(is_fixed),
            Step::Pairs(_, from) => from.as_flattened().iter().all(is_fixed),
            Step::Choices(from) => from.as_flattened().iter().all(is_fixed),
        }
    }

    /// Appends to the row; `spare` is room for a layer's input.
    pub fn append(&self, row: &mut Vec<f32>, spare: &mut Vec<f32>) {
        match self {
            Step::Layer(layer, from) => {
                spare.clear();
                spare.extend(from.iter().map(|cell| cell.of(row)));
                layer.append(spare, row);
            }
            Step::Each(function, from) => from.iter().for_each(|cell| row.push(function.of(cell.of(row)))),
            Step::Pairs(operator, from) => {
                from.iter().for_each(|[a, b]| row.push(operator.of(a.of(row), b.of(row))));
            }
            Step::Choices(from) => {
                from.iter().for_each(|[which, a, b]| row.push(if which.of(row) != 0.0 { a } else { b }.of(row)));
            }
        }
    }
}

/// A network that ends in an action.
#[derive(Clone, Debug, PartialEq)]
pub struct Graph {
    /// In the order in which they are taken.
    pub(super) steps: Vec<Step>,
    /// Where steering and pedal lie.
    pub(super) action: [Cell; ACTION],
}

impl Graph {
    /// Returns the action for the observation in `row`, cut to [-1, 1]; what is no number (0 / 0) is 0. `spare` is room.
    pub fn act(&self, row: &mut Vec<f32>, spare: &mut Vec<f32>) -> [f32; ACTION] {
        self.steps.iter().for_each(|step| step.append(row, spare));
        self.action.map(|cell| Some(cell.of(row)).filter(|x| !x.is_nan()).map_or(0.0, |x| x.clamp(-1.0, 1.0)))
    }
}
