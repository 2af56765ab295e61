//! Laws of motion against closed forms and recordings.

use crate::ego::Policy;
use crate::kernel::{OrientedBox, Seed, Vec2, num};
use crate::scene::Sample;
use crate::sim::bicycle::{Car, CorneringLoss, DEFAULT_LIMITS, Limits};
use crate::sim::body::SUBSTEPS;
use crate::sim::idm::{self, Front};
use crate::sim::scenes::*;
use crate::sim::*;

/// Random box pairs to try; more on demand.
#[allow(clippy::disallowed_methods)]
fn pairs() -> usize {
    let asked = std::env::var("EVODRIVE_BOX_PAIRS").ok().and_then(|n| n.parse().ok());
    asked.unwrap_or(100_000)
}

#[test]
fn box_contact_agrees_with_parry_on_random_pairs() {
    use parry2d_f64::math::{Pose, Vector};
    use parry2d_f64::query;
    use parry2d_f64::shape::Cuboid;
    let mut stream = Seed(3).stream(&["boxes"]);
    let (mut touching, mut doubtful) = (0, 0);
    for _ in 0..pairs() {
        let mut draw = |low, high| stream.uniform(low, high);
        let shape = [draw(0.3, 12.0), draw(0.3, 3.0), draw(0.3, 12.0), draw(0.3, 3.0)];
        let (x, y, h1, h2) = (draw(-9.0, 9.0), draw(-9.0, 9.0), draw(-4.0, 4.0), draw(-4.0, 4.0));
        let a = OrientedBox::new(Vec2::ZERO, h1, shape[0], shape[1]);
        let b = OrientedBox::new(Vec2::new(x, y), h2, shape[2], shape[3]);
        let solid = |b: &OrientedBox, heading: f64| {
            (
                Pose::new(Vector::new(b.center.x, b.center.y), heading),
                Cuboid::new(Vector::new(b.half_length_m, b.half_width_m)),
            )
        };
        let ((pa, sa), (pb, sb)) = (solid(&a, h1), solid(&b, h2));
        let exact = query::distance(&pa, &sa, &pb, &sb).unwrap().distance;
        let touches = exact == 0.0;
        if a.overlaps(&b) != touches {
            // Parry iterates towards the distance: the last nanometre may go either way.
            assert!(exact < 1e-6 && a.distance(&b) < 1e-6, "{a:?} {b:?} {exact}");
            doubtful += 1;
        }
        touching += usize::from(touches);
    }
    assert!(touching > pairs() / 20 && doubtful < 5, "{touching} {doubtful}");
}

#[test]
fn the_wanted_gap_of_idm_at_equal_speeds_is_its_closed_form() {
    // A leader at 1.5 m/s is slow enough for the equilibrium to lie within the 20 m that the policy sees.
    let speed = 1.5;
    let kmph = 3.6 * speed;
    let expected = (10.0 + 1.5 * kmph) / (1.0 - num::powu(kmph / 40.0, 10)).sqrt();
    let leader = car("leader", straight(sample(25.0, 0.0, 0.0, speed), 900));
    let mut scene = straight_road(900, speed, vec![leader]);
    scene.ego.route = vec![Vec2::ZERO, Vec2::new(400.0, 0.0)];
    let plant = Plant::new(&scene).unwrap();
    let (outcome, trace) = rollout_traced(&plant, &Intervention::default(), &mut *Policy::Idm.driver()).unwrap();
    assert_eq!(outcome.end, End::Horizon);
    let last = trace.ego.len() - 1;
    let gap = trace.actors[0].samples[last].unwrap().position.x - trace.ego[last].position.x;
    assert!((gap - expected).abs() < 0.05, "{gap} {expected}");
    assert!((trace.ego[last].speed_mps() - speed).abs() < 0.01);
}

/// Followers in a row behind a leader whose speed dips once; the largest dip of each.
fn dips(followers: usize, speed: f64) -> Vec<f64> {
    let ahead = Vec2::new(1.0, 0.0);
    let kmph = 3.6 * speed;
    let gap = (10.0 + 1.5 * kmph) / (1.0 - num::powu(kmph / 40.0, 10)).sqrt();
    let mut cars: Vec<(f64, f64)> = (0..=followers).map(|i| (-gap * i as f64, speed)).collect();
    let mut least = vec![speed; followers + 1];
    for step in 0..4000 {
        let dip = if (100..130).contains(&step) {
            -0.2
        } else if (200..230).contains(&step) {
            0.2
        } else {
            0.0
        };
        let before = cars.clone();
        for (i, (x, v)) in cars.iter_mut().enumerate() {
            let wanted = if i == 0 {
                dip
            } else {
                let front = Front { gap_m: before[i - 1].0 - *x, velocity: ahead * before[i - 1].1 };
                let throttle = idm::throttle(*v, ahead * *v, ahead, 40.0, Some(&front));
                idm::acceleration_mps2(throttle, &DEFAULT_LIMITS)
            };
            let (next, way) = crate::sim::bicycle::advance(*v, wanted, 30.0, 0.1);
            (*x, *v) = (*x + way, next);
            least[i] = least[i].min(next);
        }
    }
    least.iter().map(|v| speed - v).collect()
}

