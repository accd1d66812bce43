//! Hierarchical cell list: every sphere in the one cell of its centre, at the level of its size.
//!
//! Mapping a sphere to every cell it overlaps, as the paper's grids do, costs several entries per sphere; here it
//! is one. All levels are sorted together, since a level's cells follow the coarser level's in one numbering. Each
//! sphere then looks at the cells around it: at its own level only at spheres later in the order, at coarser levels
//! at all. A pair is thus met once, from its finer sphere or, within a level, from its earlier one.
//!
//! `crowding` estimates, `levels` plans, `sort` builds, `search` finds.

mod crowding;
mod levels;
mod raster;
mod search;
mod sort;

use crate::{Error, Survey};
use crate::columns::Columns;
use crate::detector::Input;
use crate::report::Report;
use crate::simd::Vector;
use crate::sink::Output;
use crate::survey::CLASSES;
use crowding::Crowding;
use levels::{CELLS_PER_SPHERE, Levels};
use raster::Raster;
use sort::Sorter;

/// Table entries per level at most, so that 32 bits number the entries of all levels.
const MAX_CELLS: u64 = 1 << 26;

/// The structure and its buffers, which survive between calls.
#[derive(Debug, Default)]
pub(crate) struct CellList {
    /// Coarsest first.
    levels: Vec<Placed>,
    /// The spheres, level by level and cell by cell.
    columns: Columns,
    /// Where each cell's spheres start in `columns`; one more than there are cells.
    starts: Vec<u32>,
    sorter: Sorter,
}

/// One level of the plan, placed in the table.
#[derive(Clone, Debug)]
struct Placed {
    raster: Raster,
    /// Table entry of its first cell.
    base: usize,
    /// The spheres of this level in the columns.
    members: std::ops::Range<usize>,
}

/// Where each sphere belongs in the table.
#[derive(Clone, Copy)]
struct Places<'p> {
    levels: &'p [Placed],
    of_class: &'p [u8; CLASSES],
}

impl Places<'_> {
    /// How many entries the table has.
    fn cells(&self) -> usize {
        self.levels.last().map_or(0, |level| level.base + level.raster.cells() as usize)
    }

    /// The table entry of a sphere.
    #[inline(always)]
    fn cell_of<V: Vector>(&self, vector: V, [x, y, z, radius]: [f32; 4]) -> u32 {
        let level = &self.levels[usize::from(self.of_class[Survey::class_of(radius)])];
        (level.base + level.raster.index(level.raster.cell_of(vector, [x, y, z]))) as u32
    }
}

impl CellList {
    /// Plans and builds for these spheres.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`].
    pub(crate) fn build(&mut self, input: &Input<'_>, report: &mut Report) -> Result<(), Error> {
        let Survey { min, max, .. } = input.survey;
        let plan = report.time("plan", || Levels::plan(&input.survey, &Crowding::sample(input)));
        let (mut base, mut from) = (0, 0);
        self.levels.clear();
        for level in &plan.levels {
            let most = ((level.spheres as f32 * CELLS_PER_SPHERE) as u64).min(MAX_CELLS);
            let raster = Raster::new(level.edge, (min, max), level.largest, most);
            log::trace!("level of {} spheres: edge {}, raster {:?}", level.spheres, level.edge, raster.size);
            let (cells, to) = (raster.cells() as usize, from + level.spheres as usize);
            self.levels.push(Placed { raster, base, members: from..to });
            (base, from) = (base + cells, to);
        }
        let places = Places { levels: &self.levels, of_class: &plan.of_class };
        report.time("sort", || {
            self.sorter.reserve((from, base), &mut self.columns, &mut self.starts)?;
            self.sorter.sort(input, places, &mut self.columns, &mut self.starts);
            Ok(())
        })
    }

    /// Finds all pairs.
    pub(crate) fn search<'o, O: Output>(&self, input: &Input<'_>, output: &'o O) -> O::Sink<'o> {
        search::search(self, input, output)
    }

    /// An upper estimate of the bytes held for `spheres` spheres.
    pub(crate) fn memory_for(spheres: u64) -> u64 {
        let cells = (CELLS_PER_SPHERE as u64 * spheres).max(64);
        spheres * (Columns::BYTES_PER_SPHERE + Sorter::BYTES_PER_SPHERE) + 4 * cells
    }
}
