//! Who may do what while a client commands: the table in `core/command/authority.rs`, in every
//! activity, whoever started it and whoever holds.

use super::*;

const OTHER: u64 = CLIENT + 1;
const THIRD: u64 = CLIENT + 2;

/// Starts an activity of a client.
type Begin = fn(&mut Bench, u64);

const ACTIVITIES: [(&str, Begin); 6] = [
    ("a stream of the joints", |bench, client| assert_eq!(joints(bench, client), Refusal::None)),
    ("a stream of the jaw", |bench, client| assert_eq!(jaw(bench, client), Refusal::None)),
    ("a lease of a stream that ended", |bench, client| {
        assert_eq!(joints(bench, client), Refusal::None);
        bench.run(60);
    }),
    ("a move", |bench, client| {
        assert_eq!(state(bench, client, StateCommand::Move), Refusal::None);
        bench.run(50);
    }),
    ("a conditioning cycle", |bench, client| {
        assert_eq!(state(bench, client, StateCommand::Condition), Refusal::None);
        bench.run(50);
    }),
    ("a homing", |bench, client| {
        switch_off(bench);
        bench.drives.iter_mut().for_each(|drive| drive.delay = 500);
        assert_eq!(state(bench, client, StateCommand::Home), Refusal::None);
    }),
];

/// A request, with the table row that it belongs to.
type Action = (&'static str, fn(&mut Bench, u64) -> Refusal);

const ACTIONS: [Action; 22] = [
    ("`disable`", |bench, client| state(bench, client, StateCommand::Disable)),
    ("`pause`", |bench, client| state(bench, client, StateCommand::Pause)),
    ("`hold`", |bench, client| state(bench, client, StateCommand::Hold)),
    ("`enable`", |bench, client| state(bench, client, StateCommand::Enable)),
    ("`resume`", |bench, client| state(bench, client, StateCommand::Resume)),
    ("`acknowledge`", |bench, client| state(bench, client, StateCommand::Acknowledge)),
    ("fixtures on", |bench, client| bench.change_fixtures(client, FixtureChange::SwitchOn)),
    ("fixture added", |it, client| it.change_fixtures(client, add_ball(rad(9.0, 9.0), 0.01))),
    ("model staged", |bench, _| {
        bench.stage(&scaled_standard_model(1.3));
        Refusal::None
    }),
    ("`release`", |bench, client| state(bench, client, StateCommand::Release)),
    ("`servo_jp`", joints),
    ("`actuators/servo_jp`", |bench, client| {
        let here = ServoGoal::Actuator(bench.targets().map(Counts), 2);
        let command = ServoCommand { client_id: client, ..bench.servo(here) };
        bench.send(command)
    }),
    ("`jaw/servo_jp`", jaw),
    ("`move`", |bench, client| state(bench, client, StateCommand::Move)),
    ("`condition`", |bench, client| state(bench, client, StateCommand::Condition)),
    ("`home`", |bench, client| state(bench, client, StateCommand::Home)),
    ("`unhome`", |bench, client| state(bench, client, StateCommand::Unhome)),
    ("model activated", |bench, client| activate(bench, client, false)),
    ("by force", |bench, client| activate(bench, client, true)),
    ("rollback", |bench, client| bench.change_model_as(client, ModelChange::Rollback, true)),
    ("fixtures off", |bench, client| bench.change_fixtures(client, FixtureChange::SwitchOff)),
    ("fixtures removed", |bench, client| bench.change_fixtures(client, FixtureChange::RemoveAdded)),
];

fn staged() -> Arc<Model> {
    scaled_standard_model(1.1)
}

/// ENABLED and holding, with a jaw, a staged and a previous model.
fn ready() -> Bench {
    let mut bench = Bench::enabled_with(with_jaw(config("")), Some(standard_model()));
    let second = scaled_standard_model(1.2);
    for model in [&second, &staged()] {
        bench.stage(model);
        bench.change_model(ModelChange::Activate(second.id()), true);
    }
    assert!(bench.report().models.previous.is_some());
    bench
}

fn switch_off(bench: &mut Bench) {
    assert_eq!(bench.ask_as(THIRD, StateCommand::Disable).refusal, Refusal::None);
    bench.idle();
}

fn state(bench: &mut Bench, client: u64, command: StateCommand) -> Refusal {
    bench.pose = (command == StateCommand::Move).then(|| (rad(5.0, 0.0), 2));
    bench.ask_as(client, command).refusal
}

fn activate(bench: &mut Bench, client: u64, forced: bool) -> Refusal {
    bench.change_model_as(client, ModelChange::Activate(staged().id()), forced)
}

fn joints(bench: &mut Bench, client: u64) -> Refusal {
    let goal = ServoGoal::Joint(bench.joints().setpoint, 2);
    let command = ServoCommand { client_id: client, ..bench.servo(goal) };
    bench.send(command)
}

fn jaw(bench: &mut Bench, client: u64) -> Refusal {
    let goal = ServoGoal::Joint([0.05, 0.0, 0.0], 1);
    let command = ServoCommand { client_id: client, ..bench.servo(goal) };
    bench.send_jaw(command)
}

fn hold(bench: &mut Bench, client: u64) -> Refusal {
    state(bench, client, StateCommand::Hold)
}

/// The printed rows: the request and who may make it.
fn printed() -> Vec<Vec<&'static str>> {
    let text = include_str!("../../src/core/command/authority.rs");
    let lines = text.lines().filter_map(|line| line.strip_prefix("//! | ")?.strip_suffix(" |"));
    lines.map(|line| line.split(" | ").collect::<Vec<_>>()).skip(1).collect()
}

