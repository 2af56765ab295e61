//! Values that a file lacks and that places give: velocities, headings, and the kind of road user that moves like that.

use crate::kernel::Vec2;
use crate::scene::{AgentKind, Sample};

/// Longest time between two places over which motion is derived, seconds.
const GAP_MAX_S: f64 = 0.5;
/// Speed below which motion is the jitter of a measurement and gives no direction, m/s.
const DIRECTION_MIN_MPS: f64 = 0.5;
/// Largest distance from its first place of a road user that stands, metres.
const STANDS_WITHIN_M: f64 = 1.0;
/// Distance beyond which a road user whose velocities are all zero has none in the file, metres.
const MOVES_BEYOND_M: f64 = 3.0;
/// Length below which a road user is on foot or on two wheels, metres.
const CAR_LENGTH_MIN_M: f64 = 2.5;
/// Largest speed that anybody walks for long, m/s.
const WALK_MAX_MPS: f64 = 3.0;

/// Returns the velocities of a road user at these places at these times, which increase: from the place before to the place
/// after. A road user seen only once stands.
pub fn velocities(times_s: &[f64], places: &[Vec2]) -> Vec<Vec2> {
    let near = |a: usize, b: usize| (times_s[b] - times_s[a]).abs() <= GAP_MAX_S + 1e-6;
    (0..places.len())
        .map(|k| {
            let from = k.checked_sub(1).filter(|&before| near(before, k)).unwrap_or(k);
            let to = Some(k + 1).filter(|&after| after < places.len() && near(k, after)).unwrap_or(k);
            let span = times_s[to] - times_s[from];
            if span > 0.0 { (places[to] - places[from]) * (1.0 / span) } else { Vec2::ZERO }
        })
        .collect()
}

/// Returns the headings of a road user that heads where it goes; where it stands, the last one before or else the first one
/// after. `None` for one that never moves.
pub fn headings(times_s: &[f64], places: &[Vec2]) -> Option<Vec<f64>> {
    let going = velocities(times_s, places);
    let going = going.iter().map(|v| (v.norm() >= DIRECTION_MIN_MPS).then(|| v.heading()));
    let mut last = going.clone().flatten().next()?;
    let mut each = Vec::with_capacity(places.len());
    for heading in going {
        last = heading.unwrap_or(last);
        each.push(last);
    }
    Some(each)
}

/// Values of a track of a log that come from its places.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Derived {
    /// Number of samples whose velocity is derived.
    pub velocities: usize,
    /// True if all headings are.
    pub headings: bool,
}

/// Fills in velocities that are NaN, or all zero of a road user that moves, and headings of which all are NaN. A
/// single NaN heading is left for its sample to be dropped.
pub fn fill(samples: &mut [Option<Sample>], times_s: &[f64]) -> Derived {
    let placed = |sample: &Option<Sample>| sample.filter(|sample| sample.position.is_finite());
    let known: Vec<(usize, Sample)> =
        samples.iter().enumerate().filter_map(|(k, sample)| Some((k, placed(sample)?))).collect();
    let no_velocity = |sample: &Sample| !sample.velocity.is_finite();
    let zeros = known.iter().all(|(_, sample)| sample.velocity == Vec2::ZERO) && spread_m(&known) > MOVES_BEYOND_M;
    let no_heading = !known.is_empty() && known.iter().all(|(_, sample)| !sample.heading_rad.is_finite());
    if !zeros && !no_heading && !known.iter().any(|(_, sample)| no_velocity(sample)) {
        return Derived::default();
    }
    let times: Vec<f64> = known.iter().map(|(k, _)| times_s.get(*k).copied().unwrap_or(f64::NAN)).collect();
    let places: Vec<Vec2> = known.iter().map(|(_, sample)| sample.position).collect();
    let moved = velocities(&times, &places);
    let turned = if no_heading { headings(&times, &places) } else { None };
    let mut derived = Derived { velocities: 0, headings: turned.is_some() };
    for (n, (k, _)) in known.iter().enumerate() {
        let Some(sample) = &mut samples[*k] else { continue };
        if zeros || no_velocity(sample) {
            sample.velocity = moved[n];
            derived.velocities += 1;
        }
        if let Some(turned) = &turned {
            sample.heading_rad = turned[n];
        }
    }
    derived
}

