//! What every figure and page promises: well-formed, self-contained, small, no number that is none.
#![allow(clippy::unwrap_used)]

use i2ris_plot::mark::Five;
use i2ris_plot::page::TableRow;
use i2ris_plot::*;
use proptest::prelude::*;

const NASTY: &str = "<b>&\"'</b>\u{1}";

fn stroke() -> Stroke {
    Stroke::new(Ink::BLUE, 1.5).dash(Dash::Dashed)
}

/// A figure with one of everything.
fn everything(points: &[[f64; 2]], name: &str) -> Figure {
    let band = points.iter().map(|[x, y]| [*x, y - 1.0, y + 1.0]).collect();
    let first = points.first().copied().unwrap_or_default();
    let five = Five {
        whiskers: first,
        quartiles: first,
        median: first[0],
    };
    let cells = points.iter().map(|point| (*point, point[1])).collect();
    let labels = ["1", "2", "3", "4", "5"].map(str::to_owned);
    let numbers = Panel::new(name, Axis::linear(name), Axis::linear(name))
        .with(Shade::new(first[0], first[1], Ink::FAINT).label(name))
        .with(Cells::new(cells, [1.0, 1.0], [0.0, 1.0, 2.0, 3.0], labels))
        .with(Band::new(band, Ink::SKY).label(name))
        .with(
            Line::new(points.to_vec(), stroke())
                .marker(Marker::Diamond)
                .label(name),
        )
        .with(Dots::new(points.to_vec(), Ink::PALE, 2.0).label(name))
        .with(Dots::markers(points.to_vec(), Ink::BLACK, Marker::Cross).label(name))
        .with(Ellipse::new(first, [[1.0, first[1]], [first[1], 2.0]], 2.0, stroke()).label(name))
        .with(Rule::level(first[1], stroke()))
        .with(Rule::upright(first[0], stroke()));
    let logs = Panel::new(name, Axis::log(name), Axis::log(name))
        .with(Line::new(points.to_vec(), stroke()))
        .equal();
    let names = Panel::new(
        name,
        Axis::linear(name).including(0.0),
        Axis::names("", vec![name.to_owned()]),
    )
    .with(Boxes::new(vec![(0.0, five)], Ink::SKY, 0.5).label(name));
    Figure::new(name, name, name)
        .row(200.0, vec![numbers, logs])
        .row(120.0, vec![names])
}

fn page(name: &str) -> String {
    let mut page = Page::new(name);
    page.section(name);
    page.lead(name);
    page.paragraph(name);
    page.notice(name, [name.to_owned()]);
    page.figure(&everything(&[[0.0, 1.0], [2.0, 3.0]], name), name);
    let mut table = Table::new(name, [name, name]);
    table.row(TableRow {
        cells: vec![name.to_owned(); 2],
        strong: true,
        rule: true,
    });
    page.table(&table);
    page.facts([(name.to_owned(), name.to_owned())]);
    page.footer(name);
    page.to_string()
}

fn parse(text: &str) -> roxmltree::Document<'_> {
    let options = roxmltree::ParsingOptions {
        allow_dtd: true,
        ..Default::default()
    };
    roxmltree::Document::parse_with_options(text, options).unwrap()
}

/// All numbers of attributes that hold places and lengths.
fn numbers(document: &roxmltree::Document) -> Vec<f64> {
    let places = [
        "x",
        "y",
        "x1",
        "x2",
        "y1",
        "y2",
        "cx",
        "cy",
        "r",
        "width",
        "height",
        "d",
        "viewBox",
        "transform",
    ];
    let attributes = document
        .descendants()
        .flat_map(|node| node.attributes())
        .filter(|a| places.contains(&a.name()));
    let apart = |c: char| !(c.is_ascii_digit() || c == '.' || c == '-');
    let spaced = |text: &str| text.replace('-', " -");
    let words: Vec<String> = attributes
        .flat_map(|a| {
            spaced(a.value())
                .split(apart)
                .map(str::to_owned)
                .collect::<Vec<_>>()
        })
        .collect();
    words
        .iter()
        .filter(|word| !word.is_empty())
        .map(|word| word.parse().unwrap())
        .collect()
}

#[test]
fn a_page_is_well_formed_and_keeps_every_text() {
    let text = page(NASTY);
    let document = parse(&text);
    let said = NASTY.replace('\u{1}', "\u{fffd}");
    for name in ["h1", "h2", "li", "caption", "td", "footer", "text", "desc"] {
        let all: Vec<_> = document
            .descendants()
            .filter(|node| node.tag_name().name() == name)
            .collect();
        assert!(
            all.iter()
                .any(|node| node.text().is_some_and(|text| text.contains(&said))),
            "{name}"
        );
    }
    assert!(
        document
            .descendants()
            .all(|node| node.tag_name().name() != "b")
    );
}

