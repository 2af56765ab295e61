//! Tests of the meaning of expressions, of their refusal, and of the agreement between printing and reading.

use proptest::prelude::*;

use super::{
    tree::{Column, Function, Infix, Kind, Node, Prefix},
    *,
};
use crate::objects::value_type::ValueType;

fn scope() -> Scope {
    let number = ["gap_m", "closing_speed_mps", "actor_speed_mps"].map(|name| (name, ValueType::Number));
    let boolean = ["paths_cross", "behind"].map(|name| (name, ValueType::Boolean));
    Scope::new(number.into_iter().chain(boolean))
}

fn value(text: &str, values: [f64; 5]) -> f64 {
    Expr::parse(text).unwrap().compile(&scope()).unwrap().number(&values)
}

fn constant(text: &str) -> f64 {
    value(text, [0.0; 5])
}

fn refusal(text: &str) -> String {
    match Expr::parse(text) {
        Err(error) => error.to_string(),
        Ok(expr) => expr.compile(&scope()).unwrap_err().to_string(),
    }
}

fn printed(text: &str) -> String {
    Expr::parse(text).unwrap().to_string()
}

#[test]
fn arithmetic_binds_as_in_school() {
    assert_eq!(constant("1 + 2 * 3 - 8 / 4"), 5.0);
    assert_eq!(constant("-2 * -(3 - 5)"), -4.0);
    assert_eq!(constant("10 - 4 - 3"), 3.0);
    assert_eq!(constant("clamp(min(5, 4, 9), 0, max(1, 2))"), 2.0);
    assert_eq!(constant("abs(-3) + sqrt(16) + exp(0) + log(1)"), 8.0);
}

#[test]
fn a_ranking_rule_reads_its_features_by_name() {
    let text = "if(paths_cross and not behind, 1 / max(gap_m / closing_speed_mps, 0.1), 0)";
    assert_eq!(value(text, [20.0, 10.0, 0.0, 1.0, 0.0]), 0.5);
    assert_eq!(value(text, [20.0, 10.0, 0.0, 1.0, 1.0]), 0.0);
}

#[test]
fn not_binds_weaker_than_a_comparison_and_stronger_than_and() {
    assert_eq!(printed("not (1 < 2) and true"), "not 1 < 2 and true");
    assert_eq!(printed("not ((1 < 2) and true)"), "not (1 < 2 and true)");
    assert_eq!(constant("not 1 > 2 and true"), 1.0);
}

#[test]
fn operations_without_a_value_in_arithmetic_have_a_finite_one_here() {
    assert_eq!(constant("1 / 0"), 1.0 / DENOMINATOR_MIN);
    assert_eq!(constant("0 / 0"), 0.0);
    assert_eq!(constant("1 / (0 - 1e-12)"), -1.0 / DENOMINATOR_MIN);
    assert_eq!(constant("sqrt(-4)"), 0.0);
    assert_eq!(constant("log(0)"), constant("log(-5)"));
    assert_eq!(constant("exp(1000)"), MAGNITUDE_MAX);
    assert_eq!(constant("1e12 * -1e12"), -MAGNITUDE_MAX);
    assert_eq!(constant("clamp(5, 3, 1)"), 1.0);
    assert_eq!(value("gap_m + 1", [f64::NAN, 0.0, 0.0, 0.0, 0.0]), 1.0);
    assert_eq!(constant("-0").to_bits(), 0);
}

#[test]
fn parentheses_are_kept_only_where_the_tree_needs_them() {
    assert_eq!(printed("((gap_m)) - ((1) - (2))"), "gap_m - (1 - 2)");
    assert_eq!(printed("(gap_m-1)-2"), "gap_m - 1 - 2");
    assert_eq!(printed("-(gap_m*2)"), "-(gap_m * 2)");
    assert_eq!(printed("(true==behind)==(1<2)"), "(true == behind) == (1 < 2)");
    assert_eq!(printed("0.50e1 + 1E-9"), "5 + 1e-9");
}