/// Returns the largest distance of a road user from its first place.
fn spread_m(known: &[(usize, Sample)]) -> f64 {
    let first = known.first().map_or(Vec2::ZERO, |(_, sample)| sample.position);
    known.iter().map(|(_, sample)| sample.position.distance(first)).fold(0.0, f64::max)
}

/// Returns the kind of road user for a data set's name; `None` for a name that says nothing, such as `OTHER`.
pub fn kind_named(name: &str) -> Option<AgentKind> {
    let plain: String = name.chars().filter(char::is_ascii_alphanumeric).take(64).collect();
    Some(match plain.to_ascii_lowercase().as_str() {
        "vehicle"
        | "car"
        | "truck"
        | "bus"
        | "van"
        | "taxi"
        | "trailer"
        | "train"
        | "tram"
        | "pickup"
        | "suv"
        | "tractor"
        | "motorvehicle"
        | "constructionvehicle"
        | "emergencyvehicle"
        | "priorityvehicle"
        | "parkedvehicle"
        | "largevehicle"
        | "schoolbus"
        | "trucktrailer" => AgentKind::Vehicle,
        "cyclist" | "bicycle" | "bicyclist" | "bike" | "motorcycle" | "motorcyclist" | "motorbike" | "moped"
        | "scooter" | "tricycle" | "rider" => AgentKind::Cyclist,
        "pedestrian" | "person" | "adult" | "child" | "walker" => AgentKind::Pedestrian,
        "static" | "cone" | "trafficcone" | "barrier" | "trafficbarrier" | "trafficlight" | "trafficsign"
        | "trafficobject" | "pole" | "pillar" | "constructionzone" | "medianstrip" | "building" => AgentKind::Static,
        _ => return None,
    })
}

/// Returns the kind that fits the motion of an unknown road user: a static thing, a vehicle, somebody on foot or on two wheels.
pub fn kind_moving(places: &[Vec2], fastest_mps: f64, length_m: f64) -> AgentKind {
    let stands = |first: &Vec2| places.iter().all(|place| place.distance(*first) <= STANDS_WITHIN_M);
    let walks = fastest_mps <= WALK_MAX_MPS;
    // Without a size nobody that fast is on foot.
    let has_size = length_m.is_finite() && length_m > 0.0;
    if places.first().is_none_or(stands) {
        AgentKind::Static
    } else if length_m >= CAR_LENGTH_MIN_M || !has_size && !walks {
        AgentKind::Vehicle
    } else if walks {
        AgentKind::Pedestrian
    } else {
        AgentKind::Cyclist
    }
}

/// Says how road users of an unknown kind were read: the kind's name, and the kind assumed for each.
pub fn kinds_taken(name: &str, taken: &[AgentKind]) -> String {
    let count = |kind: AgentKind| taken.iter().filter(|&&other| other == kind).count();
    let all = [
        (count(AgentKind::Vehicle), "as vehicles"),
        (count(AgentKind::Cyclist), "as cyclists"),
        (count(AgentKind::Pedestrian), "as pedestrians"),
        (count(AgentKind::Static), "as static"),
    ];
    let parts: Vec<String> = all.iter().filter(|(n, _)| *n > 0).map(|(n, what)| format!("{n} {what}")).collect();
    let users = taken.len();
    format!(
        "{users} road users of the kind {name:?}, which is not known; taken by size and motion: {}",
        parts.join(", ")
    )
}

/// Returns the greatest speed of samples, m/s.
pub fn fastest_mps(samples: &[Option<Sample>]) -> f64 {
    samples.iter().flatten().map(Sample::speed_mps).filter(|speed| speed.is_finite()).fold(0.0, f64::max)
}

