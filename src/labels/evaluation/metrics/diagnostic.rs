//! Definition of a diagnostic of realism. Experiments, pages, prompts and calibrations take all that they say of it from its row.

use super::limits::{Limit, Limits};
use super::soft::soft;
use crate::sim::AdversaryReport;

/// Text for the weight of a diagnostic that has no text of its own.
pub const WEIGHT: &str = "Weight of the diagnostic; all sum to 1.";

/// One diagnostic d_j, declared once.
#[derive(Debug)]
pub struct Diagnostic {
    /// The key of its weight w_j in experiment files; the last part is its name everywhere.
    pub key: &'static str,
    /// Experiments in which it counts.
    pub counts: Counts,
    /// Text for its weight on the pages.
    pub weight: &'static str,
    /// Description of what it measures, in words for agents.
    pub meaning: &'static str,
    /// A shorter description, where room is scarce, of what its name leaves open.
    pub short: &'static str,
    /// Computation of d_j.
    pub measure: Measure,
}

/// Experiments in which a diagnostic counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Counts {
    /// In every experiment: its weight must be there.
    Always,
    /// In experiments that give it a weight.
    Weighed,
    /// Likewise; outcomes must include motion that a kind does not show (`simulator.of_kind`).
    OfKind,
    /// Likewise; outcomes must include places where a kind does not belong (`simulator.of_place`).
    OfPlace,
}

/// Computation of d_j of an adversary, in [0, 1].
#[derive(Debug)]
pub enum Measure {
    /// The worst of these, each 1 within its limit and 0 one tolerance beyond it.
    Soft(&'static [Quantity]),
    /// A function of its own, without a limit.
    Of(fn(&AdversaryReport) -> f64),
}

/// Value of an adversary, and of its own recording where it has one.
type Shown = (f64, Option<f64>);

/// A quantity that a soft diagnostic holds to a limit.
#[derive(Debug)]
pub struct Quantity {
    /// Its name, the unit last.
    pub name: &'static str,
    /// Its limit by the kind of road user; `None` where the calibration has none.
    pub limit: fn(&Limits) -> Option<Limit>,
    /// Function for the value that is held to it; `None` where the outcome does not say.
    pub of: fn(&AdversaryReport) -> Option<Shown>,
}

/// A quantity of the measurements that every outcome has, whose limit has its name; or of one that not every outcome has, with its limit.
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

    /// Returns the quantities that it holds to limits.
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
