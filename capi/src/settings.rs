use std::ffi::{CStr, c_char};
use std::{ptr, slice};

use engine::glam::Vec3;
use engine::{Algorithm, Backend, Config, Order, Skin, Space};

use crate::Failure;
use crate::input::array;
use crate::interactions::Table;
use crate::out::check;
use crate::status::{Status, without_detector};

/// `lazygrid_settings`. New fields come at the end, and 0 means their default.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct SettingsOfC {
    pub size: usize,
    pub backend: i32,
    pub algorithm: i32,
    pub order: i32,
    pub threads: u32,
    pub max_pairs: u64,
    pub periodic: [f32; 3],
    pub timeout_seconds: u32,
    pub adapter: *const c_char,
    pub interactions: *const Table,
    pub skin: i32,
    pub skin_distance: f32,
    pub edges: *const f32,
}

/// The size of the first version, below which none can be.
const FIRST_SIZE: usize = std::mem::offset_of!(SettingsOfC, interactions) + size_of::<*const Table>();

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

/// The skins by their number, each with what a distance makes of it.
pub const SKINS: [fn(f32) -> Skin; 3] =
    [|_| Skin::Auto, |_| Skin::Off, |distance| Skin::Fixed(distance.into())];

impl SettingsOfC {
    /// All fields 0, which is their default.
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
            adapter: ptr::null(),
            interactions: ptr::null(),
            skin: 0,
            skin_distance: 0.0,
            edges: ptr::null(),
        }
    }

    /// The settings at `settings`, of a program that may know fewer fields, or more.
    ///
    /// # Errors
    /// Where the size is wrong, or a field is set that this library does not have.
    ///
    /// # Safety
    /// By the header: `settings` is NULL or begins with a size, and so many bytes are there.
    unsafe fn read(settings: *const Self) -> Result<Self, Failure> {
        check(settings, "settings")?;
        // SAFETY: a size is there, by this function's condition; NULL and misaligned pointers were refused.
        let size = unsafe { settings.cast::<usize>().read() };
        let known = size_of::<Self>();
        if !(FIRST_SIZE..=1 << 16).contains(&size) {
            return Err(Failure::argument(format!(
                "settings.size is {size}, less than {FIRST_SIZE} or far too much; set it by lazygrid_settings_init"
            )));
        }
        if size > known {
            // SAFETY: `size` bytes are there, and `lazygrid_settings_init`, which set the size, gave each a value.
            let newer = unsafe { slice::from_raw_parts(settings.cast::<u8>().add(known), size - known) };
            if newer.iter().any(|byte| *byte != 0) {
                return Err(Failure::argument(format!(
                    "settings has {size} bytes of which this library knows {known}, and one of the others is set; \
                     take the library of the header's version"
                )));
            }
        }
        let mut read = Self::defaults();
        // SAFETY: both have as many bytes, they do not overlap, and any bits are values of the fields.
        unsafe {
            ptr::copy_nonoverlapping(settings.cast::<u8>(), (&raw mut read).cast::<u8>(), size.min(known));
        }
        Ok(read)
    }

    /// What the settings at `settings` mean; NULL means the defaults.
    ///
    /// # Errors
    /// As [`read`](Self::read), and for numbers that mean nothing.
    ///
    /// # Safety
    /// As [`read`](Self::read); and the adapter is NULL or a text that ends with a zero byte, the table is NULL or one
    /// that no other thread changes meanwhile, and the edges are NULL or nine floats.
    pub unsafe fn config(settings: *const Self) -> Result<Config, Failure> {
        if settings.is_null() {
            return Ok(Config::default());
        }
        // SAFETY: this function's own condition.
        let settings = unsafe { Self::read(settings) }?;
        let mut config = Config::default()
            .backend(meant(&BACKENDS, settings.backend, "backend")?)
            .algorithm(meant(&ALGORITHMS, settings.algorithm, "algorithm")?)
            .order(meant(&ORDERS, settings.order, "order")?)
            .skin(settings.skin()?)
            // SAFETY: this function's own condition.
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
        // SAFETY: this function's own condition.
        unsafe { settings.on_gpu(config) }
    }

    /// The space: periodic along axes, or along edges of any direction.
    ///
    /// # Safety
    /// The edges are NULL or nine floats.
    unsafe fn space(&self) -> Result<Space, Failure> {
        if self.edges.is_null() {
            return Ok(Space::periodic(
                self.periodic.map(|length| (length != 0.0).then_some(length.into())),
            )?);
        }
        if self.periodic != [0.0; 3] {
            return Err(Failure::argument(
                "settings.periodic and settings.edges are both set; leave one of them 0, and give the length of a periodic \
                 axis as an edge along it",
            ));
        }
        // SAFETY: nine floats by this function's condition.
        let numbers = unsafe { array(self.edges, 9, "settings.edges") }?;
        let edge = |axis: usize| Vec3::from_slice(&numbers[3 * axis..]);
        let edge = |axis| (edge(axis) != Vec3::ZERO).then(|| edge(axis).as_dvec3().to_array());
        Ok(Space::sheared([0, 1, 2].map(edge))?)
    }

    /// The skin; a distance that would go unheard is refused.
    fn skin(&self) -> Result<Skin, Failure> {
        let distance = self.skin_distance;
        let skin = meant(&SKINS, self.skin, "skin")?(distance);
        if distance != 0.0 && !matches!(skin, Skin::Fixed(_)) {
            return Err(Failure::argument(format!(
                "settings.skin_distance is {distance} where the skin is not fixed; set skin to LAZYGRID_SKIN_FIXED, or \
                 leave the distance 0"
            )));
        }
        Ok(skin)
    }

    /// What only a GPU path has.
    ///
    /// # Safety
    /// The adapter is NULL or a text that ends with a zero byte.
    #[cfg_attr(not(feature = "gpu"), expect(unused_mut, reason = "nothing to set"))]
    unsafe fn on_gpu(&self, mut config: Config) -> Result<Config, Failure> {
        #[cfg(feature = "gpu")]
        if self.timeout_seconds != 0 {
            config = config.timeout(std::time::Duration::from_secs(self.timeout_seconds.into()));
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
            status: crate::status::GPU,
        })
    }
}

/// What `number` means among `values`.
fn meant<T: Copy>(values: &[T], number: i32, field: &str) -> Result<T, Failure> {
    let value = usize::try_from(number).ok().and_then(|place| values.get(place));
    value.copied().ok_or_else(|| {
        let last = values.len() - 1;
        Failure::argument(format!("settings.{field} is {number}; choose one of the numbers 0 to {last}"))
    })
}

/// Sets the defaults.
///
/// # Safety
/// By the header: `settings` is NULL or so many bytes of it can be written to.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn lazygrid_settings_init(settings: *mut SettingsOfC, size: usize) -> Status {
    without_detector(|| {
        check(settings, "settings")?;
        if size < FIRST_SIZE {
            let message =
                format!("a size of {size} is less than {FIRST_SIZE}; give sizeof(lazygrid_settings)");
            return Err(Failure::argument(message));
        }
        // SAFETY: `size` bytes are there, and they hold a size, both by this function's condition and the check above.
        unsafe {
            settings.cast::<u8>().write_bytes(0, size);
            settings.cast::<usize>().write(size);
        }
        Ok(())
    })
}
