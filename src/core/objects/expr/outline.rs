//! An expression as an outline in words: one line per branch, so that somebody who never saw the language can follow it.

use super::tree::{Expr, Function, Infix, Kind, Node, Prefix};

/// Name endings and the units that they stand for.
const UNITS: [(&str, &str); 8] = [
    ("_mps3", "m/s³"),
    ("_mps2", "m/s²"),
    ("_radps", "rad/s"),
    ("_mps", "m/s"),
    ("_1pm", "1/m"),
    ("_rad", "rad"),
    ("_m", "m"),
    ("_s", "s"),
];

/// A formula of up to this many letters stands on one line.
const LINE_MAX: usize = 90;

/// Returns the lines with the indentation of each. A text that does not parse is returned as a single line.
pub fn outline(text: &str) -> Vec<(usize, String)> {
    let mut lines = Vec::new();
    match Expr::parse(text) {
        Ok(expr) => outlined(&expr.root, 0, "", &mut lines),
        Err(_) => lines.push((0, text.to_string())),
    }
    lines
}

fn outlined(node: &Node, depth: usize, before: &str, lines: &mut Vec<(usize, String)>) {
    let short = words(node);
    if !branches(node) && short.chars().count() <= LINE_MAX {
        return lines.push((depth, format!("{before}{short}")));
    }
    match &node.kind {
        Kind::Call(Function::If, arguments) => {
            let [condition, then, otherwise] = &arguments[..] else { return lines.push((depth, short)) };
            if leaf(then) && leaf(otherwise) {
                let (then, otherwise) = (words(then), words(otherwise));
                return lines.push((depth, format!("{before}{then} where {}, else {otherwise}", words(condition))));
            }
            lines.push((depth, format!("{before}where {}:", words(condition))));
            outlined(then, depth + 1, "", lines);
            outlined(otherwise, depth, "else ", lines);
        }
        Kind::Call(function @ (Function::Min | Function::Max), arguments) => {
            let which = if *function == Function::Min { "the smallest of:" } else { "the largest of:" };
            lines.push((depth, format!("{before}{which}")));
            arguments.iter().for_each(|argument| outlined(argument, depth + 1, "", lines));
        }
        Kind::Call(Function::Clamp, arguments) => {
            let [value, low, high] = &arguments[..] else { return lines.push((depth, short)) };
            lines.push((depth, format!("{before}kept between {} and {}:", words(low), words(high))));
            outlined(value, depth + 1, "", lines);
        }
        Kind::Infix(Infix::Plus | Infix::Minus, ..) => {
            lines.push((depth, format!("{before}the sum of:")));
            terms(node, false, depth + 1, lines);
        }
        Kind::Infix(Infix::Times, left, right) => {
            lines.push((depth, format!("{before}the product of:")));
            outlined(left, depth + 1, "", lines);
            outlined(right, depth + 1, "", lines);
        }
        _ => lines.push((depth, format!("{before}{short}"))),
    }
}

/// Writes the terms of a sum, each on a line of its own, with `minus` for those that are subtracted.
fn terms(node: &Node, minus: bool, depth: usize, lines: &mut Vec<(usize, String)>) {
    match &node.kind {
        Kind::Infix(infix @ (Infix::Plus | Infix::Minus), left, right) => {
            terms(left, minus, depth, lines);
            terms(right, minus != (*infix == Infix::Minus), depth, lines);
        }
        _ => outlined(node, depth, if minus { "minus " } else { "" }, lines),
    }
}

/// Returns `true` if the tree holds a decision, which reads better in lines of its own.
fn branches(node: &Node) -> bool {
    matches!(&node.kind, Kind::Call(Function::If, _)) || node.children().into_iter().any(branches)
}

fn leaf(node: &Node) -> bool {
    !branches(node) && words(node).chars().count() <= LINE_MAX / 2
}

fn unit_of(name: &str) -> Option<(&str, &'static str)> {
    let name = name.strip_suffix("_min").or_else(|| name.strip_suffix("_max")).unwrap_or(name);
    UNITS.iter().find_map(|(end, unit)| Some((name.strip_suffix(end)?, *unit)))
}

/// Returns a name without its unit, with its words apart.
fn readable(name: &str) -> String {
    let which = match name {
        _ if name.ends_with("_min") => "least ",
        _ if name.ends_with("_max") => "greatest ",
        _ => "",
    };
    let bare = name.strip_suffix("_min").or_else(|| name.strip_suffix("_max")).unwrap_or(name);
    format!("{which}{}", unit_of(name).map_or(bare, |(bare, _)| bare).replace('_', " "))
}

/// Returns the unit of the quantity that a comparison is about, where one quantity decides it.
fn unit(node: &Node) -> Option<&'static str> {
    match &node.kind {
        Kind::Name(name) => unit_of(name).map(|(_, unit)| unit),
        Kind::Call(Function::Abs, arguments) => arguments.first().and_then(unit),
        Kind::Prefix(Prefix::Minus, inner) => unit(inner),
        Kind::Infix(Infix::Plus | Infix::Minus, left, right) => unit(left).or_else(|| unit(right)),
        _ => None,
    }
}

