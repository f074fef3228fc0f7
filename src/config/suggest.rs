//! The key that someone may have meant.

/// Looks at what the parser says of an unknown key and finds the known one that is written most
/// alike; an empty text if none is alike. The parser names the unknown key first and then the known
/// ones, each in back-quotes.
pub(super) fn hint(message: &str) -> String {
    let Some(rest) = message
        .find("unknown field")
        .or_else(|| message.find("unknown variant"))
        .map(|at| &message[at..])
    else {
        return String::new();
    };
    let line = rest.lines().next().unwrap_or_default();
    let mut quoted = line.split('`').skip(1).step_by(2);
    let Some(wrong) = quoted.next() else {
        return String::new();
    };
    let nearest = quoted.map(|known| (distance(wrong, known), known)).min();
    match nearest {
        Some((distance, known)) if distance <= wrong.len().max(known.len()) / 2 => {
            format!("did you mean `{known}`?\n")
        }
        _ => String::new(),
    }
}

/// How many letters have to be put in, taken out or exchanged to make one word of the other (V.
/// Levenshtein, 1966).
fn distance(left: &str, right: &str) -> usize {
    let right: Vec<char> = right.chars().collect();
    let mut row: Vec<usize> = (0..=right.len()).collect();
    for (line, letter) in left.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = line + 1;
        for (column, other) in right.iter().enumerate() {
            let exchanged = diagonal + usize::from(letter != *other);
            diagonal = row[column + 1];
            row[column + 1] = exchanged.min(diagonal + 1).min(row[column] + 1);
        }
    }
    row[right.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_key_is_named() {
        let message = "TOML parse error at line 2\nunknown field `rate_herz`, expected one of `spin_us`, `rate_hz`, `cpu`";
        assert_eq!(hint(message), "did you mean `rate_hz`?\n");
        assert_eq!(hint("unknown field `velocity`, expected `robot_id`"), "");
        assert_eq!(hint("invalid type: string \"x\", expected u32"), "");
        assert_eq!(hint("unknown field"), "");
    }

    proptest::proptest! {
        #[test]
        fn the_distance_is_one(left in "[a-z_]{0,12}", right in "[a-z_]{0,12}") {
            let there = distance(&left, &right);
            proptest::prop_assert_eq!(there, distance(&right, &left));
            proptest::prop_assert_eq!(there == 0, left == right);
            proptest::prop_assert!(there <= left.len().max(right.len()));
            proptest::prop_assert!(there >= left.len().abs_diff(right.len()));
        }

        #[test]
        fn whatever_is_said_no_hint_panics(message in ".{0,80}") {
            let _ = hint(&format!("unknown field {message}"));
        }
    }
}
