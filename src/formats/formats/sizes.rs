//! Sizes of road users: the default for one that a file does not give, and the repair of one whose length and width a
//! file holds exchanged, as ScenarioNet's conversion of nuScenes does with the ego's.

use super::import_error::shown;
use super::log::{LogTrack, Parts};
use crate::kernel::num;
use crate::scene::validate::{SIDE_MAX_M, SIDE_MIN_M};
use crate::scene::{AgentKind, LeftOut};

/// Ratio of width to length beyond which a vehicle has its sides exchanged: no vehicle is built so wide.
const WIDER_THAN_LONG: f64 = 1.2;

/// Returns `true` if these are the sides of a vehicle whose length and width are exchanged.
pub fn is_broadside(kind: AgentKind, length_m: f64, width_m: f64) -> bool {
    let given = length_m.is_finite() && length_m > 0.0 && width_m.is_finite();
    given && kind == AgentKind::Vehicle && width_m > WIDER_THAN_LONG * length_m
}

/// Units that a vehicle's size reveals, with how many make a metre, and a vehicle's usual length and width, metres.
const UNITS: [(f64, &str); 2] = [(100.0, "centimetres"), (1000.0, "millimetres")];
const USUAL_M: [std::ops::RangeInclusive<f64>; 2] = [3.0..=15.0, 1.4..=3.0];

/// Converts sizes of another unit to metres, and notes this and road users that are longer or wider than possible.
pub fn in_metres(tracks: &mut [LogTrack], left_out: &mut Parts) {
    let vehicles = || tracks.iter().filter(|track| track.kind == Ok(AgentKind::Vehicle) && track.length_m > 0.0);
    let middle = |side: fn(&LogTrack) -> f64| num::quantile(&vehicles().map(side).collect::<Vec<_>>(), 0.5);
    if let Some((length, width)) = middle(|track| track.length_m).zip(middle(|track| track.width_m)) {
        let fits = |per_m: &f64| USUAL_M[0].contains(&(length / per_m)) && USUAL_M[1].contains(&(width / per_m));
        if let Some((per_m, name)) = UNITS.iter().find(|(per_m, _)| fits(per_m)) {
            for track in tracks.iter_mut() {
                (track.length_m, track.width_m) = (track.length_m / per_m, track.width_m / per_m);
            }
            let reason = format!("those of all road users read in {name}: a vehicle is {length} long and {width} wide");
            left_out.push((LeftOut::SIZES.into(), reason));
        }
    }
    let beyond = |side: f64| side.is_finite() && side > 0.0 && !(SIDE_MIN_M..=SIDE_MAX_M).contains(&side);
    let mut wild = tracks.iter().filter(|track| beyond(track.length_m) || beyond(track.width_m));
    if let Some(first) = wild.next() {
        let reason = format!(
            "{} road users have sides beyond 0.05 to 60 m, which were brought to these: e.g. track {}, {} x {} m",
            wild.count() + 1,
            shown(&first.id),
            first.length_m,
            first.width_m
        );
        left_out.push((LeftOut::SIZES.into(), reason));
    }
}

/// Exchanges the sides of vehicles that are wider than long, and notes it. The ego counts as a vehicle, whatever the log calls it.
pub fn exchange(tracks: &mut [LogTrack], kinds: &[AgentKind], ego: usize, left_out: &mut Parts) {
    let mut others = Vec::new();
    for (ix, (track, kind)) in tracks.iter_mut().zip(kinds).enumerate() {
        let kind = if ix == ego { AgentKind::Vehicle } else { *kind };
        let sides = (track.length_m, track.width_m);
        if !is_broadside(kind, sides.0, sides.1) {
            continue;
        }
        (track.length_m, track.width_m) = (sides.1, sides.0);
        if ix == ego {
            left_out.push((LeftOut::SIZES.into(), size_exchanged("the ego", sides.0, sides.1)));
        } else {
            others.push((track.id.as_str(), sides));
        }
    }
    left_out.extend(sizes_exchanged(&others).map(|reason| (LeftOut::SIZES.into(), reason)));
}

/// Names the road users whose sides were exchanged: of several their number, and the first one. The sides are the file's.
pub fn sizes_exchanged(of: &[(&str, (f64, f64))]) -> Option<String> {
    let &(id, (length_m, width_m)) = of.first()?;
    let first = size_exchanged(&format!("track {}", shown(id)), length_m, width_m);
    Some(match of.len() {
        1 => first,
        many => format!("{many} vehicles have it so: {first}"),
    })
}

fn size_exchanged(whose: &str, length_m: f64, width_m: f64) -> String {
    format!("size of {whose} exchanged: {length_m:.2} x {width_m:.2} m is wider than long")
}

