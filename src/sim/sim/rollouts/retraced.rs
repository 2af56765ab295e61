//! A recorded drive in our own simulator, driven once more: by the controls that were recorded with it, or by those that lead from each row
//! to the next. Motion that no car can do, another motion of anybody, and a missing contact or end show as the first difference.

use crate::kernel::num;
use crate::scene::Sample;
use crate::sim::accounts::outcome::{Contact, Trace};
use crate::sim::prepared::body::{SUBSTEP_S, SUBSTEPS};
use crate::sim::prepared::plant::Plant;
use crate::sim::prepared::plant_options::EgoCar;
use crate::sim::road_users::bicycle::Car;
use crate::sim::road_users::driver::{Control, Driver, View};
use crate::sim::road_users::intervention::Intervention;

use super::reenacted::tell;
use super::reported::{Pose, ReportedError, ReportedRollout};

/// Largest distance of a recorded pose from the one that its controls lead to: metres, m/s and rad. For the ego, controls computed from the
/// motion miss by rounding alone; road users that react to the ego miss by a little more.
const EGO_APART: f64 = 1e-5;
const OTHERS_APART: f64 = 1e-4;

/// Checks a recorded drive of our own simulator. A car on springs has more state than its poses hold: without controls its drive is
/// held to the limits of [`judge`](super::judge) alone.
///
/// # Errors
/// The first thing that comes out differently.
pub fn retraced(plant: &Plant, intervention: &Intervention, reported: &ReportedRollout) -> Result<(), ReportedError> {
    if reported.controls.is_empty() && plant.options().plant.ego_car == EgoCar::Sprung {
        return Ok(());
    }
    let driven = tell(plant, intervention, &mut Retraced::of_report(reported))?;
    let differs =
        |place: String, expected: String, found: String| Err(ReportedError::Motion { place, expected, found });
    for (row, (is, was)) in driven.ego.iter().zip(&reported.ego).enumerate() {
        if apart(is, was) > EGO_APART {
            let alone = reported.controls.is_empty();
            let why = if alone { "where a car within its limits comes" } else { "where its recorded controls lead" };
            return differs(format!("ego, row {row}"), format!("{}, {why}", at(is)), at(was));
        }
    }
    let ended = |of: &ReportedRollout| {
        let contact = of.contact.map(|contact| (contact.with, contact.step, contact.substep));
        let contact = contact.map_or(String::new(), |(with, step, substep)| {
            format!(" with {with:?} in step {step}, physics step {substep}")
        });
        format!("the end {:?}{contact} after {} rows", of.end, of.ego.len())
    };
    if ended(&driven) != ended(reported) || reported.contact.is_some_and(|contact| contact.boxes.is_some()) {
        return differs("its end".into(), ended(&driven), ended(reported));
    }
    let users = |of: &ReportedRollout| of.actors.iter().map(|actor| (actor.who, actor.from_step)).collect::<Vec<_>>();
    if users(&driven) != users(reported) {
        return differs("road_users".into(), format!("{:?}", users(&driven)), format!("{:?}", users(reported)));
    }
    for (i, (is, was)) in driven.actors.iter().zip(&reported.actors).enumerate() {
        for (row, (is, was)) in is.poses.iter().zip(&was.poses).enumerate() {
            let same = match (is, was) {
                (Some(is), Some(was)) => apart(is, was) <= OTHERS_APART,
                (is, was) => is.is_none() && was.is_none(),
            };
            if !same {
                let place = format!("road_users[{i}], row {}", row + reported.actors[i].from_step);
                let say = |pose: &Option<Pose>| pose.as_ref().map_or("nobody".into(), at);
                return differs(place, say(is), say(was));
            }
        }
    }
    Ok(())
}

fn at(pose: &Pose) -> String {
    let sample = &pose.sample;
    let (x, y) = (num::fixed(sample.position.x, 4), num::fixed(sample.position.y, 4));
    format!("({x}, {y}) m at {} rad and {} m/s", num::fixed(sample.heading_rad, 4), num::fixed(sample.speed_mps(), 3))
}

/// Returns the largest difference of two poses; infinite where one is NaN.
fn apart(a: &Pose, b: &Pose) -> f64 {
    let (a, b) = (&a.sample, &b.sample);
    let turn = num::wrap_angle(a.heading_rad - b.heading_rad).abs();
    let all = [a.position.distance(b.position), (a.velocity - b.velocity).norm(), turn];
    if all.iter().all(|x| x.is_finite()) { all.into_iter().fold(0.0, f64::max) } else { f64::INFINITY }
}

/// Decides what was decided: by recorded controls, or by those that lead from one recorded state to the next.
#[derive(Clone, Debug)]
pub struct Retraced<'r> {
    controls: &'r [[f64; 2]],
    samples: Vec<Sample>,
    /// Decision step and physics step of the contact.
    contact: Option<(usize, usize)>,
}

impl<'r> Retraced<'r> {
    fn of_report(reported: &'r ReportedRollout) -> Retraced<'r> {
        Retraced {
            controls: &reported.controls,
            samples: reported.ego.iter().map(|pose| pose.sample).collect(),
            contact: reported.contact.map(|contact| (contact.step, contact.substep)),
        }
    }

    /// Makes the ego of a motion that ended with this contact. A car on springs has more state than that holds.
    pub fn of(motion: &Trace, contact: Option<&Contact>) -> Retraced<'static> {
        let at = |contact: &Contact| {
            let substeps = (contact.time_s / SUBSTEP_S).round() as usize;
            (substeps / SUBSTEPS, substeps % SUBSTEPS)
        };
        Retraced { controls: &[], samples: motion.ego.clone(), contact: contact.map(at) }
    }
}

impl Driver for Retraced<'_> {
    fn begin(&mut self, _: &Plant) {}

    fn decide(&mut self, view: &View<'_>) -> Control {
        let (k, ego) = (view.decision(), view.ego());
        if let Some(&[acceleration_mps2, steering_rad]) = self.controls.get(k) {
            return Control::Drive { acceleration_mps2, steering_rad };
        }
        let drive = |(acceleration_mps2, steering_rad)| Control::Drive { acceleration_mps2, steering_rad };
        // Behind the last row, where the recorded drive ended and this one goes on, any control shows that.
        let Some(next) = self.samples.get(k + 1).filter(|_| self.controls.is_empty()) else {
            return drive((0.0, 0.0));
        };
        let substeps = self.contact.filter(|(step, _)| *step == k).map_or(SUBSTEPS, |(_, j)| j.clamp(1, SUBSTEPS));
        let mut car = Car::new(&ego.sample, 2.0 * ego.size.half_length_m);
        (car.axis, car.speed_mps) = (ego.axis, ego.speed_mps);
        let (acceleration_mps2, steering_rad) = car.controls_to(next, substeps, &view.plant().limits().at_step(k));
        // What leads nowhere is no control either.
        let finite = acceleration_mps2.is_finite() && steering_rad.is_finite();
        drive(if finite { (acceleration_mps2, steering_rad) } else { (0.0, 0.0) })
    }
}
