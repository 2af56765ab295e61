//! `table`: the paper's tables from recorded runs.

use clap::{Args, ValueEnum};

use crate::cli::look::{faults, redraws, table_options};
use crate::cli::records::{folder::RunFolder, run_name::Runs};
use crate::cli::terminal::{answer::Answer, answer::progress, exit::Failure, width::stdout_width};
use crate::evidence::RecordedRun;
use crate::evidence::cell;
use crate::evidence::tables::{self, LatexForm, Table, TableError};

#[derive(Debug, Args)]
pub struct Options {
    /// Which of the paper's tables.
    pub table: Which,
    #[command(flatten)]
    pub runs: Runs,
    /// How to write it; without it aligned columns on a terminal, and Markdown in a pipe or a file.
    #[arg(long)]
    pub format: Option<Format>,
    /// Which columns of numbers, by their names in CSV, with commas; or `all`, in LaTeX as a long table. Without it all, and
    /// in LaTeX those that fit a page: at most eight, and none in which every row says the same.
    #[arg(long, value_delimiter = ',', value_name = "COLUMNS")]
    pub columns: Vec<String>,
    /// Which rows, by their first label or all labels with `/` between (`CAT`, `CAT/IDM`), with commas, in this order.
    #[arg(long, value_delimiter = ',', value_name = "ROWS")]
    pub rows: Vec<String>,
    /// In `metadrive-readings` also for whose contacts the ego is at fault by nuPlan's rule: held-out contacts are played again, and the search stays
    /// what it was.
    #[arg(long)]
    pub at_fault: bool,
    /// In LaTeX also the paper's numbers, in a row below ours; the other formats have them always.
    #[arg(long)]
    pub paper_rows: bool,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum Which {
    /// MetaDrive: one row per generator family, averaged over the egos.
    MetadriveMain,
    /// MetaDrive: one row per generator and ego, with the endpoint of the local trace.
    MetadrivePolicy,
    /// MetaDrive: contacts by class, and attack as published work counts it; one row per program and ego.
    MetadriveContacts,
    /// MetaDrive: attack by three readings: as searched, as published work counts, and what could have been prevented.
    MetadriveReadings,
    /// MetaDrive: gains at floors of realism, in absolute areas, and over null searches; name the search first.
    MetadriveGains,
    /// SafeBench: one row per generator, its parent drawn as often against what the search keeps.
    SafebenchMain,
    /// SafeBench: every round by traffic family, one part per generator.
    SafebenchRounds,
    /// SafeBench: the chosen programs on routes that evolution did not see, one row per generator and ego.
    SafebenchHeldOut,
    /// Either protocol: what became of the proposals, one row per source family.
    Proposals,
    /// Either protocol: what the critics did with proposals before simulation, one row per source family.
    ActorCritic,
    /// MetaDrive: search methods with the same number of rollouts; the others are compared with the first run.
    AttackOnly,
    /// MetaDrive: the system without one of its parts at a time; name the run of the whole system first.
    Without,
    /// MetaDrive: the effect of the number of proposals per epoch, one row per run and family.
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
        let table = Which::all().iter().zip(&known).find(|(_, known)| *known == name).map(|(which, _)| *which);
        table.ok_or_else(|| format!("no table `{name}`{}; there are {}", cell::near(name, &known), known.join(", ")))
    }

    /// Returns `true` if its numbers are compared with parents that are drawn anew.
    pub fn needs_redraws(self) -> bool {
        matches!(self, Which::SafebenchMain | Which::SafebenchRounds)
    }

    /// A finished run of a folder, with what the table needs besides its events.
    pub fn recorded(self, folder: &RunFolder, jobs: usize) -> Result<RecordedRun, Failure> {
        if self.needs_redraws() { redraws::recorded(folder, jobs) } else { folder.recorded() }
    }

    /// The table of these runs.
    pub fn of(self, runs: &[RecordedRun]) -> Result<Table, TableError> {
        let (_, make) = tables::NAMED[self as usize];
        make(runs)
    }
}

#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum Format {
    Markdown,
    /// Unrounded numbers; the paper's numbers have columns of their own.
    Csv,
    /// With booktabs.
    Latex,
}

impl Format {
    /// A table written so; in LaTeX with the columns that it has.
    pub fn text(self, table: &Table) -> String {
        match self {
            Format::Markdown => tables::markdown(table),
            Format::Csv => tables::csv(table),
            Format::Latex => tables::latex(table, LatexForm::default()),
        }
    }
}

pub fn run(options: &Options, jobs: usize) -> Result<Answer, Failure> {
    let folders = options.runs.folders()?;
    let of_folder = |folder: &RunFolder| {
        if options.at_fault { faults::recorded(folder, jobs) } else { options.table.recorded(folder, jobs) }
    };
    let runs = folders.iter().map(of_folder).collect::<Result<Vec<_>, _>>()?;
    let table = options.table.of(&runs).map_err(Failure::bad_input)?;
    let table = table_options::rows("--rows", &options.rows, table)?;
    let table = match (options.columns.as_slice(), options.format) {
        ([], Some(Format::Latex)) => of_a_page(&table),
        (columns, _) => table_options::columns("--columns", columns, table)?,
    };
    let object = table.json();
    Ok(match (options.format, stdout_width()) {
        (None, Some(width)) => Answer::new(tables::plain(&table, width), object),
        (Some(Format::Latex), _) => {
            let form = LatexForm { whole: options.columns == ["all"], paper: options.paper_rows };
            Answer::exact(tables::latex(&table, form), object)
        }
        (format, _) => Answer::exact(format.unwrap_or(Format::Markdown).text(&table), object),
    })
}

/// The table with what fits a page; says what was left out.
fn of_a_page(table: &Table) -> Table {
    let page = tables::of_a_page(table);
    let (shown, all) = (page.keys().len(), table.keys().len());
    if shown < all {
        progress(format!(
            "{shown} of {all} columns of numbers, so that the table fits a page; --columns all prints every one"
        ));
    }
    page
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
