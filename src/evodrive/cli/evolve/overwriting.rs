//! Decides what a recording may write over: a cassette holds answers that were paid for, and no other copy of them may exist.

use std::collections::BTreeSet;
use std::path::Path;

use crate::adapters::ADAPTER_VERSION;
use crate::cli::evolve::other_pool;
use crate::cli::records::folder::{Recording, RunFolder};
use crate::cli::terminal::{exit::Failure, typed::resume_into};
use crate::experiment::Experiment;
use crate::kernel::Digest;
use crate::llm::Cassette;
use crate::objects::world_audit::WORLD_LINE;
use crate::scene::Pool;

/// Advice of a message where a cassette would be lost.
const REMEDY: &str = "name another cassette (in the file, or by --cassette FILE), or add --overwrite to replace it";

/// What a recording finds: answers that need not be asked again, and the exchanges that its cassette must have afterwards.
pub struct Held<'a> {
    path: &'a Path,
    exchanges: BTreeSet<Digest>,
    pub cassette: Cassette,
}

impl<'a> Held<'a> {
    /// The answers that need not be asked again, and what of the cassette must not be lost. Refuses, before anybody is asked,
    /// a cassette whose answers this experiment cannot ask for.
    ///
    /// # Errors
    /// A cassette of other lineages, of another version or of other scenes; one that cannot be read and would be continued.
    pub fn before(recording: &'a Recording, experiment: &Experiment, scenes: &Pool) -> Result<Held<'a>, Failure> {
        let Recording { fresh, overwrite, .. } = *recording;
        let path = recording.cassette.as_path();
        let nothing = || Held { path, exchanges: BTreeSet::new(), cassette: Cassette::new(path.display().to_string()) };
        if !path.exists() || fresh && overwrite {
            return Ok(nothing());
        }
        let there = match Cassette::load(path) {
            Ok(there) => there,
            // A damaged file is asked anew.
            Err(_) if fresh => return Ok(nothing()),
            Err(error) => return Err(error.into()),
        };
        if overwrite {
            return Ok(Held { cassette: there, ..nothing() });
        }
        if let Some(found) = foreign(&there, experiment) {
            let place = path.display();
            return Err(Failure::bad_input(format!("{place} {found}: recording would write over it; {REMEDY}")));
        }
        if let Some(difference) = other_pool::difference(&there, scenes) {
            return Err(Failure::bad_input(format!("{difference}; --overwrite loses it")));
        }
        // Other answers lead to other questions, and a fresh recording asks for these.
        if fresh {
            return Ok(nothing());
        }
        let exchanges = there.exchanges().iter().map(|of| of.key).collect();
        Ok(Held { path, exchanges, cassette: there })
    }

    /// Refuses to lose answers that this recording did not ask for: they belong to another experiment or to other scenes.
    ///
    /// # Errors
    /// The number of them, where this recording's answers are kept, and the command that writes them elsewhere.
    pub fn lost(&self, after: &Cassette, folder: &RunFolder) -> Result<(), Failure> {
        let asked: BTreeSet<Digest> = after.exchanges().iter().map(|of| of.key).collect();
        let lost = self.exchanges.difference(&asked).count();
        if lost == 0 {
            return Ok(());
        }
        Err(Failure::bad_input(format!(
            "{} holds {} answers, {lost} of which this recording did not ask for: they belong to another experiment, another setting of \
             it or other scenes. It stays as it was, and this recording's answers are in {}\n  to keep both, in a cassette of its own: \
             {}\n  or add --overwrite to the command that recorded, which replaces the cassette; nothing is asked twice",
            self.path.display(),
            self.exchanges.len(),
            folder.cassette().display(),
            resume_into(&folder.dir, &folder.cassette_beside())
        )))
    }
}

/// Returns what shows that a cassette belongs to another experiment or another version, if anything does.
fn foreign(there: &Cassette, experiment: &Experiment) -> Option<String> {
    let mut exchanges = there.exchanges().iter();
    if let Some(other) = exchanges.clone().find(|of| of.adapter_version != ADAPTER_VERSION) {
        let version = other.adapter_version;
        return Some(format!("was recorded under adapter version {version}, and this program has {ADAPTER_VERSION}"));
    }
    let own = |lineage: &str| {
        let is = |id: &str| lineage.strip_prefix(id).is_some_and(|rest| rest.is_empty() || rest.starts_with("-s"));
        lineage == WORLD_LINE || experiment.lineages.iter().any(|of| is(of.id.as_str()))
    };
    let other = exchanges.find(|of| !own(&of.slot.lineage))?;
    Some(format!("holds answers for the lineage {}, which {} does not have", other.slot.lineage, experiment.name))
}
