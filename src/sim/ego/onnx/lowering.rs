//! From a node to steps of a graph. Shapes are settled here, and what only moves numbers gives the places that they come from.

use super::wire::{Attribute, COUNT_MAX, Kind, Node, Tensor, refused};
use crate::ego::graph::{Cell, Function, Operator, Step};
use crate::ego::network::Dense;
use crate::ego::weights_error::WeightsError;
use crate::kernel::linear::transposed;

/// Numbers that a file may come to: weights, and all that is made of them and of an observation.
const NUMBERS_MAX: usize = 1 << 24;

/// What is read, with the attributes that each operator may have.
pub const OPERATORS: [(&str, &[&str]); 54] = [
    ("Gemm", &["alpha", "beta", "transA", "transB"]),
    ("MatMul", &[]),
    ("Add", &[]),
    ("Sub", &[]),
    ("Mul", &[]),
    ("Div", &[]),
    ("Relu", &[]),
    ("LeakyRelu", &["alpha"]),
    ("Tanh", &[]),
    ("Sigmoid", &[]),
    ("Elu", &["alpha"]),
    ("Gelu", &["approximate"]),
    ("Erf", &[]),
    ("Exp", &[]),
    ("Softplus", &[]),
    ("Clip", &["min", "max"]),
    ("Abs", &[]),
    ("Neg", &[]),
    ("Sign", &[]),
    ("Sqrt", &[]),
    ("Log", &[]),
    ("Mish", &[]),
    ("Celu", &["alpha"]),
    ("Selu", &["alpha", "gamma"]),
    ("PRelu", &[]),
    ("HardSigmoid", &["alpha", "beta"]),
    ("HardSwish", &[]),
    ("Max", &[]),
    ("Min", &[]),
    ("Greater", &[]),
    ("GreaterOrEqual", &[]),
    ("Less", &[]),
    ("LessOrEqual", &[]),
    ("Equal", &[]),
    ("And", &[]),
    ("Or", &[]),
    ("Xor", &[]),
    ("Not", &[]),
    ("Where", &[]),
    ("Concat", &["axis"]),
    ("Split", &["axis", "split", "num_outputs"]),
    ("Slice", &["starts", "ends", "axes"]),
    ("Gather", &["axis"]),
    ("Flatten", &["axis"]),
    ("Reshape", &["allowzero"]),
    ("Transpose", &["perm"]),
    ("Squeeze", &["axes"]),
    ("Unsqueeze", &["axes"]),
    ("Expand", &[]),
    ("Shape", &[]),
    ("Identity", &[]),
    ("Cast", &["to", "saturate"]),
    ("Constant", &["value", "value_float", "value_floats", "value_int", "value_ints"]),
    ("ConstantOfShape", &["value"]),
];

/// A table of numbers of which some are observed.
#[derive(Clone, Debug)]
pub struct Value {
    pub shape: Vec<usize>,
    pub cells: Vec<Cell>,
    pub kind: Kind,
}

impl Value {
    fn fixed(shape: Vec<usize>, numbers: impl IntoIterator<Item = f32>, kind: Kind) -> Value {
        Value { shape, cells: numbers.into_iter().map(Cell::Fixed).collect(), kind }
    }

    /// Its numbers, where all stand in the file.
    fn numbers(&self) -> Option<Vec<f32>> {
        let number = |cell: &Cell| if let Cell::Fixed(x) = *cell { Some(x) } else { None };
        self.cells.iter().map(number).collect()
    }

    fn wholes(&self) -> Option<Vec<i64>> {
        let is_list = self.kind == Kind::Whole && self.cells.len() <= COUNT_MAX;
        self.numbers().filter(|_| is_list).map(|list| list.into_iter().map(|x| x as i64).collect())
    }

    /// Numbers before an axis, along it and behind it.
    fn around(&self, axis: usize) -> [usize; 3] {
        [&self.shape[..axis], &self.shape[axis..=axis], &self.shape[axis + 1..]].map(|part| part.iter().product())
    }
}

