//! The ego policies by name.

use std::str::FromStr;

use crate::kernel::Digest;
use crate::sim::Driver;

use super::idm::IdmDriver;
use super::replay::ReplayDriver;

/// A fixed ego policy.
#[derive(Clone, Debug, PartialEq)]
pub enum Policy {
    /// MetaDrive's `TrajectoryIDMPolicy`; heeds no light.
    Idm,
    /// The same with a red light on the route taken as a standing obstacle.
    IdmMindingLights,
    /// The ego's recorded motion.
    Replay,
}

/// No such policy.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("no ego policy is called {0:?}; there are idm, idm-lights, replay")]
pub struct PolicyError(pub String);

impl FromStr for Policy {
    type Err = PolicyError;

    fn from_str(name: &str) -> Result<Policy, PolicyError> {
        match name {
            "idm" => Ok(Policy::Idm),
            "idm-lights" => Ok(Policy::IdmMindingLights),
            "replay" => Ok(Policy::Replay),
            other => Err(PolicyError(other.to_string())),
        }
    }
}

impl Policy {
    pub fn name(&self) -> &str {
        match self {
            Policy::Idm => "idm",
            Policy::IdmMindingLights => "idm-lights",
            Policy::Replay => "replay",
        }
    }

    /// What goes into a rollout's key: the policy's name and, where it has them, its weights.
    pub fn digest(&self) -> Digest {
        Digest::of_bytes(format!("evodrive/ego/1 {}", self.name()).as_bytes())
    }

    /// A driver, ready for a rollout.
    pub fn driver(&self) -> Box<dyn Driver> {
        match self {
            Policy::Idm => Box::new(IdmDriver::new(false)),
            Policy::IdmMindingLights => Box::new(IdmDriver::new(true)),
            Policy::Replay => Box::new(ReplayDriver),
        }
    }
}
