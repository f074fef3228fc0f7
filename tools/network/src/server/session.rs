//! One client that has joined, or is about to.

use std::collections::BTreeMap;
use std::net::SocketAddr;

use i2ris::ipc::payload::{ServoActuator, ServoJp};
use i2ris::units::Nanos;

use super::controller::Controller;
use crate::key::Key;
use crate::packet::{Kind, Packet, Shift};
use crate::peer::{self, Peer};
use crate::request::{Answer, Outcome, Question};
use zerocopy::FromBytes;

/// Requests that are remembered, so that one that was repeated is not carried out twice. More than
/// can be under way.
const REMEMBERED: usize = 128;

/// One client.
#[derive(Debug)]
pub(super) struct Session {
    pub peer: Peer,
    pub address: SocketAddr,
    /// The number of the hello that it began with.
    pub call: u64,
    /// It has answered to its welcome, so it is there and not a recording.
    pub confirmed: bool,
    /// It has received everything that is known.
    pub synchronized: bool,
    /// Requests by their number; `None`: under way.
    requests: BTreeMap<u64, Option<Answer>>,
}

impl Session {
    pub fn new(key: &Key, session: u64, address: SocketAddr, call: u64, now: Nanos) -> Self {
        let peer = Peer::new(key, session, now);
        Self {
            peer,
            address,
            call,
            confirmed: false,
            synchronized: false,
            requests: BTreeMap::new(),
        }
    }

    /// Does what a packet asks for. The answer is one that is known already.
    pub fn receive(
        &mut self,
        packet: &Packet<'_>,
        controller: &mut Controller,
        commands: bool,
        now: Nanos,
    ) -> Option<Answer> {
        // Without a moment of our clock nothing has an age.
        let shift = peer::shift(packet, now)?;
        match packet.header.kind {
            Kind::ServoJp if commands => servo_jp(packet.body, &shift, controller),
            Kind::ServoActuator if commands => servo_actuators(packet.body, &shift, controller),
            Kind::Request => return self.request(packet.body, &shift, controller, commands, now),
            _ => {}
        }
        None
    }

    /// Takes note of an answer, for the case that it is asked for again.
    pub fn answered(&mut self, answer: Answer) {
        self.requests.insert(answer.number, Some(answer));
        while self.requests.len() > REMEMBERED {
            self.requests.pop_first();
        }
    }

    fn request(
        &mut self,
        body: &[u8],
        shift: &Shift,
        controller: &mut Controller,
        commands: bool,
        now: Nanos,
    ) -> Option<Answer> {
        let question = Question::read(body)?;
        let question = Question {
            asked: shift.here(question.asked),
            ..question
        };
        let number = question.number;
        if let Some(known) = self.requests.get(&number) {
            return known.clone();
        }
        if self
            .requests
            .first_key_value()
            .is_some_and(|(oldest, _)| number < *oldest)
        {
            // Answered and forgotten long ago.
            return None;
        }
        let refusal = if !commands && !question.only_looks() {
            Some(Outcome::Watching)
        } else if question.is_late(now) {
            Some(Outcome::Late)
        } else {
            None
        };
        if let Some(outcome) = refusal {
            let answer = Answer::empty(number, outcome);
            self.answered(answer.clone());
            return Some(answer);
        }
        // Where too many wait already it is dropped; the client will ask again.
        if controller.ask(self.peer.session(), question) {
            self.requests.insert(number, None);
        }
        None
    }
}

fn servo_jp(body: &[u8], shift: &Shift, controller: &mut Controller) {
    if let Ok(command) = ServoJp::read_from_bytes(body) {
        controller.servo_jp(ServoJp {
            stamp_ns: shift.here(command.stamp_ns),
            ..command
        });
    }
}

fn servo_actuators(body: &[u8], shift: &Shift, controller: &mut Controller) {
    if let Ok(command) = ServoActuator::read_from_bytes(body) {
        controller.servo_actuators(ServoActuator {
            stamp_ns: shift.here(command.stamp_ns),
            ..command
        });
    }
}
