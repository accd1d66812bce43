use std::ffi::c_char;
use std::ptr;

use engine::{CandidateListStats as Candidates, Report};
use serde_json::{Map, Value, json};

use crate::OutPtr;
use crate::detector::{DetectorHandle, HandleState, with_detector};
use crate::status::{Status, c_text};

/// Converts a report to JSON, with the names of `lazygrid detect --json`.
fn object(report: &Report) -> Value {
    let phases: Map<String, Value> =
        report.phases.iter().map(|phase| (phase.name.to_owned(), phase.time.as_secs_f64().into())).collect();
    json!({
        "spheres": report.spheres, "pairs": report.pairs, "backend": report.backend.name(),
        "adapter": report.adapter, "algorithm": report.algorithm.name(), "reason": report.reason,
        "gpu": cost(report), "candidates": report.candidates.as_ref().map(candidates), "phases": phases,
    })
}

fn candidates(list: &Candidates) -> Value {
    json!({
        "count": list.count, "age": list.age, "displacement_fraction": list.displacement_fraction,
        "rebuilt": list.rebuilt.map(|why| why.to_string()),
    })
}

#[cfg(feature = "gpu")]
fn cost(report: &Report) -> Value {
    report.cost.as_ref().map_or(Value::Null, |cost| {
        json!({
            "dispatches": cost.dispatches, "working_bytes": cost.working_bytes,
            "pair_bytes": cost.pair_bytes, "traffic_bytes": cost.traffic_bytes,
        })
    })
}

#[cfg(not(feature = "gpu"))]
fn cost(_: &Report) -> Value {
    Value::Null
}

/// Returns the report of the last search.
///
/// # Safety
/// The header's conditions.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn lazygrid_report_json(
    detector: *mut DetectorHandle,
    json: *mut *const c_char,
) -> Status {
    // SAFETY: by this function's condition.
    let json = unsafe { OutPtr::new(json, "json", ptr::null()) };
    let work = |state: &mut HandleState| {
        let json = json?;
        state.report = c_text(object(&state.detector.report()).to_string());
        json.put(state.report.as_ptr());
        Ok(())
    };
    // SAFETY: by this function's condition.
    unsafe { with_detector(detector, work) }
}

/// Estimates the memory for a number of spheres.
///
/// # Safety
/// The header's conditions.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn lazygrid_memory_for(
    detector: *mut DetectorHandle,
    spheres: u64,
    bytes: *mut u64,
) -> Status {
    // SAFETY: by this function's condition.
    let bytes = unsafe { OutPtr::new(bytes, "bytes", 0) };
    let work = |state: &mut HandleState| {
        let bytes = bytes?;
        bytes.put(state.detector.memory_for(spheres));
        Ok(())
    };
    // SAFETY: by this function's condition.
    unsafe { with_detector(detector, work) }
}
