//! The crane linearised as it is once the pump lifts: Coulomb friction, which at rest damps out every oscillation, is a constant, and the
//! load-holding valves, which are shut at rest, are open.

use crate::DesignError;
use crate::linear::{Mode, modes, transfer};
use hydroboom_description::Description;
use hydroboom_description::schema::FrictionChoice;
use hydroboom_model::{Input, Outputs, Scheme};
use hydroboom_plant::plant;
use nalgebra::{Complex, DMatrix};
use std::f64::consts::TAU;

/// A mode of boom and oil lies between these \[Hz\].
const LOAD_MODE: [f64; 2] = [0.2, 25.0];

/// A crane at rest at a piston position, linearised.
pub struct LinearisedPlant {
    /// Piston position \[m\].
    pub stroke: f64,
    /// State matrix.
    pub a: DMatrix<f64>,
    /// Input matrix: motor speed \[rev/s\].
    pub b: DMatrix<f64>,
    /// Rows of position, velocity and load pressure.
    pub outputs: [Vec<f64>; 3],
    /// All modes, slowest first.
    pub modes: Vec<Mode>,
}

/// Responses of position, velocity and load pressure to the motor's speed.
#[derive(Clone, Copy, Debug)]
pub struct Responses {
    /// Of the position \[m s/rev\].
    pub position: Complex<f64>,
    /// Of the velocity.
    pub velocity: Complex<f64>,
    /// Of the load pressure \[Pa s/rev\].
    pub pressure: Complex<f64>,
}

impl LinearisedPlant {
    /// The crane of a description at a piston position \[m\].
    ///
    /// # Errors
    ///
    /// [`DesignError`] when the crane cannot rest there, or its modes cannot be computed.
    pub fn new(description: &Description, stroke: f64) -> Result<Self, DesignError> {
        let mut sliding = description.clone();
        let n = &mut sliding.numbers;
        (n.coulomb, n.stiction) = (1e-6 * n.coulomb, 1e-6 * n.stiction);
        (n.holding_cracking, n.holding_opening) = (-2.0 * n.holding_opening, -n.holding_opening);
        // open valves leave no difference of pressure between pump and cylinder
        n.preload = 1.0;
        // bristles that slide are neither a spring nor a damper
        sliding.choices.friction = FrictionChoice::Stribeck;
        let crane = plant(&sliding, &sliding.start(stroke), Scheme::Implicit, 1e-3)?;
        let (a, b) = crane.jacobian(&Input { pump_speed: 0.0, holding_valve: 1.0 });
        let c = crane.output_jacobian();
        let row = |name: &str| -> Vec<f64> {
            let k = Outputs::NAMES.iter().position(|n| *n == name).unwrap_or_default();
            c.row(k).iter().copied().collect()
        };
        let ratio = crane.rod_side_ratio();
        let (in_a, in_b) = (row("pressure_a"), row("pressure_b"));
        let load = in_a.iter().zip(&in_b).map(|(a, b)| a - ratio * b).collect();
        let modes = modes(&a)?;
        Ok(Self { stroke, a, b, outputs: [row("stroke"), row("velocity"), load], modes })
    }

    /// The mode in which boom and load ring on the oil.
    ///
    /// # Errors
    ///
    /// [`DesignError::NoMode`] when there is none.
    pub fn load_mode(&self) -> Result<&Mode, DesignError> {
        let is_load_mode = |mode: &&Mode| {
            mode.damping_ratio < 0.9 && (LOAD_MODE[0]..LOAD_MODE[1]).contains(&mode.frequency_hz)
        };
        self.modes.iter().find(is_load_mode).ok_or_else(|| self.none("none between 0.2 and 25 Hz"))
    }

    /// Responses at a frequency \[Hz\].
    ///
    /// # Errors
    ///
    /// [`DesignError::NoMode`] where they are not finite.
    pub fn responses(&self, frequency: f64) -> Result<Responses, DesignError> {
        self.responses_at(Complex::new(0.0, TAU * frequency))
    }

    /// Responses to a motor speed that rings and grows as e to the s t, s in \[1/s\].
    ///
    /// # Errors
    ///
    /// [`DesignError::NoMode`] where they are not finite.
    pub(crate) fn responses_at(&self, s: Complex<f64>) -> Result<Responses, DesignError> {
        let of = |row: &[f64]| {
            transfer(&self.a, &self.b, row, s)
                .ok_or_else(|| self.none("its responses are not finite"))
        };
        let position = of(&self.outputs[0])?;
        Ok(Responses { position, velocity: s * position, pressure: of(&self.outputs[2])? })
    }

    /// There is no such mode, and why.
    pub(crate) fn none(&self, reason: &str) -> DesignError {
        DesignError::NoMode { stroke_mm: self.stroke * 1e3, reason: reason.into() }
    }
}
