//! How a scene came about: who was where when the ego met an adversary or came nearest to one, and what the program did for it.

use crate::kernel::num;

/// Description of one scene in detailed questions.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Encounter {
    /// The contact, or the moment at which an adversary was nearest; `None` where nobody acted or no motion is known.
    pub moment: Option<Moment>,
    /// Smallest time to collision with an adversary, s.
    pub ttc_s: Option<f64>,
    /// Remarks on what else is worth saying.
    pub remarks: Vec<Remark>,
}

/// One thing that led to a scene's outcome.
#[derive(Clone, Debug, PartialEq)]
pub enum Remark {
    /// Party that ran into the other: `ego`, `it` or `both`.
    Strikes(&'static str),
    /// How long before the contact the ego could see it coming, s; `None` where it could not.
    Seen(Option<f64>),
    /// By how much that was too late to avoid it, s.
    Late(f64),
    /// How hard the ego braked at most, m/s², and when it began, s.
    Brakes(f64, f64),
    /// Which candidate won, from 1, among how many; an adversary each.
    Took(Vec<(usize, usize)>),
    /// When a law left the way that was chosen, s; `None` where it changed nothing.
    Law(Option<f64>),
}

impl Remark {
    /// As a phrase.
    fn phrase(&self) -> String {
        match self {
            Remark::Strikes("both") => "both strike".into(),
            Remark::Strikes(who) => format!("{who} strikes"),
            Remark::Seen(Some(seen_s)) => format!("seen {seen_s:.1} s"),
            Remark::Seen(None) => "not seen".into(),
            Remark::Late(late_s) => format!("{late_s:.1} s too late"),
            Remark::Brakes(hardest, from_s) => format!("ego brakes {hardest:.1} from {from_s:.1} s"),
            Remark::Took(taken) => {
                let of = taken.iter().map(|(place, count)| format!("{place} of {count}"));
                format!("took {}", of.collect::<Vec<_>>().join(", "))
            }
            Remark::Law(Some(from_s)) => format!("law at {from_s:.1} s"),
            Remark::Law(None) => "law changed nothing".into(),
        }
    }

    /// Its column in a compact table, and its cell there.
    fn cell(&self) -> (usize, String) {
        let short = |x: &f64| short(*x);
        let or_no = |x: &Option<f64>| x.as_ref().map_or("no".to_string(), short);
        match self {
            Remark::Strikes(who) => (0, (*who).into()),
            Remark::Seen(seen_s) => (1, or_no(seen_s)),
            Remark::Late(late_s) => (2, short(late_s)),
            Remark::Brakes(hardest, from_s) => (3, format!("{}@{}", short(hardest), short(from_s))),
            Remark::Took(taken) => {
                let of = taken.iter().map(|(place, count)| format!("{place}/{count}"));
                (4, of.collect::<Vec<_>>().join(" "))
            }
            Remark::Law(from_s) => (5, or_no(from_s)),
        }
    }
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
    /// Bearing of the adversary, seen from the ego: degrees from its heading, positive to the left.
    pub bearing_deg: f64,
}

impl Encounter {
    /// Heads of its columns.
    pub const HEAD: &'static str = "at_s | its_mps | ego_mps | bearing | ttc_s | how";

    /// Heads of its columns in a compact table.
    pub const COMPACT_HEAD: [&'static str; 11] = [
        "at_s",
        "its_mps",
        "ego_mps",
        "bearing",
        "ttc_s",
        "how: strikes",
        "seen_s",
        "late_s",
        "brakes",
        "took",
        "law_s",
    ];

    /// Its cells.
    pub fn shown(&self) -> String {
        let how = self.remarks.iter().map(Remark::phrase).collect::<Vec<_>>().join("; ");
        let cell = |x: Option<f64>, decimals| x.map_or("-".to_string(), |x| num::rounded(x, decimals).to_string());
        format!("{} | {how}", self.numbers(cell).join(" | "))
    }

    /// Its cells in a compact table: what a remark says has a column, whose head says it once.
    pub fn cells(&self) -> Vec<String> {
        let numbers = self.numbers(|x, decimals| {
            let cell = |x| if decimals == 0 { num::rounded(x, 0).to_string() } else { short(x) };
            x.map_or_else(String::new, cell)
        });
        let mut how = vec![String::new(); Encounter::COMPACT_HEAD.len() - numbers.len()];
        self.remarks.iter().map(Remark::cell).for_each(|(column, cell)| how[column] = cell);
        numbers.into_iter().chain(how).collect()
    }

    /// The cells before `how`.
    fn numbers(&self, cell: impl Fn(Option<f64>, u32) -> String) -> [String; 5] {
        let of = |read: fn(&Moment) -> f64| self.moment.as_ref().map(read);
        [
            cell(of(|moment| moment.time_s), 1),
            cell(of(|moment| moment.own_mps), 1),
            cell(of(|moment| moment.ego_mps), 1),
            cell(of(|moment| moment.bearing_deg), 0),
            cell(self.ttc_s, 1),
        ]
    }
}

/// A number of a compact table: from 10 on whole, below with one decimal.
pub fn short(x: f64) -> String {
    num::rounded(x, if x.abs() < 10.0 { 1 } else { 0 }).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scene_is_told_in_cells_and_what_is_not_known_is_a_dash() {
        let moment = Moment { time_s: 2.84, own_mps: 7.06, ego_mps: 9.3, bearing_deg: -139.6 };
        let remarks = vec![Remark::Strikes("it"), Remark::Seen(Some(0.8))];
        let encounter = Encounter { moment: Some(moment), ttc_s: Some(0.0), remarks };
        assert_eq!(encounter.shown(), "2.8 | 7.1 | 9.3 | -140 | 0 | it strikes; seen 0.8 s");
        assert_eq!(Encounter::default().shown(), "- | - | - | - | - | ");
        assert_eq!(Encounter::HEAD.matches('|').count(), encounter.shown().matches('|').count());
        assert_eq!(encounter.cells()[..7], ["2.8", "7.1", "9.3", "-140", "0", "it", "0.8"]);
    }

    #[test]
    fn a_compact_row_has_a_cell_for_every_remark() {
        let remarks = vec![
            Remark::Strikes("both"),
            Remark::Seen(None),
            Remark::Late(0.24),
            Remark::Brakes(8.81, 0.5),
            Remark::Took(vec![(28, 32), (1, 4)]),
            Remark::Law(Some(1.2)),
        ];
        let cells = |remarks: Vec<Remark>| Encounter { remarks, ..Encounter::default() }.cells();
        assert_eq!(cells(remarks)[5..], ["both", "no", "0.2", "8.8@0.5", "28/32 1/4", "1.2"]);
        assert_eq!(cells(vec![Remark::Law(None)])[10], "no");
        assert_eq!(cells(vec![]), [""; 11]);
    }
}
