//! Policies as files of weights, and what a setting's numbers are.

use pyo3::prelude::*;
use pyo3::types::PyBytes;

use evodrive::ego::network::{Dense, Mlp};
use evodrive::ego::{Arrays, Policy, Setting, Weights, arrays, observation};
use evodrive::learn::Step;
use evodrive::learn::fleet::{Kind, Seeing};

use crate::refused;

/// An observation as Python says it: what is None is as in the standard one of this name.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Observed {
    name: String,
    neighbours: Option<f64>,
    range_m: Option<f64>,
    lanes: Option<f64>,
    lanes_range_m: Option<f64>,
    goal: bool,
    stack: f64,
}

/// Most moments of a stack.
const STACK_MAX: usize = 64;
/// Farthest that anything is seen, metres.
const RANGE_MAX_M: f64 = 500.0;

fn kind(name: &str) -> PyResult<Kind> {
    if name == "arrays-1" {
        return Ok(Kind::Arrays(Arrays::default()));
    }
    let setting = Setting::ALL.into_iter().find(|setting| setting.name() == name).map(Kind::Setting);
    setting.ok_or_else(|| {
        refused(format!(
            "no observation is called {name:?}; there are metadrive-1, safebench-1, safebench-2 and arrays-1"
        ))
    })
}

/// What is shown.
pub fn seeing(of: &Observed) -> PyResult<Seeing> {
    let whole = |name: &str, given: f64, most: usize| {
        let fits = given.fract() == 0.0 && (1.0..=most as f64).contains(&given);
        let expected = format!("expected a whole number from 1 to {most}");
        if fits { Ok(given as usize) } else { Err(refused(format!("observation: {name} is {given}; {expected}"))) }
    };
    let metres = |name: &str, given: f64| match given {
        0.0..=RANGE_MAX_M => Ok(given),
        _ => Err(refused(format!("observation: {name} is {given}; expected metres from 0 to {RANGE_MAX_M}"))),
    };
    let ranges = [("range_m", of.range_m), ("lanes", of.lanes), ("lanes_range_m", of.lanes_range_m)];
    let of_arrays = ranges.into_iter().chain([("goal", of.goal.then_some(1.0))]).find(|(_, given)| given.is_some());
    let kind = match (kind(&of.name)?, of_arrays, of.neighbours) {
        (Kind::Arrays(standard), _, neighbours) => Kind::Arrays(Arrays {
            neighbours: neighbours
                .map_or(Ok(standard.neighbours), |n| whole("neighbours", n, arrays::NEIGHBOURS_MAX))?,
            range_m: of.range_m.map_or(Ok(standard.range_m), |m| metres("range_m", m))?,
            lanes: of.lanes.map_or(Ok(standard.lanes), |n| whole("lanes", n, arrays::LANES_MAX))?,
            lanes_range_m: of.lanes_range_m.map_or(Ok(standard.lanes_range_m), |m| metres("lanes_range_m", m))?,
            goal: of.goal,
        }),
        (_, Some((odd, _)), _) => {
            return Err(refused(format!("observation: {odd} goes with arrays-1; {} has none", of.name)));
        }
        (Kind::Setting(Setting::Metadrive1), None, Some(neighbours)) => {
            match whole("neighbours", neighbours, observation::NEIGHBOURS_MAX)? {
                observation::NEIGHBOURS => Kind::Setting(Setting::Metadrive1),
                other => Kind::Neighbours(other),
            }
        }
        (_, None, Some(_)) => {
            return Err(refused(format!(
                "observation: neighbours goes with metadrive-1 and arrays-1; {} has none",
                of.name
            )));
        }
        (kind, None, None) => kind,
    };
    Ok(Seeing { kind, stack: whole("stack", of.stack, STACK_MAX)? })
}

/// A driver by its name, or by the bytes of its weights.
pub fn driver(name: Option<&str>, weights: Option<&[u8]>) -> PyResult<Policy> {
    match (name, weights) {
        (_, Some(bytes)) => Policy::learned(bytes).map_err(refused),
        (Some(name), None) => name.parse().map_err(refused),
        (None, None) => Ok(Policy::Idm),
    }
}

/// Name, rows (0: a single one) and numbers a row.
type Part = (&'static str, usize, usize);

/// What an observation is: whether it is the standard one of its name; lowest and highest value of each number of one moment; and how
/// one of `arrays-1` is cut.
#[pyfunction]
pub fn observed(observation: Observed) -> PyResult<(bool, Vec<f32>, Vec<f32>, Vec<Part>)> {
    let seeing = seeing(&observation)?;
    let (low, high) = seeing.bounds().into_iter().unzip();
    let parts = if let Kind::Arrays(arrays) = seeing.kind { arrays.parts() } else { Vec::new() };
    Ok((seeing == Seeing { kind: kind(&observation.name)?, stack: 1 }, low, high, parts))
}

/// What the numbers of the array `step` are called.
#[pyfunction]
pub fn step_names() -> [&'static str; 6] {
    Step::NAMES
}

/// One layer as Python holds it: rows of weights an output, and a bias an output.
type Layer = (Vec<Vec<f32>>, Vec<f32>);

/// The bytes of a file of weights: one to eight hidden layers with their activation, and the layer of the action's means. `squash` is what
/// the means become an action by: `tanh`, or `clip` to [-1, 1].
#[pyfunction]
pub fn weights<'py>(
    py: Python<'py>,
    observation: &str,
    layers: Vec<Layer>,
    activation: &str,
    squash: &str,
) -> PyResult<Bound<'py, PyBytes>> {
    let Kind::Setting(setting) = kind(observation)? else {
        return Err(refused(
            "weights drive by metadrive-1, safebench-1 or safebench-2; arrays-1 is for encoders of your own",
        ));
    };
    let mut read = Vec::new();
    for (rows, bias) in layers {
        let (outputs, inputs) = (rows.len(), rows.first().map_or(0, Vec::len));
        if bias.len() != outputs || rows.iter().any(|row| row.len() != inputs) {
            let found = format!("{outputs} rows and {} biases", bias.len());
            return Err(refused(format!("a layer has {found}; expected rows of one length and a bias each")));
        }
        // The engine keeps a row an input.
        let turned = (0..inputs).flat_map(|i| rows.iter().map(move |row| row[i])).collect();
        read.push(Dense { inputs, outputs, weights: turned, bias });
    }
    if let Some(means) = read.last_mut().filter(|means| means.outputs > 0) {
        // The file also has a head of standard deviations, which nobody reads when driving.
        let outputs = means.outputs;
        let widened = means.weights.chunks_exact(outputs).flat_map(|row| {
            let mut row = row.to_vec();
            row.resize(2 * outputs, 0.0);
            row
        });
        means.weights = widened.collect();
        means.bias.resize(2 * outputs, 0.0);
        means.outputs = 2 * outputs;
    }
    let form = Weights::form(activation, squash).map_err(refused)?;
    let bytes = Weights::to_bytes_as(setting, &Mlp { layers: read }, form).map_err(refused)?;
    Ok(PyBytes::new(py, &bytes))
}

/// The observation that a file of weights drives by; refuses bytes that are no weights.
#[pyfunction]
pub fn weights_observation(bytes: &[u8]) -> PyResult<&'static str> {
    Ok(Weights::from_bytes(bytes).map_err(refused)?.setting.name())
}
