use lazygrid::gpu::GpuDevice;
use lazygrid_kernels::kernel as k;
use lazygrid_kernels::kernel::SubgroupProbe;

use super::kernel_call::KernelCall;
use super::support::{KernelError, same, variants};

pub(crate) fn subgroup_probe(gpu: &GpuDevice) -> Result<(), KernelError> {
    let [least, most] = gpu.adapter.subgroup_sizes;
    for variant in variants(gpu) {
        let call = KernelCall::new(gpu).with("probe", &[SubgroupProbe::BEFORE])?;
        call.run(&k::SUBGROUP_PROBE, variant, SubgroupProbe::WORKGROUPS)?;
        let found = call.read_one::<SubgroupProbe>("probe")?;
        let case = || format!("{found:?} of {variant:?}");
        same(case, &found.invocations, &(SubgroupProbe::WORKGROUPS * k::WORKGROUP_SIZE))?;
        match variant.subgroups {
            None => same(case, &found.faults, &SubgroupProbe::NO_SUBGROUPS)?,
            Some(_) => {
                let is_known = (found.faults & SubgroupProbe::NO_SUBGROUPS, found.smallest <= found.largest);
                same(case, &is_known, &(0, true))?;
                let fits = least <= found.smallest && found.largest <= most;
                same(case, &(fits || found.refusal(least).is_some()), &true)?;
            }
        }
    }
    Ok(())
}
