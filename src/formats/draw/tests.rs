//! Drawings of a generated scene, read back.

use super::*;
use crate::kernel::{Seed, Vec2};
use crate::scene::fixture::worlds;
use crate::scene::{LaneKind, Scene};
use crate::synth::{FamilyOptions, SynthOptions, WorldKind, family_member, generate};

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

/// Returns the number of elements of a document that is well-formed XML.
fn elements(document: &str) -> usize {
    let tree = roxmltree::Document::parse(document);
    let tree = tree.unwrap_or_else(|error| panic!("{error} in {}", &document[..200.min(document.len())]));
    tree.descendants().filter(roxmltree::Node::is_element).count()
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

/// In a page as high as the window, what stands above a player would leave it no height.
#[test]
fn a_player_below_other_content_has_a_height_of_its_own_and_a_page_that_scrolls() {
    let drawings = [("one".to_string(), Drawing::of_scene(&scene(WorldKind::Merge)))];
    let rule = ".evo-page:has(.evo-above) > .evo-player { flex: none; height: max(420px, 85vh); }";
    for page in
        [players_below("<p>above</p>", &drawings, "a"), players_html(&drawings, "b"), beside_html(&drawings, "c")]
    {
        let (_, body) = page.split_once("<body").unwrap();
        let (above, _) = body.split_once("<div id=\"player\"").unwrap();
        assert!(above.contains("<div class=\"evo-above\">") && above.trim_end().ends_with("</div>"), "{above}");
        assert!(page.contains(rule) && page.contains(".evo-page:has(.evo-above) { height: auto;"));
    }
    assert!(!player_html(&drawings[0].1, "alone").contains("class=\"evo-above\""), "it alone fills the window");
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

/// The `t = ..` lines of a strip, in order.
fn moments(strip: &str) -> Vec<String> {
    let after = strip.split(">t = ").skip(1);
    after.filter_map(|rest| Some(rest.split_once(" s<")?.0.to_string())).collect()
}

#[test]
fn a_strip_shows_each_moment_once_in_its_own_panel_and_the_contact_from_when_it_happens() {
    let mut drawing = Drawing::of_scene(&scene(WorldKind::Merge));
    let ego = drawing.actors.iter().find(|actor| actor.role == Role::Ego).unwrap();
    let at = |step: usize| ego.samples[step].map(|s| Vec2::new(s[0], s[1])).unwrap();
    let places: Vec<Vec2> = [10, 20, 30].map(at).to_vec();
    assert!(places[0].distance(places[2]) > 1.0, "the ego moves");
    drawing.contact = Some(Contact { step: 20, point: places[1], label: "the contact".into() });
    let of = |steps: Vec<usize>| StripOptions {
        panel_px: 320.0,
        theme: Theme::Light,
        frame: Frame::Around(12.0),
        steps,
        title: "a <strip>".into(),
    };
    let picture = strip(&drawing, &of(vec![10, 15, 20, 30]));
    assert!(elements(&picture) > 100 && picture.contains("a &lt;strip&gt;"));
    assert_eq!(moments(&picture), ["0.0", "0.5", "1.0", "2.0"], "the rollout begins at step 10");
    assert!((drawing.clock_s(4) + 0.6).abs() < 1e-9, "what was recorded before");
    let panels: Vec<&str> = picture.split("<svg x=").skip(1).map(|rest| rest.split("</svg>").next().unwrap()).collect();
    let marked = panels.iter().map(|panel| panel.contains("the contact") && panel.contains("#d7191c"));
    assert_eq!(marked.collect::<Vec<_>>(), [false, false, true, true]);
    // The first panels show one part of the world, in which the road's edges are drawn at the same places, the last two the contact closely.
    let road =
        |panel: &str| panel.lines().filter(|line| line.contains("#5d6672")).map(String::from).collect::<Vec<_>>();
    assert!(!road(panels[0]).is_empty() && road(panels[0]) == road(panels[1]) && panels[0] != panels[1]);
    assert!(road(panels[2]) == road(panels[3]) && road(panels[1]) != road(panels[2]));
    let metres =
        |panel: &str| panel.split(" m</text>").next().unwrap().rsplit('>').next().unwrap().parse::<f64>().unwrap();
    assert!(metres(panels[0]) > metres(panels[3]), "each panel has the bar of its own scale");
    assert_eq!(strip(&drawing, &of(vec![10, 15, 20, 30])), picture, "the same bytes");
    // Somebody moved far away makes nobody smaller in the first panels.
    let ego = drawing.actors.iter().find(|actor| actor.role == Role::Ego).unwrap().clone();
    let far = ego.samples.iter().map(|of| of.map(|[x, y, heading, speed]| [x + 400.0, y, heading, speed]));
    let other = Actor { label: "far".into(), role: Role::Adversary, samples: far.collect(), ..ego.clone() };
    let mut with_other = drawing.clone();
    with_other.actors.push(other);
    let apart = StripOptions { frame: Frame::Around(12.0), ..of(vec![10, 15, 20, 30]) };
    let bar = |picture: &str| -> f64 {
        let said = picture.split(" m</text>").next().unwrap().rsplit('>').next().unwrap();
        said.parse().unwrap()
    };
    assert!(bar(&strip(&with_other, &apart)) <= 20.0, "the scale of the first panel");
    let key = |picture: &str| picture.matches(">adversary</text>").count();
    assert_eq!(key(&strip(&with_other, &apart)), 0, "who is in no panel is not in the key");
    assert_eq!(key(&picture), 0);
    let beside = ego.samples.iter().map(|of| of.map(|[x, y, heading, speed]| [x + 9.0, y, heading, speed]));
    with_other.actors.push(Actor { role: Role::Adversary, samples: beside.collect(), ..ego.clone() });
    assert_eq!(key(&strip(&with_other, &apart)), 1);
    // Without a contact nothing is shown closely.
    drawing.contact = None;
    let whole = strip(&drawing, &of(vec![10, 15, 20, 30]));
    let panels: Vec<&str> = whole.split("<svg x=").skip(1).map(|rest| rest.split("</svg>").next().unwrap()).collect();
    assert_eq!(road(panels[1]), road(panels[3]));
}

/// Places and words of the texts of a panel.
fn words(panel: &str) -> Vec<(f64, f64, String)> {
    let number = |line: &str, key: &str| -> f64 {
        line.split(&format!(" {key}=\"")).nth(1).unwrap().split('"').next().unwrap().parse().unwrap()
    };
    let of = |line: &str| {
        let said = line.rsplit_once("</text>")?.0.rsplit_once('>')?.1.to_string();
        Some((number(line, "x"), number(line, "y"), said))
    };
    panel.lines().filter(|line| line.starts_with("<text")).filter_map(of).collect()
}

#[test]
fn somebody_small_has_a_glyph_that_is_seen_and_words_stay_in_every_panel() {
    let mut drawing = Drawing::of_scene(&scene(WorldKind::Merge));
    let ego = drawing.actors.iter().find(|actor| actor.role == Role::Ego).unwrap().clone();
    let (met, there) = (25, ego.samples[25].map(|s| Vec2::new(s[0], s[1])).unwrap());
    let rider = Actor { label: "inserted cyclist".into(), role: Role::Adversary, length_m: 1.8, width_m: 0.7, ..ego };
    drawing.actors.push(rider);
    drawing.contact = Some(Contact { step: met, point: there, label: "contact, 20.5 m/s".into() });
    let options = StripOptions {
        panel_px: 320.0,
        theme: Theme::Light,
        frame: Frame::Around(60.0),
        steps: vec![10, 15, 20, met],
        title: String::new(),
    };
    let rows = [("Parent".to_string(), &drawing), ("Evolved".to_string(), &drawing)];
    let picture = strips(&rows, &options);
    assert!(picture.contains(">Parent</text>") && picture.contains(">Evolved</text>"));
    let panels: Vec<&str> = picture.split("<svg x=").skip(1).map(|rest| rest.split("</svg>").next().unwrap()).collect();
    assert_eq!(panels.len(), 8);
    let height: f64 = panels[0].split(" height=\"").nth(1).unwrap().split('"').next().unwrap().parse().unwrap();
    for panel in &panels {
        let glyph = panel.lines().find(|line| line.starts_with("<ellipse")).expect("a rider is no box");
        let breadth: f64 = glyph.split(" ry=\"").nth(1).unwrap().split('"').next().unwrap().parse().unwrap();
        assert!(breadth >= 2.9, "{glyph}");
        let words = words(panel);
        assert!(words.iter().any(|(.., said)| said.starts_with("inserted cyclist")), "{words:?}");
        for (x, y, said) in &words {
            let right = x + 8.2 * said.chars().count() as f64;
            assert!(*x >= 0.0 && right <= 320.0 && *y > 8.0 && *y <= height, "{said} at {x}, {y}");
        }
    }
}

#[test]
fn even_steps_begin_and_end_where_asked_and_never_repeat() {
    assert_eq!(even_steps(10, 40, 4), [10, 20, 30, 40]);
    assert_eq!(even_steps(10, 25, 3), [10, 18, 25]);
    assert_eq!(even_steps(10, 12, 5), [10, 11, 12]);
    assert_eq!(even_steps(7, 30, 1), [30], "one picture is that of the end");
    assert_eq!(even_steps(9, 9, 4), [9]);
    assert_eq!(even_steps(9, 3, 2), [9], "an end before the start is the start");
}

fn film_options(steps: Vec<usize>) -> FilmOptions {
    let title = "a title that is longer than one line of the film is, so that it goes on in a second line and is cut behind that one, here";
    FilmOptions { width_px: 481.0, theme: Theme::Light, frame: Frame::Around(12.0), steps, title: title.into() }
}

#[test]
fn a_film_shows_every_step_and_its_gif_gives_it_back() {
    let drawing = Drawing::of_scene(&scene(WorldKind::SignalledCrossing));
    let options = film_options((10..22).collect());
    let film_on = |threads: usize| film(&drawing, &options, &crate::kernel::Threads::new(threads).unwrap()).unwrap();
    let whole = film_on(1);
    assert_eq!((whole.width, whole.height % 2, whole.pictures.len()), (482, 0, 12));
    assert_eq!(whole, film_on(3), "who makes a picture does not matter");
    assert!(whole.pictures.windows(2).all(|two| two[0] != two[1]), "the ego drives");
    // The boxes of the ego are where the drawing has it.
    let ego: Vec<u8> = whole.pictures[0].chunks_exact(3).flat_map(|p| [u8::from(p == [0x00, 0x64, 0xb0])]).collect();
    assert!(ego.iter().filter(|is| **is == 1).count() > 60, "the ego's colour, in the key and on the road");

    let bytes = gif(&whole, 10, 150).unwrap();
    assert_eq!(bytes, gif(&film_on(2), 10, 150).unwrap());
    let mut read = ::gif::DecodeOptions::new();
    read.set_color_output(::gif::ColorOutput::RGBA);
    let mut read = read.read_info(bytes.as_slice()).unwrap();
    let (width, mut delays) = (usize::from(read.width()), Vec::new());
    let mut shown = vec![0u8; width * usize::from(read.height()) * 3];
    for picture in &whole.pictures {
        let frame = read.read_next_frame().unwrap().expect("a picture");
        delays.push(frame.delay);
        let [left, top, wide] = [frame.left, frame.top, frame.width].map(usize::from);
        for (k, pixel) in frame.buffer.chunks_exact(4).enumerate() {
            let at = 3 * ((top + k / wide) * width + left + k % wide);
            shown[at..at + 3].copy_from_slice(&pixel[..3]);
        }
        let off = shown.iter().zip(picture).filter(|(a, b)| a.abs_diff(**b) > 24).count();
        assert!(off * 200 < shown.len(), "{off} of {} values are another colour", shown.len());
    }
    assert!(read.read_next_frame().unwrap().is_none());
    assert_eq!((delays[0], delays[11]), (10, 150));
}

#[test]
fn a_film_that_is_too_large_or_empty_is_no_panic() {
    let threads = crate::kernel::Threads::new(1).unwrap();
    let empty = Drawing { dt_s: 0.1, steps: 1, ..Drawing::default() };
    let none = film(&empty, &film_options(vec![]), &threads).unwrap();
    assert!(none.pictures.is_empty() && !gif(&none, 10, 10).unwrap().is_empty());
    let large = Film { width: 70_000, height: 2, pictures: vec![] };
    assert!(gif(&large, 10, 10).unwrap_err().to_string().contains("--panel"));
}

#[test]
fn sidewalks_lie_below_the_road_in_a_colour_of_their_own() {
    let scene = family_member(&FamilyOptions::all(), Seed(7), 0).unwrap();
    let drawing = Drawing::of_scene(&scene);
    let beside = scene.road.lanes.iter().filter(|lane| lane.kind == LaneKind::Other).count();
    assert!(beside > 0 && drawing.verges.len() == beside, "{beside}");
    assert_eq!(drawing.surfaces.len() + beside, scene.road.lanes.len());
    let document = svg(&drawing, &options("sidewalks"));
    let at = |colour: &str| document.find(&format!("<g fill=\"{colour}\"")).expect("drawn");
    assert!(at("#e1e4e3") < at("#cdd2d8"));
    let none = svg(&Drawing { verges: Vec::new(), ..drawing }, &options("none"));
    assert!(!none.contains("#e1e4e3"));
}
