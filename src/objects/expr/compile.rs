//! A checked expression as postfix code for one scope: evaluation allocates nothing and cannot fail.

use super::{
    error::ExprError,
    ops,
    parse::DEPTH_MAX,
    scope::Scope,
    tree::{Expr, Function, Infix, Kind, Node, Prefix},
};
use crate::objects::{program::ValueType, spelling::nearest};

/// A level of the tree holds at most two waiting values (`clamp`, `if`).
const STACK: usize = 2 * DEPTH_MAX;

/// Ready to evaluate. Booleans are 1 and 0 on the stack and in `values`.
#[derive(Clone, Debug, PartialEq)]
pub struct Compiled {
    code: Vec<Step>,
    value: ValueType,
    /// How many values the scope has.
    width: usize,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Step {
    Constant(f64),
    Load(usize),
    Minus,
    Not,
    Infix(Infix),
    /// `min` and `max` take two at a time.
    Call(Function),
}

impl Expr {
    /// Checks names and types and makes the code. [`Compiled::value_type`] gives the type of the whole expression.
    pub fn compile(&self, scope: &Scope) -> Result<Compiled, ExprError> {
        let mut code = Vec::with_capacity(self.node_count());
        let value = emit(&self.root, scope, &mut code)?;
        Ok(Compiled { code, value, width: scope.len() })
    }
}

impl Compiled {
    /// What the expression gives.
    pub fn value_type(&self) -> ValueType {
        self.value
    }

    /// The value of a numeric expression; of a boolean one 1 or 0. `values` are those of the scope, in its order; NaN
    /// is read as 0, and too large values as the bound. If there are fewer values than names, the caller has a bug.
    pub fn number(&self, values: &[f64]) -> f64 {
        assert!(values.len() >= self.width, "{} values for a scope of {} names", values.len(), self.width);
        let mut stack = Stack { values: [0.0; STACK], height: 0 };
        for step in &self.code {
            stack.run(*step, values);
        }
        stack.pop()
    }

    /// The value of a condition; for a numeric expression, whether it differs from 0.
    pub fn boolean(&self, values: &[f64]) -> bool {
        self.number(values) != 0.0
    }
}

struct Stack {
    values: [f64; STACK],
    height: usize,
}

impl Stack {
    fn push(&mut self, value: f64) {
        self.values[self.height] = value;
        self.height += 1;
    }

    fn pop(&mut self) -> f64 {
        self.height -= 1;
        self.values[self.height]
    }

    fn run(&mut self, step: Step, inputs: &[f64]) {
        let result = match step {
            Step::Constant(value) => value,
            Step::Load(index) => ops::bounded(inputs[index]),
            Step::Minus => ops::bounded(-self.pop()),
            Step::Not => truth(self.pop() == 0.0),
            Step::Infix(infix) => {
                let right = self.pop();
                apply_infix(infix, self.pop(), right)
            }
            Step::Call(function) => self.call(function),
        };
        self.push(result);
    }