fn words(node: &Node) -> String {
    match &node.kind {
        Kind::Number(number) => format!("{number}"),
        Kind::Boolean(value) => value.to_string(),
        Kind::Name(name) => readable(name),
        Kind::Prefix(Prefix::Minus, inner) => format!("−{}", grouped(inner)),
        Kind::Prefix(Prefix::Not, inner) => format!("not {}", grouped(inner)),
        Kind::Infix(infix, left, right) => {
            let sign = match infix {
                Infix::Or | Infix::And => {
                    let one = |side: &Node| match &side.kind {
                        Kind::Infix(Infix::Or, ..) if *infix == Infix::And => format!("({})", words(side)),
                        _ => words(side),
                    };
                    return format!("{} {} {}", one(left), infix.text(), one(right));
                }
                Infix::Less => "below",
                Infix::AtMost => "at most",
                Infix::More => "above",
                Infix::AtLeast => "at least",
                Infix::Equal => "equal to",
                Infix::Unequal => "other than",
                Infix::Plus => "+",
                Infix::Minus => "−",
                Infix::Times => "×",
                Infix::Over => "÷",
            };
            let of_number = |number: &Node, other: &Node| match &number.kind {
                Kind::Number(value) => unit(other).map(|unit| format!("{value} {unit}")),
                _ => None,
            };
            let compares = !matches!(sign, "+" | "−" | "×" | "÷");
            if !compares {
                let tight =
                    |side: &Node| matches!(sign, "×" | "÷") || matches!(side.kind, Kind::Infix(Infix::Minus, ..));
                let side = |side: &Node| if tight(side) { grouped(side) } else { words(side) };
                let first = if matches!(sign, "×" | "÷") { grouped(left) } else { words(left) };
                return format!("{first} {sign} {}", side(right));
            }
            let right_words = of_number(right, left).unwrap_or_else(|| words(right));
            let left_words = of_number(left, right).unwrap_or_else(|| words(left));
            format!("{left_words} {sign} {right_words}")
        }
        Kind::Call(function, arguments) => {
            let all = |joined: &str| arguments.iter().map(words).collect::<Vec<_>>().join(joined);
            let one = || arguments.first().map(words).unwrap_or_default();
            match function {
                Function::Min => format!("the smallest of ({})", all("; ")),
                Function::Max => format!("the largest of ({})", all("; ")),
                Function::Abs => format!("the size of {}", arguments.first().map(grouped).unwrap_or_default()),
                Function::Sqrt => format!("the root of ({})", one()),
                Function::Exp => format!("e to the ({})", one()),
                Function::Log => format!("the log of ({})", one()),
                Function::Clamp => match &arguments[..] {
                    [value, low, high] => {
                        format!("{} kept between {} and {}", grouped(value), words(low), words(high))
                    }
                    _ => all("; "),
                },
                Function::If => match &arguments[..] {
                    [condition, then, otherwise] => {
                        format!("({} where {}, else {})", words(then), words(condition), words(otherwise))
                    }
                    _ => all("; "),
                },
            }
        }
    }
}

/// Puts brackets around the text if it holds an operator.
fn grouped(node: &Node) -> String {
    match &node.kind {
        Kind::Infix(..) | Kind::Call(Function::Clamp, _) => format!("({})", words(node)),
        _ => words(node),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(expression: &str) -> String {
        outline(expression).iter().map(|(depth, line)| format!("{}{line}\n", "  ".repeat(*depth))).collect()
    }

    #[test]
    fn names_lose_their_units_and_numbers_get_them() {
        assert_eq!(text("time_to_conflict_s > 1.5 and not behind"), "time to conflict above 1.5 s and not behind\n");
        assert_eq!(text("path_distance_m_min / 8"), "least path distance ÷ 8\n");
        assert_eq!(text("abs(seen_ego_heading_rad) < 0.8"), "the size of seen ego heading below 0.8 rad\n");
        assert_eq!(text("a - (b - c)"), "a − (b − c)\n");
        assert_eq!(text("(a + b) * c"), "(a + b) × c\n");
        assert_eq!(text("(behind or same_lane) and paths_cross"), "(behind or same lane) and paths cross\n");
    }

    #[test]
    fn a_decision_has_a_line_a_branch_and_a_sum_a_line_a_term() {
        let law = "if(abs(seen_ego_left_m) < 7 and seen_gap_m < 5, clamp(4 * seen_ego_left_m, -5, 5), 0)";
        assert_eq!(
            text(law),
            "(4 × seen ego left) kept between −5 and 5 where the size of seen ego left below 7 m and seen gap below 5 m, else 0\n"
        );
        let rank = "if(gap_m > 1.5, 2, 0) - path_distance_m_min / 8 + if(behind, if(same_lane, 1, 3), 0)";
        assert_eq!(
            text(rank),
            "the sum of:\n  2 where gap above 1.5 m, else 0\n  minus least path distance ÷ 8\n  where behind:\n    1 where same lane, else 3\n  else 0\n"
        );
    }

    #[test]
    fn what_does_not_parse_is_shown_as_it_is() {
        assert_eq!(text("a + "), "a + \n");
    }
}
