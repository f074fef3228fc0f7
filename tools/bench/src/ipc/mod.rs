//! From one thread to another through shared memory: publish to receive.
//!
//! One thread sends 64 bytes, the size of a servo command, with the instant of sending every 0.2
//! ms. Another thread receives them and reads the clock. Either it *polls* without a pause, or it
//! *waits* in the kernel until it is woken. Each has its own floor: a seqlock in shared memory, and
//! a futex on it.
//!
//! | file | contains |
//! |---|---|
//! | `pair` | a sending and a receiving thread |
//! | `seqlock` | the floors: 64 bytes in shared memory, polled or woken by a futex |
//! | `iceoryx` | iceoryx2 alone: publish-subscribe, polled or woken by its event service |
//! | `streams` | the controller's streams: `servo_jp` in, `measured_js` out |
//! | `socket` | the peers: Unix datagrams, UDP over loopback |

mod iceoryx;
mod pair;
mod seqlock;
mod socket;
mod streams;

use crate::durations::Durations;
use crate::error::BenchError;
use crate::machine::{LoadMonitor, Machine};
use crate::outcome::{BenchOutcome, Role, Variant};
use crate::placement::ThreadPlacement;
use Role::{Floor, Ours, Peer};
use pair::Turn;

/// Turns of every variant. All variants have the same load of the machine.
const TURNS: u64 = 4;

/// Groups: receivers that poll, and receivers that wait until they are woken.
const POLLED: &str = "polled";
const WAITING: &str = "waiting";

type Measure = fn(Turn) -> Result<Durations, BenchError>;

const VARIANTS: [(&str, &str, Role, Measure); 12] = [
    ("seqlock in shared memory", POLLED, Floor, seqlock::polled),
    ("iceoryx2 publish-subscribe", POLLED, Ours, iceoryx::polled),
    ("servo_jp: client to controller", POLLED, Ours, streams::to_controller),
    ("measured_js: controller to client", POLLED, Ours, streams::to_client),
    ("Unix datagram socket", POLLED, Peer, socket::unix_polled),
    ("UDP over loopback", POLLED, Peer, socket::udp_polled),
    ("futex on shared memory", WAITING, Floor, seqlock::waiting),
    ("iceoryx2 publish-subscribe + event", WAITING, Ours, iceoryx::waiting),
    ("measured_js + event", WAITING, Ours, streams::to_client_woken),
    ("iceoryx2 publish-subscribe + event, own wait", WAITING, Peer, iceoryx::waiting_as_library),
    ("Unix datagram socket", WAITING, Peer, socket::unix_waiting),
    ("UDP over loopback", WAITING, Peer, socket::udp_waiting),
];

/// Measures every variant with about `messages` each. Calls `is_interrupted` between turns.
///
/// # Errors
///
/// [`BenchError`].
pub fn run(
    messages: u64,
    placement: ThreadPlacement,
    is_interrupted: &dyn Fn() -> bool,
) -> Result<BenchOutcome, BenchError> {
    let monitor = LoadMonitor::start();
    let mut variants =
        VARIANTS.map(|(name, group, role, _)| Variant::new(name, group, role, Durations::new(0)));
    let turn = Turn { messages: messages.div_ceil(TURNS), placement };
    for _ in 0..TURNS {
        for (variant, (.., measure)) in variants.iter_mut().zip(VARIANTS) {
            variant.durations.add(&measure(turn)?);
            if is_interrupted() {
                return Err(BenchError::Interrupted);
            }
        }
    }
    let machine = Machine::detect();
    let notes = [
        "Polling is how the controller receives commands. Waiting is for programs that have other \
         work; its cost is that of waking a thread, whichever library does it.",
        "A stream that keeps only the newest message loses those that a late receiver did not \
         read; a socket delivers them late. The counts differ for that reason.",
    ];
    Ok(BenchOutcome {
        bench: "ipc",
        about: "From publishing 64 bytes in one thread to having them in another",
        notes: notes.map(str::to_owned).into_iter().chain(machine.notes()).collect(),
        load: monitor.stop(),
        scheduling: pair::scheduling(placement),
        machine,
        variants: variants.into(),
        quantities: Vec::new(),
    })
}
