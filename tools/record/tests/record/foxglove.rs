//! Independent clients of the protocol: WebSocket, JSON and bytes in Rust and in Python, nothing of
//! Foxglove's library.

use std::collections::BTreeMap;
use std::io::{BufRead, BufReader};
use std::net::TcpStream;
use std::time::Duration;

use i2ris::clock;
use i2ris::ipc::{Domain, OperatingState, random_id};
use i2ris::units::Nanos;
use i2ris_testing::{Controller, Program, run_python};
use serde_json::{Value, json};
use tungstenite::client::IntoClientRequest;
use tungstenite::http::HeaderValue;
use tungstenite::stream::MaybeTlsStream;
use tungstenite::{Message, WebSocket};

/// Long compared with anything that takes place here.
const PATIENCE: Nanos = Nanos::from_millis(20_000);

/// What viewers offer: the protocol, and in Lichtblick its former name, too.
const FOXGLOVE: &str = "foxglove.sdk.v1";
const LICHTBLICK: &str = "foxglove.websocket.v1, foxglove.sdk.v1";

struct Viewer {
    socket: WebSocket<MaybeTlsStream<TcpStream>>,
    /// What the server has advertised, by topic.
    channels: BTreeMap<String, Value>,
    subscribed: BTreeMap<u32, String>,
}

impl Viewer {
    fn open(address: &str, protocol: &'static str) -> Self {
        let mut request = address.into_client_request().unwrap();
        let protocol = HeaderValue::from_static(protocol);
        request.headers_mut().insert("Sec-WebSocket-Protocol", protocol);
        let (socket, _) = tungstenite::connect(request).unwrap();
        let MaybeTlsStream::Plain(stream) = socket.get_ref() else {
            panic!("not encrypted");
        };
        stream.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
        let mut viewer = Self { socket, channels: BTreeMap::new(), subscribed: BTreeMap::new() };
        while !viewer.channels.contains_key("/robot_description") {
            viewer.read();
        }
        viewer
    }

    fn subscribe(&mut self, topic: &str) {
        let id = self.subscribed.len() as u32 + 1;
        let channel = &self.channels[topic]["id"];
        let subscriptions = [json!({ "id": id, "channelId": channel })];
        let text = json!({ "op": "subscribe", "subscriptions": subscriptions }).to_string();
        self.socket.send(Message::text(text)).unwrap();
        self.subscribed.insert(id, topic.to_owned());
    }

    /// The next message, if it is data: topic and CDR.
    fn read(&mut self) -> Option<(String, Vec<u8>)> {
        match self.socket.read().unwrap() {
            Message::Text(text) => {
                let message: Value = serde_json::from_str(&text).unwrap();
                for channel in message["channels"].as_array().into_iter().flatten() {
                    let topic = channel["topic"].as_str().unwrap().to_owned();
                    self.channels.insert(topic, channel.clone());
                }
                None
            }
            // Operation, subscription, time of the log, message.
            Message::Binary(bytes) if bytes[0] == 1 => {
                let id = u32::from_le_bytes(bytes[1..5].try_into().unwrap());
                Some((self.subscribed[&id].clone(), bytes[13..].to_vec()))
            }
            _ => None,
        }
    }

    /// Reads until a message of this topic is as wanted.
    fn wait_for(&mut self, topic: &str, is_wanted: impl Fn(&[u8]) -> bool) -> Vec<u8> {
        let end = clock::now() + PATIENCE;
        loop {
            assert!(clock::now() < end, "no message of {topic} is as wanted");
            if let Some((of, bytes)) = self.read()
                && of == topic
                && is_wanted(&bytes)
            {
                return bytes;
            }
        }
    }
}

/// Position of the joints in a `sensor_msgs/JointState` with frame `i2ris_base` and joints `pitch`
/// and `yaw`: header 4 + 8 + 4 + 11, one byte of padding, then names and values.
fn positions(cdr: &[u8]) -> [f64; 2] {
    let count = 2_u32.to_le_bytes();
    let body = &cdr[4..];
    let names = body.windows(4).position(|bytes| bytes == b"yaw\0").unwrap();
    let at = names + 4;
    assert_eq!(body[at..at + 4], count);
    let values = (at + 4).next_multiple_of(8);
    let value = |index: usize| {
        let at = values + 8 * index;
        f64::from_le_bytes(body[at..at + 8].try_into().unwrap())
    };
    [value(0), value(1)]
}

fn has(bytes: &[u8], text: &str) -> bool {
    bytes.windows(text.len()).any(|part| part == text.as_bytes())
}

/// The program, and the address that it prints.
fn start(domain: &Domain) -> (Program, String) {
    let mut program = Program::start(domain, &["foxglove", "--listen", "127.0.0.1:0"]);
    let mut line = String::new();
    let stdout = program.child().stdout.take().unwrap();
    BufReader::new(stdout).read_line(&mut line).unwrap();
    let address = line.split_whitespace().find(|word| word.starts_with("ws://"));
    let address = address.unwrap_or_else(|| panic!("{line}")).to_owned();
    (program, address)
}

