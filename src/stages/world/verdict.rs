//! Prediction of a candidate, and what both ways of allotting an epoch's rollouts share.

use crate::objects::{Objectives, RouteDecision, RouteReason, RoutingOptions};

/// W_φ(c), calibrated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prediction {
    /// The parent's labels with the predicted difference, each in [0, 1].
    pub objectives: Objectives,
    /// The predicted difference.
    pub difference: Objectives,
    /// Half widths of the intervals; `None` where too few errors are known.
    pub half_width: Option<Objectives>,
    /// Score that candidates are ranked by.
    pub rank_score: f64,
    /// Knowledge that only an evaluator of pairs has.
    pub of_pairs: Option<OfPairs>,
}

/// How sure an evaluator of pairs is of a candidate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OfPairs {
    /// Û(c), aggregated over scenes, in [0, 1].
    pub uncertainty: f64,
    /// True if the candidate's group has too few labels to calibrate by.
    pub sparse: bool,
    /// True if the evaluator abstains.
    pub abstains: bool,
}

impl Prediction {
    /// Û(c); where candidates are predicted, half width of the wider interval. 1 where nothing is known.
    pub fn uncertainty(&self) -> f64 {
        let half = || self.half_width.map_or(1.0, |half| half.attack.max(half.realism));
        self.of_pairs.map_or_else(half, |of| of.uncertainty)
    }
}

/// A decision, for how many candidates a drawn one stands, and why.
pub type Allotted = (RouteDecision, Option<f64>, RouteReason);

/// Returns how many of the budget are drawn, by a number in [0, 1) for the fraction.
pub fn audits(options: &RoutingOptions, budget: usize, draw: f64) -> usize {
    let wanted = options.audit_share * budget as f64;
    (wanted.floor() as usize + usize::from(draw < wanted.fract())).min(budget)
}

/// Predicted, with certainty, to lose too much.
pub fn is_weak(prediction: &Prediction, options: &RoutingOptions) -> bool {
    prediction.uncertainty() <= options.lambda_u && loses(prediction, options)
}

/// Predicted to lose more than is allowed.
pub fn loses(prediction: &Prediction, options: &RoutingOptions) -> bool {
    let Objectives { attack, realism } = prediction.difference;
    attack < -options.lambda_a || realism < -options.lambda_r
}

/// Cuts a list into at most so many parts of nearly the same length, none of them empty.
pub fn strata(list: &[usize], parts: usize) -> Vec<&[usize]> {
    let parts = parts.min(list.len());
    (0..parts).map(|k| &list[k * list.len() / parts..(k + 1) * list.len() / parts]).collect()
}
