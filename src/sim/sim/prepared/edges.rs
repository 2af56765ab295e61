//! Kerbs, medians and barriers between carriageways: how far a way goes across one.
//!
//! Edges of recordings are off by some decimetres, and vehicles drive along them or past their ends. So a crossing counts as far as the
//! way was from the edge before it, or as far as it got on the other side, whichever is less: no speed, stop or return makes that
//! smaller.

use crate::kernel::{Extent, Polyline, Vec2};

use super::segment::Segment;

/// Two lines whose ends lie this near to each other are one edge, metres.
const JOIN_M: f64 = 0.5;
/// Cosine of 45°: where an edge turns farther from its direction at the crossing, another side begins.
const SIDE_COS: f64 = std::f64::consts::FRAC_1_SQRT_2;
/// Edge that is looked at from a crossing on to either side, metres.
const REACH_M: f64 = 200.0;
/// A place this near to the end of an edge does not lie beside it, metres.
const END_M: f64 = 1e-6;

/// The edges of a road.
#[derive(Clone, Debug)]
pub struct Edges {
    lines: Vec<Polyline>,
    /// Pieces of all lines, each with its line and its place there.
    pieces: Vec<(Segment, usize, usize)>,
}

impl Edges {
    pub fn of(lines: &[Vec<Vec2>]) -> Edges {
        let lines = joined(lines.iter().filter_map(|line| Polyline::new(line.clone()).ok()).collect());
        let mut pieces = Vec::new();
        for (ix, line) in lines.iter().enumerate() {
            let segments = line.points().windows(2).map(|two| Segment::new(two[0], two[1]));
            pieces.extend(segments.enumerate().map(|(at, segment)| (segment, ix, at)));
        }
        Edges { lines, pieces }
    }

    /// Returns how far a way goes across an edge in the step that leads to place `from` or a later one, metres: of each crossing the lesser of
    /// its distances from the edge before and on the other side after, each as long as it runs beside the edge, at places for which
    /// `counts` is true; the largest of these. A way that begins beside the edge has come from farther away.
    pub fn across_m(&self, way: &[Vec2], from: usize, counts: impl Fn(Vec2) -> bool) -> f64 {
        let around = Extent::around(way.iter().copied());
        let near: Vec<_> = self.pieces.iter().filter(|(piece, ..)| piece.meets(&around)).collect();
        let mut most_m: f64 = 0.0;
        for k in from.max(1)..way.len() {
            let step = Segment::new(way[k - 1], way[k]);
            for (piece, line, at) in near.iter().filter(|(piece, ..)| piece.is_crossed(&step)) {
                let side = Side::of(&self.lines[*line], *at);
                let comes_from_left = (piece.to - piece.from).cross(way[k - 1] - piece.from) > 0.0;
                // 0 on the other side, and where it does not count.
                let off_m = |left: bool, place: &Vec2| {
                    let off_m = side.offset_m(*place)?;
                    Some(if (off_m > 0.0) == left && counts(*place) { off_m.abs() } else { 0.0 })
                };
                let after_m = way[k..].iter().map_while(|place| off_m(!comes_from_left, place)).fold(0.0, f64::max);
                if after_m > most_m {
                    let before = way[..k].iter().rev().map_while(|place| off_m(comes_from_left, place));
                    let before_m: Vec<f64> = before.collect();
                    let begins_here = before_m.len() == k && before_m[k - 1] > 0.0;
                    let came_m = if begins_here { f64::INFINITY } else { before_m.into_iter().fold(0.0, f64::max) };
                    most_m = most_m.max(came_m.min(after_m));
                }
            }
        }
        most_m
    }
}

/// The stretch of an edge around a piece that runs as the piece does.
struct Side<'e> {
    line: &'e Polyline,
    first: usize,
    last: usize,
}

impl Side<'_> {
    fn of(line: &Polyline, piece: usize) -> Side<'_> {
        let own = direction(line.points(), piece);
        let s_m = line.lengths();
        let runs = |k: usize| is_ahead(own, direction(line.points(), k)) && (s_m[k] - s_m[piece]).abs() <= REACH_M;
        let first = (0..piece).rev().take_while(|k| runs(*k)).last().unwrap_or(piece);
        let last = (piece + 1..line.points().len() - 1).take_while(|k| runs(*k)).last().unwrap_or(piece) + 1;
        Side { line, first, last }
    }

    /// Signed distance of a place beside it, left positive, metres; `None` beyond its ends.
    fn offset_m(&self, place: Vec2) -> Option<f64> {
        let at = self.line.project_within(place, self.first, self.last);
        let s_m = self.line.lengths();
        (at.s_m > s_m[self.first] + END_M && at.s_m < s_m[self.last] - END_M).then_some(at.offset_m)
    }
}

