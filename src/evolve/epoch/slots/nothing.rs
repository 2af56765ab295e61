//! Why an edit did nothing, for detailed questions: what the edited modules came to on the probe scenes, who refers to an edited
//! parameter, and whether the ranking moved.

use std::collections::BTreeSet;

use crate::compiler::Prepared;
use crate::epoch::RunError;
use crate::epoch::labelling::labels::Labelling;
use crate::objects::{Program, ProgramPatch, Setting};

/// Most lines.
const LINES_MAX: usize = 8;

/// A line for each edited thing, then one on the choice. `places` are the probe scenes.
pub fn why(
    labelling: &Labelling<'_>,
    parent: &Program,
    child: &Program,
    patch: &ProgramPatch,
    places: &[usize],
) -> Result<Vec<String>, RunError> {
    let (study, spec) = (labelling.study, labelling.spec);
    let source = study.source(spec)?;
    let (Ok(own), Ok(before)) = (Prepared::new(child, source), Prepared::new(parent, source)) else {
        return Ok(Vec::new());
    };
    let (own, before) = (own.watching(), before.watching());
    let (mut compared, mut same_choice, mut scores): (usize, usize, Vec<[f64; 2]>) = (0, 0, Vec::new());
    for &place in places {
        let Ok(situation) = labelling.tools.situations.at(place, &spec.ego, &labelling.tools.backend) else { continue };
        let counsel = labelling.counsels.at(study, spec, place)?;
        let both = [&own, &before].map(|program| program.compile_counselled(&situation, study.seed, counsel));
        let [Ok(own), Ok(before)] = both else { continue };
        compared += 1;
        let chosen = |of: &crate::compiler::Compiled| {
            of.decision.actors.iter().map(|actor| (actor.track, actor.chosen)).collect::<Vec<_>>()
        };
        same_choice += usize::from(chosen(&own) == chosen(&before));
        scores.extend(
            own.decision.actors.iter().zip(&before.decision.actors).map(|(own, before)| [own.score, before.score]),
        );
    }
    let touched: BTreeSet<(&str, &str)> = patch.operations.iter().filter_map(|of| part_and_name(&of.path)).collect();
    let mut lines: Vec<String> = Vec::new();
    for (part, name) in touched {
        match part {
            "mechanism_modules" => lines.push(module(child, &own, name)),
            "parameters" => lines.push(parameter(child, name)),
            "operator_graph" => lines.extend(node(child, name)),
            _ => {}
        }
    }
    if !scores.is_empty() {
        let moved = scores.iter().filter(|[own, before]| own != before).count();
        lines.push(format!(
            "the choice is the same in {same_choice} of {compared} probe scenes; the score of what was chosen moved for {moved} of {} adversaries",
            scores.len()
        ));
    }
    lines.truncate(LINES_MAX);
    Ok(lines)
}

/// `/parameters/x/..` as its part and its name.
fn part_and_name(path: &str) -> Option<(&str, &str)> {
    let mut words = path.strip_prefix('/')?.split('/');
    Some((words.next()?, words.next()?))
}

/// Nodes and settings that refer to something.
fn references(program: &Program, holds: impl Fn(&Setting) -> bool) -> Vec<String> {
    let nodes = program.operator_graph.iter().flat_map(|(node, of)| of.settings.iter().map(move |one| (node, one)));
    nodes.filter(|(_, (_, value))| holds(value)).map(|(node, (setting, _))| format!("{node}.{setting}")).collect()
}

fn module(child: &Program, watched: &Prepared<'_>, name: &str) -> String {
    let Some(module) = child.mechanism_modules.get(name) else { return format!("module {name}: it is removed") };
    let by = references(child, |value| matches!(value, Setting::Mechanism(of) if of.mechanism == *name));
    if by.is_empty() {
        return format!("module {name}: no setting refers to it, so it is never asked");
    }
    let by = by.join(", ");
    if module.slot.starts_with("law_") {
        return format!("module {name} ({by}): a law is asked in the rollout alone, from its onset on");
    }
    let values = watched.watched(name);
    match (values.first(), values.get(values.len() / 2), values.last()) {
        (Some(least), Some(middle), Some(most)) => format!(
            "module {name} ({by}): asked {} times on the probe scenes, came to {least:.3} at least, {middle:.3} at the median, {most:.3} at most",
            values.len()
        ),
        _ => format!(
            "module {name} ({by}): never asked on the probe scenes; the node is on no way that was taken, or its rule does not hold"
        ),
    }
}

fn parameter(child: &Program, name: &str) -> String {
    let by = references(child, |value| matches!(value, Setting::Parameter(of) if of.parameter == *name));
    let read = child.mechanism_modules.iter().filter(|(_, module)| module.inputs.iter().any(|input| input == name));
    let by: Vec<String> = by.into_iter().chain(read.map(|(module, _)| format!("module {module}"))).collect();
    if by.is_empty() {
        format!("parameter {name}: no setting and no module reads it; a setting of that name holds something else")
    } else {
        format!("parameter {name}: read by {}, which changed nothing there", by.join(", "))
    }
}

/// Modules behind a node's settings, which hide its numbers.
fn node(child: &Program, name: &str) -> Option<String> {
    let node = child.operator_graph.get(name)?;
    let modules = node.settings.iter().filter_map(|(setting, value)| match value {
        Setting::Mechanism(of) => Some(format!("{setting} = {}", of.mechanism)),
        _ => None,
    });
    let modules: Vec<String> = modules.collect();
    let by = if modules.is_empty() { String::new() } else { format!("; decided by {}", modules.join(", ")) };
    Some(format!("node {name} ({}): on the probe scenes it passes on what the parent's does{by}", node.kind))
}
