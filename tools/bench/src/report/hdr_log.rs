//! Histograms in the log format of HdrHistogram, version 1.3, values in nanoseconds: one line per
//! variant with its name as the tag. HistogramLogAnalyzer, the plotter of hdrhistogram.org and the
//! libraries of Java, Python and other languages read it.

use std::time::{Duration, SystemTime};

use hdrhistogram::serialization::V2DeflateSerializer;
use hdrhistogram::serialization::interval_log::{IntervalLogWriterBuilder, Tag};

use crate::BenchError;
use crate::outcome::{Outcome, Variant};

/// Characters that separate tags and lines.
const RESERVED: [char; 4] = [',', ' ', '\n', '\r'];

pub fn hdr_log(outcome: &Outcome) -> Result<Vec<u8>, BenchError> {
    let (mut bytes, mut serializer) = (Vec::new(), V2DeflateSerializer::new());
    let mut builder = IntervalLogWriterBuilder::new();
    builder.add_comment(&format!("i2ris bench {}: {}", outcome.bench, outcome.about));
    builder.add_comment(&outcome.machine.description());
    builder.add_comment("values in nanoseconds; the tag names the variant");
    // The column of maxima is in nanoseconds, too.
    builder.with_start_time(SystemTime::now()).with_max_value_divisor(1.0);
    let mut writer = builder.begin_log_with(&mut bytes, &mut serializer)?;
    for variant in &outcome.variants {
        let (name, zero) = (tag(variant), Duration::ZERO);
        let histogram = variant.durations.histogram();
        let written = writer.write_histogram(histogram, zero, zero, Tag::new(&name));
        written.map_err(|error| {
            format!("the histogram of `{}` cannot be written: {error:?}", variant.name)
        })?;
    }
    Ok(bytes)
}

fn tag(variant: &Variant) -> String {
    format!("{}/{}", variant.group, variant.name).replace(RESERVED, "_")
}

#[cfg(test)]
mod tests {
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
        let bytes = hdr_log(&outcome(variants)).unwrap();
        let entries = IntervalLogIterator::new(&bytes).map(Result::unwrap);
        let read: Vec<(String, f64, bool)> = entries
            .filter_map(|entry| match entry {
                LogEntry::Interval(interval) => Some((
                    interval.tag().unwrap().as_str().to_owned(),
                    interval.max(),
                    // A histogram, deflated, in base64.
                    interval.encoded_histogram().starts_with("HISTFAAA"),
                )),
                _ => None,
            })
            .collect();
        let expected = [("polled/least__of_all", 1499.0), ("polled/ours", 9999.0)];
        for ((name, max, is_histogram), (tag, least)) in read.iter().zip(expected) {
            assert!(name == tag && *is_histogram && (least..least * 1.001).contains(max), "{name}");
        }
        assert_eq!(read.len(), 2);
    }
}
