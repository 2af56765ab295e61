//! The first screen as markup: it stands before the data, so that it is there at once and without a script.

use std::collections::BTreeSet;
use std::fmt::Write as _;

use super::super::recorded_run::RecordedRun;
use super::headline::{Headline, Verdict};
use super::manoeuvre::Gained;
use super::stage::Stage;
use super::trust::{self, Standing};
use crate::draw::escaped;
use crate::kernel::num;
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
    let setting = match (run.declared.setting.pool.as_str(), run.declared.setting.simulator.as_str()) {
        ("", _) | (_, "") => String::new(),
        (pool, simulator) => format!("; {pool}, simulated by {simulator}"),
    };
    let protocol = if run.rounds.is_empty() { "" } else { ", SafeBench's protocol" };
    format!(
        "<h1 id=\"title\">{}</h1>\n<p id=\"about\">Programs that make traffic dangerous for a driver under test ({}), evolved on {} and measured on {} that the \
         search never saw{protocol}{}.</p>",
        escaped(&opened.name),
        escaped(&egos.join(", ")),
        counted(opened.evolution_scenes.len(), "scene"),
        counted(opened.held_out_scenes.len(), "other scene"),
        escaped(&setting),
    )
}

/// Badges, what a reader should weigh, and one sentence a lineage.
pub fn html(run: &RecordedRun, headlines: &[Headline], stage: &Stage, realism_min: f64) -> String {
    let mut out = String::from("<section class=\"part\" id=\"answers\"><h2>What evolved</h2>\n");
    out.push_str(&badges(run, stage));
    if headlines.is_empty() {
        out.push_str("<p>The run is not finished: the answer comes when the held-out scenes are opened, after the last epoch.</p>\n");
    } else {
        out.push_str(&caution(headlines));
        let _ = writeln!(out, "<p class=\"note\">{}</p>", legend(headlines));
        out.push_str("<ul class=\"answers\">\n");
        for headline in headlines {
            row(&mut out, headline, &gains_by(run, headline, stage), &short_of_rule(run, headline, realism_min));
        }
        let _ = writeln!(out, "</ul>\n<p class=\"note\">{}</p>", escaped(&measures(run, headlines)));
    }
    out.push_str("</section>\n");
    out
}

fn badges(run: &RecordedRun, stage: &Stage) -> String {
    let mut out = String::from("<ul class=\"badges\" aria-label=\"Why it can be believed\">\n");
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
    out.push_str("</ul>\n");
    out
}

/// Describes what happens in the scenes that the shown program gains; empty where nobody looked.
fn gains_by(run: &RecordedRun, of: &Headline, stage: &Stage) -> String {
    let gained = run.result_of(&of.lineage).and_then(|result| stage.gained.get(&result.evolved.solution));
    gained.map(Gained::says).unwrap_or_default()
}

/// Says how many chosen programs fall short on the held-out scenes of the realism that the rule asks for; empty where none does.
fn short_of_rule(run: &RecordedRun, of: &Headline, realism_min: f64) -> String {
    let results = || run.result.iter().flat_map(|result| &result.lineages).filter(|one| one.group == of.group);
    let realism = run.realism_name();
    let short: Vec<f64> =
        results().map(|one| one.evolved.objectives.realism).filter(|realism| *realism < realism_min).collect();
    let shown = results().any(|one| one.lineage == of.lineage && one.evolved.objectives.realism < realism_min);
    match (&short[..], results().count()) {
        ([], _) => String::new(),
        ([one], 1) => {
            format!("On these scenes its {realism}, {}, falls short of the rule's {realism_min}.", num::fixed(*one, 4))
        }
        (short, all) => {
            format!(
                "{} of {all} chosen programs fall short of the rule's {realism} of {realism_min} on these scenes{}.",
                short.len(),
                if shown { ", this one too" } else { "" }
            )
        }
    }
}

/// The signs that the lines have.
fn legend(headlines: &[Headline]) -> String {
    let used: BTreeSet<Verdict> = headlines.iter().map(|of| of.verdict).collect();
    let entry = |verdict| {
        let (class, mark, means) = sign(verdict);
        format!("<span class=\"key {class}\"><span class=\"mark\">{mark}</span> {means}</span>")
    };
    used.into_iter().map(entry).collect()
}

/// Class, sign and meaning of a verdict.
fn sign(verdict: Verdict) -> (&'static str, &'static str, &'static str) {
    match verdict {
        Verdict::Gain => ("gain", "▲", "more of one, the other not measurably less"),
        Verdict::Trade => ("trade", "◆", "more attack for less realism"),
        Verdict::Concession => ("concession", "◇", "more realism for less attack"),
        Verdict::Unsure => ("unsure", "○", "no measurable difference"),
        Verdict::Loss => ("loss", "▼", "worse"),
        Verdict::Parent => ("parent", "=", "the parent stays"),
        Verdict::Plain => ("plain", "●", "scores without an interval"),
    }
}

