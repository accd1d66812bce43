use std::any::Any;
use std::future::Future;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::pin::Pin;
use std::sync::{Arc, Mutex, PoisonError};
use std::task::{Context, Poll, Waker};
use std::time::Duration;

use lazygrid_host::start_thread;

use super::error_scope::with_error_scope;
use crate::Error;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Wait {
    Blocking,
    /// A thread polls the device, because wgpu progresses only when polled, and wakes the task.
    Async,
}

/// A request to map all of a buffer for reading.
#[derive(Debug)]
pub(crate) struct Mapping {
    buffer: wgpu::Buffer,
    answer: MappingAnswer,
}

#[derive(Clone, Debug, Default)]
struct MappingAnswer(Arc<Mutex<State>>);

#[derive(Debug, Default)]
struct State {
    answer: Option<Answer>,
    waker: Option<Waker>,
}

#[derive(Debug)]
enum Answer {
    Mapped,
    Failed(Error),
    /// wgpu dropped the callback without a call.
    Dropped,
}

/// Answers even if it is dropped without a call, because a panic of [`wgpu::Device::poll`] on any thread drops the
/// callbacks that it would have called.
struct Callback(MappingAnswer);

impl Callback {
    fn call(self, result: Result<(), wgpu::BufferAsyncError>) {
        self.0.set(match result {
            Ok(()) => Answer::Mapped,
            Err(_) => Answer::Failed(Error::DeviceLost { reason: "no readback".to_owned() }),
        });
    }
}

impl Drop for Callback {
    fn drop(&mut self) {
        self.0.set(Answer::Dropped);
    }
}

impl Mapping {
    pub(crate) fn request(buffer: &wgpu::Buffer) -> Self {
        let answer = MappingAnswer::default();
        let callback = Callback(answer.clone());
        buffer.slice(..).map_async(wgpu::MapMode::Read, move |result| callback.call(result));
        Self { buffer: buffer.clone(), answer }
    }

    pub(crate) async fn finished(
        &self,
        device: &wgpu::Device,
        submission: Option<wgpu::SubmissionIndex>,
        timeout: Duration,
        wait: Wait,
    ) -> Result<(), Error> {
        let until = wgpu::PollType::Wait { submission_index: submission, timeout: Some(timeout) };
        let mut answer = self.answer.wait_for(device, until.clone(), wait).await?;
        if let Answer::Dropped = answer {
            let again = with_error_scope(device, "a second request for a readback", 0, || {
                // The buffer may be mapped, because the mapping precedes the callback.
                self.buffer.unmap();
                Self::request(&self.buffer)
            })?;
            answer = again.answer.wait_for(device, until, wait).await?;
        }
        match answer {
            Answer::Mapped => Ok(()),
            Answer::Failed(error) => Err(error),
            Answer::Dropped => Err(Error::DeviceLost { reason: "no answer to a readback".to_owned() }),
        }
    }

    pub(crate) fn buffer(&self) -> &wgpu::Buffer {
        &self.buffer
    }

    /// Returns the contents of the buffer, which must be mapped.
    pub(crate) fn view(&self) -> Result<wgpu::BufferView, Error> {
        let view = self.buffer.slice(..).get_mapped_range();
        view.map_err(|error| Error::DeviceRejected { what: "a readback", reason: error.to_string() })
    }
}

pub(crate) fn map_for_reading(
    device: &wgpu::Device,
    buffer: &wgpu::Buffer,
    submission: Option<wgpu::SubmissionIndex>,
    timeout: Duration,
) -> Result<wgpu::BufferView, Error> {
    let mapping = with_error_scope(device, "a readback", buffer.size(), || Mapping::request(buffer))?;
    pollster::block_on(mapping.finished(device, submission, timeout, Wait::Blocking))?;
    mapping.view()
}

impl MappingAnswer {
    async fn wait_for(
        &self,
        device: &wgpu::Device,
        until: wgpu::PollType,
        wait: Wait,
    ) -> Result<Answer, Error> {
        let device = device.clone();
        let waiting = self.clone();
        let wait_for = move || {
            if let Err(error) = poll(&device, until) {
                waiting.set(Answer::Failed(error));
            }
        };
        match wait {
            Wait::Blocking => wait_for(),
            Wait::Async => drop(start_thread(|| std::thread::Builder::new().spawn(wait_for))?),
        }
        Ok(self.clone().await)
    }

    fn set(&self, answer: Answer) {
        let mut state = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        state.answer.get_or_insert(answer);
        if let Some(waker) = state.waker.take() {
            waker.wake();
        }
    }
}

