//! How many random cases a property is tried with.

use proptest::test_runner::{Config, FileFailurePersistence};

/// So many cases in the gate; `PROPTEST_CASES` of them elsewhere, for example in `.ci/nightly`.
/// Cases that failed once are kept beside the test, as `NAME.regressions`.
pub fn cases(in_the_gate: u32) -> Config {
    let usual = Config::default();
    Config {
        cases: std::env::var("PROPTEST_CASES").map_or(in_the_gate, |_| usual.cases),
        failure_persistence: Some(Box::new(FileFailurePersistence::WithSource("regressions"))),
        ..usual
    }
}
