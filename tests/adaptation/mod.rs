//! Adaptation in simulated time, on snakes whose physics share no code with the models.

mod camera;
mod fitted;
mod hazards;
pub mod random;
mod trial;
mod wear;

mod campaign;
mod fences;

/// Not the linear one: without memory a different method learns, which the other tests cover.
#[test]
fn the_fitted_family_flies_too() {
    i2ris_testing::cycle::with_family("force-balance-fitted", &["adaptation::hazards::"]);
}
