//! A simulated crane of any number of segments, behind one interface: [`plant`] builds it from a
//! [`Description`](hydroboom_description::Description), [`Plant`] moves it and looks into it.

mod plant;

pub use plant::{Plant, PlantError, flatten, plant, unflatten};
