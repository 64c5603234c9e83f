//! Reference motion and controllers.
//!
//! Parameters live in `self`, memory is passed in: a controller cannot change its own settings,
//! and one set of settings serves any number of runs. Speeds are in rev/s here; rpm belongs to
//! files and screens.
#![cfg_attr(not(test), no_std)]
// what runs in the control cycle cannot panic
#![deny(
    clippy::disallowed_methods,
    clippy::expect_used,
    clippy::panic,
    clippy::todo,
    clippy::unimplemented,
    clippy::unreachable
)]

mod attainable;
mod belief;
mod benchmark;
mod boom;
mod carried_load;
mod command_lag;
mod deviation;
mod deviation_memory;
mod filter;
mod flow_balance;
mod follower;
mod following_feedback;
mod foreseen;
mod framed;
mod learner;
mod likelihood;
mod load_balance;
mod model_following;
mod motion;
mod motor;
mod oil_spring;
mod oil_stiffness;
mod out_of_range;
mod out_of_reach;
mod path;
mod pushed;
mod reckoned;
mod reserve;
mod schedule;
mod shaper;
mod signals;
mod sooner;
mod station;
mod strategy;
mod stroke_by_pressure;
pub mod supervision;
mod way_back;

pub use benchmark::{Benchmark, BenchmarkMemory, Measured};
pub use boom::Boom;
pub use command_lag::{BelievedLag, CommandLag, CommandLagMemory};
pub use deviation::{DeviationDesign, DeviationFeedback, Watched};
pub use deviation_memory::DeviationMemory;
pub use filter::{HighPass, Notch, NotchMemory};
pub use flow_balance::{Balance, Believed, FlowBalance, FlowBalanceMemory, TRANSITIONS};
pub use follower::Follower;
pub use framed::{
    Alignment, FramedBenchmark, FramedBenchmarkState, FramedMemory, FramedSimulationFeedforward,
    FramedSimulationState, SimulatedCrane,
};
pub use learner::{Balances, Conditions, Known, Learned, Learner};
pub use load_balance::{BelievedLoad, LoadBalance, LoadBalanceMemory};
pub use model_following::{BENDING, FollowingMemory, ModelFollowing, STATIONS, Seen};
pub use motion::{Motion, Profile, Reference, Way};
pub use motor::MotorLimits;
pub use oil_spring::{Gains, OilSpring};
pub use oil_stiffness::OilStiffness;
pub use out_of_range::OutOfRange;
pub use out_of_reach::Led;
pub use path::Path;
pub use reckoned::{MayBe, Reckoned};
pub use reserve::Reserve;
pub use schedule::{PAYLOADS, Schedule};
pub use shaper::Shaped;
pub use signals::{Command, Reading};
pub use sooner::SoonerDesign;
pub use station::{Rest, Station};
pub use strategy::Strategy;
pub use stroke_by_pressure::StrokeByPressure;
pub use supervision::{Cause, Decision, Limits, Observation, Request, State, Supervisor};
pub use way_back::{Pace, WayBackDesign};
