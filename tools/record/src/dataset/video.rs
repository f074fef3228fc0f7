//! Pictures as a video, by an external `ffmpeg`.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use super::DatasetError;

/// A program on the search path.
pub fn find_ffmpeg() -> Option<PathBuf> {
    let path = std::env::var_os("PATH")?;
    std::env::split_paths(&path).map(|folder| folder.join("ffmpeg")).find(|file| file.is_file())
}

/// A video in progress.
pub struct Video {
    ffmpeg: Child,
}

impl Video {
    /// H.264 with a key picture at every second one: readers jump.
    pub fn create(ffmpeg: &Path, output: &Path, fps: u32) -> Result<Self, DatasetError> {
        let fps = fps.to_string();
        let ffmpeg = Command::new(ffmpeg)
            .args(["-loglevel", "error", "-y", "-f", "image2pipe", "-c:v", "mjpeg"])
            .args(["-framerate", &fps, "-i", "-", "-c:v", "libx264", "-pix_fmt", "yuv420p"])
            // Of an odd size, H.264 takes no picture.
            .args(["-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2", "-g", "2", "-crf", "18"])
            .arg(output)
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .spawn()
            .map_err(|error| DatasetError::Video(error.to_string()))?;
        Ok(Self { ffmpeg })
    }

    pub fn add(&mut self, jpeg: &[u8]) -> Result<(), DatasetError> {
        let stdin = self.ffmpeg.stdin.as_mut();
        let written = stdin.map_or(Ok(()), |stdin| stdin.write_all(jpeg));
        written.map_err(|error| DatasetError::Video(error.to_string()))
    }

    pub fn finish(mut self) -> Result<(), DatasetError> {
        drop(self.ffmpeg.stdin.take());
        let ended = self.ffmpeg.wait().map_err(|error| DatasetError::Video(error.to_string()))?;
        if ended.success() { Ok(()) } else { Err(DatasetError::Video(ended.to_string())) }
    }
}

impl Drop for Video {
    fn drop(&mut self) {
        // One that has ended is not there any more.
        let _ = self.ffmpeg.kill();
        let _ = self.ffmpeg.wait();
    }
}
