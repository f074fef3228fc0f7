//! H11: units mixed up. Newtypes in code; in files the unit stands in the key, and what makes no
//! sense is refused.

use std::path::Path;

use i2ris::config::Config;

use crate::bench::ROBOT;

fn complaint(tables: &str) -> String {
    let (head, ports) = ROBOT.split_once("[[ports]]").unwrap();
    let text = format!("{head}\n{tables}\n[[ports]]{ports}");
    Config::parse(&text, Path::new("robot.toml"))
        .unwrap_err()
        .to_string()
}

#[test]
fn h11_a_key_without_its_unit_or_with_another_is_refused() {
    for (table, key) in [
        ("[limits]\nvelocity = 2000.0", "velocity"),
        ("[limits]\nvelocity_deg_s = 44.0", "velocity_deg_s"),
        ("[command]\ndeadline = 50", "deadline"),
        ("[command]\ndeadline_s = 0.05", "deadline_s"),
        ("[command]\nstep_rad = 0.1", "step_rad"),
        ("[model_swap]\nblend_s = 0.5", "blend_s"),
    ] {
        assert!(
            complaint(table).contains(key),
            "{table}: {}",
            complaint(table)
        );
    }
}

#[test]
fn h11_values_that_belong_to_another_unit_are_out_of_range() {
    for (table, key) in [
        ("[control]\nrate_hz = 1", "control.rate_hz"),
        ("[control]\nspin_us = 100000", "control.spin_us"),
        ("[command]\ndeadline_ms = 50000", "command.deadline_ms"),
        (
            "[command]\nlease_ms = 500000000",
            "command.lease_timeout_ms",
        ),
        (
            "[compensation]\nturning_band_deg = 50.0",
            "compensation.reversal_dead_band_deg",
        ),
        ("[model_swap]\nblend_ms = 500000", "model_swap.blend_ms"),
        (
            "[plausibility]\ndistance_deg = 300.0",
            "plausibility.distance_deg",
        ),
        ("[record]\nseconds = 12000", "record.seconds"),
    ] {
        assert!(
            complaint(table).contains(key),
            "{table}: {}",
            complaint(table)
        );
    }
}
