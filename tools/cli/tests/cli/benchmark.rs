//! `i2ris benchmark`.

use crate::bench::{Bench, assert_says};

#[test]
fn the_benchmark_judges_a_snake_beside_linear_and_the_exact_inverse() {
    let bench = Bench::new();
    let said = bench.run(
        "benchmark --physics preisach --draws 1 --first-seed 4 --families linear \
         --motions points --duration-s 60 --json benchmark.json --keep kept",
    );
    assert_eq!(said.code, Some(0), "{}", said.error);
    assert_says(&said.output, &["preisach           linear"]);
    let judged: serde_json::Value = serde_json::from_str(&bench.read("benchmark.json")).unwrap();
    let [judged] = judged.as_array().unwrap().as_slice() else { panic!("{judged}") };
    let rms = |of: &str| judged[of]["rms_deg"].as_f64().unwrap();
    // The exact inverse leaves what the limits of the motors cost.
    assert!(rms("exact") < 0.15, "{judged}");
    assert!((0.3..5.0).contains(&rms("linear")), "{judged}");
    assert_eq!(judged["tracking"], judged["linear"]);
    assert!(bench.exists("kept/preisach-4.csv"));
}

#[test]
fn the_benchmark_refuses_what_it_does_not_have() {
    for (options, words) in [
        ("--physics adder", ["adder", "--physics"]),
        ("--families best,worst", ["worst", "force-balance"]),
        ("--motions sleep", ["sleep", "minor-loops"]),
        ("--draws 0", ["--draws", "0"]),
        ("--figure ageing.svg", ["--figure", "--ageing"]),
        ("--ageing --drift-hours 1000", ["--drift-hours", "0 to 100"]),
        ("--ageing --json /does/not/exist/benchmark.json", ["cannot write", "exist"]),
        ("--duration-s 0", ["--duration-s", "above 0"]),
        ("--json /does/not/exist/benchmark.json", ["cannot write", "exist"]),
    ] {
        let said = Bench::new().run(&format!("benchmark {options}"));
        assert_ne!(said.code, Some(0), "{options}");
        assert_says(&said.error, &words);
    }
}
