//! Prediction of a candidate's difference from its parent, calibration, and who gets the rollouts of an epoch's budget (paper
//! eq. method-routing).

use super::{
    by_value,
    configuration::{ConfigurationError, validate},
    pairs, pilot,
    prediction::{difference, spread},
    verdict::{Allotted, OfPairs, Prediction, audits, is_weak, strata},
};
use crate::kernel::{Digest, Seed, Stream, canon::CanonError};
use crate::objects::{
    LineageId, Objectives, Pilot, Regression, Route, RouteDecision, RouteReason, RoutingChoice, RoutingOptions,
    WorldConfiguration, WorldFit, WorldModel, WorldRow, WorldSnapshot,
};
use crate::statistics::boosted;

/// Returns `true` if a recorded route would have turned its candidate away, had it not been drawn for an audit.
pub fn drawn_by_monitor(route: &Route) -> bool {
    route.decision == RouteDecision::Audit && matches!(route.reason, RouteReason::Monitored(_))
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
    /// A row cannot be predicted.
    #[error("a candidate cannot be predicted: {0}; features and snapshot must come from one schema")]
    Row(String),
}

/// A snapshot ready for use; shared by all workers of an epoch.
#[derive(Clone, Debug)]
pub struct Router<'s> {
    snapshot: &'s WorldSnapshot,
    digest: Digest,
}

/// The stream from which the audits of an epoch are drawn.
pub fn audit_stream(seed: Seed, lineage: &LineageId, epoch: u32) -> Stream {
    seed.stream(&["world", "audit", lineage.as_str(), &epoch.to_string()])
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

    /// The calibrated prediction of one candidate (eq. app-world-calibration, of differences from the parent).
    pub fn predict(&self, row: &WorldRow) -> Result<Prediction, RouterError> {
        let columns = self.snapshot.schema.columns.len();
        if row.features.len() != columns {
            return Err(RouterError::Row(format!("{} features, {columns} columns", row.features.len())));
        }
        if row.features.iter().any(|value| !value.is_finite()) {
            return Err(RouterError::Row("a feature is not finite".to_string()));
        }
        let WorldSnapshot { schema, configuration, fit } = self.snapshot;
        let expected = configuration.pairs.map(|of| (of, pairs::expected(configuration, &of, fit.as_ref(), row)));
        let of_pairs = expected.map(|(options, of)| OfPairs {
            uncertainty: of.uncertainty,
            sparse: of.sparse,
            abstains: of.uncertainty > options.abstain_above,
        });
        let difference = match &expected {
            Some((_, of)) => of.difference,
            None => difference(configuration, schema, fit.as_ref(), row),
        };
        let half_width = self.snapshot.fit.as_ref().and_then(|fit| Some(fit.half_width?.times(spread(row))));
        let gain = |of: &Objectives| of.attack + configuration.realism_weight * of.realism;
        let unknown = match of_pairs {
            Some(of) => gain(&Objectives { attack: of.uncertainty, realism: of.uncertainty }),
            None => half_width.as_ref().map_or(0.0, gain),
        };
        let rank_score = gain(&difference) + configuration.explore * unknown;
        let objectives = Objectives {
            attack: (row.parent.attack + difference.attack).clamp(0.0, 1.0),
            realism: (row.parent.realism + difference.realism).clamp(0.0, 1.0),
        };
        Ok(Prediction { objectives, difference, half_width, rank_score, of_pairs })
    }

    /// The routes of an epoch's admitted candidates, in their order.
    pub fn routes(&self, predictions: &[Prediction], stream: &mut Stream) -> Vec<Route> {
        let configuration = &self.snapshot.configuration;
        let labels = self.snapshot.fit.as_ref().map_or(0, |fit| fit.labels);
        let (known, routing) = (too_few(labels, configuration), &configuration.routing);
        let ranked = known.is_none() && routing.choice == RoutingChoice::Ranked;
        let allotted = if configuration.pairs.is_some() && ranked {
            by_value::allot(predictions, routing, stream)
        } else {
            allot(predictions, known, routing, stream)
        };
        let route = |(prediction, (decision, weight, reason)): (&Prediction, Allotted)| Route {
            decision,
            reason: reason.with(&format!("; {}", numbers(prediction))),
            snapshot: self.digest,
            predicted: prediction.objectives,
            uncertainty: prediction.uncertainty(),
            half_width: prediction.half_width,
            rank_score: Some(prediction.rank_score),
            weight,
            pilot: None,
        };
        predictions.iter().zip(allotted).map(route).collect()
    }

    /// A prediction that counts what a pilot showed when candidates are ranked; `open_share` is that of the candidate's row.
    pub fn after_pilot(&self, prediction: Prediction, open_share: f64, pilot: &Pilot) -> Prediction {
        let configuration = &self.snapshot.configuration;
        let ranked = configuration
            .routing
            .pilot
            .and_then(|options| pilot::rank_score(&prediction, open_share, pilot, &options, configuration));
        Prediction { rank_score: ranked.unwrap_or(prediction.rank_score), ..prediction }
    }
}

fn numbers(prediction: &Prediction) -> String {
    let Objectives { attack, realism } = prediction.difference;
    let width = prediction.uncertainty();
    format!("difference from the parent: attack {attack:+.3}, realism {realism:+.3}, uncertainty {width:.3}")
}

