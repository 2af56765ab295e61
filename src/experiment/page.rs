//! `docs/EXPERIMENT.md`, written from the list of keys and the shipped protocols, so that it says what the check does.

use std::fmt::Write as _;
use toml::Table;

use super::check;
use super::key::{Key, Need, shown};
use super::keys::keys;
use super::place::PROTOCOLS;

const HEAD: &str = "\
# The experiment file

This page is written by `evodrive options > docs/EXPERIMENT.md` (`.ci/bless` does that) from the list against which every file is checked. A value
outside its range, a key that is missing and a key that no table has are refused when the file is read, before any
file is created, with their place, what was found and what is expected.

A file of your own is short: `evodrive init mine --scenes my_scenarios/` writes one. `base` names the file whose keys
hold wherever yours does not say otherwise: a path relative to your file, or a protocol that the program carries
(`evodrive:metadrive`, `evodrive:safebench`). Tables merge key by key, lists are replaced. A table that names another
`source` or `kind` than its base replaces the base's table, and so does `split.evolution`. A base may have a base;
circles are refused. The digest of an experiment is taken of the merged table, so it does not matter how a file is
composed. Paths lie relative to the file that names them.

Scenes are generated, or they are yours: `source = \"pool\"` with `path = \"my.pool\"` takes a pool that `evodrive scenes import`, `generate`,
`filter`, `merge` or `split` wrote; `source = \"files\"` with `paths = [...]` takes scenario files, folders and pools, read anew each time
(`evodrive formats`). A pool is one file with a digest, so a study on it is one on these scenes: make it once, check it with `evodrive scenes
check`, and name it. `--scenes` on the command line stands in for the file's scenes. `[split]` draws the evolution scenes and the held-out ones
from it by the experiment's seed; a window larger than the evolution scenes is refused.

In the keys, `[]` stands for each entry of a list and `*` for each name. The last columns before the meaning are the
values in the two protocols; an empty cell says that each experiment chooses its own.
";

/// The whole page.
pub fn page() -> String {
    let mut page = HEAD.to_string();
    let bases: Vec<Table> = PROTOCOLS.iter().filter_map(|(_, text)| text.parse().ok()).collect();
    let names = PROTOCOLS.map(|(name, _)| name).join(" | ");
    let all = keys();
    let mut sections: Vec<&str> = Vec::new();
    for key in &all {
        if !sections.contains(&section(key)) {
            sections.push(section(key));
        }
    }
    for title in sections {
        let heading = if title.is_empty() { "The file itself".to_string() } else { format!("`[{title}]`") };
        let _ = write!(page, "\n## {heading}\n\n| key | symbol | unit | range | {names} | meaning |\n");
        page.push_str("|---|---|---|---|---|---|---|\n");
        for key in all.iter().filter(|key| section(key) == title) {
            let values: Vec<String> = bases.iter().map(|base| value(base, key)).collect();
            let _ = writeln!(
                page,
                "| `{}` | {} | {} | {}{} | {} | {} |",
                key.key,
                key.symbol,
                key.unit,
                key.range,
                needed(&key.need),
                values.join(" | "),
                key.meaning
            );
        }
    }
    page
}

/// The table that a key stands in; empty for those of the file itself.
fn section(key: &Key) -> &str {
    if key.key.contains(['.', '[']) { key.key.split(['.', '[']).next().unwrap_or_default() } else { "" }
}

/// When the key is needed, where that is not always.
fn needed(need: &Need) -> String {
    match need {
        Need::Always => String::new(),
        Need::Optional => "; may be left out".into(),
        Need::With(place) => format!("; where `{place}` is given"),
        Need::Without(place) => format!("; where `{place}` is not given"),
        Need::Of(place, values) => format!("; where `{place}` is {}", values.join(" or ")),
    }
}

/// The values of a key in a protocol, each once.
fn value(base: &Table, key: &Key) -> String {
    let mut values: Vec<String> = Vec::new();
    for value in check::values(base, key) {
        let text = format!("`{}`", shown(&value));
        if !values.contains(&text) {
            values.push(text);
        }
    }
    values.join(", ")
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_page_in_docs_is_what_the_program_writes() {
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/EXPERIMENT.md");
        let written = std::fs::read_to_string(path).unwrap_or_default();
        assert!(written == super::page(), "docs/EXPERIMENT.md is stale; run .ci/bless and say why it moved");
    }
}
