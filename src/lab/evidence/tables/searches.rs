//! Searches and their repetitions: the groups in which either protocol's tables gather lineages.

use super::error::TableError;

/// One repetition of a search, as a table reads it.
pub struct Repetition<'a> {
    /// The search's method or lineage.
    pub name: &'a str,
    /// The same as tables call it.
    pub label: &'a str,
    pub ego: &'a str,
    /// The ego as tables call it.
    pub policy: &'a str,
    pub replica: u32,
    pub lineage: &'a str,
    /// Name of its run.
    pub run: &'a str,
    /// Reason why there is no gain, where there is none.
    pub stopped: Option<&'a str>,
}

/// Facts about one lineage beside its numbers.
pub trait Repeated {
    fn repetition(&self) -> Repetition<'_>;
}

impl<T: Repeated> Repeated for &T {
    fn repetition(&self) -> Repetition<'_> {
        (*self).repetition()
    }
}

fn same_search(one: &Repetition<'_>, other: &Repetition<'_>) -> bool {
    (one.name, one.policy) == (other.name, other.policy)
}

/// The repetitions of every search, in the order of their first.
pub fn searches<'a, T: Repeated>(all: impl Iterator<Item = &'a T>) -> Vec<Vec<&'a T>> {
    let mut groups: Vec<Vec<&T>> = Vec::new();
    for lineage in all {
        match groups.iter_mut().find(|of| same_search(&of[0].repetition(), &lineage.repetition())) {
            Some(of) => of.push(lineage),
            None => groups.push(vec![lineage]),
        }
    }
    groups
}

/// Adds a lineage, unless the same repetition of its search is there already: no row comes from two of them.
pub fn add<T: Repeated>(all: &mut Vec<T>, new: T) -> Result<(), TableError> {
    let of = new.repetition();
    let known = |old: &&T| same_search(&old.repetition(), &of) && old.repetition().replica == of.replica;
    if let Some(old) = all.iter().find(known) {
        let place = |of: &Repetition<'_>| format!("{} of run {}", of.lineage, of.run);
        let (first, second) = (place(&old.repetition()), place(&of));
        return Err(TableError::Twice { row: of.name.to_string(), ego: of.ego.to_string(), first, second });
    }
    all.push(new);
    Ok(())
}

/// Says what stopped the repetitions of a search that show no gain: for one, its own words; for several, how many and which.
pub fn stops<T: Repeated>(of: &[&T]) -> Option<String> {
    let all: Vec<Repetition<'_>> = of.iter().map(|lineage| lineage.repetition()).collect();
    let stopped: Vec<&Repetition<'_>> = all.iter().filter(|repetition| repetition.stopped.is_some()).collect();
    let first = stopped.first()?;
    let what = match all.len() {
        1 => first.stopped?.to_string(),
        seeds => {
            let which: Vec<String> = stopped.iter().map(|repetition| repetition.replica.to_string()).collect();
            format!("no gain with {} of {seeds} seeds ({})", stopped.len(), which.join(", "))
        }
    };
    Some(format!("{}, {}: {what}.", first.label, first.policy))
}
