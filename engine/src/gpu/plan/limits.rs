use crate::Error;

/// The device limits that a plan respects.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct DeviceLimits {
    /// Bytes of one storage binding.
    pub storage_binding: u64,
    /// Bytes of one buffer.
    pub buffer: u64,
    /// Workgroups per dimension of a dispatch.
    pub groups_per_dimension: u32,
    /// Storage buffers per kernel.
    pub storage_buffers: u32,
    /// Bytes of memory per workgroup.
    pub workgroup_memory: u32,
}

impl DeviceLimits {
    /// Returns the limits of a device.
    pub fn from_device(device: &wgpu::Device) -> Self {
        Self::from(&device.limits())
    }
}

impl From<&wgpu::Limits> for DeviceLimits {
    fn from(limits: &wgpu::Limits) -> Self {
        Self {
            storage_binding: limits.max_storage_buffer_binding_size,
            buffer: limits.max_buffer_size,
            groups_per_dimension: limits.max_compute_workgroups_per_dimension,
            storage_buffers: limits.max_storage_buffers_per_shader_stage,
            workgroup_memory: limits.max_compute_workgroup_storage_size,
        }
    }
}

impl DeviceLimits {
    /// Kernels write at most this number of workgroups per dimension of an indirect dispatch, as every GPU supports.
    pub(super) const INDIRECT_GROUPS: u32 = 65_535;

    /// # Errors
    /// [`Error::LimitExceeded`] if indirect dispatches may exceed a limit that the device was created with.
    pub(crate) fn check_indirect(&self) -> Result<(), Error> {
        let (needed, limit) = (Self::INDIRECT_GROUPS.into(), self.groups_per_dimension.into());
        if needed <= limit {
            return Ok(());
        }
        let what = "the number of workgroups per dimension";
        let remedy = "request the adapter's own limits when making the device";
        Err(Error::LimitExceeded { what, needed, limit, remedy })
    }

    /// Returns the maximum bytes of a buffer that is bound as a whole.
    pub(crate) fn bytes(&self) -> u64 {
        self.storage_binding.min(self.buffer)
    }
}
