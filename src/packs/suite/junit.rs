//! A result as a JUnit file, which CI servers show: a test suite per family, a test case per scene, and one per rule. It keeps to the two
//! schemas that are in use: Apache Ant's (windyroad `JUnit.xsd`) and that of Jenkins' xUnit plugin (`junit-10.xsd`).
//!
//! A contact or a way off the route is a failure, a planner without an answer an error, a scene that cannot be played is skipped. The
//! time is that of the drive, in seconds of the scene, and the time stamp is fixed: the same result gives the same file.

use std::collections::BTreeSet;
use std::fmt::Write as _;

use super::failures::kind_of;
use super::result::{CaseOutcome, Played, SuiteResult};
use super::thresholds::RuleResult;
use crate::draw::escaped;
use crate::scene::DT_S;

/// Fixed time stamp of every file.
const TIMESTAMP: &str = "1970-01-01T00:00:00";

/// One test case.
struct Case {
    name: String,
    class: String,
    seconds: f64,
    /// Element, type and message of a case that is no pass.
    fault: Option<(&'static str, String, String)>,
    /// Events that led to the fault, where they are known.
    why: String,
    /// Command that shows the case.
    command: String,
}

/// The text of the file; `command` is the one that plays a scene.
pub fn junit(result: &SuiteResult, rules: &[RuleResult], command: &dyn Fn(&Played) -> String) -> String {
    let families: BTreeSet<&str> = result.cases.iter().map(|played| played.family.as_str()).collect();
    let mut text = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<testsuites>\n".to_string();
    let mut id = 0;
    for family in families {
        let own = result.cases.iter().filter(|played| played.family == family);
        let cases: Vec<Case> = own.map(|played| case(result, played, command(played))).collect();
        suite(&mut text, result, id, family, &cases);
        id += 1;
    }
    if !rules.is_empty() {
        let cases: Vec<Case> = rules.iter().map(|rule| of_rule(result, rule)).collect();
        suite(&mut text, result, id, "thresholds", &cases);
    }
    text.push_str("</testsuites>\n");
    text
}

fn case(result: &SuiteResult, played: &Played, command: String) -> Case {
    let fault = match &played.came {
        CaseOutcome::Driven(_) if played.passed() => None,
        CaseOutcome::Driven(drive) => {
            let kind = drive.contact.map_or("off_road", |met| met.class.name());
            Some(("failure", kind.to_string(), drive.in_words()))
        }
        CaseOutcome::Fault { kind, reason } => Some(("error", kind.name().to_string(), reason.clone())),
        CaseOutcome::Unplayable { reason } => Some(("skipped", String::new(), reason.clone())),
    };
    Case {
        name: played.case.clone(),
        class: format!("{}.{}.{}", result.suite.name, played.family, played.cluster),
        seconds: played.drive().map_or(0.0, |drive| drive.steps as f64 * DT_S),
        why: kind_of(played).into_iter().chain(played.why()).map(|line| format!("\n{line}")).collect(),
        fault,
        command,
    }
}

fn of_rule(result: &SuiteResult, rule: &RuleResult) -> Case {
    let message = || format!("expected {}, found {}", rule.expected, rule.found);
    Case {
        name: rule.rule.to_string(),
        class: format!("{}.thresholds", result.suite.name),
        seconds: 0.0,
        fault: (!rule.holds).then(|| ("failure", rule.rule.to_string(), message())),
        why: String::new(),
        command: rule.scenes.join("\n"),
    }
}

fn suite(text: &mut String, result: &SuiteResult, id: usize, name: &str, cases: &[Case]) {
    let count =
        |element: &str| cases.iter().filter(|case| case.fault.as_ref().is_some_and(|of| of.0 == element)).count();
    let seconds: f64 = cases.iter().map(|case| case.seconds).sum();
    let _ = writeln!(
        text,
        "<testsuite id=\"{id}\" package=\"{}\" name=\"{}\" timestamp=\"{TIMESTAMP}\" hostname=\"localhost\" tests=\"{}\" \
         failures=\"{}\" errors=\"{}\" skipped=\"{}\" time=\"{seconds:.1}\">",
        xml(&result.suite.name),
        xml(name),
        cases.len(),
        count("failure"),
        count("error"),
        count("skipped")
    );
    let properties = [
        ("driver", &result.driver.name),
        ("suite", &result.suite.digest.to_hex()),
        ("ego", &result.driver.digest.to_hex()),
    ];
    text.push_str("<properties>\n");
    for (name, value) in properties {
        let _ = writeln!(text, "<property name=\"{name}\" value=\"{}\"/>", xml(value));
    }
    text.push_str("</properties>\n");
    for case in cases {
        let _ = write!(
            text,
            "<testcase name=\"{}\" classname=\"{}\" time=\"{:.1}\"",
            xml(&case.name),
            xml(&case.class),
            case.seconds
        );
        let _ = match &case.fault {
            None => writeln!(text, "/>"),
            Some(("skipped", _, message)) => writeln!(text, "><skipped message=\"{}\"/></testcase>", xml(message)),
            Some((element, kind, message)) => writeln!(
                text,
                "><{element} type=\"{}\" message=\"{}\">{}{}\n{}</{element}></testcase>",
                xml(kind),
                xml(message),
                xml(message),
                xml(&case.why),
                xml(&case.command)
            ),
        };
    }
    let commands: Vec<&str> = cases.iter().map(|case| case.command.as_str()).filter(|text| !text.is_empty()).collect();
    let _ = writeln!(
        text,
        "<system-out>{}</system-out>\n<system-err></system-err>\n</testsuite>",
        xml(&commands.join("\n"))
    );
}

/// Text that may stand in XML: characters that no XML file can hold are shown by their numbers.
fn xml(text: &str) -> String {
    let fits = |c: char| matches!(c, '\t' | '\n' | '\r' | ' '..='\u{d7ff}' | '\u{e000}'..='\u{fffd}' | '\u{10000}'..);
    let shown: String =
        text.chars().map(|c| if fits(c) { c.to_string() } else { format!("\\u{{{:x}}}", c as u32) }).collect();
    escaped(&shown)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::suite::fixture::{ARRIVED, CRASHED, FAULT, OFF_ROAD, UNPLAYABLE, result};
    use crate::suite::{Thresholds, check_thresholds};

    fn file() -> String {
        let mut result = result("a<b>", &[ARRIVED, CRASHED, OFF_ROAD, FAULT, UNPLAYABLE]);
        if let CaseOutcome::Fault { reason, .. } = &mut result.cases[3].came {
            reason.push_str(" \u{1b}[31m <\"&> \u{0}");
        }
        result.cases[1].timeline = Some(crate::sim::Timeline {
            contact_s: 3.5,
            visible_s: Some(1.0),
            reaction: None,
            braked_mps2_max: 0.0,
            from: crate::sim::Side::Front,
            chances: Vec::new(),
        });
        let thresholds = Thresholds { max_crash_rate: Some(0.1), ..Thresholds::default() };
        let rules = check_thresholds(&result, &thresholds, None).unwrap();
        junit(&result, &rules, &|played| format!("evodrive suite play --scene '{}' && true", played.case))
    }

    /// Attributes of each opening tag of a name.
    fn tags<'t>(text: &'t str, name: &str) -> Vec<&'t str> {
        let open = format!("<{name}");
        let rest = text.split(open.as_str()).skip(1).filter(|rest| rest.starts_with([' ', '>', '/']));
        rest.map(|rest| rest.split('>').next().unwrap()).collect()
    }

    #[test]
    fn crashes_are_failures_faults_are_errors_and_what_cannot_be_played_is_skipped() {
        let text = file();
        let counts: Vec<usize> = ["testcase", "failure", "error", "skipped"].map(|tag| tags(&text, tag).len()).to_vec();
        assert_eq!(counts, [7, 4, 1, 1], "{text}");
        let why = "50 % of the route\nhead on, seen\nseen 2.5 s before the contact";
        assert!(text.contains(why), "{text}");
        let suites = tags(&text, "testsuite");
        assert_eq!(suites.len(), 2);
        assert!(suites[0].contains("tests=\"5\" failures=\"2\" errors=\"1\" skipped=\"1\""), "{}", suites[0]);
        assert!(suites[1].contains("name=\"thresholds\"") && suites[1].contains("failures=\"2\""), "{}", suites[1]);
        assert!(text.contains("evodrive suite play --scene 'cat:s1' &amp;&amp; true"), "{text}");
    }

    #[test]
    fn what_the_schemas_ask_for_is_there_and_nothing_that_xml_refuses() {
        let text = file();
        let asked = ["id=", "package=", "name=", "timestamp=", "hostname=", "tests=", "failures=", "errors=", "time="];
        for suite in tags(&text, "testsuite") {
            assert!(asked.iter().all(|attribute| suite.contains(&format!(" {attribute}\""))), "{suite}");
        }
        for case in tags(&text, "testcase") {
            assert!([" name=\"", " classname=\"", " time=\""].iter().all(|of| case.contains(of)), "{case}");
        }
        for suite in text.split("<testsuite ").skip(1) {
            let order = ["<properties>", "</properties>", "<testcase", "<system-out>", "<system-err>", "</testsuite>"];
            let places: Vec<usize> =
                order.iter().map(|tag| suite.find(tag).unwrap_or_else(|| panic!("{tag}"))).collect();
            assert!(places.is_sorted(), "{places:?}");
            assert!(suite.rfind("<testcase") < suite.find("<system-out>"));
        }
        assert!(text.chars().all(|c| !c.is_control() || c == '\n'), "{text:?}");
        assert!(text.contains("\\u{1b}[31m &lt;&quot;&amp;&gt; \\u{0}") && tags(&text, "b").is_empty());
    }
}
