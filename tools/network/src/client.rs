//! The end on the other computer: serves a domain there as the controller would.

mod joined;
mod network;
mod pending_requests;
mod service;

use std::sync::mpsc::{Receiver, TryRecvError};
use std::time::Duration;

use i2ris::clock;
use i2ris::ipc::Domain;
use i2ris::units::Nanos;
use i2ris_gateway::Reason;

use crate::keys::PersonalKey;
use crate::{BridgeEvent, NetworkError};
use joined::{Course, Joined};
use network::Network;

/// Pause after a call that failed.
const CALL_PERIOD: Nanos = Nanos::from_millis(250);
/// Pause after a refusal that a person has to end.
const REFUSED_PERIOD: Nanos = Nanos::from_millis(2000);
/// Time that the server has to admit a session.
const ADMISSION_TIMEOUT: Nanos = Nanos::from_millis(3000);
/// Arrivals that are looked at before anything else is done again.
const AT_ONCE: usize = 64;
/// What clients ask is looked for so often.
const WAIT: Duration = Duration::from_millis(1);
/// The same while somebody streams commands: they wait for half of this on average.
const STREAMING_WAIT: Duration = Duration::from_micros(200);

#[derive(Debug, Clone)]
pub struct BridgeClient {
    /// The domain to serve, on this computer.
    pub domain: Domain,
    /// Where the server listens: address and UDP port.
    pub server: String,
    pub key: PersonalKey,
    /// Silence after which the server counts as lost.
    pub lost_after: Nanos,
}

impl BridgeClient {
    /// Serves until `stop`. A server that is not there, or no longer, is waited for.
    ///
    /// # Errors
    ///
    /// When the server is of another version, or when the domain cannot be served because a
    /// controller runs in it.
    pub fn run(
        self,
        stop: impl Fn() -> bool,
        mut report: impl FnMut(BridgeEvent),
    ) -> Result<(), NetworkError> {
        let mut end = End {
            options: self,
            stage: Stage::Pausing { until: Nanos::ZERO },
            last_reason: String::new(),
        };
        while !stop() {
            end.step(&mut report)?;
        }
        if let Stage::Joined(joined) = end.stage {
            joined.leave();
        }
        Ok(())
    }
}

#[derive(Debug)]
struct End {
    options: BridgeClient,
    stage: Stage,
    /// The reason that was reported last: the same one is not said again.
    last_reason: String,
}

#[derive(Debug)]
enum Stage {
    /// The next call comes later.
    Pausing { until: Nanos },
    /// A thread calls the server.
    Calling(Receiver<Result<Network, NetworkError>>),
    /// Connected, and mostly in a session.
    Joined(Box<Joined>),
}

impl End {
    fn step(&mut self, report: &mut impl FnMut(BridgeEvent)) -> Result<(), NetworkError> {
        let now = clock::now();
        match &mut self.stage {
            Stage::Pausing { until } => {
                if now >= *until {
                    let call = Network::call(&self.options.server, &self.options.key)?;
                    self.stage = Stage::Calling(call);
                } else {
                    clock::sleep(Nanos::from_millis(5));
                }
            }
            Stage::Calling(call) => match call.try_recv() {
                Ok(Ok(network)) => {
                    let joined = Joined::new(network, &self.options.server, now);
                    self.stage = Stage::Joined(Box::new(joined));
                }
                Ok(Err(error)) => {
                    let reason = error.to_string();
                    self.pause(now + CALL_PERIOD, &reason, report);
                }
                Err(TryRecvError::Empty) => clock::sleep(Nanos::from_millis(1)),
                Err(TryRecvError::Disconnected) => {
                    self.pause(now + CALL_PERIOD, "the call ended", report);
                }
            },
            Stage::Joined(joined) => {
                let course = serve(joined, &self.options.domain, report)?;
                self.follow(course, report);
            }
        }
        Ok(())
    }

    /// Ends a session that was refused, or in which the server is silent.
    fn follow(&mut self, course: Course, report: &mut impl FnMut(BridgeEvent)) {
        let Stage::Joined(joined) = &self.stage else {
            return;
        };
        let (now, address) = (clock::now(), self.options.server.clone());
        let (silence, is_admitted) = (joined.silence(now), joined.is_admitted());
        let limit = if is_admitted { self.options.lost_after } else { ADMISSION_TIMEOUT };
        match course {
            Course::Lives if silence <= limit => {
                if is_admitted {
                    self.last_reason.clear();
                }
            }
            Course::Lives if is_admitted => {
                // With the domain goes whatever was in motion: clients see a controller that is
                // gone.
                self.leave(now + CALL_PERIOD);
                report(BridgeEvent::Lost(address));
            }
            Course::Lives => {
                let reason = "connected, and no answer: the key may not be in the list there";
                self.pause(now + REFUSED_PERIOD, reason, report);
            }
            Course::Refused(Reason::Ended) => {
                self.leave(now + CALL_PERIOD);
                report(BridgeEvent::Left(address));
            }
            Course::Refused(reason @ Reason::Full) => {
                self.leave(now + REFUSED_PERIOD);
                report(BridgeEvent::Refused(format!("{address}: {reason}")));
            }
            Course::Refused(reason @ Reason::KeyInUse) => {
                // By a session of this program that was cut off, as a rule: it ends soon.
                self.pause(now + CALL_PERIOD, &reason.to_string(), report);
            }
            Course::Refused(reason) => {
                self.pause(now + REFUSED_PERIOD, &reason.to_string(), report);
            }
        }
    }

    fn pause(&mut self, until: Nanos, reason: &str, report: &mut impl FnMut(BridgeEvent)) {
        self.leave(until);
        if self.last_reason != reason {
            reason.clone_into(&mut self.last_reason);
            report(BridgeEvent::Refused(format!("{}: {reason}", self.options.server)));
        }
    }

    fn leave(&mut self, until: Nanos) {
        let pausing = Stage::Pausing { until };
        if let Stage::Joined(joined) = std::mem::replace(&mut self.stage, pausing) {
            joined.leave();
        }
    }
}

fn serve(
    joined: &mut Joined,
    domain: &Domain,
    report: &mut impl FnMut(BridgeEvent),
) -> Result<Course, NetworkError> {
    let mut wait = match joined.is_streaming(clock::now()) {
        true => STREAMING_WAIT,
        false => WAIT,
    };
    for _ in 0..AT_ONCE {
        let Some(arrival) = joined.next(wait) else {
            break;
        };
        let course = joined.receive(arrival, domain, clock::now(), report)?;
        if course != Course::Lives {
            return Ok(course);
        }
        wait = Duration::ZERO;
    }
    joined.pass_on(clock::now(), report);
    Ok(Course::Lives)
}
