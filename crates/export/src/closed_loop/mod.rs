//! Exported controllers in closed loop with the virtual crane: engaged anywhere, held and released, with
//! inputs that are wrong, judged on the simulated machine against computed bounds.

mod bounds;
mod case;
mod program;
mod table;
mod target;
mod trial;

pub use bounds::{Bounds, bounds};
pub use case::{Bad, Case, Disturbed, Moment, cases, moves};
pub use program::{Compiled, Program};
pub use table::{HEADER, Row, csv, status_name};
pub use target::{
    Recorder, RustBenchmark, RustScheduledLqr, RustSimulationFeedforward, Target, TargetError,
};
pub use trial::{Outcome, TrialError, run};
