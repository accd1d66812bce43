use std::sync::atomic::Ordering::Relaxed;

use lazygrid_kernels::{Pair, Spheres};

use super::triclinic_filter::TriclinicFilter;
use super::{PairFilter, Xyzr};
use crate::disjoint_writes::{close_gaps, shared};
use crate::executor::Executor;
use crate::frame::SearchFrame;
use crate::memory::try_collect;

/// About 0.2 ms (50 ns per pair of distant spheres).
const CHUNK_PAIRS: usize = 1 << 12;

/// A filter of listed candidates, such as those of a device. In a triclinic frame, its spheres decide most candidates in
/// `f32`.
#[derive(Clone, Debug)]
pub struct CandidateFilter<'a> {
    exact: &'a PairFilter<'a>,
    near: Option<(TriclinicFilter, Spheres<'a>)>,
}

impl<'a> CandidateFilter<'a> {
    /// `searched` are the spheres in `frame`.
    pub(crate) fn new(exact: &'a PairFilter<'a>, frame: Option<&SearchFrame>, searched: Spheres<'a>) -> Self {
        let near = frame.and_then(|frame| TriclinicFilter::for_candidates(frame, Some(exact)));
        Self { exact, near: near.map(|near| (near, searched)) }
    }

    fn accepts(&self, pair: &Pair) -> bool {
        let [possible, certain] = self.near_contact(pair);
        certain || (possible && self.exact.accepts(pair.i, pair.j))
    }

    /// Returns `true` if contact is possible, and if it is certain.
    fn near_contact(&self, pair: &Pair) -> [bool; 2] {
        self.near.as_ref().map_or([true, false], |(near, searched)| {
            let [a, b] = [pair.i, pair.j].map(|k| row(searched, k));
            near.touch(a, b)
        })
    }

    /// Removes rejected pairs, in parallel and without changing the order.
    pub fn retain(&self, pairs: &mut Vec<Pair>, executor: Executor) {
        let none_accepted = std::iter::repeat_n(0_u32, pairs.len().div_ceil(CHUNK_PAIRS));
        let Ok(mut accepted) = try_collect(none_accepted, "chunks of pairs") else {
            return pairs.retain(|pair| self.accepts(pair));
        };
        let counts = shared(&mut accepted);
        executor.for_each_chunk(pairs, CHUNK_PAIRS, |chunk, pairs| {
            let mut count = 0;
            for k in 0..pairs.len() {
                if self.accepts(&pairs[k]) {
                    pairs[count] = pairs[k];
                    count += 1;
                }
            }
            counts[chunk].store(count as u32, Relaxed);
        });
        close_gaps(
            pairs,
            accepted.iter().zip(0..).map(|(&count, chunk)| (chunk * CHUNK_PAIRS, count as usize)),
        );
    }
}

fn row(spheres: &Spheres<'_>, k: u32) -> Xyzr {
    let sphere = spheres.get(k as usize);
    [sphere.center.x, sphere.center.y, sphere.center.z, sphere.radius]
}

#[cfg(test)]
mod tests {
    use lazygrid_kernels::{Exclusions, Query, Space, Sphere};

    use super::*;
    use crate::test_support::Random;
    use crate::{Preparation, QueryBuffers, Settings};

    #[test]
    fn retained_pairs_keep_their_order_on_any_number_of_threads() {
        let count = 3 * CHUNK_PAIRS as u32 + 5;
        let rows = vec![[0.0_f64; 4]; count as usize + 1];
        let is_listed = |k: u32| k.is_multiple_of(7) || k / CHUNK_PAIRS as u32 == 1 || k == count - 1;
        let listed = (0..count).filter(|&k| is_listed(k)).map(|k| (k, k + 1));
        let exclusions = Exclusions::new(rows.len(), listed).expect("all are in range");
        let query = Query::new(&rows).without(&exclusions);
        let exact = PairFilter::new(query, None).expect("exclusions need a filter");
        let filter = CandidateFilter::new(&exact, None, query.first());
        for executor in [Executor::Caller, Executor::Pool] {
            let mut pairs: Vec<_> = (0..count).rev().map(|k| Pair { i: k, j: k + 1 }).collect();
            filter.retain(&mut pairs, executor);
            let expected = (0..count).rev().filter(|&k| !is_listed(k));
            assert!(pairs.iter().map(|pair| pair.i).eq(expected), "{executor:?}");
        }
        filter.retain(&mut Vec::new(), Executor::Pool);
    }

    #[test]
    fn triclinic_frame_decides_most_candidates_as_the_exact_test_does() {
        let cell_vectors = [[1.0, 0.0, 0.0], [0.45, 0.9, 0.0], [-0.3, 0.4, 0.8]];
        let settings = Settings {
            space: Space::triclinic(cell_vectors.map(Some)).expect("a cell"),
            ..Settings::default()
        };
        let mut random = Random(3);
        let spheres: Vec<_> = (0..600).map(|_| Sphere::new(random.point(2.0), 0.1)).collect();
        let wide: Vec<_> = (0..600).map(|_| random.point(2.0).map(f64::from)).collect();
        let wide: Vec<_> = wide.into_iter().map(|[x, y, z]| [x, y, z, 0.1]).collect();
        let bonds = Exclusions::new(600, (0..599).map(|k| (k, k + 1))).expect("all are in range");
        let queries = [Query::new(&spheres), Query::new(&wide)];
        // Without exclusions, contacts are certain.
        let cases = queries.into_iter().flat_map(|query| [(query, 0.02), (query.without(&bonds), 0.2)]);
        for (query, most_undecided) in cases {
            let mut buffers = QueryBuffers::default();
            let preparation = Preparation {
                settings: &settings,
                wraps: false,
                has_same_species: false,
                uses_only_radii: true,
            };
            let prepared = buffers.prepare(&query, preparation, Executor::Caller, &mut Vec::new());
            let prepared = prepared.expect("valid spheres");
            let exact = prepared.filter.as_ref().expect("a frame needs a filter");
            let filter = prepared.candidate_filter().expect("a frame needs a filter");
            let all: Vec<_> = (0..600).flat_map(|i| (i + 1..600).map(move |j| Pair { i, j })).collect();
            let undecided = all.iter().filter(|pair| filter.near_contact(pair) == [true, false]).count();
            assert!((undecided as f64) < most_undecided * all.len() as f64, "{undecided} undecided");
            let expected: Vec<_> = all.iter().copied().filter(|pair| exact.accepts(pair.i, pair.j)).collect();
            let mut found = all.clone();
            filter.retain(&mut found, Executor::Caller);
            assert!(found == expected && !found.is_empty(), "{} of {}", found.len(), expected.len());
        }
    }
}
