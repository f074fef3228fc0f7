//! Sources of the frames of `i2ris vision`, and forwarding of pictures to recordings while they are
//! measured. The measurement does not wait: a picture without room is dropped and counted.

use std::fs::File;
use std::io::{Read, stdin};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::{fmt, thread};

use i2ris::clock;
use i2ris::ipc::Domain;
use i2ris::ipc::client::PicturePublisher;
use i2ris::units::Nanos;
use i2ris_report::Failure;
use i2ris_vision::image::GreyImage;
use i2ris_vision::setup::VisionSetup;
use i2ris_vision::source::{
    Frame, FrameClock, FrameSource, FrameStream, ImageFolder, MjpegStream, SourceError,
};

/// Frames per second of a numbered folder, by default.
const FOLDER_FPS: f64 = 30.0;

/// Options for reading frames.
#[derive(Debug, Clone, clap::Args)]
pub struct Format {
    /// Format of streams
    #[arg(long, value_enum, default_value_t = StreamFormat::Y4m)]
    format: StreamFormat,
    /// Frame rate, from which stamps are computed [default: 30 for folders; frames of a stream are
    /// stamped on arrival]
    #[arg(long, value_name = "HZ", value_parser = positive)]
    fps: Option<f64>,
    /// Delay from exposure to arrival, subtracted from the stamps
    #[arg(long, value_name = "MS", default_value_t = 0.0, value_parser = not_negative)]
    latency_ms: f64,
}

/// Format of a stream.
#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum StreamFormat {
    /// YUV4MPEG2
    Y4m,
    /// JPEG files, one after the other
    Mjpeg,
}

fn positive(text: &str) -> Result<f64, String> {
    let value = text.parse().ok().filter(|v: &f64| v.is_finite() && *v > 0.0);
    value.ok_or_else(|| "must be a number above 0".to_owned())
}

fn not_negative(text: &str) -> Result<f64, String> {
    let value = text.parse().ok().filter(|v: &f64| v.is_finite() && *v >= 0.0);
    value.ok_or_else(|| "must be a number, 0 or more".to_owned())
}

/// One source for every view.
pub fn check_count(given: &[PathBuf], setup: &VisionSetup, file: &Path) -> Result<(), Failure> {
    if given.len() == setup.views.len() {
        return Ok(());
    }
    let (given, wanted) = (given.len(), setup.views.len());
    Err(format!("{given} sources of frames for {wanted} views in {}", file.display()).into())
}

impl Format {
    /// Opens the frames of one view. Waits for the other end of a FIFO.
    pub fn open(&self, path: &Path) -> Result<Box<dyn FrameSource>, SourceError> {
        if path == Path::new("-") {
            return self.stream(stdin());
        }
        if path.is_dir() {
            return Ok(Box::new(ImageFolder::open(path, self.fps.unwrap_or(FOLDER_FPS))?));
        }
        let file = File::open(path).map_err(|error| SourceError::file(path, error))?;
        self.stream(file)
    }

    fn stream<R: Read + Send + 'static>(
        &self,
        from: R,
    ) -> Result<Box<dyn FrameSource>, SourceError> {
        Ok(match self.format {
            StreamFormat::Mjpeg => Box::new(MjpegStream::new(from, self.clock())),
            StreamFormat::Y4m => Box::new(FrameStream::y4m(from, self.clock())?),
        })
    }

    fn clock(&self) -> FrameClock {
        let latency = Nanos((self.latency_ms * 1e6) as u64);
        match self.fps {
            Some(fps) => FrameClock::Rate(fps),
            None => FrameClock::Arrival(Box::new(move || clock::now().duration_since(latency))),
        }
    }

    /// Whether frames of these paths come live from a camera, not from a recording.
    pub fn is_live(&self, paths: &[PathBuf]) -> bool {
        self.fps.is_none() && !paths.iter().any(|path| path.is_dir())
    }
}

/// Pictures that wait to be compressed.
const QUEUE_LENGTH: usize = 4;
/// JPEG quality of 100: compression that does not show on a fibre.
const QUALITY: u8 = 90;

enum Taken {
    Jpeg(Vec<u8>),
    Grey(GreyImage),
}

#[derive(Debug, Default)]
pub struct Counts {
    view: String,
    handed_on: AtomicU64,
    dropped: AtomicU64,
    without_controller: AtomicU64,
}

impl fmt::Display for Counts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [handed_on, dropped, without] =
            [&self.handed_on, &self.dropped, &self.without_controller]
                .map(|count| count.load(Ordering::Relaxed));
        write!(
            f,
            "{}: {handed_on} pictures forwarded, {dropped} dropped, {without} while no controller \
             served the domain",
            self.view
        )
    }
}

pub struct PictureForwarding {
    to: SyncSender<(Nanos, Taken)>,
    pub counts: Arc<Counts>,
}

impl PictureForwarding {
    pub fn start(domain: &Domain, view: &str) -> Self {
        let (to, from) = sync_channel(QUEUE_LENGTH);
        let counts = Arc::new(Counts { view: view.to_owned(), ..Counts::default() });
        let (publisher, counted) = (PicturePublisher::new(domain, view), Arc::clone(&counts));
        thread::spawn(move || publish(publisher, &from, &counted));
        Self { to, counts }
    }

    pub fn forward(&self, frame: &Frame) {
        let Ok(picture) = &frame.picture else { return };
        let taken = match &picture.jpeg {
            Some(jpeg) => Taken::Jpeg(jpeg.clone()),
            None => Taken::Grey(picture.image.clone()),
        };
        if self.to.try_send((frame.stamp, taken)).is_err() {
            self.counts.dropped.fetch_add(1, Ordering::Relaxed);
        }
    }
}

fn publish(mut publisher: PicturePublisher, from: &Receiver<(Nanos, Taken)>, counts: &Counts) {
    for (stamp, taken) in from {
        let jpeg = match taken {
            Taken::Jpeg(jpeg) => Some(jpeg),
            Taken::Grey(image) => compress(&image),
        };
        let sent = jpeg.map(|jpeg| publisher.publish(stamp, &jpeg));
        let count = match sent {
            Some(Ok(())) => &counts.handed_on,
            Some(Err(error)) if error.is_absent() => &counts.without_controller,
            Some(Err(_)) | None => &counts.dropped,
        };
        count.fetch_add(1, Ordering::Relaxed);
    }
}

/// Compresses with three colours, as expected by programs that learn from pictures.
fn compress(image: &GreyImage) -> Option<Vec<u8>> {
    let pixels: Vec<u8> = image.data().iter().flat_map(|grey| [*grey; 3]).collect();
    let (width, height) = (image.width().try_into().ok()?, image.height().try_into().ok()?);
    let mut file = Vec::new();
    let encoder = jpeg_encoder::Encoder::new(&mut file, QUALITY);
    encoder.encode(&pixels, width, height, jpeg_encoder::ColorType::Rgb).ok()?;
    Some(file)
}
