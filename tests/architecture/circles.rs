//! Circles between the files of a room: which file of a room uses which, and who needs each other.

use std::collections::{BTreeMap, BTreeSet};

/// A module by its names from the crate's root on.
type Module = Vec<String>;

/// Circles that stay: the files, and why. A type beside its verb, or a folder whose `mod.rs` holds its words.
/// `epoch`, `evidence` and `stage` may stand in no line.
const ALLOWED: &[(&str, &str)] = &[
    ("adapters/contract adapters/isolation", "a contract, and the words that it forbids to others"),
    ("agents/counsel agents/scene_prompt", "a case, and the prompt that shows it"),
    ("agents/prompt agents/task", "a task, and the prompt that asks it"),
    ("cli/records/bundle cli/records/bundle_replay", "a bundle, and the run that is carried out from it"),
    ("compiler/prepared compiler/walk", "a prepared program, and its way through a scene"),
    ("ego/pdm/simulated ego/pdm/tracker", "a car's states, and the regulator that commands the next one"),
    (
        "experiment/program_file/safebench experiment/program_file/safebench/human \
         experiment/program_file/safebench/ranges experiment/program_file/safebench/sequences",
        "what all of SafeBench's files share, and each form of them",
    ),
    (
        "formats/openscenario formats/openscenario/entities formats/openscenario/story formats/openscenario/triggered",
        "a file, and its parts",
    ),
    (
        "formats/scenarionet/pickle formats/scenarionet/pickle/json formats/scenarionet/pickle/machine \
         formats/scenarionet/pickle/numpy formats/scenarionet/pickle/torch formats/scenarionet/pickle/write",
        "a tree of values, the machine that builds it, and the writer that takes it apart",
    ),
    ("llm llm/record llm/replay", "who may be asked, and those who answer"),
    ("llm/client llm/request", "a request and its client"),
    ("live/anthropic live/openai live/protocol live/spend", "a protocol and those who speak it"),
    ("objects/expr/lex objects/expr/parse objects/expr/tree", "a tree, and the parser that makes it"),
    ("sim/encounters/avoidance sim/encounters/jury", "a rollout that is lived through again, and those who watch it"),
    ("synth/network synth/node", "a network, and the nodes that are made of it"),
];

/// Rooms that must have no circle at all.
const STRICT: [&str; 3] = ["epoch", "evidence", "stage"];

/// Checks the files (path below `src/` and text without tests and comments).
pub fn check(files: &[(String, String)]) {
    let graph = Graph::of(files);
    let found = circles(&graph);
    let allowed: Vec<BTreeSet<&str>> = ALLOWED.iter().map(|(names, _)| names.split_whitespace().collect()).collect();
    let strict = |name: &str| STRICT.contains(&name.split('/').next().unwrap_or_default());
    assert!(!allowed.iter().flatten().any(|name| strict(name)), "{STRICT:?} may have no circle");
    let named: Vec<BTreeSet<String>> =
        found.iter().map(|circle| circle.iter().map(|module| module.join("/")).collect()).collect();
    let within = |circle: &BTreeSet<String>, names: &BTreeSet<&str>| circle.iter().all(|n| names.contains(n.as_str()));
    let new: Vec<_> = named.iter().filter(|circle| !allowed.iter().any(|names| within(circle, names))).collect();
    assert!(new.is_empty(), "files that need each other: move what they share into a file of its own\n{new:#?}");
    let idle: Vec<_> = allowed.iter().filter(|names| !named.iter().any(|circle| within(circle, names))).collect();
    assert!(idle.is_empty(), "these circles are gone: take them out of the list\n{idle:#?}");
}

/// For each file, the files of its own room that it uses.
struct Graph(BTreeMap<Module, BTreeSet<Module>>);

impl Graph {
    fn of(files: &[(String, String)]) -> Graph {
        let in_rooms = files.iter().filter(|(file, _)| file.contains('/'));
        let texts: BTreeMap<Module, (&str, &str)> =
            in_rooms.map(|(file, text)| (module_of(file), (file.as_str(), text.as_str()))).collect();
        let exports: BTreeMap<Module, BTreeMap<String, Vec<String>>> =
            texts.iter().map(|(module, (_, text))| (module.clone(), exports(text))).collect();
        let mut edges = BTreeMap::new();
        for (module, (file, text)) in &texts {
            let mut used = BTreeSet::new();
            // A mod.rs without items of its own only hands on names.
            if !file.ends_with("mod.rs") || has_items(text) {
                let targets = paths(text).into_iter().filter_map(|path| resolve(module, &path, &texts, &exports, 0));
                used.extend(targets.filter(|target| target != module && target[0] == module[0]));
            }
            edges.insert(module.clone(), used);
        }
        Graph(edges)
    }

    fn reaches<'g>(&'g self, from: &'g Module) -> BTreeSet<&'g Module> {
        let (mut seen, mut open) = (BTreeSet::new(), vec![from]);
        while let Some(next) = open.pop().and_then(|module| self.0.get(module)) {
            open.extend(next.iter().filter(|target| seen.insert(*target)));
        }
        seen
    }
}

/// Groups of files of which each reaches each.
fn circles(graph: &Graph) -> Vec<Vec<&Module>> {
    let reach: BTreeMap<&Module, BTreeSet<&Module>> = graph.0.keys().map(|m| (m, graph.reaches(m))).collect();
    let mut placed: BTreeSet<&Module> = BTreeSet::new();
    let mut found = Vec::new();
    for (module, reached) in &reach {
        if placed.contains(module) || !reached.contains(module) {
            continue;
        }
        let circle: Vec<&Module> = reached.iter().copied().filter(|other| reach[other].contains(module)).collect();
        placed.extend(circle.iter().copied());
        found.push(circle);
    }
    found
}

