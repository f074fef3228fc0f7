//! `i2ris teleop input`: inspects, records and plays back input devices.

use std::fs::{File, OpenOptions};
use std::io::{self, BufRead, BufWriter, Write};
use std::path::{Path, PathBuf};

use i2ris::{clock, units::Nanos};
use i2ris_report::{Failure, Interrupt, Screen, bail, until_closed};
use i2ris_teleop::learning::{self, QUESTIONS, Snapshot};
use i2ris_teleop::{device::Device, evdev_decoder::restamp, finder, recording, state::Protocol};

use super::profiles;
use crate::numbers::seconds;
use crate::procedure::say;

const POLL: Nanos = Nanos::from_millis(5);
const DRAW: Nanos = Nanos::from_millis(100);

#[derive(Debug, clap::Subcommand)]
#[command(after_help = "Examples:
  i2ris teleop input show                        list the devices
  i2ris teleop input show /dev/input/event7      show the events of one
  i2ris teleop input record /dev/input/event7 --output hand.input
  mkfifo hand && i2ris teleop input play hand.input --to hand
  i2ris teleop input learn /dev/input/event7 --output mine.toml")]
pub enum Command {
    /// List devices, or the events of one, by the names used in profiles
    Show {
        /// The device: /dev/input/event* or /dev/hidraw*, or a pipe with a played recording
        device: Option<PathBuf>,
    },
    /// Record a device: its description, and raw bytes with times
    Record {
        /// The device
        device: PathBuf,
        /// The new file
        #[arg(long, value_name = "FILE")]
        output: PathBuf,
        /// Stop after this time instead of on Ctrl-C
        #[arg(long, value_name = "S", value_parser = seconds)]
        duration_s: Option<Nanos>,
    },
    /// Play a recording through a pipe (`mkfifo`), for `i2ris teleop --device PIPE`
    Play {
        /// The recording
        recording: PathBuf,
        /// The pipe
        #[arg(long, value_name = "PIPE")]
        to: PathBuf,
    },
    /// Create a profile
    Learn {
        /// The device
        device: PathBuf,
        /// The new profile
        #[arg(long, value_name = "FILE")]
        output: PathBuf,
    },
}

pub fn run(command: &Command) -> Result<(), Failure> {
    match command {
        Command::Show { device: None } => list(),
        Command::Show { device: Some(device) } => test(Device::open(device)?, &Interrupt::catch()?),
        Command::Record { output, .. } | Command::Learn { output, .. } if output.exists() => {
            Err(format!("--output {}: already exists; name another file", output.display()).into())
        }
        Command::Record { device, output, duration_s } => {
            record(Device::open(device)?, output, *duration_s, &Interrupt::catch()?)
        }
        Command::Play { recording, to } => play(recording, to),
        Command::Learn { device, output } => learn(Device::open(device)?, output),
    }
}

fn list() -> Result<(), Failure> {
    let profiles = profiles(&[])?;
    let found = finder::scan(&profiles);
    if found.is_empty() {
        bail!("no input device found, neither in /dev/input/event* nor in /dev/hidraw*");
    }
    let mut screen = Screen::stdout();
    for found in &found {
        until_closed(screen.say(&finder::line(found, &profiles)))?;
    }
    Ok(())
}

fn test(mut device: Device, interrupt: &Interrupt) -> Result<(), Failure> {
    let mut screen = Screen::stdout();
    until_closed(screen.say(&format!("{}; Ctrl-C exits", device.description().identity)))?;
    let mut next = clock::now();
    while !interrupt.came() {
        device.read(clock::now(), |_| {})?;
        if clock::now() >= next {
            next = next + DRAW;
            let (_, state) = device.parts();
            let axes = state.axes().map(|(axis, value)| format!("{axis} {value}"));
            let pressed = state.pressed().map(|key| format!("{key} pressed"));
            let events: Vec<_> = axes.chain(pressed).collect();
            if !until_closed(screen.draw(&[events.join("  ")]))? {
                break;
            }
        }
        clock::sleep(POLL);
    }
    Ok(())
}

fn record(
    mut device: Device,
    output: &Path,
    duration: Option<Nanos>,
    interrupt: &Interrupt,
) -> Result<(), Failure> {
    let named = |error: io::Error| format!("{}: {error}", output.display());
    let mut file = BufWriter::new(File::create_new(output).map_err(named)?);
    recording::write_head(&mut file, device.description()).map_err(named)?;
    let (start, mut frames) = (clock::now(), 0_u64);
    let mut ended = Ok(());
    while !interrupt.came() && duration.is_none_or(|span| clock::now().duration_since(start) < span)
    {
        let now = clock::now();
        let mut written = Ok(());
        let read = device.read(now, |bytes| {
            frames += 1;
            if written.is_ok() {
                written = recording::write_frame(&mut file, now.duration_since(start), bytes);
            }
        });
        written.map_err(named)?;
        if let Err(gone) = read {
            ended = Err(gone);
            break;
        }
        clock::sleep(Nanos::from_millis(1));
    }
    file.flush().map_err(named)?;
    say(&format!("{}: {frames} frames", output.display()))?;
    Ok(ended?)
}

/// Writes each frame at its recorded time, stamped with the present time. Waits for a reader.
fn play(recording: &Path, to: &Path) -> Result<(), Failure> {
    let named = |path: &Path, error: &dyn std::fmt::Display| format!("{}: {error}", path.display());
    let file = File::open(recording).map_err(|error| named(recording, &error))?;
    let (head, mut frames) = recording::read(file).map_err(|error| named(recording, &error))?;
    let mut pipe = OpenOptions::new().write(true).open(to).map_err(|error| named(to, &error))?;
    let mut write = || -> io::Result<()> {
        recording::write_head(&mut pipe, &head)?;
        let start = clock::now();
        for (at, bytes) in &mut frames {
            clock::sleep_until(start + *at);
            if head.protocol == Protocol::Evdev {
                restamp(bytes, clock::now());
            }
            recording::write_frame(&mut pipe, *at, bytes)?;
        }
        Ok(())
    };
    // The reader may end first.
    until_closed(write())?;
    Ok(())
}

fn learn(mut device: Device, output: &Path) -> Result<(), Failure> {
    let mut screen = Screen::stdout();
    let mut answers = <[Snapshot; 4]>::default();
    for (answer, question) in answers.iter_mut().zip(QUESTIONS) {
        until_closed(screen.say(&format!("{question}, then press Enter")))?;
        if io::stdin().lock().read_line(&mut String::new())? == 0 {
            bail!("the input ended before the last answer; no profile was written");
        }
        device.read(clock::now(), |_| {})?;
        *answer = Snapshot::of(device.parts().1);
    }
    let profile = learning::profile(device.description(), &answers)?;
    let text = toml::to_string(&profile)?;
    let named = |error: io::Error| format!("{}: {error}", output.display());
    let mut file = File::create_new(output).map_err(named)?;
    file.write_all(text.as_bytes()).map_err(named)?;
    let output = output.display();
    until_closed(screen.say(&format!("{output}; use it with `i2ris teleop --profile {output}`")))?;
    Ok(())
}
