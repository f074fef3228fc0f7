//! `i2ris vision`: measures angles in microscope images.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a command-line program prints")]

mod input;

use std::fmt::Write as _;
use std::fs::{self, File};
use std::io::{self, Write, stdout};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::thread;
use std::time::{Duration, Instant};

use i2ris::clock;
use i2ris::ipc::client::{ClientError, ExternalPublisher};
use i2ris::units::Nanos;
use i2ris_report::{DomainOption, Failure, Interrupt, bail, until_closed};
use i2ris_vision::angle_csv::{AngleRow, Recorder};
use i2ris_vision::drawing::overlay;
use i2ris_vision::joint_angles::RestPose;
use i2ris_vision::session::{Session, SessionStatistics};
use i2ris_vision::setup::VisionSetup;
use i2ris_vision::source::SourceError;
use i2ris_vision::view_detector::{ViewDetector, ViewResult};

use input::{Format, PictureForwarding, check_count};

/// A camera without a frame for this long has stalled.
const STALL_TIMEOUT: Duration = Duration::from_secs(1);
/// Poll period for the end.
const POLL: Duration = Duration::from_millis(100);
/// Results of one view that can wait for the other: more than a second of a camera.
const QUEUE_LENGTH: usize = 256;

/// Measure angles in microscope images
#[derive(Debug, clap::Parser)]
#[command(name = "i2ris-vision", bin_name = "i2ris vision", version)]
#[command(after_help = "Examples:
  i2ris vision --config vision.toml P/top P/side --overlays drawn
  i2ris vision --config vision.toml top.fifo side.fifo --latency-ms 40 --publish \\
      --output angles.csv")]
struct Arguments {
    /// Frames of each view of the setup: a folder, a file, a FIFO, or `-` for the standard input
    #[arg(value_name = "IMAGES", num_args = 1..=2, required = true)]
    images: Vec<PathBuf>,
    /// Description of the views
    #[arg(long, value_name = "FILE", default_value = "config/vision.toml")]
    config: PathBuf,
    #[command(flatten)]
    format: Format,
    /// Time at rest at the start: the reference of the angles
    #[arg(long, value_name = "SECONDS", default_value = "2", value_parser = span)]
    rest_s: Nanos,
    /// File to write the angles to, CSV [default: standard output]
    #[arg(long, short, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Publish the angles as external/measured_jp
    #[arg(long)]
    publish: bool,
    /// Folder for every image with the measurement drawn over it, PNG
    #[arg(long, value_name = "DIR")]
    overlays: Option<PathBuf>,
    /// Forward the pictures to recordings: a JPEG unchanged, others compressed
    #[arg(long)]
    pictures: bool,
    #[command(flatten)]
    domain: DomainOption,
}

/// A span of 0 to 3600 s.
fn span(text: &str) -> Result<Nanos, String> {
    let seconds = text.parse().ok().filter(|s: &f64| (0.0..=3600.0).contains(s));
    seconds.map(|s| Nanos((s * 1e9) as u64)).ok_or_else(|| "must be seconds, 0 to 3600".to_owned())
}

/// A message of a view's thread.
type ViewMessage = Result<ViewResult, SourceError>;

fn main() -> ExitCode {
    i2ris_report::program::run(|_| true, run)
}

