use std::path::Path;
use std::sync::Arc;

use lazygrid_io::read::ArrayFile;
use lazygrid_scenario::{self as file, Finite, Positive};

use super::checks::{refuse_keys, span_of};
use crate::Error;
use crate::memory::check_available;
use crate::model::flow_field::FlowField;
use crate::scenario::Problem;

pub(super) fn read(flow: &file::Flow, directory: &Path) -> Result<Arc<FlowField>, Problem> {
    refuse_keys([("velocity", span_of(&flow.velocity)), ("speed", span_of(&flow.speed))], |_| {
        "the velocities of a field are in its file; remove this key".to_owned()
    })?;
    let (Some(file), Some(spacing)) = (&flow.file, &flow.spacing) else {
        let message = "a field needs a file, and the spacing of its points along each axis";
        return Err(Problem::at(flow.profile.span(), message.to_owned()));
    };
    let fault = |message: String| Problem::at(file.span(), message);
    let array = ArrayFile::open(directory.join(file.get_ref())).map_err(|error| fault(error.to_string()))?;
    let &[nx, ny, nz, 3] = array.shape() else {
        let shape = array.shape();
        return Err(fault(format!(
            "the array has the shape {shape:?}; it must be (nx, ny, nz, 3), with velocities in µm/s"
        )));
    };
    check_memory([nx, ny, nz]).map_err(|error| fault(error.to_string()))?;
    let velocities = array.read().map_err(|error| fault(error.to_string()))?;
    let origin = flow.origin.as_ref().map_or([0.0; 3], |origin| origin.get_ref().map(|Finite(x)| x));
    let origin_and_spacing = [origin, spacing.get_ref().map(|Positive(h)| h)];
    let field = FlowField::new(origin_and_spacing, [nx, ny, nz].map(|n| n as usize), velocities);
    field.map(Arc::new).map_err(|error| fault(error.to_string()))
}

fn check_memory(points: [u64; 3]) -> Result<(), Error> {
    let count = points.into_iter().fold(1, u64::saturating_mul);
    let remedy = "give it fewer points, or raise the limit";
    let what = format!("{count} points of a flow field");
    check_available(&what, count.saturating_mul(FlowField::BYTES_PER_POINT), remedy)
}

pub(super) fn check_unused(flow: &file::Flow) -> Result<(), Problem> {
    let keys = [
        ("file", span_of(&flow.file)),
        ("origin", span_of(&flow.origin)),
        ("spacing", span_of(&flow.spacing)),
    ];
    refuse_keys(keys, |key| format!("{key} goes with profile = \"field\""))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn field_beyond_the_memory_is_refused() {
        if lazygrid_io::available_memory().is_some() {
            let error = check_memory([1 << 16; 3]).unwrap_err().to_string();
            assert!(
                error.starts_with("281474976710656 points of a flow field need 3377699720527872"),
                "{error}"
            );
        }
        assert!(check_memory([100; 3]).is_ok());
    }
}
