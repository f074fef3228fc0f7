//! The order in which a participant meets the conditions.

/// Balanced Latin square (Williams, Aust. J. Sci. Res. A 2, 149, 1949): over its rows every
/// condition is in every place once, and follows every other one equally often. An odd number of
/// conditions needs twice as many rows, the second half reversed.
pub fn order(conditions: usize, participant: usize) -> Vec<usize> {
    if conditions == 0 {
        return Vec::new();
    }
    let rows = if conditions.is_multiple_of(2) { conditions } else { 2 * conditions };
    let row = participant % rows;
    let (shift, is_reversed) = (row % conditions, row >= conditions);
    let place = |column: usize| {
        let first =
            if column.is_multiple_of(2) { conditions - column / 2 } else { column.div_ceil(2) };
        (first + shift) % conditions
    };
    let mut order: Vec<usize> = (0..conditions).map(place).collect();
    if is_reversed {
        order.reverse();
    }
    order
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn conditions_are_balanced_by_place_and_predecessor() {
        for count in 1..=6 {
            let rows = if count % 2 == 0 { count } else { 2 * count };
            let mut places = vec![vec![0; count]; count];
            let mut follows = vec![vec![0; count]; count];
            for participant in 0..rows {
                let row = order(count, participant);
                for (place, condition) in row.iter().enumerate() {
                    places[*condition][place] += 1;
                }
                for pair in row.windows(2) {
                    follows[pair[0]][pair[1]] += 1;
                }
            }
            assert!(places.iter().flatten().all(|times| *times == rows / count), "{count}");
            let mut off_diagonal = (0..count).flat_map(|a| (0..count).map(move |b| (a, b)));
            let times = rows / count;
            assert!(
                off_diagonal.all(|(a, b)| follows[a][b] == if a == b { 0 } else { times }),
                "{count}: {follows:?}"
            );
        }
    }
}
