//! Messages that arrived together.
//!
//! A reliable writer delivers its stored messages at once, after a stall or at a match. Of a stream
//! only the newest counts then.

use i2ris::units::Nanos;
use ros2_client::{Gid, MessageInfo, ROSTime, Subscription};
use serde::de::DeserializeOwned;

use crate::admission::{Times, Writer};
use crate::clock::Moment;

/// Maximum number of messages of one topic read at once: a flood on one topic must not delay
/// `hold`.
const AT_ONCE: usize = 256;

/// Maximum time for which a message can have waited here.
const WAITED: Nanos = Nanos::from_millis(10_000);

#[derive(Debug)]
pub(super) struct Received<M> {
    pub message: M,
    pub writer: Writer,
    pub times: Times,
}

#[derive(Debug)]
pub(super) struct Arrivals<M> {
    /// Messages in the order of arrival, each with the number of messages it replaces.
    pub messages: Vec<(Received<M>, u32)>,
    /// Messages without the type of the topic. Their writers are not known.
    pub undecodable: u64,
}

pub(super) fn take<M: DeserializeOwned + 'static>(subscription: &Subscription<M>) -> Arrivals<M> {
    let (mut messages, mut undecodable) = (Vec::new(), 0);
    for _ in 0..AT_ONCE {
        match subscription.take() {
            Ok(Some((message, info))) => {
                let (writer, times) = (writer(info.publisher_gid()), times(&info));
                messages.push((Received { message, writer, times }, 1));
            }
            Ok(None) => break,
            Err(_) => undecodable += 1,
        }
    }
    Arrivals { messages, undecodable }
}

impl<M> Arrivals<M> {
    /// Only the newest message of every writer.
    pub fn newest(self) -> Self {
        let mut newest: Vec<(Received<M>, u32)> = Vec::new();
        for (next, _) in self.messages {
            match newest.iter_mut().find(|(it, _)| it.writer == next.writer) {
                Some((before, count)) => (*before, *count) = (next, *count + 1),
                None => newest.push((next, 1)),
            }
        }
        Self { messages: newest, ..self }
    }
}

pub(super) fn writer(gid: Gid) -> Writer {
    Writer(gid.to_bytes16())
}

fn times(info: &MessageInfo) -> Times {
    let unix_ns = |time: ROSTime| u64::try_from(time.to_nanos()).ok().filter(|ns| *ns > 0);
    let now = Moment::now();
    let arrived_unix_ns = info.received_timestamp().and_then(unix_ns);
    let arrived_unix_ns = arrived_unix_ns.unwrap_or(now.unix_ns);
    Times {
        arrived: now.monotonic_at(arrived_unix_ns, WAITED),
        arrived_unix_ns,
        sent_unix_ns: info.source_timestamp().and_then(unix_ns),
    }
}
