//! Start and shutdown of the controller process.
//!
//! | thread | scheduling | task |
//! |---|---|---|
//! | control loop | SCHED_FIFO, pinned if configured | one cycle per tick |
//! | one per serial port | SCHED_FIFO, 10 below | the exchanges with the drives |
//! | shared memory | SCHED_FIFO, 20 below | commands in, messages out |
//! | models | normal | reads, checks, compares and frees models |
//! | black box | normal | keeps the last seconds of every tick and writes them to files |
//! | main | normal | writes the log and waits for the end |

use std::io::Write;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, mpsc};

use rtrb::Consumer;

use crate::config::{Config, ControlConfig};
use crate::core::cycle::ControlCycle;
use crate::core::{CommandCheck, CycleEvent, Gated};
use crate::drive::event::PortEvent;
use crate::drive::line_turn::LoopBeat;
use crate::drive::port_runner::PortRunner;
use crate::ipc::domain_lock::publish_run;
use crate::ipc::heartbeat::HeartbeatWriter;
use crate::ipc::server::check_memory;
use crate::ipc::watchdog_presence::WatchdogStatus;
use crate::ipc::{Domain, DomainLock, Server, StreamMessage};
use crate::model::Model;
use crate::process::black_box::{RecordedRun, Recorder, recover};
use crate::process::channels::{WorkerQueues, loop_channels, request_queues};
use crate::process::control_loop::{Beats, ControlLoop};
use crate::process::fixture_table::FixtureTable;
use crate::process::ipc_thread::{IpcThread, IpcThreadParts};
use crate::process::loop_history::SharedLoopHistory;
use crate::process::main_thread::{MainThread, RunEnd};
use crate::process::model_manager::ModelManager;
use crate::process::payload_conversion::robot_description;
use crate::process::run_log::{RunHeader, RunLog, write_line};
use crate::process::start_up::{
    Drives, PortLine, StartModelError, bring_up_ports, check_drives, load_model, software,
    wait_for_positions,
};
pub use crate::process::threads::ControllerError;
use crate::process::threads::{self, BLACK_BOX, NamedThread, ThreadError, Threads};
use crate::realtime::{self, Granted, SchedulingRequest};
use crate::units::Nanos;
use crate::{clock, service_manager};

/// SCHED_FIFO priority of the port threads relative to the loop: lower by this value.
const PORT_PRIORITY_DISTANCE: u8 = 10;
/// The same for the IPC thread. Under normal scheduling, other programs would delay commands until
/// they are stale. It is lower than the port threads: an ongoing exchange must not wait for a
/// client.
const IPC_PRIORITY_DISTANCE: u8 = 20;
const PORT_EVENTS: usize = 1024;
const START_DELAY: Nanos = Nanos::from_millis(20);

