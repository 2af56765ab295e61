//! What a function may give back at once in place of its work: simple values of its type, as cargo-mutants chooses them.

use syn::{GenericArgument, PathArguments, ReturnType, Type, TypePath};

/// At most so many values for one function.
const VALUES_MAX: usize = 4;

/// Values of the type, as source; none where the type has no simple one.
pub fn of_return(output: &ReturnType) -> Vec<String> {
    match output {
        ReturnType::Default => vec!["()".into()],
        ReturnType::Type(_, of) => {
            let mut values = of_type(of);
            values.truncate(VALUES_MAX);
            values
        }
    }
}

fn of_type(of: &Type) -> Vec<String> {
    match of {
        Type::Path(path) => of_path(path),
        Type::Tuple(tuple) if tuple.elems.is_empty() => vec!["()".into()],
        Type::Tuple(tuple) => {
            // The first value of each place, then the second of each.
            let places: Vec<Vec<String>> = tuple.elems.iter().map(of_type).collect();
            if places.iter().any(Vec::is_empty) {
                return Vec::new();
            }
            let row =
                |n: usize| places.iter().map(|place| place[n.min(place.len() - 1)].clone() + ",").collect::<String>();
            let mut values = vec![format!("({})", row(0)), format!("({})", row(1))];
            values.dedup();
            values
        }
        Type::Array(array) => {
            of_type(&array.elem).into_iter().map(|value| format!("std::array::from_fn(|_| {value})")).collect()
        }
        Type::Paren(inner) => of_type(&inner.elem),
        Type::Reference(reference) if reference.mutability.is_none() => match &*reference.elem {
            Type::Slice(_) => vec!["&[]".into()],
            Type::Path(path) if path.path.is_ident("str") => vec!["\"\"".into(), "\"xyzzy\"".into()],
            _ => Vec::new(),
        },
        _ => Vec::new(),
    }
}

fn of_path(path: &TypePath) -> Vec<String> {
    let Some(last) = path.path.segments.last() else { return Vec::new() };
    let inner = || match &last.arguments {
        PathArguments::AngleBracketed(list) => match list.args.first() {
            Some(GenericArgument::Type(of)) => of_type(of),
            _ => Vec::new(),
        },
        _ => Vec::new(),
    };
    let around =
        |open: &str, close: &str| inner().into_iter().map(|value| format!("{open}{value}{close}")).collect::<Vec<_>>();
    match last.ident.to_string().as_str() {
        "bool" => vec!["true".into(), "false".into()],
        "u8" | "u16" | "u32" | "u64" | "u128" | "usize" => vec!["0".into(), "1".into()],
        "i8" | "i16" | "i32" | "i64" | "i128" | "isize" => vec!["0".into(), "1".into(), "-1".into()],
        "f32" | "f64" => vec!["0.0".into(), "1.0".into(), "-1.0".into()],
        "String" => vec!["String::new()".into(), "\"xyzzy\".to_string()".into()],
        "Option" => [vec!["None".into()], around("Some(", ")")].concat(),
        "Result" => around("Ok(", ")"),
        "Vec" => [vec!["Vec::new()".into()], around("vec![", "]")].concat(),
        "Box" => around("Box::new(", ")"),
        _ => vec!["Default::default()".into()],
    }
}
