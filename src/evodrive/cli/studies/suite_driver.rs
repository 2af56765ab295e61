//! Drivers in a suite: a policy by its name or its weights, one that stands still, or a planner.

use std::path::Path;

use crate::backend::DriverOptions;
use crate::cli::studies::egos;
use crate::cli::terminal::exit::Failure;
use crate::ego::Policy;
use crate::experiment::named_driver;
use crate::kernel::Digest;
use crate::suite::DriverMark;
use crate::text::nearest;

/// The driver that brakes and stands: what a crash rate is worth shows beside it.
const STANDING: &str = "standing";
/// Drivers that have a name.
const NAMES: [&str; 6] = {
    let [idm, idm_lights, pdm, frenet, replay] = Policy::NAMES;
    [idm, idm_lights, pdm, frenet, replay, STANDING]
};

/// Driver of a suite's cases.
#[derive(Clone, Debug)]
pub enum TestDriver {
    Policy(String, Policy),
    Standing,
    Planner(DriverOptions),
    /// A planner by its recorded answers alone.
    Recorded(DriverMark, Digest),
}

impl TestDriver {
    /// The driver that a name, a file of weights or a planner's file means.
    pub fn named(word: &str) -> Result<TestDriver, Failure> {
        let path = Path::new(word);
        let file_name =
            || path.file_name().map_or_else(|| word.to_string(), |name| name.to_string_lossy().into_owned());
        match word {
            STANDING => Ok(TestDriver::Standing),
            _ if Policy::NAMES.contains(&word) => {
                Ok(TestDriver::Policy(word.to_string(), word.parse().map_err(Failure::internal)?))
            }
            _ if egos::is_weights(word) => Ok(TestDriver::Policy(file_name(), egos::learned(path)?)),
            _ if path.exists() || path.components().count() > 1 || path.extension().is_some() => {
                Ok(TestDriver::Planner(named_driver(path)?))
            }
            _ => {
                let near = nearest(word, NAMES).map_or(String::new(), |near| format!("; did you mean {near}?"));
                Err(Failure::bad_input(format!(
                    "--driver {word}: expected one of {}, a file of weights (.safetensors, .onnx) or a planner's file{near}",
                    NAMES.join(", ")
                )))
            }
        }
    }

    /// The same with another time limit for a planner's decision, seconds, where one is given.
    pub fn within(self, limit_s: Option<f64>) -> Result<TestDriver, Failure> {
        match (self, limit_s) {
            (TestDriver::Planner(driver), Some(limit_s)) if (0.001..=3600.0).contains(&limit_s) => {
                Ok(TestDriver::Planner(DriverOptions { timeout_s: limit_s, ..driver }))
            }
            (TestDriver::Planner(_), Some(limit_s)) => Err(Failure::bad_input(format!(
                "--time-limit is {limit_s}, expected a number of seconds from 0.001 to 3600"
            ))),
            (driver, _) => Ok(driver),
        }
    }

    pub fn mark(&self) -> DriverMark {
        match self {
            TestDriver::Policy(name, policy) => DriverMark { name: name.clone(), digest: policy.digest() },
            TestDriver::Standing => {
                DriverMark { name: STANDING.into(), digest: Digest::of_bytes(b"evodrive/ego/1 standing ") }
            }
            TestDriver::Planner(driver) => {
                let digest = driver.policy().map_or_else(|| Digest::of_bytes(b""), |policy| policy.digest());
                DriverMark { name: driver.name(), digest }
            }
            TestDriver::Recorded(mark, _) => mark.clone(),
        }
    }

    /// The policy behind it; none of one that stands.
    pub fn policy(&self) -> Option<Policy> {
        match self {
            TestDriver::Policy(_, policy) => Some(policy.clone()),
            TestDriver::Standing => None,
            TestDriver::Planner(driver) => driver.policy(),
            TestDriver::Recorded(_, planner) => Some(Policy::Command(*planner)),
        }
    }
}
