//! What compiling costs: every recorded-traffic family's parent program on the same generated scenes against the IDM
//! ego, one thread. A scene's situation (lane graph, features, the ego's undisturbed rollout, road field) is prepared
//! beforehand, as a study prepares it once for all programs; motion, search and choice are in the figure.

use std::sync::{Arc, OnceLock};

use divan::{Bencher, counter::ItemsCount};
use evodrive::compiler::{Prepared, Situation};
use evodrive::ego::Policy;
use evodrive::families::sources;
use evodrive::kernel::Seed;
use evodrive::objects::FamilyName;
use evodrive::synth::{SynthOptions, WorldKind, pool_member};

/// Four scenes of every kind of world.
const SCENES: usize = 4 * WorldKind::ALL.len();

fn main() {
    divan::main();
}

/// The worlds of the MetaDrive set.
fn options() -> SynthOptions {
    SynthOptions {
        kinds: WorldKind::ALL.to_vec(),
        steps: 91,
        current_step: 10,
        warm_up_s: 12.0,
        tracks_per_scene: 16,
        pedestrian_share: 0.1,
        cyclist_share: 0.1,
        following_share: 0.3,
        ego_travel_m_min: 10.0,
        interaction_time_s_max: 3.0,
        interaction_gap_m_max: 12.0,
        attempts_max: 40,
    }
}

fn situations() -> &'static [Situation] {
    static SITUATIONS: OnceLock<Vec<Situation>> = OnceLock::new();
    SITUATIONS.get_or_init(|| {
        let scene = |index| pool_member(&options(), Seed(500), index).expect("a generated scene");
        let prepared = |index| Situation::new(Arc::new(scene(index)), &Policy::Idm).expect("an undisturbed rollout");
        let situations: Vec<Situation> = (0..SCENES).map(prepared).collect();
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
