use super::*;
use crate::draw::{Shape, pdf};

fn words(figure: &crate::draw::Figure) -> String {
    let text = |shape: &Shape| match shape {
        Shape::Text(words) => Some(words.text.clone()),
        _ => None,
    };
    figure.shapes.iter().filter_map(text).collect::<Vec<_>>().join("\n")
}

#[test]
fn the_architecture_is_drawn_from_the_page_alone() {
    let page = include_str!("../../../../docs/ARCHITECTURE.md");
    let all = rooms::rooms(page);
    assert!(all.len() > 25, "{all:?}");
    let words_in = words(&architecture().unwrap());
    assert!(all.iter().all(|room| words_in.lines().any(|line| line == room.name)), "{words_in}");
    assert_eq!(all.iter().find(|room| room.name == "kernel").unwrap().imports, Some(0));
    assert!(rooms::rooms("| floor | no such table |").is_empty());
}

#[test]
fn a_figure_is_the_same_bytes_each_time() {
    let (one, two) = (architecture().unwrap(), architecture().unwrap());
    assert_eq!((one.svg(), pdf(&one).unwrap()), (two.svg(), pdf(&two).unwrap()));
}
