//! Rows of a fleet as numpy sees them: where they lie, of which type and shape.

use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::sync::{Arc, Mutex};

use evodrive::learn;

/// Memory that a fleet owns; it is neither moved nor given back while somebody looks at it.
#[pyclass(frozen)]
pub struct Sheet {
    /// Keeps the memory.
    _owner: Arc<Mutex<learn::Fleet>>,
    at: usize,
    shape: Vec<usize>,
    kind: &'static str,
    read_only: bool,
}

impl Sheet {
    /// A view for numpy.
    pub fn new(
        owner: &Arc<Mutex<learn::Fleet>>,
        at: usize,
        kind: &'static str,
        shape: Vec<usize>,
        read_only: bool,
    ) -> Sheet {
        Sheet { _owner: owner.clone(), at, shape, kind, read_only }
    }
}

#[pymethods]
impl Sheet {
    /// numpy's array interface, version 3.
    #[getter(__array_interface__)]
    fn array_interface<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let dict = PyDict::new(py);
        dict.set_item("shape", pyo3::types::PyTuple::new(py, &self.shape)?)?;
        dict.set_item("typestr", self.kind)?;
        dict.set_item("data", (self.at, self.read_only))?;
        dict.set_item("version", 3)?;
        Ok(dict)
    }
}
