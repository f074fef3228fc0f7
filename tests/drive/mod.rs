//! The drive layer on a simulated line, in simulated time: link, bring-up, port thread and axes.

mod bring_up;
mod capture;
mod every_frame;
mod gateway_stop;
mod link;
mod runner;
