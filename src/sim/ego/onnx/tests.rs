use proptest::prelude::*;

use super::*;
use crate::ego::network::{Dense, Mlp};
use crate::ego::{Policy, Weights};
use crate::kernel::Seed;
use crate::kernel::linear::transposed;
use crate::sim::scenes::crossing;
use crate::sim::{Control, Driver, Intervention, Plant, View, rollout};

fn varint(mut x: u64) -> Vec<u8> {
    let mut bytes = Vec::new();
    while x > 127 {
        bytes.push(x as u8 | 128);
        x >>= 7;
    }
    bytes.push(x as u8);
    bytes
}

fn number(field: u64, x: u64) -> Vec<u8> {
    [varint(field << 3), varint(x)].concat()
}

fn message(field: u64, body: impl AsRef<[u8]>) -> Vec<u8> {
    let body = body.as_ref();
    [&varint(field << 3 | 2), &varint(body.len() as u64), body].concat()
}

fn tensor(name: &str, kind: u64, shape: &[usize], raw: &[u8]) -> Vec<u8> {
    let shape = shape.iter().flat_map(|length| number(1, *length as u64)).collect();
    [shape, number(2, kind), message(8, name), message(9, raw)].concat()
}

fn floats(name: &str, shape: &[usize], values: &[f32]) -> Vec<u8> {
    tensor(name, 1, shape, &values.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<_>>())
}

fn wholes(name: &str, values: &[i64]) -> Vec<u8> {
    tensor(name, 7, &[values.len()], &values.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<_>>())
}

/// A whole number or a float under this name.
fn whole(key: &str, x: i64) -> Vec<u8> {
    [message(1, key), number(3, x as u64), number(20, 2)].concat()
}

fn float(key: &str, x: f32) -> Vec<u8> {
    [message(1, key), varint(2 << 3 | 5), x.to_le_bytes().to_vec(), number(20, 1)].concat()
}

/// A node by its words, inputs before `->`, which is named as its first output.
fn node(operator: &str, words: &str, attributes: &[Vec<u8>]) -> Vec<u8> {
    let (inputs, outputs) = words.split_once(" -> ").unwrap();
    let of = |field, words: &str| words.split(' ').flat_map(|word| message(field, word)).collect::<Vec<_>>();
    let attributes = attributes.iter().flat_map(|attribute| message(5, attribute)).collect();
    [of(1, inputs), of(2, outputs), message(3, outputs), message(4, operator), attributes].concat()
}

/// A file whose input `seen` has this width and whose action is `acted`.
fn file(width: usize, nodes: &[Vec<u8>], tensors: &[Vec<u8>], said: Option<&str>) -> Vec<u8> {
    let dimensions = [message(1, message(2, "batch")), message(1, number(1, width as u64))].concat();
    let input = [message(1, "seen"), message(2, message(1, [number(1, 1), message(2, dimensions)].concat()))].concat();
    let parts = [nodes, tensors].into_iter().zip([1, 5]);
    let parts = parts.flat_map(|(of, field)| of.iter().flat_map(move |part| message(field, part))).collect();
    let graph: Vec<u8> = [parts, message(11, input), message(12, message(1, "acted"))].concat();
    let said = said.map_or(vec![], |said| message(14, [message(1, KEY), message(2, said)].concat()));
    [number(1, 8), message(2, "tests"), said, message(7, graph)].concat()
}

/// How torch spells a function, from `a` to `b`.
fn spelled(function: &str, a: &str, b: &str) -> Vec<Vec<u8>> {
    let two = |first, second| node(first, second, &[]);
    match function {
        "relu" => vec![two("Relu", &format!("{a} -> {b}"))],
        "tanh" => vec![two("Tanh", &format!("{a} -> {b}"))],
        "elu" => vec![two("Elu", &format!("{a} -> {b}"))],
        "silu" => vec![two("Sigmoid", &format!("{a} -> {b}s")), two("Mul", &format!("{a} {b}s -> {b}"))],
        _ => vec![
            two("Div", &format!("{a} root -> {b}d")),
            two("Erf", &format!("{b}d -> {b}e")),
            two("Add", &format!("{b}e one -> {b}a")),
            two("Mul", &format!("{a} {b}a -> {b}m")),
            two("Mul", &format!("{b}m half -> {b}")),
        ],
    }
}

