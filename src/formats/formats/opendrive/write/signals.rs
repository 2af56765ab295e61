//! Traffic lights and stop signs as signals beside the lanes that they are for.

use super::graph::Network;
use super::place_on;
use crate::formats::xml_write::{Xml, decimal};
use crate::scene::Scene;

/// Height at which lights and signs hang, metres.
const LIGHT_HEIGHT_M: &str = "5";
const SIGN_HEIGHT_M: &str = "2.1";

/// The id of the signal that is a light of the scene.
pub(in crate::formats) fn light_signal_id(light: usize) -> String {
    (light + 1).to_string()
}

pub(super) fn write(xml: &mut Xml, scene: &Scene, network: &Network, road: usize) {
    let lights = scene.lights.iter().enumerate().filter_map(|(ix, light)| {
        let (on, s_m, t_m) = place_on(network, light.lane, light.stop_point)?;
        (on == road).then(|| (light_signal_id(ix), s_m, t_m))
    });
    let count = scene.lights.len();
    let faces = scene.stop_signs.iter().flat_map(|sign| sign.lanes.iter().map(move |&lane| (sign, lane)));
    let signs = faces.enumerate().filter_map(|(ix, (sign, lane))| {
        let (on, s_m, t_m) = place_on(network, lane, sign.position)?;
        (on == road).then(|| ((count + ix + 1).to_string(), s_m, t_m))
    });
    let (lights, signs): (Vec<_>, Vec<_>) = (lights.collect(), signs.collect());
    if lights.is_empty() && signs.is_empty() {
        return;
    }
    xml.within("signals", &[], |xml| {
        for (id, s_m, t_m) in &lights {
            signal(xml, id, *s_m, *t_m, "yes", LIGHT_HEIGHT_M, ["OpenDRIVE", "1000001", "-1"]);
        }
        for (id, s_m, t_m) in &signs {
            signal(xml, id, *s_m, *t_m, "no", SIGN_HEIGHT_M, ["DE", "206", "-1"]);
        }
    });
}

fn signal(xml: &mut Xml, id: &str, s_m: f64, t_m: f64, dynamic: &str, height_m: &str, catalogue: [&str; 3]) {
    let [country, kind, subtype] = catalogue;
    xml.empty(
        "signal",
        &[
            ("s", &decimal(s_m)),
            ("t", &decimal(t_m)),
            ("id", &id),
            ("name", &format!("signal {id}")),
            ("dynamic", &dynamic),
            ("orientation", &"+"),
            ("zOffset", &height_m),
            ("country", &country),
            ("type", &kind),
            ("subtype", &subtype),
            ("height", &"0.8"),
            ("width", &"0.6"),
        ],
    );
}
