//! Motion tokens: a 33 x 33 grid of acceleration and yaw rate, each held for half a second, and nucleus sampling from
//! unnormalised log-probabilities over it (Adv-BMT's vocabulary).

use super::bicycle::Control;
use crate::kernel::{Stream, num};

/// Values along each axis.
pub const SIDE: usize = 33;
/// Tokens in all.
pub const TOKENS: usize = SIDE * SIDE;
/// Scene steps of a token.
pub const TOKEN_STEPS: usize = 5;
/// Tokens this much less likely than the best are considered only if all likelier ones are refused.
const NEGLIGIBLE: f64 = 14.0;
/// Tokens this much less likely than the best are never taken.
const IMPOSSIBLE: f64 = 500.0;

/// −10..10 m/s² in steps of 0.625.
pub fn acceleration_mps2(i: usize) -> f64 {
    -10.0 + 0.625 * i as f64
}

/// −π/2..π/2 rad/s in 33 values.
pub fn yaw_rate_radps(j: usize) -> f64 {
    num::PI * (j as f64 / (SIDE - 1) as f64 - 0.5)
}

/// The control of a token; tokens are numbered acceleration first.
pub fn control(token: usize) -> Control {
    Control { acceleration_mps2: acceleration_mps2(token / SIDE), yaw_rate_radps: yaw_rate_radps(token % SIDE) }
}

/// How tokens are drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nucleus {
    /// Draws only from the likeliest tokens that together have this probability (top-p).
    pub share: f64,
    /// Softmax temperature of the draw.
    pub temperature: f64,
}

/// A token by its log-probability, `logs[token]`, none of them infinite or NaN, with the normalised log-probability it
/// was drawn with. A token that `refused` rejects is not taken: the draw is repeated among the rest of the nucleus,
/// then continues in order of probability. `None` if every possible token is refused.
pub fn draw(
    logs: &[f64],
    nucleus: &Nucleus,
    stream: &mut Stream,
    mut refused: impl FnMut(Control) -> bool,
) -> Option<(usize, f64)> {
    let best = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let temperature = nucleus.temperature.max(1e-3);
    let scaled = |token: usize| (logs[token] - best) / temperature;
    let mut order: Vec<(usize, f64)> =
        (0..logs.len()).filter(|t| scaled(*t) > -NEGLIGIBLE).map(|t| (t, num::exp(scaled(t)))).collect();
    order.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    let total = num::sum(order.iter().map(|(_, weight)| *weight));
    let mut held = 0.0;
    let inside = order.iter().take_while(|(_, weight)| {
        let inside = held < nucleus.share * total;
        held += weight;
        inside
    });
    let inside = inside.count();
    let mut rest = order.split_off(inside);
    while !order.is_empty() {
        let place = weighted(&order, stream);
        let (token, weight) = order.remove(place);
        if !refused(control(token)) {
            return Some((token, num::ln(weight / total)));
        }
    }
    if let Some((token, weight)) = rest.drain(..).find(|(token, _)| !refused(control(*token))) {
        return Some((token, num::ln(weight / total)));
    }
    let unlikely = |token: &usize| (-IMPOSSIBLE..=-NEGLIGIBLE).contains(&scaled(*token));
    let mut last: Vec<usize> = (0..logs.len()).filter(unlikely).collect();
    last.sort_by(|a, b| logs[*b].total_cmp(&logs[*a]).then(a.cmp(b)));
    let token = last.into_iter().find(|token| !refused(control(*token)))?;
    Some((token, scaled(token) - num::ln(total)))
}

fn weighted(among: &[(usize, f64)], stream: &mut Stream) -> usize {
    let mut left = stream.unit() * num::sum(among.iter().map(|(_, weight)| *weight));
    for (place, (_, weight)) in among.iter().enumerate() {
        left -= weight;
        if left < 0.0 {
            return place;
        }
    }
    among.len() - 1
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernel::Seed;

    const ALL: Nucleus = Nucleus { share: 1.0, temperature: 1.0 };

    #[test]
    fn the_grid_has_the_published_values() {
        assert_eq!(control(0), Control { acceleration_mps2: -10.0, yaw_rate_radps: -0.5 * num::PI });
        assert_eq!(control(TOKENS - 1), Control { acceleration_mps2: 10.0, yaw_rate_radps: 0.5 * num::PI });
        assert_eq!(control(16 * SIDE + 16), Control::default());
        assert!((yaw_rate_radps(17) - 0.0982).abs() < 1e-4);
    }

    #[test]
    fn tokens_come_as_often_as_their_probability_says() {
        let mut logs = vec![-1e3; TOKENS];
        (logs[5], logs[9]) = (num::ln(0.75), num::ln(0.25));
        let mut stream = Seed(1).stream(&["tokens"]);
        let fives = (0..4000).filter(|_| draw(&logs, &ALL, &mut stream, |_| false).unwrap().0 == 5).count();
        assert!((2900..3100).contains(&fives), "{fives}");
        let narrow = Nucleus { share: 0.7, temperature: 1.0 };
        assert!((0..100).all(|_| draw(&logs, &narrow, &mut stream, |_| false).unwrap().0 == 5));
    }

    #[test]
    fn what_is_refused_is_not_drawn_even_if_it_was_the_whole_nucleus() {
        let mut logs = vec![-1e3; TOKENS];
        (logs[5], logs[9]) = (0.0, -3.0);
        let narrow = Nucleus { share: 0.5, temperature: 1.0 };
        let mut stream = Seed(2).stream(&["tokens"]);
        let found = draw(&logs, &narrow, &mut stream, |c| c == control(5));
        assert_eq!(found.map(|(token, _)| token), Some(9));
        assert_eq!(draw(&logs, &narrow, &mut stream, |_| true), None);
        logs[7] = -40.0;
        let likelier = [control(5), control(9)];
        let found = draw(&logs, &narrow, &mut stream, |c| likelier.contains(&c));
        assert_eq!(found.map(|(token, _)| token), Some(7));
    }
}
