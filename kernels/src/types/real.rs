use std::mem::MaybeUninit;

use crate::InputError;

/// A coordinate type: `f32` or `f64`.
pub trait Real: sealed::Sealed {}

impl Real for f32 {}
impl Real for f64 {}

pub(crate) mod sealed {
    use super::{Strided, Wide};

    #[expect(unnameable_types, reason = "nothing else is a coordinate type")]
    pub trait Sealed: Copy + Into<f64> + Send + Sync + 'static {
        fn narrow(columns: [&[Self]; 4]) -> Option<[&[f32]; 4]>;
        fn wide(strided: Strided<'_, Self>) -> Wide<'_>;
    }

    impl Sealed for f32 {
        fn narrow(columns: [&[Self]; 4]) -> Option<[&[f32]; 4]> {
            Some(columns)
        }

        fn wide(strided: Strided<'_, Self>) -> Wide<'_> {
            Wide::F32(strided)
        }
    }

    impl Sealed for f64 {
        fn narrow(_: [&[Self]; 4]) -> Option<[&[f32]; 4]> {
            None
        }

        fn wide(strided: Strided<'_, Self>) -> Wide<'_> {
            Wide::F64(strided)
        }
    }
}

/// The radii of points.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub enum Radii<'a, T> {
    /// One radius for all: half a cutoff finds the points within the cutoff.
    All(T),
    /// One radius per point.
    Each(&'a [T]),
}

/// Columns in strided memory.
#[derive(Clone, Copy, Debug)]
pub struct Strided<'a, T> {
    /// Columns from the first sphere's value. Memory between values may be uninitialized and is not read.
    axes: [&'a [MaybeUninit<T>]; 3],
    step: usize,
    radii: Source<'a, T>,
    count: usize,
}

#[derive(Clone, Copy, Debug)]
enum Source<'a, T> {
    All(T),
    /// A column like `axes`, and its step.
    Each(&'a [MaybeUninit<T>], usize),
}

#[derive(Clone, Copy, Debug)]
#[expect(unnameable_types, reason = "part of the sealed `Real`")]
pub enum Wide<'a> {
    F32(Strided<'a, f32>),
    F64(Strided<'a, f64>),
}

/// Widens numbers to `f64`. `array::map` is not always inlined.
#[inline(always)]
#[doc(hidden)]
pub fn widened<T: Into<f64>>([x, y, z, radius]: [T; 4]) -> [f64; 4] {
    [x.into(), y.into(), z.into(), radius.into()]
}

fn maybe<T>(values: &[T]) -> &[MaybeUninit<T>] {
    // SAFETY: `MaybeUninit<T>` has the layout of `T`, and a shared slice of it cannot be written through.
    unsafe { &*(std::ptr::from_ref(values) as *const [MaybeUninit<T>]) }
}

impl<'a, T: Copy> Strided<'a, T> {
    pub(crate) fn from_columns([x, y, z, r]: [&'a [T]; 4]) -> Self {
        Self { axes: [x, y, z].map(maybe), step: 1, radii: Source::Each(maybe(r), 1), count: x.len() }
    }

    pub(crate) fn from_points(centers: &'a [[T; 3]], radii: Radii<'a, T>) -> Result<Self, InputError> {
        let radii = match radii {
            Radii::All(radius) => Source::All(radius),
            Radii::Each(radii) if radii.len() != centers.len() => {
                let (length, expected) = (radii.len(), centers.len());
                return Err(InputError::Lengths { what: "radii", length, expected });
            }
            Radii::Each(radii) => Source::Each(maybe(radii), 1),
        };
        let values = centers.as_flattened();
        let axes = [0, 1, 2].map(|axis| maybe(values.get(axis..).unwrap_or(&[])));
        Ok(Self { axes, step: 3, radii, count: centers.len() })
    }

    /// Creates strided spheres from columns `x, y, z, r`. `steps` are the numbers of values from one center and one
    /// radius to the next; a radius step of 0 shares one radius.
    ///
    /// # Safety
    /// For every `k` below `count`, value `k * steps[0]` of the first three columns and value `k * steps[1]` of the
    /// last one must be inside the column and initialized.
    pub unsafe fn from_parts(columns: [&'a [MaybeUninit<T>]; 4], steps: [usize; 2], count: usize) -> Self {
        let ([x, y, z, r], [step, radius_step]) = (columns, steps);
        Self { axes: [x, y, z], step, radii: Source::Each(r, radius_step), count }
    }

    pub(crate) fn len(&self) -> usize {
        self.count
    }

    /// # Panics
    /// If `i` is not below the number of spheres.
    #[inline(always)]
    #[doc(hidden)]
    pub fn get(&self, i: usize) -> [T; 4] {
        assert!(i < self.count, "sphere {i} of {}", self.count);
        // SAFETY: `i` is below `count`. The values of these spheres are inside their columns and initialized: the
        // columns are initialized slices of these lengths, or `from_parts` required it.
        let value =
            |values: &[MaybeUninit<T>], step: usize| unsafe { values.get_unchecked(i * step).assume_init() };
        let [x, y, z] = self.axes.map(|axis| value(axis, self.step));
        let radius = match self.radii {
            Source::All(radius) => radius,
            Source::Each(radii, step) => value(radii, step),
        };
        [x, y, z, radius]
    }
}

impl<T> Strided<'_, T> {
    #[inline(always)]
    #[doc(hidden)]
    pub fn addresses(&self, i: usize) -> [*const u8; 4] {
        let address = |values: &[MaybeUninit<T>], step: usize| values.as_ptr().wrapping_add(i * step).cast();
        let [x, y, z] = self.axes.map(|axis| address(axis, self.step));
        match self.radii {
            Source::All(_) => [x, y, z, z],
            Source::Each(radii, step) => [x, y, z, address(radii, step)],
        }
    }
}

impl Wide<'_> {
    #[inline]
    pub(crate) fn addresses(&self, i: usize) -> [*const u8; 4] {
        match self {
            Self::F32(spheres) => spheres.addresses(i),
            Self::F64(spheres) => spheres.addresses(i),
        }
    }

    pub(crate) fn len(&self) -> usize {
        match self {
            Self::F32(spheres) => spheres.len(),
            Self::F64(spheres) => spheres.len(),
        }
    }

    #[inline]
    pub(crate) fn get(&self, i: usize) -> [f64; 4] {
        match self {
            Self::F32(spheres) => widened(spheres.get(i)),
            Self::F64(spheres) => spheres.get(i),
        }
    }
}
