//! The database: islands with their grids, the archive, the best ones, migration, and the cap on the population.

use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};

use super::diversity::Diversity;

/// OpenEvolve's options of the search, under its own names.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OpenEvolveOptions {
    /// Populations that evolve apart.
    pub num_islands: usize,
    /// Places of the archive of the best, over all islands.
    pub archive_size: usize,
    /// Most programs, over all islands.
    pub population_size: usize,
    /// Axes of the grid: names of metrics, `complexity` (length of the text) or `diversity`.
    pub feature_dimensions: Vec<String>,
    /// Cells of an axis.
    pub feature_bins: usize,
    /// Programs that an island takes in between two migrations.
    pub migration_interval: usize,
    /// Share of an island that migrates, 1.
    pub migration_rate: f64,
    /// Texts that `diversity` is measured against.
    pub diversity_reference_size: usize,
    /// Share of parents drawn from their whole island, 1.
    pub exploration_ratio: f64,
    /// Share of parents drawn from the archive, 1. The rest is drawn by fitness.
    pub exploitation_ratio: f64,
    /// Share of the inspirations that are the best of their island, 1; one at least.
    pub elite_selection_ratio: f64,
}

/// A program as the database sees it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Member {
    pub id: String,
    /// Its text: what `complexity` and `diversity` are read off, and what two islands may not hold both.
    pub code: String,
    pub metrics: BTreeMap<String, f64>,
    /// The one score by which programs are compared.
    pub fitness: f64,
    /// Program that this member is a copy of, where it is a copy that migrated.
    pub copy_of: Option<String>,
}

/// Everything that the search remembers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Database {
    pub(super) options: OpenEvolveOptions,
    /// In order of insertion.
    pub(super) members: Vec<Member>,
    /// Ids of each island's members, in order of insertion.
    pub(super) islands: Vec<Vec<String>>,
    /// For each island: place in the grid, such as `3-7` -> program that holds it. Places are never computed anew.
    pub(super) cells: Vec<BTreeMap<String, String>>,
    pub(super) archive: Vec<String>,
    pub(super) best: Option<String>,
    pub(super) island_best: Vec<Option<String>>,
    pub(super) generations: Vec<usize>,
    pub(super) last_migration: usize,
    /// Smallest and largest value of each axis so far.
    pub(super) ranges: BTreeMap<String, [f64; 2]>,
    diversity: Diversity,
    copies: usize,
}

impl Database {
    pub fn new(options: OpenEvolveOptions) -> Database {
        let islands = options.num_islands.max(1);
        Database {
            members: Vec::new(),
            islands: vec![Vec::new(); islands],
            cells: vec![BTreeMap::new(); islands],
            archive: Vec::new(),
            best: None,
            island_best: vec![None; islands],
            generations: vec![0; islands],
            last_migration: 0,
            ranges: BTreeMap::new(),
            diversity: Diversity::default(),
            copies: 0,
            options,
        }
    }

    /// The member of this id.
    pub fn member(&self, id: &str) -> Option<&Member> {
        self.members.iter().find(|member| member.id == id)
    }

    /// Puts a program on an island: a cell where it is free or held by somebody worse, a place in the archive likewise.
    /// `draw` gives numbers in [0, 1). Here and below the number of an island counts on from the last to the first.
    pub fn add(&mut self, member: Member, island: usize, draw: &mut dyn FnMut() -> f64) {
        let (id, island) = (member.id.clone(), island % self.islands.len());
        self.members.push(member);
        let cell = self.cell_of(&id, draw);
        let displaced = self.take_cell(&id, island, key(&cell));
        if !self.islands[island].contains(&id) {
            self.islands[island].push(id.clone());
        }
        self.take_archive_place(&id);
        self.note_best(&id, island);
        // A program that lost its cell lives nowhere else: a copy on another island is a member of its own.
        if let Some(gone) = displaced {
            self.forget(&gone);
        }
        self.keep_to_size(&id);
    }

    /// One more program was made for an island; migration follows where it is time.
    pub fn advance(&mut self, island: usize, draw: &mut dyn FnMut() -> f64) -> bool {
        let island = island % self.islands.len();
        self.generations[island] += 1;
        let newest = self.generations.iter().copied().max().unwrap_or(0);
        let due = newest - self.last_migration >= self.options.migration_interval;
        if due {
            self.migrate(draw);
            self.last_migration = newest;
        }
        due
    }

    pub(super) fn fitness(&self, id: &str) -> f64 {
        self.member(id).map_or(f64::NEG_INFINITY, |member| member.fitness)
    }

    /// Members of an island, in order of insertion.
    pub(super) fn on_island(&self, island: usize) -> Vec<&Member> {
        self.islands[island].iter().filter_map(|id| self.member(id)).collect()
    }

    /// The same, the best first.
    pub(super) fn ranked(&self, island: usize) -> Vec<&Member> {
        let mut members = self.on_island(island);
        members.sort_by(|a, b| b.fitness.total_cmp(&a.fitness));
        members
    }

    /// Its place in the grid; the ranges of the axes grow on the way.
    pub(super) fn cell_of(&mut self, id: &str, draw: &mut dyn FnMut() -> f64) -> Vec<usize> {
        let mut cell = Vec::new();
        for axis in self.options.feature_dimensions.clone() {
            let Some(member) = self.members.iter().find(|member| member.id == id) else { continue };
            let value = match (member.metrics.get(&axis), axis.as_str()) {
                (Some(metric), _) => Some(*metric),
                (None, "complexity") => Some(member.code.chars().count() as f64),
                (None, "diversity") if self.members.len() >= 2 => {
                    let texts: Vec<&str> = self.members.iter().map(|member| member.code.as_str()).collect();
                    Some(self.diversity.of(&member.code, &texts, self.options.diversity_reference_size, draw))
                }
                _ => None,
            };
            cell.push(value.map_or(0, |value| self.bin(&axis, value)));
        }
        cell
    }

