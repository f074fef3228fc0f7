//! H11: confused units. Newtypes in code; in files the unit is part of the key, and values out of
//! range are refused.

use std::path::Path;

use i2ris::config::Config;
use i2ris_testing::cycle::ROBOT;

fn assert_refused(tables: &[(&str, &str)]) {
    let (head, ports) = ROBOT.split_once("[[ports]]").unwrap();
    for (table, key) in tables {
        let text = format!("{head}\n{table}\n[[ports]]{ports}");
        let error = Config::parse(&text, Path::new("robot.toml")).unwrap_err();
        assert!(error.to_string().contains(key), "{table}: {error}");
    }
}

#[test]
fn h11_a_key_without_its_unit_or_with_another_is_refused() {
    assert_refused(&[
        ("[limits]\nvelocity = 2000.0", "velocity"),
        ("[limits]\nvelocity_deg_s = 44.0", "velocity_deg_s"),
        ("[command]\ndeadline = 50", "deadline"),
        ("[command]\ndeadline_s = 0.05", "deadline_s"),
        ("[command]\nstep_rad = 0.1", "step_rad"),
    ]);
}

#[test]
fn h11_values_that_belong_to_another_unit_are_out_of_range() {
    assert_refused(&[
        ("[control]\nrate_hz = 1", "control.rate_hz"),
        ("[command]\ndeadline_ms = 50000", "command.deadline_ms"),
        ("[command]\nlease_timeout_ms = 500000000", "command.lease_timeout_ms"),
        ("[compensation]\nreversal_dead_band_deg = 50.0", "compensation.reversal_dead_band_deg"),
        ("[limits]\nplausibility_deg = 300.0", "limits.plausibility_deg"),
    ]);
}
