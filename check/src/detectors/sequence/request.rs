use std::any::Any;
use std::fmt;
use std::ops::ControlFlow;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

use lazygrid::{Detector, Error, Exclusions, Pair, Query, Sphere, Spheres};

use crate::TestInput;
use crate::detectors::results::{pairs_across, pairs_among};
use crate::detectors::variant::text;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Request {
    pub(super) output: Output,
    pub(super) split: Option<usize>,
    pub(super) layout: Layout,
    pub(super) is_stopped: bool,
    /// `true` for exclusions of the wrong number of sets.
    pub(super) has_foreign_exclusions: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Layout {
    Rows,
    Columns,
    WideRows,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Output {
    List,
    Count,
    Neighbors,
    Stream { chunk: usize, ending: Ending },
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Ending {
    All,
    /// Ends the stream at this chunk, counted from 1.
    Break(usize),
    Panic(usize),
    /// Sets the cancel flag at this chunk, and continues.
    Stop(usize),
}

/// An answer in which pairs of two sets have `j` as an index among all spheres.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Answer {
    Pairs(Vec<Pair>),
    Count(u64),
    Part(Vec<Pair>),
    Refused(Error),
}

struct ConsumerPanic;

#[derive(Default)]
struct ReceivedPairs {
    pairs: Vec<Pair>,
    chunks: usize,
    longest: usize,
    has_ended: bool,
    late: usize,
}

struct Columns([Vec<f32>; 4]);

impl Columns {
    fn from_spheres(spheres: &[Sphere]) -> Self {
        let column = |value: fn(&Sphere) -> f32| spheres.iter().map(value).collect();
        Self([column(|s| s.center.x), column(|s| s.center.y), column(|s| s.center.z), column(|s| s.radius)])
    }

    fn view(&self) -> Result<Spheres<'_>, String> {
        let [x, y, z, r] = &self.0;
        Spheres::columns(x, y, z, r).map_err(text)
    }
}

fn wide_rows(spheres: &[Sphere]) -> Vec<[f64; 4]> {
    let row = |Sphere { center, radius }: &Sphere| [center.x, center.y, center.z, *radius].map(f64::from);
    spheres.iter().map(row).collect()
}

impl Request {
    pub(super) fn is_plain(&self) -> bool {
        let ends_early = matches!(self.output, Output::Stream { ending, .. } if ending != Ending::All);
        let is_changed = self.is_stopped || self.has_foreign_exclusions || ends_early;
        self.split.is_none() && self.layout == Layout::Rows && !is_changed
    }

    pub(super) fn answer(
        &self,
        detector: &mut Detector,
        scenario: &TestInput,
        stop: &AtomicBool,
    ) -> Result<Answer, String> {
        stop.store(self.is_stopped, Relaxed);
        let answer = self.answer_query(detector, stop, scenario);
        stop.store(false, Relaxed);
        answer
    }

    fn answer_query(
        &self,
        detector: &mut Detector,
        stop: &AtomicBool,
        scenario: &TestInput,
    ) -> Result<Answer, String> {
        let n = scenario.spheres.len();
        let split = self.split.map(|split| split.min(n));
        let first = split.unwrap_or(n);
        let rows = [&scenario.spheres[..first], &scenario.spheres[first..]];
        let only = |layout: Layout| rows.map(|rows| if self.layout == layout { rows } else { &[] });
        let (columns, wide) =
            (only(Layout::Columns).map(Columns::from_spheres), only(Layout::WideRows).map(wide_rows));
        let [a, b] = match self.layout {
            Layout::Rows => rows.map(Spheres::from),
            Layout::Columns => [columns[0].view()?, columns[1].view()?],
            Layout::WideRows => wide.each_ref().map(Spheres::from),
        };
        let (a, b) = (with_labels(a, scenario, 0..first)?, with_labels(b, scenario, first..n)?);
        let query = if split.is_some() { Query::new((a, b)) } else { Query::new(a) };
        let exclusions = self.exclusions(scenario, split)?;
        let query = exclusions.as_ref().map_or(query, |exclusions| query.without(exclusions));
        let split = split.unwrap_or(0);
        match self.output {
            Output::List => listed(detector.pairs(query).map(<[Pair]>::to_vec), split),
            Output::Count => counted(detector.count(query)),
            Output::Neighbors => match detector.neighbors(query) {
                Err(error) => Ok(Answer::Refused(error)),
                Ok(lists) if lists.len() != first => Err(format!("{} lists of {first} spheres", lists.len())),
                Ok(lists) if self.split.is_some() => {
                    pairs_across(&lists).map(|pairs| Answer::Pairs(among_all(pairs, split)))
                }
                Ok(lists) => pairs_among(n, |i| lists.neighbors_of(i)).map(Answer::Pairs),
            },
            Output::Stream { chunk, ending } => {
                streamed(chunk, ending, split, stop, |consume| detector.stream(query, chunk, consume))
            }
        }
    }

    fn exclusions(&self, scenario: &TestInput, split: Option<usize>) -> Result<Option<Exclusions>, String> {
        let n = scenario.spheres.len();
        let exclusions = match (split, self.has_foreign_exclusions, &scenario.excluded) {
            (None, true, _) => Exclusions::across(n, 3, []),
            (Some(split), true, _) => Exclusions::new(split, []),
            (_, false, None) => return Ok(None),
            (None, false, Some(excluded)) => return Ok(Some(excluded.list().clone())),
            (Some(split), false, Some(excluded)) => {
                let across = excluded.pairs().filter(|&(i, j)| (i as usize) < split && j as usize >= split);
                Exclusions::across(split, n - split, across.map(|(i, j)| (i, j - split as u32)))
            }
        };
        exclusions.map(Some).map_err(text)
    }
}

fn with_labels<'a>(
    spheres: Spheres<'a>,
    scenario: &'a TestInput,
    range: std::ops::Range<usize>,
) -> Result<Spheres<'a>, String> {
    let mut view = spheres;
    if let Some(mixture) = &scenario.mixture {
        view = view.with_species(&mixture.species[range.clone()]).map_err(text)?;
    }
    if let Some(groups) = &scenario.groups {
        view = view.with_groups(&groups[range]).map_err(text)?;
    }
    Ok(view)
}

