//! H36: a model that somebody trained is right on its rows and wrong elsewhere.

use std::path::PathBuf;

use i2ris::ipc::Refusal;
use i2ris::ipc::client::ClientError;
use i2ris::ipc::payload::{ModelSlot, unpadded_text};
use i2ris::model::file::{FamilyParameters, ModelFile};
use i2ris::model::network::{Activation, Layer, NetworkParameters};
use i2ris_testing::cycle::GAIN_DEG;
use i2ris_testing::{Rig, wait_until_idle};

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
    std::fs::write(&path, serde_json::to_string(&file).unwrap()).unwrap();
    path
}

#[test]
fn h36_a_network_is_examined_when_it_is_staged_and_a_bad_one_changes_nothing() {
    let mut rig = Rig::with_model();
    rig.start_controller();
    let mut client = rig.client();
    wait_until_idle(&mut client);
    let before = client.models().unwrap().slots;
    let radians = |network: &mut NetworkParameters| {
        network.skip_gain.iter_mut().flatten().for_each(|gain| *gain = gain.to_radians());
    };
    let heavy = |network: &mut NetworkParameters| network.output_gain[0][0] = 1e9;
    let rough = |network: &mut NetworkParameters| network.step_counts = 1e6;
    for (path, reason) in [
        (written(&rig, "grows.json", true, |_| ()), "hidden state grows"),
        (written(&rig, "radians.json", false, radians), "nonsense"),
        (written(&rig, "heavy.json", false, heavy), "at most 10000"),
        (written(&rig, "rough.json", false, rough), "1 to 1000 counts"),
    ] {
        match client.stage_model(&path) {
            Err(ClientError::ModelRefused { refusal: Refusal::BadModel, message, .. }) => {
                assert!(message.contains(reason), "{message}");
            }
            other => panic!("{reason}: {other:?}"),
        }
        assert_eq!(client.models().unwrap().slots, before, "{reason}");
    }
    let staged = client.stage_model(&written(&rig, "good.json", false, |_| ())).unwrap();
    let [_, staged, _] = staged.slots;
    assert!(staged.flags & ModelSlot::PRESENT != 0);
    assert_eq!(unpadded_text(&staged.family), "network");
}
