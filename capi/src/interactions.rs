use engine::{Interaction, Interactions};

use crate::pointer::check;
use crate::status::{Status, guarded, without_detector};
use crate::{Failure, OutPtr};

/// `lazygrid_interactions`: a table of species.
#[derive(Debug)]
pub struct InteractionsHandle(pub Interactions);

fn interaction(kind: i32, distance: f64) -> Result<Interaction, Failure> {
    match kind {
        0 => Ok(Interaction::Never),
        1 => Ok(Interaction::Touch),
        2 => Ok(Interaction::Within(distance)),
        _ => Err(Failure::argument(format!(
            "unknown kind of interaction {kind}; choose LAZYGRID_NEVER, LAZYGRID_TOUCH or LAZYGRID_WITHIN"
        ))),
    }
}

/// Creates a table.
///
/// # Safety
/// The header's conditions.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn lazygrid_interactions_create(
    species: u32,
    kind: i32,
    distance: f64,
    interactions: *mut *mut InteractionsHandle,
) -> Status {
    without_detector(|| {
        // SAFETY: by this function's condition.
        let out = unsafe { OutPtr::new(interactions, "interactions", std::ptr::null_mut()) }?;
        let table = Interactions::new(species, interaction(kind, distance)?)?;
        out.put(Box::into_raw(Box::new(InteractionsHandle(table))));
        Ok(())
    })
}

/// Sets the interaction of two species.
///
/// # Safety
/// The header's conditions.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn lazygrid_interactions_set(
    interactions: *mut InteractionsHandle,
    a: u32,
    b: u32,
    kind: i32,
    distance: f64,
) -> Status {
    without_detector(|| {
        check(interactions, "interactions")?;
        // SAFETY: a table that `lazygrid_interactions_create` made, used by this thread alone.
        let InteractionsHandle(table) = unsafe { &mut *interactions };
        Ok(table.set(a, b, interaction(kind, distance)?)?)
    })
}

/// Frees a table.
///
/// # Safety
/// The header's conditions.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn lazygrid_interactions_destroy(interactions: *mut InteractionsHandle) {
    guarded(|| {
        if !interactions.is_null() {
            // SAFETY: `lazygrid_interactions_create` made it by `Box::into_raw`, and it is freed once.
            drop(unsafe { Box::from_raw(interactions) });
        }
        0
    });
}
