//! Compares the header with the library. The C compiler reads each function's Rust type, as a C declaration, after the
//! header, so a difference is an error. Static assertions compare layouts and constants.

use std::collections::BTreeSet;
use std::ffi::{CStr, c_char, c_void};
use std::mem::offset_of;
use std::process::Command;

use engine::{Pair, Spheres};

use crate::detector::{
    DetectorHandle, lazygrid_create, lazygrid_destroy, lazygrid_last_error, with_detector,
};
use crate::exclusions::{
    ExclusionsHandle, lazygrid_exclusions_across, lazygrid_exclusions_create, lazygrid_exclusions_destroy,
    lazygrid_exclusions_from_csr,
};
use crate::input::{CQuery, CSpheres, F32, F64};
use crate::interactions::{
    InteractionsHandle, lazygrid_interactions_create, lazygrid_interactions_destroy,
    lazygrid_interactions_set,
};
use crate::list::{CNeighborList, OPTIONS, lazygrid_neighbor_list};
use crate::report::{lazygrid_memory_for, lazygrid_report_json};
use crate::search::{PairCallback, lazygrid_count, lazygrid_neighbors, lazygrid_pairs, lazygrid_stream};
use crate::settings::{ALGORITHMS, BACKENDS, CSettings, ORDERS, SKINS, lazygrid_settings_init};
use crate::status::{
    ARGUMENT, Failure, INTERNAL, NAMES, OK, PANICKED, PANICKED_WITHOUT_DETECTOR, lazygrid_status_name,
    lazygrid_version, without_detector,
};

const HEADER: &str = include_str!("../include/lazygrid.h");

trait CType {
    fn name() -> String;
}

macro_rules! c_types {
    ($($rust:ty => $c:literal),* $(,)?) => { $(impl CType for $rust { fn name() -> String { $c.to_owned() } })* };
}

c_types! {
    () => "void", c_void => "void", c_char => "char", i32 => "int32_t", u32 => "uint32_t", u64 => "uint64_t",
    usize => "size_t", f64 => "double", Pair => "lazygrid_pair", DetectorHandle => "lazygrid_detector",
    InteractionsHandle => "lazygrid_interactions", CSettings => "lazygrid_settings", CQuery => "lazygrid_query",
    CNeighborList => "lazygrid_list",
    ExclusionsHandle => "lazygrid_exclusions", Option<PairCallback> => "lazygrid_pair_callback",
}

impl<T: CType> CType for *const T {
    fn name() -> String {
        format!("{} const *", T::name())
    }
}

impl<T: CType> CType for *mut T {
    fn name() -> String {
        format!("{} *", T::name())
    }
}

trait Declared {
    fn declaration(&self, name: &str) -> String;
}

macro_rules! declared {
    ($(($($argument:ident)*))*) => { $(
        impl<R: CType $(, $argument: CType)*> Declared for unsafe extern "C" fn($($argument),*) -> R {
            fn declaration(&self, name: &str) -> String {
                let arguments: Vec<String> = vec![$($argument::name()),*];
                let arguments = if arguments.is_empty() { "void".to_owned() } else { arguments.join(", ") };
                format!("{} {name}({arguments});\n", R::name())
            }
        }
    )* };
}

declared! { () (A) (A B) (A B C) (A B C D) (A B C D E) (A B C D E F) }

macro_rules! declarations {
    ($($name:ident: $type:ty),* $(,)?) => {
        [$((stringify!($name), Declared::declaration(&($name as $type), stringify!($name)))),*]
    };
}