/// A graph in the making.
#[derive(Default)]
pub struct Lowering {
    pub steps: Vec<Step>,
    /// Numbers in the row so far.
    row: u32,
    /// Numbers so far, in all.
    spent: usize,
}

impl Lowering {
    /// How many numbers a shape holds; counts them.
    fn room(&mut self, shape: &[usize]) -> Result<usize, WeightsError> {
        let count = shape.iter().try_fold(1usize, |count, length| count.checked_mul(*length));
        match count.filter(|count| shape.len() <= 8 && (1..=NUMBERS_MAX - self.spent).contains(count)) {
            Some(count) => {
                self.spent += count;
                Ok(count)
            }
            None => {
                let found = format!("shape {:?} behind {} numbers", &shape[..shape.len().min(9)], self.spent);
                Err(refused(
                    "graph",
                    found,
                    format!("at most 8 axes, none of them empty, and {NUMBERS_MAX} numbers in all"),
                ))
            }
        }
    }

    /// The next numbers of the row.
    pub fn seen(&mut self, shape: Vec<usize>) -> Result<Value, WeightsError> {
        let from = self.row;
        self.row += self.room(&shape)? as u32;
        Ok(Value { shape, cells: (from..self.row).map(Cell::At).collect(), kind: Kind::Float })
    }

    /// A tensor of the file.
    pub fn kept(&mut self, tensor: &Tensor<'_>) -> Result<Value, WeightsError> {
        self.room(&tensor.shape)?;
        let (numbers, kind) = tensor.numbers()?;
        Ok(Value::fixed(tensor.shape.clone(), numbers, kind))
    }

    /// The results of a step, which is taken at once where nothing in it is observed.
    fn step(&mut self, step: Step, shape: Vec<usize>) -> Result<Value, WeightsError> {
        if !step.is_fixed() {
            self.steps.push(step);
            return self.seen(shape);
        }
        self.room(&shape)?;
        let mut row = Vec::new();
        step.append(&mut row, &mut Vec::new());
        Ok(Value::fixed(shape, row, Kind::Float))
    }

    fn shaped(&mut self, of: &Value, shape: Vec<usize>) -> Result<Option<Value>, WeightsError> {
        let is_all = self.room(&shape)? == of.cells.len();
        Ok(is_all.then(|| Value { shape, ..of.clone() }))
    }

    /// What lies at these places of an axis.
    fn taken(&mut self, of: &Value, axis: usize, places: &[usize]) -> Result<Value, WeightsError> {
        let mut shape = of.shape.clone();
        shape[axis] = places.len();
        self.room(&shape)?;
        let [_, along, behind] = of.around(axis);
        let blocks = of.cells.chunks_exact(along * behind);
        let cells =
            blocks.flat_map(|block| places.iter().flat_map(|place| &block[place * behind..(place + 1) * behind]));
        Ok(Value { shape, cells: cells.copied().collect(), kind: of.kind })
    }

    /// A table repeated along axes of length 1 and new ones in front; none where it does not fit.
    fn spread(&mut self, of: &Value, shape: &[usize]) -> Result<Option<Vec<Cell>>, WeightsError> {
        let count = self.room(shape)?;
        let Some(more) = shape.len().checked_sub(of.shape.len()) else { return Ok(None) };
        if of.shape.iter().zip(&shape[more..]).any(|(own, length)| *own != 1 && own != length) {
            return Ok(None);
        }
        let place = |mut at: usize| {
            let (mut place, mut stride) = (0, 1);
            for (axis, length) in shape.iter().enumerate().rev() {
                let own = axis.checked_sub(more).map_or(1, |axis| of.shape[axis]);
                place += at % length % own * stride;
                (at, stride) = (at / length, stride * own);
            }
            of.cells[place]
        };
        Ok(Some((0..count).map(place).collect()))
    }

