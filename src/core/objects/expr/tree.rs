//! The tree of an expression and its canonical text.

use serde::{Deserialize, Deserializer, Serialize, Serializer, de::Error as _};
use std::{collections::BTreeSet, fmt};

use super::{error::ExprError, parse};

/// A parsed expression: bounded in size and depth, not yet checked against a scope. As text in serde.
#[derive(Clone, Debug, PartialEq)]
pub struct Expr {
    pub(super) root: Node,
}

/// A place in the text from which it was parsed; it does not count when expressions are compared.
#[derive(Clone, Copy, Debug)]
pub(super) struct Column(pub usize);

impl PartialEq for Column {
    fn eq(&self, _: &Column) -> bool {
        true
    }
}

#[derive(Clone, Debug, PartialEq)]
pub(super) struct Node {
    pub at: Column,
    pub kind: Kind,
}

#[derive(Clone, Debug, PartialEq)]
pub(super) enum Kind {
    /// Never negative: a sign is an operator.
    Number(f64),
    Boolean(bool),
    Name(String),
    Prefix(Prefix, Box<Node>),
    Infix(Infix, Box<Node>, Box<Node>),
    Call(Function, Vec<Node>),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Prefix {
    Minus,
    Not,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Infix {
    Or,
    And,
    Less,
    AtMost,
    More,
    AtLeast,
    Equal,
    Unequal,
    Plus,
    Minus,
    Times,
    Over,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Function {
    Min,
    Max,
    Clamp,
    Abs,
    Sqrt,
    Exp,
    Log,
    If,
}

/// Binding strengths. A node gets parentheses if its strength is lower than its place needs.
pub(super) mod binding {
    pub const OR: u8 = 1;
    pub const AND: u8 = 2;
    pub const NOT: u8 = 3;
    pub const COMPARE: u8 = 4;
    pub const SUM: u8 = 5;
    pub const PRODUCT: u8 = 6;
    pub const MINUS: u8 = 7;
    pub const ATOM: u8 = 8;
}

impl Infix {
    pub const ALL: [Infix; 12] = [
        Infix::Or,
        Infix::And,
        Infix::Less,
        Infix::AtMost,
        Infix::More,
        Infix::AtLeast,
        Infix::Equal,
        Infix::Unequal,
        Infix::Plus,
        Infix::Minus,
        Infix::Times,
        Infix::Over,
    ];

    pub fn text(self) -> &'static str {
        match self {
            Infix::Or => "or",
            Infix::And => "and",
            Infix::Less => "<",
            Infix::AtMost => "<=",
            Infix::More => ">",
            Infix::AtLeast => ">=",
            Infix::Equal => "==",
            Infix::Unequal => "!=",
            Infix::Plus => "+",
            Infix::Minus => "-",
            Infix::Times => "*",
            Infix::Over => "/",
        }
    }

    pub fn binding(self) -> u8 {
        match self {
            Infix::Or => binding::OR,
            Infix::And => binding::AND,
            Infix::Plus | Infix::Minus => binding::SUM,
            Infix::Times | Infix::Over => binding::PRODUCT,
            _ => binding::COMPARE,
        }
    }

    /// Comparisons do not chain: `a < b < c` has no meaning.
    pub fn left_needs(self) -> u8 {
        self.binding() + u8::from(self.binding() == binding::COMPARE)
    }
}

/// Names of the functions, for prompts and messages.
pub const FUNCTIONS: [&str; 8] = ["min", "max", "clamp", "abs", "sqrt", "exp", "log", "if"];

impl Function {
    pub const ALL: [Function; 8] = [
        Function::Min,
        Function::Max,
        Function::Clamp,
        Function::Abs,
        Function::Sqrt,
        Function::Exp,
        Function::Log,
        Function::If,
    ];

    pub fn text(self) -> &'static str {
        FUNCTIONS[self as usize]
    }

    /// Returns the fewest and the most arguments.
    pub fn arity(self) -> (usize, usize) {
        match self {
            Function::Min | Function::Max => (2, 8),
            Function::Clamp | Function::If => (3, 3),
            _ => (1, 1),
        }
    }
}

impl Expr {
    /// Parses a text. Errors name the column, what was found there and what would be accepted. Hostile text is refused
    /// before it can use much memory or stack.
    pub fn parse(text: &str) -> Result<Expr, ExprError> {
        parse::parse(text).map(|root| Expr { root })
    }

