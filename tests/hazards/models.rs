//! H08, H36: a bad model, and one that was trained elsewhere. Staging refuses it; a model that
//! proves bad in use is rolled back.

use std::fs::{self, Permissions};
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use i2ris::clock;
use i2ris::ipc::client::{Client, ClientError};
use i2ris::ipc::payload::{ModelReply, ModelSlot, unpadded_text};
use i2ris::ipc::{OperatingState, Refusal, StateCommand};
use i2ris::model::ModelId;
use i2ris::model::file::{FamilyParameters, ModelFile};
use i2ris::model::network::{Activation, Layer, NetworkParameters};
use i2ris::units::Nanos;
use i2ris_testing::cycle::{GAIN_DEG, lag_counts};
use i2ris_testing::{
    Rig, SetOnDrop, largest_step, stream_angles_by, swing_angles_until, wait_until_idle,
};
use nix::sys::stat::Mode;
use nix::unistd::mkfifo;

fn refusal(outcome: Result<ModelReply, ClientError>) -> (Refusal, String) {
    match outcome {
        Err(ClientError::ModelRefused { refusal, message, .. }) => (refusal, message),
        other => panic!("{other:?}"),
    }
}

#[test]
fn h08_bad_models_are_refused_and_active_model_stays() {
    let mut rig = Rig::with_model();
    let mut client = rig.started();
    wait_until_idle(&mut client);
    let before = client.models().unwrap().slots;
    let absent = rig.folder.path().join("absent.json");
    let broken = rig.folder.path().join("broken.json");
    fs::write(&broken, "{\"format\": \"i2ris-model\", ").unwrap();
    let other = rig.sample_model("other.json", "elsewhere", 1.0);
    let flat = rig.sample_model("flat.json", "rig", 0.0);
    let open = rig.sample_model("open.json", "rig", 1.1);
    fs::set_permissions(&open, Permissions::from_mode(0o666)).unwrap();
    // A FIFO without a writer, and a file without an end.
    let fifo = rig.folder.path().join("fifo.json");
    mkfifo(&fifo, Mode::S_IRWXU).unwrap();
    for (file, reason) in [
        (absent, "cannot read"),
        (broken, "EOF"),
        (other, "robot `elsewhere`"),
        (flat, "must move an output"),
        (open, "chmod o-w"),
        (fifo, "not a regular file"),
        ("/dev/zero".into(), "not a regular file"),
    ] {
        let (refused, message) = refusal(client.stage_model(&file));
        assert!(refused == Refusal::BadModel && message.contains(reason), "{message}");
    }
    assert_eq!(refusal(client.activate_model(ModelId([7; 32]), true)).0, Refusal::NothingStaged);
    assert_eq!(refusal(client.roll_back_model(true)).0, Refusal::NoPreviousModel);
    assert_eq!(client.models().unwrap().slots, before);
}

#[test]
fn h08_model_is_swapped_and_rolled_back_during_motion() {
    let mut rig = Rig::with_model();
    let second = rig.sample_model("second.json", "rig", 1.3);
    let mut client = rig.enabled();
    // A model takes over where the memory is known.
    client.carry_out(StateCommand::Condition, || false).unwrap();
    let mut operator = Client::connect(&rig.domain(), Nanos::from_millis(5000)).unwrap();
    let done = AtomicBool::new(false);
    let (largest, pairs) = std::thread::scope(|scope| {
        let steps = scope.spawn(|| largest_step(&client, &done));
        // During a stream, only the followed client may change the model.
        let commander = operator.commander();
        scope.spawn(|| stream_angles_by(commander, swing_angles_until(&done)));
        let end = SetOnDrop(&done);
        for _ in 0..5 {
            swap_and_roll_back(&mut operator, &second);
        }
        drop(end);
        steps.join().unwrap()
    });
    let (state, log) = (wait_until_idle(&mut operator), rig.log_text("controller"));
    assert_eq!(state.state, OperatingState::Enabled.number(), "{log}");
    assert!(log.contains(" took over from "));
    let limit = rig.config.limits.velocity_counts_s * rig.config.control.period().as_seconds();
    let within = f64::from(largest) <= limit + 1.0;
    assert!(pairs > 100 && within, "{largest} counts in one of {pairs} ticks");
}

