//! The manual of i2ris. The chapters are in `src`, beginning with `src/SUMMARY.md`; the tests run
//! their commands and check their links.