fn module_of(file: &str) -> Module {
    let mut names: Module = file.trim_end_matches(".rs").split('/').map(String::from).collect();
    if names.last().is_some_and(|name| name == "mod") {
        names.pop();
    }
    names
}

fn has_items(text: &str) -> bool {
    let words = ["fn", "struct", "enum", "impl", "trait", "const", "static", "type"];
    let starts = |line: &str| {
        let line = line.trim_start_matches("pub(super) ").trim_start_matches("pub(crate) ").trim_start_matches("pub ");
        words.iter().any(|word| line.strip_prefix(word).is_some_and(|rest| rest.starts_with([' ', '<'])))
    };
    text.lines().any(starts)
}

/// Name -> where a `pub use` takes it from.
fn exports(text: &str) -> BTreeMap<String, Vec<String>> {
    let statements = text.split(';').filter_map(|statement| Some(statement.split_once("pub use ")?.1));
    let trees = statements.flat_map(|tree| {
        let rooted = ["crate::", "self::", "super::"].iter().any(|root| tree.starts_with(root));
        leaves(&if rooted { tree.to_string() } else { format!("self::{tree}") })
    });
    trees.filter_map(|path| Some((path.last()?.clone(), path))).collect()
}

/// Every path that a text names from `crate`, `self`, `super` or one of its own modules on.
fn paths(text: &str) -> Vec<Vec<String>> {
    let mut found = Vec::new();
    for root in ["crate::", "self::", "super::"] {
        for (at, _) in text.match_indices(root) {
            let before = text[..at].chars().next_back();
            // `pub(in crate::room)` says who sees an item and uses nothing.
            if !before.is_some_and(|c| c.is_alphanumeric() || c == '_' || c == ':') && !text[..at].ends_with("(in ") {
                found.extend(leaves(&text[at..]));
            }
        }
    }
    found.extend(exports(text).into_values());
    found
}

/// The paths of a use tree at the start of a text: `a::{b, c::d}` gives `a::b` and `a::c::d`.
fn leaves(text: &str) -> Vec<Vec<String>> {
    let (mut stack, mut path, mut word, mut found) = (Vec::new(), Vec::new(), String::new(), Vec::new());
    let mut chars = text.chars().peekable();
    while let Some(c) = chars.next() {
        match c {
            c if c.is_alphanumeric() || c == '_' => word.push(c),
            ':' if chars.peek() == Some(&':') => {
                chars.next();
                path.push(std::mem::take(&mut word));
            }
            '{' if word.is_empty() && !path.is_empty() => stack.push(path.clone()),
            ' ' | '\n' if !stack.is_empty() => {}
            ',' | '}' if !stack.is_empty() => {
                if !word.is_empty() {
                    path.push(std::mem::take(&mut word));
                    found.push(path);
                }
                path = if c == ',' { stack.last().cloned() } else { stack.pop() }.unwrap_or_default();
                if stack.is_empty() {
                    return found;
                }
                if c == '}' {
                    path = stack.last().cloned().unwrap_or_default();
                }
            }
            _ => break,
        }
    }
    if !word.is_empty() {
        path.push(word);
    }
    if !path.is_empty() {
        found.push(path);
    }
    found
}

/// The file in which a path's item stands, where it is one of ours.
fn resolve(
    from: &Module,
    path: &[String],
    texts: &BTreeMap<Module, (&str, &str)>,
    exports: &BTreeMap<Module, BTreeMap<String, Vec<String>>>,
    depth: usize,
) -> Option<Module> {
    let mut at = from.clone();
    let mut names = path.iter().peekable();
    while let Some(root) = names.next_if(|name| ["crate", "self", "super"].contains(&name.as_str())) {
        match root.as_str() {
            "crate" => at.clear(),
            "super" => drop(at.pop()),
            _ => {}
        }
    }
    let child = |at: &Module, name: &String| [at.as_slice(), std::slice::from_ref(name)].concat();
    while let Some(name) = names.next_if(|name| texts.contains_key(&child(&at, name))) {
        at.push(name.clone());
    }
    let handed_on = names.peek().and_then(|name| exports.get(&at)?.get(*name)).filter(|_| depth < 6);
    let elsewhere = handed_on.and_then(|path| resolve(&at, path, texts, exports, depth + 1));
    elsewhere.or_else(|| texts.contains_key(&at).then_some(at))
}

/// A circle that is there is found, whether it goes by `super`, by `crate` or by a name that a mod.rs hands on.
#[test]
fn circles_are_found() {
    let file = |name: &str, text: &str| (name.to_string(), text.to_string());
    let files = [
        file("room/mod.rs", "mod a;\nmod b;\nmod c;\npub use a::{A, other::Thing};\npub use b::B;\nconst N: u32 = 1;"),
        file("room/a.rs", "use super::b::helper;\npub struct A;"),
        file("room/b.rs", "use crate::kernel::num;\nuse crate::room::{A, c};\npub struct B;"),
        file("room/c.rs", "pub(in crate::room) fn alone() {}"),
        file("kernel/mod.rs", "pub mod num;"),
        file("kernel/num.rs", "fn one() {}"),
    ];
    let graph = Graph::of(&files);
    let found: Vec<Vec<String>> =
        circles(&graph).iter().map(|circle| circle.iter().map(|module| module.join("/")).collect()).collect();
    assert_eq!(found, [["room/a", "room/b"]]);
}