fn run(arguments: Arguments) -> Result<(), Failure> {
    let setup = VisionSetup::load(&arguments.config)?;
    let Arguments { images, format, .. } = &arguments;
    check_count(images, &setup, &arguments.config)?;
    let live = format.is_live(images);
    let session = Session::new(&setup, arguments.rest_s);
    let output = AngleOutput::open(&arguments, live, session.axes())?;
    let interrupt = Interrupt::catch()?;
    if arguments.pictures && !live {
        bail!("--pictures needs live frames: a stream, without --fps");
    }
    if let Some(folder) = &arguments.overlays {
        fs::create_dir_all(folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    }
    let domain = arguments.domain.domain()?;
    let (mut views, mut handed_on) = (Vec::new(), Vec::new());
    for (view, path) in setup.views.iter().zip(images) {
        let (sender, receiver) = sync_channel(QUEUE_LENGTH);
        let (path, format, detector) =
            (path.clone(), format.clone(), ViewDetector::new(view.settings()));
        let pictures = arguments.pictures.then(|| PictureForwarding::start(&domain, &view.name));
        handed_on.extend(pictures.iter().map(|it| it.counts.clone()));
        let overlays =
            arguments.overlays.as_ref().map(|folder| (folder.clone(), view.name.clone()));
        thread::spawn(move || watch(&path, &format, detector, (pictures, overlays), &sender));
        views.push(receiver);
    }
    let mut run = Run { views, session, output, live, interrupt, failure: None };
    let outcome = run.go();
    eprint!("{}{}", report(&setup, &run.session), run.output.report());
    handed_on.iter().for_each(|counts| eprintln!("{counts}"));
    outcome?;
    match run.failure {
        Some(failure) => Err(failure.into()),
        None if run.session.statistics().good == 0 => Err("no angle could be measured".into()),
        None => Ok(()),
    }
}

/// Reference, counts of good rows and of every cause.
fn report(setup: &VisionSetup, session: &Session) -> String {
    let mut text = String::new();
    for (view, rest) in setup.views.iter().zip(session.rests()) {
        let RestPose { angle_deg, spread_deg, length_px, tip_px: [x, y] } = rest;
        let _ = writeln!(
            text,
            "view {}: rest at {angle_deg:+.3} deg, spread {spread_deg:.3} deg, length \
             {length_px:.1} px, tip at {x:.1}, {y:.1} px",
            view.name
        );
    }
    let SessionStatistics { rows, good, causes, skew } = session.statistics();
    let _ = writeln!(text, "{good} of {rows} rows have angles");
    if setup.views.len() == 2 {
        let _ = writeln!(text, "pairs at most {:.1} ms apart", skew.as_seconds() * 1e3);
    }
    for ((view, cause), count) in causes {
        let _ = writeln!(text, "{count:>7}  {view}: {cause}");
    }
    text
}

/// Measures the frames of one view until they end, or until the receiver is gone.
fn watch(
    path: &Path,
    format: &Format,
    mut detector: ViewDetector,
    (pictures, overlays): (Option<PictureForwarding>, Option<(PathBuf, String)>),
    to: &SyncSender<ViewMessage>,
) {
    let mut measure = || -> Result<(), SourceError> {
        let mut source = format.open(path)?;
        for number in 1.. {
            let Some(frame) = source.next()? else { break };
            if let Some(pictures) = &pictures {
                pictures.forward(&frame);
            }
            let mut result = detector.detect(frame);
            if let Some((folder, view)) = &overlays {
                draw(&folder.join(format!("{view}_{number:05}.png")), view, &result)?;
            }
            // Many of them wait in the channel.
            result.image = None;
            if to.send(Ok(result)).is_err() {
                break;
            }
        }
        Ok(())
    };
    if let Err(error) = measure() {
        // The receiver may be gone.
        let _ = to.send(Err(error));
    }
}

fn draw(path: &Path, view: &str, result: &ViewResult) -> Result<(), SourceError> {
    let Some(image) = &result.image else { return Ok(()) };
    let seen = result.seen.clone().map_err(|cause| cause.to_string());
    let drawn = overlay(image, &format!("{view} {}", result.name), &seen).save(path);
    drawn.map_err(|error| SourceError::file(path, io::Error::other(error)))
}

struct Run {
    views: Vec<Receiver<ViewMessage>>,
    session: Session,
    output: AngleOutput,
    live: bool,
    interrupt: Interrupt,
    /// Error that ended a view early.
    failure: Option<SourceError>,
}

impl Run {
    fn go(&mut self) -> Result<(), Failure> {
        while let Some(view) = self.session.wanted() {
            match self.next(view) {
                Next::ViewMessage(reported) => self.take(view, *reported),
                Next::Ended => self.session.end(view),
                Next::Stalled => {
                    // With a full queue, frames would wait before they are stamped, and seem new.
                    for other in (0..self.views.len()).filter(|other| *other != view) {
                        while let Ok(reported) = self.views[other].try_recv() {
                            self.take(other, reported);
                        }
                    }
                    let rows = self.session.stalled(view, clock::now())?;
                    if !self.output.put(&rows)? {
                        return Ok(());
                    }
                }
                Next::Interrupted => return Ok(()),
            }
            // The reason for a missing frame says more than its absence.
            let rows = self.session.rows().map_err(|error| -> Failure {
                self.failure.take().map_or_else(|| error.into(), Failure::from)
            })?;
            if !self.output.put(&rows)? {
                return Ok(());
            }
        }
        Ok(())
    }

    fn take(&mut self, view: usize, reported: ViewMessage) {
        match reported {
            Ok(result) => self.session.take(view, result),
            Err(error) => {
                self.failure.get_or_insert(error);
                self.session.end(view);
            }
        }
    }

    fn next(&self, view: usize) -> Next {
        let start = Instant::now();
        loop {
            // Not only after a timeout: a running camera never causes one.
            if self.interrupt.came() {
                return Next::Interrupted;
            }
            match self.views[view].recv_timeout(POLL) {
                Ok(reported) => return Next::ViewMessage(Box::new(reported)),
                Err(RecvTimeoutError::Disconnected) => return Next::Ended,
                Err(RecvTimeoutError::Timeout) if self.live && start.elapsed() >= STALL_TIMEOUT => {
                    return Next::Stalled;
                }
                Err(RecvTimeoutError::Timeout) => {}
            }
        }
    }
}

enum Next {
    ViewMessage(Box<ViewMessage>),
    Ended,
    Stalled,
    Interrupted,
}

struct AngleOutput {
    recorder: Recorder<Box<dyn Write>>,
    publisher: Option<ExternalPublisher>,
    published: usize,
    without_controller: usize,
}

impl AngleOutput {
    fn open(arguments: &Arguments, live: bool, axes: [bool; 2]) -> Result<Self, Failure> {
        if arguments.publish && !live {
            bail!("--publish needs live frames: a stream, without --fps");
        }
        if arguments.publish && !axes[0] {
            bail!("--publish needs pitch: external/measured_jp cannot carry yaw alone");
        }
        let create = |path: &PathBuf| {
            File::create(path).map_err(|error| format!("{}: {error}", path.display()))
        };
        let to: Box<dyn Write> = match &arguments.output {
            None => Box::new(stdout()),
            Some(path) => Box::new(create(path)?),
        };
        let domain = arguments.publish.then(|| arguments.domain.domain()).transpose()?;
        let publisher = domain.as_ref().map(ExternalPublisher::new);
        let recorder = Recorder::new(to, axes)?;
        Ok(Self { recorder, publisher, published: 0, without_controller: 0 })
    }

    /// Writes and publishes. `false`: the reader is gone.
    fn put(&mut self, rows: &[AngleRow]) -> Result<bool, Failure> {
        for row in rows {
            if !until_closed(self.recorder.row(row))? {
                return Ok(false);
            }
            self.publish(row)?;
        }
        Ok(true)
    }

    fn publish(&mut self, row: &AngleRow) -> Result<(), ClientError> {
        let Some(publisher) = &mut self.publisher else { return Ok(()) };
        let known = |values: [Option<f64>; 2]| values.into_iter().flatten().collect::<Vec<_>>();
        let outcome = match &row.seen {
            Ok(joints) => {
                let (angles, deviations) = (known(joints.angle_rad), known(joints.std_rad));
                publisher.publish_with_quality(row.stamp, &angles, &deviations, joints.quality)
            }
            Err(_) => publisher.publish_nothing(row.stamp),
        };
        match outcome {
            Ok(()) => self.published += 1,
            // A controller may come later.
            Err(error) if error.is_absent() => self.without_controller += 1,
            Err(error) => return Err(error),
        }
        Ok(())
    }

    fn report(&self) -> String {
        if self.publisher.is_none() {
            return String::new();
        }
        format!(
            "published {} rows; {} more while no controller served the domain\n",
            self.published, self.without_controller
        )
    }
}
