//! What the controller reports. Streams, their names and messages are those of
//! [`i2ris::ipc::Stream`]; what goes over the network of one stream is one message or several.

use std::collections::{BTreeMap, VecDeque};

use i2ris::ipc::payload::{Payload, Version};
use i2ris::ipc::{Direction, Stream, StreamMessage};
use i2ris::units::Nanos;
use i2ris_gateway::clock::ClockOffset;

/// The reply to `version` goes with the streams, so that programs on the other computer need not
/// wait for it.
pub(crate) const VERSION: &str = "version";

/// Everything that the controller reports, and what its camera sees.
pub(crate) fn streams() -> impl Iterator<Item = Stream> {
    let is_shown = |stream: &Stream| {
        stream.properties().direction == Direction::Out || *stream == Stream::External
    };
    Stream::ALL.iter().copied().filter(is_shown)
}

/// Whether every message counts, and not only the newest one.
pub(crate) fn is_log(stream: Stream) -> bool {
    stream.properties().history > 1
}

/// Messages of every stream: what is new, or what is known.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct State {
    messages: BTreeMap<Stream, VecDeque<StreamMessage>>,
    pub version: Option<Version>,
}

impl State {
    /// Takes in a message: the newest, or one more of a log.
    pub fn insert(&mut self, message: StreamMessage) {
        let messages = self.messages.entry(message.stream()).or_default();
        if !is_log(message.stream()) {
            messages.clear();
        }
        messages.push_back(message);
    }

    /// Takes in what is new, and of a log keeps as much as a late subscriber gets in shared memory.
    pub fn update(&mut self, new: &Self) {
        for message in new.messages.values().flatten() {
            self.insert(*message);
        }
        for (stream, messages) in &mut self.messages {
            let kept = stream.properties().history;
            messages.drain(..messages.len().saturating_sub(kept));
        }
        self.version = new.version.or(self.version);
    }

    /// The newest message of a stream.
    pub fn newest(&self, stream: Stream) -> Option<&StreamMessage> {
        self.messages.get(&stream)?.back()
    }

    /// The messages of every stream. The operating state is last: clients wait for it.
    pub fn streams(&self) -> impl Iterator<Item = (Stream, &VecDeque<StreamMessage>)> {
        let (state, others): (Vec<_>, Vec<_>) = { self.messages.iter() }
            .map(|(stream, messages)| (*stream, messages))
            .partition(|(stream, _)| *stream == Stream::State);
        others.into_iter().chain(state)
    }

    /// Takes in what arrived. `false`: there is no such stream, or these are no messages of it.
    pub fn read(&mut self, name: &str, bytes: &[u8]) -> bool {
        if name == VERSION {
            self.version = Version::from_bytes(bytes).or(self.version);
            return size_of::<Version>() == bytes.len();
        }
        let Some(stream) = streams().find(|stream| stream.name() == name) else {
            return false;
        };
        let messages = bytes.chunks(stream.layout().size);
        let messages: Option<Vec<StreamMessage>> =
            messages.map(|bytes| StreamMessage::from_bytes(stream, bytes)).collect();
        let is_valid = messages.is_some();
        messages.unwrap_or_default().into_iter().for_each(|message| self.insert(message));
        is_valid
    }

    /// The same with every time on our clock; `None` while it is not known how the clocks stand.
    pub fn here(&self, offset: &ClockOffset, now: Nanos) -> Option<Self> {
        let mut here = Self { version: self.version, ..Self::default() };
        for message in self.messages.values().flatten() {
            here.insert(shifted(message, |time| offset.here(time, now))?);
        }
        Some(here)
    }
}

/// The message with every time on another clock.
pub(crate) fn shifted(
    message: &StreamMessage,
    shift: impl Fn(u64) -> Option<u64>,
) -> Option<StreamMessage> {
    let (stream, mut bytes) = (message.stream(), message.bytes().to_vec());
    for field in stream.layout().fields.iter().filter(|field| is_time(field.name)) {
        for time in bytes[field.offset..][..8 * field.count].chunks_exact_mut(8) {
            let shifted = shift(u64::from_le_bytes(time.try_into().ok()?))?;
            time.copy_from_slice(&shifted.to_le_bytes());
        }
    }
    StreamMessage::from_bytes(stream, &bytes)
}

/// Whether a field holds a time of the monotonic clock. All others in ns are spans.
fn is_time(field: &str) -> bool {
    field.ends_with("stamp_ns") || field == "since_ns"
}

#[cfg(test)]
mod tests {
    use i2ris::ipc::payload::{FieldType, JointState};
    use proptest::prelude::*;

    use super::*;

    /// A message of every stream, with all times one second.
    fn full() -> State {
        let mut state = State { version: Some(Version::default()), ..State::default() };
        for stream in streams() {
            let zero = StreamMessage::from_bytes(stream, &vec![0; stream.layout().size]).unwrap();
            state.insert(shifted(&zero, |_| Some(1_000_000_000)).unwrap());
        }
        state
    }

    #[test]
    fn every_stream_is_read_again_and_cut_ones_are_none() {
        let (mut read, mut count) = (State { version: full().version, ..State::default() }, 0);
        for (stream, messages) in full().streams() {
            count += 1;
            let bytes = messages[0].bytes();
            assert!(read.read(stream.name(), bytes), "{stream:?}");
            assert!(!State::default().read(stream.name(), &bytes[1..]), "{stream:?}");
        }
        assert_eq!((&read, count), (&full(), 14));
        assert!(read.read(VERSION, Version::default().bytes()));
        assert!(!read.read(VERSION, &[0; 3]));
        assert!(!read.read("servo_jp", &[]));
    }

    #[test]
    fn what_is_not_new_stays_known_and_of_logs_the_last_messages() {
        let mut known = full();
        let mut new = State::default();
        let goal = JointState { stamp_ns: 19, ..JointState::default() };
        new.insert(StreamMessage::Goal(goal));
        for _ in 0..20 {
            new.insert(*full().newest(Stream::Events).unwrap());
        }
        known.update(&new);
        assert_eq!(known.newest(Stream::Goal), Some(&StreamMessage::Goal(goal)));
        assert_eq!(known.newest(Stream::Health), full().newest(Stream::Health));
        assert_eq!(known.messages[&Stream::Events].len(), Stream::Events.properties().history);
    }

    #[test]
    fn every_time_is_put_on_the_other_clock_and_nothing_else() {
        let mut offset = ClockOffset::default();
        assert_eq!(full().here(&offset, Nanos(100)), None, "nothing is known");
        let at = Nanos(5_000_000_000);
        offset.note(at, Nanos(at.0 - 1_000_000), at);
        let here = full().here(&offset, at).unwrap();
        for (stream, messages) in here.streams() {
            for field in stream.layout().fields {
                let bytes = &messages[0].bytes()[field.offset..];
                if field.kind == FieldType::U64 {
                    let value = u64::from_le_bytes(bytes[..8].try_into().unwrap());
                    let expected = if is_time(field.name) { 1_001_000_000 } else { 0 };
                    assert_eq!(value, expected, "{stream:?} {}", field.name);
                }
            }
        }
        assert_eq!(here.version, full().version);
    }

    proptest! {
        #[test]
        fn whatever_arrives_nothing_panics(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
            let _ = State::default().read("measured_js", &bytes);
        }
    }
}
