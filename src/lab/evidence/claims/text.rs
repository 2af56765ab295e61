//! Judged claims as Markdown and CSV.

use std::fmt::Write as _;

use super::judge::{Judged, Judgement, Part, Verdict};
use crate::evidence::tables::escaped;
use crate::kernel::num;

/// The claims with their verdicts, those that fail first.
pub fn markdown(found: &Judgement) -> String {
    let mut out = String::from("# Claims of the paper\n\n");
    let count = |verdict: Verdict| found.claims.iter().filter(|claim| claim.verdict == verdict).count();
    let counts: Vec<String> =
        Verdict::ALL.iter().map(|verdict| format!("{} {}", count(*verdict), verdict.words())).collect();
    let of_course = |claim: &&Judged| claim.verdict == Verdict::Supported && claim.never_negative;
    let of_course = match found.claims.iter().filter(of_course).count() {
        0 => String::new(),
        n => format!(" Supported as more than 0 of a number that is never negative: {n}."),
    };
    let _ = writeln!(out, "{} claims: {}.{of_course}\n", found.claims.len(), counts.join(", "));
    let runs = found.runs.iter().map(|source| ("run", "root", source));
    let studies = found.studies.iter().map(|source| ("study", "recipe", source));
    for (what, by, (name, root, kinds)) in runs.chain(studies) {
        let from = match kinds.as_str() {
            "scripted" => "proposals from the scripted stand-in, which is no language model".to_string(),
            "" => "no proposer is named".to_string(),
            "random" => "random legal patches in place of proposals".to_string(),
            _ => format!("proposals from {kinds}"),
        };
        let once = if what == "run" && found.one_seed.contains(name) {
            "; one seed of every search, so that its intervals and p do not hold the spread between searches"
        } else {
            ""
        };
        let rules = found.rules.get(name).filter(|_| what == "run");
        let rules = rules.map_or(String::new(), |rules| format!("; {rules}"));
        let _ = writeln!(out, "- {what} {name}, {by} {}: {from}{once}{rules}", root.get(..12).unwrap_or(root));
    }
    let _ = writeln!(
        out,
        "- {} claims were tested; p is one-sided and corrected after Holm over them; level {}. A claim over several rows is supported only \
         if every row shows it, and not supported where one row shows the contrary or a number stands on the threshold without spread. \
         It is smaller than in the paper where neither is shown, but in every row that there is less of it than the paper prints.\n",
        found.tested, found.level
    );
    for verdict in Verdict::ALL {
        let of: Vec<&Judged> = found.claims.iter().filter(|claim| claim.verdict == verdict).collect();
        if of.is_empty() {
            continue;
        }
        let _ = writeln!(out, "## {}\n", capital(verdict.words()));
        for claim in of {
            one(&mut out, claim, found.level);
        }
    }
    out
}

fn capital(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or(String::new(), |first| first.to_uppercase().chain(letters).collect())
}

fn one(out: &mut String, claim: &Judged, level: f64) {
    let _ = writeln!(out, "**{}** (`{}`): {}", claim.id, claim.label, claim.text);
    if !claim.asked.is_empty() {
        let _ = writeln!(out, "\n- asked: {}", claim.asked);
    }
    if let Some(reason) = &claim.reason {
        let _ = writeln!(out, "- {reason}");
    }
    if claim.never_negative {
        let _ = writeln!(
            out,
            "- this number is never negative: a search by random patches is above 0 as well, so being above it says little"
        );
    }
    if let (Some(p_for), Some(p_against)) = (claim.p_for, claim.p_against) {
        let smaller =
            claim.p_smaller.map_or(String::new(), |value| format!(", for less of it than in the paper {}", p(value)));
        let _ = writeln!(out, "- p for it {}, against it {}{smaller}", p(p_for), p(p_against));
    }
    if claim.parts.len() > 1 {
        let alone = |of: fn(&Part) -> f64| claim.parts.iter().filter(|part| of(part) <= level).count();
        let (shows, contrary, all) = (alone(|part| part.p_for), alone(|part| part.p_against), claim.parts.len());
        let _ = writeln!(
            out,
            "- {shows} of {all} rows show it taken alone (p at most {level}, not corrected), {contrary} the contrary"
        );
    }
    for part in &claim.parts {
        let paper = part.paper.map_or(String::new(), |paper| format!("; paper {paper}"));
        let why = part.cell.as_ref().map_or(String::new(), |cell| format!(" (`evodrive why {cell}`)"));
        let _ = writeln!(out, "- {}: {}{paper}{why}", part.row, estimate(part));
    }
    out.push('\n');
}

