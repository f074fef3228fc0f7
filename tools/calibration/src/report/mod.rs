//! The report of a fit: one HTML file with figures and tables that needs nothing but itself.
//!
//! Everything in it comes from [`ReportData`], plain numbers and words, so a report can be made of
//! any models on any recording. [`gather`] makes that of models and a recording, with the code that
//! the controller runs, and [`of_fit`] of a whole fit.
//!
//! # Words
//!
//! - **straight line** of an output: the affine least-squares fit of it to the counts.
//! - **counts along** an output: the counts projected on the direction in which its straight line
//!   is steepest. With two motors that both move an output, this is the one axis on which a loop
//!   shows.
//! - **rising, falling**: the counts along an output were last seen going up, going down.
//! - **branches**: what a model says on a full stroke back and forth through the middle of the
//!   calibrated region, after strokes that wipe out what it remembered before.
//!
//! | file | holds |
//! |---|---|
//! | `data` | what goes in |
//! | `gather`, `stroke` | making that of models and a recording |
//! | `outcome` | making that of a whole fit |
//! | `score` | the figures of merit of each family |
//! | `summary` | the findings in words |
//! | `tables`, `comparison` | families side by side |
//! | `loops`, `read_out`, `residuals`, `directions`, `map` | the figures |
//! | `words` | numbers and names as all of these write them |

mod comparison;
mod data;
mod directions;
mod gather;
mod loops;
mod map;
mod outcome;
mod read_out;
mod residuals;
mod score;
mod stroke;
mod summary;
mod tables;
#[cfg(test)]
mod tests;
mod words;

pub use data::{
    Branches, Component, FamilyResult, OutputFacts, ReadOutView, RecordingFacts, ReportData,
    SectionPoint, Straight, Track,
};
pub use gather::{FamilyFit, gather};
pub use outcome::of_fit;

use i2ris_plot::Page;

use score::Scores;

/// The report as an HTML document.
#[must_use]
pub fn html(data: &ReportData) -> String {
    let scores = Scores::new(data);
    let mut page = Page::new(&*data.title);
    summary::write(&mut page, data, &scores);
    page.section("Families side by side");
    comparison::write(&mut page, data, &scores);
    tables::write(&mut page, data, &scores);
    page.section("Hysteresis");
    loops::write(&mut page, data);
    read_out::write(&mut page, data);
    page.section("What is left over");
    residuals::write(&mut page, data);
    directions::write(&mut page, data);
    map::write(&mut page, data);
    page.section("Where it comes from");
    tables::provenance(&mut page, data);
    page.to_string()
}
