use std::ffi::c_void;
use std::mem::MaybeUninit;

use engine::{InputError, MAX_SPHERES, Query, Real, Sphere, Spheres, Strided};

use crate::Failure;
use crate::exclusions::{self, ExclusionsHandle};
use crate::pointer::array;
use crate::sized::{self, VersionedStruct};

/// `LAZYGRID_F32`.
pub const F32: i32 = 0;
/// `LAZYGRID_F64`.
pub const F64: i32 = 1;

/// `lazygrid_spheres`: a set of spheres in the caller's memory.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct CSpheres {
    pub size: usize,
    pub count: usize,
    pub x: *const c_void,
    pub y: *const c_void,
    pub z: *const c_void,
    pub r: *const c_void,
    pub step: usize,
    pub r_step: usize,
    pub r#type: i32,
    pub zero: i32,
    pub species: *const u32,
    pub groups: *const u32,
}

// SAFETY: the size is the first field, and all are numbers and pointers, which any bits are.
unsafe impl VersionedStruct for CSpheres {
    const FIRST_SIZE: usize = size_of::<Self>();
    const REMEDY: &'static str =
        "set it to sizeof(lazygrid_spheres), or make the spheres by lazygrid_rows or its like";
}

/// `lazygrid_query`: one set or two, and exclusions.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct CQuery {
    pub size: usize,
    pub first: *const CSpheres,
    pub second: *const CSpheres,
    pub exclusions: *const ExclusionsHandle,
}

// SAFETY: the size is the first field, and all others are pointers, which any bits are.
unsafe impl VersionedStruct for CQuery {
    const FIRST_SIZE: usize = size_of::<Self>();
    const REMEDY: &'static str =
        "set it to sizeof(lazygrid_query), or make the query by lazygrid_among or lazygrid_across";
}

/// Borrows the query; copies only the structures, not the arrays.
///
/// # Errors
/// If a required pointer is NULL or misaligned, if a size, type or step is wrong, or if there are too many spheres. An
/// error in the second set says so.
///
/// # Safety
/// The header's conditions: `query` is NULL or points to such a structure, whose pointers are NULL or point
/// to what the header says, which does not change while the result is in use.
pub unsafe fn borrow<'a>(query: *const CQuery) -> Result<Query<'a>, Failure> {
    // SAFETY: by this function's condition.
    let CQuery { first, second, exclusions, .. } = unsafe { sized::read(query, "query") }?;
    // SAFETY: by this function's condition.
    let first = unsafe { CSpheres::borrow(first, "query.first") }?;
    let query = if second.is_null() {
        Query::new(first)
    } else {
        // SAFETY: by this function's condition.
        let second = unsafe { CSpheres::borrow(second, "query.second") }.map_err(in_second_set)?;
        Query::new((first, second))
    };
    // SAFETY: by this function's condition.
    let exclusions = unsafe { exclusions::borrow(exclusions) }?;
    Ok(exclusions.map_or(query, |exclusions| query.without(exclusions)))
}

fn in_second_set(Failure { status, message }: Failure) -> Failure {
    Failure { status, message: format!("in the second set, {message}") }
}

impl CSpheres {
    /// Borrows the spheres at `at`; messages call them `name`.
    ///
    /// # Safety
    /// The conditions of [`borrow`], for these spheres.
    unsafe fn borrow<'a>(at: *const Self, name: &str) -> Result<Spheres<'a>, Failure> {
        // SAFETY: by this function's condition.
        let set = unsafe { sized::read(at, name) }?;
        let Self { count, species, groups, zero, .. } = set;
        if zero != 0 {
            return Err(Failure::argument(format!("`zero` is {zero}; it must be 0")));
        }
        // Keeps all arrays below `isize::MAX` bytes, also with 32-bit addresses.
        if count as u64 > MAX_SPHERES || count > isize::MAX as usize / size_of::<Sphere>() {
            return Err(InputError::TooManySpheres { count: count as u64 }.into());
        }
        // SAFETY: the structure describes live arrays, by this function's condition.
        let mut spheres = unsafe { set.numbers() }?;
        if !species.is_null() {
            // SAFETY: `count` ids, by this function's condition.
            spheres = spheres.with_species(unsafe { array(species, count, "species") }?)?;
        }
        if !groups.is_null() {
            // SAFETY: `count` groups, by this function's condition.
            spheres = spheres.with_groups(unsafe { array(groups, count, "groups") }?)?;
        }
        Ok(spheres)
    }

