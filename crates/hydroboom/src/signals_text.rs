//! The signals of an axis as a line of text.

use hydroboom_control::measurement::AxisSignals;

/// Piston position, pressures and motor speed in the units of gauges; a signal that is not a number is shown as such.
pub fn signals_text(signals: &AxisSignals<f64>) -> String {
    let bar = 1e-5;
    format!(
        "stroke {:.2} mm, p_PA {:.1}, p_A {:.1}, p_B {:.1}, p_PB {:.1}, p_acc {:.1} bar, motor {:.1} rpm",
        1e3 * signals.stroke,
        bar * signals.pressure_pump_a,
        bar * signals.pressure_a,
        bar * signals.pressure_b,
        bar * signals.pressure_pump_b,
        bar * signals.pressure_accumulator,
        60.0 * signals.motor_speed
    )
}
