//! A simulated crane of any number of segments, behind one interface: [`plant`] builds it from a
//! [`Description`](hydroboom_description::Description), [`Plant`] moves it and looks into it.

mod plant;
mod side_by_side;

pub use plant::{Plant, PlantError, flatten, plant, unflatten};
pub use side_by_side::SideBySide;
