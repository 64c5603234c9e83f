//! One machine, one motion, and the outputs that are looked at, over any number.

use crate::closed_loop::{follow, motor_speeds};
use crate::error::SensitivityError;
use crate::output::Output;
use crate::ringing::eigenfrequency;
use hydroboom_control::reference::profile::OutAndBack;
use hydroboom_control::strategy::Strategy;
use hydroboom_description::Description;
use hydroboom_description::schema::Numbers;
use hydroboom_identify::Number;

/// Segments of the published model.
pub(crate) const SEGMENTS: usize = 3;

/// What is looked at: a machine as described, a motion, and outputs.
#[derive(Clone, Debug)]
pub struct Case {
    /// The machine as described: what its controllers know, and what varies.
    pub description: Description,
    /// The motion.
    pub motion: OutAndBack<f64>,
    /// The outputs.
    pub outputs: Vec<Output>,
    /// What the simulation beside the machine drives the motor with; none where no strategy asks for it.
    simulated: Option<Vec<f64>>,
}

impl Case {
    /// A machine along its motion at a speed \[m/s\].
    ///
    /// # Errors
    ///
    /// [`SensitivityError`] when there is no such model, or the simulation beside the machine cannot follow.
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

    /// The outputs of a machine with these parameters, in the case's order and in SI units.
    ///
    /// # Errors
    ///
    /// [`SensitivityError`] when there is no such machine, or it cannot follow.
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

    fn run<T: Number>(
        &self,
        numbers: &Numbers<T>,
        strategy: Strategy,
    ) -> Result<[T; 2], SensitivityError> {
        let simulated = self.simulated.as_deref().filter(|_| strategy.simulates());
        follow(&self.description, numbers, &self.motion, strategy, simulated)
    }
}