    /// The results of a node.
    pub fn lower(&mut self, node: &Node<'_>, used: &[Option<&Value>]) -> Result<Vec<Value>, WeightsError> {
        node.check(&OPERATORS)?;
        let given = |i: usize| used.get(i).copied().flatten();
        if node.operator == "Constant" {
            return Ok(vec![self.constant(node)?]);
        }
        let x = given(0).ok_or_else(|| node.refused("no input", "one"))?;
        let second = || given(1).ok_or_else(|| node.refused("no second input", "one"));
        // Lists are inputs, and in older files attributes.
        let list = |i: usize, key: &str| match given(i) {
            Some(list) => {
                list.wholes().map(Some).ok_or_else(|| node.refused(format!("input {i}"), "whole numbers of the file"))
            }
            None => node.wholes(key),
        };
        let place = |axis: i64, rank: usize| {
            let place = if axis < 0 { axis.checked_add(rank as i64) } else { Some(axis) };
            let place = place.and_then(|place| usize::try_from(place).ok()).filter(|place| *place < rank);
            place.ok_or_else(|| node.refused(format!("axis {axis}"), format!("one of {rank}")))
        };
        let axis = |default: i64| place(node.whole("axis", default)?, x.shape.len());
        let misfit = |shape: &[usize]| node.refused(format!("shapes {:?} and {shape:?}", x.shape), "shapes that fit");
        let function = match node.operator {
            "Relu" => Some(Function::Relu),
            "LeakyRelu" => Some(Function::LeakyRelu(node.float("alpha", 0.01)?)),
            "Tanh" => Some(Function::Tanh),
            "Sigmoid" => Some(Function::Sigmoid),
            "Elu" => Some(Function::Elu(node.float("alpha", 1.0)?)),
            "Gelu" => Some(Function::Gelu),
            "Erf" => Some(Function::Erf),
            "Exp" => Some(Function::Exp),
            "Softplus" => Some(Function::Softplus),
            "Clip" => {
                let bound = |i: usize, key: &str, default: f32| match given(i).map(Value::numbers) {
                    Some(Some(bound)) if bound.len() == 1 => Ok(bound[0]),
                    Some(_) => Err(node.refused(format!("input {i}"), "one number of the file")),
                    None => node.float(key, default),
                };
                Some(Function::Clip(bound(1, "min", f32::NEG_INFINITY)?, bound(2, "max", f32::INFINITY)?))
            }
            "Abs" => Some(Function::Abs),
            "Neg" => Some(Function::Neg),
            "Sign" => Some(Function::Sign),
            "Sqrt" => Some(Function::Sqrt),
            "Log" => Some(Function::Log),
            "Mish" => Some(Function::Mish),
            "Celu" => Some(Function::Celu(node.float("alpha", 1.0)?)),
            "Selu" => Some(Function::Selu(node.float("alpha", 1.673_263_2)?, node.float("gamma", 1.050_701)?)),
            "HardSigmoid" => Some(Function::HardSigmoid(node.float("alpha", 0.2)?, node.float("beta", 0.5)?)),
            "HardSwish" => Some(Function::HardSigmoid(1.0 / 6.0, 0.5)),
            _ => None,
        };
        if let Some(function) = function {
            if x.kind != Kind::Float {
                return Err(node.refused(format!("numbers of kind {:?}", x.kind), "f32"));
            }
            if !matches!(node.attribute("approximate")?, None | Some(Attribute::Text("none"))) {
                return Err(node.refused("an approximation", "approximate=\"none\""));
            }
            let result = self.step(Step::Each(function, x.cells.clone()), x.shape.clone())?;
            return Ok(vec![if node.operator == "HardSwish" {
                self.pairs(node, Operator::Mul, x, &result)?
            } else {
                result
            }]);
        }
        let operator = match node.operator {
            "Add" => Some(Operator::Add),
            "Sub" => Some(Operator::Sub),
            "Mul" => Some(Operator::Mul),
            "Div" => Some(Operator::Div),
            "Max" => Some(Operator::Max),
            "Min" => Some(Operator::Min),
            "PRelu" => Some(Operator::PRelu),
            "Greater" => Some(Operator::Greater),
            "GreaterOrEqual" => Some(Operator::GreaterOrEqual),
            "Less" => Some(Operator::Less),
            "LessOrEqual" => Some(Operator::LessOrEqual),
            "Equal" => Some(Operator::Equal),
            "And" => Some(Operator::And),
            "Or" => Some(Operator::Or),
            "Xor" => Some(Operator::Xor),
            _ => None,
        };
        if let Some(operator @ (Operator::Max | Operator::Min)) = operator {
            let mut more = used.iter().skip(1).copied().flatten();
            return Ok(vec![more.try_fold(x.clone(), |most, of| self.pairs(node, operator, &most, of))?]);
        }
        if let Some(operator) = operator {
            return Ok(vec![self.pairs(node, operator, x, second()?)?]);
        }
        let one = match node.operator {
            "Gemm" | "MatMul" => self.product(node, x, second()?, given(2))?,
            "Concat" => {
                let axis = axis(0)?;
                let parts: Vec<&Value> = used.iter().copied().flatten().collect();
                let same = |part: &Value, i: usize| i == axis || part.shape[i] == x.shape[i];
                let alike = |part: &&Value| {
                    let rank = x.shape.len();
                    part.kind == x.kind && part.shape.len() == rank && (0..rank).all(|i| same(part, i))
                };
                if let Some(odd) = parts.iter().find(|part| !alike(part)) {
                    return Err(misfit(&odd.shape));
                }
                let mut shape = x.shape.clone();
                shape[axis] = parts.iter().map(|part| part.shape[axis]).sum();
                self.room(&shape)?;
                let mut cells = Vec::new();
                for block in 0..x.around(axis)[0] {
                    for part in &parts {
                        let [_, along, behind] = part.around(axis);
                        cells.extend(&part.cells[block * along * behind..][..along * behind]);
                    }
                }
                Value { shape, cells, kind: x.kind }
            }
            "Split" => {
                let axis = axis(0)?;
                let (count, along) = (node.outputs.len().max(1), x.shape[axis]);
                let even = along.div_ceil(count);
                let lengths = match list(1, "split")? {
                    Some(lengths) => lengths.into_iter().map(|length| usize::try_from(length).unwrap_or(0)).collect(),
                    None => (0..count).map(|part| even.min(along.saturating_sub(part * even))).collect::<Vec<_>>(),
                };
                if lengths.iter().try_fold(0usize, |sum, length| sum.checked_add(*length)) != Some(along) {
                    return Err(node.refused(format!("parts {lengths:?}"), format!("{along} in all")));
                }
                let mut from = 0;
                let mut part = |length: usize| {
                    from += length;
                    self.taken(x, axis, &(from - length..from).collect::<Vec<_>>())
                };
                return lengths.into_iter().map(&mut part).collect();
            }
            "Slice" => {
                let from = list(1, "starts")?.unwrap_or_default();
                let to = list(2, "ends")?.unwrap_or_default();
                let axes = list(3, "axes")?.unwrap_or_else(|| (0..from.len() as i64).collect());
                let by = list(4, "steps")?.unwrap_or_else(|| vec![1; from.len()]);
                if [to.len(), axes.len(), by.len()] != [from.len(); 3] || by.iter().any(|by| *by < 1) {
                    return Err(node.refused(format!("from {from:?} to {to:?} by {by:?}"), "as many of each, forwards"));
                }
                let mut result = x.clone();
                for (((from, to), axis), by) in from.into_iter().zip(to).zip(axes).zip(by) {
                    let axis = place(axis, x.shape.len())?;
                    let along = x.shape[axis] as i64;
                    let [from, to] =
                        [from, to].map(|at| (if at < 0 { at.saturating_add(along) } else { at }).clamp(0, along));
                    let places: Vec<usize> = (from as usize..to as usize).step_by(by as usize).collect();
                    result = self.taken(&result, axis, &places)?;
                }
                result
            }
            "Gather" => {
                let (axis, y) = (axis(0)?, second()?);
                let places = y.wholes().ok_or_else(|| node.refused("places", "whole numbers of the file"))?;
                let places: Vec<usize> =
                    places.into_iter().map(|at| place(at, x.shape[axis])).collect::<Result<_, _>>()?;
                let mut result = self.taken(x, axis, &places)?;
                result.shape.splice(axis..=axis, y.shape.iter().copied());
                result
            }
            "Flatten" => {
                let axis = node.whole("axis", 1)?;
                let axis = if axis == x.shape.len() as i64 { x.shape.len() } else { place(axis, x.shape.len())? };
                let shape = [&x.shape[..axis], &x.shape[axis..]].map(|part| part.iter().product());
                self.shaped(x, shape.to_vec())?.ok_or_else(|| misfit(&shape))?
            }
            "Reshape" | "Expand" | "ConstantOfShape" => {
                let of = if node.operator == "ConstantOfShape" { x } else { second()? };
                let lengths = of.wholes().filter(|_| node.whole("allowzero", 0) == Ok(0));
                let lengths = lengths.ok_or_else(|| node.refused("a shape", "whole numbers of the file"))?;
                let mut shape: Vec<usize> =
                    lengths.iter().map(|length| usize::try_from(*length).unwrap_or(0)).collect();
                match node.operator {
                    "Reshape" => {
                        for (i, _) in lengths.iter().enumerate().filter(|(_, length)| **length == 0) {
                            shape[i] = x.shape.get(i).copied().unwrap_or(0);
                        }
                        if let Some(open) = lengths.iter().position(|length| *length == -1) {
                            shape[open] = 1;
                            let others = shape.iter().try_fold(1usize, |count, length| count.checked_mul(*length));
                            shape[open] = others.and_then(|others| x.cells.len().checked_div(others)).unwrap_or(0);
                        }
                        self.shaped(x, shape.clone())?.ok_or_else(|| misfit(&shape))?
                    }
                    "Expand" => {
                        // A length of 1 keeps what is there.
                        for (length, own) in shape.iter_mut().rev().zip(x.shape.iter().rev()) {
                            *length = if *length == 1 { *own } else { *length };
                        }
                        let cells = self.spread(x, &shape)?.ok_or_else(|| misfit(&shape))?;
                        Value { shape, cells, kind: x.kind }
                    }
                    _ => {
                        let fill = match node.attribute("value")? {
                            Some(Attribute::Tensor(tensor)) => self.kept(&tensor)?,
                            _ => Value::fixed(vec![], [0.0], Kind::Float),
                        };
                        let cells =
                            self.spread(&Value { shape: vec![], ..fill }, &shape)?.ok_or_else(|| misfit(&shape))?;
                        Value { shape, cells, kind: fill.kind }
                    }
                }
            }
            "Transpose" => {
                let perm = node.wholes("perm")?.unwrap_or_else(|| vec![1, 0]);
                let [rows, columns] = x.shape[..] else {
                    return Err(node.refused(format!("shape {:?}", x.shape), "a matrix"));
                };
                match perm[..] {
                    [0, 1] => x.clone(),
                    [1, 0] => {
                        self.room(&x.shape)?;
                        let cells = (0..columns).flat_map(|column| x.cells[column..].iter().step_by(columns).copied());
                        Value { shape: vec![columns, rows], cells: cells.collect(), kind: x.kind }
                    }
                    _ => return Err(node.refused(format!("perm {perm:?}"), "[1, 0]")),
                }
            }
            "Squeeze" | "Unsqueeze" => {
                let is_less = node.operator == "Squeeze";
                let axes = list(1, "axes")?;
                let rank = x.shape.len() + if is_less { 0 } else { axes.as_ref().map_or(0, Vec::len) };
                let axes =
                    axes.map(|axes| axes.into_iter().map(|axis| place(axis, rank)).collect::<Result<Vec<_>, _>>());
                let axes = axes.transpose()?;
                let mut own = x.shape.iter().copied();
                let is_named = |axis: &usize| axes.as_ref().is_none_or(|axes| axes.contains(axis));
                let shape: Vec<usize> = if is_less {
                    own.enumerate()
                        .filter(|(axis, length)| !(is_named(axis) && *length == 1))
                        .map(|(_, length)| length)
                        .collect()
                } else {
                    (0..rank).filter_map(|axis| if is_named(&axis) { Some(1) } else { own.next() }).collect()
                };
                self.shaped(x, shape.clone())?.ok_or_else(|| misfit(&shape))?
            }
            "Shape" => Value::fixed(vec![x.shape.len()], x.shape.iter().map(|length| *length as f32), Kind::Whole),
            "Cast" => match (node.whole("to", 0)?, x.kind) {
                (1, _) => Value { kind: Kind::Float, ..x.clone() },
                (7, Kind::Whole) => x.clone(),
                (9, _) => self.truths(Function::Truth, x)?,
                (kind, _) => {
                    return Err(node.refused(format!("a cast to kind {kind}"), "f32 (kind 1) or bool (kind 9)"));
                }
            },
            "Not" if x.kind == Kind::Truth => self.truths(Function::Not, x)?,
            "Not" => return Err(node.refused(format!("numbers of kind {:?}", x.kind), "bool")),
            "Where" => {
                let (a, b) = (second()?, given(2).ok_or_else(|| node.refused("no third input", "one"))?);
                if x.kind != Kind::Truth || a.kind != b.kind {
                    let found = format!("kinds {:?}, {:?} and {:?}", x.kind, a.kind, b.kind);
                    return Err(node.refused(found, "bool, and two of one kind"));
                }
                let (shape, threes) = self.alike(node, [x, a, b])?;
                // What the file decides is no step: its sides are moved, seen or not.
                let chosen = |[which, a, b]: &[Cell; 3]| match which {
                    Cell::Fixed(which) => Some(if *which != 0.0 { *a } else { *b }),
                    Cell::At(_) => None,
                };
                match threes.iter().map(chosen).collect() {
                    Some(cells) => Value { shape, cells, kind: a.kind },
                    None => Value { kind: a.kind, ..self.step(Step::Choices(threes), shape)? },
                }
            }
            _ => x.clone(),
        };
        Ok(vec![one])
    }