#[test]
fn a_page_loads_nothing_and_runs_nothing() {
    let text = page("plain").replace("http://www.w3.org/2000/svg", "");
    for part in [
        "http:", "https:", "//", "<script", "<link", "<img", "@import", "href", "src=",
    ] {
        assert!(!text.contains(part), "{part}");
    }
    // Clips are found on the page itself.
    assert!(text.contains("url(#f-plain-c0-0)"));
    let (start, end) = (
        text.find("<style>").unwrap(),
        text.find("</style>").unwrap(),
    );
    assert!(
        !text[start..end].contains("&"),
        "the look must stand as it is"
    );
}

#[test]
fn identifiers_are_unique_and_references_lead_somewhere() {
    let text = page("plain");
    let document = parse(&text);
    let mut ids: Vec<_> = document
        .descendants()
        .filter_map(|node| node.attribute("id"))
        .collect();
    let all = ids.len();
    ids.sort_unstable();
    ids.dedup();
    assert_eq!(ids.len(), all);
    let svg = document
        .descendants()
        .find(|node| node.tag_name().name() == "svg")
        .unwrap();
    assert_eq!(svg.attribute("role"), Some("img"));
    assert!(
        svg.attribute("aria-labelledby")
            .unwrap()
            .split(' ')
            .all(|id| ids.contains(&id))
    );
}

#[test]
fn a_figure_of_many_points_stays_small() {
    let noise = |i: u32| f64::from(i.wrapping_mul(2_654_435_761) >> 16) * 1e-3;
    let points: Vec<_> = (0..100_000_u32)
        .map(|i| [f64::from(i) * 0.01, noise(i)])
        .collect();
    let panel = |mark: Line| Panel::new("", Axis::linear("x"), Axis::linear("y")).with(mark);
    let line =
        Figure::new("line", "", "").row(200.0, vec![panel(Line::new(points.clone(), stroke()))]);
    let cloud = Panel::new("", Axis::linear("x"), Axis::linear("y")).with(Dots::new(
        points,
        Ink::BLACK,
        2.0,
    ));
    let cloud = Figure::new("cloud", "", "").row(200.0, vec![cloud]);
    for figure in [line, cloud] {
        let size = figure.to_string().len();
        assert!(
            (5_000..60_000).contains(&size),
            "{}: {size} bytes",
            figure.element()
        );
    }
}

#[test]
fn the_legend_names_everything_once() {
    let line = |name: &str| Line::new(vec![[0.0, 0.0], [1.0, 1.0]], stroke()).label(name);
    let panel = || {
        Panel::new("", Axis::linear("x"), Axis::linear("y"))
            .with(line("one"))
            .with(line("two"))
    };
    let text = Figure::new("legend", "", "")
        .row(200.0, vec![panel(), panel()])
        .to_string();
    assert_eq!(text.matches(">one<").count(), 1);
    assert_eq!(text.matches(">two<").count(), 1);
}

#[test]
fn no_word_of_the_legend_leaves_the_figure() {
    let names = (0..12).map(|i| format!("entry {i} {}", "m".repeat(i)));
    let lines = names.map(|name| Line::new(vec![[0.0, 0.0], [1.0, 1.0]], stroke()).label(name));
    let panel = Panel::new("", Axis::linear("x"), Axis::linear("y")).with_all(lines);
    let text = Figure::new("legend", "", "")
        .row(200.0, vec![panel])
        .to_string();
    let document = parse(&text);
    let words = document
        .descendants()
        .filter(|node| node.text().is_some_and(|text| text.starts_with("entry")));
    let words = words.filter(|node| node.tag_name().name() == "text");
    let ends: Vec<f64> = words
        .map(|node| {
            node.attribute("x").unwrap().parse::<f64>().unwrap() + text::width(node.text().unwrap())
        })
        .collect();
    assert!(
        ends.len() == 12 && ends.iter().all(|end| *end <= figure::WIDTH),
        "{ends:?}"
    );
}

#[test]
fn what_lies_outside_is_cut_off_and_empty_panels_are_drawn() {
    let text = everything(&[], "empty").to_string();
    parse(&text);
    assert_eq!(text.matches("<clipPath").count(), 3);
    assert_eq!(text.matches("clip-path=").count(), 3);
}

fn special() -> impl Strategy<Value = f64> {
    let values = [
        f64::NAN,
        f64::INFINITY,
        f64::NEG_INFINITY,
        0.0,
        -0.0,
        f64::MAX,
        f64::MIN,
        1e-320,
    ];
    prop_oneof![prop::sample::select(values.to_vec()), -5.0..5.0_f64]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Whatever the numbers, the figure is well-formed, and every number in it is one.
    #[test]
    fn any_numbers_make_a_figure(points in prop::collection::vec([any::<f64>(), any::<f64>()], 0..40)) {
        let text = everything(&points, "any").to_string();
        let found = numbers(&parse(&text));
        prop_assert!(found.len() > 50);
        prop_assert!(found.iter().all(|number| number.is_finite()));
    }

    /// Special values, one after the other: gaps, not nonsense.
    #[test]
    fn special_numbers_make_a_figure(points in prop::collection::vec([special(), special()], 0..12)) {
        let text = everything(&points, "special").to_string();
        prop_assert!(numbers(&parse(&text)).iter().all(|number| number.is_finite()));
        prop_assert!(!text.contains("NaN") && !text.contains("inf"));
    }
}
