//! Test of whether the road users that a program moves are told from recorded ones: a critic of realism that was not made by hand. It is
//! reported, and nothing is searched by it.

use std::fmt::Write as _;

use crate::kernel::{Digest, num};
use crate::scene::beside::{COLUMNS, QUANTITIES};
use crate::statistics::Estimate;
use crate::statistics::two_samples::{Member, in_deviations, told_apart};

/// A road user's motion beside the ego ([`crate::scene::beside`]), and the scene that it is in, by its place.
pub type Moving = (usize, [f64; COLUMNS]);

/// Road users of one program's rollouts.
#[derive(Clone, Debug, Default)]
pub struct RoadUsers {
    /// Adversaries where the program acts.
    pub acted: Vec<Moving>,
    /// Everybody else, as recorded, and the recordings of those adversaries, over the same time beside the same ego.
    pub recorded: Vec<Moving>,
}

/// Degree to which they are told apart.
#[derive(Clone, Debug)]
pub struct Recognised {
    pub acted: usize,
    pub recorded: usize,
    /// 0.5 where nothing tells them apart; `None` where a program acts too rarely.
    pub auc: Option<Estimate>,
    /// Largest differences: name, and Wasserstein's distance in standard deviations.
    pub differs: Vec<(&'static str, f64)>,
}

/// Number of the largest differences that are named.
const NAMED: usize = 3;

impl RoadUsers {
    /// Adversaries against recorded road users. `suite`: which scenes.
    pub fn recognised(&self, suite: Digest) -> Recognised {
        recognised([&self.recorded, &self.acted], suite)
    }

    /// The control: recorded road users of every second scene against those of the others, who must not be told apart.
    pub fn control(&self, suite: Digest) -> Recognised {
        let (second, first): (Vec<Moving>, Vec<Moving>) = self.recorded.iter().partition(|(scene, _)| scene % 2 == 1);
        recognised([&first, &second], suite)
    }
}

fn recognised([recorded, acted]: [&[Moving]; 2], suite: Digest) -> Recognised {
    let member = |second: bool| move |(group, row): &Moving| Member { group: *group, second, values: row.to_vec() };
    let members: Vec<Member> = recorded.iter().map(member(false)).chain(acted.iter().map(member(true))).collect();
    let distance = |column: usize| {
        let of = |users: &[Moving]| users.iter().map(|(_, row)| row[column]).collect::<Vec<f64>>();
        in_deviations(&of(recorded), &of(acted)).unwrap_or(0.0)
    };
    let mut differs: Vec<(&str, f64)> =
        QUANTITIES.iter().enumerate().map(|(column, (name, ..))| (*name, distance(column))).collect();
    differs.sort_by(|a, b| b.1.total_cmp(&a.1));
    differs.truncate(NAMED);
    Recognised { acted: acted.len(), recorded: recorded.len(), auc: told_apart(&members, suite), differs }
}

/// A Markdown table, a program a row: its name, and the realism that the search works with.
pub fn text(rows: &[(String, Option<f64>, Recognised)], scenes: usize, driver: &str) -> String {
    let mut out = format!(
        "# Whether acted road users are told from recorded ones\n\nA classifier (boosted trees, cross-validated by scene) sees {} numbers of a road user's motion \
         beside the ego, up to a second before a contact. AUC: the chance that of two it takes the acted one for acted; .5 where nothing tells them \
         apart. In {scenes} scenes that no search has seen, driven by {driver}; recorded road users come from the same rollouts. Reported, not \
         searched by.\n\n| program | strict realism | AUC | acted | recorded | differs most (deviations) |\n|---|--:|--:|--:|--:|---|\n",
        QUANTITIES.len()
    );
    for (name, realism, of) in rows {
        let realism = realism.map_or("–".to_string(), |realism| format!("{realism:.3}"));
        let auc = of.auc.map_or("–".to_string(), |auc| auc.text(2));
        let differs: Vec<String> =
            of.differs.iter().map(|(name, by)| format!("{name} {}", num::fixed(*by, 2))).collect();
        let _ =
            writeln!(out, "| {name} | {realism} | {auc} | {} | {} | {} |", of.acted, of.recorded, differs.join("; "));
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernel::{Seed, Stream};

    fn row(draw: &mut Stream) -> [f64; COLUMNS] {
        std::array::from_fn(|_| draw.normal(0.0, 1.0))
    }

    #[test]
    fn what_a_mean_of_diagnostics_does_not_see_is_recognised_and_named() {
        let mut draw = Seed(5).stream(&["recognised"]);
        let behind = QUANTITIES.iter().position(|(name, ..)| *name == "close behind, share of time").unwrap();
        let recorded: Vec<Moving> = (0..300).map(|place| (place / 3, row(&mut draw))).collect();
        let mut acted: Vec<Moving> = (0..100).map(|place| (place, row(&mut draw))).collect();
        let suite = Digest::of_bytes(b"recognised");
        let alike = RoadUsers { acted: acted.clone(), recorded: recorded.clone() };
        let control = alike.control(suite).auc.unwrap();
        assert!((0.42..0.58).contains(&control.value), "{control:?}");
        let same = alike.recognised(suite).auc.unwrap();
        assert!(same.interval.is_some_and(|[low, high]| low < 0.5 && 0.5 < high), "{same:?}");
        acted.iter_mut().for_each(|(_, row)| row[behind] += 2.0);
        let rams = RoadUsers { acted, recorded }.recognised(suite);
        assert!(rams.auc.unwrap().value > 0.8 && rams.differs[0].0 == QUANTITIES[behind].0, "{rams:?}");
        assert!(RoadUsers::default().recognised(suite).auc.is_none());
    }
}
