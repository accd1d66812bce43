//! Tests of several crates include this file and must define `Access` in the parent module.

use std::num::NonZeroU64;

use naga::valid::{Capabilities, ModuleInfo, ValidationFlags, Validator};
use naga::{AddressSpace, Expression, Literal, Module, StorageAccess, TypeInner};

use super::Access;

/// Parses and validates a shader.
///
/// # Panics
/// Panics with the location of the error if the shader is invalid.
pub(crate) fn parse(name: &str, source: &str) -> (Module, ModuleInfo) {
    let module = naga::front::wgsl::parse_str(source)
        .unwrap_or_else(|error| panic!("{name}: {}", error.emit_to_string(source)));
    let info =
        Validator::new(ValidationFlags::all(), Capabilities::SUBGROUP | Capabilities::SUBGROUP_BARRIER)
            .validate(&module)
            .unwrap_or_else(|error| panic!("{name}: {}", error.emit_to_string(source)));
    (module, info)
}

/// Bindings must be in group 0.
pub(crate) fn bindings(name: &str, module: &Module) -> Vec<(u32, String, Access)> {
    let bound = module.global_variables.iter().filter_map(|(_, global)| {
        let binding = global.binding.as_ref()?;
        assert_eq!(binding.group, 0, "{name}");
        let access = match global.space {
            AddressSpace::Uniform => Access::Uniform,
            AddressSpace::Storage { access } if access.contains(StorageAccess::STORE) => Access::ReadWrite,
            AddressSpace::Storage { .. } => Access::Read,
            space => panic!("{name}: {space:?}"),
        };
        Some((binding.binding, global.name.clone().expect("a named binding"), access))
    });
    let mut found: Vec<_> = bound.collect();
    found.sort_by_key(|(number, ..)| *number);
    found
}

/// Compares the constants of `expected` that a shader has, and counts them in `found`.
pub(crate) fn check_constants(
    name: &str,
    module: &Module,
    expected: &[(&str, Literal)],
    found: &mut [usize],
) {
    for (_, constant) in module.constants.iter() {
        let known = expected.iter().position(|(known, _)| constant.name.as_deref() == Some(*known));
        if let (Some(k), Expression::Literal(value)) = (known, &module.global_expressions[constant.init]) {
            assert_eq!(*value, expected[k].1, "{} of {name}", expected[k].0);
            found[k] += 1;
        }
    }
}

/// Name and size, and the name and offset of each member.
pub(crate) type Structure = (String, usize, Vec<(String, usize)>);

pub(crate) fn structures(module: &Module) -> Vec<Structure> {
    let found = module.types.iter().filter_map(|(_, ty)| {
        let TypeInner::Struct { members, span } = &ty.inner else { return None };
        let member = |m: &naga::StructMember| (m.name.clone().unwrap_or_default(), m.offset as usize);
        Some((ty.name.clone().unwrap_or_default(), *span as usize, members.iter().map(member).collect()))
    });
    found.collect()
}

pub(crate) fn spirv(name: &str, module: &Module, info: &ModuleInfo) -> Vec<u32> {
    let options = naga::back::spv::Options { lang_version: (1, 3), ..Default::default() };
    naga::back::spv::write_vec(module, info, &options, None).unwrap_or_else(|error| panic!("{name}: {error}"))
}

/// Returns the shader layout of a structure. `fields` have offsets in memory, which give their order;
/// `offsets` are those in a buffer.
pub(crate) fn laid_out<const N: usize>(
    name: &str,
    size: NonZeroU64,
    mut fields: [(usize, &str); N],
    offsets: [u64; N],
) -> Structure {
    fields.sort_unstable();
    let members =
        fields.iter().zip(offsets).map(|((_, field), offset)| ((*field).to_owned(), offset as usize));
    (name.to_owned(), size.get() as usize, members.collect())
}

/// Describes a Rust structure like [`structures`]. A structure of `words` has equal layouts in a buffer and
/// in memory.
macro_rules! layout {
    ($type:ident { $($field:ident),* $(,)? }) => {
        laid_out(
            stringify!($type),
            <$type as encase::ShaderType>::min_size(),
            [$((std::mem::offset_of!($type, $field), stringify!($field))),*],
            <$type as encase::ShaderType>::METADATA.extra.offsets,
        )
    };
    (words $type:ident { $($field:ident),* $(,)? }) => {
        (
            stringify!($type).to_owned(),
            std::mem::size_of::<$type>(),
            vec![$((stringify!($field).to_owned(), std::mem::offset_of!($type, $field))),*],
        )
    };
}
pub(crate) use layout;
