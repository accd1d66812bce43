//! Each input of an entry point has the semantic that compilers of HLSL and MSL require.

mod texts;

use lazygrid_kernels::kernel::Kernel;
use naga::back::{hlsl, msl};
use naga::valid::{Capabilities, ModuleInfo, ValidationFlags, Validator};

fn parsed(text: &texts::Text) -> (naga::Module, ModuleInfo) {
    let module = naga::front::wgsl::parse_str(&text.wgsl)
        .unwrap_or_else(|e| panic!("{}: {}", text.name, e.emit_to_string(&text.wgsl)));
    let mut validator = Validator::new(ValidationFlags::all(), Capabilities::all());
    validator.subgroup_stages(naga::valid::ShaderStages::all());
    validator.subgroup_operations(naga::valid::SubgroupOperationSet::all());
    let info = validator.validate(&module).unwrap_or_else(|e| panic!("{}: {e:?}", text.name));
    (module, info)
}

fn between<'a>(text: &'a str, opening: &str, closing: &str) -> &'a str {
    text.split_once(opening).and_then(|(_, rest)| rest.split_once(closing)).map_or("", |(inside, _)| inside)
}

/// Returns the inputs of an entry point without a semantic.
fn hlsl_faults(hlsl: &str, entry: &str) -> Vec<String> {
    let mut faults = Vec::new();
    for input in between(hlsl, &format!("void {entry}("), ")\n").split(", ").filter(|input| !input.is_empty())
    {
        if input.contains(" : SV_") {
            continue;
        }
        let kind = input.split(' ').next().unwrap_or_default();
        let members: Vec<_> = between(hlsl, &format!("struct {kind} {{\n"), "}")
            .lines()
            .filter(|line| line.contains(';'))
            .collect();
        if members.is_empty() {
            faults.push(input.to_owned());
        }
        faults.extend(members.into_iter().filter(|line| !line.contains(" : SV_")).map(str::to_owned));
    }
    faults
}

#[test]
fn hlsl_entry_point_inputs_have_semantics() {
    let mut faults = Vec::new();
    for text in texts::all(Kernel::wgsl) {
        let (module, info) = parsed(&text);
        for shader_model in [hlsl::ShaderModel::V5_1, hlsl::ShaderModel::V6_0] {
            if shader_model == hlsl::ShaderModel::V5_1 && text.name.contains("-subgroups-") {
                continue; // Wave operations begin with shader model 6.0.
            }
            let options = hlsl::Options { shader_model, fake_missing_bindings: true, ..Default::default() };
            let pipeline = hlsl::PipelineOptions::default();
            let mut hlsl_text = String::new();
            let written = hlsl::Writer::new(&mut hlsl_text, &options, &pipeline).write(&module, &info, None);
            let names = written.unwrap_or_else(|e| panic!("{}: {e}", text.name)).entry_point_names;
            for name in names {
                let name = name.unwrap_or_else(|e| panic!("{}: {e}", text.name));
                assert!(hlsl_text.contains(&format!("void {name}(")), "{}: no entry point {name}", text.name);
                let found = hlsl_faults(&hlsl_text, &name);
                faults.extend(found.into_iter().map(|fault| format!("{}: {}", text.name, fault.trim())));
            }
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

#[test]
fn msl_entry_point_inputs_have_attributes() {
    let mut faults = Vec::new();
    for text in texts::all(Kernel::wgsl) {
        let (module, info) = parsed(&text);
        let options =
            msl::Options { lang_version: (2, 4), fake_missing_bindings: true, ..Default::default() };
        let (msl_text, names) = msl::write_string(&module, &info, &options, &msl::PipelineOptions::default())
            .unwrap_or_else(|e| panic!("{}: {e}", text.name));
        for name in names.entry_point_names {
            let name = name.unwrap_or_else(|e| panic!("{}: {e}", text.name));
            let inputs = between(&msl_text, &format!("kernel void {name}("), ") {");
            assert!(!inputs.is_empty(), "{}: no inputs of {name}", text.name);
            // Metal binds threadgroup memory by the order of its parameters.
            let is_bound = |line: &str| {
                line.contains("[[") || line.trim_start_matches([',', ' ']).starts_with("threadgroup ")
            };
            let bare = inputs.lines().filter(|line| line.len() > 2 && !is_bound(line));
            faults.extend(bare.map(|line| format!("{}: {line}", text.name)));
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}
