//! The generated worlds of the MetaDrive set, for tests and benches that want scenes as studies have them.

use std::path::Path;
use std::sync::Arc;

use evodrive::compiler::Situation;
use evodrive::ego::Policy;
use evodrive::kernel::Seed;
use evodrive::synth::{SynthOptions, pool_member};

/// Reads the MetaDrive protocol's file.
pub fn protocol() -> toml::Table {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("experiments/protocols/metadrive.toml");
    std::fs::read_to_string(path).expect("a shipped file").parse().expect("TOML")
}

/// Returns the options by which its scenes are generated.
pub fn options() -> SynthOptions {
    protocol()["scenes"]["options"].clone().try_into().expect("options of generated worlds")
}

/// Scenes of a seed one after the other, prepared against the IDM ego.
pub fn prepared(options: &SynthOptions, seed: u64) -> impl Iterator<Item = Situation> {
    let scene = move |index| pool_member(options, Seed(seed), index).expect("a generated scene");
    (0..).map(move |index| Situation::new(Arc::new(scene(index)), &Policy::Idm).expect("an undisturbed rollout"))
}

/// The first `count` of them.
pub fn situations(options: &SynthOptions, seed: u64, count: usize) -> Vec<Situation> {
    prepared(options, seed).take(count).collect()
}
