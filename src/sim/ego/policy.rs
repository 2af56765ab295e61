//! The ego policies by name.

use std::str::FromStr;

use crate::kernel::Digest;
use crate::sim::Driver;

use super::frenet::{self, FrenetDriver};
use super::idm::IdmDriver;
use super::learned::LearnedDriver;
use super::pdm::{self, PdmDriver};
use super::replay::ReplayDriver;
use super::weights::Weights;
use super::weights_error::WeightsError;

/// A fixed ego policy.
#[derive(Clone, Debug, PartialEq)]
pub enum Policy {
    /// MetaDrive's `TrajectoryIDMPolicy`; it ignores traffic lights.
    Idm,
    /// The same, but a red light on the route counts as a standing obstacle.
    IdmMindingLights,
    /// PDM-Closed with its published constants.
    Pdm,
    /// PDM-Closed with other constants.
    PdmWith(Box<pdm::Settings>),
    /// Frenet sampling, as CommonRoad's reactive planner does it.
    Frenet,
    /// The ego's recorded motion.
    Replay,
    /// A network with frozen weights.
    Learned(Weights),
    /// A program of the experimenter's own, known by a digest. It drives through `backend::Planners` alone.
    Command(Digest),
}

/// Why a name gives no policy.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PolicyError {
    /// The name is not known.
    #[error("no ego policy is called {0:?}; there are idm, idm-lights, pdm, frenet, replay, learned, command")]
    Unknown(String),
    /// A learned policy was named without its weights.
    #[error("the ego policy `learned` needs its weights; name a file of policies/")]
    NoWeights,
    /// A planner was named without its program.
    #[error("the ego policy `command` needs its program; name it in the table [driver]")]
    NoProgram,
}

impl FromStr for Policy {
    type Err = PolicyError;

    fn from_str(name: &str) -> Result<Policy, PolicyError> {
        match name {
            "idm" => Ok(Policy::Idm),
            "idm-lights" => Ok(Policy::IdmMindingLights),
            "pdm" => Ok(Policy::Pdm),
            "frenet" => Ok(Policy::Frenet),
            "replay" => Ok(Policy::Replay),
            "learned" => Err(PolicyError::NoWeights),
            "command" => Err(PolicyError::NoProgram),
            other => Err(PolicyError::Unknown(other.to_string())),
        }
    }
}

impl Policy {
    /// The names that need no further data.
    pub const NAMES: [&str; 5] = ["idm", "idm-lights", "pdm", "frenet", "replay"];

    /// Returns the policy `learned` with the bytes of a file of weights.
    pub fn learned(bytes: &[u8]) -> Result<Policy, WeightsError> {
        Weights::from_bytes(bytes).map(Policy::Learned)
    }

    /// Returns the name in experiment files and keys.
    pub fn name(&self) -> &str {
        match self {
            Policy::Idm => "idm",
            Policy::IdmMindingLights => "idm-lights",
            Policy::Pdm => "pdm",
            Policy::PdmWith(_) => "pdm-with",
            Policy::Frenet => "frenet",
            Policy::Replay => "replay",
            Policy::Learned(_) => "learned",
            Policy::Command(_) => "command",
        }
    }

    /// Returns the digest that goes into a rollout's key: of the policy's name and, where it has them, its weights or its program.
    pub fn digest(&self) -> Digest {
        let weights = match self {
            Policy::Learned(weights) => weights.digest.to_hex(),
            Policy::Command(digest) => digest.to_hex(),
            Policy::PdmWith(settings) => Digest::of("evodrive/pdm-constants/1", settings)
                .map_or_else(|error| error.to_string(), |of| of.to_hex()),
            _ => String::new(),
        };
        Digest::of_bytes(format!("evodrive/ego/1 {} {weights}", self.name()).as_bytes())
    }

    /// Returns a driver, ready for a rollout. IDM stands in for a program of the experimenter's own: searches ask thousands of times
    /// what the ego would do. No label comes from it, because a backend refuses that ego without its program.
    pub fn driver(&self) -> Box<dyn Driver + Send> {
        match self {
            Policy::Idm | Policy::Command(_) => Box::new(IdmDriver::new(false)),
            Policy::IdmMindingLights => Box::new(IdmDriver::new(true)),
            Policy::Pdm => Box::new(PdmDriver::new(pdm::PUBLISHED)),
            Policy::PdmWith(settings) => Box::new(PdmDriver::new(**settings)),
            Policy::Frenet => Box::new(FrenetDriver::new(frenet::PUBLISHED)),
            Policy::Replay => Box::new(ReplayDriver),
            Policy::Learned(weights) => Box::new(LearnedDriver::new(weights)),
        }
    }
}
