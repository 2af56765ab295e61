//! Not a test: prints what the tests of `tests/all` skipped for want of data or a tool. Cargo runs test targets in the
//! order of their names, so this list stands at the end of `cargo test`, whose own output hides what passing tests print.

use std::path::Path;

fn main() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("skipped");
    let mut notes: Vec<String> = std::fs::read_dir(&folder)
        .into_iter()
        .flatten()
        .flatten()
        .filter_map(|entry| std::fs::read_to_string(entry.path()).ok())
        .collect();
    notes.sort();
    // The next run begins without notes.
    let _ = std::fs::remove_dir_all(&folder);
    match notes.len() {
        0 => println!("\nskipped: nothing"),
        n => println!("\nskipped in {n} places, for want of data or a tool:\n  {}", notes.join("\n  ")),
    }
}
