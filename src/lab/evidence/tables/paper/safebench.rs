//! The SafeBench tables.

use super::Figures;
use crate::scene::safebench::TrafficFamily;

/// Label of the table that compares parents and evolved generators.
pub const MAIN_LABEL: &str = "tab:carla-main-generator-evolution";
/// The one ego of these tables, a learned policy.
pub const EGO: &str = "RL";

/// A generator as the paper's rows name it.
#[derive(Debug, PartialEq)]
pub struct Method {
    /// Row of the main table.
    pub name: &'static str,
    /// Full name, in captions.
    pub title: &'static str,
    /// Source family of our lineages.
    pub family: &'static str,
    /// Label of its table by round.
    pub rounds_label: &'static str,
    /// Figures in the order of `MAIN_COLUMNS`.
    main: [f64; 13],
    rounds: &'static Rounds,
}

/// Metrics of the tables by round, in their order.
const ROUND_METRICS: [&str; 3] = ["CR", "OS", "ARS"];
/// Key of the column that averages over the traffic families.
pub const AVERAGE: &str = "average";

/// Columns of the main table, in its order.
const MAIN_COLUMNS: [&str; 13] = [
    "parent_attack",
    "parent_ars",
    "parent_cr",
    "parent_os",
    "evolved_attack",
    "evolved_ars",
    "evolved_cr",
    "evolved_os",
    "attack_change_pct",
    "ars_change_pp",
    "cr_change_pp",
    "os_change_pp",
    "pf_area_at_3_pct",
];

/// CR, OS, ARS; rounds 0 to 4; the eight traffic families in the paper's order and their average.
type Rounds = [[[f64; 9]; 5]; 3];

impl Method {
    /// The method's row of the main table.
    pub fn main_figures(&self) -> Figures {
        Figures::new(MAIN_COLUMNS, &self.main)
    }

    /// A row of the method's table by round: of `CR`, `OS` or `ARS`; `None` for a round that the paper does not have.
    pub fn round_figures(&self, metric: &str, round: usize) -> Option<Figures> {
        let place = ROUND_METRICS.iter().position(|name| *name == metric)?;
        let mut columns = [AVERAGE; 9];
        columns.iter_mut().zip(TrafficFamily::ALL).for_each(|(column, family)| *column = family.name());
        Some(Figures::new(columns, self.rounds.get(place)?.get(round)?))
    }
}

/// Rounds in the paper's tables, the parent's included.
pub const ROUNDS: usize = 5;

/// The rows of the main table, in its order.
pub const METHODS: [Method; 4] = [
    Method {
        name: "AS",
        title: "AdvSim (AS)",
        family: "advsim",
        rounds_label: "tab:carla-as-family-rounds",
        main: [0.260, 0.544, 0.631, 0.589, 0.382, 0.615, 0.791, 0.517, 47.2, 7.02, 16.01, -7.17, 142.5],
        rounds: &ADVSIM_ROUNDS,
    },
    Method {
        name: "AT",
        title: "Adversarial trajectory (AT)",
        family: "adv_traj",
        rounds_label: "tab:carla-at-family-rounds",
        main: [0.197, 0.514, 0.537, 0.633, 0.330, 0.607, 0.729, 0.548, 67.5, 9.29, 19.22, -8.57, 255.7],
        rounds: &ADV_TRAJ_ROUNDS,
    },
    Method {
        name: "CS",
        title: "ChatScene (CS)",
        family: "chatscene",
        rounds_label: "tab:carla-chatscene-family-rounds",
        main: [0.394, 0.729, 0.812, 0.516, 0.507, 0.924, 0.934, 0.457, 28.9, 19.51, 12.12, -5.89, 143.5],
        rounds: &CHATSCENE_ROUNDS,
    },
    Method {
        name: "Human",
        title: "Human-designed",
        family: "human",
        rounds_label: "tab:carla-human-family-rounds",
        main: [0.264, 0.856, 0.664, 0.602, 0.301, 0.927, 0.713, 0.578, 13.8, 7.13, 4.89, -2.41, 73.7],
        rounds: &HUMAN_ROUNDS,
    },
];

