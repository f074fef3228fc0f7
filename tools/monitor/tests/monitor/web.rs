//! `i2ris status --web`: answers, refusals, and robustness against slow clients.

use std::fmt::Debug;
use std::io::Write;
use std::net::TcpStream;

use i2ris::ipc::payload::{
    JointState, ModelReply, ModelRequest, MoveRequest, ServoActuator, ServoJp, StateCommandReply,
    StateCommandRequest,
};
use i2ris::ipc::{Domain, Fault, OperatingState};
use i2ris::robot::{Cause, Reason};
use i2ris_testing::bench::{ends, fails};
use i2ris_testing::{Controller, unique_domain, wait_until};
use iceoryx2::node::{Node, NodeBuilder};
use iceoryx2::prelude::{
    Config, FileName, Path, SemanticString, SignalHandlingMode, ZeroCopySend, ipc,
};
use iceoryx2::service::port_factory::PortFactory;
use serde_json::json;

use crate::http::Served;

#[test]
fn page_gets_everything_and_then_only_news() {
    let controller = Controller::enabled();
    let served = Served::start(&controller.domain);
    let live = served.wait("numbers", |live| {
        live["loop"].is_object()
            && live["models"]["used"].is_object()
            && live["next_sample"].as_u64() > Some(50)
    });
    assert_eq!((&live["problem"], &live["state"]["name"]), (&json!(null), &json!("ENABLED")));
    let shown = (&live["estimate"]["deg"], &live["state"]["stale"]);
    assert_eq!(shown, (&json!([1.0, -1.0]), &json!(false)));
    assert_eq!(live["motors"][1]["measured_counts"], json!(-20));
    assert_eq!(live["models"]["used"]["name"], json!("linear 01010101"));
    let (run, next) = (&live["run"], &live["next_sample"]);
    let more = served.live(&format!("run={run}&sample={next}"));
    assert!(more["samples"].as_array().unwrap().len() < 50, "{more}");
    controller.robot().pose = [2.0, 3.0];
    served.wait("another pose", |live| live["estimate"]["deg"] == json!([2.0, 3.0]));
    controller.robot().state = OperatingState::Fault;
    controller.robot().reasons.push((Reason::from(Cause::Fault(Fault::Link)), 0));
    served.wait("a fault", |live| live["state"]["name"] == json!("FAULT"));
    served.wait("its alarm", |live| {
        let mut events = live["events"].as_array().unwrap().iter();
        events.any(|it| it["severity"] == "alarm" && it["text"].to_string().contains("fault 2"))
    });
}

#[test]
fn the_pages_and_all_of_their_parts_come_from_here() {
    let controller = Controller::enabled();
    let served = Served::start(&controller.domain);
    for (target, part) in [
        ("/page.css", "canvas"),
        ("/page.js", "drawPlane("),
        ("/live.js", "fetch("),
        ("/plots.js", "class Plot"),
    ] {
        let (status, body) = served.ask("GET", target);
        assert!(status == 200 && body.contains(part), "{target}: {status}\n{body}");
        assert!(!body.contains("//cdn") && !body.contains("https:"), "{target}");
    }
    for target in ["/", "/operator"] {
        let (status, page) = served.ask("GET", target);
        assert!(status == 200 && page.contains("<!doctype html>"), "{status}\n{page}");
        let elsewhere = ["http:", "https:", "//cdn"].iter().find(|part| page.contains(**part));
        assert_eq!(elsewhere, None, "{target}");
        let is_file = |part: &&str| part.ends_with(".js") || part.ends_with(".css");
        let named: Vec<&str> = page.split('"').filter(is_file).collect();
        assert!(named.len() >= 2, "{named:?}");
        for name in named {
            assert_eq!(served.ask("GET", &format!("/{name}")).0, 200, "{name}");
        }
    }
    for target in ["/none", "/../etc/passwd"] {
        assert_eq!(served.ask("GET", target).0, 404);
    }
}

