//! Path from ROS to the controller: one thread waits for messages, one for answers.

mod commands;
mod graph;
mod requests;

use std::io::{self, ErrorKind};
use std::time::Duration;

use i2ris::clock;
use i2ris::ipc::Domain;
use i2ris::model::kinematic::bend_to;
use i2ris::units::Nanos;
use i2ris_report::snake::{Bend, Snake};
use ros2_client::{Context, Gid, Message, MessageInfo, Node, ROSTime, Server, Subscription};
use rustdds::GUID;
use rustdds::mio1::event::Source;
use rustdds::mio1::{Events as Ready, Interest, Poll, Token};
use serde::de::DeserializeOwned;

use crate::RosError;
use crate::admission::{Times, Writer, checked};
use crate::clock::Moment;
use crate::event::{ClientNames, Events};
use crate::message::{
    Inputs, JOINTS, NoRequest, QueryForwardKinematics, QueryForwardKinematicsResponse,
    QueryInverseKinematics, QueryInverseKinematicsResponse, Services,
    TriggerOperatingStateResponse, TriggerResponse,
};
use crate::outbound::{SharedState, lock};
use commands::Commands;
use graph::Graph;

const WAIT: Duration = Duration::from_millis(10);
/// Maximum number of requests of one service answered at once, so that they delay no command.
const ANSWERED_AT_ONCE: usize = 16;
/// The version of CRTK that these messages follow.
const CRTK_VERSION: &str = "1.3.0";

#[derive(Debug, Clone)]
pub(crate) struct Shared {
    pub domain: Domain,
    pub robot: String,
    pub may_home: bool,
    pub events: Events,
    pub names: ClientNames,
    pub state: SharedState,
    pub state_writer: GUID,
}

pub(crate) struct Inbound {
    poll: Poll,
    graph: Graph,
    commands: Option<Commands>,
    services: Services,
    snake: Snake,
    shared: Shared,
}

impl Inbound {
    /// Starts to listen. Without `inputs` nothing moves the robot.
    pub fn new(
        context: &Context,
        node: &mut Node,
        inputs: Option<Inputs>,
        services: Services,
        shared: Shared,
    ) -> Result<Self, RosError> {
        let failed = |source| RosError::System { action: "wait for messages", source };
        let commands = inputs.map(|inputs| Commands::new(inputs, shared.clone()));
        let mut inbound = Self {
            poll: Poll::new().map_err(failed)?,
            graph: Graph::new(context, node, &shared)?,
            commands: commands.transpose()?,
            services,
            snake: Snake::new(&shared.robot),
            shared,
        };
        inbound.register().map_err(failed)?;
        Ok(inbound)
    }

    fn register(&mut self) -> io::Result<()> {
        let services = &mut self.services;
        let Services { operating_state, crtk_version, forward, inverse } = services;
        let mut sources: Vec<&mut dyn Source> =
            vec![operating_state, crtk_version, forward, inverse];
        if let Some(Commands { inputs, .. }) = &mut self.commands {
            let Inputs { stops, state_command, joints, places, twist } = inputs;
            sources.extend(stops.iter_mut().map(|(_, input)| input as &mut dyn Source));
            sources.extend([state_command as &mut dyn Source, twist]);
            sources.extend(joints.iter_mut().map(|(_, input)| input as &mut dyn Source));
            sources.extend(places.iter_mut().map(|(_, input)| input as &mut dyn Source));
        }
        for (place, source) in sources.into_iter().enumerate() {
            source.register(self.poll.registry(), Token(place), Interest::READABLE)?;
        }
        Ok(())
    }

    pub fn run(mut self, stop: impl Fn() -> bool) {
        let mut ready = Ready::with_capacity(16);
        while !stop() {
            if let Err(error) = self.poll.poll(&mut ready, Some(WAIT))
                && error.kind() != ErrorKind::Interrupted
            {
                clock::sleep(Nanos::from_millis(1));
            }
            if let Some(commands) = &mut self.commands {
                commands.take_all(&self.graph);
            }
            // After the commands: nothing may delay them.
            self.graph.update(self.commands.as_mut().map(|commands| &mut commands.admission));
            self.answer();
        }
    }

