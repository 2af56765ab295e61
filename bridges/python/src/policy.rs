//! Policies as files of weights, and what a setting's numbers are.

use pyo3::prelude::*;
use pyo3::types::PyBytes;

use evodrive::ego::network::{Dense, Mlp};
use evodrive::ego::{Policy, Setting, Weights, arrays};
use evodrive::learn::Step;
use evodrive::learn::fleet::Seeing;

use crate::refused;

/// An observation by its name.
pub fn seeing(name: &str) -> PyResult<Seeing> {
    if name == "arrays-1" {
        return Ok(Seeing::Arrays);
    }
    let setting = Setting::ALL.into_iter().find(|setting| setting.name() == name).map(Seeing::Setting);
    setting.ok_or_else(|| {
        refused(format!(
            "no observation is called {name:?}; there are metadrive-1, safebench-1, safebench-2 and arrays-1"
        ))
    })
}

/// A driver by its name, or by the bytes of its weights.
pub fn driver(name: Option<&str>, weights: Option<&[u8]>) -> PyResult<Policy> {
    match (name, weights) {
        (_, Some(bytes)) => Policy::learned(bytes).map_err(refused),
        (Some(name), None) => name.parse().map_err(refused),
        (None, None) => Ok(Policy::Idm),
    }
}

/// Lowest and highest value of each number of an observation, as two lists of float.
#[pyfunction]
pub fn bounds(observation: &str) -> PyResult<(Vec<f32>, Vec<f32>)> {
    Ok(match seeing(observation)? {
        Seeing::Setting(setting) => setting.bounds(),
        Seeing::Arrays => arrays::bounds(),
    }
    .into_iter()
    .unzip())
}

/// How an observation `arrays-1` is cut: name, rows, numbers a row (rows 0: a single row).
#[pyfunction]
pub fn layout() -> Vec<(&'static str, usize, usize)> {
    let (route, near, lanes) = (arrays::ROUTE, arrays::NEIGHBOURS, arrays::LANES);
    vec![
        ("ego", 0, arrays::EGO),
        ("route", route.0, route.1),
        ("neighbours", near.0, near.1),
        ("lanes", lanes.0, lanes.1),
    ]
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
    let Seeing::Setting(setting) = seeing(observation)? else {
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
