use bytemuck::Zeroable;
use lazygrid::Sphere;
use lazygrid::gpu::GpuDevice;
use lazygrid_kernels::kernel::Variant;
use lazygrid_kernels::layout::{Outcome, SearchParams};

use super::cell_list::expected_stats;
use super::cells::{CellListInput, configure};
use super::division::Division;
use super::support::{KernelError, changed, same};
use crate::Effort;

const EXTENTS: [[f32; 3]; 3] = [[1000.0; 3], [1000.0, 1000.0, 0.0], [1000.0, 0.0, 0.0]];
/// Radius at which the bounds hold far more cells than the table.
const RADIUS: f32 = 1.0 / 1024.0;

/// Tries table sizes around every number at which one more cell fits.
pub(crate) fn cells_along_axes(gpu: &GpuDevice, effort: Effort) -> Result<(), KernelError> {
    let roots: Vec<u32> = match effort {
        Effort::Quick => vec![3, 7, 64],
        Effort::Default => (3..=40).chain([97, 98, 125, 200, 250]).collect(),
        Effort::Full => (3..=322).collect(),
    };
    for extent in EXTENTS {
        let long = extent.iter().filter(|length| **length > 0.0).count() as u32;
        for &root in &roots {
            let full = root.pow(long);
            for capacity in full - 1..=full + 1 {
                let fits = |cells: &u32| cells.pow(long) <= capacity;
                let expected = (root - 1..=root + 1).rev().find(fits).unwrap_or(0);
                if expected < 3 {
                    continue;
                }
                let cells = extent.map(|length| if length > 0.0 { expected } else { 1 });
                let case = || format!("cells along {extent:?} with room for {capacity}");
                same(case, &configured(gpu, extent, capacity)?, &cells)?;
            }
        }
    }
    Ok(())
}

fn configured(gpu: &GpuDevice, extent: [f32; 3], capacity: u32) -> Result<[u32; 3], KernelError> {
    let corner = |k: usize| [0, 1, 2].map(|axis| if k >> axis & 1 == 1 { extent[axis] } else { 0.0 });
    let spheres: Vec<_> = (0..16).map(|k| Sphere::new(corner(k), RADIUS)).collect();
    let call = SearchParams {
        spheres: 16,
        cells: capacity,
        cell_ratio: 1.0,
        tau: u32::MAX,
        occupancy_slots: 512,
        window_end: u32::MAX,
        tiles_per_submission: SearchParams::UNLIMITED,
        ..SearchParams::zeroed()
    };
    let (one_set, variant) = (Division::OneSet, Variant::default());
    let before = changed(Outcome::zeroed(), |new| new.dispatch_z = 1);
    let stats = expected_stats(&spheres, one_set, false);
    let input = CellListInput { spheres: &spheres, stats, division: one_set };
    let configured = configure(gpu, one_set.divide(call), variant, input, before)?;
    Ok(configured.list.level[0].cells.to_array())
}