const ADVSIM_ROUNDS: Rounds = [
    [
        [0.609, 0.400, 0.200, 0.900, 0.650, 0.830, 0.700, 0.760, 0.631],
        [0.597, 0.450, 0.158, 0.975, 0.651, 0.856, 0.698, 0.854, 0.655],
        [0.670, 0.520, 0.190, 0.980, 0.940, 0.960, 0.748, 0.980, 0.748],
        [0.690, 0.580, 0.210, 0.980, 1.000, 0.960, 0.830, 1.000, 0.781],
        [0.710, 0.610, 0.210, 0.980, 0.990, 0.960, 0.870, 1.000, 0.791],
    ],
    [
        [0.607, 0.688, 0.793, 0.457, 0.625, 0.540, 0.505, 0.494, 0.589],
        [0.638, 0.663, 0.805, 0.436, 0.634, 0.534, 0.501, 0.454, 0.583],
        [0.609, 0.627, 0.790, 0.436, 0.490, 0.485, 0.481, 0.389, 0.538],
        [0.597, 0.598, 0.783, 0.436, 0.458, 0.484, 0.441, 0.378, 0.522],
        [0.588, 0.583, 0.783, 0.436, 0.463, 0.483, 0.421, 0.378, 0.517],
    ],
    [
        [0.664, 0.000, 0.562, 0.998, 0.029, 0.888, 0.653, 0.561, 0.544],
        [0.891, 0.000, 0.512, 0.998, 0.014, 0.969, 0.743, 0.606, 0.592],
        [0.980, 0.000, 0.529, 0.998, 0.010, 0.978, 0.760, 0.585, 0.605],
        [0.980, 0.000, 0.550, 0.998, 0.010, 0.978, 0.794, 0.586, 0.612],
        [0.981, 0.000, 0.550, 0.998, 0.019, 0.978, 0.804, 0.586, 0.615],
    ],
];

const ADV_TRAJ_ROUNDS: Rounds = [
    [
        [0.553, 0.300, 0.380, 0.900, 0.900, 0.680, 0.140, 0.440, 0.537],
        [0.523, 0.307, 0.452, 0.901, 0.881, 0.748, 0.093, 0.528, 0.554],
        [0.540, 0.460, 0.630, 0.900, 0.940, 0.880, 0.150, 0.700, 0.650],
        [0.530, 0.530, 0.670, 0.910, 1.000, 0.940, 0.190, 0.760, 0.691],
        [0.530, 0.570, 0.810, 0.910, 1.000, 0.950, 0.250, 0.810, 0.729],
    ],
    [
        [0.631, 0.737, 0.684, 0.457, 0.496, 0.613, 0.789, 0.660, 0.633],
        [0.662, 0.729, 0.656, 0.473, 0.515, 0.584, 0.800, 0.620, 0.630],
        [0.660, 0.653, 0.584, 0.477, 0.487, 0.518, 0.771, 0.532, 0.585],
        [0.662, 0.618, 0.567, 0.472, 0.456, 0.490, 0.751, 0.501, 0.565],
        [0.657, 0.598, 0.516, 0.472, 0.456, 0.485, 0.721, 0.475, 0.548],
    ],
    [
        [0.486, 0.000, 0.649, 0.983, 0.086, 0.933, 0.543, 0.434, 0.514],
        [0.429, 0.000, 0.665, 0.971, 0.076, 0.940, 0.556, 0.485, 0.515],
        [0.412, 0.000, 0.761, 0.978, 0.117, 0.976, 0.635, 0.652, 0.566],
        [0.413, 0.000, 0.781, 0.978, 0.146, 0.975, 0.694, 0.740, 0.591],
        [0.413, 0.000, 0.846, 0.974, 0.185, 0.976, 0.714, 0.750, 0.607],
    ],
];

