//! Reads a recording and prints how far the measured joints moved.
//!
//! `read_recording FILE.mcap`
#![allow(clippy::print_stdout, reason = "an example")]

use std::collections::BTreeMap;
use std::error::Error;
use std::path::Path;

use i2ris::ipc::{Stream, StreamMessage};
use i2ris_record::messages::{Topic, cdr};
use i2ris_record::read::Records;
use mcap::records::Record;

fn main() -> Result<(), Box<dyn Error>> {
    let file = std::env::args().nth(1).ok_or("usage: read_recording FILE.mcap")?;
    let mut streams: BTreeMap<u16, Stream> = BTreeMap::new();
    let (mut count, mut least, mut most) = (0_u64, [f64::MAX; 2], [f64::MIN; 2]);
    let mut records = Records::open(Path::new(&file))?;
    for record in records.by_ref() {
        match record {
            Record::Channel(channel) => {
                let stream = Topic::payload_stream(&channel.topic);
                streams.extend(stream.map(|stream| (channel.id, stream)));
            }
            Record::Message { header, data } => {
                let stream = streams.get(&header.channel_id);
                let message = stream.and_then(|stream| cdr::decode(*stream, &data));
                let Some(StreamMessage::Measured(joints)) = message else { continue };
                count += 1;
                for axis in 0..2 {
                    least[axis] = least[axis].min(joints.position[axis].to_degrees());
                    most[axis] = most[axis].max(joints.position[axis].to_degrees());
                }
            }
            _ => {}
        }
    }
    println!("{count} samples");
    for (name, axis) in [("pitch", 0), ("yaw", 1)] {
        println!("{name}: {:.2} to {:.2} deg", least[axis], most[axis]);
    }
    // A file that was cut off or damaged is read as far as possible.
    records.stopped_by().map_or(Ok(()), |error| Err(error.into()))
}
