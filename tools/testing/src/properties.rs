//! Number of random cases of property tests.

use proptest::test_runner::{Config, FileFailurePersistence};

/// The given number of cases in the gate, or `PROPTEST_CASES`, for example in `.ci/nightly`.
/// Cases that failed once are kept next to the test, as `NAME.regressions`.
pub fn cases(in_the_gate: u32) -> Config {
    let usual = Config::default();
    Config {
        cases: std::env::var("PROPTEST_CASES").map_or(in_the_gate, |_| usual.cases),
        failure_persistence: Some(Box::new(FileFailurePersistence::WithSource("regressions"))),
        ..usual
    }
}
