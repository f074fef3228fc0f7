//! Frames as Y4M streams in FIFOs, one for each view, every frame with its stamp.

use std::fs::{File, OpenOptions};
use std::io::{self, BufWriter, ErrorKind, Write};
use std::path::PathBuf;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread;

use i2ris::units::Nanos;
use i2ris_vision::image::GreyImage;
use nix::sys::stat::Mode;

use i2ris_report::Failure;

/// One frame per camera, and when they were taken.
pub type FrameSet = (Nanos, Vec<GreyImage>);

/// FIFOs, and the thread that writes frames into them once somebody reads.
pub struct Fifos {
    paths: Vec<PathBuf>,
    /// Where frames are handed over. The other end goes when a reader goes.
    pub to: SyncSender<FrameSet>,
}

impl Fifos {
    /// Makes the FIFOs.
    pub fn make(paths: &[PathBuf]) -> Result<Self, Failure> {
        for path in paths {
            nix::unistd::mkfifo(path, Mode::S_IRUSR | Mode::S_IWUSR).map_err(|error| {
                format!("cannot make the FIFO {}: {error}; remove what is there", path.display())
            })?;
        }
        let (to, from) = sync_channel(1);
        let paths = paths.to_vec();
        let readers = paths.clone();
        thread::spawn(move || match write(&readers, &from) {
            Err(error) if error.kind() != ErrorKind::BrokenPipe => eprintln!("FIFOs: {error}"),
            _ => {}
        });
        Ok(Self { paths, to })
    }
}

impl Drop for Fifos {
    fn drop(&mut self) {
        for path in &self.paths {
            // Only tidying: it may be gone already.
            let _ = std::fs::remove_file(path);
        }
    }
}

/// Waits for a reader of every FIFO, then writes what comes. Ends when one of them goes.
fn write(paths: &[PathBuf], from: &Receiver<FrameSet>) -> io::Result<()> {
    let open = |path: &PathBuf| OpenOptions::new().write(true).open(path).map(BufWriter::new);
    let mut to: Vec<BufWriter<File>> = paths.iter().map(open).collect::<io::Result<_>>()?;
    let mut begun = false;
    for (stamp, images) in from {
        for (to, image) in to.iter_mut().zip(&images) {
            if !begun {
                writeln!(
                    to,
                    "YUV4MPEG2 W{} H{} F30:1 Ip A1:1 Cmono",
                    image.width(),
                    image.height()
                )?;
            }
            writeln!(to, "FRAME XT={}.{:09}", stamp.0 / 1_000_000_000, stamp.0 % 1_000_000_000)?;
            to.write_all(image.data())?;
            to.flush()?;
        }
        begun = true;
    }
    Ok(())
}
