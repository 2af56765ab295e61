//! Prediction for each candidate-scene pair, calibration, and the routing decision (paper eq. method-routing).

use super::{
    calibration::group_key,
    configuration::{ConfigurationError, validate},
    ridge::{leverage, standardised, value_at},
};
use crate::kernel::{Digest, Seed, Stream, canon::CanonError, num};
use crate::objects::{AttemptId, Objectives, Route, RouteDecision, WorldFit, WorldPair, WorldSnapshot};

/// The prediction of an evaluator without any label: the middle of the scale.
const UNKNOWN: Objectives = Objectives { attack: 0.5, realism: 0.5 };

/// How the reason of a candidate opens that the false-rejection monitor drew.
const MONITORED: &str = "audit: weak, drawn by the false-rejection monitor";

/// Whether a recorded route would have turned its candidate away, had the monitor not drawn it.
pub fn drawn_by_monitor(route: &Route) -> bool {
    route.decision == RouteDecision::Audit && route.reason.starts_with(MONITORED)
}

/// Why a candidate could not be routed, or a snapshot not used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RouterError {
    /// An option cannot be used.
    #[error(transparent)]
    Configuration(#[from] ConfigurationError),
    /// A value has no canonical bytes.
    #[error("a world snapshot has no digest: {0}")]
    Digest(#[from] CanonError),
    /// The snapshot contradicts itself; it holds where.
    #[error("a world snapshot's fit does not match its schema ({0}); refit it from its labels")]
    Inconsistent(String),
    /// There is no scene to route by.
    #[error("nothing to route: the routing subset of scenes is empty")]
    NoScenes,
    /// A pair cannot be predicted.
    #[error("scene {scene}: {problem}; features and snapshot must come from one schema")]
    Pair {
        /// Id of the scene.
        scene: String,
        /// What is wrong with it.
        problem: String,
    },
}

/// W_φ(c, s), calibrated, for one pair.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PairPrediction {
    /// In [0, 1].
    pub objectives: Objectives,
    /// Û_φ(c, s): standard deviation.
    pub uncertainty: f64,
    /// Whether the pair's group has too few labels for a mean of its own.
    pub sparse: bool,
}

/// A decision with the details that the calibration set keeps.
#[derive(Clone, Debug, PartialEq)]
pub struct Routed {
    /// What was decided, with the candidate's prediction.
    pub route: Route,
    /// Whether the router would have rejected it without the monitor.
    pub monitored: bool,
}

/// A snapshot ready for use; shared by all workers of an epoch.
#[derive(Clone, Debug)]
pub struct Router<'s> {
    snapshot: &'s WorldSnapshot,
    digest: Digest,
}

/// The stream from which the false-rejection monitor of an attempt draws.
pub fn monitor_stream(seed: Seed, attempt: &AttemptId) -> Stream {
    seed.stream(&["world", "monitor", attempt.as_str()])
}

