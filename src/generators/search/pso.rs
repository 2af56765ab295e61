//! Global-best particle swarm (Kennedy and Eberhart) with AT's numbers given by the caller: minimises a loss on the
//! cube [-1, 1]^n. A coordinate that would leave the cube stays on its face, with its speed there set to 0.

use crate::kernel::Stream;

/// Swarm settings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Swarm {
    /// Number of particles.
    pub particles: usize,
    /// Steps of the swarm.
    pub iterations: usize,
    /// c1, pull toward a particle's own best.
    pub cognitive: f64,
    /// c2, pull toward the swarm's best.
    pub social: f64,
    /// w
    pub inertia: f64,
}

/// The best place that a particle saw.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// The place. `[dimensions]`
    pub place: Vec<f64>,
    /// Its loss.
    pub loss: f64,
}

/// The best of every particle, smallest loss first; equal losses in particle order.
///
/// The centre of the cube (no perturbation) is the first particle's start, so that the result is never worse than it.
pub fn minimise(
    swarm: &Swarm,
    dimensions: usize,
    stream: &mut Stream,
    mut loss: impl FnMut(&[f64]) -> f64,
) -> Vec<Found> {
    let mut places: Vec<Vec<f64>> = (0..swarm.particles)
        .map(|p| (0..dimensions).map(|_| if p == 0 { 0.0 } else { stream.uniform(-1.0, 1.0) }).collect())
        .collect();
    let mut speeds: Vec<Vec<f64>> =
        (0..swarm.particles).map(|_| (0..dimensions).map(|_| stream.uniform(-1.0, 1.0)).collect()).collect();
    let mut best: Vec<Found> = places.iter().map(|place| Found { place: place.clone(), loss: loss(place) }).collect();
    let Some(mut leader) = best_of(&best) else { return best };
    for _ in 0..swarm.iterations {
        for p in 0..swarm.particles {
            fly(swarm, &mut places[p], &mut speeds[p], &best[p].place, &leader.place, stream);
            let losses = loss(&places[p]);
            if losses < best[p].loss {
                best[p] = Found { place: places[p].clone(), loss: losses };
            }
        }
        if let Some(next) = best_of(&best).filter(|next| next.loss < leader.loss) {
            leader = next;
        }
    }
    best.sort_by(|a, b| a.loss.total_cmp(&b.loss));
    best
}

fn best_of(found: &[Found]) -> Option<Found> {
    found.iter().min_by(|a, b| a.loss.total_cmp(&b.loss)).cloned()
}

fn fly(swarm: &Swarm, place: &mut [f64], speed: &mut [f64], own: &[f64], leader: &[f64], stream: &mut Stream) {
    for k in 0..place.len() {
        let (r1, r2) = (stream.unit(), stream.unit());
        speed[k] = swarm.inertia * speed[k]
            + swarm.cognitive * r1 * (own[k] - place[k])
            + swarm.social * r2 * (leader[k] - place[k]);
        let next = place[k] + speed[k];
        place[k] = next.clamp(-1.0, 1.0);
        if place[k] != next {
            speed[k] = 0.0;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernel::Seed;

    const SWARM: Swarm = Swarm { particles: 10, iterations: 100, cognitive: 0.5, social: 0.3, inertia: 0.9 };

    #[test]
    fn the_swarm_finds_a_known_minimum() {
        let goal = [0.3, -0.7, 0.1];
        let loss = |x: &[f64]| x.iter().zip(&goal).map(|(a, b)| (a - b) * (a - b)).sum::<f64>();
        let losses = minimise(&SWARM, 3, &mut Seed(3).stream(&["pso"]), loss);
        assert!(losses[0].loss < 1e-2, "{}", losses[0].loss);
        assert!(losses.windows(2).all(|pair| pair[0].loss <= pair[1].loss));
    }

    #[test]
    fn the_swarm_never_ends_worse_than_no_perturbation_and_stays_in_the_cube() {
        let loss = |x: &[f64]| {
            assert!(x.iter().all(|v| v.abs() <= 1.0));
            x.iter().map(|v| v.abs()).sum::<f64>()
        };
        assert_eq!(minimise(&SWARM, 8, &mut Seed(4).stream(&["pso"]), loss)[0].loss, 0.0);
    }
}
