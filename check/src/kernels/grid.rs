use bytemuck::Zeroable;
use glam::Vec3;
use lazygrid::gpu::GpuDevice;
use lazygrid::{Space, Sphere};
use lazygrid_kernels::kernel::{self as k, Variant};
use lazygrid_kernels::layout::{Bounds, Grid, SearchParams};

use super::kernel_call::KernelCall;
use super::support::{KernelError, ordered, same};
use crate::Random;
use crate::scenes::periodic;

const KEY_BITS: u32 = 24;

fn scene(count: usize, radii: &[f32], space: Space) -> Vec<Sphere> {
    let mut random = Random(count as u64);
    let mut coordinate = || random.unit() * 20.0 - 7.0;
    let sphere =
        |k: usize| Sphere::new(space.wrap([(); 3].map(|()| coordinate()).into()), radii[k % radii.len()]);
    (0..count).map(sphere).collect()
}

fn extent(spheres: &[Sphere]) -> [Vec3; 2] {
    let corner = |sign: f32| spheres.iter().map(move |sphere| sphere.center + sign * sphere.radius);
    [corner(-1.0).fold(Vec3::INFINITY, Vec3::min), corner(1.0).fold(Vec3::NEG_INFINITY, Vec3::max)]
}

fn bounds(spheres: &[Sphere]) -> Bounds {
    let [low, high] = extent(spheres);
    let radii = || spheres.iter().map(|sphere| sphere.radius.to_bits());
    Bounds {
        low: low.to_array().map(ordered),
        high: high.to_array().map(ordered),
        radius_min: radii().min().unwrap_or(u32::MAX),
        radius_max: radii().max().unwrap_or(0),
        ..Bounds::zeroed()
    }
}

pub(crate) fn grid_configure(gpu: &GpuDevice) -> Result<(), KernelError> {
    let spaces = [[None; 3], [Some(20.0), None, Some(1e3)], [Some(3.0); 3]];
    for (count, lengths) in [1, 200, 256].into_iter().flat_map(|count| spaces.map(|space| (count, space))) {
        for radii in [&[0.5_f32][..], &[0.5, 0.01]] {
            let space = periodic::space(lengths);
            let spheres = scene(count, radii, space);
            let case = |what: &str| format!("{what} of {count} spheres of radii {radii:?} in {lengths:?}");
            let settings = SearchParams {
                cell_ratio: 2.0,
                key_bits: KEY_BITS,
                split_policy: 2,
                ..SearchParams::zeroed()
            };
            let settings = settings.in_space(space);
            let call = KernelCall::new(gpu)
                .with("params", &[settings])?
                .with("spheres", &spheres)?
                .with("bounds", &[bounds(&spheres)])?
                .with_layout("grid", &Grid { spheres: count as u32, ..Grid::zeroed() })?;
            let variant = Variant { periodic: space.is_periodic(), ..Variant::default() };
            call.run(&k::GRID_CONFIGURE, variant, 1)?;
            let grid = call.read_layout::<Grid>("grid")?;
            let fits = count > 1 && radii.len() > 1;
            let levels = [grid.split_policy, grid.level_mask, grid.depth_mask, grid.passive, grid.ordinary];
            same(|| case("levels"), &levels, &[2 * u32::from(fits), 1, 1, 0, 1])?;
            let width = 2.0 * settings.cell_ratio * radii[0];
            for (axis, length) in lengths.into_iter().enumerate() {
                let sound = match length {
                    None => open_axis(&grid, axis, width, &spheres),
                    Some(length) => ring(&grid, axis, width, length),
                };
                sound.map_err(|text| {
                    KernelError::WrongResult(case(&format!("axis {axis}, {text}, {grid:?}")))
                })?;
            }
            let bits = grid.levels[0].bits;
            let fewest = (0..3).all(|axis| wanted_bits(&grid, axis) == bits[axis]);
            let folded = bits.element_sum() <= KEY_BITS && bits.cmpge(glam::UVec3::splat(3)).all();
            same(|| case(&format!("{bits:?} bits suffice")), &(fewest || folded), &true)?;
        }
    }
    Ok(())
}

fn wanted_bits(grid: &Grid, axis: usize) -> u32 {
    match grid.ring_cells[axis] {
        0.0 => u32::BITS - (grid.high[axis].abs_diff(grid.low[axis])).leading_zeros(),
        turns if turns < 4.0 => 0,
        turns => u32::BITS - (turns as u32 - 1).leading_zeros(),
    }
}

fn open_axis(grid: &Grid, axis: usize, width: f32, spheres: &[Sphere]) -> Result<(), String> {
    let mut coordinates: Vec<f32> = spheres.iter().map(|sphere| sphere.center[axis]).collect();
    coordinates.sort_by(f32::total_cmp);
    let (median, origin) = (coordinates[coordinates.len() / 2], grid.origin[axis]);
    if origin != median {
        return Err(format!("starts at {origin}, not {median}"));
    }
    let cell_size = 1.0 / grid.inverse_edge[axis];
    if !(0.9999 * width..1.02 * width).contains(&cell_size) {
        return Err(format!("cell size {cell_size}, not {width}"));
    }
    let cell = |corner: Vec3| ((corner[axis] - origin) * grid.inverse_edge[axis]).floor() as i32;
    let [low, high] = extent(spheres).map(cell);
    match [grid.low[axis], grid.high[axis]] == [low, high] && grid.ring_cells[axis] == 0.0 {
        true => Ok(()),
        false => Err(format!("cells {low} to {high}")),
    }
}

fn ring(grid: &Grid, axis: usize, width: f32, length: f32) -> Result<(), String> {
    let turns = grid.ring_cells[axis];
    let whole = if turns >= 4.0 { turns % 4.0 == 0.0 } else { turns.log2().fract() == 0.0 };
    if !whole || length / turns < width {
        return Err(format!("{turns} cells of at least {width} in a length of {length}"));
    }
    let (corner, inverse) = (grid.origin[axis], grid.inverse_edge[axis]);
    if corner != -0.5 * length || !(0.999_999..1.000_001).contains(&(inverse * length / turns)) {
        return Err(format!("starts at {corner} with {inverse} cells per unit of length"));
    }
    let cells = [grid.low[axis], grid.high[axis]];
    if cells == [-1, turns as i32 + 1] { Ok(()) } else { Err(format!("cells {cells:?}")) }
}
