//! Tokens to a tree, by binding strength. Size, depth and nesting are counted while reading, so a hostile text is
//! refused at the first token beyond a limit.

use super::{
    error::ExprError,
    lex::{Token, tokens},
    tree::{Column, FUNCTIONS, Function, Infix, Kind, Node, Prefix, binding},
};
use crate::text::nearest;

/// Longest text, in bytes.
pub const TEXT_MAX_BYTES: usize = 8192;
/// Most numbers, names, operators and calls. A contract may ask for fewer.
pub const NODES_MAX: usize = 256;
/// Most nodes from the root to a leaf; a chain such as `a + b + c` has one level per term.
pub const DEPTH_MAX: usize = 32;
/// Parentheses, calls and prefixes inside each other: each level of a printed tree needs at most two.
const NESTING_MAX: usize = 2 * DEPTH_MAX;

pub(super) fn parse(text: &str) -> Result<Node, ExprError> {
    let mut parser = Parser { tokens: tokens(text)?, next: 0, nodes: 0, nesting: 0 };
    let (node, _) = parser.expression(binding::OR)?;
    match parser.peek() {
        Token::End => Ok(node),
        Token::Sign(")") => Err(parser.error("an operator or the end: this parenthesis was never opened")),
        _ => Err(parser.error("an operator or the end")),
    }
}

struct Parser {
    tokens: Vec<(Token, usize)>,
    /// Index of the next token.
    next: usize,
    nodes: usize,
    nesting: usize,
}

/// A node and its depth.
type Built = (Node, usize);

impl Parser {
    fn peek(&self) -> &Token {
        self.tokens.get(self.next).map_or(&Token::End, |(token, _)| token)
    }

    fn column(&self) -> usize {
        self.tokens.get(self.next).or(self.tokens.last()).map_or(1, |(_, column)| *column)
    }

    fn error(&self, expected: impl Into<String>) -> ExprError {
        ExprError::new(self.column(), self.peek().describe(), expected)
    }

    fn build(&mut self, at: usize, kind: Kind, children_depth: usize) -> Result<Built, ExprError> {
        self.nodes += 1;
        if self.nodes > NODES_MAX {
            return Err(ExprError::new(at, "a larger expression", format!("at most {NODES_MAX} nodes")));
        }
        let depth = children_depth + 1;
        if depth > DEPTH_MAX {
            return Err(ExprError::new(at, "a deeper expression", format!("at most {DEPTH_MAX} levels")));
        }
        Ok((Node { at: Column(at), kind }, depth))
    }

    fn nested<T>(&mut self, read: impl FnOnce(&mut Parser) -> Result<T, ExprError>) -> Result<T, ExprError> {
        if self.nesting == NESTING_MAX {
            return Err(self.error(format!("at most {NESTING_MAX} parentheses or signs inside each other")));
        }
        self.nesting += 1;
        let result = read(self);
        self.nesting -= 1;
        result
    }

    /// Parses operators that bind at least as strongly as `least`.
    fn expression(&mut self, least: u8) -> Result<Built, ExprError> {
        let (mut left, mut depth) = self.prefix(least)?;
        let mut compared = false;
        while let Some(infix) = self.infix().filter(|infix| infix.binding() >= least) {
            if compared && infix.binding() == binding::COMPARE {
                return Err(self.error("`and`, `or` or the end: comparisons do not chain"));
            }
            compared |= infix.binding() == binding::COMPARE;
            let at = self.column();
            self.next += 1;
            let (right, right_depth) = self.expression(infix.binding() + 1)?;
            let kind = Kind::Infix(infix, Box::new(left), Box::new(right));
            (left, depth) = self.build(at, kind, depth.max(right_depth))?;
        }
        Ok((left, depth))
    }

    fn infix(&self) -> Option<Infix> {
        let text = match self.peek() {
            Token::Word(word) => word.as_str(),
            Token::Sign(sign) => sign,
            _ => return None,
        };
        Infix::ALL.into_iter().find(|infix| infix.text() == text)
    }

    fn prefix(&mut self, least: u8) -> Result<Built, ExprError> {
        let at = self.column();
        let (prefix, strength) = match self.peek() {
            Token::Sign("-") => (Prefix::Minus, binding::MINUS),
            Token::Word(word) if word == "not" && least <= binding::NOT => (Prefix::Not, binding::NOT),
            _ => return self.atom(),
        };
        self.next += 1;
        let (inner, depth) = self.nested(|parser| parser.expression(strength))?;
        self.build(at, Kind::Prefix(prefix, Box::new(inner)), depth)
    }

    fn atom(&mut self) -> Result<Built, ExprError> {
        let at = self.column();
        match self.peek().clone() {
            Token::Number(value) => {
                self.next += 1;
                self.build(at, Kind::Number(value), 0)
            }
            Token::Sign("(") => {
                self.next += 1;
                let inner = self.nested(|parser| parser.expression(binding::OR))?;
                self.expect(")", "an operator or `)`")?;
                Ok(inner)
            }
            Token::Word(word) => self.word(at, word),
            _ => Err(self.error("a number, a name or `(`")),
        }
    }

    fn word(&mut self, at: usize, word: String) -> Result<Built, ExprError> {
        match word.as_str() {
            "and" | "or" => return Err(self.error("a number, a name or `(`")),
            "not" => return Err(self.error("`(not ...)`: a negation inside an operation needs parentheses")),
            _ => {}
        }
        self.next += 1;
        if *self.peek() == Token::Sign("(") {
            return self.call(at, &word);
        }
        let kind = match word.as_str() {
            "true" => Kind::Boolean(true),
            "false" => Kind::Boolean(false),
            "if" => return Err(self.error("`(`: a choice is written if(condition, a, b)")),
            _ => Kind::Name(word),
        };
        self.build(at, kind, 0)
    }

    fn call(&mut self, at: usize, word: &str) -> Result<Built, ExprError> {
        let Some(function) = Function::ALL.into_iter().find(|function| function.text() == word) else {
            let hint = nearest(word, FUNCTIONS).map(|near| format!("; did you mean `{near}`?")).unwrap_or_default();
            let expected = format!("one of the functions {}{hint}", FUNCTIONS.join(" "));
            return Err(ExprError::new(at, format!("unknown function `{word}`"), expected));
        };
        self.next += 1;
        let (arguments, depth) = self.nested(Parser::arguments)?;
        let (fewest, most) = function.arity();
        if !(fewest..=most).contains(&arguments.len()) {
            let expected = if fewest == most { format!("{fewest}") } else { format!("{fewest} to {most}") };
            return Err(ExprError::new(at, format!("`{word}` with {} arguments", arguments.len()), expected));
        }
        self.build(at, Kind::Call(function, arguments), depth)
    }

    /// Parses from behind the opening parenthesis up to and including the closing one.
    fn arguments(&mut self) -> Result<(Vec<Node>, usize), ExprError> {
        let (mut arguments, mut depth) = (Vec::new(), 0);
        loop {
            let (argument, argument_depth) = self.expression(binding::OR)?;
            arguments.push(argument);
            depth = depth.max(argument_depth);
            if *self.peek() == Token::Sign(",") {
                self.next += 1;
                continue;
            }
            self.expect(")", "an operator, `,` or `)`")?;
            return Ok((arguments, depth));
        }
    }

    fn expect(&mut self, sign: &str, expected: &str) -> Result<(), ExprError> {
        if matches!(self.peek(), Token::Sign(found) if *found == sign) {
            self.next += 1;
            return Ok(());
        }
        Err(self.error(expected))
    }
}
