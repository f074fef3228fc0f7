//! The order in which servo commands of several clients reach the loop, which takes one per tick.
//!
//! 1. The lease holder's newest valid command.
//! 2. One valid command of the other publishers, in turn, so that a client that sends often cannot
//!    displace one that sends rarely, whatever their stamps are.
//! 3. One invalid command, in turn: its client receives the reason.
//!
//! Turns go by publisher and not by client id, which a faulty client may change with every command.
//! One publisher can send for several clients: `i2ris start ros`.

use std::collections::VecDeque;

use crate::ipc::payload::{ServoActuator, ServoJp};
use crate::ipc::streams::StreamMessage;

/// Clients of one publisher whose commands wait for their turn. The oldest is dropped first.
const CLIENTS_PER_PUBLISHER: usize = 8;

/// A servo command of either stream.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ReceivedCommand {
    /// `servo_jp`.
    Joint(ServoJp),
    /// `actuators/servo_jp`.
    Actuator(ServoActuator),
}

impl From<ReceivedCommand> for StreamMessage {
    fn from(command: ReceivedCommand) -> Self {
        match command {
            ReceivedCommand::Joint(it) => Self::ServoJp(it),
            ReceivedCommand::Actuator(it) => Self::ServoActuators(it),
        }
    }
}

impl ReceivedCommand {
    /// Identity of the client.
    #[must_use]
    pub fn client_id(&self) -> u64 {
        match self {
            Self::Joint(command) => command.client_id,
            Self::Actuator(command) => command.client_id,
        }
    }

    pub(super) fn client_id_mut(&mut self) -> &mut u64 {
        match self {
            Self::Joint(command) => &mut command.client_id,
            Self::Actuator(command) => &mut command.client_id,
        }
    }

    /// Age order of a client's commands, which may use both streams.
    fn age_order(&self) -> (u64, u64) {
        match self {
            Self::Joint(command) => (command.stamp_ns, command.sequence),
            Self::Actuator(command) => (command.stamp_ns, command.sequence),
        }
    }
}

/// A publisher with its commands, at most one per client.
#[derive(Debug)]
struct Sender {
    publisher: u128,
    waiting: VecDeque<ReceivedCommand>,
}

#[derive(Debug, Default)]
pub(super) struct CommandTurns {
    /// In the order of their turns. A sender always has a command.
    senders: VecDeque<Sender>,
}

impl CommandTurns {
    /// Adds a command in place of the waiting one of the same publisher and client.
    pub(super) fn add(&mut self, publisher: u128, command: ReceivedCommand) {
        let mut senders = self.senders.iter_mut();
        let Some(sender) = senders.find(|sender| sender.publisher == publisher) else {
            let waiting = VecDeque::from([command]);
            self.senders.push_back(Sender { publisher, waiting });
            return;
        };
        let same = |waiting: &&mut ReceivedCommand| waiting.client_id() == command.client_id();
        if let Some(waiting) = sender.waiting.iter_mut().find(same) {
            *waiting = command;
            return;
        }
        if sender.waiting.len() == CLIENTS_PER_PUBLISHER {
            sender.waiting.pop_front();
        }
        sender.waiting.push_back(command);
    }

    /// Takes the newest valid command of one client. Its older ones are dropped.
    pub(crate) fn take_of(
        &mut self,
        client_id: u64,
        is_valid: impl Fn(&ReceivedCommand) -> bool,
    ) -> Option<ReceivedCommand> {
        let commands = self.senders.iter().flat_map(|sender| &sender.waiting);
        let own = commands.filter(|command| command.client_id() == client_id && is_valid(command));
        let newest = *own.max_by_key(|command| command.age_order())?;
        for sender in &mut self.senders {
            sender.waiting.retain(|command| {
                command.client_id() != client_id || command.age_order() > newest.age_order()
            });
        }
        self.senders.retain(|sender| !sender.waiting.is_empty());
        Some(newest)
    }

    pub(crate) fn take_next(
        &mut self,
        is_valid: impl Fn(&ReceivedCommand) -> bool,
    ) -> Option<ReceivedCommand> {
        let turn = |(index, sender): (usize, &Sender)| {
            let valid = sender.waiting.iter().find(|command| is_valid(command))?;
            Some((index, valid.client_id()))
        };
        match self.senders.iter().enumerate().find_map(turn) {
            Some((index, client_id)) => {
                self.end_turn(index);
                self.take_of(client_id, is_valid)
            }
            None => {
                let command = self.senders.front_mut()?.waiting.pop_front();
                self.end_turn(0);
                command
            }
        }
    }

    fn end_turn(&mut self, index: usize) {
        if let Some(sender) = self.senders.remove(index)
            && !sender.waiting.is_empty()
        {
            self.senders.push_back(sender);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn joint(client_id: u64, stamp_ns: u64) -> ReceivedCommand {
        let sequence = stamp_ns;
        ReceivedCommand::Joint(ServoJp { client_id, stamp_ns, sequence, ..ServoJp::default() })
    }

    fn actuator(client_id: u64, stamp_ns: u64) -> ReceivedCommand {
        let sequence = stamp_ns;
        let it = ServoActuator { client_id, stamp_ns, sequence, ..ServoActuator::default() };
        ReceivedCommand::Actuator(it)
    }

    /// Client 0 and stamps above 1000 are not valid.
    fn is_valid(command: &ReceivedCommand) -> bool {
        command.client_id() != 0 && command.age_order().0 <= 1000
    }

    #[test]
    fn the_holder_of_the_lease_comes_first_whatever_others_stamp() {
        for other in [joint(8, 900), actuator(8, 900), joint(8, 9000), joint(0, 1)] {
            let mut turns = CommandTurns::default();
            turns.add(2, other);
            turns.add(1, joint(7, 100));
            assert_eq!(turns.take_of(7, is_valid), Some(joint(7, 100)));
            assert_eq!(turns.take_of(7, is_valid), None);
            assert_eq!(turns.take_next(is_valid), Some(other));
        }
    }

    #[test]
    fn newest_valid_command_of_a_client_wins_across_streams() {
        let mut turns = CommandTurns::default();
        turns.add(1, joint(7, 100));
        turns.add(2, actuator(7, 200));
        turns.add(3, actuator(7, 5000));
        assert_eq!(turns.take_of(7, is_valid), Some(actuator(7, 200)));
        assert_eq!(turns.take_next(is_valid), Some(actuator(7, 5000)));
        assert_eq!(turns.take_next(is_valid), None);
    }

    #[test]
    fn without_a_holder_every_publisher_has_its_turn() {
        let mut turns = CommandTurns::default();
        let mut honest = 0;
        for tick in 1..=160 {
            // Fifteen publishers with a new identity in every tick, one that sends rarely.
            for publisher in 2..=16 {
                turns.add(publisher, joint(1000 + tick * 16 + publisher as u64, 1000));
            }
            if tick % 20 == 1 {
                turns.add(1, joint(7, tick));
            }
            honest += u32::from(turns.take_next(is_valid).unwrap().client_id() == 7);
        }
        assert_eq!(honest, 8);
    }

    #[test]
    fn invalid_commands_come_last_and_do_not_accumulate() {
        let mut turns = CommandTurns::default();
        for number in 0..100 {
            turns.add(1, joint(number, 5000));
        }
        turns.add(2, joint(7, 10));
        assert_eq!(turns.take_next(is_valid), Some(joint(7, 10)));
        for number in 92..100 {
            assert_eq!(turns.take_next(is_valid), Some(joint(number, 5000)));
        }
        assert_eq!(turns.take_next(is_valid), None);
    }
}