/// Runs the controller until `shutdown` is set and the drives are off. `note` goes to the run log;
/// lines for the operator go to `log`. Fails when a component cannot be started, a thread ended
/// early, or a drive may still have power.
pub fn run(
    config: &Config,
    note: &str,
    shutdown: &Arc<AtomicBool>,
    log: &mut dyn Write,
) -> Result<(), ControllerError> {
    let model = load_model(config)?.map(Arc::new);
    // Locks the domain before the ports: a second controller must not touch the drives of the
    // first.
    let domain = Domain::new(&config.domain)?;
    let before = domain.last_run();
    let lock = DomainLock::acquire(&domain)?;
    // Before anything that can fail: the end of the lock removes what a killed controller left.
    recover(config, &domain, log);
    let boot_id = lock.boot_id();
    let drives = match ready_drives(config, model.as_deref(), &domain, log) {
        Ok(drives) => drives,
        Err(error) => {
            drop(lock);
            // The run before this start remains the last one.
            if let Some((boot_id, records)) = before {
                let _ = publish_run(&domain, boot_id, &records);
            }
            return Err(error);
        }
    };
    let (identities, exchanges) = (drives.identities.clone(), drives.exchanges.clone());
    let (config, fingerprints) = (&config.with_exchanges(&exchanges), drives.fingerprints.clone());
    // Before clients find it. Without the file they do not know the drive settings, but it runs.
    let _ = domain.publish_drives(&fingerprints);
    let threads = start_threads(config, lock, model.as_ref(), drives, shutdown)?;
    // Without it, clients do not know why a killed controller ended.
    let _ = publish_run(&domain, boot_id, &config.record_folder);
    service_manager::notify(service_manager::READY);
    let (name, process) = (domain.name(), std::process::id());
    write_line(log, format_args!("serves domain `{name}`, process {process}"));
    write_granted(log, &threads.granted);
    write_limits(log, config, model.as_deref(), &exchanges);
    write_ipc_granted(log, &config.control, &threads.ipc_granted);
    if let Some(delay_s) = config.command.tremor_filter_delay_s() {
        let delay_ms = delay_s * 1e3;
        write_line(log, format_args!("the tremor filter delays the goal by {delay_ms:.0} ms"));
    }
    let (run_log, begun) = RunLog::begin(&RunHeader {
        software: &software(),
        boot_id,
        config,
        model: model.as_ref().map(|model| model.id()),
        drives: &identities,
        fingerprints: &fingerprints,
        granted: &threads.granted,
        note,
    });
    if let Err(error) = begun {
        write_line(log, format_args!("warning: cannot write the run log: {error}"));
    }
    let mut main = MainThread {
        events: threads.events,
        port_events: threads.port_events,
        recorder_lines: threads.recorder_lines,
        run_log,
        domain,
        ports: config.ports_digest(),
        was_watched: false,
        powered: config.axes().map(|axis| axis.motor).collect(),
        boot_id,
        log,
        published: threads.published,
    };
    main.run(&threads.running, shutdown);
    service_manager::notify(service_manager::STOPPING);
    let (ended, end) = threads.running.end(&mut main);
    let _ = main.run_log.end(end.text());
    if end != RunEnd::Clean {
        // The folder was removed when the lock was released.
        let _ = publish_run(&main.domain, boot_id, &config.record_folder);
    }
    threads::outcome(main.powered, ended)
}

/// Brings up the drives and checks that the model may use them.
fn ready_drives(
    config: &Config,
    model: Option<&Model>,
    domain: &Domain,
    log: &mut dyn Write,
) -> Result<Drives, ControllerError> {
    check_memory()?;
    let beat = LoopBeat::default();
    beat.set_watched(WatchdogStatus::read(domain, &config.ports_digest(), clock::now()).acts());
    let drives = bring_up_ports(config, beat, log)?;
    if let (Some(model), Some(path)) = (model, &config.control.model) {
        check_drives(model, &drives.fingerprints).map_err(|differences| {
            StartModelError::OtherDrive { path: path.clone(), differences }
        })?;
    }
    Ok(drives)
}

/// All threads but the main thread, and their channels to it.
struct Started {
    running: Threads,
    granted: Granted,
    ipc_granted: Granted,
    events: Consumer<CycleEvent>,
    port_events: mpsc::Receiver<(Nanos, PortEvent)>,
    recorder_lines: mpsc::Receiver<String>,
    published: mpsc::Sender<StreamMessage>,
}

