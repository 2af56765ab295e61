//! Small suites and results for tests.

use super::*;
use crate::kernel::Digest;
use crate::objects::{FamilyName, SolutionId};
use crate::scene::Pool;
use crate::scene::fixture::two_lane_scene;
use crate::sim::{self, ContactClass, End, Fault, Intervention, SimulatorOptions};

/// Ends of scenes.
pub const ARRIVED: usize = 0;
pub const CRASHED: usize = 1;
pub const CAUSED: usize = 2;
pub const OFF_ROAD: usize = 3;
pub const STOOD: usize = 4;
pub const FAULT: usize = 5;
pub const UNPLAYABLE: usize = 6;

/// One scene, in which nobody is moved.
pub fn suite() -> Suite {
    let scene = two_lane_scene();
    let plant = sim::Plant::new(&scene).unwrap();
    let label = sim::rollout(&plant, &Intervention::default(), &mut crate::learn::Stopped).unwrap();
    let case = Case {
        id: format!("plain:{}", scene.id),
        scene: scene.id.clone(),
        family: PLAIN.into(),
        program: None,
        rules: 0,
        cluster: "highway".into(),
        intervention: Intervention::default(),
        label,
        around: None,
    };
    let member = Member {
        name: SolutionId::new("cat/parent"),
        family: FamilyName::new("cat"),
        program: Digest::of_bytes(b"program"),
        seed: 1,
        origins: Vec::new(),
    };
    Suite {
        name: "small".into(),
        planned_around: DriverMark { name: "standing".into(), digest: Digest::of_bytes(b"standing") },
        around: Vec::new(),
        simulator: sim::SIM_VERSION,
        seed: 1,
        rules: vec![SimulatorOptions::SHIPPED],
        programs: vec![member],
        sizes: Sizes {
            per_family: 1,
            plain_share: 0.5,
            preventable_only: false,
            min_realism: None,
            classes: Vec::new(),
        },
        thresholds: Thresholds::default(),
        licences: vec![Licence { source: "fixture".into(), scenes: 1, terms: "any".into() }],
        cases: vec![case],
        pool: Pool::new(vec![scene], Vec::new()).unwrap(),
    }
}

/// A result in a suite of scenes `s0`, `s1`, ..., with these ends.
pub fn result(driver: &str, ends: &[usize]) -> SuiteResult {
    let drive = |end, completion, contact| {
        CaseOutcome::Driven(Drive { end, completion, steps: 80, contact, trace: Digest::of_bytes(b"trace") })
    };
    let met = |class, avoidable, fault| {
        Some(Met { class, adversary: true, avoidable, fault, jury: None, time_s: 3.5, relative_speed_mps: 6.0 })
    };
    let came = |end: usize| match end {
        ARRIVED => drive(End::Arrived, 1.0, None),
        CRASHED => drive(End::Contact, 0.5, met(ContactClass::HeadOn, Some(false), Some(Fault::ActiveFront))),
        CAUSED => drive(End::Contact, 0.5, met(ContactClass::CutIn, Some(true), Some(Fault::ActiveLateral))),
        OFF_ROAD => drive(End::OffRoad, 0.5, None),
        STOOD => drive(End::Horizon, 0.05, None),
        FAULT => CaseOutcome::Fault { kind: FaultKind::TooSlow, reason: "planner `p`: no answer within 1 s".into() },
        _ => CaseOutcome::Unplayable { reason: "no recorded drive".into() },
    };
    let played = |(k, end): (usize, &usize)| Played {
        case: format!("cat:s{k}"),
        scene: format!("s{k}"),
        family: "cat".into(),
        cluster: ["junction", "highway"][k % 2].into(),
        class: "none".into(),
        came: came(*end),
        realism: None,
        timeline: None,
    };
    SuiteResult {
        format: RESULT_FORMAT.into(),
        suite: SuiteMark { name: "small".into(), digest: Digest::of_bytes(b"suite") },
        driver: DriverMark { name: driver.into(), digest: Digest::of_bytes(driver.as_bytes()) },
        simulator: sim::SIM_VERSION,
        selection: Some(Selected::default()),
        recordings: Vec::new(),
        seal: None,
        cases: ends.iter().enumerate().map(played).collect(),
    }
}