/// Returns the number of labelled candidates, where these are too few to rank anybody. After a pilot or a rollout of our own something
/// is known of every candidate, however few were labelled before.
pub(super) fn too_few(labels: u32, configuration: &WorldConfiguration) -> Option<u32> {
    let WorldConfiguration { model, routing, .. } = configuration;
    let all_known = routing.pilot.is_some() || *model == WorldModel::Simulator;
    (labels < routing.min_labels && !all_known).then_some(labels)
}

/// Allots the rollouts of an epoch.
///
/// 1. So few labels that nobody can be ranked, or a random choice: the budget is drawn at random; each drawn one stands for as many
///    as there are for one place of the budget.
/// 2. A candidate is weak if it is predicted to lose more than λ_A of attack or λ_R of realism, with an uncertainty of at most λ_U.
/// 3. The budget less its audits goes to the best by rank that are not weak.
/// 4. The others are cut into as many strata as there are audits, by rank, and one of each is drawn: it stands for its stratum.
pub fn allot(
    predictions: &[Prediction],
    too_few: Option<u32>,
    options: &RoutingOptions,
    stream: &mut Stream,
) -> Vec<Allotted> {
    let n = predictions.len();
    let budget = (options.rollout_budget as usize).min(n);
    // It is drawn in every case, so that another budget changes no other draw of the stream.
    let draw = stream.unit();
    match (options.choice, too_few) {
        (RoutingChoice::Random, _) => return drawn(n, budget, "the choice is random", stream),
        (RoutingChoice::Ranked, Some(labels)) => {
            let needed = options.min_labels;
            let why = format!("{labels} labelled candidates, {needed} needed before anybody is ranked");
            return drawn(n, budget, &why, stream);
        }
        (RoutingChoice::Ranked, None) => {}
    }
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by(|&a, &b| predictions[b].rank_score.total_cmp(&predictions[a].rank_score).then(a.cmp(&b)));
    let audits = audits(options, budget, draw);
    let fit: Vec<usize> = order.iter().copied().filter(|&place| !is_weak(&predictions[place], options)).collect();
    let selected: Vec<usize> = fit.into_iter().take(budget - audits).collect();
    let others: Vec<usize> = order.iter().copied().filter(|place| !selected.contains(place)).collect();
    let rank = |place: usize| order.iter().position(|other| *other == place).map_or(0, |rank| rank + 1);
    let mut allotted: Vec<Allotted> = (0..n)
        .map(|place| {
            let weak = if is_weak(&predictions[place], options) { "weak and certain" } else { "behind the budget" };
            (RouteDecision::Reject, None, RouteReason::Other(format!("reject: {weak}, rank {} of {n}", rank(place))))
        })
        .collect();
    for place in selected {
        let reason = RouteReason::Other(format!("select: rank {} of {n}", rank(place)));
        allotted[place] = (RouteDecision::Select, None, reason);
    }
    for stratum in strata(&others, audits) {
        let place = stratum[stream.below(stratum.len())];
        let reason = RouteReason::Monitored(format!(", rank {} of {n}", rank(place)));
        allotted[place] = (RouteDecision::Audit, Some(stratum.len() as f64), reason);
    }
    allotted
}

/// The budget at random.
fn drawn(n: usize, budget: usize, why: &str, stream: &mut Stream) -> Vec<Allotted> {
    let mut order: Vec<usize> = (0..n).collect();
    stream.shuffle(&mut order);
    let chosen = &order[..budget];
    let one = |place: usize| {
        if chosen.contains(&place) {
            let reason = RouteReason::Other(format!("audit: drawn at random, {why}"));
            (RouteDecision::Audit, Some(n as f64 / budget as f64), reason)
        } else {
            (RouteDecision::Reject, None, RouteReason::Other(format!("reject: not drawn, {why}")))
        }
    };
    (0..n).map(one).collect()
}

/// Why a fit cannot belong to a schema.
fn mismatch(fit: &WorldFit, columns: usize) -> Option<String> {
    let p = fit.columns.len();
    if let Some(found) = fit.pairs.as_ref().map(|of| of.inverse.len()).filter(|found| *found != 0 && *found != p * p) {
        return Some(format!("{p} columns, {found} entries of the inverse"));
    }
    if fit.columns.iter().any(|place| *place >= columns) {
        return Some(format!("a used column lies beyond the {columns} of the schema"));
    }
    if fit.column_mean.len() != p || fit.column_std.len() != p {
        return Some(format!("{p} columns, {} means, {} deviations", fit.column_mean.len(), fit.column_std.len()));
    }
    [&fit.attack, &fit.realism].into_iter().find_map(|regression| match regression {
        Regression::Ridge(line) => (!line.weights.is_empty() && line.weights.len() != p)
            .then(|| format!("{} weights for {p} columns", line.weights.len())),
        Regression::Simulated(line) => {
            (line.column >= columns).then(|| format!("a slope reads a column beyond the {columns} of the schema"))
        }
        Regression::Boosted(model) => (!model.trees.iter().all(|tree| boosted::is_sound(tree, p)))
            .then(|| "a tree leads nowhere or reads a column that is not there".to_string()),
    })
}
