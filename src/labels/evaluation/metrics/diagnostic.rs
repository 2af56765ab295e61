//! What a diagnostic of realism is. All that experiments, pages, prompts and calibrations say of one follows from its row.

use super::limits::{Limit, Limits};
use super::soft::soft;
use crate::sim::AdversaryReport;

/// What the pages say of a weight that says nothing else.
pub const WEIGHT: &str = "Weight of the diagnostic; all sum to 1.";

/// One diagnostic d_j, declared once.
#[derive(Debug)]
pub struct Diagnostic {
    /// The key of its weight w_j in experiment files; the last part is its name everywhere.
    pub key: &'static str,
    /// Where it counts.
    pub counts: Counts,
    /// What the pages say of its weight.
    pub weight: &'static str,
    /// What it measures, in words for agents.
    pub meaning: &'static str,
    /// The same where room is scarce: what its name leaves open of that.
    pub short: &'static str,
    /// How d_j comes about.
    pub measure: Measure,
}

/// Where a diagnostic counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Counts {
    /// In every experiment: its weight must be there.
    Always,
    /// Where it has a weight.
    Weighed,
    /// Likewise; outcomes must say what a kind does not do (`simulator.of_kind`).
    OfKind,
    /// Likewise; outcomes must say where a kind does not belong (`simulator.of_place`).
    OfPlace,
}

/// How d_j of an adversary comes about, in [0, 1].
#[derive(Debug)]
pub enum Measure {
    /// The worst of these, each 1 within its limit and 0 one tolerance beyond it.
    Soft(&'static [Quantity]),
    /// A function of its own, without a limit.
    Of(fn(&AdversaryReport) -> f64),
}

/// What an adversary shows, and its own recording where it has one.
type Shown = (f64, Option<f64>);

/// A quantity that a soft diagnostic holds to a limit.
#[derive(Debug)]
pub struct Quantity {
    /// Its name, the unit last.
    pub name: &'static str,
    /// Its limit by the kind of road user; `None` where the calibration has none.
    pub limit: fn(&Limits) -> Option<Limit>,
    /// What is held to it; `None` where the outcome does not say.
    pub of: fn(&AdversaryReport) -> Option<Shown>,
}

/// A quantity of the account that every outcome has, whose limit has its name; or of one that not every outcome has, with its limit.
macro_rules! quantity {
    ($name:ident) => {
        Quantity {
            name: stringify!($name),
            limit: |of| Some(of.$name),
            of: |report| Some((report.simulated.$name, report.recorded.map(|of| of.$name))),
        }
    };
    ($account:ident.$name:ident, $limit:expr) => {
        Quantity {
            name: stringify!($name),
            limit: $limit,
            of: |report| report.$account.map(|of| (of.simulated.$name, of.recorded.map(|of| of.$name))),
        }
    };
}
pub(super) use quantity;

impl Quantity {
    /// d_j of the excess over the bound and over the adversary's own recording, whichever is larger.
    fn value(&self, report: &AdversaryReport, limits: &Limits) -> f64 {
        (self.limit)(limits).zip((self.of)(report)).map_or(1.0, |(limit, (simulated, recorded))| {
            soft(simulated - limit.bound.max(recorded.unwrap_or(0.0)), limit.tolerance)
        })
    }
}

impl Diagnostic {
    /// Its name in weights, scores and tables.
    pub fn name(&self) -> &'static str {
        self.key.rsplit('.').next().unwrap_or(self.key)
    }

    /// What it holds to limits.
    pub fn quantities(&self) -> &'static [Quantity] {
        if let Measure::Soft(all) = self.measure { all } else { &[] }
    }

    /// d_j of one adversary by the limits of its kind.
    pub fn value(&self, report: &AdversaryReport, limits: &Limits) -> f64 {
        match self.measure {
            Measure::Soft(all) => all.iter().fold(1.0, |worst, of| of.value(report, limits).min(worst)),
            Measure::Of(value) => value(report),
        }
    }
}
