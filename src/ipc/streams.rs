//! The tables of all streams and requests. Server, clients, recorder, monitor, ROS, the headers
//! of other languages and the manual read them: something new is a payload and a row here.

use super::payload::{
    ActuatorState, AdaptationMsg, BlackBoxReply, BlackBoxRequest, EventMsg, ExternalPosition,
    Health, JointState, Message, ModelReply, ModelRequest, MoveRequest, OperatingStateMsg, Payload,
    PayloadLayout, PeriodStatistics, ReachTarget, ReasonMsg, ServoActuator, ServoJp,
    StateCommandReply, StateCommandRequest, TeleopMsg, TrialMsg, Version, VersionRequest,
    VirtualFixtureRequest, VirtualFixturesMsg,
};
use crate::robot::Reason;
use crate::units::Nanos;

/// Clients that command, or try to.
pub(super) const COMMANDERS: usize = 8;
/// Monitors, recorders, user interfaces.
pub(super) const WATCHERS: usize = 32;

/// Calls a macro with all streams: in Rust, as a function, in shared memory; payload; who sends it;
/// most publishers and subscribers; messages that a late subscriber receives at once. The last is 0
/// for commands: an old one must not be executed.
macro_rules! for_each_stream {
    ($call:ident) => {
        $call! {
            controller {
                /// `measured_js`: the model's estimate from the encoders.
                Measured measured_js "measured_js" JointState Out 1 WATCHERS 1;
                /// `setpoint_js`: the model's estimate for the setpoints.
                Setpoint setpoint_js "setpoint_js" JointState Out 1 WATCHERS 1;
                /// `goal_js`: the requested goal, clipped to the calibrated hull.
                Goal goal_js "goal_js" JointState Out 1 WATCHERS 1;
                /// `actuators/measured_js`: state of the motors.
                Actuators actuators "actuators/measured_js" ActuatorState Out 1 WATCHERS 1;
                /// `jaw/measured_js`: the angle of the auxiliary axis, if there is one. Its
                /// velocity and its deviation are not known.
                Jaw jaw_measured_js "jaw/measured_js" JointState Out 1 WATCHERS 1;
                /// `operating_state`: state of the controller and its reason.
                State operating_state "operating_state" OperatingStateMsg Out 1 WATCHERS 1;
                /// `period_statistics`: timing of the control loop.
                Statistics period_statistics "period_statistics" PeriodStatistics Out 1 WATCHERS 1;
                /// `health`: what failed or was lost since the start of the controller.
                Health health "health" Health Out 1 WATCHERS 1;
                /// `adaptation`: the drift from the calibration that the camera shows.
                Adaptation adaptation "adaptation" AdaptationMsg Out 1 WATCHERS 1;
                /// `virtual_fixtures`: regions that the snake may not enter.
                VirtualFixtures virtual_fixtures "virtual_fixtures" VirtualFixturesMsg
                    Out 1 WATCHERS 1;
                /// `events`: the log of the controller, line by line. A client that joins after a
                /// fault sees what led to it.
                Events events "events" EventMsg Out 1 WATCHERS 16;
                /// `error`: faults, with what was measured and what to do.
                Error error "error" ReasonMsg Out 1 WATCHERS 16;
                /// `warning`: refusals, stops and clips, with what was measured and what to do.
                Warning warning "warning" ReasonMsg Out 1 WATCHERS 16;
            }
            clients {
                /// `external/measured_jp`: measurements of a camera or another sensor.
                External external "external/measured_jp" ExternalPosition In 4 WATCHERS 1;
                /// `reach_target`: the target of a reach-and-hold task, from the client that runs
                /// it to those that show and record it.
                ReachTarget reach_target "reach_target" ReachTarget BetweenClients 4 WATCHERS 1;
                /// `teleop`: what a person does with an input device.
                Teleop teleop "teleop" TeleopMsg BetweenClients 4 WATCHERS 1;
                /// `trial`: the recorded trial and its marks. Who joins later sees the last ones.
                Trial trial "trial" TrialMsg BetweenClients 4 WATCHERS 16;
                /// `servo_jp`: commands of clients, accepted or not.
                ServoJp servo_jp "servo_jp" ServoJp In COMMANDERS 4 0;
                /// `actuators/servo_jp`: motor commands of clients, accepted or not.
                ServoActuators servo_actuators "actuators/servo_jp" ServoActuator In COMMANDERS 4 0;
                /// `jaw/servo_jp`: the angle of the auxiliary axis.
                ServoJaw servo_jaw "jaw/servo_jp" ServoJp In COMMANDERS 4 0;
            }
        }
    };
}

