//! `i2ris record replay`: runs the last seconds of a controller again, through the same cycle; and
//! `i2ris record dump`, which saves them.

use std::path::PathBuf;

use i2ris::core::{CycleEventKind, CycleOutputs};
use i2ris::ipc::client::Client;
use i2ris::process::black_box::{BlackBox, ReplayDifference, ReplayResult, replay};
use i2ris_report::{DomainOption, Failure, while_working};

#[derive(Debug, clap::Args)]
#[command(after_help = "Example:
  i2ris record replay $(i2ris record dump)")]
pub struct Arguments {
    /// Black box: a file that i2ris-control writes on a fault, at its end, or for `i2ris record
    /// dump`
    file: PathBuf,
    /// Also print every event
    #[arg(long)]
    events: bool,
}

#[derive(Debug, clap::Args)]
#[command(after_help = "Example:
  i2ris record replay $(i2ris record dump)")]
pub struct DumpArguments {
    #[command(flatten)]
    domain: DomainOption,
}

pub fn dump(arguments: &DumpArguments) -> Result<(), Failure> {
    let mut client =
        Client::connect(&arguments.domain.domain()?, super::recording::CONNECT_TIMEOUT)?;
    println!("{}", while_working("the controller writes", || client.write_black_box())?.display());
    Ok(())
}

/// Replays a black box. A tick with a different result is a failure.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let content = while_working("reading", || BlackBox::read(&arguments.file))?;
    header(&content);
    if arguments.events {
        content.ticks.iter().for_each(|tick| events(&tick.outputs));
    }
    let replayed = while_working("replaying", || replay(&content))?;
    let ReplayResult { ticks, swaps, skipped, difference } = &replayed;
    if *skipped > 0 {
        println!("skipped    {skipped} ticks after a gap, or before the first stored state");
    }
    match difference {
        None => {
            println!("replayed   {ticks} ticks with {swaps} model swaps: identical bit for bit")
        }
        Some(difference) => return Err(describe(difference, *ticks).into()),
    }
    Ok(())
}

fn header(content: &BlackBox) {
    let header = &content.header;
    println!("software   {}", header.software);
    println!("written    {}, on {}", header.written, header.cause);
    println!("boot id    {:016x}", header.boot_id);
    for model in &content.models {
        println!("model      {} bytes", model.len());
    }
    let (first, last) = (content.ticks.first(), content.ticks.last());
    if let (Some(first), Some(last)) = (first, last) {
        let seconds =
            last.timing.tick.started.duration_since(first.timing.tick.started).as_seconds();
        println!("ticks      {} to {}, {seconds:.3} s", first.number, last.number);
        println!(
            "state      {} at the end, last fault: {}",
            last.outputs.report.state, last.outputs.report.fault
        );
    }
    if header.lost > 0 {
        println!(
            "lost       {} ticks since the start, because the recorder was too slow",
            header.lost
        );
    }
}

fn events(outputs: &CycleOutputs) {
    for event in outputs.events.iter().flatten() {
        // Refusals come in floods.
        if !matches!(event.kind, CycleEventKind::Refused { .. }) {
            println!("           [{:12.6}] {event}", event.stamp.as_seconds());
        }
    }
}

fn describe(difference: &ReplayDifference, ticks: u64) -> String {
    let ReplayDifference { number, field, recorded, replayed } = difference;
    format!(
        "tick {number} differs, after {} identical ones; first different field: {field}\n  \
         recorded: {recorded}\n  \
         replayed: {replayed}\nthe file is from a different version of the software or a \
         different kind of machine, or the software has a bug",
        ticks.saturating_sub(1)
    )
}