#[test]
fn a_viewer_sees_angles_state_and_the_robot() {
    let controller = Controller::enabled();
    let (mut program, address) = start(&controller.domain);
    let mut viewer = Viewer::open(&address, FOXGLOVE);
    for (topic, schema) in [
        ("/measured_js", "sensor_msgs/msg/JointState"),
        ("/tracking_error", "sensor_msgs/msg/JointState"),
        ("/operating_state", "crtk_msgs/msg/OperatingState"),
        ("/i2ris/period_statistics", "i2ris_msgs/msg/PeriodStatistics"),
        ("/robot_description", "std_msgs/msg/String"),
        ("/measured_cp", "geometry_msgs/msg/PoseStamped"),
        ("/tf", "tf2_msgs/msg/TFMessage"),
    ] {
        let channel = &viewer.channels[topic];
        assert_eq!(channel["schemaName"], schema);
        assert_eq!(
            (&channel["encoding"], &channel["schemaEncoding"]),
            (&json!("cdr"), &json!("ros2msg"))
        );
        viewer.subscribe(topic);
    }
    viewer.wait_for("/robot_description", |bytes| has(bytes, "<robot name=\"i2ris\">"));
    let wanted = controller.robot().pose.map(f64::to_radians);
    let is_there = |wanted: [f64; 2]| {
        move |bytes: &[u8]| {
            let found = positions(bytes);
            (0..2).all(|joint| (found[joint] - wanted[joint]).abs() < 1e-12)
        }
    };
    viewer.wait_for("/measured_js", is_there(wanted));
    viewer.wait_for("/tracking_error", is_there([0.0; 2]));
    viewer.wait_for("/i2ris/period_statistics", |_| true);
    viewer.wait_for("/measured_cp", |bytes| has(bytes, "i2ris_base"));
    viewer.wait_for("/tf", |bytes| has(bytes, "i2ris_yaw") && has(bytes, "i2ris_tip"));
    controller.robot().pose = [7.0, 3.0];
    viewer.wait_for("/measured_js", is_there([7.0, 3.0].map(f64::to_radians)));
    controller.robot().state = OperatingState::Paused;
    viewer.wait_for("/operating_state", |bytes| has(bytes, "PAUSED"));
    // Who comes later sees the state without a change of it.
    let mut second = Viewer::open(&address, LICHTBLICK);
    second.subscribe("/operating_state");
    second.wait_for("/operating_state", |bytes| has(bytes, "PAUSED"));
    program.interrupt();
    let (success, _, error) = program.end();
    assert!(success, "{error}");
}

#[test]
fn pages_of_others_and_other_names_of_this_computer_are_kept_out() {
    let nobody = Domain::new(&format!("t{:016x}", random_id())).unwrap();
    let mut program = Program::start(
        &nobody,
        &["foxglove", "--listen", "127.0.0.1:0", "--origin", "https://viewer.example"],
    );
    let mut line = String::new();
    BufReader::new(program.child().stdout.take().unwrap()).read_line(&mut line).unwrap();
    let address = line.split_whitespace().find(|word| word.starts_with("ws://")).unwrap();
    let answer = |header: &'static str, value: &'static str| {
        let mut request = address.into_client_request().unwrap();
        let headers = request.headers_mut();
        headers.insert("Sec-WebSocket-Protocol", HeaderValue::from_static(FOXGLOVE));
        headers.insert(header, HeaderValue::from_static(value));
        match tungstenite::connect(request) {
            Ok(_) => 101,
            Err(tungstenite::Error::Http(response)) => response.status().as_u16(),
            Err(error) => panic!("{error}"),
        }
    };
    for origin in [
        "https://app.foxglove.dev",
        "https://viewer.example",
        "http://localhost:8080",
        "http://127.0.0.1:3000",
        "file://",
    ] {
        assert_eq!(answer("Origin", origin), 101, "{origin}");
    }
    for origin in [
        "https://evil.example",
        "null",
        "https://evilfoxglove.dev",
        "https://localhost.evil.example",
    ] {
        assert_eq!(answer("Origin", origin), 403, "{origin}");
    }
    assert_eq!(answer("Host", "localhost:8765"), 101);
    assert_eq!(answer("Host", "rebound.example:8765"), 403);
}

/// Decodes by the definitions that the server advertises.
const VIEWER: &str = "
import asyncio, json, math, struct, sys
import websockets
from mcap.records import Schema
from mcap_ros2.decoder import DecoderFactory

WANTED = ['/measured_js', '/operating_state', '/robot_description', '/i2ris/actuators/measured_js']

