//! Counts of values between edges.

/// How many values are in each bin. Bin `i` is from `edges[i]` up to, but without, `edges[i + 1]`;
/// the edges are in rising order. Values outside all bins are not counted.
#[must_use]
pub fn histogram(values: impl IntoIterator<Item = f64>, edges: &[f64]) -> Vec<u64> {
    let mut counts = vec![0; edges.len().saturating_sub(1)];
    for value in values {
        let above = edges.partition_point(|edge| *edge <= value);
        if let Some(count) = above.checked_sub(1).and_then(|bin| counts.get_mut(bin)) {
            *count += 1;
        }
    }
    counts
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_on_an_edge_is_in_the_bin_above() {
        let edges = [-1.0, 0.0, 1.0];
        assert_eq!(histogram([-0.5, 0.0, 0.5, 7.0], &edges), [1, 2]);
        assert_eq!(histogram([-2.0, -1.0, 1.0], &edges), [1, 0]);
        assert_eq!(histogram([1.0], &[]), [0; 0]);
    }
}