fn p(value: f64) -> String {
    format!("{value:.4}")
}

/// About three digits that count; all of them are in the CSV.
fn short(value: f64) -> String {
    let size = value.abs();
    let digits =
        [(10.0, 1), (1.0, 2), (0.1, 3)].into_iter().find(|(from, _)| size >= *from).map_or(4, |(_, digits)| digits);
    format!("{:.digits$}", num::rounded(value, digits as u32))
}

pub(super) fn estimate(part: &Part) -> String {
    let interval = part.estimate.interval.map(|[low, high]| format!(" [{}, {}]", short(low), short(high)));
    format!("{}{}", short(part.estimate.value), interval.unwrap_or_default())
}

/// The same as LaTeX with booktabs and longtable, a line a claim with its least convincing row.
pub fn latex(found: &Judgement) -> String {
    let mut out = String::from(
        "% needs \\usepackage{booktabs} and \\usepackage{longtable}\n\\begin{longtable}{@{}p{19mm}p{55mm}p{33mm}p{34mm}r@{}}\n\\toprule\n\
         Verdict & Claim & Where the paper says it & Estimate & p \\\\\n\\midrule\n\\endhead\n",
    );
    for claim in &found.claims {
        let least = claim.parts.iter().max_by(|a, b| a.p_for.total_cmp(&b.p_for));
        let tested = claim.p_for.map_or("--".to_string(), p);
        let of = |part: &Part| match claim.parts.len() {
            1 => estimate(part),
            _ => format!("{}: {}", part.row, estimate(part)),
        };
        let found = least.map_or("--".to_string(), of);
        let cells = [claim.verdict.words(), &claim.text, &claim.label, &found].map(escaped);
        let _ = writeln!(
            out,
            "\\raggedright {} & \\raggedright {} & \\raggedright {{\\footnotesize {}}} & \\raggedright {} & {tested} \\\\[0.6ex]",
            cells[0],
            cells[1],
            cells[2].replace('-', "-\\allowbreak "),
            // A space in an interval stays with what follows it.
            cells[3].replace(", ", ",~")
        );
    }
    out.push_str("\\bottomrule\n\\end{longtable}\n");
    out
}

/// One line for each claim and row, numbers unrounded.
pub fn csv(found: &Judgement) -> String {
    let mut out = String::from(
        "verdict,id,label,asked,row,value,low,high,paper,p_for_holm,p_against_holm,p_smaller_holm,root,cell,reason,text\n",
    );
    let number = |value: Option<f64>| value.map_or(String::new(), |value| value.to_string());
    for claim in &found.claims {
        let parts: Vec<Option<&Part>> =
            if claim.parts.is_empty() { vec![None] } else { claim.parts.iter().map(Some).collect() };
        for part in parts {
            let interval = part.and_then(|part| part.estimate.interval);
            let fields = [
                claim.verdict.words().to_string(),
                claim.id.clone(),
                claim.label.clone(),
                claim.asked.clone(),
                part.map_or(String::new(), |part| part.row.clone()),
                number(part.map(|part| part.estimate.value)),
                number(interval.map(|i| i[0])),
                number(interval.map(|i| i[1])),
                number(part.and_then(|part| part.paper)),
                number(claim.p_for),
                number(claim.p_against),
                number(claim.p_smaller),
                claim.root.clone().unwrap_or_default(),
                part.and_then(|part| part.cell.clone()).unwrap_or_default(),
                claim.reason.clone().unwrap_or_default(),
                claim.text.clone(),
            ];
            out.push_str(&crate::evidence::tables::csv_line(&fields));
        }
    }
    out
}