fn declarations() -> Vec<(&'static str, String)> {
    declarations! {
        lazygrid_version: unsafe extern "C" fn() -> _,
        lazygrid_status_name: unsafe extern "C" fn(_) -> _,
        lazygrid_last_error: unsafe extern "C" fn(_) -> _,
        lazygrid_settings_init: unsafe extern "C" fn(_, _) -> _,
        lazygrid_interactions_create: unsafe extern "C" fn(_, _, _, _) -> _,
        lazygrid_interactions_set: unsafe extern "C" fn(_, _, _, _, _) -> _,
        lazygrid_interactions_destroy: unsafe extern "C" fn(_) -> _,
        lazygrid_exclusions_create: unsafe extern "C" fn(_, _, _, _) -> _,
        lazygrid_exclusions_across: unsafe extern "C" fn(_, _, _, _, _) -> _,
        lazygrid_exclusions_from_csr: unsafe extern "C" fn(_, _, _, _) -> _,
        lazygrid_exclusions_destroy: unsafe extern "C" fn(_) -> _,
        lazygrid_create: unsafe extern "C" fn(_, _) -> _,
        lazygrid_destroy: unsafe extern "C" fn(_) -> _,
        lazygrid_pairs: unsafe extern "C" fn(_, _, _, _) -> _,
        lazygrid_count: unsafe extern "C" fn(_, _, _) -> _,
        lazygrid_neighbors: unsafe extern "C" fn(_, _, _, _) -> _,
        lazygrid_stream: unsafe extern "C" fn(_, _, _, _, _, _) -> _,
        lazygrid_neighbor_list: unsafe extern "C" fn(_, _, _, _) -> _,
        lazygrid_report_json: unsafe extern "C" fn(_, _) -> _,
        lazygrid_memory_for: unsafe extern "C" fn(_, _, _) -> _,
    }
    .into()
}

macro_rules! layout {
    ($rust:ident as $c:literal, $($field:ident),*) => {{
        // Unless every field is named, this does not compile.
        let _ = |$rust { $($field: _),* }: $rust| ();
        let mut text = equal(concat!("sizeof(", $c, ")"), size_of::<$rust>());
        $(
            // Rust's keywords are no keywords in C.
            let field = stringify!($field).trim_start_matches("r#");
            text += &equal(&format!("offsetof({}, {field})", $c), offset_of!($rust, $field));
        )*
        text
    }};
}

fn equal(what: &str, number: usize) -> String {
    format!("_Static_assert({what} == {number}, \"{what} is not {number}\");\n")
}

fn layouts() -> String {
    layout!(Pair as "lazygrid_pair", i, j)
        + &layout!(CSpheres as "lazygrid_spheres", size, count, x, y, z, r, step, r_step, r#type, zero, species, groups)
        + &layout!(CQuery as "lazygrid_query", size, first, second, exclusions)
        + &layout!(CNeighborList as "lazygrid_list", length, offsets, pairs, shifts, vectors, distances)
        + &layout!(
            CSettings as "lazygrid_settings",
            size, backend, algorithm, order, threads, max_pairs, periodic, timeout_seconds, skin, skin_distance, adapter,
            interactions, cell_vectors
        )
}

fn numbers() -> Vec<(String, usize)> {
    let with_prefix = |kind: &str, names: &[&str]| -> Vec<(String, usize)> {
        let named = |name: &&str| format!("LAZYGRID_{kind}{}", name.to_uppercase().replace('-', "_"));
        names.iter().enumerate().map(|(number, name)| (named(name), number)).collect()
    };
    let statuses = NAMES.map(|name| name.to_str().expect("a name is ASCII").trim_start_matches("LAZYGRID_"));
    let orders = ORDERS.map(|order| format!("{order:?}"));
    let skins = SKINS.map(|skin| format!("{:?}", skin(1.0)).replace("(1.0)", ""));
    [
        with_prefix("", &statuses),
        with_prefix("BACKEND_", &BACKENDS.map(|backend| backend.name())),
        with_prefix("ALGORITHM_", &ALGORITHMS.map(|algorithm| algorithm.name())),
        with_prefix("ORDER_", &orders.each_ref().map(String::as_str)),
        with_prefix("SKIN_", &skins.each_ref().map(String::as_str)),
        with_prefix("", &["never", "touch", "within"]),
        OPTIONS.iter().map(|(name, bit)| (format!("LAZYGRID_LIST_{name}"), *bit as usize)).collect(),
        vec![
            ("LAZYGRID_F32".to_owned(), F32 as usize),
            ("LAZYGRID_F64".to_owned(), F64 as usize),
            ("LAZYGRID_NO_GROUP".to_owned(), Spheres::NO_GROUP as usize),
            ("LAZYGRID_VERSION_MAJOR".to_owned(), env!("CARGO_PKG_VERSION_MAJOR").parse().expect("a number")),
            ("LAZYGRID_VERSION_MINOR".to_owned(), env!("CARGO_PKG_VERSION_MINOR").parse().expect("a number")),
            ("LAZYGRID_VERSION_PATCH".to_owned(), env!("CARGO_PKG_VERSION_PATCH").parse().expect("a number")),
        ],
    ]
    .concat()
}

fn words() -> Vec<&'static str> {
    let code = HEADER.split("/*").map(|section| section.split_once("*/").map_or(section, |(_, code)| code));
    code.flat_map(|section| section.split(|c: char| !(c.is_alphanumeric() || c == '_'))).collect()
}