#[test]
fn everything_but_get_is_refused_and_moves_nothing() {
    let controller = Controller::enabled();
    let served = Served::start(&controller.domain);
    served.wait("numbers", |live| live["state"].is_object());
    for method in ["POST", "PUT", "DELETE", "PATCH", "OPTIONS", "HEAD", "BREW"] {
        for target in ["/", "/live", "/state_command"] {
            assert_eq!(served.ask(method, target).0, 405, "{method} {target}");
        }
    }
    for (method, status) in [("POST", 405), ("GET", 400)] {
        let body = "{\"command\":\"disable\"}";
        let length = body.len();
        let head =
            format!("{method} /live HTTP/1.1\r\nHost: localhost\r\nContent-Length: {length}");
        let answer = served.exchange(format!("{head}\r\n\r\n{body}").as_bytes());
        assert!(answer.starts_with(&format!("HTTP/1.1 {status} ")), "{answer}");
    }
    let robot = controller.robot();
    assert_eq!((robot.requested.len(), robot.model_requests.len(), robot.poses.len()), (0, 0, 0));
    assert_eq!(robot.state, OperatingState::Enabled);
}

#[test]
fn strangers_and_nonsense_are_refused() {
    let controller = Controller::enabled();
    let served = Served::start(&controller.domain);
    let status = |text: &str| served.exchange(text.as_bytes()).chars().take(12).collect::<String>();
    assert_eq!(status("GET /live HTTP/1.1\r\nHost: rebound.example\r\n\r\n"), "HTTP/1.1 403");
    assert_eq!(status("nonsense\r\n\r\n"), "HTTP/1.1 400");
    let long = format!("GET / HTTP/1.1\r\nHost: localhost\r\nX-Long: {}", "x".repeat(9000));
    assert_eq!(status(&long), "HTTP/1.1 431");
    assert_eq!(served.ask("GET", "/live").0, 200, "and it continues");
}

#[test]
fn browsers_that_stall_or_vanish_cost_the_others_nothing() {
    let controller = Controller::enabled();
    let served = Served::start(&controller.domain);
    // Some send half a request, some send many and never read, some disconnect.
    let stall = |number| {
        let mut stream = served.connect();
        match number % 3 {
            0 => stream.write_all(b"GET / HT").unwrap(),
            1 => {
                stream.set_nonblocking(true).unwrap();
                let many = "GET /live HTTP/1.1\r\nHost: localhost\r\n\r\n".repeat(2000);
                let _ = stream.write(many.as_bytes());
            }
            _ => {}
        }
        stream
    };
    let stalled: Vec<TcpStream> = (0..30).map(stall).collect();
    drop((0..50).map(|_| served.connect()).collect::<Vec<_>>());
    served.wait_for_a_place();
    let before = served.live("")["next_sample"].as_u64().unwrap();
    let live = served
        .wait("the stream continues", |live| live["next_sample"].as_u64().unwrap() > before + 20);
    assert_eq!(live["state"]["stale"], json!(false));
    drop(stalled);
}

#[test]
fn too_many_browsers_are_informed() {
    let controller = Controller::enabled();
    let served = Served::start(&controller.domain);
    let held: Vec<TcpStream> = (0..60).map(|_| served.connect()).collect();
    wait_until("one too many is refused", || served.ask("GET", "/").0 == 503);
    drop(held);
    served.wait_for_a_place();
}

#[test]
fn page_waits_for_a_controller_and_reports_its_end() {
    let served = Served::start(&unique_domain());
    let live = served.wait("the reason", |live| live["problem"].is_string());
    assert!(live["problem"].as_str().unwrap().contains("no controller serves domain"), "{live}");
    assert_eq!(live["state"], json!(null));

    let controller = Controller::enabled();
    let served = Served::start(&controller.domain);
    served.wait("numbers", |live| {
        live["state"]["name"] == json!("ENABLED") && live["problem"].is_null()
    });
    drop(controller);
    let live = served.wait("staleness", |live| {
        live["state"]["stale"] == json!(true)
            && !live["problem"].is_null()
            && live["estimate"]["age_ms"].as_u64() > Some(500)
    });
    let shown = (&live["estimate"]["stale"], &live["motors"][0]["stale"]);
    assert_eq!(shown, (&json!(true), &json!(true)));
}

