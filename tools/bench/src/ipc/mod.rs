//! From one thread to another: publish to receive.
//!
//! One thread sends 64 bytes, the size of a servo command, with the instant of sending every 0.2
//! ms; another one receives them and looks at the clock. Either it *polls*, looking again and again
//! without a pause, or it *waits* in the kernel until it is woken. The two are different worlds, so
//! each has its own floor: a seqlock in shared memory, and a futex on it.
//!
//! | file | holds |
//! |---|---|
//! | `pair` | one thread that sends on a grid, another one that receives |
//! | `memory` | the floors: 64 bytes in shared memory, polled or woken by a futex |
//! | `sample` | iceoryx2 as such: publish-subscribe, polled or woken by its event service |
//! | `streams` | the controller's streams: `servo_jp` in, `measured_js` out |
//! | `socket` | the peers: Unix datagrams, UDP over loopback |

mod memory;
mod pair;
mod sample;
mod socket;
mod streams;

use i2ris::units::Nanos;

use crate::error::BenchError;
use crate::machine::{self, Watch};
use crate::outcome::{Outcome, Role, Way};
use crate::seat::Seats;
use crate::spans::Spans;
use pair::Run;

/// Between two messages: a fifth of a tick of the controller, to be done sooner.
const PERIOD: Nanos = Nanos::from_micros(200);

/// Bytes of a servo command.
const BYTES: usize = 64;

/// Every way gets so many turns: all meet the same weather.
const TURNS: u64 = 4;

/// Messages of each turn that do not count, at most.
const WARM_UP: u64 = 300;

/// Receivers that look again and again.
const POLLED: &str = "polled";
/// Receivers that sleep until they are woken.
const WAITING: &str = "waiting";

type Measure = fn(Run) -> Result<Spans, BenchError>;

const WAYS: [(&str, &str, Role, Measure); 11] = [
    (
        "seqlock in shared memory",
        POLLED,
        Role::Floor,
        memory::polled,
    ),
    (
        "iceoryx2 publish-subscribe",
        POLLED,
        Role::Ours,
        sample::polled,
    ),
    (
        "servo_jp: client to controller",
        POLLED,
        Role::Ours,
        streams::to_controller,
    ),
    (
        "measured_js: controller to client",
        POLLED,
        Role::Ours,
        streams::to_client,
    ),
    (
        "Unix datagram socket",
        POLLED,
        Role::Peer,
        socket::unix_polled,
    ),
    ("UDP over loopback", POLLED, Role::Peer, socket::udp_polled),
    (
        "futex on shared memory",
        WAITING,
        Role::Floor,
        memory::waiting,
    ),
    (
        "iceoryx2 publish-subscribe + event",
        WAITING,
        Role::Ours,
        sample::waiting,
    ),
    (
        "measured_js + event",
        WAITING,
        Role::Ours,
        streams::to_client_woken,
    ),
    (
        "Unix datagram socket",
        WAITING,
        Role::Peer,
        socket::unix_waiting,
    ),
    (
        "UDP over loopback",
        WAITING,
        Role::Peer,
        socket::udp_waiting,
    ),
];

/// Measures every way with about `messages` each. `interrupted` is asked between turns.
///
/// # Errors
///
/// [`BenchError`].
pub fn run(
    messages: u64,
    seats: Seats,
    interrupted: &dyn Fn() -> bool,
) -> Result<Outcome, BenchError> {
    let watch = Watch::start();
    let mut ways = WAYS.map(|(name, group, role, _)| Way {
        name: name.to_owned(),
        group,
        role,
        spans: Spans::new(0),
    });
    for _ in 0..TURNS {
        for (way, (.., measure)) in ways.iter_mut().zip(WAYS) {
            way.spans.add(&measure(Run {
                messages: messages.div_ceil(TURNS),
                seats,
            })?);
            if interrupted() {
                return Err(BenchError::Interrupted);
            }
        }
    }
    let machine = machine::look();
    let notes = [
        "Polling is how the controller takes commands. Waiting is for programs that have something else to do; what it costs \
         is the kernel's way of waking a thread, whoever does it."
            .to_owned(),
        "A stream that keeps the newest message only loses those that a late receiver did not see; a socket delivers them \
         late instead. Counts differ for that reason."
            .to_owned(),
    ];
    Ok(Outcome {
        bench: "ipc",
        about: "From publishing 64 bytes in one thread to having them in another",
        notes: notes.into_iter().chain(machine.notes()).collect(),
        weather: watch.stop(),
        scheduling: pair::seats(seats),
        machine,
        ways: ways.into(),
        quantities: Vec::new(),
    })
}