#[test]
fn header_matches_library() {
    let dir = tempfile::tempdir().expect("a folder");
    let path = dir.path().join("drift.c");
    let functions: String = declarations().into_iter().map(|(_, declaration)| declaration).collect();
    let numbers: String = numbers().iter().map(|(name, number)| equal(name, *number)).collect();
    let text = format!("#include <lazygrid.h>\n{functions}{}{numbers}", layouts());
    std::fs::write(&path, &text).expect("a file");
    let compiler = std::env::var("CC").unwrap_or_else(|_| "cc".to_owned());
    let mut command = Command::new(compiler);
    command.args(["-std=c11", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-fsyntax-only", "-I"]);
    command.arg(concat!(env!("CARGO_MANIFEST_DIR"), "/include")).arg(&path);
    let output = command.output().expect("a C compiler");
    assert!(output.status.success(), "{}\n{text}", String::from_utf8_lossy(&output.stderr));
}

#[test]
fn header_has_no_other_names() {
    let functions: BTreeSet<&str> = declarations().iter().map(|(name, _)| *name).collect();
    let types = [
        "status",
        "detector",
        "interactions",
        "exclusions",
        "pair",
        "settings",
        "spheres",
        "query",
        "list",
        "pair_callback",
    ];
    let inline =
        ["strided", "rows", "rows_f64", "columns", "columns_f64", "points", "points_f64", "among", "across"];
    let others: BTreeSet<String> =
        types.iter().chain(&inline).map(|name| format!("lazygrid_{name}")).collect();
    let declared: BTreeSet<&str> =
        words().into_iter().filter(|word| word.starts_with("lazygrid_") && !others.contains(*word)).collect();
    assert_eq!(declared, functions);

    let known: BTreeSet<String> = numbers().into_iter().map(|(name, _)| name).collect();
    let switches = ["LAZYGRID_H", "LAZYGRID_STATIC", "LAZYGRID_API"];
    let named: BTreeSet<String> = words()
        .into_iter()
        .filter(|word| word.starts_with("LAZYGRID_") && !switches.contains(word))
        .map(str::to_owned)
        .collect();
    assert_eq!(named, known);
}

#[test]
fn panic_becomes_a_status_and_poisons_only_its_detector() {
    let settings = CSettings { backend: 1, ..CSettings::defaults() };
    let (mut poisoned, mut other) = (std::ptr::null_mut(), std::ptr::null_mut());
    // SAFETY: all pointers are valid, and detectors are destroyed once, at the end.
    unsafe {
        assert_eq!(lazygrid_create(&raw const settings, &raw mut poisoned), OK);
        assert_eq!(lazygrid_create(&raw const settings, &raw mut other), OK);
        assert_eq!(with_detector(poisoned, |_| panic!("on purpose")), INTERNAL);
        let mut bytes = 7;
        assert_eq!(lazygrid_memory_for(poisoned, 10, &raw mut bytes), INTERNAL);
        assert_eq!(bytes, 0);
        assert_eq!(CStr::from_ptr(lazygrid_last_error(poisoned)), PANICKED);
        assert_eq!(lazygrid_memory_for(other, 10, &raw mut bytes), OK);
        assert_eq!((lazygrid_destroy(poisoned), lazygrid_destroy(other)), (OK, OK));
    }
}

#[test]
fn panic_without_detector_replaces_the_message_of_the_thread() {
    // SAFETY: NULL is allowed, and this thread makes no call before the message is read.
    let message = || unsafe { CStr::from_ptr(lazygrid_last_error(std::ptr::null())) };
    assert_eq!(without_detector(|| Err(Failure::argument("an earlier call"))), ARGUMENT);
    assert_eq!(message(), c"an earlier call");
    assert_eq!(without_detector(|| panic!("on purpose")), INTERNAL);
    assert_eq!(message(), PANICKED_WITHOUT_DETECTOR);
    assert_eq!(without_detector(|| Ok(())), OK);
    assert_eq!(message(), c"");
}
