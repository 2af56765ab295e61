//! The two experts as they are committed: weights over the features of a candidate.

use std::sync::LazyLock;

use serde::{Deserialize, Serialize};

use super::measure::FEATURES;
use crate::kernel::{Digest, num};
use crate::stage::StageError;

/// Output of `training::experts`.
const COMMITTED: &str = include_str!("experts.json");

/// Change of the reference's log-probability: θ · φ(τ).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Experts {
    pub features: Vec<String>,
    pub adversarial: Vec<f64>,
    pub realistic: Vec<f64>,
}

static KNOWN: LazyLock<Experts> = LazyLock::new(|| {
    let parsed: Result<Experts, _> = serde_json::from_str(COMMITTED);
    parsed.unwrap_or_else(|error| unreachable!("experts.json is part of the program and a test reads it: {error}"))
});

impl Experts {
    /// Returns the experts that this build carries.
    pub fn committed() -> &'static Experts {
        &KNOWN
    }

    /// First digits of the digest of the committed file: programs name the experts that they mean by it.
    pub fn digest() -> &'static str {
        static SHORT: LazyLock<String> = LazyLock::new(|| Digest::of_bytes(COMMITTED.as_bytes()).short(16));
        &SHORT
    }

    /// Refuses a program that means other experts.
    pub fn check(&self, named: &str) -> Result<(), StageError> {
        let expected = Experts::digest();
        if named == expected {
            return Ok(());
        }
        Err(StageError::Unfit { setting: "experts".into(), found: named.into(), expected: expected.into() })
    }

    /// θ(w) = w θ_adv + (1 - w) θ_real.
    pub fn mixed(&self, weight: f64) -> Vec<f64> {
        let pairs = self.adversarial.iter().zip(&self.realistic);
        pairs.map(|(adversarial, realistic)| weight * adversarial + (1.0 - weight) * realistic).collect()
    }

    /// From two weight vectors, rounded to six digits.
    pub fn new(adversarial: &[f64], realistic: &[f64]) -> Experts {
        let rounded = |theta: &[f64]| theta.iter().map(|x| num::rounded(*x, 6)).collect();
        Experts {
            features: FEATURES.map(String::from).to_vec(),
            adversarial: rounded(adversarial),
            realistic: rounded(realistic),
        }
    }

    /// The text of the committed file.
    pub fn text(&self) -> String {
        let list = |theta: &[f64]| theta.iter().map(f64::to_string).collect::<Vec<_>>().join(", ");
        let names: Vec<String> = self.features.iter().map(|name| format!("\"{name}\"")).collect();
        format!(
            "{{\n  \"features\": [{}],\n  \"adversarial\": [{}],\n  \"realistic\": [{}]\n}}\n",
            names.join(", "),
            list(&self.adversarial),
            list(&self.realistic)
        )
    }
}

/// Returns the dot product of two vectors of equal length.
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    num::sum(a.iter().zip(b).map(|(a, b)| a * b))
}
