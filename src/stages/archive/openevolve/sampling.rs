//! Choice of the program that is edited next, and of those that the question shows beside it.

use serde::Serialize;
use std::collections::BTreeMap;

use super::database::{Database, Member, key};

/// Least weight of a program that is drawn by fitness.
const WEIGHT_MIN: f64 = 0.001;
/// How far from its parent's cell an inspiration is looked for, cells an axis.
const CELLS_APART: i64 = 2;
/// Tries to find one there, a place that is left.
const TRIES: usize = 3;

/// A parent with its inspirations, by id.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Draw {
    pub parent: String,
    pub inspirations: Vec<String>,
}

impl Database {
    /// Draws the parent for an island and up to `count` inspirations. `draw` gives numbers in [0, 1). `None` while there is
    /// nobody at all.
    pub fn sample(&mut self, island: usize, count: usize, draw: &mut dyn FnMut() -> f64) -> Option<Draw> {
        let island = island % self.islands.len();
        let parent = self.parent(island, draw(), draw())?.id.clone();
        let inspirations = self.inspirations(island, &parent, count, draw);
        Some(Draw { parent, inspirations })
    }

    /// The parent for an island: `kind` says how it is drawn (from the whole island, from the archive, by fitness), `place`
    /// who it is. An empty island draws by the same rule from the first one and, by fitness, from everybody.
    pub fn parent(&self, island: usize, kind: f64, place: f64) -> Option<&Member> {
        let chances = self.chances(island);
        let mut start = 0.0;
        let way = chances.iter().find(|(share, _)| {
            start += share;
            kind < start
        });
        let (_, weights) = way.or_else(|| chances.last())?;
        let total: f64 = weights.iter().map(|(_, weight)| weight).sum();
        let (mut left, last) = (place * total, weights.last()?.0);
        let sampled = weights.iter().find(|(_, weight)| {
            left -= weight;
            left < 0.0
        });
        Some(sampled.map_or(last, |(member, _)| *member))
    }

    /// The chance of each program to be the parent for an island, 1: what [`Database::parent`] draws from.
    pub fn parent_probabilities(&self, island: usize) -> Vec<(&str, f64)> {
        let mut chances: Vec<(&str, f64)> = Vec::new();
        for (share, weights) in self.chances(island) {
            let total: f64 = weights.iter().map(|(_, weight)| weight).sum();
            for (member, weight) in weights {
                let own = share * weight / total;
                match chances.iter_mut().find(|(id, _)| *id == member.id) {
                    Some((_, chance)) => *chance += own,
                    None => chances.push((&member.id, own)),
                }
            }
        }
        chances
    }

    /// The three ways to draw a parent: the share of each, and who is drawn with which weight.
    fn chances(&self, island: usize) -> Vec<(f64, Vec<(&Member, f64)>)> {
        let empty = self.on_island(island).is_empty();
        let from = if empty { 0 } else { island };
        let own = self.on_island(from);
        let everybody: Vec<&Member> = self.members.iter().collect();
        let archived: Vec<&Member> = self.archive.iter().filter_map(|id| self.member(id)).collect();
        let mut here: Vec<&Member> =
            archived.iter().copied().filter(|member| self.islands[from].contains(&member.id)).collect();
        if here.is_empty() {
            here = archived;
        }
        if here.is_empty() {
            here = own.clone();
        }
        let rest = 1.0 - self.options.exploration_ratio - self.options.exploitation_ratio;
        // Fitness is asked for only where the island has members.
        let by_fitness = if empty {
            uniform(everybody)
        } else {
            own.iter().map(|member| (*member, member.fitness.max(WEIGHT_MIN))).collect()
        };
        vec![
            (self.options.exploration_ratio, uniform(own)),
            (self.options.exploitation_ratio, uniform(here)),
            (rest.max(0.0), by_fitness),
        ]
    }

    /// The island's best, then the best few. Where the island has more members than are shown: who lives near the parent, then
    /// anybody. Near is by where the members stand in the grid as it is now, not by the cells that they hold; of several in one
    /// place the latest is meant.
    fn inspirations(
        &mut self,
        island: usize,
        parent: &str,
        count: usize,
        draw: &mut dyn FnMut() -> f64,
    ) -> Vec<String> {
        let mut sampled: Vec<String> = Vec::new();
        let elite = ((count as f64 * self.options.elite_selection_ratio) as usize).max(1);
        let best = self.island_best[island].iter().filter(|best| self.member(best).is_some()).cloned();
        let top = self.ranked(island).into_iter().take(elite).map(|member| member.id.clone());
        for id in best.chain(top).collect::<Vec<String>>() {
            if id != parent && !sampled.contains(&id) {
                sampled.push(id);
            }
        }
        let mut others: Vec<String> = self.on_island(island).iter().map(|member| member.id.clone()).collect();
        let left = count.saturating_sub(sampled.len());
        if others.len() > count && left > 0 {
            let cell = self.cell_of(parent, draw);
            let standing: BTreeMap<String, &String> =
                others.iter().map(|id| (key(&self.cell_of(id, draw)), id)).collect();
            for _ in 0..TRIES * left {
                let near: Vec<usize> = cell.iter().map(|bin| self.near(*bin, draw())).collect();
                if let Some(id) = standing.get(&key(&near)).filter(|id| **id != parent && !sampled.contains(id)) {
                    sampled.push((*id).clone());
                }
                if sampled.len() == count {
                    break;
                }
            }
            others.retain(|id| id != parent && !sampled.contains(id));
            while sampled.len() < count && !others.is_empty() {
                let place = ((draw() * others.len() as f64) as usize).min(others.len() - 1);
                sampled.push(others.remove(place));
            }
        }
        sampled.truncate(count);
        sampled
    }

    /// A bin at most two away from another one.
    fn near(&self, bin: usize, draw: f64) -> usize {
        let step = (draw * (2 * CELLS_APART + 1) as f64) as i64 - CELLS_APART;
        (bin as i64 + step).clamp(0, self.options.feature_bins as i64 - 1) as usize
    }

    /// The best of the island that a program lives on, itself among them: what the question shows as the top programs.
    pub fn top(&self, id: &str, count: usize) -> Vec<String> {
        let home = self.islands.iter().position(|island| island.iter().any(|other| other == id)).unwrap_or(0);
        self.ranked(home).into_iter().take(count).map(|member| member.id.clone()).collect()
    }
}

fn uniform(members: Vec<&Member>) -> Vec<(&Member, f64)> {
    members.into_iter().map(|member| (member, 1.0)).collect()
}
