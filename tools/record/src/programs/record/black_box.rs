//! `i2ris record replay`: runs the last seconds of a controller again, through the same cycle.

use std::path::PathBuf;

use i2ris::core::{CycleEventKind, CycleOutputs};
use i2ris::ipc::client::Client;
use i2ris::process::black_box::{BlackBox, ReplayDifference, ReplayResult, replay};
use i2ris_report::{DomainOption, Failure, while_working};

#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  i2ris record replay                      save the last seconds, print the path, and replay them
  i2ris record replay 20260131-120000-fault.box --events")]
pub struct Arguments {
    /// Black box: a file that i2ris-control wrote on a fault or at its end [default: the last
    /// seconds of the running controller, which writes them first]
    file: Option<PathBuf>,
    /// Also print every event
    #[arg(long)]
    events: bool,
    #[command(flatten)]
    domain: DomainOption,
}

/// Has the running controller write its black box, and prints the path.
fn saved(domain: &DomainOption) -> Result<PathBuf, Failure> {
    let mut client = Client::connect(&domain.domain()?, super::recording::CONNECT_TIMEOUT)?;
    let file = while_working("the controller writes", || client.write_black_box())?;
    println!("{}", file.display());
    Ok(file)
}

/// Replays a black box. A tick with a different result is a failure.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let file = arguments.file.clone().map_or_else(|| saved(&arguments.domain), Ok)?;
    let content = while_working("reading", || BlackBox::read(&file))?;
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
