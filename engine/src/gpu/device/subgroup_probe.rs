//! The subgroup probe, once per adapter and process. Kernels with subgroup operations need full subgroups whose lanes
//! follow local indices, which wgpu does not request and no API reports.

use std::collections::HashMap;
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use bytemuck::Zeroable;
use lazygrid_kernels::kernel as k;
use lazygrid_kernels::kernel::SubgroupProbe;

use super::error_scope::with_error_scope;
use super::mapping::map_for_reading;
use super::pipelines::{Pipeline, Pipelines};
use crate::Error;

const TIMEOUT: Duration = Duration::from_secs(10);

type AdapterKey = (String, String, String, u32, u32, wgpu::Backend);

static RESULTS: Mutex<Option<HashMap<AdapterKey, Option<String>>>> = Mutex::new(None);

fn key(device: &wgpu::Device) -> AdapterKey {
    let info = device.adapter_info();
    (info.name, info.driver, info.driver_info, info.vendor, info.device, info.backend)
}

pub(super) fn refusal(device: &wgpu::Device) -> Option<String> {
    let results = RESULTS.lock().unwrap_or_else(PoisonError::into_inner);
    match results.as_ref().and_then(|results| results.get(&key(device))) {
        Some(refusal) => refusal.clone(),
        None => Some("this adapter was not probed; open it with `GpuDevice` first".to_owned()),
    }
}

pub(super) fn run_once(device: &wgpu::Device, queue: &wgpu::Queue) {
    if !device.features().contains(wgpu::Features::SUBGROUP) {
        return;
    }
    let key = key(device);
    let mut results = RESULTS.lock().unwrap_or_else(PoisonError::into_inner);
    let results = results.get_or_insert_default();
    if results.contains_key(&key) {
        return;
    }
    let smallest = device.adapter_info().subgroup_min_size;
    let refusal = match probed(device, queue, smallest) {
        Ok(probe) => probe.refusal(smallest).map(str::to_owned),
        Err(error) => Some(format!("the probe of subgroups failed: {error}")),
    };
    if let Some(reason) = &refusal {
        log::warn!("{}: kernels run without subgroup operations: {reason}", key.0);
    }
    results.insert(key, refusal);
}

fn probed(device: &wgpu::Device, queue: &wgpu::Queue, smallest: u32) -> Result<SubgroupProbe, Error> {
    let variant = k::Variant { subgroups: Some(smallest), ..k::Variant::default() };
    let Pipeline { pipeline, layout } = Pipelines::compiled(device, &k::SUBGROUP_PROBE, variant)?;
    let size = size_of::<SubgroupProbe>() as u64;
    let (staging, submission) = with_error_scope(device, "the probe of subgroups", size, || {
        let buffer = |usage| {
            let label = Some("the probe of subgroups");
            device.create_buffer(&wgpu::BufferDescriptor { label, size, usage, mapped_at_creation: false })
        };
        use wgpu::BufferUsages as Usages;
        let result = buffer(Usages::STORAGE | Usages::COPY_SRC | Usages::COPY_DST);
        let staging = buffer(Usages::MAP_READ | Usages::COPY_DST);
        queue.write_buffer(&result, 0, bytemuck::bytes_of(&SubgroupProbe::BEFORE));
        let bindings = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout: &layout,
            entries: &[wgpu::BindGroupEntry { binding: 0, resource: result.as_entire_binding() }],
        });
        let mut encoder = device.create_command_encoder(&Default::default());
        let mut pass = encoder.begin_compute_pass(&Default::default());
        pass.set_pipeline(&pipeline);
        pass.set_bind_group(0, &bindings, &[]);
        pass.dispatch_workgroups(SubgroupProbe::WORKGROUPS, 1, 1);
        drop(pass);
        encoder.copy_buffer_to_buffer(&result, 0, &staging, 0, size);
        (staging, queue.submit([encoder.finish()]))
    })?;
    let view = map_for_reading(device, &staging, Some(submission), TIMEOUT)?;
    let mut probe = SubgroupProbe::zeroed();
    bytemuck::bytes_of_mut(&mut probe).copy_from_slice(&view[..size as usize]);
    Ok(probe)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::device::device_or_skip;

    #[test]
    fn wrong_probe_chooses_the_portable_variant() {
        let Some(gpu) = device_or_skip() else { return };
        if !gpu.adapter.has_subgroups {
            return;
        }
        let smallest = gpu.adapter.subgroup_sizes[0];
        let probe = probed(&gpu.device, &gpu.queue, smallest).expect("a result");
        for (faults, is_refused) in [
            (probe.faults, probe.faults != 0),
            (SubgroupProbe::PARTIAL, true),
            (SubgroupProbe::OUT_OF_ORDER, true),
        ] {
            let mut probe = probe;
            probe.faults = faults;
            let refusal = probe.refusal(smallest).map(str::to_owned);
            assert_eq!(refusal.is_some(), is_refused, "{probe:?}");
            let pipelines = Pipelines::with_refusal(&gpu.device, refusal.clone());
            assert_eq!(pipelines.subgroup_refusal(), refusal.as_deref());
            assert_eq!(pipelines.variant().subgroups.is_none(), is_refused || smallest < 4, "{probe:?}");
        }
    }
}
