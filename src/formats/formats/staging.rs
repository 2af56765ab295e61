//! A scene as a rollout played it: motions that replace logged ones, and inserted road users. This module knows no
//! simulator; the caller fills it in.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::ops::Range;

use super::export_error::{ExportError, Note, sound};
use crate::scene::validate::STEPS_MAX;
use crate::scene::{AgentKind, DT_S, LightState, Sample, Scene, Track, TrackIx};

/// Motion from `from_step` on, one sample a step; before it every road user moves as logged.
#[derive(Clone, Debug, PartialEq)]
pub struct Staging {
    /// Id of the scene as played, which is another scene than the logged one.
    pub id: String,
    /// The first simulated step of the scene.
    pub from_step: usize,
    /// Motion of the ego; the scene as played ends with it. `None` leaves the log.
    pub ego: Option<Vec<Sample>>,
    /// Tracks whose motion differs from the log; the others keep their log.
    pub tracks: BTreeMap<TrackIx, Vec<Option<Sample>>>,
    /// Road users that the logged scene does not have; they follow its tracks in order.
    pub inserted: Vec<Inserted>,
    /// Share of the last step, above 0 and at most 1, after which a rollout stopped within it, as at a contact: the last samples lie
    /// there. They are carried on at their own velocity to the full step.
    pub last_step_share: Option<f64>,
}

/// A road user that a rollout inserted.
#[derive(Clone, Debug, PartialEq)]
pub struct Inserted {
    /// Kind of road user.
    pub kind: AgentKind,
    /// Length of its box, metres.
    pub length_m: f64,
    /// Width of its box, metres.
    pub width_m: f64,
    /// Samples, one a step of the scene; `None` where it is not there. `[steps]`
    pub samples: Vec<Option<Sample>>,
}

/// Returns the scene to export: the logged one as it is, or as played.
pub(super) fn staged<'s>(
    scene: &'s Scene,
    staging: Option<&Staging>,
    notes: &mut Vec<Note>,
) -> Result<Cow<'s, Scene>, ExportError> {
    let Some(staging) = staging else {
        sound(scene)?;
        return Ok(Cow::Borrowed(scene));
    };
    staging.applied_to(scene, notes).map(Cow::Owned)
}

impl Staging {
    /// Returns the scene as played: it ends with the ego's motion where that is given. Road users first seen later are left
    /// out and named in the notes.
    ///
    /// # Errors The staging names tracks that the scene does not have, is too long, or breaks a rule of a valid scene.
    pub fn applied_to(&self, scene: &Scene, notes: &mut Vec<Note>) -> Result<Scene, ExportError> {
        let steps = self.checked_steps(scene)?;
        let mut played = scene.clone();
        played.id = self.id.clone();
        played.steps = steps;
        played.current_step = scene.current_step.min(steps.saturating_sub(1));
        if let Some(samples) = &self.ego {
            let samples: Vec<Option<Sample>> = samples.iter().copied().map(Some).collect();
            played.ego.track.samples = self.joined(&scene.ego.track.samples, &samples, steps);
        }
        played.ego.track.samples.resize(steps, None);
        for (&track, samples) in &self.tracks {
            played.tracks[track].samples = self.joined(&scene.tracks[track].samples, samples, steps);
        }
        for track in &mut played.tracks {
            track.samples.resize(steps, None);
        }
        self.insert(&mut played, steps);
        for light in &mut played.lights {
            let last = light.states.last().copied().unwrap_or(LightState::Unknown);
            light.states.resize(steps, last);
        }
        drop_unseen(&mut played, notes);
        if self.last_step_share.is_some_and(|share| share < 1.0) {
            notes.push(Note::new("", "the rollout stopped within its last step; the last samples are carried on at their own velocity to the end of that step"));
        }
        sound(&played)?;
        Ok(played)
    }

