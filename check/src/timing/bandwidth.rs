//! Times of the radix sort and the prefix scan compared with a plain copy.

use std::time::{Duration, Instant};

use lazygrid::Error;
use lazygrid::gpu::{GpuDevice, KeyValueBuffers, PrefixScan, RadixSort, wgpu};
use lazygrid_kernels::kernel::DIGIT_BITS;
use lazygrid_kernels::layout::SortCounts;

use crate::Random;
use crate::device::{download, storage_buffer, submit, upload, wait};
use crate::kernels::{KernelError, same};

/// Returns the time in which an idle GPU raises its clock.
pub fn warm_up(gpu: &GpuDevice) -> Duration {
    if gpu.adapter.is_hardware { Duration::from_secs(1) } else { Duration::ZERO }
}

#[derive(Clone, Debug, PartialEq)]
pub struct Measured {
    /// Seconds per round.
    pub times: Vec<f64>,
    /// Bytes read and written per round.
    pub bytes: u64,
}

impl Measured {
    /// Returns the median in seconds; 0 without times.
    pub fn median(&self) -> f64 {
        median(&self.times)
    }

    /// Returns the bytes per second.
    pub fn bandwidth(&self) -> f64 {
        self.bytes as f64 / self.median().max(1e-9)
    }
}

pub fn median(times: &[f64]) -> f64 {
    let mut sorted = times.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or(0.0)
}

#[derive(Debug)]
pub struct GpuTimer {
    gpu: GpuDevice,
    rounds: usize,
    ticks: Option<(wgpu::QuerySet, wgpu::Buffer)>,
}

impl GpuTimer {
    pub fn new(gpu: GpuDevice, rounds: usize) -> Result<Self, Error> {
        let ticks = gpu.adapter.has_timestamps.then(|| {
            let descriptor =
                wgpu::QuerySetDescriptor { label: None, ty: wgpu::QueryType::Timestamp, count: 2 };
            gpu.with_error_scope("timestamps", 16, || {
                let resolved = wgpu::BufferDescriptor {
                    label: None,
                    size: 16,
                    usage: wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC,
                    mapped_at_creation: false,
                };
                (gpu.device.create_query_set(&descriptor), gpu.device.create_buffer(&resolved))
            })
        });
        Ok(Self { rounds, ticks: ticks.transpose()?, gpu })
    }

    /// Returns `false` for wall time, which includes the submission.
    pub fn has_gpu_timestamps(&self) -> bool {
        self.ticks.is_some()
    }

    /// Times a copy of the keys and payloads that a sort pass moves.
    pub fn copy(&self, n: u32) -> Result<Measured, KernelError> {
        let size = u64::from(n.max(2)) * 8;
        let (from, to) = (storage_buffer(&self.gpu, size)?, storage_buffer(&self.gpu, size)?);
        let times = self.times(|_| (), |encoder| encoder.copy_buffer_to_buffer(&from, 0, &to, 0, size))?;
        Ok(Measured { times, bytes: 2 * size })
    }

    /// Times a scan, which reads each value twice and writes it once.
    pub fn scan(&self, n: u32, subgroups: bool) -> Result<Measured, KernelError> {
        let values = random(n);
        let (fresh, work) = (upload(&self.gpu, &values)?, storage_buffer(&self.gpu, u64::from(n) * 4)?);
        let scan = PrefixScan::new(&self.gpu.device, subgroups).bind(&work, n)?;
        let renew = |encoder: &mut wgpu::CommandEncoder| copy_all(encoder, &fresh, &work);
        let times = self.times(renew, |encoder| scan.encode(encoder))?;
        let mut sum = 0_u32;
        let before = |value: &u32| {
            let before = sum;
            sum = sum.wrapping_add(*value);
            before
        };
        let expected: Vec<u32> = values.iter().map(before).collect();
        same(|| format!("a scan of {n}"), &download(&self.gpu, &work, n as usize)?, &expected)?;
        Ok(Measured { times, bytes: 12 * u64::from(n) })
    }

