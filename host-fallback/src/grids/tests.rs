use lazygrid_kernels::Algorithm;

use crate::Settings;
use crate::test_support::{assert_matches_naive, assert_threads_match_naive};

fn settings(algorithm: Algorithm, cell_ratio: f32, tau: u32) -> Settings {
    Settings { algorithm, cell_ratio, tau, ..Settings::default() }
}

#[test]
fn grids_agree_with_all_pairs() {
    for ratio in [0.5, 1.0, 1.5, 3.0, 16.0] {
        for algorithm in [Algorithm::ArrayGrid, Algorithm::HashGrid] {
            assert_matches_naive(&settings(algorithm, ratio, Settings::TAU));
        }
    }
    for (ratio, tau) in [(0.5, 0), (1.0, 1), (3.0, 5), (1.0, Settings::TAU), (16.0, 0), (3.0, u32::MAX)] {
        assert_matches_naive(&settings(Algorithm::RecursiveGrid, ratio, tau));
    }
}

#[test]
fn threads_share_the_work() {
    let grids = [Algorithm::ArrayGrid, Algorithm::HashGrid].map(|algorithm| (algorithm, Settings::TAU));
    let recursive = [0, Settings::TAU, 1000].map(|tau| (Algorithm::RecursiveGrid, tau));
    for (algorithm, tau) in grids.into_iter().chain(recursive) {
        assert_threads_match_naive(&settings(algorithm, Settings::CELL_RATIO, tau));
    }
}
