use std::ops::ControlFlow;

use lazygrid::{Detector, Pair, Query};
use lazygrid_check::detectors::results::{pairs_across, pairs_among};

fn text(error: impl std::fmt::Display) -> String {
    error.to_string()
}

/// Returns the pairs that a stream delivers.
///
/// # Errors
/// Fails if the detector refuses the query, a chunk is longer than `chunk` pairs, or the returned number is wrong.
pub fn streamed<'a>(
    detector: &mut Detector,
    query: impl Into<Query<'a>>,
    chunk: usize,
) -> Result<Vec<Pair>, String> {
    let (mut pairs, mut longest) = (Vec::new(), 0);
    let delivered = detector.stream(query, chunk, |chunk_pairs| {
        longest = longest.max(chunk_pairs.len());
        pairs.extend_from_slice(chunk_pairs);
        ControlFlow::Continue(())
    });
    match delivered.map_err(text)? {
        delivered if delivered != pairs.len() as u64 => {
            Err(format!("stream returned {delivered} pairs but delivered {}", pairs.len()))
        }
        _ if longest > chunk.max(1) => Err(format!("{longest} pairs in a chunk of {chunk}")),
        _ => Ok(pairs),
    }
}

/// Returns the pairs of all neighbor lists in canonical order.
///
/// # Errors
/// Fails if the detector refuses the query, neighbors are not in ascending order, or a pair of one set is in only one
/// list.
pub fn listed<'a>(detector: &mut Detector, query: impl Into<Query<'a>>) -> Result<Vec<Pair>, String> {
    let query = query.into();
    let lists = detector.neighbors(query).map_err(text)?;
    let spheres = query.first().len();
    match lists.len() == spheres {
        false => Err(format!("{} lists of {spheres} spheres", lists.len())),
        true if query.second().is_some() => pairs_across(&lists),
        true => pairs_among(spheres, |i| lists.neighbors_of(i)),
    }
}

/// Compares the count, the neighbor lists and a stream with the `expected` pairs.
///
/// # Errors
/// Fails if one of them differs.
pub fn match_the_list<'a>(
    detector: &mut Detector,
    query: impl Into<Query<'a>>,
    expected: &[Pair],
) -> Result<(), String> {
    let query = query.into();
    let count = detector.count(query).map_err(text)?;
    if count != expected.len() as u64 {
        return Err(format!("{count} pairs are counted, but {} are listed", expected.len()));
    }
    if listed(detector, query)? != expected {
        return Err("the neighbors differ from the list".to_owned());
    }
    match streamed(detector, query, 7)? == expected {
        true => Ok(()),
        false => Err("the stream differs from the list".to_owned()),
    }
}
