//! Properties of every figure and page: well-formed, self-contained, small, only finite numbers.

use crate::*;
use proptest::prelude::*;
use roxmltree::{Document, Node, ParsingOptions};

const MARKUP: &str = "<b>&\"'</b>\u{1}";
const STROKE: Stroke = Stroke::new(Color::BLUE, 1.5).dash(Dash::Dashed);

fn panel() -> Panel {
    Panel::new("", Axis::linear("x"), Axis::linear("y"))
}

/// A figure with all marks.
fn everything(points: &[[f64; 2]], name: &str) -> Figure {
    let [x, y] = points.first().copied().unwrap_or_default();
    let all = || points.to_vec();
    let numbers = Panel::new(name, Axis::linear(name), Axis::linear(name))
        .with(Mark::interval(x, y, Color::FAINT).label(name))
        .with(Mark::line(all(), STROKE).marker(Marker::Diamond).label(name))
        .with(Mark::dots(all(), Color::PALE, 2.0).label(name))
        .with(Mark::markers(all(), Color::BLACK, Marker::Cross).label(name))
        .with(Mark::horizontal(y, STROKE))
        .with(Mark::vertical(x, STROKE));
    let logs = Panel::new(name, Axis::log(name), Axis::log(name));
    let logs = logs.with(Mark::line(all(), STROKE));
    let names = Axis::names("", vec![name.to_owned()]);
    let names = Panel::new(name, Axis::linear(name).including(0.0), names);
    let names = names.with(Mark::dots(vec![[x, 0.0]], Color::SKY, 2.0).label(name));
    Figure::new(name, name, name).row(200.0, vec![numbers, logs]).row(120.0, vec![names])
}

fn page(name: &str) -> String {
    let mut page = crate::Document::new(name);
    page.section(name);
    page.main_result(name);
    page.paragraph(name);
    page.notice(name, [name.to_owned()]);
    page.figure(everything(&[[0.0, 1.0], [2.0, 3.0]], name), name);
    let mut table = Table::new(name, [name, name]);
    table.row([name, name].map(str::to_owned)).strong = true;
    page.table(table);
    page.facts([(name.to_owned(), name.to_owned())]);
    page.footer(name);
    page.html()
}

fn parse(text: &str) -> Document<'_> {
    let options = ParsingOptions { allow_dtd: true, ..Default::default() };
    Document::parse_with_options(text, options).unwrap()
}

fn elements<'a>(document: &'a Document<'a>, name: &'a str) -> impl Iterator<Item = Node<'a, 'a>> {
    document.descendants().filter(move |node| node.tag_name().name() == name)
}

/// All numbers in attributes that are lengths or coordinates.
fn numbers(document: &Document) -> Vec<f64> {
    let lengths = "x y width height points d viewBox transform";
    let lengths: Vec<&str> = lengths.split(' ').collect();
    let attributes = document.descendants().flat_map(|node| node.attributes());
    let mut numbers = Vec::new();
    for attribute in attributes.filter(|attribute| lengths.contains(&attribute.name())) {
        let is_separator = |c: char| !(c.is_ascii_digit() || c == '.' || c == '-');
        let spaced = attribute.value().replace('-', " -");
        let words = spaced.split(is_separator).filter(|word| !word.is_empty());
        numbers.extend(words.map(|word| word.parse::<f64>().unwrap()));
    }
    numbers
}

#[test]
fn page_follows_dark_mode_and_captions_fit_a_phone() {
    let mut page = crate::Document::new("a");
    let mut table = Table::new("a long caption", ["x"]);
    table.row(["y".to_owned()]);
    page.table(table);
    let text = page.html();
    assert!(text.contains("@media screen and (prefers-color-scheme: dark)"), "{text}");
    assert!(text.contains("<caption><span>a long caption</span></caption>"), "{text}");
}

