//! Black-box search of the SafeBench ports: a (1+1) evolution strategy on the cube [0, 1]^n whose numbers are a profile
//! over time. The first query is given, as a rule drawn at random, and kept if it already succeeds; every later one takes the best so far and
//! moves a stretch of it or draws that stretch anew. Numbers of a stretch move together: what a road user makes of a
//! profile is about its mean over a second or two, in which changes of single numbers cancel out. Early stretches are
//! taken more often: they change everything that comes after them.

use crate::kernel::Stream;

/// Numbers of the search.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Queries {
    /// Most queries; each is one simulation.
    pub count: usize,
    /// Largest change of a number, 1.
    pub step: f64,
    /// Length of the stretch that a query changes, as a share of all numbers.
    pub changed_share: f64,
}

/// The result of a query.
pub struct Answer<T> {
    /// Smaller is better.
    pub loss: f64,
    /// True if the goal is reached, so that the search may stop.
    pub success: bool,
    /// Result that the simulation left behind.
    pub made: T,
}

/// Asks until a query succeeds or none is left. What the queries found with their losses, in the order asked; a query
/// that `ask` refuses counts, but leaves nothing.
pub fn ask_all<T>(
    queries: &Queries,
    first: Vec<f64>,
    stream: &mut Stream,
    mut ask: impl FnMut(&[f64]) -> Option<Answer<T>>,
) -> Vec<(f64, T)> {
    let mut best: (Vec<f64>, f64) = (first, f64::INFINITY);
    let mut answers = Vec::with_capacity(queries.count);
    for query in 0..queries.count {
        let place = if query == 0 { best.0.clone() } else { changed(queries, &best.0, stream) };
        let Some(answer) = ask(&place) else { continue };
        if answer.loss < best.1 {
            best = (place, answer.loss);
        }
        answers.push((answer.loss, answer.made));
        if answer.success {
            break;
        }
    }
    answers
}

fn changed(queries: &Queries, place: &[f64], stream: &mut Stream) -> Vec<f64> {
    let length = ((queries.changed_share * place.len() as f64).round() as usize).clamp(1, place.len().max(1));
    let early = stream.unit() * stream.unit();
    let from = (early * (place.len() + 1 - length.min(place.len())) as f64) as usize;
    let moves = stream.chance(0.5);
    let step = stream.uniform(-queries.step, queries.step);
    let mut next = place.to_vec();
    for u in next.iter_mut().skip(from).take(length) {
        *u = if moves { (*u + step).clamp(0.0, 1.0) } else { stream.unit() };
    }
    next
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernel::Seed;

    const QUERIES: Queries = Queries { count: 200, step: 0.3, changed_share: 0.25 };

    fn run(queries: &Queries, success: f64) -> Vec<(f64, Vec<f64>)> {
        let mut stream = Seed(1).stream(&["queries"]);
        let first = (0..4).map(|_| stream.unit()).collect();
        ask_all(queries, first, &mut stream, |place| {
            assert!(place.iter().all(|u| (0.0..=1.0).contains(u)));
            let loss = place.iter().map(|u| (u - 0.7) * (u - 0.7)).sum::<f64>();
            Some(Answer { loss, success: loss < success, made: place.to_vec() })
        })
    }

    #[test]
    fn the_search_comes_nearer_and_stops_at_the_first_success() {
        let found = run(&QUERIES, 0.01);
        assert!(found.len() < 200 && found[found.len() - 1].0 < 0.01, "{}", found.len());
        assert!(found[..found.len() - 1].iter().all(|(loss, _)| *loss >= 0.01));
    }

    #[test]
    fn a_query_changes_one_stretch_by_one_step_or_draws_it_anew() {
        let queries = Queries { count: 1, step: 0.2, changed_share: 0.4 };
        let mut stream = Seed(3).stream(&["stretch"]);
        let mut moved_together = 0;
        for _ in 0..100 {
            let changed = changed(&queries, &[0.5; 10], &mut stream);
            let places: Vec<usize> = (0..10).filter(|i| changed[*i] != 0.5).collect();
            assert_eq!((places.len(), places[3] - places[0]), (4, 3), "{changed:?}");
            let together = places.iter().all(|i| changed[*i] == changed[places[0]]);
            moved_together += usize::from(together && (changed[places[0]] - 0.5).abs() <= 0.2);
        }
        assert!((30..70).contains(&moved_together), "{moved_together}");
    }

    #[test]
    fn no_query_more_than_asked_for_is_made() {
        assert_eq!(run(&Queries { count: 7, ..QUERIES }, -1.0).len(), 7);
        assert!(run(&Queries { count: 0, ..QUERIES }, -1.0).is_empty());
    }
}
