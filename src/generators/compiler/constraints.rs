//! Γ: what every intervention must satisfy, however it was found. These are the limits of what is a drivable motion at
//! all; how good a motion is, the realism diagnostics say.

use super::CompileFailure;
use crate::kernel::{Extent, Vec2};
use crate::motion::Candidate;
use crate::scene::DT_S;
use crate::stage::{Part, Situation};

/// Γ_dyn: nothing on a road is faster, m/s.
const SPEED_MPS_MAX: f64 = 70.0;
/// Γ_map: how far beyond everything known of a scene a road user may get, metres.
const MARGIN_M: f64 = 300.0;

/// Checks the constraints that κ names.
pub fn check(
    situation: &Situation,
    part: &Part,
    candidate: &Candidate,
    names: &[String],
) -> Result<(), CompileFailure> {
    let named = |name: &str| names.iter().any(|n| n == name);
    let fail = |constraint: &'static str, k: usize, found: String, expected: &'static str| {
        let (scene, step) = (situation.scene_id().to_string(), part.window.from_step + k);
        Err(CompileFailure::Constraint { scene, constraint, actor: part.actor, step, found, expected })
    };
    if named("interface") && candidate.samples.len() > part.window.steps {
        let found = format!("{} samples", candidate.samples.len());
        return fail("interface", 0, found, "no more samples than the window has steps");
    }
    let Extent { low, high } = bounds(situation);
    let mut last: Option<Vec2> = None;
    for (k, sample) in candidate.samples.iter().enumerate() {
        let finite = sample.position.is_finite() && sample.velocity.is_finite() && sample.heading_rad.is_finite();
        if !finite {
            return fail("interface", k, "a number that is not finite".into(), "finite positions and velocities");
        }
        let p = sample.position;
        if named("map") && !(p.x >= low.x && p.y >= low.y && p.x <= high.x && p.y <= high.y) {
            return fail("map", k, format!("({:.1}, {:.1})", p.x, p.y), "a place within 300 m of the scene's road");
        }
        let stepped = last.map_or(0.0, |last| last.distance(p) / DT_S);
        let fastest = sample.speed_mps().max(stepped);
        if named("dynamics") && fastest > SPEED_MPS_MAX {
            return fail("dynamics", k, format!("{fastest:.1} m/s"), "at most 70 m/s");
        }
        last = Some(p);
    }
    Ok(())
}

/// The rectangle around road, route and actors, with its margin.
fn bounds(situation: &Situation) -> Extent {
    let scene = &situation.scene;
    let road = scene.road.lanes.iter().flat_map(|lane| &lane.centre).copied();
    let tracks = scene.tracks.iter().flat_map(|t| t.samples.iter().flatten().map(|s| s.position));
    Extent::around(road.chain(scene.ego.route.iter().copied()).chain(tracks)).grown(MARGIN_M)
}
