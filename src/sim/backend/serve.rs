//! Our own simulator as a worker: the code behind a line to `evodrive worker`. It shows how the protocol is meant, and a run
//! behind it has the same labels as a run without it.

use std::collections::BTreeMap;
use std::sync::Arc;

use serde::Deserialize;
use serde_json::{Value, json};

use super::answer::{Answer, AnswerLine};
use super::request::{Commanded, PROTOCOL};
use super::spec::OWN;
use crate::ego::Policy;
use crate::kernel::Digest;
use crate::scene::{PreparedScene, Sample, Scene};
use crate::sim::{Action, ActorRef, Intervention, Plant, PlantOptions, SIM_VERSION, SimulatorOptions, tell};

/// Name under which our own simulator serves. It differs from the name of the one that needs no worker.
const NAME: &str = "evodrive-worker";
/// The egos that it serves, apart from scenes that only the undisguised simulator has.
const EGOS: [&str; 3] = ["idm", "idm-lights", "replay"];

/// A line to write.
pub type Served = Vec<u8>;

/// Returns the greeting.
pub fn hello() -> Served {
    let version = SIM_VERSION.to_string();
    let digest = Digest::of_bytes(format!("{OWN} {NAME} {PROTOCOL} {version}").as_bytes());
    let said = json!({
        "evodrive_worker": PROTOCOL, "backend": NAME, "version": version, "digest": digest, "egos": EGOS,
    });
    said.to_string().into_bytes()
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Asked {
    request: Digest,
    scene: Scene,
    first_step: usize,
    steps: usize,
    ego: String,
    #[serde(rename = "seed")]
    _seed: u64,
    adversaries: Vec<Commanded>,
    options: BTreeMap<String, Value>,
}

/// Answers a line. A line that is no request is an error, which says so.
pub fn serve(line: &[u8]) -> Result<Served, String> {
    let asked: Asked = serde_json::from_slice(line).map_err(|error| format!("not a rollout request: {error}"))?;
    let request = asked.request;
    let answer = match played(asked) {
        Ok(answer) => answer,
        Err(reason) => Answer::Failed(reason.into()),
    };
    Ok(AnswerLine::of(request, &answer).to_bytes())
}

fn played(asked: Asked) -> Result<Answer, String> {
    let Asked { mut scene, first_step, steps, ego, adversaries, mut options, .. } = asked;
    let law = options.remove("plant").ok_or("options need `plant`, the law of docs/PLANT.md")?;
    if let Some(other) = options.keys().next() {
        return Err(format!("option `{other}` is unknown; there is `plant`"));
    }
    let plant: PlantOptions = serde_json::from_value(law).map_err(|error| error.to_string())?;
    let simulator = SimulatorOptions { plant, ..SimulatorOptions::SHIPPED };
    simulator.check().map_err(|error| error.to_string())?;
    let policy: Policy = ego.parse().map_err(|error: crate::ego::policy::PolicyError| error.to_string())?;
    sound(&scene)?;
    if first_step >= scene.steps {
        return Err(format!("first_step is {first_step}, the scene has {} steps", scene.steps));
    }
    let carried_out = |of| action(of, &mut scene, first_step);
    let actions = adversaries.into_iter().map(carried_out).collect::<Result<_, String>>()?;
    sound(&scene)?;
    let scene = PreparedScene::new(Arc::new(scene));
    let plant = Plant::with_options(scene, &simulator).map_err(|error| error.to_string())?;
    if (plant.first_step(), plant.steps()) != (first_step, steps) {
        return Err(format!("the scene has {} steps from {} on", plant.steps(), plant.first_step()));
    }
    let rollout =
        tell(&plant, &Intervention { actions }, policy.driver().as_mut()).map_err(|error| error.to_string())?;
    Ok(Answer::ReportedRollout(rollout))
}

/// Refuses a scene that breaks a rule: the sender may be another program than ours, and what a scene costs is bounded by what a sound one
/// may hold. It is asked again when commands are in its recordings.
fn sound(scene: &Scene) -> Result<(), String> {
    let broken =
        |violation| format!("the scene breaks a rule of a sound scene: {violation}; correct it where it comes from");
    scene.validate().first().map_or(Ok(()), |violation| Err(broken(violation)))
}

/// Returns the action that carries a command out. A recorded road user may be away for a while: its commands before it comes back then
/// replace its recording, which an action leaves as it is up to its first step.
fn action(commanded: Commanded, scene: &mut Scene, first_step: usize) -> Result<Action, String> {
    let Commanded { who, kind, length_m, width_m, samples } = commanded;
    let until = samples.iter().rposition(Option::is_some).ok_or_else(|| format!("{who:?} has no sample"))?;
    let from = samples[..until].iter().rposition(Option::is_none).map_or(0, |away| away + 1);
    let away_between = samples[..from].iter().any(Option::is_some);
    let driven: Vec<Sample> = samples[from..=until].iter().flatten().copied().collect();
    let from_step = first_step + from;
    match who {
        ActorRef::Track(track) => {
            let (tracks, steps) = (scene.tracks.len(), scene.steps);
            let recorded = scene.tracks.get_mut(track).ok_or_else(|| format!("track {track} of {tracks}"))?;
            if away_between {
                recorded.samples.truncate(first_step);
                recorded.samples.extend_from_slice(&samples);
                recorded.samples.resize(steps.max(recorded.samples.len()), None);
            }
            Ok(Action::Follow { track, from_step, samples: driven })
        }
        ActorRef::Inserted(_) if away_between => {
            Err(format!("{who:?} is away between two samples, which no action of ours can say"))
        }
        ActorRef::Inserted(_) => Ok(Action::Insert { kind, length_m, width_m, from_step, samples: driven }),
    }
}
