//! The replay buffer: whole episodes, one row a state, so that a state is kept once although it ends one transition and
//! begins the next.

use crate::ego::observation::ACTION;
use crate::kernel::Stream;

use super::sac::Batch;

/// The rows of one rollout: one more state than actions.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Episode {
    /// Observations, one behind the other.
    pub observations: Vec<f32>,
    pub actions: Vec<[f32; ACTION]>,
    pub rewards: Vec<f32>,
    /// True if nothing follows the last state; a time limit is no end.
    pub is_terminal: bool,
}

/// States of past episodes in a ring; the oldest are overwritten.
#[derive(Clone, Debug, PartialEq)]
pub struct Memory {
    /// Numbers in an observation.
    pub width: usize,
    /// Most rows that it holds.
    pub capacity: usize,
    /// Row that is written next, once it is full.
    pub next: usize,
    pub observations: Vec<f32>,
    /// The action in a row's state, its reward, and 1 where nothing follows the next row.
    pub actions: Vec<f32>,
    pub rewards: Vec<f32>,
    pub terminals: Vec<f32>,
    /// 1 where a row is an episode's last state, so that it has no action.
    pub lasts: Vec<f32>,
}

impl Memory {
    /// Makes an empty memory for observations of this length.
    pub fn new(width: usize, capacity: usize) -> Memory {
        Memory {
            width,
            capacity,
            next: 0,
            observations: Vec::new(),
            actions: Vec::new(),
            rewards: Vec::new(),
            terminals: Vec::new(),
            lasts: Vec::new(),
        }
    }

    /// Returns the number of rows that it holds.
    pub fn len(&self) -> usize {
        self.rewards.len()
    }

    /// Returns `true` if it holds nothing.
    pub fn is_empty(&self) -> bool {
        self.rewards.is_empty()
    }

    /// Makes `rows` empty rows, to be filled from a checkpoint.
    pub fn make_room(&mut self, rows: usize, next: usize) {
        self.next = next;
        self.observations = vec![0.0; rows * self.width];
        self.actions = vec![0.0; rows * ACTION];
        (self.rewards, self.terminals, self.lasts) = (vec![0.0; rows], vec![0.0; rows], vec![0.0; rows]);
    }

    /// Adds an episode.
    pub fn push(&mut self, episode: &Episode) {
        let count = episode.actions.len();
        for (i, state) in episode.observations.chunks_exact(self.width).enumerate() {
            let is_last = i >= count;
            let ends = i + 1 == count && episode.is_terminal;
            let action = episode.actions.get(i).copied().unwrap_or_default();
            let reward = episode.rewards.get(i).copied().unwrap_or_default();
            self.put(state, action, reward, [ends, is_last].map(|is| if is { 1.0 } else { 0.0 }));
        }
    }

    fn put(&mut self, state: &[f32], action: [f32; ACTION], reward: f32, [ends, is_last]: [f32; 2]) {
        if self.len() < self.capacity {
            self.observations.extend_from_slice(state);
            self.actions.extend(action);
            self.rewards.push(reward);
            self.terminals.push(ends);
            self.lasts.push(is_last);
            return;
        }
        let row = self.next;
        self.observations[row * self.width..][..self.width].copy_from_slice(state);
        self.actions[row * ACTION..][..ACTION].copy_from_slice(&action);
        (self.rewards[row], self.terminals[row], self.lasts[row]) = (reward, ends, is_last);
        self.next = (row + 1) % self.capacity;
    }

    /// Draws `count` transitions, all equally likely, with the noise of an update. The memory must hold a transition.
    pub fn sample(&self, count: usize, stream: &mut Stream, batch: &mut Batch) {
        *batch = Batch::default();
        let state = |row: usize| &self.observations[row * self.width..][..self.width];
        for _ in 0..count {
            let row = self.drawn(stream);
            batch.observations.extend_from_slice(state(row));
            batch.next_observations.extend_from_slice(state((row + 1) % self.len()));
            batch.actions.extend_from_slice(&self.actions[row * ACTION..][..ACTION]);
            batch.rewards.push(self.rewards[row]);
            batch.terminals.push(self.terminals[row]);
        }
        let mut noise = || (0..count * ACTION).map(|_| stream.normal(0.0, 1.0) as f32).collect();
        (batch.noise, batch.next_noise) = (noise(), noise());
    }

    /// Draws a row that has an action. Its next row is the next state: an episode is written whole, and its last row
    /// is a last one, so no transition reaches over the place that is written next.
    fn drawn(&self, stream: &mut Stream) -> usize {
        loop {
            let row = stream.below(self.len());
            if self.lasts[row] == 0.0 {
                return row;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernel::Seed;

    /// Makes an episode whose observations hold its number and the state's.
    fn episode(number: usize, steps: usize, is_terminal: bool) -> Episode {
        Episode {
            observations: (0..=steps).flat_map(|i| [number as f32, i as f32]).collect(),
            actions: (0..steps).map(|i| [i as f32, 0.5]).collect(),
            rewards: (0..steps).map(|i| i as f32).collect(),
            is_terminal,
        }
    }

    #[test]
    fn every_drawn_transition_is_a_step_of_one_episode() {
        let mut memory = Memory::new(2, 23);
        for number in 0..9 {
            memory.push(&episode(number, 3 + number % 3, number.is_multiple_of(2)));
        }
        assert_eq!(memory.len(), 23, "full");
        let mut batch = Batch::default();
        memory.sample(500, &mut Seed(1).stream(&["memory"]), &mut batch);
        let mut ends = 0;
        for i in 0..500 {
            let (now, next) = (&batch.observations[2 * i..][..2], &batch.next_observations[2 * i..][..2]);
            assert_eq!(now[0], next[0], "one episode");
            assert_eq!(now[1] + 1.0, next[1], "one step");
            assert_eq!((batch.actions[2 * i], batch.rewards[i]), (now[1], now[1]));
            let number = now[0] as usize;
            let is_end = number.is_multiple_of(2) && next[1] as usize == 3 + number % 3;
            assert_eq!(batch.terminals[i] == 1.0, is_end, "a time limit is no end");
            ends += usize::from(is_end);
        }
        assert!(ends > 0 && batch.observations.iter().step_by(2).all(|&number| number >= 3.0), "the oldest are gone");
    }
}
