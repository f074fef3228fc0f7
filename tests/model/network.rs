//! Networks that were trained elsewhere.

use i2ris::model::network::{Layer, NetworkParameters};

use super::*;

const STEP: f64 = 10.0;

fn some_files() -> Vec<(&'static str, ModelFile)> {
    let relu = conv(Activation::Relu);
    let two = vec![gru(6), gru_of(6, 4), averages(4)];
    vec![
        ("gru", network_file(vec![gru(6), averages(6)])),
        ("lstm", network_file(vec![lstm(6), averages(6)])),
        ("conv", network_file(vec![conv(Activation::Tanh), averages(3)])),
        ("conv, relu", network_file(vec![relu, averages(3)])),
        ("two layers", network_file(two)),
    ]
}

/// Two motors that wander, a step of the network at a time.
fn steps() -> Vec<MotorVec> {
    let mut at = [0.0_f64; 2];
    let step = |k: i32| {
        let t = f64::from(k) * 0.02;
        let to = [(1.3 * t).sin() * 700.0, (0.9 * t + 1.0).sin() * 600.0];
        let [x, y] = [to[0] - at[0], to[1] - at[1]];
        let part = STEP / x.abs().max(y.abs());
        at = [at[0] + part * x, at[1] + part * y];
        at
    };
    (0..900).map(step).collect()
}

fn product(rows: &[Vec<f64>], input: &[f64]) -> Vec<f64> {
    rows.iter().map(|row| row.iter().zip(input).map(|(w, x)| w * x).sum()).collect()
}

fn activate(activation: Activation, x: f64) -> f64 {
    match activation {
        Activation::None => x,
        Activation::Tanh => x.tanh(),
        Activation::Relu => x.max(0.0),
        Activation::Sigmoid => sigmoid(x),
        Activation::Softplus => x.exp().ln_1p(),
    }
}

fn sigmoid(x: f64) -> f64 {
    1.0 / (1.0 + (-x).exp())
}

/// The formulas of PyTorch's documentation over a whole sequence.
fn layer(layer: &Layer, inputs: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let gates = |gates: usize, wx: Vec<f64>, wh: Vec<f64>| -> Vec<Vec<[f64; 2]>> {
        let pairs: Vec<[f64; 2]> = wx.into_iter().zip(wh).map(|(x, h)| [x, h]).collect();
        pairs.chunks(pairs.len() / gates).map(<[_]>::to_vec).collect()
    };
    let plus = |values: Vec<f64>, bias: &[f64]| -> Vec<f64> {
        values.iter().zip(bias).map(|(value, bias)| value + bias).collect()
    };
    match layer {
        Layer::Dense { weight, bias, activation } => {
            let sums = inputs.iter().map(|input| plus(product(weight, input), bias));
            sums.map(|sums| sums.into_iter().map(|x| activate(*activation, x)).collect()).collect()
        }
        Layer::Gru { input_weight, recurrent_weight, input_bias, recurrent_bias } => {
            let mut hidden = vec![0.0; input_bias.len() / 3];
            let step = |input: &Vec<f64>| {
                let wx = plus(product(input_weight, input), input_bias);
                let gates = gates(3, wx, plus(product(recurrent_weight, &hidden), recurrent_bias));
                for (unit, hidden) in hidden.iter_mut().enumerate() {
                    let sum = |gate: usize| sigmoid(gates[gate][unit].iter().sum());
                    let (reset, update) = (sum(0), sum(1));
                    let new = (gates[2][unit][0] + reset * gates[2][unit][1]).tanh();
                    *hidden = (1.0 - update) * new + update * *hidden;
                }
                hidden.clone()
            };
            inputs.iter().map(step).collect()
        }
        Layer::Lstm { input_weight, recurrent_weight, input_bias, recurrent_bias } => {
            let mut hidden = vec![0.0; input_bias.len() / 4];
            let mut cells = hidden.clone();
            let step = |input: &Vec<f64>| {
                let wx = plus(product(input_weight, input), input_bias);
                let gates = gates(4, wx, plus(product(recurrent_weight, &hidden), recurrent_bias));
                for unit in 0..hidden.len() {
                    let sum = |gate: usize| gates[gate][unit].iter().sum::<f64>();
                    cells[unit] = sigmoid(sum(1)) * cells[unit] + sigmoid(sum(0)) * sum(2).tanh();
                    hidden[unit] = sigmoid(sum(3)) * cells[unit].tanh();
                }
                hidden.clone()
            };
            inputs.iter().map(step).collect()
        }
        Layer::Conv { taps, bias, dilation, activation } => {
            let at = |now: usize| {
                let mut sums = bias.clone();
                for (tap, rows) in taps.iter().enumerate() {
                    let back = (taps.len() - 1 - tap) * dilation;
                    if back <= now {
                        sums = plus(sums, &product(rows, &inputs[now - back]));
                    }
                }
                sums.into_iter().map(|x| activate(*activation, x)).collect()
            };
            (0..inputs.len()).map(at).collect()
        }
    }
}

/// The outputs of a whole sequence, deg.
fn expected(network: &NetworkParameters, path: &[MotorVec]) -> Vec<Vec<f64>> {
    let scaled = |counts: &MotorVec| -> Vec<f64> {
        let parts = counts.iter().zip(&network.input_centre).zip(&network.input_scale);
        parts.map(|((at, centre), scale)| (at - centre) * scale).collect()
    };
    let mut values: Vec<Vec<f64>> = path.iter().map(scaled).collect();
    let skip = |counts: &MotorVec| {
        let parts: Vec<f64> =
            counts.iter().zip(&network.input_centre).map(|(at, centre)| at - centre).collect();
        product(&network.skip_gain, &parts)
    };
    for each in &network.layers {
        values = layer(each, &values);
    }
    let output = |(value, counts): (Vec<f64>, &MotorVec)| {
        let products = product(&network.output_gain, &value);
        let sums = products.iter().zip(&network.output_offset).zip(skip(counts));
        sums.map(|((y, offset), skip)| y + offset + skip).collect()
    };
    values.into_iter().zip(path).map(output).collect()
}

