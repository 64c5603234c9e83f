//! Calibration of the virtual crane to the published measurements of the real one: the measurements, the
//! unknown parameters with their ranges, and the search.

mod crane_file;
mod journal;
mod parameter;
mod published;
mod search;
mod trade_off;

pub use crane_file::{Calibrated, Reached};
pub use journal::Journal;
pub use parameter::{PARAMETERS, Parameter, crane_at, shares_of};
pub use published::{Published, RESULTS, Tests, differences, published, shown, table_6, tests};
pub use search::{Effort, Found, Progress, search};
pub use trade_off::trade_off;
