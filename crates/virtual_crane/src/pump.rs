//! Pump effects beyond the model: flow ripple and torque losses.

use std::f64::consts::TAU;

/// Torque and ripple of the pump at its shaft.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PumpShaft {
    /// Displacement \[m³/rev\].
    pub displacement: f64,
    /// Number of pistons.
    pub pistons: f64,
    /// Amplitude of the flow ripple, as a share of the flow.
    pub ripple: f64,
    /// Torque loss independent of speed \[N·m\].
    pub loss: f64,
    /// Torque loss as a share of the hydraulic torque.
    pub loss_share: f64,
    /// Torque loss by viscous drag \[N·m per rev/s\].
    pub loss_speed: f64,
}

impl PumpShaft {
    /// Instantaneous flow over mean flow at a shaft angle \[rev\]. The ripple arises as each piston's oil is
    /// compressed to the outlet pressure.
    pub(crate) fn delivery(&self, angle: f64) -> f64 {
        1.0 + self.ripple * (TAU * self.pistons * angle).cos()
    }

    /// Torque \[N·m\] at the pump's shaft at a pressure difference p_PA − p_PB \[Pa\] and speed \[rev/s\]. Losses
    /// oppose the motion in motoring and pumping operation.
    pub(crate) fn torque(&self, difference: f64, speed: f64) -> f64 {
        let hydraulic = self.displacement * difference / TAU;
        // smooths the sign of Coulomb friction over ±0.1 rev/s
        let direction = (10.0 * speed).clamp(-1.0, 1.0);
        hydraulic
            + direction * (self.loss + self.loss_share * hydraulic.abs())
            + self.loss_speed * speed
    }

    /// Power \[W\] of the torque losses at the same conditions.
    pub(crate) fn heat(&self, difference: f64, speed: f64) -> f64 {
        let hydraulic = self.displacement * difference / TAU;
        (self.torque(difference, speed) - hydraulic) * speed * TAU
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SHAFT: PumpShaft = PumpShaft {
        displacement: 10.6e-6,
        pistons: 9.0,
        ripple: 0.02,
        loss: 0.5,
        loss_share: 0.05,
        loss_speed: 0.02,
    };

    #[test]
    fn ripple_keeps_the_mean_flow_and_has_one_peak_per_piston() {
        let flows: Vec<f64> = (0..3600).map(|k| SHAFT.delivery(f64::from(k) / 3600.0)).collect();
        let mean = flows.iter().sum::<f64>() / 3600.0;
        assert!((mean - 1.0).abs() < 1e-12, "{mean}");
        let peaks = (0..3600).filter(|k| {
            let (before, after) = (flows[(k + 3599) % 3600], flows[(k + 1) % 3600]);
            flows[*k] > before && flows[*k] >= after
        });
        assert_eq!(peaks.count(), 9);
    }

    #[test]
    fn torque_losses_heat_in_every_quadrant() {
        for difference in [-80e5, 80e5] {
            for speed in [-40.0, -0.01, 0.01, 40.0] {
                assert!(SHAFT.heat(difference, speed) > 0.0, "{difference} Pa, {speed} rev/s");
            }
        }
    }
}
