//! Conventions of headings and velocities, each applied to good files of every form: it must be found, and the good files themselves
//! are never accused.

use std::sync::OnceLock;

use prost::Message;
use serde_json::{Value, json};

use super::conventions::{Conventions, HEADINGS, ReadAs, VELOCITIES};
use super::hostile::wholes::described;
use super::log::SampleTimes;
use super::summary::import_file;
use super::waymo::tfrecord;
use super::{Imported, commonroad::write as commonroad, scenarionet, waymo};
use crate::kernel::{Seed, Vec2, num};
use crate::scene::consistency::{checked, values};
use crate::scene::{AgentKind, LeftOut, Sample, Scene, Track};
use crate::synth::{SynthOptions, WorldKind, pool_member};

const SCENES: usize = 100;

fn scenes() -> &'static [Scene] {
    static SCENES_MADE: OnceLock<Vec<Scene>> = OnceLock::new();
    SCENES_MADE.get_or_init(|| {
        let options = SynthOptions {
            kinds: WorldKind::ALL.to_vec(),
            steps: 61,
            current_step: 10,
            warm_up_s: 12.0,
            tracks_per_scene: 12,
            pedestrian_share: 0.15,
            cyclist_share: 0.1,
            following_share: 0.3,
            ego_travel_m_min: 8.0,
            interaction_time_s_max: 5.0,
            interaction_gap_m_max: 20.0,
            attempts_max: 200,
            traffic: None,
        };
        (0..SCENES).map(|i| pool_member(&options, Seed(61), i).unwrap()).collect()
    })
}

/// The road users of a scene, the ego's first.
fn users(scene: &mut Scene) -> impl Iterator<Item = &mut Track> {
    std::iter::once(&mut scene.ego.track).chain(&mut scene.tracks)
}

fn with_samples(scene: &Scene, change: impl Fn(&mut Sample)) -> Scene {
    let mut scene = scene.clone();
    users(&mut scene).for_each(|track| track.samples.iter_mut().flatten().for_each(&change));
    scene
}

/// Forms of files that are not ours: a description, Waymo's record, GPUDrive's objects, CommonRoad's XML.
const FORMS: [&str; 4] = ["scenarionet", "waymo", "gpudrive", "commonroad"];

/// Writes the file of a scene, with headings changed by `theirs`; `None` where our exporter refuses a number.
fn file(form: &str, scene: &Scene, theirs: &dyn Fn(f64) -> f64) -> Option<Vec<u8>> {
    let turned = with_samples(scene, |sample| sample.heading_rad = theirs(sample.heading_rad));
    Some(match form {
        "scenarionet" => {
            let bytes = scenarionet::export(&turned, None).ok()?.bytes;
            let mut value: Value = serde_json::from_slice(&bytes).unwrap();
            value["metadata"]["evodrive"] = Value::Null;
            value.to_string().into_bytes()
        }
        "waymo" => tfrecord::written(&[waymo::tests::message_of(&turned).encode_to_vec()]),
        "gpudrive" => objects(&turned).to_string().into_bytes(),
        _ => {
            // A road user that appears within half a second is there before, beside the map: a jump that the file has.
            let mut scene = scene.clone();
            let start = scene.ego.start_step;
            scene.tracks.retain(|track| track.samples.iter().skip(start).all(Option::is_some));
            scene.objects_of_interest.clear();
            let text = String::from_utf8(commonroad::export(&scene, None).ok()?.bytes).unwrap();
            let (before, own) = text.split_once("<?evodrive").unwrap();
            turned_xml(&format!("{before}{}", own.split_once("?>").unwrap().1), theirs).into_bytes()
        }
    })
}

/// Changes every orientation of an XML file by `theirs`, exact or an interval; those of shapes are neither.
fn turned_xml(text: &str, theirs: &dyn Fn(f64) -> f64) -> String {
    let mut parts = text.split("<orientation>");
    let mut out = parts.next().unwrap().to_string();
    for part in parts {
        let (inside, behind) = part.split_once("</orientation>").unwrap();
        let mut inside = inside.to_string();
        for name in ["exact", "intervalStart", "intervalEnd"] {
            let (open, close) = (format!("<{name}>"), format!("</{name}>"));
            if let Some((before, rest)) = inside.split_once(&open) {
                let (number, after) = rest.split_once(&close).unwrap();
                inside = format!("{before}{open}{}{close}{after}", theirs(number.parse().unwrap()));
            }
        }
        out += &format!("<orientation>{inside}</orientation>{behind}");
    }
    out
}

