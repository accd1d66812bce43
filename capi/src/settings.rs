use std::ffi::{CStr, c_char};

use engine::{Algorithm, Backend, Config, Order, Skin, Space};

use crate::Failure;
use crate::interactions::InteractionsHandle;
use crate::pointer::{array, check};
use crate::sized::{self, VersionedStruct};
use crate::status::{Status, without_detector};

/// `lazygrid_settings`. New fields are appended, and 0 means their default.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct CSettings {
    pub size: usize,
    pub backend: i32,
    pub algorithm: i32,
    pub order: i32,
    pub threads: u32,
    pub max_pairs: u64,
    pub periodic: [f64; 3],
    pub timeout_seconds: u32,
    pub skin: i32,
    pub skin_distance: f64,
    pub adapter: *const c_char,
    pub interactions: *const InteractionsHandle,
    pub cell_vectors: *const f64,
}

// SAFETY: the size is the first field, and all are numbers and pointers, which any bits are.
unsafe impl VersionedStruct for CSettings {
    const FIRST_SIZE: usize = size_of::<Self>();
    const REMEDY: &'static str = "set it by lazygrid_settings_init";
}

pub const BACKENDS: [Backend; 3] = [Backend::Auto, Backend::Cpu, Backend::Gpu];

pub const ALGORITHMS: [Algorithm; 8] = [
    Algorithm::Auto,
    Algorithm::Naive,
    Algorithm::HashGrid,
    Algorithm::ArrayGrid,
    Algorithm::RecursiveGrid,
    Algorithm::CellList,
    Algorithm::EagerGrid,
    Algorithm::LazyGrid,
];

pub const ORDERS: [Order; 2] = [Order::Canonical, Order::Unordered];

/// Constructor of each skin from `skin_distance`, by the number in the header.
pub const SKINS: [fn(f64) -> Skin; 3] = [|_| Skin::Auto, |_| Skin::Off, Skin::Fixed];

impl CSettings {
    /// All fields 0, the default.
    #[cfg(test)]
    pub const fn defaults() -> Self {
        Self {
            size: size_of::<Self>(),
            backend: 0,
            algorithm: 0,
            order: 0,
            threads: 0,
            max_pairs: 0,
            periodic: [0.0; 3],
            timeout_seconds: 0,
            skin: 0,
            skin_distance: 0.0,
            adapter: std::ptr::null(),
            interactions: std::ptr::null(),
            cell_vectors: std::ptr::null(),
        }
    }

    /// Reads the settings; NULL means the defaults.
    ///
    /// # Errors
    /// See [`sized::read`]; also if a number is out of range.
    ///
    /// # Safety
    /// The conditions of [`sized::read`]; and the adapter is NULL or a text that ends with a zero byte, the table is NULL
    /// or one that no other thread changes during the call, and the cell vectors are NULL or nine numbers.
    pub unsafe fn config(settings: *const Self) -> Result<Config, Failure> {
        if settings.is_null() {
            return Ok(Config::default());
        }
        // SAFETY: by this function's condition.
        let settings = unsafe { sized::read(settings, "settings") }?;
        let mut config = Config::default()
            .backend(choice(&BACKENDS, settings.backend, "backend")?)
            .algorithm(choice(&ALGORITHMS, settings.algorithm, "algorithm")?)
            .order(choice(&ORDERS, settings.order, "order")?)
            .skin(settings.skin()?)
            // SAFETY: by this function's condition.
            .space(unsafe { settings.space() }?);
        if settings.threads != 0 {
            config = config.threads(settings.threads as usize);
        }
        if settings.max_pairs != 0 {
            config = config.max_pairs(settings.max_pairs);
        }
        if !settings.interactions.is_null() {
            check(settings.interactions, "settings.interactions")?;
            // SAFETY: not NULL and aligned, and a table by this function's condition.
            config = config.interactions(unsafe { &*settings.interactions }.0.clone());
        }
        // SAFETY: by this function's condition.
        unsafe { settings.on_gpu(config) }
    }