/// Puts sample times that are NaN between their neighbours, and returns how many these were. `None` if the first or
/// the last is NaN.
pub fn times_filled(times_s: &mut [f64]) -> Option<usize> {
    if !times_s.first()?.is_finite() || !times_s.last()?.is_finite() {
        return None;
    }
    let mut filled = 0;
    for k in 1..times_s.len() {
        if !times_s[k].is_finite() {
            let after = (k..times_s.len()).find(|&j| times_s[j].is_finite())?;
            let (from, to) = (times_s[k - 1], times_s[after]);
            times_s[k] = from + (to - from) / (after - k + 1) as f64;
            filled += 1;
        }
    }
    Some(filled)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernel::num;

    fn moving(velocity: Vec2, heading_rad: f64) -> Vec<Option<Sample>> {
        (0..5).map(|k| Some(Sample { position: Vec2::new(f64::from(k), 0.0), heading_rad, velocity })).collect()
    }

    const TIMES: [f64; 5] = [0.0, 0.1, 0.2, 0.3, 0.4];

    #[test]
    fn velocities_that_are_not_there_or_all_zero_come_from_places() {
        for gone in [Vec2::new(f64::NAN, f64::NAN), Vec2::ZERO] {
            let mut samples = moving(gone, 0.0);
            assert_eq!(fill(&mut samples, &TIMES).velocities, 5);
            assert!(samples.iter().flatten().all(|s| (s.velocity.x - 10.0).abs() < 1e-9), "{samples:?}");
        }
        let mut whole = moving(Vec2::new(9.0, 0.0), 0.0);
        assert_eq!((fill(&mut whole, &TIMES), whole), (Derived::default(), moving(Vec2::new(9.0, 0.0), 0.0)));
    }

    #[test]
    fn headings_come_from_motion_only_where_there_is_none_at_all() {
        let mut samples = moving(Vec2::new(10.0, 0.0), f64::NAN);
        assert!(fill(&mut samples, &TIMES).headings && samples[3].unwrap().heading_rad == 0.0);
        let mut one = moving(Vec2::new(10.0, 0.0), 0.3);
        one[2].as_mut().unwrap().heading_rad = f64::NAN;
        assert!(!fill(&mut one, &TIMES).headings && one[2].unwrap().heading_rad.is_nan());
        assert_eq!(headings(&TIMES, &[Vec2::ZERO; 5]), None);
        let stops = [0.0, 0.0, 1.0, 1.0, 1.0].map(|y| Vec2::new(0.0, y));
        assert_eq!(headings(&TIMES, &stops), Some(vec![num::FRAC_PI_2; 5]));
    }

    #[test]
    fn a_time_that_is_none_lies_between_its_neighbours() {
        let mut times = [0.0, f64::NAN, f64::NAN, 0.3];
        assert_eq!(times_filled(&mut times), Some(2));
        assert!((times[1] - 0.1).abs() < 1e-12 && (times[2] - 0.2).abs() < 1e-12);
        assert_eq!(times_filled(&mut [f64::NAN, 0.1]), None);
    }

    #[test]
    fn who_moves_like_a_car_is_a_vehicle_whatever_its_name() {
        let way: Vec<Vec2> = (0..9).map(|k| Vec2::new(f64::from(k), 0.0)).collect();
        let kinds =
            [(8.0, 4.5), (1.2, 0.6), (6.0, 1.8), (9.0, 0.0)].map(|(speed, size)| kind_moving(&way, speed, size));
        assert_eq!(kinds, [AgentKind::Vehicle, AgentKind::Pedestrian, AgentKind::Cyclist, AgentKind::Vehicle]);
        assert_eq!(kind_moving(&[Vec2::ZERO; 9], 0.0, 4.5), AgentKind::Static);
        let named = ["BUS", "TRUCK", "MOTORCYCLE", "TRAFFIC_CONE", "OTHER"].map(kind_named);
        let (vehicle, cyclist) = (Some(AgentKind::Vehicle), Some(AgentKind::Cyclist));
        assert_eq!(named, [vehicle, vehicle, cyclist, Some(AgentKind::Static), None]);
    }
}
