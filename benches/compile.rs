//! Cost of compiling: every recorded-traffic family's parent program on the same generated scenes against the IDM
//! ego, one thread. A scene's situation (lane graph, features, the ego's undisturbed rollout, road field) is prepared
//! beforehand, as a study prepares it once for all programs; motion, search and choice are in the figure.

use std::sync::OnceLock;

use divan::{Bencher, counter::ItemsCount};
use evodrive::compiler::{Prepared, Situation};
use evodrive::families::sources;
use evodrive::kernel::Seed;
use evodrive::objects::FamilyName;
use evodrive::synth::WorldKind;

#[path = "../tests/all/worlds.rs"]
mod worlds;

/// Four scenes of every kind of world.
const SCENES: usize = 4 * WorldKind::ALL.len();

fn main() {
    divan::main();
}

fn situations() -> &'static [Situation] {
    static SITUATIONS: OnceLock<Vec<Situation>> = OnceLock::new();
    SITUATIONS.get_or_init(|| {
        let situations = worlds::situations(&worlds::options(), 500, SCENES);
        for situation in &situations {
            situation.road_field();
        }
        situations
    })
}

#[divan::bench(
    args = ["king", "strive", "at", "adv_bmt", "sage", "seal", "cat", "llm_attacker"],
    sample_count = 5,
    sample_size = 1
)]
fn scenes_compiled(bencher: Bencher<'_, '_>, name: &str) {
    let sources = sources();
    let source = sources.get(&FamilyName::new(name)).expect("a family");
    let prepared = Prepared::new(&source.parent, source).expect("a legal parent");
    let run = || {
        let compiled = situations().iter().map(|s| prepared.compile(s, Seed(1)).expect("a constraint that holds"));
        compiled.filter(|compiled| compiled.decision.applies).count()
    };
    situations();
    bencher.counter(ItemsCount::new(SCENES)).bench_local(run);
}
