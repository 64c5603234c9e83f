//! Inputs of the crane in the tests.

use hydroboom_model::Input;

/// Motor speed and valve of an extension, a dwell with the valve closed, and a retraction faster than the oil can
/// follow. Check valves, the holding valve and the cavities pass their switching points.
pub fn inputs(steps: usize) -> Vec<Input<f64>> {
    let of = |k: usize| {
        let t = k as f64 / steps as f64;
        let pump_speed = match t {
            t if t < 0.1 => 0.0,
            t if t < 0.3 => 40.0 * (t - 0.1) / 0.2,
            t if t < 0.5 => 40.0,
            t if t < 0.6 => 0.0,
            t => -45.0 * ((t - 0.6) / 0.1).min(1.0),
        };
        Input { pump_speed, holding_valve: if (0.5..0.6).contains(&t) { 0.0 } else { 1.0 } }
    };
    (0..steps).map(of).collect()
}