    fn constant(&mut self, node: &Node<'_>) -> Result<Value, WeightsError> {
        let keys = ["value", "value_float", "value_floats", "value_int", "value_ints"];
        let said = keys.iter().find_map(|key| node.attribute(key).transpose()).transpose()?;
        let (numbers, kind) = match said {
            Some(Attribute::Tensor(tensor)) => return self.kept(&tensor),
            Some(Attribute::Float(x)) => return Ok(Value::fixed(vec![], [x], Kind::Float)),
            Some(Attribute::Whole(x)) => return Ok(Value::fixed(vec![], [x as f32], Kind::Whole)),
            Some(Attribute::Floats(list)) => (list, Kind::Float),
            Some(Attribute::Wholes(list)) => (list.into_iter().map(|x| x as f32).collect(), Kind::Whole),
            _ => return Err(node.refused("no number", "one of the file")),
        };
        self.room(&[numbers.len()])?;
        Ok(Value::fixed(vec![numbers.len()], numbers, kind))
    }

    /// A function that says of each number whether something holds.
    fn truths(&mut self, function: Function, x: &Value) -> Result<Value, WeightsError> {
        let result = self.step(Step::Each(function, x.cells.clone()), x.shape.clone())?;
        Ok(Value { kind: Kind::Truth, ..result })
    }