fn listed(pairs: Result<Vec<Pair>, Error>, first: usize) -> Result<Answer, String> {
    let of_all = |pairs: Vec<Pair>| Answer::Pairs(among_all(pairs, first));
    Ok(pairs.map_or_else(Answer::Refused, of_all))
}

fn counted(count: Result<u64, Error>) -> Result<Answer, String> {
    Ok(count.map_or_else(Answer::Refused, Answer::Count))
}

fn among_all(mut pairs: Vec<Pair>, first: usize) -> Vec<Pair> {
    pairs.iter_mut().for_each(|pair| pair.j = pair.j.wrapping_add(first as u32));
    pairs
}

impl ReceivedPairs {
    fn take(&mut self, chunk: &[Pair], ending: Ending, stop: &AtomicBool) -> ControlFlow<()> {
        self.late += usize::from(self.has_ended);
        self.chunks += 1;
        self.longest = self.longest.max(chunk.len());
        self.pairs.extend_from_slice(chunk);
        match ending {
            Ending::Break(at) if at == self.chunks => {
                self.has_ended = true;
                ControlFlow::Break(())
            }
            Ending::Panic(at) if at == self.chunks => {
                self.has_ended = true;
                // Resuming prints no panic message.
                resume_unwind(Box::new(ConsumerPanic))
            }
            Ending::Stop(at) if at == self.chunks => {
                stop.store(true, Relaxed);
                ControlFlow::Continue(())
            }
            _ => ControlFlow::Continue(()),
        }
    }
}

fn streamed(
    chunk: usize,
    ending: Ending,
    first: usize,
    stop: &AtomicBool,
    stream: impl FnOnce(&mut (dyn FnMut(&[Pair]) -> ControlFlow<()> + Send)) -> Result<u64, Error>,
) -> Result<Answer, String> {
    let mut received = ReceivedPairs::default();
    let mut consume = |chunk: &[Pair]| received.take(chunk, ending, stop);
    let outcome = catch_unwind(AssertUnwindSafe(|| stream(&mut consume)));
    let ReceivedPairs { pairs, longest, has_ended, late, .. } = received;
    if late > 0 {
        return Err(format!("{late} chunks after the consumer had ended the stream"));
    }
    if longest > chunk {
        return Err(format!("{longest} pairs in a chunk of {chunk}"));
    }
    let delivered = pairs.len() as u64;
    let pairs = among_all(pairs, first);
    match outcome {
        Err(payload) if payload.is::<ConsumerPanic>() => Ok(Answer::Part(pairs)),
        Err(payload) => resume_unwind(payload as Box<dyn Any + Send>),
        Ok(Err(Error::Cancelled)) if matches!(ending, Ending::Stop(_)) => Ok(Answer::Part(pairs)),
        Ok(Err(error)) => Ok(Answer::Refused(error)),
        Ok(Ok(_)) if matches!(ending, Ending::Panic(_)) && has_ended => {
            Err("the panic of the consumer was lost".to_owned())
        }
        Ok(Ok(returned)) if returned != delivered => {
            Err(format!("stream returned {returned} pairs but delivered {delivered}"))
        }
        Ok(Ok(_)) if has_ended => Ok(Answer::Part(pairs)),
        Ok(Ok(_)) => Ok(Answer::Pairs(pairs)),
    }
}

impl fmt::Display for Request {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.output {
            Output::List => f.write_str("list")?,
            Output::Count => f.write_str("count")?,
            Output::Neighbors => f.write_str("neighbors")?,
            Output::Stream { chunk, ending: Ending::All } => write!(f, "stream by {chunk}")?,
            Output::Stream { chunk, ending } => write!(f, "stream by {chunk}, {ending:?},")?,
        }
        self.split.map_or(Ok(()), |split| write!(f, " between {split} and the others"))?;
        f.write_str(match self.layout {
            Layout::Rows => "",
            Layout::Columns => " from columns",
            Layout::WideRows => " in f64",
        })?;
        f.write_str(if self.is_stopped { " stopped" } else { "" })?;
        f.write_str(if self.has_foreign_exclusions { " with foreign exclusions" } else { "" })
    }
}