#[test]
fn refusals_name_the_column_and_what_would_do() {
    assert_eq!(refusal("gap_m +"), "column 8: found the end, expected a number, a name or `(`");
    assert_eq!(refusal("(gap_m"), "column 7: found the end, expected an operator or `)`");
    assert_eq!(refusal("gap_m && behind"), "column 7: found `&&`, expected `and`");
    assert_eq!(
        refusal("gap + 1"),
        "column 1: found unknown name `gap`, expected a name that may be read here; did you mean `gap_m`?"
    );
    assert!(refusal("sqr(2)").contains("did you mean `sqrt`?"));
    assert!(refusal("1 < 2 < 3").contains("comparisons do not chain"));
    assert!(refusal("true == (behind) == true").contains("comparisons do not chain"));
    assert_eq!(refusal("min(1)"), "column 1: found `min` with 1 arguments, expected 2 to 8");
    assert!(refusal("gap_m.x").starts_with("column 6: found `.`"));
    assert!(refusal("1e400").contains("out of range"));
    assert!(refusal("NaN").contains("unknown name `NaN`"));
    assert!(refusal("").contains("found the end"));
}

#[test]
fn types_are_checked_where_they_meet() {
    assert_eq!(refusal("1 + behind"), "column 5: found a condition, expected a number");
    assert_eq!(refusal("not gap_m"), "column 5: found a number, expected a condition");
    assert_eq!(refusal("if(1, 2, 3)"), "column 4: found a number, expected a condition");
    assert_eq!(refusal("if(behind, 2, true)"), "column 15: found a condition, expected a number");
    assert_eq!(refusal("behind == 1"), "column 11: found a number, expected a condition");
}

#[test]
fn hostile_texts_are_refused_without_using_the_stack() {
    for text in ["(".repeat(8000), "-".repeat(8000), "not ".repeat(2000), "min(1,".repeat(1300), "(".repeat(100_000)] {
        assert!(Expr::parse(&text).is_err());
    }
    assert!(Expr::parse(&"1+".repeat(4000)).is_err());
    assert!(Expr::parse(&vec!["1"; 33].join("+")).unwrap_err().to_string().contains("deeper"));
    assert!(Expr::parse("ö + 1").unwrap_err().to_string().starts_with("column 1: found `ö`"));
    assert!(Expr::parse(&"a".repeat(65)).is_err());
}

#[test]
fn the_deepest_legal_tree_of_the_widest_calls_fits_the_stack() {
    let mut text = "1".to_string();
    for _ in 1..DEPTH_MAX {
        text = format!("clamp(1, 2, {text})");
    }
    assert_eq!(Expr::parse(&text).unwrap().depth(), DEPTH_MAX);
    assert_eq!(constant(&text), 1.0);
}

#[test]
fn sizes_and_names_are_of_the_tree() {
    let expr = Expr::parse("if(behind, gap_m, gap_m + 1)").unwrap();
    assert_eq!((expr.node_count(), expr.depth()), (6, 3));
    assert_eq!(expr.names().into_iter().collect::<Vec<_>>(), ["behind", "gap_m"]);
}

#[test]
fn a_chain_is_one_level_however_long_and_what_it_holds_still_nests() {
    let depth = |text: &str| Expr::parse(text).unwrap().depth_of_chains();
    assert_eq!(depth("a"), 1);
    assert_eq!(depth("a + b - c + d + e"), 2);
    assert_eq!(depth("p and q and r and s"), 2);
    assert_eq!(depth("a + b * c * d - e"), 3);
    assert_eq!(Expr::parse("a + b - c + d + e").unwrap().depth(), 5);
    assert_eq!(depth("a + (b - (c + d))"), 4, "brackets on the right nest");
    assert_eq!(depth("a - b < c and d < e and f < g"), 4);
}

