//! Path from ROS to the controller: one thread waits for messages, one for answers.
//!
//! | file | contains |
//! |---|---|
//! | `arrivals` | messages that arrived together |
//! | `commands` | all commands that can move the robot |
//! | `requests` | the thread that sends requests to the controller |
//! | `kinematics` | forward and inverse kinematics as services |
//! | `graph` | participants in ROS |

mod arrivals;
mod commands;
mod graph;
mod kinematics;
mod requests;

use std::io::{self, ErrorKind};
use std::time::Duration;

use i2ris::clock;
use i2ris::ipc::Domain;
use i2ris::units::Nanos;
use i2ris_report::snake::Snake;
use ros2_client::{Context, Message, Node, Server};
use rustdds::GUID;
use rustdds::mio1::event::Source;
use rustdds::mio1::{Events as Ready, Interest, Poll, Token};

use crate::RosError;
use crate::event::{ClientNames, Events};
use crate::message::{NoRequest, TriggerOperatingStateResponse, TriggerResponse};
use crate::outbound::{SharedState, lock};
use crate::topics::{Inputs, Services};
use commands::Commands;
use graph::Graph;

/// Time to wait for messages before other work.
const WAIT: Duration = Duration::from_millis(10);

/// Maximum number of requests of one service answered at once, so that they delay no command.
const AT_ONCE: usize = 16;

/// The version of CRTK that these messages follow.
const CRTK_VERSION: &str = "1.3.0";

/// State shared by the threads.
#[derive(Debug, Clone)]
pub(crate) struct Shared {
    pub domain: Domain,
    pub robot: String,
    /// Whether `home` is passed on.
    pub may_home: bool,
    pub events: Events,
    pub names: ClientNames,
    pub state: SharedState,
    /// Writer of the operating state.
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
            let commands = &mut self.commands;
            self.graph.update(&self.shared.events, |participant| {
                if let Some(commands) = commands {
                    commands.lost(participant);
                }
            });
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
        answer(&self.services.forward, |request| kinematics::forward(&self.snake, &request));
        answer(&self.services.inverse, |request| kinematics::inverse(&request));
    }
}

/// Answers the requests of a service; the client repeats a request if the answer cannot be sent.
fn answer<Q, R>(server: &Server<Q, R>, respond: impl Fn(Q) -> R)
where
    Q: Message + Clone + 'static,
    R: Message + Clone + 'static,
{
    for _ in 0..AT_ONCE {
        let Ok(Some((id, request))) = server.receive_request() else {
            return;
        };
        let _ = server.send_response(id, respond(request));
    }
}
