//! lazygrid as a Python module, `lazygrid._lazygrid`, documented in `_lazygrid.pyi` of the package around it,
//! `package/lazygrid`.

mod arrays;
mod chunks;
mod command;
mod detector;
mod drive;
mod error;
mod exclusions;
mod floats;
mod fork;
mod input;
mod interactions;
mod interruptible;
mod memory;
mod neighbors;
mod pool;
mod read;
mod report;
mod result_memory;
mod settings;
mod simulate;
mod spheres;

#[pyo3::pymodule(name = "_lazygrid", gil_used = false)]
mod module {
    use pyo3::prelude::*;

    #[pymodule_export]
    use crate::chunks::Chunks;
    #[pymodule_export]
    use crate::command::command;
    #[pymodule_export]
    use crate::detector::Detector;
    #[pymodule_export]
    use crate::drive::SimulationCore;
    #[pymodule_export]
    use crate::exclusions::Exclusions;
    #[pymodule_export]
    use crate::interactions::Interactions;
    #[pymodule_export]
    use crate::neighbors::neighbors_within;
    #[pymodule_export]
    use crate::read::{Frame, Frames};
    #[pymodule_export]
    use crate::simulate::simulate;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        crate::fork::watch(module)
    }

    #[pymodule_export]
    const NO_GROUP: u32 = lazygrid::Spheres::NO_GROUP;
    #[pymodule_export]
    const VERSION: &str = env!("CARGO_PKG_VERSION");
}
