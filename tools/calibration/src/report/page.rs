//! The whole page.

use i2ris_plot::Page;

use super::data::ReportData;
use super::score::Scores;
use super::{choice, comparison, error_map, hysteresis_loops, mixture, residual_directions};
use super::{residual_times, summary, tables};

/// The report as an HTML document.
#[must_use]
pub fn html(data: &ReportData) -> String {
    let scores = Scores::new(data);
    let mut page = Page::new(&*data.title);
    summary::write(&mut page, data, &scores);
    page.section("Families side by side");
    choice::write(&mut page, data);
    comparison::write(&mut page, data, &scores);
    tables::write(&mut page, data, &scores);
    page.section("Hysteresis");
    hysteresis_loops::write(&mut page, data);
    mixture::write(&mut page, data);
    page.section("What is left over");
    residual_times::write(&mut page, data);
    residual_directions::write(&mut page, data);
    error_map::write(&mut page, data);
    page.section("Where it comes from");
    tables::provenance(&mut page, data);
    page.to_string()
}
