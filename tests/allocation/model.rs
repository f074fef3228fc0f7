//! The methods of a model that the loop calls do not allocate, in every family.

use std::hint::black_box;

use i2ris::model::file::FamilyParameters;
use i2ris::model::network::Activation;
use i2ris::model::{Model, Query};
use i2ris_testing::families::{self, DEG, averages, balance_file, conv, gru, network_file};
use proptest::strategy::{Strategy, ValueTree};
use proptest::test_runner::TestRunner;

use crate::allocations;

/// One second of control: goals in and outside the hull, huge and NaN, with and without good start.
fn tick_for_a_second(model: &Model) {
    let mut memory = model.new_memory();
    let mut last = model.hull().centre();
    for tick in 0..1000 {
        let turn = f64::from(tick) * 0.02;
        let reach = [4.0, 12.0, 60.0, 1e300, f64::NAN][tick as usize % 5] * DEG;
        let goal = [reach * turn.cos(), reach * turn.sin(), 0.3 * reach];
        let start = if tick % 3 == 0 { [1e9, f64::NEG_INFINITY] } else { last };
        let compensation = if tick % 2 == 0 { 1.0 } else { 0.7 };
        let query = Query { compensation, ..Query::new(start) };
        let inverse = black_box(model.invert(black_box(&goal), &memory, &query));
        last = model.hull().project(&inverse.counts);
        model.advance_over(&mut memory, &last, 0.001);
        black_box((model.is_memory_known(&memory), model.correction(&memory)));
        black_box(model.predict(&last, &memory).deviation());
        black_box(model.jacobian(&last, &memory));
        let is_inside = model.hull().contains(&[goal[0], goal[1]]);
        black_box((is_inside, model.motors(), model.outputs(), model.id()));
    }
}

#[test]
fn a_tick_with_a_model_allocates_nothing() {
    let mut runner = TestRunner::deterministic();
    let layers = [vec![gru(64), averages(64)], vec![conv(Activation::Softplus), averages(3)]];
    let mut models: Vec<_> =
        layers.map(|layers| Model::from_file(network_file(layers)).unwrap()).into();
    let mut creeping = balance_file(2);
    if let FamilyParameters::ForceBalance { balance, .. } = &mut creeping.family {
        balance.creep = [0.04, 0.02, 0.03];
    }
    models.push(Model::from_file(creeping).unwrap());
    for family in families::all() {
        models.push(Model::from_file(family.file).unwrap());
        for (motors, outputs) in family.sizes.repeat(6) {
            let random = (family.random)(motors, outputs);
            let file = random.new_tree(&mut runner).unwrap().current();
            // A random model may be refused.
            models.extend(Model::from_file(file));
        }
    }
    assert!(models.len() > 100, "{}", models.len());
    for model in &models {
        assert_eq!(allocations(|| tick_for_a_second(model)), 0, "{:?}", model.file().family);
    }
    // This checks that the counter works.
    assert!(allocations(|| drop(black_box(vec![0_u8; 64]))) >= 2);
}
