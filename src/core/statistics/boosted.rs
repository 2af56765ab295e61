//! Boosted regression trees of depth 3 for a squared error, grown level by level over presorted columns (Friedman, Greedy
//! function approximation). Nothing is drawn: each tree looks at every third column, in turn, so that trees differ.

use super::table::Table;
use crate::objects::{Boosted, Tree, TreeNode};

const DEPTH: usize = 3;
/// Least rows of a leaf.
const LEAF_ROWS_MIN: usize = 5;
/// Weight that pulls a leaf towards zero, in rows.
const SHRINKAGE_ROWS: f64 = 5.0;
/// A tree reads the columns whose place leaves the same remainder.
const COLUMNS_IN_TURN: usize = 3;

/// Trees for one target.
pub fn fit(table: &Table, target: &[f64], trees: u32, learning_rate: f64) -> Boosted {
    let intercept = table.mean(target);
    let mut left: Vec<f64> = target.iter().map(|value| value - intercept).collect();
    let orders: Vec<Vec<(u32, f64)>> = (0..table.columns).map(|column| order(table, column)).collect();
    let mut grown = Vec::new();
    for turn in 0..trees as usize {
        let tree = grow(table, &orders, &left, turn % COLUMNS_IN_TURN, learning_rate);
        for (left, row) in left.iter_mut().zip(&table.rows) {
            *left -= answer(&tree, row);
        }
        if tree.nodes.len() > 1 {
            grown.push(tree);
        }
    }
    Boosted { intercept, trees: grown }
}

/// Value of the trees at a standardised row.
pub fn value_at(model: &Boosted, row: &[f64]) -> f64 {
    model.trees.iter().fold(model.intercept, |sum, tree| sum + answer(tree, row))
}

/// Returns `true` if every question of a tree leads on to a later node, and reads a column that exists.
pub fn is_sound(tree: &Tree, columns: usize) -> bool {
    let n = tree.nodes.len();
    let sound = |(place, node): (usize, &TreeNode)| match *node {
        TreeNode::Split { column, low, high, .. } => {
            column < columns && low > place && high > place && low < n && high < n
        }
        TreeNode::Leaf { .. } => true,
    };
    n > 0 && tree.nodes.iter().enumerate().all(sound)
}

fn answer(tree: &Tree, row: &[f64]) -> f64 {
    let mut place = 0;
    loop {
        match tree.nodes.get(place) {
            Some(TreeNode::Split { column, bound, low, high }) => {
                place = if row.get(*column).is_some_and(|value| value <= bound) { *low } else { *high };
            }
            Some(TreeNode::Leaf { value }) => return *value,
            None => return 0.0,
        }
    }
}

/// Places of the rows by a column's value, each with the value: read again and again, so they lie side by side. Equal values
/// stand by their place. Empty for a column that does not vary.
fn order(table: &Table, column: usize) -> Vec<(u32, f64)> {
    let mut order: Vec<(u32, f64)> = (0..).zip(table.rows.iter().map(|row| row[column])).collect();
    order.sort_unstable_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)));
    let ends = order.first().zip(order.last());
    if ends.is_none_or(|(low, high)| low.1 == high.1) {
        return Vec::new();
    }
    order
}

/// Weight, weighted sum and rows of a set.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    weight: f64,
    sum: f64,
    rows: usize,
}

impl Sums {
    fn add(&mut self, weight: f64, value: f64) {
        self.weight += weight;
        self.sum += weight * value;
        self.rows += 1;
    }

    fn without(&self, other: &Sums) -> Sums {
        Sums { weight: self.weight - other.weight, sum: self.sum - other.sum, rows: self.rows - other.rows }
    }

    fn gain(&self) -> f64 {
        self.sum * self.sum / (self.weight + SHRINKAGE_ROWS)
    }
}

/// The best question of a node so far.
#[derive(Clone, Copy)]
struct Best {
    gain: f64,
    column: usize,
    bound: f64,
}

fn grow(table: &Table, orders: &[Vec<(u32, f64)>], left: &[f64], turn: usize, learning_rate: f64) -> Tree {
    let mut nodes = vec![TreeNode::Leaf { value: 0.0 }];
    let mut home = vec![0usize; left.len()];
    let mut level: Vec<usize> = vec![0];
    for _ in 0..DEPTH {
        let sums = sums_of(table, left, &home, nodes.len());
        let best = questions(table, orders, left, turn, &home, &sums);
        let mut next = Vec::new();
        for &node in &level {
            let Some(Best { column, bound, .. }) = best[node] else { continue };
            let (low, high) = (nodes.len(), nodes.len() + 1);
            nodes.extend([TreeNode::Leaf { value: 0.0 }; 2]);
            nodes[node] = TreeNode::Split { column, bound, low, high };
            for (home, row) in home.iter_mut().zip(&table.rows).filter(|(home, _)| **home == node) {
                *home = if row[column] <= bound { low } else { high };
            }
            next.extend([low, high]);
        }
        level = next;
    }
    let sums = sums_of(table, left, &home, nodes.len());
    for (node, sums) in nodes.iter_mut().zip(&sums) {
        if let TreeNode::Leaf { value } = node {
            *value = learning_rate * sums.sum / (sums.weight + SHRINKAGE_ROWS);
        }
    }
    Tree { nodes }
}

fn sums_of(table: &Table, left: &[f64], home: &[usize], nodes: usize) -> Vec<Sums> {
    let mut sums = vec![Sums::default(); nodes];
    for ((&home, &value), &weight) in home.iter().zip(left).zip(&table.weights) {
        sums[home].add(weight, value);
    }
    sums
}

/// For each node the question that explains most; `None` where none leaves enough rows on both sides.
fn questions(
    table: &Table,
    orders: &[Vec<(u32, f64)>],
    left: &[f64],
    turn: usize,
    home: &[usize],
    whole: &[Sums],
) -> Vec<Option<Best>> {
    let mut best: Vec<Option<Best>> = vec![None; whole.len()];
    // Data of a row for the questions, side by side.
    let rows: Vec<(usize, f64, f64)> =
        home.iter().zip(&table.weights).zip(left).map(|((&home, &weight), &left)| (home, weight, left)).collect();
    let gains: Vec<f64> = whole.iter().map(Sums::gain).collect();
    let mut below = vec![(Sums::default(), f64::NAN); whole.len()];
    for (column, order) in orders.iter().enumerate().filter(|(column, _)| column % COLUMNS_IN_TURN == turn) {
        below.fill((Sums::default(), f64::NAN));
        for &(row, value) in order {
            let (node, weight, left) = rows[row as usize];
            let (low, before) = &mut below[node];
            // Before the first row the value is NaN, and no comparison with it holds.
            if *before < value {
                let high = whole[node].without(low);
                if low.rows >= LEAF_ROWS_MIN && high.rows >= LEAF_ROWS_MIN {
                    let gain = low.gain() + high.gain() - gains[node];
                    if gain > best[node].map_or(1e-12, |best| best.gain) {
                        best[node] = Some(Best { gain, column, bound: 0.5 * (*before + value) });
                    }
                }
            }
            low.add(weight, left);
            *before = value;
        }
    }
    best
}