#[test]
fn it_ends_with_ctrl_c_and_reports_a_used_port() {
    let controller = Controller::enabled();
    let mut served = Served::start(&controller.domain);
    let place = served.address.to_string();
    let used = format!("status --web {place}");
    fails(&controller.domain, &used, 1, &[&place, "--web ADDRESS:PORT"]);
    served.program.interrupt();
    assert!(served.program.end().0);
    fails(&controller.domain, "status --web somewhere", 2, &["192.168.1.5:8080"]);
}

#[test]
fn an_address_for_others_is_warned_about() {
    let controller = Controller::enabled();
    let mut served = Served::with(&controller.domain, &["status", "--web", "0.0.0.0:0"]);
    assert_eq!(served.ask("GET", "/live").0, 200);
    served.program.interrupt();
    ends(served.program, 0, &["can be reached from other machines"]);
}

/// The services of the controller, as any client finds them: how many of the domain could command.
struct Census(Node<ipc::Service>);

impl Census {
    fn of(domain: &Domain) -> Self {
        let text = std::fs::read_to_string(domain.directory().join("ready")).unwrap();
        let boot = text.split(' ').next().unwrap();
        let mut config = Config::default();
        let root = domain.directory().join(boot);
        config.global.set_root_path(&Path::new(root.as_os_str().as_encoded_bytes()).unwrap());
        config.global.prefix =
            FileName::new(format!("{}{boot}_", domain.prefix()).as_bytes()).unwrap();
        config.global.node.cleanup_dead_nodes_on_creation = false;
        config.global.node.cleanup_dead_nodes_on_destruction = false;
        let node = NodeBuilder::new().config(&config);
        Self(node.signal_handling_mode(SignalHandlingMode::Disabled).create().unwrap())
    }

    /// Publishers and subscribers of a stream.
    fn stream<T: ZeroCopySend + Debug + 'static>(&self, name: &str) -> (usize, usize) {
        let service = self.0.service_builder(&name.try_into().unwrap());
        let service = service.publish_subscribe::<T>().open().unwrap();
        let ports = service.dynamic_config();
        (ports.number_of_publishers(), ports.number_of_subscribers())
    }

    fn askers<Q, R>(&self, name: &str) -> usize
    where
        Q: ZeroCopySend + Debug + 'static,
        R: ZeroCopySend + Debug + 'static,
    {
        let service = self.0.service_builder(&name.try_into().unwrap());
        let service = service.request_response::<Q, R>().open().unwrap();
        service.dynamic_config().number_of_clients()
    }
}

#[test]
fn the_page_has_no_way_to_command() {
    let controller = Controller::enabled();
    let census = Census::of(&controller.domain);
    let watchers = || census.stream::<JointState>("i2ris/measured_js").1;
    let before = watchers();
    let served = Served::start(&controller.domain);
    served.wait("numbers, and the models", |live| live["models"]["used"].is_object());
    assert_eq!(watchers(), before + 1, "it is counted");
    assert_eq!(census.stream::<ServoJp>("i2ris/servo_jp").0, 0);
    assert_eq!(census.stream::<ServoActuator>("i2ris/actuators/servo_jp").0, 0);
    // Every few seconds it requests the list of models; nothing stays open.
    let askers = || {
        [
            census.askers::<StateCommandRequest, StateCommandReply>("i2ris/state_command"),
            census.askers::<MoveRequest, StateCommandReply>("i2ris/move_jp"),
            census.askers::<ModelRequest, ModelReply>("i2ris/model"),
        ]
    };
    wait_until("no connection can send requests", || askers() == [0; 3]);
}
