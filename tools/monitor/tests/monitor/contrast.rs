//! The colours of the page by WCAG 2.2: contrast of 4.5 for text (1.4.3 AA), 3 for curves, marks
//! and borders of controls (1.4.11 AA), in both themes.

use std::collections::BTreeMap;

const CSS: &str = include_str!("../../src/web/page/colours.css");
const GROUNDS: [&str; 2] = ["panel", "ground"];
const TEXTS: [&str; 12] = [
    "text", "faint", "goal", "setpoint", "estimate", "camera", "hull", "error", "caution", "alarm",
    "old", "target",
];
const FILLS: [&str; 4] = ["good", "wait", "off", "bad"];

type Colours = BTreeMap<String, [f64; 3]>;

/// The colours of a block of the style sheet, after those of `base`.
fn colours(block: &str, base: Colours) -> Colours {
    let mut found = base;
    for declaration in block.split(';') {
        if let Some((name, value)) = declaration.split_once(':')
            && let Some(name) = name.trim().strip_prefix("--")
            && let Some(digits) = value.trim().strip_prefix('#')
            && digits.len() == 6
        {
            let channel = |at: usize| u8::from_str_radix(&digits[at..at + 2], 16).unwrap();
            let rgb = [0, 2, 4].map(|at| f64::from(channel(at)) / 255.0);
            found.insert(name.to_owned(), rgb);
        }
    }
    found
}

fn themes() -> [(&'static str, Colours); 2] {
    let blocks: Vec<&str> = CSS.split('{').skip(1).collect();
    let [dark, light] = blocks[..] else {
        panic!("two blocks: dark and light");
    };
    let dark = colours(dark.split('}').next().unwrap(), Colours::new());
    let light = colours(light.split('}').next().unwrap(), dark.clone());
    [("dark", dark), ("light", light)]
}

/// Relative luminance (WCAG 2.2, definitions).
fn luminance(rgb: [f64; 3]) -> f64 {
    let linear = rgb.map(|channel| {
        if channel <= 0.04045 { channel / 12.92 } else { ((channel + 0.055) / 1.055).powf(2.4) }
    });
    0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]
}

fn contrast(a: [f64; 3], b: [f64; 3]) -> f64 {
    let (a, b) = (luminance(a), luminance(b));
    (a.max(b) + 0.05) / (a.min(b) + 0.05)
}

/// CIE L*a*b* of a colour under D65.
fn lab(rgb: [f64; 3]) -> [f64; 3] {
    let linear = |it: f64| {
        if it <= 0.04045 { it / 12.92 } else { ((it + 0.055) / 1.055).powf(2.4) }
    };
    let [r, g, b] = rgb.map(linear);
    let cube = |t: f64| if t > 0.008_856 { t.cbrt() } else { 7.787 * t + 16.0 / 116.0 };
    let x = cube((0.4124 * r + 0.3576 * g + 0.1805 * b) / 0.950_47);
    let y = cube(0.2126 * r + 0.7152 * g + 0.0722 * b);
    let z = cube((0.0193 * r + 0.1192 * g + 0.9505 * b) / 1.088_83);
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

/// A person tells two colours apart at a glance from a distance of about 30 on.
#[test]
fn no_two_curves_look_alike_in_either_theme() {
    for (theme, colours) in themes() {
        let names = ["goal", "setpoint", "estimate", "camera", "error", "alarm"];
        for (place, a) in names.iter().enumerate() {
            for b in &names[place + 1..] {
                let pairs = lab(colours[*a]).into_iter().zip(lab(colours[*b]));
                let distance = pairs.map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
                assert!(distance > 30.0, "{theme}: {a} and {b} are {distance:.1} apart");
            }
        }
    }
}

#[test]
fn the_formula_gives_the_published_values() {
    let (black, white) = ([0.0; 3], [1.0; 3]);
    assert!((contrast(black, white) - 21.0).abs() < 1e-9);
    let grey = [f64::from(0x76_u8) / 255.0; 3];
    assert!((contrast(grey, white) - 4.54).abs() < 0.01);
}

#[test]
fn every_text_and_every_curve_has_enough_contrast_in_both_themes() {
    let mut weak = Vec::new();
    let mut check = |theme: &str, colours: &Colours, front: &str, back: &str, least: f64| {
        let ratio = contrast(colours[front], colours[back]);
        if ratio < least {
            weak.push(format!("{theme}: {front} on {back} {ratio:.2}, at least {least}"));
        }
    };
    for (theme, colours) in &themes() {
        for ground in GROUNDS {
            for text in TEXTS {
                check(theme, colours, text, ground, 4.5);
            }
            check(theme, colours, "edge", ground, 3.0);
        }
        for fill in FILLS {
            check(theme, colours, "on-fill", fill, 4.5);
            check(theme, colours, fill, "panel", 1.0);
        }
    }
    assert!(weak.is_empty(), "{weak:#?}");
}

#[test]
fn no_colour_stands_outside_of_the_tested_list() {
    let pages = [
        include_str!("../../src/web/page/page.css"),
        include_str!("../../src/web/page/operator.css"),
        include_str!("../../src/web/page/plots.js"),
        include_str!("../../src/web/page/strips.js"),
        include_str!("../../src/web/page/snake.js"),
    ];
    for page in pages {
        let literal = page.split('#').skip(1).find(|rest| {
            let digits = rest.chars().take_while(char::is_ascii_hexdigit).count();
            let ends = rest.chars().nth(digits).is_none_or(|c| !c.is_alphanumeric() && c != '-');
            matches!(digits, 3 | 6 | 8) && ends
        });
        assert_eq!(literal.map(|it| &it[..it.len().min(20)]), None);
    }
}
