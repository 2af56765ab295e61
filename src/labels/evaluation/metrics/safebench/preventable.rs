//! The stricter reading of SafeBench's runs, beside the published one in which every staged contact counts: only a contact that a careful
//! ego would have prevented is a collision, and motion that traffic does not show wins nothing. ARS weighs these too, but its floor of 0.8
//! leaves room for them. The paper has no such reading; it is ours.

use serde::{Deserialize, Serialize};

use crate::objects::benchmark::{Run, SafebenchRun};
use crate::scene::AgentKind;
use crate::sim::{AdversaryReport, Contact, ContactClass, Outcome};

/// Bounds of the stricter reading: the table `[evaluation.safebench.preventable]`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PreventableOptions {
    /// Farthest that anyone but a pedestrian may drive against a lane in a valid scene, metres.
    pub wrong_way_m_max: f64,
    /// Farthest that anyone but a pedestrian may move where rolling does not take them, metres within 6 s; needs `simulator.of_kind`.
    pub unrolled_m_max: f64,
    /// Conditions for a contact with a body that stands in the ego's way to count; without them it counts like any other.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub standing: Option<StandingOptions>,
}

/// The fence around bodies that stand: the table `[evaluation.safebench.preventable.standing]`. The cheapest way to meet an ego that does
/// not see a body, or cannot brake, is to leave one on its way; a careful driver would stop, so that every such contact is preventable.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StandingOptions {
    /// Least time for which the ego must have seen the body that stands, s: the careful driver's time to stop.
    pub visible_s_min: f64,
    /// Least top speed of anybody whom the ego meets, m/s: a body that never moved in earnest did not come there by its script.
    pub speed_mps_min: f64,
}

impl StandingOptions {
    /// Returns `true` if a contact with an adversary passes the fence. A body that crept all the way is treated as one that stands.
    fn lets_count(&self, contact: &Contact, outcome: &Outcome) -> bool {
        let reports = outcome.adversaries.iter().filter(|report| report.actor == contact.with);
        let came = reports.into_iter().any(|report| report.motion.speed_mps_max >= self.speed_mps_min);
        let seen = contact.visible_s.is_some_and(|visible_s| visible_s >= self.visible_s_min);
        came && (contact.class != ContactClass::StationaryHit || seen)
    }
}

impl PreventableOptions {
    /// The name of the first bound that defines no reading, and what it must be.
    pub(super) fn fault(&self) -> Option<(&'static str, &'static str)> {
        let own = [
            ("preventable.wrong_way_m_max", self.wrong_way_m_max),
            ("preventable.unrolled_m_max", self.unrolled_m_max),
        ];
        let standing = self.standing.map(|of| {
            [
                ("preventable.standing.visible_s_min", of.visible_s_min),
                ("preventable.standing.speed_mps_min", of.speed_mps_min),
            ]
        });
        let all = own.into_iter().chain(standing.into_iter().flatten());
        let offending = { all }.find(|(_, x)| !(x.is_finite() && *x >= 0.0));
        offending.map(|(name, _)| (name, "a number not below 0"))
    }

    /// Returns the published labels of a run under this reading. A contact that does not count still ends the run: the ego is scored
    /// until then, and its route counts as completed, so that the overall score does not fall by it.
    pub(in crate::evaluation) fn read(&self, outcome: &Outcome, published: SafebenchRun) -> SafebenchRun {
        let SafebenchRun { mut run, mut realism, search_rollouts } = published;
        let staged = outcome.contact.filter(|contact| contact.adversary);
        let passes = |contact: &Contact| self.standing.is_none_or(|fence| fence.lets_count(contact, outcome));
        let counts = |contact: Contact| contact.preventable() == Some(true) && passes(&contact);
        if staged.is_some_and(|contact| !counts(contact)) {
            run = Run { collision: false, completion: 1.0, completed_s: None, ..run };
        }
        realism.valid &= outcome.adversaries.iter().all(|report| self.holds(report));
        SafebenchRun { run, realism, search_rollouts }
    }

