//! Text to tokens, in one pass over the characters.

use super::{
    error::ExprError,
    parse::{NODES_MAX, TEXT_MAX_BYTES},
};
use crate::kernel::total::MAGNITUDE_MAX;

/// A name may be as long as this many characters.
const NAME_MAX: usize = 64;
/// Tokens of the largest legal expression, with a pair of parentheses and a comma for each node.
const TOKENS_MAX: usize = 4 * NODES_MAX;

#[derive(Clone, Debug, PartialEq)]
pub enum Token {
    Number(f64),
    Word(String),
    /// One of `+ - * / ( ) , < <= > >= == !=`.
    Sign(&'static str),
    End,
}

impl Token {
    pub fn describe(&self) -> String {
        match self {
            Token::Number(value) => format!("the number {value}"),
            Token::Word(word) => format!("`{word}`"),
            Token::Sign(sign) => format!("`{sign}`"),
            Token::End => "the end".into(),
        }
    }
}

const SIGNS: [&str; 13] = ["<=", ">=", "==", "!=", "+", "-", "*", "/", "(", ")", ",", "<", ">"];

/// Spellings of other languages, and the spelling of this one.
const FOREIGN: [(&str, &str); 9] = [
    ("&&", "`and`"),
    ("||", "`or`"),
    ("**", "a product such as `x * x`: there is no power"),
    ("^", "a product such as `x * x`: there is no power"),
    ("!", "`not`"),
    ("=", "`==`"),
    ("?", "`if(condition, a, b)`"),
    (".", "a plain name: there are no fields or methods"),
    ("%", "one of `+ - * /`: there is no remainder"),
];

/// Tokens with their columns; the last one is `End`.
pub fn tokens(text: &str) -> Result<Vec<(Token, usize)>, ExprError> {
    if text.len() > TEXT_MAX_BYTES {
        return Err(ExprError::new(1, format!("{} bytes", text.len()), format!("at most {TEXT_MAX_BYTES} bytes")));
    }
    let mut tokens = Vec::new();
    let mut rest = text;
    let mut column = 1;
    loop {
        let trimmed = rest.trim_start();
        column += rest.chars().count() - trimmed.chars().count();
        rest = trimmed;
        let Some(first) = rest.chars().next() else { break };
        let (token, length) = one(rest, first, column)?;
        tokens.push((token, column));
        if tokens.len() > TOKENS_MAX {
            return Err(ExprError::new(column, "more of it", format!("at most {TOKENS_MAX} words and signs")));
        }
        // Tokens are ASCII: bytes are characters.
        column += length;
        rest = rest.get(length..).unwrap_or_default();
    }
    tokens.push((Token::End, column));
    Ok(tokens)
}

fn one(rest: &str, first: char, column: usize) -> Result<(Token, usize), ExprError> {
    let begins_fraction = first == '.' && rest.as_bytes().get(1).is_some_and(u8::is_ascii_digit);
    if first.is_ascii_digit() || begins_fraction {
        return number(rest, column);
    }
    if first.is_ascii_alphabetic() || first == '_' {
        let length = rest.bytes().take_while(|b| b.is_ascii_alphanumeric() || *b == b'_').count();
        if length > NAME_MAX {
            let found = format!("a name of {length} characters");
            return Err(ExprError::new(column, found, format!("at most {NAME_MAX}")));
        }
        return Ok((Token::Word(rest.chars().take(length).collect()), length));
    }
    if let Some((foreign, instead)) =
        FOREIGN.iter().find(|(foreign, _)| rest.starts_with(foreign) && !SIGNS[..4].iter().any(|s| rest.starts_with(s)))
    {
        return Err(ExprError::new(column, format!("`{foreign}`"), *instead));
    }
    if let Some(sign) = SIGNS.iter().find(|sign| rest.starts_with(*sign)) {
        return Ok((Token::Sign(sign), sign.len()));
    }
    Err(ExprError::new(column, format!("`{}`", first.escape_debug()), "a number, a name, an operator or a parenthesis"))
}

/// `12`, `1.5`, `.5`, `2e-3`.
fn number(rest: &str, column: usize) -> Result<(Token, usize), ExprError> {
    let bytes = rest.as_bytes();
    let digits = |from: usize| bytes.iter().skip(from).take_while(|b| b.is_ascii_digit()).count();
    let mut length = digits(0);
    if bytes.get(length) == Some(&b'.') {
        length += 1 + digits(length + 1);
    }
    if matches!(bytes.get(length), Some(b'e' | b'E')) {
        let sign = usize::from(matches!(bytes.get(length + 1), Some(b'+' | b'-')));
        let exponent = digits(length + 1 + sign);
        if exponent > 0 {
            length += 1 + sign + exponent;
        }
    }
    let text = rest.get(..length).unwrap_or_default();
    if bytes.get(length).is_some_and(|b| b.is_ascii_alphanumeric() || *b == b'_' || *b == b'.') {
        return Err(ExprError::new(
            column,
            format!("`{text}` run into what follows"),
            "a number such as 2, 0.5 or 1e-3",
        ));
    }
    match text.parse::<f64>() {
        Ok(value) if value <= MAGNITUDE_MAX => Ok((Token::Number(value), length)),
        _ => Err(ExprError::new(column, "a number out of range", format!("at most {MAGNITUDE_MAX:e}"))),
    }
}