/// Returns a plausible box: as in the log, or else the usual size of its kind.
pub fn sides(log: &LogTrack, kind: AgentKind) -> (f64, f64) {
    let usual = match kind {
        AgentKind::Vehicle => (4.5, 1.9),
        AgentKind::Pedestrian => (0.6, 0.6),
        AgentKind::Cyclist => (1.8, 0.7),
        AgentKind::Static => (0.5, 0.5),
    };
    let side = |given: f64, usual: f64| {
        if given.is_finite() && given > 0.0 { given.clamp(SIDE_MIN_M, SIDE_MAX_M) } else { usual }
    };
    (side(log.length_m, usual.0), side(log.width_m, usual.1))
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::*;
    use crate::formats::hostile::wholes::{described, edited};
    use crate::formats::{commonroad::read as commonroad, scenarionet::read_json};
    use crate::scene::Track;

    #[test]
    fn sizes_of_another_unit_are_read_in_metres_and_sides_beyond_all_are_told() {
        let (sides, said) = read(("VEHICLE", 450.0, 190.0), ("PEDESTRIAN", 60.0, 50.0));
        assert_eq!((sides, said.len()), (vec![[4.5, 1.9], [0.6, 0.5]], 1));
        assert!(said[0].contains("centimetres"), "{said:?}");
        let (sides, said) = read(("VEHICLE", 4500.0, 1900.0), ("TRUCK", 9000.0, 2500.0));
        assert!(sides == [[4.5, 1.9], [9.0, 2.5]] && said[0].contains("millimetres"), "{said:?}");
        let (sides, said) = read(("VEHICLE", 4.5, 1.9), ("TRUCK", 90.0, 2.5));
        assert!(sides[1] == [60.0, 2.5] && said.len() == 1 && said[0].contains("track 2, 90 x 2.5 m"), "{said:?}");
    }

    fn resized(track: &mut Value, kind: &str, length_m: f64, width_m: f64) {
        track["type"] = json!(kind);
        track["state"]["length"] = json!(length_m);
        track["state"]["width"] = json!(width_m);
    }

    /// Returns the sides of the ego and of the other, and the notes on sizes.
    fn read(ego: (&str, f64, f64), other: (&str, f64, f64)) -> (Vec<[f64; 2]>, Vec<String>) {
        let file = described(|scene| {
            resized(&mut scene["tracks"]["1"], ego.0, ego.1, ego.2);
            resized(&mut scene["tracks"]["2"], other.0, other.1, other.2);
        });
        let imported = read_json::import("s.json", file.to_string().as_bytes()).unwrap();
        let scene = &imported.scenes[0];
        let box_of = |track: &Track| [track.length_m, track.width_m];
        let sides = std::iter::once(&scene.ego.track).chain(&scene.tracks).map(box_of).collect();
        let said = imported.left_out.into_iter().filter(|left| left.what == LeftOut::SIZES);
        (sides, said.map(|left| left.reason).collect())
    }

    #[test]
    fn a_vehicle_that_is_wider_than_long_is_turned_and_it_is_said() {
        let exchanged = read(("VEHICLE", 1.73, 4.08), ("TRUCK", 2.5, 9.0));
        let said = [
            "size of the ego exchanged: 1.73 x 4.08 m is wider than long",
            "size of track 2 exchanged: 2.50 x 9.00 m is wider than long",
        ];
        assert_eq!(exchanged, (vec![[4.08, 1.73], [9.0, 2.5]], said.map(String::from).to_vec()));
        // An ego of an unknown kind drives as well.
        assert_eq!(read(("OTHER", 1.73, 4.08), ("VEHICLE", 4.5, 1.9)).0[0], [4.08, 1.73]);
    }

    #[test]
    fn who_may_be_wider_than_long_stays_as_given() {
        for (kind, length_m, width_m) in [
            ("VEHICLE", 4.5, 1.9),
            ("VEHICLE", 1.5, 1.75),
            ("PEDESTRIAN", 0.5, 0.8),
            ("CYCLIST", 0.6, 1.7),
            ("TRAFFIC_BARRIER", 0.5, 2.9),
        ] {
            let (sides, said) = read(("VEHICLE", 4.5, 1.9), (kind, length_m, width_m));
            assert_eq!((sides[1], said), ([length_m, width_m], vec![]), "{kind}");
        }
        // A width alone does not give the missing length.
        assert_eq!(read(("VEHICLE", 0.0, 2.1), ("VEHICLE", 4.5, 1.9)), (vec![[4.5, 2.1], [4.5, 1.9]], vec![]));
    }

    #[test]
    fn an_obstacle_of_commonroad_is_turned_by_the_same_rule() {
        let whole = "<length>4.5</length><width>1.9</width>";
        let file = edited("CommonRoad", whole, "<length>1.9</length><width>4.5</width>");
        let imported = commonroad::import("c.xml", &file).unwrap();
        let car = imported.scenes[0].tracks.iter().find(|track| track.id == "61").unwrap();
        assert_eq!([car.length_m, car.width_m], [4.5, 1.9]);
        let said = imported.left_out.iter().find(|left| left.what == LeftOut::SIZES).unwrap();
        assert_eq!(said.reason, "size of track 61 exchanged: 1.90 x 4.50 m is wider than long");
    }
}
