//! Ranks as threads, for tests without MPI.

use std::sync::mpsc::{Receiver, Sender, channel};

use bytemuck::Pod;

use crate::{Communicator, RankData};

/// Methods panic if another rank has ended or is in another call.
pub struct Thread {
    rank: u32,
    to: Vec<Sender<Vec<u8>>>,
    from: Vec<Receiver<Vec<u8>>>,
}

/// # Panics
/// If `work` panics on a rank.
pub fn on<T: Send>(ranks: u32, work: impl Fn(Thread) -> T + Sync) -> Vec<T> {
    let n = ranks as usize;
    let mut from: Vec<Vec<_>> = (0..n).map(|_| Vec::new()).collect();
    let to: Vec<Vec<_>> = (0..n)
        .map(|_| {
            let one = |from: &mut Vec<_>| {
                let (send, receive) = channel();
                from.push(receive);
                send
            };
            from.iter_mut().map(one).collect()
        })
        .collect();
    let threads = (0..).zip(to).zip(from).map(|((rank, to), from)| Thread { rank, to, from });
    let threads: Vec<_> = threads.collect();
    std::thread::scope(|scope| {
        let work = &work;
        let handles: Vec<_> = threads.into_iter().map(|thread| scope.spawn(move || work(thread))).collect();
        handles.into_iter().map(|handle| handle.join().expect("no rank panics")).collect()
    })
}

impl Thread {
    fn trade(&self, send: Vec<Vec<u8>>) -> Vec<Vec<u8>> {
        for (to, bytes) in self.to.iter().zip(send) {
            to.send(bytes).expect("the other rank goes on");
        }
        self.from.iter().map(|from| from.recv().expect("the other rank goes on")).collect()
    }

    fn to_all(&self, bytes: &[u8]) -> Vec<Vec<u8>> {
        self.trade(vec![bytes.to_vec(); self.to.len()])
    }
}

fn received<T: Pod>(came: &[Vec<u8>]) -> RankData<T> {
    let each: Vec<Vec<T>> = came.iter().map(|bytes| bytemuck::pod_collect_to_vec(bytes)).collect();
    (each.concat(), each.iter().map(Vec::len).collect())
}

impl Communicator for Thread {
    type Error = String;

    fn rank(&self) -> u32 {
        self.rank
    }

    fn ranks(&self) -> u32 {
        self.to.len() as u32
    }

    fn ranks_on_machine(&self) -> u32 {
        self.ranks()
    }

    fn all_reduce_sum(&mut self, values: &[u64]) -> Vec<u64> {
        let (all, counts) = received::<u64>(&self.to_all(bytemuck::cast_slice(values)));
        assert!(counts.iter().all(|&count| count == values.len()), "ranks are out of step");
        (0..values.len()).map(|k| all.iter().skip(k).step_by(values.len()).sum()).collect()
    }

    fn all_gather<T: Pod>(&mut self, _: &str, local: &[T]) -> Result<RankData<T>, String> {
        Ok(received(&self.to_all(bytemuck::cast_slice(local))))
    }

    fn all_to_all_v<T: Pod>(&mut self, _: &str, send: &[T], counts: &[usize]) -> Result<RankData<T>, String> {
        assert_eq!(counts.iter().sum::<usize>(), send.len());
        let mut rest = send;
        let mut segments = Vec::new();
        for &count in counts {
            let (segment, others) = rest.split_at(count);
            segments.push(bytemuck::cast_slice(segment).to_vec());
            rest = others;
        }
        Ok(received(&self.trade(segments)))
    }

    fn agree<T>(&self, result: Result<T, String>) -> Result<T, String> {
        let message = result.as_ref().err().cloned().unwrap_or_default();
        let all = self.to_all(message.as_bytes());
        match all.into_iter().find(|message| !message.is_empty()) {
            Some(message) => Err(String::from_utf8(message).expect("text")),
            None => result,
        }
    }

    fn failure(&self, message: String) -> String {
        format!("rank {}: {message}", self.rank)
    }
}
