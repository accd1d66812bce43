//! LAMMPS through its C library, loaded from the path in [`VARIABLE`]: in doubles, with a half list and
//! forces at each step. Its pair style has an energy of 1 within the cutoff, so a step's energy is the
//! number of pairs.
//!
//! LAMMPS stores its own atoms, so copying the coordinates is not timed.

use std::env;
use std::error::Error;
use std::ffi::{CStr, CString, c_char, c_double, c_int, c_void};
use std::io::Write;
use std::path::PathBuf;

use lazygrid::Sphere;
use libloading::Library;
use tempfile::NamedTempFile;

use crate::measure::{ContenderFactory, Found, PairFinder};

/// Environment variable with the path of `liblammps.so`.
pub const VARIABLE: &str = "LAZYGRID_LAMMPS_LIB";

type Handle = *mut c_void;
type Open = unsafe extern "C" fn(c_int, *mut *mut c_char, *mut Handle) -> Handle;
type Text = unsafe extern "C" fn(Handle, *const c_char);
type Failed = unsafe extern "C" fn(Handle) -> c_int;
type Message = unsafe extern "C" fn(Handle, *mut c_char, c_int) -> c_int;
type Number = unsafe extern "C" fn(Handle, *const c_char) -> c_int;
type Thermo = unsafe extern "C" fn(Handle, *const c_char) -> c_double;
type Extract = unsafe extern "C" fn(Handle, *const c_char) -> *mut c_void;
type Create = unsafe extern "C" fn(
    Handle,
    c_int,
    *const c_int,
    *const c_int,
    *const c_double,
    *const c_double,
    *const c_int,
    c_int,
) -> c_int;

/// Returns a search for spheres of radius 1 with the fastest of [`skins`], by the command in `verlet.rs` with
/// `--scene equal`.
pub fn tuned(name: impl Into<String>, step_length: f32) -> ContenderFactory {
    with(name, best(step_length))
}

pub fn skins() -> Vec<ContenderFactory> {
    let with_skin = |skin: f32| with(format!("LAMMPS, skin {skin}"), skin);
    if is_named() { [0.05, 0.1, 0.25, 0.5, 1.0, 1.5, 2.0].map(with_skin).into() } else { Vec::new() }
}

pub fn is_named() -> bool {
    library().is_some()
}

pub fn library() -> Option<PathBuf> {
    env::var_os(VARIABLE).map(PathBuf::from)
}

fn best(step_length: f32) -> f32 {
    match step_length {
        ..=0.003 => 0.1,
        ..=0.03 => 0.5,
        _ => 1.5,
    }
}

fn with(name: impl Into<String>, skin: f32) -> ContenderFactory {
    ContenderFactory::new(name, move || Lammps::new(skin))
}

struct Lammps {
    handle: Handle,
    library: Library,
    skin: f32,
    atoms: Option<usize>,
}

impl Lammps {
    fn new(skin: f32) -> Result<Self, Box<dyn Error>> {
        let path = library().ok_or_else(|| format!("set {VARIABLE} to the path of liblammps.so"))?;
        // SAFETY: the user names this library as LAMMPS, whose initializers have no preconditions.
        let library = unsafe { Library::new(path)? };
        let mut words: Vec<Vec<u8>> = ["lammps", "-log", "none", "-screen", "none", "-nocite"]
            .map(|word| CString::new(word).map(CString::into_bytes_with_nul))
            .into_iter()
            .collect::<Result<_, _>>()?;
        let mut words: Vec<*mut c_char> = words.iter_mut().map(|word| word.as_mut_ptr().cast()).collect();
        // SAFETY: the type is that of `lammps_open_no_mpi`; the words outlive the call, in which they are copied.
        let handle = unsafe {
            let open = library.get::<Open>(b"lammps_open_no_mpi\0")?;
            open(words.len() as c_int, words.as_mut_ptr(), std::ptr::null_mut())
        };
        if handle.is_null() {
            return Err("LAMMPS failed to start".into());
        }
        let lammps = Self { handle, library, skin, atoms: None };
        match lammps.setting(c"tagint")? {
            4 => Ok(lammps),
            bytes => Err(format!("this LAMMPS has ids of {bytes} bytes; only 4 bytes are supported").into()),
        }
    }

    fn commands(&self, text: &str) -> Result<(), Box<dyn Error>> {
        let text = CString::new(text)?;
        // SAFETY: the type is that of `lammps_commands_string`, which reads a text that outlives the call; `handle` is
        // alive.
        unsafe { self.library.get::<Text>(b"lammps_commands_string\0")?(self.handle, text.as_ptr()) };
        self.check()
    }

    fn check(&self) -> Result<(), Box<dyn Error>> {
        let mut text = [0; 1000];
        // SAFETY: the types are those of the two functions; the second writes at most the given size, including a final
        // zero. `handle` is alive.
        unsafe {
            if self.library.get::<Failed>(b"lammps_has_error\0")?(self.handle) == 0 {
                return Ok(());
            }
            let message = self.library.get::<Message>(b"lammps_get_last_error_message\0")?;
            message(self.handle, text.as_mut_ptr(), text.len() as c_int);
            Err(format!("LAMMPS: {}", CStr::from_ptr(text.as_ptr()).to_string_lossy().trim()).into())
        }
    }

