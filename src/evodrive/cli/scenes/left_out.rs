//! Lists what a pool changed or left out, in one line for each reason: a folder of a thousand files without a map says so once.

use std::collections::BTreeMap;

use crate::scene::{LeftOut, Pool, usable};

/// Names that a line gives before it counts.
const NAMED_MAX: usize = 3;

/// Returns lines on what was changed, is doubtful, or was left out at import.
pub fn lines(pool: &Pool) -> Vec<String> {
    let named = |holds: fn(&LeftOut) -> bool| {
        pool.left_out.iter().filter(move |left| holds(left)).map(|left| {
            let what = if left.what.is_empty() { String::new() } else { format!(" ({})", left.what) };
            (format!("{}{what}", left.file), left.reason.clone())
        })
    };
    let changed = named(|left| left.is_kept() && !left.is_doubtful());
    let (doubtful, gone) = (named(LeftOut::is_doubtful), named(|left| !left.is_kept()));
    [listed("changed", changed), listed("doubtful", doubtful), listed("left out", gone)].concat()
}

/// Scenes that are in the pool and that evolution cannot use.
pub fn unusable(pool: &Pool) -> Vec<String> {
    let reason = |scene: &crate::scene::Scene| usable(scene).err().map(|reason| (scene.id.clone(), reason.to_string()));
    listed("not used", pool.scenes.iter().filter_map(reason))
}

/// One line a reason, in the order in which reasons are met. Reasons that differ in their numbers alone are one.
pub fn listed(what: &str, all: impl Iterator<Item = (String, String)>) -> Vec<String> {
    let mut places: BTreeMap<String, usize> = BTreeMap::new();
    let mut reasons: Vec<(String, Vec<String>)> = Vec::new();
    for (name, reason) in all {
        let place = *places.entry(without_numbers(&reason)).or_insert(reasons.len());
        match reasons.get_mut(place) {
            Some((_, names)) => names.push(name),
            None => reasons.push((reason, vec![name])),
        }
    }
    let line = |(reason, names): (String, Vec<String>)| match names.as_slice() {
        [one] => format!("{what}: {one}: {reason}"),
        all => {
            let more = all.len().saturating_sub(NAMED_MAX);
            let shown = all.iter().take(NAMED_MAX).cloned().collect::<Vec<_>>().join(", ");
            let more = if more > 0 { format!(" and {more} more") } else { String::new() };
            format!("{what}: {} times: {reason}: {shown}{more}", all.len())
        }
    };
    reasons.into_iter().map(line).collect()
}

/// A sentence with each number replaced by one sign. The name of a town's file stays: it is what has to be brought.
pub fn without_numbers(text: &str) -> String {
    let mut out = String::new();
    for word in text.split_inclusive(' ') {
        if word.trim_end().ends_with(".xodr") {
            out.push_str(word);
            continue;
        }
        for c in word.chars() {
            let part = c.is_ascii_digit() || (c == '.' && out.ends_with('#'));
            if !part {
                out.push(c);
            } else if !out.ends_with('#') {
                out.push('#');
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_only_resampled_is_called_changed_and_not_left_out() {
        let of = |what: &str, reason: &str| LeftOut { file: "a.pkl".into(), what: what.into(), reason: reason.into() };
        let all = vec![of(LeftOut::SAMPLE_TIMES, "all motion was resampled"), of("track 7", "it is never observed")];
        assert_eq!(
            lines(&Pool { left_out: all, ..Pool::default() }),
            [
                "changed: a.pkl (its sample times): all motion was resampled",
                "left out: a.pkl (track 7): it is never observed"
            ]
        );
    }

    #[test]
    fn repeated_reasons_are_one_line_and_single_ones_stay_whole() {
        let of = |name: &str, reason: &str| (name.to_string(), reason.to_string());
        let mut all: Vec<_> =
            (0..9).map(|k| of(&format!("s{k}"), &format!("the route is {k}.5 m long; 10 m are needed"))).collect();
        all.insert(4, of("t", "there is no vehicle"));
        assert_eq!(
            listed("not used", all.into_iter()),
            [
                "not used: 9 times: the route is 0.5 m long; 10 m are needed: s0, s1, s2 and 6 more",
                "not used: t: there is no vehicle"
            ]
        );
        assert_eq!(without_numbers("0.5 m. 10 of s1"), "# m. # of s#");
        let town = |name: &str| (format!("route on {name}"), format!("{name}.xodr is missing, 5 m away"));
        let towns = listed("left out", ["Town03", "Town05", "Town03"].map(town).into_iter());
        assert_eq!(towns.len(), 2, "each missing file is named: {towns:?}");
        assert!(towns[0].contains("2 times: Town03.xodr") && towns[1].contains("Town05.xodr"), "{towns:?}");
    }
}
