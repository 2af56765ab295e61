//! Motion and roads as the page carries them: whole hundredths, each number as its difference from the one before. That
//! is what a drawing shows, in a third of the space; `assets/unpack.js` turns it back into what the player reads.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use flate2::{Compression, write::ZlibEncoder};
use serde_json::{Value, json};
use std::io::Write;

use super::stage::{Playable, Stage, Unplayed};
use crate::draw::{Actor, Drawing};
use crate::kernel::{Vec2, num};

/// Units of a sample's numbers: centimetres, milliradians, centimetres a second.
const SCALES: [f64; 4] = [100.0, 100.0, 1000.0, 100.0];

/// Bytes of data from which on a page carries them deflated. Smaller ones stay readable for people and programs.
const PLAIN_BYTES_MAX: usize = 2 << 20;

/// The data's JSON as the page holds it: as it is, or as a JSON text of base64 of the deflated bytes, which `assets/unpack.js` reads.
pub fn held(data: String) -> String {
    if data.len() <= PLAIN_BYTES_MAX {
        return data;
    }
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::best());
    match encoder.write_all(data.as_bytes()).and_then(|()| encoder.finish()) {
        Ok(bytes) => format!("\"{}\"", STANDARD.encode(bytes)),
        // Writing to memory does not fail; if it did, the plain page is whole.
        Err(_) => data,
    }
}

/// The whole stage.
pub fn stage(stage: &Stage) -> Value {
    let scenes: serde_json::Map<String, Value> =
        stage.scenes.iter().map(|(id, scene)| (id.clone(), drawing(scene))).collect();
    let rollout = |playable: &Playable| {
        json!({
            "solution": playable.solution,
            "role": playable.role,
            "scene": playable.scene,
            "changed": playable.changed.iter().map(actor).collect::<Vec<_>>(),
            "contact": playable.contact,
            "caption": playable.caption,
            "as_recorded": playable.as_recorded,
        })
    };
    let mut packed = json!({"scenes": scenes, "rollouts": stage.rollouts.iter().map(rollout).collect::<Vec<_>>()});
    if !stage.unplayed.is_empty() {
        let said = |of: &Unplayed| json!({"solution": of.solution, "scene": of.scene, "reason": of.reason});
        packed["unplayed"] = stage.unplayed.iter().map(said).collect();
    }
    if stage.repetitions_left_out > 0 {
        packed["repetitions_left_out"] = json!(stage.repetitions_left_out);
    }
    packed
}

fn drawing(scene: &Drawing) -> Value {
    let lines: Vec<Value> =
        scene.lines.iter().map(|line| json!({"style": line.style, "points": points(&line.points)})).collect();
    json!({
        "dt_s": scene.dt_s,
        "steps": scene.steps,
        "start_step": scene.start_step,
        "current_step": scene.current_step,
        "verges": scene.verges.iter().map(|line| points(line)).collect::<Vec<_>>(),
        "surfaces": scene.surfaces.iter().map(|line| points(line)).collect::<Vec<_>>(),
        "lines": lines,
        "crosswalks": scene.crosswalks.iter().map(|line| points(line)).collect::<Vec<_>>(),
        "lights": scene.lights,
        "stop_signs": scene.stop_signs,
        "route": points(&scene.route),
        "actors": scene.actors.iter().map(actor).collect::<Vec<_>>(),
        "contact": scene.contact,
    })
}

/// An actor whose samples are runs `[first step, [differences]]` without absent ones, and how many samples there are.
fn actor(actor: &Actor) -> Value {
    let mut runs: Vec<(usize, Vec<i64>)> = Vec::new();
    let mut before: Option<[i64; 4]> = None;
    for (step, sample) in actor.samples.iter().enumerate() {
        let Some(sample) = sample else {
            before = None;
            continue;
        };
        let now: [i64; 4] = std::array::from_fn(|k| whole(sample[k], SCALES[k]));
        if before.is_none() {
            runs.push((step, Vec::new()));
        }
        let base = before.unwrap_or_default();
        if let Some((_, run)) = runs.last_mut() {
            run.extend((0..4).map(|k| now[k].saturating_sub(base[k])));
        }
        before = Some(now);
    }
    json!({
        "label": actor.label,
        "role": actor.role,
        "length_m": num::rounded(actor.length_m, 2),
        "width_m": num::rounded(actor.width_m, 2),
        "steps": actor.samples.len(),
        "runs": runs,
    })
}