    fn setting(&self, name: &CStr) -> Result<c_int, Box<dyn Error>> {
        // SAFETY: the type is that of `lammps_extract_setting`, which reads a name; `handle` is alive.
        Ok(unsafe { self.library.get::<Number>(b"lammps_extract_setting\0")?(self.handle, name.as_ptr()) })
    }

    fn extract(&self, name: &CStr) -> Result<*mut c_void, Box<dyn Error>> {
        // SAFETY: the type is that of `lammps_extract_atom`, which reads a name; `handle` is alive.
        Ok(unsafe { self.library.get::<Extract>(b"lammps_extract_atom\0")?(self.handle, name.as_ptr()) })
    }

    fn begin(&mut self, spheres: &[Sphere]) -> Result<(), Box<dyn Error>> {
        if spheres.iter().any(|sphere| sphere.radius != 1.0) {
            return Err("LAMMPS supports only spheres of radius 1 here".into());
        }
        let mut table = NamedTempFile::new()?;
        writeln!(table, "# energy 1\n\nONE\nN 2 R 0.000001 2.5\n\n1 0.000001 1.0 0.0\n2 2.5 1.0 0.0")?;
        table.flush()?;
        let bound = spheres.iter().fold(1.0_f32, |bound, s| bound.max(s.center.abs().max_element()));
        let (skin, file) = (self.skin, table.path().display());
        self.commands(&format!(
            "units lj\natom_style atomic\natom_modify map array\nboundary s s s\n\
             region all block -{bound} {bound} -{bound} {bound} -{bound} {bound}\ncreate_box 1 all\nmass 1 1.0\n\
             pair_style table linear 10\npair_coeff * * {file} ONE 2.0\n\
             neighbor {skin} bin\nneigh_modify every 1 delay 0 check yes\n\
             thermo 1\nthermo_style custom step pe\nthermo_modify norm no\n"
        ))?;
        let count = c_int::try_from(spheres.len())?;
        let ids: Vec<c_int> = (1..=count).collect();
        let types = vec![1; spheres.len()];
        let positions: Vec<c_double> =
            spheres.iter().flat_map(|sphere| sphere.center.to_array().map(f64::from)).collect();
        let (none, no_images) = (std::ptr::null(), std::ptr::null());
        // SAFETY: the type is that of `lammps_create_atoms` for ids of 4 bytes, as checked in `new`. There are as many
        // ids and types as atoms, and three coordinates per atom; velocities and images may be null.
        let made = unsafe {
            let create = self.library.get::<Create>(b"lammps_create_atoms\0")?;
            create(self.handle, count, ids.as_ptr(), types.as_ptr(), positions.as_ptr(), none, no_images, 1)
        };
        self.check()?;
        if made != count {
            return Err(format!("LAMMPS created {made} of {count} atoms").into());
        }
        self.atoms = Some(spheres.len());
        // Builds the first neighbor list.
        self.commands("run 0\n")
    }
}

impl Drop for Lammps {
    fn drop(&mut self) {
        // SAFETY: the type is that of `lammps_close`; `handle` is alive and not used any more.
        if let Ok(close) = unsafe { self.library.get::<unsafe extern "C" fn(Handle)>(b"lammps_close\0") } {
            // SAFETY: as above.
            unsafe { close(self.handle) }
        }
    }
}

impl PairFinder for Lammps {
    fn prepare(&mut self, spheres: &[Sphere]) -> Result<(), Box<dyn Error>> {
        match self.atoms {
            None => self.begin(spheres)?,
            Some(atoms) if atoms == spheres.len() => {}
            Some(_) => return Err("the number of spheres must not change, as LAMMPS's atoms are kept".into()),
        }
        let [ids, positions] = [self.extract(c"id")?, self.extract(c"x")?];
        if ids.is_null() || positions.is_null() {
            return Err("LAMMPS returned no ids or coordinates of its atoms".into());
        }
        // SAFETY: `id` has one number from 1 to their count for each atom of this process, which has all atoms; the
        // array is not accessed otherwise during the call.
        let ids = unsafe { std::slice::from_raw_parts(ids.cast::<c_int>(), spheres.len()) };
        // SAFETY: `x` is an array of pointers to three coordinates for each atom.
        let positions =
            unsafe { std::slice::from_raw_parts(positions.cast::<*mut [c_double; 3]>(), spheres.len()) };
        for (&id, &position) in ids.iter().zip(positions) {
            let center = spheres[id as usize - 1].center.to_array().map(f64::from);
            // SAFETY: as above.
            unsafe { position.write(center) };
        }
        Ok(())
    }

    fn run(&mut self, _: &[Sphere]) -> Result<Found<'_>, Box<dyn Error>> {
        self.commands("run 1 pre no post no\n")?;
        // SAFETY: the type is that of `lammps_get_thermo`, which reads a name; `handle` is alive.
        let energy =
            unsafe { self.library.get::<Thermo>(b"lammps_get_thermo\0")?(self.handle, c"pe".as_ptr()) };
        // The sum of energies may be rounded down.
        Ok(Found::Count(energy.round() as u64))
    }
}
