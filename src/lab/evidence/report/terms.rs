//! Meanings of the page's words, from `docs/GLOSSARY.md`: shown where a reader rests the pointer on one.

use std::collections::BTreeMap;

const GLOSSARY: &str = include_str!("../../../../docs/GLOSSARY.md");

/// Words of the page, in small letters, and the noun of the glossary that each of them is.
const WORDS: &[(&str, &str)] = &[
    ("any crash", "any crash"),
    ("any contact", "any crash"),
    ("attack", "objectives"),
    ("attack–realism front", "archive"),
    ("archive", "archive"),
    ("attempt", "attempt"),
    ("attempts", "attempt"),
    ("change of the program", "patch"),
    ("chosen program", "active generator"),
    ("counsel", "counsel"),
    ("coverage", "coverage"),
    ("evaluated", "exit"),
    ("declined", "exit"),
    ("invalid", "exit"),
    ("exit", "exit"),
    ("gates", "gate"),
    ("lineage", "lineage"),
    ("memory shown", "memory"),
    ("no program", "do-nothing row"),
    ("on the front", "archive"),
    ("patch", "patch"),
    ("pf-area@3 %", "PF-Area@3"),
    ("predicted", "Â, R̂"),
    ("program", "program"),
    ("realism", "realism"),
    ("strict realism", "strict realism"),
    ("ars", "CR, OS, ARS"),
    ("rejected by the router", "route decision"),
    ("reviews", "review"),
    ("rollouts", "rollout"),
    ("route", "route decision"),
    ("scene", "scene"),
    ("scenes", "scene"),
    ("standing", "active generator"),
];

/// Word of the page to its meaning, with the unit where it has one.
pub fn terms() -> BTreeMap<&'static str, String> {
    let nouns = nouns();
    WORDS.iter().filter_map(|(word, noun)| Some((*word, nouns.get(noun)?.clone()))).collect()
}

/// The glossary's rows by the noun that stands before the type; where there is none, by the paper's symbol.
fn nouns() -> BTreeMap<&'static str, String> {
    GLOSSARY.lines().filter_map(noun).collect()
}

fn noun(line: &'static str) -> Option<(&'static str, String)> {
    let cells: Vec<&str> = line.strip_prefix('|')?.strip_suffix('|')?.split('|').map(str::trim).collect();
    let [symbol, name, unit, meaning] = cells[..] else { return None };
    let name = name.split([',', ';']).next().unwrap_or_default();
    let key = if name.is_empty() || name.starts_with('`') { symbol } else { name };
    let plain = |text: &str| text.replace('`', "");
    let unit = if unit.is_empty() { String::new() } else { format!(" [{}]", plain(unit).trim_matches(['[', ']'])) };
    Some((key, format!("{}{unit}", plain(meaning))))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_word_of_the_page_is_a_noun_of_the_glossary() {
        let (nouns, terms) = (nouns(), terms());
        let lost: Vec<&str> = WORDS.iter().map(|(_, noun)| *noun).filter(|noun| !nouns.contains_key(noun)).collect();
        assert!(lost.is_empty(), "not in docs/GLOSSARY.md: {lost:?}");
        assert!(
            terms.len() == WORDS.len() && terms.values().all(|meaning| meaning.len() > 10 && !meaning.contains('`'))
        );
        assert!(terms["pf-area@3 %"].ends_with("[%]") && terms["realism"] != terms["strict realism"]);
    }
}
