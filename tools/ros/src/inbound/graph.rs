//! Participants: their names, those that left, and those with incompatible topics.

use std::collections::BTreeMap;

use ros2_client::entities_info::ParticipantEntitiesInfo;
use ros2_client::{Context, MessageTypeName, Node, QosProfile, Subscription};
use rustdds::qos::policy;
use rustdds::{
    DomainParticipantStatusEvent as Status, DomainParticipantStatusListener, GUID, QosPolicies,
    StatusEvented,
};

use super::{Shared, writer};
use crate::RosError;
use crate::admission::{Admission, Participant, Writer};
use crate::event::Event;
use crate::message::Inputs;
use crate::participant::NODE;

const NAMES: usize = 256;
/// Topic on which rmw announces the nodes of a participant.
const DISCOVERY: &str = "ros_discovery_info";

pub(super) struct Graph {
    status: DomainParticipantStatusListener,
    nodes: Subscription<ParticipantEntitiesInfo>,
    names: BTreeMap<Participant, String>,
    closed: Vec<Writer>,
    shared: Shared,
}

impl Graph {
    pub fn new(context: &Context, node: &mut Node, shared: &Shared) -> Result<Self, RosError> {
        let failed = |error: ros2_client::CreateError| {
            let (name, reason) = (DISCOVERY.to_owned(), error.to_string());
            RosError::Topic { name, reason }
        };
        let kind = MessageTypeName::new("rmw_dds_common", "ParticipantEntitiesInfo");
        let qos = QosProfile::publisher_default()
            .durability(ros2_client::qos::Durability::TransientLocal)
            .history(ros2_client::qos::History::KeepLast { depth: 1 });
        let topic = context.create_topic(DISCOVERY.to_owned(), kind, &qos).map_err(failed)?;
        let nodes = node.create_subscription(&topic, Some(qos)).map_err(failed)?;
        Ok(Self {
            status: context.domain_participant().status_listener(),
            nodes,
            names: BTreeMap::new(),
            closed: Vec::new(),
            shared: shared.clone(),
        })
    }

    /// The name of a writer's participant: those of its nodes, or else its number.
    pub fn name(&self, writer: Writer) -> String {
        let participant = writer.participant();
        let known = self.names.get(&participant).cloned();
        known.unwrap_or_else(|| format!("participant {participant}"))
    }

    /// Processes new events; `admission` forgets who left.
    pub fn update(&mut self, mut admission: Option<&mut Admission>) {
        // Only now: the last messages of a publisher may come after the news of its end.
        for writer in std::mem::take(&mut self.closed) {
            admission.iter_mut().for_each(|admission| admission.closed(writer));
        }
        // Undecodable announcements are not ours.
        while let Ok(Some((info, _))) = self.nodes.take() {
            let names: Vec<String> =
                { info.nodes().iter() }.map(|node| node.fully_qualified_name()).collect();
            if !names.is_empty() {
                self.note(writer(info.gid()).participant(), names.join(", "));
            }
        }
        while let Some(event) = self.status.try_recv_status() {
            self.take(event, admission.as_deref_mut());
        }
    }

    fn take(&mut self, event: Status, admission: Option<&mut Admission>) {
        let Shared { events, robot, state_writer, .. } = &self.shared;
        match event {
            Status::ParticipantDiscovered { dpd } => {
                let participant = Writer(dpd.guid.to_bytes()).participant();
                if let Some(name) = dpd.entity_name
                    && !self.names.contains_key(&participant)
                {
                    self.note(participant, name);
                }
            }
            Status::ParticipantLost { id, .. } => {
                let any = GUID { prefix: id, ..GUID::from_bytes([0; 16]) };
                let participant = Writer(any.to_bytes()).participant();
                if let Some(admission) = admission {
                    admission.lost(participant);
                }
                if let Some(name) = self.names.remove(&participant) {
                    events.report(Event::Status(format!("{name} is gone")));
                }
            }
            Status::WriterLost { guid, .. } => self.closed.push(Writer(guid.to_bytes())),
            Status::RemoteReaderMatched { local_writer, .. } if local_writer == *state_writer => {
                events.report(Event::ReaderFound);
            }
            Status::RemoteWriterQosIncompatible {
                remote_writer,
                requested_qos,
                offered_qos,
                ..
            } => self.say_mismatch(remote_writer, "publishes", &offered_qos, &requested_qos),
            Status::RemoteReaderQosIncompatible {
                remote_reader,
                requested_qos,
                offered_qos,
                ..
            } => self.say_mismatch(remote_reader, "wants", &requested_qos, &offered_qos),
            Status::WriterDetected { writer }
                if !Inputs::is_own_type(robot, &writer.topic_name, &writer.type_name) =>
            {
                let name = self.name(Writer(writer.guid.to_bytes()));
                events.report(Event::Warning(format!(
                    "{name} publishes {} as {}: that type is not read",
                    writer.topic_name.strip_prefix("rt").unwrap_or(&writer.topic_name),
                    writer.type_name
                )));
            }
            _ => {}
        }
    }

    fn note(&mut self, participant: Participant, name: String) {
        if self.names.len() >= NAMES {
            self.names.clear();
        }
        self.names.insert(participant, name);
    }

    fn say_mismatch(&self, other: GUID, verb: &str, theirs: &QosPolicies, ours: &QosPolicies) {
        let name = self.name(Writer(other.to_bytes()));
        if name.contains(NODE) {
            return;
        }
        self.shared.events.report(Event::Warning(format!(
            "{name} {verb} {}, but this side has {}: nothing is exchanged",
            words(theirs),
            words(ours)
        )));
    }
}

fn words(qos: &QosPolicies) -> String {
    let reliability = match qos.reliability() {
        Some(policy::Reliability::Reliable { .. }) => "RELIABLE",
        Some(policy::Reliability::BestEffort) | None => "BEST_EFFORT",
    };
    let durability = match qos.durability() {
        Some(policy::Durability::Volatile) | None => "VOLATILE",
        Some(_) => "TRANSIENT_LOCAL",
    };
    format!("{reliability} {durability}")
}