    fn holds(&self, report: &AdversaryReport) -> bool {
        // A pedestrian has neither wheels nor a lane; a standing body has no way of its own that it could take.
        if report.kind == AgentKind::Pedestrian {
            return true;
        }
        let unrolled_m = report.of_kind.map_or(0.0, |of| of.simulated.unrolled_m);
        report.simulated.wrong_way_m <= self.wrong_way_m_max && unrolled_m <= self.unrolled_m_max
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluation::metrics::safebench::SafebenchOptions;
    use crate::evaluation::metrics::safebench::ars::tests::{PUBLISHED, conduct, contact, outcome, report};
    use crate::evaluation::protocol::safebench::{point_of, safebench_run};
    use crate::sim::{OfKind, WithRecording};

    const STRICTER: SafebenchOptions = SafebenchOptions {
        preventable: Some(PreventableOptions { wrong_way_m_max: 10.0, unrolled_m_max: 0.35, standing: None }),
        ..PUBLISHED
    };

    fn met(class: ContactClass, avoidable: Option<bool>) -> Outcome {
        let met = crate::sim::Contact { class, avoidable, adversary: true, ..contact(3.0) };
        Outcome { contact: Some(met), ..outcome(vec![(report(), conduct(AgentKind::Vehicle))]) }
    }

    #[test]
    fn only_what_a_careful_ego_would_have_prevented_is_a_collision_and_the_rest_costs_the_route_nothing() {
        for (class, avoidable, counts) in [
            (ContactClass::CutIn, Some(true), true),
            (ContactClass::StationaryHit, Some(true), true),
            (ContactClass::CutIn, Some(false), false),
            (ContactClass::Crossing, None, false),
            (ContactClass::RearEndEgoStruck, Some(true), false),
        ] {
            let outcome = met(class, avoidable);
            let published = safebench_run(&outcome, &PUBLISHED).unwrap();
            assert!(published.run.collision && published.run.completion == 0.5, "{class:?}");
            let stricter = safebench_run(&outcome, &STRICTER).unwrap();
            assert_eq!(stricter.run.collision, counts, "{class:?}, avoidable {avoidable:?}");
            assert_eq!(stricter.run.completion, if counts { 0.5 } else { 1.0 }, "{class:?}");
            assert_eq!(point_of(&stricter).0 > 0.0, counts, "{class:?}");
        }
    }

    /// The worked example of docs/OBJECTIVES.md.
    #[test]
    fn a_body_that_stands_counts_where_it_came_to_stand_and_was_seen_for_the_time_to_stop() {
        let fence = StandingOptions { visible_s_min: 2.5, speed_mps_min: 0.8 };
        let fenced = SafebenchOptions {
            preventable: STRICTER.preventable.map(|reading| PreventableOptions { standing: Some(fence), ..reading }),
            ..PUBLISHED
        };
        let counts = |options: &SafebenchOptions, class, visible_s, speed_mps_max| {
            let mut outcome = met(class, Some(true));
            outcome.contact.iter_mut().for_each(|contact| contact.visible_s = visible_s);
            for report in &mut outcome.adversaries {
                report.motion.speed_mps_max = speed_mps_max;
            }
            safebench_run(&outcome, options).unwrap().run.collision
        };
        for (class, visible_s, speed_mps_max, passes) in [
            (ContactClass::StationaryHit, Some(2.8), 2.5, true),
            (ContactClass::StationaryHit, Some(2.4), 2.5, false),
            (ContactClass::StationaryHit, None, 2.5, false),
            (ContactClass::StationaryHit, Some(2.8), 0.0, false),
            (ContactClass::Crossing, Some(1.3), 2.5, true),
            (ContactClass::Crossing, Some(2.9), 0.3, false),
        ] {
            let told = format!("{class:?} seen for {visible_s:?} s, once {speed_mps_max} m/s fast");
            assert!(counts(&STRICTER, class, visible_s, speed_mps_max), "without the fence: {told}");
            assert_eq!(counts(&fenced, class, visible_s, speed_mps_max), passes, "{told}");
        }
    }

    #[test]
    fn a_slide_or_a_way_against_traffic_makes_a_scene_invalid_but_of_someone_on_foot() {
        let valid = |kind, wrong_way_m, unrolled_m| {
            let simulated = OfKind { unrolled_m, speed_mps: 8.0 };
            let mut one = AdversaryReport { kind, ..report() };
            one.simulated.wrong_way_m = wrong_way_m;
            one.of_kind = Some(WithRecording { simulated, recorded: None });
            let of = |options| safebench_run(&outcome(vec![(one.clone(), conduct(kind))]), options).unwrap();
            assert!(of(&PUBLISHED).realism.valid);
            of(&STRICTER).realism.valid
        };
        assert!(valid(AgentKind::Vehicle, 10.0, 0.35));
        assert!(!valid(AgentKind::Vehicle, 10.1, 0.0) && !valid(AgentKind::Cyclist, 0.0, 0.36));
        assert!(
            valid(AgentKind::Static, 0.0, 0.35) && !valid(AgentKind::Static, 0.0, 0.36),
            "what stands may not slide"
        );
        assert!(valid(AgentKind::Pedestrian, 50.0, 9.0), "someone on foot has no wheels and no lane");
    }
}