fn points(line: &[Vec2]) -> Vec<i64> {
    let mut before = [0, 0];
    let mut packed = Vec::with_capacity(2 * line.len());
    for point in line {
        let now = [whole(point.x, 100.0), whole(point.y, 100.0)];
        packed.extend([now[0].saturating_sub(before[0]), now[1].saturating_sub(before[1])]);
        before = now;
    }
    packed
}

/// The nearest whole number of units. A number that is beyond all of them is the last one: a drawing shows neither.
fn whole(value: f64, scale: f64) -> i64 {
    (value * scale).round() as i64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::draw::Role;
    use proptest::prelude::*;

    /// Unpacks as `unpack.js` does.
    fn unpacked(packed: &Value) -> Vec<Option<[f64; 4]>> {
        let mut samples = vec![None; packed["steps"].as_u64().unwrap() as usize];
        for run in packed["runs"].as_array().unwrap() {
            let mut now = [0i64; 4];
            let numbers: Vec<i64> = run[1].as_array().unwrap().iter().map(|n| n.as_i64().unwrap()).collect();
            for (k, differences) in numbers.chunks(4).enumerate() {
                (0..4).for_each(|i| now[i] += differences[i]);
                samples[run[0].as_u64().unwrap() as usize + k] =
                    Some(std::array::from_fn(|i| now[i] as f64 / SCALES[i]));
            }
        }
        samples
    }

    proptest! {
        #[test]
        fn a_motion_comes_back_as_it_is_drawn(
            samples in prop::collection::vec(prop::option::weighted(0.8, prop::array::uniform4(-5000.0..5000.0f64)), 0..40)
        ) {
            // The drawing has rounded already.
            let drawn = |s: [f64; 4]| std::array::from_fn(|k| (s[k] * SCALES[k]).round() / SCALES[k]);
            let samples: Vec<Option<[f64; 4]>> = samples.into_iter().map(|s| s.map(drawn)).collect();
            let one = Actor { label: "v".into(), role: Role::Traffic, length_m: 4.5, width_m: 1.9, samples: samples.clone() };
            let back = unpacked(&actor(&one));
            prop_assert_eq!(back.len(), samples.len());
            for (found, wanted) in back.iter().zip(&samples) {
                prop_assert_eq!(found.is_some(), wanted.is_some());
                if let (Some(found), Some(wanted)) = (found, wanted) {
                    prop_assert!((0..4).all(|k| (found[k] - wanted[k]).abs() < 1e-9));
                }
            }
        }
    }

    #[test]
    fn data_of_a_large_page_are_deflated_and_come_back() {
        assert_eq!(held("[1]".into()), "[1]", "people and programs read a small one as it is");
        let large = format!("[{}0]", "{\"id\":\"cat-idm/e0s0\"},".repeat(200_000));
        let text: String = serde_json::from_str(&held(large.clone())).unwrap();
        assert!(text.len() * 20 < large.len());
        let mut back = String::new();
        let bytes = STANDARD.decode(text).unwrap();
        std::io::Read::read_to_string(&mut flate2::read::ZlibDecoder::new(bytes.as_slice()), &mut back).unwrap();
        assert!(back == large);
    }

    #[test]
    fn a_line_is_its_differences_in_centimetres() {
        assert_eq!(points(&[Vec2::new(1.0, -2.0), Vec2::new(1.5, -2.25)]), [100, -200, 50, -25]);
    }
}