#[test]
fn layers_follow_their_formulas_step_by_step() {
    let mut path = steps();
    path.insert(0, [0.0; 2]);
    for (name, file) in some_files() {
        let FamilyParameters::Network { network, .. } = &file.family else { unreachable!() };
        let expected = expected(network, &path);
        let model = Model::from_file(file.clone()).unwrap();
        let mut memory = memory_after(&model, &path[..1]);
        for (pair, expected) in path.windows(2).zip(&expected[1..]) {
            let [before, counts] = [pair[0], pair[1]];
            let found = model.predict(&counts, &memory).mean.map(|angle| angle / DEG);
            assert!(distance(&found[..2], expected) < 1e-9, "{name}: {found:?} {expected:?}");
            // A step is taken when the motors are beyond its end.
            let beyond = [0, 1].map(|motor| counts[motor] + 1e-7 * (counts[motor] - before[motor]));
            model.advance(&mut memory, &beyond);
        }
    }
}

/// Message of a refusal.
fn refused(change: impl FnOnce(&mut ModelFile, &mut NetworkParameters)) -> String {
    let mut file = network_file(vec![gru(6), averages(6)]);
    let FamilyParameters::Network { network, .. } = &file.family else { unreachable!() };
    let mut network = network.clone();
    change(&mut file, &mut network);
    if let FamilyParameters::Network { network: parameters, .. } = &mut file.family {
        *parameters = network;
    }
    let text = Model::from_file(file).unwrap_err().to_string();
    assert!(!text.contains('\n'), "{text}");
    text
}

#[test]
fn invalid_weights_are_refused_with_their_location() {
    for weight in [f64::NAN, f64::INFINITY, 1e9] {
        let text = refused(|_, network| {
            let Layer::Gru { recurrent_weight, .. } = &mut network.layers[0] else { panic!() };
            recurrent_weight[2][1] = weight;
        });
        assert!(text.contains("layers[0].recurrent_weight") && text.contains("10000"), "{text}");
        let text = refused(|_, network| network.output_gain[0][0] = weight);
        assert!(text.contains("network.output_gain"), "{text}");
    }
}

#[test]
fn sizes_that_do_not_fit_are_refused() {
    let (taps, bias) = (vec![vec![vec![0.1; 2]; 2]; 64], vec![0.0; 2]);
    let long = Layer::Conv { taps, bias, dilation: 10, activation: Activation::None };
    for (layers, part) in [
        (vec![gru(65), averages(65)], "1 to 64 units"),
        (vec![gru(6), averages(5)], "layers[1].weight"),
        (vec![gru(2); 9], "1 to 8 layers"),
        (vec![long], "at most 512 numbers"),
    ] {
        let text = refused(|_, network| network.layers = layers);
        assert!(text.contains(part), "{text}");
    }
    let text = refused(|_, network| network.input_scale = vec![0.001]);
    assert!(text.contains("input_scale"), "{text}");
}

#[test]
fn a_hidden_state_that_grows_is_refused() {
    let text = refused(|_, network| {
        let Layer::Lstm { input_weight, recurrent_weight, mut input_bias, recurrent_bias } =
            lstm(6)
        else {
            panic!()
        };
        // The state forgets nothing and grows at every step.
        input_bias[6..12].fill(30.0);
        input_bias[12..18].fill(0.5);
        network.layers = vec![
            Layer::Lstm { input_weight, recurrent_weight, input_bias, recurrent_bias },
            averages(6),
        ];
    });
    assert!(text.contains("hidden state grows"), "{text}");
}

#[test]
fn radians_and_a_network_that_folds_are_refused() {
    let text = refused(|file, network| {
        let to_radians = |value: &mut f64| *value = value.to_radians();
        network.output_gain.iter_mut().flatten().for_each(to_radians);
        network.skip_gain.clear();
        if let FamilyParameters::Network { memory_counts, .. } = &mut file.family {
            memory_counts.fill(20.0);
        }
    });
    assert!(text.contains("unusable"), "{text}");
    let text = refused(|_, network| {
        network.output_gain = vec![vec![0.0; 2]; 2];
        network.skip_gain.clear();
    });
    assert!(text.contains("inverse fails") || text.contains("unusable"), "{text}");
    let text = refused(|file, _| file.outputs[0].unit = OutputUnit::Mm);
    assert!(text.contains("one unit"), "{text}");
}

#[test]
fn other_layers_and_activations_are_refused_by_name() {
    let text = serde_json::to_string(&network_file(vec![gru(2), averages(2)])).unwrap();
    for (from, to) in [("\"kind\":\"gru\"", "\"kind\":\"attention\""), ("\"none\"", "\"gelu\"")] {
        assert!(text.contains(from));
        let error = ModelFile::parse(&text.replacen(from, to, 1)).unwrap_err().to_string();
        let name = to.rsplit('"').nth(1).unwrap();
        assert!(error.contains(&format!("unknown variant `{name}`")), "{error}");
        assert!(error.contains("`gru`") || error.contains("`softplus`"), "{error}");
    }
    assert_eq!(serde_json::to_string(&ModelFile::parse(&text).unwrap()).unwrap(), text);
}