/// Calls a macro with all requests: in Rust, as a function, in shared memory; payloads of request
/// and reply; how fast the reply is. The first group is for the user of the server, which answers
/// the second one itself.
macro_rules! for_each_request {
    ($call:ident) => {
        $call! {
            user {
                /// `state_command`.
                StateCommand state_command "state_command"
                    StateCommandRequest StateCommandReply Quick;
                /// `move_jp`.
                Move move_jp "move_jp" MoveRequest StateCommandReply Quick;
                /// `virtual_fixture`.
                Fixture virtual_fixture "virtual_fixture"
                    VirtualFixtureRequest StateCommandReply Quick;
                /// `model`.
                Model model "model" ModelRequest ModelReply Slow;
                /// `black_box`.
                BlackBox black_box "black_box" BlackBoxRequest BlackBoxReply Slow;
            }
            server {
                /// `version`.
                Version version "version" VersionRequest Version Quick;
            }
        }
    };
}

pub(super) use {for_each_request, for_each_stream};

/// Who sends a stream to whom.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Direction {
    /// The controller to its clients.
    Out,
    /// Clients to the controller. Recorders can also subscribe.
    In,
    /// Clients to other clients. The controller does not read it.
    BetweenClients,
}

/// A row of the stream table.
#[derive(Debug, Clone, Copy)]
pub struct StreamProperties {
    /// Name of the service in shared memory.
    pub service: &'static str,
    /// Its messages.
    pub layout: PayloadLayout,
    /// Who sends it.
    pub direction: Direction,
    /// Maximum number of publishers.
    pub publishers: usize,
    /// Maximum number of subscribers.
    pub subscribers: usize,
    /// Number of messages that a late subscriber receives at once.
    pub history: usize,
}

/// How fast a request is answered.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ReplySpeed {
    /// Within a few ticks; the machine may stall for a tenth of a second.
    Quick,
    /// A model is checked, a file is written to the disk: seconds on a busy machine.
    Slow,
}

