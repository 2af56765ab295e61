//! An experiment file and the files that it is based on, merged into one table before anything is read from it.
//!
//! `base = "protocol.toml"` names a file whose keys hold wherever this one does not say otherwise; a base may have a base.
//! `base = "evodrive:metadrive"` names a protocol that the program carries. Tables merge key by key, lists are replaced.

use std::path::{Path, PathBuf};
use toml::{Table, Value};

use super::place::{Place, problem};
use super::toml_file;
use super::{
    ExperimentError, OptionError, calibration, check, ego_weights, family_name, own_driver, parent_program, set,
};

/// The key that says how a seed of the file was chosen.
const SEED_NOTE: &str = "seed_note";
/// The key that says what the file's experiment is.
const DESCRIBES: &str = "describes";
/// Files of one chain of bases.
const CHAIN_MAX: usize = 8;

/// A file's whole table, and where its parts come from.
#[derive(Clone, Debug)]
pub struct Composed {
    pub table: Table,
    /// The file as it was named.
    pub file: PathBuf,
    /// The file's own text.
    text: String,
    /// True if something was written into the table in place of the name of its file.
    inlined: bool,
    /// The file and its bases by name, each with its own table; the file first.
    layers: Vec<(String, Table)>,
}

/// Reads a file and its bases.
///
/// # Errors
/// A file that cannot be read or is no TOML; a base that is unknown; a circle.
pub fn composed(path: &Path) -> Result<Composed, ExperimentError> {
    composed_under(path, &[])
}

/// The same with values of the command line above the file's.
///
/// # Errors
/// Those of [`composed`], and a text that is not an assignment.
pub fn composed_under(path: &Path, assignments: &[String]) -> Result<Composed, ExperimentError> {
    let mut seen: Vec<String> = Vec::new();
    let mut layers: Vec<(String, Table)> = Vec::new();
    let (mut own_text, mut inlined) = (None, false);
    if !assignments.is_empty() {
        let mut above = set::table(assignments)
            .map_err(|error| ExperimentError::Option { file: path.display().to_string(), error })?;
        inline(&mut above, &Place::of(path))?;
        layers.push((set::SET.to_string(), above));
    }
    // Where the next file is, and how one comes from the first file's folder to that file's folder.
    let mut next = Some((Place::of(path), PathBuf::new()));
    while let Some((place, folder)) = next.take() {
        let name = place.name();
        if seen.contains(&name) || seen.len() == CHAIN_MAX {
            let chain = seen.join(" -> ");
            return Err(problem(
                path,
                format!(
                    "its bases form a circle or a chain of more than {CHAIN_MAX} files: {chain} -> {name}; remove one `base`"
                ),
            ));
        }
        let text = place.read()?;
        let mut table: Table = text.parse().map_err(|error: toml::de::Error| ExperimentError::File {
            file: name.clone(),
            problem: toml_file::said(&error, &text),
        })?;
        let base = table.remove("base");
        rebase(&mut table, &folder);
        inlined |= inline(&mut table, &place)?;
        if let Some(base) = base {
            let Value::String(base) = base else {
                let error =
                    OptionError::new("base", super::key::shown(&base), "the name of a file or of a shipped protocol");
                return Err(ExperimentError::Option { file: name, error });
            };
            next = Some((place.beside(&base, &name)?, folder.join(Path::new(&base).parent().unwrap_or(Path::new("")))));
        }
        own_text.get_or_insert(text);
        seen.push(name.clone());
        layers.push((name, table));
    }
    let mut table = Table::new();
    let mut below: Option<&String> = None;
    for (name, layer) in layers.iter().rev() {
        // A note on a seed speaks of its own file: a file above it is another experiment, and so is one with another seed.
        if name != set::SET || names_a_seed(layer) {
            table.remove(SEED_NOTE);
        }
        // So does what describes an experiment: a file that says nothing of its own is not what its base is.
        if let (true, Some(of_base), Some(base)) = (name != set::SET, table.get_mut(DESCRIBES), below) {
            let base = Path::new(base).file_name().map_or(base.clone(), |own| own.to_string_lossy().into_owned());
            *of_base = Value::String(format!("based on {base}"));
        }
        below = Some(name);
        merge(&mut table, layer);
    }
    Ok(Composed { table, file: path.to_path_buf(), text: own_text.unwrap_or_default(), inlined, layers })
}

