use std::slice;

use engine::{Exclusions, InputError, MAX_SPHERES, Query, Sphere, Spheres};

use crate::Failure;
use crate::exclusions::{self, List};
use crate::out::check;
use crate::status::INPUT;

/// `lazygrid_spheres`: spheres as rows or as columns, and what is said of each.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct SpheresOfC {
    pub count: usize,
    pub rows: *const f32,
    pub x: *const f32,
    pub y: *const f32,
    pub z: *const f32,
    pub r: *const f32,
    pub species: *const u32,
    pub groups: *const u32,
    pub exclusions: *const List,
}

impl SpheresOfC {
    /// The spheres at `spheres`, not copied.
    ///
    /// # Errors
    /// Where a pointer is NULL that must not be, or not aligned, where rows and columns are both given, and for too
    /// many spheres.
    ///
    /// # Safety
    /// By the header: `spheres` is NULL or points to such a structure, whose pointers are NULL or point to as many
    /// values as it says, which nobody changes for as long as the result lives.
    pub unsafe fn borrow<'a>(spheres: *const Self) -> Result<Query<'a>, Failure> {
        // SAFETY: this function's own condition.
        let (spheres, exclusions) = unsafe { Self::borrow_set(spheres) }?;
        Ok(query(Query::new(spheres), exclusions))
    }

    /// The spheres at `spheres` and the exclusions that come with them.
    ///
    /// # Errors
    /// As [`borrow`](Self::borrow).
    ///
    /// # Safety
    /// As [`borrow`](Self::borrow).
    unsafe fn borrow_set<'a>(spheres: *const Self) -> Result<(Spheres<'a>, Option<&'a Exclusions>), Failure> {
        check(spheres, "spheres")?;
        // SAFETY: not NULL and aligned, as was checked, and the rest is this function's own condition. Any bits are
        // values of its fields.
        let Self { count, rows, x, y, z, r, species, groups, exclusions } = unsafe { *spheres };
        // So that no slice is longer than slices can be, also where addresses have 32 bits.
        if count as u64 > MAX_SPHERES || count > isize::MAX as usize / size_of::<Sphere>() {
            return Err(InputError::TooManySpheres { count: count as u64 }.into());
        }
        let columns = [("x", x), ("y", y), ("z", z), ("r", r)];
        let by_rows = !rows.is_null();
        if let (true, Some((name, _))) = (by_rows, columns.iter().find(|(_, column)| !column.is_null())) {
            let message = format!("`rows` and `{name}` are both given; leave one of them NULL");
            return Err(Failure::argument(message));
        }
        let mut spheres = if by_rows {
            // SAFETY: 4 floats for each sphere by this function's condition; `Sphere` is laid out as 4 floats, is
            // aligned as they are, and any bits are one.
            Spheres::from(unsafe { array(rows.cast::<Sphere>(), count, "rows") }?)
        } else {
            // SAFETY: `count` floats each, by this function's condition.
            let [x, y, z, r] = columns.map(|(name, column)| unsafe { array(column, count, name) });
            Spheres::columns(x?, y?, z?, r?)?
        };
        if !species.is_null() {
            // SAFETY: `count` ids, by this function's condition.
            spheres = spheres.with_species(unsafe { array(species, count, "species") }?)?;
        }
        if !groups.is_null() {
            // SAFETY: `count` groups, by this function's condition.
            spheres = spheres.with_groups(unsafe { array(groups, count, "groups") }?)?;
        }
        // SAFETY: a list or NULL, by this function's condition.
        Ok((spheres, unsafe { exclusions::borrow(exclusions) }?))
    }

    /// Two sets of spheres, not copied.
    ///
    /// # Errors
    /// As [`borrow`](Self::borrow); what is wrong with the second set says so, as the engine does.
    ///
    /// # Safety
    /// As [`borrow`](Self::borrow), for both.
    pub unsafe fn borrow_two<'a>(a: *const Self, b: *const Self) -> Result<Query<'a>, Failure> {
        check(a, "a")?;
        check(b, "b")?;
        // SAFETY: this function's own condition.
        let (first, exclusions) = unsafe { Self::borrow_set(a) }?;
        // SAFETY: this function's own condition.
        let second = unsafe { Self::borrow_set(b) };
        let of_second = |Failure { status, message }| {
            let message = format!("of the second set, {message}");
            Failure { status, message }
        };
        let (second, others) = second.map_err(of_second)?;
        if others.is_some() {
            let message = "pairs between two sets are excluded with the first set; leave `exclusions` of the \
                           second one NULL";
            return Err(of_second(Failure { status: INPUT, message: message.to_owned() }));
        }
        Ok(query(Query::new((first, second)), exclusions))
    }
}

fn query<'a>(query: Query<'a>, exclusions: Option<&'a Exclusions>) -> Query<'a> {
    exclusions.map_or(query, |exclusions| query.without(exclusions))
}

/// `count` values at `at`; none where `count` is 0, wherever `at` points.
///
/// # Errors
/// Where `at` is NULL or not aligned, unless `count` is 0.
///
/// # Safety
/// If `count` is not 0 and `at` neither NULL nor misaligned, so many values are there, any bits are a value, nobody
/// changes them for as long as the result lives, and they are no larger than an `isize`.
pub unsafe fn array<'a, T: Copy>(at: *const T, count: usize, name: &str) -> Result<&'a [T], Failure> {
    if count == 0 {
        return Ok(&[]);
    }
    check(at, name)?;
    // SAFETY: not NULL and aligned, as was checked; the rest is this function's condition.
    Ok(unsafe { slice::from_raw_parts(at, count) })
}
