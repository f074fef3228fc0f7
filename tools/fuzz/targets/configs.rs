//! Configurations: refused with a reason, or consistent.
#![no_main]

use std::path::Path;

use i2ris::config::Config;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|text: &str| {
    let Ok(config) = Config::parse(text, Path::new("robot.toml")) else {
        return;
    };
    assert!((1..=2).contains(&config.motors()));
    for motor in 0..config.motors() {
        let axis = config.axis(motor).expect("every motor has an axis");
        assert!(axis.position_min_counts < axis.position_max_counts);
    }
});