    /// Tables spread to one shape, side by side.
    fn alike<const COUNT: usize>(
        &mut self,
        node: &Node<'_>,
        tables: [&Value; COUNT],
    ) -> Result<(Vec<usize>, Vec<[Cell; COUNT]>), WeightsError> {
        let rank = tables.iter().map(|of| of.shape.len()).max().unwrap_or(0);
        let mut shape = vec![1; rank];
        for of in tables {
            for (length, own) in shape.iter_mut().rev().zip(of.shape.iter().rev()) {
                *length = (*length).max(*own);
            }
        }
        let mut sides = vec![[Cell::Fixed(0.0); COUNT]; self.room(&shape)?];
        for (i, of) in tables.into_iter().enumerate() {
            let cells = self.spread(of, &shape)?;
            let shapes = || tables.map(|of| format!("{:?}", of.shape)).join(" and ");
            let cells = cells.ok_or_else(|| node.refused(format!("shapes {}", shapes()), "shapes that fit"))?;
            sides.iter_mut().zip(cells).for_each(|(side, cell)| side[i] = cell);
        }
        Ok((shape, sides))
    }

    /// An operator on two tables, spread to one shape.
    fn pairs(&mut self, node: &Node<'_>, operator: Operator, x: &Value, y: &Value) -> Result<Value, WeightsError> {
        use Operator::{And, Equal, Greater, GreaterOrEqual, Less, LessOrEqual, Or, PRelu, Xor};
        let compares = matches!(operator, Greater | GreaterOrEqual | Less | LessOrEqual | Equal);
        let takes = match (operator, x.kind) {
            (And | Or | Xor, kind) => kind == Kind::Truth,
            (Equal, _) | (_, Kind::Float) => true,
            (PRelu, _) | (_, Kind::Truth) => false,
            (_, Kind::Whole) => true,
        };
        if !takes || x.kind != y.kind {
            return Err(node.refused(format!("kinds {:?} and {:?}", x.kind, y.kind), "two of one kind that it takes"));
        }
        let (shape, pairs) = self.alike(node, [x, y])?;
        let result = self.step(Step::Pairs(operator, pairs), shape)?;
        Ok(match result.numbers() {
            _ if compares => Value { kind: Kind::Truth, ..result },
            None if (operator, x.kind) == (Operator::Div, Kind::Whole) => {
                return Err(node.refused("whole numbers that are observed", "f32, or whole numbers of the file"));
            }
            Some(numbers) if x.kind == Kind::Whole => {
                Value::fixed(result.shape, numbers.into_iter().map(f32::trunc), Kind::Whole)
            }
            _ => Value { kind: x.kind, ..result },
        })
    }