fn objects(scene: &Scene) -> Value {
    let object = |(id, track): (usize, &Track)| {
        let kind = match track.kind {
            AgentKind::Pedestrian => "pedestrian",
            AgentKind::Cyclist => "cyclist",
            _ => "vehicle",
        };
        let all: Vec<Sample> = track.samples.iter().map(|sample| sample.unwrap_or_default()).collect();
        let place = |v: Vec2| json!({"x": v.x, "y": v.y, "z": 0.0});
        json!({
            "id": id, "type": kind, "length": track.length_m, "width": track.width_m,
            "position": all.iter().map(|s| place(s.position)).collect::<Vec<_>>(),
            "velocity": all.iter().map(|s| place(s.velocity)).collect::<Vec<_>>(),
            "heading": all.iter().map(|s| s.heading_rad).collect::<Vec<_>>(),
            "valid": track.samples.iter().map(Option::is_some).collect::<Vec<_>>(),
        })
    };
    let all = std::iter::once(&scene.ego.track).chain(&scene.tracks);
    let roads = scene.road.lanes.iter().enumerate().map(|(id, lane)| {
        let points: Vec<Value> = lane.centre.iter().map(|p| json!({"x": p.x, "y": p.y, "z": 0.0})).collect();
        json!({"id": id, "map_element_id": 2, "type": "lane", "geometry": points})
    });
    json!({
        "name": "f.json", "scenario_id": "f", "objects": all.enumerate().map(object).collect::<Vec<_>>(),
        "roads": roads.collect::<Vec<_>>(), "tl_states": {}, "metadata": {"sdc_track_index": 0},
    })
}

fn read(bytes: &[u8], conventions: Conventions) -> Imported {
    import_file("f", bytes, conventions).unwrap()
}

fn said<'i>(imported: &'i Imported, what: &str) -> Vec<&'i str> {
    imported.left_out.iter().filter(|left| left.what == what).map(|left| left.reason.as_str()).collect()
}

/// Returns `true` if all moving road users have the same headings and velocities in both.
fn alike(read: &Scene, good: &Scene) -> bool {
    let all = |scene: &Scene| -> Vec<Track> {
        let tracks = std::iter::once(&scene.ego.track).chain(&scene.tracks);
        tracks.filter(|track| track.kind != AgentKind::Static).cloned().collect()
    };
    let (read, good) = (all(read), all(good));
    read.len() == good.len()
        && read.iter().zip(&good).all(|(a, b)| {
            a.samples.iter().zip(&b.samples).filter_map(|(a, b)| a.zip(*b)).all(|(a, b)| {
                let still = b.speed_mps() < 1.0;
                let heading = num::wrap_angle(a.heading_rad - b.heading_rad).abs();
                (still || heading < 0.02) && a.velocity.distance(b.velocity) < 0.02 * b.speed_mps().max(1.0)
            })
        })
}