/// An actor's means and their hyperbolic tangent as torch exports them; `passed` is a layer that is left out.
fn exported(actor: &Mlp, function: &str, passed: Option<usize>) -> Vec<u8> {
    let root = [("root", std::f32::consts::SQRT_2), ("one", 1.0), ("half", 0.5)];
    let (mut nodes, mut tensors) = (Vec::new(), root.map(|(name, x)| floats(name, &[], &[x])).to_vec());
    let mut last = "seen".to_string();
    for (i, layer) in actor.layers.iter().enumerate().filter(|(i, _)| passed != Some(*i)) {
        let is_head = i + 1 == actor.layers.len();
        let outputs = if is_head { ACTION } else { layer.outputs };
        let turned = &transposed(&layer.weights, layer.outputs)[..outputs * layer.inputs];
        tensors.push(floats(&format!("w{i}"), &[outputs, layer.inputs], turned));
        tensors.push(floats(&format!("b{i}"), &[outputs], &layer.bias[..outputs]));
        nodes.push(node("Gemm", &format!("{last} w{i} b{i} -> g{i}"), &[whole("transB", 1), float("alpha", 1.0)]));
        let into = if is_head { "acted".to_string() } else { format!("h{i}") };
        nodes.extend(spelled(if is_head { "tanh" } else { function }, &format!("g{i}"), &into));
        last = into;
    }
    file(actor.inputs(), &nodes, &tensors, None)
}

fn drawn(widths: &[usize]) -> Mlp {
    let (mut actor, mut stream) = (Mlp::zeros(widths), Seed(4).stream(&["onnx"]));
    actor.parameters_mut().flatten().for_each(|x| *x = stream.normal(0.0, 0.3) as f32);
    actor
}

/// Drives by a policy and keeps what it was shown.
struct Watcher(Box<dyn Driver>, Setting, Vec<Vec<f32>>);

impl Driver for Watcher {
    fn begin(&mut self, plant: &Plant) {
        self.0.begin(plant);
    }

    fn decide(&mut self, view: &View<'_>) -> Control {
        let mut seen = Vec::new();
        self.1.observe(view, &mut seen);
        self.2.push(seen);
        self.0.decide(view)
    }
}

fn acts(bytes: &[u8], seen: &[Vec<f32>]) -> Vec<[u32; ACTION]> {
    let (weights, mut spare) = (Weights::from_bytes(bytes).unwrap(), Vec::new());
    seen.iter().map(|seen| weights.act(&mut seen.clone(), &mut spare).map(f32::to_bits)).collect()
}

#[test]
fn a_network_acts_alike_as_onnx_and_as_safetensors_to_the_bit_with_one_to_eight_hidden_layers_and_every_function() {
    let setting = Setting::Metadrive1;
    let plant = Plant::new(&crossing(4, 20, 91)).unwrap();
    let many = [setting.length(), 9, 8, 7, 6, 5, 6, 7, 8, 2 * ACTION];
    for (function, layers) in [("relu", 3), ("tanh", 3), ("elu", 1), ("gelu", 2), ("silu", 8), ("relu", 8)] {
        let actor = drawn(&[&many[..=layers], &many[9..]].concat());
        let form = Weights::form(function, "tanh").unwrap();
        let (onnx, own) = (exported(&actor, function, None), Weights::to_bytes_as(setting, &actor, form).unwrap());
        let driven = [&onnx, &own].map(|bytes| {
            let mut watcher = Watcher(Policy::learned(bytes).unwrap().driver(), setting, vec![]);
            (rollout(&plant, &Intervention::default(), &mut watcher).unwrap(), watcher.2)
        });
        assert_eq!(driven[0], driven[1], "{function}");
        let seen = &driven[0].1;
        let expected = acts(&own, seen);
        assert!(seen.len() > 5 && acts(&onnx, seen) == expected, "{function}");
        // A reader that passed over a function or a layer would not notice the difference to these.
        let other = if function == "relu" { "tanh" } else { "relu" };
        assert_ne!(acts(&exported(&actor, other, None), seen), expected, "{function}");
        if layers == 8 {
            let mut actor = actor;
            actor.layers[3] = Dense { outputs: 7, inputs: 7, ..Dense::zeros(7, 7) };
            actor.layers[4] = Dense::zeros(7, 5);
            assert_ne!(acts(&exported(&actor, function, Some(3)), seen), expected, "{function}");
        }
    }
}

