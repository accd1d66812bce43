use lazygrid::Report;
use pyo3::prelude::*;
use pyo3::types::PyDict;

pub(crate) fn dict<'py>(py: Python<'py>, report: &Report) -> PyResult<Bound<'py, PyDict>> {
    let phases = PyDict::new(py);
    for phase in &report.phases {
        phases.set_item(phase.name, phase.time.as_secs_f64())?;
    }
    let gpu = report.cost.as_ref().map(|cost| {
        let gpu = PyDict::new(py);
        gpu.set_item("dispatches", cost.dispatches)?;
        gpu.set_item("working_bytes", cost.working_bytes)?;
        gpu.set_item("pair_bytes", cost.pair_bytes)?;
        gpu.set_item("traffic_bytes", cost.traffic_bytes)?;
        Ok::<_, PyErr>(gpu)
    });
    let candidates = report.candidates.as_ref().map(|stats| {
        let candidates = PyDict::new(py);
        candidates.set_item("count", stats.count)?;
        candidates.set_item("age", stats.age)?;
        candidates.set_item("displacement_fraction", stats.displacement_fraction)?;
        candidates.set_item("rebuilt", stats.rebuilt.map(|why| why.to_string()))?;
        Ok::<_, PyErr>(candidates)
    });
    let dict = PyDict::new(py);
    dict.set_item("spheres", report.spheres)?;
    dict.set_item("pairs", report.pairs)?;
    dict.set_item("backend", report.backend.name())?;
    dict.set_item("adapter", report.adapter.as_deref())?;
    dict.set_item("algorithm", report.algorithm.name())?;
    dict.set_item("reason", &report.reason)?;
    dict.set_item("gpu", gpu.transpose()?)?;
    dict.set_item("candidates", candidates.transpose()?)?;
    dict.set_item("phases", phases)?;
    Ok(dict)
}
