//! One machine, one motion and the outputs under study, generic over the number type.

use crate::closed_loop::{follow, motor_speeds};
use crate::error::SensitivityError;
use crate::output::Output;
use crate::ringing::{conditions, eigenfrequency};
use hydroboom_control::reference::profile::OutAndBack;
use hydroboom_control::strategy::Strategy;
use hydroboom_description::Description;
use hydroboom_description::schema::Numbers;
use hydroboom_identify::Number;

/// Number of segments of the published model.
pub(crate) const SEGMENTS: usize = 3;

/// Subject of a sensitivity study: a crane, its reference motion and the scalar outputs. The crane's parameters vary,
/// those of its controllers stay nominal. Only models of three coordinates (segments) are supported.
#[derive(Clone, Debug)]
pub struct Case {
    /// Nominal description: it varies in the machine and stays fixed in the controllers.
    pub description: Description,
    /// Reference motion of the piston, out and back.
    pub motion: OutAndBack<f64>,
    /// Outputs; every result lists them in this order.
    pub outputs: Vec<Output>,
    /// Motor speeds of the simulation that runs beside the machine \[rev/s\]; `None` where no strategy uses them.
    simulated: Option<Vec<f64>>,
}

impl Case {
    /// Case of a crane on its reference motion with a piston speed \[m/s\]; the speed must be positive and within the
    /// motion's limits.
    ///
    /// # Errors
    ///
    /// [`SensitivityError::Segments`] if the model does not have three coordinates. [`SensitivityError::Build`] if it
    /// cannot be built, [`SensitivityError::Broken`] if its simulation fails.
    pub fn new(
        description: &Description,
        speed: f64,
        outputs: &[Output],
    ) -> Result<Self, SensitivityError> {
        let found = description.coordinates();
        if found != SEGMENTS {
            return Err(SensitivityError::Segments { found });
        }
        let motion = description.motion(speed);
        let simulates = outputs.iter().any(|output| match output {
            Output::Tracking(strategy) | Output::Pressure(strategy) => strategy.simulates(),
            Output::Eigenfrequency => false,
        });
        let simulated = if simulates { Some(motor_speeds(description, &motion)?) } else { None };
        Ok(Self { description: description.clone(), motion, outputs: outputs.to_vec(), simulated })
    }

    /// Outputs of a crane with these parameters, in the case's order and in SI units: m, Pa and Hz.
    ///
    /// # Errors
    ///
    /// [`SensitivityError::Build`] if the model cannot be built, [`SensitivityError::Broken`] if a simulation fails,
    /// and [`SensitivityError::Silent`] if the locked crane shows no oscillation.
    pub fn evaluate<T: Number>(&self, numbers: &Numbers<T>) -> Result<Vec<T>, SensitivityError> {
        let mut runs: Vec<(Strategy, [T; 2])> = Vec::new();
        let mut values = Vec::with_capacity(self.outputs.len());
        for output in &self.outputs {
            values.push(match *output {
                Output::Tracking(strategy) | Output::Pressure(strategy) => {
                    let done = runs.iter().find(|(of, _)| *of == strategy).map(|(_, v)| *v);
                    let run = match done {
                        Some(run) => run,
                        None => {
                            let run = self.run(numbers, strategy)?;
                            runs.push((strategy, run));
                            run
                        }
                    };
                    run[usize::from(matches!(output, Output::Pressure(_)))]
                }
                Output::Eigenfrequency => eigenfrequency(&self.description, numbers)?,
            });
        }
        Ok(values)
    }

    /// Conditions of an output in words, beyond its title; none for tracking errors and pressures.
    pub fn conditions(&self, output: Output) -> Option<String> {
        match output {
            Output::Tracking(_) | Output::Pressure(_) => None,
            Output::Eigenfrequency => Some(conditions(&self.description)),
        }
    }

    fn run<T: Number>(
        &self,
        numbers: &Numbers<T>,
        strategy: Strategy,
    ) -> Result<[T; 2], SensitivityError> {
        let simulated = self.simulated.as_deref().filter(|_| strategy.simulates());
        follow(&self.description, numbers, &self.motion, strategy, simulated)
    }
}
