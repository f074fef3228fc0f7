//! Histograms in the log format of HdrHistogram, version 1.3, values in nanoseconds: one line per
//! variant with its name as the tag. HistogramLogAnalyzer, the plotter of hdrhistogram.org and the
//! libraries of Java, Python and other languages read it.

use std::time::{Duration, SystemTime};

use hdrhistogram::serialization::V2DeflateSerializer;
use hdrhistogram::serialization::interval_log::{IntervalLogWriterBuilder, Tag};

use crate::error::BenchError;
use crate::outcome::{BenchOutcome, Variant};

/// Characters that separate tags and lines.
const RESERVED: [char; 4] = [',', ' ', '\n', '\r'];

/// The log of an outcome.
///
/// # Errors
///
/// [`BenchError::Histogram`].
pub fn hdr_log(outcome: &BenchOutcome) -> Result<Vec<u8>, BenchError> {
    let (mut bytes, mut serializer) = (Vec::new(), V2DeflateSerializer::new());
    let failed = |variant: &str, reason: String| BenchError::Histogram {
        variant: variant.to_owned(),
        reason,
    };
    let mut builder = IntervalLogWriterBuilder::new();
    builder.add_comment(&format!("i2ris bench {}: {}", outcome.bench, outcome.about));
    builder.add_comment(&outcome.machine.description());
    builder.add_comment("values in nanoseconds; the tag names the variant");
    // The column of maxima is in nanoseconds, too.
    builder.with_start_time(SystemTime::now()).with_max_value_divisor(1.0);
    let mut writer = builder
        .begin_log_with(&mut bytes, &mut serializer)
        .map_err(|error| failed("header", error.to_string()))?;
    for variant in &outcome.variants {
        let (name, histogram) = (tag(variant), variant.durations.histogram());
        let zero = Duration::ZERO;
        let written = writer.write_histogram(histogram, zero, zero, Tag::new(&name));
        written.map_err(|error| failed(&variant.name, format!("{error:?}")))?;
    }
    Ok(bytes)
}

fn tag(variant: &Variant) -> String {
    format!("{}/{}", variant.group, variant.name).replace(RESERVED, "_")
}

#[cfg(test)]
mod tests {
    use hdrhistogram::Histogram;
    use hdrhistogram::serialization::Deserializer;
    use hdrhistogram::serialization::interval_log::{IntervalLogIterator, LogEntry};

    use super::*;
    use crate::outcome::Role;
    use crate::outcome::tests::{outcome, variant};

    #[test]
    fn histograms_are_read_back_with_their_names() {
        let variants = vec![
            variant("least, of all", "polled", Role::Floor, 500),
            variant("ours", "polled", Role::Ours, 9000),
        ];
        let outcome = outcome(variants);
        let bytes = hdr_log(&outcome).unwrap();
        let mut read: Vec<(String, Histogram<u64>)> = Vec::new();
        for entry in IntervalLogIterator::new(&bytes).map(Result::unwrap) {
            if let LogEntry::Interval(interval) = entry {
                let bytes = base64::decode(interval.encoded_histogram());
                let histogram = Deserializer::new().deserialize(&mut bytes.as_slice()).unwrap();
                read.push((interval.tag().unwrap().as_str().to_owned(), histogram));
            }
        }
        assert_eq!(read[0].0, "polled/least__of_all");
        for ((_, histogram), variant) in read.iter().zip(&outcome.variants) {
            assert_eq!(histogram, variant.durations.histogram());
        }
    }

    /// Base64 (RFC 4648), which hdrhistogram encodes but does not decode.
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