    fn bin(&mut self, axis: &str, value: f64) -> usize {
        let range = self.ranges.entry(axis.to_string()).or_insert([value; 2]);
        *range = [range[0].min(value), range[1].max(value)];
        let [low, high] = *range;
        let scaled = if low == high { 0.5 } else { ((value - low) / (high - low)).clamp(0.0, 1.0) };
        ((scaled * self.options.feature_bins as f64) as usize).min(self.options.feature_bins.saturating_sub(1))
    }

    /// Takes the cell if it is free or its holder has less fitness; returns that holder. The winner takes over its place in the archive.
    fn take_cell(&mut self, id: &str, island: usize, cell: String) -> Option<String> {
        let held = self.cells[island].get(&cell).filter(|held| self.member(held).is_some()).cloned();
        if held.as_ref().is_some_and(|held| self.fitness(id) <= self.fitness(held)) {
            return None;
        }
        self.cells[island].insert(cell, id.to_string());
        let held = held?;
        if self.archive.contains(&held) {
            self.archive.retain(|other| *other != held);
            self.archive.push(id.to_string());
        }
        Some(held)
    }

    fn take_archive_place(&mut self, id: &str) {
        let has_place = |archive: &[String]| archive.iter().any(|other| other == id);
        if self.archive.len() < self.options.archive_size {
            if !has_place(&self.archive) {
                self.archive.push(id.to_string());
            }
            return;
        }
        let members: BTreeSet<&str> = self.members.iter().map(|member| member.id.as_str()).collect();
        self.archive.retain(|other| members.contains(other.as_str()));
        let worst = self.archive.iter().min_by(|a, b| self.fitness(a).total_cmp(&self.fitness(b))).cloned();
        if let Some(worst) = worst.filter(|worst| self.fitness(id) > self.fitness(worst)) {
            // A program that holds a place already takes no second one: the archive shrinks then, as OpenEvolve's does.
            self.archive.retain(|other| *other != worst);
            if !has_place(&self.archive) {
                self.archive.push(id.to_string());
            }
        }
    }

    /// Notes a program that beats the best so far. Any program beats one that is gone, which has no fitness.
    fn note_best(&mut self, id: &str, island: usize) {
        let beaten = |best: &String| self.fitness(id) > self.fitness(best);
        let (of_all, of_island) =
            (self.best.as_ref().is_none_or(beaten), self.island_best[island].as_ref().is_none_or(beaten));
        if of_all {
            self.best = Some(id.to_string());
        }
        if of_island {
            self.island_best[island] = Some(id.to_string());
        }
    }

    fn best_of(&self, island: usize) -> Option<String> {
        self.ranked(island).first().map(|member| member.id.clone())
    }

    fn owns_cell(&self, id: &str) -> bool {
        self.cells.iter().any(|cells| cells.values().any(|held| held == id))
    }

    fn forget(&mut self, id: &str) {
        self.members.retain(|member| member.id != id);
        self.islands.iter_mut().for_each(|island| island.retain(|other| other != id));
        self.cells.iter_mut().for_each(|cells| cells.retain(|_, held| held != id));
        self.archive.retain(|other| other != id);
    }

    /// The cap: the worst without a cell go first, then the worst with one; neither the best nor the newcomer.
    fn keep_to_size(&mut self, newcomer: &str) {
        let excess = self.members.len().saturating_sub(self.options.population_size);
        if excess == 0 {
            return;
        }
        let mut ranked: Vec<&Member> = self.members.iter().collect();
        ranked.sort_by(|a, b| a.fitness.total_cmp(&b.fitness));
        let spared = |id: &str| id == newcomer || self.best.as_deref() == Some(id);
        let ids = ranked.into_iter().map(|member| member.id.clone()).filter(|id| !spared(id));
        let (holding, free): (Vec<String>, Vec<String>) = ids.partition(|id| self.owns_cell(id));
        for id in free.into_iter().chain(holding).take(excess) {
            self.forget(&id);
        }
        for island in 0..self.islands.len() {
            if self.island_best[island].as_ref().is_some_and(|best| self.member(best).is_none()) {
                self.island_best[island] = self.best_of(island);
            }
        }
    }

    /// The best of each island are copied to both neighbours on the ring, unless they came that way themselves or the
    /// neighbour has the same text.
    fn migrate(&mut self, draw: &mut dyn FnMut() -> f64) {
        let islands = self.islands.len();
        for island in 0..islands {
            let ranked: Vec<Member> = self.ranked(island).into_iter().cloned().collect();
            let leaving = ((ranked.len() as f64 * self.options.migration_rate) as usize).max(1);
            for migrant in ranked.into_iter().take(leaving).filter(|migrant| migrant.copy_of.is_none()) {
                for target in [(island + 1) % islands, (island + islands - 1) % islands] {
                    if self.on_island(target).iter().any(|member| member.code == migrant.code) {
                        continue;
                    }
                    let id = format!("m{:04}", self.copies);
                    self.copies += 1;
                    let copy = Member { id, copy_of: Some(migrant.id.clone()), ..migrant.clone() };
                    self.add(copy, target, draw);
                }
            }
        }
    }
}

/// A place in the grid as the cells are kept under.
pub(super) fn key(cell: &[usize]) -> String {
    cell.iter().map(usize::to_string).collect::<Vec<String>>().join("-")
}