fn start_threads(
    config: &Config,
    lock: DomainLock,
    model: Option<&Arc<Model>>,
    drives: Drives,
    shutdown: &Arc<AtomicBool>,
) -> Result<Started, ControllerError> {
    let (recorder, to_recorder) = Recorder::new(RecordedRun {
        config: config.clone(),
        software: software(),
        boot_id: lock.boot_id(),
        model: model.cloned(),
        captures: drives.captures,
        drives: drives.fingerprints.clone(),
    });
    let (published, log_entries) = mpsc::channel();
    let (channels, ipc_channels, model_channels, events) = loop_channels(to_recorder, log_entries);
    let (queues, workers) = request_queues();
    let history = SharedLoopHistory::new(config, model);
    let (settings, writes) = (drives.fingerprints.clone(), queues.recorder.clone());
    let manager =
        ModelManager::new(config.clone(), settings, history.clone(), model_channels, writes);
    let quit = Arc::new(AtomicBool::new(false));
    let (lines, recorder_lines) = mpsc::channel();
    let WorkerQueues { models, model_replies, recorder: writes, recorder_replies } = workers;
    let (cpu, until) = (config.control.cpu, Arc::clone(&quit));
    let recorder = NamedThread::spawn(BLACK_BOX, move || {
        realtime::keep_normal(cpu);
        recorder.run(&until, &writes, &recorder_replies, |line| {
            // The log may have ended.
            let _ = lines.send(line);
        });
    })?;
    let until = Arc::clone(&quit);
    let models = NamedThread::spawn("models", move || {
        realtime::keep_normal(cpu);
        manager.run(&until, &models, &model_replies);
    })?;
    let mut others = vec![recorder, models];
    let parts = IpcThreadParts {
        channels: ipc_channels,
        robot: robot_description(config),
        motors: config.motors() as u32,
        ports: config.ports_digest(),
        beat: drives.beat.clone(),
        command_check: CommandCheck::new(&config.command),
        history,
        queues,
        fixtures: FixtureTable::new(&config.virtual_fixtures),
        period: config.control.period(),
        line: config.slowest_line(&drives.exchanges),
    };
    let (to_ipc, granted) = mpsc::channel();
    let (ipc, (heartbeat, ipc_granted)) = start_ipc(config, lock, parts, granted, &quit)?;
    others.push(ipc);
    let (to_main, port_events) = mpsc::sync_channel(PORT_EVENTS);
    let quit_ports = Arc::new(AtomicBool::new(false));
    let start = |runner| start_port(&config.control, runner, to_main.clone(), &quit_ports);
    let ports = drives.runners.into_iter().map(start).collect::<Result<_, _>>()?;
    let mut links = drives.links;
    wait_for_positions(&mut links);
    let first = clock::now() + START_DELAY;
    let cycle = ControlCycle::new(config, model.cloned());
    let beats = Arc::new(Beats { heartbeat, line: drives.beat, lives: drives.lives });
    let lost_after = config.feedback_lost();
    let control_loop =
        ControlLoop { cycle, channels, links, beats: Arc::clone(&beats), lost_after };
    let (control, granted) = start_control(&config.control, control_loop, first, shutdown)?;
    // If the IPC thread has ended already, the main thread detects it.
    let _ = to_ipc.send((granted.clone(), first));
    Ok(Started {
        running: Threads { control, ports, others, quit_ports, quit, beats },
        granted,
        ipc_granted,
        events,
        port_events,
        recorder_lines,
        published,
    })
}

/// Priority of a thread at a distance below the loop: 0 only if the loop has 0.
fn priority_below(config: &ControlConfig, distance: u8) -> u8 {
    config.priority.saturating_sub(distance).max(config.priority.min(1))
}

/// Starts the IPC thread and waits until clients can find the controller.
fn start_ipc(
    config: &Config,
    lock: DomainLock,
    parts: IpcThreadParts,
    granted: mpsc::Receiver<(Granted, Nanos)>,
    quit: &Arc<AtomicBool>,
) -> Result<(NamedThread, (HeartbeatWriter, Granted)), ControllerError> {
    let (cpu, quit) = (config.control.cpu, Arc::clone(quit));
    let priority = priority_below(&config.control, IPC_PRIORITY_DISTANCE);
    let wanted = SchedulingRequest { priority, ..SchedulingRequest::default() };
    let (started_in, started) = mpsc::channel();
    let thread = NamedThread::spawn("ipc", move || {
        // Keeps off the CPU of the loop. Creating the services takes long and runs under normal
        // scheduling.
        realtime::keep_normal(cpu);
        match Server::create(lock).and_then(|server| Ok((server.heartbeat()?, server))) {
            Ok((heartbeat, server)) => {
                let _ = started_in.send(Ok((heartbeat, realtime::request(wanted))));
                // An error means that the loop never started; the main thread then ends the
                // process.
                if let Ok((granted, first)) = granted.recv() {
                    IpcThread::new(server, parts, granted).run(first, &quit);
                }
            }
            Err(error) => {
                let _ = started_in.send(Err(error));
            }
        }
    })?;
    let started = started.recv().map_err(|_| ThreadError::Died("ipc"))??;
    Ok((thread, started))
}

fn start_port(
    config: &ControlConfig,
    runner: PortRunner<PortLine, Gated>,
    events: mpsc::SyncSender<(Nanos, PortEvent)>,
    quit: &Arc<AtomicBool>,
) -> Result<NamedThread, ThreadError> {
    let quit = Arc::clone(quit);
    let priority = priority_below(config, PORT_PRIORITY_DISTANCE);
    let wanted = SchedulingRequest { priority, ..SchedulingRequest::default() };
    NamedThread::spawn("port", move || {
        // If this is refused, so is the request of the loop, which reports it.
        let _ = realtime::request(wanted);
        runner.run(&quit, |event| {
            // The queue is allocated in advance: the thread neither allocates nor waits. The queue
            // is full only if the main thread stalls; at the end, the log may already be closed.
            let _ = events.try_send((clock::now(), event));
        });
    })
}

