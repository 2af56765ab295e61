//! Black-box search of the SafeBench ports: a (1+1) evolution strategy on the cube [0, 1]^n. The first query is drawn
//! at random and kept if it already succeeds; every later one changes some numbers of the best so far.

use crate::kernel::Stream;

/// Numbers of the search.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Queries {
    /// Most queries; each is one simulation.
    pub count: usize,
    /// Largest change of a number, 1.
    pub step: f64,
    /// Share of the numbers that a query changes.
    pub changed_share: f64,
}

/// The result of a query.
pub struct Answer<T> {
    /// Smaller is better.
    pub loss: f64,
    /// Whether the goal is reached, so that the search may stop.
    pub success: bool,
    /// What the simulation left behind.
    pub found: T,
}

/// Asks until a query succeeds or none is left. What the queries found with their losses, in the order asked; a query
/// that `ask` refuses counts, but leaves nothing.
pub fn ask_all<T>(
    queries: &Queries,
    dimensions: usize,
    stream: &mut Stream,
    mut ask: impl FnMut(&[f64]) -> Option<Answer<T>>,
) -> Vec<(f64, T)> {
    let mut best: (Vec<f64>, f64) = ((0..dimensions).map(|_| stream.unit()).collect(), f64::INFINITY);
    let mut answers = Vec::with_capacity(queries.count);
    for query in 0..queries.count {
        let place = if query == 0 { best.0.clone() } else { changed(queries, &best.0, stream) };
        let Some(answer) = ask(&place) else { continue };
        if answer.loss < best.1 {
            best = (place, answer.loss);
        }
        answers.push((answer.loss, answer.found));
        if answer.success {
            break;
        }
    }
    answers
}

fn changed(queries: &Queries, place: &[f64], stream: &mut Stream) -> Vec<f64> {
    let mut next = |u: &f64| {
        let (moves, step) = (stream.chance(queries.changed_share), stream.uniform(-queries.step, queries.step));
        if moves { (u + step).clamp(0.0, 1.0) } else { *u }
    };
    place.iter().map(&mut next).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernel::Seed;

    const QUERIES: Queries = Queries { count: 200, step: 0.3, changed_share: 0.5 };

    fn run(queries: &Queries, success: f64) -> Vec<(f64, Vec<f64>)> {
        let mut stream = Seed(1).stream(&["queries"]);
        ask_all(queries, 4, &mut stream, |place| {
            assert!(place.iter().all(|u| (0.0..=1.0).contains(u)));
            let loss = place.iter().map(|u| (u - 0.7) * (u - 0.7)).sum::<f64>();
            Some(Answer { loss, success: loss < success, found: place.to_vec() })
        })
    }

    #[test]
    fn the_search_comes_nearer_and_stops_at_the_first_success() {
        let found = run(&QUERIES, 0.01);
        assert!(found.len() < 200 && found[found.len() - 1].0 < 0.01, "{}", found.len());
        assert!(found[..found.len() - 1].iter().all(|(loss, _)| *loss >= 0.01));
    }

    #[test]
    fn no_query_more_than_asked_for_is_made() {
        assert_eq!(run(&Queries { count: 7, ..QUERIES }, -1.0).len(), 7);
        assert!(run(&Queries { count: 0, ..QUERIES }, -1.0).is_empty());
    }
}
