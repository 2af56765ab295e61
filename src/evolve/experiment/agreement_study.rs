//! The validity study of `experiments/agreement` for scenes of a user's own: the same programs in both simulators.

use std::fmt::Write as _;
use std::path::Path;

use super::key::Range;
use super::starter::{named_source, usable_in};
use super::{ExperimentError, OptionError};
use crate::families;
use crate::objects::FamilyName;
use crate::scene::{Pool, Scene, usable};

/// The shipped study in MetaDrive: which version and which options are compared with.
const METADRIVE: &str = include_str!("../../../experiments/agreement/metadrive.toml");
/// Most scenes that the one proposal of the study is tried in; all others are held out, and labelled without it.
const EVOLUTION_MAX: usize = 14;
/// Most scenes of a window.
const WINDOW_MAX: usize = 8;

/// The three files of a study, each with its text, in the order in which they are based on each other.
///
/// `typed` is the pool's path as it was named, `scenes` as the files name it, seen from their folder. Each of `families` is a lineage
/// against IDM, and one more repeats the recording as the ego, where all scenes have one: those of CommonRoad have none.
///
/// # Errors
/// A name that no run folder can have; a family that is unknown, named twice or staged; fewer than two usable scenes.
pub fn agreement_study(
    name: &str,
    typed: &Path,
    scenes: &Path,
    pool: &Pool,
    families: &[String],
) -> Result<[(&'static str, String); 3], ExperimentError> {
    let option = |error| ExperimentError::Option { file: "agree init".into(), error };
    Range::Name.check("NAME", &toml::Value::String(name.into())).map_err(option)?;
    let families = known(families).map_err(option)?;
    let count = usable_in(typed, pool, false)?;
    let evolution = (count / 2).clamp(1, EVOLUTION_MAX);
    let mut study = format!(
        "# The programs that are compared, in whichever simulator: one epoch of one proposal, because what is compared are labels of the\n\
         # programs that lineages start from. `evodrive agree` compares the two runs.\n\
         base = \"evodrive:metadrive\"\n\n[scenes]\n{}\n\n[split]\nevolution = {{ count = {evolution} }}\nheld_out = {}\nwindow = {}\n\n\
         [budget]\nepochs = 1\nslots = 1\nmax_repair_rounds = 0\nprobe_scenes = {}\nfinalists = 1\n\n\
         # MetaDrive's car, brakes and quirks, as measured (docs/PLANT.md).\n[simulator]\nplant = \"metadrive-0.4.3\"\n",
        named_source(scenes),
        count - evolution,
        evolution.min(WINDOW_MAX),
        evolution.min(3),
    );
    for family in &families {
        let _ = write!(study, "\n[[lineage]]\nid = \"{family}\"\nfamily = \"{family}\"\nego = \"idm\"\n");
    }
    if let Some(first) = families.first().filter(|_| pool.scenes.iter().all(ego_is_recorded)) {
        let _ = write!(study, "\n[[lineage]]\nid = \"{first}-replay\"\nfamily = \"{first}\"\nego = \"replay\"\n");
    }
    let own = format!(
        "# The study in our own simulator.\nbase = \"study.toml\"\nname = \"{name}-evodrive\"\n\
         describes = \"{name} in our own simulator, for comparison with MetaDrive\"\ncassette = \"evodrive.jsonl\"\n\n\
         [simulator]\nbackend = \"evodrive\"\n"
    );
    let backend = METADRIVE.split_once("[simulator.backend]").map_or("", |(_, backend)| backend);
    let recorded = "\"../../cassettes/agreement/metadrive-rollouts.jsonl.zst\"";
    let other = format!(
        "# The study in MetaDrive. What it simulates is recorded: to replay it takes neither Python nor MetaDrive.\nbase = \"study.toml\"\n\
         name = \"{name}-metadrive\"\ndescribes = \"{name} in MetaDrive, for comparison with our own simulator\"\n\
         cassette = \"metadrive.jsonl\"\n\n[simulator.backend]{}",
        backend.replace(recorded, "\"metadrive-rollouts.jsonl.zst\"")
    );
    Ok([("study.toml", study), ("evodrive.toml", own), ("metadrive.toml", other)])
}

/// Returns `true` if an ego that repeats the recording can drive the scene, if anybody can.
fn ego_is_recorded(scene: &Scene) -> bool {
    let ego = &scene.ego;
    usable(scene).is_err() || ego.track.samples.iter().skip(ego.start_step).all(Option::is_some)
}

/// The families in their order; of recorded traffic each.
fn known(named: &[String]) -> Result<Vec<FamilyName>, OptionError> {
    let sources = families::sources();
    let recorded: Vec<String> = sources
        .iter()
        .filter(|of| of.contract.backend == "metadrive" && of.asks.counsel.is_none())
        .map(|of| of.contract.family.to_string())
        .collect();
    let mut families: Vec<FamilyName> = Vec::new();
    for name in named {
        if !recorded.contains(name) {
            return Err(OptionError::word("--family", name, &recorded));
        }
        let family = FamilyName::new(name.as_str());
        if families.contains(&family) {
            return Err(OptionError::new("--family", format!("{name:?} twice"), "each family once"));
        }
        families.push(family);
    }
    Ok(families)
}
