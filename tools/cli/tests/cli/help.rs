//! The help of every subcommand and of every program.

use i2ris_report::programs::PROGRAMS;

use crate::bench::{Bench, assert_says};

#[test]
fn every_command_has_an_example_and_the_first_page_tells_every_exit_code() {
    let own = "start emulate demo doctor home enable disable command teleop calibrate model";
    for name in own.split(' ').chain(PROGRAMS.map(|program| program.words)) {
        let help = Bench::new().succeeds(&format!("{name} --help"));
        assert_says(&help, &["Example", &format!("i2ris {name}")]);
    }
    let help = Bench::new().succeeds("--help");
    for name in own.split(' ') {
        assert_says(&help, &[&format!("\n  {name} ")]);
    }
    for code in ["0 ", "1 ", "2 ", "3 ", "4 ", "5 ", "6 ", "7 ", "8 ", "130 "] {
        assert!(help.lines().any(|line| line.trim_start().starts_with(code)), "{code}: {help}");
    }
}
