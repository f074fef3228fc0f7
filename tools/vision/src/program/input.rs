//! Sources of the frames of `i2ris vision`.

use std::fs::File;
use std::io::{Read, stdin};
use std::path::{Path, PathBuf};

use i2ris::clock;
use i2ris::units::Nanos;
use i2ris_report::Failure;
use i2ris_vision::setup::VisionSetup;
use i2ris_vision::source::{
    FrameClock, FrameSource, FrameStream, ImageFolder, MjpegStream, SourceError,
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
