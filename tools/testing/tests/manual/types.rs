//! The Python of package, examples and manual against `mypy --strict`: a notebook or an editor shows
//! its types.

use std::fs;

use i2ris_testing::python;

use super::markdown::Document;

#[test]
fn python_of_package_examples_and_manual_has_strict_types() {
    let Some(mut python) = python("mypy, numpy, iceoryx2") else { return };
    let folder = tempfile::tempdir().unwrap();
    let mut listings = Vec::new();
    for document in Document::all() {
        let text = fs::read_to_string(&document.path).unwrap();
        for part in text.split("```python\n").skip(1) {
            let file = folder.path().join(format!("listing_{}.py", listings.len()));
            fs::write(&file, part.split("```").next().unwrap()).unwrap();
            listings.push(file);
        }
    }
    assert!(listings.len() >= 3, "{listings:?}");
    python.args(["-m", "mypy", "--strict", "--cache-dir"]).arg(folder.path().join("cache"));
    let output = python.args(["i2ris", "examples"]).args(&listings);
    let output = output.env("MYPYPATH", "examples").output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stdout));
}
