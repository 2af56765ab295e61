//! Manoeuvres of the road users that a program drives in the scenes that it gains, measured in its rollouts and said in one sentence. The
//! structure of a program says how it decides; this says what comes of it, for somebody who reads no program.

use std::collections::BTreeMap;

use crate::kernel::num;
use crate::text::counted;

/// Manoeuvre of one road user before the ego touched it.
#[derive(Clone, Debug, PartialEq)]
pub struct Manoeuvre {
    /// Name that people call it by: a vehicle, an inserted cyclist.
    pub who: String,
    /// Place from which it came, when it left its recorded motion or was brought in.
    pub came: Approach,
    /// Mean speed from then on to the contact less the recorded one, m/s; `None` where nothing was recorded to the end.
    pub faster_mps: Option<f64>,
    /// Distance of the contact from its recorded path, metres; `None` of one that was brought in.
    pub aside_m: Option<f64>,
    /// Mean speed from then on to the contact, m/s.
    pub speed_mps: f64,
    /// Time from then on to the contact, seconds.
    pub lasts_s: f64,
}

/// Place of a road user, as the ego saw it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Approach {
    Behind,
    Beside,
    Ahead,
    Towards,
    Across,
}

impl Approach {
    /// Derives the place from positions and headings in one frame; `reach_m` is half of both lengths together.
    pub fn of(ahead_m: f64, turned_rad: f64, reach_m: f64) -> Approach {
        match turned_rad.abs().to_degrees() {
            turned if turned > 135.0 => Approach::Towards,
            turned if turned > 45.0 => Approach::Across,
            _ if ahead_m < -reach_m => Approach::Behind,
            _ if ahead_m > reach_m => Approach::Ahead,
            _ => Approach::Beside,
        }
    }

    fn says(self) -> &'static str {
        match self {
            Approach::Behind => "that was behind it",
            Approach::Beside => "that was beside it",
            Approach::Ahead => "that was ahead of it",
            Approach::Towards => "that came towards it",
            Approach::Across => "that came across",
        }
    }
}

/// The scenes that a program gains over its parent.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Gained {
    /// Number of scenes.
    pub scenes: usize,
    /// Manoeuvres in those that were looked at, drawn evenly.
    pub seen: Vec<Manoeuvre>,
}

/// Smallest difference from recorded motion that an onlooker notices: m/s and metres.
const FELT: f64 = 0.5;

impl Gained {
    /// Says what happens mostly; empty where nothing was looked at.
    pub fn says(&self) -> String {
        let mut kinds: BTreeMap<(&str, Approach), usize> = BTreeMap::new();
        for seen in &self.seen {
            *kinds.entry((&seen.who, seen.came)).or_default() += 1;
        }
        let mut kinds: Vec<((&str, Approach), usize)> = kinds.into_iter().collect();
        kinds.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
        let Some(((who, came), most)) = kinds.first() else { return String::new() };
        let first = kind(who, *came);
        let all = self.seen.len();
        let scenes = match (self.scenes, all) {
            (1, _) => "In the scene gained".to_string(),
            (scenes, all) if scenes == all => format!("In the {scenes} scenes gained"),
            (scenes, all) => format!("In {all} of the {} gained, taken at even steps,", counted(scenes, "scene")),
        };
        let met = match most {
            _ if all == 1 => format!("meets {first}"),
            most if *most == all => format!("always meets {first}"),
            most if 2 * most > all => format!("mostly meets {first} ({most} of {all})"),
            // None of them is the rule.
            most => {
                let second = kinds.get(1).map(|((who, came), count)| format!(" or {} ({count})", kind(who, *came)));
                format!("most often meets {first} ({most} of {all}){}", second.unwrap_or_default())
            }
        };
        let speeds = |sign: f64| -> Vec<f64> {
            self.seen.iter().filter_map(|of| of.faster_mps).map(|by| sign * by).filter(|by| *by >= FELT).collect()
        };
        let (faster, slower) = (speeds(1.0), speeds(-1.0));
        let aside: Vec<f64> = self.seen.iter().filter_map(|of| of.aside_m).filter(|by| *by >= FELT).collect();
        let (word, speeds) = if faster.len() >= slower.len() { ("faster", faster) } else { ("slower", slower) };
        let median = |values: &[f64], unit: &str| {
            let count = if values.len() == all { String::new() } else { format!(" ({})", values.len()) };
            format!("by {} {unit}{count}", num::fixed(num::quantile(values, 0.5).unwrap_or_default(), 1))
        };
        // What a third of them does is said.
        let often = |values: &[f64]| !values.is_empty() && 3 * values.len() >= all;
        let mut does = vec![met];
        if often(&speeds) {
            does.push(format!("which drives {word} than recorded {}", median(&speeds, "m/s")));
        }
        if often(&aside) {
            let which = if does.len() > 1 { "" } else { "which " };
            does.push(format!("{which}leaves its recorded path {}", median(&aside, "m")));
        }
        // Of somebody who was brought in nothing was recorded.
        if does.len() == 1 && self.seen.iter().all(|of| of.faster_mps.is_none()) {
            let speeds: Vec<f64> = self.seen.iter().map(|of| of.speed_mps).collect();
            let median = num::fixed(num::quantile(&speeds, 0.5).unwrap_or_default(), 1);
            does.push(format!("which moves at {median} m/s"));
        }
        let lasts: Vec<f64> = self.seen.iter().map(|of| of.lasts_s).collect();
        format!(
            "{scenes} the ego {}, beginning {} s before the contact{}",
            match &does[..] {
                [met, drives, leaves] => format!("{met}, {drives} and {leaves}"),
                other => other.join(", "),
            },
            num::fixed(num::quantile(&lasts, 0.5).unwrap_or_default(), 1),
            if all > 1 { " (medians)" } else { "" }
        )
    }
}