impl<'s> Router<'s> {
    /// A router by this snapshot; an error where the snapshot cannot be used.
    pub fn new(snapshot: &'s WorldSnapshot) -> Result<Router<'s>, RouterError> {
        validate(&snapshot.configuration, &snapshot.schema)?;
        if let Some(problem) = snapshot.fit.as_ref().and_then(|fit| mismatch(fit, snapshot.schema.columns.len())) {
            return Err(RouterError::Inconsistent(problem));
        }
        Ok(Router { snapshot, digest: snapshot.digest()? })
    }

    /// The snapshot's digest, as routes cite it.
    pub fn digest(&self) -> Digest {
        self.digest
    }

    /// The calibrated prediction of one pair (eq. app-world-calibration).
    pub fn predict(&self, pair: &WorldPair) -> Result<PairPrediction, RouterError> {
        let problem = |problem: String| RouterError::Pair { scene: pair.scene.clone(), problem };
        let columns = self.snapshot.schema.columns.len();
        if pair.features.len() != columns {
            return Err(problem(format!("{} features, {columns} columns", pair.features.len())));
        }
        if pair.features.iter().any(|value| !value.is_finite()) {
            return Err(problem("a feature is not finite".to_string()));
        }
        Ok(match &self.snapshot.fit {
            Some(fit) => self.calibrated(fit, pair),
            None => PairPrediction { objectives: UNKNOWN, uncertainty: 1.0, sparse: true },
        })
    }

    fn calibrated(&self, fit: &WorldFit, pair: &WorldPair) -> PairPrediction {
        let configuration = &self.snapshot.configuration;
        let group = fit
            .groups
            .get(group_key(pair, configuration.calibration_group))
            .filter(|group| group.labels >= configuration.group_labels_min);
        let mean = group.unwrap_or(&fit.global).mean;
        let row = standardised(fit, &pair.features);
        let mixed = |beta: f64, raw: f64, mean: f64| rate(beta * rate(raw) + (1.0 - beta) * mean);
        let std = fit.attack.residual_std.max(fit.realism.residual_std);
        let uncertainty = std * (leverage(fit, &row) + configuration.residual_share).sqrt();
        PairPrediction {
            objectives: Objectives {
                attack: mixed(configuration.beta_attack, value_at(&fit.attack, &row), mean.attack),
                realism: mixed(configuration.beta_realism, value_at(&fit.realism, &row), mean.realism),
            },
            uncertainty: if uncertainty.is_finite() { uncertainty.min(1e9) } else { 1e9 },
            sparse: group.is_none(),
        }
    }

    /// Select, reject or audit a candidate over the routing subset. `monitor` is the attempt's own stream.
    ///
    /// 1. Fewer labels than `min_labels`: audit. Nothing is rejected without evidence.
    /// 2. Promising (A >= λ_A, R >= λ_R) and certain (U <= λ_U): select.
    /// 3. Uncertain, or in a sparse calibration group in most scenes: audit.
    /// 4. Weak and certain: reject, but for the declared share that the monitor audits.
    pub fn route(&self, pairs: &[WorldPair], monitor: &mut Stream) -> Result<Routed, RouterError> {
        let predictions = pairs.iter().map(|pair| self.predict(pair)).collect::<Result<Vec<_>, _>>()?;
        let mean = |of: fn(&PairPrediction) -> f64| num::mean(&predictions.iter().map(of).collect::<Vec<_>>());
        let (Some(attack), Some(realism)) = (mean(|p| p.objectives.attack), mean(|p| p.objectives.realism)) else {
            return Err(RouterError::NoScenes);
        };
        let uncertainties: Vec<f64> = predictions.iter().map(|p| p.uncertainty).collect();
        let quantile = self.snapshot.configuration.uncertainty_quantile;
        let uncertainty = num::quantile(&uncertainties, quantile).ok_or(RouterError::NoScenes)?;
        let sparse = 2 * predictions.iter().filter(|p| p.sparse).count() > predictions.len();
        let predicted = Objectives { attack, realism };
        let (decision, monitored, reason) = self.decide(predicted, uncertainty, sparse, monitor);
        Ok(Routed { route: Route { decision, reason, snapshot: self.digest, predicted, uncertainty }, monitored })
    }

    fn decide(
        &self,
        predicted: Objectives,
        uncertainty: f64,
        sparse: bool,
        monitor: &mut Stream,
    ) -> (RouteDecision, bool, String) {
        let options = &self.snapshot.configuration.routing;
        let labels = self.snapshot.fit.as_ref().map_or(0, |fit| fit.labels);
        // It is drawn in every case, so that another threshold changes no other draw of the stream.
        let draw = monitor.unit();
        let numbers = format!(
            "attack {:.3} (needs {:.3}), realism {:.3} (needs {:.3}), uncertainty {:.3} (at most {:.3})",
            predicted.attack, options.lambda_a, predicted.realism, options.lambda_r, uncertainty, options.lambda_u
        );
        if labels == 0 || labels < options.min_labels {
            let reason = format!("audit: {labels} labels, {} needed before anything is judged", options.min_labels);
            return (RouteDecision::Audit, false, reason);
        }
        let promising = predicted.attack >= options.lambda_a && predicted.realism >= options.lambda_r;
        let certain = uncertainty <= options.lambda_u;
        match (promising, certain) {
            (true, true) => (RouteDecision::Select, false, format!("select: promising and certain; {numbers}")),
            (_, false) => (RouteDecision::Audit, false, format!("audit: uncertain; {numbers}")),
            (false, true) if sparse => {
                (RouteDecision::Audit, false, format!("audit: weak, but its group has too few labels; {numbers}"))
            }
            (false, true) if draw < options.audit_rate => {
                (RouteDecision::Audit, true, format!("{MONITORED}; {numbers}"))
            }
            (false, true) => (RouteDecision::Reject, false, format!("reject: weak and certain; {numbers}")),
        }
    }
}

/// Why a fit cannot belong to a schema.
fn mismatch(fit: &WorldFit, columns: usize) -> Option<String> {
    let p = fit.columns.len();
    if fit.columns.iter().any(|place| *place >= columns) {
        return Some(format!("a used column lies beyond the {columns} of the schema"));
    }
    if fit.column_mean.len() != p || fit.column_std.len() != p {
        return Some(format!("{p} columns, {} means, {} deviations", fit.column_mean.len(), fit.column_std.len()));
    }
    let whole = p.checked_add(1).and_then(|next| p.checked_mul(next)).map(|twice| twice / 2);
    if !fit.factor.is_empty() && Some(fit.factor.len()) != whole {
        return Some(format!("the factor has {} entries for {p} columns", fit.factor.len()));
    }
    let weights = [fit.attack.weights.len(), fit.realism.weights.len()];
    weights.into_iter().find(|n| *n != 0 && *n != p).map(|n| format!("{n} weights for {p} columns"))
}

fn rate(value: f64) -> f64 {
    if value.is_finite() { value.clamp(0.0, 1.0) } else { 0.5 }
}