pub(crate) fn poll(device: &wgpu::Device, until: wgpu::PollType) -> Result<(), Error> {
    let seconds = match &until {
        wgpu::PollType::Wait { timeout: Some(timeout), .. } => timeout.as_secs_f64(),
        _ => 0.0,
    };
    match catch_unwind(AssertUnwindSafe(|| device.poll(until))) {
        Ok(Ok(_)) => Ok(()),
        Ok(Err(wgpu::PollError::Timeout)) => Err(Error::Timeout { seconds }),
        Ok(Err(other)) => Err(Error::DeviceRejected { what: "waiting", reason: other.to_string() }),
        Err(panic) if is_queue_empty(&*panic) => Ok(()),
        Err(panic) => match loss(&*panic) {
            Some(reason) => Err(Error::DeviceLost { reason }),
            None => resume_unwind(panic),
        },
    }
}

/// Returns `true` for wgpu's assertion that a wait for an empty queue has succeeded.
///
/// It fails without a fault if the wait times out, and another thread sees all submissions finished before this one
/// looks at the queue (wgpu's pull request 9958).
fn is_queue_empty(panic: &(dyn Any + Send)) -> bool {
    let message = panic.downcast_ref::<String>();
    message.is_some_and(|message| message.starts_with("If the queue is empty, the current submission index"))
}

/// Returns wgpu's message; `None` for panics of a host application's callbacks, which may run while wgpu polls.
fn loss(panic: &(dyn Any + Send)) -> Option<String> {
    let message = panic.downcast_ref::<String>()?;
    message.starts_with("Error in Device::").then(|| message.clone())
}

impl Future for MappingAnswer {
    type Output = Answer;

    fn poll(self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Self::Output> {
        let mut state = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        match state.answer.take() {
            Some(answer) => Poll::Ready(answer),
            None => {
                state.waker = Some(context.waker().clone());
                Poll::Pending
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use wgpu::BufferUsages as Usages;

    use super::*;
    use crate::gpu::device::device_or_skip;

    #[test]
    fn panic_of_a_callback_is_not_a_loss() {
        let panic = |message: &str| -> Box<dyn Any + Send> { Box::new(message.to_owned()) };
        let lost = "Error in Device::poll: Validation Error";
        assert_eq!(loss(&*panic(lost)), Some(lost.to_owned()));
        assert_eq!(loss(&*panic("index out of bounds")), None);
        assert_eq!(loss(&3_u32), None);
    }

    /// Waits with time limits that expire at about the end of the work, while another thread looks at the queue.
    #[test]
    fn expired_wait_for_an_empty_queue_is_no_panic() {
        let Some(gpu) = device_or_skip() else { return };
        let work = |waits: bool| {
            let [from, to] = [Usages::COPY_SRC, Usages::COPY_DST].map(|usage| buffer(&gpu.device, usage));
            for round in 0..5000 {
                let mut encoder = gpu.device.create_command_encoder(&Default::default());
                encoder.copy_buffer_to_buffer(&from, 0, &to, 0, from.size());
                let submission_index = Some(gpu.queue.submit([encoder.finish()]));
                let timeout = waits.then(|| Duration::from_micros(round % 100));
                let polled = poll(&gpu.device, wgpu::PollType::Wait { submission_index, timeout });
                assert!(matches!(polled, Ok(()) | Err(Error::Timeout { .. })), "{polled:?}");
            }
        };
        std::thread::scope(|scope| {
            for waits in [true, false, true] {
                scope.spawn(move || work(waits));
            }
        });
    }

    #[test]
    fn mapping_survives_a_dropped_callback() {
        let Some(gpu) = device_or_skip() else { return };
        let buffer = buffer(&gpu.device, Usages::MAP_READ | Usages::COPY_DST);
        buffer.slice(..).map_async(wgpu::MapMode::Read, drop);
        poll(&gpu.device, wgpu::PollType::wait_indefinitely()).expect("mapped");
        for wait in [Wait::Blocking, Wait::Async] {
            let answer = MappingAnswer::default();
            drop(Callback(answer.clone()));
            let mapping = Mapping { buffer: buffer.clone(), answer };
            let finished = mapping.finished(&gpu.device, None, Duration::from_secs(60), wait);
            assert_eq!(pollster::block_on(finished), Ok(()));
            assert_eq!(mapping.view().expect("mapped")[..], [0; 16]);
        }
    }

    fn buffer(device: &wgpu::Device, usage: Usages) -> wgpu::Buffer {
        device.create_buffer(&wgpu::BufferDescriptor {
            label: None,
            size: 16,
            usage,
            mapped_at_creation: false,
        })
    }
}
