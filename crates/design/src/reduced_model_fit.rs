//! Fit of the reduced model: statics and linearised crane over stroke and payload, as polynomials.

use crate::DesignError;
use crate::operating_points::{OperatingPoints, POINTS};
use hydroboom_control::estimation::reduced_model::{COEFFICIENTS, Polynomial, ReducedModel};
use hydroboom_description::Description;
use hydroboom_model::hydraulics::Oil;
use nalgebra::{DMatrix, DVector};

/// Payloads at which the crane is linearised, as shares of the heaviest.
const SHARES: [f64; 6] = [0.0, 0.1, 0.25, 0.45, 0.7, 1.0];
/// Heaviest payload that is thought of, over the largest of the crane file's range.
const OVERLOAD: f64 = 1.25;

/// An operating point.
struct Sample {
    /// Place over the stroke, −1 to 1, and payload \[kg\].
    place: f64,
    payload: f64,
    holding_pressure: f64,
    equivalent_mass: f64,
    compliance: f64,
}

/// Fits the reduced model to the crane of a description.
///
/// Oil, cylinder, pump and friction are the crane file's. Equivalent mass and boom compliance match the responses of
/// the crane's exact linearisation at 17 positions and six payloads. They and the holding pressure become polynomials
/// of the position, linear or quadratic in the payload.
///
/// # Errors
///
/// [`DesignError::NoFit`] if the polynomials cannot be fitted. Any other [`DesignError`] if the crane cannot rest or
/// be linearised at one of the positions and payloads, or does not oscillate on its oil there.
pub fn reduced_model(description: &Description) -> Result<ReducedModel<f64>, DesignError> {
    let n = &description.numbers;
    let range = description.range("payload.mass_kg").map_or(n.payload, |range| range.high);
    let maximum_payload = OVERLOAD * range.max(n.payload).max(1.0);
    let half = 0.5 * n.stroke;
    let mut samples = Vec::with_capacity(SHARES.len() * POINTS);
    let mut leakage = 0.0;
    for share in SHARES {
        let mut loaded = description.clone();
        loaded.numbers.payload = share * maximum_payload;
        let all = OperatingPoints::new(&loaded)?;
        for (k, point) in all.points.iter().enumerate() {
            let equilibrium = &point.equilibrium;
            samples.push(Sample {
                place: (all.position(k) - half) / half,
                payload: share * maximum_payload,
                holding_pressure: equilibrium.load_pressure,
                equivalent_mass: 1.0 / point.load.acceleration_by_pressure,
                compliance: point.load.compliance,
            });
            // of the heaviest, last
            leakage = equilibrium.holding_speed / equilibrium.load_pressure.max(1.0).sqrt();
        }
    }
    let holding_pressure = fit(&samples, |s| (s.holding_pressure, 1e6))?;
    let equivalent_mass = fit(&samples, |s| (s.equivalent_mass, s.equivalent_mass))?;
    let compliance = fit(&samples, |s| {
        let value = s.compliance * s.equivalent_mass * s.equivalent_mass;
        (value, value.max(1e-12))
    })?;
    let cylinder = description.cylinder();
    let area = cylinder.piston_area;
    Ok(ReducedModel {
        half_stroke: half,
        holding_pressure,
        equivalent_mass,
        compliance,
        viscous: n.viscous / area,
        coulomb: n.coulomb / area,
        presliding_stiffness: n.bristle_stiffness / area,
        sliding_velocity: 1.0 / n.steepness,
        oil: Oil {
            bulk_modulus_max: n.bulk_modulus_max,
            bulk_modulus_min: n.bulk_modulus_min,
            transition_pressure: n.transition,
            transition_slope: 1.0 / n.transition_width,
            vapour_pressure: n.vapour_pressure,
        },
        volume: n.dead_volume_a + n.volume_pump_a,
        piston_area: area,
        displacement: n.displacement * n.flow_gain,
        leakage,
        disturbance_time: n.tuning.estimator_disturbance_time,
        maximum_payload,
    })
}

/// Polynomials that sum up to a quantity, times powers of the payload, by least squares; `of` is its value and what
/// counts as much as one.
fn fit<const POWERS: usize>(
    samples: &[Sample],
    of: impl Fn(&Sample) -> (f64, f64),
) -> Result<[Polynomial<f64>; POWERS], DesignError> {
    // payload over the heaviest, so that columns have similar scales
    let maximum_payload = samples.iter().map(|s| s.payload).fold(1.0, f64::max);
    let mut rows = DMatrix::zeros(samples.len(), POWERS * COEFFICIENTS);
    let mut values = DVector::zeros(samples.len());
    for (k, sample) in samples.iter().enumerate() {
        let (value, scale) = of(sample);
        values[k] = value / scale;
        for power in 0..POWERS {
            for degree in 0..COEFFICIENTS {
                let column = power * COEFFICIENTS + degree;
                let load = (sample.payload / maximum_payload).powi(power as i32);
                rows[(k, column)] = load * sample.place.powi(degree as i32) / scale;
            }
        }
    }
    // columns to unit length, since values may be of any size
    let lengths: Vec<f64> = rows.column_iter().map(|c| c.norm().max(f64::MIN_POSITIVE)).collect();
    for (mut column, length) in rows.column_iter_mut().zip(&lengths) {
        column /= *length;
    }
    let found = rows
        .svd(true, true)
        .solve(&values, 1e-12)
        .map_err(|reason| DesignError::NoFit(reason.into()))?;
    Ok(std::array::from_fn(|power| {
        std::array::from_fn(|degree| {
            let column = power * COEFFICIENTS + degree;
            found[column] / lengths[column] / maximum_payload.powi(power as i32)
        })
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The polynomials are compared with every operating point from which they were fitted.
    #[test]
    fn the_reduced_model_is_the_crane_at_its_operating_points() {
        let description = Description::uia_single_boom().unwrap();
        let model = reduced_model(&description).unwrap();
        for payload in [20.0, 150.0, 307.0, 400.0] {
            let mut loaded = description.clone();
            loaded.numbers.payload = payload;
            let all = OperatingPoints::new(&loaded).unwrap();
            for (k, point) in all.points.iter().enumerate() {
                let position = all.position(k);
                let at = model.at(position, payload);
                let (rest, load) = (point.equilibrium, point.load);
                let alike = |found: f64, wanted: f64, tolerance: f64| {
                    let off = f64::abs(found / wanted - 1.0);
                    assert!(off < tolerance, "{payload} kg, {position} m: {found} for {wanted}");
                };
                let off = f64::abs(at.holding_pressure - rest.load_pressure);
                assert!(off < 0.02e5, "{payload} kg, {position} m: {off} Pa");
                alike(at.holding_slope, rest.load_pressure_slope, 0.05);
                alike(at.acceleration, load.acceleration_by_pressure, 2e-3);
                alike(at.compliance, load.compliance, 0.03);
                // pressure by travel and by pumping, where the oil is stiff
                let oil = model.oil.bulk_modulus_max / at.volume;
                alike(-model.piston_area * oil, point.stiff.pressure_by_velocity, 0.04);
                alike(model.displacement * oil, point.stiff.pressure_by_speed, 0.06);
                // leakage within 0.01 mm/s of travel
                let off = model.leakage(rest.load_pressure) - rest.holding_speed;
                assert!(off.abs() < 1e-5 * model.revolutions_per_metre(), "{off} rev/s");
            }
        }
    }
}
