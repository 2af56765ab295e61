//! `docs/EXPERIMENT.md`, written from the list of keys and the shipped protocols, so that it says what the check does.

use std::fmt::Write as _;
use toml::Table;

use super::check;
use super::key::{Key, Need, Range, bound, shown};
use super::keys::keys;
use super::place::PROTOCOLS;

const HEAD: &str = "\
# The experiment file

This page lets you write an experiment file and look up every key. It is written by `evodrive options > docs/EXPERIMENT.md` from the list against
which every file is checked. A value outside its range, a key that is missing and a key that no table has are refused
when the file is read, with their place, what was found and what is expected.

A file of your own is short: `evodrive init mine --scenes my_scenarios/` writes one. `base` names the file whose keys
hold wherever yours does not say otherwise: a path relative to your file, or a protocol that the program carries
(`evodrive:metadrive`, `evodrive:safebench`). Tables merge key by key, lists are replaced. A table that names another
`source` or `kind` than its base replaces the base's table, and so does `split.evolution`. A base may have a base;
circles are refused. The digest of an experiment is taken of the merged table. Paths lie relative to the file that names them.

Scenes are generated, or they are yours: `source = \"pool\"` with `path = \"my.pool\"` takes a pool (`evodrive scenes import`);
`source = \"files\"` with `paths = [...]` takes scenario files, folders and pools, read anew each time. `--scenes` on the command
line stands in for the file's scenes. `[split]` draws the evolution scenes and the held-out ones by the experiment's seed. Several
keys are called seed: [GLOSSARY](GLOSSARY.md#seeds) sets them side by side.

**What to leave alone.** Most keys have one value in every shipped file. The second part of both protocol files, below the line
`# LEAVE ALONE`, holds those that no study needs to change, each table with the reason. Keys that no shipped file sets are for files
of your own: `scenes.path`, `[driver]`, `evaluation.attack.when`, `[evaluation.metrics]`, and of live models `top_k`, `min_p`,
`max_completion_tokens`, `frequency_penalty` and `presence_penalty`.

**In an editor.** [experiment.schema.json](experiment.schema.json) (`evodrive options --schema`) is a JSON Schema of the file. Editors that read it
complete keys, show meanings and underline mistakes: taplo, and Even Better TOML for VS Code. Begin your file with
`#:schema path/to/experiment.schema.json`, or name it for a folder in `.taplo.toml`:

```toml
[[rule]]
include = [\"my_experiments/*.toml\"]

[rule.schema]
path = \"docs/experiment.schema.json\"
```

The schema knows each key by itself. What depends on other keys, `evodrive plan` says.

In the keys, `[]` stands for each entry of a list and `*` for each name; the paper's symbol stands behind the key. The columns before the
meaning are the values in the protocols; an empty cell says that each experiment chooses its own, in `metadrive-2` that `metadrive`'s holds.
";

/// The whole page.
pub fn page() -> String {
    let mut page = HEAD.to_string();
    let bases: Vec<Table> = PROTOCOLS.iter().filter_map(|(_, text)| text.parse().ok()).collect();
    let names = PROTOCOLS.map(|(name, _)| name).join("|");
    let all = keys();
    let mut sections: Vec<&str> = Vec::new();
    for key in &all {
        if !sections.contains(&section(key)) {
            sections.push(section(key));
        }
    }
    for title in sections {
        let heading = if title.is_empty() { "The file itself".to_string() } else { format!("`[{title}]`") };
        let _ = write!(page, "\n## {heading}\n\n|key|range|{names}|meaning|\n");
        let _ = writeln!(page, "|---|---|{}---|", "---|".repeat(PROTOCOLS.len()));
        for key in all.iter().filter(|key| section(key) == title) {
            let values: Vec<String> = bases.iter().map(|base| value(base, key)).collect();
            let _ = writeln!(
                page,
                "|`{}`{}|{}{}|{}|{}|",
                key.key,
                symbol(key),
                range(key),
                needed(&key.need),
                values.join("|"),
                key.meaning
            );
        }
    }
    page
}

/// The keys as a terminal shows them: each in a line with its range, below it the values in the protocols and the meaning.
pub fn listing() -> String {
    let bases: Vec<(&str, Table)> =
        PROTOCOLS.iter().filter_map(|(name, text)| Some((*name, text.parse().ok()?))).collect();
    let mut out = String::new();
    let all = keys();
    for (at, key) in all.iter().enumerate() {
        if at == 0 || section(&all[at - 1]) != section(key) {
            let title = section(key);
            let _ = writeln!(out, "\n{}", if title.is_empty() { "The file itself" } else { title });
        }
        let _ = writeln!(out, "\n  {}{}", key.key, symbol(key));
        let _ = writeln!(out, "    {}\n    {}{}", key.meaning, range(key), needed(&key.need));
        for (name, base) in &bases {
            let value = value(base, key).replace('`', "");
            if !value.is_empty() {
                let _ = writeln!(out, "    {name}: {value}");
            }
        }
    }
    out.trim_start().to_string()
}

fn symbol(key: &Key) -> String {
    if key.symbol.is_empty() { String::new() } else { format!(" ({})", key.symbol) }
}

/// The table that a key stands in; empty for those of the file itself.
fn section(key: &Key) -> &str {
    if key.key.contains(['.', '[']) { key.key.split(['.', '[']).next().unwrap_or_default() } else { "" }
}

/// The values that a key may have, with their unit.
fn range(key: &Key) -> String {
    let range = match &key.range {
        Range::Whole(least, i64::MAX) => format!("whole, {least} to 2^63 - 1"),
        Range::Whole(least, most) => format!("whole, {least} to {most}"),
        Range::Number(least, most) => format!("{} to {}", bound(*least), bound(*most)),
        Range::Above(least, most) => format!("above {}, at most {}", bound(*least), bound(*most)),
        Range::Text(most) => format!("text, 1 to {most} characters"),
        other => other.to_string(),
    };
    if key.unit.is_empty() { range } else { format!("{range} {}", key.unit) }
}

/// When the key is needed, where that is not always.
fn needed(need: &Need) -> String {
    match need {
        Need::Always => String::new(),
        Need::Optional => "; optional".into(),
        Need::With(place) => format!("; with `{place}`"),
        Need::Without(place) => format!("; without `{place}`"),
        Need::Of(place, values) => format!("; if `{place}` is {}", values.join(" or ")),
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
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/EXPERIMENT.md");
        let written = std::fs::read_to_string(path).unwrap_or_default();
        assert!(written == super::page(), "docs/EXPERIMENT.md is stale; run .ci/bless and say why it moved");
    }
}
