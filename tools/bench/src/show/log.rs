//! Histograms in the log format of HdrHistogram, version 1.3: one line for every way, its name as
//! the tag. HistogramLogAnalyzer, the plotter of hdrhistogram.org and the libraries of Java, Python
//! and others read it. Values are nanoseconds.

use std::time::{Duration, SystemTime};

use hdrhistogram::serialization::V2DeflateSerializer;
use hdrhistogram::serialization::interval_log::{IntervalLogWriterBuilder, Tag};

use crate::error::BenchError;
use crate::outcome::{Outcome, Way};

/// What tags and lines are made of.
const RESERVED: [char; 4] = [',', ' ', '\n', '\r'];

/// The log of an outcome.
///
/// # Errors
///
/// [`BenchError::Histogram`].
pub fn log(outcome: &Outcome) -> Result<Vec<u8>, BenchError> {
    let (mut bytes, mut serializer) = (Vec::new(), V2DeflateSerializer::new());
    let failed = |way: &str, reason: String| BenchError::Histogram {
        way: way.to_owned(),
        reason,
    };
    let mut builder = IntervalLogWriterBuilder::new();
    builder.add_comment(&format!("i2ris bench {}: {}", outcome.bench, outcome.about));
    builder.add_comment(&outcome.machine.words());
    builder.add_comment("values in nanoseconds; the tag names the way");
    // Values stay nanoseconds in the column of maxima, too.
    builder
        .with_start_time(SystemTime::now())
        .with_max_value_divisor(1.0);
    let mut writer = builder
        .begin_log_with(&mut bytes, &mut serializer)
        .map_err(|error| failed("header", error.to_string()))?;
    for way in &outcome.ways {
        let name = tag(way);
        let outcome = writer.write_histogram(
            way.spans.histogram(),
            Duration::ZERO,
            Duration::ZERO,
            Tag::new(&name),
        );
        outcome.map_err(|error| failed(&way.name, format!("{error:?}")))?;
    }
    Ok(bytes)
}

fn tag(way: &Way) -> String {
    format!("{}/{}", way.group, way.name).replace(RESERVED, "_")
}

#[cfg(test)]
mod tests {
    use hdrhistogram::Histogram;
    use hdrhistogram::serialization::Deserializer;
    use hdrhistogram::serialization::interval_log::{IntervalLogIterator, LogEntry};

    use super::*;
    use crate::outcome::Role;
    use crate::outcome::tests::{outcome, way};

    #[test]
    fn what_is_logged_is_read_back_with_its_name() {
        let ways = vec![
            way("least, of all", "polled", Role::Floor, 500),
            way("ours", "polled", Role::Ours, 9000),
        ];
        let outcome = outcome(ways);
        let bytes = log(&outcome).unwrap();
        let entries: Vec<_> = IntervalLogIterator::new(&bytes)
            .map(Result::unwrap)
            .collect();
        let read: Vec<(String, Histogram<u64>)> = entries
            .iter()
            .filter_map(|entry| match entry {
                LogEntry::Interval(interval) => Some(interval),
                _ => None,
            })
            .map(|interval| {
                let bytes = base64::decode(interval.encoded_histogram());
                let histogram = Deserializer::new()
                    .deserialize(&mut bytes.as_slice())
                    .unwrap();
                (interval.tag().unwrap().as_str().to_owned(), histogram)
            })
            .collect();
        assert_eq!(read[0].0, "polled/least__of_all");
        for ((_, histogram), way) in read.iter().zip(&outcome.ways) {
            assert_eq!(histogram, way.spans.histogram());
        }
    }

    /// The alphabet of RFC 4648, decoded by hand: the crate that could do it is not ours.
    mod base64 {
        pub fn decode(text: &str) -> Vec<u8> {
            let value = |c: u8| match c {
                b'A'..=b'Z' => c - b'A',
                b'a'..=b'z' => c - b'a' + 26,
                b'0'..=b'9' => c - b'0' + 52,
                b'+' => 62,
                _ => 63,
            };
            let bits: Vec<u8> = text.bytes().filter(|c| *c != b'=').map(value).collect();
            let join = |four: &[u8]| {
                let word = four
                    .iter()
                    .enumerate()
                    .fold(0u32, |word, (i, v)| word | u32::from(*v) << (18 - 6 * i));
                word.to_be_bytes()[1..four.len()].to_vec()
            };
            bits.chunks(4).flat_map(join).collect()
        }
    }
}
