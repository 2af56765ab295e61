//! The pictures of the repository: no line of text leaves its picture, and none is cut where a reader wants to go on.

use std::path::Path;

use evodrive::draw::width;

/// A line of text: from where to where it reaches by the widths of the font, the part of the drawing that it must keep to, and what it says.
#[derive(Debug)]
struct Line {
    reach: [f64; 2],
    room: [f64; 2],
    text: String,
}

fn attribute<'t>(tag: &'t str, name: &str) -> Option<&'t str> {
    tag.split(&format!(" {name}=\"")).nth(1)?.split('"').next()
}

fn number(tag: &str, name: &str) -> f64 {
    attribute(tag, name).and_then(|text| text.parse().ok()).unwrap_or_else(|| panic!("{name}: {tag}"))
}

/// The lines that are read from left to right, in drawings within drawings too.
fn lines(svg: &str) -> Vec<Line> {
    let (mut rooms, mut lines): (Vec<[f64; 2]>, Vec<Line>) = (Vec::new(), Vec::new());
    for tag in svg.split('<').skip(1) {
        if tag.starts_with("svg ") {
            let seen: Vec<f64> =
                attribute(tag, "viewBox").unwrap().split(' ').map(|part| part.parse().unwrap()).collect();
            rooms.push([seen[0], seen[0] + seen[2]]);
        } else if tag.starts_with("/svg") {
            rooms.pop();
        } else if tag.starts_with("text ") && !tag.contains("rotate(") {
            let (tag, text) = tag.split_once('>').unwrap();
            let text = text.replace("&lt;", "<").replace("&gt;", ">").replace("&quot;", "\"").replace("&amp;", "&");
            // Bold letters are a tenth wider at most.
            let bold = if tag.contains("font-weight") && !tag.contains("\"400\"") { 1.1 } else { 1.0 };
            let wide = bold * width(&text, number(tag, "font-size"));
            let before = match attribute(tag, "text-anchor") {
                Some("middle") => 0.5,
                Some("end") => 1.0,
                _ => 0.0,
            };
            let from = number(tag, "x") - before * wide;
            lines.push(Line { reach: [from, from + wide], room: *rooms.last().unwrap(), text });
        }
    }
    lines
}

/// Returns the faults of a picture.
fn faults(svg: &str) -> Vec<String> {
    let leaves = |line: &Line| line.reach[0] < line.room[0] - 1.0 || line.reach[1] > line.room[1] + 1.0;
    let cut = |line: &Line| line.text.ends_with("...") || line.text.ends_with('…');
    let wrong = |line: &Line| match (leaves(line), cut(line)) {
        (true, _) => Some(format!("leaves its picture: {line:?}")),
        (_, true) => Some(format!("is cut: {line:?}")),
        _ => None,
    };
    lines(svg).iter().filter_map(wrong).collect()
}

#[test]
fn no_text_of_a_picture_leaves_it_or_is_cut() {
    let home = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut looked_at = 0;
    for folder in ["golden/paper", "golden/downstream", "docs/gallery"] {
        for entry in std::fs::read_dir(home.join(folder)).unwrap() {
            let path = entry.unwrap().path();
            if path.extension().is_some_and(|ending| ending == "svg") {
                let found = faults(&std::fs::read_to_string(&path).unwrap());
                assert!(found.is_empty(), "{}: {found:#?}", path.display());
                looked_at += 1;
            }
        }
    }
    assert!(looked_at > 30, "{looked_at} pictures");
}

#[test]
fn a_text_that_leaves_its_picture_or_is_cut_is_found() {
    let of = |x: &str, anchor: &str, text: &str| {
        let inner = format!("<text x=\"{x}\" y=\"5\" font-size=\"10\"{anchor}>{text}</text>");
        faults(&format!("<svg viewBox=\"0 0 500 9\"><svg viewBox=\"0 0 100 9\">{inner}</svg></svg>")).len()
    };
    assert_eq!(of("10", "", "within"), 0);
    assert_eq!(of("80", "", "without"), 1, "it reaches beyond the inner drawing, if not the outer one");
    assert_eq!(of("10", " text-anchor=\"end\"", "without"), 1);
    assert_eq!(of("10", "", "cut wit ..."), 1);
}