#[test]
fn a_page_is_well_formed_and_keeps_every_text() {
    let text = page(MARKUP);
    let document = parse(&text);
    let expected = MARKUP.replace('\u{1}', "\u{fffd}");
    for name in ["h1", "h2", "li", "span", "td", "footer", "text", "desc"] {
        let has_text = |node: Node| node.text().is_some_and(|text| text.contains(&expected));
        assert!(elements(&document, name).any(has_text), "{name}");
    }
    assert_eq!(elements(&document, "b").count(), 0);
}

#[test]
fn a_page_loads_and_runs_nothing() {
    let text = page("plain").replace("http://www.w3.org/2000/svg", "");
    let forbidden = "http: https: // <script <link <img @import href src=";
    for part in forbidden.split(' ') {
        assert!(!text.contains(part), "{part}");
    }
    let (_, style) = text.split_once("<style>").unwrap();
    let (style, _) = style.split_once("</style>").unwrap();
    assert!(!style.contains('&'), "the style sheet must not need escaping");
}

#[test]
fn identifiers_are_unique_and_references_exist() {
    let text = page("plain");
    let document = parse(&text);
    let all = document.descendants().filter_map(|node| node.attribute("id"));
    let mut ids: Vec<_> = all.clone().collect();
    ids.sort_unstable();
    ids.dedup();
    assert_eq!(ids.len(), all.count());
    let svg = elements(&document, "svg").next().unwrap();
    assert_eq!(svg.attribute("role"), Some("img"));
    let mut labels = svg.attribute("aria-labelledby").unwrap().split(' ');
    assert!(labels.all(|id| ids.contains(&id)));
}

#[test]
fn a_figure_of_many_points_is_small() {
    let noise = |i: u32| f64::from(i.wrapping_mul(2_654_435_761) >> 16) * 1e-3;
    let points: Vec<_> = (0..100_000).map(|i| [f64::from(i) * 0.01, noise(i)]).collect();
    let cloud = panel().with(Mark::dots(points.clone(), Color::BLACK, 2.0));
    for panel in [panel().with(Mark::line(points, STROKE)), cloud] {
        let size = Figure::new("many", "", "").row(200.0, vec![panel]).to_string().len();
        assert!((5_000..60_000).contains(&size), "{size} bytes");
    }
}

#[test]
fn the_legend_has_every_label_once() {
    let line = |name: &str| Mark::line(vec![[0.0, 0.0], [1.0, 1.0]], STROKE).label(name);
    let panels = [(); 2].map(|()| panel().with(line("one")).with(line("two")));
    let text = Figure::new("legend", "", "").row(200.0, panels.into()).to_string();
    assert_eq!([">one<", ">two<"].map(|label| text.matches(label).count()), [1, 1]);
}

#[test]
fn empty_panels_are_drawn() {
    let text = everything(&[], "empty").to_string();
    let document = parse(&text);
    let titles = elements(&document, "text").filter(|node| node.text() == Some("(b) empty"));
    assert_eq!(titles.count(), 1);
}

fn special() -> impl Strategy<Value = f64> {
    let infinity = f64::INFINITY;
    let values = [f64::NAN, infinity, -infinity, 0.0, -0.0, f64::MAX, f64::MIN, 1e-320];
    prop_oneof![prop::sample::select(values.to_vec()), -5.0..5.0_f64]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn any_values_give_a_figure_of_finite_numbers(
        points in prop::collection::vec([any::<f64>(), any::<f64>()], 0..40)
    ) {
        let text = everything(&points, "any").to_string();
        let found = numbers(&parse(&text));
        prop_assert!(found.len() > 50);
        prop_assert!(found.iter().all(|number| number.is_finite()));
    }

    #[test]
    fn special_values_give_a_figure_of_finite_numbers(
        points in prop::collection::vec([special(), special()], 0..12)
    ) {
        let text = everything(&points, "special").to_string();
        prop_assert!(numbers(&parse(&text)).iter().all(|number| number.is_finite()));
        prop_assert!(!text.contains("NaN") && !text.contains("inf"));
    }
}
