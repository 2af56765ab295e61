//! The ego's motion by scene step, as one of its rollouts left it.

use crate::kernel::OrientedBox;
use crate::scene::{Sample, Scene};

/// The ego's motion by scene step, with its size.
#[derive(Clone, Debug)]
pub struct EgoPath {
    from_step: usize,
    samples: Vec<Sample>,
    boxes: Vec<OrientedBox>,
    pub length_m: f64,
    pub width_m: f64,
}

impl EgoPath {
    /// `samples[k]` lies at scene step `from_step + k`.
    pub fn new(scene: &Scene, from_step: usize, samples: Vec<Sample>) -> EgoPath {
        let (length_m, width_m) = (scene.ego.track.length_m, scene.ego.track.width_m);
        let boxes = samples.iter().map(|s| OrientedBox::new(s.position, s.heading_rad, length_m, width_m)).collect();
        EgoPath { from_step, samples, boxes, length_m, width_m }
    }

    /// Returns the ego's sample at a scene step; `None` before its start and after its rollout ended.
    pub fn at(&self, step: usize) -> Option<&Sample> {
        self.samples.get(step.checked_sub(self.from_step)?)
    }

    /// Its bounding box at a scene step.
    pub fn body(&self, step: usize) -> Option<&OrientedBox> {
        self.boxes.get(step.checked_sub(self.from_step)?)
    }

    /// The steps at which it is known.
    pub fn steps(&self) -> std::ops::Range<usize> {
        self.from_step..self.from_step + self.samples.len()
    }
}