/// Names a road user and the place from which it came.
fn kind(who: &str, came: Approach) -> String {
    let article = if who.starts_with(['a', 'e', 'i', 'o', 'u']) { "an" } else { "a" };
    format!("{article} {who} {}", came.says())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen(who: &str, came: Approach, faster_mps: Option<f64>, aside_m: Option<f64>) -> Manoeuvre {
        Manoeuvre { who: who.into(), came, faster_mps, aside_m, speed_mps: 1.5, lasts_s: 2.5 }
    }

    #[test]
    fn a_sentence_says_what_most_do_and_counts_the_others_out() {
        let ram = |by: f64| seen("vehicle", Approach::Behind, Some(by), Some(0.1));
        let across = seen("cyclist", Approach::Across, None, Some(2.0));
        let says = |scenes: usize, seen: &[Manoeuvre]| Gained { scenes, seen: seen.to_vec() }.says();
        assert_eq!(says(0, &[]), "");
        assert_eq!(
            says(4, &[ram(2.0), ram(3.0), ram(4.0), across.clone()]),
            "In the 4 scenes gained the ego mostly meets a vehicle that was behind it (3 of 4), which drives faster than recorded by 3.0 m/s (3), \
             beginning 2.5 s before the contact (medians)"
        );
        assert_eq!(
            says(
                9,
                &[
                    seen("vehicle", Approach::Beside, Some(-2.0), Some(1.0)),
                    seen("vehicle", Approach::Beside, Some(-2.0), None)
                ]
            ),
            "In 2 of the 9 scenes gained, taken at even steps, the ego always meets a vehicle that was beside it, which drives slower than recorded by 2.0 m/s \
             and leaves its recorded path by 1.0 m (1), beginning 2.5 s before the contact (medians)"
        );
        let one = says(1, &[seen("inserted cyclist", Approach::Ahead, None, None)]);
        assert_eq!(
            one,
            "In the scene gained the ego meets an inserted cyclist that was ahead of it, which moves at 1.5 m/s, beginning 2.5 s before the contact"
        );
        let both = says(2, &[across.clone(), ram(0.1)]);
        assert!(
            both.contains(
                "most often meets a cyclist that came across (1 of 2) or a vehicle that was behind it (1), which leaves"
            ),
            "{both}"
        );
        // What fewer than a third do is not said.
        assert!(!says(4, &[ram(0.1), ram(0.1), ram(0.1), across]).contains("recorded"), "neither speed nor path");
    }

    #[test]
    fn where_somebody_came_from_is_seen_from_the_ego() {
        let quarter = std::f64::consts::FRAC_PI_2;
        let of = |ahead_m, turned_rad| Approach::of(ahead_m, turned_rad, 5.0);
        assert_eq!(
            [of(-12.0, 0.1), of(2.0, -0.2), of(12.0, 0.0)],
            [Approach::Behind, Approach::Beside, Approach::Ahead]
        );
        assert_eq!([of(12.0, 3.0), of(-12.0, -quarter)], [Approach::Towards, Approach::Across]);
    }
}
