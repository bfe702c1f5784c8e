//! Scenes: from photographs, simulated and others, to what is on the wall. One module for a
//! matter: `cargo test -p iltm-tests --test scenes simulator` runs the tests of one.

mod closed_loop_simulated;
mod demo;
mod dense_map;
mod even_light;
mod gates;
mod hard_cases;
mod installation;
mod paper;
mod path_tracer;
mod placed_simulated;
mod poses;
mod projectors;
mod reference;
mod simulator;
mod verify_simulated;
