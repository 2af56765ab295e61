//! The numbers that a fleet hands out, one row a place. They are allocated once and never move, so that readers from
//! outside need no copy.

use serde::{Deserialize, Serialize};

use crate::ego::observation::ACTION;
use crate::learn::reward::Step;

/// Facts of the episode that a step belonged to. Codes that name nothing are -1.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Reports {
    /// Number of its scene, as its task says.
    pub scene: Vec<i32>,
    /// Index of its program among the sets.
    pub program: Vec<i32>,
    /// [`End`](crate::sim::End) as a number; -1 while it goes on.
    pub end: Vec<i8>,
    /// [`ContactClass`](crate::sim::ContactClass) as a number; -1 without a contact.
    pub contact_class: Vec<i8>,
    /// 1 if the contact was with an adversary.
    pub adversary: Vec<u8>,
    /// 1 if a careful ego would have prevented the contact with an adversary; -1 where that was not asked, or there is none.
    pub preventable: Vec<i8>,
    /// Share of the route driven.
    pub route_completion: Vec<f32>,
    /// Number of steps.
    pub length: Vec<i32>,
    /// Sum of its rewards.
    pub sum: Vec<f64>,
}

/// All numbers of a fleet.
#[derive(Clone, Debug)]
pub struct Sheets {
    /// Actions of the next step: two numbers a place.
    pub actions: Vec<f32>,
    /// Two sheets, written in turn: what a step returned stays as it is during the next one.
    pub observations: [Vec<f32>; 2],
    /// The last observation of episodes that ended with the last step.
    pub final_observations: Vec<f32>,
    pub rewards: Vec<f64>,
    /// 1 if the episode ended: contact, beside the road, or arrived.
    pub terminated: Vec<u8>,
    /// 1 if the scene's time is over, which is no end.
    pub truncated: Vec<u8>,
    pub reports: Reports,
    /// [`Step::numbers`] of the last step.
    pub steps: Vec<f64>,
    /// Scene and program of the episode that goes on behind the step.
    pub now_scene: Vec<i32>,
    pub now_program: Vec<i32>,
}

impl Sheets {
    /// Makes room for so many places with observations of so many numbers.
    pub fn new(places: usize, length: usize) -> Sheets {
        let reports = Reports {
            scene: vec![-1; places],
            program: vec![-1; places],
            end: vec![-1; places],
            contact_class: vec![-1; places],
            adversary: vec![0; places],
            preventable: vec![-1; places],
            route_completion: vec![0.0; places],
            length: vec![0; places],
            sum: vec![0.0; places],
        };
        Sheets {
            actions: vec![0.0; places * ACTION],
            observations: [vec![0.0; places * length], vec![0.0; places * length]],
            final_observations: vec![0.0; places * length],
            rewards: vec![0.0; places],
            terminated: vec![0; places],
            truncated: vec![0; places],
            reports,
            steps: vec![0.0; places * Step::NAMES.len()],
            now_scene: vec![-1; places],
            now_program: vec![-1; places],
        }
    }
}
