//! One self-contained HTML page with the study's tables and figures.

mod drawing;
mod figure;
mod page;

pub use page::page;