/// Starts the loop and waits until its scheduling is known.
fn start_control(
    config: &ControlConfig,
    control_loop: ControlLoop,
    first: Nanos,
    shutdown: &Arc<AtomicBool>,
) -> Result<(NamedThread, Granted), ThreadError> {
    let (config, shutdown) = (config.clone(), Arc::clone(shutdown));
    let (granted_in, granted) = mpsc::channel();
    let thread = NamedThread::spawn("control", move || {
        let ControlConfig { priority, cpu, .. } = config;
        let wanted = SchedulingRequest { priority, cpu, lock_memory: priority > 0 };
        let _ = granted_in.send(realtime::request(wanted));
        control_loop.run(&config, first, &shutdown);
    })?;
    Ok((thread, granted.recv().unwrap_or_default()))
}

fn write_granted(log: &mut dyn Write, granted: &Granted) {
    let fifo = granted.priority > 0;
    let scheduling = if fifo { "SCHED_FIFO" } else { "normal scheduling" };
    let memory = if granted.memory_locked { "locked" } else { "not locked" };
    let priority = granted.priority;
    let cpu = granted.cpu.map_or_else(|| "any CPU".to_owned(), |cpu| format!("CPU {cpu}"));
    write_line(log, format_args!("loop: {scheduling} {priority}, memory {memory}, {cpu}"));
    for warning in &granted.warnings {
        write_line(log, format_args!("warning: {warning}"));
    }
}

/// Logs which limits do not apply: monitors disabled in the configuration, unknown angles, and what
/// the serial lines, as measured, cannot achieve.
fn write_limits(log: &mut dyn Write, config: &Config, model: Option<&Model>, exchanges: &[Nanos]) {
    let off = config.disabled_monitors().into_iter();
    let off = off.map(|it| format!("off by configuration: {it}"));
    for line in off.chain(config.host_failure_warning()) {
        write_line(log, format_args!("{line}"));
    }
    if model.is_none() && config.joint_limits.is_any() {
        let until = "until then, only the count, speed and current limits apply";
        write_line(log, format_args!("no model: joint_limits apply once one is in use; {until}"));
    }
    if model.is_some_and(|model| model.file().training.drives.is_empty()) {
        let line = "the model does not record the drive settings of its calibration";
        write_line(log, format_args!("{line}"));
    }
    let (stale, lost) = (config.feedback_stale().as_seconds(), config.feedback_lost().as_seconds());
    let [stale, lost] = [stale, lost].map(|age| age * 1e3);
    write_line(
        log,
        format_args!(
            "feedback: motion stops when a position is older than {stale:.0} ms; fault at \
             {lost:.0} ms"
        ),
    );
    for (port, exchange) in config.ports.iter().zip(exchanges) {
        let (device, line) = (port.device.display(), port.describe_line(*exchange));
        write_line(log, format_args!("{device}: {line}"));
        for finding in config.line_findings(port, *exchange) {
            write_line(log, format_args!("warning: {finding}"));
        }
    }
}

/// Logs the scheduling of the IPC thread, with a warning if it is not the requested one. The
/// warning of the loop contains the remedy.
fn write_ipc_granted(log: &mut dyn Write, config: &ControlConfig, granted: &Granted) {
    match granted.priority {
        0 if config.priority > 0 => write_line(
            log,
            format_args!(
                "warning: commands are read under normal scheduling: under load, they become \
                 stale and the robot holds"
            ),
        ),
        0 => write_line(log, format_args!("commands: normal scheduling 0")),
        priority => write_line(log, format_args!("commands: SCHED_FIFO {priority}")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thread_priorities_are_below_the_loop() {
        for (priority, expected) in
            [(80, [70, 60]), (98, [88, 78]), (15, [5, 1]), (2, [1, 1]), (1, [1, 1]), (0, [0, 0])]
        {
            let config = ControlConfig { priority, ..ControlConfig::default() };
            let distances = [PORT_PRIORITY_DISTANCE, IPC_PRIORITY_DISTANCE];
            assert_eq!(distances.map(|distance| priority_below(&config, distance)), expected);
        }
    }
}
