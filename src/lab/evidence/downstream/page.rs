//! A study as one page: figure, tables, verdicts, and what it rests on. No script, nothing loaded from elsewhere.

use super::{figure, table};
use crate::draw::escaped;
use crate::evidence::tables::html;
use crate::objects::downstream::{Downstream, FixedSet};

const CSS: &str = include_str!("page.css");

/// The page of a record.
pub fn page(record: &Downstream) -> String {
    let opening = &record.opening;
    let title = escaped(&opening.describes);
    let rows = |cells: Vec<Vec<String>>| -> String {
        let row = |cells: &Vec<String>| cells.iter().map(|cell| format!("<td>{cell}</td>")).collect::<String>();
        cells.iter().map(|cells| format!("<tr>{}</tr>\n", row(cells))).collect()
    };
    let code = |text: &str| format!("<code>{}</code>", escaped(text));
    let set = |of: &str, set: &FixedSet| {
        vec![of.to_string(), set.name.name().into(), set.scenes.len().to_string(), code(&set.digest.to_string())]
    };
    let training = opening.sets.training.iter().map(|fixed| set("training", fixed));
    let sets = training.chain(opening.sets.evaluation.iter().map(|fixed| set("evaluation", fixed))).collect();
    let trainings = record.trainings.iter();
    let trainings = trainings.map(|of| vec![escaped(&of.which().to_string()), code(&of.weights.to_string())]).collect();
    let head = |names: &[&str]| names.iter().map(|name| format!("<th>{name}</th>")).collect::<String>();
    let listed = |names: &[&str], rows: String| {
        format!(
            "<div class=\"wide\"><table>\n<thead><tr>{}</tr></thead>\n<tbody>\n{rows}</tbody>\n</table></div>\n",
            head(names)
        )
    };
    format!(
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'\">\n\
         <title>{title}</title>\n<style>\n{CSS}</style>\n</head>\n<body>\n<h1>{title}</h1>\n\
         <p class=\"from\">Downstream study {}, recipe {}, proposals: {}</p>\n\
         <h2>Over the training</h2>\n<figure>\n{}</figure>\n<h2>After the last update</h2>\n{}\
         <h2>What it rests on</h2>\n{}{}</body>\n</html>\n",
        escaped(&opening.name),
        code(&opening.recipe.short(16)),
        escaped(&opening.proposals),
        figure(record).svg(),
        html(&table(record)),
        listed(&["Used for", "Set", "Scenes", "Digest"], rows(sets)),
        listed(&["Training", "Digest of its weights"], rows(trainings)),
    )
}
