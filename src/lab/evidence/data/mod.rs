//! A recorded run as tables for other programs: attempts, labels, scenes without one, rollouts, reviews, exchanges and cost, each column with its unit and
//! meaning, as CSV and Parquet.

mod attempts;
mod exchanges;
mod labels;
mod rollouts;
mod sheet;
mod write;

pub use labels::records;
pub use rollouts::Rollout;
pub use sheet::Sheet;

use sheet::{Columns, Heading};

use super::recorded_run::RecordedRun;
use crate::kernel::Digest;
use crate::objects::cost::{LineageCost, RunCost};

/// All tables of a run, and last the dictionary of their columns. `rollouts` are those behind [`records`], as far as the store
/// still holds them.
pub fn sheets(run: &RecordedRun, rollouts: &[(Digest, Rollout)], cost: Option<&RunCost>) -> Vec<Sheet> {
    let mut all = vec![
        attempts::sheet(run),
        labels::sheet(run),
        labels::unlabelled(run),
        rollouts::sheet(rollouts),
        exchanges::reviews(run),
        exchanges::sheet(run),
    ];
    all.extend(cost.map(|cost| cost_of(&cost.lineages)));
    let dictionary = dictionary(&all);
    all.push(dictionary);
    all
}

fn dictionary(sheets: &[Sheet]) -> Sheet {
    let entries: Vec<(&Sheet, &Heading)> =
        sheets.iter().flat_map(|sheet| sheet.headings.iter().map(move |heading| (sheet, heading))).collect();
    let columns = Columns::<(&Sheet, &Heading)>::new()
        .text("table", "Name of the table.", |(sheet, _)| sheet.name)
        .text("row", "What a row of the table is.", |(sheet, _)| sheet.row)
        .text("column", "Name of the column.", |(_, heading)| heading.name.clone())
        .text("type", "text, number, integer or boolean; empty cells are missing values.", |(_, heading)| {
            heading.kind.name()
        })
        .text("unit", "Unit of a number.", |(_, heading)| heading.unit)
        .text("meaning", "What the column holds.", |(_, heading)| heading.meaning.clone());
    columns.laid_out("dictionary", "a column of a table", &entries)
}

fn cost_of(lineages: &[LineageCost]) -> Sheet {
    let columns = Columns::<LineageCost>::new()
        .text("lineage", "The lineage.", |of| of.lineage.to_string())
        .text("family", "Its source family.", |of| of.family.to_string())
        .text("ego", "Its ego.", |of| of.ego.clone())
        .number("wall_s", "s", "Time from one lineage's end to the next one's.", |of| of.work.wall_s)
        .whole("compiled", "Scenes for which a program was compiled.", |of| of.work.compiled)
        .number("compile_s", "s", "Compiling, summed over threads.", |of| of.work.compile_s)
        .whole("rollouts", "Rollouts simulated.", |of| of.work.rollouts)
        .number("rollout_s", "s", "Rollouts, summed over threads.", |of| of.work.rollout_s)
        .whole("answers", "Answers of models, those of a cassette too.", |of| of.work.answers)
        .number("model_s", "s", "Waiting for models.", |of| of.work.model_s)
        .whole("input_tokens", "Tokens of the questions, as providers counted them.", |of| of.work.input_tokens)
        .whole("output_tokens", "Tokens of the answers, as providers counted them.", |of| of.work.output_tokens);
    columns.laid_out("cost", "a lineage", lineages)
}
