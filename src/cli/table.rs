//! `table`: the paper's tables from recorded runs.

use clap::{Args, ValueEnum};
use std::path::PathBuf;

use super::answer::Answer;
use super::exit::Failure;
use super::folder::RunFolder;
use crate::evidence::tables::{self, Table, TableError};
use crate::evidence::{RecordedRun, cell};

#[derive(Debug, Args)]
pub struct Options {
    /// Which of the paper's tables.
    pub table: Which,
    /// Run folder; may be given again, one row is never taken from two. Without it the latest one below runs/.
    #[arg(long)]
    pub run: Vec<PathBuf>,
    /// How to write it.
    #[arg(long, default_value = "markdown")]
    pub format: Format,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum Which {
    /// MetaDrive, a row a generator family, averaged over the egos.
    MetadriveMain,
    /// MetaDrive, a row a generator and ego, with the endpoint of the local trace.
    MetadrivePolicy,
    /// MetaDrive, contacts by class and the readings of published work, a row a program and ego.
    MetadriveContacts,
    /// SafeBench, a row a generator: the parent's scenes against those after the last round.
    SafebenchMain,
    /// SafeBench, every round by traffic family, a part a generator.
    SafebenchRounds,
    /// SafeBench, the chosen programs on routes that evolution did not see, a row a generator and ego.
    SafebenchHeldOut,
    /// Either protocol: what became of proposals, a row a source family.
    Proposals,
    /// Either protocol: what critics did with proposals before simulation, a row a source family.
    ActorCritic,
    /// MetaDrive, search methods at the same rollouts; the first run is what the others are compared with.
    AttackOnly,
    /// MetaDrive, the system without one part at a time; the whole first.
    Without,
    /// MetaDrive, how many proposals an epoch has, a row a run and family.
    Kwidth,
}

impl Which {
    /// All of them.
    pub fn all() -> &'static [Which] {
        Which::value_variants()
    }

    /// The table of that name; the error lists the names.
    pub fn named(name: &str) -> Result<Which, String> {
        let spelled = |which: &Which| which.to_possible_value().map(|value| value.get_name().to_string());
        let known: Vec<String> = Which::all().iter().filter_map(spelled).collect();
        let found = Which::all().iter().zip(&known).find(|(_, known)| *known == name).map(|(which, _)| *which);
        found.ok_or_else(|| format!("no table `{name}`{}; there are {}", cell::near(name, &known), known.join(", ")))
    }

    /// The table of these runs.
    pub fn of(self, stories: &[RecordedRun]) -> Result<Table, TableError> {
        let (_, make) = tables::NAMED[self as usize];
        make(stories)
    }
}

#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum Format {
    Markdown,
    /// Unrounded numbers, the paper's in columns of their own.
    Csv,
    /// With booktabs.
    Latex,
}

pub fn run(options: &Options) -> Result<Answer, Failure> {
    let named: Vec<Option<&PathBuf>> =
        if options.run.is_empty() { vec![None] } else { options.run.iter().map(Some).collect() };
    let story = |dir: Option<&PathBuf>| RunFolder::find(dir.map(PathBuf::as_path))?.story();
    let stories = named.into_iter().map(story).collect::<Result<Vec<_>, _>>()?;
    let table = options.table.of(&stories).map_err(Failure::bad_input)?;
    let text = match options.format {
        Format::Markdown => tables::markdown(&table),
        Format::Csv => tables::csv(&table),
        Format::Latex => tables::latex(&table),
    };
    Ok(Answer::new(text, table.json()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_means_the_table_of_that_name() {
        for (place, (name, _)) in tables::NAMED.iter().enumerate() {
            assert_eq!(Which::named(name).unwrap() as usize, place, "{name}");
        }
        assert_eq!(Which::all().len(), tables::NAMED.len());
    }
}