macro_rules! declare_streams {
    (controller { $($controller:tt)* } clients { $($clients:tt)* }) => {
        declare_streams! { $($controller)* $($clients)* }
    };
    ($($(#[$doc:meta])* $stream:ident $function:ident $name:literal $payload:ident
        $direction:ident $publishers:tt $subscribers:tt $history:tt;)*) => {
        /// A stream.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
        pub enum Stream {
            $($(#[$doc])* $stream,)*
        }

        impl Stream {
            /// All streams.
            pub const ALL: &'static [Self] = &[$(Self::$stream),*];

            /// Its name.
            #[must_use]
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$stream => $name,)*
                }
            }

            /// Its row of the table.
            #[must_use]
            pub const fn properties(self) -> StreamProperties {
                match self {
                    $(Self::$stream => StreamProperties {
                        service: concat!("i2ris/", $name),
                        layout: $payload::LAYOUT,
                        direction: Direction::$direction,
                        publishers: $publishers,
                        subscribers: $subscribers,
                        history: $history,
                    },)*
                }
            }
        }

        /// A message of any stream.
        #[derive(Debug, Clone, Copy, PartialEq)]
        #[expect(clippy::large_enum_variant, reason = "the IPC thread sends it without a heap")]
        pub enum StreamMessage {
            $($(#[$doc])* $stream($payload),)*
        }

        impl StreamMessage {
            /// Its stream.
            #[must_use]
            pub const fn stream(&self) -> Stream {
                match self {
                    $(Self::$stream(_) => Stream::$stream,)*
                }
            }

            /// Counts up by one per message of one sender.
            #[must_use]
            pub fn sequence(&self) -> u64 {
                match self {
                    $(Self::$stream(message) => message.sequence(),)*
                }
            }

            /// Time of the values.
            #[must_use]
            pub fn stamp(&self) -> Nanos {
                match self {
                    $(Self::$stream(message) => message.stamp(),)*
                }
            }

            /// All fields in the order of memory, little endian.
            #[must_use]
            pub fn bytes(&self) -> &[u8] {
                match self {
                    $(Self::$stream(message) => message.bytes(),)*
                }
            }

            /// The message of a stream with these bytes; `None` if it has another size.
            #[must_use]
            pub fn from_bytes(stream: Stream, bytes: &[u8]) -> Option<Self> {
                Some(match stream {
                    $(Stream::$stream => Self::$stream(Payload::from_bytes(bytes)?),)*
                })
            }
        }
    };
}

for_each_stream!(declare_streams);

impl Stream {
    /// The stream of this name.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.iter().copied().find(|stream| stream.name() == name)
    }

    /// The fields of its messages.
    #[must_use]
    pub const fn layout(self) -> PayloadLayout {
        self.properties().layout
    }

    /// Whether only the controller sends. Commands and camera angles can have several senders, so
    /// their sequence numbers do not show missing messages.
    #[must_use]
    pub const fn has_one_sender(self) -> bool {
        self.properties().publishers == 1
    }
}

impl StreamMessage {
    /// The message of a reason: a fault is an error, all others are warnings.
    #[must_use]
    pub fn of_reason(reason: &Reason, client_id: u64, stamp: Nanos) -> Self {
        let message = ReasonMsg::new(reason, client_id, stamp);
        if reason.cause.is_error() { Self::Error(message) } else { Self::Warning(message) }
    }
}

macro_rules! declare_requests {
    (user { $($user:tt)* } server { $($server:tt)* }) => {
        declare_requests! { $($user)* $($server)* }
    };
    ($($(#[$doc:meta])* $service:ident $function:ident $name:literal
        $request:ident $reply:ident $speed:ident;)*) => {
        /// Available requests.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
        pub enum RequestService {
            $($(#[$doc])* $service,)*
        }

        impl RequestService {
            /// All services.
            pub const ALL: &'static [Self] = &[$(Self::$service),*];

            /// Its name.
            #[must_use]
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$service => $name,)*
                }
            }

            /// Its name in shared memory.
            #[must_use]
            pub const fn service(self) -> &'static str {
                match self {
                    $(Self::$service => concat!("i2ris/", $name),)*
                }
            }

            /// How fast it is answered.
            #[must_use]
            pub const fn speed(self) -> ReplySpeed {
                match self {
                    $(Self::$service => ReplySpeed::$speed,)*
                }
            }

            /// Layouts of request and reply.
            #[must_use]
            pub const fn layouts(self) -> [PayloadLayout; 2] {
                match self {
                    $(Self::$service => [$request::LAYOUT, $reply::LAYOUT],)*
                }
            }
        }

        /// A request to any service.
        #[derive(Debug, Clone, Copy, PartialEq)]
        #[expect(clippy::large_enum_variant, reason = "requests are rare")]
        pub enum Request {
            $($(#[$doc])* $service($request),)*
        }
    };
}

for_each_request!(declare_requests);

impl Request {
    /// The client that asks, where a request says it.
    pub(crate) fn client_id_mut(&mut self) -> Option<&mut u64> {
        match self {
            Self::StateCommand(request) => Some(&mut request.client_id),
            Self::Move(request) => Some(&mut request.client_id),
            Self::Fixture(request) => Some(&mut request.client_id),
            Self::Model(request) => Some(&mut request.client_id),
            Self::BlackBox(request) => Some(&mut request.client_id),
            Self::Version(_) => None,
        }
    }
}