/// A file of the operators that move, spread and cut numbers.
fn moving() -> Vec<u8> {
    let nodes = [
        node("Cast", "seen -> cast", &[whole("to", 1)]),
        node("Sub", "cast mean -> less", &[]),
        node("Div", "less spread -> scaled", &[]),
        node("Clip", "scaled least most -> cut", &[]),
        node("Slice", "cut from to axes by -> last", &[]), // numbers 1 and 3
        node("Split", "cut -> half rest", &[whole("axis", -1)]),
        node("Concat", "last half -> four", &[whole("axis", 1)]), // 1, 3, 0, 1
        node("Reshape", "four square -> table", &[]),
        node("Transpose", "table -> turned", &[]), // 1, 0 and 3, 1
        node("Flatten", "turned -> flat", &[whole("axis", 0)]),
        node("Gather", "flat order -> picked", &[whole("axis", 1)]), // 3, 1
        node("Squeeze", "picked front -> bare", &[]),
        node("Unsqueeze", "bare front -> again", &[]),
        node("MatMul", "again matrix -> means", &[]),
        node("Shape", "means -> shape", &[]),
        node("ConstantOfShape", "shape -> zeros", &[]),
        node("Expand", "zeros shape -> more", &[]),
        node("Add", "means more -> sum", &[]),
        node("LeakyRelu", "sum -> leaky", &[float("alpha", 0.5)]),
        node("Identity", "leaky -> acted", &[]),
        node("Softmax", "seen -> unused", &[]),
    ];
    let tensors = [
        floats("mean", &[4], &[1.0, 1.0, 1.0, 1.0]),
        floats("spread", &[1, 1], &[2.0]),
        floats("least", &[], &[-1.0]),
        floats("most", &[], &[1.5]),
        wholes("from", &[1]),
        wholes("to", &[i64::MAX]),
        wholes("axes", &[1]),
        wholes("by", &[2]),
        wholes("square", &[2, -1]),
        wholes("order", &[2, -4]),
        wholes("front", &[0]),
        floats("matrix", &[2, 2], &[0.25, 0.5, 0.125, 0.25]),
    ];
    file(4, &nodes, &tensors, Some("safebench-1"))
}

#[test]
fn operators_that_move_spread_and_cut_numbers_do_what_onnx_says() {
    let weights = Weights::from_bytes(&moving()).unwrap();
    assert_eq!(weights.setting, Setting::Safebench1);
    // ((x - 1) / 2, cut to [-1, 1.5]): -1, 0.5, .., 1.5. Picked: number 3, then 1.
    let action = weights.act(&mut vec![-9.0, 2.0, 0.0, 9.0], &mut Vec::new());
    assert_eq!(action, [1.5 * 0.25 + 0.5 * 0.125, 1.5 * 0.5 + 0.5 * 0.25]);
    let action = weights.act(&mut vec![0.0, -9.0, 0.0, 1.0], &mut Vec::new());
    assert_eq!(action, [-0.125 * 0.5, -0.25 * 0.5]);
}

/// The action of a file whose observation is two numbers `a` and two `b`, and whose nodes end in `c`.
fn compared(nodes: &[Vec<u8>], tensors: &[Vec<u8>], seen: [f32; 4]) -> [f32; ACTION] {
    let split = node("Split", "seen -> a b", &[whole("axis", 1)]);
    let nodes = [&[split], nodes, &[node("Cast", "c -> acted", &[whole("to", 1)])]].concat();
    Weights::from_bytes(&file(4, &nodes, tensors, None)).unwrap().act(&mut seen.to_vec(), &mut Vec::new())
}

