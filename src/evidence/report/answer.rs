//! The first screen as markup: it stands before the data, so that it is there at once and without a script.

use std::fmt::Write as _;

use super::super::recorded_run::RecordedRun;
use super::headline::{Headline, Verdict};
use super::stage::Stage;
use super::trust::{self, Standing};
use crate::draw::escaped;
use crate::text::counted;

/// Name and what the page is about.
pub fn header(run: &RecordedRun) -> String {
    let opened = &run.opened;
    let egos: Vec<String> = {
        let mut egos: Vec<&str> = run.parents.iter().map(|parent| run.ego_name(&parent.ego)).collect();
        egos.sort_unstable();
        egos.dedup();
        egos.into_iter().map(|ego| if ego == "idm" { "IDM".into() } else { ego.to_string() }).collect()
    };
    let protocol = if run.rounds.is_empty() { "" } else { ", SafeBench's protocol" };
    format!(
        "<h1 id=\"title\">{}</h1>\n<p id=\"about\">Programs that make traffic dangerous for a driver under test ({}), evolved on {} and measured on {} that the \
         search never saw{protocol}.</p>",
        escaped(&opened.name),
        escaped(&egos.join(", ")),
        counted(opened.evolution_scenes.len(), "scene"),
        counted(opened.held_out_scenes.len(), "other scene"),
    )
}

/// One sentence a lineage, then the badges.
pub fn html(run: &RecordedRun, headlines: &[Headline], stage: &Stage) -> String {
    let mut out = String::from("<section class=\"part\" id=\"answers\"><h2>What evolved</h2>\n");
    if headlines.is_empty() {
        out.push_str("<p>The run is not finished: the answer comes when the held-out scenes are opened, after the last epoch.</p>\n");
    } else {
        out.push_str("<ul class=\"answers\">\n");
        headlines.iter().for_each(|headline| row(&mut out, headline));
        let plain = headlines.iter().any(|of| of.verdict == Verdict::Plain);
        let (sure, measures) = match plain {
            true => ("", "CR and ARS: SafeBench's scores of attack and of realism"),
            false => (
                "; in brackets 95 % intervals over scenes",
                "Attack: share of scenes in which the ego meets the program's road user in a way that counts. Realism: 1 where motion is within \
                 what recorded traffic shows",
            ),
        };
        let _ = writeln!(
            out,
            "</ul>\n<p class=\"note\">Each line: the chosen program less the published one that it began with{sure}. {measures}.</p>"
        );
    }
    out.push_str("<ul class=\"badges\" aria-label=\"Why it can be believed\">\n");
    for badge in trust::badges(run, stage) {
        let (class, mark) = match badge.standing {
            Standing::Holds => ("holds", "✓"),
            Standing::Note => ("weigh", "!"),
            Standing::Against => ("against", "✗"),
            Standing::Unknown => ("unknown", "?"),
        };
        let (says, rests_on) = (escaped(&badge.says), escaped(&badge.rests_on));
        let _ = writeln!(
            out,
            "<li class=\"badge {class}\"><details><summary><span aria-hidden=\"true\">{mark}</span> {says}</summary><p>{rests_on}</p></details></li>"
        );
    }
    out.push_str("</ul></section>\n");
    out
}

fn row(out: &mut String, of: &Headline) {
    let (class, mark) = match of.verdict {
        Verdict::Gain => ("gain", "▲"),
        Verdict::Trade => ("trade", "◆"),
        Verdict::Unsure => ("unsure", "○"),
        Verdict::Loss => ("loss", "▼"),
        Verdict::Parent => ("parent", "="),
        Verdict::Plain => ("plain", "●"),
    };
    let by = match (of.verdict, of.mechanism.as_str()) {
        (Verdict::Parent, _) | (_, "") => String::new(),
        (Verdict::Gain | Verdict::Trade | Verdict::Plain, mechanism) if of.searches > 1 => {
            format!("; the best, {}, by <i>{}</i>", escaped(of.lineage.as_str()), escaped(mechanism))
        }
        (Verdict::Gain | Verdict::Trade | Verdict::Plain, mechanism) => format!(", by <i>{}</i>", escaped(mechanism)),
        (_, mechanism) => format!(" <span class=\"tried\">(with {})</span>", escaped(mechanism)),
    };
    let shares = if of.shares.is_empty() {
        String::new()
    } else {
        {
            let who = if of.searches > 1 { "This one" } else { "It" };
            format!(" {who} {}.", escaped(&of.shares))
        }
    };
    let _ = writeln!(
        out,
        "<li class=\"{class}\" data-lineage=\"{}\"><span class=\"mark\" aria-hidden=\"true\">{mark}</span> <span><b>{}</b>: {}{by}.{shares}</span></li>",
        escaped(of.lineage.as_str()),
        escaped(of.group.as_str()),
        escaped(&of.says),
    );
}
