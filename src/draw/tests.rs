//! Drawings of a generated scene, read back.

use super::*;
use crate::kernel::{Seed, Vec2};
use crate::scene::Scene;
use crate::scene::fixture::worlds;
use crate::synth::{SynthOptions, WorldKind, generate};

fn scene(kind: WorldKind) -> Scene {
    let options = SynthOptions { kinds: vec![kind], ..worlds() };
    generate(kind, Seed(1), 0, &options).unwrap()
}

fn options(title: &str) -> SvgOptions {
    SvgOptions {
        width_px: 1200.0,
        theme: Theme::Light,
        frame: Frame::Around(30.0),
        step: None,
        trails: true,
        labels: false,
        title: title.into(),
    }
}

/// Well-formed XML: every element closed, in order.
fn elements(document: &str) -> usize {
    let mut reader = quick_xml::Reader::from_str(document);
    let mut count = 0;
    loop {
        match reader.read_event() {
            Ok(quick_xml::events::Event::Eof) => return count,
            Ok(quick_xml::events::Event::Start(_) | quick_xml::events::Event::Empty(_)) => count += 1,
            Ok(_) => {}
            Err(error) => panic!("{error} in {}", &document[..200.min(document.len())]),
        }
    }
}

#[test]
fn a_picture_is_well_formed_and_names_the_leading_parts() {
    let scene = scene(WorldKind::SignalledCrossing);
    let picture = svg(&Drawing::of_scene(&scene), &options("a <crossing> & more"));
    assert!(elements(&picture) > 100);
    assert!(picture.contains("a &lt;crossing&gt; &amp; more"));
    assert!(picture.contains(">ego "));
    let marked = &scene.tracks[scene.objects_of_interest[0]].id;
    assert!(picture.contains(&format!(">{marked} ")), "{marked}");
}

#[test]
fn an_empty_drawing_still_gives_a_picture_and_a_page() {
    let empty = Drawing { dt_s: 0.1, steps: 1, ..Drawing::default() };
    assert!(elements(&svg(&empty, &SvgOptions { frame: Frame::Everything, ..options("") })) > 2);
    assert!(player_html(&empty, "nothing").contains("EvoPlayer.mount"));
}

#[test]
fn a_page_is_self_contained_and_its_data_are_the_drawing() {
    let mut drawing = Drawing::of_scene(&scene(WorldKind::Merge));
    drawing.actors[0].label = "</script><b>".into();
    drawing.contact = Some(Contact { step: 40, point: Vec2::new(1.0, 2.0), label: "ego hit by v1".into() });
    let page = player_html(&drawing, "merge & co");
    assert!(!page.contains("http://") && !page.contains("https://") && !page.contains("src="), "loads something");
    let from = page.find("id=\"drawing\">").unwrap() + "id=\"drawing\">".len();
    let data = &page[from..from + page[from..].find("</script>").unwrap()];
    assert_eq!(serde_json::from_str::<Drawing>(data).unwrap(), drawing);
}

#[test]
fn every_role_that_occurs_is_in_the_legend_once() {
    let drawing = Drawing::of_scene(&scene(WorldKind::UnsignalledCrossing));
    let roles = drawing.roles();
    assert_eq!(roles[..2], [Role::Ego, Role::Interacting]);
    assert!(roles.contains(&Role::Traffic));
    let picture = svg(&drawing, &options("legend"));
    assert!(picture.contains(">interacting</text>"));
}

#[test]
#[allow(clippy::disallowed_methods)]
fn pictures_for_the_eye_are_written_where_asked() {
    // Set EVODRIVE_PICTURES to a folder to look at every kind of world.
    let Ok(folder) = std::env::var("EVODRIVE_PICTURES") else {
        println!("skipped: EVODRIVE_PICTURES names no folder");
        return;
    };
    for kind in WorldKind::ALL {
        let drawing = Drawing::of_scene(&scene(kind));
        let near = svg(&drawing, &options(kind.name()));
        let all = SvgOptions { frame: Frame::Everything, theme: Theme::Dark, ..options(kind.name()) };
        std::fs::write(format!("{folder}/{}.svg", kind.name()), near).unwrap();
        std::fs::write(format!("{folder}/{}_all.svg", kind.name()), svg(&drawing, &all)).unwrap();
        std::fs::write(format!("{folder}/{}.html", kind.name()), player_html(&drawing, kind.name())).unwrap();
    }
}
