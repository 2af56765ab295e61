//! Names that people call lineages by.

use super::paper::safebench::METHODS;
use super::{archives, labels};
use crate::evidence::recorded_run::RecordedRun;
use crate::objects::LineageId;

/// A lineage as a figure calls it: its method against its ego, and which repetition it is where there are several. By its id while the run
/// is unfinished.
pub fn called(recorded: &RecordedRun, lineage: &LineageId) -> String {
    let Some(result) = recorded.result_of(lineage) else { return lineage.to_string() };
    let method = if recorded.rounds.is_empty() {
        labels::method_label(recorded, result)
    } else {
        spelled_out(archives::method_label(recorded, result), result.family.as_str())
    };
    let repeats = recorded.result.iter().flat_map(|all| &all.lineages).filter(|of| of.group == result.group).count();
    let which = if repeats > 1 { format!(", search {} of {repeats}", result.replica + 1) } else { String::new() };
    format!("{method} against {}{which}", labels::policy(recorded, &result.ego))
}

/// A label of SafeBench's tables with its method's whole name in place of two letters.
fn spelled_out(label: String, family: &str) -> String {
    let method = METHODS.iter().find(|method| method.family == family);
    match method.and_then(|method| Some((method.title, label.strip_prefix(method.name)?))) {
        Some((title, rest)) => format!("{title}{rest}"),
        None => label,
    }
}