/// Warns that gains say little about the ego's driving where most contacts are not preventable; empty where no line is so.
fn caution(headlines: &[Headline]) -> String {
    let share = |of: &Headline| 100.0 * (1.0 - of.preventable[0] as f64 / of.preventable[1].max(1) as f64);
    let shares: Vec<f64> = headlines.iter().filter(|of| of.weigh).map(share).collect();
    let (least, most) = (shares.iter().copied().fold(100.0, f64::min), shares.iter().copied().fold(0.0, f64::max));
    let percent = if num::fixed(least, 0) == num::fixed(most, 0) {
        format!("{} %", num::fixed(most, 0))
    } else {
        format!("{} to {} %", num::fixed(least, 0), num::fixed(most, 0))
    };
    let lines = match (shares.len(), headlines.len()) {
        (0, _) => return String::new(),
        (_, 1) => String::new(),
        (weigh, all) if weigh == all => " in every line".to_string(),
        (weigh, all) => format!(" in {weigh} of {all} lines"),
    };
    format!(
        "<p class=\"weigh\"><b>Weigh:</b> {percent} of the contacts that count are not preventable{lines}: neither braking nor swerving \
         avoids them, or the ego is rammed from behind. Such attacks say little about how it drives.</p>\n"
    )
}

/// Explains the numbers of the sentences.
fn measures(run: &RecordedRun, headlines: &[Headline]) -> String {
    let subject = if headlines.len() > 1 { "Each line has" } else { "The line has" };
    let setting = &run.declared.setting;
    if !run.rounds.is_empty() {
        return format!(
            "{subject} the chosen program less the published one that it began with, on routes that the search never saw; in brackets 95 % \
             intervals over groups of routes{}, which are few, so they are wide. Attack: collision rate times lost overall score, CR (1 − OS); \
             ARS: SafeBench's realism score. Both are scores of whole sets of runs.",
            if headlines.iter().any(|of| of.searches > 1) { " and searches" } else { "" }
        );
    }
    let counts = match setting.reading.as_str() {
        "" => String::new(),
        reading => format!(" Here attacks are {reading}."),
    };
    let settings = match setting.realism.as_str() {
        "" => String::new(),
        realism => {
            format!(" Here it is {realism}; two experiments mean the same realism only where these settings are equal.")
        }
    };
    let over = if headlines.iter().any(|of| of.searches > 1) {
        "over searches and scenes; the best search is named for what it did on these very scenes, so a new one would do less"
    } else {
        "over scenes; it is one search, and another would come to something else"
    };
    format!(
        "{subject} the chosen program less the published one that it began with; in brackets 95 % intervals {over}. Attack: share of scenes \
         in which the ego touches a road user whom the program drives, and the contact counts.{counts} Realism: 1 where all motion is within \
         what recorded human traffic shows, over the scenes in which the program acts; it does not ask why somebody drives so, and a ram that a car can \
         drive is realistic.{settings} Strict realism, which the rule and the front ask, is the worse of that and of the scenes with an attack."
    )
}

fn row(out: &mut String, of: &Headline, gains_by: &str, short: &str) {
    let (class, mark, _) = sign(of.verdict);
    let mechanism = escaped(&of.mechanism);
    let mut more = Vec::new();
    let who =
        if of.searches > 1 { format!("The best of them here, {},", escaped(of.lineage.as_str())) } else { "It".into() };
    if !of.shares.is_empty() {
        more.push(format!("{who} {}.", escaped(&of.shares)));
    }
    if !gains_by.is_empty() {
        more.push(format!("{}.", escaped(gains_by)));
    }
    match of.verdict {
        Verdict::Parent => {}
        _ if mechanism.is_empty() => {}
        _ if of.shares.is_empty() && of.searches > 1 => more.push(format!("{who} has <i>{mechanism}</i>.")),
        _ => more.push(format!("What is new in it: <i>{mechanism}</i>.")),
    }
    for says in [of.contacts_say.as_str(), short] {
        match says {
            "" => {}
            says if of.weigh || says == short => more.push(format!("<span class=\"weigh\">{}</span>", escaped(says))),
            says => more.push(escaped(says)),
        }
    }
    let more =
        if more.is_empty() { String::new() } else { format!("<span class=\"further\">{}</span>", more.join(" ")) };
    let _ = writeln!(
        out,
        "<li class=\"{class}\" data-lineage=\"{}\"><span class=\"mark\" aria-hidden=\"true\">{mark}</span> <span><b>{}</b> <small>{}</small>: {}{}.{more}</span></li>",
        escaped(of.lineage.as_str()),
        escaped(&of.called),
        escaped(of.group.as_str()),
        escaped(&of.says),
        if of.searches > 1 { "" } else { "; one search" },
    );
}
