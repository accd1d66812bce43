use std::num::NonZero;

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct BoundBuffer {
    pub(crate) buffer: wgpu::Buffer,
    offset: u64,
    size: Option<NonZero<u64>>,
}

impl BoundBuffer {
    pub(crate) fn range(buffer: &wgpu::Buffer, offset: u64, size: u64) -> Self {
        Self { buffer: buffer.clone(), offset, size: NonZero::new(size) }
    }

    pub(super) fn binding(&self) -> wgpu::BindingResource<'_> {
        let Self { buffer, offset, size } = self;
        wgpu::BindingResource::Buffer(wgpu::BufferBinding { buffer, offset: *offset, size: *size })
    }
}

impl From<&wgpu::Buffer> for BoundBuffer {
    fn from(buffer: &wgpu::Buffer) -> Self {
        Self::range(buffer, 0, 0)
    }
}
