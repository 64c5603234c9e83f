//! Noise of the sensors: white noise and resolution of position and load pressure from their data sheets.

use hydroboom_description::Description;

/// Standard deviations of the measurements.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct SensorNoise {
    /// Standard deviation of the piston position \[m\].
    pub position: f64,
    /// Standard deviation of the load pressure p_A − (A_r/A_p) p_B \[Pa\].
    pub load_pressure: f64,
}

/// Nearly exact sensors, so that no covariance becomes singular.
pub(super) const EXACT: SensorNoise = SensorNoise { position: 1e-12, load_pressure: 1e-3 };

impl SensorNoise {
    /// Sensor noise of a crane file. The resolution counts as uniform noise within one step.
    pub fn of(crane: &Description) -> Self {
        let n = &crane.numbers;
        let uniform = |step: f64| step / 12_f64.sqrt();
        let steps = match n.pressure_bits >= 1.0 {
            true => n.pressure_span / n.pressure_bits.exp2(),
            false => 0.0,
        };
        let pressure = (n.pressure_noise * n.pressure_span).hypot(uniform(steps));
        Self {
            position: n.position_noise.hypot(uniform(n.position_resolution)).max(EXACT.position),
            // combined noise of two transducers
            load_pressure: (pressure * 1.0_f64.hypot(crane.cylinder().area_ratio()))
                .max(EXACT.load_pressure),
        }
    }

    /// Variances of piston position \[m²\] and load pressure \[Pa²\].
    pub fn variances(&self) -> [f64; 2] {
        [self.position, self.load_pressure].map(|deviation| deviation * deviation)
    }
}
