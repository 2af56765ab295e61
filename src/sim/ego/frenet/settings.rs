//! Every number of the Frenet driver, with its source: `utility/config.py`, `cost_function.py`, `sampling.py` and
//! `reactive_planner.py` of CommonRoad's reactive planner where nothing else is said.

/// Seconds of a step.
pub const STEP_S: f64 = 0.1;
/// Steps of a trajectory: 6 s.
pub const STEPS: usize = 60;
/// States of a trajectory: now, and behind each step.
pub const STATES: usize = STEPS + 1;

/// Numbers that decide.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Decisions that a plan holds for.
    pub replan_steps: usize,
    /// The levels of sampling, in the order in which they are tried: steps between end times, and samples of speed and offset each. The
    /// source has a third, (2, 17) with 8 874 trajectories, which costs more than it finds.
    pub levels: [(usize, usize); 2],
    /// The first step at which a manoeuvre may end: 0.4 s.
    pub end_step_min: usize,
    /// Largest offset to either side at the end of a manoeuvre, metres.
    pub offset_m: f64,
    /// Range of the end speeds below the present one: an eighth of the horizon at 11.5 m/s², m/s ...
    pub slower_mps: f64,
    /// ... and above it, but over at least `speeds_mps`, m/s.
    pub faster_mps: f64,
    /// The least width of that range, m/s.
    pub speeds_mps: f64,
    /// Speed below which the way aside is planned over the way along, not over time, m/s.
    pub slow_mps: f64,
    /// Speed aimed at where no limit is known: PDM-Closed's, m/s.
    pub free_speed_mps: f64,
    /// Weight of the squared acceleration at each state.
    pub acceleration_weight: f64,
    /// Weights of the squared distance from the speed that is aimed at: at each state, at the last, at the middle one.
    pub speed_weights: [f64; 3],
    /// Weights of the squared offset: at each state, at the last.
    pub offset_weights: [f64; 2],
    /// Weights of the squared turn from the reference: at each state, at the last.
    pub turn_weights: [f64; 2],
    /// Largest acceleration to the side, m/s²: nuPlan's bound of comfort. The source's car has a friction circle of 11.5 m/s², which our
    /// tyres do not hold.
    pub across_mps2: f64,
    /// Room ahead and behind, and to either side, metres: IDM's least gap in PDM-Closed, and UN R157's margin of a lane. The source needs
    /// none, because its car is where its plan is.
    pub room_m: [f64; 2],
    /// Largest distance of a corner beside the lanes, metres: as for the careful driver of `contact.avoidable`.
    pub beside_road_m: f64,
}

/// The published values.
pub const PUBLISHED: Settings = Settings {
    replan_steps: 3,
    levels: [(5, 5), (3, 9)],
    end_step_min: 4,
    offset_m: 3.0,
    slower_mps: 0.125 * 6.0 * 11.5,
    faster_mps: 2.0,
    speeds_mps: 5.0,
    slow_mps: 4.0,
    free_speed_mps: 15.0,
    acceleration_weight: 25.0,
    speed_weights: [25.0, 50.0, 100.0],
    offset_weights: [0.0625, 400.0],
    turn_weights: [0.0625, 25.0],
    across_mps2: 4.89,
    room_m: [1.0, 0.3],
    beside_road_m: 0.5,
};
