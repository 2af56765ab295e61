//! An experiment in the words of a caption: who simulates, where its scenes come from, and which contacts it counts as attacks.

use std::collections::BTreeSet;

use crate::evaluation::{AT_FAULT, AttackOptions, ContactClass, EvaluationOptions, RealismOptions};
use crate::evidence::Setting;
use crate::experiment::{Experiment, PlainContacts, SceneSource};
use crate::kernel::Digest;
use crate::objects::{AttackRequirement, RealismMean};

/// Returns what a caption says of the experiment.
pub fn of(experiment: &Experiment) -> Setting {
    let simulator = match &experiment.simulator.backend {
        None => "EvoDrive's own simulator".to_string(),
        Some(backend) => format!("{} {}", backend.name, backend.version),
    };
    let pool = match &experiment.scenes {
        SceneSource::Synth { .. } => "generated scenes",
        SceneSource::Safebench { .. } => "SafeBench's traffic families on generated roads",
        SceneSource::Files { .. } | SceneSource::Pool { .. } => "scenes of the experimenter's own",
    };
    let (reading, realism) = match &experiment.evaluation {
        EvaluationOptions::Metadrive(options) => (reading(&options.attack), realism(&options.realism)),
        EvaluationOptions::Safebench { .. } => ("collision rate times lost overall score".into(), String::new()),
    };
    let left_out = match experiment.split.plain_contacts {
        PlainContacts::Keep => String::new(),
        PlainContacts::Drop => "scenes in which an ego meets somebody although no program acts".into(),
    };
    Setting { simulator, pool: pool.into(), left_out, reading, realism }
}

/// Returns what realism is a mean of, and a name for its settings by which a reader sees whether two experiments mean the same.
fn realism(options: &RealismOptions) -> String {
    let count = options.weights().len();
    let over = match options.mean {
        RealismMean::Strict => "",
        RealismMean::Plain => " over all scenes",
        RealismMean::Sound => ", at most the share of scenes where none fails",
    };
    match Digest::of("evodrive/realism-options/1", options) {
        Ok(settings) => {
            format!("the weighted mean of {count} diagnostics of motion{over}, settings {}", settings.short(8))
        }
        Err(_) => format!("the weighted mean of {count} diagnostics of motion{over}"),
    }
}

/// Returns which contacts are attacks. The three readings that the tables set side by side have their own words; others are named by their classes.
fn reading(options: &AttackOptions) -> String {
    match options.when.as_ref().map(|when| when.text()) {
        Some(AT_FAULT) => return "contacts for which the ego is at fault by nuPlan's rule".into(),
        Some(_) => return "an expression of the experiment's own".into(),
        None => {}
    }
    let all: BTreeSet<ContactClass> = ContactClass::ALL.into_iter().collect();
    let preventable: BTreeSet<ContactClass> =
        ContactClass::ALL.into_iter().filter(|class| class.could_be_prevented(Some(true))).collect();
    let caused: BTreeSet<ContactClass> =
        [ContactClass::EgoStrikes, ContactClass::EgoSideswipes, ContactClass::StationaryHit].into_iter().collect();
    if !options.requires.is_unsaid() {
        let asked = [
            (AttackRequirement::Adversary, "with an adversary"),
            (AttackRequirement::Acts, "with somebody who acted"),
            (AttackRequirement::NotMetAnyway, "not met without the program"),
        ];
        let asked: Vec<&str> =
            asked.into_iter().filter(|(of, _)| options.requires.has(*of)).map(|(_, says)| says).collect();
        let classes = if options.counts == all { "every contact of the ego" } else { "contacts of the ego by class" };
        return [&[classes], asked.as_slice()].concat().join(", ");
    }
    let either = options.counts.union(&options.counts_if_avoidable).copied().collect::<BTreeSet<_>>();
    if options.counts == all {
        "every contact that the program brings about".into()
    } else if options.counts.is_empty() && options.counts_if_avoidable == preventable {
        "contacts that the ego could have prevented".into()
    } else if options.counts == caused && either == all {
        "contacts that the ego caused or could have avoided".into()
    } else {
        let names = |of: &BTreeSet<ContactClass>| of.iter().map(|class| class.name()).collect::<Vec<_>>().join(", ");
        match (options.counts.is_empty(), options.counts_if_avoidable.is_empty()) {
            (false, true) => format!("contacts of the classes {}", names(&options.counts)),
            (true, _) => format!("avoidable contacts of the classes {}", names(&options.counts_if_avoidable)),
            (false, false) => format!(
                "contacts of the classes {}; where avoidable, {}",
                names(&options.counts),
                names(&options.counts_if_avoidable)
            ),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn options(counts: &[ContactClass], if_avoidable: &[ContactClass]) -> AttackOptions {
        AttackOptions {
            counts: counts.iter().copied().collect(),
            counts_if_avoidable: if_avoidable.iter().copied().collect(),
            when: None,
            requires: Default::default(),
        }
    }

    #[test]
    fn each_reading_of_the_shipped_searches_has_its_words_and_any_other_its_classes() {
        let all = ContactClass::ALL;
        let no_rams: Vec<ContactClass> =
            all.into_iter().filter(|class| *class != ContactClass::RearEndEgoStruck).collect();
        let caused = [ContactClass::EgoStrikes, ContactClass::EgoSideswipes, ContactClass::StationaryHit];
        let others: Vec<ContactClass> = all.into_iter().filter(|class| !caused.contains(class)).collect();
        assert_eq!(reading(&options(&all, &[])), "every contact that the program brings about");
        assert_eq!(reading(&options(&[], &no_rams)), "contacts that the ego could have prevented");
        assert_eq!(reading(&options(&caused, &others)), "contacts that the ego caused or could have avoided");
        // Rams from behind that count where avoidable are another reading.
        assert!(reading(&options(&[], &all)).starts_with("avoidable contacts of the classes "));
        assert_eq!(reading(&options(&[ContactClass::CutIn], &[])), "contacts of the classes cut_in");
    }
    #[test]
    fn scenes_that_are_left_out_are_named() {
        let read = |set: &[String]| {
            let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("experiments/quickstart.toml");
            of(&Experiment::read_under(&path, set).unwrap()).left_out
        };
        assert_eq!(read(&[]), "");
        assert!(read(&["split.plain_contacts=drop".into()]).starts_with("scenes in which an ego meets somebody"));
    }
}
