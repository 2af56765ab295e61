//! A file's table against the list of keys: nothing unknown, nothing missing, every value in its range.

use toml::{Table, Value};

use super::OptionError;
use super::key::{Key, Need, shown};
use super::keys::keys;

/// One step from a table or list into it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Step {
    Key(String),
    Index(usize),
}

/// One step of a key's place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    Name(&'static str),
    EachKey,
    EachIndex,
}

impl Part {
    fn takes(self, step: &Step) -> bool {
        match (self, step) {
            (Part::Name(name), Step::Key(key)) => name == key,
            (Part::EachKey, Step::Key(_)) | (Part::EachIndex, Step::Index(_)) => true,
            _ => false,
        }
    }
}

/// `lineage[].id` -> lineage, each entry, id.
pub fn parts(place: &'static str) -> Vec<Part> {
    let mut parts = Vec::new();
    for word in place.split('.') {
        match (word, word.strip_suffix("[]")) {
            ("*", _) => parts.push(Part::EachKey),
            (_, Some(list)) => parts.extend([Part::Name(list), Part::EachIndex]),
            (name, None) => parts.push(Part::Name(name)),
        }
    }
    parts
}

/// A path as messages write it: `lineage[0].family`.
fn text(path: &[Step]) -> String {
    let mut text = String::new();
    for step in path {
        match step {
            Step::Key(key) if text.is_empty() => text.push_str(key),
            Step::Key(key) => text.extend([".", key]),
            Step::Index(i) => text.push_str(&format!("[{i}]")),
        }
    }
    text
}

fn at<'t>(root: &'t Value, path: &[Step]) -> Option<&'t Value> {
    path.iter().try_fold(root, |value, step| match step {
        Step::Key(key) => value.get(key),
        Step::Index(i) => value.get(*i),
    })
}

/// The paths in `root` that a place stands for, with the lists and names that are there.
fn expanded(root: &Value, parts: &[Part]) -> Vec<Vec<Step>> {
    let mut paths: Vec<Vec<Step>> = vec![Vec::new()];
    for part in parts {
        let next = |path: &Vec<Step>| -> Vec<Step> {
            match (part, at(root, path)) {
                (Part::Name(name), _) => vec![Step::Key(name.to_string())],
                (Part::EachKey, Some(Value::Table(table))) => table.keys().cloned().map(Step::Key).collect(),
                (Part::EachIndex, Some(Value::Array(items))) => (0..items.len()).map(Step::Index).collect(),
                _ => Vec::new(),
            }
        };
        let longer = |path: Vec<Step>| {
            next(&path).into_iter().map(move |step| path.iter().cloned().chain([step]).collect::<Vec<Step>>())
        };
        paths = paths.into_iter().flat_map(longer).collect();
    }
    paths
}

/// Checks the whole table.
///
/// # Errors
/// The first key that is unknown, out of its range, unwanted or missing.
pub fn check(table: &Table) -> Result<(), OptionError> {
    let root = Value::Table(table.clone());
    let checker = Checker { root: &root, keys: keys().into_iter().map(|key| (parts(key.key), key)).collect() };
    let in_range = |key: &Key, path: &[Step], value: &Value| key.range.check(&text(path), value);
    checker.visit(&mut Vec::new(), &root, &in_range)?;
    checker.visit(&mut Vec::new(), &root, &|key, path, value| checker.wanted(key, path, value))?;
    checker.missing()?;
    one_form(&root)
}

/// `split.evolution` is written in one of its two forms.
fn one_form(root: &Value) -> Result<(), OptionError> {
    let evolution = root.get("split").and_then(|split| split.get("evolution"));
    let scenes = match evolution {
        Some(Value::Table(forms)) if forms.len() == 1 => return Ok(()),
        Some(value) => shown(value),
        None => "missing".to_string(),
    };
    Err(OptionError::new("split.evolution", scenes, "`{ count = 240 }` or `{ share = 1.0 }`, one of the two"))
}

/// The values of one key in a table, in the order of the file.
pub fn values(table: &Table, key: &Key) -> Vec<Value> {
    let root = Value::Table(table.clone());
    expanded(&root, &parts(key.key)).iter().filter_map(|path| at(&root, path).cloned()).collect()
}

/// Returns `true` if a table holds a value at a path that a message names.
pub fn holds(table: &Table, path: &str) -> bool {
    let root = Value::Table(table.clone());
    let mut steps = Vec::new();
    for word in path.split('.') {
        let mut pieces = word.split('[');
        steps.extend(pieces.next().map(|name| Step::Key(name.to_string())));
        steps.extend(pieces.filter_map(|piece| piece.trim_end_matches(']').parse().ok().map(Step::Index)));
    }
    at(&root, &steps).is_some()
}