/// Activates a different model, then returns to the previous one.
fn swap_and_roll_back(operator: &mut Client, second: &Path) {
    let staged = operator.stage_model(second).unwrap();
    let [first, second, _] = staged.slots;
    assert!(first.flags & ModelSlot::PRESENT != 0);
    assert_eq!(unpadded_text(&second.family), unpadded_text(&first.family));
    let difference = staged.difference;
    assert!(difference.valid == 1 && difference.unreached == 0.0, "{difference:?}");
    // 1.3 times the angle: 769 counts instead of 1000; less with gap and friction, which stay.
    let [one, two] = difference.largest_counts.map(f64::abs);
    let wanted = (1000.0 - lag_counts().unwrap_or_default()) * (1.0 - 1.0 / 1.3);
    assert!((one.max(two) - wanted).abs() < 1.0, "{difference:?}");
    let in_use = |reply: ModelReply| [reply.slots[0].model_id, reply.slots[2].model_id];
    let reply = operator.activate_model(ModelId(second.model_id), false).unwrap();
    assert_eq!(in_use(reply), [second.model_id, first.model_id]);
    assert_eq!(operator.version().unwrap().model_id, second.model_id);
    clock::sleep(Nanos::from_millis(200));
    assert_eq!(in_use(operator.roll_back_model(false).unwrap()), [first.model_id, second.model_id]);
    clock::sleep(Nanos::from_millis(200));
}

/// A network that adds the state of two cells to the straight line of the robot; with `keeps`, the
/// cells forget nothing and something is added at every step.
fn network(gain: &[Vec<f64>], keeps: bool) -> NetworkParameters {
    let (forget, add) = if keeps { (30.0, 0.5) } else { (0.0, 0.0) };
    let cells = Layer::Lstm {
        input_weight: vec![vec![0.0; 2]; 8],
        recurrent_weight: vec![vec![0.0; 2]; 8],
        input_bias: [[0.0; 2], [forget; 2], [add; 2], [0.0; 2]].concat(),
        recurrent_bias: vec![0.0; 8],
    };
    let sum = Layer::Dense {
        weight: vec![vec![1.0, 0.0], vec![0.0, 1.0]],
        bias: vec![0.0; 2],
        activation: Activation::None,
    };
    NetworkParameters {
        step_counts: 20.0,
        input_centre: vec![0.0; 2],
        input_scale: vec![1e-3; 2],
        layers: vec![cells, sum],
        output_gain: vec![vec![1.0, 0.0], vec![0.0, 1.0]],
        output_offset: vec![0.0; 2],
        skip_gain: gain.to_vec(),
    }
}

/// Writes a model of a network, as the tools would if they did not examine it.
fn written(
    rig: &Rig,
    name: &str,
    keeps: bool,
    change: impl FnOnce(&mut NetworkParameters),
) -> PathBuf {
    let path = rig.sample_model(name, "rig", 1.0);
    let mut file = ModelFile::read(&path).unwrap();
    let gain = vec![vec![GAIN_DEG, -GAIN_DEG], vec![GAIN_DEG; 2]];
    let mut network = network(&gain, keeps);
    change(&mut network);
    file.training.linear_gain = Some(gain.clone());
    file.family = FamilyParameters::Network {
        network,
        memory_counts: vec![0.0; 2],
        gain,
        covariance: vec![vec![0.04, 0.0], vec![0.0, 0.09]],
    };
    fs::write(&path, serde_json::to_string(&file).unwrap()).unwrap();
    path
}

#[test]
fn h36_bad_network_is_refused_when_staged_and_changes_nothing() {
    let mut rig = Rig::with_model();
    let mut client = rig.started();
    wait_until_idle(&mut client);
    let before = client.models().unwrap().slots;
    let radians = |network: &mut NetworkParameters| {
        network.skip_gain.iter_mut().flatten().for_each(|gain| *gain = gain.to_radians());
    };
    let heavy = |network: &mut NetworkParameters| network.output_gain[0][0] = 1e9;
    let rough = |network: &mut NetworkParameters| network.step_counts = 1e6;
    for (path, reason) in [
        (written(&rig, "grows.json", true, |_| ()), "hidden state grows"),
        (written(&rig, "radians.json", false, radians), "unusable"),
        (written(&rig, "heavy.json", false, heavy), "at most 10000"),
        (written(&rig, "rough.json", false, rough), "1 to 1000 counts"),
    ] {
        let (refused, message) = refusal(client.stage_model(&path));
        assert!(refused == Refusal::BadModel && message.contains(reason), "{message}");
        assert_eq!(client.models().unwrap().slots, before, "{reason}");
    }
    let staged = client.stage_model(&written(&rig, "good.json", false, |_| ())).unwrap();
    let [_, staged, _] = staged.slots;
    assert!(staged.flags & ModelSlot::PRESENT != 0);
    assert_eq!(unpadded_text(&staged.family), "network");
}
