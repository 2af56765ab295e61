//! A checked expression as postfix code for one scope: evaluation allocates nothing and cannot fail.

use super::{
    error::ExprError,
    parse::DEPTH_MAX,
    scope::Scope,
    tree::{Expr, Function, Infix, Kind, Node, Prefix},
};
use crate::kernel::formula::{Formula, Op, STACK_MAX};
use crate::objects::value_type::ValueType;
use crate::text::nearest;

/// A level of the tree holds at most two values that wait (`clamp`, `if`).
const _: () = assert!(STACK_MAX >= 2 * DEPTH_MAX);

/// Ready to evaluate. Booleans are 1 and 0 on the stack and in `values`.
#[derive(Clone, Debug, PartialEq)]
pub struct Compiled {
    formula: Formula,
    value: ValueType,
    /// Number of values in the scope.
    width: usize,
}

impl Expr {
    /// Checks names and types and makes the code. [`Compiled::value_type`] gives the type of the whole expression.
    pub fn compile(&self, scope: &Scope) -> Result<Compiled, ExprError> {
        let mut code = Vec::with_capacity(self.node_count());
        let value = emit(&self.root, scope, &mut code)?;
        let formula = Formula::try_from(code).map_err(|error| ExprError::new(1, error.to_string(), "an expression"))?;
        Ok(Compiled { formula, value, width: scope.len() })
    }
}

impl Compiled {
    /// Returns the type of the expression's value.
    pub fn value_type(&self) -> ValueType {
        self.value
    }

    /// The value of a numeric expression; of a boolean one 1 or 0. `values` are those of the scope, in its order; NaN
    /// is read as 0, and too large values as the bound. If there are fewer values than names, the caller has a bug.
    pub fn number(&self, values: &[f64]) -> f64 {
        assert!(values.len() >= self.width, "{} values for a scope of {} names", values.len(), self.width);
        self.formula.value(values)
    }

    /// Returns the code, whose places are those of the scope.
    pub fn formula(&self) -> &Formula {
        &self.formula
    }

    /// The value of a condition; for a numeric expression, whether it differs from 0.
    pub fn boolean(&self, values: &[f64]) -> bool {
        self.number(values) != 0.0
    }
}

fn emit(node: &Node, scope: &Scope, code: &mut Vec<Op>) -> Result<ValueType, ExprError> {
    match &node.kind {
        Kind::Number(value) => {
            code.push(Op::Constant(*value));
            Ok(ValueType::Number)
        }
        Kind::Boolean(value) => {
            code.push(Op::Constant(f64::from(u8::from(*value))));
            Ok(ValueType::Boolean)
        }
        Kind::Name(name) => {
            let (value, index) = scope.get(name).ok_or_else(|| unknown(node, name, scope))?;
            code.push(Op::Load(index));
            Ok(value)
        }
        Kind::Prefix(prefix, inner) => {
            let (value, step) = match prefix {
                Prefix::Minus => (ValueType::Number, Op::Minus),
                Prefix::Not => (ValueType::Boolean, Op::Not),
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
    code: &mut Vec<Op>,
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
    code.push(infix_op(infix));
    Ok(gives)
}

fn emit_call(
    function: Function,
    arguments: &[Node],
    scope: &Scope,
    code: &mut Vec<Op>,
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
            code.push(call_op(function));
        }
    }
    if !matches!(function, Function::Min | Function::Max) {
        code.push(call_op(function));
    }
    Ok(gives)
}

fn infix_op(infix: Infix) -> Op {
    match infix {
        Infix::Or => Op::Or,
        Infix::And => Op::And,
        Infix::Less => Op::Less,
        Infix::AtMost => Op::AtMost,
        Infix::More => Op::More,
        Infix::AtLeast => Op::AtLeast,
        Infix::Equal => Op::Equal,
        Infix::Unequal => Op::Unequal,
        Infix::Plus => Op::Plus,
        Infix::Minus => Op::Difference,
        Infix::Times => Op::Times,
        Infix::Over => Op::Over,
    }
}

/// `min` and `max` take two at a time.
fn call_op(function: Function) -> Op {
    match function {
        Function::Min => Op::Min,
        Function::Max => Op::Max,
        Function::Clamp => Op::Clamp,
        Function::Abs => Op::Abs,
        Function::Sqrt => Op::Sqrt,
        Function::Exp => Op::Exp,
        Function::Log => Op::Log,
        Function::If => Op::If,
    }
}

fn operand(node: &Node, wanted: ValueType, scope: &Scope, code: &mut Vec<Op>) -> Result<(), ExprError> {
    let emitted = emit(node, scope, code)?;
    matches_type(node, emitted, wanted)
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
