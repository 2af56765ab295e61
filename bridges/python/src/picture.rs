//! An episode as a picture, by the painter of films.

use pyo3::prelude::*;
use pyo3::types::PyBytes;

use evodrive::draw::{Actor, Drawing, Film, FilmOptions, Frame, Role, Theme, film, role_of};
use evodrive::kernel::Threads;
use evodrive::scene::{Sample, TrackIx};
use evodrive::sim::{ActorRef, ActorTrace, Episode, Trace};

use crate::refused;

/// From the ego to the sides of the picture, metres.
const HALF_M: f64 = 45.0;

/// A picture's height and width, and rows of red, green and blue.
pub type Picture<'py> = (usize, usize, Bound<'py, PyBytes>);

/// The present moment, the ego in the middle; these tracks are drawn as if the data set had marked them.
pub fn picture<'py>(
    py: Python<'py>,
    episode: &Episode<'_>,
    marked: &[TrackIx],
    width_px: f64,
    title: &str,
) -> PyResult<Picture<'py>> {
    let motion =
        episode.motion().ok_or_else(|| refused("motion is not kept; make it with render_mode=\"rgb_array\""))?;
    let film = painted(episode, motion, marked, width_px, title).map_err(refused)?;
    let rgb = film.pictures.first().ok_or_else(|| refused("the painter made no picture"))?;
    Ok((film.height, film.width, PyBytes::new(py, rgb)))
}

fn painted(
    episode: &Episode<'_>,
    motion: &Trace,
    marked: &[TrackIx],
    width_px: f64,
    title: &str,
) -> Result<Film, String> {
    let view = episode.observe();
    let scene = view.plant().scene();
    let mut drawing = Drawing::of_scene(scene);
    let before = motion.from_step;
    let told = |samples: &mut dyn Iterator<Item = Option<Sample>>| -> Vec<Option<[f64; 4]>> {
        let point = |s: Sample| [s.position.x, s.position.y, s.heading_rad, s.speed_mps()];
        std::iter::repeat_n(None, before).chain(samples.map(|sample| sample.map(point))).collect()
    };
    let of = |actor: &ActorTrace| {
        let (label, role) = match (actor.actor, actor.adversary) {
            (ActorRef::Track(track), true) => (scene.tracks[track].id.clone(), Role::Adversary),
            (ActorRef::Track(track), false) => {
                let marked = scene.objects_of_interest.contains(&track) || marked.contains(&track);
                (scene.tracks[track].id.clone(), role_of(&scene.tracks[track], marked))
            }
            (ActorRef::Inserted(_), _) => ("inserted".to_string(), Role::Adversary),
        };
        let samples = told(&mut actor.samples.iter().copied());
        Actor { label, role, length_m: actor.length_m, width_m: actor.width_m, samples }
    };
    let ego = Actor {
        label: "ego".into(),
        role: Role::Ego,
        length_m: 2.0 * view.ego().size.half_length_m,
        width_m: 2.0 * view.ego().size.half_width_m,
        samples: told(&mut motion.ego.iter().copied().map(Some)),
    };
    drawing.actors = motion.actors.iter().map(of).chain([ego]).collect();
    drawing.steps = before + motion.ego.len();
    drawing.contact = None;
    let now = drawing.steps - 1;
    for light in &mut drawing.lights {
        // A contact within a step is drawn one step later.
        let last = light.states.last().copied();
        light.states.resize_with(drawing.steps, || last.unwrap_or(evodrive::scene::LightState::Unknown));
    }
    let frame = Frame::Square { centre: view.ego().sample.position, half_m: HALF_M };
    let options = FilmOptions { width_px, theme: Theme::Light, frame, steps: vec![now], title: title.into() };
    film(&drawing, &options, &Threads::none()).map_err(|error| error.to_string())
}
