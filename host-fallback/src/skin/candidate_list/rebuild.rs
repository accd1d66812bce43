//! The decision of each call to test the candidates again, or to build a new list.

use super::CandidateList;
use crate::Simd;
use crate::cell_list::CellList;
use crate::executor::Executor;
use crate::input::check_valid;
use crate::report::RebuildReason;
use crate::skin::CallSpheres;
use crate::skin::advance::advance;

/// Usable fraction of a displacement limit. The rest exceeds the rounding error of a displacement in `f32`.
const USABLE_FRACTION: f32 = 1.0 - 1.0 / (1 << 16) as f32;

impl CandidateList {
    /// Returns the reason for a rebuild; `None` for a valid list. Drops an invalid list before the call can fail, so
    /// that no later call uses it.
    pub(crate) fn revalidate(
        &mut self,
        current: CallSpheres<'_>,
        list: &CellList,
        simd: Simd,
        executor: Executor,
    ) -> Option<RebuildReason> {
        let spheres = current.test.spheres();
        let Some(input_stats) = self.input_stats.take() else { return Some(RebuildReason::NoList) };
        let has_other_count = spheres.len() != self.order.len();
        let has_other_species = !current.has_same_species;
        let has_other_frame = current.test.frame() != self.frame.as_ref();
        if has_other_count || has_other_species || has_other_frame {
            return Some(RebuildReason::InputChanged);
        }
        let rows = match current.input {
            Some(_) => &mut self.rows[..],
            // An effective radius that depends only on the species hides an invalid radius.
            None if spheres.species().is_some() && check_valid(&spheres.into(), executor).is_err() => {
                return Some(RebuildReason::InputChanged);
            }
            // Later spheres are in no candidate.
            None => &mut self.rows[..list.paired()],
        };
        let (displacement_fraction, has_other_radius_or_frame) =
            advance(current, list.notes(), rows, simd, executor);
        self.displacement_fraction = displacement_fraction;
        self.age += 1;
        match (has_other_radius_or_frame, displacement_fraction <= USABLE_FRACTION) {
            (true, _) => Some(RebuildReason::InputChanged),
            (false, false) => Some(RebuildReason::Displacement),
            (false, true) => {
                self.input_stats = Some(input_stats);
                None
            }
        }
    }
}
