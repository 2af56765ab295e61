//! Places of the recorded road users at each step: ordered by step, then x, then track, so that those near a place are
//! found by a search instead of a walk through everyone. Velocities and headings stay in the scene.

use std::sync::Arc;

use crate::kernel::Vec2;
use crate::scene::{DT_S, Sample, Scene, TrackIx};

use super::body::{Place, Size, coasting};

/// A track that is not there at a step.
pub(super) const NONE: u32 = u32::MAX;

/// All recorded samples of a scene from the first simulated step on. A row is one sample.
#[derive(Clone, Debug)]
pub(in crate::sim) struct Rows {
    scene: Arc<Scene>,
    /// `starts[k]..starts[k + 1]` are the rows of the k-th simulated step.
    pub starts: Vec<u32>,
    pub x: Vec<f64>,
    pub y: Vec<f64>,
    /// Radius of the box plus the way to the next sample, rounded up.
    pub reach: Vec<f32>,
    /// Unit heading vectors.
    pub axis: Vec<Vec2>,
    pub track: Vec<u32>,
    /// Largest reach of a step, metres.
    pub reach_max: Vec<f64>,
    /// Row of a track at a step, or [`NONE`]: `row_of[k * tracks + track]`.
    row_of: Vec<u32>,
    tracks: usize,
}

impl Rows {
    /// Makes the rows of a scene that was checked.
    pub fn new(scene: Arc<Scene>, sizes: &[Size]) -> Rows {
        let (first, steps, tracks) = (scene.ego.start_step, scene.steps, scene.tracks.len());
        let observed = |t: &crate::scene::Track| t.samples.iter().skip(first).flatten().count();
        // Exact, because a pool of prepared scenes is kept in memory.
        let count = scene.tracks.iter().map(observed).sum();
        let mut rows = Rows {
            starts: Vec::with_capacity(steps - first + 1),
            x: Vec::with_capacity(count),
            y: Vec::with_capacity(count),
            reach: Vec::new(),
            axis: Vec::with_capacity(count),
            track: Vec::with_capacity(count),
            reach_max: Vec::new(),
            row_of: vec![NONE; (steps - first) * tracks],
            tracks,
            scene: scene.clone(),
        };
        rows.starts.push(0);
        let mut present: Vec<(usize, &Sample)> = Vec::with_capacity(tracks);
        for (k, step) in (first..steps).enumerate() {
            present.clear();
            present.extend(scene.tracks.iter().enumerate().filter_map(|(i, track)| Some((i, track.at(step)?))));
            present.sort_by(|a, b| a.1.position.x.total_cmp(&b.1.position.x).then(a.0.cmp(&b.0)));
            for &(track, sample) in &present {
                rows.row_of[k * tracks + track] = rows.x.len() as u32;
                rows.x.push(sample.position.x);
                rows.y.push(sample.position.y);
                rows.axis.push(Vec2::from_heading(sample.heading_rad));
                rows.track.push(track as u32);
            }
            rows.starts.push(rows.x.len() as u32);
        }
        rows.measure_reach(sizes);
        rows
    }

    fn measure_reach(&mut self, sizes: &[Size]) {
        let mut reach = Vec::with_capacity(self.x.len());
        let mut reach_max = Vec::with_capacity(self.starts.len() - 1);
        for k in 0..self.starts.len() - 1 {
            let mut most = 0.0;
            for row in self.of_step(k) {
                let way = self.next_place(k, row).position.distance(self.place(row).position);
                // A little more than the exact bound, so that rounding to f32 can never cut a contact off.
                let bound = ((sizes[self.track[row] as usize].radius_m + way) * 1.000_001) as f32;
                reach.push(bound);
                most = f64::max(most, f64::from(bound));
            }
            reach_max.push(most);
        }
        (self.reach, self.reach_max) = (reach, reach_max);
    }

    pub fn place(&self, row: usize) -> Place {
        Place { position: Vec2::new(self.x[row], self.y[row]), axis: self.axis[row] }
    }

    /// Returns the sample behind a row of the k-th simulated step.
    pub fn sample(&self, k: usize, row: usize) -> &Sample {
        let track = &self.scene.tracks[self.track[row] as usize];
        let Some(sample) = track.at(self.scene.ego.start_step + k) else {
            unreachable!("a row is made of a sample of its step")
        };
        sample
    }

    pub fn of_step(&self, k: usize) -> std::ops::Range<usize> {
        match (self.starts.get(k), self.starts.get(k + 1)) {
            (Some(&from), Some(&to)) => from as usize..to as usize,
            _ => 0..0,
        }
    }

    /// Returns the rows of the k-th simulated step whose x lies within `radius_m` of `x`, in order.
    pub fn strip(&self, k: usize, x: f64, radius_m: f64) -> std::ops::Range<usize> {
        let all = self.of_step(k);
        let xs = &self.x[all.clone()];
        let from = xs.partition_point(|&at| at < x - radius_m);
        let count = xs[from..].iter().take_while(|&&at| at <= x + radius_m).count();
        all.start + from..all.start + from + count
    }

    /// Returns the row of a track at the k-th simulated step.
    pub fn find(&self, k: usize, track: TrackIx) -> Option<usize> {
        match self.row_of.get(k * self.tracks + track) {
            Some(&row) if track < self.tracks && row != NONE => Some(row as usize),
            _ => None,
        }
    }

    /// Returns the row of the same road user one step later.
    pub fn next(&self, k: usize, row: usize) -> Option<usize> {
        self.find(k + 1, self.track[row] as usize)
    }

    /// Returns the place at the k-th step's end of the recorded road user of a row: its next sample, or coasting if it
    /// has none.
    pub fn next_place(&self, k: usize, row: usize) -> Place {
        match self.next(k, row) {
            Some(next) => self.place(next),
            None => Place { position: coasting(self.sample(k, row), DT_S).position, axis: self.axis[row] },
        }
    }
}
