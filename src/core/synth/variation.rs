//! Variation from scene to scene where traffic is fitted to recordings (docs/SCENES.md): how many share the road, how close, and how
//! unlike an ideal driver they drive. Without it every scene of a pool has as many road users, who drive as their models say.

use serde::{Deserialize, Serialize};

use crate::kernel::{Seed, Stream, num};

/// Ranges of traffic: `scenes.options.traffic` has two bounds of each, first and last included, a scene the values drawn between them.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Variation<Of> {
    /// Road users of a scene, drawn by their logarithm.
    pub users: Of,
    /// Factor of their room: metres of lane each, and metres between them at first.
    pub room: Of,
    /// Distance from the ego within which others are recorded, metres.
    pub range_m: Of,
    /// Further lanes per direction; half as many for a road that meets another one.
    pub lanes: Of,
    /// Factor of speed limits.
    pub limit: Of,
    /// Standard deviation of the acceleration that drivers' pedals add to the one that they want, m/s².
    pub pedals_mps2: Of,
    /// Amplitude of drivers' wander in their lane, metres.
    pub weave_m: Of,
    /// Standard deviation of drivers' places in their lanes, metres.
    pub place_m: Of,
    /// Standard deviation of drivers' wanted speeds, as a share of the limit.
    pub haste: Of,
    /// Factor of drivers' largest accelerations.
    pub pace: Of,
    /// Factor of drivers' time gaps.
    pub headway: Of,
}

/// `scenes.options.traffic`.
pub type TrafficOptions = Variation<[f64; 2]>;

/// Name of a pair of bounds, the pair, and the least and the most that it may be.
type Bound = (&'static str, [f64; 2], f64, f64);

impl TrafficOptions {
    fn bounds(&self) -> [Bound; 11] {
        [
            ("traffic.users", self.users, 4.0, 400.0),
            ("traffic.room", self.room, 0.2, 4.0),
            ("traffic.range_m", self.range_m, 30.0, 1000.0),
            ("traffic.lanes", self.lanes, 0.0, 3.0),
            ("traffic.limit", self.limit, 0.3, 1.5),
            ("traffic.pedals_mps2", self.pedals_mps2, 0.0, 3.0),
            ("traffic.weave_m", self.weave_m, 0.0, 1.0),
            ("traffic.place_m", self.place_m, 0.0, 1.0),
            ("traffic.haste", self.haste, 0.0, 0.5),
            ("traffic.pace", self.pace, 0.3, 3.0),
            ("traffic.headway", self.headway, 0.3, 3.0),
        ]
    }

    /// Returns the first invalid bounds, or bounds that the generator cannot do: their key below `scenes.options`, and their value.
    pub(super) fn fault(&self) -> Option<(&'static str, String)> {
        let is_none =
            |&(_, [low, high], least, most): &Bound| !(least..=most).contains(&low) || !(low..=most).contains(&high);
        let (field, [low, high], ..) = self.bounds().into_iter().find(is_none)?;
        Some((field, format!("[{low}, {high}]")))
    }

    /// Draws the values of one scene.
    pub(super) fn drawn(&self, seed: Seed, kind: &str, index: u32) -> Variation<f64> {
        let mut draw = seed.stream(&["synth", kind, &index.to_string(), "traffic"]);
        let mut between = |[low, high]: [f64; 2]| low + (high - low) * draw.unit();
        let [fewest, most] = self.lanes;
        Variation {
            users: num::exp(between(self.users.map(num::ln))).round(),
            room: between(self.room),
            range_m: between(self.range_m),
            lanes: between([fewest, most + 1.0]).min(most).floor(),
            limit: between(self.limit),
            pedals_mps2: between(self.pedals_mps2),
            weave_m: between(self.weave_m),
            place_m: between(self.place_m),
            haste: between(self.haste),
            pace: between(self.pace),
            headway: between(self.headway),
        }
    }
}

/// Seconds over which the acceleration that a driver's pedals add persists.
const PEDALS_S: f64 = 0.8;

/// A driver's pedals: the acceleration that they add comes and goes (an Ornstein-Uhlenbeck process, sampled every step).
#[derive(Clone, Debug)]
pub(super) struct Pedals {
    sd_mps2: f64,
    now_mps2: f64,
    draw: Stream,
}

impl Pedals {
    pub fn new(sd_mps2: f64, mut draw: Stream) -> Pedals {
        let now_mps2 = draw.normal(0.0, sd_mps2);
        Pedals { sd_mps2, now_mps2, draw }
    }

    /// Returns the acceleration that they add in the next step, m/s².
    pub fn step(&mut self) -> f64 {
        let kept = num::exp(-crate::scene::DT_S / PEDALS_S);
        self.now_mps2 = kept * self.now_mps2 + self.draw.normal(0.0, self.sd_mps2 * (1.0 - kept * kept).sqrt());
        self.now_mps2
    }
}

/// Amplitude of the shorter wave as a share of the longer one's.
const SECOND_WAVE: f64 = 0.4;

/// A driver's wander in the lane: two waves along the way, so that a standing car does not move sideways.
#[derive(Clone, Copy, Debug)]
pub(super) struct Weave {
    /// Amplitude in metres, radians per metre, radians at the start.
    waves: [(f64, f64, f64); 2],
}

impl Weave {
    /// Draws the waves. A wave that takes longer at `speed_mps` is longer. Both together reach `aside_m_max` at most.
    pub fn draw(amplitude_m: f64, aside_m_max: f64, speed_mps: f64, draw: &mut Stream) -> Weave {
        let amplitude_m = amplitude_m.min(aside_m_max / (1.0 + SECOND_WAVE));
        let mut wave = |amplitude_m: f64, period_s: f64| {
            (amplitude_m, num::TAU / (period_s * speed_mps.max(5.0)), draw.uniform(0.0, num::TAU))
        };
        Weave { waves: [wave(amplitude_m, 11.0), wave(SECOND_WAVE * amplitude_m, 3.0)] }
    }

    /// Metres to the left, and their slope by distance.
    pub fn at(&self, odo: f64) -> (f64, f64) {
        self.waves.iter().fold((0.0, 0.0), |(aside, slope), (amplitude, pace, phase)| {
            let angle = pace * odo + phase;
            (aside + amplitude * num::sin(angle), slope + amplitude * pace * num::cos(angle))
        })
    }
}
