//! Adaptation in simulated time, on snakes whose physics share no code with the models.

mod camera;
mod fitted;
pub mod random;
mod trial;
mod wear;

mod campaign;
mod fences;
