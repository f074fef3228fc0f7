//! Help for a key that does not exist: its new name, or the known key that is spelled most alike.

/// Keys and tables of earlier versions, and their names today.
const RENAMED: [(&str, &str); 19] = [
    ("condition", "conditioning"),
    ("swap", "model_swap"),
    ("joints", "joint_limits"),
    ("lease_ms", "lease_timeout_ms"),
    ("step_deg", "max_step_deg"),
    ("step_counts", "max_step_counts"),
    ("scale", "motion_scale"),
    ("current_trip_ma", "over_current_ma"),
    ("current_trip_ms", "over_current_ms"),
    ("late_ticks", "overrun_ticks"),
    ("late_window_ms", "overrun_window_ms"),
    ("turning_band_deg", "reversal_dead_band_deg"),
    ("correction_filter_ms", "residual_filter_ms"),
    ("correction_band_deg", "residual_dead_band_deg"),
    ("lasts_ms", "debounce_ms"),
    ("deadman_ms", "loop_timeout_ms"),
    ("pattern", "polling"),
    ("status_every", "status_every_rounds"),
    ("rare_every", "slow_every_rounds"),
];

/// A sentence about the unknown key or value in a message of the parser; empty if there is nothing
/// to say. The parser names the unknown word first and then the known ones, each in back-quotes.
pub(super) fn hint(message: &str) -> String {
    let Some(at) = message.find("unknown field").or_else(|| message.find("unknown variant")) else {
        return String::new();
    };
    let line = message[at..].lines().next().unwrap_or_default();
    let mut quoted = line.split('`').skip(1).step_by(2);
    let Some(unknown) = quoted.next() else {
        return String::new();
    };
    let known: Vec<&str> = quoted.collect();
    let renamed = RENAMED.iter().find(|(old, new)| *old == unknown && known.contains(new));
    if let Some((old, new)) = renamed {
        return format!("`{old}` is called `{new}` in this version\n");
    }
    let nearest = known.into_iter().map(|word| (strsim::levenshtein(unknown, word), word)).min();
    match nearest {
        Some((distance, word)) if distance <= unknown.len().max(word.len()) / 2 => {
            format!("did you mean `{word}`?\n")
        }
        _ => String::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_key_or_the_new_name_is_named() {
        let message = "TOML parse error at line 2\nunknown field `rate_herz`, expected one of \
                       `spin_us`, `rate_hz`, `cpu`";
        assert_eq!(hint(message), "did you mean `rate_hz`?\n");
        let message = "unknown field `late_ticks`, expected `overrun_ticks`";
        assert_eq!(hint(message), "`late_ticks` is called `overrun_ticks` in this version\n");
        assert_eq!(hint("unknown field `velocity`, expected `robot_id`"), "");
        assert_eq!(hint("invalid type: string \"x\", expected u32"), "");
        assert_eq!(hint("unknown field"), "");
    }

    proptest::proptest! {
        #[test]
        fn no_message_makes_the_hint_panic(message in ".{0,80}") {
            let _ = hint(&format!("unknown field {message}"));
        }
    }
}
