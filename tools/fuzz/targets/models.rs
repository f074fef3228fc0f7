//! Model files: refused with a reason, or a model that answers with finite numbers or an error.
#![no_main]

use i2ris::model::file::ModelFile;
use i2ris::model::{Model, Query};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|text: &str| {
    let Ok(model) = ModelFile::parse(text).and_then(Model::from_file) else {
        return;
    };
    let memory = model.new_memory();
    let inverse = model.invert(&[0.1, -0.1, 0.0], &memory, &Query::new(model.hull().centre()));
    assert!(inverse.counts.iter().all(|counts| counts.is_finite()), "{inverse:?}");
});
