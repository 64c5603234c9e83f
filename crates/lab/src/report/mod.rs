//! Self-contained HTML pages with tables and figures.

mod bars;
mod bode;
mod bounds;
mod design;
mod document;
mod drawing;
mod drawing_data;
mod estimation;
mod family;
mod figure;
mod origin;
mod page;
mod palette;
mod pareto;
mod tip;
mod tracking;
mod trials;
mod validation;

pub use bars::{Bar, Bars};
pub use bode::bode_page;
pub use bounds::bounds_page;
pub use design::design_page;
pub use document::{Page, document};
pub use drawing_data::{Drawing, FigureFile, figure};
pub use estimation::estimation_page;
pub use family::family_page;
pub use figure::{Axes, Figure, Series};
pub use origin::Origin;
pub use page::page;
pub use palette::{NEUTRAL, colour_of};
pub use tip::tip_page;
pub use tracking::{IDEAL_SENSORS, MotionTests, motion_page};
pub use trials::trials_page;