#[test]
fn a_dip_of_the_leader_dies_out_along_a_platoon_of_idm_cars() {
    let dips = dips(12, 4.0);
    assert!(dips[0] > 0.55, "{dips:?}");
    for pair in dips.windows(2) {
        assert!(pair[1] < pair[0], "{dips:?}");
    }
    assert!(dips[12] < 0.6 * dips[0], "{dips:?}");
}

#[test]
fn no_car_gains_energy_without_throttle_nor_more_than_its_engine_gives() {
    let mut stream = Seed(5).stream(&["energy"]);
    for _ in 0..2000 {
        let start = sample(0.0, 0.0, stream.uniform(-3.0, 3.0), stream.uniform(0.0, 35.0));
        let mut car = Car::new(&start, stream.uniform(3.0, 12.0));
        for _ in 0..20 {
            let asked = stream.uniform(-30.0, 30.0);
            let steering = stream.uniform(-2.0, 2.0);
            let next = car.drive(asked, steering, &DEFAULT_LIMITS)[SUBSTEPS - 1];
            let most = DEFAULT_LIMITS.engine_mps2.min(asked.max(0.0)) * 0.1;
            assert!(next.speed_mps <= car.speed_mps + most + 1e-12);
            assert!(next.speed_mps >= 0.0 && next.speed_mps <= car.speed_mps.max(DEFAULT_LIMITS.speed_mps));
            assert!(next.position.distance(car.position) <= 0.1 * car.speed_mps.max(next.speed_mps) + 1e-12);
            let turn = num::wrap_angle(next.heading_rad - car.heading_rad).abs() / 0.1;
            let mean = 0.5 * (car.speed_mps + next.speed_mps);
            assert!(turn * mean <= DEFAULT_LIMITS.grip_mps2 * 1.35, "{turn} {mean}");
            car = next;
        }
    }
}

#[test]
fn the_inverse_bicycle_driven_forward_recovers_a_recorded_motion() {
    // A recording of a car that brakes into a bend and leaves it: written by the law of a circle, not by our bicycle.
    let mut at = sample(0.0, 0.0, 0.3, 12.0);
    let mut log = vec![at];
    for k in 0..80 {
        let acceleration = if k < 30 { -1.5 } else { 1.0 };
        let curvature = 0.06 * num::sin(num::PI * f64::from(k) / 80.0);
        for _ in 0..100 {
            let speed = at.speed_mps() + acceleration * 0.001;
            let heading = at.heading_rad + at.speed_mps() * curvature * 0.001;
            let position = at.position + at.velocity * 0.001;
            at = Sample { position, heading_rad: heading, velocity: Vec2::from_heading(heading) * speed };
        }
        log.push(at);
    }
    let length_m = 4.515;
    let (front, rear) = (1.05234, 1.4166);
    // The course of the recording is the motion of the centre; the car's axis lies the slip angle beside it.
    let slip = |k: usize| {
        let ahead = &log[(k + 1).min(80)];
        let way = log[k].speed_mps().max(0.1) * 0.1;
        num::asin(rear * num::wrap_angle(ahead.heading_rad - log[k].heading_rad) / way)
    };
    let mut first = log[0];
    first.heading_rad -= slip(0);
    let mut car = Car::new(&first, length_m);
    car.speed_mps = log[0].speed_mps();
    // The accelerations of a recording are what is left after all losses.
    let lossless = Limits { cornering_loss: CorneringLoss::Steering { share: 0.0 }, ..DEFAULT_LIMITS };
    let mut worst: f64 = 0.0;
    for k in 0..80 {
        let acceleration = (log[k + 1].speed_mps() - log[k].speed_mps()) / 0.1;
        // Yaw that brings the course onto the next sample's, as steering.
        let wanted = log[k + 1].heading_rad - slip(k + 1);
        let way = 0.5 * (log[k].speed_mps() + log[k + 1].speed_mps()) * 0.1;
        let sine = rear * num::wrap_angle(wanted - car.heading_rad) / way;
        let steering = num::atan((front + rear) / rear * num::tan(num::asin(sine)));
        car = car.drive(acceleration, steering, &lossless)[SUBSTEPS - 1];
        worst = worst.max(car.position.distance(log[k + 1].position));
    }
    assert!(worst < 0.3, "open loop over 8 s and 80 m: {worst} m");
}
