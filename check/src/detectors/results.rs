use lazygrid::{Neighbors, Pair};

/// Returns the pairs of the `list` of each sphere in canonical order.
///
/// # Errors
/// Fails if neighbors do not ascend, or if a pair is not in the lists of both spheres.
pub fn pairs_among<'a>(spheres: usize, list: impl Fn(usize) -> &'a [u32]) -> Result<Vec<Pair>, String> {
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

/// Returns the pairs of a query of two sets in canonical order.
///
/// # Errors
/// Fails if neighbors do not ascend.
pub fn pairs_across(lists: &Neighbors<'_>) -> Result<Vec<Pair>, String> {
    if let Some(i) = (0..lists.len()).find(|&i| !lists.neighbors_of(i).is_sorted()) {
        return Err(format!("the neighbors of {i} do not ascend"));
    }
    let pairs_of = |i: usize| lists.neighbors_of(i).iter().map(move |&j| Pair { i: i as u32, j });
    Ok((0..lists.len()).flat_map(pairs_of).collect())
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