/// Puts what a table names into the place of its name. Says whether it named something.
fn inline(table: &mut Table, place: &Place) -> Result<bool, ExperimentError> {
    family_name::spell(table);
    let mut inlined = calibration::inline(table, place)?;
    inlined |= parent_program::inline(table, place)?;
    inlined |= ego_weights::inline(table, place)?;
    inlined |= own_driver::inline(table, place)?;
    Ok(inlined)
}

impl Composed {
    /// How a seed of the file was chosen, where it says so.
    pub fn seed_note(&self) -> Option<&str> {
        self.table.get(SEED_NOTE)?.as_str()
    }

    /// The error with the file that holds the value.
    pub fn error(&self, error: OptionError) -> ExperimentError {
        let holder = self.layers.iter().find(|(_, table)| check::holds(table, &error.path));
        let file = holder.map_or_else(|| self.file.display().to_string(), |(name, _)| name.clone());
        ExperimentError::Option { file, error }
    }

    /// One file that means the same and needs no other: the file itself, or what it was merged to.
    pub fn whole_text(&self) -> Result<String, ExperimentError> {
        if self.layers.len() < 2 && !self.inlined {
            return Ok(self.text.clone());
        }
        // A run folder is handed on: it names no folder of this machine.
        let own = |name: &String| Path::new(name).file_name().map(|own| own.to_string_lossy().into_owned());
        let names: Vec<String> = self.layers.iter().filter_map(|(name, _)| own(name)).collect();
        let merged_from = names.join(", ").replace(['\n', '\r'], " ");
        let mut table = self.table.clone();
        own_driver::leave_place(&mut table);
        let merged = toml::to_string(&table).map_err(|error| problem(&self.file, error.to_string()))?;
        Ok(format!("# Merged from {merged_from}; the calibration is written out.\n{merged}"))
    }
}

/// Files that a base names lie relative to the base; the merged table names them relative to the first file.
fn rebase(table: &mut Table, folder: &Path) {
    let moved = |value: &mut Value| {
        if let Value::String(path) = value {
            *path = folder.join(&*path).to_string_lossy().into_owned();
        }
    };
    if folder.as_os_str().is_empty() {
        return;
    }
    table.get_mut("cassette").into_iter().for_each(moved);
    table.get_mut("driver").and_then(|driver| driver.get_mut("cassette")).into_iter().for_each(moved);
    let backend = table.get_mut("simulator").and_then(|simulator| simulator.get_mut("backend"));
    backend.and_then(|backend| backend.get_mut("cassette")).into_iter().for_each(moved);
    let Some(Value::Table(scenes)) = table.get_mut("scenes") else { return };
    scenes.get_mut("path").into_iter().for_each(moved);
    if let Some(Value::Array(paths)) = scenes.get_mut("paths") {
        paths.iter_mut().for_each(moved);
    }
}

/// Returns `true` if a seed is written anywhere in this table.
fn names_a_seed(table: &Table) -> bool {
    table.iter().any(|(key, value)| match value {
        Value::Table(below) => names_a_seed(below),
        _ => key == "seed" || key == "seeds",
    })
}

/// Puts `over` above `base`: tables key by key, everything else as a whole. A table that names another `source` or `kind`
/// than its base means something else, so it replaces it; so does `evolution`, which is one of two forms.
fn merge(base: &mut Table, over: &Table) {
    for (key, value) in over {
        match (base.get_mut(key), value) {
            (Some(Value::Table(below)), Value::Table(above)) if merges(key, below, above) => merge(below, above),
            _ => drop(base.insert(key.clone(), value.clone())),
        }
    }
}

fn merges(key: &str, below: &Table, above: &Table) -> bool {
    let other = |tag: &str| above.get(tag).is_some_and(|value| below.get(tag).is_some_and(|known| known != value));
    key != "evolution" && !other("source") && !other("kind")
}
