use lazygrid_kernels::Algorithm;

use crate::Settings;
use crate::test_support::{assert_matches_naive, assert_threads_match_naive};

fn settings(cell_ratio: f32) -> Settings {
    Settings { algorithm: Algorithm::RecursiveGrid, cell_ratio, ..Settings::default() }
}

#[test]
fn agrees_with_all_pairs() {
    for (ratio, tau) in [(0.5, 0), (1.0, 1), (3.0, 5), (1.0, Settings::TAU), (16.0, 0), (3.0, u32::MAX)] {
        assert_matches_naive(&Settings { tau, ..settings(ratio) });
    }
}

#[test]
fn threads_share_the_work() {
    for tau in [0, Settings::TAU, 1000] {
        assert_threads_match_naive(&Settings { tau, ..settings(Settings::CELL_RATIO) });
    }
}
