//! Share of a program's gain that each of its edits carries: the same scenes without the edit, and with the edit alone.

use serde::{Deserialize, Serialize};

use super::aligned::Aligned;
use super::tables::{Compared, Drawn, Estimate, compared_labels};
use crate::kernel::num;
use crate::objects::{SceneScore, SolutionId};
use crate::text::counted;

/// A program against its parent, and its edits one by one.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Credit {
    pub program: SolutionId,
    pub parent: SolutionId,
    /// Scenes in which both have a label.
    pub scenes: usize,
    pub whole: Gain,
    /// Edits in the order of the chain.
    pub edits: Vec<EditCredit>,
}

/// Gain of one program over another, paired by scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Gain {
    pub attack: Estimate,
    /// Gain of realism over the scenes in which both act; `None` where there is no such scene.
    pub realism: Option<Estimate>,
    /// Scenes in which the two rollouts differ at all.
    pub differing: usize,
}

/// An edit, and what it is worth.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EditCredit {
    /// The attempt that proposed it; with the number of the operation where operations are taken one by one.
    pub name: String,
    /// Changes that it makes, one text an operation.
    pub what: Vec<String>,
    /// The parent with the edits up to this one against the parent: the way that the chain took. Absent in what an earlier version kept.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub so_far: Option<Result<Gain, String>>,
    /// The program against the program without this edit, or why there is no such program.
    pub taken_out: Result<Gain, String>,
    /// The parent with this edit alone against the parent, or why there is no such program.
    pub alone: Result<Gain, String>,
}

impl Gain {
    /// Compares the second labels with the first; `None` where no scene has labels of both. Scenes are drawn as asked, else by name.
    pub fn of(first: &[SceneScore], second: &[SceneScore], drawn: Option<&Drawn>) -> Option<Gain> {
        let rows = compared_labels(first, second, drawn);
        let of = |name: &str| rows.iter().find(|row| row.quantity == name);
        let attack = of("attack")?.difference;
        let differing = first
            .iter()
            .filter(|label| second.iter().any(|other| other.scene == label.scene && other.record != label.record));
        Some(Gain { attack, realism: of("realism").map(|row: &Compared| row.difference), differing: differing.count() })
    }

    /// Returns `true` if the interval of attack lies above zero.
    fn raises(&self) -> bool {
        self.attack.interval.is_some_and(|[low, _]| low > 0.0)
    }

    /// Says what holds of it at 95 %.
    pub fn verdict(&self) -> String {
        let of = |estimate: Estimate, name: &str| match estimate.interval {
            Some([low, _]) if low > 0.0 => Some(format!("raises {name}")),
            Some([_, high]) if high < 0.0 => Some(format!("lowers {name}")),
            _ => None,
        };
        let said = [of(self.attack, "attack"), self.realism.and_then(|realism| of(realism, "realism"))];
        match &said {
            _ if self.differing == 0 => "changes no rollout".into(),
            [None, None] => "not told apart from no effect".into(),
            _ => said.into_iter().flatten().collect::<Vec<_>>().join(", "),
        }
    }
}

impl Credit {
    /// The table in lines of at most `width` characters, then what it says in words.
    pub fn text(&self, width: usize) -> String {
        let heads = [
            "edit",
            "so far: attack",
            "realism",
            "needed: attack",
            "realism",
            "alone: attack",
            "realism",
            "taken out of the program",
        ];
        let cells = |gain: &Result<Gain, String>| match gain {
            Ok(gain) => [signed(gain.attack), gain.realism.map_or("-".into(), signed)],
            Err(_) => ["-".to_string(), "-".to_string()],
        };
        let none = Err(String::new());
        let row = |edit: &EditCredit| {
            let numbers = [edit.so_far.as_ref().unwrap_or(&none), &edit.taken_out, &edit.alone].map(cells);
            let verdict = match &edit.taken_out {
                Ok(gain) => gain.verdict(),
                Err(reason) => reason.clone(),
            };
            [edit.name.clone()].into_iter().chain(numbers.into_iter().flatten()).chain([verdict]).collect()
        };
        let table = Aligned {
            indent: 0,
            labels: 1,
            words: 1,
            heads: heads.map(String::from).to_vec(),
            rows: self.edits.iter().map(row).collect(),
        };
        let realism = self.whole.realism.map_or(String::new(), |realism| format!(", realism {}", signed(realism)));
        let mut text = format!(
            "{} against {} on {}: attack {}{realism}; {}\n\n{}\n",
            self.program,
            self.parent,
            counted(self.scenes, "held-out scene"),
            signed(self.whole.attack),
            self.whole.verdict(),
            table.text(width)
        );
        for edit in &self.edits {
            text.push_str(&format!("{}: {}\n", edit.name, edit.what.join("; ")));
        }
        text.push('\n');
        for edit in &self.edits {
            text.push_str(&format!("{}\n", self.sentence(edit)));
        }
        text.push_str(
            "so far: the parent with the edits up to this one minus the parent; needed: the program minus the program without this edit; alone: the parent with this edit minus the parent; \
             the shares of edits need not add up to the whole, because edits may need each other or do the same; \
             both paired by scene, in brackets 95 % bootstrap intervals over scenes; they hold for this one program, \
             and another seed of the search may give another\n",
        );
        text
    }

