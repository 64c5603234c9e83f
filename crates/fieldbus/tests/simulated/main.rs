//! The bus against simulated devices, in one thread and in simulated time.

mod bench;
mod crane;
mod faults;
mod operation;
mod start_up;