    /// Returns the space, from the lengths of periodic axes or from cell vectors.
    ///
    /// # Safety
    /// The cell vectors are NULL or nine numbers.
    unsafe fn space(&self) -> Result<Space, Failure> {
        if self.cell_vectors.is_null() {
            return Ok(Space::periodic(self.periodic.map(|length| (length != 0.0).then_some(length)))?);
        }
        if self.periodic != [0.0; 3] {
            return Err(Failure::setting(
                "settings.periodic and settings.cell_vectors are both set; leave one of them 0, and give the length of a periodic \
                 axis as a cell vector along it",
            ));
        }
        // SAFETY: nine numbers by this function's condition.
        let numbers = unsafe { array(self.cell_vectors, 9, "settings.cell_vectors") }?;
        let cell_vector = |axis: usize| [numbers[3 * axis], numbers[3 * axis + 1], numbers[3 * axis + 2]];
        let cell_vector = |axis| (cell_vector(axis) != [0.0; 3]).then(|| cell_vector(axis));
        Ok(Space::triclinic([0, 1, 2].map(cell_vector))?)
    }

    /// A distance without a fixed skin is an error.
    fn skin(&self) -> Result<Skin, Failure> {
        let distance = self.skin_distance;
        let skin = choice(&SKINS, self.skin, "skin")?(distance);
        if distance != 0.0 && !matches!(skin, Skin::Fixed(_)) {
            return Err(Failure::setting(format!(
                "settings.skin_distance is {distance}, but the skin is not fixed; set skin to LAZYGRID_SKIN_FIXED, or \
                 the distance to 0"
            )));
        }
        Ok(skin)
    }

    /// Adds the settings of the GPU path.
    ///
    /// # Safety
    /// The adapter is NULL or a text that ends with a zero byte.
    #[cfg_attr(not(feature = "gpu"), expect(unused_mut, reason = "nothing to set"))]
    unsafe fn on_gpu(&self, mut config: Config) -> Result<Config, Failure> {
        #[cfg(feature = "gpu")]
        if self.timeout_seconds != 0 {
            config = config.timeout(std::time::Duration::from_secs(self.timeout_seconds.into()));
        }
        #[cfg(not(feature = "gpu"))]
        if self.timeout_seconds != 0 && choice(&BACKENDS, self.backend, "backend")? == Backend::Cpu {
            return Err(engine::Error::TimeoutOnCpu { seconds: self.timeout_seconds.into() }.into());
        }
        if self.adapter.is_null() {
            return Ok(config);
        }
        // SAFETY: a text, by this function's condition.
        let Ok(name) = unsafe { CStr::from_ptr(self.adapter) }.to_str() else {
            return Err(Failure::argument("settings.adapter is not UTF-8"));
        };
        #[cfg(feature = "gpu")]
        return Ok(config.adapter(name));
        #[cfg(not(feature = "gpu"))]
        Err(Failure {
            message: format!("adapter '{name}': {}", engine::Error::WithoutGpu),
            status: crate::status::GPU_UNAVAILABLE,
        })
    }
}

fn choice<T: Copy>(values: &[T], number: i32, field: &str) -> Result<T, Failure> {
    let value = usize::try_from(number).ok().and_then(|index| values.get(index));
    value.copied().ok_or_else(|| {
        let last = values.len() - 1;
        Failure::argument(format!("settings.{field} is {number}; choose one of the numbers 0 to {last}"))
    })
}

/// Writes the default settings.
///
/// # Safety
/// The header's conditions.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn lazygrid_settings_init(settings: *mut CSettings, size: usize) -> Status {
    without_detector(|| {
        check(settings, "settings")?;
        let first = CSettings::FIRST_SIZE;
        if size < first {
            let message = format!("a size of {size} is less than {first}; pass sizeof(lazygrid_settings)");
            return Err(Failure::argument(message));
        }
        // SAFETY: `size` bytes can be written by this function's condition, and hold a `usize` by the check above.
        unsafe {
            settings.cast::<u8>().write_bytes(0, size);
            settings.cast::<usize>().write(size);
        }
        Ok(())
    })
}