const CHATSCENE_ROUNDS: Rounds = [
    [
        [0.930, 0.770, 0.510, 0.970, 0.820, 0.750, 0.820, 0.930, 0.812],
        [0.910, 0.750, 0.750, 0.970, 0.950, 0.890, 0.950, 0.910, 0.885],
        [0.960, 0.790, 0.830, 0.980, 0.990, 0.890, 0.980, 0.900, 0.915],
        [0.980, 0.840, 0.900, 1.000, 1.000, 0.890, 0.970, 0.850, 0.929],
        [0.990, 0.860, 0.900, 1.000, 0.990, 0.890, 0.970, 0.870, 0.934],
    ],
    [
        [0.479, 0.512, 0.680, 0.432, 0.548, 0.590, 0.469, 0.415, 0.516],
        [0.488, 0.533, 0.564, 0.412, 0.482, 0.521, 0.430, 0.426, 0.482],
        [0.462, 0.514, 0.529, 0.405, 0.461, 0.521, 0.412, 0.431, 0.467],
        [0.448, 0.489, 0.494, 0.397, 0.456, 0.520, 0.416, 0.456, 0.460],
        [0.442, 0.479, 0.494, 0.396, 0.460, 0.520, 0.416, 0.446, 0.457],
    ],
    [
        [0.921, 0.462, 0.711, 0.978, 0.464, 0.573, 0.764, 0.960, 0.729],
        [0.970, 0.701, 0.894, 0.958, 0.584, 0.822, 0.815, 0.932, 0.835],
        [0.982, 0.761, 0.926, 0.958, 0.664, 0.913, 0.895, 0.973, 0.884],
        [0.985, 0.811, 0.967, 0.968, 0.773, 0.944, 0.906, 0.984, 0.917],
        [0.987, 0.792, 0.957, 0.968, 0.823, 0.955, 0.926, 0.984, 0.924],
    ],
];

const HUMAN_ROUNDS: Rounds = [
    [
        [0.967, 0.689, 0.788, 0.552, 0.479, 0.557, 0.758, 0.522, 0.664],
        [0.947, 0.665, 0.810, 0.562, 0.760, 0.700, 0.750, 0.701, 0.737],
        [0.917, 0.611, 0.850, 0.562, 0.820, 0.720, 0.790, 0.681, 0.744],
        [0.928, 0.548, 0.840, 0.552, 0.780, 0.690, 0.800, 0.666, 0.725],
        [0.948, 0.471, 0.840, 0.552, 0.730, 0.700, 0.790, 0.671, 0.713],
    ],
    [
        [0.466, 0.607, 0.556, 0.652, 0.684, 0.630, 0.565, 0.657, 0.602],
        [0.470, 0.617, 0.544, 0.645, 0.558, 0.571, 0.567, 0.571, 0.568],
        [0.480, 0.647, 0.522, 0.644, 0.527, 0.562, 0.547, 0.582, 0.564],
        [0.474, 0.678, 0.527, 0.649, 0.544, 0.573, 0.542, 0.588, 0.572],
        [0.464, 0.716, 0.527, 0.649, 0.568, 0.568, 0.547, 0.585, 0.578],
    ],
    [
        [0.877, 0.731, 0.873, 0.841, 0.934, 0.924, 0.814, 0.851, 0.856],
        [0.880, 0.796, 0.915, 0.899, 0.914, 0.939, 0.894, 0.867, 0.888],
        [0.910, 0.822, 0.944, 0.900, 0.922, 0.948, 0.902, 0.868, 0.902],
        [0.922, 0.799, 0.945, 0.939, 0.934, 0.949, 0.931, 0.899, 0.915],
        [0.922, 0.794, 0.965, 0.949, 0.946, 0.949, 0.951, 0.939, 0.927],
    ],
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_average_is_the_mean_of_its_row_up_to_rounding() {
        for method in &METHODS {
            for row in method.rounds.iter().flatten() {
                let mean = row[..8].iter().sum::<f64>() / 8.0;
                assert!((row[8] - mean).abs() < 0.0011, "{}: {mean} beside {row:?}", method.name);
            }
        }
    }

    #[test]
    fn the_main_table_holds_the_first_and_the_last_round_and_their_differences() {
        for method in &METHODS {
            let average = |metric: usize, round: usize| method.rounds[metric][round][8];
            let m = &method.main;
            // Columns of the main table: attack, ARS, CR, OS; metrics by round: CR, OS, ARS.
            for (first, round) in [(0, 0), (4, ROUNDS - 1)] {
                assert_eq!(
                    (m[first + 1], m[first + 2], m[first + 3]),
                    (average(2, round), average(0, round), average(1, round))
                );
                assert!((m[first] - m[first + 2] * (1.0 - m[first + 3])).abs() < 0.003, "{}", method.name);
            }
            for column in 1..4 {
                let difference = 100.0 * (m[4 + column] - m[column]);
                assert!((m[8 + column] - difference).abs() < 0.11, "{}: {difference}", method.name);
            }
            assert!((m[8] - 100.0 * (m[4] - m[0]) / m[0]).abs() < 0.6, "{}", method.name);
            assert_eq!(method.round_figures("CR", ROUNDS), None);
            assert_eq!(method.round_figures("OS", 0).unwrap().under(AVERAGE), Some(average(1, 0)));
        }
    }
}