/// A situation, its column in the table, and a client that may do everything the state allows.
struct Situation {
    what: String,
    column: usize,
    entitled: u64,
    build: Box<dyn Fn() -> Bench>,
}

fn situations() -> Vec<Situation> {
    let mut all = Vec::new();
    for (name, begin) in [("nothing", (|_, _| {}) as Begin)].into_iter().chain(ACTIVITIES) {
        // The client that starts it, the client that then holds, and the column for `CLIENT`.
        for (by, holder, column, entitled) in [
            (CLIENT, None, if name == "nothing" { 1 } else { 2 }, CLIENT),
            (OTHER, None, if name == "nothing" { 1 } else { 3 }, OTHER),
            (OTHER, Some(CLIENT), 1, CLIENT),
            (CLIENT, Some(OTHER), 4, OTHER),
            (OTHER, Some(THIRD), 4, THIRD),
        ] {
            let build = Box::new(move || {
                let mut bench = ready();
                begin(&mut bench, by);
                let _ = holder.map(|holder| hold(&mut bench, holder));
                bench
            });
            let what = format!("{name} of {by}, held by {holder:?}");
            all.push(Situation { what, column, entitled, build });
        }
    }
    all
}

/// How the reply to a client differs from the table; `twin` receives no request.
fn mistake(
    situation: &Situation,
    twin: &Bench,
    act: fn(&mut Bench, u64) -> Refusal,
    cell: &str,
) -> Option<String> {
    let mut bench = (situation.build)();
    let refusal = act(&mut bench, CLIENT);
    let is_who = [Refusal::Lease, Refusal::StreamInterrupted].contains(&refusal);
    let expected = match cell {
        "yes" => return is_who.then(|| format!("{refusal:?}")),
        "Lease" => Refusal::Lease,
        "StreamInterrupted" => Refusal::StreamInterrupted,
        other => panic!("{other} is not a cell"),
    };
    // A refusal by the state, which applies to every client, comes first.
    let of_state = || act(&mut (situation.build)(), situation.entitled);
    let is_right = refusal == expected || refusal != Refusal::None && refusal == of_state();
    let seen = |bench: &Bench| {
        let report = bench.report();
        let robot = (report.state, report.busy, report.homed, report.fixtures);
        (bench.out.requests, bench.out.auxiliary, robot, report.models, report.lease_client_id)
    };
    let is_unchanged = seen(&bench) == seen(twin);
    (!is_right || !is_unchanged).then(|| format!("{refusal:?}, unchanged: {is_unchanged}"))
}

#[test]
fn permission_table_holds_in_every_activity() {
    // The table does not depend on the model: a thousand robots get the one that computes least.
    if has_memory() {
        return with_family("linear", "permission_table_holds");
    }
    let rows = printed();
    let asked = |row: &[&str]| ACTIONS.iter().any(|(name, _)| row[0].contains(name));
    assert!(rows.len() == 8 && rows.iter().all(|row| asked(row)), "{rows:?}");
    let mut mistakes = Vec::new();
    for situation in situations() {
        let mut twin = (situation.build)();
        twin.tick();
        for (name, act) in ACTIONS {
            let row = rows.iter().find(|row| row[0].contains(name));
            let cell = row.unwrap_or_else(|| panic!("{name} is in no row"))[situation.column];
            if let Some(found) = mistake(&situation, &twin, act, cell) {
                mistakes.push(format!("{name}, {}: {found}, not {cell}", situation.what));
            }
        }
    }
    assert!(mistakes.is_empty(), "{}:\n{}", mistakes.len(), mistakes.join("\n"));
}

#[test]
fn hold_of_any_client_ends_every_activity() {
    for (name, begin) in ACTIVITIES {
        let mut bench = ready();
        begin(&mut bench, OTHER);
        assert_eq!(hold(&mut bench, CLIENT), Refusal::None, "{name}");
        assert_eq!(bench.report().lease_client_id, 0, "{name}");
        bench.run(5);
        let targets = |bench: &Bench| (bench.targets(), bench.out.auxiliary.unwrap().target);
        let held = targets(&bench);
        bench.run(100);
        assert_eq!(targets(&bench), held, "{name}");
        bench.idle();
        let is_on = bench.state() == OperatingState::Enabled && bench.report().holding;
        assert!(is_on || name == "a homing" && !bench.report().busy, "{name}");
    }
}

#[test]
fn foreign_hold_blocks_every_client_until_silent() {
    for (name, act) in ACTIONS {
        let row = printed().into_iter().find(|row| row[0].contains(name)).unwrap();
        if row[4] != "StreamInterrupted" {
            continue;
        }
        let mut bench = ready();
        assert_eq!(hold(&mut bench, OTHER), Refusal::None);
        bench.run(20);
        if ["`home`", "`unhome`"].contains(&name) {
            switch_off(&mut bench);
        }
        for k in 1..=10 {
            assert_eq!(act(&mut bench, CLIENT), Refusal::StreamInterrupted, "{name}");
            // Its own stop does not release the hold.
            assert_eq!(state(&mut bench, CLIENT, StateCommand::Disable), Refusal::None);
            bench.run(298);
            assert_eq!(state(&mut bench, THIRD + k, StateCommand::Enable), Refusal::None);
            bench.run(100);
            if ["`home`", "`unhome`"].contains(&name) {
                switch_off(&mut bench);
            }
        }
        bench.run(1000);
        assert_eq!(state(&mut bench, CLIENT, StateCommand::Release), Refusal::None);
        assert_ne!(act(&mut bench, CLIENT), Refusal::StreamInterrupted, "{name}");
    }
}