    /// A row times a matrix of the file, and a bias.
    fn product(
        &mut self,
        node: &Node<'_>,
        x: &Value,
        matrix: &Value,
        bias: Option<&Value>,
    ) -> Result<Value, WeightsError> {
        let is_turned = node.whole("transB", 0)? == 1;
        let (Some(mut weights), [rows, columns]) = (matrix.numbers(), &matrix.shape[..]) else {
            return Err(node.refused(format!("a second factor of shape {:?}", matrix.shape), "a matrix of the file"));
        };
        let (inputs, outputs) = if is_turned { (*columns, *rows) } else { (*rows, *columns) };
        if x.cells.len() != inputs
            || x.shape.last() != Some(&inputs)
            || node.whole("transA", 0)? != 0
            || x.kind != Kind::Float
        {
            let found = format!("numbers of shape {:?} times {inputs} by {outputs}", x.shape);
            return Err(node.refused(found, format!("one row of {inputs}")));
        }
        self.room(&[inputs, outputs])?;
        if is_turned {
            weights = transposed(&weights, inputs);
        }
        let mut shape = x.shape.clone();
        shape[x.shape.len() - 1] = outputs;
        let bias = match bias {
            None => vec![0.0; outputs],
            Some(bias) => {
                let cells = self.spread(bias, &shape)?;
                let numbers = cells.and_then(|cells| Value { cells, ..bias.clone() }.numbers());
                numbers.ok_or_else(|| {
                    node.refused(format!("a bias of shape {:?}", bias.shape), "one of the file that fits")
                })?
            }
        };
        let mut layer = Dense { inputs, outputs, weights, bias };
        for (numbers, key) in [(&mut layer.weights, "alpha"), (&mut layer.bias, "beta")] {
            let factor = node.float(key, 1.0)?;
            numbers.iter_mut().for_each(|x| *x *= factor);
            if let Some(odd) = numbers.iter().find(|x| !x.is_finite()) {
                return Err(node.refused(odd, "finite numbers"));
            }
        }
        self.step(Step::Layer(layer, x.cells.clone()), shape)
    }
}
