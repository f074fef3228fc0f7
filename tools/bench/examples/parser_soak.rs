//! Random bytes into the frame parser and the decoders of replies: no panic, and every good frame
//! behind rubbish is found.
//!
//! ```text
//! cargo run --release -p i2ris-bench --example parser_soak [BYTES] [SEED]
//! ```
//!
//! Rubbish and good frames alternate. After every piece of rubbish the parser is reset, as the
//! driver does after every time-out; then the frame must be found. Without the reset, one that
//! follows a frame cut short may be taken for the rest of it: those are counted, because the
//! protocol cannot save them (there is no way to tell).
#![allow(clippy::print_stdout, reason = "it prints what it found")]

use std::error::Error;

use i2ris::config::Family;
use i2ris::config::PortConfig;
use i2ris::drive::family_selection;
use i2ris::drive::handshake_frame;
use i2ris::drive::object;
use i2ris::drive::serial_frame::{FrameEncoder as Encoder, SerialFrame as Frame};
use i2ris::drive::serial_frame_parser::{FrameParser as Parser, ParserEvent as Parsed};

/// A small generator of our own: the library's random numbers are for other packages. Splitmix64,
/// by Vigna.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut value = self.0;
        value = (value ^ value >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        value = (value ^ value >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
        value ^ value >> 31
    }

    fn below(&mut self, bound: u64) -> usize {
        (self.next() % bound) as usize
    }

    /// A byte; the bytes of sync come often, so that frames seem to start.
    fn byte(&mut self) -> u8 {
        match self.next() % 16 {
            0 => 0x90,
            1 => 0x02,
            _ => self.next() as u8,
        }
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let total: u64 = arguments
        .next()
        .map_or(Ok(100_000_000), |text| text.parse())?;
    let mut random = Random(arguments.next().map_or(Ok(1), |text| text.parse())?);
    let dialects = [Family::Epos4, Family::Epos2].map(|family| {
        let port = PortConfig {
            family,
            ..PortConfig::new("/dev/null".into(), Vec::new())
        };
        family_selection::family_of_port(&port).command_set()
    });
    let (mut parser, mut unreset, mut encoder) =
        (Parser::default(), Parser::default(), Encoder::default());
    let (mut bytes, mut frames, mut found, mut found_unreset, mut spurious) =
        (0u64, 0u64, 0u64, 0u64, 0u64);
    let mut rest = Vec::new();
    while bytes < total {
        for _ in 0..random.below(300) {
            let byte = random.byte();
            bytes += 1;
            rest.push(byte);
            let _ = unreset.push(byte);
            if let Parsed::Frame(frame) = parser.push(byte) {
                spurious += 1;
                for dialect in dialects {
                    let _ = (dialect.read_reply(frame), dialect.write_reply(frame));
                    let _ = dialect
                        .read_segmented(1, object::DEVICE_NAME)
                        .take_reply(frame);
                }
            }
        }
        let _ = handshake_frame::decode(0, &rest);
        rest.clear();
        parser.reset();
        let data: Vec<u8> = (0..2 * random.below(8)).map(|_| random.byte()).collect();
        let frame = Frame {
            opcode: 0,
            data: &data,
        };
        frames += 1;
        for byte in encoder.encode(frame)? {
            bytes += 1;
            found += u64::from(parser.push(*byte) == Parsed::Frame(frame));
            found_unreset += u64::from(unreset.push(*byte) == Parsed::Frame(frame));
        }
    }
    println!("{bytes} bytes, no panic; rubbish was a frame with a good CRC {spurious} times");
    println!("{found} of {frames} good frames found after a reset, {found_unreset} without one");
    if found == frames {
        Ok(())
    } else {
        Err("a good frame was lost".into())
    }
}
