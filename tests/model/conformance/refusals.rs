//! Invalid parameters are refused, in one sentence that names them.

use toml::Value;

use super::*;

/// Family, parameter path, its value, and message. `*3` means three copies of the first list entry.
const BAD: [(&str, &str, &str, &str); 22] = [
    ("linear", "gain", "[[0.02, 0.01]]", "family.gain = rows of [2] numbers"),
    ("linear", "gain", "[[0.0, 0.0], [0.0, 0.0]]", "a motor must move"),
    ("linear", "offset", "[0.0, 1.0, 2.0]", "family.offset = 3 numbers"),
    ("linear", "covariance.0.0", "-0.25", "family.covariance[0][0] = -0.25"),
    ("linear", "covariance", "[[1.0, 2.0], [2.0, 1.0]]", "eigen"),
    ("gmr", "mixture.weights.0", "0.3", "weights = sum 0.3"),
    ("gmr", "mixture.weights", "*65", "65 components"),
    ("gmr_play", "plays.thresholds_counts.0.0", "1.0", "family.plays"),
    ("gmr_play", "plays.thresholds_counts.1.2", "20.0", "family.plays"),
    ("gmr_play", "plays.weights.0", "[0.0, 0.3, 0.7]", "family.plays"),
    ("gmr_play", "plays.weights.0", "[0.4, 0.3, 0.4]", "family.plays"),
    ("gmr_play", "plays.weights", "*1", "one row per motor"),
    ("gmr_play", "plays.planar_thresholds_counts", "[9.0, 8.0]", "must rise from above 0"),
    ("force_balance", "balance.motors", "*1", "motors"),
    ("force_balance", "balance.motors.1.gap", "-1.0", "gap"),
    ("force_balance", "balance.motors.0.spring", "0.0", "spring"),
    ("force_balance", "balance.motors.0.coupling", "20.0", "coupling"),
    ("force_balance", "balance.own_stops", "[]", "own_stops"),
    ("force_balance", "balance.softness", "0.0", "softness"),
    ("force_balance", "balance.friction_stays", "1.1", "friction_stays"),
    ("network", "network.step_counts", "0.0", "step_counts"),
    ("network", "network.layers", "*1", "one unit per output"),
];

/// Message of the refusal of a file with one parameter changed.
fn refusal(file: &Value, path: &str, change: impl FnOnce(&mut Value)) -> String {
    let mut file = file.clone();
    let place = path.split('.').fold(&mut file["family"], |value, key| match key.parse() {
        Ok::<usize, _>(index) => &mut value[index],
        Err(_) => &mut value[key],
    });
    change(place);
    let file: ModelFile = file.try_into().unwrap();
    let text = Model::from_file(file).expect_err(path).to_string();
    assert!(!text.contains('\n'), "{text}");
    text
}

pub fn parameters(sample: &Sample) {
    let file = Value::try_from(&sample.file).unwrap();
    let mut bad = BAD.iter().filter(|row| row.0 == sample.name).peekable();
    assert!(bad.peek().is_some(), "{} has no bad parameters", sample.name);
    for (_, path, value, named) in bad {
        let text = refusal(&file, path, |place| match value.strip_prefix('*') {
            Some(count) => *place = vec![place[0].clone(); count.parse().unwrap()].into(),
            None => *place = toml::from_str::<Value>(&format!("v = {value}")).unwrap()["v"].clone(),
        });
        assert!(text.contains(named), "{path} = {value}: {text}");
    }
}

/// Locations of numbers, with their names.
fn numbers_of(value: &Value, path: &str, name: &str, found: &mut Vec<[String; 2]>) {
    let below = |key: &str| if path.is_empty() { key.to_owned() } else { format!("{path}.{key}") };
    match value {
        Value::Table(table) => {
            table.iter().for_each(|(key, value)| numbers_of(value, &below(key), key, found));
        }
        Value::Array(list) => (0..).zip(list).for_each(|(index, value): (usize, _)| {
            numbers_of(value, &below(&index.to_string()), name, found);
        }),
        Value::Float(_) => found.push([path.to_owned(), name.to_owned()]),
        _ => {}
    }
}

/// Every number must be valid.
pub fn numbers(sample: &Sample) {
    let file = Value::try_from(&sample.file).unwrap();
    let mut places = Vec::new();
    numbers_of(&file["family"], "", "", &mut places);
    assert!(places.len() > 5, "{places:?}");
    for [path, name] in places {
        for number in [f64::NAN, f64::INFINITY] {
            let text = refusal(&file, &path, |place| *place = Value::Float(number));
            assert!(text.contains(&name), "{path} = {number}: {text}");
        }
    }
}
