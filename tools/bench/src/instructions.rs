//! Instructions per call: the program runs itself under valgrind, with one round of calls and with
//! three, and subtracts.

use std::env;
use std::hint::black_box;
use std::process::Command;

use i2ris::units::Nanos;

use crate::BenchError;
use crate::inverse::{MODELS, TICKS, workload};
use crate::model::Operators;
use crate::outcome::{Found, Outcome, Quantity};
use crate::tick::Cycle;

/// Whole ticks with ten components: family, operators.
const TICK_COMPONENTS: usize = 10;
const FAMILIES: [(&str, Operators); 4] = [
    ("gmr", Operators::Plays(0)),
    ("gmr-play, 8 plays per motor", Operators::Plays(8)),
    ("gmr-stop, 3 segments", Operators::Stops(3)),
    ("gmr-prandtl-ishlinskii, 8 plays per motor", Operators::GeneralisedPlays(8)),
];

const CALLS: [&str; 4] = ["inverse", "forward", "advance", "correction"];

/// Calls a model at every tick, or runs whole ticks with a family, `rounds` times.
pub fn repeat(call: &str, model: usize, rounds: usize) -> Result<(), BenchError> {
    if call == "tick" {
        let (_, operators) = FAMILIES[model];
        let mut cycle = Cycle::new(Nanos::from_millis(1), TICK_COMPONENTS, operators, false)?;
        for _ in 0..rounds * TICKS {
            cycle.step()?;
        }
        return Ok(());
    }
    let (components, plays, ..) = MODELS[model];
    let model = crate::model::model(components, Operators::Plays(plays))?;
    let ticks = workload(&model);
    for tick in (0..rounds).flat_map(|_| &ticks) {
        let tick = black_box(tick);
        match call {
            "inverse" => drop(black_box(model.invert(&tick.goal, &tick.memory, &tick.query))),
            "forward" => drop(black_box(model.predict(&tick.query.start, &tick.memory))),
            "correction" => drop(black_box(model.correction(&tick.memory))),
            _ => {
                let mut memory = tick.memory;
                model.advance(&mut memory, &tick.query.start);
                black_box(&memory);
            }
        }
    }
    Ok(())
}

/// Instructions per call of the models of the measurement.
pub fn of_calls() -> Result<Outcome, BenchError> {
    Outcome::of("inverse", "Instructions per call, two motors and two angles", || {
        let mut quantities = Vec::new();
        for (model, (.., name, _)) in MODELS.iter().enumerate() {
            for call in CALLS {
                let value = per_call(call, model)?;
                quantities.push(Quantity::new(format!("{name}: {call}"), value, "instructions"));
            }
        }
        Ok(Found { quantities, ..Found::default() })
    })
}

/// Instructions of a whole tick, for all families.
pub fn of_ticks() -> Result<Outcome, BenchError> {
    Outcome::of("loop", "Instructions of a whole tick of the controller, K = 10", || {
        let count = |(model, (name, _)): (usize, (&str, Operators))| {
            Ok(Quantity::new(name, per_call("tick", model)?, "instructions"))
        };
        let families = FAMILIES.into_iter().enumerate();
        let quantities = families.map(count).collect::<Result<_, BenchError>>()?;
        Ok(Found { quantities, ..Found::default() })
    })
}

fn per_call(call: &str, model: usize) -> Result<f64, BenchError> {
    let [few, many] = [1, 3].map(|rounds| count(call, model, rounds));
    Ok((many? - few?) / (2 * TICKS) as f64)
}

/// Instructions of a whole run.
fn count(call: &str, model: usize, rounds: usize) -> Result<f64, BenchError> {
    let run = Command::new("valgrind")
        .args(["--tool=callgrind", "--callgrind-out-file=/dev/null"])
        .arg(env::current_exe()?)
        .args(["repeat", call, &model.to_string(), &rounds.to_string()])
        .output()
        .map_err(|error| format!("cannot run valgrind: {error}; install it"))?;
    let text = String::from_utf8_lossy(&run.stderr);
    let collected = text.lines().find_map(|line| line.split("Collected :").nth(1));
    let collected = collected.ok_or_else(|| format!("valgrind did not count: {text}"))?;
    Ok(collected.trim().parse()?)
}
