use crate::Error;
use std::future::Future;
use std::pin::Pin;
use std::sync::{Arc, Mutex, PoisonError};
use std::task::{Context, Poll, Waker};
use std::time::Duration;

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
    /// After all submitted work.
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
        let poll = move || {
            let until = wgpu::PollType::Wait { submission_index: Some(submission), timeout: Some(timeout) };
            if let Err(error) = device.poll(until) {
                let seconds = timeout.as_secs();
                waiting.answer(Err(match error {
                    wgpu::PollError::Timeout => Error::Timeout { seconds },
                    other => Error::DeviceRejected { what: "waiting", reason: other.to_string() },
                }));
            }
        };
        match wait {
            Wait::Blocking => poll(),
            Wait::Async => drop(std::thread::spawn(poll)),
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
