use bytemuck::Pod;
use encase::ShaderType;
use encase::internal::{CreateFrom, WriteInto};
use lazygrid::Error;
use lazygrid::gpu::{GpuDevice, wgpu};
use lazygrid_kernels::kernel::{Kernel, Variant};

use crate::device::{download, download_one, run_over, upload, upload_one};

pub(super) struct KernelCall<'a> {
    gpu: &'a GpuDevice,
    buffers: Vec<(&'static str, wgpu::Buffer)>,
}

impl<'a> KernelCall<'a> {
    pub(super) fn new(gpu: &'a GpuDevice) -> Self {
        Self { gpu, buffers: Vec::new() }
    }

    pub(super) fn bind(mut self, name: &'static str, buffer: wgpu::Buffer) -> Self {
        self.buffers.retain(|(other, _)| *other != name);
        self.buffers.push((name, buffer));
        self
    }

    pub(super) fn with<T: Pod>(self, name: &'static str, values: &[T]) -> Result<Self, Error> {
        let buffer = upload(self.gpu, values)?;
        Ok(self.bind(name, buffer))
    }

    pub(super) fn with_zeros<T: Pod>(self, name: &'static str, count: usize) -> Result<Self, Error> {
        self.with(name, &vec![T::zeroed(); count])
    }

    pub(super) fn with_layout<T: ShaderType + WriteInto>(
        self,
        name: &'static str,
        value: &T,
    ) -> Result<Self, Error> {
        let buffer = upload_one(self.gpu, value)?;
        Ok(self.bind(name, buffer))
    }

    /// # Panics
    /// Panics if a binding of the kernel has no buffer.
    pub(super) fn run(&self, kernel: &'static Kernel, variant: Variant, groups: u32) -> Result<(), Error> {
        self.run_over(kernel, variant, [groups, 1, 1])
    }

    pub(super) fn run_over(
        &self,
        kernel: &'static Kernel,
        variant: Variant,
        groups: [u32; 3],
    ) -> Result<(), Error> {
        let buffers: Vec<_> = self.buffers.iter().map(|(name, buffer)| (*name, buffer)).collect();
        run_over(self.gpu, kernel, variant, groups, &buffers)
    }

    pub(super) fn buffer(&self, name: &str) -> &wgpu::Buffer {
        let found = self.buffers.iter().find(|(other, _)| *other == name);
        &found.unwrap_or_else(|| panic!("no buffer for {name}")).1
    }

    pub(super) fn read<T: Pod>(&self, name: &str, count: usize) -> Result<Vec<T>, Error> {
        download(self.gpu, self.buffer(name), count)
    }

    pub(super) fn read_one<T: Pod>(&self, name: &str) -> Result<T, Error> {
        Ok(self.read(name, 1)?[0])
    }

    pub(super) fn read_layout<T: ShaderType + CreateFrom>(&self, name: &str) -> Result<T, Error> {
        download_one(self.gpu, self.buffer(name))
    }
}
