//! Cost of a rollout, and the parts that its time goes to.

/// Cost of a rollout, for throughput figures.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RolloutCost {
    /// Decision steps.
    pub steps: u64,
    /// Road users present, ego included, summed over the decision steps.
    pub agent_steps: u64,
}

/// Part of a rollout that takes time.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Part {
    /// Buffers, checks of the intervention, the first state; the outcome at the end.
    Setup,
    /// Start of reactive behaviour, and decisions of reactive vehicles by IDM.
    Traffic,
    /// The ego's decision and its motion.
    Ego,
    /// Motion of adversaries and reactive vehicles.
    Motion,
    /// Contacts at the physics steps: the ego's, and adversaries' with others.
    Contact,
    /// Everything of the outcome that is summed up: distances, times to collision, road, log, route, trace digest.
    Statistics,
}

impl Part {
    /// All parts, in the order in which a step comes to them.
    pub const ALL: [Part; 6] = [Part::Setup, Part::Traffic, Part::Ego, Part::Motion, Part::Contact, Part::Statistics];

    /// Returns the name in the tables of `bench sim`.
    pub fn name(self) -> &'static str {
        match self {
            Part::Setup => "setup",
            Part::Traffic => "traffic",
            Part::Ego => "ego",
            Part::Motion => "motion",
            Part::Contact => "contact",
            Part::Statistics => "statistics",
        }
    }
}
