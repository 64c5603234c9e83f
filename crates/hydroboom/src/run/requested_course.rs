//! Course that a run is asked for: the crane's motion at a speed, or a scenario.

use crate::machine_choice::MachineChoice;
use hydroboom_control::reference::trajectory::Trajectory;
use hydroboom_dashboard as dashboard;
use hydroboom_lab::closed_loop::scenario::CourseChoice;
use hydroboom_realtime::session::PayloadChange;
use miette::{IntoDiagnostic, Result};
use std::ops::RangeInclusive;
use std::sync::Arc;

/// Requested course with its name and payload changes.
#[derive(Clone)]
pub struct RequestedCourse {
    /// Name of the course: the motion with its speed, or a scenario.
    pub name: String,
    /// Trajectory of the piston, the reference of position and speed over time.
    pub path: Arc<dyn Trajectory>,
    /// Payload changes: time of the course \[s\], and payload from then on \[kg\].
    pub payload_changes: Vec<PayloadChange>,
}

/// Constructor of the course that is requested at the dashboard. It fails for an unknown scenario, and for a speed
/// outside [`speeds_mm_s`].
pub type CourseConstructor = Box<dyn Fn(&dashboard::Course) -> Result<RequestedCourse>>;

impl RequestedCourse {
    /// A scenario of that name, otherwise the motion at a speed \[mm/s\], by default the model's fast one.
    ///
    /// # Errors
    ///
    /// If the speed is outside [`speeds_mm_s`], or there is no such scenario.
    pub fn new(
        cranes: &MachineChoice,
        speed_mm_s: Option<f64>,
        scenario: Option<&str>,
    ) -> Result<Self> {
        let speed = speed_mm_s.map_or(cranes.model.numbers.fast, |mm_s| mm_s * 1e-3);
        let speeds = speeds_mm_s(cranes);
        if speed_mm_s.is_some_and(|mm_s| !speeds.contains(&mm_s)) {
            miette::bail!(
                "a speed of {:.3} mm/s: it is {:.1} to {:.0} mm/s",
                speed * 1e3,
                speeds.start(),
                speeds.end()
            );
        }
        let choice = match scenario {
            Some(name) => CourseChoice::Scenario(name.into()),
            None => CourseChoice::Motion(speed),
        };
        let course = choice.of(&cranes.machine).into_diagnostic()?;
        let payload_changes = course.loads().iter().map(|load| (load.time, load.mass)).collect();
        Ok(Self {
            name: course.name(),
            path: Arc::from(course as Box<dyn Trajectory>),
            payload_changes,
        })
    }

    /// Constructor of the courses of a model and a machine.
    pub fn constructor(cranes: &MachineChoice) -> CourseConstructor {
        let cranes = cranes.clone();
        Box::new(move |course| match course {
            dashboard::Course::Motion { speed_mm_s } => Self::new(&cranes, Some(*speed_mm_s), None),
            dashboard::Course::Scenario { name } => Self::new(&cranes, None, Some(name)),
        })
    }

    /// Smallest and largest payload \[kg\]: of the model, of the machine, and of the payload changes.
    pub fn payload_range(&self, cranes: &MachineChoice) -> [f64; 2] {
        let payload_changes = self.payload_changes.iter().map(|(_, mass)| *mass);
        let payloads = [&cranes.model, &cranes.machine].map(|crane| crane.numbers.payload);
        let (low, high) = payload_changes
            .chain(payloads)
            .fold((f64::INFINITY, 0.0), |(low, high), kg| (f64::min(low, kg), f64::max(high, kg)));
        [low, high]
    }
}

/// Range of the motion's speed \[mm/s\]: up to twice the model's fast speed.
pub fn speeds_mm_s(cranes: &MachineChoice) -> RangeInclusive<f64> {
    0.1..=2e3 * cranes.model.numbers.fast
}
