//! Closed-loop tests of exported controllers on the virtual crane: engagement, hold, release and wrong inputs. The true
//! motion of the simulated machine is compared with computed bounds.

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
