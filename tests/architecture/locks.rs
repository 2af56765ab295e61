//! The Python package is a workspace of its own, with a lock of its own. What both locks hold they hold in one version: a package built
//! from other crates than the program's computes with other crates.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

const OWN: &str = "Cargo.lock";
const PACKAGE: &str = "bridges/python/Cargo.lock";

#[test]
fn the_python_package_is_locked_to_the_crates_of_the_program() {
    let read = |file: &str| {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(file);
        std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{file}: {error}"))
    };
    let (own, package) = (read(OWN), read(PACKAGE));
    let drifted = drift(&own, &package);
    assert!(drifted.is_empty(), "{PACKAGE} holds other versions than {OWN}:\n{}", drifted.join("\n"));
    // A check that lets everything pass would end here: another version, and another source of the same one.
    let of = |name: &str| versions(&package)[name].first().unwrap().clone();
    let (serde, version) = (of("serde_json"), |of: &str| of.split(' ').next().unwrap().to_string());
    let older = package.replacen(
        &format!("name = \"serde_json\"\nversion = \"{}\"", version(&serde)),
        "name = \"serde_json\"\nversion = \"1.0.1\"",
        1,
    );
    let said = drift(&own, &older);
    let mend =
        format!("cargo update --manifest-path bridges/python/Cargo.toml -p serde_json --precise {}", version(&serde));
    assert!(said.len() == 1 && said[0].contains("1.0.1") && said[0].ends_with(&mend), "{said:?}");
    assert!(versions(&package).len() > 150, "the lock was not read");
    let other =
        package.replacen("registry+https://github.com/rust-lang/crates.io-index", "registry+https://elsewhere", 1);
    assert_eq!(drift(&own, &other).len(), 1);
}

/// One line a crate that both locks hold and that is another one in the package's, with the command that mends it.
fn drift(own: &str, package: &str) -> Vec<String> {
    let (own, package) = (versions(own), versions(package));
    let one = |(name, found): (&String, &BTreeSet<String>)| {
        let expected = own.get(name)?;
        let mut other = found.difference(expected);
        let (first, wanted) = (other.next()?, expected.iter().next_back()?);
        // Of a crate that the program has in two versions a package may have either.
        let precise = wanted.split(' ').next()?;
        Some(format!(
            "{name}: expected {}, found {first}\n  cargo update --manifest-path bridges/python/Cargo.toml -p {name} --precise {precise}",
            expected.iter().map(String::as_str).collect::<Vec<_>>().join(" or ")
        ))
    };
    package.iter().filter_map(one).collect()
}

/// Versions of each crate of a lock, each with where it comes from.
fn versions(lock: &str) -> BTreeMap<String, BTreeSet<String>> {
    let lock: toml::Table = lock.parse().expect("a lock is TOML");
    let mut versions: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for package in lock["package"].as_array().expect("packages") {
        let text = |key: &str| package.get(key).and_then(toml::Value::as_str).unwrap_or("here");
        versions.entry(text("name").into()).or_default().insert(format!("{} from {}", text("version"), text("source")));
    }
    versions
}