#[test]
fn comparisons_and_functions_of_one_and_two_numbers_do_what_onnx_says() {
    type Of = fn(f32, f32) -> f32;
    let cases: [(&str, Of); 21] = [
        ("Greater", |a, b| f32::from(a > b)),
        ("GreaterOrEqual", |a, b| f32::from(a >= b)),
        ("Less", |a, b| f32::from(a < b)),
        ("LessOrEqual", |a, b| f32::from(a <= b)),
        ("Equal", |a, b| f32::from(a == b)),
        ("And", |a, b| f32::from(a > 0.0 && b > 0.0)),
        ("Or", |a, b| f32::from(a > 0.0 || b > 0.0)),
        ("Xor", |a, b| f32::from((a > 0.0) != (b > 0.0))),
        ("Max", |a, b| if a > b { a } else { b }),
        ("Min", |a, b| if a < b { a } else { b }),
        ("PRelu", |a, b| if a < 0.0 { a * b } else { a }),
        ("Not", |a, _| f32::from(a <= 0.0)),
        ("Abs", |a, _| a.abs()),
        ("Neg", |a, _| -a),
        ("Sign", |a, _| if a == 0.0 { 0.0 } else { a.signum() }),
        ("Sqrt", |a, _| if a < 0.0 { 0.0 } else { a.sqrt() }),
        ("Log", |a, _| if a < 0.0 { 0.0 } else { a.ln().max(-1.0) }),
        ("Mish", |a, _| a * a.exp().ln_1p().tanh()),
        ("Celu", |a, _| if a > 0.0 { a } else { a.exp_m1() }),
        ("HardSigmoid", |a, _| (0.2 * a + 0.5).clamp(0.0, 1.0)),
        ("HardSwish", |a, _| a * (a / 6.0 + 0.5).clamp(0.0, 1.0)),
    ];
    let zero = [floats("zero", &[], &[0.0])];
    let positive = |name: &str| node("Greater", &format!("{name} zero -> {name}p"), &[]);
    for (operator, expected) in cases {
        let nodes = match operator {
            "And" | "Or" | "Xor" => vec![positive("a"), positive("b"), node(operator, "ap bp -> c", &[])],
            "Not" => vec![positive("a"), node("Not", "ap -> c", &[])],
            "Greater" | "GreaterOrEqual" | "Less" | "LessOrEqual" | "Equal" | "Max" | "Min" | "PRelu" => {
                vec![node(operator, "a b -> c", &[])]
            }
            _ => vec![node(operator, "a -> c", &[])],
        };
        for seen in [[0.5, 0.25, 0.5, -0.5], [-0.5, -1.0, 0.25, 0.75], [0.0, 0.75, -0.0, 1.0], [-0.25, 0.0, -0.5, 1.0]]
        {
            let found = compared(&nodes, &zero, seen);
            let expected = [expected(seen[0], seen[2]), expected(seen[1], seen[3])];
            let near = found.iter().zip(expected).all(|(found, expected)| (found - expected).abs() < 1e-6);
            assert!(near, "{operator} of {seen:?}: {found:?}, expected {expected:?}");
        }
    }
    let selu = compared(&[node("Selu", "a -> c", &[])], &zero, [-0.5, 0.25, 0.0, 0.0]);
    assert!((selu[0] + 0.691_758_2).abs() < 1e-6 && (selu[1] - 0.262_675_26).abs() < 1e-6, "{selu:?}");
    // 0 / 0 is larger than nothing and equal to nothing.
    let none = [node("Div", "a a -> none", &[]), node("GreaterOrEqual", "none none -> c", &[])];
    assert_eq!(compared(&none, &zero, [0.0, 1.0, 0.0, 0.0]), [0.0, 1.0]);
}

