//! Scenes whose recorded ego itself touches somebody. Such a scene can be used, but a crash in it shows nothing: the boxes of
//! the recording overlap, or the recorded drive ended badly, before any program or planner had a say.

use std::path::PathBuf;

use serde::Serialize;

use crate::cli::terminal::shell::quoted;
use crate::ego::Policy;
use crate::kernel::Threads;
use crate::scene::Scene;
use crate::sim::{ActorRef, Intervention, Plant, ending};
use crate::text::counted;

/// Scenes that a line names before it counts.
const NAMED_MAX: usize = 20;

/// A recorded ego's first contact in its own recording.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RecordedCrash {
    /// Id of the scene.
    pub scene: String,
    /// Whom the ego touches: the id of the track.
    pub with: String,
    /// Time since the first simulated step, s.
    pub at_s: f64,
}

/// The contact of a scene's ego when everybody moves as recorded. `None` where it touches nobody, where its drive was not
/// recorded, and where the scene cannot be simulated, which [`super::pools::fault`] says.
pub fn recorded_crash(scene: &Scene) -> Option<RecordedCrash> {
    let plant = Plant::new(scene).ok()?;
    let (_, contact) = ending(&plant, &Intervention::default(), Policy::Replay.driver().as_mut()).ok()?;
    let contact = contact?;
    let with = match contact.with {
        ActorRef::Track(ix) => scene.tracks.get(ix).map(|track| track.id.clone())?,
        ActorRef::Inserted(_) => return None,
    };
    Some(RecordedCrash { scene: scene.id.clone(), with, at_s: contact.time_s })
}

/// Returns the recorded crashes of a pool, in its order.
pub fn of_pool(scenes: &[Scene], threads: &Threads) -> Vec<RecordedCrash> {
    threads.map(scenes, |_, scene| recorded_crash(scene)).into_iter().flatten().collect()
}

/// Says how many scenes there are, which ones, and what to do; no line if there is no such scene. `from` are the files that hold them.
pub fn lines(crashes: &[RecordedCrash], all: usize, from: &[PathBuf]) -> Vec<String> {
    let Some(first) = crashes.first() else { return Vec::new() };
    let named =
        crashes.iter().take(NAMED_MAX).map(|of| format!("{} (touches {} after {:.1} s)", of.scene, of.with, of.at_s));
    let more = crashes.len().saturating_sub(NAMED_MAX);
    let more = if more > 0 { format!(" and {more} more, which --json lists") } else { String::new() };
    let from: Vec<String> = from.iter().map(|path| quoted(&path.to_string_lossy())).collect();
    // If there are several files, it is no longer known which one holds the scene.
    let shown = match from.as_slice() {
        [one] => {
            vec![format!("  to look at one: evodrive scenes show {one} {} --html scene.html", quoted(&first.scene))]
        }
        _ => Vec::new(),
    };
    let said = vec![
        format!(
            "recorded crash: in {} of {all} the recorded ego itself touches somebody: {}{more}",
            counted(crashes.len(), "scene"),
            named.collect::<Vec<_>>().join(", "),
        ),
        "  such a scene is used like any other, and a crash in it may be the recording's and not your planner's"
            .to_string(),
    ];
    let left_out = format!(
        "  to leave them out: evodrive scenes filter {} --without-crashes --out no_crashes.pool",
        from.join(" ")
    );
    said.into_iter().chain(shown).chain([left_out]).collect()
}
