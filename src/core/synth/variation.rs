//! What varies from scene to scene where traffic is fitted to recordings (docs/SCENES.md): how many share the road, how close, and how
//! unlike an ideal driver they drive. Without it every scene of a pool has as many road users, who drive as their models say.

use serde::{Deserialize, Serialize};

use crate::kernel::{Seed, Stream, num};

/// How traffic varies: `scenes.options.traffic` has two bounds of each, first and last included, a scene what it drew between them.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Variation<Of> {
    /// Road users of a scene, drawn by their logarithm.
    pub users: Of,
    /// What their room is multiplied by: metres of lane each, and metres between them at first.
    pub room: Of,
    /// How far from the ego others are recorded, metres.
    pub range_m: Of,
    /// Further lanes of a direction; of a road that meets another one, half as many.
    pub lanes: Of,
    /// What speed limits are multiplied by.
    pub limit: Of,
    /// Standard deviation of what drivers' pedals add to the acceleration that they want, m/s².
    pub pedals_mps2: Of,
    /// How far drivers wander in their lane, metres.
    pub weave_m: Of,
    /// Standard deviation of drivers' places in their lanes, metres.
    pub place_m: Of,
    /// Standard deviation of drivers' wanted speeds, as a share of the limit.
    pub haste: Of,
    /// What drivers' largest accelerations are multiplied by.
    pub pace: Of,
    /// What drivers' time gaps are multiplied by.
    pub headway: Of,
}

/// `scenes.options.traffic`.
pub type TrafficOptions = Variation<[f64; 2]>;

/// One bound's name, its pair, and the least and the most that it may be.
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

    /// The first bounds that are none, or beyond what the generator can do: their key below `scenes.options`, and what stands there.
    pub(super) fn fault(&self) -> Option<(&'static str, String)> {
        let is_none =
            |&(_, [low, high], least, most): &Bound| !(least..=most).contains(&low) || !(low..=most).contains(&high);
        let (field, [low, high], ..) = self.bounds().into_iter().find(is_none)?;
        Some((field, format!("[{low}, {high}]")))
    }

    /// What one scene has of it.
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

/// Seconds over which a driver's pedals keep what they add.
const PEDALS_S: f64 = 0.8;

/// A driver's pedals: what they add comes and goes (an Ornstein-Uhlenbeck process, sampled every step).
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

    /// What they add in the next step, m/s².
    pub fn step(&mut self) -> f64 {
        let kept = num::exp(-crate::scene::DT_S / PEDALS_S);
        self.now_mps2 = kept * self.now_mps2 + self.draw.normal(0.0, self.sd_mps2 * (1.0 - kept * kept).sqrt());
        self.now_mps2
    }
}

/// The amplitude of the shorter wave, of the longer one's.
const SECOND_WAVE: f64 = 0.4;

/// A driver's wander in the lane: two waves along the way, so that who stands does not move sideways.
#[derive(Clone, Copy, Debug)]
pub(super) struct Weave {
    /// Amplitude in metres, radians a metre, radians at the start.
    waves: [(f64, f64, f64); 2],
}

impl Weave {
    /// The longer a wave takes at `speed_mps`, the longer it is. Both together reach `aside_m_max` at most.
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
