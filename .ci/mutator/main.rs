//! All mutants of five rooms in one copy of the library, each behind a switch: `.ci/mutants` builds the copy once and turns
//! them on one after the other. A mutant is a small mistake that a test should find; docs/QUALITY.md says what came of it.
//!
//! `mutator TREE UNFIT LIST`, in a checkout: TREE is its copy, whose files are rewritten from those of the checkout. UNFIT names
//! the numbers that do not compile, one a line. LIST gets the mutants as lines of JSON.

use std::collections::BTreeSet;
use std::error::Error;
use std::fs;
use std::path::{Path, PathBuf};

use serde_json::json;

mod sites;
mod values;

use sites::Site;

/// By their folder; the mutants name the last part.
const ROOMS: [&str; 5] = ["stages/archive", "labels/evaluation", "lang/candidates", "stages/world", "core/store"];
const CRATES: [&str; 12] =
    ["core", "sim", "lang", "generators", "formats", "models", "stages", "labels", "packs", "evolve", "lab", "evodrive"];

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [tree, unfit, list] = arguments.as_slice() else { return Err("give TREE, UNFIT and LIST".into()) };
    let tree = Path::new(tree);
    let unfit: BTreeSet<usize> = match fs::read_to_string(unfit) {
        Ok(text) => text.split_whitespace().map(str::parse).collect::<Result<_, _>>()?,
        Err(_) => BTreeSet::new(),
    };
    let mut mutants = Mutants { unfit, count: 0, lines: String::new() };
    for folder in ROOMS {
        let room = folder.rsplit('/').next().unwrap_or(folder);
        for path in sources(&Path::new("src").join(folder))? {
            let text = fs::read_to_string(&path)?;
            let found = sites::of_file(&text).map_err(|error| format!("{}: {error}", path.display()))?;
            fs::write(tree.join(&path), mutants.rewritten(&text, found, room, &path))?;
        }
    }
    let kernel = fs::read_to_string("src/core/kernel/mod.rs")?;
    fs::write(tree.join("src/core/kernel/mod.rs"), format!("{kernel}\npub mod switch;\npub use switch::mutated;\n"))?;
    fs::write(tree.join("src/core/kernel/switch.rs"), include_str!("switch.rs"))?;
    // The copy is full of brackets that nobody needs, and a sum that must overflow shall do so when the mutant is on.
    let allowed = "#![allow(warnings, arithmetic_overflow, unconditional_panic)]";
    for name in CRATES {
        let root = format!("src/{name}/lib.rs");
        fs::write(tree.join(&root), format!("{allowed}\n{}", fs::read_to_string(&root)?))?;
    }
    fs::write(list, mutants.lines)?;
    Ok(println!("{} mutants, {} of them unfit", mutants.count, mutants.unfit.len()))
}

/// Files of a room without those of its tests, in order.
fn sources(folder: &Path) -> Result<Vec<PathBuf>, Box<dyn Error>> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy().to_string();
        if path.is_dir() {
            found.extend(sources(&path)?);
        } else if name.ends_with(".rs") && !name.contains("tests") {
            found.push(path);
        }
    }
    found.sort();
    Ok(found)
}

struct Mutants {
    unfit: BTreeSet<usize>,
    /// Numbers begin with 1; a number keeps its mutant, fit or not.
    count: usize,
    lines: String,
}

impl Mutants {
    fn rewritten(&mut self, text: &str, mut sites: Vec<Site>, room: &str, path: &Path) -> String {
        // Outer places first; of equal ones the guard stands before the expression that it is.
        sites.sort_by_key(|site| (site.place.start, std::cmp::Reverse(site.place.end)));
        let numbered: Vec<(Site, Vec<usize>)> = sites.into_iter().map(|site| self.numbered(site, room, path)).collect();
        let mut at = 0;
        part(text, 0..text.len(), &numbered, &mut at)
    }

    fn numbered(&mut self, site: Site, room: &str, path: &Path) -> (Site, Vec<usize>) {
        let mut numbers = Vec::new();
        for (_, change) in &site.changes {
            self.count += 1;
            numbers.push(self.count);
            let fit = !self.unfit.contains(&self.count);
            let line = json!({ "number": self.count, "room": room, "file": path, "line": site.line,
                "function": site.function, "change": change, "fit": fit });
            self.lines += &format!("{line}\n");
        }
        let kept: Vec<usize> = (0..numbers.len()).filter(|place| !self.unfit.contains(&numbers[*place])).collect();
        let changes = kept.iter().map(|place| site.changes[*place].clone()).collect();
        (Site { changes, ..site }, kept.iter().map(|place| numbers[*place]).collect())
    }
}

/// A part of the text with the sites inside it, from site `at` on, put behind their switches. The comments say to
/// `.ci/mutants` whose text an error of the compiler stands in.
fn part(text: &str, of: std::ops::Range<usize>, sites: &[(Site, Vec<usize>)], at: &mut usize) -> String {
    let (mut done, mut from) = (String::new(), of.start);
    while let Some((site, numbers)) = sites.get(*at).filter(|(site, _)| site.place.end <= of.end) {
        *at += 1;
        done += &text[from..site.place.start];
        let inside = part(text, site.place.clone(), sites, at);
        let arms = site.changes.iter().zip(numbers).map(|((new, _), number)| {
            format!("if crate::kernel::mutated({number}) {{ /*<{number}*/{new}/*{number}>*/ }} ")
        });
        let arms: Vec<String> = arms.collect();
        let marks: String = numbers.iter().map(|number| format!(" {number}")).collect();
        done += &match (arms.is_empty(), site.is_body) {
            (true, _) => inside,
            (false, true) => format!("/*[{marks}*/{}/*{marks}]*/", arms.concat()),
            (false, false) => format!("/*[{marks}*/({}else {{ {inside} }})/*{marks}]*/", arms.join("else ")),
        };
        from = site.place.end;
    }
    done + &text[from..of.end]
}
