//! What a driver of one's own is shown: which observation, and how many moments of it.

use crate::ego::{Arrays, Setting, observation};
use crate::sim::View;

/// Kind of observation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Kind {
    /// The numbers of a learned ego's setting.
    Setting(Setting),
    /// Those of `metadrive-1` with another number of road users that are described one by one.
    Neighbours(usize),
    /// Arrays of road users, lanes and route, for encoders of one's own. Actions are `metadrive-1`'s.
    Arrays(Arrays),
}

/// An observation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seeing {
    pub kind: Kind,
    /// Number of moments, of which the newest stands last; 1 or more.
    pub stack: usize,
}

impl From<Setting> for Seeing {
    fn from(setting: Setting) -> Seeing {
        Seeing { kind: Kind::Setting(setting), stack: 1 }
    }
}

impl Seeing {
    /// Returns the number of values in an observation.
    pub fn length(&self) -> usize {
        let of_one = match self.kind {
            Kind::Setting(setting) => setting.length(),
            Kind::Neighbours(count) => observation::length(count),
            Kind::Arrays(arrays) => arrays.length(),
        };
        of_one * self.stack
    }

    /// Returns the lowest and highest value of each number of one moment.
    pub fn bounds(&self) -> Vec<(f32, f32)> {
        match self.kind {
            Kind::Setting(setting) => setting.bounds(),
            Kind::Neighbours(count) => observation::bounds(count),
            Kind::Arrays(arrays) => arrays.bounds(),
        }
    }

    /// Returns the setting that gives an action its meaning.
    pub fn setting(&self) -> Setting {
        match self.kind {
            Kind::Setting(setting) => setting,
            Kind::Neighbours(_) | Kind::Arrays(_) => Setting::Metadrive1,
        }
    }

    /// Puts one moment in place of what `out` holds.
    fn observe(&self, view: &View<'_>, out: &mut Vec<f32>) {
        match self.kind {
            Kind::Setting(setting) => setting.observe(view, out),
            Kind::Neighbours(count) => observation::observe(view, count, out),
            Kind::Arrays(arrays) => arrays.observe(view, out),
        }
    }
}

/// The newest moments of an episode.
#[derive(Clone, Debug, Default)]
pub struct Frames {
    values: Vec<f32>,
    /// Decisions before the moment that was seen last.
    decisions: Option<usize>,
    spare: Vec<f32>,
}

impl Frames {
    /// Begins another episode: its first moment stands for those before it, too.
    pub fn clear(&mut self) {
        self.decisions = None;
    }

    /// Returns the observation after so many decisions of the episode, of which every one has to be seen where several moments are stacked.
    /// Who asks again before the next decision gets the same.
    pub fn seen(&mut self, seeing: &Seeing, view: &View<'_>, decisions: usize) -> &[f32] {
        if self.decisions == Some(decisions) {
            return &self.values;
        }
        let is_first = self.decisions.replace(decisions).is_none();
        if seeing.stack == 1 {
            seeing.observe(view, &mut self.values);
            return &self.values;
        }
        seeing.observe(view, &mut self.spare);
        if is_first {
            self.values.clear();
            (0..seeing.stack).for_each(|_| self.values.extend_from_slice(&self.spare));
        } else {
            self.values.drain(..self.spare.len());
            self.values.extend_from_slice(&self.spare);
        }
        &self.values
    }
}
