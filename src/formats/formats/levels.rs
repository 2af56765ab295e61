//! Levels of a log: a scene is plane, so it holds the level of the ego's way. Road users above or below it, on a bridge or in a
//! tunnel, are left out there, because two levels do not meet.

use super::log::{LogTrack, Parts};
use crate::kernel::Vec2;

/// Somebody's middle this far above or below the ego's way at the same place is on another level, metres: a truck's middle
/// lies about 1.3 m above a car's, and a bridge lets a truck of 4 m pass.
const APART_M: f64 = 3.0;
/// And this much more a metre beside the ego's way: streets are hardly steeper.
const SLOPE: f64 = 0.15;
/// The ego's way lies at the heights of all its places that are at most this much farther away than the nearest, metres.
const NEAREST_WITHIN_M: f64 = 5.0;
/// Most pairs of a sample and a place of the ego that are compared; what is beyond stays.
const PAIRS_MAX: usize = 200_000_000;

/// Leaves out samples on another level than the ego's way, and returns the ids of those who are on another one for all time.
/// Places are taken as they are in the log.
pub(super) fn leave_out_others(tracks: &mut [LogTrack], ego: usize, left_out: &mut Parts) -> Vec<String> {
    let way: Vec<(Vec2, f64)> = tracks.get(ego).map(placed).unwrap_or_default().into_iter().map(|(_, at)| at).collect();
    let heights = |fold: fn(f64, f64) -> f64, from: f64| way.iter().map(|(_, height)| *height).fold(from, fold);
    let (low, high) = (heights(f64::min, f64::INFINITY), heights(f64::max, f64::NEG_INFINITY));
    let mut pairs = 0usize;
    let mut nowhere_else = Vec::new();
    for (ix, track) in tracks.iter_mut().enumerate() {
        let (mut count, mut most) = (0, 0.0_f64);
        for (k, (place, height)) in placed(track) {
            // Within the heights of the whole way nobody is on another level, and most are.
            if ix == ego || way.is_empty() || (height <= low + APART_M && height >= high - APART_M) {
                continue;
            }
            pairs = pairs.saturating_add(way.len());
            if pairs > PAIRS_MAX {
                break;
            }
            let (beside_m, above_m) = above(&way, place, height);
            if above_m.abs() > APART_M + SLOPE * beside_m {
                track.samples[k] = None;
                count += 1;
                most = if above_m.abs() > most.abs() { above_m } else { most };
            }
        }
        if count == 0 {
            continue;
        }
        let side = if most > 0.0 { "above" } else { "below" };
        let all = track.samples.iter().all(Option::is_none);
        let (what, rest) = if all {
            (String::new(), "the other road users are")
        } else {
            (format!("{count} samples of "), "the rest of the track is")
        };
        let reason = format!(
            "on another level than the ego's way, up to {:.1} m {side} it; two levels do not meet; {rest} kept",
            most.abs()
        );
        left_out.push((format!("{what}track {}", super::import_error::shown(&track.id)), reason));
        if all {
            nowhere_else.push(track.id.clone());
        }
    }
    nowhere_else
}

/// Step, place and height of each sample of which all are known.
fn placed(track: &LogTrack) -> Vec<(usize, (Vec2, f64))> {
    let known = track.samples.iter().zip(&track.heights_m).enumerate().filter_map(|(k, (sample, height))| {
        let place = sample.as_ref()?.position;
        (place.is_finite() && height.is_finite()).then_some((k, (place, *height)))
    });
    known.collect()
}

/// How far a place lies beside a way, and how far above its nearest height there (below: less than 0), metres.
fn above(way: &[(Vec2, f64)], place: Vec2, height: f64) -> (f64, f64) {
    let nearest = way.iter().map(|(at, _)| at.distance(place)).fold(f64::INFINITY, f64::min);
    let near = way.iter().filter(|(at, _)| at.distance(place) <= nearest + NEAREST_WITHIN_M);
    let above = near.map(|(_, there)| height - there).min_by(|a, b| a.abs().total_cmp(&b.abs()));
    (nearest, above.unwrap_or(0.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{AgentKind, Sample};

    fn track(id: &str, at: impl Fn(f64) -> (f64, f64, f64)) -> LogTrack {
        let places: Vec<(f64, f64, f64)> = (0..50).map(|k| at(f64::from(k))).collect();
        let sample = |(x, y, _): &(f64, f64, f64)| Some(Sample { position: Vec2::new(*x, *y), ..Sample::default() });
        LogTrack {
            id: id.into(),
            kind: Ok(AgentKind::Vehicle),
            length_m: 4.5,
            width_m: 1.9,
            samples: places.iter().map(sample).collect(),
            heights_m: places.iter().map(|(_, _, z)| *z).collect(),
        }
    }

    /// Returns the number of samples that are kept of a road user beside an ego that drives 100 m east and 5 m up.
    fn kept(at: impl Fn(f64) -> (f64, f64, f64)) -> usize {
        let mut tracks = vec![track("ego", |k| (2.0 * k, 0.0, 0.1 * k)), track("other", at)];
        let mut left_out = Parts::new();
        let gone = leave_out_others(&mut tracks, 0, &mut left_out);
        assert_eq!(tracks[0].samples.iter().flatten().count(), 50, "the ego is on its own level");
        let kept = tracks[1].samples.iter().flatten().count();
        assert_eq!((gone.is_empty(), left_out.is_empty()), (kept > 0, kept == 50), "{left_out:?}");
        kept
    }

    #[test]
    fn who_passes_above_or_below_is_left_out_and_who_is_as_high_is_kept() {
        assert_eq!(kept(|_| (50.0, 0.0, 10.5)), 0, "parked on a bridge 8 m above");
        assert_eq!(kept(|_| (50.0, 0.0, -5.5)), 0, "in a tunnel");
        assert_eq!(kept(|_| (50.0, 3.5, 3.8)), 50, "a truck at grade");
        assert_eq!(kept(|_| (90.0, 0.0, 4.5)), 50, "as high as the way is there, not as where it begins");
        assert_eq!(kept(|_| (4.0, 0.0, 5.0)), 0, "as high as the way is elsewhere");
        assert_eq!(kept(|k| (50.0, 100.0 + k, 14.0)), 50, "up a hill that begins beside the way");
        assert_eq!(kept(|_| (50.0, 0.0, f64::NAN)), 50, "nobody knows");
    }

    #[test]
    fn who_crosses_on_a_bridge_is_left_out_at_the_crossing_only() {
        let crossing = kept(|k| (50.0, 4.0 * (k - 25.0), 10.5));
        assert!((20..40).contains(&crossing), "{crossing}");
    }
}
