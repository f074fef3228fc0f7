//! The drive layer on a simulated line, in simulated time: the link, bring-up, the port thread and
//! its axes.

mod bring_up;
mod capture;
mod every_frame;
mod gateway_stop;
mod link;
mod runner;