fn direction(points: &[Vec2], piece: usize) -> Vec2 {
    points[piece + 1] - points[piece]
}

fn is_ahead(one: Vec2, other: Vec2) -> bool {
    one.dot(other) >= SIDE_COS * one.norm() * other.norm()
}

/// Lines that go on in each other as one, and rings that begin at their sharpest corner: maps cut edges anywhere.
fn joined(lines: Vec<Polyline>) -> Vec<Polyline> {
    let mut left: Vec<Vec<Vec2>> = lines.into_iter().map(|line| line.into_parts().0).collect();
    let mut all = Vec::new();
    while let Some(mut line) = left.pop() {
        for _end in 0..2 {
            while let Some(next) = take_next(&line, &mut left) {
                line.extend(next);
            }
            line.reverse();
        }
        if line.len() > 3 && line[0].distance(line[line.len() - 1]) <= JOIN_M {
            begin_at_corner(&mut line);
        }
        all.extend(Polyline::new(line));
    }
    all
}

/// Takes out of `left` a line that goes on where this one ends, turned so that it does.
fn take_next(line: &[Vec2], left: &mut Vec<Vec<Vec2>>) -> Option<Vec<Vec2>> {
    let (end, ahead) = (line[line.len() - 1], direction(line, line.len() - 2));
    let goes_on = |from: Vec2, to: Vec2| from.distance(end) <= JOIN_M && is_ahead(ahead, to - from);
    let forward = |other: &Vec<Vec2>| goes_on(other[0], other[1]);
    let backward = |other: &Vec<Vec2>| goes_on(other[other.len() - 1], other[other.len() - 2]);
    let ix = left.iter().position(|other| forward(other) || backward(other))?;
    let mut next = left.swap_remove(ix);
    if !forward(&next) {
        next.reverse();
    }
    Some(next)
}

