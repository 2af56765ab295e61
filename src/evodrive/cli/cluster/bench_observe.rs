//! Cost of observing: rollouts of an ego that also makes the observation of a learned ego at every step.

use crate::ego::{Policy, Setting};
use crate::sim::{Control, Driver, Plant, View};

/// Drives as another driver does, and observes.
pub struct Observer {
    inner: Box<dyn Driver>,
    setting: Setting,
    values: Vec<f32>,
}

impl Observer {
    pub fn new(ego: &Policy, setting: Setting) -> Observer {
        Observer { inner: ego.driver(), setting, values: Vec::new() }
    }
}

impl Driver for Observer {
    fn begin(&mut self, plant: &Plant) {
        self.inner.begin(plant);
    }

    fn decide(&mut self, view: &View<'_>) -> Control {
        self.setting.observe(view, &mut self.values);
        std::hint::black_box(&self.values);
        self.inner.decide(view)
    }
}

/// Seconds of rollouts with the observation of a setting, and without any.
pub struct Cost {
    pub setting: Setting,
    pub seconds: f64,
    pub plain_seconds: f64,
    /// Decision steps that these seconds took, on all threads together.
    pub steps: u64,
    pub threads: usize,
}

impl Cost {
    pub fn us_per_step(&self) -> f64 {
        1e6 * (self.seconds - self.plain_seconds) * self.threads as f64 / self.steps.max(1) as f64
    }

    pub fn text(&self) -> String {
        format!(
            "observing {} ({} numbers): {:.1} us per step and thread; {:.0} steps/s instead of {:.0}\n",
            self.setting.name(),
            self.setting.length(),
            self.us_per_step(),
            self.steps as f64 / self.seconds,
            self.steps as f64 / self.plain_seconds
        )
    }
}
