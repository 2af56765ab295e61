//! What the Python package `evodrive` is made of besides Python: environments over the engine's fleets, and the program itself.
//! Nothing here knows numpy: arrays are handed out by `__array_interface__`, and actions are written into one of them.

mod arrays;
mod evaluation;
mod fleet;
mod parallel;
mod picture;
mod policy;
mod scenarios;

use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;

#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

/// A message as the program tells it: a name that was handed over may be without end.
fn bounded(reason: &dyn std::fmt::Display) -> String {
    evodrive::text::cut(&reason.to_string(), 16 << 10).into_owned()
}

/// Something that Python handed over cannot be used.
fn refused(reason: impl std::fmt::Display) -> PyErr {
    PyValueError::new_err(bounded(&reason))
}

/// Something broke that the caller could not have known.
fn broken(reason: impl std::fmt::Display) -> PyErr {
    PyRuntimeError::new_err(bounded(&reason))
}

/// The compiled part of the package `evodrive`.
#[pymodule]
mod _evodrive {
    use pyo3::prelude::*;

    #[pymodule_export]
    use crate::arrays::Sheet;
    #[pymodule_export]
    use crate::evaluation::{evaluate, evaluate_by};
    #[pymodule_export]
    use crate::fleet::Fleet;
    #[pymodule_export]
    use crate::parallel::Shared;
    #[pymodule_export]
    use crate::policy::{observed, step_names, weights, weights_observation};
    #[pymodule_export]
    use crate::scenarios::Scenarios;

    /// The package's version.
    #[pymodule_export]
    #[allow(non_upper_case_globals)]
    const __version__: &str = env!("CARGO_PKG_VERSION");

    /// Runs the program `evodrive` with these words (its own name first) and gives its exit code.
    #[pyfunction]
    fn main(py: Python<'_>, words: Vec<std::ffi::OsString>) -> i32 {
        py.detach(|| {
            let code = evodrive::cli::called_with(words) as i32;
            // Nobody else flushes it: the process ends as Python does.
            let _ = std::io::Write::flush(&mut std::io::stdout());
            code
        })
    }

    /// BLAKE3 of bytes, as the program computes digests: 64 hex digits.
    #[pyfunction]
    fn digest(bytes: &[u8]) -> String {
        evodrive::kernel::Digest::of_bytes(bytes).to_hex()
    }
}
