//! Estimator of the tip's position for a crane.

use hydroboom_control::estimation::tip::{TipEstimator, TipModel, TipParameters};
use hydroboom_description::Description;
use hydroboom_description::schema::StructureChoice;

/// Estimator of the tip's position for the crane of a description, with parameters and spread of its section `tip`.
///
/// `None` for a boom of links, or if the cylinder's mount is not between bearing and tip.
pub fn tip_estimator(description: &Description) -> Option<TipEstimator<f64>> {
    let n = &description.numbers;
    let is_beam = description.choices.structure == StructureChoice::Beam;
    (is_beam && n.mount_x < n.boom_length).then(|| {
        let deviations = [n.tip_bending_deviation, n.tip_base_deviation, n.tip_offset_deviation];
        let (bb, bo, co) = (n.tip_bending_base, n.tip_bending_offset, n.tip_base_offset);
        let correlations = [[1.0, bb, bo], [bb, 1.0, co], [bo, co, 1.0]];
        TipEstimator {
            model: TipModel {
                mount_x: n.mount_x,
                mount_y: n.mount_y,
                base_x: n.base_x,
                base_y: n.base_y,
                shortest: n.shortest,
                length: n.boom_length,
                mass: n.boom_mass,
                flexural_rigidity: n.youngs_modulus * n.second_moment,
                payload_x: n.payload_x,
                payload_y: n.payload_y,
                gravity: n.gravity,
            },
            parameters: TipParameters {
                bending: n.tip_bending,
                base: n.tip_base,
                stroke_offset: n.tip_offset,
            },
            covariance: std::array::from_fn(|i| {
                std::array::from_fn(|j| correlations[i][j] * deviations[i] * deviations[j])
            }),
            remainder: n.tip_remainder,
            payload_memory: n.tip_payload_memory,
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reduced_model_fit::reduced_model;
    use crate::scheduled_lqr::state_estimator;
    use hydroboom_control::estimation::extended_kalman_filter::EstimatorInput;
    use hydroboom_control::estimation::tip::TipMemory;

    /// The mean of the payload restarts with a load change and with an invalid number. Its difference
    /// from the present payload widens the bounds.
    #[test]
    fn the_payload_of_the_tip_is_a_mean_since_the_last_load_change() {
        let description = Description::uia_single_boom().unwrap();
        let model = reduced_model(&description).unwrap();
        let filter = state_estimator(&description, &model, 1).filter;
        let tip = tip_estimator(&description).unwrap();
        let mut state = filter.start(&EstimatorInput {
            position: 0.25,
            position_is_good: 1.0,
            load_pressure: 60e5,
            load_pressure_is_good: 1.0,
            rod_side_term: 2e5,
            motor_speed: 0.0,
        });
        let mut memory = TipMemory::default();
        let mut go_on = |state: &_, periods: u32| {
            (0..periods).for_each(|_| tip.update(&mut memory, &filter, state));
            memory.payload
        };
        state.estimate.payload = 200.0;
        let payload = go_on(&state, 1000);
        assert!((payload - 200.0).abs() < 1e-9, "{payload} kg");
        // forty kilograms more for as long again: half of them
        state.estimate.payload = 240.0;
        let payload = go_on(&state, 1000);
        assert!((payload - 220.0).abs() < 2.0, "{payload} kg");
        // its numbers assumed exact, so that only the filter's errors remain
        let exact = TipEstimator { covariance: [[0.0; 3]; 3], ..tip };
        let deviation = |payload: f64| {
            let memory = TipMemory { payload, weight: 1.0 };
            exact.estimate(&memory, &model, &state).deviation_y
        };
        let [at_the_mean, off] = [240.0, 220.0].map(deviation);
        assert!(off > at_the_mean + 1e-5, "{off} and {at_the_mean} m");
        state.mean_nis = 100.0;
        assert_eq!(go_on(&state, 1), 240.0);
        state.mean_nis = 1.0;
        let good = state.estimate.payload;
        state.estimate.payload = f64::NAN;
        go_on(&state, 10);
        state.estimate.payload = good;
        assert_eq!(go_on(&state, 1), good);
    }
}