async def watch(address):
    offered = ['foxglove.websocket.v1', 'foxglove.sdk.v1']
    async with websockets.connect(address, subprotocols=offered, max_size=None) as socket:
        assert socket.subprotocol == 'foxglove.sdk.v1', socket.subprotocol
        info = json.loads(await socket.recv())
        assert info['op'] == 'serverInfo' and info['capabilities'] == [], info
        channels, seen = {}, {}
        while not all(topic in channels for topic in WANTED):
            for channel in json.loads(await socket.recv()).get('channels', []):
                channels[channel['topic']] = channel
        decoders = {}
        for place, topic in enumerate(WANTED):
            channel = channels[topic]
            schema = Schema(place + 1, data=channel['schema'].encode(),
                            encoding=channel['schemaEncoding'], name=channel['schemaName'])
            decoders[place] = DecoderFactory().decoder_for(channel['encoding'], schema)
        subscriptions = [{'id': place, 'channelId': channels[topic]['id']}
                         for place, topic in enumerate(WANTED)]
        await socket.send(json.dumps({'op': 'subscribe', 'subscriptions': subscriptions}))
        while len(seen) < len(WANTED):
            message = await socket.recv()
            if isinstance(message, bytes) and message[0] == 1:
                place, stamp = struct.unpack_from('<IQ', message, 1)
                seen[WANTED[place]] = decoders[place](message[13:])
        return seen

seen = asyncio.run(asyncio.wait_for(watch(sys.argv[1]), 30))
joints = seen['/measured_js']
assert list(joints.name) == ['pitch', 'yaw'], joints
degrees = [math.degrees(angle) for angle in joints.position]
assert all(abs(a - float(b)) < 1e-9 for a, b in zip(degrees, sys.argv[2:4])), degrees
assert seen['/operating_state'].state == 'ENABLED', seen
assert seen['/robot_description'].data.startswith('<?xml'), seen['/robot_description'].data[:80]
assert list(seen['/i2ris/actuators/measured_js'].measured_counts) == [40, -20]
";

#[test]
fn a_viewer_in_python_decodes_by_the_definitions_that_are_advertised() {
    let controller = Controller::enabled();
    let (_program, address) = start(&controller.domain);
    let pose = controller.robot().pose.map(|angle| angle.to_string());
    let arguments = [address.as_str(), &pose[0], &pose[1]];
    run_python("websockets, mcap_ros2", VIEWER, &arguments);
}

#[test]
fn it_waits_for_a_controller_and_accepts_no_commands() {
    let nobody = Domain::new(&format!("t{:016x}", random_id())).unwrap();
    let (_program, address) = start(&nobody);
    assert!(tungstenite::connect(&address).is_err(), "another protocol");
    let mut viewer = Viewer::open(&address, LICHTBLICK);
    viewer.subscribe("/robot_description");
    viewer.wait_for("/robot_description", |bytes| has(bytes, "i2ris_base"));
    let channel = json!({ "id": 1, "topic": "/servo_jp", "encoding": "cdr", "schemaName": "x" });
    let text = json!({ "op": "advertise", "channels": [channel] }).to_string();
    viewer.socket.send(Message::text(text)).unwrap();
    let end = clock::now() + PATIENCE;
    loop {
        assert!(clock::now() < end, "an advertisement is not refused");
        if let Message::Text(text) = viewer.socket.read().unwrap()
            && has(text.as_bytes(), "status")
        {
            break;
        }
    }
}

#[test]
fn the_layout_is_written_once_and_names_topics_that_are_there() {
    let folder = std::env::temp_dir().join(format!("i2ris-layout-{:x}", random_id()));
    std::fs::create_dir(&folder).unwrap();
    let file = folder.join("layout.json");
    let nobody = Domain::new("nobody").unwrap();
    let run = || Program::run(&nobody, &["foxglove", "--layout", file.to_str().unwrap()]);
    assert!(run().0);
    let (success, _, error) = run();
    assert!(!success && error.contains("cannot make"), "{error}");
    let layout: Value = serde_json::from_str(&std::fs::read_to_string(&file).unwrap()).unwrap();
    std::fs::remove_dir_all(&folder).unwrap();
    let text = layout.to_string();
    let mut topics: Vec<String> = i2ris_record::topic::Topic::all().map(|it| it.name()).collect();
    topics.push("/tracking_error".to_owned());
    let mut named = 0;
    for path in text.split("\"value\":\"").skip(1).map(|it| it.split('"').next().unwrap()) {
        let topic = path.split('.').next().unwrap();
        assert!(topics.iter().any(|known| known == topic), "{path}");
        named += 1;
    }
    assert!(named > 10, "{text}");
    for panel in layout["configById"].as_object().unwrap().keys() {
        assert!(layout["layout"].to_string().contains(panel), "{panel} has a place");
    }
}
