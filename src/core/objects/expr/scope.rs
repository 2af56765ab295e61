//! The names that an expression may read in one place, with types and positions.

use std::collections::BTreeMap;

use crate::objects::value_type::ValueType;

/// Names in the order in which their values are passed to `Compiled`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Scope {
    names: BTreeMap<String, (ValueType, usize)>,
}

impl Scope {
    /// A scope of these names; the values are given in this order.
    pub fn new<S: Into<String>>(names: impl IntoIterator<Item = (S, ValueType)>) -> Scope {
        let mut scope = Scope::default();
        for (name, value) in names {
            scope.add(name, value);
        }
        scope
    }

    /// Index of the name; a name that is already there keeps its first type and index.
    pub fn add(&mut self, name: impl Into<String>, value: ValueType) -> usize {
        let next = self.names.len();
        self.names.entry(name.into()).or_insert((value, next)).1
    }

    /// Returns type and position of a name; `None` for a name that is not in scope.
    pub fn get(&self, name: &str) -> Option<(ValueType, usize)> {
        self.names.get(name).copied()
    }

    /// Returns the names in alphabetical order.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.names.keys().map(String::as_str)
    }

    /// Returns the number of values that an expression of this scope is given.
    pub fn len(&self) -> usize {
        self.names.len()
    }

    /// Returns `true` if no name is in scope.
    pub fn is_empty(&self) -> bool {
        self.names.is_empty()
    }
}