#[test]
fn where_takes_the_second_where_the_first_holds_and_bools_lie_in_files_as_bytes_or_numbers() {
    let chosen = |cond: &str, more: &[Vec<u8>], tensors: &[Vec<u8>], seen| {
        compared(&[more, &[node("Where", &format!("{cond} a b -> c"), &[])]].concat(), tensors, seen)
    };
    let seen = [0.25, -0.5, 0.75, 1.0];
    let is_less = [node("Less", "a limit -> less", &[])];
    let limit = [floats("limit", &[1], &[0.0])];
    assert_eq!(chosen("less", &is_less, &limit, seen), [0.75, -0.5]);
    assert_eq!(chosen("less", &is_less, &limit, [-0.25, 0.5, 0.75, 1.0]), [-0.25, 1.0]);
    let raw = [tensor("mask", 9, &[2], &[1, 0])];
    assert_eq!(chosen("mask", &[], &raw, seen), [0.25, 1.0]);
    let listed = [[number(1, 2), number(2, 9), message(8, "mask"), number(5, 0), number(5, 1)].concat()];
    assert_eq!(chosen("mask", &[], &listed, seen), [0.75, -0.5]);
    let one = [tensor("mask", 9, &[], &[0])];
    assert_eq!(chosen("mask", &[], &one, seen), [0.75, 1.0], "spread");
    // As torch spells `expand(-1, 2)`: lengths of -1 become 1.
    let expand = [
        node("Equal", "asked open -> is_open", &[]),
        node("Where", "is_open ones asked -> lengths", &[]),
        node("Slice", "a from to axes -> first", &[]),
        node("Expand", "first lengths -> c", &[]),
    ];
    let lists = [("asked", [-1, 2]), ("open", [-1, -1]), ("ones", [1, 1])].map(|(name, of)| wholes(name, &of));
    let places = [("from", [0]), ("to", [1]), ("axes", [1])].map(|(name, of)| wholes(name, &of));
    assert_eq!(compared(&expand, &[&lists[..], &places].concat(), seen), [0.25, 0.25]);
    // A choice between whole numbers that hangs on what is seen is a number like others.
    let whole = [is_less[0].clone(), node("Where", "less two none -> c", &[])];
    let whole = compared(&whole, &[limit[0].clone(), wholes("two", &[1, 1]), wholes("none", &[0, 0])], seen);
    assert_eq!(whole, [0.0, 1.0]);
}

fn refusal(bytes: &[u8]) -> String {
    Weights::from_bytes(bytes).unwrap_err().to_string()
}