    fn checked_steps(&self, scene: &Scene) -> Result<usize, ExportError> {
        let refuse =
            |found: String, expected: String| Err(ExportError::Staging { scene: scene.id.clone(), found, expected });
        if let Some((track, _)) = self.tracks.range(scene.tracks.len()..).next() {
            return refuse(format!("track {track}"), format!("a track below {}", scene.tracks.len()));
        }
        if self.from_step > scene.steps {
            return refuse(format!("from_step {}", self.from_step), format!("a step up to {}", scene.steps));
        }
        if let Some(share) = self.last_step_share.filter(|share| !(*share > 0.0 && *share <= 1.0)) {
            return refuse(format!("last_step_share {share}"), "a share above 0, at most 1".into());
        }
        let steps = self.ego.as_ref().map_or(scene.steps, |ego| self.from_step.saturating_add(ego.len()));
        if !(2..=STEPS_MAX).contains(&steps) {
            return refuse(format!("{steps} steps"), format!("2 to {STEPS_MAX} steps"));
        }
        Ok(steps)
    }

    /// Returns the log before `from_step`, then the samples, `steps` in all.
    fn joined(&self, log: &[Option<Sample>], samples: &[Option<Sample>], steps: usize) -> Vec<Option<Sample>> {
        let mut all: Vec<Option<Sample>> = log.iter().copied().take(self.from_step).collect();
        all.resize(self.from_step, None);
        all.extend(samples);
        let ends_with_rollout = self.from_step + samples.len() == steps;
        if let (Some(share), Some(Some(last)), true) = (self.last_step_share, all.last_mut(), ends_with_rollout) {
            last.position = last.position + last.velocity * ((1.0 - share) * DT_S);
        }
        all.resize(steps, None);
        all
    }

    fn insert(&self, played: &mut Scene, steps: usize) {
        for (number, inserted) in self.inserted.iter().enumerate() {
            let taken = |id: &str| played.ego.track.id == id || played.tracks.iter().any(|track| track.id == id);
            let mut id = format!("inserted_{number}");
            while taken(&id) {
                id.push('_');
            }
            played.tracks.push(Track {
                id,
                kind: inserted.kind,
                length_m: inserted.length_m,
                width_m: inserted.width_m,
                samples: self.joined(&[], &inserted.samples, steps),
            });
        }
    }
}

/// Leaves out road users that are never observed in the rest of the scene.
fn drop_unseen(played: &mut Scene, notes: &mut Vec<Note>) {
    let mut places: Vec<Option<TrackIx>> = Vec::with_capacity(played.tracks.len());
    let mut kept = 0;
    for (ix, track) in played.tracks.iter().enumerate() {
        let seen = track.span().is_some();
        places.push(seen.then_some(kept));
        kept += usize::from(seen);
        if !seen {
            let reason = "it is first seen after the rollout ended and is left out";
            notes.push(Note::new(format!("tracks[{ix}] {:?}", track.id), reason));
        }
    }
    played.tracks.retain(|track| track.span().is_some());
    let interest = std::mem::take(&mut played.objects_of_interest);
    played.objects_of_interest = interest.into_iter().filter_map(|ix| places.get(ix).copied().flatten()).collect();
}

/// Returns the steps from `from` on in which a track is seen without a gap.
pub(super) fn stretches(track: &Track, from: usize) -> Vec<Range<usize>> {
    let mut ranges: Vec<Range<usize>> = Vec::new();
    for (step, _) in track.samples.iter().enumerate().skip(from).filter(|(_, sample)| sample.is_some()) {
        match ranges.last_mut() {
            Some(last) if last.end == step => last.end += 1,
            _ => ranges.push(step..step + 1),
        }
    }
    ranges
}

/// Returns the height where no data set gave one, metres: a car, a person, a person on a bicycle, a barrier.
pub(super) fn height_m(track: &Track) -> f64 {
    match track.kind {
        AgentKind::Vehicle if track.length_m > 7.0 => 3.2,
        AgentKind::Vehicle => 1.5,
        AgentKind::Pedestrian | AgentKind::Cyclist => 1.75,
        AgentKind::Static => 1.0,
    }
}
