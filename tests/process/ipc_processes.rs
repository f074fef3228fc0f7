//! Processes that exit at once, are killed, and start again.
//!
//! The child processes are this test binary itself, running one of the ignored tests below.

use super::*;

const DOMAIN: &str = "I2RIS_TEST_DOMAIN";

fn start(role: &str, domain: &Domain) -> Killed {
    Killed::role(&format!("process::ipc_processes::{role}"), &[(DOMAIN, domain.name())])
}

/// The domain of a role; `None` when the ignored tests are run by hand.
fn assigned_domain() -> Option<Domain> {
    Some(Domain::new(&std::env::var(DOMAIN).ok()?).unwrap())
}

/// eclipse-iceoryx/iceoryx2#601; RemoveIPC= of logind does the same.
#[test]
fn removed_ipc_files_are_reported_by_controller_and_clients() {
    let mut rig = Rig::start();
    let mut client = rig.started();
    client.version().unwrap();
    let domain = rig.domain();
    for file in files(&domain).iter().filter(|file| file.is_file()) {
        fs::remove_file(file).unwrap();
    }
    let error = Client::connect(&domain, TIMEOUT).and_then(|mut new| new.version()).unwrap_err();
    assert!(error.to_string().contains("are gone or damaged"), "{error}");
    wait_until("the controller notices", || rig.log_text("controller").contains("were removed"));
    // Connected clients stay connected.
    client.version().unwrap();
}

#[test]
#[ignore = "a role: serves until killed"]
fn role_controller() {
    let Some(domain) = assigned_domain() else { return };
    let mut server = serve(&domain);
    loop {
        let now = clock::now();
        let state = OperatingStateMsg { stamp_ns: now.0, ..OperatingStateMsg::default() };
        server.publish(StreamMessage::State(state));
        server.maintain(now);
        clock::sleep(Nanos::from_millis(1));
    }
}

#[test]
#[ignore = "a role: one state command, then the end"]
fn role_one_shot() {
    let Some(domain) = assigned_domain() else { return };
    let mut client = Client::connect(&domain, TIMEOUT).unwrap();
    client.state_command(StateCommand::Home).unwrap();
}

#[test]
#[ignore = "a role: commands until killed"]
fn role_commander() {
    let Some(domain) = assigned_domain() else { return };
    let client = Client::connect(&domain, TIMEOUT).unwrap();
    let mut commander = client.commander();
    loop {
        let _ = commander.servo_jp(&[0.1, 0.2]);
        clock::sleep(Nanos::from_millis(1));
    }
}

#[test]
fn a_command_from_a_process_that_exits_at_once_arrives() {
    let domain = unique_domain();
    let (sender, commands) = std::sync::mpsc::channel();
    let _server = serve_on_thread(&domain, move |server, now| {
        for (token, request) in server.poll_requests(now) {
            let Request::StateCommand(request) = request else { panic!("{request:?}") };
            server.reply(token, StateCommandReply::default());
            sender.send(request.command).unwrap();
        }
    });
    for _ in 0..5 {
        let mut process = start("role_one_shot", &domain);
        assert!(process.0.wait().unwrap().success());
    }
    let received: Vec<u32> = commands.try_iter().collect();
    assert_eq!(received, [StateCommand::Home.number(); 5]);
}

#[test]
fn killed_commanders_never_block_the_next_one() {
    let domain = unique_domain();
    let mut server = serve(&domain);
    let mut previous = 0;
    // More than the service has room for at the same time.
    for _ in 0..12 {
        let commander = start("role_commander", &domain);
        previous = wait_until("a command of a new commander", || {
            server.maintain(clock::now());
            let client = server.poll_command(0, |_| true)?.client_id();
            (client != previous).then_some(client)
        });
        drop(commander);
    }
    assert_eq!(server.failures().0, 0, "{:?}", server.failures());
}

#[test]
fn second_controller_is_refused_with_pid_of_first() {
    let domain = unique_domain();
    let first = start("role_controller", &domain);
    let first_pid = wait_until("the first controller serves", || Ready::read(&domain)).pid;
    assert_eq!(first_pid, first.0.id());
    let error = DomainLock::acquire(&domain).unwrap_err();
    assert!(matches!(error, DomainError::Taken { pid: Some(pid), .. } if pid == first_pid));
    assert!(error.to_string().contains(&format!("process id {first_pid}")), "{error}");
    drop(first);
    // The lock ends with the process, so the next controller starts at once.
    drop(serve(&domain));
    assert_no_files(&domain);
}

#[test]
fn controller_killed_during_start_does_not_block_next() {
    let domain = unique_domain();
    for delay in 0..16 {
        let process = start("role_controller", &domain);
        clock::sleep(Nanos::from_millis(delay));
        drop(process);
        let server = serve(&domain);
        assert_eq!(Ready::read(&domain).unwrap().pid, std::process::id());
        drop(server);
    }
    assert_no_files(&domain);
}
