//! Linearised plant: the crane at an operating point with the pump lifting.
//!
//! Coulomb friction, which at rest damps out every oscillation, is a constant. The load-holding valves, which are
//! shut at rest, are open. The accumulator's pressure is constant.

use crate::DesignError;
use crate::frequency_response::FrequencyResponse;
use crate::hydraulic_spring_fit::{hydraulic_spring, is_near};
use crate::linear::{Mode, modes};
use hydroboom_description::schema::FrictionChoice;
use hydroboom_description::{Description, millimetres};
use hydroboom_model::{Input, Outputs, Scheme};
use hydroboom_plant::plant;
use nalgebra::{Complex, DMatrix};
use std::f64::consts::TAU;

/// A mode of boom and oil lies between these \[Hz\].
const LOAD_MODE: [f64; 2] = [0.2, 25.0];

/// Volume of the accumulator over its own, so that its pressure stands.
const STANDING: f64 = 1e4;

/// Linearised crane ẋ = A x + B u, at rest at a piston position.
pub struct LinearisedPlant {
    /// Piston position \[m\].
    pub stroke: f64,
    /// State matrix A, in SI units.
    pub a: DMatrix<f64>,
    /// Input matrix B of the motor speed \[rev/s\].
    pub b: DMatrix<f64>,
    /// Rows of the output matrix C: position \[m\], velocity \[m/s\], load pressure \[Pa\].
    pub outputs: [Vec<f64>; 3],
    /// All modes, slowest first.
    pub modes: Vec<Mode>,
    response: FrequencyResponse,
}

/// Frequency responses of position, velocity and load pressure to the motor speed.
#[derive(Clone, Copy, Debug)]
pub struct Responses {
    /// Response of the position \[m s/rev\].
    pub position: Complex<f64>,
    /// Response of the velocity \[m/rev\].
    pub velocity: Complex<f64>,
    /// Response of the load pressure \[Pa s/rev\].
    pub pressure: Complex<f64>,
}

impl LinearisedPlant {
    /// Linearises the crane of a description at a piston position \[m\].
    ///
    /// # Errors
    ///
    /// [`DesignError::Plant`] if the crane cannot rest there, [`DesignError::Eigenvalues`] if its modes cannot be
    /// computed, [`DesignError::NoMode`] if it lacks one of the outputs.
    pub fn new(description: &Description, stroke: f64) -> Result<Self, DesignError> {
        let mut sliding = description.clone();
        let n = &mut sliding.numbers;
        (n.coulomb, n.stiction) = (1e-6 * n.coulomb, 1e-6 * n.stiction);
        (n.holding_cracking, n.holding_opening) = (-2.0 * n.holding_opening, -n.holding_opening);
        // open valves leave no difference of pressure between pump and cylinder
        n.preload = 1.0;
        // leakage fills the accumulator: about no state of rest, a linearisation would take its pressure's rise for
        // growth of a pole
        n.accumulator_volume *= STANDING;
        // bristles that slide are neither a spring nor a damper
        sliding.choices.friction = FrictionChoice::Stribeck;
        let crane = plant(&sliding, &sliding.start(stroke), Scheme::Implicit, 1e-3)?;
        let (a, b) = crane.jacobian(&Input { pump_speed: 0.0, holding_valve: 1.0 });
        let c = crane.output_jacobian();
        let row = |name: &str| -> Result<Vec<f64>, DesignError> {
            let k = Outputs::NAMES.iter().position(|n| *n == name);
            let none = || DesignError::NoMode {
                stroke_mm: millimetres(stroke),
                reason: format!("the model has no output {name}"),
            };
            Ok(c.row(k.ok_or_else(none)?).iter().copied().collect())
        };
        let ratio = crane.rod_side_ratio();
        let (in_a, in_b) = (row("pressure_a")?, row("pressure_b")?);
        let load = in_a.iter().zip(&in_b).map(|(a, b)| a - ratio * b).collect();
        Self::of(stroke, a, b, [row("stroke")?, row("velocity")?, load])
    }

    /// Of its matrices.
    pub(crate) fn of(
        stroke: f64,
        a: DMatrix<f64>,
        b: DMatrix<f64>,
        outputs: [Vec<f64>; 3],
    ) -> Result<Self, DesignError> {
        let (modes, response) = (modes(&a)?, FrequencyResponse::new(&a, &b, &outputs));
        Ok(Self { stroke, a, b, outputs, modes, response })
    }

    /// Mode of boom and load on the oil's spring: the slowest oscillation, if its frequency is near that of the
    /// fitted mass on a hydraulic spring.
    ///
    /// A slower mode is overdamped by soft oil; the slowest oscillation is then the boom's own.
    ///
    /// # Errors
    ///
    /// [`DesignError::NoMode`] if there is no such mode, or if no mass on a hydraulic spring fits.
    pub fn load_mode(&self) -> Result<&Mode, DesignError> {
        let (spring, load) = hydraulic_spring(self)?;
        let natural = load.natural_frequency(&spring) / TAU;
        let slowest = self.slowest_mode().filter(|mode| is_near(natural, mode.frequency_hz));
        slowest.ok_or_else(|| self.none("its load mode is overdamped"))
    }

    /// The slowest oscillation where one of boom and oil may lie.
    pub(crate) fn slowest_mode(&self) -> Option<&Mode> {
        let is_load_mode = |mode: &&Mode| {
            mode.damping_ratio < 0.9 && (LOAD_MODE[0]..LOAD_MODE[1]).contains(&mode.frequency_hz)
        };
        self.modes.iter().find(is_load_mode)
    }

    /// Natural frequency of boom and load on the oil \[Hz\]: that of the load mode, or of the fitted mass on a
    /// hydraulic spring if that mode is overdamped.
    ///
    /// # Errors
    ///
    /// As [`hydraulic_spring`].
    pub fn load_frequency(&self) -> Result<f64, DesignError> {
        match self.load_mode() {
            Ok(mode) => Ok(mode.frequency_hz),
            Err(_) => {
                let (spring, load) = hydraulic_spring(self)?;
                Ok(load.natural_frequency(&spring) / TAU)
            }
        }
    }

    /// Frequency responses at a frequency \[Hz\].
    ///
    /// # Errors
    ///
    /// [`DesignError::NoMode`] if they are not finite.
    pub fn responses(&self, frequency: f64) -> Result<Responses, DesignError> {
        self.responses_at(Complex::new(0.0, TAU * frequency))
    }

    /// Responses to a motor speed e^(s t), s in \[1/s\].
    ///
    /// # Errors
    ///
    /// [`DesignError::NoMode`] where they are not finite.
    pub(crate) fn responses_at(&self, s: Complex<f64>) -> Result<Responses, DesignError> {
        let all = self.response.at(s, &[Complex::from(1.0)]);
        let Some(&[position, _, pressure]) = all.as_deref() else {
            return Err(self.none("its responses are not finite"));
        };
        Ok(Responses { position, velocity: s * position, pressure })
    }

    /// Poles that grow faster than a rate \[1/s\].
    pub(crate) fn growing_poles(&self, growth: f64) -> u32 {
        let poles = |mode: &Mode| if mode.imaginary > 0.0 { 2 } else { 1 };
        self.modes.iter().filter(|mode| mode.real > growth).map(poles).sum()
    }

    /// There is no such mode, and why.
    pub(crate) fn none(&self, reason: &str) -> DesignError {
        DesignError::NoMode { stroke_mm: millimetres(self.stroke), reason: reason.into() }
    }
}
