//! Forwards pictures to recordings while they are measured. The measurement does not wait: a
//! picture without room is dropped and counted.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::{fmt, thread};

use i2ris::ipc::Domain;
use i2ris::ipc::client::PicturePublisher;
use i2ris::units::Nanos;
use i2ris_vision::image::GreyImage;
use i2ris_vision::source::Frame;

/// Pictures that wait to be compressed.
const QUEUE_LENGTH: usize = 4;
/// JPEG quality of 100: compression that does not show on a fibre.
const QUALITY: u8 = 90;

enum Taken {
    Jpeg(Vec<u8>),
    Grey(GreyImage),
}

/// Picture counts of a view.
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

/// Forwards the pictures of a view.
pub struct PictureForwarding {
    to: SyncSender<(Nanos, Taken)>,
    counts: Arc<Counts>,
}

impl PictureForwarding {
    pub fn start(domain: &Domain, view: &str) -> Self {
        let (to, from) = sync_channel(QUEUE_LENGTH);
        let counts = Arc::new(Counts { view: view.to_owned(), ..Counts::default() });
        let (publisher, counted) = (PicturePublisher::new(domain, view), Arc::clone(&counts));
        thread::spawn(move || publish(publisher, &from, &counted));
        Self { to, counts }
    }

    pub fn counts(&self) -> Arc<Counts> {
        Arc::clone(&self.counts)
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