    /// Times a sort, whose passes count keys, scan counters, and move keys and payload.
    pub fn sort(&self, n: u32, bits: u32, subgroups: bool) -> Result<Measured, KernelError> {
        let (keys, payload) = (random(n), (0..n).collect::<Vec<_>>());
        let fresh = [upload(&self.gpu, &keys)?, upload(&self.gpu, &payload)?];
        let bytes = u64::from(n) * 4;
        let work = KeyValueBuffers {
            keys: storage_buffer(&self.gpu, bytes)?,
            payload: storage_buffer(&self.gpu, bytes)?,
        };
        let sort = RadixSort::new(&self.gpu.device, subgroups).bind(&work, n, bits)?;
        let renew = |encoder: &mut wgpu::CommandEncoder| {
            copy_all(encoder, &fresh[0], &work.keys);
            copy_all(encoder, &fresh[1], &work.payload);
        };
        let times = self.times(renew, |encoder| sort.encode(encoder))?;
        let mask = u32::MAX >> (32 - bits);
        let mut expected = payload;
        expected.sort_by_key(|&at| keys[at as usize] & mask);
        let found = download(&self.gpu, &sort.sorted().payload, n as usize)?;
        same(|| format!("a sort of {n} by {bits} bits"), &found, &expected)?;
        let a_pass = 20 * u64::from(n) + 16 * u64::from(SortCounts::for_sort(n).counters);
        Ok(Measured { times, bytes: u64::from(bits.div_ceil(DIGIT_BITS)) * a_pass })
    }

    fn times(
        &self,
        prepare: impl Fn(&mut wgpu::CommandEncoder),
        record: impl Fn(&mut wgpu::CommandEncoder),
    ) -> Result<Vec<f64>, Error> {
        let begun = Instant::now();
        self.seconds(&prepare, &record)?;
        while begun.elapsed() < warm_up(&self.gpu) {
            self.seconds(&prepare, &record)?;
        }
        (0..self.rounds).map(|_| self.seconds(&prepare, &record)).collect()
    }

    fn seconds(
        &self,
        prepare: impl Fn(&mut wgpu::CommandEncoder),
        record: impl Fn(&mut wgpu::CommandEncoder),
    ) -> Result<f64, Error> {
        let Some((queries, ticks)) = &self.ticks else {
            submit(&self.gpu, |encoder| {
                prepare(encoder);
                Ok(())
            })?;
            wait(&self.gpu)?;
            let start = Instant::now();
            submit(&self.gpu, |encoder| {
                record(encoder);
                Ok(())
            })?;
            wait(&self.gpu)?;
            return Ok(start.elapsed().as_secs_f64());
        };
        submit(&self.gpu, |encoder| {
            prepare(encoder);
            stamp(encoder, queries, 0);
            record(encoder);
            stamp(encoder, queries, 1);
            encoder.resolve_query_set(queries, 0..2, ticks, 0);
            Ok(())
        })?;
        let read = download::<u64>(&self.gpu, ticks, 2)?;
        let period = f64::from(self.gpu.queue.get_timestamp_period()) * 1e-9;
        Ok(read[1].saturating_sub(read[0]) as f64 * period)
    }
}

pub fn stamp(encoder: &mut wgpu::CommandEncoder, queries: &wgpu::QuerySet, at: u32) {
    let writes = wgpu::ComputePassTimestampWrites {
        query_set: queries,
        beginning_of_pass_write_index: Some(at),
        end_of_pass_write_index: None,
    };
    encoder.begin_compute_pass(&wgpu::ComputePassDescriptor { label: None, timestamp_writes: Some(writes) });
}

fn copy_all(encoder: &mut wgpu::CommandEncoder, from: &wgpu::Buffer, to: &wgpu::Buffer) {
    encoder.copy_buffer_to_buffer(from, 0, to, 0, from.size().min(to.size()));
}

fn random(n: u32) -> Vec<u32> {
    let mut random = Random(n.into());
    (0..n).map(|_| random.word()).collect()
}