#[test]
fn what_is_not_read_is_refused_by_node_or_place_with_what_to_do() {
    let heads = [floats("w", &[4, 2], &[0.5; 8]), floats("b", &[2], &[0.0; 2])];
    let one = |operator: &str, attributes: &[Vec<u8>]| {
        file(4, &[node("Gemm", "seen w b -> g", &[]), node(operator, "g -> acted", attributes)], &heads, None)
    };
    let all = |found: String, words: &[&str]| {
        assert!(words.iter().chain(&["expected", "torch.onnx.export"]).all(|word| found.contains(word)), "{found}");
    };
    assert_eq!(Weights::from_bytes(&one("Tanh", &[])).unwrap().setting, Setting::Safebench2, "today's of four numbers");
    all(refusal(&one("Softmax", &[])), &["node \"acted\" (Softmax)", "Gemm, MatMul"]);
    all(
        refusal(&one("Gelu", &[[message(1, "approximate"), message(4, "tanh"), number(20, 3)].concat()])),
        &["acted", "approximat"],
    );
    all(refusal(&one("Tanh", &[float("beta", 2.0)])), &["(Tanh)", "\"beta\""]);
    all(refusal(&one("Not", &[])), &["(Not)", "kind Float", "bool"]);
    all(refusal(&one("Cast", &[whole("to", 7)])), &["(Cast)", "kind 7", "bool (kind 9)"]);
    let two = |operator: &str, words: &str| {
        let nodes = [node("Gemm", "seen w b -> g", &[]), node("Less", "g b -> less", &[]), node(operator, words, &[])];
        file(4, &nodes, &[&heads[..], &[floats("three", &[3], &[0.0; 3])]].concat(), None)
    };
    all(refusal(&two("Add", "less less -> acted")), &["(Add)", "kinds Truth and Truth"]);
    all(refusal(&two("And", "less g -> acted")), &["(And)", "kinds Truth and Float"]);
    all(refusal(&two("Where", "g g g -> acted")), &["(Where)", "kinds Float, Float and Float", "bool"]);
    all(refusal(&two("Where", "less g three -> acted")), &["(Where)", "[1, 2] and [1, 2] and [3]"]);
    all(refusal(&two("Identity", "less -> acted")), &["output \"acted\"", "Truth", "steering and pedal"]);
    let gemm = |nodes: &[Vec<u8>], tensors: &[Vec<u8>]| file(4, nodes, tensors, None);
    let straight = [node("Gemm", "seen w b -> acted", &[])];
    all(refusal(&file(5, &straight, &heads, None)), &["input \"seen\"", "[any, 5]", "126 (metadrive-1)", KEY]);
    all(refusal(&file(4, &straight, &heads, Some("metadrive-1"))), &["metadrive-1\"", "input \"seen\""]);
    all(refusal(&gemm(&straight, &[floats("w", &[4, 3], &[0.5; 12])])), &["(Gemm)", "\"b\""]);
    all(
        refusal(&gemm(&straight, &[floats("w", &[4, 3], &[0.5; 12]), floats("b", &[1], &[0.0])])),
        &["output \"acted\"", "[1, 3]", "steering and pedal"],
    );
    all(refusal(&gemm(&straight, &[floats("w", &[3, 2], &[0.5; 6]), heads[1].clone()])), &["(Gemm)", "one row of 3"]);
    all(refusal(&gemm(&straight, &[floats("w", &[4, 2], &[f32::NAN; 8]), heads[1].clone()])), &["tensor \"w\""]);
    all(
        refusal(&gemm(&straight, &[floats("w", &[4, 2], &[f32::INFINITY; 8]), heads[1].clone()])),
        &["(Gemm)", "finite"],
    );
    all(
        refusal(&gemm(&straight, &[tensor("w", 11, &[4, 2], &[0; 64]), heads[1].clone()])),
        &["tensor \"w\"", "kind 11", "float32"],
    );
    let elsewhere = [tensor("w", 1, &[4, 2], &[]), number(14, 1)].concat();
    all(refusal(&gemm(&straight, &[elsewhere, heads[1].clone()])), &["another file", "external_data=False"]);
    // A table that doubles at each node.
    let doubling = (0..60).map(|i| node("Concat", &format!("t{i} t{i} -> t{}", i + 1), &[whole("axis", 1)]));
    let doubling: Vec<_> = [node("Gemm", "seen w b -> t0", &[])].into_iter().chain(doubling).collect();
    let doubling = [doubling, vec![node("Identity", "t60 -> acted", &[])]].concat();
    all(refusal(&gemm(&doubling, &heads)), &["numbers in all"]);
    let whole = one("Tanh", &[]);
    (5..whole.len()).for_each(|end| all(refusal(&whole[..end]), &["found"]));
}

proptest! {
    #[test]
    fn no_bytes_make_the_reader_or_the_driver_panic(
        places in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
        cut in any::<prop::sample::Index>(),
        kind in 0..3u8,
    ) {
        let mut bytes = if cut.index(2) == 0 { moving() } else { exported(&drawn(&[4, 3, 3, 2 * ACTION]), "gelu", None) };
        match kind {
            0 => bytes.truncate(cut.index(bytes.len())),
            1 => {
                let at = cut.index(bytes.len());
                let piece = bytes[at..(at + 40).min(bytes.len())].to_vec();
                bytes.splice(places[0].0.index(bytes.len()).., piece);
            }
            _ => {}
        }
        if bytes.is_empty() {
            bytes.push(8);
        }
        for (place, byte) in places {
            let at = place.index(bytes.len());
            bytes[at] = byte;
        }
        if let Ok(weights) = Weights::from_bytes(&bytes) {
            weights.act(&mut vec![0.5; weights.setting.length()], &mut Vec::new());
        }
    }
}
