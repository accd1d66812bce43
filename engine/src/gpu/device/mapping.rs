use std::any::Any;
use std::future::Future;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::pin::Pin;
use std::sync::{Arc, Mutex, PoisonError};
use std::task::{Context, Poll, Waker};
use std::time::Duration;

use lazygrid_host::start_thread;

use crate::Error;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Wait {
    Blocking,
    /// A thread polls the device, because wgpu progresses only when polled, and wakes the task.
    Async,
}

#[derive(Clone, Debug, Default)]
pub(crate) struct Mapping(Arc<Mutex<State>>);

#[derive(Debug, Default)]
struct State {
    answer: Option<Result<(), Error>>,
    waker: Option<Waker>,
}

impl Mapping {
    pub(crate) fn request(buffer: &wgpu::Buffer) -> Self {
        let mapping = Self::default();
        let answer = mapping.clone();
        buffer.slice(..).map_async(wgpu::MapMode::Read, move |result| {
            answer.answer(result.map_err(|_| Error::DeviceLost { reason: "no readback".to_owned() }));
        });
        mapping
    }

    pub(crate) async fn finished(
        self,
        device: &wgpu::Device,
        submission: wgpu::SubmissionIndex,
        timeout: Duration,
        wait: Wait,
    ) -> Result<(), Error> {
        let device = device.clone();
        let waiting = self.clone();
        let wait_for = move || {
            let until = wgpu::PollType::Wait { submission_index: Some(submission), timeout: Some(timeout) };
            if let Err(error) = poll(&device, until) {
                waiting.answer(Err(error));
            }
        };
        match wait {
            Wait::Blocking => wait_for(),
            Wait::Async => drop(start_thread(|| std::thread::Builder::new().spawn(wait_for))?),
        }
        self.await
    }

    fn answer(&self, answer: Result<(), Error>) {
        let mut state = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        state.answer.get_or_insert(answer);
        if let Some(waker) = state.waker.take() {
            waker.wake();
        }
    }
}

pub(crate) fn poll(device: &wgpu::Device, until: wgpu::PollType) -> Result<(), Error> {
    let seconds = match &until {
        wgpu::PollType::Wait { timeout: Some(timeout), .. } => timeout.as_secs(),
        _ => 0,
    };
    match catch_unwind(AssertUnwindSafe(|| device.poll(until))) {
        Ok(Ok(_)) => Ok(()),
        Ok(Err(wgpu::PollError::Timeout)) => Err(Error::Timeout { seconds }),
        Ok(Err(other)) => Err(Error::DeviceRejected { what: "waiting", reason: other.to_string() }),
        Err(panic) => match loss(&*panic) {
            Some(reason) => Err(Error::DeviceLost { reason }),
            None => resume_unwind(panic),
        },
    }
}

/// Returns wgpu's message; `None` for panics of a host application's callbacks, which may run while wgpu polls.
fn loss(panic: &(dyn Any + Send)) -> Option<String> {
    let message = panic.downcast_ref::<String>()?;
    message.starts_with("Error in Device::").then(|| message.clone())
}

impl Future for Mapping {
    type Output = Result<(), Error>;

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
    use super::*;

    #[test]
    fn panic_of_a_callback_is_not_a_loss() {
        let panic = |message: &str| -> Box<dyn Any + Send> { Box::new(message.to_owned()) };
        let lost = "Error in Device::poll: Validation Error";
        assert_eq!(loss(&*panic(lost)), Some(lost.to_owned()));
        assert_eq!(loss(&*panic("index out of bounds")), None);
        assert_eq!(loss(&3_u32), None);
    }
}