#[test]
fn in_serde_an_expression_is_its_text() {
    let expr: Expr = serde_json::from_str("\"gap_m*2\"").unwrap();
    assert_eq!(serde_json::to_string(&expr).unwrap(), "\"gap_m * 2\"");
    assert!(serde_json::from_str::<Expr>("\"gap_m *\"").unwrap_err().to_string().contains("column 8"));
}

fn node(kind: Kind) -> Node {
    Node { at: Column(0), kind }
}

/// Any tree, typed or not.
fn trees() -> impl Strategy<Value = Expr> {
    let number = (0u64..(1 << 62)).prop_map(f64::from_bits).prop_filter("in range", |x| *x <= 1e12);
    let leaf = prop_oneof![
        number.prop_map(Kind::Number),
        (0u32..1000).prop_map(|n| Kind::Number(f64::from(n) / 8.0)),
        any::<bool>().prop_map(Kind::Boolean),
        "(gap_m|behind|paths_cross|x[0-9]?)".prop_map(Kind::Name),
    ]
    .prop_map(node);
    let tree = leaf.prop_recursive(6, 48, 3, |inner| {
        let pair = (inner.clone(), inner.clone());
        prop_oneof![
            inner.clone().prop_map(|a| Kind::Prefix(Prefix::Minus, Box::new(a))),
            inner.clone().prop_map(|a| Kind::Prefix(Prefix::Not, Box::new(a))),
            (0usize..12, pair).prop_map(|(i, (a, b))| Kind::Infix(Infix::ALL[i], Box::new(a), Box::new(b))),
            (0usize..8, prop::collection::vec(inner, 3)).prop_map(|(i, arguments)| {
                let function = Function::ALL[i];
                Kind::Call(function, arguments.into_iter().take(function.arity().1).collect())
            }),
        ]
        .prop_map(node)
    });
    tree.prop_map(|root| Expr { root })
}

/// Texts that are numeric expressions of `scope`.
fn numeric_texts() -> impl Strategy<Value = String> {
    let leaf = prop_oneof![
        Just("gap_m".to_string()),
        Just("closing_speed_mps".to_string()),
        Just("actor_speed_mps".to_string()),
        (0u32..50).prop_map(|n| format!("{}", f64::from(n) / 4.0)),
    ];
    leaf.prop_recursive(5, 40, 3, |inner| {
        (0usize..11, inner.clone(), inner.clone(), inner).prop_map(|(pick, a, b, c)| match pick {
            0 => format!("({a} + {b})"),
            1 => format!("({a} - {b})"),
            2 => format!("({a} * {b})"),
            3 => format!("({a} / {b})"),
            4 => format!("clamp({a}, {b}, {c})"),
            5 => format!("if({a} < {b} or behind, {b}, {c})"),
            6 => format!("exp({a})"),
            7 => format!("log({a})"),
            8 => format!("sqrt({a})"),
            9 => format!("-{a}"),
            _ => format!("max({a}, {b}, {c})"),
        })
    })
}

proptest! {
    #[test]
    fn a_printed_tree_reads_back_as_itself(expr in trees()) {
        let text = expr.to_string();
        let back = Expr::parse(&text);
        prop_assert_eq!(back.as_ref(), Ok(&expr), "{}", text);
    }

    #[test]
    fn any_text_is_read_or_refused(text in "[-a-z0-9_.()<>=!+*/, ]{0,60}|\\PC{0,40}") {
        if let Ok(expr) = Expr::parse(&text) {
            prop_assert_eq!(Expr::parse(&expr.to_string()), Ok(expr));
        }
    }

    #[test]
    fn every_value_is_finite_and_bounded(text in numeric_texts(), values in prop::array::uniform5(any::<f64>())) {
        let result = value(&text, values);
        prop_assert!(result.is_finite() && result.abs() <= MAGNITUDE_MAX, "{} = {}", text, result);
    }
}