    fn call(&mut self, function: Function) -> f64 {
        let last = self.pop();
        match function {
            Function::Min => self.pop().min(last),
            Function::Max => self.pop().max(last),
            Function::Abs => last.abs(),
            Function::Sqrt => ops::sqrt(last),
            Function::Exp => ops::exp(last),
            Function::Log => ops::log(last),
            Function::Clamp => {
                let low = self.pop();
                ops::clamp(self.pop(), low, last)
            }
            Function::If => {
                let held = self.pop();
                if self.pop() != 0.0 { held } else { last }
            }
        }
    }
}

fn truth(holds: bool) -> f64 {
    f64::from(u8::from(holds))
}

fn apply_infix(infix: Infix, a: f64, b: f64) -> f64 {
    match infix {
        Infix::Or => truth(a != 0.0 || b != 0.0),
        Infix::And => truth(a != 0.0 && b != 0.0),
        Infix::Less => truth(a < b),
        Infix::AtMost => truth(a <= b),
        Infix::More => truth(a > b),
        Infix::AtLeast => truth(a >= b),
        Infix::Equal => truth(a == b),
        Infix::Unequal => truth(a != b),
        Infix::Plus => ops::bounded(a + b),
        Infix::Minus => ops::bounded(a - b),
        Infix::Times => ops::bounded(a * b),
        Infix::Over => ops::divide(a, b),
    }
}

fn emit(node: &Node, scope: &Scope, code: &mut Vec<Step>) -> Result<ValueType, ExprError> {
    match &node.kind {
        Kind::Number(value) => {
            code.push(Step::Constant(*value));
            Ok(ValueType::Number)
        }
        Kind::Boolean(value) => {
            code.push(Step::Constant(truth(*value)));
            Ok(ValueType::Boolean)
        }
        Kind::Name(name) => {
            let (value, index) = scope.get(name).ok_or_else(|| unknown(node, name, scope))?;
            code.push(Step::Load(index));
            Ok(value)
        }
        Kind::Prefix(prefix, inner) => {
            let (value, step) = match prefix {
                Prefix::Minus => (ValueType::Number, Step::Minus),
                Prefix::Not => (ValueType::Boolean, Step::Not),
            };
            operand(inner, value, scope, code)?;
            code.push(step);
            Ok(value)
        }
        Kind::Infix(infix, left, right) => emit_infix(*infix, left, right, scope, code),
        Kind::Call(function, arguments) => emit_call(*function, arguments, scope, code),
    }
}

fn emit_infix(
    infix: Infix,
    left: &Node,
    right: &Node,
    scope: &Scope,
    code: &mut Vec<Step>,
) -> Result<ValueType, ExprError> {
    let (takes, gives) = match infix {
        Infix::Or | Infix::And => (Some(ValueType::Boolean), ValueType::Boolean),
        Infix::Equal | Infix::Unequal => (None, ValueType::Boolean),
        Infix::Less | Infix::AtMost | Infix::More | Infix::AtLeast => (Some(ValueType::Number), ValueType::Boolean),
        Infix::Plus | Infix::Minus | Infix::Times | Infix::Over => (Some(ValueType::Number), ValueType::Number),
    };
    let first = emit(left, scope, code)?;
    let wanted = takes.unwrap_or(first);
    matches_type(left, first, wanted)?;
    operand(right, wanted, scope, code)?;
    code.push(Step::Infix(infix));
    Ok(gives)
}

fn emit_call(
    function: Function,
    arguments: &[Node],
    scope: &Scope,
    code: &mut Vec<Step>,
) -> Result<ValueType, ExprError> {
    let mut gives = ValueType::Number;
    for (index, argument) in arguments.iter().enumerate() {
        if function == Function::If && index == 1 {
            gives = emit(argument, scope, code)?;
            continue;
        }
        let condition = function == Function::If && index == 0;
        operand(argument, if condition { ValueType::Boolean } else { gives }, scope, code)?;
        if index > 0 && matches!(function, Function::Min | Function::Max) {
            code.push(Step::Call(function));
        }
    }
    if !matches!(function, Function::Min | Function::Max) {
        code.push(Step::Call(function));
    }
    Ok(gives)
}

fn operand(node: &Node, wanted: ValueType, scope: &Scope, code: &mut Vec<Step>) -> Result<(), ExprError> {
    let found = emit(node, scope, code)?;
    matches_type(node, found, wanted)
}

fn matches_type(node: &Node, found: ValueType, wanted: ValueType) -> Result<(), ExprError> {
    if found == wanted {
        return Ok(());
    }
    Err(ExprError::new(node.at.0, article(found), article(wanted)))
}

fn article(value: ValueType) -> &'static str {
    match value {
        ValueType::Number => "a number",
        ValueType::Boolean => "a condition",
    }
}

fn unknown(node: &Node, name: &str, scope: &Scope) -> ExprError {
    let expected = match nearest(name, scope.names()) {
        Some(near) => format!("a name that may be read here; did you mean `{near}`?"),
        None => format!("one of the names that may be read here: {}", scope.names().collect::<Vec<_>>().join(" ")),
    };
    ExprError::new(node.at.0, format!("unknown name `{name}`"), expected)
}
