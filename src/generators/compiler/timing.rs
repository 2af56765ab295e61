//! The timing slot: when an actor's motion is changed.

use crate::adapters::vocabulary;
use crate::motion::Window;
use crate::scene::{DT_S, TrackIx};
use crate::stage::scripted::EGO_TRIGGER;
use crate::stage::{Settings, Situation, StageError};

/// Shortest window that is used, steps.
const STEPS_MIN: usize = 10;

/// The window of an actor, which is the `place.0`-th of `place.1` adversaries, clamped so that at least a second of the scene follows its start; `None` where that does
/// not fit or the actor was not observed just before it.
pub fn window(
    situation: &Situation,
    actor: TrackIx,
    place: (usize, usize),
    kind: &str,
    settings: &Settings,
) -> Result<Option<Window>, StageError> {
    let facts = situation.facts(actor);
    if kind == EGO_TRIGGER {
        let from_step = situation.first_step();
        let steps = situation.scene.steps.saturating_sub(from_step);
        return Ok((steps > 0).then_some(Window { from_step, steps }));
    }
    let delay_s = match kind {
        "after_history" => 0.0,
        "conflict_window" => {
            let conflict_s = facts.and_then(|f| f.value("time_to_conflict_s")).unwrap_or(0.0);
            conflict_s - settings.number("lead_s")?
        }
        "timed_window" => {
            let mut values = facts.map_or(vec![0.0; vocabulary::ACTOR.len()], |f| f.values.clone());
            values.extend([place.0 as f64, place.1 as f64]);
            settings.module("start")?.number(values)
        }
        other => return Err(StageError::Missing(format!("operator {other}"))),
    };
    let first = situation.first_step();
    let Some(last) = situation.scene.steps.checked_sub(STEPS_MIN).filter(|last| *last >= first) else {
        return Ok(None);
    };
    let delay = (delay_s / DT_S).round().clamp(0.0, 1e6) as usize;
    let from_step = (first + delay).min(last);
    let asked = (settings.number("duration_s")? / DT_S).round().clamp(STEPS_MIN as f64, 1e6) as usize;
    let window = Window { from_step, steps: asked.min(situation.scene.steps - from_step) };
    let appears = situation.as_guest(actor).is_some();
    Ok((appears || situation.track(actor).at(from_step - 1).is_some()).then_some(window))
}
