//! Road users whose fields contradict each other, in a table for `scenes check` and in a line each for what writes pools.

use crate::evidence::aligned::Aligned;
use crate::kernel::{Threads, num};
use crate::scene::Scene;
use crate::scene::consistency::{Checked, checked, values};
use crate::text::counted;

/// Road users that a line names before it counts.
const NAMED_MAX: usize = 5;
/// Characters of a line of the table.
const WIDTH: usize = 120;

/// Runs each check on these scenes.
pub fn of_pool(scenes: &[Scene], threads: &Threads) -> Vec<Checked> {
    checked(&threads.map(scenes, |_, scene| values(scene)).concat())
}

/// The table, a line a check.
pub fn table(checks: &[Checked]) -> String {
    let row = |of: &Checked| {
        vec![
            of.row.name.to_string(),
            of.judged.to_string(),
            of.contradictions.len().to_string(),
            of.greatest.map_or("-".into(), |greatest| num::fixed(greatest, 2)),
            num::fixed(of.row.limit, 2),
            format!("{}: {}", of.row.unit, of.row.meaning),
        ]
    };
    let heads = ["check", "road users", "contradict", "greatest", "limit", "unit"].map(String::from).to_vec();
    Aligned { indent: 0, labels: 1, words: 1, heads, rows: checks.iter().map(row).collect() }.text(WIDTH)
}

/// A line for each check that somebody contradicts.
pub fn lines(checks: &[Checked]) -> Vec<String> {
    let line = |of: &Checked| {
        let named = of.contradictions.iter().take(NAMED_MAX);
        let named = named.map(|who| format!("{} of {} ({})", who.track, who.scene, num::fixed(who.value, 2)));
        let more = of.contradictions.len().saturating_sub(NAMED_MAX);
        let more = if more > 0 { format!(" and {more} more, which --json lists") } else { String::new() };
        format!(
            "contradiction: {}: {} of {} above {} {} ({}): {}{more}",
            of.row.name,
            counted(of.contradictions.len(), "road user"),
            of.judged,
            num::fixed(of.row.limit, 2),
            of.row.unit,
            of.row.meaning,
            named.collect::<Vec<_>>().join(", "),
        )
    };
    checks.iter().filter(|of| !of.contradictions.is_empty()).map(line).collect()
}
