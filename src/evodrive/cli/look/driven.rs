//! An episode that was driven from outside, as a rollout to be shown: simulated again from its controls, and compared with its record.

use serde::Deserialize;
use std::path::Path;

use crate::cli::look::rollout::Played;
use crate::cli::scenes::files;
use crate::cli::terminal::exit::Failure;
use crate::kernel::Digest;
use crate::objects::SolutionId;
use crate::scene::PreparedScene;
use crate::sim::{Control, Intervention, Outcome, Plant, Repeated, SimulatorOptions, assess, commands, rollout_traced};
use crate::store;
use std::path::PathBuf;
use std::sync::Arc;

/// Most bytes of a file.
const BYTES_MAX: u64 = 1 << 28;
/// Name and version of the format.
const FORMAT: &str = "evodrive-episode/1";

/// An episode as `evodrive.gym` writes it.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Driven {
    format: String,
    scene: String,
    scene_digest: Digest,
    program: String,
    intervention: Intervention,
    simulator: SimulatorOptions,
    /// Acceleration, m/s², and steering, radians, of each decision.
    controls: Vec<[f64; 2]>,
    outcome: Outcome,
}

/// The episode of a file, in its scene of the pool.
///
/// # Errors
/// A file of another form, a pool without its scene, an episode that comes out otherwise.
pub fn played(file: &Path, pool: &PathBuf, jobs: usize) -> Result<Played, Failure> {
    let place = file.display();
    let read = |error: &dyn std::fmt::Display| {
        Failure::bad_input(format!("{place}: {error}; expected an episode of evodrive.gym ({FORMAT})"))
    };
    let driven: Driven =
        serde_json::from_slice(&store::read_bounded(file, BYTES_MAX)?).map_err(|error| read(&error))?;
    if driven.format != FORMAT {
        return Err(read(&format!("format {:?}", driven.format)));
    }
    let scenes = files::read(std::slice::from_ref(pool), jobs)?;
    let scene = files::named(&scenes, pool, &driven.scene)?;
    if scene.digest() != driven.scene_digest {
        return Err(Failure::divergence(format!(
            "{place}: scene {} is another one in {} than it was driven in; name the pool that it was trained with",
            driven.scene,
            pool.display()
        )));
    }
    let prepared = PreparedScene::new(Arc::new(scene.clone()));
    let plant = Plant::with_options(prepared, &driven.simulator).map_err(Failure::bad_input)?;
    let control = |[acceleration_mps2, steering_rad]: &[f64; 2]| Control::Drive {
        acceleration_mps2: *acceleration_mps2,
        steering_rad: *steering_rad,
    };
    let controls: Vec<Control> = driven.controls.iter().map(control).collect();
    let mut again = Repeated::new(&controls, false);
    // An episode that goes on where it ended is asked for a control that it has not.
    let otherwise = |error| Failure::divergence(format!("{place}: the episode does not come out as recorded: {error}"));
    let (mut outcome, motion) = rollout_traced(&plant, &driven.intervention, &mut again).map_err(otherwise)?;
    assess(&plant, &driven.intervention, &mut again, &mut outcome).map_err(Failure::bad_input)?;
    if outcome != driven.outcome {
        return Err(Failure::divergence(format!(
            "{place}: the episode ends {:?} after {} steps ({}), {:?} after {} ({}) are recorded",
            outcome.end, outcome.steps, outcome.trace, driven.outcome.end, driven.outcome.steps, driven.outcome.trace
        )));
    }
    let commanded = commands(&plant, &driven.intervention);
    let (scene, intervention) = (scene.clone(), driven.intervention);
    let solution = SolutionId::new(format!("an episode under {}", driven.program));
    Ok(Played { solution, scene, outcome, decision: None, intervention, commanded, motion })
}
