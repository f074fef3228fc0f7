//! The bill of materials: CycloneDX 1.5, without a date, so that the same lock file gives the same
//! file.

use serde_json::{Value, json};

use super::packages::{Class, Package, classes, packages};
use super::{SAFETY, require_up_to_date};

fn reference(package: &Package) -> String {
    format!("pkg:cargo/{}@{}", package.name, package.version)
}

fn component(package: &Package, class: Class) -> Value {
    let mut component = json!({
        "type": if package.is_own { "application" } else { "library" },
        "bom-ref": reference(package),
        "name": package.name,
        "version": package.version,
        "description": package.description,
        "scope": if class == Class::Tool { "excluded" } else { "required" },
        "licenses": [{ "expression": package.licence.replace('/', " OR ") }],
        "purl": reference(package),
        "properties": [{ "name": "i2ris:safety-class", "value": class.text() }],
    });
    if let Some(checksum) = &package.checksum {
        component["hashes"] = json!([{ "alg": "SHA-256", "content": checksum }]);
    }
    component
}

fn dependencies(packages: &[Package], package: &Package) -> Value {
    let used: Vec<String> = package
        .uses
        .union(&package.builds_with)
        .map(|index| reference(&packages[*index]))
        .collect();
    json!({ "ref": reference(package), "dependsOn": used })
}

/// One component per line, so that a change can be read.
fn bill() -> String {
    let packages = packages();
    let classes = classes(&packages);
    let main = packages.iter().position(|package| package.name == "i2ris").unwrap();
    let lines = |values: Vec<Value>| {
        let lines: Vec<String> = values.iter().map(|value| format!("    {value}")).collect();
        lines.join(",\n")
    };
    let components = (0..packages.len())
        .filter(|index| *index != main)
        .map(|index| component(&packages[index], classes[index]));
    let edges = packages.iter().map(|package| dependencies(&packages, package));
    format!(
        "{{\n  \"bomFormat\": \"CycloneDX\",\n  \"specVersion\": \"1.5\",\n  \"version\": 1,\n  \
         \"metadata\": {{ \"component\": {} }},\n  \"components\": [\n{}\n  ],\n  \
         \"dependencies\": [\n{}\n  ]\n}}\n",
        component(&packages[main], classes[main]),
        lines(components.collect()),
        lines(edges.collect())
    )
}

#[test]
fn the_bill_of_third_party_software_is_up_to_date() {
    require_up_to_date(&format!("{SAFETY}/sbom.cdx.json"), &bill());
}

#[test]
fn the_bill_is_complete_and_the_same_every_time() {
    let (text, packages) = (bill(), packages());
    assert_eq!(text, bill());
    let bill: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(bill["components"].as_array().unwrap().len(), packages.len() - 1);
    let edges = bill["dependencies"].as_array().unwrap();
    assert_eq!(edges.len(), packages.len());
    for component in bill["components"].as_array().unwrap() {
        let is_library = component["type"] == "library";
        assert_eq!(component["hashes"].is_array(), is_library, "{component}");
    }
}
