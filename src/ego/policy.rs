//! The ego policies by name.

use std::str::FromStr;

use crate::kernel::Digest;
use crate::sim::Driver;

use super::idm::IdmDriver;
use super::learned::{ACTION, LearnedDriver, OBSERVATION};
use super::network::{Network, NetworkError};
use super::replay::ReplayDriver;

/// A fixed ego policy.
#[derive(Clone, Debug, PartialEq)]
pub enum Policy {
    /// MetaDrive's `TrajectoryIDMPolicy`; it ignores traffic lights.
    Idm,
    /// The same, but a red light on the route counts as a standing obstacle.
    IdmMindingLights,
    /// The ego's recorded motion.
    Replay,
    /// A network with frozen weights.
    Learned(Network),
}

/// Why a name gives no policy.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PolicyError {
    /// The name is none of those that are known.
    #[error("no ego policy is called {0:?}; there are idm, idm-lights, replay, learned")]
    Unknown(String),
    /// A learned policy was named without its weights.
    #[error("the ego policy `learned` needs the bytes of its weights; name a weight file")]
    NoWeights,
}

impl FromStr for Policy {
    type Err = PolicyError;

    fn from_str(name: &str) -> Result<Policy, PolicyError> {
        match name {
            "idm" => Ok(Policy::Idm),
            "idm-lights" => Ok(Policy::IdmMindingLights),
            "replay" => Ok(Policy::Replay),
            "learned" => Err(PolicyError::NoWeights),
            other => Err(PolicyError::Unknown(other.to_string())),
        }
    }
}

impl Policy {
    /// The policy `learned` with weights in the format of [`super::network`].
    pub fn learned(weights: &[u8]) -> Result<Policy, NetworkError> {
        Network::from_bytes(weights, OBSERVATION, ACTION).map(Policy::Learned)
    }

    /// The name in experiment files and keys.
    pub fn name(&self) -> &str {
        match self {
            Policy::Idm => "idm",
            Policy::IdmMindingLights => "idm-lights",
            Policy::Replay => "replay",
            Policy::Learned(_) => "learned",
        }
    }

    /// What goes into a rollout's key: the policy's name and, where it has them, its weights.
    pub fn digest(&self) -> Digest {
        let weights = match self {
            Policy::Learned(network) => network.digest().to_hex(),
            _ => String::new(),
        };
        Digest::of_bytes(format!("evodrive/ego/1 {} {weights}", self.name()).as_bytes())
    }

    /// A driver, ready for a rollout.
    pub fn driver(&self) -> Box<dyn Driver> {
        match self {
            Policy::Idm => Box::new(IdmDriver::new(false)),
            Policy::IdmMindingLights => Box::new(IdmDriver::new(true)),
            Policy::Replay => Box::new(ReplayDriver),
            Policy::Learned(network) => Box::new(LearnedDriver::new(network.clone())),
        }
    }
}
