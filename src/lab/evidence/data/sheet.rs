//! A table with what its columns mean.

use crate::kernel::Digest;

/// Type of a column's values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// UTF-8.
    Text,
    /// 64-bit float.
    Number,
    /// 64-bit integer.
    Whole,
    /// True or false.
    Flag,
}

impl Kind {
    pub fn name(self) -> &'static str {
        match self {
            Kind::Text => "text",
            Kind::Number => "number",
            Kind::Whole => "integer",
            Kind::Flag => "boolean",
        }
    }
}

/// A value of a table.
#[derive(Clone, Debug, PartialEq)]
pub enum Cell {
    /// There is none.
    Nothing,
    /// A text.
    Text(String),
    /// A number.
    Number(f64),
    /// A whole number.
    Whole(i64),
    /// A yes or no.
    Flag(bool),
}

/// A column as the dictionary has it.
#[derive(Clone, Debug, PartialEq)]
pub struct Heading {
    /// Name in the header; a unit stands last.
    pub name: String,
    /// Type of its values.
    pub kind: Kind,
    /// Unit of a number; empty for none.
    pub unit: &'static str,
    /// Meaning of its values.
    pub meaning: String,
}

/// One table. Rows have a cell a heading.
#[derive(Clone, Debug, PartialEq)]
pub struct Sheet {
    /// Name of its files.
    pub name: &'static str,
    /// Meaning of a row.
    pub row: &'static str,
    /// Its columns.
    pub headings: Vec<Heading>,
    /// `[rows][headings]`
    pub rows: Vec<Vec<Cell>>,
}

/// Function from what a row is about to one of its cells.
type Read<'c, R> = Box<dyn Fn(&R) -> Cell + 'c>;

/// Columns being written: how a row's cells come from what the row is about.
pub struct Columns<'c, R> {
    headings: Vec<Heading>,
    cells: Vec<Read<'c, R>>,
}

impl<'c, R> Columns<'c, R> {
    pub fn new() -> Columns<'c, R> {
        Columns { headings: Vec::new(), cells: Vec::new() }
    }

    fn with<C: Into<Cell>>(mut self, heading: Heading, cell: impl Fn(&R) -> C + 'c) -> Columns<'c, R> {
        self.headings.push(heading);
        self.cells.push(Box::new(move |row| cell(row).into()));
        self
    }

    fn plain<C: Into<Cell>>(
        self,
        kind: Kind,
        name: &str,
        meaning: &str,
        cell: impl Fn(&R) -> C + 'c,
    ) -> Columns<'c, R> {
        self.with(Heading { name: name.into(), kind, unit: "", meaning: meaning.into() }, cell)
    }

    pub fn text<C: Into<Cell>>(self, name: &str, meaning: &str, cell: impl Fn(&R) -> C + 'c) -> Columns<'c, R> {
        self.plain(Kind::Text, name, meaning, cell)
    }

    pub fn whole<C: Into<Cell>>(self, name: &str, meaning: &str, cell: impl Fn(&R) -> C + 'c) -> Columns<'c, R> {
        self.plain(Kind::Whole, name, meaning, cell)
    }

    pub fn flag<C: Into<Cell>>(self, name: &str, meaning: &str, cell: impl Fn(&R) -> C + 'c) -> Columns<'c, R> {
        self.plain(Kind::Flag, name, meaning, cell)
    }

    pub fn number<C: Into<Cell>>(
        self,
        name: &str,
        unit: &'static str,
        meaning: &str,
        cell: impl Fn(&R) -> C + 'c,
    ) -> Columns<'c, R> {
        self.with(Heading { name: name.into(), kind: Kind::Number, unit, meaning: meaning.into() }, cell)
    }

    pub fn laid_out(self, name: &'static str, row: &'static str, rows: &[R]) -> Sheet {
        let rows = rows.iter().map(|row| self.cells.iter().map(|cell| cell(row)).collect()).collect();
        Sheet { name, row, headings: self.headings, rows }
    }
}

impl From<&str> for Cell {
    fn from(value: &str) -> Cell {
        Cell::Text(value.into())
    }
}

impl From<String> for Cell {
    fn from(value: String) -> Cell {
        Cell::Text(value)
    }
}

impl From<f64> for Cell {
    fn from(value: f64) -> Cell {
        Cell::Number(value)
    }
}

impl From<bool> for Cell {
    fn from(value: bool) -> Cell {
        Cell::Flag(value)
    }
}

impl From<Digest> for Cell {
    fn from(value: Digest) -> Cell {
        Cell::Text(value.to_string())
    }
}

impl From<usize> for Cell {
    fn from(value: usize) -> Cell {
        i64::try_from(value).map_or(Cell::Nothing, Cell::Whole)
    }
}

impl From<u64> for Cell {
    fn from(value: u64) -> Cell {
        i64::try_from(value).map_or(Cell::Nothing, Cell::Whole)
    }
}

impl From<u32> for Cell {
    fn from(value: u32) -> Cell {
        Cell::Whole(i64::from(value))
    }
}

impl<C: Into<Cell>> From<Option<C>> for Cell {
    fn from(value: Option<C>) -> Cell {
        value.map_or(Cell::Nothing, Into::into)
    }
}

/// The word under which a value is written in events.
pub fn word(value: &impl serde::Serialize) -> Cell {
    match serde_json::to_value(value) {
        Ok(serde_json::Value::String(word)) => Cell::Text(word),
        _ => Cell::Nothing,
    }
}

/// Words side by side in one cell.
pub fn joined<T: ToString>(words: impl IntoIterator<Item = T>) -> String {
    words.into_iter().map(|word| word.to_string()).collect::<Vec<String>>().join(" ")
}