/// Checks how many scenes of each convention are read like the good file, with a note.
fn found(what: &str, names: &[&'static str], spoilt: impl Fn(usize, &str, &Scene) -> Option<Vec<u8>>) {
    for (ix, name) in names.iter().enumerate().skip(1) {
        let (mut found, mut all, mut missed) = (0, 0, Vec::new());
        for (k, scene) in scenes().iter().enumerate() {
            let form = FORMS[k % FORMS.len()];
            let Some(bytes) = spoilt(ix, form, scene) else { continue };
            let imported = read(&bytes, Conventions::default());
            let good = read(&file(form, scene, &|rad| rad).unwrap(), Conventions::default());
            let Some(good) = good.scenes.first() else { continue };
            all += 1;
            let is_right = imported.scenes.first().is_some_and(|read| alike(read, good));
            if !said(&imported, what).is_empty() && is_right {
                found += 1;
            } else {
                missed.push(format!("{form} {}: {:?}", scene.id, imported.left_out));
            }
        }
        assert!(all >= 25 && 100 * found >= 95 * all, "{name}: {found} of {all}; missed {missed:#?}");
    }
}

#[test]
fn each_convention_of_headings_is_found_in_95_of_100_scenes() {
    // A road user that goes backwards may reverse: that is noted and not turned.
    let names: Vec<&str> = HEADINGS.iter().map(|of| of.name).filter(|name| !name.starts_with("backwards")).collect();
    found(LeftOut::HEADINGS, &names, |ix, form, scene| {
        let (at_0, at_1) = (HEADINGS[ix].ours(0.0), HEADINGS[ix].ours(1.0));
        file(form, scene, &|ours| (ours - at_0) / (at_1 - at_0))
    });
}

#[test]
fn each_convention_of_velocities_is_found_in_95_of_100_scenes() {
    let names: Vec<&str> = VELOCITIES.iter().map(|of| of.name).collect();
    found(LeftOut::VELOCITIES, &names, |ix, form, scene| {
        let (own_frame, unit_mps) = VELOCITIES[ix].parts();
        // A state of CommonRoad has its velocity along its heading.
        if own_frame && form == "commonroad" {
            return None;
        }
        let theirs = |sample: &mut Sample| {
            let velocity = if own_frame { sample.velocity.rotated(-sample.heading_rad) } else { sample.velocity };
            sample.velocity = velocity * (1.0 / unit_mps);
        };
        file(form, &with_samples(scene, theirs), &|rad| rad)
    });
}

#[test]
fn no_good_file_of_any_form_is_accused() {
    let mut read_whole = 0;
    for scene in scenes() {
        for form in FORMS {
            let bytes = file(form, scene, &|rad| rad).unwrap();
            let imported = read(&bytes, Conventions::default());
            let accused = imported.left_out.iter().find(|left| {
                left.is_doubtful() || [LeftOut::HEADINGS, LeftOut::VELOCITIES].contains(&left.what.as_str())
            });
            assert_eq!(accused, None, "{form} {}", scene.id);
            // Through some roads no way leads to the goal of CommonRoad's planning problem.
            let Some(first) = imported.scenes.first() else { continue };
            read_whole += 1;
            let contradictions: Vec<_> = checked(&values(first))
                .into_iter()
                .flat_map(|of| of.contradictions.into_iter().map(move |who| (of.row.name, who)))
                .collect();
            assert_eq!(contradictions, vec![], "{form} {}", scene.id);
            let written =
                Conventions { headings: ReadAs::Known(0), velocities: ReadAs::Known(0), ..Conventions::default() };
            assert_eq!(read(&bytes, written), imported, "{form} {}", scene.id);
        }
    }
    assert!(read_whole >= 4 * SCENES - 10, "{read_whole}");
}

/// Returns a scene of a description in which everybody goes north, with the ego's and the other's state changed.
fn northward(change: impl Fn(&mut Value, f64)) -> Value {
    described(|scene| {
        for (track, x, mps) in [("1", 0.0, 10.0), ("2", 4.0, 8.0)] {
            let track = &mut scene["tracks"][track];
            let steps = track["state"]["valid"].as_array().unwrap().len();
            track["type"] = json!("VEHICLE");
            let state = &mut track["state"];
            state["position"] = (0..steps).map(|k| json!([x, 0.1 * mps * k as f64, 0.0])).collect();
            state["velocity"] = vec![json!([0.0, mps]); steps].into();
            state["heading"] = vec![json!(num::FRAC_PI_2); steps].into();
            state["valid"] = vec![json!(true); steps].into();
            (state["length"], state["width"]) = (json!(4.5), json!(1.9));
            change(state, mps);
        }
    })
}

fn read_value(value: &Value, conventions: Conventions) -> (Scene, Vec<LeftOut>) {
    let imported = read(value.to_string().as_bytes(), conventions);
    (imported.scenes[0].clone(), imported.left_out)
}

#[test]
fn the_ego_alone_may_have_another_convention_than_the_others() {
    let (good, said) = read_value(&northward(|_, _| ()), Conventions::default());
    assert!(said.iter().all(|left| left.what == LeftOut::HEIGHTS), "{said:?}");
    let mut ego = described(|_| ())["metadata"]["sdc_id"].clone();
    let ego = ego.take().as_str().map_or("1".to_string(), str::to_string);
    let mut value = northward(|_, _| ());
    let steps = value["tracks"][&ego]["state"]["valid"].as_array().unwrap().len();
    value["tracks"][&ego]["state"]["velocity"] = vec![json!([if ego == "1" { 10.0 } else { 8.0 }, 0.0]); steps].into();
    let (scene, said) = read_value(&value, Conventions::default());
    assert!(alike(&scene, &good), "{said:?}");
    assert!(
        said.iter()
            .any(|l| l.what == LeftOut::VELOCITIES && l.reason.starts_with("those of the ego read as own-frame")),
        "{said:?}"
    );
}

#[test]
fn what_fits_no_convention_is_derived_or_told_with_the_option_that_reads_it() {
    let (good, _) = read_value(&northward(|_, _| ()), Conventions::default());
    let steps = good.steps;
    let wild = northward(|state, _| state["velocity"] = vec![json!([3.0, -7.0]); steps].into());
    let (scene, said) = read_value(&wild, Conventions::default());
    assert!(
        alike(&scene, &good)
            && said.iter().any(|l| l.reason.contains("derived from their places; --velocities written")),
        "{said:?}"
    );
    let written = Conventions { velocities: ReadAs::Known(0), ..Conventions::default() };
    assert_eq!(read_value(&wild, written).0.ego.track.samples[0].unwrap().velocity, Vec2::new(3.0, -7.0));

    let slow = northward(|state, mps| state["velocity"] = vec![json!([0.0, mps / 5.0]); steps].into());
    let (scene, said) = read_value(&slow, Conventions::default());
    let of_pace = said.iter().find(|l| l.what == LeftOut::VELOCITIES_DOUBTFUL).unwrap();
    assert!(of_pace.is_kept() && of_pace.is_doubtful() && of_pace.reason.contains("0.200 times"), "{of_pace:?}");
    assert!(!alike(&scene, &good), "what is doubtful is kept");
    let places = Conventions { velocities: ReadAs::Derived, ..Conventions::default() };
    assert!(alike(&read_value(&slow, places).0, &good));
    let every = Conventions { times: SampleTimes::Every(0.5), ..Conventions::default() };
    assert!(
        read_value(&slow, every).1.iter().all(|l| !l.is_doubtful()),
        "half a second between samples is what they say"
    );

    // As of times that are double what they were: within the error that single samples may have of mph.
    let double = northward(|state, mps| state["velocity"] = vec![json!([0.0, 2.0 * mps]); steps].into());
    let (_, said) = read_value(&double, Conventions::default());
    assert!(said.iter().any(|l| l.is_doubtful() && l.reason.contains("2.000 times")), "{said:?}");

    let askew = northward(|state, _| state["heading"] = vec![json!(0.7); steps].into());
    let (scene, said) = read_value(&askew, Conventions::default());
    let told = said.iter().find(|l| l.what == LeftOut::HEADINGS_DOUBTFUL).unwrap();
    assert!(told.reason.contains("50 degrees") && told.reason.contains("--headings motion"), "{told:?}");
    assert!(
        told.reason.contains("compass-degrees would fit, but that is not sure"),
        "0.7 degrees are nearly north: {told:?}"
    );
    assert_eq!(scene.ego.track.samples[3].unwrap().heading_rad, 0.7);
    let motion = Conventions { headings: ReadAs::Derived, ..Conventions::default() };
    assert!(alike(&read_value(&askew, motion).0, &good));

    // A road user that goes east and heads west may reverse; northward, -90 degrees would be clockwise.
    let (good, _) = read_value(&described(|_| ()), Conventions::default());
    let back = described(|scene| {
        for track in ["1", "2"] {
            scene["tracks"][track]["state"]["heading"] = vec![json!(num::PI); steps].into();
        }
    });
    let (_, said) = read_value(&back, Conventions::default());
    assert!(said.iter().any(|l| l.is_doubtful() && l.reason.contains("--headings backwards would fit")), "{said:?}");
    let turned = HEADINGS.iter().position(|of| of.name == "backwards").unwrap();
    let (scene, said) = read_value(&back, Conventions { headings: ReadAs::Known(turned), ..Conventions::default() });
    assert!(alike(&scene, &good) && said.iter().any(|l| l.reason.contains("as --headings says")), "{said:?}");
}

#[test]
fn who_stands_follows_those_who_move_and_alone_says_that_a_great_heading_is_of_no_known_unit() {
    let mut value =
        northward(|state, _| state["heading"] = json!(vec![90.0; state["heading"].as_array().unwrap().len()]));
    let steps = value["tracks"]["2"]["state"]["valid"].as_array().unwrap().len();
    let parked = |value: &mut Value, track: &str| {
        value["tracks"][track]["state"]["position"] = vec![json!([4.0, 0.0, 0.0]); steps].into();
        value["tracks"][track]["state"]["velocity"] = vec![json!([0.0, 0.0]); steps].into();
        value["tracks"][track]["state"]["heading"] = vec![json!(45.0); steps].into();
    };
    let ego = if value["metadata"]["sdc_id"] == json!("2") { "2" } else { "1" };
    let other = if ego == "2" { "1" } else { "2" };
    parked(&mut value, other);
    let (scene, said) = read_value(&value, Conventions::default());
    assert!((scene.tracks[0].samples[0].unwrap().heading_rad - num::PI / 4.0).abs() < 1e-9, "{said:?}");
    parked(&mut value, ego);
    let (_, said) = read_value(&value, Conventions::default());
    assert!(said.iter().any(|l| l.is_doubtful() && l.reason.contains("greater than two turns")), "{said:?}");
}
