use glam::DVec3;

/// Maximum steps of the lattice reduction. Valid boxes need some hundreds.
const MAX_REDUCTION_STEPS: usize = 1 << 16;
/// Gain that a swap of the reduction requires, so that rounding cannot make it cycle (Lovász's δ).
const LLL_DELTA: f64 = 0.99;

pub(super) fn combination(basis: &[DVec3; 3], counts: [f64; 3]) -> DVec3 {
    basis[0] * counts[0] + basis[1] * counts[1] + basis[2] * counts[2]
}

pub(super) fn power_of_two_below(number: f64) -> f64 {
    const FRACTION: u64 = (1 << 52) - 1;
    if number < f64::MIN_POSITIVE {
        return f64::MIN_POSITIVE;
    }
    f64::from_bits(number.to_bits() & !FRACTION)
}

pub(super) fn orthogonal_part(basis: &[DVec3], k: usize) -> DVec3 {
    let mut rest = basis[k];
    for before in 0..k {
        let orthogonal = orthogonal_part(basis, before);
        rest -= orthogonal * (rest.dot(orthogonal) / orthogonal.length_squared());
    }
    rest
}

/// Reduces the basis without changing the images.
pub(super) fn reduce(basis: &mut [DVec3], multiples: &mut [[f64; 3]; 3]) {
    let mut k = 1;
    for _ in 0..MAX_REDUCTION_STEPS {
        if k >= basis.len() {
            return;
        }
        for before in (0..k).rev() {
            let orthogonal = orthogonal_part(basis, before);
            let count = (basis[k].dot(orthogonal) / orthogonal.length_squared()).round();
            basis[k] -= basis[before] * count;
            let taken = multiples[before];
            (0..3).for_each(|column| multiples[k][column] -= count * taken[column]);
        }
        let before = orthogonal_part(basis, k - 1);
        let along = basis[k].dot(before) / before.length_squared();
        if orthogonal_part(basis, k).length_squared() >= (LLL_DELTA - along * along) * before.length_squared()
        {
            k += 1;
        } else {
            basis.swap(k, k - 1);
            multiples.swap(k, k - 1);
            k = (k - 1).max(1);
        }
    }
}

pub(super) fn completed(mut basis: [DVec3; 3], rank: usize) -> [DVec3; 3] {
    match rank {
        1 => (basis[1], basis[2]) = basis[0].normalize().any_orthonormal_pair(),
        2 => basis[2] = basis[0].normalize().cross(basis[1].normalize()).normalize(),
        _ => {}
    }
    basis
}

pub(super) fn inverse([a, b, c]: &[DVec3; 3]) -> [DVec3; 3] {
    let volume = a.dot(b.cross(*c));
    [b.cross(*c) / volume, c.cross(*a) / volume, a.cross(*b) / volume]
}

pub(super) fn heights(inverse: &[DVec3; 3]) -> [f64; 3] {
    inverse.map(|row| row.length().recip())
}