    fn answer(&self) {
        answer(&self.services.operating_state, |NoRequest { .. }| {
            let operating_state = lock(&self.shared.state).clone();
            TriggerOperatingStateResponse { operating_state }
        });
        answer(&self.services.crtk_version, |NoRequest { .. }| TriggerResponse {
            success: true,
            message: CRTK_VERSION.to_owned(),
        });
        answer(&self.services.forward, |request| forward(&self.snake, &request));
        answer(&self.services.inverse, |request| inverse(&request));
    }
}

/// Answers the requests of a service; the client repeats a request if the answer cannot be sent.
fn answer<Q, R>(server: &Server<Q, R>, respond: impl Fn(Q) -> R)
where
    Q: Message + Clone + 'static,
    R: Message + Clone + 'static,
{
    for _ in 0..ANSWERED_AT_ONCE {
        let Ok(Some((id, request))) = server.receive_request() else { return };
        let _ = server.send_response(id, respond(request));
    }
}

/// Maximum number of messages of one topic read at once: a flood must not delay `hold`.
const AT_ONCE: usize = 256;
/// Maximum time for which a message can have waited here.
const WAITED: Nanos = Nanos::from_millis(10_000);

#[derive(Debug)]
struct Received<M> {
    pub message: M,
    pub writer: Writer,
    pub times: Times,
    /// Messages of its writer, this one and those that it replaces.
    pub count: u32,
}

#[derive(Debug)]
struct Arrivals<M> {
    /// In the order of arrival.
    pub messages: Vec<Received<M>>,
    /// Messages without the type of the topic. Their writers are not known.
    pub undecodable: u64,
}

fn take<M: DeserializeOwned + 'static>(subscription: &Subscription<M>) -> Arrivals<M> {
    let (mut messages, mut undecodable) = (Vec::new(), 0);
    for _ in 0..AT_ONCE {
        match subscription.take() {
            Ok(Some((message, info))) => {
                let (writer, times) = (writer(info.publisher_gid()), times(&info));
                messages.push(Received { message, writer, times, count: 1 });
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
        let mut newest: Vec<Received<M>> = Vec::new();
        for next in self.messages {
            match newest.iter_mut().find(|it| it.writer == next.writer) {
                Some(before) => *before = Received { count: before.count + 1, ..next },
                None => newest.push(next),
            }
        }
        Self { messages: newest, ..self }
    }
}

fn writer(gid: Gid) -> Writer {
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

/// Distance of the tip below which a position counts as reached, m.
const REACHED_M: f64 = 1e-6;

fn bend(jp: &[f64]) -> Result<Bend, String> {
    let given = checked(jp, JOINTS.len()).map_err(|reason| reason.to_string())?;
    Ok(Bend { pitch: given.position[0], yaw: given.position[1] })
}

fn forward(snake: &Snake, request: &QueryForwardKinematics) -> QueryForwardKinematicsResponse {
    match bend(&request.jp) {
        Ok(bend) => {
            let (cp, message) = (snake.tip_pose(bend).into(), String::new());
            QueryForwardKinematicsResponse { cp, result: true, message }
        }
        Err(message) => QueryForwardKinematicsResponse { message, ..Default::default() },
    }
}

/// The orientation in the request is not used: pitch and yaw also determine the orientation.
fn inverse(request: &QueryInverseKinematics) -> QueryInverseKinematicsResponse {
    let failed = |message| QueryInverseKinematicsResponse { message, ..Default::default() };
    let from = if request.jp.is_empty() { Ok(Bend::default()) } else { bend(&request.jp) };
    let from = match from {
        Ok(from) => from,
        Err(message) => return failed(message),
    };
    let place = &request.cp.position;
    let ([pitch, yaw], away_m) = bend_to([place.x, place.y, place.z], [from.pitch, from.yaw]);
    if !away_m.is_finite() {
        return failed("a position is not finite".to_owned());
    }
    let result = away_m <= REACHED_M;
    let far = || format!("out of reach: the nearest pose is {:.3} mm away", away_m * 1e3);
    let message = if result { String::new() } else { far() };
    QueryInverseKinematicsResponse { jp: vec![pitch, yaw], result, message }
}
