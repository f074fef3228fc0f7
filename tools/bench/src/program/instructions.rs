//! Instructions per call: the program runs itself under valgrind, with one round of calls and with
//! three, and subtracts.

use std::env;
use std::hint::black_box;
use std::process::Command;

use i2ris::units::Nanos;
use i2ris_bench::model::{Operators, model};
use i2ris_bench::tick::Cycle;
use i2ris_bench::workload::{TICKS, workload};
use i2ris_terminal::Failure;

/// Components of the mixtures.
const COMPONENTS: [usize; 3] = [3, 10, 20];

/// Plays per motor beside the one of threshold 0.
const PLAYS: [usize; 4] = [0, 4, 8, 12];

const CALLS: [&str; 4] = ["inverse", "forward", "advance", "correction"];

/// Whole ticks: call, name, components, operators.
const WHOLE_TICKS: [(&str, &str, Operators); 4] = [
    ("tick-gmr", "gmr", Operators::None),
    ("tick-play", "gmr-play, 8 plays per motor", Operators::Plays(8)),
    ("tick-stop", "gmr-stop, 3 segments", Operators::Stops(3)),
    (
        "tick-prandtl-ishlinskii",
        "gmr-prandtl-ishlinskii, 8 plays per motor",
        Operators::GeneralisedPlays(8),
    ),
];

/// Components of the mixture of whole ticks.
const TICK_COMPONENTS: usize = 10;

/// Calls a model at every tick, `rounds` times.
pub fn repeat(call: &str, components: usize, plays: usize, rounds: usize) -> Result<(), Failure> {
    if let Some((.., operators)) = WHOLE_TICKS.iter().find(|(name, ..)| *name == call) {
        let mut cycle = Cycle::new(Nanos::from_millis(1), components, *operators)?;
        for _ in 0..rounds * TICKS {
            cycle.step()?;
        }
        return Ok(());
    }
    let model = model(components, plays)?;
    let ticks = workload(&model);
    for tick in (0..rounds).flat_map(|_| &ticks) {
        let tick = black_box(tick);
        match call {
            "inverse" => {
                black_box(model.invert(&tick.goal, &tick.memory, &tick.query));
            }
            "forward" => {
                black_box(model.predict(&tick.query.start, &tick.memory));
            }
            "correction" => {
                black_box(model.correction(&tick.memory));
            }
            "advance" => {
                let mut memory = tick.memory;
                model.advance(&mut memory, &tick.query.start);
                black_box(&memory);
            }
            _ => return Err(format!("no such call: {call}").into()),
        }
    }
    Ok(())
}

/// Prints instructions per call of all sizes.
pub fn table() -> Result<(), Failure> {
    println!("Instructions per call, two motors and two angles");
    println!(
        "{:>4}{:>7}{:>10}{:>10}{:>10}{:>12}",
        "K", "plays", CALLS[0], CALLS[1], CALLS[2], CALLS[3]
    );
    for components in COMPONENTS {
        for plays in PLAYS {
            let [inverse, forward, advance, correction] =
                CALLS.map(|call| per_call(call, components, plays));
            println!(
                "{components:>4}{plays:>7}{:>10.0}{:>10.0}{:>10.0}{:>12.0}",
                inverse?, forward?, advance?, correction?
            );
        }
    }
    println!("\nInstructions of a whole tick of the controller, K = {TICK_COMPONENTS}");
    for (call, name, _) in WHOLE_TICKS {
        println!("{:>10.0}  {name}", per_call(call, TICK_COMPONENTS, 0)?);
    }
    Ok(())
}

fn per_call(call: &str, components: usize, plays: usize) -> Result<f64, Failure> {
    let [few, many] = [1, 3].map(|rounds| count(call, components, plays, rounds));
    Ok((many? - few?) / (2 * TICKS) as f64)
}

/// Instructions of a whole run.
fn count(call: &str, components: usize, plays: usize, rounds: usize) -> Result<f64, Failure> {
    let run = Command::new("valgrind")
        .args(["--tool=callgrind", "--callgrind-out-file=/dev/null"])
        .arg(env::current_exe()?)
        .args(["repeat", call, &components.to_string(), &plays.to_string(), &rounds.to_string()])
        .output()
        .map_err(|error| format!("cannot run valgrind: {error}; install it"))?;
    let text = String::from_utf8_lossy(&run.stderr);
    let collected = text.lines().find_map(|line| line.split("Collected :").nth(1));
    let collected = collected.ok_or_else(|| format!("valgrind did not count: {text}"))?;
    Ok(collected.trim().parse()?)
}
