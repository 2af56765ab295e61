//! A speed limit as files write it: a number, often with its unit behind it.

use crate::scene::validate::SPEED_MAX_MPS;

const MPH_IN_MPS: f64 = 0.44704;

/// The limit that a text such as `50kmh`, `25 mph` or `13.9` gives, m/s. `unsaid` is the unit of a plain number.
///
/// # Errors What was expected.
pub fn limit_mps(text: &str, unsaid: &str) -> Result<f64, String> {
    let text = text.trim();
    let number = |end: &usize| text.get(..*end).and_then(|head| head.trim().parse::<f64>().ok());
    let begins = text.starts_with(|c: char| c.is_ascii_digit() || matches!(c, '.' | '+' | '-'));
    // The longest beginning that is a number; what is behind it is the unit.
    let parsed = (1..=text.len().min(64)).rev().find_map(|end| Some((number(&end)?, text.get(end..)?.trim())));
    let expected = || format!("a speed in m/s, km/h or mph, found {:?}", super::import_error::shown(text));
    let (value, unit) = parsed.filter(|_| begins).ok_or_else(expected)?;
    let unit = if unit.is_empty() { unsaid } else { unit };
    let factor = match unit.to_ascii_lowercase().as_str() {
        "m/s" | "mps" | "ms" => 1.0,
        "km/h" | "kmh" | "kph" | "kmph" | "km/hr" => 1.0 / 3.6,
        "mph" | "mi/h" | "mi/hr" => MPH_IN_MPS,
        _ => return Err(expected()),
    };
    let limit = value * factor;
    let sound = limit > 0.0 && limit <= SPEED_MAX_MPS;
    sound.then_some(limit).ok_or_else(|| {
        format!("a speed above 0, at most {SPEED_MAX_MPS} m/s, found {:?}", super::import_error::shown(text))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_unit_behind_the_number_counts() {
        let is = |text: &str, mps: f64| assert!((limit_mps(text, "m/s").unwrap() - mps).abs() < 1e-3, "{text}");
        for text in ["50kmh", "50 km/h", "50KPH", " 50 kmh "] {
            is(text, 13.889);
        }
        is("25mph", 11.176);
        is("25 mph", 11.176);
        is("13.9", 13.9);
        is("13.9 m/s", 13.9);
        assert!((limit_mps("30", "mph").unwrap() - 13.411).abs() < 1e-3);
    }

    #[test]
    fn what_is_no_speed_is_refused() {
        for text in ["", "fast", "50 knots", "inf", "NaN", "-5", "0", "1e9", "kmh", "999 km/h"] {
            assert!(limit_mps(text, "m/s").is_err(), "{text}");
        }
    }
}