    /// Says what an edit accounts for.
    pub fn sentence(&self, edit: &EditCredit) -> String {
        let alone = match &edit.alone {
            Ok(gain) if gain.raises() => format!("; alone on the parent it raises attack by {}", signed(gain.attack)),
            _ => String::new(),
        };
        let needed = match &edit.taken_out {
            Ok(gain) if gain.differing == 0 => {
                format!("{} accounts for nothing: without it every rollout is the same", edit.name)
            }
            Ok(gain) => format!(
                "{} accounts for {} of {} attack{}",
                edit.name,
                num::signed(gain.attack.value, 3),
                num::signed(self.whole.attack.value, 3),
                if gain.raises() { "" } else { ", which these scenes do not tell apart from nothing or less" }
            ),
            Err(reason) => format!("{} cannot be taken out alone: {}", edit.name, in_short(reason)),
        };
        needed + &alone
    }
}

/// Returns the reason why there is no such program, without the place in it.
pub fn in_short(reason: &str) -> &str {
    reason.split(" (").next().unwrap_or(reason)
}

fn signed(of: Estimate) -> String {
    let number = |value| num::signed(value, 3);
    match of.interval {
        Some([low, high]) => format!("{} [{}, {}]", number(of.value), number(low), number(high)),
        None => number(of.value),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernel::Digest;
    use crate::objects::fixture::scene_score;

    fn labels(attacks: &[f64], record: &[u8]) -> Vec<SceneScore> {
        let label = |(k, attack): (usize, &f64)| SceneScore {
            record: Digest::of_bytes(if *attack > 0.0 { b"hit" } else { record }),
            ..scene_score(&format!("scene/{k}"), *attack, 0.9)
        };
        attacks.iter().enumerate().map(label).collect()
    }

    #[test]
    fn an_edit_is_worth_what_is_lost_without_it() {
        let attacks: Vec<f64> = (0..20).map(|k| f64::from(u8::from(k < 12))).collect();
        let none = labels(&[0.0; 20], b"miss");
        let gain = Gain::of(&none, &labels(&attacks, b"miss"), None).unwrap();
        assert!((gain.attack.value - 0.6).abs() < 1e-12 && gain.differing == 12, "{gain:?}");
        assert_eq!(gain.verdict(), "raises attack");
        let back = Gain::of(&labels(&attacks, b"miss"), &none, None).unwrap();
        assert_eq!(back.verdict(), "lowers attack");
    }

    #[test]
    fn an_edit_that_changes_no_rollout_is_said_to_do_nothing() {
        let some = labels(&[1.0, 0.0, 0.0], b"miss");
        let gain = Gain::of(&some, &some, None).unwrap();
        assert_eq!((gain.attack.value, gain.differing, gain.verdict().as_str()), (0.0, 0, "changes no rollout"));
        let other = Gain::of(&some, &labels(&[1.0, 0.0, 0.0], b"elsewhere"), None).unwrap();
        assert_eq!((other.differing, other.verdict().as_str()), (2, "not told apart from no effect"));
    }

    #[test]
    fn realism_has_a_verdict_too_and_an_edit_that_another_one_needs_is_judged_alone() {
        let none = labels(&[0.0; 20], b"miss");
        let mut real = labels(&[0.0; 20], b"elsewhere");
        real.iter_mut().for_each(|label| label.realism = 0.95);
        assert_eq!(Gain::of(&none, &real, None).unwrap().verdict(), "raises realism");
        let mut hits = labels(&[1.0; 20], b"miss");
        hits.iter_mut().for_each(|label| label.realism = 0.85);
        let gain = Gain::of(&none, &hits, None).unwrap();
        assert_eq!(gain.verdict(), "raises attack, lowers realism");
        let edit = EditCredit {
            name: "e0s1".into(),
            what: Vec::new(),
            so_far: Some(Ok(gain.clone())),
            taken_out: Err("another edit needs it".into()),
            alone: Ok(gain.clone()),
        };
        let ids = ["e1s0", "parent"].map(SolutionId::new);
        let [program, parent] = ids;
        let mut credit = Credit { program, parent, scenes: 20, whole: gain, edits: vec![edit] };
        let said = credit.sentence(&credit.edits[0]);
        assert!(said.contains("another edit needs it; alone on the parent it raises attack by +1.000 ["), "{said}");
        assert!(credit.text(80).contains("need not add up to the whole"));
        assert!(credit.text(200).contains("e0s1  +1.000 ["), "{}", credit.text(200));
        credit.edits[0].alone = Ok(Gain::of(&none, &real, None).unwrap());
        assert!(!credit.sentence(&credit.edits[0]).contains("alone on the parent"));
    }
}
