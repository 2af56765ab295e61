//! Allotment of an epoch's rollouts by value and uncertainty (paper, eq. method-routing and appendix World Evaluator): what is
//! promising and certain is selected, what is uncertain or in a sparse region is audited, and only what is low with certainty is turned
//! away for its value.

use super::verdict::{Allotted, Prediction, audits, loses, strata};
use crate::kernel::Stream;
use crate::objects::{RouteDecision, RouteReason, RoutingOptions};

/// Start of the reason of a candidate that is turned away for its value.
const LOW: &str = "reject: low and certain";

/// d_φ of a candidate, before the budget.
fn verdict(prediction: &Prediction, options: &RoutingOptions) -> RouteDecision {
    let sparse = prediction.of_pairs.is_some_and(|of| of.sparse || of.abstains);
    if prediction.uncertainty() > options.lambda_u || sparse {
        RouteDecision::Audit
    } else if loses(prediction, options) {
        RouteDecision::Reject
    } else {
        RouteDecision::Select
    }
}

/// The budget less what the monitor draws goes to the selected by rank, what they leave to the audited by rank. The monitor draws
/// among all who are left, in strata: the audited first, then the rejected, then the selected; a drawn one stands for its stratum.
pub(super) fn allot(predictions: &[Prediction], options: &RoutingOptions, stream: &mut Stream) -> Vec<Allotted> {
    let n = predictions.len();
    let budget = (options.rollout_budget as usize).min(n);
    let monitored = audits(options, budget, stream.unit());
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by(|&a, &b| predictions[b].rank_score.total_cmp(&predictions[a].rank_score).then(a.cmp(&b)));
    let verdicts: Vec<RouteDecision> = predictions.iter().map(|of| verdict(of, options)).collect();
    let of =
        |wanted: RouteDecision| order.iter().copied().filter(|&place| verdicts[place] == wanted).collect::<Vec<_>>();
    let ranked = [of(RouteDecision::Select), of(RouteDecision::Audit), of(RouteDecision::Reject)];
    let taken: Vec<usize> = ranked[..2].concat().into_iter().take(budget - monitored).collect();
    let rank = |place: usize| order.iter().position(|other| *other == place).map_or(0, |rank| rank + 1);
    let mut allotted: Vec<Allotted> = (0..n)
        .map(|place| {
            let why = match (verdicts[place], taken.contains(&place)) {
                (RouteDecision::Select, true) => "select: promising and certain",
                (RouteDecision::Audit, true) => "audit: uncertain or in a sparse region",
                (RouteDecision::Reject, _) => LOW,
                (RouteDecision::Select, false) => "reject: behind the budget, promising and certain",
                (RouteDecision::Audit, false) => "reject: behind the budget, uncertain or in a sparse region",
            };
            let decision = if taken.contains(&place) { verdicts[place] } else { RouteDecision::Reject };
            (decision, None, RouteReason::Other(format!("{why}, rank {} of {n}", rank(place))))
        })
        .collect();
    let left = [&ranked[1], &ranked[2], &ranked[0]].into_iter().flatten().copied();
    let left: Vec<usize> = left.filter(|place| !taken.contains(place)).collect();
    for stratum in strata(&left, monitored) {
        let place = stratum[stream.below(stratum.len())];
        let reason = RouteReason::Monitored(format!(", rank {} of {n}", rank(place)));
        allotted[place] = (RouteDecision::Audit, Some(stratum.len() as f64), reason);
    }
    allotted
}
