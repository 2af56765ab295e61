//! How a scene came about: who was where when the ego met an adversary or came nearest to one, and what the program did for it.

use crate::kernel::num;

/// What detailed questions say of one scene.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Encounter {
    /// The contact, or the moment at which an adversary was nearest; `None` where nobody acted or no motion is known.
    pub moment: Option<Moment>,
    /// Smallest time to collision with an adversary, s.
    pub ttc_s: Option<f64>,
    /// What else is worth saying, a phrase each: who struck whom, what the ego did, which candidate won, when a law took over.
    pub remarks: Vec<String>,
}

/// Ego and adversary at one moment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moment {
    /// Since the first simulated step, s.
    pub time_s: f64,
    /// Speed of the adversary, m/s.
    pub own_mps: f64,
    /// Speed of the ego, m/s.
    pub ego_mps: f64,
    /// Where the adversary is, seen from the ego: degrees from its heading, positive to the left.
    pub bearing_deg: f64,
}

impl Encounter {
    /// Heads of its columns.
    pub const HEAD: &'static str = "at_s | its_mps | ego_mps | bearing | ttc_s | how";

    /// Its cells.
    pub fn shown(&self) -> String {
        let cell = |x: Option<f64>, decimals| x.map_or("-".to_string(), |x| num::rounded(x, decimals).to_string());
        let of = |read: fn(&Moment) -> f64| self.moment.as_ref().map(read);
        let cells = [
            cell(of(|moment| moment.time_s), 1),
            cell(of(|moment| moment.own_mps), 1),
            cell(of(|moment| moment.ego_mps), 1),
            cell(of(|moment| moment.bearing_deg), 0),
            cell(self.ttc_s, 1),
            self.remarks.join("; "),
        ];
        cells.join(" | ")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scene_is_told_in_cells_and_what_is_not_known_is_a_dash() {
        let moment = Moment { time_s: 2.84, own_mps: 7.06, ego_mps: 9.3, bearing_deg: -139.6 };
        let remarks = vec!["it strikes".to_string(), "seen 0.8 s".to_string()];
        let encounter = Encounter { moment: Some(moment), ttc_s: Some(0.0), remarks };
        assert_eq!(encounter.shown(), "2.8 | 7.1 | 9.3 | -140 | 0 | it strikes; seen 0.8 s");
        assert_eq!(Encounter::default().shown(), "- | - | - | - | - | ");
        assert_eq!(Encounter::HEAD.matches('|').count(), encounter.shown().matches('|').count());
    }
}