    /// Spheres without species and groups.
    ///
    /// # Safety
    /// The conditions of [`borrow`](Self::borrow); `count` is at most the number of spheres that fit in memory.
    unsafe fn numbers<'a>(&self) -> Result<Spheres<'a>, Failure> {
        match self.r#type {
            F32 if self.is_rows::<f32>() => {
                // SAFETY: 4 floats for each sphere by this function's condition; `Sphere` is laid out as 4 floats, is
                // aligned as they are, and any bits are one.
                Ok(Spheres::from(unsafe { array(self.x.cast::<Sphere>(), self.count, "x") }?))
            }
            F64 if self.is_rows::<f64>() => {
                // SAFETY: 4 numbers for each sphere by this function's condition.
                Ok(Spheres::from(unsafe { array(self.x.cast::<[f64; 4]>(), self.count, "x") }?))
            }
            // SAFETY: the numbers are `f32` by `type`, and live, by this function's condition.
            F32 => unsafe { self.strided::<f32>() },
            // SAFETY: the numbers are `f64` by `type`, and live, by this function's condition.
            F64 => unsafe { self.strided::<f64>() },
            other => {
                let message = format!("`type` is {other}; choose LAZYGRID_F32 or LAZYGRID_F64");
                Err(Failure::argument(message))
            }
        }
    }

    /// Returns `true` if the numbers, of type `T`, lie in rows `x, y, z, r` without gaps.
    fn is_rows<T>(&self) -> bool {
        let is_at =
            |address: *const c_void, k: usize| address == self.x.wrapping_byte_add(k * size_of::<T>());
        let row = 4 * size_of::<T>();
        let are_steps = self.step == row && self.r_step == row;
        are_steps && !self.x.is_null() && is_at(self.y, 1) && is_at(self.z, 2) && is_at(self.r, 3)
    }

    /// Returns spheres of type `T` with any steps.
    ///
    /// # Safety
    /// The conditions of [`numbers`](Self::numbers); the numbers are of type `T`.
    unsafe fn strided<'a, T: Real>(&self) -> Result<Spheres<'a>, Failure> {
        let (step, step_values) = (self.step, values_of::<T>(self.step, "step")?);
        let (r_step, r_step_values) = (self.r_step, values_of::<T>(self.r_step, "r_step")?);
        let count = self.count;
        if count > 1 && step == 0 {
            return Err(Failure::argument(format!(
                "`step` is 0 for {count} spheres; give the number of bytes from one center to the next"
            )));
        }
        let columns = [("x", self.x), ("y", self.y), ("z", self.z), ("r", self.r)];
        if step == size_of::<T>() && r_step == step {
            // SAFETY: `count` values each, by this function's condition.
            let [x, y, z, r] = columns.map(|(name, at)| unsafe { array(at.cast::<T>(), count, name) });
            return Ok(Spheres::columns(x?, y?, z?, r?)?);
        }
        let lengths =
            [extent::<T>(count, step_values, "step")?, extent::<T>(count, r_step_values, "r_step")?];
        let [x, y, z, r] = columns.map(|(name, at)| {
            let length = lengths[usize::from(name == "r")];
            // SAFETY: the slice ends with the last sphere's value, so it is in the memory that the header requires;
            // `extent` has checked its size; any bits are a `MaybeUninit`.
            unsafe { array(at.cast::<MaybeUninit<T>>(), length, name) }
        });
        // SAFETY: `extent` gives each column the value of the last sphere, and those before it. That of each sphere is
        // initialized by the header.
        Ok(Spheres::strided(unsafe {
            Strided::from_parts([x?, y?, z?, r?], [step_values, r_step_values], count)
        }))
    }
}

fn values_of<T>(step: usize, name: &str) -> Result<usize, Failure> {
    let size = size_of::<T>();
    if !step.is_multiple_of(size) {
        let message = format!("`{name}` is {step}; it must be a multiple of {size}, the size of a number");
        return Err(Failure::argument(message));
    }
    Ok(step / size)
}

/// Returns the number of values from the first sphere's to the last sphere's, both included; 0 without spheres.
fn extent<T>(count: usize, step: usize, name: &str) -> Result<usize, Failure> {
    let Some(last) = count.checked_sub(1) else { return Ok(0) };
    let most = isize::MAX as usize / size_of::<T>();
    let length = last.checked_mul(step).and_then(|last| last.checked_add(1));
    length.filter(|length| *length <= most).ok_or_else(|| {
        let bytes = step * size_of::<T>();
        Failure::argument(format!(
            "`{name}` is {bytes} for {count} spheres, more than memory can hold; give the number of bytes from one sphere \
             to the next"
        ))
    })
}
