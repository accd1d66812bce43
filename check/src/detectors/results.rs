//! Pairs from neighbor lists and streams.

use std::ops::ControlFlow;

use lazygrid::{Detector, Neighbors, Pair, Query};

use crate::detectors::variant::text;

/// # Errors
/// If the detector refuses the query, a chunk is longer than `chunk` pairs, or the returned number is wrong.
pub fn streamed<'a>(
    detector: &mut Detector,
    query: impl Into<Query<'a>>,
    chunk: usize,
) -> Result<Vec<Pair>, String> {
    let (mut pairs, mut longest) = (Vec::new(), 0);
    let handed = detector.stream(query, chunk, |part| {
        longest = longest.max(part.len());
        pairs.extend_from_slice(part);
        ControlFlow::Continue(())
    });
    match handed.map_err(text)? {
        handed if handed != pairs.len() as u64 => {
            Err(format!("stream returned {handed} pairs but delivered {}", pairs.len()))
        }
        _ if longest > chunk.max(1) => Err(format!("{longest} pairs in a chunk of {chunk}")),
        _ => Ok(pairs),
    }
}

/// Returns the pairs of all neighbor lists in canonical order.
///
/// # Errors
/// If the detector refuses the query, neighbors do not ascend, or a pair of one set is in only one list.
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

/// # Errors
/// If the count, the neighbor lists or a stream of a query are not those of the `expected` pairs.
pub fn match_the_list<'a>(
    detector: &mut Detector,
    query: impl Into<Query<'a>>,
    expected: &[Pair],
) -> Result<(), String> {
    let query = query.into();
    let count = detector.count(query).map_err(text)?;
    if count != expected.len() as u64 {
        return Err(format!("{count} pairs are counted, {} listed", expected.len()));
    }
    if listed(detector, query)? != expected {
        return Err("the neighbors differ from the list".to_owned());
    }
    match streamed(detector, query, 7)? == expected {
        true => Ok(()),
        false => Err("the stream differs from the list".to_owned()),
    }
}

/// Each pair must be in the lists of both spheres.
pub(super) fn pairs_among<'a>(
    spheres: usize,
    list: impl Fn(usize) -> &'a [u32],
) -> Result<Vec<Pair>, String> {
    let mut pairs = Vec::new();
    for i in 0..spheres {
        if !list(i).windows(2).all(|two| two[0] < two[1]) {
            return Err(format!("the neighbors of {i} do not ascend"));
        }
        for &j in list(i) {
            if j as usize >= spheres || list(j as usize).binary_search(&(i as u32)).is_err() {
                return Err(format!("{j} is in the list of {i}, but {i} is not in the list of {j}"));
            }
            if j > i as u32 {
                pairs.push(Pair { i: i as u32, j });
            }
        }
    }
    Ok(pairs)
}

pub(super) fn pairs_across(lists: &Neighbors<'_>) -> Result<Vec<Pair>, String> {
    if let Some(i) = (0..lists.len()).find(|&i| !lists.neighbors_of(i).is_sorted()) {
        return Err(format!("the neighbors of {i} do not ascend"));
    }
    let of = |i: usize| lists.neighbors_of(i).iter().map(move |&j| Pair { i: i as u32, j });
    Ok((0..lists.len()).flat_map(of).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_sided_neighbors_are_detected() {
        let lists: [&[u32]; 3] = [&[1, 2], &[0], &[0]];
        assert_eq!(pairs_among(3, |i| lists[i]), Ok(vec![Pair { i: 0, j: 1 }, Pair { i: 0, j: 2 }]));
        let lists: [&[u32]; 3] = [&[1, 2], &[0], &[]];
        assert!(pairs_among(3, |i| lists[i]).is_err());
        let lists: [&[u32]; 3] = [&[2, 1], &[0], &[0]];
        assert!(pairs_among(3, |i| lists[i]).is_err());
    }
}