fn begin_at_corner(ring: &mut Vec<Vec2>) {
    ring.pop();
    let count = ring.len();
    let turn = |k: usize| {
        let (before, after) = (ring[k] - ring[(k + count - 1) % count], ring[(k + 1) % count] - ring[k]);
        before.dot(after) / (before.norm() * after.norm())
    };
    let corner = (0..count).min_by(|a, b| turn(*a).total_cmp(&turn(*b))).unwrap_or(0);
    ring.rotate_left(corner);
    ring.push(ring[0]);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernel::num;

    /// Along y = 0 from 0 to 100 m.
    fn straight() -> Vec<Vec<Vec2>> {
        vec![vec![Vec2::ZERO, Vec2::new(100.0, 0.0)]]
    }

    fn across(edges: &[Vec<Vec2>], way: &[Vec2]) -> f64 {
        Edges::of(edges).across_m(way, 0, |_| true)
    }

    /// Returns a way from 20 m on along the edge, as far beside it as the values, in so many steps from one to the next.
    fn beside(offs_m: &[f64], steps: usize) -> Vec<Vec2> {
        let count = (offs_m.len() - 1) * steps;
        let at = |k: usize| {
            let (ix, share) = (k / steps, (k % steps) as f64 / steps as f64);
            let next = offs_m[(ix + 1).min(offs_m.len() - 1)];
            Vec2::new(20.0 + 40.0 * k as f64 / count as f64, offs_m[ix] + share * (next - offs_m[ix]))
        };
        (0..=count).map(at).collect()
    }

    #[test]
    fn a_way_across_counts_the_lesser_side_however_fast_it_is_and_whatever_it_does_then() {
        for steps in [1, 7, 60, 600] {
            for (offs_m, expected_m) in [
                (&[-1.75, 3.0][..], 3.0),
                (&[-1.75, 1.2], 1.2),
                (&[-1.75, 1.2, -1.75], 1.2),
                (&[-1.75, 0.2, -1.75], 0.2),
                (&[-2.0, 0.4, -0.4, 2.0], 2.0),
                (&[-2.0, 0.4, 0.0, 0.0, -0.4, 0.0, 2.0], 2.0),
                (&[-0.05, 2.0], 2.0),
                (&[2.0, -1.5], 1.5),
                (&[-1.75, 0.0], 0.0),
                (&[-1.75, -0.1, -1.75], 0.0),
            ] {
                let found = across(&straight(), &beside(offs_m, steps));
                assert!((found - expected_m).abs() < 1e-9, "{offs_m:?} in {steps} steps: {found}");
            }
        }
    }

    #[test]
    fn who_comes_back_from_a_touch_has_not_gone_across_and_who_began_there_has() {
        // It begins on the other side by 0.2 m: that may be the map's error, and its earlier way is not known.
        assert_eq!(across(&straight(), &beside(&[-1.75, 0.2, 0.2, -1.75], 9)), 0.2);
        assert_eq!(across(&straight(), &beside(&[0.2, -1.75], 9)), 1.75);
    }

    #[test]
    fn only_steps_from_the_first_one_on_and_places_that_count_are_counted() {
        let way = beside(&[-1.75, 1.75, 1.75], 10);
        let edges = Edges::of(&straight());
        // Its place 5 lies on the edge, which still belongs to the side it comes from.
        assert_eq!(edges.across_m(&way, 6, |_| true), 1.75);
        assert_eq!(edges.across_m(&way, 7, |_| true), 0.0, "it had gone across before");
        assert_eq!(edges.across_m(&way, usize::MAX / 2, |_| true), 0.0);
        assert_eq!(
            edges.across_m(&way, 0, |at| at.y < 1.0),
            way.iter().map(|p| p.y).filter(|y| *y < 1.0).fold(0.0, f64::max)
        );
        assert_eq!(
            edges.across_m(&way, 0, |at| at.y > 0.0),
            0.0,
            "from nowhere onto a carriageway is no way between two"
        );
    }

    #[test]
    fn an_edge_in_pieces_that_run_either_way_is_one_edge() {
        let at = |x: f64| Vec2::new(x, 0.0);
        let pieces = vec![
            vec![at(35.0), at(0.0)],
            vec![at(35.2), at(41.0)],
            vec![at(100.0), at(44.0)],
            vec![at(44.0), at(41.0)],
        ];
        let way = beside(&[-1.75, 1.75], 40);
        assert!((across(&pieces, &way) - across(&straight(), &way)).abs() < 1e-9);
        let apart = vec![vec![at(39.0), at(41.0)]];
        assert!(across(&apart, &way) < 0.1, "past both ends of a short one: that is a way round it");
    }

    #[test]
    fn a_thin_barrier_is_crossed_by_who_is_on_its_other_side_and_not_by_who_goes_round_its_end() {
        let at = |x: f64, y: f64| Vec2::new(x, y);
        for turn in 0..4 {
            let mut ring = vec![at(0.0, -0.15), at(50.0, -0.15), at(100.0, -0.15), at(100.0, 0.15), at(0.0, 0.15)];
            ring.rotate_left(turn);
            ring.push(ring[0]);
            let found = across(&[ring.clone()], &beside(&[-1.75, 1.75], 20));
            assert!((found - 1.9).abs() < 1e-9, "from the nearer side 1.6 m, from the farther 1.9 m: {found}");
            let round: Vec<Vec2> = (0..=20)
                .map(|k| {
                    at(
                        100.1 + 1.7 * num::sin(0.05 * num::PI * f64::from(k)),
                        -1.7 * num::cos(0.05 * num::PI * f64::from(k)),
                    )
                })
                .collect();
            assert_eq!(across(&[ring], &round), 0.0);
        }
    }

    #[test]
    fn a_way_along_a_bend_does_not_cross_it_and_one_that_cuts_it_counts_its_distance_from_it() {
        let arc = |radius_m: f64| -> Vec<Vec2> {
            (0..=90).map(|k| Vec2::from_heading(f64::from(k) * num::PI / 180.0) * radius_m).collect()
        };
        let kerb = [arc(12.0)];
        assert_eq!(across(&kerb, &arc(13.75)), 0.0);
        // Its chord is nearest to the centre halfway, at 16 / √2 = 11.31 m.
        let cut: Vec<Vec2> = (0..=20).map(|k| Vec2::new(16.0 - 0.8 * f64::from(k), 0.8 * f64::from(k))).collect();
        assert!((across(&kerb, &cut) - (12.0 - 8.0 * 2.0f64.sqrt())).abs() < 0.01, "{}", across(&kerb, &cut));
    }
}