/// Check of a key, its path and its value.
type Judge<'j> = dyn Fn(&Key, &[Step], &Value) -> Result<(), OptionError> + 'j;

struct Checker<'t> {
    root: &'t Value,
    keys: Vec<(Vec<Part>, Key)>,
}

impl Checker<'_> {
    /// Judges the value of every key below a path.
    fn visit(&self, path: &mut Vec<Step>, value: &Value, judge: &Judge<'_>) -> Result<(), OptionError> {
        let begins = |parts: &[Part]| parts.len() >= path.len() && parts.iter().zip(&*path).all(|(p, s)| p.takes(s));
        let below: Vec<&(Vec<Part>, Key)> = self.keys.iter().filter(|(parts, _)| begins(parts)).collect();
        if let Some((_, key)) = below.iter().find(|(parts, _)| parts.len() == path.len()) {
            return judge(key, path, value);
        }
        let next = below.first().and_then(|(parts, _)| parts.get(path.len()));
        match (value, next) {
            (_, None) => Err(self.unknown(path)),
            (Value::Array(items), Some(Part::EachIndex)) => {
                items.iter().enumerate().try_for_each(|(i, item)| self.step(path, Step::Index(i), item, judge))
            }
            (_, Some(Part::EachIndex)) => Err(OptionError::new(text(path), shown(value), "a list of tables")),
            (Value::Table(table), _) => {
                table.iter().try_for_each(|(name, item)| self.step(path, Step::Key(name.clone()), item, judge))
            }
            (_, Some(_)) => Err(OptionError::new(text(path), shown(value), "a table")),
        }
    }

    fn step(&self, path: &mut Vec<Step>, step: Step, value: &Value, judge: &Judge<'_>) -> Result<(), OptionError> {
        path.push(step);
        self.visit(path, value, judge)?;
        path.pop();
        Ok(())
    }

    /// No key stands here; the keys beside it do.
    fn unknown(&self, path: &[Step]) -> OptionError {
        let Some((Step::Key(name), parent)) = path.split_last() else {
            return OptionError::new(text(path), "unknown", "no list here");
        };
        let mut known: Vec<String> = Vec::new();
        for (parts, _) in &self.keys {
            let beside = parts.len() > parent.len() && parts.iter().zip(parent).all(|(p, s)| p.takes(s));
            match parts.get(parent.len()) {
                Some(Part::Name(name)) if beside && !known.iter().any(|k| k == name) => known.push(name.to_string()),
                _ => {}
            }
        }
        OptionError::unknown(text(path), name, &known)
    }

    /// The value on which a need rests, for a key at this path.
    fn base(&self, place: &'static str, path: &[Step]) -> Option<&Value> {
        let steps = parts(place).into_iter().zip(0..).map(|(part, i)| match part {
            Part::Name(name) => Some(Step::Key(name.to_string())),
            Part::EachKey | Part::EachIndex => path.get(i).cloned(),
        });
        at(self.root, &steps.collect::<Option<Vec<Step>>>()?)
    }

    /// Refuses a value that nothing would read.
    fn wanted(&self, key: &Key, path: &[Step], value: &Value) -> Result<(), OptionError> {
        let why = match key.need {
            Need::Without(place) if self.base(place, path).is_some() => {
                format!("nothing: it has no effect beside [{place}]; remove one of the two")
            }
            Need::Of(place, values) => match self.base(place, path) {
                Some(Value::String(word)) if !values.contains(&word.as_str()) => {
                    format!("nothing: it is only used with {place} = {}, and {place} is {word:?}", values.join(" or "))
                }
                _ => return Ok(()),
            },
            _ => return Ok(()),
        };
        Err(OptionError::new(text(path), shown(value), why))
    }

    fn missing(&self) -> Result<(), OptionError> {
        for (parts, key) in &self.keys {
            for path in expanded(self.root, parts) {
                let needed = match key.need {
                    Need::Always => true,
                    Need::Optional => false,
                    Need::With(place) => self.base(place, &path).is_some(),
                    Need::Without(place) => self.base(place, &path).is_none(),
                    Need::Of(place, values) => {
                        self.base(place, &path).and_then(Value::as_str).is_some_and(|word| values.contains(&word))
                    }
                };
                if needed && at(self.root, &path).is_none() {
                    return Err(OptionError::new(text(&path), "missing", key.range.to_string()));
                }
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
