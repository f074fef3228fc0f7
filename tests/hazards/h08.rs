//! H08: a bad model. Staged validation refuses it; a model that turns out bad is rolled back.

use std::fs::{self, Permissions};
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use i2ris::ipc::client::{Client, ClientError};
use i2ris::ipc::payload::{ModelReply, ModelSlot, unpadded_text};
use i2ris::ipc::{OperatingState, Refusal};
use i2ris::model::ModelId;
use i2ris::units::Nanos;

use crate::live::{SetAtEnd, largest_step, linear_model, stream_angles};
use crate::rig::{Rig, settle};

fn with_model() -> Rig {
    let mut rig = Rig::new();
    linear_model(&rig, "model.json", "rig", 1.0);
    rig.config.control.model = Some("model.json".into());
    rig
}

fn refusal(outcome: Result<ModelReply, ClientError>) -> (Refusal, String) {
    match outcome {
        Err(ClientError::ModelRefused {
            refusal, message, ..
        }) => (refusal, message),
        other => panic!("{other:?}"),
    }
}

#[test]
fn h08_bad_models_are_refused_with_the_reason_and_the_one_in_use_stays() {
    let mut rig = with_model();
    rig.start_controller();
    let mut client = rig.client();
    settle(&mut client, |_| true);
    let before = client.models().unwrap().slots;
    let broken = rig.folder.path().join("broken.json");
    fs::write(&broken, "{\"format\": \"i2ris-model\", ").unwrap();
    let open = linear_model(&rig, "open.json", "rig", 1.1);
    fs::set_permissions(&open, Permissions::from_mode(0o666)).unwrap();
    for (file, reason) in [
        (rig.folder.path().join("absent.json"), "cannot read"),
        (broken, "EOF"),
        (
            linear_model(&rig, "other.json", "elsewhere", 1.0),
            "robot `elsewhere`",
        ),
        (
            linear_model(&rig, "flat.json", "rig", 0.0),
            "must move an output",
        ),
        (open, "chmod o-w"),
    ] {
        let (refused, message) = refusal(client.stage_model(&file));
        assert!(
            refused == Refusal::BadModel && message.contains(reason),
            "{message}"
        );
    }
    assert_eq!(
        refusal(client.activate_model(ModelId([7; 32]), true)).0,
        Refusal::NothingStaged
    );
    assert_eq!(refusal(client.roll_back_model(true)).0, Refusal::NoFormer);
    assert_eq!(client.models().unwrap().slots, before);
}

#[test]
fn h08_a_model_takes_over_while_the_snake_moves_and_is_rolled_back() {
    let mut rig = with_model();
    let second = linear_model(&rig, "second.json", "rig", 1.3);
    let client = rig.enabled();
    let mut operator = Client::connect(&rig.domain(), Nanos::from_millis(5000)).unwrap();
    let done = AtomicBool::new(false);
    let goal = |t: f64| {
        (!done.load(Ordering::Relaxed)).then(|| [6.0 * (2.0 * t).sin(), 4.0 * (1.3 * t).sin()])
    };
    let (largest, pairs) = std::thread::scope(|scope| {
        let watch = scope.spawn(|| largest_step(&client, &done));
        scope.spawn(|| stream_angles(&client, goal));
        let end = SetAtEnd(&done);
        (0..5).for_each(|_| there_and_back(&mut operator, &second));
        drop(end);
        watch.join().unwrap()
    });
    let state = settle(&mut operator, |_| true);
    assert_eq!(
        state.state,
        OperatingState::Enabled.number(),
        "{}",
        rig.said("controller")
    );
    assert!(rig.said("controller").contains("took over from"));
    let limit = rig.config.limits.velocity_counts_s * rig.config.control.period().as_seconds();
    assert!(
        pairs > 100 && f64::from(largest) <= limit + 1.0,
        "{largest} counts in one of {pairs} ticks"
    );
}

/// Another model, and the former one again.
fn there_and_back(operator: &mut Client, second: &Path) {
    let reply = operator.stage_model(second).unwrap();
    let [active, staged, _] = reply.slots;
    assert_eq!(
        (
            active.flags & ModelSlot::PRESENT,
            unpadded_text(&staged.family)
        ),
        (ModelSlot::PRESENT, "linear".to_owned())
    );
    assert!(
        reply.difference.valid == 1 && reply.difference.unreached == 0.0,
        "{:?}",
        reply.difference
    );
    // 1.3 times the angle: what took 1000 counts takes 769.
    let [first, other] = reply.difference.largest_counts;
    assert!(
        (first.abs().max(other.abs()) - 231.0).abs() < 1.0,
        "{:?}",
        reply.difference
    );
    let reply = operator
        .activate_model(ModelId(staged.model_id), false)
        .unwrap();
    assert_eq!(
        (reply.slots[0].model_id, reply.slots[2].model_id),
        (staged.model_id, active.model_id)
    );
    assert_eq!(operator.version().unwrap().model_id, staged.model_id);
    i2ris::clock::sleep(Nanos::from_millis(200));
    let reply = operator.roll_back_model(false).unwrap();
    assert_eq!(
        (reply.slots[0].model_id, reply.slots[2].model_id),
        (active.model_id, staged.model_id)
    );
    i2ris::clock::sleep(Nanos::from_millis(200));
}