    /// Features and parameters that it reads, sorted, without repeats.
    pub fn names(&self) -> BTreeSet<String> {
        let mut names = BTreeSet::new();
        self.root.visit(&mut |node| {
            if let Kind::Name(name) = &node.kind {
                names.insert(name.clone());
            }
        });
        names
    }

    /// Numbers, names, operators and calls.
    pub fn node_count(&self) -> usize {
        let mut count = 0;
        self.root.visit(&mut |_| count += 1);
        count
    }

    /// Nodes on the longest way from the root to a leaf.
    pub fn depth(&self) -> usize {
        self.root.depth(false)
    }

    /// Returns the depth where a chain such as `a + b - c` or `p and q and r` counts as one level: it reads as one list, however the tree holds it.
    pub fn depth_of_chains(&self) -> usize {
        self.root.depth(true)
    }
}

impl Node {
    pub fn children(&self) -> Vec<&Node> {
        match &self.kind {
            Kind::Number(_) | Kind::Boolean(_) | Kind::Name(_) => Vec::new(),
            Kind::Prefix(_, inner) => vec![inner],
            Kind::Infix(_, left, right) => vec![left, right],
            Kind::Call(_, arguments) => arguments.iter().collect(),
        }
    }

    // Recursion here and below goes no deeper than the parser allowed.
    fn visit(&self, f: &mut impl FnMut(&Node)) {
        f(self);
        for child in self.children() {
            child.visit(f);
        }
    }

    fn depth(&self, chains: bool) -> usize {
        if let Kind::Infix(infix, left, right) = &self.kind
            && chains
            && infix.binding() != binding::COMPARE
            && left.binding() == infix.binding()
        {
            return left.depth(chains).max(1 + right.depth(chains));
        }
        1 + self.children().into_iter().map(|child| child.depth(chains)).max().unwrap_or(0)
    }

    fn binding(&self) -> u8 {
        match &self.kind {
            Kind::Prefix(Prefix::Not, _) => binding::NOT,
            Kind::Prefix(Prefix::Minus, _) => binding::MINUS,
            Kind::Infix(infix, ..) => infix.binding(),
            _ => binding::ATOM,
        }
    }

    fn print(&self, needs: u8, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.binding() < needs {
            f.write_str("(")?;
            self.print(0, f)?;
            return f.write_str(")");
        }
        match &self.kind {
            Kind::Number(value) => print_number(*value, f),
            Kind::Boolean(value) => write!(f, "{value}"),
            Kind::Name(name) => f.write_str(name),
            Kind::Prefix(Prefix::Minus, inner) => {
                f.write_str("-")?;
                inner.print(binding::MINUS, f)
            }
            Kind::Prefix(Prefix::Not, inner) => {
                f.write_str("not ")?;
                inner.print(binding::NOT, f)
            }
            Kind::Infix(infix, left, right) => {
                left.print(infix.left_needs(), f)?;
                write!(f, " {} ", infix.text())?;
                right.print(infix.binding() + 1, f)
            }
            Kind::Call(function, arguments) => {
                write!(f, "{}(", function.text())?;
                for (index, argument) in arguments.iter().enumerate() {
                    if index > 0 {
                        f.write_str(", ")?;
                    }
                    argument.print(0, f)?;
                }
                f.write_str(")")
            }
        }
    }
}

/// Shortest digits that read back as the same number; with an exponent where plain digits would be many.
fn print_number(value: f64, f: &mut fmt::Formatter<'_>) -> fmt::Result {
    if value == 0.0 || (1e-6..=1e12).contains(&value) { write!(f, "{value}") } else { write!(f, "{value:e}") }
}

impl fmt::Display for Expr {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.root.print(0, f)
    }
}

impl Serialize for Expr {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for Expr {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Expr, D::Error> {
        Expr::parse(&String::deserialize(deserializer)?).map_err(D::Error::custom)
    }
}
